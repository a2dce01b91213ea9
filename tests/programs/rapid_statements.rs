//! Where statements of RAPID begin, and the frames of points to which no known move goes.

use crate::programs_support::text::{
    TOOL, WORK, assert_tool_meets, confdata, frames, jointtarget, lines, pose, tool_robtarget as robtarget,
};
use crate::programs_support::{Cell, Run};
use robotcal::programs::LeftReason;

/// A posture away from singular ones, rad.
const START: [f64; 6] = [0.17, -1.4, 1.7, 0.35, 0.7, 0.5];

/// A little beside it.
fn beside(k: usize) -> Vec<f64> {
    START.iter().enumerate().map(|(i, q)| q + 0.02 * ((7 * k + i) as f64).sin()).collect()
}

/// A module with the robtargets `p1` to `p9` in `tGun` and `wTable`; `@` stands for such a robtarget, `#` for a jointtarget.
fn module(cell: &Cell, body: &str) -> String {
    let (tool, base) = frames();
    let point = |k: usize| robtarget(cell, &beside(k), &tool, &base, &confdata(&beside(k)));
    let declared = (1..10).filter(|k| body.contains(&format!("p{k}")));
    let points: String = declared.map(|k| format!("CONST robtarget p{k}:={};\n", point(k))).collect();
    let mut text = format!("MODULE m\n{TOOL}{WORK}{points}PROC main()\n{body}\nENDPROC\nENDMODULE\n");
    text = text.replace('#', &jointtarget(&START));
    for k in 11.. {
        let Some(at) = text.find('@') else { break };
        text.replace_range(at..=at, &point(k));
    }
    text
}

pub(super) fn run(cell: &Cell, body: &str, flags: &[&str]) -> (String, Run) {
    let text = module(cell, body);
    let file = cell.write("m.mod", text.as_bytes());
    (text, cell.compensate(&[&file], &[&["--unordered"], flags].concat()))
}

/// Asserts that all robtargets of `tGun` and `wTable` of a text, declared ones first, are met by the real robot.
fn assert_all_meet(cell: &Cell, old: &str, new: &str, names: &[usize]) {
    let (tool, base) = frames();
    let points = |text: &str| lines(text, "[0,").into_iter().filter(|n| n.len() > 16).collect::<Vec<_>>();
    let (old, new) = (points(old), points(new));
    assert_eq!((old.len(), new.len()), (names.len(), names.len()));
    for ((old, new), k) in old.iter().zip(&new).zip(names) {
        assert_ne!(old[..3], new[..3]);
        assert_tool_meets(cell, &tool, &(base * pose(old)), &(base * pose(new)), &beside(*k), 1e-6, &k.to_string());
    }
}

#[test]
fn moves_behind_conditions_of_one_line_and_over_several_lines_are_corrected() {
    let cell = Cell::kuka(91);
    let end = "v1,z1,tGun\\WObj:=wTable;";
    for (body, targets, points) in [
        (format!("MoveAbsJ #,v1,z1,tGun;\nIF di1=1 MoveAbsJ #,v1,z1,tGun;\nIF di1=1 MoveL @,{end}"), 3, vec![11]),
        (format!("IF (a OR b{{2}}) AND NOT f(x) MoveJ p1,{end}\nIF a MoveL Offs(p1,0,0,9),{end}"), 2, vec![1]),
        (format!("MoveJ\n p1,{end}\nMoveL\n  @,\n{end}"), 2, vec![1, 11]),
        (format!("IF a=1\n  MoveJ p1,{end} IF r.b MoveJ @,{end}"), 2, vec![1, 11]),
        (format!("IF a THEN MoveJ p1,{end} ELSE MoveJ @,{end} ENDIF MoveJ p2,{end}"), 3, vec![1, 2, 11]),
        (format!("WHILE a AND\n b DO MoveJ p1,{end} ENDWHILE\nhere: MoveJ @,{end}"), 2, vec![1, 11]),
        (format!("TEST n CASE 1,\n k: MoveJ p1,{end}\nDEFAULT: MoveJ @,{end} ENDTEST"), 2, vec![1, 11]),
        (
            format!("ENDPROC\nPROC go(\n  num x,\n  num y)\nMoveJ p1,{end}\nERROR (A,\n B)\nMoveJ @,{end}"),
            2,
            vec![1, 11],
        ),
        (format!("IF a %\"go\"+x% p1;\nMoveJ p1,{end}"), 1, vec![1]),
    ] {
        let (text, run) = run(&cell, &body, &[]);
        let run = run.expect(0);
        assert_eq!(run.told().corrected, targets, "{body}");
        assert_all_meet(&cell, &text, &run.text("m.mod"), &points);
    }
}

