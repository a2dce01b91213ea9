//! Poses and programs as the languages write them, and what became of their targets.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

use robotcal::geom::{Pose, log_so3};
use robotcal::model::inverse;

use super::{Cell, numbers, status_turn};

/// A posture away from singular ones, rad.
pub const START: [f64; 6] = [0.17, -1.4, 1.7, 0.35, 0.7, 0.5];

/// A little beside it.
pub fn beside(k: usize) -> Vec<f64> {
    START.iter().enumerate().map(|(i, q)| q + 0.02 * ((7 * k + i) as f64).sin()).collect()
}

/// Components X to C of the flange.
pub fn pose_text(cell: &Cell, q: &[f64]) -> String {
    let pose = cell.nominal.base_from_tip(q);
    let [c, b, a] = pose.rpy().map(f64::to_degrees);
    let [x, y, z] = pose.xyz().map(|v| 1e3 * v);
    format!("X {x:.5},Y {y:.5},Z {z:.5},A {a:.7},B {b:.7},C {c:.7}")
}

/// A flange pose as KRL has it, with status and turn.
pub fn krl_pose(cell: &Cell, q: &[f64]) -> String {
    let pose = cell.nominal.base_from_tip(q);
    let [c, b, a] = pose.rpy().map(f64::to_degrees);
    let [x, y, z] = pose.xyz().map(|v| 1e3 * v);
    let (s, t) = status_turn(q);
    format!("{{X {x:.4},Y {y:.4},Z {z:.4},A {a:.6},B {b:.6},C {c:.6},S {s},T {t}}}")
}

/// A module of KRL whose tool and base are flange and foot at first; `SET` sets another tool, `MOVE` goes to a pose.
pub fn krl_text(pose: &str, body: &str) -> String {
    let set = "$TOOL={X 0.0,Y 0.0,Z 50.0,A 0.0,B 0.0,C 0.0}";
    let body = body.replace("SET", set).replace("MOVE", &format!("PTP {pose}"));
    format!("DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n{body}\nEND\n")
}

/// A pose of the tool as URScript has it.
pub fn script_pose(flange: &Pose) -> String {
    let (xyz, r) = (flange.xyz(), log_so3(&flange.rotation));
    format!("p[{:.9},{:.9},{:.9},{:.9},{:.9},{:.9}]", xyz[0], xyz[1], xyz[2], r[0], r[1], r[2])
}

/// A robtarget with these configuration data.
pub fn robtarget(p: &Pose, confdata: &str) -> String {
    let [x, y, z] = p.xyz().map(|v| 1e3 * v);
    let [qx, qy, qz, qw] = p.quaternion_xyzw();
    format!("[[{x:.4},{y:.4},{z:.4}],[{qw:.9},{qx:.9},{qy:.9},{qz:.9}],{confdata},{NO_AXES}]")
}

/// Configuration data that count for nothing where they are not checked.
pub const UNCHECKED: &str = "[0,0,0,0]";

/// No external axes.
pub const NO_AXES: &str = "[9E9,9E9,9E9,9E9,9E9,9E9]";

/// A robtarget of the tool at `q`, in a work object.
pub fn tool_robtarget(cell: &Cell, q: &[f64], tool: &Pose, base: &Pose, confdata: &str) -> String {
    robtarget(&(base.inverse() * cell.nominal.base_from_tip(q) * *tool), confdata)
}

pub fn jointtarget(q: &[f64]) -> String {
    let degrees: Vec<String> = q.iter().map(|v| format!("{:.9}", v.to_degrees())).collect();
    format!("[[{}],[9E9,9E9,9E9,9E9,9E9,9E9]]", degrees.join(","))
}

pub fn confdata(q: &[f64]) -> String {
    let (status, _) = status_turn(q);
    let cfx = 4 * (status & 1) + 2 * u32::from(status & 2 == 0) + u32::from(status & 4 != 0);
    let quarter = |v: f64| (v / FRAC_PI_2).floor() as i64;
    format!("[{},{},{},{cfx}]", quarter(q[0]), quarter(q[3]), quarter(q[5]))
}

