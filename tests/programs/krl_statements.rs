//! Statements of KRL beside the usual ones: where the robot goes behind them, and with which frames.

use crate::programs_support::text::{beside, told_beside_first as told};
use crate::programs_support::{Cell, Run, assert_brings_to, krl_frame};
use crate::ways::krl;
use robotcal::programs::LeftReason;

/// Checks how many targets of each body are corrected beside the first, and why the others are left.
fn check(cell: &Cell, cases: &[(&str, usize, &[LeftReason])]) {
    for (body, corrected, left) in cases {
        let (done, mut reasons) = told(cell, &[("a.src", krl(cell, body))], &[]);
        let mut wanted: Vec<String> = left.iter().map(|reason| reason.name().to_owned()).collect();
        reasons.sort();
        wanted.sort();
        assert_eq!((done, reasons), (*corrected, wanted), "{body}");
    }
}

fn run(cell: &Cell, body: &str) -> Run {
    cell.compensate(&[&cell.write("a.src", krl(cell, body).as_bytes())], &["--unordered"])
}

/// Asserts that all is corrected, and that the lines that begin so bring the robot to the first poses of the body, in their order.
fn assert_all_meet(cell: &Cell, body: &str, begins: &str) {
    let new = run(cell, body).expect(0).text("a.src");
    let is_one = |line: &&str| line.trim_start().starts_with(begins) && line.contains('{');
    let lines: Vec<&str> = new.lines().skip(4).filter(is_one).collect();
    assert!(!lines.is_empty(), "{new}");
    for (k, line) in lines.iter().enumerate() {
        let (_, numbers) = line.split_once('{').unwrap();
        assert_brings_to(cell, &krl_frame(numbers), &beside(k + 1), &format!("{body}\n{line}"));
    }
}

/// A frame that is not zero, and one that is.
const OTHER: &str = "{X 100,Y 50,Z -40,A 15,B 0,C 0}";
const NONE: &str = "{X 0,Y 0,Z 0,A 0,B 0,C 0}";

#[test]
fn a_motion_to_a_variable_of_the_controller_leads_to_where_the_text_does_not_tell() {
    use LeftReason::{Incomplete, PostureUnknown, Undeclared};
    let cell = Cell::kuka(181);
    check(
        &cell,
        &[
            ("PTP $AXIS_HOME[1]\nLIN {Z 700}\n", 0, &[Undeclared, Incomplete]),
            ("PTP $AXIS_HOME[1]\nPTP @\n", 0, &[Undeclared, PostureUnknown]),
            ("$H_POS=XHOME\nPTP $H_POS\nLIN {Z 700}\n", 0, &[Undeclared, Incomplete]),
            ("P1=@\n$H_POS=P1\nPTP $H_POS\nLIN {Z 700}\n", 2, &[]),
            ("LIN $POS_INT\nLIN {Z 700}\n", 0, &[Undeclared, Incomplete]),
            ("LIN $NULLFRAME\nLIN @\n", 0, &[Undeclared, PostureUnknown]),
            ("PTP $AXIS_HOME[1]\nPTP <N>\nLIN {Z 700}\n", 2, &[Undeclared]),
            ("GOHOME( )\nLIN {Z 700}\nEND\nDEF GOHOME( )\nPTP $AXIS_HOME[1]\n", 0, &[Undeclared, Incomplete]),
            ("PTP $AXIS_ACT\nLIN @\nLIN $POS_ACT\nLIN {Z 700}\nPTP $AXIS_ACT_MEAS\nLIN @\n", 3, &[]),
        ],
    );
}

