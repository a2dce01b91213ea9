//! An arm on a rail that the description has: where the rail stands when a target does not say so.

use std::collections::BTreeMap;
use std::process::Command;

use crate::programs_support::text::{START, UNCHECKED, beside};
use crate::programs_support::{assert_meets, status_turn};
use crate::retarget::on_rail;
use crate::robots::{kr6_urdf, repo};
use robotcal::geom::Pose;
use robotcal::model::robot::Robot;
use robotcal::programs::{
    self, Language, LeftReason, Models, Postures, Program, ProgramSetting, Target, TargetOutcome, TextFile,
};
use robotcal::urdf::{Chain, read};

/// Targets by their lines: corrected readings, or the reason for which they stay as they are.
type Found = BTreeMap<usize, Result<Vec<f64>, LeftReason>>;

/// `axes` are the readings of the program's axes.
fn read_program(chain: &Chain, axes: &[usize], name: &str, text: &str) -> Program {
    let setting = ProgramSetting {
        chain,
        axes,
        rad_per_unit: Some(1.0),
        base: Pose::identity(),
        tool: None,
        work: None,
        axes_apart: false,
    };
    let file = TextFile { name: name.into(), bytes: text.as_bytes().to_vec() };
    programs::read(Language::of_file(name.as_ref()).unwrap(), vec![file], &setting).unwrap()
}

/// Corrects a program of an arm on a rail, which stands at `start_m` where the program says nothing of it.
fn corrected(robot: &(Chain, Robot), name: &str, text: &str, start_m: Option<f64>) -> Found {
    corrected_in(robot, &[1, 2, 3, 4, 5, 6, 0], name, text, start_m)
}

fn corrected_in((chain, real): &(Chain, Robot), axes: &[usize], name: &str, text: &str, start_m: Option<f64>) -> Found {
    let program = read_program(chain, axes, name, text);
    let nominal = Robot::nominal(chain.clone());
    let models = Models { controller: &nominal, from: &nominal, to: real, frames: None, beyond: [None, None] };
    let start = start_m.map(|m| std::iter::once(m).chain(START).collect());
    let done = programs::compensate(&program, models, &Postures { held: vec![false; 7], start });
    let left = program.left.iter().map(|left| (left.line, Err(left.why.reason)));
    let outcomes = program.targets.iter().zip(done.outcomes).map(|(target, outcome)| match outcome {
        TargetOutcome::Done(correction) => (target.line, Ok(correction.corrected)),
        TargetOutcome::Left(why) => (target.line, Err(why.reason)),
    });
    left.chain(outcomes).collect()
}

/// Why targets stay as they are where `--start` is not given, by their lines.
fn words((chain, real): &(Chain, Robot), name: &str, text: &str) -> BTreeMap<usize, String> {
    let program = read_program(chain, &[1, 2, 3, 4, 5, 6, 0], name, text);
    let nominal = Robot::nominal(chain.clone());
    let models = Models { controller: &nominal, from: &nominal, to: real, frames: None, beyond: [None, None] };
    let done = programs::compensate(&program, models, &Postures { held: vec![false; 7], start: None });
    let of = |(target, outcome): (&Target, TargetOutcome)| match outcome {
        TargetOutcome::Done(_) => None,
        TargetOutcome::Left(why) => Some((target.line, why.words)),
    };
    program.targets.iter().zip(done.outcomes).filter_map(of).collect()
}

/// The flange beside the start, with the rail at `rail_m`.
fn pose((chain, _): &(Chain, Robot), rail_m: f64) -> Pose {
    let q: Vec<f64> = std::iter::once(rail_m).chain(beside(1)).collect();
    Robot::nominal(chain.clone()).base_from_tip(&q)
}

fn krl_frame(pose: &Pose, more: &str) -> String {
    let [x, y, z] = pose.xyz().map(|v| 1e3 * v);
    let [c, b, a] = pose.rpy().map(f64::to_degrees);
    format!("{{X {x:.7},Y {y:.7},Z {z:.7},A {a:.8},B {b:.8},C {c:.8}{more}}}")
}

/// A robtarget, whose rail is at `eax` mm.
fn robtarget(pose: &Pose, eax: &str) -> String {
    crate::programs_support::text::robtarget(pose, UNCHECKED).replacen("9E9", eax, 1)
}

/// The real robot meets a pose with the rail at `rail_m`, after the correction of the target of this line.
fn assert_meets_at(robot: &(Chain, Robot), found: &Found, line: usize, rail_m: f64, what: &str) {
    let Ok(readings) = &found[&line] else { panic!("{what}: {found:?}") };
    assert!((readings[0] - rail_m).abs() < 1e-12, "{what}: {readings:?}");
    assert_meets(&robot.1.base_from_tip(readings), &pose(robot, rail_m), what);
}

fn axes(more: &str) -> String {
    let all = START.iter().enumerate().map(|(k, q)| format!("A{} {:.6}", k + 1, q.to_degrees()));
    format!("{{{}{more}}}", all.collect::<Vec<_>>().join(","))
}

