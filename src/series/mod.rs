//! A measurement series: manifest, joint readings, plate, and images or observations.
//!
//! A new format of recordings is one file in `recording/` that makes a stream of messages of it, and its arms in `recording/file.rs` and
//! `recording/recording_files.rs`.

mod camera_section;
mod contact_file;
mod controller_file;
mod controller_poses;
mod image_file;
mod image_folder;
mod inputs;
mod joint_names;
mod joints;
mod light;
mod manifest;
mod measurement_series;
mod named_poses;
mod observation;
mod observation_file;
mod plate;
mod plate_file;
mod plate_kind;
mod plate_turns;
mod point_file;
mod pose_file;
mod puzzle;
mod quaternion;
mod read;
mod recorded;
mod recording;
mod rotation_kind;
mod run;
mod sections;
mod spatial;
mod spread;
mod spreadsheet;
mod stop_index;
mod table;
mod tag_plates;
mod tags;
mod toml_file;
mod units;
mod views;
mod without_robot;

pub use camera_section::{CameraMount, CameraSection, Cameras};
pub use contact_file::ContactRow;
pub use controller_file::parse_controller;
pub use controller_poses::{ControllerPoses, ReadOtherwise};
pub use image_folder::is_image;
pub use inputs::{InputFile, sha256};
pub(crate) use joint_names::{StatedUnit, remedy_of_names};
pub use joints::{Covariates, DEFAULT_PLACEMENT, SeriesStop, StopKey, Stops};
pub use manifest::{AngleUnit, CirclePoint, Manifest, ObservationsSection, RobotSection, StopOrder};
pub use measurement_series::{Series, Source};
pub use named_poses::{NamedPoses, read_named_poses};
pub use observation::{Edge, ImageObservations, Observation};
pub use observation_file::{observations_csv, parse_observations};
pub use plate::{Aruco, Marker, Plate, ScaleBar};
pub use plate_file::{parse_plate, plate_csv, plate_files, plate_toml, read_plate};
pub use plate_kind::{Ink, Places, PlateKind, Print, Turns};
pub use plate_turns::PlateTurn;
pub use point_file::PointRow;
pub use pose_file::PoseRow;
pub use puzzle::{Next, Puzzle};
pub use read::{read, read_images};
pub use recorded::convert_recording;
pub use recording::{
    CameraInfo, Clock, Delay, Extracted, Motion, Picking, RecordingOptions, StopReport, extract, is_recording,
};
#[cfg(feature = "mcap")]
pub use recording::{
    FramePoses, ImageMarks, MarkKind, MarkLayer, RecordingContent, Written, require_new, write_recording,
};
pub use rotation_kind::RotationKind;
pub use run::Run;
pub use sections::{
    ContactSection, ControllerSection, DistanceSection, PlateMountSection, SecondRobotSection, TrackerSection,
};
pub use spatial::SpatialFiles;
pub use spread::spread;
pub(crate) use table::{Row, Table, csv_line, to_csv};
pub use tag_plates::regions;
pub use tags::{Region, TagPrint, Tags, dictionary_named};
pub(crate) use toml_file::read_toml;
pub use units::{JointsBeside, LENGTH_UNITS, LengthUnit, check_unit};
pub use without_robot::{read_without_robot, series_of_images};
