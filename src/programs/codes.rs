//! Which posture a pose means: status and turn (KRL), confdata (RAPID).
//!
//! Both count the same three alternatives of a six-axis arm with a spherical wrist (KUKA, *Programming by end users*, status and turn;
//! ABB, *Technical reference manual RAPID*, confdata): wrist centre before or behind axis 1, elbow, sign of axis 5.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::ops::Range;

use nalgebra::{Vector3, Vector6};

use super::field::Edit;
use super::text_file::TextFile;
use crate::geom::{adjoint, exp_so3};
use crate::model::robot::{Posture, Robot};
use crate::urdf::Joint;

/// An angle this near to a border (rad) belongs to both sides.
const BORDER: f64 = 1e-5;

/// A whole number in the text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PostureCode {
    /// Index of the file.
    pub file: usize,
    /// Its bytes.
    pub range: Range<usize>,
    /// Its value.
    pub value: i64,
}

/// Codes of a pose.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Codes {
    /// `S` and `T`.
    Krl {
        /// Bit 0: overhead; bit 1: axis 3 beyond the stretched arm; bit 2: axis 5 negative.
        status: Option<PostureCode>,
        /// Bit n: axis n + 1 negative.
        turn: Option<PostureCode>,
    },
    /// `[cf1, cf4, cf6, cfx]`: quadrants of axes 1, 4 and 6, and the alternative.
    Rapid(Box<[PostureCode; 4]>),
}

/// The alternatives of a posture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Branch {
    /// Wrist centre behind axis 1.
    pub behind: bool,
    /// Axis 3 beyond the stretched arm: the wrist centre lies before the lower arm.
    pub elbow: bool,
    /// Axis 5 negative.
    pub flipped: bool,
}

impl Branch {
    /// Of the arm with these six axes (readings) at `q`; its foot's x is forward.
    pub fn of(robot: &Robot, axes: &[usize; 6], q: &[f64]) -> Self {
        let k = robot.kinematics_at(&Posture::at(q));
        let to_base = adjoint(&k.base_from_tip);
        let line = |axis: usize| {
            let twist: Vector6<f64> = to_base * k.d_readings[axes[axis]];
            let direction: Vector3<f64> = twist.fixed_rows::<3>(3).into_owned();
            (direction, direction.cross(&twist.fixed_rows::<3>(0).into_owned()))
        };
        let ((d1, p1), (_, p2), (d3, p3)) = (line(0), line(1), line(2));
        let wrist = nearest_to(line(4), line(5));
        let out = (wrist - p1) - d1 * d1.dot(&(wrist - p1));
        let x = foot_x(robot, axes[0], q);
        let forward = exp_so3(&(d1 * q[axes[0]])) * (x - d1 * d1.dot(&x));
        let a5 = q[axes[4]];
        Self {
            behind: out.dot(&forward) < 0.0,
            elbow: d3.dot(&(p3 - p2).cross(&(wrist - p3))) >= 0.0,
            flipped: (-PI..0.0).contains(&a5) || a5 >= PI,
        }
    }

    fn status(self) -> i64 {
        i64::from(self.behind) | i64::from(self.elbow) << 1 | i64::from(self.flipped) << 2
    }

    fn cfx(self) -> i64 {
        i64::from(self.behind) << 2 | i64::from(!self.elbow) << 1 | i64::from(self.flipped)
    }
}

/// The x axis of the foot of the arm in the base: the base of the chain, or, where a rail or another moving joint lies below axis 1, the link that
/// carries that axis.
fn foot_x(robot: &Robot, first: usize, q: &[f64]) -> Vector3<f64> {
    let is_first = |joint: &Joint| joint.drive.as_ref().is_some_and(|drive| drive.reading == first);
    let below = robot.chain.joints.iter().take_while(|joint| !is_first(joint));
    let moving = below.clone().any(|joint| joint.drive.is_some());
    let carrier = below.count().checked_sub(1).filter(|_| moving);
    let pose = carrier.and_then(|k| robot.link_poses(q).get(k).copied());
    pose.map_or_else(Vector3::x, |pose| pose.rotation.column(0).into_owned())
}

