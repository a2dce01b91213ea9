//! Rotations and rigid motions in closed form.
//!
//! Poses are named `a_from_b`: they map coordinates in frame b to coordinates in frame a.
//! Perturbations are body-fixed (right) 6-vectors, translation first: `T * Exp([rho, phi])`.

mod distance;
mod homography;
mod pose;
mod rigid;
mod rotation;

pub use distance::{OrientedBox, segment_distance_m};
pub use homography::PlaneMap;
pub use pose::{Pose, adjoint, right_jacobian_se3};
pub use rigid::rigid_fit;
pub use rotation::{exp_so3, log_so3, matrix_from_rpy, project_to_so3, right_jacobian_so3, rpy_from_matrix, skew};
