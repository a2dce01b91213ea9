//! Programs for another cell: joints that move far and stay in their posture.

use robotcal::geom::Pose;
use robotcal::model::robot::Robot;
use robotcal::programs::{
    self, Language, LeftReason, MeasuredFrames, Models, Postures, ProgramSetting, RobotFrames, TargetOutcome, TextFile,
};
use robotcal::urdf::Chain;

use crate::programs_support::{Cell, assert_meets};

/// A program by the nominal robot of a chain, run by another one whose work object is elsewhere.
fn outcomes(name: &str, text: String, to: &Robot, from: &Chain, moved: Option<Pose>) -> (Vec<TargetOutcome>, String) {
    let language = Language::of_file(name.as_ref()).unwrap();
    let axes: Vec<usize> =
        (0..from.readings.len()).map(|k| (k + from.readings.len() - 6) % from.readings.len()).collect();
    let setting = ProgramSetting {
        chain: from,
        axes: &axes,
        rad_per_unit: Some(1.0),
        base: Pose::identity(),
        tool: None,
        work: None,
        axes_apart: false,
    };
    let nominal = Robot::nominal(from.clone());
    let work = Pose::from_xyz_rpy([0.4, 0.1, 0.2], [0.0, 0.0, 0.3]);
    let at = |work: Pose| RobotFrames { tool: None, work: Some(work) };
    let frames = moved.map(|moved| MeasuredFrames {
        to: at(moved * work),
        from: Some(at(work)),
        work_is_base: true,
        tool: None,
        work: None,
        same_work: (0.0, 0.0),
        same_tool_m: 0.0,
    });
    let file = TextFile { name: name.into(), bytes: text.into_bytes() };
    let program = programs::read(language, vec![file], &setting).unwrap();
    let models = Models { controller: &nominal, from: &nominal, to, frames: frames.as_ref(), beyond: [None, None] };
    let postures = Postures { held: vec![false; axes.len()], start: None };
    let done = programs::compensate(&program, models, &postures);
    (done.outcomes, String::from_utf8(done.files[0].clone()).unwrap())
}

fn table(chain: &Chain, q: &[Vec<f64>]) -> String {
    let row = |q: &Vec<f64>| q.iter().map(|v| format!("{v:.12}")).collect::<Vec<_>>().join(",");
    chain.readings.join(",") + "\n" + &q.iter().map(row).collect::<Vec<_>>().join("\n") + "\n"
}

/// 46 degrees about the first axis, which points down, and 8 mm: the arm stays in its posture though its joints move far.
#[test]
fn targets_of_a_turned_cell_are_reached_in_their_posture() {
    let mut cell = Cell::kuka(301);
    let to = Robot::nominal(cell.real.chain.clone());
    let moved = Pose::from_xyz_rpy([0.008, -0.005, 0.003], [0.0, 0.0, 46f64.to_radians()]);
    let q: Vec<Vec<f64>> = std::iter::repeat_with(|| cell.readings()).filter(|q| q[0] > -1.9).take(30).collect();
    let (outcomes, _) = outcomes("t.csv", table(&to.chain, &q), &to, &to_nominal(&cell), Some(moved));
    let mut done = 0;
    for (q, outcome) in q.iter().zip(&outcomes) {
        match outcome {
            TargetOutcome::Done(correction) => {
                let wanted = moved * cell.nominal.base_from_tip(q);
                assert_meets(&to.base_from_tip(&correction.corrected), &wanted, "the moved target");
                let turned = correction.corrected[0] - q[0];
                assert!((turned + 46f64.to_radians()).abs() < 0.15, "axis 1 turns by {turned} rad");
                done += 1;
            }
            // 8 mm may bring a joint to its limit.
            TargetOutcome::Left(why) => assert!(why.reason != LeftReason::Singular, "{}", why.words),
        }
    }
    assert!(done >= 27, "{done} of 30");
}

fn to_nominal(cell: &Cell) -> Chain {
    cell.nominal.chain.clone()
}

/// Axes 4 and 6 in one line, and nearly so.
#[test]
fn a_target_with_aligned_wrist_axes_is_singular_wherever_the_cell_stands() {
    let cell = Cell::kuka(302);
    let to = Robot::nominal(cell.real.chain.clone());
    let moved = Pose::from_xyz_rpy([0.008, -0.005, 0.003], [0.02, 0.01, 46f64.to_radians()]);
    let q: Vec<Vec<f64>> = [0.0, 0.002].map(|a5| vec![0.2, -1.2, 1.5, 0.3, a5, 0.1]).to_vec();
    let (outcomes, _) = outcomes("t.csv", table(&to.chain, &q), &to, &to_nominal(&cell), Some(moved));
    for outcome in outcomes {
        let TargetOutcome::Left(why) = outcome else { panic!("corrected") };
        assert_eq!(why.reason, LeftReason::Singular, "{}", why.words);
    }
}