#[test]
fn behind_a_relative_motion_what_a_target_leaves_out_is_not_known() {
    use LeftReason::{Incomplete, Relative};
    let cell = Cell::kuka(182);
    let called = "MOVE( )\nLIN {Z 700}\nEND\nDEF MOVE( )\n";
    let [once, twice, maybe] = [
        "LIN_REL {Y 100}\n",
        "NEXT( )\nEND\nDEF NEXT( )\nLIN_REL {Y 100}\n",
        "IF $IN[1] THEN\nLIN_REL {Y 100}\nENDIF\n",
    ]
    .map(|routine| format!("{called}{routine}"));
    check(
        &cell,
        &[
            ("SPL_REL {X 30}\nLIN {Z 700}\n", 0, &[Relative, Incomplete]),
            ("SPLINE\nSPL @\nSPL_REL {X 30}\nSPL @\nENDSPLINE\nLIN {Z 700}\n", 3, &[Relative]),
            (&once, 0, &[Relative, Incomplete]),
            (&twice, 0, &[Relative, Incomplete]),
            (&maybe, 0, &[Relative, Incomplete]),
            ("MOVE( )\nLIN @\nLIN {Z 700}\nEND\nDEF MOVE( )\nLIN_REL {Y 100}\n", 2, &[Relative]),
        ],
    );
}

#[test]
fn a_routine_in_none_of_the_files_may_move_the_robot() {
    use LeftReason::{Incomplete, NotATarget};
    let cell = Cell::kuka(183);
    check(
        &cell,
        &[
            ("MOVE_EXT( )\nLIN {Z 700}\n", 0, &[Incomplete]),
            ("OK=MOVE_EXT(1)\nLIN {Z 700}\n", 0, &[Incomplete]),
            ("MOVE_EXT( )\nLIN {Z 700}\nLIN @\nLIN {Z 700}\n", 2, &[Incomplete]),
            ("SUB( )\nLIN {Z 700}\nEND\nDEF SUB( )\nMOVE_EXT( )\n", 0, &[Incomplete]),
            ("SUB( )\nLIN {Z 700}\nEND\nDEF SUB( )\nWAIT SEC 1\n", 1, &[]),
            (
                "R=ABS(R)\nIF (R>1) THEN\nPULSE ($OUT[1],TRUE,0.5)\nENDIF\nSWRITE(T[],S,O,\"%d\",R)\nLIN {Z 700}\n",
                1,
                &[],
            ),
            ("SLIN @ WITH $VEL=SVEL_CP(0.2,,LP1),$CM[1]=USE_CM_PRO_VALUES(0)\nLIN {Z 700}\n", 2, &[]),
            // Positions that it is given.
            ("MYMOVE(@)\nLIN @\n", 0, &[NotATarget, LeftReason::PostureUnknown]),
            ("MYMOVE(1,<N>)\nLIN @\n", 0, &[NotATarget, LeftReason::PostureUnknown]),
            ("SETLASER({A 5,B 2},TRUE)\nLIN @\n", 1, &[]),
            ("OK=MYMOVE(@)\n", 0, &[NotATarget]),
            ("MYMOVE(@)\nLIN {Z 700}\n", 0, &[NotATarget, Incomplete]),
            ("P1=@\nMYMOVE(P1)\n", 0, &[NotATarget]),
            ("P1=@\nMYMOVE(P1,P1)\nP1=@\nMYMOVE(P1)\n", 0, &[NotATarget, NotATarget]),
            ("P1=@\nMYMOVE(P1)\nLIN P1\n", 0, &[LeftReason::Computed]),
            ("A1=INVERSE(@,A0,N)\nLIN @\n", 1, &[]),
            ("GO(@)\nEND\nDEF GO(P :IN)\nLIN P\n", 0, &[LeftReason::Computed]),
        ],
    );
    // A whole target behind such a call is met as without it.
    assert_all_meet(&cell, "LIN @\nGRIP( )\nLIN @\n", "LIN");
}

