//! Backlash: `b tanh(dq / 2 mrad)` of the step from the previous stop.

use super::joint_error::{Exported, JointError, TermContext};
use super::robot_model::RobotModel;

/// Step of a joint (rad or m) over which the term turns from one side to the other.
const STEP: f64 = 2e-3;

/// The error.
pub(super) struct Backlash;

impl JointError for Backlash {
    type Index = ();

    const NAME: &'static str = "backlash";
    const PRIOR_SIGMA: f64 = 0.3e-3;
    const TYPICAL: f64 = 0.1e-3;
    const MODEL: RobotModel = RobotModel::Full;
    const SUMMAND: &'static str = "backlash_rad tanh(step / 0.002)";
    const SYMBOLS: &'static [&'static str] = &["step from the previous stop in rad (m)."];

    fn indices(_harmonics: u8) -> Vec<Self::Index> {
        vec![()]
    }

    fn basis((): Self::Index, context: &TermContext) -> f64 {
        context.approach.map_or(0.0, |step| (step / STEP).tanh())
    }

    fn exported((): Self::Index) -> Exported {
        Exported::Number("backlash_rad")
    }
}