const BEGIN: &str = "DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n";

/// Axis angles of RAPID, with the rail at `eax` mm.
fn jointtarget(eax: &str) -> String {
    let axes = START.map(|q| format!("{:.6}", q.to_degrees())).join(",");
    format!("[[{axes}],[{eax},9E9,9E9,9E9,9E9,9E9]]")
}

/// Number of the first line that begins so.
fn first_line(text: &str, begin: &str) -> usize {
    1 + text.lines().position(|line| line.starts_with(begin)).unwrap()
}

fn module(body: &str) -> String {
    format!("MODULE m\nPROC main()\nConfL\\Off;\nConfJ\\Off;\n{body}ENDPROC\nENDMODULE\n")
}

#[test]
fn start_tells_where_the_rail_stands_that_nothing_before_a_pose_tells() {
    let robot = on_rail();
    let at = |mm: &str| format!("PTP {}\n", axes(&format!(",E1 {mm}")));
    let lin = format!("LIN {}\n", krl_frame(&pose(&robot, 0.5), ""));
    let sub = format!("sub()\nEND\nDEF sub()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n{lin}");
    for body in [
        lin.clone(),
        format!("PTP {}\n{lin}", axes("")),
        // The rail is elsewhere later.
        format!("{lin}{}", at("700.0")),
        sub.clone(),
        format!("{}{sub}", at("500.0")),
        format!("WHILE $IN[1]\n{lin}{}ENDWHILE\n", at("500.0")),
    ] {
        let text = format!("{BEGIN}{body}END\n");
        let line = first_line(&text, "LIN");
        assert_meets_at(&robot, &corrected(&robot, "a.src", &text, Some(0.5)), line, 0.5, &text);
        let without = corrected(&robot, "a.src", &text, None);
        assert_eq!(without[&line], Err(LeftReason::Incomplete), "{text}");
    }
    for body in [
        format!("{}{sub}", at("700.0")),
        format!("PTP {{E1 700.0}}\n{lin}"),
        format!("PTP XHOME\n{lin}"),
        format!("WHILE $IN[1]\n{lin}{}ENDWHILE\n", at("700.0")),
    ] {
        let text = format!("{BEGIN}{body}END\n");
        let found = corrected(&robot, "a.src", &text, Some(0.5));
        assert_eq!(found[&first_line(&text, "LIN")], Err(LeftReason::Incomplete), "{text}");
    }
    let go = format!("MoveL {},v10,fine,tool0;\n", robtarget(&pose(&robot, 0.5), "9E9"));
    let elsewhere = format!("MoveAbsJ {},v10,fine,tool0;\n", jointtarget("700"));
    for (body, start, is_met) in [
        (go.clone(), Some(0.5), true),
        (go.clone(), None, false),
        (format!("{go}EXIT;\n{elsewhere}"), Some(0.5), true),
        (format!("SetDO do1,1;\nWaitTime 1;\nn:=1;\n{go}"), Some(0.5), true),
        (format!("rPick;\n{go}"), Some(0.5), false),
    ] {
        let text = module(&body);
        let line = first_line(&text, "MoveL");
        let found = corrected(&robot, "m.mod", &text, start);
        match is_met {
            true => assert_meets_at(&robot, &found, line, 0.5, &text),
            false => assert_eq!(found[&line], Err(LeftReason::Incomplete), "{text}"),
        }
    }
}

/// Whether the line with the first `LIN` or `MoveL` is corrected for a rail at 0.5 m, where `--start` has it.
fn is_met(robot: &(Chain, Robot), name: &str, text: &str) -> bool {
    let line = first_line(text, if name.ends_with(".src") { "LIN " } else { "MoveL " });
    let found = corrected(robot, name, text, Some(0.5));
    if found[&line] == Err(LeftReason::Incomplete) {
        return false;
    }
    assert_meets_at(robot, &found, line, 0.5, text);
    true
}

