//! Programs whose numbers alone do not say where the robot goes: such targets stay as they are, by name.

use crate::programs_support::Cell;
use crate::programs_support::text::{UNCHECKED, krl_moves, krl_pose as krl, krl_text, robtarget, script_pose, told};
use robotcal::programs::LeftReason;

/// Two poses `XP1` and `XP2`, the motion data of the first in the frame `IPO`.
fn krl_module(cell: &mut Cell, ipo: &str, moves: &str) -> Vec<(&'static str, String)> {
    let (a, b) = (cell.readings(), cell.readings());
    let (first, second) = (krl(cell, &a), krl(cell, &b));
    let data = |n: u8, ipo: &str| format!("DECL FDAT FP{n}={{TOOL_NO 0,BASE_NO 0,IPO_FRAME {ipo},POINT2[] \" \"}}\n");
    let dat = format!(
        "DEFDAT a\nDECL E6POS XP1={first}\n{}DECL E6POS XP2={second}\n{}ENDDAT\n",
        data(1, ipo),
        data(2, "#BASE")
    );
    vec![("a.src", format!("DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n{moves}END\n")), ("a.dat", dat)]
}

#[test]
fn targets_of_a_tool_that_is_fixed_in_the_room_are_left() {
    let mut cell = Cell::kuka(61);
    let unknown = vec![LeftReason::ToolUnknown.name().to_owned()];
    let with = |n: u8| {
        format!(
            "SPTP XP{n} WITH $TOOL=STOOL2(FP{n}), $BASE=SBASE(FP{n}.BASE_NO), $IPO_MODE=SIPO_MODE(FP{n}.IPO_FRAME)\n"
        )
    };
    for (ipo, moves) in [
        ("#TCP", "FDAT_ACT=FP1\nPTP XP1\nFDAT_ACT=FP2\nPTP XP2\n".to_owned()),
        ("#TCP", with(1) + &with(2)),
        ("#BASE", "$IPO_MODE=#TCP\nPTP XP1\n$IPO_MODE=#BASE\nPTP XP2\n".to_owned()),
        // Which of the two a variable holds is not told.
        ("#BASE", "M=#TCP\n$IPO_MODE=M\nPTP XP1\n$IPO_MODE=#BASE\nPTP XP2\n".to_owned()),
        ("#BASE", "PTP XP1 WITH $IPO_MODE=M\nPTP XP2\n".to_owned()),
        ("M", "FDAT_ACT=FP1\nPTP XP1\nFDAT_ACT=FP2\nPTP XP2\n".to_owned()),
    ] {
        let files = krl_module(&mut cell, ipo, &moves);
        assert_eq!(told(&cell, &files, &["--tool=0,0,100,0,0,0"]), (1, unknown.clone()), "{ipo}: {moves}");
    }
}

/// Where the text has neither the motion data nor the tool, it is the one on the flange that the user states.
#[test]
fn a_tool_that_is_stated_is_on_the_flange_where_the_text_does_not_tell() {
    let mut cell = Cell::kuka(62);
    let [(name, text), _] =
        krl_module(&mut cell, "#BASE", "PTP XP1 WITH $TOOL=STOOL2(FP7), $IPO_MODE=SIPO_MODE(FP7.IPO_FRAME)\n")
            .try_into()
            .unwrap();
    let (readings, tool) = (cell.readings(), "--tool=0,0,100,0,0,0");
    let files = [(name, text.replace("XP1", &krl(&cell, &readings)))];
    assert_eq!(told(&cell, &files, &[tool]), (1, vec![]));
    assert_eq!(told(&cell, &files, &[]), (0, vec![LeftReason::ToolUnknown.name().to_owned()]));
}