#[test]
fn frames_of_a_spline_block_of_joint_motions_hold_for_it_alone() {
    let cell = Cell::kuka(184);
    for header in ["PTP_SPLINE", "PTP SPLINE", "SPLINE"] {
        let motion = if header == "SPLINE" { "SLIN" } else { "SPTP" };
        let body = format!(
            "$BASE={OTHER}\n$TOOL={OTHER}\n{header} WITH $BASE={NONE}, $TOOL={NONE}\n {motion} @\n {motion} @\nENDSPLINE\n"
        );
        assert_all_meet(&cell, &body, motion);
    }
    let body = format!("PTP_SPLINE WITH $BASE={OTHER}, $TOOL={OTHER}\nENDSPLINE\nSPTP @\n");
    assert_all_meet(&cell, &body, "SPTP");
    // What a block takes as its base is no target of its own.
    let body = "P1=@\nLIN P1\nPTP_SPLINE WITH $TOOL=$NULLFRAME, $BASE=P1\nENDSPLINE\n";
    check(&cell, &[(body, 0, &[LeftReason::FramesDiffer])]);
}

/// Every `BAS` takes them, not the first alone.
#[test]
fn motion_data_stay_until_others_are_stated() {
    let cell = Cell::kuka(187);
    let body = format!(
        "TOOL_DATA[1]={NONE}\nBASE_DATA[2]={NONE}\nFDAT_ACT={{TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE}}\nBAS(#PTP_PARAMS,100)\nLIN @\n$BASE={OTHER}\n\
         BAS(#CP_PARAMS,0.2)\nLIN @\n"
    );
    assert_all_meet(&cell, &body, "LIN");
}

#[test]
fn a_copy_has_what_was_copied_whatever_that_gets_later() {
    use LeftReason::{Computed, FramesDiffer};
    let cell = Cell::kuka(185);
    assert_all_meet(&cell, "P2=@\nP1=P2\nP2=@\nLIN P1\nLIN P2\n", "P2=");
    assert_all_meet(&cell, "P2=@\nP1=P2\nP3=P1\nP1=@\nP2=@\nLIN P1\nLIN P2\nLIN P3\n", "P");
    let set_below = "INIT( )\nP1=P2\nGO( )\nEND\nDEF INIT( )\nP2=@\nEND\nDEF GO( )\nPTP <N>\nLIN P1\n";
    assert_all_meet(&cell, set_below, "P2=");
    for frame in ["$BASE", "$TOOL"] {
        assert_all_meet(&cell, &format!("F1={NONE}\nF2=F1\nF1={OTHER}\n{frame}=F2\nLIN @\n"), "LIN");
        assert_all_meet(&cell, &format!("F1={OTHER}\nF2=F1\nF1={NONE}\n{frame}=F1\nLIN @\n"), "LIN");
    }
    check(
        &cell,
        &[
            ("P1=P2\nP2=@\nLIN P1\n", 0, &[Computed]),
            ("LOOP\nP1=P2\nP2=@\nLIN P1\nENDLOOP\n", 0, &[Computed]),
            ("P2=@\nIF $IN[1] THEN\nP2=@\nENDIF\nP1=P2\nLIN P1\n", 0, &[Computed]),
            ("P2=@\nP1=P2\nP2.Z=600\nLIN P1\n", 0, &[Computed]),
            ("P1=@\nF1=P1\n$BASE=F1\nLIN P1\n", 0, &[FramesDiffer]),
        ],
    );
}