/// A routine that is called begins with the rail where `--start` has it, unless anything may have moved it meanwhile.
#[test]
fn start_does_not_count_in_a_routine_where_something_may_have_moved_the_rail() {
    let robot = on_rail();
    let lin = format!("LIN {}\n", krl_frame(&pose(&robot, 0.5), ""));
    let arm = format!("PTP {}\n", axes(""));
    for (moved, counts) in [
        ("", true),
        ("$OUT[1]=TRUE\n", true),
        ("ASYPTP {E1 500}\n", false),
        ("ASYPTP XPARK\n", false),
        ("ASYCONT {E1 500}\n", false),
        ("ASYSTOP\n", false),
        ("ASYCANCEL 1\n", false),
        ("$ASYNC_AXIS='B0001'\n", false),
        ("PICK()\n", false),
        ("PTP XHOME\n", false),
        ("PTP $POS_RET\n", false),
        ("PTP {E1 500}\n", true),
        ("PTP {E1 700}\n", false),
        ("LIN_REL {E1 500}\n", false),
        ("PTP_REL {X 5}\n", false),
    ] {
        for between in ["", &arm] {
            let text =
                format!("{BEGIN}{moved}{between}sub()\nEND\nDEF sub()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n{lin}END\n");
            assert_eq!(is_met(&robot, "a.src", &text), counts, "{text}");
        }
    }
    let go = format!("MoveL {},v10,fine,tool0;\n", robtarget(&pose(&robot, 0.5), "9E9"));
    let arm = format!("MoveAbsJ {},v10,fine,tool0;\n", jointtarget("9E9"));
    let external = |eax: &str| format!("[[9E9,9E9,9E9,9E9,9E9,9E9],[{eax},9E9,9E9,9E9,9E9,9E9]]");
    for (moved, counts) in [
        (String::new(), true),
        ("SetDO do1,1;\nActUnit STN1;\n".to_owned(), true),
        (format!("MoveExtJ {},vrot10,fine;\n", external("500")), false),
        ("MoveExtJ jExt,vrot10,fine;\n".to_owned(), false),
        ("SearchExtJ di1,jFound,jExt,vrot10;\n".to_owned(), false),
        ("MoveAbsJ jHome,v10,fine,tool0;\n".to_owned(), false),
        ("rPick;\n".to_owned(), false),
        ("%\"rPick\"%;\n".to_owned(), false),
        ("%\"rPick\"+NumToStr(n,0)%;\n".to_owned(), false),
        ("IF a=1 THEN\nrPick;\nENDIF\n".to_owned(), false),
        ("jp.extax:=[700,9E9,9E9,9E9,9E9,9E9];\n".to_owned(), false),
        ("jp.extax.eax_a:=9E9;\n".to_owned(), true),
    ] {
        for between in ["", &arm] {
            let text = module(&format!("{moved}{between}rSub;\nENDPROC\nPROC rSub()\n{go}"));
            assert_eq!(is_met(&robot, "m.mod", &text), counts, "{text}");
        }
    }
}

/// `%"name"%` calls the routine of this name.
#[test]
fn a_routine_that_is_called_by_a_text_may_have_moved_the_rail() {
    let robot = on_rail();
    let head = format!("MoveAbsJ {},v10,fine,tool0;\n", jointtarget("500"));
    let go = format!("MoveL {},v10,fine,tool0;\n", robtarget(&pose(&robot, 0.5), "9E9"));
    let still = "ENDPROC\nPROC rPick()\nWaitTime 1;\n";
    for (call, more, counts) in [
        ("%\"rPick\"%;\n", "", false),
        ("%\"rPick\"%;\n", still, true),
        ("%\"rPick\"% 1,2;\n", still, true),
        ("%stName%;\n", still, false),
        ("%\"rPick\"+st%;\n", still, false),
        ("IF a=1 %\"rPlace\"%;\n", still, false),
        ("CallByVar \"rPick\",1;\n", still, false),
    ] {
        let text = module(&format!("{head}{call}{go}{more}"));
        assert_eq!(is_met(&robot, "m.mod", &text), counts, "{text}");
    }
}

/// Behind its end `main` begins again, with the rail where that has left it.
#[test]
fn the_first_target_of_main_has_the_rail_of_its_end_in_all_cycles_but_the_first() {
    let robot = on_rail();
    let go = format!("MoveL {},v10,fine,tool0;\n", robtarget(&pose(&robot, 0.5), "9E9"));
    let at = |eax: &str| format!("MoveAbsJ {},v10,fine,tool0;\n", jointtarget(eax));
    for (body, counts) in [
        (go.clone(), true),
        (format!("{go}{}", at("500")), true),
        (format!("{go}{}", at("700")), false),
        (format!("{go}{}", at("9E9")), true),
        (format!("{go}rPick;\n"), false),
        (format!("{go}WHILE TRUE DO\n{}ENDWHILE\n", at("700")), true),
        (format!("{go}WHILE a DO\n{}ENDWHILE\n", at("700")), false),
        (format!("{go}WHILE TRUE DO\n{}IF a=1 RETURN;\nENDWHILE\n", at("700")), false),
        (format!("{go}WHILE TRUE DO\n{}IF a=1 ExitCycle;\nENDWHILE\n", at("700")), false),
        (format!("{go}WHILE TRUE DO\nrOut;\nENDWHILE\nENDPROC\nPROC rOut()\n{}ExitCycle;\n", at("700")), false),
        (format!("{go}{}Stop;\nEXIT;\n", at("700")), true),
        (format!("{}{go}{}", at("500"), at("700")), true),
        // Its end is that of its body, too, not of its handler alone.
        (format!("{go}{}ERROR\nRAISE;\n", at("700")), false),
        (format!("{go}{}ERROR\nRAISE;\n", at("500")), true),
        (format!("{go}{}EXIT;\nERROR\nRAISE;\n", at("700")), true),
        (format!("{go}WHILE TRUE DO\n{}ENDWHILE\nERROR\nRAISE;\n", at("700")), true),
    ] {
        let text = module(&body);
        assert_eq!(is_met(&robot, "m.mod", &text), counts, "{text}");
    }
}

