//! What the joint is off by near one reading to which it came back for several stops: whatever it is, it does not change while the joint
//! stands still, and is nearly the same when it comes back.

use super::joint_error::{Exported, Index, JointError, TermContext};
use super::robot_model::RobotModel;

/// Range of readings (rad or m, one sigma) over which the local error of a joint is the same.
pub const LOCAL_RANGE: f64 = 3e-3;

/// Ranges beyond which a local error is less than the smallest number.
const BEYOND: f64 = 39.0;

/// The reading of a local error, in urad or um: in names in rad or m.
impl Index for i32 {
    fn suffix(self) -> String {
        format!("_{:.4}", 1e-6 * f64::from(self))
    }

    fn from_suffix(suffix: &str) -> Option<Self> {
        suffix.strip_prefix('_')?.parse().ok().map(micro)
    }
}

/// A reading in urad or um.
pub(super) fn micro(reading: f64) -> i32 {
    (1e6 * reading).round() as i32
}

/// A local error; its prior is a variance component, which the data decide.
pub(super) struct Local;

impl JointError for Local {
    type Index = i32;

    const NAME: &'static str = "local";
    const PRIOR_SIGMA: f64 = 3e-3;
    const TYPICAL: f64 = 0.0;
    const MODEL: RobotModel = RobotModel::Rigid;
    const SUMMAND: &'static str = "";

    fn indices(_harmonics: u8) -> Vec<Self::Index> {
        // They come from the stops, not from the chain.
        Vec::new()
    }

    fn basis(at: Self::Index, context: &TermContext) -> f64 {
        let distance = (context.reading - 1e-6 * f64::from(at)) / LOCAL_RANGE;
        if distance.abs() > BEYOND { 0.0 } else { (-0.5 * distance * distance).exp() }
    }

    fn exported(_at: Self::Index) -> Exported {
        // Noise near readings of one series, no property of the robot.
        Exported::Nowhere
    }
}
