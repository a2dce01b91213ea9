//! A body that the tip carries, measured at a stop: a reflector or a ball as a point, a 6-DoF target as a pose.
//!
//! `instrument_from_body = instrument_from_base * base_from_tip(q) * tip_from_body`, in the frame of the instrument that measured it: that of
//! a tracker, of a socket that a ball sits in (parallel to the base, its origin is the place), or of given places. To the robot it is what
//! a fixed camera and its plate are, so it enters through the same six degrees of freedom.

use std::fmt;

use nalgebra::{Matrix6, Vector3, Vector6};

use crate::geom::{Pose, right_jacobian_se3};

/// Huber bounds on the normalised length of a residual: the 95 % points of the length of a standard normal vector of 3 and of 6 components.
const HUBER: [f64; 2] = [2.795, 3.548];

/// What measures bodies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InstrumentKind {
    /// A tracker, in a frame of its own.
    Tracker,
    /// A socket: the body is always at the same place of the base.
    Socket,
    /// Given places, in a frame of their own.
    Places,
}

/// Name of the block of the columns of a body.
pub(super) const BODY: &str = "target";

/// True for a column, by its name for people, that places an instrument or a body: no camera sees it.
pub fn places_body(name: &str) -> bool {
    let block = name.split('.').next();
    block == Some(BODY) || InstrumentKind::ALL.iter().any(|kind| block == Some(kind.block()))
}

impl InstrumentKind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Tracker, Self::Socket, Self::Places];

    /// Name of the block of its columns.
    pub fn block(self) -> &'static str {
        match self {
            Self::Tracker => "tracker",
            Self::Socket => "contact",
            Self::Places => "places",
        }
    }

    /// True where the axes of its frame are those of the base.
    pub fn is_parallel_to_base(self) -> bool {
        self == Self::Socket
    }
}

/// One frame in which bodies are measured.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Instrument {
    /// Name.
    pub name: String,
    /// What it is.
    pub kind: InstrumentKind,
    /// Index of its variance components in [`super::Noise::body`]: sockets of one series have them in common.
    pub component: usize,
}

impl Instrument {
    /// What it is and its name, as people are told.
    pub fn place(&self) -> String {
        format!("{} {}", self.kind.block(), self.name)
    }
}

/// What an instrument saw of a body, in its frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BodySeen {
    /// Its origin, m.
    Point(Vector3<f64>),
    /// Its pose, `instrument_from_body`.
    Pose(Pose),
}

impl BodySeen {
    /// Number of coordinates.
    pub fn coordinates(&self) -> usize {
        match self {
            Self::Point(_) => 3,
            Self::Pose(_) => 6,
        }
    }

    /// Where it was seen, m.
    pub fn position(&self) -> Vector3<f64> {
        match self {
            Self::Point(position) => *position,
            Self::Pose(pose) => pose.translation,
        }
    }
}

/// Why a measurement of a body is left out.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum BodyRejection {
    /// It disagrees with all others at its stop.
    Residual {
        /// Length of its residual in sigmas.
        sigmas: f64,
    },
    /// It and the joint readings of its stop do not belong together.
    JointError {
        /// In usual joint errors, RMS over the joints.
        usual_errors: f64,
    },
    /// The tracker wrote the same at successive stops, to the last digit, though the arm had moved on.
    Repeated,
    /// The caller does not want it: held out.
    Excluded,
}

impl fmt::Display for BodyRejection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Residual { sigmas } => write!(f, "its residual is {sigmas:.1} sigma"),
            Self::JointError { usual_errors } => {
                write!(f, "its joint readings would have to be wrong by {usual_errors:.1} of the usual noise")
            }
            Self::Repeated => {
                f.write_str("it is the same to the last digit as at another stop, though the arm had moved")
            }
            Self::Excluded => f.write_str("not asked for"),
        }
    }
}

/// One measurement of a body.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyMeasurement {
    /// Index of its stop.
    pub stop: usize,
    /// Series that it was read from, and place of its stop there.
    pub read: (usize, usize),
    /// Index of the instrument.
    pub instrument: usize,
    /// Index of the body.
    pub body: usize,
    /// What was seen.
    pub seen: BodySeen,
    /// Stated sigma of a coordinate, m.
    pub sigma_m: f64,
    /// Stated sigma of the rotation about an axis, rad.
    pub sigma_rad: f64,
    /// Why it is left out; `None` while it is used.
    pub rejected: Option<BodyRejection>,
}