#[test]
fn tools_and_work_objects_of_moves_behind_conditions_are_held_against_each_other() {
    let cell = Cell::kuka(92);
    let second = ["tool0\\WObj:=wTable", "tGun\\WObj:=wobj0", "tGun"].map(|s| format!("IF di1=1 MoveJ p1,v1,z1,{s};"));
    let moved = second.map(|second| format!("MoveJ p1,v1,z1,tGun\\WObj:=wTable;\n{second}"));
    // Nor do two uses count that are no known moves.
    let used = "CapL p1,v1,cap,tGun\\WObj:=wTable;\nCapL p1,v1,cap,tGun\\WObj:=wobj0;".to_owned();
    let reason = LeftReason::FramesDiffer.name();
    for body in moved.into_iter().chain([used]) {
        let (text, run) = run(&cell, &body, &[]);
        let told = run.expect(1);
        assert_eq!(told.text("m.mod"), text, "what both ask for differs, and so neither gets it");
        let told = told.told();
        assert_eq!((told.corrected, told.left.first().map(|(.., r)| r.as_str())), (0, Some(reason)), "{told:?}");
    }
}

#[test]
fn a_point_whose_two_work_objects_ask_for_the_same_correction_gets_it() {
    let cell = Cell::kuka(98);
    let near = WORK.replace("wTable", "wNear").replace("20.5]", "20.5000001]");
    let body =
        format!("MoveJ p1,v1,z1,tGun\\WObj:=wTable;\nMoveJ p1,v1,z1,tGun\\WObj:=wNear;\nENDPROC\n{near}PROC other()");
    let (text, run) = run(&cell, &body, &[]);
    let run = run.expect(0);
    assert_eq!(run.told().corrected, 2);
    assert_all_meet(&cell, &text, &run.text("m.mod"), &[1]);
}

#[test]
fn a_condition_over_several_lines_begins_the_statement_that_its_end_closes() {
    let cell = Cell::kuka(93);
    let end = "\nMoveJ p1,v1,z1,tGun\\WObj:=wTable;";
    let displaced = "PDispSet [[100,0,0],[1,0,0,0],[0,0,0],[0,0,0]];\n";
    let frame = LeftReason::FrameUnknown.name();
    for (body, left) in [
        (format!("{displaced}IF a AND\n b THEN\nPDispOff;\nENDIF{end}"), vec![frame]),
        (format!("{displaced}IF a\nTHEN\nPDispOff;\nENDIF{end}"), vec![frame]),
        (format!("{displaced}IF a\nPDispOff;{end}"), vec![frame]),
        (format!("{displaced}IF a OR\n b THEN\nPDispOff;\nELSE\nPDispOff;\nENDIF{end}"), vec![]),
        (format!("IF a\n{displaced}{end}"), vec![frame]),
        (format!("{displaced}PDispOff;IF a{end}"), vec![]),
    ] {
        let told = run(&cell, &body, &[]).1.told();
        assert_eq!(told.left.iter().map(|(.., reason)| reason.as_str()).collect::<Vec<_>>(), left, "{body}");
    }
}