#[test]
fn targets_of_a_robot_whose_foot_is_not_the_origin_of_the_world_are_left() {
    let mut cell = Cell::kuka(62);
    let unknown = vec![LeftReason::FrameUnknown.name().to_owned()];
    let machine = |z: &str| {
        (
            "$machine.dat",
            format!("DEFDAT $MACHINE PUBLIC\nFRAME $ROBROOT={{X 0.0,Y 0.0,Z {z},A 0.0,B 0.0,C 0.0}}\nENDDAT\n"),
        )
    };
    let mut files = krl_module(&mut cell, "#BASE", "PTP XP1\n");
    files[1].1 = files[1].1.lines().filter(|l| !l.contains("P2=")).collect::<Vec<_>>().join("\n");
    for (z, left) in [("0.0", vec![]), ("500.0", unknown)] {
        files.truncate(2);
        files.push(machine(z));
        assert_eq!(told(&cell, &files, &[]), (1 - left.len(), left), "{z}");
    }
}

/// A variable in the place of a number stays the only value of its component.
#[test]
fn a_pose_with_a_variable_in_it_is_computed() {
    let mut cell = Cell::kuka(63);
    let q = cell.readings();
    let text = krl(&cell, &q);
    let (_, rest) = text.split_once(',').unwrap();
    let source = format!("DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nPTP {text}\nLIN {{X XV,{rest}\nEND\n");
    let file = cell.write("a.src", source.as_bytes());
    let run = cell.compensate(&[&file], &["--unordered"]).expect(1);
    assert!(run.told().has(5, "LIN", LeftReason::Computed), "{:?}", run.told());
    assert!(run.text("a.src").contains(&format!("LIN {{X XV,{rest}\n")), "{}", run.text("a.src"));
}

/// Axes beside which the targets lie, deg.
const START: [f64; 6] = [10.0, -80.0, 100.0, 20.0, 40.0, 30.0];

#[test]
fn robtargets_under_a_program_displacement_are_left() {
    let mut cell = Cell::kuka(64);
    let target = |cell: &mut Cell| {
        let q: Vec<f64> = START.iter().map(|q| q.to_radians() + 0.05 * cell.readings()[0].sin()).collect();
        robtarget(&cell.nominal.base_from_tip(&q), UNCHECKED)
    };
    let unknown = LeftReason::FrameUnknown.name().to_owned();
    for (body, corrected, left) in [
        (
            "MoveJ @,v10,fine,tool0;PDispSet [[100,0,0],[1,0,0,0],[0,0,0],[0,0,0]];\nMoveJ @,v10,fine,tool0;\nPDispOff;\nMoveJ @,v10,fine,tool0;\nENDPROC",
            2,
            1,
        ),
        ("PDispOn \\Rot \\ExeP:=p1,p2,tool0;\nMoveJ @,v10,fine,tool0;\nENDPROC", 0, 1),
        (
            "MoveJ @,v10,fine,tool0;\nsub;\nENDPROC\nPROC sub()\nConfJ\\Off;\nMoveJ @,v10,fine,tool0;\nENDPROC\nPROC other()\nPDispSet d;\nENDPROC",
            1,
            1,
        ),
        ("MoveJ @,v10,fine,tool0;\nsub;\nENDPROC\nPROC sub()\nConfJ\\Off;\nMoveJ @,v10,fine,tool0;\nENDPROC", 2, 0),
    ] {
        let mut text = format!("MODULE m\nPROC main()\nConfJ\\Off;\n{body}\nENDMODULE\n");
        while text.contains('@') {
            text = text.replacen('@', &target(&mut cell), 1);
        }
        let start = format!("--start={}", START.map(|q| q.to_string()).join(","));
        assert_eq!(told(&cell, &[("m.mod", text)], &[&start]), (corrected, vec![unknown.clone(); left]), "{body}");
    }
}