/// An axis that is moved independently of the targets at the end of `main` is so where that begins again.
#[test]
fn what_the_end_of_main_moves_independently_is_moved_so_where_it_begins_again() {
    let robot = on_rail();
    let target = robtarget(&pose(&robot, 0.5), "500,0,0,0,0,0").replace(",9E9,9E9,9E9,9E9,9E9]", "]");
    let go = format!("MoveL {target},v10,fine,tool0;\n");
    let alone = "IndAMove STN1,1\\ToAbsNum:=560,20;\n";
    let routine = format!("ENDPROC\nPROC rEnd()\n{alone}");
    for (body, is_alone) in [
        (go.clone(), false),
        (format!("{go}{alone}"), true),
        (format!("{go}{alone}IndReset STN1,1;\n"), false),
        (format!("IndReset STN1,1;\n{go}{alone}"), false),
        (format!("IndReset STN1,2;\n{go}{alone}"), true),
        (format!("{go}{alone}EXIT;\n"), false),
        (format!("{go}IF a=1 THEN\n{alone}RETURN;\nENDIF\nIndReset STN1,1;\n"), true),
        (format!("{go}rEnd;\n{routine}"), true),
        (format!("{go}rEnd;\nEXIT;\n{routine}"), false),
        (format!("{go}WHILE TRUE DO\nrEnd;\nENDWHILE\n{routine}ExitCycle;\n"), true),
    ] {
        let text = module(&body);
        let found = corrected(&robot, "m.mod", &text, Some(0.5));
        let reason = found[&first_line(&text, "MoveL")].as_ref().err();
        assert_eq!(reason, is_alone.then_some(&LeftReason::ExternalAxis), "{text}");
    }
}

/// Behind axis angles that leave the rail out, the numbers that a pose leaves out are told only where the rail is.
#[test]
fn a_partial_pose_is_completed_only_where_the_rail_before_it_is_told() {
    let robot = on_rail();
    let q: Vec<f64> = std::iter::once(0.5).chain(START).collect();
    let z_mm = 1e3 * Robot::nominal(robot.0.clone()).base_from_tip(&q).xyz()[2];
    let lin = format!("LIN {{Z {:.7},E1 500.0}}\n", z_mm + 5.0);
    let [arm, told] = ["", ",E1 500.0"].map(|more| format!("PTP {}\n", axes(more)));
    for (before, start, is_met) in [
        (told.clone(), None, true),
        (format!("{told}{arm}"), None, true),
        (arm.clone(), Some(0.5), true),
        (arm.clone(), None, false),
        (format!("PICK()\n{arm}"), Some(0.5), false),
        (format!("{told}PICK()\n{arm}"), None, false),
    ] {
        let text = format!("{BEGIN}{before}{lin}END\n");
        let found = corrected(&robot, "a.src", &text, start);
        let reason = found[&first_line(&text, "LIN")].as_ref().err();
        assert_eq!(reason, (!is_met).then_some(&LeftReason::Incomplete), "{text}");
    }
}

/// A target of axis angles that leaves the rail out does not tell where it stands, if one way to it does not.
#[test]
fn the_rail_is_told_behind_a_joint_target_only_where_all_ways_to_it_tell_it() {
    let robot = on_rail();
    let (lin, arm) = (format!("LIN {}\n", krl_frame(&pose(&robot, 0.5), "")), format!("PTP {}\n", axes("")));
    let told = format!("PTP {}\n", axes(",E1 500.0"));
    for (other, counts) in
        [(told.clone(), true), ("PTP XHOME\n".to_owned(), false), ("LIN_REL {E1 5}\n".to_owned(), false)]
    {
        for branches in [[&told, &other], [&other, &told]] {
            let [one, two] = branches;
            let text = format!("{BEGIN}IF $IN[1] THEN\n{one}ELSE\n{two}ENDIF\n{arm}{arm}{lin}END\n");
            assert_eq!(is_met(&robot, "a.src", &text), counts, "{text}");
        }
    }
}

/// The posture of the third pose is found to be open only once the last target is known: behind that, nothing tells the rail at the second one.
#[test]
fn a_way_that_is_found_late_counts_for_targets_that_stand_before_it_in_the_text() {
    let robot = on_rail();
    let at = |more: &str| krl_frame(&pose(&robot, 0.5), more);
    let [arm, told] = ["", ",E1 500.0"].map(|more| format!("PTP {}\n", axes(more)));
    let [a1, a2, a3, a4, a5, a6] = START.map(f64::to_degrees);
    let [a4, a6] = [a4, a6].map(|q| q - 180.0 * q.signum());
    let turned = format!("PTP {{A1 {a1},A2 {a2},A3 {a3},A4 {a4},A5 {:.6},A6 {a6},E1 500.0}}\n", -a5);
    for (last, counts) in [(&told, true), (&turned, false)] {
        let within = format!("WHILE $IN[3]\nPTP {}\nIF $IN[4] THEN\n{last}ENDIF\nENDWHILE\n", at(",E1 500.0"));
        let around = format!("LOOP\n{arm}IF $IN[2] THEN\nEXIT\nENDIF\n{within}ENDLOOP\n");
        let text = format!("{BEGIN}{told}WHILE $IN[1]\nLIN {}\n{around}ENDWHILE\nEND\n", at(""));
        assert_eq!(is_met(&robot, "a.src", &text), counts, "{text}");
    }
}