/// Normal-equation blocks of one measurement in the six degrees of freedom of `instrument_from_body`.
#[derive(Debug, Clone)]
pub struct BodyTerms {
    /// Robust cost.
    pub cost: f64,
    /// Information.
    pub pp: Matrix6<f64>,
    /// Right-hand side.
    pub bp: Vector6<f64>,
    /// Measured minus predicted: position (m), then rotation (rad, zero for a point); as a body twist for a pose.
    pub residual: Vector6<f64>,
    /// Sums of squares in units of the stated sigmas: position, rotation.
    pub squares: [f64; 2],
    /// Length of the residual in sigmas.
    pub length: f64,
    /// Huber weight.
    pub weight: f64,
}

impl BodyTerms {
    /// Second derivative of the robust cost, by a residual that is linear in the pose. The information takes the Huber weight as constant; a
    /// residual beyond the bound, `l` sigmas long, is bent by `J' w S^-1 r r' S^-1 J / l^2` less.
    pub fn robust_curvature(&self) -> Matrix6<f64> {
        match self.weight < 1.0 {
            true => self.pp - self.bp * self.bp.transpose() / (self.weight * self.length.powi(2)),
            false => self.pp,
        }
    }
}

impl BodyMeasurement {
    /// Blocks at a predicted pose, with factors on the stated sigmas of position and rotation.
    pub fn linearise(&self, predicted: &Pose, factors: [f64; 2]) -> BodyTerms {
        let (residual, jacobian) = self.residual(predicted);
        let sigma = [self.sigma_m, self.sigma_rad];
        let square = |k: usize| residual.fixed_rows::<3>(3 * k).norm_squared() / sigma[k].powi(2);
        let (coordinates, turned, kind) = match self.seen {
            BodySeen::Point(_) => (3, 0.0, 0),
            BodySeen::Pose(_) => (6, square(1), 1),
        };
        let squares = [square(0), turned];
        let length = (squares[0] / factors[0].powi(2) + squares[1] / factors[1].powi(2)).sqrt();
        let bound = HUBER[kind];
        let weight = if length <= bound { 1.0 } else { bound / length };
        let cost = if length <= bound { 0.5 * length * length } else { bound * (length - 0.5 * bound) };
        let information = |k: usize| weight / (sigma[k / 3] * factors[k / 3]).powi(2);
        let w = Matrix6::from_diagonal(&Vector6::from_fn(|k, _| if k < coordinates { information(k) } else { 0.0 }));
        let jw = jacobian.transpose() * w;
        BodyTerms { cost, pp: jw * jacobian, bp: jw * residual, residual, squares, length, weight }
    }

    /// Measured minus predicted, m and rad (of a point the rotation is zero), and the derivative of the prediction by its body twist.
    pub fn residual(&self, predicted: &Pose) -> (Vector6<f64>, Matrix6<f64>) {
        match &self.seen {
            BodySeen::Point(position) => {
                let d = position - predicted.translation;
                let mut jacobian = Matrix6::zeros();
                jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&predicted.rotation);
                (Vector6::new(d.x, d.y, d.z, 0.0, 0.0, 0.0), jacobian)
            }
            BodySeen::Pose(pose) => {
                let residual = (predicted.inverse() * *pose).log();
                // log(Exp(-x) Exp(r)) = r - J_l(r)^-1 x, and J_l(r) = J_r(-r).
                let jacobian = right_jacobian_se3(&-residual).try_inverse().unwrap_or_else(Matrix6::identity);
                (residual, jacobian)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curvature_is_the_second_derivative_of_the_robust_cost() {
        let turned = Pose::exp(&Vector6::new(0.4, -0.2, 0.9, 0.5, -1.1, 0.3));
        for off in [Vector3::new(1e-3, -5e-4, 2e-4), Vector3::new(4e-3, 7e-3, -2e-3)] {
            let measured = BodyMeasurement {
                stop: 0,
                read: (0, 0),
                instrument: 0,
                body: 0,
                seen: BodySeen::Point(turned.translation + off),
                sigma_m: 5e-4,
                sigma_rad: 0.0,
                rejected: None,
            };
            let terms = measured.linearise(&turned, [1.0; 2]);
            let step = 1e-6;
            let cost = |x: Vector3<f64>| {
                measured.linearise(&(turned * Pose::exp(&Vector6::new(x.x, x.y, x.z, 0.0, 0.0, 0.0))), [1.0; 2]).cost
            };
            let curvature = terms.robust_curvature();
            for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
                let (a, b) = (Vector3::ith(i, step), Vector3::ith(j, step));
                let second = (cost(a + b) - cost(a - b) - cost(b - a) + cost(-a - b)) / (4.0 * step * step);
                assert!((second - curvature[(i, j)]).abs() < 1e-3 * terms.pp[(0, 0)], "{off}: {second} {curvature}");
            }
            assert_eq!(terms.weight < 1.0, off.norm() > 5e-3);
        }
    }
}
