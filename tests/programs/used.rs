//! Declared positions that are no targets, or not only: frames of others, and parts of what is computed.

use crate::programs_support::Cell;
use crate::programs_support::text::{krl_pose as krl, script_pose};
use robotcal::geom::Pose;
use robotcal::programs::LeftReason;

#[test]
fn positions_that_are_frames_or_offsets_of_others_stay_as_they_are() {
    let mut cell = Cell::kuka(111);
    let (a, b) = (cell.readings(), cell.readings());
    let dat = |name: &str, q: &[f64]| format!("DECL E6POS {name}={}\n", krl(&cell, q));
    let data = format!("DEFDAT a\n{}{}ENDDAT\n", dat("XP1", &a), dat("XFRAME", &b));
    let flags = ["--unordered", "--tool=0,0,0,0,0,0", "--work=0,0,0,0,0,0"];
    let unvisited = LeftReason::Unvisited;
    for (body, left, is_rewritten) in [
        ("$BASE=XFRAME\n", vec![], false),
        (
            "LIN XP1 WITH $BASE=XFRAME, $TOOL=$NULLFRAME\n",
            vec![LeftReason::FramesDiffer, LeftReason::OutOfReach],
            false,
        ),
        ("LIN XP1:XFRAME\n", vec![LeftReason::Computed, unvisited], false),
        ("XOTHER=XP1:XFRAME\n", vec![unvisited], false),
        ("LIN XFRAME\n$BASE=XFRAME\n", vec![LeftReason::FramesDiffer], false),
        ("LIN XFRAME\n", vec![], true),
        ("GO(XFRAME)\n", vec![], true),
    ] {
        let source = format!("DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nLIN XP1\n{body}END\n");
        let files = [("a.src", source), ("a.dat", data.clone())].map(|(name, text)| cell.write(name, text.as_bytes()));
        let run = cell.compensate(&files.each_ref(), &flags).expect(i32::from(!left.is_empty()));
        let mut found: Vec<String> = run.told().left.into_iter().map(|(.., reason)| reason).collect();
        found.sort();
        let wanted: Vec<String> = left.iter().map(|reason| reason.name().to_owned()).collect();
        assert_eq!(found, wanted, "{body}");
        let line = |text: &str, name: &str| {
            let key = format!("E6POS {name}=");
            text.lines().find(|l| l.contains(&key)).map(str::to_owned)
        };
        let changed = ["XP1", "XFRAME"].map(|name| line(&run.text("a.dat"), name) != line(&data, name));
        let is_used_apart = body.starts_with("LIN XP1 WITH");
        assert_eq!(changed, [!is_used_apart, is_rewritten], "{body}");
    }
}

#[test]
fn what_is_computed_from_corrected_points_names_them() {
    let mut cell = Cell::kuka(112);
    let q = cell.readings();
    let source = format!(
        "DEF a()\nDECL E6POS XP1\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nXP1={}\nLIN XP1\nLIN XP1:XQ\nEND\n",
        krl(&cell, &q)
    );
    let file = cell.write("a.src", source.as_bytes());
    let run = cell.compensate(&[&file], &["--unordered"]).expect(1);
    let table = run.text("corrections.csv");
    let left = table.lines().find(|l| l.ends_with(LeftReason::Computed.name())).unwrap();
    assert_eq!(left.matches("XP1").count(), 1, "{left}");
}

/// Both uses ask for a correction of their own, and the text has one.
#[test]
fn points_that_are_used_with_two_tools_or_bases_stay_as_they_are_for_both() {
    let mut cell = Cell::kuka(112);
    let q = cell.readings();
    let data = format!("DEFDAT a\nDECL E6POS XP1={}\nENDDAT\n", krl(&cell, &q));
    for (base, left) in [("X 20,Y 10,Z -10,A 5,B 0,C 0", true), ("X 0.0000001,Y 0,Z 0,A 0,B 0,C 0", false)] {
        let source = format!("DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nPTP XP1\n$BASE={{{base}}}\nPTP XP1\nEND\n");
        let files = [("a.src", source), ("a.dat", data.clone())].map(|(name, text)| cell.write(name, text.as_bytes()));
        let run = cell.compensate(&files.each_ref(), &["--unordered"]).expect(i32::from(left));
        let told = run.told();
        assert_eq!((told.corrected, told.left.len()), if left { (0, 1) } else { (2, 0) }, "{told:?}");
        assert!(told.left.iter().all(|(.., reason)| reason == LeftReason::FramesDiffer.name()), "{told:?}");
        assert_eq!(run.text("a.dat") == data, left, "{base}");
    }
    let mut cell = Cell::ur(113);
    let q = cell.readings();
    let tool = |z: f64| Pose::from_xyz_rpy([0.01, -0.02, z], [0.0; 3]);
    let joints: Vec<String> = q.iter().map(|v| format!("{v:.8}")).collect();
    let (joints, pose) = (joints.join(","), script_pose(&(cell.nominal.base_from_tip(&q) * tool(0.15))));
    let text = format!(
        "def p():\n  A={pose}\n  set_tcp(p[0.01,-0.02,0.15,0,0,0])\n  movej([{joints}])\n  movel(A)\n  set_tcp(p[0.01,-0.02,0.14,0,0,0])\n  movel(A)\nend\n"
    );
    let run = cell.compensate(&[&cell.write("p.script", text.as_bytes())], &["--unordered"]).expect(1);
    let told = run.told();
    assert_eq!((told.corrected, told.left.len()), (1, 1), "{told:?}");
    assert_eq!(told.left[0].2, LeftReason::FramesDiffer.name());
    assert!(run.text("p.script").contains(&format!("A={pose}\n")));
}