#[test]
fn script_targets_that_change_while_the_program_runs_are_left() {
    let mut cell = Cell::ur(65);
    let (computed, moved) = (LeftReason::Computed.name(), LeftReason::FrameUnknown.name());
    let before = cell.readings();
    for (body, corrected, left) in [
        ("  P=@\n  P[2]=P[2]+0.05\n  movel(P)\n", 0, vec![computed]),
        ("  P=@\n  while True:\n    movel(P)\n    P=pose_add(P,p[0,0,0.1,0,0,0])\n  end\n", 0, vec![computed]),
        ("  P=@\n  if P[2] == 0:\n    x=P[2]\n  end\n  movel(P)\n", 1, vec![]),
        (
            "  track_conveyor_linear(p[1,0,0,0,0,0],400)\n  movel(@)\n  stop_conveyor_tracking()\n  movel(@)\n",
            1,
            vec![moved],
        ),
        ("  path_offset_enable()\n  movel(@)\n  path_offset_disable()\n  movel(@)\n", 1, vec![moved]),
        ("  optimovel(@, a=0.3, v=0.3)\n  optimovej(@)\n  servoc(@,1,0.1,0)\n", 3, vec![]),
    ] {
        let mut text = format!("def p():\n  set_tcp(p[0,0,0,0,0,0])\n  movej({before:?})\n{body}end\n");
        while text.contains('@') {
            // Beside the one before: no posture is open.
            let q: Vec<f64> = before.iter().enumerate().map(|(k, v)| v + 0.02 * (k as f64 + 1.0).sin()).collect();
            text = text.replacen('@', &script_pose(&cell.nominal.base_from_tip(&q)), 1);
        }
        let left: Vec<String> = left.into_iter().map(str::to_owned).collect();
        assert_eq!(told(&cell, &[("a.script", text)], &[]), (1 + corrected, left), "{body}");
    }
}

#[test]
fn poses_with_an_external_axis_that_the_description_lacks_are_left_unless_it_is_at_zero() {
    let cell = Cell::kuka(66);
    let q: Vec<f64> = START.iter().map(|q| q.to_radians()).collect();
    let external = LeftReason::ExternalAxis.name().to_owned();
    let in_krl = krl(&cell, &q).replace('}', ",E1 @}");
    let joints: Vec<String> = q.iter().enumerate().map(|(k, v)| format!("A{} {}", k + 1, v.to_degrees())).collect();
    let src = format!(
        "DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nPTP {in_krl}\nPTP {{E6AXIS: {},E1 @}}\nEND\n",
        joints.join(",")
    );
    let pose = cell.nominal.base_from_tip(&q);
    let target = robtarget(&pose, UNCHECKED).replacen("9E9", "@", 1);
    let rapid = |before: &str| {
        format!("MODULE m\nPROC main()\nConfJ\\Off;\n{before}MoveJ {target},v10,fine,tool0;\nENDPROC\nENDMODULE\n")
    };
    let start = format!("--start={}", START.map(|q| q.to_string()).join(","));
    for (name, text, at, flags, corrected, left) in [
        ("a.src", src.clone(), "0.0", vec![], 2, 0),
        // Angles of the six axes are those of the robot wherever it stands.
        ("a.src", src.clone(), "500.0", vec![], 1, 1),
        ("a.src", src, "500.0", vec!["--axes-apart"], 2, 0),
        ("m.mod", rapid(""), "9E9", vec![], 1, 0),
        ("m.mod", rapid(""), "0", vec![], 1, 0),
        ("m.mod", rapid(""), "500", vec![], 0, 1),
        ("m.mod", rapid(""), "500", vec!["--axes-apart"], 1, 0),
        ("m.mod", rapid("EOffsSet [100,0,0,0,0,0];\n"), "0", vec![], 0, 1),
        ("m.mod", rapid("IF a>1 EOffsOn \\ExeP:=p1, p2;\n"), "0", vec![], 0, 1),
        ("m.mod", rapid("EOffsSet [100,0,0,0,0,0];\nEOffsOff;\n"), "0", vec![], 1, 0),
    ] {
        let flags = [&[start.as_str()][..], &flags].concat();
        let found = told(&cell, &[(name, text.replace('@', at))], &flags);
        assert_eq!(found, (corrected, vec![external.clone(); left]), "{name} {at} {flags:?}");
    }
}

