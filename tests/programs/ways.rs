//! Targets to which several ways lead: they are corrected where all of these mean the same posture.

use crate::programs_support::text::{
    START, UNCHECKED, beside, confdata, jointtarget, pose, pose_text, robtarget, script_pose, told,
};
use crate::programs_support::{Cell, assert_brings_to, krl_frame, numbers, status_turn};
use robotcal::programs::LeftReason;

/// Nearly the same pose in another posture: the wrist is turned over.
fn turned_over() -> Vec<f64> {
    let [a, b, c, d, e, f] = START;
    vec![a, b, c, d - std::f64::consts::PI, 0.05 - e, f + std::f64::consts::PI]
}

fn degrees(q: &[f64]) -> Vec<f64> {
    q.iter().map(|v| v.to_degrees()).collect()
}

/// How a language writes joints and poses.
struct Writer<'a> {
    joints: &'a dyn Fn(&[f64]) -> String,
    pose: &'a dyn Fn(&[f64]) -> String,
}

impl Writer<'_> {
    /// `N` stands for joints near the start, `O` for the wrist turned over, `@` for a new pose each time.
    fn text(&self, body: &str) -> String {
        let mut text = body.replace("<N>", &(self.joints)(&beside(40))).replace("<O>", &(self.joints)(&turned_over()));
        for k in 1.. {
            let Some(at) = text.find('@') else { break };
            text.replace_range(at..=at, &(self.pose)(&beside(k)));
        }
        text
    }
}

fn krl_joints(q: &[f64]) -> String {
    let axes: Vec<_> = degrees(q).iter().enumerate().map(|(k, q)| format!("A{} {q:.6}", k + 1)).collect();
    format!("{{{}}}", axes.join(","))
}

fn krl_pose(cell: &Cell, q: &[f64]) -> String {
    format!("{{{}}}", pose_text(cell, q))
}

pub(super) fn krl(cell: &Cell, body: &str) -> String {
    let writer = Writer { joints: &krl_joints, pose: &|q| krl_pose(cell, q) };
    let head = format!("DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nPTP {}\n", krl_joints(&START));
    head + &writer.text(body) + "END\n"
}

fn unknown(count: usize) -> Vec<String> {
    vec![LeftReason::PostureUnknown.name().to_owned(); count]
}

#[test]
fn a_target_of_krl_is_left_where_the_ways_to_it_mean_several_postures() {
    let cell = Cell::kuka(111);
    let maybe = |joints: &str| format!("IF $IN[1] THEN\nPTP {joints}\nENDIF\n");
    for (body, corrected, left) in [
        (maybe("<O>") + "PTP @\n", 2, 1),
        (maybe("<N>") + "PTP @\n", 3, 0),
        (maybe("<O>") + "LIN @\nLIN @\nPTP <N>\nLIN @\n", 4, 2),
        ("IF $IN[1] THEN\nPTP <O>\nELSE\nPTP <O>\nENDIF\nPTP @\n".to_owned(), 4, 0),
        ("IF $IN[1] THEN\nPTP <O>\nRETURN\nENDIF\nPTP @\n".to_owned(), 3, 0),
        ("LOOP\nPTP @\nPTP <O>\nENDLOOP\n".to_owned(), 2, 1),
        ("LOOP\nPTP @\nPTP <N>\nENDLOOP\n".to_owned(), 3, 0),
        ("LOOP\nPTP @\nLIN @\nENDLOOP\n".to_owned(), 3, 0),
        ("LOOP\nLIN @\nLIN @\nPTP <O>\nENDLOOP\n".to_owned(), 2, 2),
        ("WHILE $IN[1]\nPTP <O>\nENDWHILE\nPTP @\n".to_owned(), 2, 1),
        ("LOOP\nPTP <N>\nIF $IN[1] THEN\nEXIT\nENDIF\nPTP <O>\nENDLOOP\nPTP @\n".to_owned(), 4, 0),
        ("W=@\nPTP W\nPTP <O>\nPTP W\n".to_owned(), 2, 1),
        ("W=@\nPTP W\nPTP <N>\nPTP W\n".to_owned(), 3, 0),
        ("SUB()\nPTP @\nEND\nDEF SUB()\n".to_owned() + &maybe("<O>"), 2, 1),
        ("SUB()\nPTP @\nEND\nDEF SUB()\n".to_owned() + &maybe("<N>"), 3, 0),
        ("SUB()\nPTP @\nPTP <O>\nSUB()\nEND\nDEF SUB()\n".to_owned() + &maybe("<N>"), 4, 0),
    ] {
        let told = told(&cell, &[("a.src", krl(&cell, &body))], &[]);
        assert_eq!(told, (corrected, unknown(left)), "{body}");
    }
}

