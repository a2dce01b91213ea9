//! A robot with known errors as files, and `robotcal compensate` as a user calls it.

#![allow(dead_code)]

pub mod identified;
pub mod text;
pub mod touching;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::robots::{kr6_urdf, repo};
use nalgebra::Vector6;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use robotcal::geom::{Pose, matrix_from_rpy};
use robotcal::model::inverse::{reading_limits, solve_from};
use robotcal::model::joint_terms::{JointTerm, Term};
use robotcal::model::robot::{Posture, Robot};
use robotcal::programs::LeftReason;
use robotcal::urdf::{Chain, patch_origins, read};

/// A nominal robot, and the real one as corrected URDF and compensation.toml.
pub struct Cell {
    pub folder: tempfile::TempDir,
    pub nominal_urdf: PathBuf,
    pub real_urdf: PathBuf,
    pub compensation: PathBuf,
    pub nominal: Robot,
    /// Read back from the files by this crate's readers of URDF; terms as drawn.
    pub real: Robot,
    pub rng: ChaCha8Rng,
}

fn chain(urdf: &Path, links: (&str, &str)) -> Chain {
    read(urdf).unwrap().chain(Some(links.0), Some(links.1)).unwrap()
}

impl Cell {
    /// Errors of a usual arm: 0.5 mm and 1 mrad at every origin, and terms of every kind.
    pub fn new(urdf: &Path, links: (&str, &str), seed: u64) -> Self {
        println!("seed {seed}");
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let folder = tempfile::tempdir().unwrap();
        let description = read(urdf).unwrap();
        let nominal = Robot::nominal(chain(urdf, links));
        let mut draw = |sigma: f64| rng.random_range(-1.7..1.7) * sigma;
        let new: BTreeMap<String, Pose> = nominal
            .chain
            .joints
            .iter()
            .map(|j| {
                let twist = Vector6::from_fn(|i, _| draw(if i < 3 { 0.5e-3 } else { 1e-3 }));
                (j.name.clone(), j.origin.perturbed(&twist))
            })
            .collect();
        let real_urdf = folder.path().join("real.urdf");
        std::fs::write(&real_urdf, patch_origins(&description.text, &new).unwrap()).unwrap();
        let compensation = folder.path().join("compensation.toml");
        let (mut terms, mut text) = (Vec::new(), String::new());
        for (reading, name) in nominal.chain.readings.iter().enumerate() {
            let [gear, a1, b1, a2, b2] = [3e-4, 2e-4, 2e-4, 1e-4, 1e-4].map(&mut draw);
            let g: [f64; 4] = [3e-4; 4].map(&mut draw);
            let backlash = draw(1e-4);
            text += &format!("[joint.{name}]\ngear_scale = {gear:?}\nharmonics = [{a1:?}, {b1:?}, {a2:?}, {b2:?}]\n");
            text += &format!("gravity = {g:?}\nbacklash_rad = {backlash:?}\n");
            let all = [
                (Term::Gear, gear),
                (Term::Cosine(1), a1),
                (Term::Sine(1), b1),
                (Term::Cosine(2), a2),
                (Term::Sine(2), b2),
                (Term::Gravity(0), g[0]),
                (Term::Gravity(1), g[1]),
                (Term::Gravity(2), g[2]),
                (Term::Gravity(3), g[3]),
                (Term::Backlash, backlash),
            ];
            terms.extend(all.map(|(term, value)| JointTerm { reading, term, value }));
        }
        std::fs::write(&compensation, text).unwrap();
        let real = Robot { terms, ..Robot::nominal(chain(&real_urdf, links)) };
        Self { folder, nominal_urdf: urdf.to_path_buf(), real_urdf, compensation, nominal, real, rng }
    }

    pub fn kuka(seed: u64) -> Self {
        Self::new(&kr6_urdf(), ("base_link", "tool0"), seed)
    }

    pub fn ur(seed: u64) -> Self {
        Self::new(&repo("robots/ur10e/ur10e.urdf"), ("base_link", "tool0"), seed)
    }

