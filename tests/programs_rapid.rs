//! `robotcal compensate` on ABB RAPID, written as the vendor's manuals give it.

#![allow(clippy::unwrap_used)]

mod programs_support;

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

use programs_support::{Cell, assert_meets, numbers, shape, status_turn};
use robotcal::geom::Pose;
use robotcal::plan::inverse;

const MODULE: &str = "%%%\r\n  VERSION:1\r\n  LANGUAGE:ENGLISH\r\n%%%\r\n\r\nMODULE MainModule\r\n\
  ! [[1.0,2.0,3.0],[1,0,0,0]] is no target\r\n\
  PERS tooldata tGun:=[TRUE,[[97.4,0,223.1],[0.924,0,0.382389,0]],[5,[23,0,75],[1,0,0,0],0,0,0]];\r\n\
  TASK PERS wobjdata wTable:=[FALSE,TRUE,\"\",[[300,-60,20.5],[0.707107,0,0,0.707107]],[[0,20.25,3],[1,0,0,0]]];\r\n\
\tCONST robtarget p10:=[@P1@];\r\n\
  LOCAL VAR RobTarget p20 := [ @P2@ ] ;\r\n\
  CONST robtarget pLost:=[[500.5,0,600],[0.5,0.5,0.5,0.5],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\r\n\
  CONST jointtarget jHome:=[[@Q0@],[9E+09,9E9,9E9,9E9,9E9,9E9]];\r\n\
  VAR robtarget pHere;\r\n\
  PROC main()\r\n\
    MoveAbsJ jHome\\NoEOffs,v1000,z50,tool0;\r\n\
    MoveJ p10, v1000 \\T:=2.5, z50, tGun \\WObj:=wTable;\r\n\
    pHere:=CRobT(\\Tool:=tGun \\WObj:=wTable);\r\n\
    movel \\Conc, p20,v200,fine,tGun\\wobj:=wTable;\r\n\
    MoveC [@P3@],[@P4@],\r\n      v100, z1.5, tGun \\WObj:=wTable; ! round\r\n\
    MoveL Offs(p20,0,0,50.5),v100,fine,tGun\\WObj:=wTable;\r\n\
    MoveL pHere,v100,fine,tGun\\WObj:=wTable;\r\n\
    WaitTime 0.5;\r\n    TPWrite \"MoveL p10; 1.5\";\r\n\
  ENDPROC\r\nENDMODULE\r\n";

/// Numbers of the `k`-th list after `key`, exponents of `9E9` included.
fn target(text: &str, key: &str) -> Vec<f64> {
    let at = text.find(key).unwrap_or_else(|| panic!("{key} in\n{text}")) + key.len();
    let end = text[at..].find(']').unwrap();
    let end = at + end + text[at + end..].find("]]").unwrap();
    numbers(&text[at..end])
}

fn pose(v: &[f64]) -> Pose {
    Pose::from_xyz_quaternion([v[0], v[1], v[2]].map(|x| 1e-3 * x), [v[4], v[5], v[6], v[3]])
}

fn confdata(q: &[f64]) -> String {
    let (status, _) = status_turn(q);
    let cfx = 4 * (status & 1) + 2 * u32::from(status & 2 == 0) + u32::from(status & 4 != 0);
    let quarter = |v: f64| (v / FRAC_PI_2).floor() as i64;
    format!("[{},{},{},{cfx}]", quarter(q[0]), quarter(q[3]), quarter(q[5]))
}

