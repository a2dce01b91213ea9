//! What a joint does that its reading does not say, beyond rigid geometry.
//!
//! `qt = q + sum_t p_t phi_t(q)`: every term is a basis function `phi` of the reading (and of the posture and the approach)
//! times one parameter. To add a term: a variant of [`Term`], its rows in `name`, `prior_sigma` and `basis`.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::urdf::JointKind;

/// Step of a joint (rad or m) over which the backlash term turns from one side to the other.
const BACKLASH_STEP: f64 = 2e-3;

/// Range of readings (rad or m, one sigma) over which the local error of a joint is the same.
pub const LOCAL_RANGE: f64 = 3e-3;

/// Number of gravity basis functions of a joint.
pub const GRAVITY_TERMS: u8 = 4;

/// One kind of joint error; its parameter is in rad (or m for a prismatic joint) unless said otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Term {
    /// Constant offset of the zero position.
    Offset,
    /// Error of the gear ratio, dimensionless: `kappa q`.
    Gear,
    /// `a cos(k q)` of the reading: first, second, ... harmonic of a gear.
    Cosine(u8),
    /// `b sin(k q)` of the reading.
    Sine(u8),
    /// Sag under gravity: the moment about the axis of a unit weight on a unit lever. Levers 0 and 1 are fixed in the
    /// joint's own link, levers 2 and 3 in the link after the next moving joint of the chain.
    Gravity(u8),
    /// Sag under gravity where the masses are known: the moment about the axis, over the largest that it can be
    /// ([`crate::urdf::Chain::largest_moment`]). The parameter is the sag at that moment.
    Sag,
    /// Backlash: `b tanh(dq / 2 mrad)` of the step from the previous stop.
    Backlash,
    /// What the joint is off by near one reading (given in urad or um) to which it came back for several stops: whatever it
    /// is, it does not change while the joint stands still, and is nearly the same when it comes back.
    Local(i32),
}

impl Term {
    /// Local error near a reading, rad or m.
    pub fn local(reading: f64) -> Self {
        Self::Local((1e6 * reading).round() as i32)
    }

    /// Name in parameter blocks.
    pub fn name(self) -> String {
        match self {
            Self::Offset => "offset".into(),
            Self::Gear => "gear".into(),
            Self::Cosine(k) => format!("cos_{k}"),
            Self::Sine(k) => format!("sin_{k}"),
            Self::Gravity(k) => format!("gravity_{k}"),
            Self::Sag => "sag".into(),
            Self::Backlash => "backlash".into(),
            Self::Local(at) => format!("local_{:.4}", 1e-6 * f64::from(at)),
        }
    }

    /// The term of a name; `None` for an unknown one.
    pub fn from_name(name: &str) -> Option<Self> {
        match (name, name.split_once('_')) {
            ("offset", _) => Some(Self::Offset),
            ("gear", _) => Some(Self::Gear),
            ("sag", _) => Some(Self::Sag),
            ("backlash", _) => Some(Self::Backlash),
            (_, Some(("cos", k))) => k.parse().ok().map(Self::Cosine),
            (_, Some(("sin", k))) => k.parse().ok().map(Self::Sine),
            (_, Some(("local", at))) => at.parse().ok().map(Self::local),
            (_, Some(("gravity", k))) => k.parse().ok().filter(|k| *k < GRAVITY_TERMS).map(Self::Gravity),
            _ => None,
        }
    }

    /// Unit of the parameter for a joint of `kind`.
    pub fn unit(self, kind: JointKind) -> &'static str {
        match (self, kind) {
            (Self::Gear, _) => "1",
            (_, JointKind::Prismatic) => "m",
            _ => "rad",
        }
    }

    /// Default prior sigma, in the unit of the parameter.
    pub fn prior_sigma(self, kind: JointKind) -> f64 {
        let per_metre = if kind == JointKind::Prismatic { 0.1 } else { 1.0 };
        match self {
            Self::Offset => 10e-3 * per_metre,
            Self::Gear => 5e-4,
            Self::Cosine(_) | Self::Sine(_) => 0.1e-3 * per_metre,
            Self::Gravity(_) | Self::Backlash => 0.3e-3 * per_metre,
            Self::Sag => 1e-3 * per_metre,
            // A variance component: the data decide.
            Self::Local(_) => 3e-3 * per_metre,
        }
    }
}

/// Posture-dependent quantities that the basis functions need, of one joint at one stop.
#[derive(Debug, Clone, Copy)]
pub struct TermContext {
    /// Reading, rad or m.
    pub reading: f64,
    /// Step of the reading from the previous stop; `None` where the approach is not known.
    pub approach: Option<f64>,
    /// Moment of the unit weight about the axis for the four gravity levers, dimensionless.
    pub gravity: [f64; GRAVITY_TERMS as usize],
    /// Moment of the masses behind the joint about its axis over the largest that it can be, -1 to 1; 0 where masses are not known.
    pub moment: f64,
}

impl Term {
    /// Value of the basis function.
    pub fn basis(self, context: &TermContext) -> f64 {
        match self {
            Self::Offset => 1.0,
            Self::Gear => context.reading,
            Self::Cosine(k) => (f64::from(k) * context.reading).cos(),
            Self::Sine(k) => (f64::from(k) * context.reading).sin(),
            Self::Gravity(k) => context.gravity[usize::from(k)],
            Self::Sag => context.moment,
            Self::Backlash => context.approach.map_or(0.0, |step| (step / BACKLASH_STEP).tanh()),
            Self::Local(at) => {
                let distance = (context.reading - 1e-6 * f64::from(at)) / LOCAL_RANGE;
                (-0.5 * distance * distance).exp()
            }
        }
    }
}

impl JointTerm {
    /// Value of the basis function of a local error at a reading; `None` for other terms.
    pub fn local_basis(&self, reading: f64) -> Option<f64> {
        let context = TermContext { reading, approach: None, gravity: Default::default(), moment: 0.0 };
        matches!(self.term, Term::Local(_)).then(|| self.term.basis(&context))
    }
}

/// Two unit vectors that complete `axis` to a right-handed frame: the levers of the gravity terms.
pub(super) fn levers(axis: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let helper = if axis.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let u = (helper - axis * axis.dot(&helper)).normalize();
    [u, axis.cross(&u)]
}

/// A term of one joint with its parameter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct JointTerm {
    /// Index of the reading that it belongs to.
    pub reading: usize,
    /// Kind.
    pub term: Term,
    /// Parameter.
    pub value: f64,
}
