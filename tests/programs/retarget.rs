//! Programs for another cell: joints that move far and stay in their posture, and external axes that keep their place.

use nalgebra::Vector6;
use robotcal::geom::Pose;
use robotcal::model::robot::Robot;
use robotcal::programs::{
    self, Language, LeftReason, MeasuredFrames, Models, Postures, ProgramSetting, RobotFrames, SameFrames,
    TargetOutcome, TextFile,
};
use robotcal::urdf::{Chain, read};

use crate::programs_support::{Cell, assert_meets};
use crate::robots::kr6_urdf;

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
        base_within: None,
        tool: None,
        work: None,
        unsaid: None,
        same: SameFrames { work: (0.0, 0.0), tool: (0.0, 0.0), clearly_nearer: 1.0 },
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

/// An arm on a rail, and the same one slightly wrong.
pub(super) fn on_rail() -> (Chain, Robot) {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(kr6_urdf()).unwrap();
    let rail = "<link name=\"rail\"/><joint name=\"slide\" type=\"prismatic\"><parent link=\"rail\"/><child link=\"base_link\"/>\
                <axis xyz=\"1 0 0\"/><limit lower=\"0\" upper=\"3\" effort=\"1\" velocity=\"1\"/></joint></robot>";
    let path = folder.path().join("rail.urdf");
    std::fs::write(&path, text.replace("</robot>", rail)).unwrap();
    let chain = read(&path).unwrap().chain(Some("rail"), Some("tool0")).unwrap();
    let mut real = Robot::nominal(chain.clone());
    for (k, joint) in real.chain.joints.iter_mut().enumerate() {
        let twist = Vector6::from_fn(|i, _| 1e-3 * ((3 * k + i) as f64).sin());
        joint.origin = joint.origin.perturbed(&twist);
    }
    (chain, real)
}

/// A rail under the arm keeps its place: the arm alone makes up for what is wrong, with axis angles as with poses.
#[test]
fn external_axes_keep_their_value_beside_axis_angles() {
    let (chain, real) = on_rail();
    let degrees = [12.0, -60.0, 80.0, 20.0, 50.0, 10.0];
    let axes = degrees.iter().enumerate().map(|(k, v)| format!("A{} {v:.1}", k + 1)).collect::<Vec<_>>().join(",");
    let krl = format!("DEF a()\nPTP {{E6AXIS: {axes},E1 500.0}}\nPTP {{E1 700.0}}\nEND\n");
    let rapid = format!(
        "MODULE m\nPROC main()\nMoveAbsJ [{degrees:?},[500.0,9E9,9E9,9E9,9E9,9E9]],v10,fine,tool0;\nENDPROC\nENDMODULE\n"
    );
    let given: Vec<f64> = std::iter::once(0.5).chain(degrees.map(f64::to_radians)).collect();
    let wanted = Robot::nominal(chain.clone()).base_from_tip(&given);
    for (name, text, kept) in [("a.src", krl, "E1 500.0}"), ("m.mod", rapid, "[500.0,")] {
        let (outcomes, new) = outcomes(name, text, &real, &chain, None);
        let [TargetOutcome::Done(correction)] = &outcomes[..] else { panic!("{outcomes:?}") };
        assert_meets(&real.base_from_tip(&correction.corrected), &wanted, name);
        assert_eq!(correction.corrected[0], 0.5, "{name}");
        assert!(new.contains(kept), "{new}");
        assert!(name != "a.src" || new.contains("PTP {E1 700.0}"), "{new}");
    }
}

/// A pose without its external axis: the rail stands where the target before has left it, and no other place may be taken for it.
#[test]
fn a_pose_that_leaves_the_rail_out_keeps_it_where_it_stands() {
    let (chain, real) = on_rail();
    let nominal = Robot::nominal(chain.clone());
    let degrees = [12.5, -59.0, 79.0, 20.5, 50.5, 10.5f64];
    let meant: Vec<f64> = std::iter::once(0.5).chain(degrees.map(f64::to_radians)).collect();
    let pose = nominal.base_from_tip(&meant);
    let [x, y, z] = pose.xyz().map(|v| 1e3 * v);
    let [c, b, a] = pose.rpy().map(f64::to_degrees);
    let lin = format!("LIN {{X {x:.7},Y {y:.7},Z {z:.7},A {a:.8},B {b:.8},C {c:.8}}}\n");
    let begin = "DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n";
    let arm = "A1 12.0,A2 -60.0,A3 80.0,A4 20.0,A5 50.0,A6 10.0";
    // One after another: what the first of them leaves out is known too.
    let text = format!("{begin}PTP {{{arm},E1 500.0}}\n{lin}{lin}END\n");
    let (done, _) = outcomes("a.src", text, &real, &chain, None);
    assert_eq!(done.len(), 3);
    for outcome in &done[1..] {
        let TargetOutcome::Done(correction) = outcome else { panic!("{outcome:?}") };
        for (found, q) in correction.programmed.iter().zip(&meant) {
            assert!((found - q).abs() < 1e-6, "{:?}", correction.programmed);
        }
        assert!((correction.corrected[0] - 0.5).abs() < 1e-12, "{:?}", correction.corrected);
        assert_meets(&real.base_from_tip(&correction.corrected), &pose, "the rail stands");
    }
    let moved_beside = format!("{begin}PTP {{{arm},E1 500.0}}\nPTP {{E1 700.0}}\n{lin}END\n");
    let nowhere_told = format!("{begin}PTP {{{arm}}}\n{lin}END\n");
    let (none, at) = ([9e9; 6], [x, y, z]);
    let quaternion = "[0.0,1.0,0.0,0.0]";
    let first = format!(
        "MODULE m\nPROC main()\nMoveL [{at:?},{quaternion},[0,0,0,0],{none:?}],v10,fine,tool0;\nENDPROC\nENDMODULE\n"
    );
    for (name, text) in [("a.src", moved_beside), ("a.src", nowhere_told), ("m.mod", first)] {
        let (left, _) = outcomes(name, text.clone(), &real, &chain, None);
        let Some(TargetOutcome::Left(why)) = left.last() else { panic!("{text}: {left:?}") };
        assert_eq!(why.reason, LeftReason::Incomplete, "{text}: {}", why.words);
    }
}