#[test]
fn targets_to_which_the_tool_keeps_its_orientation_are_left() {
    use LeftReason::OrientationKept;
    let cell = Cell::kuka(186);
    let data =
        "DECL LDAT L1={VEL 2.0,ORI_TYP #CONSTANT}\nDECL LDAT L2={VEL 2.0,ORI_TYP #VAR}\nDECL LDAT L3={VEL 2.0}\n";
    let kept: &[LeftReason] = &[OrientationKept];
    let initial = format!("TOOL_DATA[1]={NONE}\n$ORI_TYPE=#CONSTANT\nBAS(#INITMOV,0)\nLIN @\n");
    let cases: [(&str, usize, &[LeftReason]); 21] = [
        ("$ORI_TYPE=#CONSTANT\nLIN @\n", 0, kept),
        ("$ORI_TYPE=#CONSTANT\nSCIRC @,@\nPTP @\nPTP <N>\n", 2, &[OrientationKept, OrientationKept]),
        ("$ORI_TYPE=#CONSTANT\nLIN @\n$ORI_TYPE=#VAR\nLIN @\n", 1, kept),
        ("$ORI_TYPE=#JOINT\nLIN @\n", 1, &[]),
        // INITMOV of BAS takes #VAR, and so do data of a path without it.
        (&initial, 1, &[]),
        ("$ORI_TYPE=#CONSTANT\nLDAT_ACT=L3\nBAS(#CP_PARAMS,0.2)\nLIN @\n", 1, &[]),
        ("$ORI_TYPE=HOW\nLIN @\n", 0, kept),
        ("IF $IN[1] THEN\n$ORI_TYPE=#CONSTANT\nENDIF\nLIN @\n", 0, kept),
        ("SUB( )\nLIN @\nEND\nDEF SUB( )\n$ORI_TYPE=#CONSTANT\n", 0, kept),
        ("SLIN @ WITH $VEL.CP=0.2, $ORI_TYPE=#CONSTANT\nSLIN @\n", 1, kept),
        ("SPLINE WITH $ORI_TYPE=#CONSTANT\nSPL @\nSPL @ WITH $ORI_TYPE=#VAR\nENDSPLINE\nSLIN @\n", 2, kept),
        ("SPLINE\nSPL @ WITH $ORI_TYPE=#IGNORE\nENDSPLINE\n", 0, kept),
        ("SLIN @ WITH $ORI_TYPE=SORI_TYP(L1)\nSLIN @ WITH $ORI_TYPE=SORI_TYP(L2)\n", 1, kept),
        ("SLIN @ WITH $ORI_TYPE=SORI_TYP(L3)\n", 1, &[]),
        ("SLIN @ WITH $ORI_TYPE=SORI_TYP(L9)\n", 0, kept),
        ("SLIN @ WITH $ORI_TYPE=SORI_TYP(LDEFAULT)\n", 1, &[]),
        ("LDAT_ACT=L1\nLIN @\nBAS(#CP_PARAMS,0.2)\nLIN @\n", 1, kept),
        ("LDAT_ACT=L1\nBAS(#CP_DAT)\nLIN @\nLDAT_ACT=L2\nBAS(#CP_PARAMS,0.2)\nLIN @\n", 1, kept),
        ("LDAT_ACT=L1\nBAS(#PTP_PARAMS,100)\nLIN @\n", 1, &[]),
        ("LDAT_ACT={VEL 2.0,ORI_TYP #CONSTANT}\nBAS(#CP_PARAMS,0.2)\nLIN @\n", 0, kept),
        ("$ORI_TYPE=L1.ORI_TYP\nLIN @\n$ORI_TYPE=L2.ORI_TYP\nLIN @\n", 1, kept),
    ];
    for (body, corrected, left) in cases {
        let files = [("a.src", krl(&cell, body)), ("a.dat", format!("DEFDAT a\n{data}ENDDAT\n"))];
        let wanted: Vec<String> = left.iter().map(|reason| reason.name().to_owned()).collect();
        assert_eq!(told(&cell, &files, &[]), (corrected, wanted), "{body}");
    }
    // A declared point that is left so is named once.
    let point = krl(&cell, "@");
    let point = point.lines().last().unwrap().trim_end_matches("END").replace('}', ",S 2,T 2}");
    let files = [
        ("a.src", krl(&cell, "$ORI_TYPE=#CONSTANT\nLIN XP1\n")),
        ("a.dat", format!("DEFDAT a\nDECL E6POS XP1={point}\nENDDAT\n")),
    ];
    assert_eq!(told(&cell, &files, &[]), (0, vec![OrientationKept.name().to_owned()]));
}

#[test]
fn what_the_end_of_a_circle_leaves_out_is_known_where_its_auxiliary_point_leaves_it_out_too() {
    use LeftReason::Incomplete;
    let cell = Cell::kuka(187);
    check(
        &cell,
        &[
            ("LIN @\nCIRC {X 300,Y 30,Z 720},{X 280,Y 60}\n", 2, &[Incomplete]),
            ("LIN @\nCIRC @,{X 280,Y 60,Z 700}\n", 2, &[Incomplete]),
            ("LIN @\nCIRC {Y 30,Z 720},{Y 60,Z 700}\n", 3, &[]),
            ("LIN @\nCIRC {Y 30},{Y 60,Z 700}\n", 3, &[]),
            ("LIN @\nCIRC @,@\n", 3, &[]),
        ],
    );
}

