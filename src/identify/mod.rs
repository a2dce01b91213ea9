//! Series -> solution: `series -> observations -> free poses -> starting values -> joint fit -> assessment`.

mod build;
mod compare;
mod dry_run;
mod evidence;
mod free_poses;
mod in_words;
mod joint;
mod lens_choice;
mod local_errors;
mod look;
mod measure;
mod second_pass;
mod selection;
mod solution;
mod staged;
mod start;
mod suspects;
mod two_stage;
mod verify;

pub use crate::model::joint_terms::RobotModel;
pub use build::build;
pub use compare::{Comparison, ComparisonRow, HeldOut, TruthError, beside_two_stages, compare, truth_error};
pub use dry_run::dry_run;
pub use evidence::{Evidence, identify};
pub use free_poses::adjust_free_poses;
pub use joint::{JointNoise, MarkerTolerance, Options};
pub use lens_choice::{LensEvidence, choose_lens, depths_m};
pub use look::{SeenImage, look, look_at, pictures, require_some};
pub use measure::{Measured, measure};
pub use selection::{Config, Parameters, Selection, StatedPrior};
pub use solution::{Solution, StartVerdict};
pub use two_stage::{Estimate, Estimator, PoseStage, estimate_all, fit_joint, fit_poses, linear_step};
pub use verify::{JudgedImage, verify_series};
