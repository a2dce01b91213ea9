//! How far a result can be trusted: hold-out, identifiability, points of another device.

mod advice;
mod alone;
mod clustered;
mod expected_errors;
mod flange;
mod held;
mod hold_out;
mod hold_out_bodies;
mod identifiability;
mod in_base;
mod limits;
mod limits_read;
mod mean_square;
mod near_nominal;
mod pattern_effect;
mod patterns;
mod points;
mod points_apart;
mod points_mistaken;
mod points_size;
mod points_tell;
mod projection;
mod promise;
mod propagate;
mod repeating;
mod statistics;
mod stops;
mod truth;
mod uncertainty;
mod used_stops;
mod usual_errors;

pub use advice::Advice;
pub use alone::urdf_alone;
pub use clustered::{Clustered, RootInformation, StopInformation, clustered_covariance};
pub use expected_errors::expected_mm;
pub use flange::{FlangeModel, PredictedFlange, WorkspacePoint, within_joint_limits};
pub use held::{HeldTest, contradicted};
pub use hold_out::{
    Accuracy, Errors, ImageError, Refit, cluster_of_images, error_of_predicted, folds, hold_out, hold_out_images,
    predict_image, refitted, refitted_near, regions, seen_pose,
};
pub use hold_out_bodies::hold_out_bodies;
pub use identifiability::{
    Cause, Correlation, Identifiability, Observability, UnknownDirection, identifiability, identifiability_of_stops,
};
pub use in_base::sigma_in_base;
pub use limits::Limits;
pub use near_nominal::{extrapolation_m, restraint};
pub use pattern_effect::PatternEffect;
pub use patterns::{Bearer, Pattern, PatternTest, camera_shows_pattern, cause, patterns};
pub use points::{Derivatives, ExpectedRms, ExpectedSquares, MeasuredPoint, PointFit, fit_points, freedom};
pub use points_apart::{DeviceMoved, MARKERS_DRAWN_ALONG, OddPoints, StepCause, device_moved, farthest, odd_points};
pub use points_mistaken::{ReadingMistake, reading_mistake};
pub use points_size::{SizeOfPoints, size_of_points};
pub use points_tell::LeftOpen;
pub use projection::ProjectionMap;
pub use promise::{FlangeErrors, FlangeIntervals, NoiseAtStop, by_readings, scatter_m, usual_joint_sigma};
pub use propagate::{PredictedPose, View, predict_pose};
pub use repeating::stops_for_one;
pub use statistics::{
    Ratio, best_run, bootstrap_ratio, by_cluster, log_chance, most_of_sum, root_mean_square, root_of_mean,
};
pub use stops::{Structural, ideal_stops, minimal_set, structural};
pub use truth::{camera_errors_m, flange_error_m};
pub use uncertainty::{NORMAL_95, Uncertainty, judge};
pub use used_stops::{Standing, still, stops};