/// Components that a motion leaves out must be the same from everywhere.
#[test]
fn what_a_target_leaves_out_is_the_same_on_all_ways() {
    let cell = Cell::kuka(112);
    for (body, wanted) in [
        ("LOOP\nLIN {Z 700}\nLIN {Z 690}\nENDLOOP\n", (3, vec![])),
        ("PTP @\nLOOP\nLIN {Z 700}\nLIN @\nENDLOOP\n", (3, vec![LeftReason::Incomplete.name().to_owned()])),
    ] {
        assert_eq!(told(&cell, &[("a.src", krl(&cell, body))], &[]), wanted, "{body}");
    }
}

#[test]
fn a_target_of_a_script_is_left_where_the_ways_to_it_mean_several_postures() {
    let cell = Cell::kuka(113);
    let writer = Writer { joints: &|q| format!("{q:?}"), pose: &|q| script_pose(&cell.nominal.base_from_tip(q)) };
    let text =
        |body: &str| format!("def p():\n  set_tcp(p[0,0,0,0,0,0])\n  movej({START:?})\n{}end\n", writer.text(body));
    for (body, corrected, left) in [
        ("  if x:\n    movej(<O>)\n  end\n  movej(@)\n", 2, 1),
        ("  if x:\n    movej(<O>)\n  end\n  movel(@)\n  movel(@)\n", 2, 2),
        ("  if x:\n    movej(<N>)\n  end\n  movel(@)\n  movel(@)\n", 4, 0),
        ("  while True:\n    movej(@)\n    movej(<O>)\n  end\n", 2, 1),
        ("  while True:\n    movej(@)\n    movel(@)\n  end\n", 3, 0),
        ("  w=@\n  movej(w)\n  movej(<O>)\n  movej(w)\n", 2, 1),
        ("  if x:\n    movej(<O>)\n    return False\n  end\n  movej(@)\n", 3, 0),
    ] {
        let told = told(&cell, &[("a.script", text(body))], &[]);
        assert_eq!(told, (corrected, unknown(left)), "{body}");
    }
}

#[test]
fn a_target_of_rapid_without_confdata_is_left_where_the_ways_to_it_mean_several_postures() {
    let cell = Cell::kuka(114);
    let joints = |q: &[f64]| format!("[{:?},[9E9,9E9,9E9,9E9,9E9,9E9]]", degrees(q));
    let pose = |q: &[f64]| robtarget(&cell.nominal.base_from_tip(q), UNCHECKED);
    let writer = Writer { joints: &joints, pose: &pose };
    let end = ",v10,fine,tool0;\n";
    let text = |body: &str| {
        let body = writer.text(body).replace(".\n", end);
        format!(
            "MODULE m\nPROC main()\nConfJ\\Off;\nConfL\\Off;\nMoveAbsJ {}{end}{body}ENDPROC\nENDMODULE\n",
            joints(&START)
        )
    };
    for (body, corrected, left) in [
        ("IF a THEN\nMoveAbsJ <O>.\nENDIF\nMoveJ @.\n", 2, 1),
        ("IF a THEN\nMoveAbsJ <N>.\nENDIF\nMoveJ @.\n", 3, 0),
        ("IF a THEN\nMoveAbsJ <O>.\nRETURN;\nENDIF\nMoveJ @.\n", 3, 0),
        ("WHILE TRUE DO\nMoveJ @.\nMoveAbsJ <O>.\nENDWHILE\n", 2, 1),
        ("WHILE TRUE DO\nMoveJ @.\nMoveL @.\nENDWHILE\n", 3, 0),
        ("MoveAbsJ <O>.\nback:\nMoveJ @.\nMoveAbsJ <N>.\nGOTO back;\n", 3, 1),
        ("MoveJ @.\nERROR\nMoveJ @.\n", 2, 1),
    ] {
        let told = told(&cell, &[("m.mod", text(body))], &[]);
        assert_eq!(told, (corrected, unknown(left)), "{body}");
    }
}