/// Point of line `a` nearest to line `b` (direction and point each).
fn nearest_to(a: (Vector3<f64>, Vector3<f64>), b: (Vector3<f64>, Vector3<f64>)) -> Vector3<f64> {
    let ((da, pa), (db, pb)) = (a, b);
    let c = da.dot(&db);
    let between = pb - pa;
    pa + da * ((between.dot(&da) - between.dot(&db) * c) / (1.0 - c * c).max(1e-12))
}

/// Quarter turn in which an angle lies, from 0 on.
fn quadrant(q: f64) -> i64 {
    (q / FRAC_PI_2).floor() as i64
}

fn in_quadrant(q: f64, wanted: i64) -> bool {
    quadrant(q - BORDER) == wanted || quadrant(q + BORDER) == wanted
}

impl Codes {
    /// True where the alternatives are those of the code.
    pub fn mean(&self, branch: Branch) -> bool {
        match self {
            Self::Krl { status, .. } => status.as_ref().is_none_or(|s| s.value & 7 == branch.status()),
            Self::Rapid(cf) => cf[3].value == branch.cfx(),
        }
    }

    /// True where axis `axis` (from 0) at `q` (rad) has the turn of the code.
    pub fn allow(&self, axis: usize, q: f64) -> bool {
        match self {
            Self::Krl { turn, .. } => turn.as_ref().is_none_or(|t| {
                let negative = t.value >> axis & 1 == 1;
                if negative { q < BORDER } else { q >= -BORDER }
            }),
            Self::Rapid(cf) => match axis {
                0 => in_quadrant(q, cf[0].value),
                3 => in_quadrant(q, cf[1].value),
                5 => in_quadrant(q, cf[2].value),
                _ => true,
            },
        }
    }

    /// Of all whole turns of an axis within its limits that the code allows, the one nearest to `near`; rad.
    pub fn turned(&self, axis: usize, q: f64, near: f64, (low, high): (f64, f64)) -> Option<f64> {
        let all =
            (-3i32..=3).map(|k| q + TAU * f64::from(k)).filter(|v| (low..=high).contains(v) && self.allow(axis, *v));
        all.min_by(|a, b| (a - near).abs().total_cmp(&(b - near).abs()))
    }

    /// In words, for messages.
    pub fn shown(&self) -> String {
        let value = |c: &Option<PostureCode>| c.as_ref().map_or("-".to_owned(), |c| c.value.to_string());
        match self {
            Self::Krl { status, turn } => format!("S {}, T {}", value(status), value(turn)),
            Self::Rapid(cf) => format!("[{},{},{},{}]", cf[0].value, cf[1].value, cf[2].value, cf[3].value),
        }
    }

    /// Edits for what changes in the codes between the programmed and the corrected posture.
    pub fn edits(&self, before: (&[f64; 6], Branch), after: (&[f64; 6], Branch), files: &[TextFile]) -> Vec<Edit> {
        let mut edits = Vec::new();
        let mut set = |code: &PostureCode, value: i64| {
            if value != code.value {
                let old = &files[code.file].bytes[code.range.clone()];
                edits.push(Edit { file: code.file, range: code.range.clone(), text: written(value, old) });
            }
        };
        match self {
            Self::Krl { status, turn } => {
                if let Some(s) = status {
                    set(s, s.value ^ before.1.status() ^ after.1.status());
                }
                if let Some(t) = turn {
                    let bit = |value: i64, axis: usize| {
                        let negative = after.0[axis] < 0.0;
                        if negative { value | 1 << axis } else { value & !(1 << axis) }
                    };
                    set(t, (0..6).fold(t.value, bit));
                }
            }
            Self::Rapid(cf) => {
                for (code, axis) in cf.iter().zip([0, 3, 5]) {
                    let keeps = quadrant(after.0[axis]) == code.value;
                    set(code, if keeps { code.value } else { quadrant(after.0[axis]) });
                }
                set(&cf[3], after.1.cfx());
            }
        }
        edits
    }
}

/// A whole number in the notation that it had: decimal, `'B0101'` or `'H1F'`.
fn written(value: i64, old: &[u8]) -> String {
    let width = old.len().saturating_sub(3);
    match old.get(..2) {
        Some([b'\'', b @ (b'B' | b'b')]) => format!("'{}{value:0width$b}'", char::from(*b)),
        Some([b'\'', b @ (b'H' | b'h')]) => format!("'{}{value:0width$X}'", char::from(*b)),
        _ => value.to_string(),
    }
}
