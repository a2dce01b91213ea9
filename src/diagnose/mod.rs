//! What the data contradict: one file a check with what it finds, one row in [`CHECKS`].
//!
//! To add one: a file with a function of the stage at which it runs and a type that is a `Kind`; the type as a variant of
//! [`Finding`]; the function as a row of [`CHECKS`]. Numbers that decide stand in [`crate::assess::Limits`].

mod camera_model;
mod camera_pattern;
mod checks;
mod computed_postures;
mod displaced;
mod exchanged_readings;
mod extrapolates;
mod few_images;
mod finding;
mod focus;
mod held_near_nominal;
mod joint_noise;
mod kind;
mod left_out_bodies;
mod left_out_images;
mod left_out_observations;
mod length_standard;
mod lens_not_in_ros;
mod loose;
mod marker_off;
mod measurement_scatter;
mod mistake;
mod moved;
mod no_gain;
mod noticed;
mod parameter_off;
mod plate_size;
mod pose_step;
mod scatter;
mod stated_noise;
mod undetermined;
mod zeros_off;

pub use camera_model::CameraModelMisfit;
pub use camera_pattern::{ResidualPattern, residual_pattern};
pub use checks::{CHECKS, Check, Diagnosis, Stage};
pub use computed_postures::ComputedPostures;
pub use displaced::{Carried, Displaced, Displacement};
pub use exchanged_readings::ExchangedReadings;
pub use extrapolates::Extrapolates;
pub use few_images::FewImages;
pub use finding::Finding;
pub use focus::FocusChange;
pub use held_near_nominal::HeldNearNominal;
pub use joint_noise::{ImageValue, JointNoiseLarge};
pub use kind::{CheckContext, Quantity, StatedNoise, Subject, Weight};
pub use left_out_bodies::MeasurementsLeftOut;
pub use left_out_images::ImagesLeftOut;
pub use left_out_observations::ObservationsLeftOut;
pub use length_standard::ContradictedLengths;
pub use lens_not_in_ros::LensNotInRos;
pub use loose::LooseMounting;
pub use marker_off::MarkerOff;
pub use measurement_scatter::MeasurementsScatter;
pub use mistake::{Mistake, MistakeKind};
pub use moved::{BodyMoved, MovedBody};
pub use no_gain::NoGain;
pub use noticed::Noticed;
pub use parameter_off::ParameterOff;
pub use plate_size::DoubtedSize;
pub use scatter::LargeScatter;
pub use stated_noise::NoiseContradicted;
pub use undetermined::FlangeUndetermined;
pub use zeros_off::ZeroOff;