/// In a loop whose ends agree the target comes where it was meant.
#[test]
fn a_target_at_the_top_of_a_loop_meets_its_place() {
    let cell = Cell::kuka(115);
    let file = cell.write("a.src", krl(&cell, "LOOP\nPTP @\nPTP <N>\nENDLOOP\n").as_bytes());
    let new = cell.compensate(&[&file], &["--unordered"]).expect(0).text("a.src");
    let line = new.lines().find(|l| l.starts_with("PTP {X")).unwrap();
    assert_brings_to(&cell, &krl_frame(line), &beside(1), line);
}

/// At a singular posture two axes turn alike, and status and turn say nothing.
#[test]
fn a_singular_target_is_said_to_be_singular() {
    let cell = Cell::kuka(116);
    let straight = [0.1, -1.5, 1.6, 0.4, 0.0, 0.3];
    let pose = krl_pose(&cell, &straight).replace('}', ",S 2,T 2}");
    let (_, reasons) = told(&cell, &[("a.src", krl(&cell, &format!("PTP {pose}\n")))], &[]);
    assert_eq!(reasons, [LeftReason::Singular.name()]);
}

/// `START` with the wrist elsewhere: axes 4 and 6, and axis 5 itself, rad.
fn wrist([fourth, fifth, sixth]: [f64; 3]) -> Vec<f64> {
    let [a, b, c, d, _, f] = START;
    vec![a, b, c, d + fourth, fifth, f + sixth]
}

/// The poses of a motion in a corrected module.
fn poses_of(new: &str, motion: &str) -> Vec<String> {
    let lines = new.lines().filter(|line| line.starts_with(motion));
    lines.flat_map(|line| line.split("},").map(str::to_owned).collect::<Vec<_>>()).collect()
}

/// Turned over, the wrist would be nearer in the joints, but no path of the tool leads there without passing the singular posture.
#[test]
fn paths_of_the_tool_keep_the_wrist_on_its_side() {
    let cell = Cell::kuka(117);
    let at = |q: &[f64]| krl_pose(&cell, q);
    for (motion, ends) in [
        ("CIRC", vec![wrist([2.2, 0.5, -1.8]), wrist([2.5, 0.6, -2.0])]),
        ("CIRC", vec![wrist([-2.3, 0.6, 1.9]), wrist([-2.5, 0.5, 2.1])]),
        // Beside the singular posture axis 4 turns by half a turn in a few millimetres.
        ("LIN", vec![wrist([-2.95, 0.6, 2.9])]),
        ("LIN", vec![wrist([-3.05, 0.5, 3.05])]),
    ] {
        let (from, to) = (krl_joints(&wrist([0.0, 0.6, 0.0])), ends.iter().map(|q| at(q)).collect::<Vec<_>>());
        let text = format!("DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nPTP {from}\n{motion} {}\nEND\n", to.join(","));
        let file = cell.write("a.src", text.as_bytes());
        let new = cell.compensate(&[&file], &["--unordered"]).expect(0).text("a.src");
        let written = poses_of(&new, motion);
        assert_eq!(written.len(), ends.len(), "{new}");
        for (pose, q) in written.iter().zip(&ends) {
            assert_brings_to(&cell, &krl_frame(pose), q, pose);
        }
    }
}

