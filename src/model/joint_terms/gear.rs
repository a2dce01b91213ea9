//! Error of the gear ratio: `kappa q`.

use super::joint_error::{Exported, JointError, TermContext};
use super::robot_model::RobotModel;

/// The error.
pub(super) struct Gear;

impl JointError for Gear {
    type Index = ();

    const NAME: &'static str = "gear";
    const IS_RATIO: bool = true;
    const PRIOR_SIGMA: f64 = 5e-4;
    const TYPICAL: f64 = 3e-4;
    const MODEL: RobotModel = RobotModel::Gear;
    const SUMMAND: &'static str = "gear_scale q";

    fn indices(_harmonics: u8) -> Vec<Self::Index> {
        vec![()]
    }

    fn basis((): Self::Index, context: &TermContext) -> f64 {
        context.reading
    }

    fn exported((): Self::Index) -> Exported {
        Exported::Number("gear_scale")
    }
}
