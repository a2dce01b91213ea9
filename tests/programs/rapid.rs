//! `robotcal compensate` on ABB RAPID, written as the vendor's manuals give it.

use std::f64::consts::FRAC_1_SQRT_2;

use crate::programs_support::text::{
    TOOL, WORK, assert_tool_meets, confdata, frames, jointtarget, lines, pose, tool_robtarget as robtarget,
};
use crate::programs_support::{Cell, assert_meets, numbers, shape};
use crate::said::assert_says;
use robotcal::Code;
use robotcal::geom::Pose;
use robotcal::model::inverse;
use robotcal::programs::LeftReason;

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
    MoveL Offs(p20,0.0,0.0,50.5),v100,fine,tGun\\WObj:=wTable;\r\n\
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
    let run = run.expect(1);
    let told = run.told();
    assert_eq!((told.corrected, told.left.len()), (6, 2), "{told:?}");
    assert!(told.has(23, "MoveL", LeftReason::Computed) && told.has(12, "PLOST", LeftReason::Unvisited), "{told:?}");
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
    for (text, code, names) in [
        ("CONST robtarget p:=[[1,2,3],[1,0,0,0],[0,0,0,0]];\n", Code::ProgramTargets, [":1", "[3, 4, 4, 6]"]),
        ("\nCONST jointtarget p:=[[1,2,3,4,5],[9E9,9E9,9E9,9E9,9E9,9E9]];\n", Code::ProgramTargets, [":2", "[6, 6]"]),
        (
            "CONST robtarget p:=[[1,2,3],[1,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n",
            Code::ProgramQuaternion,
            [":1", "1.4142"],
        ),
        // What is written in numbers beside computed parts.
        ("VAR robtarget p:=[[1,2,3],[0,2,0,0],[0,0,0,0],q.extax];\n", Code::ProgramQuaternion, [":1", "2.0000"]),
        ("VAR robtarget p:=[[1,2],[1,0,0,0],q.robconf,q.extax];\n", Code::ProgramTargets, [":1", "[3, 4, 4, 6]"]),
        ("CONST robtarget p:=[[1,2,3],[1,0,0,0];\n", Code::ProgramSyntax, [":1", "["]),
        ("MODULE m\nPROC p()\nMoveL p10,v100,z1,tool0\n", Code::ProgramSyntax, [":3", "MoveL"]),
    ] {
        let file = cell.write("m.mod", text.as_bytes());
        let run = cell.compensate(&[&file], &[]).expect(2);
        assert_says(&run.said(), code, &names);
    }
}

#[test]
fn where_configurations_are_not_checked_the_posture_goes_on() {
    let (tool, base) = frames();
    for seed in [51, 52, 53] {
        let mut cell = Cell::kuka(seed);
        let mut q = cell.readings();
        let mut text = format!("MODULE m\n{TOOL}{WORK}PROC main()\n ConfL\\Off;\n ConfJ \\Off;\n");
        let home = q.clone();
        text += &format!(" MoveAbsJ {},v200,z20,tGun;\n", jointtarget(&home));
        let mut all = Vec::new();
        for k in 0..30 {
            q = q
                .iter()
                .zip(&home)
                .enumerate()
                .map(|(i, (v, h))| 0.5 * (v + h) + 0.12 * ((k * 3 + i) as f64).sin())
                .collect();
            // Configuration data of a generator that knows no robot.
            let p = robtarget(&cell, &q, &tool, &base, "[0,-1,-1,0]");
            let name = if k % 2 == 0 { "MoveJ" } else { "MoveL" };
            text += &format!(" {name} {p},v200,z20,tGun\\WObj:=wTable;\n");
            all.push(q.clone());
        }
        text += "ENDPROC\nENDMODULE\n";
        let file = cell.write("taco.mod", text.as_bytes());
        let run = cell.compensate(&[&file], &["--unordered"]).expect(0);
        let new = run.text("taco.mod");
        for (k, ((old, new), q)) in lines(&text, "wTable;").iter().zip(lines(&new, "wTable;")).zip(&all).enumerate() {
            assert_eq!(old[7..11], new[7..11], "data that nobody heeds stay");
            assert_tool_meets(&cell, &tool, &(base * pose(old)), &(base * pose(&new)), q, 1e-6, &format!("{k}"));
        }
        // With the checks on, such data are those of another posture, or of none.
        let on = text.replace(" ConfL\\Off;\n ConfJ \\Off;\n", "");
        let file = cell.write("on.mod", on.as_bytes());
        let strict = cell.compensate(&[&file], &["--unordered"]);
        let meant = lines(&strict.text("on.mod"), "wTable;");
        assert!(lines(&new, "wTable;").iter().zip(&meant).any(|(a, b)| a[..7] != b[..7]));
    }
}

