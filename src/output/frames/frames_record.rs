//! frames.json: tool and work object of a robot, with what is needed to judge them and to use them.
//!
//! Poses are `parent_from_frame`; covariances of points stand along the axes of the parent, those of poses are of body twists, translation
//! first, row by row; m and rad. A change of meaning raises [`FORMAT`].

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use crate::error::{Code, Error, Result, plain_name};
use crate::frames::fit::Expected;
use crate::frames::{Knowledge, KnownRobot};
use crate::geom::Pose;
use crate::model::robot::Robot;
use crate::output::corrections::FileFinding;
use crate::output::restore::FoundModel;
use crate::output::solution::bytes::field_per_line;
use crate::output::solution::pose_record::PoseRecord;
use crate::series::InputFile;

/// Name of the file.
pub const FILE_NAME: &str = "frames.json";

/// Version of the format.
pub const FORMAT: u32 = 1;

/// Postures at which the robot that frames belong to is recorded.
const CHECKED: usize = 5;
/// Distance (m) and angle (rad) within which a robot is the same at them.
const SAME_ROBOT: f64 = 1e-6;

/// How a tool was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ToolKind {
    /// Its position was measured, its orientation was not: that of the record is as it was given.
    Point,
    /// Position and orientation were measured.
    Pose,
    /// It was given, and nothing of it was measured.
    Given,
    /// Its position was given without an orientation.
    GivenPoint,
}

/// How a work object was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WorkKind {
    /// From places that were touched or tracked.
    Measured,
    /// It is the plate of the solution.
    Plate,
}

/// The tool.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ToolRecord {
    /// Name.
    pub name: String,
    /// Link that carries it.
    pub parent: String,
    /// What of it was measured.
    pub measured: ToolKind,
    /// `tip_from_tool`.
    pub pose: PoseRecord,
    /// 9 numbers for a point, 36 for a pose, none where it was given.
    pub covariance: Option<Vec<f64>>,
}

/// The work object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WorkRecord {
    /// Name of the frame in which its places are given.
    pub name: String,
    /// Link on which it stands.
    pub parent: String,
    /// How it was found.
    pub measured: WorkKind,
    /// `base_from_work`.
    pub pose: PoseRecord,
    /// 36 numbers.
    pub covariance: Vec<f64>,
}

/// One measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TouchRecord {
    /// Stop.
    pub stop: String,
    /// What touched: the tool, or a target of a tracker.
    pub body: String,
    /// What was touched: its contact, or the frame of the known place.
    pub at: String,
    /// Place in the work object, m; as found, where it was not known.
    pub place_m: [f64; 3],
    /// Stated sigma of a coordinate, m.
    pub sigma_m: f64,
    /// Place less tool, along the axes of the base, m.
    pub residual_m: [f64; 3],
    /// Length of the residual in sigmas.
    pub sigmas: f64,
    /// True where it disagrees with the others, and is left out.
    pub left_out: bool,
}

/// The solution whose corrected robot the frames go with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RobotOfFrames {
    /// solution.json with its hash.
    pub solution: InputFile,
    /// Name of the robot.
    pub name: String,
    /// Base link.
    pub base: String,
    /// Tip link.
    pub tip: String,
    /// Readings of some postures, rad or m, and where the corrected robot has its tip there.
    pub checks: Vec<(Vec<f64>, PoseRecord)>,
}

/// What goes on to targets: covariance of `u` (tool, work object) and of `u` with the robot's parameters in solution.json.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KnowledgeRecord {
    /// Index of the plate's placement in the solution whose columns count, too.
    pub placement: Option<usize>,
    /// Of `u`, a list a row.
    pub frames: Vec<Vec<f64>>,
    /// Of `u` with the robot, a list a row.
    pub cross: Vec<Vec<f64>>,
    /// What the touches say of the robot's parameters beyond the solution.
    pub learned: Vec<f64>,
    /// What of it tool and work object have taken up.
    pub taken: Vec<f64>,
}

