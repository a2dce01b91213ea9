//! Harmonics of a gear: `a cos kq + b sin kq` of the reading.

use super::joint_error::{Exported, JointError, TermContext};
use super::robot_model::RobotModel;

/// Harmonics of a gear unless asked for otherwise.
pub const USUAL_HARMONICS: u8 = 2;

/// Key in compensation.toml: `[a1, b1, a2, b2, ..]`.
const KEY: &str = "harmonics";

/// Prior sigma of an amplitude, rad.
const SIGMA: f64 = 0.1e-3;

/// The cosine of harmonic k, from 1.
pub(super) struct Cosine;

impl JointError for Cosine {
    type Index = u8;

    const NAME: &'static str = "cos";
    const PRIOR_SIGMA: f64 = SIGMA;
    const MODEL: RobotModel = RobotModel::Gear;

    fn indices(harmonics: u8) -> Vec<Self::Index> {
        (1..=harmonics).collect()
    }

    fn exists(k: u8) -> bool {
        k > 0
    }

    fn basis(k: Self::Index, context: &TermContext) -> f64 {
        (f64::from(k) * context.reading).cos()
    }

    fn exported(k: Self::Index) -> Exported {
        Exported::InList(KEY, 2 * usize::from(k.saturating_sub(1)))
    }
}

/// The sine of harmonic k, from 1.
pub(super) struct Sine;

impl JointError for Sine {
    type Index = u8;

    const NAME: &'static str = "sin";
    const PRIOR_SIGMA: f64 = SIGMA;
    const MODEL: RobotModel = RobotModel::Gear;

    fn indices(harmonics: u8) -> Vec<Self::Index> {
        (1..=harmonics).collect()
    }

    fn exists(k: u8) -> bool {
        k > 0
    }

    fn basis(k: Self::Index, context: &TermContext) -> f64 {
        (f64::from(k) * context.reading).sin()
    }

    fn exported(k: Self::Index) -> Exported {
        Exported::InList(KEY, 2 * usize::from(k.saturating_sub(1)) + 1)
    }
}
