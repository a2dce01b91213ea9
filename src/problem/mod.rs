//! The least-squares problem: what is unknown, what was measured, what is known beforehand.
//!
//! [`Problem`] holds the data and never changes during a solve; [`State`] holds every unknown; [`Adjustment`] is both; [`Layout`] is the one place
//! that turns a name into a column. The unit of residual evaluation is one image ([`linearise`]).

mod adjustment;
mod approach;
mod body;
mod body_chain;
mod bounds;
mod condensed;
mod different;
mod equations;
mod exposures;
mod family;
mod given;
mod image;
mod layout;
mod length;
mod linearise;
mod measured;
mod measured_series;
mod neighbours;
mod noise;
mod plate_distance;
mod plate_shape;
mod postures;
mod rejection;
mod restraint;
mod rounding;
mod select;
mod shared;
mod some_stops;
mod state;
mod step;
mod stop;

pub use crate::model::plate_modes::SCALE;
pub use adjustment::Adjustment;
pub use approach::{postures_of_run, postures_of_stops, runs};
pub use body::{BodyMeasurement, BodyRejection, BodySeen, BodyTerms, Instrument, InstrumentKind, places_body};
pub use bounds::Bounds;
pub use condensed::{SeenAtStop, by_columns, condensed};
pub use different::different_readings;
pub use equations::{E, Equations, MarkerTerms, Sight};
pub use exposures::Exposures;
pub use family::{Family, FamilyKind};
pub use given::{HUBER, Problem, TakenBodies};
pub use image::Image;
pub use layout::{Column, Layout, Names, OriginPrior};
pub use length::{Length, LengthEnds, MeasuredLength};
pub use linearise::{
    Chained, ImageTerms, Residual, Weighting, equations, linearise, linearise_pose, linearise_with_equations, predict,
};
pub use measured::{Mark, MarkerObservation};
pub use measured_series::{
    KnownCamera, LensChoice, MeasuredSeries, MeasuredStop, SeenBody, SeenLength, intern, stop_name,
};
pub use noise::Noise;
pub use plate_distance::{
    PlateDistance, UNKNOWN_SCALE, release_measured_scales, seen_markers, size_by_distance, telling_markers,
};
pub use plate_shape::PlateShape;
pub use postures::{JOINTS_IN_COMMON, joined, posture_groups, related_readings};
pub use rejection::{FitsReadings, ImageRejection, Misfit, Mismatch, ObservationRejection};
pub use restraint::{JointPrior, Restraint};
pub use rounding::Rounding;
pub use select::{names, short_name};
pub use shared::Shared;
pub use state::State;
pub use step::Step;
pub use stop::{DISPLACEMENT_SIZES, SIZE_OF_DISPLACEMENT, Stop, TakenFrom, Tie};