/// What a pose of KRL leaves out keeps its place, and so does an external axis of RAPID at `9E9`.
#[test]
fn poses_that_leave_out_an_external_axis_are_left_where_it_may_stand_elsewhere_than_at_zero() {
    let cell = Cell::kuka(68);
    let q: Vec<f64> = START.iter().map(|q| q.to_radians()).collect();
    let (pose, axes) = (krl(&cell, &q), START.map(|q| format!("{q:.1}")));
    let angles: Vec<String> = axes.iter().enumerate().map(|(k, v)| format!("A{} {v}", k + 1)).collect();
    let at = |e: &str| format!("PTP {{E6AXIS: {},E1 {e}}}\n", angles.join(","));
    let [far, home, there] = [at("500.0"), at("0.0"), format!("PTP {pose}\n")];
    let with_axis = there.replace('}', ",E1 300.0}");
    let external = LeftReason::ExternalAxis.name().to_owned();
    let start = format!("--start={}", axes.join(","));
    for (body, corrected, left) in [
        (format!("{there}{there}"), 2, 0),
        (format!("{home}{there}"), 2, 0),
        (format!("{far}{there}"), 1, 1),
        (format!("{far}{home}{there}"), 3, 0),
        (format!("{home}{with_axis}{there}"), 1, 2),
        (format!("IF a THEN\n{far}ELSE\n{home}ENDIF\n{there}"), 2, 1),
        (format!("{far}sub()\nEND\nDEF sub()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n{there}"), 1, 1),
        // A program before this one, or the last run of it, may have left the axis there.
        (format!("{there}{far}"), 1, 1),
        // A variable of that name is no axis.
        (format!("DECL INT N,E1\n{there}sub(1,E1)\n"), 1, 0),
    ] {
        let src = |body: &str| format!("DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n{body}END\n");
        let found = told(&cell, &[("a.src", src(&body))], &[&start]);
        assert_eq!(found, (corrected, vec![external.clone(); left]), "{body}");
        let apart = told(&cell, &[("a.src", src(&body))], &[&start, "--axes-apart"]);
        assert_eq!(apart, (corrected + left, vec![]), "{body}");
    }
    let target = robtarget(&cell.nominal.base_from_tip(&q), UNCHECKED);
    let at = |e: &str| format!("MoveAbsJ [[{}],[{e},9E9,9E9,9E9,9E9,9E9]],v10,fine,tool0;\n", axes.join(","));
    let there = format!("MoveJ {target},v10,fine,tool0;\n");
    for (body, corrected, left) in [
        (format!("{}{there}", at("500")), 1, 1),
        (format!("{}{there}", at("9E9")), 2, 0),
        (format!("{}{there}", at("0")), 2, 0),
        (format!("{}{}{there}", at("500"), at("0")), 3, 0),
        (format!("{}{}{there}", at("500"), at("9E9")), 2, 1),
        // A routine in none of the files may put it back; what waits or sets an output does not.
        (format!("{}{}rPick;\n{there}", at("500"), at("0")), 2, 1),
        (format!("{}{}WaitTime 1;\nSetDO do1,1;\nn:=1;\n{there}", at("500"), at("0")), 3, 0),
        (format!("IndAMove STN1,1\\ToAbsNum:=90,20;\n{there}"), 0, 1),
        (format!("{}sub;\nENDPROC\nPROC sub()\n{there}", at("500")), 1, 1),
    ] {
        let text = format!("MODULE m\nPROC main()\nConfJ\\Off;\n{body}ENDPROC\nENDMODULE\n");
        let found = told(&cell, &[("m.mod", text.clone())], &[&start]);
        assert_eq!(found, (corrected, vec![external.clone(); left]), "{body}");
        assert_eq!(told(&cell, &[("m.mod", text)], &[&start, "--axes-apart"]), (corrected + left, vec![]), "{body}");
    }
}

