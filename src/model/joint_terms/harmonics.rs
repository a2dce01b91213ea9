//! Harmonics of a gear: `a cos kq + b sin kq` of the reading.

use super::joint_error::{Exported, JointError, TermContext};
use super::robot_model::RobotModel;

/// Harmonics of a gear unless asked for otherwise.
pub const USUAL_HARMONICS: u8 = 2;

/// The cosine of harmonic k, from 1; or its sine.
pub(super) struct Harmonic<const IS_SINE: bool>;

/// The cosine of harmonic k, from 1.
pub(super) type Cosine = Harmonic<false>;
/// The sine of harmonic k, from 1.
pub(super) type Sine = Harmonic<true>;

impl<const IS_SINE: bool> JointError for Harmonic<IS_SINE> {
    type Index = u8;

    const NAME: &'static str = if IS_SINE { "sin" } else { "cos" };
    const PRIOR_SIGMA: f64 = 0.1e-3;
    const TYPICAL: f64 = 0.1e-3;
    const MODEL: RobotModel = RobotModel::Gear;
    const SUMMAND: &'static str = "sum_k [a_k cos kq + b_k sin kq]";
    const SYMBOLS: &'static [&'static str] = &["harmonics = [a1, b1, a2, b2, ..] in rad (m for a prismatic joint)."];

    fn indices(harmonics: u8) -> Vec<u8> {
        (1..=harmonics).collect()
    }

    fn exists(k: u8) -> bool {
        k > 0
    }

    fn basis(k: u8, context: &TermContext) -> f64 {
        let (sin, cos) = (f64::from(k) * context.reading).sin_cos();
        if IS_SINE { sin } else { cos }
    }

    fn exported(k: u8) -> Exported {
        let place = 2 * usize::from(k.saturating_sub(1)) + usize::from(IS_SINE);
        Exported::InList { key: "harmonics", place, together: 2 }
    }
}
