//! The solver: block elimination, Levenberg-Marquardt, variance components, rejection.

mod acceleration;
mod blocks;
mod body_components;
mod by_markers;
mod by_stops;
mod components;
mod covariance;
mod distances;
mod fit;
mod frame;
mod in_frame;
mod levenberg;
mod linear;
mod linearised_adjustment;
mod noise_information;
mod noise_uncertainty;
mod pose_space;
mod response;
mod snoop;
mod stretch;
mod system;
mod unidentified_noise;

pub use acceleration::Acceleration;
pub use blocks::SeenMarkers;
pub use components::{
    ComponentOptions, JOINT_NOISE_FLOOR, LEAST_FIRST_GUESS, Tally, estimate_components, estimate_components_from_above,
    share_out,
};
pub use covariance::Covariance;
pub use fit::Fit;
pub use frame::{Frame, PlateScale, Similarity, frames};
pub use in_frame::{InFrame, in_frame, in_frame_by};
pub use levenberg::{NoFit, Outcome, Settings, Status, converged, solve};
pub use linear::{BodyPart, LinearImage, LinearProblem, LinearStop, Linearised};
pub use linearised_adjustment::LinearisedAdjustment;
pub use noise_information::{NoiseInformation, Spread, noise_information};
pub use noise_uncertainty::NoiseUncertainty;
pub use response::Response;
pub use snoop::{reject_bodies, reject_contradicting, reject_observations, reject_stops};
pub use stretch::{LengthStandard, Stretch};
pub use system::{Elimination, Singular, System};
pub use unidentified_noise::without_unidentified_noise;
