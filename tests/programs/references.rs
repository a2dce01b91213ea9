//! Positions, tools and frames that routines change which are given them by reference.

use crate::programs_support::Cell;
use crate::programs_support::text::{UNCHECKED, krl_pose as krl, robtarget, told};
use robotcal::programs::LeftReason;

/// A pose as RAPID has it, with confdata that no check heeds.
fn rapid(cell: &Cell, q: &[f64]) -> String {
    robtarget(&cell.nominal.base_from_tip(q), UNCHECKED)
}

const TOOL: &str = "[TRUE,[[0,0,0],[1,0,0,0]],[1,[0,0,50],[1,0,0,0],0,0,0]]";
const WORK: &str = "[FALSE,TRUE,\"\",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]]";

#[test]
fn what_routines_of_rapid_change_by_reference_is_not_corrected() {
    let mut cell = Cell::kuka(121);
    let q = cell.readings();
    let axes: Vec<f64> = q.iter().map(|v| v.to_degrees()).collect();
    let data = format!(
        "PERS tooldata tA:={TOOL};\nPERS wobjdata wA:={WORK};\nPERS robtarget p:={0};\nCONST robtarget c:={0};\n",
        rapid(&cell, &q)
    );
    let text = |body: &str, routines: &str| {
        format!(
            "MODULE m\n{data}PROC main()\nConfJ\\Off;\nConfL\\Off;\nMoveAbsJ [{axes:?},[9E9,9E9,9E9,9E9,9E9,9E9]],v10,fine,tA;\n{body}\nENDPROC\n{routines}ENDMODULE\n"
        )
    };
    let (to_p, to_c) = ("MoveJ p,v10,fine,tA\\WObj:=wA;", "MoveJ c,v10,fine,tA\\WObj:=wA;");
    let go = "PROC go(robtarget r,PERS tooldata t,PERS wobjdata w)\nMoveL r,v10,fine,t\\WObj:=w;\nENDPROC\n";
    let (computed, tool, frame) = (LeftReason::Computed, LeftReason::ToolUnknown, LeftReason::FrameUnknown);
    for (body, routines, left) in [
        (format!("next p;\n{to_p}"), "PROC next(INOUT robtarget t)\nt.trans:=[250,60,200];\nENDPROC\n", vec![computed]),
        (format!("next p;\n{to_p}"), "PROC next(robtarget t)\nt.trans:=[250,60,200];\nENDPROC\n", vec![]),
        (format!("next p;\n{to_p}"), "PROC next(INOUT robtarget t)\nTPWrite \"x\";\nENDPROC\n", vec![]),
        (
            format!("next p;\n{to_p}"),
            "PROC next(INOUT robtarget t)\ninner 1,t;\nENDPROC\nPROC inner(num n,INOUT robtarget u)\nu:=CRobT();\nENDPROC\n",
            vec![computed],
        ),
        (format!("next\\t:=p;\n{to_p}"), "PROC next(\\INOUT robtarget t)\nt:=CRobT();\nENDPROC\n", vec![computed]),
        (format!("next c;\n{to_c}"), "", vec![]),
        (format!("IF NOT seen(p) Stop;\n{to_p}"), "", vec![computed]),
        (format!("GetVis p;\n{to_p}"), "", vec![computed]),
        (format!("%\"vis\"% p;\n{to_p}"), "", vec![computed]),
        (format!("SearchL di1,p,c,v10,tA\\WObj:=wA;\n{to_p}"), "", vec![computed]),
        (format!("SetW wA;\n{to_c}"), "PROC SetW(INOUT wobjdata w)\nw.uframe.trans:=[9,9,9];\nENDPROC\n", vec![frame]),
        (format!("GetSysData wA;\n{to_c}"), "", vec![frame]),
        // An instruction that names a tool and a work object goes there with them.
        (format!("{to_c}\nPaintL v10,b1,fine,tA\\WObj:=wA;\n{to_c}"), "", vec![]),
        (format!("{to_c}\nPaintOn\\WObj:=wA;"), "", vec![frame]),
        (format!("MToolTCPCalib j1,j2,j3,j4,tA,mx,mn;\n{to_c}"), "", vec![tool]),
        (format!("go p,tA,wA;\nSetSysData tA;\nTPWrite \"\"\\Num:=Distance(a,b);\n{to_c}"), go, vec![]),
        (format!("CapL p,v10,c1,fine,tA\\WObj:=wA;\n{to_p}"), "", vec![]),
        (format!("j:=CalcJointT(p,tA\\WObj:=wA);\n{to_c}\n{to_p}"), "", vec![]),
    ] {
        let (_, reasons) = told(&cell, &[("m.mod", text(&body, routines))], &[]);
        let wanted: Vec<_> = left.iter().map(|reason| reason.name().to_owned()).collect();
        let reasons: Vec<_> = reasons.into_iter().filter(|r| r != LeftReason::Unvisited.name()).collect();
        // In the routine itself nothing tells its parameter.
        let own = usize::from(routines == go);
        assert_eq!(reasons[..reasons.len() - own], wanted[..], "{body}\n{routines}");
    }
}

