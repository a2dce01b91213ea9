//! Uncertainty of the tip in the base frame itself: what a corrected program keeps while nobody measured base and tool.
//!
//! Images tell the flange relative to the plate; where base and tool frame stand against it is known by the priors of the origins
//! only. With `J(q)` the derivative of the body twist of the tip and `C` the covariance of all columns, `J(q) C J(q)'` holds both.

use nalgebra::{DMatrix, Matrix6};

use crate::geom::{Pose, adjoint};
use crate::model::robot::{Posture, Robot};
use crate::problem::Layout;

/// Root of the summed variances of the three axes of a point of the tip in the base frame, m.
///
/// `covariance` is that of the columns of `layout`; `tip_from_tool` is where the point stands on the tip.
pub fn sigma_in_base(
    robot: &Robot,
    layout: &Layout,
    covariance: &DMatrix<f64>,
    readings: &[f64],
    tip_from_tool: &Pose,
) -> f64 {
    let kinematics = robot.kinematics_at(&Posture::at(readings));
    let to_tool = adjoint(&tip_from_tool.inverse());
    let mut j = DMatrix::zeros(6, layout.theta_len());
    for (k, d) in kinematics.d_twists.iter().enumerate() {
        j.fixed_view_mut::<6, 6>(0, layout.twists.start + 6 * k).copy_from(&(to_tool * d));
    }
    // Local errors are noise near single readings, not properties of the robot.
    for (k, d) in kinematics.d_terms.iter().enumerate().take(layout.locals.start - layout.terms.start) {
        j.fixed_view_mut::<6, 1>(0, layout.terms.start + k).copy_from(&(to_tool * d));
    }
    let n = j.ncols();
    let c = &j * covariance.view((0, 0), (n, n)) * j.transpose();
    let c: Matrix6<f64> = c.fixed_view::<6, 6>(0, 0).into_owned();
    (0..3).map(|k| c[(k, k)]).sum::<f64>().max(0.0).sqrt()
}
