//! `robotcal compensate`: the real robot goes where the program meant it.
//!
//! Witness: the new text is read by other code than that which wrote it, and the real robot's forward kinematics at those numbers is held
//! against the nominal robot's at the old ones.

use std::time::Instant;

use crate::programs_support::findings;
use crate::programs_support::{Cell, assert_meets, numbers, shape};
use crate::robots::repo;
use crate::said::assert_says;
use robotcal::Code;
use robotcal::geom::{Pose, exp_so3};
use robotcal::model::inverse;
use robotcal::model::robot::Robot;
use robotcal::programs::LeftReason;
use robotcal::programs::{self, Language, Models, Postures, ProgramSetting, TargetOutcome, TextFile};

fn csv(header: &str, rows: &[Vec<f64>]) -> String {
    let row = |r: &Vec<f64>| r.iter().map(|v| format!("{v:.6}")).collect::<Vec<_>>().join(",");
    format!("{header}\n{}\n", rows.iter().map(row).collect::<Vec<_>>().join("\n"))
}

fn rows(text: &str) -> Vec<Vec<f64>> {
    text.lines().skip(1).map(numbers).collect()
}

#[test]
fn joint_targets_of_a_table_bring_the_real_robot_to_the_meant_poses() {
    let mut cell = Cell::ur(1);
    let table: Vec<Vec<f64>> = (0..200).map(|_| cell.readings()).collect();
    let text = csv(&cell.nominal.chain.readings.join(","), &table);
    let file = cell.write("targets.csv", text.as_bytes());
    let run = cell.compensate(&[&file], &["--joint-unit", "rad"]).expect(0);
    let new = rows(&run.text("targets.csv"));
    assert_eq!(new.len(), 200);
    let mut farthest = 0.0f64;
    for (k, (old, new_row)) in rows(&text).iter().zip(&new).enumerate() {
        let meant = cell.nominal.base_from_tip(old);
        let before = k.checked_sub(1).map(|b| new[b].as_slice());
        assert_meets(&cell.real_at(new_row, before), &meant, &format!("row {k}"));
        farthest = farthest.max(cell.real_at(old, None).distance(&meant).1);
        let change = old.iter().zip(new_row).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(change < 0.3, "row {k} left its posture: {change}");
    }
    assert!(farthest > 1e-3, "a robot without errors proves nothing: {farthest}");
    let told = run.told();
    assert!(told.corrected == 200 && told.left.is_empty(), "{told:?}");
}

#[test]
fn poses_of_a_table_get_joint_columns_and_other_columns_stay() {
    let mut cell = Cell::kuka(2);
    let wanted: Vec<Vec<f64>> = (0..40).map(|_| cell.readings()).collect();
    let mut text = String::from("name; x_m;y_m;z_m;qx;qy;qz;qw;speed\r\n");
    for (k, q) in wanted.iter().enumerate() {
        let pose = cell.nominal.base_from_tip(q);
        let all: Vec<String> = pose.xyz().iter().chain(&pose.quaternion_xyzw()).map(|v| format!("{v:.9}")).collect();
        text += &format!("\"P {k}\"; {};0.25\r\n", all.join(";"));
    }
    let file = cell.write("poses.csv", text.as_bytes());
    let run = cell.compensate(&[&file], &["--joint-unit", "deg", "--unordered"]).expect(0);
    let new = run.text("poses.csv");
    let header = new.lines().next().unwrap();
    assert_eq!(header.split(';').skip(9).collect::<Vec<_>>().join(";"), cell.nominal.chain.readings.join(";"));
    for (old, line) in text.lines().zip(new.lines()).skip(1) {
        assert!(line.starts_with(old), "{line}");
        let joints: Vec<f64> =
            line[old.len() + 1..].split(';').map(|c| c.parse::<f64>().unwrap().to_radians()).collect();
        let p = numbers(old.split_once(';').unwrap().1);
        let meant = Pose::from_xyz_quaternion([p[0], p[1], p[2]], [p[3], p[4], p[5], p[6]]);
        assert_meets(&cell.real_at(&joints, None), &meant, old);
    }
}

