//! Programs whose targets are not the same each time, or not where a reader from top to bottom would have them.

use crate::programs_support::text::{START, UNCHECKED, beside, pose_text, robtarget, told_beside_first as told};
use crate::programs_support::{Cell, assert_brings_to, krl_frame, numbers, status_turn};
use robotcal::geom::{Pose, log_so3};
use robotcal::programs::LeftReason;

/// `@` stands for a new pose each time, `#` for the axes of the first.
fn krl(cell: &Cell, body: &str) -> String {
    let axes: Vec<_> = START.iter().enumerate().map(|(k, q)| format!("A{} {:.6}", k + 1, q.to_degrees())).collect();
    let mut text = format!("DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nPTP {{{}}}\n{body}END\n", axes.join(","));
    for k in 1.. {
        let Some(at) = text.find('@') else { break };
        text.replace_range(at..=at, &format!("{{{}}}", pose_text(cell, &beside(k))));
    }
    text
}

#[test]
fn variables_of_krl_that_change_while_the_program_runs_are_left() {
    let cell = Cell::kuka(81);
    let dat = |text: &str| {
        ("a.dat", format!("DEFDAT a\n{}ENDDAT\n", text.replace('@', &format!("{{{}}}", pose_text(&cell, &beside(0))))))
    };
    let data = dat("DECL E6POS XQ=@\nP[1]=@\nP[2]=@\n");
    for (body, corrected, left) in [
        ("P=@\nLIN P\nP=@\nLIN P\n", 2, 0),
        ("IF $IN[1] THEN\nP=@\nELSE\nP=@\nENDIF\nLIN P\n", 0, 1),
        ("P=@\nLOOP\nLIN P\nP=@\nENDLOOP\n", 0, 1),
        ("P=@\nAGAIN:\nLIN P\nP=@\nGOTO AGAIN\n", 0, 1),
        ("P=@\nSUB()\nLIN P\nEND\nDEF SUB()\nP=@\n", 0, 1),
        ("FOR I=1 TO 6\n$VEL_AXIS[I]=50\nENDFOR\nP=@\nLOOP\nLIN P\nENDLOOP\nP=@\nLIN P\n", 2, 0),
        ("GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )\nP=@\nLIN P\nP=@\nLIN P\n", 2, 0),
    ] {
        let (done, reasons) = told(&cell, &[("a.src", krl(&cell, body))], &[]);
        assert_eq!((done, reasons), (corrected, vec![LeftReason::Computed.name().to_owned(); left]), "{body}");
    }
    for body in [
        "LOOP\nLIN XQ\nXQ.X=XQ.X+10\nENDLOOP\nPTP P[1]\nPTP P[2]\n",
        "LIN XQ\nXQ=@\nPTP P[1]\nPTP P[2]\n",
        "FOR I=1 TO 2\nP[I].Z=300\nENDFOR\nPTP P[1]\nLIN XQ\n",
        "LIN XQ\nGO(@)\nPTP P[1]\nPTP P[2]\nEND\nDEF GO(XQ :IN)\nLIN XQ\n",
        "P[1]=@\nFOR I=1 TO 2\nPTP P[I]\nENDFOR\nLIN XQ\n",
    ] {
        let (_, reasons) = told(&cell, &[("a.src", krl(&cell, body)), data.clone()], &["--start=10,-80,97,20,40,28"]);
        assert!(!reasons.is_empty() && reasons.iter().all(|r| r == LeftReason::Computed.name()), "{body}: {reasons:?}");
    }
}

#[test]
fn blocks_labels_and_circles_that_go_on_are_no_targets_of_their_own() {
    let cell = Cell::kuka(82);
    let name = |reason: LeftReason| reason.name().to_owned();
    for (body, corrected, left) in [
        ("PTP SPLINE\nSPTP @\nENDSPLINE\n", 1, vec![]),
        ("CIRC @,@\nLIN {Z 480}\n", 3, vec![]),
        ("CIRC @,@,CA 90.0\nLIN {Z 480}\n", 2, vec![name(LeftReason::Incomplete), name(LeftReason::PathEnd)]),
        ("SPLINE\nSCIRC @,@,ca A\nENDSPLINE\nLIN @\n", 3, vec![name(LeftReason::PathEnd)]),
        ("CIRC @,@ C_DIS\nCIRC @,@,CA 360\n", 4, vec![name(LeftReason::PathEnd)]),
        (
            "LIN @\n$BASE={X 50,Y 0,Z 0,A 0,B 0,C 0}\nHERE:\nLIN @\nIF $IN[1] THEN\nGOTO HERE\nENDIF\n",
            1,
            vec![name(LeftReason::FrameUnknown)],
        ),
    ] {
        assert_eq!(told(&cell, &[("a.src", krl(&cell, body))], &[]), (corrected, left), "{body}");
    }
}

