//! Tool and work object that the user states: for what the text does not tell, and for nothing else.

use crate::programs_support::Cell;
use crate::programs_support::text::{
    beside, confdata, krl_pose as krl, krl_text, script_pose, told, tool_robtarget as robtarget,
};
use crate::said::assert_says;
use robotcal::Code;
use robotcal::geom::Pose;
use robotcal::programs::LeftReason;

/// Tools and work objects that are held, stand, and others.
const FRAMES: &str = "PERS tooldata tRoom:=[FALSE,[[900,100,400],[0,0,1,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
PERS tooldata tSet:=[TRUE,[[0,0,90],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
PERS wobjdata wHeld:=[TRUE,TRUE,\"\",[[10,20,150],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
PERS wobjdata wUnit:=[FALSE,FALSE,\"STN1\",[[10,20,150],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
PERS wobjdata wSet:=[FALSE,TRUE,\"\",[[10,20,150],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
";

#[test]
fn a_tool_in_the_room_and_a_work_object_that_moves_are_no_frames_for_which_others_stand() {
    let cell = Cell::kuka(221);
    let q = beside(1);
    let target = robtarget(&cell, &q, &Pose::identity(), &Pose::identity(), &confdata(&q));
    let stated = ["--tool=0,0,0,1,0,0,0", "--work=0,0,0,1,0,0,0"];
    let (tool, work) = (LeftReason::ToolUnknown, LeftReason::FrameUnknown);
    let [set_room, set_held] = ["tRoom.tframe.trans.x:=1;", "wHeld.oframe:=x;"];
    for (frames, set, flags, left) in [
        ("tRoom\\WObj:=wobj0", "", &stated[..], Some(tool)),
        ("tRoom\\WObj:=wobj0", set_room, &stated, Some(tool)),
        ("tool0\\WObj:=wHeld", "", &stated, Some(work)),
        ("tool0\\WObj:=wHeld", set_held, &stated, Some(work)),
        ("tool0\\WObj:=wUnit", "", &stated, Some(work)),
        ("tSet\\WObj:=wSet", "tSet.tframe:=x;\nwSet.oframe:=x;", &[], Some(work)),
        ("tSet\\WObj:=wSet", "tSet.tframe:=x;\nwSet.oframe:=x;", &stated, None),
        ("tMissing\\WObj:=wMissing", "", &stated, None),
    ] {
        let text =
            format!("MODULE m\n{FRAMES}PROC main()\nMoveJ {target},v10,fine,{frames};\n{set}\nENDPROC\nENDMODULE\n");
        let file = cell.write("m.mod", text.as_bytes());
        let run = cell.compensate(&[&file], &[&["--unordered"], flags].concat()).expect(i32::from(left.is_some()));
        let reasons: Vec<String> = run.told().left.into_iter().map(|(.., reason)| reason).collect();
        assert_eq!(
            reasons,
            left.map(|reason| reason.name().to_owned()).into_iter().collect::<Vec<_>>(),
            "{frames} {set}"
        );
        assert_eq!(run.text("m.mod") == text, left.is_some(), "{frames} {set}");
    }
}

/// `SET` sets a tool 50 mm before the flange, which is the tool at first.
#[test]
fn a_stated_tool_stands_for_none_of_those_that_the_text_has() {
    let cell = Cell::kuka(222);
    let pose = krl(&cell, &beside(0));
    let (tool, work) = (LeftReason::ToolUnknown.name(), LeftReason::FrameUnknown.name());
    let [none, own, other] = ["--tool=0,0,0,0,0,0", "--tool=0,0,50,0,0,0", "--tool=0,0,5,0,0,0"];
    let maybe = "IF $IN[1] THEN\nSET\nENDIF\nMOVE";
    let label = |before: &str| format!("HERE:\nMOVE\n{before}IF $IN[1] THEN\nGOTO HERE\nENDIF");
    let handler = "INTERRUPT DECL 10 WHEN $IN[1]==TRUE DO h( )\nINTERRUPT ON 10\nMOVE\n";
    for (body, flag, corrected, left) in [
        (maybe.to_owned(), other, 0, vec![tool]),
        (maybe.to_owned(), own, 0, vec![tool]),
        ("$TOOL=GET()\nMOVE".to_owned(), other, 1, vec![]),
        ("BAS(#TOOL,7)\nMOVE".to_owned(), other, 1, vec![]),
        ("IF $IN[1] THEN\nBAS(#TOOL,7)\nELSE\nSET\nENDIF\nMOVE".to_owned(), other, 0, vec![tool]),
        ("IF $IN[1] THEN\nBAS(#TOOL,7)\nELSE\nSET\nENDIF\nMOVE".to_owned(), own, 1, vec![]),
        (label(""), none, 1, vec![]),
        (label(""), other, 0, vec![tool]),
        (label("SET\n"), none, 0, vec![tool]),
        (label("SET\n"), own, 0, vec![tool]),
        (format!("{handler}END\nDEF h()\nMOVE"), none, 2, vec![]),
        (format!("{handler}END\nDEF h()\nMOVE"), other, 1, vec![tool]),
        (format!("{handler}SET\nMOVE\nEND\nDEF h()\nMOVE"), none, 2, vec![tool]),
        ("$BASE=EK(MACHINE_DEF[2].ROOT,MACHINE_DEF[2].MECH_TYPE,X)\nMOVE".to_owned(), none, 0, vec![work]),
        ("BAS(#EX_BASE,1)\nMOVE".to_owned(), none, 0, vec![work]),
    ] {
        let left: Vec<String> = left.into_iter().map(str::to_owned).collect();
        let found = told(&cell, &[("a.src", krl_text(&pose, &body))], &[flag, "--work=0,0,0,0,0,0"]);
        assert_eq!(found, (corrected, left), "{body} {flag}");
    }
    // The tool that is not set where the branch is not taken is the stated one.
    for (flag, left) in [(own, vec![]), (other, vec![tool.to_owned()])] {
        let text = krl_text(&pose, maybe).replacen("$TOOL=$NULLFRAME\n", "", 1);
        assert_eq!(told(&cell, &[("a.src", text)], &[flag]), (1 - left.len(), left), "{flag}");
    }
}

/// What holds anywhere in the main program may hold where an interrupt or a jump leads.
#[test]
fn a_handler_and_a_label_of_krl_begin_with_what_a_sensor_or_a_fixed_tool_may_do() {
    let cell = Cell::kuka(223);
    let pose = krl(&cell, &beside(0));
    let handler = "END\nDEF h()\n$BASE=$NULLFRAME\n$TOOL=$NULLFRAME\nMOVE";
    let begins = "INTERRUPT DECL 10 WHEN $IN[1]==TRUE DO h( )\nINTERRUPT ON 10\nMOVE\n";
    let label = "HERE:\n$BASE=$NULLFRAME\n$TOOL=$NULLFRAME\nMOVE\n";
    let jump = "IF $IN[1] THEN\nGOTO HERE\nENDIF";
    let (tool, work) = (LeftReason::ToolUnknown.name(), LeftReason::FrameUnknown.name());
    for (body, corrected, left) in [
        (format!("{begins}WAIT SEC 1\n{handler}"), 2, vec![]),
        (format!("{begins}RSI_ON()\nWAIT SEC 1\nRSI_OFF()\n{handler}"), 1, vec![work]),
        (format!("{begins}RSI_ON()\nRSI_MoveCorr()\nRSI_OFF()\n{handler}"), 1, vec![work]),
        (format!("{begins}RSI_ON()\nWEAVE()\nRSI_OFF()\n{handler}"), 1, vec![work]),
        (format!("{begins}RSI_ON()\nR=SIN(3)\nRSI_OFF()\n{handler}"), 2, vec![]),
        (format!("{begins}$IPO_MODE=#TCP\nWAIT SEC 1\n$IPO_MODE=#BASE\n{handler}"), 1, vec![tool]),
        (format!("{label}{jump}"), 1, vec![]),
        (format!("{label}RSI_ON()\n{jump}"), 0, vec![work]),
        (format!("{label}$IPO_MODE=#TCP\n{jump}"), 0, vec![tool]),
    ] {
        let left: Vec<String> = left.into_iter().map(str::to_owned).collect();
        assert_eq!(told(&cell, &[("a.src", krl_text(&pose, &body))], &[]), (corrected, left), "{body}");
    }
}

/// The flag is named where it helps.
#[test]
fn a_script_says_whether_stating_the_tool_helps() {
    let cell = Cell::ur(224);
    let q = beside(0);
    let pose = script_pose(&cell.nominal.base_from_tip(&q));
    let (set, other) = ("  set_tcp(p[0,0,0,0,0,0])\n", "  set_tcp(p[0,0,0.1,0,0,0])\n");
    for (before, helps) in [
        (String::new(), true),
        (format!("{set}  if a:\n  {other}  end\n"), false),
        (format!("{set}  thread t():\n  {other}  end\n  h = run t()\n"), false),
        ("  set_tcp(get_target_tcp_offset())\n".to_owned(), true),
        (format!("{set}  set_tcp(get_target_tcp_offset())\n"), true),
        (format!("{set}  if a:\n    set_tcp(get_target_tcp_offset())\n  end\n"), false),
    ] {
        let text = format!("def p():\n  movej({q:?})\n{before}  movel({pose})\nend\n");
        let file = cell.write("a.script", text.as_bytes());
        for flags in [&["--unordered"][..], &["--unordered", "--tool=0,0,0.02,0,0,0"]] {
            let run = cell.compensate(&[&file], flags);
            let is_left = !(helps && flags.len() > 1);
            assert_eq!(run.told().left.len(), usize::from(is_left), "{before} {flags:?}");
            let table = run.text("corrections.csv");
            let left = table.lines().find(|l| l.ends_with(LeftReason::ToolUnknown.name()));
            assert_eq!(left.map(|left| left.contains("--tool")), is_left.then_some(helps), "{before} {flags:?}");
        }
    }
}

#[test]
fn stated_frames_are_numbers_or_written_as_the_language_writes_them() {
    let cell = Cell::kuka(225);
    let q = beside(0);
    let pose = krl(&cell, &q);
    let source = format!("DEF a()\nPTP {pose}\nEND\n");
    let target = robtarget(&cell, &q, &Pose::identity(), &Pose::identity(), &confdata(&q));
    let module = format!("MODULE m\nPROC main()\nMoveJ {target},v1,z1,tX\\WObj:=wX;\nENDPROC\nENDMODULE\n");
    let script = format!("def p():\n  movej({q:?})\n  movel({})\nend\n", script_pose(&cell.nominal.base_from_tip(&q)));
    for (name, text, numbers, written, wrong) in [
        ("a.src", &source, "1,-2,30,0,1,0", "{X 1, Y -2.0, Z 30, A 0, B 1, C 0}", "{X 1,Y -2,Z 30}"),
        ("m.mod", &module, "1,-2,30,0.999962,0,0.008727,0", "[[1,-2.0,30], [0.999962,0,0.008727,0]]", "[[1,-2,30]]"),
        ("p.script", &script, "0.01,-0.02,0.03,0,0.02,0", "p[0.01,-0.02,0.03, 0,0.02,0]", "[0.01,-0.02,0.03,0,0.1,0]"),
    ] {
        let file = cell.write(name, text.as_bytes());
        let run = |frame: &str| cell.compensate(&[&file], &["--unordered", "--work", frame, "--tool", frame]);
        let [by_numbers, by_text] = [numbers, written].map(|frame| run(frame).expect(0).text(name));
        assert_eq!(by_numbers, by_text);
        assert_ne!(&by_numbers, text);
        for frame in [wrong, "1,2", "x", ""] {
            assert_says(&run(frame).expect(2).said(), Code::OptionRange, &["--tool"]);
        }
    }
}

#[test]
fn packed_files_are_named_as_what_they_are() {
    let cell = Cell::ur(226);
    for (bytes, names) in [(&b"\x1f\x8b\x08\0\0\0"[..], ".script"), (b"PK\x03\x04\x14\0", "zip")] {
        for name in ["p.urp", "p.zip", "p.script"] {
            let file = cell.write(name, bytes);
            for flags in [&[][..], &["--language", "krl"]] {
                assert_says(&cell.compensate(&[&file], flags).expect(2).said(), Code::ProgramLanguage, &[name, names]);
            }
        }
    }
    for (name, bytes, words) in
        [("p.ls", &b"/PROG P\n"[..], "FANUC"), ("p.tp", b"\x05\0\0\x01P\0", "FANUC"), ("p.jbi", b"/JOB\n", "INFORM")]
    {
        let file = cell.write(name, bytes);
        assert_says(&cell.compensate(&[&file], &[]).expect(2).said(), Code::ProgramLanguage, &[name, words, ".csv"]);
    }
}