#[test]
fn what_routines_of_krl_change_by_reference_is_not_corrected() {
    let mut cell = Cell::kuka(122);
    let q = cell.readings();
    let pose = krl(&cell, &q);
    let dat =
        format!("DEFDAT a\nDECL E6POS XP1={pose}\nP[1]={pose}\nDECL FRAME F1={{X 0,Y 0,Z 0,A 0,B 0,C 0}}\nENDDAT\n");
    let text = |body: &str| format!("DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n{body}\nEND\n");
    let (computed, frame) = (Some(LeftReason::Computed), Some(LeftReason::FrameUnknown));
    for (body, left) in [
        ("SUB(XP1)\nPTP XP1\nEND\nDEF SUB(T)\nT.X=5", computed),
        ("SUB(XP1)\nPTP XP1\nEND\nDEF SUB(T:OUT)\nT=$POS_ACT", computed),
        ("SUB(XP1)\nPTP XP1\nEND\nDEF SUB(T:IN)\nT.X=5", None),
        ("SUB(XP1)\nPTP XP1\nEND\nDEF SUB(T:OUT)\nHALT", None),
        ("SUB(XP1)\nPTP XP1\nEND\nDEF SUB(T)\nDEEP(1,T)\nEND\nDEF DEEP(N:IN,U:OUT)\nU.Z=1", computed),
        ("OK=SEEN(XP1)\nPTP XP1", computed),
        ("CREAD(H,ST,#SEQ,TO,OFS,\"%r\",XP1)\nPTP XP1", computed),
        ("SREAD(B[],ST,OFS,\"%f\",XP1.X)\nPTP XP1", computed),
        ("SWRITE(B[],ST,OFS,\"%f\",XP1.X)\nPTP XP1", None),
        ("RET=EKI_SetReal(\"a\",\"b\",XP1.X)\nPTP XP1", None),
        ("RET=EKI_GetFrame(\"a\",\"b\",XP1)\nPTP XP1", computed),
        ("FILL(P[])\nPTP P[1]\nEND\nDEF FILL(A[]:OUT)\nA[1].Z=420", computed),
        ("A6=INVERSE(XP1,S,ERR)\nPTP XP1", None),
        ("INTERRUPT DECL 5 WHEN $IN[3] DO XP1=XP2\nPTP XP1", computed),
        ("TRIGGER WHEN DISTANCE=0 DELAY=0 DO XP1.X=5\nPTP XP1", computed),
        ("TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[1]=TRUE\nPTP XP1", None),
        ("FIND(F1)\n$BASE=F1\nPTP XP1\nEND\nDEF FIND(F)\nF.X=9", frame),
        ("FIND($BASE)\nPTP XP1", frame),
        ("$BASE=$WORLD\nPTP XP1", None),
        ("$BASE=$WORLDS\nPTP XP1", frame),
    ] {
        let files = [("a.src", text(body)), ("a.dat", dat.clone())];
        let (_, reasons) = told(&cell, &files, &[]);
        let reasons: Vec<_> = reasons.into_iter().filter(|r| r != LeftReason::Unvisited.name()).collect();
        assert_eq!(reasons, left.map(|reason| reason.name().to_owned()).into_iter().collect::<Vec<_>>(), "{body}");
    }
}