/// The words of targets that stay as they are offer `--start` where it tells the rail, and nowhere else.
#[test]
fn start_is_offered_where_it_would_tell_the_rail() {
    let robot = on_rail();
    let lin = format!("LIN {}\n", krl_frame(&pose(&robot, 0.5), ""));
    let sub = format!("sub()\nEND\nDEF sub()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n{lin}");
    let arm = format!("PTP {}\n", axes(""));
    let elsewhere = format!("PTP {}\n", axes(",E1 700.0"));
    for (body, helps) in [
        (lin.clone(), true),
        (format!("{arm}{lin}"), true),
        (sub.clone(), true),
        (format!("{elsewhere}{sub}"), false),
        (format!("PICK()\n{sub}"), false),
        (format!("PICK()\n{lin}"), false),
        (format!("PTP XHOME\n{arm}{lin}"), false),
        (format!("IF $IN[1] THEN\nPTP XHOME\nENDIF\n{arm}{lin}"), false),
    ] {
        let text = format!("{BEGIN}{body}END\n");
        let all = words(&robot, "a.src", &text);
        assert_eq!(all[&first_line(&text, "LIN ")].contains("--start"), helps, "{text}");
    }
}

/// External axes of the point on a circle do not count: the rail goes on from where it stood before.
#[test]
fn the_end_of_a_circle_does_not_take_the_rail_from_the_point_on_it() {
    let robot = on_rail();
    let head = format!("PTP {}\n", axes(",E1 500.0"));
    let at = |rail_m: f64, more: &str| krl_frame(&pose(&robot, rail_m), more);
    let head_mod = format!("MoveAbsJ {},v10,fine,tool0;\n", jointtarget("500"));
    let tool = |eax: &str| robtarget(&pose(&robot, 0.5), eax);
    for (on_circle, end, is_left) in [("", "", false), (",E1 700.0", "", true), (",E1 700.0", ",E1 500.0", false)] {
        let text = format!("{BEGIN}{head}CIRC {},{}\nEND\n", at(0.5, on_circle), at(0.5, end));
        let left = read_program(&robot.0, &[1, 2, 3, 4, 5, 6, 0], "a.src", &text).left;
        assert_eq!(left.iter().any(|l| l.why.reason == LeftReason::Incomplete), is_left, "{text}");
        let [on_circle, end] = [on_circle, end].map(|e| if e.is_empty() { "9E9" } else { &e[4..7] });
        let text = module(&format!("{head_mod}MoveC {},{},v10,fine,tool0;\n", tool(on_circle), tool(end)));
        let left = read_program(&robot.0, &[1, 2, 3, 4, 5, 6, 0], "m.mod", &text).left;
        assert_eq!(left.iter().any(|l| l.why.reason == LeftReason::Incomplete), is_left, "{text}");
    }
}

/// The arm hardly moves where the rail goes along with a line, however far that is.
#[test]
fn a_line_is_followed_while_the_rail_goes_along() {
    let robot = on_rail();
    for rail_m in [0.55, 0.9, 1.5] {
        let at = pose(&robot, rail_m);
        let eax = format!("{:.1}", 1e3 * rail_m);
        let text = format!("{BEGIN}PTP {}\nLIN {}\nEND\n", axes(",E1 500.0"), krl_frame(&at, &format!(",E1 {eax}")));
        assert_meets_at(&robot, &corrected(&robot, "a.src", &text, None), first_line(&text, "LIN"), rail_m, &text);
        let begin = format!("MoveAbsJ {},v10,fine,tool0;\n", jointtarget("500"));
        let text = module(&format!("{begin}MoveL {},v10,fine,tool0;\n", robtarget(&at, &eax)));
        assert_meets_at(&robot, &corrected(&robot, "m.mod", &text, None), first_line(&text, "MoveL"), rail_m, &text);
    }
}