#[test]
fn joint_columns_beside_poses_say_which_posture_is_meant() {
    let mut cell = Cell::ur(3);
    let mut table = Vec::new();
    for _ in 0..20 {
        let q = cell.readings();
        let pose = cell.nominal.base_from_tip(&q);
        let near = q.iter().map(|v| v + 0.02);
        table.push(pose.xyz().into_iter().chain(pose.quaternion_xyzw()).chain(near).collect::<Vec<f64>>());
    }
    let header = format!("x_m,y_m,z_m,qx,qy,qz,qw,{}", cell.nominal.chain.readings.join(","));
    let file = cell.write("poses.csv", csv(&header, &table).as_bytes());
    let run = cell.compensate(&[&file], &["--joint-unit", "rad", "--unordered"]).expect(0);
    for (old, new) in table.iter().zip(rows(&run.text("poses.csv"))) {
        let meant = Pose::from_xyz_quaternion([old[0], old[1], old[2]], [old[3], old[4], old[5], old[6]]);
        let (rad, m) = cell.real_at(&new[7..], None).distance(&meant);
        assert!(rad < 5e-6 && m < 2e-6, "six decimals of the input: {m:e} {rad:e}");
        let change = old[7..].iter().zip(&new[7..]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(change < 0.1, "left its posture: {change}");
    }
}

const SCRIPT: &str = "def welding():\r\n\
\t# home [1.0, 2.0]; not a target: movej([0.1, 0.2])\r\n\
  set_tcp(p[0.01,0.02,0.15,0.0,0.3,0.0])\r\n\
  set_payload(2.500, [0.01, 0.02, 0.03])\r\n\
  global Waypoint_1_p=p[{P1}]\r\n\
\u{a0} global Waypoint_1_q = [ {Q1} ]\r\n\
  while (True):\r\n\
    $ 2 \"Home: movej([0.5, 0.5])\"\r\n\
    movej([{Q0}], a=1.3962634015954636, v=1.0471975511965976)\t # fast\r\n\
    movej(get_inverse_kin(Waypoint_1_p, qnear=Waypoint_1_q), a=1.3, v=1.0)\r\n\
    movel( p[{P2}] , a=1.2, v=0.25, r=0.001)\r\n\
    movec(p[{P3}],p[{P4}], a=1.2, v=0.25, r=0.05)\r\n\
    sleep(0.5)\r\n\
  end\r\n\
end\r\n";

#[test]
fn urscript_keeps_every_other_byte_and_meets_every_target() {
    let mut cell = Cell::ur(4);
    let tool = Pose::new(exp_so3(&[0.0, 0.3, 0.0].into()), [0.01, 0.02, 0.15].into());
    let q: Vec<Vec<f64>> = (0..5).map(|_| cell.readings()).collect();
    // A chain of near postures: poses mean the posture next to the one before.
    let near = |k: usize| q[1].iter().enumerate().map(|(i, v)| v + 0.1 * ((k + i) as f64).sin()).collect::<Vec<f64>>();
    let q = [q[0].clone(), q[1].clone(), near(2), near(3), near(4)];
    let list = |v: &[f64]| v.iter().map(|x| format!("{x:.6}")).collect::<Vec<_>>().join(", ");
    let pose = |q: &[f64]| {
        let p = cell.nominal.base_from_tip(q) * tool;
        let v = robotcal::geom::log_so3(&p.rotation);
        list(&[p.xyz(), v.into()].concat())
    };
    let mut text = SCRIPT.replace("{Q0}", &list(&q[0])).replace("{Q1}", &list(&q[1]));
    for (k, q) in q.iter().enumerate().take(5).skip(1) {
        text = text.replace(&format!("{{P{k}}}"), &pose(q));
    }
    let file = cell.write("welding.script", text.as_bytes());
    let run = cell.compensate(&[&file], &["--unordered"]).expect(0);
    let new = run.text("welding.script");
    assert_eq!(String::from_utf8_lossy(&shape(new.as_bytes())), String::from_utf8_lossy(&shape(text.as_bytes())));
    for untouched in
        ["set_tcp(p[0.01,0.02,0.15,0.0,0.3,0.0])", "[0.01, 0.02, 0.03]", "movej([0.1, 0.2])", "movej([0.5, 0.5])"]
    {
        assert!(new.contains(untouched), "{untouched}\n{new}");
    }
    let q1 = format!("global Waypoint_1_q = [ {} ]", list(&q[1]));
    assert!(new.contains(&q1), "the posture of get_inverse_kin is no target");
    // Literals in the order of the text.
    let literals = |text: &str| -> Vec<Vec<f64>> {
        let parts = text.split('[').skip(1).map(|p| numbers(p.split(']').next().unwrap()));
        parts.filter(|v| v.len() == 6).collect()
    };
    let (old, new) = (literals(&text), literals(&new));
    assert_eq!(new.len(), 7);
    let joints = &new[3];
    assert_meets(&cell.real_at(joints, None), &cell.nominal.base_from_tip(&old[3]), "movej");
    let limits = vec![(f64::NEG_INFINITY, f64::INFINITY); 6];
    for (k, which) in [(1, 1), (4, 2), (5, 3), (6, 4)] {
        let flange =
            |v: &Vec<f64>| Pose::new(exp_so3(&[v[3], v[4], v[5]].into()), [v[0], v[1], v[2]].into()) * tool.inverse();
        // What the controller makes of the new pose, by its own model.
        let commanded = inverse::solve_from(&cell.nominal, &limits, &flange(&new[k]), &q[which]).unwrap();
        assert_meets(&cell.real_at(&commanded, None), &flange(&old[k]), &format!("literal {k}"));
        let change = commanded.iter().zip(&q[which]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(change < 0.1, "literal {k} left its posture: {change}");
    }
}

#[test]
fn what_a_script_does_not_say_in_numbers_is_named_and_left() {
    let mut cell = Cell::ur(5);
    let q = cell.readings().iter().map(|x| format!("{x:.6}")).collect::<Vec<_>>().join(", ");
    let text = format!(
        "def p():\n  movej([{q}])\n  movel(pose_add(get_actual_tcp_pose(), p[0.0,0.0,0.1,0.0,0.0,0.0]))\n  movel(p[0.5,0.1,0.4,0.0,3.1,0.0])\n  movel(p[5.0,0.1,0.4,0.0,3.1,0.0], a=1)\n  movej([{q}])\nend\n"
    );
    let file = cell.write("p.script", text.as_bytes());
    let run = cell.compensate(&[&file], &[]).expect(1);
    let told = run.told();
    assert!(told.has(3, "movel", LeftReason::Computed) && told.has(4, "movel", LeftReason::ToolUnknown), "{told:?}");
    let (weight, counts) = &findings(&run)["targets_left"];
    assert_eq!(weight, "gate");
    assert_eq!(
        [&counts["targets"], &counts["computed"]].map(|n| n.as_f64()),
        [Some(told.left.len() as f64), Some(1.0)]
    );
    let run = cell.compensate(&[&file], &["--tool", "0,0,0,0,0,0"]).expect(1);
    assert!(run.told().has(5, "movel", LeftReason::OutOfReach), "{:?}", run.told());
    let new = run.text("p.script");
    for (k, (a, b)) in text.lines().zip(new.lines()).enumerate() {
        assert_eq!(a == b, ![1, 3, 5].contains(&k), "line {}: {b}", k + 1);
    }
}

#[test]
fn targets_beyond_the_limits_are_named_by_line_and_left() {
    let mut cell = Cell::kuka(6);
    let limits = inverse::reading_limits(&cell.nominal.chain);
    let base = cell.readings();
    // Every joint 1e-6 rad from either limit: some corrections lead beyond it. The last row is beyond it already.
    let beside = |i: usize, value: f64| base.iter().enumerate().map(|(k, q)| if k == i { value } else { *q }).collect();
    let mut table: Vec<Vec<f64>> = (0..12)
        .map(|k| beside(k / 2, if k % 2 == 0 { limits[k / 2].0 + 1e-6 } else { limits[k / 2].1 - 1e-6 }))
        .collect();
    table.push(beside(1, limits[1].0 - 0.01));
    let names = cell.nominal.chain.readings.clone();
    let text = csv(&names.join(","), &table);
    let file = cell.write("targets.csv", text.as_bytes());
    let run = cell.compensate(&[&file], &["--joint-unit", "rad", "--unordered"]).expect(1);
    let (told, new) = (run.told(), run.text("targets.csv"));
    let mut left = 0;
    for (k, (a, b)) in text.lines().zip(new.lines()).enumerate().skip(1) {
        let row = k - 1;
        if a != b {
            let within = |(q, (low, high)): (&f64, &(f64, f64))| (low..=high).contains(&q);
            assert!(numbers(b).iter().zip(&limits).all(within), "line {}: {b}", k + 1);
        } else if row < 12 {
            left += 1;
            assert!(told.has(k + 1, &format!("row {}", k + 1), LeftReason::BeyondLimit), "{told:?}");
            assert!(run.said().contains(&names[row / 2]), "{}", run.said());
        }
    }
    assert!((2..=10).contains(&left), "{left}: {told:?}");
    assert!(told.has(14, "row 14", LeftReason::ProgramBeyondLimit), "{told:?}");
    assert_eq!(run.text("corrections.csv").lines().count(), 14);
}

#[test]
fn a_program_moves_from_one_calibrated_robot_to_another() {
    let mut a = Cell::ur(7);
    let b = Cell::ur(8);
    let table: Vec<Vec<f64>> = (0..20).map(|_| a.readings()).collect();
    let text = csv(&a.nominal.chain.readings.join(","), &table);
    let file = b.write("taught.csv", text.as_bytes());
    let (urdf, toml) = (a.real_urdf.to_str().unwrap(), a.compensation.to_str().unwrap());
    let flags = ["--joint-unit", "rad", "--unordered", "--from", urdf, "--from-compensation", toml];
    let run = b.compensate(&[&file], &flags).expect(0);
    for (old, new) in rows(&text).iter().zip(rows(&run.text("taught.csv"))) {
        assert_meets(&b.real_at(&new, None), &a.real_at(old, None), "retargeted");
    }
}

#[test]
fn redundant_axes_stay_close_and_held_ones_stay() {
    let urdf = repo("robots/lbr_iiwa_14/lbr_iiwa_14.urdf");
    let mut cell = Cell::new(&urdf, ("base_link", "flange"), 9);
    let table: Vec<Vec<f64>> = (0..50).map(|_| cell.readings_holding(Some(2))).collect();
    let text = csv(&cell.nominal.chain.readings.join(","), &table);
    let file = cell.write("t.csv", text.as_bytes());
    let third = cell.nominal.chain.readings[2].clone();
    for flags in
        [&["--joint-unit", "rad", "--unordered"][..], &["--joint-unit", "rad", "--unordered", "--hold", &third]]
    {
        let run = cell.compensate(&[&file], flags).expect(0);
        for (old, new) in rows(&text).iter().zip(rows(&run.text("t.csv"))) {
            assert_meets(&cell.real_at(&new, None), &cell.nominal.base_from_tip(old), "seven axes");
            let change = old.iter().zip(&new).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(change < 0.05, "{change}");
            assert_eq!(flags.contains(&"--hold"), old[2] == new[2]);
        }
    }
}

#[test]
fn bad_input_is_refused_with_its_line() {
    let cell = Cell::ur(10);
    let joints = cell.nominal.chain.readings.join(",");
    for (name, text, code, names) in [
        ("a.csv", format!("{joints}\n0,0,0,0,0,0\n0,0,0,0,x,0\n"), Code::CsvNumber, ["a.csv:3", "\"x\""]),
        ("b.csv", format!("{joints}\n0,0,0,0,0\n"), Code::CsvCellCount, ["b.csv:2", "5 "]),
        ("c.csv", "a,b\n1,2\n".to_owned(), Code::CsvColumnMissing, ["c.csv:1", "a, b"]),
        (
            "l.csv",
            format!("left_{}\n1,2,3,4,5,6\n", joints.replace(',', ",left_")),
            Code::CsvColumnMissing,
            ["l.csv:1", "'left_'"],
        ),
        (
            "d.csv",
            joints.replace("wrist_3_joint", "wrist_joint_3") + "\n",
            Code::CsvColumnMissing,
            ["d.csv:1", "\"wrist_3_joint\""],
        ),
        ("e.csv", "x_m,y_m,z_m,qx,qy,qz,qw\n0,0,0,1,1,1,1\n".to_owned(), Code::ProgramQuaternion, ["e.csv:2", " 2,"]),
        ("f.script", "def f():\n movej([0.0, 0.1\nend\n".to_owned(), Code::ProgramSyntax, ["f.script:2", "["]),
        ("g.script", "x=1\nmovel(p[0.1,0.2,0.3], a=1)\n".to_owned(), Code::ProgramTargets, ["g.script:2", "p[..]"]),
        ("h.script", "movej([0.1,0.2,0.3])\n".to_owned(), Code::ProgramTargets, ["h.script:1", "3"]),
        ("i.script", "textmsg(\"a)\n".to_owned(), Code::ProgramSyntax, ["i.script:1", "i.script"]),
        ("j.doc", "movej([0.1,0.2,0.3])\n".to_owned(), Code::ProgramLanguage, ["j.doc", "--language"]),
    ] {
        let file = cell.write(name, text.as_bytes());
        let run = cell.compensate(&[&file], &["--joint-unit", "rad"]).expect(2);
        assert_says(&run.said(), code, &names);
        assert!(!run.out.exists());
    }
    let file = cell.write("k.csv", format!("{joints}\n0,0,0,0,0,0\n").as_bytes());
    assert_says(&cell.compensate(&[&file], &[]).expect(2).said(), Code::JointUnitMissing, &["--joint-unit"]);
    let folder = cell.folder.path().to_str().unwrap();
    let run = cell.compensate(&[&file], &["--joint-unit", "rad", "--out", folder]);
    assert!(run.output.status.code() == Some(2) && run.said().contains("--out"), "{}", run.said());
}

/// Ten thousand targets in under a second, by release code (the development profile is about three times slower).
#[test]
fn the_time_for_many_targets_grows_with_their_number() {
    let mut cell = Cell::ur(11);
    let table: Vec<Vec<f64>> = (0..10_000).map(|_| cell.readings()).collect();
    let setting = ProgramSetting {
        chain: &cell.nominal.chain,
        axes: &[0, 1, 2, 3, 4, 5],
        rad_per_unit: Some(1.0),
        base: Pose::identity(),
        tool: None,
        work: None,
        axes_apart: false,
    };
    let postures = Postures { held: vec![false; 6], start: Some(vec![0.5; 6]) };
    let real: &Robot = &cell.real;
    let seconds_for = |targets: &[Vec<f64>]| {
        let text = csv(&cell.nominal.chain.readings.join(","), targets);
        let begin = Instant::now();
        let file = TextFile { name: "t.csv".into(), bytes: text.into_bytes() };
        let program = programs::read(Language::Csv, vec![file], &setting).unwrap();
        let models =
            Models { controller: &cell.nominal, from: &cell.nominal, to: real, frames: None, beyond: [None, None] };
        let done = programs::compensate(&program, models, &postures);
        let seconds = begin.elapsed().as_secs_f64();
        let count = done.outcomes.iter().filter(|o| matches!(o, TargetOutcome::Done(_))).count();
        assert_eq!(count, targets.len());
        seconds
    };
    // In turn, as others may use the machine: what takes least was disturbed least.
    let [all, some] = (0..6).fold([f64::INFINITY; 2], |[all, some], _| {
        [all.min(seconds_for(&table)), some.min(seconds_for(&table[..1_250]))]
    });
    let ratio = all / some;
    println!("eight times as many targets take {ratio:.1} times as long");
    // Proportional would be 8, the square of the number 64.
    assert!(ratio < 24.0, "{ratio}");
}

/// `p[..]` of the tool of a robot at `q`.
fn tool_pose(robot: &Robot, q: &[f64], tool: &Pose) -> String {
    let p = robot.base_from_tip(q) * *tool;
    let all = [p.xyz(), robotcal::geom::log_so3(&p.rotation).into()].concat();
    format!("p[{}]", all.iter().map(|v| format!("{v:.12}")).collect::<Vec<_>>().join(", "))
}

fn joint_list(q: &[f64]) -> String {
    format!("[{}]", q.iter().map(|v| format!("{v:.16}")).collect::<Vec<_>>().join(", "))
}

/// Numbers in the brackets behind `name=`.
fn literal(text: &str, name: &str) -> Vec<f64> {
    let at = text.find(&format!("{name}=")).unwrap_or_else(|| panic!("{name} in\n{text}"));
    numbers(text[at..].split_once('[').unwrap().1.split(']').next().unwrap())
}

/// How far (m) the real robot is from what the program meant, where the controller reaches the new pose in the posture of `q`.
fn left_over(cell: &Cell, tool: &Pose, old: &[f64], new: &[f64], q: &[f64]) -> f64 {
    let flange = |v: &[f64]| Pose::new(exp_so3(&[v[3], v[4], v[5]].into()), [v[0], v[1], v[2]].into()) * tool.inverse();
    let limits = vec![(f64::NEG_INFINITY, f64::INFINITY); 6];
    let commanded = inverse::solve_from(&cell.nominal, &limits, &flange(new), q).unwrap();
    let change = commanded.iter().zip(q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(change < 0.1, "another posture: {change}");
    (cell.real_at(&commanded, None) * *tool).distance(&(flange(old) * *tool)).1
}

fn column(run: &crate::programs_support::Run, name: &str) -> Vec<String> {
    let text = run.text("corrections.csv");
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let at = reader.headers().unwrap().iter().position(|h| h == name).unwrap();
    reader.records().map(|r| r.unwrap()[at].to_owned()).collect()
}

#[test]
fn joints_taught_beside_poses_tell_the_posture_of_each() {
    let tool = Pose::new(exp_so3(&[0.1, 0.0, 0.2].into()), [0.0, 0.03, 0.18].into());
    for seed in [41, 42] {
        let mut cell = Cell::ur(seed);
        let q: Vec<Vec<f64>> = (0..24).map(|_| cell.readings()).collect();
        let mut text = String::from("def prog():\n  set_tcp(p[0,0.03,0.18,0.1,0,0.2])\n");
        for (k, q) in q.iter().enumerate() {
            text += &format!("  global w{k}_p={}\n", tool_pose(&cell.nominal, q, &tool));
            text += &format!("  global w{k}_q={}\n", joint_list(q));
        }
        text += "  while (True):\n";
        for k in 0..q.len() {
            text += &match k % 3 {
                0 => format!("    movel(w{k}_p, a=1.2, v=0.25)\n"),
                1 => format!("    movej(get_inverse_kin(w{k}_p, qnear=w{k}_q), a=1.4, v=1.0)\n"),
                _ => format!("    movej(w{k}_p, a=1.2, v=0.25)\n"),
            };
        }
        text += "  end\nend\n";
        let file = cell.write("taught.script", text.as_bytes());
        let run = cell.compensate(&[&file], &["--unordered"]).expect(0);
        let new = run.text("taught.script");
        let mut before = 0.0f64;
        for (k, q) in q.iter().enumerate() {
            let name = format!("w{k}_p");
            let (old, new) = (literal(&text, &name), literal(&new, &name));
            let left = left_over(&cell, &tool, &old, &new, q);
            before = before.max(left_over(&cell, &tool, &old, &old, q));
            assert!(left < 1e-6, "seed {seed}, {name}: {left:e} m");
            assert_eq!(literal(&text, &format!("w{k}_q")), literal(&run.text("taught.script"), &format!("w{k}_q")));
        }
        assert!(before > 1e-3, "{before}");
        assert!(column(&run, "joint_unit").iter().all(|unit| unit == "rad"));
        let known = column(&run, "posture");
        assert!((0..24).all(|k| known[k] == if k % 3 == 1 { "near" } else { "taught" }), "{known:?}");
        let (weight, told) = &findings(&run)["nominal_is_controllers"];
        assert_eq!((weight.as_str(), told["pairs"].as_f64()), ("note", Some(24.0)));
        assert!(told["max_mm"].as_f64().unwrap() < 1e-6, "{told}");
    }
}

#[test]
fn the_first_pose_is_refused_until_something_tells_its_posture() {
    let mut cell = Cell::ur(43);
    let q = cell.readings();
    let beside: Vec<f64> = q.iter().enumerate().map(|(i, v)| v + 0.04 * (i as f64).cos()).collect();
    let none = Pose::identity();
    let text = format!(
        "set_tcp(p[0,0,0,0,0,0])\na={}\nb={}\nmovel(a)\nmovel(b)\nmovej({})\nmovel(a)\n",
        tool_pose(&cell.nominal, &q, &none),
        tool_pose(&cell.nominal, &beside, &none),
        joint_list(&q)
    );
    let file = cell.write("first.script", text.as_bytes());
    let run = cell.compensate(&[&file], &["--unordered"]).expect(1);
    let new = run.text("first.script");
    for name in ["a", "b"] {
        assert_eq!(literal(&text, name), literal(&new, name), "{name} has no posture that the text tells");
    }
    assert_eq!(column(&run, "posture"), ["", "", "joints"]);
    let start = q.iter().map(|v| format!("{:.1}", v.to_degrees())).collect::<Vec<_>>().join(",");
    let run = cell.compensate(&[&file], &["--unordered", "--start", &start]).expect(0);
    assert_eq!(column(&run, "posture"), ["start", "line", "joints"]);
    for (name, q) in [("a", &q), ("b", &beside)] {
        let left = left_over(&cell, &none, &literal(&text, name), &literal(&run.text("first.script"), name), q);
        assert!(left < 1e-6, "{name}: {left:e}");
    }
}

/// The other postures that reach the flange pose of `q`.
fn others(cell: &mut Cell, q: &[f64]) -> Vec<Vec<f64>> {
    let limits = vec![(-3.1, 3.1); 6];
    let wanted = cell.nominal.base_from_tip(q);
    let mut all = vec![q.to_vec()];
    for _ in 0..300 {
        let start = inverse::random_readings(&limits, &cell.nominal.chain.reading_kinds, &mut cell.rng);
        let Some(found) = inverse::solve_from(&cell.nominal, &limits, &wanted, &start) else { continue };
        let far = |o: &Vec<f64>| o.iter().zip(&found).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) > 0.1;
        if all.iter().all(far) {
            all.push(found);
        }
    }
    all.split_off(1)
}

#[test]
fn the_posture_goes_on_from_where_the_robot_comes_also_after_a_target_visited_again() {
    let none = Pose::identity();
    let mut cell = Cell::ur(44);
    let (mut checked, mut farthest) = (0, 0.0f64);
    for _ in 0..4 {
        let q = cell.readings();
        for other in others(&mut cell, &q) {
            let beside: Vec<f64> = q.iter().enumerate().map(|(i, v)| v + 0.05 * (i as f64).sin()).collect();
            // The second visit of `a` comes after the same pose in another posture.
            let text = format!(
                "set_tcp(p[0,0,0,0,0,0])\na={}\nmovej(a)\nmovej({})\nmovej(a)\nc={}\nmovel(c)\n",
                joint_list(&q),
                joint_list(&other),
                tool_pose(&cell.nominal, &beside, &none)
            );
            let file = cell.write("again.script", text.as_bytes());
            let run = cell.compensate(&[&file], &["--unordered"]);
            if run.output.status.code() == Some(1) {
                // A joint target beside a singular posture.
                continue;
            }
            let new = run.expect(0).text("again.script");
            let (old, new) = (literal(&text, "c"), literal(&new, "c"));
            assert!(left_over(&cell, &none, &old, &new, &beside) < 1e-6);
            farthest = farthest.max(left_over(&cell, &none, &old, &old, &beside));
            checked += 1;
        }
    }
    assert!(checked >= 8 && farthest > 1e-3, "{checked} {farthest}");
}

#[test]
fn branches_and_routines_do_not_hand_their_posture_to_each_other() {
    let mut cell = Cell::ur(45);
    let none = Pose::identity();
    let q = cell.readings();
    let other = others(&mut cell, &q).into_iter().max_by(|a, b| a[4].total_cmp(&b[4])).unwrap();
    let beside: Vec<f64> = q.iter().enumerate().map(|(i, v)| v + 0.05 * (i as f64).sin()).collect();
    let pose = tool_pose(&cell.nominal, &beside, &none);
    let text = format!(
        "def p():\n set_tcp(p[0,0,0,0,0,0])\n movej({a})\n if x == 1:\n  movej({b})\n else:\n  c={pose}\n  movel(c)\n end\n def sub():\n  d={pose}\n  movel(d)\n end\nend\n",
        a = joint_list(&q),
        b = joint_list(&other)
    );
    let file = cell.write("branches.script", text.as_bytes());
    let run = cell.compensate(&[&file], &["--unordered"]).expect(1);
    let new = run.text("branches.script");
    assert!(left_over(&cell, &none, &literal(&text, "c"), &literal(&new, "c"), &beside) < 1e-6);
    assert_eq!(literal(&text, "d"), literal(&new, "d"), "from where a routine is called is not known");
    assert_eq!(column(&run, "posture"), ["joints", "joints", "line", ""]);
}

/// Behind a call the robot stands where the routine has left it, in the posture that this left it in.
#[test]
fn behind_a_call_the_posture_is_that_in_which_the_routine_ends() {
    let mut cell = Cell::ur(73);
    let none = Pose::identity();
    let q = cell.readings();
    let other = others(&mut cell, &q).into_iter().max_by(|a, b| a[4].total_cmp(&b[4])).unwrap();
    let beside = |q: &[f64]| -> Vec<f64> { q.iter().enumerate().map(|(i, v)| v + 0.05 * (i as f64).sin()).collect() };
    let pose = tool_pose(&cell.nominal, &beside(&q), &none);
    // The same pose in the posture of `q`, and nearest to the other one.
    let limits = vec![(-3.1, 3.1); 6];
    let wanted = cell.nominal.base_from_tip(&beside(&q));
    let (here, there) = (beside(&q), inverse::solve_from(&cell.nominal, &limits, &wanted, &other).unwrap());
    let (a, b) = (joint_list(&q), joint_list(&other));
    let leaves = format!("def sub():\n  movej({b})\n end\n");
    let inner = format!("{leaves} def outer():\n  sub()\n end\n");
    let returns = format!("def sub():\n  movej({b})\n  movej({a})\n end\n");
    for (routines, call, meant, posture) in [
        (leaves.as_str(), "sub()", &there, "before"),
        (inner.as_str(), "outer()", &there, "before"),
        (returns.as_str(), "sub()", &here, "before"),
        ("def sub():\n  textmsg(\"x\")\n end\n", "sub()", &here, "line"),
    ] {
        let text =
            format!("def p():\n set_tcp(p[0,0,0,0,0,0])\n {routines} movej({a})\n {call}\n c={pose}\n movel(c)\nend\n");
        let file = cell.write("calls.script", text.as_bytes());
        let run = cell.compensate(&[&file], &["--unordered"]).expect(0);
        let new = run.text("calls.script");
        let left = left_over(&cell, &none, &literal(&text, "c"), &literal(&new, "c"), meant);
        assert!(left < 1e-6, "{call} {routines}: {left}");
        assert_eq!(column(&run, "posture").last().unwrap(), posture);
    }
    // A path of the routine that the text does not tell.
    let text = format!(
        "def p():\n set_tcp(p[0,0,0,0,0,0])\n def sub():\n  movej(get_actual_joint_positions())\n end\n movej({a})\n sub()\n c={pose}\n movel(c)\nend\n"
    );
    let file = cell.write("untold.script", text.as_bytes());
    let run = cell.compensate(&[&file], &["--unordered"]).expect(1);
    assert_eq!(literal(&text, "c"), literal(&run.text("untold.script"), "c"));
}

#[test]
fn poses_and_joints_taught_together_tell_whether_the_nominal_model_is_the_controllers() {
    let mut cell = Cell::ur(46);
    let tool = Pose::new(exp_so3(&[0.0; 3].into()), [0.0, 0.0, 0.15].into());
    // A controller with a factory calibration of its own: origins beside those of the table.
    let own = Cell::ur(47);
    let factory = robotcal::model::robot::Robot { terms: Vec::new(), ..own.real.clone() };
    let mut text = String::from("set_tcp(p[0,0,0.15,0,0,0])\n");
    let mut squares = 0.0;
    for k in 0..10 {
        let q = cell.readings();
        text += &format!("w{k}_p={}\nw{k}_q={}\nmovel(w{k}_p)\n", tool_pose(&factory, &q, &tool), joint_list(&q));
        let (by, table) = (factory.base_from_tip(&q) * tool, cell.nominal.base_from_tip(&q) * tool);
        squares += by.distance(&table).1.powi(2);
    }
    let true_mm = 1e3 * (squares / 10.0f64).sqrt();
    let file = cell.write("factory.script", text.as_bytes());
    let run = cell.compensate(&[&file], &["--unordered"]).expect(1);
    let (weight, told) = &findings(&run)["nominal_differs"];
    assert_eq!(weight, "gate");
    assert!((told["rms_mm"].as_f64().unwrap() - true_mm).abs() < 1e-6 && true_mm > 0.5, "{told} {true_mm}");
    assert_eq!(column(&run, "taught_mm").iter().filter(|c| !c.is_empty()).count(), 10);
    let owner = Cell { nominal_urdf: own.real_urdf.clone(), ..cell };
    let run = owner.compensate(&[&file], &["--unordered"]).expect(0);
    assert!(findings(&run).contains_key("nominal_is_controllers"));
    // Another tool for all of them, or another base: nothing is where it was meant.
    let moved = text.replace("set_tcp(p[0,0,0.15,0,0,0])", "set_tcp(p[0.2,0,0.15,0,0,0])");
    let file = owner.write("moved.script", moved.as_bytes());
    let run = owner.compensate(&[&file], &["--unordered"]);
    assert_eq!((run.output.status.code(), findings(&run)["frames_differ"].0.as_str()), (Some(1), "gate"));
    // For one of them only: its joints tell the posture, but nothing of the model.
    let last = "movel(w9_p)\n";
    let one = text.replace(last, &format!("set_tcp(p[0.2,0,0.15,0,0,0])\n{last}"));
    let file = owner.write("one.script", one.as_bytes());
    let run = owner.compensate(&[&file], &["--unordered"]);
    let found = findings(&run);
    assert_eq!(found["taught_with_other_frames"].1["pairs"].as_f64(), Some(1.0));
    assert_eq!(found["nominal_is_controllers"].1["pairs"].as_f64(), Some(9.0));
}

/// `base` of ur_description: the frame in which these controllers compute is a leaf beside the arm, half a turn from `base_link`.
#[test]
fn the_controller_may_compute_in_a_frame_that_is_fixed_beside_the_arm() {
    let cell = Cell::ur(49);
    let half_turn = Pose::new(exp_so3(&[0.0, 0.0, std::f64::consts::PI].into()), [0.0; 3].into());
    let beside = |path: &std::path::Path, name: &str| {
        let text = std::fs::read_to_string(path).unwrap();
        let more = "<link name=\"base\"/><joint name=\"base_fixed\" type=\"fixed\"><origin xyz=\"0 0 0\" rpy=\"0 0 3.141592653589793\"/><parent link=\"base_link\"/><child link=\"base\"/></joint></robot>";
        cell.write(name, text.replace("</robot>", more).as_bytes())
    };
    let (nominal, real) = (beside(&cell.nominal_urdf, "nominal.urdf"), beside(&cell.real_urdf, "with_base.urdf"));
    let mut world = Cell::ur(49);
    let q = world.readings();
    let p = half_turn.inverse() * world.nominal.base_from_tip(&q);
    let all = [p.xyz(), robotcal::geom::log_so3(&p.rotation).into()].concat();
    let list = all.iter().map(|v| format!("{v:.12}")).collect::<Vec<_>>().join(",");
    let text = format!("set_tcp(p[0,0,0,0,0,0])\nw_p=p[{list}]\nw_q={}\nmovel(w_p)\n", joint_list(&q));
    let file = cell.write("ur.script", text.as_bytes());
    let call = |base: &str| {
        let out = cell.folder.path().join("out");
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_robotcal"));
        command
            .arg("compensate")
            .arg(&file)
            .arg("--out")
            .arg(&out)
            .arg("--nominal")
            .arg(&nominal)
            .arg("--urdf")
            .arg(&real);
        command.arg("--compensation").arg(&cell.compensation).args([
            "--unordered",
            "--frames",
            "nominal",
            "--base",
            base,
            "--tip",
            "tool0",
        ]);
        crate::programs_support::Run { output: command.output().unwrap(), out, programs: Vec::new() }
    };
    let run = call("base").expect(0);
    assert!(findings(&run).contains_key("nominal_is_controllers"));
    let flange = |v: &[f64]| half_turn * Pose::new(exp_so3(&[v[3], v[4], v[5]].into()), [v[0], v[1], v[2]].into());
    let (old, new) = (literal(&text, "w_p"), literal(&run.text("ur.script"), "w_p"));
    let limits = vec![(f64::NEG_INFINITY, f64::INFINITY); 6];
    let commanded = inverse::solve_from(&cell.nominal, &limits, &flange(&new), &q).unwrap();
    assert_meets(&cell.real_at(&commanded, None), &flange(&old), "in `base`");
    // In the wrong one of the two frames every pose is elsewhere: a gate, not a correction in silence.
    let run = call("base_link");
    assert_eq!((run.output.status.code(), findings(&run)["frames_differ"].0.as_str()), (Some(1), "gate"));
}

/// The world behind reports/kr6_small is known: what is left in its base frame against what is promised.
#[test]
fn what_base_and_tool_leave_is_stated_by_the_covariance_of_the_solution() {
    let report = repo("reports/kr6_small");
    let truth = std::fs::read_to_string(repo("datasets/kr6_small/truth.toml")).unwrap();
    let truth: toml::Value = toml::from_str(&truth).unwrap();
    let list = |v: &toml::Value| -> Vec<f64> { v.as_array().unwrap().iter().map(|x| x.as_float().unwrap()).collect() };
    let known: Vec<(Vec<f64>, Pose)> = truth["held_out"]
        .as_array()
        .unwrap()
        .iter()
        .map(|h| {
            let (xyz, q) = (list(&h["base_from_tip"]["xyz_m"]), list(&h["base_from_tip"]["quat_xyzw"]));
            (list(&h["readings"]), Pose::from_xyz_quaternion([xyz[0], xyz[1], xyz[2]], [q[0], q[1], q[2], q[3]]))
        })
        .collect();
    let cell = Cell::kuka(48);
    let table: Vec<Vec<f64>> = known.iter().map(|(q, _)| q.clone()).collect();
    let file = cell.write("t.csv", csv(&cell.nominal.chain.readings.join(","), &table).as_bytes());
    let copied = cell.folder.path().join("calibrated.urdf");
    std::fs::copy(report.join("kuka_kr6_r900.calibrated.urdf"), &copied).unwrap();
    let call = |urdf: &std::path::Path, more: &[&str]| {
        let out = cell.folder.path().join("out");
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_robotcal"));
        command.arg("compensate").arg(&file).arg("--out").arg(&out).arg("--nominal").arg(&cell.nominal_urdf);
        command.arg("--urdf").arg(urdf).arg("--compensation").arg(report.join("compensation.toml"));
        command.args(["--joint-unit", "rad", "--unordered", "--base", "base_link", "--tip", "tool0"]).args(more);
        crate::programs_support::Run { output: command.output().unwrap(), out, programs: Vec::new() }
    };
    let run = call(&report.join("kuka_kr6_r900.calibrated.urdf"), &[]);
    let (_, told) = &findings(&run)["expected_error"];
    let stated = told["rms_mm"].as_f64().unwrap();
    // A place beside a singular posture is left and has none.
    let cells = column(&run, "expected_mm");
    let expected: Vec<f64> = cells.iter().filter_map(|c| c.parse().ok()).collect();
    assert!(cells.len() == known.len() && 10 * expected.len() >= 9 * known.len());
    assert!((stated - (expected.iter().map(|e| e * e).sum::<f64>() / expected.len() as f64).sqrt()).abs() < 1e-3);
    // What the corrected program keeps: the model's error in the base frame, which the images cannot tell.
    let chain = robotcal::urdf::read(&report.join("kuka_kr6_r900.calibrated.urdf")).unwrap();
    let chain = chain.chain(Some("base_link"), Some("tool0")).unwrap();
    let model = robotcal::output::read_compensation(&report.join("compensation.toml"), chain).unwrap();
    let left: Vec<f64> =
        known.iter().map(|(q, true_pose)| 1e3 * model.base_from_tip(q).distance(true_pose).1).collect();
    let left = (left.iter().map(|e| e * e).sum::<f64>() / left.len() as f64).sqrt();
    println!("left {left:.3} mm, stated {stated:.3} mm over {} places", known.len());
    // One world: a handful of directions, so that the ratio scatters by a factor.
    assert!(left > 0.3 && left < 2.5 * stated && stated < 5.0 * left, "{left} {stated}");
    // The description alone tells nothing of it; nor does the solution of another robot, which is refused where it is named.
    assert!(findings(&call(&copied, &[])).contains_key("expected_error_unknown"));
    let named = report.join("solution.json");
    assert!(findings(&call(&copied, &["--solution", named.to_str().unwrap()])).contains_key("expected_error"));
    assert_eq!(call(&cell.real_urdf, &["--solution", named.to_str().unwrap()]).output.status.code(), Some(2));
}

/// The URDF for use without compensation.toml is that of the solution that lists it, and lacks what it cannot hold.
#[test]
fn the_urdf_that_is_used_alone_has_the_expected_error_of_its_solution_and_what_it_lacks() {
    let (report, cell) = (repo("reports/kr6_small"), Cell::kuka(49));
    let name = "kuka_kr6_r900.calibrated_alone.urdf";
    let solution = std::fs::read_to_string(report.join("solution.json")).unwrap();
    let mut solution: serde_json::Value = serde_json::from_str(&solution).unwrap();
    // At a reading of 1 rad, a gear that errs does what an offset does.
    let q = [0.2, -1.2, 1.0, 0.3, 0.8, 0.1];
    let term = &mut solution["robot"]["terms"][2];
    let offset = term["value"].as_f64().unwrap();
    assert_eq!((term["reading"].as_str(), term["term"].as_str()), (Some("joint_a3"), Some("offset")));
    (term["term"], term["value"]) = ("gear".into(), 0.0.into());
    solution["files"].as_array_mut().unwrap().push(name.into());
    cell.write("solution.json", solution.to_string().as_bytes());
    let whole = report.join("kuka_kr6_r900.calibrated.urdf");
    let [alone, other] = [name, "other.urdf"].map(|name| cell.write(name, &std::fs::read(&whole).unwrap()));
    let file = cell.write("t.csv", csv(&cell.nominal.chain.readings.join(","), &[q.to_vec()]).as_bytes());
    let call = |urdf: &std::path::Path, more: &[&std::path::Path]| {
        let out = cell.folder.path().join("out");
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_robotcal"));
        command.arg("compensate").arg(&file).arg("--out").arg(&out).arg("--nominal").arg(&cell.nominal_urdf);
        command.arg("--urdf").arg(urdf).args(["--joint-unit", "rad", "--base", "base_link", "--tip", "tool0"]);
        command.args(more);
        crate::programs_support::Run { output: command.output().unwrap(), out, programs: Vec::new() }
    };
    let stated = |run: &crate::programs_support::Run| findings(run)["expected_error"].1["rms_mm"].as_f64().unwrap();
    let by_whole = stated(&call(&whole, &[]));
    let moved = [q[0], q[1], q[2] + offset, q[3], q[4], q[5]];
    let lacks = 1e3 * cell.nominal.base_from_tip(&q).distance(&cell.nominal.base_from_tip(&moved)).1;
    let named = cell.folder.path().join("solution.json");
    let named = [std::path::Path::new("--solution"), &named];
    for more in [&[][..], &named] {
        let by_alone = stated(&call(&alone, more));
        println!("alone {by_alone:.4} mm, whole {by_whole:.4} mm, lacking {lacks:.4} mm");
        assert!((by_alone - by_whole.hypot(lacks)).abs() < 0.02 * lacks, "{by_alone} {by_whole} {lacks}");
    }
    assert!(findings(&call(&other, &[])).contains_key("expected_error_unknown"));
    assert_eq!(call(&other, &named).output.status.code(), Some(2));
}