/// KUKA controllers heed status and turn in joint motions alone.
#[test]
fn status_and_turn_of_a_path_are_held_against_the_way_there() {
    let cell = Cell::kuka(83);
    let coded = |motion: &str, status: u32, turn: u32| {
        krl(&cell, &format!("{motion} {{{},S {status},T {turn}}}\n", pose_text(&cell, &beside(1))))
    };
    let (s, t) = status_turn(&beside(1));
    let flipped = (s ^ 4, t ^ 0b111000);
    let unknown = vec![LeftReason::PostureUnknown.name().to_owned()];
    for (motion, codes, flags, wanted) in [
        ("LIN", (s, t), &[][..], (1, vec![])),
        ("LIN", flipped, &[], (0, unknown.clone())),
        ("LIN", flipped, &["--nearest-posture"], (1, vec![])),
        // Above the stretched arm and behind axis 1 at once: out of reach there, and of no account on a path.
        ("LIN", (s ^ 3, t), &[], (1, vec![])),
        ("PTP", (s ^ 3, t), &[], (0, vec![LeftReason::OutOfReach.name().to_owned()])),
    ] {
        let text = coded(motion, codes.0, codes.1);
        assert_eq!(told(&cell, &[("a.src", text.clone())], flags), wanted, "{text}");
    }
}

#[test]
fn a_variable_of_urscript_with_one_of_several_values_is_computed() {
    let cell = Cell::ur(84);
    let start = [0.3, -1.4, 1.7, -1.2, -1.4, 0.5];
    let pose = |k: usize| {
        let q: Vec<f64> = start.iter().enumerate().map(|(i, q)| q + 0.02 * ((7 * k + i) as f64).sin()).collect();
        let flange = cell.nominal.base_from_tip(&q);
        let (xyz, r) = (flange.xyz(), log_so3(&flange.rotation));
        format!("p[{:.9},{:.9},{:.9},{:.9},{:.9},{:.9}]", xyz[0], xyz[1], xyz[2], r[0], r[1], r[2])
    };
    for (body, corrected, left) in [
        ("  w=@\n  movel(w)\n  w=@\n  movel(w)\n", 2, 0),
        ("  if x == 1:\n    w=@\n  else:\n    w=@\n  end\n  movel(w)\n", 0, 1),
        ("  while x == 1:\n    x=2\n  end\n  w=@\n  movel(w)\n  w=@\n  movel(w)\n", 2, 0),
        ("  w=@\n  while True:\n    movel(w)\n    w=@\n  end\n", 0, 1),
        ("  w=@\n  movel(w)\n  def go(a, w):\n    movej(w)\n  end\n  go(1, @)\n", 0, 2),
    ] {
        let mut text = format!("def p():\n  set_tcp(p[0,0,0,0,0,0])\n  movej({start:?})\n{body}end\n");
        for k in 1..=body.matches('@').count() {
            text = text.replacen('@', &pose(k), 1);
        }
        let wanted = (corrected, vec![LeftReason::Computed.name().to_owned(); left]);
        assert_eq!(told(&cell, &[("a.script", text)], &[]), wanted, "{body}");
    }
}

#[test]
fn targets_of_other_instructions_of_rapid_are_corrected_or_named() {
    let cell = Cell::kuka(85);
    let axes = START.map(f64::to_degrees);
    let target = |k: usize| robtarget(&cell.nominal.base_from_tip(&beside(k)), UNCHECKED);
    let head = format!(
        "MODULE m\nVAR robtarget found;\nPROC main()\nConfL\\Off;\nMoveAbsJ [{axes:?},[9E9,9E9,9E9,9E9,9E9,9E9]],v10,fine,tool0;\n"
    );
    let (search, circle) = (
        format!("SearchL\\Stop,di1,found,{},v10,tool0\\WObj:=wobj0;", target(1)),
        format!("SearchC di1,found,{},{},v10,tool0;", target(2), target(3)),
    );
    let text = format!(
        "{head}{search}\n{circle}\nGrindL {},v10,force,tool0;\nIF di1=1 MoveL {},v10,fine,tool0;\nENDPROC\nENDMODULE\n",
        target(4),
        target(5)
    );
    let file = cell.write("m.mod", text.as_bytes());
    let run = cell.compensate(&[&file], &["--unordered"]).expect(1);
    let told = run.told();
    assert_eq!(told.corrected, 5, "{told:?}");
    assert!(told.has(8, "GRINDL", LeftReason::NotATarget) && told.left.len() == 1, "{told:?}");
    let new = run.text("m.mod");
    let line = new.lines().find(|l| l.starts_with("SearchL")).unwrap();
    let n = numbers(&line[line.find("[[").unwrap()..]);
    let rotation = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(n[3], n[4], n[5], n[6]));
    let commanded =
        Pose::new(rotation.to_rotation_matrix().into_inner(), [n[0] * 1e-3, n[1] * 1e-3, n[2] * 1e-3].into());
    assert_brings_to(&cell, &commanded, &beside(1), line);
}

#[test]
fn a_corrected_path_with_codes_meets_its_target() {
    let cell = Cell::kuka(86);
    let (s, t) = status_turn(&beside(1));
    let text = krl(&cell, &format!("LIN {{{},S {},T {t}}}\n", pose_text(&cell, &beside(1)), s ^ 3));
    let file = cell.write("a.src", text.as_bytes());
    let new = cell.compensate(&[&file], &["--unordered"]).expect(0).text("a.src");
    let line = new.lines().find(|l| l.starts_with("LIN")).unwrap();
    assert_brings_to(&cell, &krl_frame(line), &beside(1), line);
}
