//! A robot with known errors that touches known and unknown places with a tool, as a series folder and in memory.

#![allow(dead_code)]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use robotcal::frames::{Touch, TouchPlace, Touches};
use robotcal::geom::Pose;
use robotcal::model::robot::{Posture, Robot};
use robotcal::series::JointsBeside;

/// What touches.
pub struct Toucher<'a> {
    /// As it is.
    pub truth: &'a Robot,
    /// `base_from_work`, as it is.
    pub work: Pose,
    /// The tool on the tip, m.
    pub tool: Vector3<f64>,
    /// Sigma of a touch per axis, m.
    pub sigma_m: f64,
    /// Sigma of every joint at a stop, rad.
    pub joint_sigma: f64,
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

fn vector(rng: &mut ChaCha8Rng, sigma: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| sigma * normal(rng))
}

impl Toucher<'_> {
    /// The tool in the work object at readings, with the noise of a stop.
    pub fn touched(&self, readings: &[f64], rng: &mut ChaCha8Rng) -> Vector3<f64> {
        let noise: Vec<f64> = readings.iter().map(|_| self.joint_sigma * normal(rng)).collect();
        let tip = self.truth.pose_at(&Posture::at(readings), &noise);
        self.work.inverse().transform(&(tip.transform(&self.tool) + vector(rng, self.sigma_m)))
    }

    /// Touches of known places: each at readings of its own.
    pub fn places(&self, readings: &[Vec<f64>], frame: &str, rng: &mut ChaCha8Rng) -> Touches {
        let touch = |(k, q): (usize, &Vec<f64>)| Touch {
            stop: format!("t{k:02}"),
            posture: k,
            body: 0,
            seen: TouchPlace::Point(self.touched(q, rng)),
            sigma_m: self.sigma_m.max(1e-9),
            sigma_rad: 1e-4,
        };
        Touches {
            all: readings.iter().enumerate().map(touch).collect(),
            postures: readings.iter().map(|q| Posture::at(q)).collect(),
            bodies: vec!["contact".into()],
            contacts: Vec::new(),
            frame: Some(frame.to_owned()),
            beside: JointsBeside::default(),
        }
    }
}

/// Readings spread over ranges.
pub fn spread(ranges: &[(f64, f64)], count: usize, rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
    (0..count).map(|_| ranges.iter().map(|(low, high)| rng.random_range(*low..*high)).collect()).collect()
}

/// Ranges of the readings of stops.
pub fn ranges(stops: &[Posture]) -> Vec<(f64, f64)> {
    let of = |r: usize| {
        let all = stops.iter().map(|s| s.readings[r]);
        (all.clone().fold(f64::INFINITY, f64::min), all.fold(f64::NEG_INFINITY, f64::max))
    };
    (0..stops[0].readings.len()).map(of).collect()
}

/// Touches as a series folder; `contacts.csv` has coordinates where they are known.
pub fn write(folder: &Path, joints: &[String], touches: &Touches, head: &str) -> PathBuf {
    std::fs::create_dir_all(folder).unwrap();
    let mut table = format!("stop,{}\n", joints.join(","));
    let mut contacts = String::from("stop,contact,x_m,y_m,z_m\n");
    for t in &touches.all {
        let q: Vec<String> =
            touches.postures[t.posture].readings.iter().map(|q| format!("{:.9}", q.to_degrees())).collect();
        writeln!(table, "{},{}", t.stop, q.join(",")).unwrap();
        match t.seen {
            TouchPlace::Point(p) => {
                writeln!(contacts, "{},p{},{:.7},{:.7},{:.7}", t.stop, t.stop, p.x, p.y, p.z).unwrap()
            }
            TouchPlace::Unknown(c) => writeln!(contacts, "{},{},,,", t.stop, touches.contacts[c]).unwrap(),
            TouchPlace::Pose(_) => panic!("contacts are points"),
        }
    }
    std::fs::write(folder.join("joints.csv"), table).unwrap();
    std::fs::write(folder.join("contacts.csv"), contacts).unwrap();
    std::fs::write(folder.join("series.toml"), format!("format = 1\njoint_unit = \"deg\"\n{head}")).unwrap();
    folder.to_path_buf()
}
