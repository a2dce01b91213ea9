//! Starting values from nothing: homographies, focal length, poses, hand-camera and plate pose.

pub(crate) mod bases;
mod between;
mod focal;
mod hand_eye;
mod homography;
mod resection;
mod zeros;

pub use focal::{FocalCandidate, focal_candidates};
pub use hand_eye::{
    HandEye, HandEyeStart, PosePair, hand_eye_misfit, plate_scale, shah, solve_hand_eye, translations_by_rotations,
};
pub use homography::{Homography, PlanarPose};
pub use resection::{resect, resect_near};
pub use zeros::{SeenStop, Slope, Slopes, Zeros, solve_slopes, solve_zeros};
