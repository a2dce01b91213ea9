//! The solver: block elimination, Levenberg-Marquardt, variance components, rejection.
//!
//! ```text
//! linear (residuals and derivatives at a state) -> elimination (the reduced normal equations) -> levenberg (step by step to the optimum)
//!     -> optimum (covariances, frames, tests) -> noise (sizes of noise, then back to levenberg) -> snoop (what contradicts is left out)
//! ```

mod elimination;
mod levenberg;
mod linear;
mod linearised_adjustment;
mod noise;
mod optimum;
mod side_by_side;
mod snoop;
mod status;

pub use elimination::parts::Parts;
pub use elimination::seen_markers::SeenMarkers;
pub use elimination::system::{Elimination, Singular, System};
pub use levenberg::{Ended, NoFit, Outcome, Settings, solve, solve_near};
pub use linear::{BodyPart, LinearImage, LinearProblem, LinearStop, Linearised};
pub use linearised_adjustment::LinearisedAdjustment;
pub use noise::acceleration::Acceleration;
pub use noise::components::{
    ComponentOptions, FEWEST_MARKER_COORDINATES, LEAST_FIRST_GUESS, estimate_components,
    estimate_components_from_above, estimate_components_judged, estimate_components_near,
};
pub use noise::information::{NoiseInformation, Spread, noise_information};
pub use noise::tally::{JOINT_NOISE_FLOOR, Tally, share_out};
pub use noise::uncertainty::NoiseUncertainty;
pub use noise::unidentified::without_unidentified_noise;
pub use optimum::covariance::Covariance;
pub use optimum::fit::Fit;
pub use optimum::frame::{Frame, PlateScale, Similarity, frames};
pub use optimum::in_frame::{InFrame, in_frame, in_frame_by};
pub use optimum::length_misfit::LengthMisfit;
pub use optimum::response::Response;
pub use optimum::stretch::{LengthStandard, Stretch};
pub use side_by_side::side_by_side;
pub use snoop::{reject_bodies, reject_contradicting, reject_contradictory, reject_observations, reject_stops};
pub use status::Status;