#[test]
fn points_to_which_no_known_move_goes_are_corrected_in_the_frames_that_are_named_or_left() {
    let cell = Cell::kuka(94);
    let told_tool = ["--tool=97.4,0,223.1,0.924,0,0.382389,0"];
    let told_work = ["--work=279.75,-60,23.5,0.707106781,0,0,0.707106781"];
    let unvisited = vec![LeftReason::Unvisited.name().to_owned()];
    let own = "CapL p1,v1,cap,start,w,fine,tGun\\WObj:=wTable;";
    for (body, flags, corrected) in [
        ("! p1 alone", vec![], 0),
        ("! p1 alone", told_tool.to_vec(), 0),
        ("! p1 alone", [told_tool, told_work].concat(), 1),
        (own, vec![], 1),
        (own, vec!["--tool=0,0,9,1,0,0,0", "--work=0,0,9,1,0,0,0"], 1),
        ("CapL p1,v1,cap,tGun;", told_tool.to_vec(), 0),
        ("Grip p1;", told_tool.to_vec(), 0),
        ("PDispOn p1,tGun\\WObj:=wTable;", [told_tool, told_work].concat(), 0),
        ("pHere:=Offs(p1,0,0,9);", [told_tool, told_work].concat(), 0),
    ] {
        let (text, run) = run(&cell, body, &flags);
        let told = run.told();
        let left: Vec<String> = told.left.iter().map(|(.., reason)| reason.clone()).collect();
        let wanted = if corrected == 1 { vec![] } else { unvisited.clone() };
        assert_eq!((told.corrected, left), (corrected, wanted), "{body} {flags:?}");
        if body == own {
            assert_all_meet(&cell, &text, &run.text("m.mod"), &[1]);
        }
    }
}

#[test]
fn a_move_that_names_no_work_object_is_in_that_of_the_world_whatever_the_flags_say() {
    let cell = Cell::kuka(95);
    let world = nalgebra::Vector3::new(0.3, -0.06, 0.0205);
    let (tool, _) = frames();
    let target = robtarget(&cell, &beside(1), &tool, &robotcal::geom::Pose::identity(), &confdata(&beside(1)));
    let body = format!("MoveJ {target},v1,z1,tGun;\nMoveAbsJ #,v1,z1,tGun;");
    let flag = format!("--work={},{},{},1,0,0,0", 1e3 * world.x, 1e3 * world.y, 1e3 * world.z);
    let texts = [&[][..], &[flag.as_str()]].map(|flags| run(&cell, &body, flags).1.expect(0).text("m.mod"));
    assert_eq!(texts[0], texts[1]);
}

#[test]
fn instructions_of_the_controller_that_move_are_corrected_in_any_case() {
    let cell = Cell::kuka(96);
    let end = "v1,z1,tGun\\WObj:=wTable;";
    for (names, arguments, targets) in [
        (&["MoveJ", "movel", "MOVEJDO", "MoveLSync", "MoveLAO", "MoveJGO", "TriggJ", "TriggLIOs"][..], "@", 1),
        (&["ArcL", "ArcLStart", "arcl1", "ArcL2End", "ArcMoveL", "SpotL", "SpotJ", "SpotML"], "@", 1),
        (&["MoveC", "movecdo", "MoveCSync", "TriggC", "ArcC", "ArcCEnd", "ArcC1Start", "ArcMoveC"], "@,\n@", 2),
        (&["SearchL", "searchl \\Stop,"], "di1,pFound,@", 1),
        (&["SearchC"], "di1,pFound,@,\n@", 2),
    ] {
        for name in names {
            let (text, run) = run(&cell, &format!("{name} {arguments},{end}"), &[]);
            let run = run.expect(0);
            assert_eq!(run.told().corrected, targets, "{name}");
            let points: Vec<usize> = (11..11 + targets).collect();
            assert_all_meet(&cell, &text, &run.text("m.mod"), &points);
        }
    }
}