/// `INITMOV` sets tool 1 and the world as base; a base on an external kinematic is elsewhere.
#[test]
fn frames_that_bas_sets_are_those_of_the_controller() {
    let mut cell = Cell::kuka(123);
    let q = cell.readings();
    let pose = krl(&cell, &q);
    let tools = "TOOL_DATA[1]={X 10,Y 0,Z 0,A 0,B 0,C 0}\nTOOL_DATA[2]={X 0,Y 0,Z 90,A 0,B 0,C 0}\n";
    let data = |more: &str| format!("DEFDAT $CONFIG PUBLIC\nBASE_DATA[1]={{X 5,Y 0,Z 0,A 0,B 0,C 0}}\n{more}ENDDAT\n");
    let moves = |body: &str, more: &str| {
        let text = format!("DEF a()\nBAS(#TOOL,2)\nBAS(#BASE,1)\n{body}PTP {pose}\nEND\n");
        let files = [("a.src", text), ("$config.dat", data(more))];
        let paths: Vec<_> = files.iter().map(|(name, text)| cell.write(name, text.as_bytes())).collect();
        let run = cell.compensate(&paths.iter().collect::<Vec<_>>(), &["--unordered"]);
        let told = run.told();
        (run.text("a.src").lines().find(|l| l.starts_with("PTP")).unwrap().to_owned(), told.left)
    };
    let by_initmov = moves("BAS(#INITMOV,0)\n", tools);
    let by_hand = moves("BAS(#TOOL,1)\nBAS(#BASE,0)\n", tools);
    assert_eq!(by_initmov, by_hand);
    assert_ne!(by_initmov, moves("", tools));
    let unknown = moves("BAS(#INITMOV,0)\n", "").1;
    assert_eq!(unknown[0].2, LeftReason::ToolUnknown.name());
    let data = "FDAT_ACT={TOOL_NO 1,BASE_NO 0,IPO_FRAME #BASE}\n";
    assert_eq!(moves(&format!("{data}BAS(#FRAMES)\n"), tools), by_hand);
    assert_eq!(moves(data, tools).1[0].2, LeftReason::FrameUnknown.name());
    for (index, left) in [(2, vec![LeftReason::FrameUnknown.name()]), (1, vec![]), (0, vec![])] {
        let frame = format!("MACHINE_FRAME_DAT[1]={{MACH_DEF_INDEX {index},PARENT[] \"DKP\",GEOMETRY[] \" \"}}\n");
        let found = moves("", &(tools.to_owned() + &frame)).1;
        assert_eq!(found.iter().map(|(_, _, reason)| reason.as_str()).collect::<Vec<_>>(), left, "{index}");
    }
}

/// What may change a tool or a work object is named, and nothing says that its numbers are missing.
#[test]
fn what_may_change_a_frame_of_rapid_is_named() {
    let mut cell = Cell::kuka(124);
    let q = cell.readings();
    let pose = rapid(&cell, &q);
    let step = format!("MoveJ {pose},v10,fine,tA\\WObj:=wA;");
    let routine = "ENDPROC\nPROC find(INOUT wobjdata w)\nw.uframe.trans.x:=9;";
    for (body, names) in [
        (format!("{step}\nwA.uframe.trans.x:=470;"), "m.mod:5"),
        (format!("{step}\nGetSysData wA;"), "GETSYSDATA"),
        (format!("{step}\n%\"find\"% wA;"), "computed"),
        (format!("{step}\nfind wA;\n{routine}"), "FIND"),
    ] {
        let text = format!(
            "MODULE m\nPERS tooldata tA:={TOOL};PERS wobjdata wA:={WORK};\nPROC main()\n{body}\nENDPROC\nENDMODULE\n"
        );
        let file = cell.write("m.mod", text.as_bytes());
        let run = cell.compensate(&[&file], &["--unordered"]).expect(1);
        assert!(run.told().has(4, "MoveJ", LeftReason::FrameUnknown), "{body}: {:?}", run.told());
        let table = run.text("corrections.csv");
        let left = table.lines().find(|l| l.ends_with(LeftReason::FrameUnknown.name())).unwrap();
        assert!(left.contains(names) && left.contains("--work"), "{left}");
    }
}
