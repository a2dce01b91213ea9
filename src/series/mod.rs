//! A measurement series: manifest, joint readings, plate, and images or observations.
//!
//! A new source of recordings is one file here that returns a [`Series`], and one row in `read`.

mod inputs;
mod joints;
mod manifest;
mod mcap;
mod observation;
mod observation_file;
mod plate;
mod plate_file;
mod plate_kind;
mod plate_turns;
mod read;
mod recorded;
mod table;
mod tag_plates;
mod tags;
mod units;
mod without_robot;

pub use inputs::InputFile;
pub use joints::{DEFAULT_PLACEMENT, Stop, Stops};
pub(crate) use manifest::read_toml;
pub use manifest::{
    AngleUnit, CameraMount, CameraSection, CirclePoint, Manifest, ObservationsSection, RobotSection, StopOrder,
};
pub use mcap::{CameraInfo, Clock, Delay, Extracted, Motion, Picking, RecordingOptions, StopReport, extract};
#[cfg(feature = "mcap")]
pub use mcap::{FramePoses, ImageMarks, MarkKind, MarkLayer, Shown, require_new, write_recording};
pub use observation::{Edge, ImageObservations, Observation};
pub use observation_file::{observations_csv, parse_observations};
pub use plate::{Aruco, Marker, Plate, ScaleBar};
pub use plate_file::{DEFAULT_TOLERANCE_M, parse_plate, plate_csv, plate_toml, read_plate};
pub use plate_kind::{Ink, Places, PlateKind, Print};
pub use plate_turns::PlateTurn;
pub use read::{Series, Source, read, read_images};
pub use recorded::convert_recording;
pub use tag_plates::regions;
pub use tags::{Region, TagPrint, Tags};
pub use without_robot::{read_without_robot, series_of_images};