#[test]
fn routines_whose_names_begin_as_those_of_instructions_are_calls() {
    let cell = Cell::kuka(97);
    let step = "MoveJ @,v1,z1,tGun\\WObj:=wTable;";
    let home = "MoveAbsJ #,v1,z1,tGun;";
    for (body, targets) in [
        (format!("MoveHome\\Fast;\n{step}\nENDPROC\nPROC MoveHome(\\switch Fast)\n{home}"), 2),
        (format!("movehome\\Fast;\n{step}\nENDPROC\nLOCAL PROC MoveHome(\\switch Fast)\n{home}"), 2),
        (format!("IF di1=1 MoveHome\\Fast;\n{step}\nENDPROC\nPROC MoveHome(\\switch Fast)\n{home}"), 2),
        (format!("MoveHome\\Fast;\n{step}"), 1),
        (format!("SpotGunOff\\G1;\n{step}"), 1),
        (format!("ArcKill\\Now;\nArcRefresh\\UpdateWeld;\n{step}"), 1),
        (format!("TriggCheckIO check,100,di1,EQ,1,iCheck;\n{step}"), 1),
        (format!("MoveToStation 3;\nMoveGripper 20,TRUE;\n{step}\nENDPROC\nPROC MoveToStation(num n)\n{home}"), 2),
        (format!("ArcL 3;\n{step}\nENDPROC\nPROC ArcL(num n)\n{home}"), 2),
    ] {
        let (text, run) = run(&cell, &body, &[]);
        let run = run.expect(0);
        assert_eq!(run.told().corrected, targets, "{body}");
        assert_all_meet(&cell, &text, &run.text("m.mod"), &[11]);
    }
}

#[test]
fn a_displacement_that_such_a_routine_begins_holds_behind_its_call() {
    let cell = Cell::kuka(98);
    let step = "MoveJ @,v1,z1,tGun\\WObj:=wTable;";
    let shift = "PDispSet [[100,0,0],[1,0,0,0],[0,0,0],[0,0,0]];";
    let frame = vec![LeftReason::FrameUnknown.name().to_owned()];
    for (call, name) in [("MoveFrame\\On;", "MoveFrame"), ("SearchFrame 3;", "SearchFrame"), ("ArcL;", "ArcL")] {
        let body = format!("{call}\n{step}\nENDPROC\nPROC {name}()\n{shift}");
        let told = run(&cell, &body, &[]).1.told();
        let left: Vec<String> = told.left.into_iter().map(|(.., reason)| reason).collect();
        assert_eq!((told.corrected, &left), (0, &frame), "{body}");
    }
}

#[test]
fn points_of_an_unknown_routine_are_not_taken_for_those_of_the_world() {
    let cell = Cell::kuka(99);
    let told_work = "--work=279.75,-60,23.5,0.707106781,0,0,0.707106781";
    let (computed, unvisited) = (LeftReason::Computed.name(), LeftReason::Unvisited.name());
    let own = |name: &str, call: &str| {
        format!(
            "{call}\nENDPROC\nPROC {name}(robtarget p,speeddata v,zonedata z,PERS tooldata t)\nMoveJ p,v,z,t\\WObj:=wTable;"
        )
    };
    for (body, flags, corrected, left) in [
        ("MovePick p1,v1,z1,tGun;".to_owned(), vec![], 0, vec![unvisited]),
        ("ArcPick p1,v1,z1,tGun;".to_owned(), vec![], 0, vec![unvisited]),
        ("SearchEdge p1,v1,z1,tGun;".to_owned(), vec![], 0, vec![unvisited]),
        ("MovePick p1,v1,z1,tGun;".to_owned(), vec![told_work], 1, vec![]),
        ("MovePick p1,v1,z1,tGun\\WObj:=wTable;".to_owned(), vec![], 1, vec![]),
        (own("MovePick", "MovePick p1,v1,z1,tGun;"), vec![], 0, vec![computed, unvisited]),
        (own("SpotL", "SpotL p1,v1,z1,tGun;"), vec![], 0, vec![computed, unvisited]),
        ("MovePick @,v1,z1,tGun;".to_owned(), vec![], 0, vec![LeftReason::NotATarget.name()]),
        (
            "MovePick [[300,0,400],[0,0,1,0],[0,0,0,0],ext0],v1,z1,tGun;".to_owned(),
            vec![],
            0,
            vec![LeftReason::NotATarget.name()],
        ),
    ] {
        let (text, run) = run(&cell, &body, &flags);
        let told = run.told();
        let mut found: Vec<&str> = told.left.iter().map(|(.., reason)| reason.as_str()).collect();
        found.sort_unstable();
        assert_eq!((told.corrected, found), (corrected, left), "{body} {flags:?}");
        if corrected == 1 {
            assert_all_meet(&cell, &text, &run.text("m.mod"), &[1]);
        } else {
            assert_eq!(text, run.text("m.mod"), "{body}");
        }
    }
}