#[test]
fn what_another_routine_switches_is_not_guessed() {
    let (tool, base) = frames();
    let mut cell = Cell::kuka(54);
    let q = cell.readings();
    let near: Vec<f64> = q.iter().map(|v| v + 0.02).collect();
    let flipped = vec![
        q[0],
        q[1],
        q[2],
        q[3] - q[3].signum() * std::f64::consts::PI,
        -q[4],
        q[5] - q[5].signum() * std::f64::consts::PI,
    ];
    let right = robtarget(&cell, &near, &tool, &base, &confdata(&near));
    let wrong = robtarget(&cell, &q, &tool, &base, &confdata(&flipped));
    let text = |init: &str| {
        format!(
            "MODULE m\n{TOOL}{WORK}PROC Init()\n ConfL\\Off;\nENDPROC\nPROC main()\n {init}\n MoveAbsJ {},v1,z1,tGun;\n MoveL {right},v1,z1,tGun\\WObj:=wTable;\n MoveL {wrong},v1,z1,tGun\\WObj:=wTable;\n ConfL\\On;\n MoveL {wrong},v1,z1,tGun\\WObj:=wTable;\nENDPROC\nENDMODULE\n",
            jointtarget(&q)
        )
    };
    let poses = |init: &str, code: i32| {
        let file = cell.write("m.mod", text(init).as_bytes());
        let run = cell.compensate(&[&file], &["--unordered"]).expect(code);
        (lines(&text(init), "wTable;"), lines(&run.text("m.mod"), "wTable;"))
    };
    let meets = |old: &[f64], new: &[f64], q: &[f64], what: &str| {
        assert_tool_meets(&cell, &tool, &(base * pose(old)), &(base * pose(new)), q, 1e-6, what);
    };
    let (old, new) = poses("IF a Init;", 1);
    meets(&old[0], &new[0], &near, "both mean the same");
    assert_eq!(old[1], new[1], "the two mean different postures");
    meets(&old[2], &new[2], &flipped, "switched on");
    let (old, new) = poses("Init;", 0);
    meets(&old[1], &new[1], &q, "switched off by the routine that is called");
    meets(&old[2], &new[2], &flipped, "switched on");
}

/// The pose that `Offs(..)` or `RelTool(..)` in a line means, from the declarations of the text.
fn displaced(text: &str, line: usize) -> Pose {
    let line = text.lines().nth(line).unwrap();
    let inner = line.split_once('(').unwrap().1.split_once(')').unwrap().0;
    let (name, rest) = inner.split_once(',').unwrap();
    let declared = text.lines().find(|l| l.contains(&format!("robtarget {name}:="))).unwrap();
    let p = pose(&numbers(&declared[declared.find("[[").unwrap()..]));
    let (plain, switches) = rest.split_once('\\').map_or((rest, ""), |(a, b)| (a, b));
    let by: Vec<f64> = plain.split(',').map(|n| 1e-3 * n.trim().parse::<f64>().unwrap()).collect();
    let by = nalgebra::Vector3::new(by[0], by[1], by[2]);
    if line.contains("Offs(") {
        return Pose::new(p.rotation, p.translation + by);
    }
    let mut turned = nalgebra::Rotation3::identity();
    for axis in ["Rx", "Ry", "Rz"] {
        let switch = switches.split('\\').find_map(|s| s.trim().strip_prefix(&format!("{axis}:=")));
        let angle = switch.map_or(0.0, |s| s.trim().parse::<f64>().unwrap().to_radians());
        turned *= match axis {
            "Rx" => nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::x_axis(), angle),
            "Ry" => nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::y_axis(), angle),
            _ => nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::z_axis(), angle),
        };
    }
    p * Pose::new(turned.into_inner(), by)
}