#[test]
fn motion_data_are_taken_with_the_frames_that_hold_then() {
    let cell = Cell::kuka(188);
    let data = "FDAT_ACT={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE}\n";
    let set = |tool: &str, base: &str| format!("TOOL_DATA[1]={tool}\nBASE_DATA[2]={base}\n");
    for taken in ["BAS(#FRAMES)\n", "BAS(#CP_PARAMS,0.2)\n"] {
        for before in ["", "$BASE=BASE_DATA[2]\n$TOOL=TOOL_DATA[1]\n"] {
            let body = format!("{}{before}{data}{}{taken}LIN @\n", set(OTHER, OTHER), set(NONE, NONE));
            assert_all_meet(&cell, &body, "LIN");
        }
    }
    // What is set behind it counts no more.
    let body = format!("{}{data}BAS(#FRAMES)\n{}LIN @\n", set(NONE, NONE), set(OTHER, OTHER));
    assert_all_meet(&cell, &body, "LIN");
}

#[test]
fn targets_that_a_sensor_corrects_are_left() {
    use LeftReason::{FrameUnknown, Incomplete, PostureUnknown};
    let cell = Cell::kuka(189);
    check(
        &cell,
        &[
            ("RSI_ON(#RELATIVE)\nLIN @\nR=RSI_OFF()\nLIN @\n", 1, &[FrameUnknown]),
            ("R=RSI_ON(#ABSOLUTE)\nLIN @\nLIN @\n", 0, &[FrameUnknown, FrameUnknown]),
            ("IF (RSI_ON(#RELATIVE)<>#RSIOK) THEN\nHALT\nENDIF\nPTP <N>\n", 0, &[FrameUnknown]),
            ("SENSE( )\nLIN @\nEND\nDEF SENSE( )\nRSI_ON(#RELATIVE)\n", 0, &[FrameUnknown]),
            ("R=ST_ON1(#BASE,1)\nLIN @\nR=ST_OFF()\nPTP <N>\n", 1, &[FrameUnknown]),
            ("RSI_ON(#RELATIVE)\nRSI_MOVECORR()\nRSI_OFF()\nLIN @\n", 0, &[PostureUnknown]),
            ("RSI_ON(#RELATIVE)\nRSI_MOVECORR()\nRSI_OFF()\nLIN {Z 700}\n", 0, &[Incomplete]),
            ("RSI_ON(#RELATIVE)\nRSI_MOVECORR()\nRSI_OFF()\nPTP <N>\nLIN {Z 700}\n", 2, &[]),
            ("R=RSI_CREATE(\"a.rsi\",C)\nLIN {Z 700}\n", 1, &[]),
        ],
    );
}

/// The frame of zeros has no numbers; what is seen from it is what it is.
#[test]
fn a_position_seen_from_the_null_frame_is_that_position() {
    use LeftReason::{Computed, FramesDiffer, PostureUnknown, Undeclared};
    let cell = Cell::kuka(341);
    assert_all_meet(&cell, "P1=@\nLIN $NULLFRAME:P1\n", "P1=");
    assert_all_meet(&cell, "$BASE=$NULLFRAME:$NULLFRAME\nLIN $NULLFRAME:@\nLIN $nullframe : @\n", "LIN");
    check(
        &cell,
        &[
            ("P1=@\nLIN P1:$NULLFRAME\n", 0, &[Computed]),
            ("P1=@\nLIN $NULLFRAME:P1:P2\n", 0, &[Computed]),
            ("P1=@\nP2=$NULLFRAME:P1\n$BASE=P2\n$BASE=$NULLFRAME\nLIN P1\n", 0, &[FramesDiffer]),
            ("PTP $NULLFRAME\nLIN @\n", 0, &[Undeclared, PostureUnknown]),
        ],
    );
}