/// An end of which the text does not tell where it stands does not leave the rail out; elements of an array are looked at one by one.
#[test]
fn the_end_of_a_circle_that_is_an_element_or_computed_is_left_only_where_it_leaves_the_rail_out() {
    let robot = on_rail();
    let at = |eax: &str| robtarget(&pose(&robot, 0.5), eax);
    let data = |eax: &str| format!("CONST robtarget pEnds{{2}}:=[{},{}];\nVAR robtarget pLater;\n", at("500"), at(eax));
    let circle = |end: &str, eax: &str| {
        module(&format!("MoveC {},{end},v10,fine,tool0;\nENDPROC\n{}PROC q()\n", at("500"), data(eax)))
    };
    for (end, reason) in [
        ("pEnds{i}", None),
        ("pEnds{1}", None),
        ("pNone", Some(LeftReason::Undeclared)),
        ("pLater", Some(LeftReason::Computed)),
        ("CalcRobT(j,tool0)", Some(LeftReason::Computed)),
    ] {
        let text = circle(end, "500");
        let left = read_program(&robot.0, &[1, 2, 3, 4, 5, 6, 0], "m.mod", &text).left;
        let reasons = left.iter().map(|left| left.why.reason).filter(|reason| *reason != LeftReason::Unvisited);
        assert_eq!(reasons.collect::<Vec<_>>(), Vec::from_iter(reason), "{text}");
    }
    for (eax, is_told) in [("500", true), ("9E9", false)] {
        let text = circle("pEnds{i}", eax);
        let (line, found) = (first_line(&text, "CONST"), corrected(&robot, "m.mod", &text, Some(0.5)));
        match is_told {
            true => assert_meets_at(&robot, &found, line, 0.5, &text),
            false => assert_eq!(found[&line], Err(LeftReason::Incomplete), "{text}"),
        }
    }
}

/// A segment of a spline may leave external axes where they are best.
#[test]
fn a_segment_that_ignores_external_axes_is_left() {
    let robot = on_rail();
    let head = format!("PTP {}\n", axes(",E1 500.0"));
    let at = |more: &str| krl_frame(&pose(&robot, 0.5), more);
    let text = format!(
        "{BEGIN}{head}SPLINE\nSLIN {} WITH $EX_AX_IGNORE='B1'\nSPL {}\nENDSPLINE\nEND\n",
        at(",E1 700.0"),
        at("")
    );
    let found = corrected(&robot, "a.src", &text, Some(0.5));
    assert_eq!(found[&first_line(&text, "SLIN")], Err(LeftReason::ExternalAxis), "{text}");
    assert_eq!(found[&first_line(&text, "SPL ")], Err(LeftReason::Incomplete), "{text}");
}

/// A trap routine, or an interrupt, that moves the robot may have moved the rail behind any statement.
#[test]
fn the_rail_may_stand_elsewhere_where_an_interrupt_moves_it() {
    let robot = on_rail();
    let head = format!("MoveAbsJ {},v10,fine,tool0;\n", jointtarget("500"));
    let go = format!("MoveL {},v10,fine,tool0;\n", robtarget(&pose(&robot, 0.5), "9E9"));
    let away = format!("MoveAbsJ {},v10,fine,tool0;\n", jointtarget("700"));
    for (trap, counts) in [(String::from("TPWrite \"a\";\n"), true), (away, false), (String::from("rAway;\n"), false)] {
        let text = module(&format!(
            "CONNECT i1 WITH tAway;\n{head}WaitTime 1;\n{go}ENDPROC\nTRAP tAway\n{trap}ENDTRAP\nPROC p()\n"
        ));
        assert_eq!(is_met(&robot, "m.mod", &text), counts, "{text}");
    }
}