/// The whole file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FramesRecord {
    /// [`FORMAT`].
    pub format: u32,
    /// Version of the program.
    pub version: String,
    /// Command line.
    pub command: String,
    /// The robot.
    pub robot: RobotOfFrames,
    /// Files of the touches, with hashes.
    pub inputs: Vec<InputFile>,
    /// The tool; none where nothing tells it.
    pub tool: Option<ToolRecord>,
    /// The work object; none where no place is known.
    pub work: Option<WorkRecord>,
    /// Factor that the touches ask for on their stated sigmas.
    pub sigma_factor: f64,
    /// RMS of the lengths of the residuals in use, m.
    pub rms_m: f64,
    /// Expected error of the tool in the work object over the stops and touches, RMS of the length.
    pub expected: Expected,
    /// Measurements.
    pub touches: Vec<TouchRecord>,
    /// What was found.
    pub findings: Vec<FileFinding>,
    /// What goes on to targets.
    pub knowledge: KnowledgeRecord,
}

/// Rows of a matrix.
pub fn rows(m: &DMatrix<f64>) -> Vec<Vec<f64>> {
    m.row_iter().map(|r| r.iter().copied().collect()).collect()
}

/// A matrix row by row.
pub fn flat(m: &DMatrix<f64>) -> Vec<f64> {
    m.transpose().as_slice().to_vec()
}

/// Postures of the identification and where the written robot has its tip there.
pub fn checks(robot: &KnownRobot) -> Vec<(Vec<f64>, PoseRecord)> {
    let every = robot.stops.len().div_ceil(CHECKED).max(1);
    let check = |q: &Vec<f64>| (q.clone(), (&robot.exported().base_from_tip(q)).into());
    robot.stops.iter().step_by(every).map(|s| check(&s.readings)).collect()
}

/// Bytes of frames.json.
///
/// # Errors
/// None in practice: every field can be written as JSON.
pub fn to_bytes(record: &FramesRecord) -> Result<Vec<u8>> {
    field_per_line(record, FILE_NAME)
}

fn damaged(what: impl std::fmt::Display) -> Error {
    Error::new(Code::SettingSyntax, FILE_NAME, what, "give the frames.json that `robotcal frames` wrote")
}

/// Reads frames.json back.
///
/// # Errors
/// Text that is no such file, other versions of the format, parts that do not fit together.
pub fn read(bytes: &[u8]) -> Result<FramesRecord> {
    #[derive(Deserialize)]
    struct Version {
        format: u32,
    }
    let version: Version = serde_json::from_slice(bytes).map_err(damaged)?;
    if version.format != FORMAT {
        let what = format!("format = {}; this program reads {FORMAT}", version.format);
        return Err(Error::new(Code::SettingVersion, FILE_NAME, what, "make it again with `robotcal frames`"));
    }
    let record: FramesRecord = serde_json::from_slice(bytes).map_err(damaged)?;
    record.check()?;
    Ok(record)
}

impl FramesRecord {
    fn check(&self) -> Result<()> {
        let plain = |kind: &str, name: &str| plain_name(kind, name, FILE_NAME).map(|_| ());
        [&self.robot.name, &self.robot.base, &self.robot.tip]
            .into_iter()
            .try_for_each(|n| plain("robot or link", n))?;
        self.tool.iter().try_for_each(|t| plain("tool", &t.name))?;
        self.work.iter().try_for_each(|w| plain("work object", &w.name))?;
        let known = &self.knowledge;
        let n = known.frames.len();
        let columns = known.cross.first().map_or(0, Vec::len);
        let square = known.frames.iter().all(|r| r.len() == n) && (n == 9 || n == 12);
        let whole = known.cross.len() == n && known.cross.iter().all(|r| r.len() == columns);
        let all = || known.frames.iter().chain(&known.cross).flatten();
        let whole = whole && known.learned.len() == columns && known.taken.len() == n;
        let all = || all().chain(&known.learned).chain(&known.taken);
        if !square || !whole || !all().all(|v| v.is_finite()) {
            return Err(damaged("its covariance does not hang together"));
        }
        let poses = self.tool.iter().map(|t| &t.pose).chain(self.work.iter().map(|w| &w.pose));
        let checked = self.robot.checks.iter().map(|(_, pose)| pose);
        let is_pose = |p: &PoseRecord| {
            let norm: f64 = p.quat_xyzw.iter().map(|q| q * q).sum();
            p.xyz_m.iter().all(|v| v.is_finite()) && (norm - 1.0).abs() < 1e-6
        };
        match poses.chain(checked).all(is_pose) {
            true => Ok(()),
            false => Err(damaged("a pose has numbers that are none, or a quaternion that is no rotation")),
        }
    }

