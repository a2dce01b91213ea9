//! Declared positions that are no targets, or not only: frames of others, and parts of what is computed.

use crate::programs_support::Cell;
use crate::programs_support::text::krl_pose as krl;
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
        ("LIN XP1 WITH $BASE=XFRAME, $TOOL=$NULLFRAME\n", vec![LeftReason::FramesDiffer], false),
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
        assert_eq!(changed, [true, is_rewritten], "{body}");
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