/// What moves external axes to where no file tells may have put any of them anywhere, until a target tells all of them.
#[test]
fn poses_that_leave_out_an_external_axis_are_left_behind_one_that_is_moved_to_where_no_text_tells() {
    let cell = Cell::kuka(68);
    let q: Vec<f64> = START.iter().map(|q| q.to_radians()).collect();
    let (pose, axes) = (krl(&cell, &q), START.map(|q| format!("{q:.1}")));
    let angles: Vec<String> = axes.iter().enumerate().map(|(k, v)| format!("A{} {v}", k + 1)).collect();
    let home = format!("PTP {{E6AXIS: {},E1 0,E2 0,E3 0,E4 0,E5 0,E6 0}}\n", angles.join(","));
    let there = format!("PTP {pose}\n");
    let external = LeftReason::ExternalAxis.name().to_owned();
    let start = format!("--start={}", axes.join(","));
    for (body, parked, corrected, left) in [
        (format!("ASYPTP XPARK\n{there}"), None, 0, 1),
        (format!("ASYPTP XPARK\n{home}{there}"), None, 2, 0),
        (format!("IF $IN[1] THEN\nASYPTP XPARK\nENDIF\n{there}"), None, 0, 1),
        (format!("ASYPTP XPARK\n{there}"), Some("{E1 0}"), 1, 0),
        (format!("ASYPTP XPARK\n{there}"), Some("{E1 90}"), 0, 1),
        (format!("ASYPTP {{E1 0}}\n{there}"), None, 1, 0),
        (format!("PTP XPARK\n{there}"), None, 1, 0),
        // What ends such a motion moves none that the files put nowhere.
        (format!("ASYSTOP\nASYCANCEL 1\n{there}"), None, 1, 0),
    ] {
        let src = format!("DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n{body}END\n");
        let dat = parked.map(|at| ("a.dat", format!("DEFDAT a\nDECL E6AXIS XPARK={at}\nENDDAT\n")));
        let files: Vec<(&str, String)> = std::iter::once(("a.src", src)).chain(dat).collect();
        let found = told(&cell, &files, &[&start]);
        let unknown = found.1.iter().filter(|reason| **reason == external).count();
        assert_eq!((found.0, unknown), (corrected, left), "{body} {parked:?}: {found:?}");
    }
    let target = robtarget(&cell.nominal.base_from_tip(&q), UNCHECKED);
    let at = |e: &str| format!("MoveAbsJ [[{}],[{e}]],v10,fine,tool0;\n", axes.join(","));
    let (one, all) = (at("0,9E9,9E9,9E9,9E9,9E9"), at("0,0,0,0,0,0"));
    let there = format!("MoveJ {target},v10,fine,tool0;\n");
    let data = |e: &str| {
        let none = "9E9,9E9,9E9,9E9,9E9";
        format!("ENDPROC\nCONST jointtarget jExt:=[[{none},9E9],[{e},{none}]];\nPROC q()\n")
    };
    for (body, corrected, left) in [
        (format!("MoveExtJ jExt,vrot10,fine;\n{there}"), 0, 1),
        (format!("MoveExtJ \\Conc,jExt,vrot10,fine;\n{there}"), 0, 1),
        (format!("IF a=1 MoveExtJ jExt,vrot10,fine;\n{there}"), 0, 1),
        (format!("MoveExtJ jExt,vrot10,fine;\n{one}{there}"), 1, 1),
        (format!("MoveExtJ jExt,vrot10,fine;\n{all}{there}"), 2, 0),
        (format!("MoveExtJ jExt,vrot10,fine;\n{there}{}", data("0")), 1, 0),
        (format!("MoveExtJ jExt,vrot10,fine;\n{there}{}", data("90")), 0, 1),
        // It stops where its signal comes, if not there.
        (format!("SearchExtJ di1,jFound,jExt,vrot10;\n{there}"), 0, 1),
        (format!("SearchExtJ di1,jFound,jExt,vrot10;\n{all}{there}"), 2, 0),
        (format!("SearchExtJ di1,jFound,jExt,vrot10;\n{there}{}", data("0")), 0, 1),
        (format!("MoveAbsJ jHome,v10,fine,tool0;\n{there}"), 1, 0),
        (format!("rPick;\n{there}"), 1, 0),
        (format!("MoveExtJ jExt,vrot10,fine;\n{there}ENDPROC\nPROC MoveExtJ(jointtarget j)\n"), 1, 0),
    ] {
        let text = format!("MODULE m\nPROC main()\nConfJ\\Off;\n{body}ENDPROC\nENDMODULE\n");
        let found = told(&cell, &[("m.mod", text.clone())], &[&start]);
        let unknown = found.1.iter().filter(|reason| **reason == external).count();
        assert_eq!((found.0, unknown), (corrected, left), "{body}: {found:?}");
        assert_eq!(told(&cell, &[("m.mod", text)], &[&start, "--axes-apart"]).0, corrected + left, "{body}");
    }
}

