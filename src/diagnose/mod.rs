//! What the data contradict: one file a check with what it finds, one row in [`CHECKS`].
//!
//! Most checks stand side by side here. `steps` looks for what stands elsewhere at some of the stops, `left_out` at what was left out of the fit.
//!
//! To add one: a file with a function of the stage at which it runs and a type that is a `Kind`; the type as a variant of
//! [`Finding`]; the function as a row of [`CHECKS`]. Numbers that decide stand in [`crate::assess::Limits`].
//!
//! Some kinds are found before there is a fit to check, or where a way is chosen, and have no row: [`Mistake`], [`ComputedPostures`],
//! [`ToolInPoses`] and [`LensNotInRos`] by `identify`, [`Mistake`] in touches of a tool by `frames` of the command line, too; [`Noticed`] is a
//! notice that was given on the way.

mod camera_model;
mod camera_pattern;
mod cameras_contradict;
mod checks;
mod computed_postures;
mod contradicted_distances;
mod extrapolates;
mod few_images;
mod finding;
mod focus;
mod given_camera;
mod heaps;
mod held_near_nominal;
mod held_parameters;
mod joint_noise;
mod kind;
mod left_out;
mod length_standard;
mod lens_not_in_ros;
mod lost_images;
mod marker_off;
mod measurement_scatter;
mod mirror_image;
mod mistake;
mod mistake_words;
mod no_gain;
mod noticed;
mod odd_image;
mod parameter_off;
mod plate_size;
mod rail;
mod reading_ratio;
mod repeated_measurements;
mod rounded_readings;
mod scatter;
mod slopes;
mod small_gain;
mod stands_still;
mod stated_noise;
mod steps;
mod tag_size;
mod tool_in_poses;
mod undetermined;
mod zeros_off;

pub use camera_model::CameraModelMisfit;
pub use camera_pattern::{ResidualPattern, residual_pattern};
pub use cameras_contradict::CamerasContradict;
pub use checks::{CHECKS, Check, Diagnosis, Stage, follows_from_tool};
pub use computed_postures::ComputedPostures;
pub use contradicted_distances::{ContradictedDistances, DistanceOff};
pub use extrapolates::Extrapolates;
pub use few_images::FewImages;
pub use finding::Finding;
pub use focus::FocusChange;
pub use given_camera::GivenCamera;
pub use held_near_nominal::HeldNearNominal;
pub use held_parameters::HeldContradicted;
pub use joint_noise::{ImageValue, JointNoiseLarge};
pub use kind::{CheckContext, Quantity, StatedNoise, Subject, Weight};
pub use left_out::agreement::agreement;
pub use left_out::exchanged_pictures::ExchangedPictures;
pub use left_out::exchanged_readings::ExchangedReadings;
pub use left_out::exchanged_targets::ExchangedTargets;
pub use left_out::left_out_bodies::MeasurementsLeftOut;
pub use left_out::left_out_images::ImagesLeftOut;
pub use left_out::left_out_observations::{ObservationsLeftOut, observations_left_out};
pub use left_out::many_left_out::{ManyLeftOut, many_left_out};
pub use left_out::moved::BodyMoved;
pub use left_out::shifted_measurements::ShiftedMeasurements;
pub use left_out::shifted_readings::ShiftedReadings;
pub use length_standard::{ContradictedLengths, PlateSays};
pub use lens_not_in_ros::LensNotInRos;
pub use lost_images::LostImages;
pub use marker_off::{FarMarker, MarkerOff, markers_off, named_markers_off};
pub use measurement_scatter::MeasurementsScatter;
pub use mirror_image::MirrorImageFits;
pub use mistake::{HALF_TURN_DEG, Mistake, MistakeKind, RowsOf, ShiftedPart};
pub use no_gain::NoGain;
pub use noticed::Noticed;
pub use odd_image::OddImage;
pub use parameter_off::ParameterOff;
pub use plate_size::{DoubtedSize, InOrder, SizeDifference, ToldBy, sizes_by_robot, uneven_plates};
pub use reading_ratio::ReadingRatio;
pub use repeated_measurements::RepeatedMeasurements;
pub use rounded_readings::ReadingsRounded;
pub use scatter::LargeScatter;
pub use small_gain::SmallGain;
pub use stands_still::{StandsStill, all_stand_still, stands_still};
pub use stated_noise::NoiseContradicted;
pub use steps::displaced::{Carried, Displaced, Displacement};
pub use steps::images_shifted::ImagesShifted;
pub use steps::loose_mounting::LooseMounting;
pub use steps::place_misstated::PlaceMisstated;
pub use steps::zero_moved::ZeroMoved;
pub use tag_size::{TagsOff, tags_off};
pub use tool_in_poses::{PosesOf, ToolInPoses};
pub use undetermined::FlangeUndetermined;
pub use zeros_off::{ZeroOff, zeros_off};
