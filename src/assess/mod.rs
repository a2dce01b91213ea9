//! What a result is worth: hold-out, identifiability, points of another device.

mod hold_out;
mod points;
mod propagate;

pub use hold_out::{Accuracy, Errors, hold_out};
pub use points::{MeasuredPoint, PointFit, fit_points};
pub use propagate::{PredictedPose, View, predict_pose};