/// Such data (`CONST extjoint pExt:=[500,..]`) may put an axis elsewhere.
#[test]
fn external_axes_of_rapid_that_a_target_has_by_name_may_stand_elsewhere_than_at_zero() {
    let cell = Cell::kuka(69);
    let q: Vec<f64> = START.iter().map(|q| q.to_radians()).collect();
    let axes = START.map(|q| format!("{q:.1}")).join(",");
    let none = "9E9,9E9,9E9,9E9,9E9,9E9";
    let target = robtarget(&cell.nominal.base_from_tip(&q), UNCHECKED);
    let by_name = target.replace(&format!("[{none}]"), "pExt");
    let [computed, external] = [LeftReason::Computed, LeftReason::ExternalAxis].map(LeftReason::name);
    let go = |what: &str| format!("{what},v10,fine,tool0;\n");
    let declared = format!("CONST robtarget pHere:={target};\nCONST extjoint pExt:=[500,9E9,9E9,9E9,9E9,9E9];\n");
    let only_external = format!("CONST jointtarget jExt:=[[{none}],pExt];\n");
    for (before, data, corrected, left) in [
        (go(&format!("MoveJ {by_name}")), "", 0, vec![computed, external]),
        (go(&format!("MoveAbsJ [[{axes}],pExt]")), "", 0, vec![computed, external]),
        ("MoveExtJ jExt,v10,fine;\n".to_owned(), only_external.as_str(), 0, vec![external]),
    ] {
        let there = go("MoveJ pHere");
        let text = format!("MODULE m\n{declared}{data}PROC main()\nConfJ\\Off;\n{before}{there}ENDPROC\nENDMODULE\n");
        let start = format!("--start={axes}");
        let left: Vec<String> = left.into_iter().map(str::to_owned).collect();
        assert_eq!(told(&cell, &[("m.mod", text)], &[&start]), (corrected, left), "{before}");
    }
}