    /// Readings well inside the ranges and away from singular postures (smallest singular value of the Jacobian in m and rad).
    pub fn readings(&mut self) -> Vec<f64> {
        self.readings_holding(None)
    }

    /// The same, for a robot whose joint `held` does not move.
    pub fn readings_holding(&mut self, held: Option<usize>) -> Vec<f64> {
        let limits = robotcal::model::inverse::reading_limits(&self.nominal.chain);
        loop {
            let q: Vec<f64> = limits
                .iter()
                .map(|(low, high)| self.rng.random_range(low.max(-2.5) + 0.2..high.min(2.5) - 0.2))
                .collect();
            let mut columns = self.nominal.kinematics(&Posture::at(&q), &vec![0.0; q.len()]).d_readings;
            held.into_iter().for_each(|h| columns[h].fill(0.0));
            let jacobian = nalgebra::Matrix6xX::from_columns(&columns);
            if (jacobian.clone() * jacobian.transpose()).symmetric_eigenvalues().min() > 0.1f64.powi(2) {
                return q;
            }
        }
    }

    /// Where the real robot ends at `q`, coming from `before`.
    pub fn real_at(&self, q: &[f64], before: Option<&[f64]>) -> Pose {
        let approach = before.map(|b| q.iter().zip(b).map(|(q, b)| q - b).collect());
        self.real.pose_at(&Posture { readings: q.to_vec(), approach }, &vec![0.0; q.len()])
    }

    pub fn write(&self, name: &str, text: &[u8]) -> PathBuf {
        let path = self.folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    }

    /// Runs `compensate` on files of this cell.
    pub fn compensate(&self, files: &[&PathBuf], flags: &[&str]) -> Run {
        let out = self.folder.path().join("out");
        let mut command = Command::new(env!("CARGO_BIN_EXE_robotcal"));
        command.arg("compensate").args(files).arg("--out").arg(&out);
        command.arg("--nominal").arg(&self.nominal_urdf).arg("--urdf").arg(&self.real_urdf);
        command.arg("--compensation").arg(&self.compensation);
        command.args(["--frames", "nominal", "--base", &self.nominal.chain.base, "--tip", &self.nominal.chain.tip]);
        let output = command.args(flags).output().unwrap();
        Run { output, out, programs: files.iter().map(|file| (*file).clone()).collect() }
    }
}

/// A finished call.
pub struct Run {
    pub output: Output,
    pub out: PathBuf,
    /// Of which `told` tells; of all in the folder where none is named.
    pub programs: Vec<PathBuf>,
}

impl Run {
    pub fn said(&self) -> String {
        let Output { stdout, stderr, .. } = &self.output;
        format!("{}{}", String::from_utf8_lossy(stdout), String::from_utf8_lossy(stderr))
    }

    pub fn expect(self, code: i32) -> Self {
        assert_eq!(self.output.status.code(), Some(code), "{}", self.said());
        self
    }

    pub fn file(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.out.join(name)).unwrap()
    }

    pub fn text(&self, name: &str) -> String {
        String::from_utf8(self.file(name)).unwrap()
    }
}

/// What became of the targets of a call, by corrections.csv.
#[derive(Debug)]
pub struct Told {
    pub corrected: usize,
    /// Line, name and reason of the targets that stay as they are.
    pub left: Vec<(usize, String, String)>,
}

impl Run {
    pub fn told(&self) -> Told {
        let text = self.text("corrections.csv");
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let headers = reader.headers().unwrap().clone();
        let cell =
            |row: &csv::StringRecord, name: &str| row[headers.iter().position(|h| h == name).unwrap()].to_owned();
        let is_own = |row: &csv::StringRecord| {
            let name = |path: &Path| path.file_name().map(|name| name.to_owned());
            self.programs.is_empty() || self.programs.iter().any(|p| name(p) == name(Path::new(&row[0])))
        };
        let rows: Vec<csv::StringRecord> = reader.records().map(|r| r.unwrap()).filter(is_own).collect();
        let left = |row: &&csv::StringRecord| !cell(row, "reason").is_empty();
        let of =
            |row: &csv::StringRecord| (cell(row, "line").parse().unwrap(), cell(row, "target"), cell(row, "reason"));
        let left: Vec<_> = rows.iter().filter(left).map(of).collect();
        Told { corrected: rows.len() - left.len(), left }
    }
}

