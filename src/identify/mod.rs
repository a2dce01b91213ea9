//! The modes of the program: short lists of stages over the same chain.
//!
//! `series -> observations -> free poses -> starting values -> joint fit -> assessment`. A new mode is a file here.

mod build;
mod compare;
mod dry_run;
mod evidence;
mod focus;
mod forecast;
mod free_poses;
mod gates;
mod joint;
mod lens_choice;
mod local_errors;
mod look;
mod loose;
mod measure;
mod monte_carlo;
mod moved;
mod places;
mod plan;
mod plan_study;
mod plate_size;
mod second_pass;
mod selection;
mod shift;
mod simulated;
mod solution;
mod staged;
mod start;
mod study;
mod suspects;
mod two_stage;
mod verify;
mod worth;

pub use build::{MeasuredSeries, MeasuredStop};
pub use compare::{Comparison, ComparisonRow, HeldOut, TruthError, beside_two_stages, compare};
pub use dry_run::dry_run;
pub use evidence::{Evidence, identify};
pub use forecast::{
    CurvePoint, Forecast, Gain, JointRange, ParameterForecast, check_wish, exact_covariance, flange_m, forecast,
    image_name,
};
pub use free_poses::{FreePose, FreePoses, PlacedCamera, adjust_free_poses};
pub use joint::{JointNoise, MarkerTolerance, Options, RobotModel};
pub use lens_choice::{LensChoice, LensEvidence, choose_lens, depths_m};
pub use look::{SeenImage, look, look_at, pictures, require_some};
pub use measure::{Measured, measure};
pub use monte_carlo::{
    BLOCKS, BlockResult, ErrorWithCovariance, MonteCarloCell, MonteCarloRequest, flange_error, monte_carlo,
};
pub use places::{PlaceForecast, compare_places, place_words};
pub use plan::{Budget, Choice, Plan, PlanRequest, Wish, choose, plan};
pub use plan_study::{PlanStudy, PlanStudyRequest, PlanStudyRow, plan_study};
pub use selection::{Config, Parameters, Selection, StatedPrior};
pub use simulated::measured;
pub use solution::{Solution, StartVerdict};
pub use study::{Study, StudyCell, StudyRequest, study};
pub use two_stage::{Estimate, Estimator, PoseStage, estimate_all, fit_joint, fit_poses, linear_step};
pub use verify::{JudgedImage, verify_series};
pub use worth::{Worth, still, stops};