#[test]
fn poses_behind_branches_that_set_tool_frame_or_displacement_differently_are_left() {
    let mut cell = Cell::kuka(67);
    let q = cell.readings();
    let pose = krl(&cell, &q);
    let in_krl = |body: &str| ("a.src", krl_text(&pose, body));
    let (tool, work) = (LeftReason::ToolUnknown.name(), LeftReason::FrameUnknown.name());
    for (body, left) in [
        ("IF $IN[1] THEN\nSET\nENDIF\nMOVE", vec![tool]),
        ("IF $IN[1] THEN\nSET\nELSE\nSET\nENDIF\nMOVE", vec![]),
        ("IF $IN[1] THEN\nSET\nELSE\nMOVE\nENDIF", vec![]),
        ("SWITCH N\nCASE 1\nSET\nCASE 2\nSET\nDEFAULT\nSET\nENDSWITCH\nMOVE", vec![]),
        ("SWITCH N\nCASE 1\nSET\nCASE 2\nSET\nENDSWITCH\nMOVE", vec![tool]),
        ("FOR I=1 TO 3\n$BASE=$ELSEWHERE\nENDFOR\nMOVE", vec![work]),
        ("REPEAT\nSET\nUNTIL $IN[1]\nMOVE", vec![]),
    ] {
        let left: Vec<String> = left.into_iter().map(str::to_owned).collect();
        assert_eq!(told(&cell, &[in_krl(body)], &[]), (1 - left.len(), left), "{body}");
    }
    let (tip, start) = (cell.nominal.base_from_tip(&q), q.iter().map(|q| q.to_degrees().to_string()));
    let start = format!("--start={}", start.collect::<Vec<_>>().join(","));
    let displaced = "PDispSet [[100,0,0],[1,0,0,0],[0,0,0],[0,0,0]];\n";
    for (body, left) in [
        (format!("IF a THEN\n{displaced}ENDIF\n"), vec![work]),
        (format!("IF a {displaced}"), vec![work]),
        (format!("{displaced}IF a THEN\nPDispOff;\nENDIF\n"), vec![work]),
        (format!("{displaced}IF a THEN\nPDispOff;\nELSE\nPDispOff;\nENDIF\n"), vec![]),
    ] {
        let target = robtarget(&tip, UNCHECKED);
        let text =
            format!("MODULE m\nPROC main()\nConfJ\\Off;\n{body}MoveJ {target},v10,fine,tool0;\nENDPROC\nENDMODULE\n");
        let left: Vec<String> = left.into_iter().map(str::to_owned).collect();
        assert_eq!(told(&cell, &[("m.mod", text)], &[&start]), (1 - left.len(), left), "{body}");
    }
    let mut cell = Cell::ur(68);
    let q = cell.readings();
    let pose = script_pose(&cell.nominal.base_from_tip(&q));
    for (body, left) in [
        ("  if a:\n    set_tcp(p[0,0,0.1,0,0,0])\n  end\n", vec![tool]),
        ("  if a:\n    set_tcp(p[0,0,0,0,0,0])\n  end\n", vec![]),
    ] {
        let text = format!("def p():\n  set_tcp(p[0,0,0,0,0,0])\n  movej({q:?})\n{body}  movel({pose})\nend\n");
        let left: Vec<String> = left.into_iter().map(str::to_owned).collect();
        assert_eq!(told(&cell, &[("a.script", text)], &[]), (2 - left.len(), left), "{body}");
    }
}

#[test]
fn poses_in_loops_are_visited_with_what_the_loop_set_before_too() {
    let mut cell = Cell::kuka(69);
    let q = cell.readings();
    let pose = krl(&cell, &q);
    let tool = LeftReason::ToolUnknown.name();
    for (body, left) in [
        ("LOOP\nMOVE\nSET\nENDLOOP", vec![tool]),
        ("WHILE $IN[1]\nFOR I=1 TO 3\nMOVE\nENDFOR\nSET\nENDWHILE", vec![tool]),
        ("FOR I=1 TO 3\nSET\nMOVE\nENDFOR", vec![]),
        ("SET\nREPEAT\nMOVE\nSET\nUNTIL $IN[1]", vec![]),
    ] {
        let left: Vec<String> = left.into_iter().map(str::to_owned).collect();
        assert_eq!(told(&cell, &[("a.src", krl_text(&pose, body))], &[]), (1 - left.len(), left), "{body}");
    }
}

