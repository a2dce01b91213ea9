//! Constant offset of the zero position.

use super::joint_error::{Exported, JointError, TermContext};
use super::robot_model::RobotModel;

/// The error.
pub(super) struct Offset;

impl JointError for Offset {
    type Index = ();

    const NAME: &'static str = "offset";
    const PRIOR_SIGMA: f64 = 10e-3;
    const TYPICAL: f64 = 3e-3;
    const MODEL: RobotModel = RobotModel::Rigid;
    const SUMMAND: &'static str = "";

    fn indices(_harmonics: u8) -> Vec<Self::Index> {
        vec![()]
    }

    fn basis((): Self::Index, _context: &TermContext) -> f64 {
        1.0
    }

    fn exported((): Self::Index) -> Exported {
        // Folded into the origins.
        Exported::Nowhere
    }
}
