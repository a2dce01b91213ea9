//! Sag under gravity where the masses are known: the moment about the axis, over the largest that it can be
//! ([`crate::urdf::Chain::largest_moment`]). The parameter is the sag at that moment.

use super::joint_error::{Exported, JointError, TermContext};
use super::robot_model::RobotModel;
use crate::urdf::Chain;

/// The error.
pub(super) struct Sag;

impl JointError for Sag {
    type Index = ();

    const NAME: &'static str = "sag";
    const PRIOR_SIGMA: f64 = 1e-3;
    const TYPICAL: f64 = 0.2e-3;
    const MODEL: RobotModel = RobotModel::Sag;
    const SUMMAND: &'static str = "compliance_rad_per_nm T(q)";
    const SYMBOLS: &'static [&'static str] = &[
        "T: moment of gravity about the axis, N m (force along it, N, for a prismatic joint), of the masses in the URDF and the [payload]",
        "(centre in the frame of the tip link).",
    ];

    fn indices(_harmonics: u8) -> Vec<Self::Index> {
        vec![()]
    }

    fn applies(chain: &Chain) -> bool {
        !chain.masses.is_empty()
    }

    fn basis((): Self::Index, context: &TermContext) -> f64 {
        context.moment
    }

    fn exported((): Self::Index) -> Exported {
        Exported::PerMoment("compliance_rad_per_nm")
    }
}
