//! What a result is worth: hold-out, identifiability, points of another device.

mod hold_out;
mod points;
mod propagate;
mod statistics;
mod truth;

pub use hold_out::{Accuracy, Errors, ImageError, hold_out, predict_image};
pub use points::{ExpectedRms, MeasuredPoint, PointFit, fit_points};
pub use propagate::{PredictedPose, View, predict_pose};
pub use statistics::{Ratio, bootstrap_ratio, median, root_mean_square};
pub use truth::{camera_errors_m, flange_error_m};