/// A straight line through the base is none that the robot can go: what the joints would be at its end, nobody knows.
#[test]
fn a_line_that_cannot_be_followed_leaves_its_target() {
    let cell = Cell::kuka(118);
    let [_, b, c, d, e, f] = START;
    let at = |turn: f64| vec![turn, b, c, d, e, f];
    let text = |turn: f64| {
        let (from, to) = (krl_joints(&at(-turn)), krl_pose(&cell, &at(turn)));
        format!("DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nPTP {from}\nLIN {to}\nEND\n")
    };
    assert_eq!(told(&cell, &[("a.src", text(1.6))], &[]), (1, unknown(1)));
    assert_eq!(told(&cell, &[("a.src", text(0.3))], &[]), (2, Vec::new()));
}

/// Status and turn count for nothing on an arc, too: those of a wrist that would have to turn over on the way are not believed, though no chord leads there.
#[test]
fn codes_of_an_arc_are_held_against_it() {
    let cell = Cell::kuka(119);
    let [_, b, c, d, e, f] = START;
    let at = |turn: f64| vec![turn, b, c, d, e, f];
    let (s, t) = status_turn(&at(2.6));
    let text = |(s, t): (u32, u32)| {
        let [aux, end] = [0.0, 2.6].map(|turn| pose_text(&cell, &at(turn)));
        let from = krl_joints(&at(-2.6));
        format!("DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nPTP {from}\nCIRC {{{aux}}},{{{end},S {s},T {t}}}\nEND\n")
    };
    let flipped = (s ^ 4, t ^ 0b111000);
    for (codes, flags, wanted) in [
        ((s, t), &[][..], (3, Vec::new())),
        (flipped, &[], (2, unknown(1))),
        // Without codes two postures lie about equally far.
        (flipped, &["--nearest-posture"], (2, unknown(1))),
    ] {
        assert_eq!(told(&cell, &[("a.src", text(codes))], flags), wanted, "{codes:?} {flags:?}");
    }
}

/// Where no codes are heeded a line still leads to its own posture, not to the nearest one.
#[test]
fn a_line_whose_codes_are_not_heeded_is_followed() {
    let cell = Cell::kuka(120);
    let q = wrist([-2.95, 0.6, 2.9]);
    let target = robtarget(&cell.nominal.base_from_tip(&q), &confdata(&wrist([0.0, 0.6, 0.0])));
    let from = jointtarget(&wrist([0.0, 0.6, 0.0]));
    let text = format!(
        "MODULE m\nPROC main()\nMoveAbsJ {from},v100,fine,tool0;\nMoveL {target},v100,fine,tool0;\nENDPROC\nENDMODULE\n"
    );
    let file = cell.write("m.mod", text.as_bytes());
    let new = cell.compensate(&[&file], &["--unordered", "--nearest-posture"]).expect(0).text("m.mod");
    let line = new.lines().find(|l| l.starts_with("MoveL")).unwrap();
    assert_brings_to(&cell, &pose(&numbers(line)), &q, line);
}

/// From a stretched wrist a path leads to either side of it: the nearest posture is taken, not that of a sign that is noise.
#[test]
fn a_path_from_a_singular_posture_leads_to_either_side_of_it() {
    let cell = Cell::kuka(130);
    let rad = |q: [f64; 6]| q.map(f64::to_radians).to_vec();
    for side in [1.0, -1.0] {
        for fourth in [0.0, 60.0] {
            let ends = [rad([4.0, -86.0, 95.0, 0.0, 12.0 * side, 0.0]), rad([8.0, -82.0, 99.0, 0.0, 25.0 * side, 0.0])];
            let from = krl_joints(&rad([0.0, -90.0, 90.0, fourth, 0.0, -fourth]));
            let to = ends.iter().map(|q| krl_pose(&cell, q)).collect::<Vec<_>>().join(",");
            let text = format!("DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nPTP {from}\nCIRC {to}\nEND\n");
            let file = cell.write("a.src", text.as_bytes());
            // The first one is singular itself, and may stay.
            let new = cell.compensate(&[&file], &["--unordered"]).text("a.src");
            assert_eq!(poses_of(&new, "CIRC").len(), ends.len(), "{new}");
            for (pose, q) in poses_of(&new, "CIRC").iter().zip(&ends) {
                assert_brings_to(&cell, &krl_frame(pose), q, pose);
            }
        }
    }
}
