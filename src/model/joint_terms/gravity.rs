//! Sag under gravity where the masses are not known: the moment about the axis of a unit weight on a unit lever.

use nalgebra::Vector3;

use super::joint_error::{Exported, GRAVITY_TERMS, JointError, TermContext};
use super::robot_model::RobotModel;
use crate::urdf::Chain;

/// Levers 0 and 1 are fixed in the joint's own link, 2 and 3 in the link after the next moving joint. Of a joint that others mimic, axis and
/// link are those of the last of them in the chain.
pub(super) struct Gravity;

impl JointError for Gravity {
    type Index = u8;

    const NAME: &'static str = "gravity";
    const PRIOR_SIGMA: f64 = 0.3e-3;
    const TYPICAL: f64 = 0.2e-3;
    const MODEL: RobotModel = RobotModel::Full;
    const MODEL_OF_ARM: RobotModel = RobotModel::Sag;
    const SUMMAND: &'static str = "sum_i gravity_i m_i(q)";
    const SYMBOLS: &'static [&'static str] = &[
        "gravity in rad (m for a prismatic joint).",
        "m_1, m_2: moment about the axis of a unit weight (along -z of the root) at unit levers u and axis x u of the joint's own link;",
        "m_3, m_4: the same about this axis for levers u' and axis' x u' of the link after the next moving joint.",
        "Of a joint that others mimic, axis and own link are those of the last of them from base to tip; the next joint moves behind that one.",
        "u is the unit vector along x (along y where |axis_x| >= 0.9) without its part along the axis.",
    ];

    fn indices(_harmonics: u8) -> Vec<Self::Index> {
        (0..GRAVITY_TERMS).collect()
    }

    fn is_drawn(chain: &Chain) -> bool {
        // Where masses are known their sag stands for it.
        chain.masses.is_empty()
    }

    fn exists(lever: u8) -> bool {
        lever < GRAVITY_TERMS
    }

    fn basis(lever: Self::Index, context: &TermContext) -> f64 {
        context.gravity[usize::from(lever)]
    }

    fn exported(lever: Self::Index) -> Exported {
        Exported::InList { key: "gravity", place: usize::from(lever), together: 1 }
    }
}

/// Two unit vectors that complete `axis` to a right-handed frame: the levers of the gravity terms.
pub(in crate::model) fn levers(axis: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let helper = if axis.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let u = (helper - axis * axis.dot(&helper)).normalize();
    [u, axis.cross(&u)]
}
