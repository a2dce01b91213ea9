//! Routines of KRL that interrupts and triggers run, and frames that these set, at a time that the text does not tell.

use crate::programs_support::text::{beside, krl_moves, krl_pose as krl, krl_text, told};
use crate::programs_support::{Cell, assert_brings_to, krl_frame, numbers};
use crate::ways;
use robotcal::programs::LeftReason;

const INTERRUPT: &str = "INTERRUPT DECL 10 WHEN $IN[1]==TRUE DO h( )\nINTERRUPT ON 10\n";
const TRIGGER: &str = "TRIGGER WHEN DISTANCE=1 DELAY=0 DO h( ) PRIO=-1\n";

#[test]
fn what_a_handler_sets_may_hold_behind_every_motion_and_what_is_stated_again_holds() {
    let cell = Cell::kuka(141);
    let pose = krl(&cell, &beside(0));
    let (tool, work) = (LeftReason::ToolUnknown.name(), LeftReason::FrameUnknown.name());
    let set = "SET\nEND\nDEF h()\n$TOOL=$NULLFRAME";
    let spline = format!("MOVE\nSET\nSPLINE\nSPL {pose}\nSPL {pose}\nENDSPLINE\nMOVE\n{set}");
    for (body, corrected, left) in [
        (format!("{INTERRUPT}MOVE\nEND\nDEF h()\nBRAKE"), 1, vec![]),
        (format!("{INTERRUPT}MOVE\nEND\nDEF h()\nSET"), 0, vec![tool]),
        (format!("GLOBAL {INTERRUPT}MOVE\nEND\nDEF h()\nSET"), 0, vec![tool]),
        (format!("{TRIGGER}MOVE\nEND\nDEF h()\nSET"), 0, vec![tool]),
        (format!("{TRIGGER}MOVE\nEND\nDEF h()\n$BASE=BASE_DATA[2]"), 0, vec![work]),
        (format!("{INTERRUPT}MOVE\nEND\nDEF h()\nsub()\nEND\nDEF sub()\nSET"), 0, vec![tool]),
        ("TRIGGER WHEN DISTANCE=0 DELAY=5 DO $TOOL=TOOL_DATA[2]\nMOVE".to_owned(), 0, vec![tool]),
        ("INTERRUPT DECL 4 WHEN $IN[1] DO $BASE=BASE_DATA[2]\nMOVE".to_owned(), 0, vec![work]),
        ("TRIGGER WHEN DISTANCE=0 DELAY=5 DO $OUT[2]=TRUE\nMOVE".to_owned(), 1, vec![]),
        (format!("SET\n{INTERRUPT}MOVE\nMOVE\nEND\nDEF h()\nSET"), 2, vec![]),
        (format!("MOVE\n{INTERRUPT}SET\nMOVE\nSET\nMOVE\n{set}"), 3, vec![]),
        (format!("{INTERRUPT}SET\nMOVE\nMOVE\n{set}"), 1, vec![tool]),
        (format!("{INTERRUPT}SET\nWAIT SEC 1\nMOVE\n{set}"), 0, vec![tool]),
        (format!("{INTERRUPT}SET\nWEAVE()\nMOVE\n{set}"), 0, vec![tool]),
        (format!("{INTERRUPT}SET\nR=SIN(3)\nMOVE\n{set}"), 1, vec![]),
        (format!("{INTERRUPT}sub()\nEND\nDEF sub()\nSET\nMOVE\nMOVE\n{set}"), 1, vec![tool]),
        (format!("{INTERRUPT}SET\n{spline}"), 3, vec![tool]),
    ] {
        let left: Vec<String> = left.into_iter().map(str::to_owned).collect();
        assert_eq!(told(&cell, &[("a.src", krl_text(&pose, &body))], &[]), (corrected, left), "{body}");
    }
}