#[test]
fn displaced_points_are_exact_and_the_points_they_start_from_are_corrected() {
    let (tool, base) = frames();
    let mut complete = 0;
    for seed in [55, 56, 57, 58] {
        let mut cell = Cell::kuka(seed);
        let (a, b) = (cell.readings(), cell.readings());
        let text = format!(
            "MODULE m\n{TOOL}{WORK}CONST robtarget p10:={};\nCONST robtarget p40:={};\nPROC main()\n MoveJ Offs(p10,0,0,25.5),v1,z1,tGun\\WObj:=wTable;\n MoveL p10,v1,z1,tGun\\WObj:=wTable;\n MoveJ RelTool(p40,5,-7.5,-30\\Rz:=4.5),v1,z1,tGun\\WObj:=wTable;\n MoveL Offs(p40,0,12,-0.5),v1,z1,tGun\\WObj:=wTable;\n MoveL RelTool(p40,0,0,-10),v1,z1,tGun\\WObj:=wTable;\n MoveL Offs(p40,0,nStep,0),v1,z1,tGun\\WObj:=wTable;\nENDPROC\nENDMODULE\n",
            robtarget(&cell, &a, &tool, &base, &confdata(&a)),
            robtarget(&cell, &b, &tool, &base, &confdata(&b)),
        );
        let file = cell.write("m.mod", text.as_bytes());
        let run = cell.compensate(&[&file], &["--unordered"]).expect(1);
        let new = run.text("m.mod");
        let (old10, new10) = (lines(&text, "p10:="), lines(&new, "p10:="));
        assert_tool_meets(&cell, &tool, &(base * pose(&old10[0])), &(base * pose(&new10[0])), &a, 1e-6, "p10");
        let (old40, new40) = (lines(&text, "p40:="), lines(&new, "p40:="));
        assert_tool_meets(&cell, &tool, &(base * pose(&old40[0])), &(base * pose(&new40[0])), &b, 1e-6, "p40");
        let mut before = 0.0f64;
        let table = run.text("corrections.csv");
        let is_left = |line: usize| {
            let place = format!(".mod\",{line},");
            table.lines().any(|l| l.contains(&place) && l.contains(",,,,,,,\""))
        };
        let mut cannot_turn = 0.0;
        for (line, q, most_rad) in [(6, &a, 5e-4), (8, &b, 1e-6), (9, &b, 5e-4), (10, &b, 1e-6)] {
            // Where the point lies in another quadrant of a joint than confdata say, it is left, and listed with its reason.
            if is_left(line + 1) {
                continue;
            }
            let (old, new) = (base * displaced(&text, line), base * displaced(&new, line));
            assert_tool_meets(&cell, &tool, &old, &new, q, most_rad, &format!("line {line}"));
            before = before.max(old.distance(&new).1);
            cannot_turn += if most_rad > 1e-6 { 1.0 } else { 0.0 };
        }
        assert!(before > 1e-3, "{before}");
        let turned = new.lines().nth(8).unwrap();
        if !is_left(9) {
            let order = ["\\Rx:=", "\\Ry:=", "\\Rz:="].map(|s| turned.find(s).unwrap());
            assert!(order[0] < order[1] && order[1] < order[2], "{turned}");
            complete += 1;
        }
        assert_eq!(text.lines().nth(11), new.lines().nth(11), "a computed displacement stays");
        let left = run.told().left;
        assert_eq!(left.iter().filter(|(.., reason)| *reason == LeftReason::Computed.name()).count(), 1, "{left:?}");
        let found: Vec<serde_json::Value> = serde_json::from_str(&run.text("findings.json")).unwrap();
        let turned = found.iter().find(|f| f["code"] == "displaced_orientation").unwrap();
        let mrad = turned["quantities"]["max_mrad"].as_f64().unwrap();
        assert!(
            cannot_turn > 0.0 && turned["quantities"]["targets"] == cannot_turn && mrad > 1e-3 && mrad < 0.5,
            "{turned}"
        );
    }
    assert!(complete >= 2, "{complete}");
}