#[test]
fn rapid_keeps_every_other_byte_and_meets_every_target() {
    let mut cell = Cell::kuka(31);
    let frame = |v: [f64; 7]| pose(&v);
    let tool = frame([97.4, 0.0, 223.1, 0.924, 0.0, 0.382389, 0.0]);
    let base = frame([300.0, -60.0, 20.5, FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2])
        * frame([0.0, 20.25, 3.0, 1.0, 0.0, 0.0, 0.0]);
    let q: Vec<Vec<f64>> = (0..5).map(|_| cell.readings()).collect();
    let mut text = MODULE.to_owned();
    let home: Vec<String> = q[0].iter().map(|v| format!("{:.3}", v.to_degrees())).collect();
    text = text.replace("@Q0@", &home.join(","));
    for (k, q) in q.iter().enumerate().skip(1) {
        let p = base.inverse() * cell.nominal.base_from_tip(q) * tool;
        let [x, y, z] = p.xyz().map(|v| 1e3 * v);
        let [qx, qy, qz, qw] = p.quaternion_xyzw();
        // The other sign of the same quaternion stays the other sign.
        let s = if k == 2 { -1.0 } else { 1.0 };
        let [q1, q2, q3, q4] = [qw, qx, qy, qz].map(|v| s * v);
        let new = format!(
            "[{x:.4},{y:.4},{z:.4}],[{q1:.9},{q2:.9},{q3:.9},{q4:.9}],{},[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]",
            confdata(q)
        );
        text = text.replace(&format!("@P{k}@"), &new);
    }
    let file = cell.write("MainModule.mod", text.as_bytes());
    let run = cell.compensate(&[&file], &["--unordered"]);
    let said = run.said();
    let run = run.expect(1);
    assert!(said.contains("5 corrected, 3 left"), "{said}");
    for left in [
        ":22 MoveL: its target is computed",
        ":23 MoveL: PHERE is computed",
        ":12 PLOST: no move of the files goes there",
    ] {
        assert!(said.contains(left), "{left}: {said}");
    }
    let new = run.text("MainModule.mod");
    assert_eq!(String::from_utf8_lossy(&shape(new.as_bytes())), String::from_utf8_lossy(&shape(text.as_bytes())));
    for same in ["tGun:=", "wTable:=", "pLost:="] {
        let line = |t: &str| t.lines().find(|l| l.contains(same)).unwrap().to_owned();
        assert_eq!(line(&text), line(&new));
    }
    let joints = |t: &str| target(t, "jHome:=")[..6].iter().map(|v| v.to_radians()).collect::<Vec<f64>>();
    assert_meets(&cell.real_at(&joints(&new), None), &cell.nominal.base_from_tip(&joints(&text)), "jHome");
    let limits = inverse::reading_limits(&cell.nominal.chain);
    for (k, key) in [(1, "p10:="), (2, "p20 :="), (3, "MoveC "), (4, "]],\r\n")] {
        let find = |t: &str| match k {
            4 => target(&t[t.find("MoveC ").unwrap()..], "]],["),
            _ => target(t, key),
        };
        let (old, new) = (find(&text), find(&new));
        let flange = |v: &[f64]| base * pose(v) * tool.inverse();
        let commanded = inverse::solve_from(&cell.nominal, &limits, &flange(&new), &q[k]).unwrap();
        assert_meets(&cell.real_at(&commanded, None), &flange(&old), key);
        let change = commanded.iter().zip(&q[k]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(change < 0.1, "{key} left its posture: {change}");
        assert_eq!(new[3] < 0.0, k == 2, "sign of the quaternion");
    }
}

#[test]
fn malformed_modules_are_refused_with_their_line() {
    let cell = Cell::kuka(32);
    for (text, words) in [
        ("CONST robtarget p:=[[1,2,3],[1,0,0,0],[0,0,0,0]];\n", [":1", "[3, 4, 4, 6]"]),
        ("\nCONST jointtarget p:=[[1,2,3,4,5],[9E9,9E9,9E9,9E9,9E9,9E9]];\n", [":2", "[6, 6]"]),
        ("CONST robtarget p:=[[1,2,3],[1,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n", [":1", "norm 1.4142"]),
        ("CONST robtarget p:=[[1,2,3],[1,0,0,0];\n", [":1", "not closed"]),
        ("MODULE m\nPROC p()\nMoveL p10,v100,z1,tool0\n", [":3", "semicolon"]),
    ] {
        let file = cell.write("m.mod", text.as_bytes());
        let run = cell.compensate(&[&file], &[]).expect(2);
        assert!(words.iter().all(|w| run.said().contains(w)), "{text}: {}", run.said());
    }
}