/// `RESUME` goes on behind the routine that was called where the interrupt was declared.
#[test]
fn what_a_routine_sets_for_a_while_may_hold_where_an_interrupt_leaves_it() {
    let cell = Cell::kuka(144);
    let pose = krl(&cell, &beside(0));
    let tool = LeftReason::ToolUnknown.name();
    let (none, handler) = ("$TOOL=$NULLFRAME", "END\nDEF h()\nBRAKE\nRESUME");
    let search = format!("END\nDEF search()\nSET\nMOVE\n{none}\nMOVE");
    for (body, corrected, left) in [
        (format!("{INTERRUPT}search()\nMOVE\n{search}\n{handler}"), 2, vec![tool]),
        (format!("{INTERRUPT}search()\n{none}\nMOVE\n{search}\n{handler}"), 3, vec![]),
        (format!("{INTERRUPT}first()\nMOVE\nEND\nDEF first()\nsearch()\n{search}\n{handler}"), 2, vec![tool]),
        (format!("{INTERRUPT}search()\nMOVE\n{search}\nEND\nDEF h()\nBRAKE"), 3, vec![]),
        (format!("search()\nMOVE\n{search}\n{handler}"), 3, vec![]),
        (format!("{INTERRUPT}search()\nMOVE\nEND\nDEF search()\nMOVE\n{handler}"), 2, vec![]),
        // It may have been left before it has set anything.
        (format!("{INTERRUPT}search()\nMOVE\nEND\nDEF search()\nMOVE\nSET\n{handler}"), 1, vec![tool]),
        (format!("{INTERRUPT}search()\nMOVE\nEND\nDEF search()\nMOVE\nSET\nEND\nDEF h()\nBRAKE"), 2, vec![]),
    ] {
        let left: Vec<String> = left.into_iter().map(str::to_owned).collect();
        assert_eq!(told(&cell, &[("a.src", krl_text(&pose, &body))], &[]), (corrected, left), "{body}");
    }
}

#[test]
fn a_handler_begins_with_unknown_frames_and_the_main_program_keeps_its_own() {
    let cell = Cell::kuka(142);
    let pose = krl(&cell, &beside(0));
    let moves = |body: &str| {
        let all = krl_moves(&cell, &krl_text(&pose, body));
        all.iter().map(|line| numbers(line)).collect::<Vec<_>>()
    };
    let is_same = |a: &Vec<f64>, b: &Vec<f64>| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-3);
    let [flange, other] = ["MOVE", "SET\nMOVE"].map(|body| moves(body)[0].clone());
    let as_it_was = numbers(&pose);
    assert!(!is_same(&flange, &other) && !is_same(&flange, &as_it_was) && !is_same(&other, &as_it_was));
    for (handler, wanted, reason) in [
        ("MOVE", &as_it_was, Some(LeftReason::FrameUnknown)),
        ("$BASE=$NULLFRAME\nMOVE", &as_it_was, Some(LeftReason::ToolUnknown)),
        ("$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nMOVE", &flange, None),
        ("SET\n$BASE=$NULLFRAME\nMOVE\n$TOOL=$NULLFRAME", &other, None),
    ] {
        for begins in [INTERRUPT, TRIGGER] {
            let body = format!("{begins}MOVE\nMOVE\nEND\nDEF h()\nBRAKE\n{handler}\nRESUME");
            let found = moves(&body);
            assert_eq!(found.len(), 3);
            let same = found.iter().zip([&flange, &flange, wanted]).filter(|(a, b)| is_same(a, b)).count();
            assert_eq!(same, 3, "{body}\n{found:?}");
            let left: Vec<String> = reason.iter().map(|reason| reason.name().to_owned()).collect();
            let told = told(&cell, &[("a.src", krl_text(&pose, &body))], &[]);
            assert_eq!(told, (3 - left.len(), left), "{body}");
        }
    }
    // Called elsewhere, too, it has the frames of that call or any others.
    let body = format!("{INTERRUPT}h()\nMOVE\nEND\nDEF h()\nMOVE");
    let found = moves(&body);
    assert!(is_same(&found[0], &flange) && is_same(&found[1], &as_it_was), "{found:?}");
}

#[test]
fn the_posture_of_the_main_program_goes_on_behind_the_declaration_of_a_handler_that_moves() {
    let cell = Cell::kuka(143);
    for begins in [INTERRUPT, TRIGGER] {
        let body = format!("{begins}LIN @\nEND\nDEF h()\nPTP <O>\n");
        let file = cell.write("a.src", ways::krl(&cell, &body).as_bytes());
        let new = cell.compensate(&[&file], &["--unordered"]).expect(0).text("a.src");
        let line = new.lines().find(|line| line.starts_with("LIN")).unwrap();
        assert_brings_to(&cell, &krl_frame(line), &beside(1), line);
    }
    let body = format!("{INTERRUPT}LIN @\nEND\nDEF h()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nLIN @\n");
    let told = told(&cell, &[("a.src", ways::krl(&cell, &body))], &[]);
    assert_eq!(told, (2, vec![LeftReason::PostureUnknown.name().to_owned()]));
}