/// What moves the rail alone, or may move it, puts it where the text does not tell; that of the target before is wrong.
#[test]
fn a_rail_that_something_else_has_moved_stands_where_the_text_does_not_tell() {
    let robot = on_rail();
    let head = format!("PTP {}\n", axes(",E1 500.0"));
    let lin = format!("LIN {}\n", krl_frame(&pose(&robot, 0.56), ""));
    let told = format!("LIN {}\n", krl_frame(&pose(&robot, 0.56), ",E1 560.0"));
    for moved in ["ASYPTP {E1 560}\n", "ASYCONT {E1 60}\n", "$ASYNC_AXIS=1\n", "PICK()\n"] {
        // The last one says where the arm is, but not the rail.
        for between in [String::new(), format!("PTP {}\n", axes(""))] {
            let text = format!("{BEGIN}{head}{moved}{between}{lin}{told}END\n");
            let line = first_line(&text, "LIN");
            let found = corrected(&robot, "a.src", &text, None);
            assert_eq!(found[&line], Err(LeftReason::Incomplete), "{text}");
            assert_meets_at(&robot, &found, line + 1, 0.56, &text);
        }
    }
    let head = format!("MoveAbsJ {},v10,fine,tool0;\n", jointtarget("500"));
    let go = |eax: &str| format!("MoveL {},v10,fine,tool0;\n", robtarget(&pose(&robot, 0.56), eax));
    let arm = format!("MoveAbsJ {},v10,fine,tool0;\n", jointtarget("9E9"));
    let none = "[9E9,9E9,9E9,9E9,9E9,9E9]";
    for (moved, reason) in [
        (format!("MoveExtJ [{none},[560,9E9,9E9,9E9,9E9,9E9]],vrot10,fine;\n"), LeftReason::Incomplete),
        ("MoveExtJ jExt,vrot10,fine;\n".to_owned(), LeftReason::Incomplete),
        ("SearchExtJ di1,jFound,jExt,vrot10;\n".to_owned(), LeftReason::Incomplete),
        ("rPick;\n".to_owned(), LeftReason::Incomplete),
        // It may have moved one of those that the description lacks, too.
        ("IndAMove STN1,1\\ToAbsNum:=560,20;\nIndReset STN1,1;\n".to_owned(), LeftReason::ExternalAxis),
        ("IndRMove STN1,1\\ToRelNum:=60,20;\n".to_owned(), LeftReason::ExternalAxis),
        ("IF a=1 IndCMove STN1,1,20;\n".to_owned(), LeftReason::ExternalAxis),
    ] {
        for between in ["", &arm] {
            let text = module(&format!("{head}{moved}{between}{}{}", go("9E9"), go("560")));
            let line = first_line(&text, "MoveL");
            let found = corrected(&robot, "m.mod", &text, None);
            assert_eq!(found[&line], Err(reason), "{text}");
            match reason {
                LeftReason::Incomplete => assert_meets_at(&robot, &found, line + 1, 0.56, &text),
                _ => assert_eq!(found[&(line + 1)], Err(reason), "{text}"),
            }
        }
    }
    let all_told = go("560,0,0,0,0,0").replace(",9E9,9E9,9E9,9E9,9E9]", "]");
    for (reset, is_met) in [
        ("IndReset STN1,1;\n", true),
        ("", false),
        ("IndReset STN1,2;\n", false),
        ("IndReset STN2,1;\n", false),
        ("IndReset STN1 , 1 \\RefNum:=0;\n", true),
        ("IndAMove STN1,2\\ToAbsNum:=5,20;\nIndReset STN1,1;\n", false),
        ("IndRMove STN2,1\\ToRelNum:=5,20;\nIndReset STN1,1;\nIndReset STN2,1;\n", true),
    ] {
        let text = module(&format!("{head}IndAMove STN1,1\\ToAbsNum:=560,20;\n{reset}{all_told}"));
        let (line, found) = (first_line(&text, "MoveL"), corrected(&robot, "m.mod", &text, None));
        match is_met {
            true => assert_meets_at(&robot, &found, line, 0.56, &text),
            false => assert_eq!(found[&line], Err(LeftReason::ExternalAxis), "{text}"),
        }
    }
}

/// `MoveAbsJ` without `\NoEOffs` moves external axes by the offset, too.
#[test]
fn axis_angles_beside_an_offset_of_the_rail_are_left() {
    let robot = on_rail();
    let go = |switch: &str, eax: &str| format!("MoveAbsJ {}{switch},v10,fine,tool0;\n", jointtarget(eax));
    let set = "EOffsSet [100,0,0,0,0,0];\n";
    for (body, is_left) in [
        (format!("{set}{}", go("", "500")), true),
        (format!("{set}{}", go("\\NoEOffs", "500")), false),
        (format!("{set}{}", go("", "9E9")), false),
        (format!("{set}EOffsOff;\n{}", go("", "500")), false),
        (format!("IF a=1 EOffsOn \\ExeP:=p1,p2;\n{}", go("", "500")), true),
    ] {
        let text = module(&body);
        let line = first_line(&text, "MoveAbsJ");
        let found = corrected(&robot, "m.mod", &text, None);
        let reason = found[&line].as_ref().err();
        assert_eq!(reason, is_left.then_some(&LeftReason::ExternalAxis), "{text}");
    }
}

