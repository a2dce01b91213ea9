//! What every kind of joint error has to say of itself.

use super::robot_model::RobotModel;
use crate::urdf::Chain;

/// Number of gravity basis functions of a joint.
pub const GRAVITY_TERMS: u8 = 4;

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

/// Where compensation.toml has the parameter of a term.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exported {
    /// Nowhere: it is folded into the URDF, or it is no property of the robot.
    Nowhere,
    /// Under a key of its own.
    Number(&'static str),
    /// In the list under a key, whose numbers come so many together.
    InList {
        /// The key.
        key: &'static str,
        /// Place in the list, from 0.
        place: usize,
        /// How many numbers belong together.
        together: usize,
    },
    /// Under a key of its own, over the largest moment of gravity about the axis, N m (N for a prismatic joint).
    PerMoment(&'static str),
}

/// What tells the terms of one kind apart, in names.
pub(super) trait Index: Copy {
    /// What follows the name of the kind.
    fn suffix(self) -> String;

    /// The index of a suffix.
    fn from_suffix(suffix: &str) -> Option<Self>;
}

/// There is only one.
impl Index for () {
    fn suffix(self) -> String {
        String::new()
    }

    fn from_suffix(suffix: &str) -> Option<Self> {
        suffix.is_empty().then_some(())
    }
}

/// A number.
impl Index for u8 {
    fn suffix(self) -> String {
        format!("_{self}")
    }

    fn from_suffix(suffix: &str) -> Option<Self> {
        suffix.strip_prefix('_')?.parse().ok()
    }
}

/// A kind of joint error, one file each.
pub(super) trait JointError {
    /// What tells terms of this kind apart.
    type Index: Index;

    /// Name in parameter blocks, before the index.
    const NAME: &'static str;

    /// Whether the parameter is a pure number; else it is in rad (m for a prismatic joint).
    const IS_RATIO: bool = false;

    /// Default prior sigma: rad, or the number; a tenth of it in m for a prismatic joint.
    const PRIOR_SIGMA: f64;

    /// Standard deviation in robots in use, as `simulate` draws it: unit as of the prior sigma.
    const TYPICAL: f64;

    /// What the term adds to the reading, by the symbols of compensation.toml; empty where that has nothing of it.
    const SUMMAND: &'static str;

    /// What these symbols mean, for the head of compensation.toml, line by line.
    const SYMBOLS: &'static [&'static str] = &[];

    /// The smallest robot model that has terms of this kind; those that contain it have them, too.
    const MODEL: RobotModel;

    /// The same for joints that carry the arm ([`Chain::carries_arm`]).
    const MODEL_OF_ARM: RobotModel = Self::MODEL;

    /// The terms that a joint gets in such a model, where gears have this many harmonics.
    fn indices(harmonics: u8) -> Vec<Self::Index>;

    /// False where a chain does not say what the basis function needs.
    fn applies(_chain: &Chain) -> bool {
        true
    }

    /// False where another term stands for the same in simulated robots of a chain.
    fn is_drawn(chain: &Chain) -> bool {
        Self::applies(chain)
    }

    /// False for an index that no term has.
    fn exists(_index: Self::Index) -> bool {
        true
    }

    /// Value of the basis function.
    fn basis(index: Self::Index, context: &TermContext) -> f64;

    /// Where compensation.toml has the parameter.
    fn exported(index: Self::Index) -> Exported;
}

impl Exported {
    /// The key in compensation.toml.
    pub fn key(self) -> Option<&'static str> {
        match self {
            Self::Nowhere => None,
            Self::Number(key) | Self::InList { key, .. } | Self::PerMoment(key) => Some(key),
        }
    }
}
