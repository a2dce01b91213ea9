//! Series -> solution: `series -> observations -> free poses -> starting values -> joint fit -> assessment`.
//!
//! | in the order of the data | |
//! |---|---|
//! | `options`, `selection`, `estimator` | what is asked for |
//! | `observations` | a series as read -> as seen |
//! | `controller` | poses of a controller -> readings |
//! | `problem` | series -> the least-squares problem |
//! | `photogrammetry` | images alone -> cameras, plates, camera poses |
//! | `start` | camera poses, readings -> starting values of cameras and plates on the robot |
//! | `bodies` | what trackers and contacts measured -> starting values of instruments and bodies |
//! | `mistakes` | where no start fits: which usual mistake explains it |
//! | `joint_fit` | starting values -> the fit |
//! | `model_choice` | fits -> lens and robot model |
//! | `poses` | camera poses alone, as a result of their own |
//! | `two_stage` | the other estimators, beside the joint fit |
//! | `comparison`, `solution` | what all of this gives |
//!
//! [`identify`] in `run` strings these together. Beside them, `dry_run` looks at a series before its images are, and `verify` judges a robot model by a
//! series that it was not fitted to.

mod bodies;
mod comparison;
mod controller;
mod dry_run;
mod estimator;
mod in_words;
mod joint_fit;
mod mistakes;
mod model_choice;
mod observations;
mod options;
mod photogrammetry;
mod poses;
mod problem;
mod run;
mod selection;
mod solution;
mod start;
mod start_verdict;
mod two_stage;
mod verify;

pub use crate::model::joint_terms::RobotModel;
pub use bodies::touch_mistakes::{mirror_image, touch_mistake};
pub use comparison::{Comparison, ComparisonRow, HeldOut, TruthError};
pub use controller::readings::{postures_are_computed, readings_of};
pub use dry_run::dry_run;
pub use estimator::Estimator;
pub use model_choice::lens_choice::{choose_lens, depths_m};
pub use observations::bodies::NamedSeries;
pub use observations::detections::{
    SeenSeries, Unused, detect_images, detect_stops, flat_field_drift, pictures, require_some,
};
pub use observations::measure::{MeasuredWithNotices, image_size, measure, measure_bodies};
pub use observations::repeated::leave_out_repeated_bodies;
pub use observations::seen_image::SeenImage;
pub use observations::together::bring_together;
pub use options::{JointNoise, MarkerTolerance, Options};
pub use photogrammetry::camera_start::CameraStart;
pub use photogrammetry::free_poses::adjust_free_poses;
pub use poses::pose_comparison::{OtherBody, PoseComparison, PoseDifference, compare_poses};
pub use poses::stand_alone::{PoseSigma, StandAlone, stand_alone};
pub use problem::build::{build, stated_covariance};
pub use run::identify;
pub use selection::{Config, Parameters, Selection, StatedPrior};
pub use solution::{Evidence, LensEvidence, Solution};
pub use start_verdict::{StartReached, StartVerdict};
pub use two_stage::compare::{beside_two_stages, compare, truth_error};
pub use two_stage::fit::{Estimate, PoseStage, estimate_all, fit_joint, fit_poses, linear_step};
pub use verify::{JudgedByImages, JudgedImage, JudgedSeries, RobotOfOtherZeros, in_told_postures, verify_series};
