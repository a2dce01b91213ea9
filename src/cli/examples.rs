//! Examples at the end of every help, and what the program says when it is called alone.

/// `robotcal` alone.
pub(super) const START: &str = "\
robotcal finds the real geometry of a robot arm from images of a printed plate.

Three commands to start with:

  robotcal plate --out plate
      a plate of coded circles to print (A2; --sheet A3 or A4 for smaller ones)
  robotcal plan --urdf robot.urdf --plate plate/plate.toml --count 30 --out run1
      where to take images: joints.csv and programs for the robot
  robotcal identify --urdf robot.urdf --series run1
      the corrected robot, and a report: reports/run1/report.html

Is the folder complete? robotcal doctor run1 --urdf robot.urdf
All commands: robotcal --help; examples of each: robotcal COMMAND --help";

macro_rules! examples {
    ($($(#[$doc:meta])+ $name:ident = [$($example:literal),+ $(,)?];)+) => {
        $($(#[$doc])+ pub(super) const $name: &str = concat!("Examples:", $("\n  ", $example),+);)+

        /// All of them.
        #[cfg(test)]
        pub(super) const ALL: &[&str] = &[$($name),+];
    };
}

examples! {
    /// Of `compare`.
    COMPARE = [
        "robotcal compare --urdf robot.urdf --series run1",
        "robotcal compare --urdf robot.urdf --study --out study",
    ];
    /// Of `compensate`.
    COMPENSATE = [
        "robotcal compensate weld.src weld.dat --nominal robot.urdf --urdf reports/run1/robot.calibrated.urdf --compensation reports/run1/compensation.toml",
        "robotcal compensate weld.src --nominal robot.urdf --urdf reports/run1/robot.calibrated.urdf --compensation reports/run1/compensation.toml --frames frames/frames.json",
        "robotcal compensate taught.csv --from a.calibrated.urdf --to b.calibrated.urdf --from-frames a/frames.json --frames b/frames.json --joint-unit deg",
        "robotcal compensate targets.csv --nominal robot.urdf --urdf robot.calibrated.urdf --joint-unit deg --out corrected",
    ];
    /// Of `convert`.
    CONVERT = [
        "robotcal convert run1.mcap run1",
        "robotcal convert run1 run1.mcap --urdf robot.urdf",
        "robotcal convert reports/run1/solution.json front.cameramodel",
        "robotcal convert reports/run1/solution.json camchain.yaml --as kalibr --nearest",
    ];
    /// Of `detect`.
    DETECT = [
        "robotcal detect --series run1 --overlay",
        "robotcal detect --plate plate/plate.toml photo.png",
    ];
    /// Of `doctor`.
    DOCTOR = ["robotcal doctor run1 --urdf robot.urdf", "robotcal doctor run1.mcap"];
    /// Of `frames`.
    FRAMES = [
        "robotcal frames --from reports/run1/solution.json --touches touches",
        "robotcal frames --from reports/run1/solution.json --touches tcp --touches fixture --out frames",
        "robotcal frames --from reports/run1/solution.json --plate",
    ];
    /// Of `identify`.
    IDENTIFY = [
        "robotcal identify --urdf robot.urdf --series run1",
        "robotcal identify --urdf robot.urdf --series run1 --series run2 --out reports/both",
        "robotcal identify --urdf robot.urdf --series run1 --dry-run",
        "robotcal identify --from reports/run1/solution.json --robot-model rigid --out reports/rigid",
    ];
    /// Of `plan`.
    PLAN = [
        "robotcal plan --from reports/run1/solution.json --touch fixture.csv --touch-work 0.5,0.1,0.1 --count 12 --out touches",
        "robotcal plan --urdf robot.urdf --plate plate/plate.toml --count 30 --out run1",
        "robotcal plan --from reports/run1/solution.json --count 10 --out run2",
    ];
    /// Of `plate`.
    PLATE = [
        "robotcal plate --out plate",
        "robotcal plate --sheet A4 --out plate_a4",
        "robotcal plate --sheet A3 --out plate_a3",
    ];
    /// Of `poses`.
    POSES = ["robotcal poses --series run1", "robotcal poses --plate plate/plate.toml a.png b.png c.png d.png --out poses"];
    /// Of `show`.
    SHOW = [
        "robotcal show reports/run1/solution.json",
        "robotcal show --all reports/run1/solution.json",
        "robotcal show reports/run1/solution.json reports/run2/solution.json",
    ];
    /// Of `simulate`.
    SIMULATE = [
        "robotcal simulate --urdf robot.urdf --out made --images 30",
        "robotcal simulate --urdf robot.urdf --out made --observations --fault moved-plate",
    ];
    /// Of `verify`.
    VERIFY = [
        "robotcal verify --urdf reports/run1/robot.calibrated.urdf --compensation reports/run1/compensation.toml --points tracker.csv --joint-unit deg",
        "robotcal verify --urdf reports/run1/robot.calibrated.urdf --series run2",
    ];
}
