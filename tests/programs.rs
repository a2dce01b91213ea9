//! `robotcal compensate`: the real robot goes where the program meant it.
//!
//! Witness: the new text is read by other code than that which wrote it, and the real robot's forward kinematics at those numbers is held
//! against the nominal robot's at the old ones.

#![allow(clippy::unwrap_used)]

mod programs_support;

use std::time::Instant;

use programs_support::{Cell, assert_meets, numbers, shape};
use robotcal::geom::{Pose, exp_so3};
use robotcal::model::robot::Robot;
use robotcal::plan::inverse;
use robotcal::programs::{self, Language, Models, Outcome, Postures, Setting, TextFile};

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
    assert!(run.said().contains("200 corrected, 0 left"), "{}", run.said());
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
    let said = run.said();
    assert!(said.contains("p.script:3 movel: its target is computed"), "{said}");
    assert!(said.contains("p.script:4 movel: its tool is not known"), "{said}");
    let run = cell.compensate(&[&file], &["--tool", "0,0,0,0,0,0"]).expect(1);
    let said = run.said();
    assert!(said.contains("p.script:5 movel: the controller's model does not reach"), "{said}");
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
    let (said, new) = (run.said(), run.text("targets.csv"));
    let mut left = 0;
    for (k, (a, b)) in text.lines().zip(new.lines()).enumerate().skip(1) {
        let row = k - 1;
        if a != b {
            let within = |(q, (low, high)): (&f64, &(f64, f64))| (low..=high).contains(&q);
            assert!(numbers(b).iter().zip(&limits).all(within), "line {}: {b}", k + 1);
        } else if row < 12 {
            left += 1;
            let words = format!(":{} row {}: it would take {} at", k + 1, k + 1, names[row / 2]);
            assert!(said.contains(&words), "{words}: {said}");
        }
    }
    assert!((2..=10).contains(&left), "{left}: {said}");
    assert!(said.contains(&format!(":14 row 14: the program itself puts {}", names[1])), "{said}");
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
    let urdf = programs_support::repo("robots/lbr_iiwa_14/lbr_iiwa_14.urdf");
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
    for (name, text, words) in [
        ("a.csv", format!("{joints}\n0,0,0,0,0,0\n0,0,0,0,x,0\n"), ["a.csv:3", "\"x\" is not a number"]),
        ("b.csv", format!("{joints}\n0,0,0,0,0\n"), ["b.csv:2", "5 cells under 6"]),
        ("c.csv", "a,b\n1,2\n".to_owned(), ["c.csv:1", "neither joint columns nor pose"]),
        ("d.csv", joints.replace("wrist_3_joint", "wrist_joint_3") + "\n", ["d.csv:1", "no column \"wrist_3_joint\""]),
        ("e.csv", "x_m,y_m,z_m,qx,qy,qz,qw\n0,0,0,1,1,1,1\n".to_owned(), ["e.csv:2", "norm 2"]),
        ("f.script", "def f():\n movej([0.0, 0.1\nend\n".to_owned(), ["f.script:2", "not closed"]),
        ("g.script", "x=1\nmovel(p[0.1,0.2,0.3], a=1)\n".to_owned(), ["g.script:2", "has 6 numbers, this one has 3"]),
        ("h.script", "movej([0.1,0.2,0.3])\n".to_owned(), ["h.script:1", "3 joint values for the 6 joints"]),
        ("i.script", "textmsg(\"a)\n".to_owned(), ["i.script:1", "does not end"]),
        ("j.doc", "movej([0.1,0.2,0.3])\n".to_owned(), ["j.doc", "no language"]),
    ] {
        let file = cell.write(name, text.as_bytes());
        let run = cell.compensate(&[&file], &["--joint-unit", "rad"]).expect(2);
        assert!(words.iter().all(|w| run.said().contains(w)) && run.said().contains("try:"), "{name}: {}", run.said());
        assert!(!run.out.exists());
    }
    let file = cell.write("k.csv", format!("{joints}\n0,0,0,0,0,0\n").as_bytes());
    assert!(cell.compensate(&[&file], &[]).expect(2).said().contains("--joint-unit"));
    let folder = cell.folder.path().to_str().unwrap();
    let run = cell.compensate(&[&file], &["--joint-unit", "rad", "--out", folder]);
    assert!(run.said().contains("cannot be used multiple times"), "{}", run.said());
}

/// Ten thousand targets in under a second, by release code (the development profile is about three times slower).
#[test]
fn ten_thousand_targets_take_less_than_a_second() {
    let mut cell = Cell::ur(11);
    let table: Vec<Vec<f64>> = (0..10_000).map(|_| cell.readings()).collect();
    let text = csv(&cell.nominal.chain.readings.join(","), &table);
    let setting = Setting {
        chain: &cell.nominal.chain,
        axes: &[0, 1, 2, 3, 4, 5],
        rad_per_unit: Some(1.0),
        tool: None,
        work: None,
    };
    let postures = Postures { held: vec![false; 6], start: vec![0.5; 6] };
    let real: &Robot = &cell.real;
    let begin = Instant::now();
    let file = TextFile { name: "t.csv".into(), bytes: text.into_bytes() };
    let program = programs::read(Language::Csv, vec![file], &setting).unwrap();
    let models = Models { controller: &cell.nominal, from: &cell.nominal, to: real };
    let done = programs::compensate(&program, models, &postures);
    let seconds = begin.elapsed().as_secs_f64();
    let count = done.outcomes.iter().filter(|o| matches!(o, Outcome::Done(_))).count();
    println!("{count} of 10000 in {seconds:.3} s");
    assert_eq!(count, 10_000);
    assert!(cfg!(debug_assertions) || seconds < 1.0, "{seconds} s");
}