/// `\WObj?w` hands on what the routine may have been given, or nothing.
#[test]
fn a_work_object_that_may_be_handed_on_or_not_is_not_known() {
    let cell = Cell::kuka(215);
    let frame = LeftReason::FrameUnknown.name();
    let go = |step: &str| format!("go\\w:=wTable;\nENDPROC\nPROC go(\\PERS wobjdata w\\PERS loaddata load)\n{step}");
    let all = ["--work=279.75,-60,23.5,0.707106781,0,0,0.707106781"];
    for (body, flags, corrected, left) in [
        (go("MoveL p1,v1,z1,tGun\\WObj?w;"), vec![], 0, vec![frame]),
        (go("MoveL p1,v1,z1,tGun\\WObj?w;"), all.to_vec(), 0, vec![frame]),
        (go("MoveL @,v1,z1,tGun\\WObj?w\\TLoad?load;"), vec![], 0, vec![frame]),
        (go("MoveL @,v1\\V?x,z1,tGun\\TLoad?load\\WObj:=wTable;"), vec![], 1, vec![]),
        (go("MoveL\\Conc?x,@,v1,z1,tGun\\WObj:=wTable;"), vec![], 1, vec![]),
        (go("CapL p1,v1,tGun\\WObj?w;"), all.to_vec(), 0, vec![LeftReason::Unvisited.name()]),
        // A computed one is not told anywhere.
        ("MoveL @,v1,z1,tGun\\WObj:=(wA);".to_owned(), vec![], 0, vec![frame]),
        ("MoveL @,v1,z1,tGun\\WObj:=(wA);".to_owned(), all.to_vec(), 1, vec![]),
        ("MoveL @,v1,z1,tGun\\WObj:=wList{i};".to_owned(), vec![], 0, vec![frame]),
        ("MoveL @,v1,z1,tGun\\WObj:=wList{i};".to_owned(), all.to_vec(), 1, vec![]),
    ] {
        let told = run(&cell, &body, &flags).1.told();
        let found: Vec<&str> = told.left.iter().map(|(.., reason)| reason.as_str()).collect();
        assert_eq!((told.corrected, found), (corrected, left), "{body} {flags:?}");
    }
}

/// What a routine sets that it is given by way of another one, which may have been given it or not.
#[test]
fn a_point_that_is_handed_on_as_it_may_be_is_computed_where_it_is_set() {
    let cell = Cell::kuka(216);
    let computed = vec![LeftReason::Computed.name().to_owned()];
    let routines = "ENDPROC\nPROC outer(\\VAR robtarget a)\ninner\\b?a;\nENDPROC\nPROC inner(\\VAR robtarget b)";
    for (inner, left) in [("b.trans.z:=9;", computed), ("TPWrite \"\";", vec![])] {
        let body = format!("MoveJ p1,v1,z1,tGun\\WObj:=wTable;\nouter\\a:=p1;\n{routines}\n{inner}");
        let text = module(&cell, &body).replace("CONST robtarget", "VAR robtarget");
        let file = cell.write("m.mod", text.as_bytes());
        let told = cell.compensate(&[&file], &["--unordered"]).told();
        let found: Vec<String> = told.left.into_iter().map(|(.., reason)| reason).collect();
        assert_eq!((told.corrected, &found), (1 - left.len(), &left), "{inner}");
    }
}