pub fn pose(v: &[f64]) -> Pose {
    Pose::from_xyz_quaternion([v[0], v[1], v[2]].map(|x| 1e-3 * x), [v[4], v[5], v[6], v[3]])
}

pub const TOOL: &str =
    "PERS tooldata tGun:=[TRUE,[[97.4,0,223.1],[0.924,0,0.382389,0]],[5,[23,0,75],[1,0,0,0],0,0,0]];\n";

pub const WORK: &str =
    "PERS wobjdata wTable:=[FALSE,TRUE,\"\",[[300,-60,20.5],[0.707107,0,0,0.707107]],[[0,20.25,3],[1,0,0,0]]];\n";

pub fn frames() -> (Pose, Pose) {
    let frame = |v: [f64; 7]| pose(&v);
    let base = frame([300.0, -60.0, 20.5, FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2])
        * frame([0.0, 20.25, 3.0, 1.0, 0.0, 0.0, 0.0]);
    (frame([97.4, 0.0, 223.1, 0.924, 0.0, 0.382389, 0.0]), base)
}

/// Numbers of the lists in the last brackets `[[..],[..],..]` of every line that contains `key`.
pub fn lines(text: &str, key: &str) -> Vec<Vec<f64>> {
    text.lines().filter(|l| l.contains(key)).map(|l| numbers(&l[l.find("[[").unwrap()..])).collect()
}

/// How many targets were corrected, and the reasons of those that were left.
pub fn told(cell: &Cell, files: &[(&str, String)], flags: &[&str]) -> (usize, Vec<String>) {
    let paths: Vec<_> = files.iter().map(|(name, text)| cell.write(name, text.as_bytes())).collect();
    let flags = [&["--unordered"], flags].concat();
    let told = cell.compensate(&paths.iter().collect::<Vec<_>>(), &flags).told();
    (told.corrected, told.left.into_iter().map(|(_, _, reason)| reason).collect())
}

/// Targets that were corrected beside the first, and the reasons of those that were left.
pub fn told_beside_first(cell: &Cell, files: &[(&str, String)], flags: &[&str]) -> (usize, Vec<String>) {
    let paths: Vec<_> = files.iter().map(|(name, text)| cell.write(name, text.as_bytes())).collect();
    let run = cell.compensate(&paths.iter().collect::<Vec<_>>(), &[&["--unordered"], flags].concat());
    let told = run.told();
    assert_eq!(run.output.status.code(), Some(i32::from(!told.left.is_empty())), "{}", run.said());
    (told.corrected - 1, told.left.into_iter().map(|(_, _, reason)| reason).collect())
}

/// The motions of a module as they were corrected.
pub fn krl_moves(cell: &Cell, text: &str) -> Vec<String> {
    let file = cell.write("a.src", text.as_bytes());
    let run = cell.compensate(&[&file], &["--unordered"]);
    run.text("a.src").lines().filter(|line| line.starts_with("PTP")).map(str::to_owned).collect()
}

/// Asserts that the real robot's tool is where the program meant it (m, rad), where the controller goes to `new` near `q`.
pub fn assert_tool_meets(cell: &Cell, tool: &Pose, old: &Pose, new: &Pose, q: &[f64], most_rad: f64, what: &str) {
    let limits = inverse::reading_limits(&cell.nominal.chain);
    let commanded = inverse::solve_from(&cell.nominal, &limits, &(*new * tool.inverse()), q).unwrap();
    let change = commanded.iter().zip(q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(change < 0.15, "{what} left its posture: {change}");
    let (rad, m) = (cell.real_at(&commanded, None) * *tool).distance(old);
    assert!(m < 1e-6 && rad < most_rad, "{what}: {m:e} m, {rad:e} rad");
}