/// Status and turn are those of the arm, wherever its foot looks on the rail.
#[test]
fn codes_of_an_arm_that_is_turned_on_its_rail_tell_its_posture() {
    let text = std::fs::read_to_string(kr6_urdf()).unwrap();
    let (s, t) = status_turn(&beside(1));
    for yaw in [0.0f64, 1.2, std::f64::consts::PI, -2.5] {
        let rail = format!(
            "<link name=\"rail\"/><link name=\"carriage\"/><joint name=\"slide\" type=\"prismatic\"><parent link=\"rail\"/>\
             <child link=\"carriage\"/><axis xyz=\"1 0 0\"/><limit lower=\"0\" upper=\"3\" effort=\"1\" velocity=\"1\"/></joint>\
             <joint name=\"mount\" type=\"fixed\"><origin rpy=\"0 0 {yaw}\"/><parent link=\"carriage\"/>\
             <child link=\"base_link\"/></joint></robot>"
        );
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rail.urdf");
        std::fs::write(&path, text.replace("</robot>", &rail)).unwrap();
        let chain = read(&path).unwrap().chain(Some("rail"), Some("tool0")).unwrap();
        let mut real = Robot::nominal(chain.clone());
        for (k, joint) in real.chain.joints.iter_mut().enumerate() {
            joint.origin =
                joint.origin.perturbed(&nalgebra::Vector6::from_fn(|i, _| 1e-3 * ((3 * k + i) as f64).sin()));
        }
        let robot = (chain, real);
        let target = krl_frame(&pose(&robot, 0.5), &format!(",S {s},T {t},E1 500.0"));
        let found = corrected(&robot, "a.src", &format!("{BEGIN}PTP {target}\nEND\n"), None);
        assert_meets_at(&robot, &found, 4, 0.5, &format!("{yaw}"));
        let Ok(readings) = &found[&4] else { panic!("{found:?}") };
        let change = readings[1..].iter().zip(beside(1)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(change < 0.1, "{yaw}: {readings:?}");
    }
}

/// A robtarget of an arm with seven joints says how its elbow is turned, a jointtarget the angle of its seventh joint.
#[test]
fn robtargets_of_an_arm_with_seven_joints_are_left_and_its_jointtargets_corrected() {
    let chain = read(&repo("robots/lbr_iiwa_14/lbr_iiwa_14.urdf")).unwrap().chain(None, None).unwrap();
    let mut real = Robot::nominal(chain.clone());
    for (k, joint) in real.chain.joints.iter_mut().enumerate() {
        joint.origin = joint.origin.perturbed(&nalgebra::Vector6::from_fn(|i, _| 1e-3 * ((3 * k + i) as f64).sin()));
    }
    let q = [0.2f64, 0.5, 0.3, -1.2, 0.4, 0.9, 0.1];
    let nominal = Robot::nominal(chain.clone());
    let degrees = q.map(|v| format!("{:.9}", v.to_degrees()));
    let (arm, seventh) = ([0, 1, 3, 4, 5, 6].map(|k| degrees[k].clone()).join(","), &degrees[2]);
    let body = format!(
        "MoveAbsJ [[{arm}],[{seventh},9E9,9E9,9E9,9E9,9E9]],v10,fine,tool0;\nMoveL {},v10,fine,tool0;\n",
        robtarget(&nominal.base_from_tip(&q), seventh)
    );
    for axes in [[0, 1, 3, 4, 5, 6, 2], [0, 1, 2, 3, 4, 5, 6]] {
        let found = corrected_in(&(chain.clone(), real.clone()), &axes, "m.mod", &module(&body), None);
        assert_eq!(found[&6], Err(LeftReason::ExternalAxis), "{axes:?}");
        let Ok(readings) = &found[&5] else { panic!("{found:?}") };
        if axes[6] == 2 {
            assert_meets(&real.base_from_tip(readings), &nominal.base_from_tip(&q), "seven joints");
        }
    }
}

/// The turntable that carries the work comes first in the chain, and is `E1` in programs.
#[test]
fn joints_that_carry_the_work_are_external_axes() {
    let folder = tempfile::tempdir().unwrap();
    let turntable = "<link name=\"world\"/><link name=\"plate\"/><joint name=\"foot\" type=\"fixed\"><parent link=\"world\"/>\
                     <child link=\"base_link\"/></joint><joint name=\"turn\" type=\"revolute\"><origin xyz=\"0.6 0 0.3\"/>\
                     <parent link=\"world\"/><child link=\"plate\"/><axis xyz=\"0 0 1\"/>\
                     <limit lower=\"-3\" upper=\"3\" effort=\"1\" velocity=\"1\"/></joint></robot>";
    let nominal = std::fs::read_to_string(kr6_urdf()).unwrap().replace("</robot>", turntable);
    let real = nominal.replace("0.025 0 0", "0.0256 0.0003 0.0004").replace("0.42 0 0", "0.4195 0.0006 0");
    let paths = [("nominal.urdf", &nominal), ("real.urdf", &real)].map(|(name, text)| {
        std::fs::write(folder.path().join(name), text).unwrap();
        folder.path().join(name)
    });
    let robots =
        paths.each_ref().map(|path| Robot::nominal(read(path).unwrap().chain(Some("plate"), Some("tool0")).unwrap()));
    let program = folder.path().join("a.src");
    std::fs::write(&program, format!("DEF a()\nPTP {}\nEND\n", axes(",E1 30.0"))).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_robotcal"));
    command.arg("compensate").arg(&program).arg("--out").arg(folder.path().join("out"));
    command.arg("--nominal").arg(&paths[0]).arg("--urdf").arg(&paths[1]);
    let output = command.args(["--frames", "nominal", "--base", "plate", "--tip", "tool0"]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stdout));
    let text = std::fs::read_to_string(folder.path().join("out/a.src")).unwrap();
    let line = text.lines().nth(1).unwrap();
    let values: Vec<f64> =
        line.split([',', '}']).filter_map(|part| part.split(' ').next_back()?.parse().ok()).collect();
    assert!(line.ends_with(",E1 30.0}") && values.len() == 7, "{line}");
    let q: Vec<f64> = [6, 0, 1, 2, 3, 4, 5].map(|k| values[k].to_radians()).to_vec();
    let meant: Vec<f64> = std::iter::once(30f64.to_radians()).chain(START).collect();
    assert!(values[0] != START[0].to_degrees(), "{line}");
    let (rad, m) = robots[1].base_from_tip(&q).distance(&robots[0].base_from_tip(&meant));
    assert!(rad < 1e-6 && m < 1e-6, "{line}: {m:e} m, {rad:e} rad");
}