#[test]
fn moves_whose_path_something_else_corrects_are_left() {
    let cell = Cell::kuka(217);
    let (work, frame) = ("\\WObj:=wTable;", LeftReason::FrameUnknown.name());
    for (body, corrected, left) in [
        (format!("MoveL @,v1,z1,tGun\\Corr{work}"), 0, vec![frame]),
        (format!("MoveL @,v1,z1,tGun{work}\nMoveL p1,v1,z1,tGun\\WObj:=wTable\\Corr;"), 1, vec![frame]),
        (format!("MoveL p1,v1,z1,tGun{work}\nMoveL Offs(p1,0,0,9),v1,z1,tGun\\Corr?x{work}"), 1, vec![frame]),
        (format!("MoveC @,@,v1,z1,tGun\\Corr{work}"), 0, vec![frame, frame]),
        (
            format!("ArcL @,v1,seam,weld,z1,tGun\\WObj:=wTable\\Track:=follow;\nMoveL @,v1,z1,tGun{work}"),
            1,
            vec![frame],
        ),
        (format!("CorrCon id;\nMoveL @,v1,z1,tGun{work}\nMoveAbsJ #,v1,z1,tGun;"), 2, vec![]),
    ] {
        assert_told(&cell, &body, corrected, &left);
    }
}

/// Asserts how many targets are corrected, and the reasons of those that are left.
pub(super) fn assert_told(cell: &Cell, body: &str, corrected: usize, left: &[&str]) {
    let told = run(cell, body, &[]).1.told();
    let found: Vec<&str> = told.left.iter().map(|(.., reason)| reason.as_str()).collect();
    assert_eq!((told.corrected, found), (corrected, left.to_vec()), "{body}");
}

/// Where an instruction fails, or a routine that it calls, the handler is entered with what held there.
#[test]
fn a_handler_of_rapid_begins_with_all_that_its_routine_has_passed_through() {
    let cell = Cell::kuka(218);
    let step = "MoveJ @,v1,z1,tGun\\WObj:=wTable;";
    let shift = "PDispSet [[100,0,0],[1,0,0,0],[0,0,0],[0,0,0]];\nSearchIt;\nPDispOff;";
    let frame = LeftReason::FrameUnknown.name();
    for handler in ["ERROR", "UNDO", "BACKWARD"] {
        for (body, corrected, left) in [
            (format!("{step}\n{handler}\n{step}"), 2, vec![]),
            (format!("{shift}\n{step}\n{handler}\n{step}"), 1, vec![frame]),
            (format!("{shift}\n{step}\n{handler}\nPDispOff;\n{step}"), 2, vec![]),
            (format!("IF a THEN\n{shift}\nENDIF\n{step}\n{handler}\n{step}"), 1, vec![frame]),
            (format!("IF a THEN\n{shift}\nRETURN;\nENDIF\n{step}\n{handler}\n{step}"), 1, vec![frame]),
            (format!("Shift;\n{step}\n{handler}\n{step}\nENDPROC\nPROC Shift()\n{shift}"), 1, vec![frame]),
            (format!("{step}\n{handler}\n{step}\nENDPROC\nPROC Shift()\n{shift}"), 2, vec![]),
            // Codes may count or not, and nothing tells the way.
            (
                format!("ConfJ\\Off;\nSearchIt;\nConfJ\\On;\n{step}\n{handler}\n{step}"),
                1,
                vec![LeftReason::PostureUnknown.name()],
            ),
        ] {
            assert_told(&cell, &body, corrected, &left);
        }
    }
}

/// `MoveExtJ` leaves the arm where it is.
#[test]
fn a_jointtarget_of_external_axes_alone_is_none_of_the_arm() {
    let cell = Cell::kuka(351);
    let step = "MoveJ @,v1,z1,tGun\\WObj:=wTable;";
    let none = "9E9,9E9,9E9,9E9,9E9,9E9";
    let [no_target, external_axis] = [LeftReason::NotATarget, LeftReason::ExternalAxis].map(LeftReason::name);
    // Behind it the axis stands where it was moved to, and the pose leaves it there.
    for (at, corrected, left) in [("0", 1, vec![]), ("10", 0, vec![external_axis])] {
        let external = format!("[[{none}],[{at},9E9,9E9,9E9,9E9,9E9]]");
        let declared =
            format!("MoveExtJ jExt,v1,z1;\n{step}\nENDPROC\nCONST jointtarget jExt:={external};\nPROC Last()");
        assert_told(&cell, &declared, corrected, &left);
        let left = [vec![no_target], left].concat();
        assert_told(&cell, &format!("MoveAbsJ {external},v1,z1,tGun;\n{step}"), corrected, &left);
    }
}