#[test]
fn targets_of_an_array_are_corrected_and_what_is_computed_of_it_is_left() {
    let (tool, base) = frames();
    let mut cell = Cell::kuka(61);
    let q: Vec<Vec<f64>> = (0..4).map(|_| cell.readings()).collect();
    let rows: Vec<String> = q.iter().map(|q| robtarget(&cell, q, &tool, &base, &confdata(q))).collect();
    let rows = format!("[\n    {}];", rows.join(",\n    "));
    let text = |moves: &str| {
        format!(
            "MODULE m\n{TOOL}{WORK}CONST robtarget pts{{4}}:={rows}\nVAR robtarget grid{{2,2}};\nPROC main()\n{moves}ENDPROC\nENDMODULE\n"
        )
    };
    let told = |moves: &str, code: i32| {
        let file = cell.write("m.mod", text(moves).as_bytes());
        let run = cell.compensate(&[&file], &["--unordered"]).expect(code);
        (run.told(), run.text("m.mod"))
    };
    let by_variable = " FOR i FROM 1 TO 4 DO\n  MoveL pts{i},v1,z1,tGun\\WObj:=wTable;\n ENDFOR\n";
    let by_number = " MoveJ pts{3},v1,z1,tGun\\WObj:=wTable;\n MoveL Offs(pts{3},0,0,0),v1,z1,tGun\\WObj:=wTable;\n";
    for moves in [by_variable.to_owned(), format!("{by_variable}{by_number}")] {
        let (said, new) = told(&moves, 0);
        assert!(said.left.is_empty(), "{said:?}");
        let [old, new] = [text(&moves), new].map(|t| lines(&t, "    [["));
        for ((old, new), q) in old.iter().zip(&new).zip(&q) {
            assert_tool_meets(&cell, &tool, &(base * pose(old)), &(base * pose(new)), q, 1e-6, "element");
        }
    }
    let left = |moves: &str, reason: LeftReason, count: usize| {
        let (said, new) = told(moves, 1);
        let found = said.left.iter().filter(|(.., r)| *r == reason.name()).count();
        assert_eq!(found, count, "{moves}{said:?}");
        let same = lines(&text(moves), "    [[").iter().zip(&lines(&new, "    [[")).filter(|(a, b)| a == b).count();
        assert_eq!(same, 4, "{moves}{new}");
    };
    // Which of them is assigned to is not followed, nor a displacement from some of them; without confdata nothing tells the posture.
    left(&format!(" pts{{2}}.trans.z:=5;\n{by_variable}"), LeftReason::Computed, 4);
    left(" MoveL Offs(pts{i},0,0,9),v1,z1,tGun\\WObj:=wTable;\n", LeftReason::Computed, 1);
    left(
        " MoveL grid{1,2},v1,z1,tGun\\WObj:=wTable;\n MoveL pts{7},v1,z1,tGun\\WObj:=wTable;\n",
        LeftReason::Computed,
        2,
    );
    left(&format!(" ConfL\\Off;\n{by_variable}"), LeftReason::PostureUnknown, 4);
}
