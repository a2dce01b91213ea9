//! What to print and where to look: the design of the plate, the choice of poses.
//!
//! Poses: [`setting`] (what is roughly known) -> [`candidates`] (workable poses, with [`scene`] and [`visibility`]) ->
//! [`information`] -> [`relax`] (optimal weights with certificate), [`refine`] (further poses where they pay) -> [`rounding`] -> [`order`].

pub mod candidates;
mod choose;
pub mod criterion;
mod forecast;
pub mod information;
pub mod order;
mod places;
pub mod plate_code;
pub mod plate_design;
pub mod refine;
pub mod relax;
pub mod rounding;
pub mod scene;
pub mod setting;
pub mod viewpoint;
pub mod visibility;

pub use choose::{Budget, Choice, Demand, Plan, PlanRequest, choose, plan};
pub use forecast::{
    CurvePoint, Forecast, Gain, JointRange, ParameterForecast, check_demand, exact_covariance, flange_m, forecast,
    image_name,
};
pub use information::share_left;
pub use places::{PlaceForecast, compare_places, place_words};