/// Such a program was refused as a whole.
#[test]
fn a_target_made_of_parts_of_others_is_computed() {
    let cell = Cell::kuka(352);
    let computed = LeftReason::Computed.name();
    let go = |target: &str| format!("MoveJ p1,v1,z1,tGun\\WObj:=wTable;\nMoveL {target},v1,z1,tGun\\WObj:=wTable;");
    for target in ["[p1.trans,p1.rot,p1.robconf,p1.extax]", "[[300,0,400],p1.rot,p1.robconf,p1.extax]"] {
        assert_told(&cell, &go(target), 1, &[computed]);
    }
    // The external axes alone may move what the arm stands on.
    assert_told(&cell, &go("[[300,0,400],[0,0,1,0],[0,0,0,0],p1.extax]"), 1, &[computed]);
    let none = "9E9,9E9,9E9,9E9,9E9,9E9";
    for target in [format!("[jHere.robax,[{none}]]"), "[[1,2,3,4,5,6],jHere.extax]".to_owned()] {
        assert_told(&cell, &format!("MoveAbsJ #,v1,z1,tGun;\nMoveAbsJ {target},v1,z1,tGun;"), 1, &[computed]);
    }
}

/// `VAR robtarget p:=[[0,0,0],[0,0,0,0],..]` is how data are declared that get their value later.
#[test]
fn a_robtarget_without_a_value_keeps_nothing_else_from_being_corrected() {
    let cell = Cell::kuka(99);
    let end = "v1,z1,tGun\\WObj:=wTable;";
    let none = "[[0,0,0],[0,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";
    let declared = format!("VAR robtarget pLater:={none};\n");
    let [computed, no_target] = [LeftReason::Computed, LeftReason::NotATarget].map(LeftReason::name);
    for (body, left) in [
        (format!("MoveJ p1,{end}"), vec![]),
        (format!("MoveJ p1,{end}\npLater:=CRobT();\nMoveL pLater,{end}"), vec![computed]),
        (format!("MoveJ p1,{end}\nMoveL pLater,{end}"), vec![no_target]),
    ] {
        let text = module(&cell, &body).replace("PROC main()", &format!("{declared}PROC main()"));
        let file = cell.write("m.mod", text.as_bytes());
        let told = cell.compensate(&[&file], &["--unordered"]).expect(i32::from(!left.is_empty())).told();
        assert_eq!(told.corrected, 1, "{body}");
        assert_eq!(told.left.iter().map(|(.., reason)| reason.as_str()).collect::<Vec<_>>(), left, "{body}");
    }
    let tool = "PERS tooldata tLater:=[TRUE,[[0,0,0],[0,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n";
    let text =
        module(&cell, "MoveJ p1,v1,z1,tLater\\WObj:=wTable;").replace("PROC main()", &format!("{tool}PROC main()"));
    let file = cell.write("m.mod", text.as_bytes());
    let told = cell.compensate(&[&file], &["--unordered"]).expect(1).told();
    assert_eq!(told.left[0].2, LeftReason::ToolUnknown.name(), "{told:?}");
}

/// Under `EGMRunPose` and `EGMRunJoint` the robot goes where something else tells it.
#[test]
fn behind_a_guided_motion_the_posture_is_not_known() {
    let cell = Cell::kuka(100);
    let end = "v1,z1,tGun\\WObj:=wTable;";
    let begin = "ConfL\\Off;\nMoveAbsJ #,v1,z1,tGun;\n";
    for (between, is_known) in [
        ("WaitTime 1;", true),
        ("EGMRunPose id,EGM_STOP_HOLD\\x;", false),
        ("EGMRunJoint id,EGM_STOP_HOLD\\J1;", false),
    ] {
        let told = run(&cell, &format!("{begin}{between}\nMoveL @,{end}"), &[]).1.told();
        let left: Vec<_> = told.left.iter().map(|(.., reason)| reason.as_str()).collect();
        let wanted = if is_known { vec![] } else { vec![LeftReason::PostureUnknown.name()] };
        assert_eq!(left, wanted, "{between}");
    }
}