#[test]
fn what_triggers_and_interrupts_set_for_paths_may_hold_behind_them() {
    use LeftReason::{FrameUnknown, OrientationKept, ToolUnknown};
    let cell = Cell::kuka(342);
    check(
        &cell,
        &[
            ("TRIGGER WHEN DISTANCE=0 DELAY=0 DO $TOOL={X 0,Y 0,Z 50,A 0,B 0,C 0}\nLIN @\n", 0, &[ToolUnknown]),
            (
                "TRIGGER WHEN PATH=20.0 DELAY=0 DO $BASE={FRAME: X 0,Y 0,Z 50,A 0,B 0,C 0} PRIO=-1\nLIN @\n",
                0,
                &[FrameUnknown],
            ),
            ("INTERRUPT DECL 3 WHEN $IN[1] DO $BASE.X=12\nLIN @\n", 0, &[FrameUnknown]),
            ("TRIGGER WHEN DISTANCE=1 DELAY=0 DO $IPO_MODE=#TCP\nLIN @\n", 0, &[ToolUnknown]),
            ("INTERRUPT DECL 3 WHEN $IN[1] DO $ORI_TYPE=#CONSTANT\nLIN @\nPTP @\n", 1, &[OrientationKept]),
            ("LIN @\nTRIGGER WHEN DISTANCE=1 DELAY=0 DO $ORI_TYPE=#VAR\nLIN @\n", 2, &[]),
            ("TRIGGER WHEN DISTANCE=1 DELAY=0 DO $IPO_MODE=#BASE\nLIN @\n", 1, &[]),
        ],
    );
}

/// `TOOL_DATA[1]:{..}` is another frame than `TOOL_DATA[1]`.
#[test]
fn frames_behind_with_on_which_something_stands_are_not_known() {
    use LeftReason::{FrameUnknown, ToolUnknown};
    let cell = Cell::kuka(190);
    let data =
        "DEFDAT $CONFIG\nTOOL_DATA[1]={X 10,Y 0,Z 150,A 0,B 0,C 0}\nBASE_DATA[2]={X 100,Y 0,Z 0,A 0,B 0,C 0}\nENDDAT\n";
    for (with, left) in [
        ("$TOOL=TOOL_DATA[1], $BASE=BASE_DATA[2]", None),
        ("$TOOL=$NULLFRAME:TOOL_DATA[1]", None),
        ("$BASE=SBASE(2)", None),
        ("$TOOL=TOOL_DATA[1]:{X 0,Y 0,Z 90,A 0,B 0,C 0}", Some(ToolUnknown)),
        ("$TOOL={X 0,Y 0,Z 90,A 0,B 0,C 0}:TOOL_DATA[1], $BASE=BASE_DATA[2]", Some(ToolUnknown)),
        ("$BASE=BASE_DATA[2]:XOFFS", Some(FrameUnknown)),
        ("$BASE=SBASE(2):XOFFS", Some(FrameUnknown)),
        ("$BASE=SBASE(1+N)", Some(FrameUnknown)),
    ] {
        for body in [format!("SPTP @ WITH {with}\n"), format!("SPLINE WITH {with}\nSPL @\nENDSPLINE\n")] {
            let files = [("a.src", krl(&cell, &body)), ("$config.dat", data.to_owned())];
            let (done, reasons) = told(&cell, &files, &[]);
            let wanted: Vec<String> = left.iter().map(|reason| reason.name().to_owned()).collect();
            assert_eq!((done, reasons), (1 - wanted.len(), wanted), "{body}");
        }
    }
    for (set, left) in [("BAS(#TOOL,1)", vec![]), ("BAS(#TOOL,0+N)", vec![ToolUnknown.name().to_owned()])] {
        let files = [("a.src", krl(&cell, &format!("{set}\nSPTP @\n"))), ("$config.dat", data.to_owned())];
        assert_eq!(told(&cell, &files, &[]), (1 - left.len(), left), "{set}");
    }
}