impl Told {
    /// True where the target of that line and name was left for that reason.
    pub fn has(&self, line: usize, target: &str, reason: LeftReason) -> bool {
        self.left.iter().any(|(l, t, r)| (*l, t.as_str(), r.as_str()) == (line, target, reason.name()))
    }
}

/// All numbers of a text in their order, signs included.
pub fn numbers(text: &str) -> Vec<f64> {
    let part = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | '+' | 'e' | 'E');
    text.split(|c: char| !part(c)).filter_map(|t| t.parse().ok()).collect()
}

/// The text with every number with a point replaced by `#`: what a correction must leave alone.
pub fn shape(text: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut at = 0;
    while at < text.len() {
        let part = |b: &u8| b.is_ascii_digit() || *b == b'.';
        let length = text[at..].iter().take_while(|b| part(b)).count();
        if length > 1 && text[at..at + length].contains(&b'.') {
            if out.last() == Some(&b'-') {
                out.pop();
            }
            out.push(b'#');
            at += length;
        } else {
            out.push(text[at]);
            at += 1;
        }
    }
    out
}

/// Asserts that two poses agree to 1e-6 m and 1e-6 rad.
pub fn assert_meets(reached: &Pose, wanted: &Pose, what: &str) {
    let (rad, m) = reached.distance(wanted);
    assert!(rad < 1e-6 && m < 1e-6, "{what}: {m:e} m, {rad:e} rad");
}

/// The frame that the six numbers of a line of KRL say.
pub fn krl_frame(line: &str) -> Pose {
    let n: Vec<f64> = numbers(line);
    let [x, y, z] = [n[0], n[1], n[2]].map(|v| 1e-3 * v);
    Pose::new(matrix_from_rpy([n[5], n[4], n[3]].map(f64::to_radians)), [x, y, z].into())
}

/// Asserts that a commanded pose, with the joints next to `q`, brings the real robot where the nominal one is at `q`.
pub fn assert_brings_to(cell: &Cell, commanded: &Pose, q: &[f64], what: &str) {
    let joints = solve_from(&cell.nominal, &reading_limits(&cell.nominal.chain), commanded, q).unwrap();
    assert_meets(&cell.real_at(&joints, None), &cell.nominal.base_from_tip(q), what);
}

/// Status and turn as the manual defines them, for the KR 6 R900: S bit 2 and T are signs; bit 1 is A3 against the stretched arm, whose
/// wrist lies 35 mm beside axis 4's line at 420 mm; bit 0 is the wrist centre against axis 1.
pub fn status_turn(q: &[f64]) -> (u32, u32) {
    let phi = (35.0f64 / 420.0).atan() - 0.0;
    let (a2, a3) = (q[1], q[2]);
    // Wrist centre before axis 1, in the plane of the arm, m; x forward, z up.
    let reach = 0.025 + 0.455 * a2.cos() + 0.42 * (a2 + a3).cos() - 0.035 * (a2 + a3).sin() * SIDE;
    let status = u32::from(reach < 0.0) | u32::from(a3 >= -phi * SIDE) << 1 | u32::from(q[4] < 0.0) << 2;
    let turn = q.iter().enumerate().map(|(k, v)| u32::from(*v < 0.0) << k).sum();
    (status, turn)
}

/// Side of the 35 mm: the wrist lies above axis 3 when the forearm is level.
const SIDE: f64 = -1.0;

/// Findings of a call by their codes: weight and quantities.
pub fn findings(run: &Run) -> BTreeMap<String, (String, serde_json::Value)> {
    let all: Vec<serde_json::Value> = serde_json::from_str(&run.text("findings.json")).unwrap();
    let one = |f: serde_json::Value| {
        (f["code"].as_str().unwrap().into(), (f["weight"].as_str().unwrap().into(), f["quantities"].clone()))
    };
    // Those of this run stand first.
    all.into_iter().rev().map(one).collect()
}