#[test]
fn a_routine_has_the_tool_of_its_calls_and_leaves_the_one_that_it_sets() {
    let mut cell = Cell::kuka(70);
    let q = cell.readings();
    let pose = krl(&cell, &q);
    let moves = |body: &str| krl_moves(&cell, &krl_text(&pose, body));
    let [flange, other] = ["MOVE", "SET\nMOVE"].map(moves);
    assert_ne!(flange, other);
    for (body, wanted) in [
        ("sub()\nMOVE\nEND\nDEF sub()\nSET", &other),
        ("MOVE\nsub()\nEND\nDEF sub()\nSET", &flange),
        ("sub()\nMOVE\nEND\nDEF sub()\nRETURN", &flange),
        ("SET\nsub()\n$TOOL=$NULLFRAME\nEND\nDEF sub()\nMOVE", &other),
        ("first()\nMOVE\nEND\nDEF first()\nsecond()\nEND\nDEF second()\nSET", &other),
    ] {
        assert_eq!(&moves(body), wanted, "{body}");
    }
    let (tool, work) = (LeftReason::ToolUnknown.name(), LeftReason::FrameUnknown.name());
    for (body, left) in [
        ("sub()\nMOVE\nEND\nDEF sub()\nIF $IN[1] THEN\nRETURN\nENDIF\nSET", tool),
        ("sub()\nSET\nsub()\nEND\nDEF sub()\nMOVE", tool),
        ("SET\nEND\nDEF uncalled()\nMOVE", work),
    ] {
        assert_eq!(told(&cell, &[("a.src", krl_text(&pose, body))], &[]), (0, vec![left.to_owned()]), "{body}");
    }
}

#[test]
fn routines_of_scripts_and_modules_that_set_tool_or_displacement_are_followed_too() {
    let mut cell = Cell::ur(71);
    let q = cell.readings();
    let pose = script_pose(&cell.nominal.base_from_tip(&q));
    let (tool, work) = (LeftReason::ToolUnknown.name(), LeftReason::FrameUnknown.name());
    let routine = "  def grip():\n    set_tcp(get_target_tcp_pose())\n  end\n";
    for (body, left) in [
        (format!("{routine}  movel({pose})\n"), vec![]),
        (format!("{routine}  grip()\n  movel({pose})\n"), vec![tool]),
        (format!("  while a:\n    movel({pose})\n    set_tcp(p[0,0,0.1,0,0,0])\n  end\n"), vec![tool]),
    ] {
        let text = format!("def p():\n  set_tcp(p[0,0,0,0,0,0])\n  movej({q:?})\n{body}end\n");
        let left: Vec<String> = left.into_iter().map(str::to_owned).collect();
        assert_eq!(told(&cell, &[("a.script", text)], &[]), (2 - left.len(), left), "{body}");
    }
    let mut cell = Cell::kuka(72);
    let q = cell.readings();
    let (tip, start) = (cell.nominal.base_from_tip(&q), q.iter().map(|q| q.to_degrees().to_string()));
    let start = format!("--start={}", start.collect::<Vec<_>>().join(","));
    let displace = "PDispSet [[100,0,0],[1,0,0,0],[0,0,0],[0,0,0]];\n";
    let target = robtarget(&tip, UNCHECKED);
    let step = format!("MoveJ {target},v10,fine,tool0;\n");
    for (body, left) in [
        (format!("Shift;\n{step}"), vec![work]),
        (format!("IF a Shift;\n{step}"), vec![work]),
        (format!("{step}Shift;\n"), vec![]),
        (format!("WHILE a DO\n{step}{displace}ENDWHILE\n"), vec![work]),
        (format!("WHILE a DO\n{step}{displace}PDispOff;\nENDWHILE\n"), vec![]),
    ] {
        let text =
            format!("MODULE m\nPROC main()\nConfJ\\Off;\n{body}ENDPROC\nPROC Shift()\n{displace}ENDPROC\nENDMODULE\n");
        let left: Vec<String> = left.into_iter().map(str::to_owned).collect();
        assert_eq!(told(&cell, &[("m.mod", text)], &[&start]), (1 - left.len(), left), "{body}");
    }
}