    /// True where the places are given in the base itself: the nominal work object is the base.
    pub fn work_is_base(&self) -> bool {
        self.work.as_ref().is_some_and(|w| w.name == self.robot.base)
    }

    /// Refuses a robot that is not the one whose frames these are; `file` is where it was read from.
    ///
    /// # Errors
    /// Other links or joints; a tip that is elsewhere at the recorded postures.
    pub fn check_robot(&self, robot: &Robot, file: &str) -> Result<()> {
        let differs = |what: String, remedy: &str| Err(Error::new(Code::SolutionDiffers, file, what, remedy));
        let chain = &robot.chain;
        if chain.base != self.robot.base || chain.tip != self.robot.tip {
            let what = format!(
                "goes from {} to {}, and the frames are those of {} to {}",
                chain.base, chain.tip, self.robot.base, self.robot.tip
            );
            return differs(what, "give --base and --tip of the solution that the frames were found with");
        }
        for (readings, pose) in &self.robot.checks {
            if readings.len() != chain.readings.len() {
                let what = format!(
                    "has {} joints, and the frames are of a robot with {}",
                    chain.readings.len(),
                    readings.len()
                );
                return differs(what, "give the description that was written beside the solution of the frames");
            }
            let (rad, m) = robot.base_from_tip(readings).distance(&pose.into());
            if rad > SAME_ROBOT || m > SAME_ROBOT {
                let what = format!(
                    "is not the robot that the frames were found with: its tip is {:.4} mm and {:.4} mrad elsewhere",
                    1e3 * m,
                    1e3 * rad
                );
                return differs(
                    what,
                    "give the corrected description and the compensation.toml of that solution (--compensation)",
                );
            }
        }
        Ok(())
    }

    /// What goes on to targets.
    ///
    /// # Errors
    /// A solution with other parameters.
    pub fn known(&self, found: &FoundModel) -> Result<(KnownRobot, Knowledge)> {
        let placement = self.knowledge.placement;
        if placement.is_some_and(|p| p >= found.layout.placements.len()) {
            return Err(damaged("the solution has no such placement"));
        }
        let robot = found.known_robot(placement)?;
        let matrix =
            |rows: &[Vec<f64>]| DMatrix::from_fn(rows.len(), rows.first().map_or(0, Vec::len), |i, j| rows[i][j]);
        let vector = |values: &[f64]| DVector::from_column_slice(values);
        let knowledge = Knowledge {
            frames: matrix(&self.knowledge.frames),
            cross: matrix(&self.knowledge.cross),
            learned: vector(&self.knowledge.learned),
            taken: vector(&self.knowledge.taken),
        };
        if knowledge.cross.ncols() != robot.columns().len() {
            return Err(damaged("the solution has other parameters than the one that the frames were found with"));
        }
        Ok((robot, knowledge))
    }

    /// `base_from_work`; the base itself where there is none.
    pub fn base_from_work(&self) -> Pose {
        self.work.as_ref().map_or_else(Pose::identity, |w| (&w.pose).into())
    }
}
