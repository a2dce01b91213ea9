//! Recordings of rosbag2, in MCAP or sqlite: joint states and images become stops of a series.
//!
//! The robot moves, stands, moves: standstills are found from the joints, and one picture is taken of each. Two passes
//! over the file, in constant memory: the first reads joints and stamps, the second the pictures that were chosen. Between them,
//! pictures about motions tell how late they are.
//! Nothing of ROS is needed.

mod cdr;
mod collect;
#[cfg(feature = "mcap")]
mod decodable;
mod delay;
mod extract;
mod file;
mod frame;
mod image_frames;
#[cfg(feature = "mcap")]
mod interfaces;
mod kind;
mod lateness;
mod message;
mod messages;
mod motion;
mod moving;
mod options;
mod order;
mod pixels;
mod recording_files;
#[cfg(feature = "mcap")]
mod records;
mod samples;
mod scan;
mod silence;
mod sqlite;
mod two_publishers;
mod unit;
#[cfg(feature = "mcap")]
mod write;

pub use collect::StopReport;
pub use delay::Delay;
pub use extract::{Extracted, extract};
pub(super) use file::require_recording;
pub use messages::CameraInfo;
pub use options::{Clock, Motion, Picking, RecordingOptions};
pub use recording_files::is_recording;
pub(super) use recording_files::written_in;
#[cfg(feature = "mcap")]
pub use write::{FramePoses, ImageMarks, MarkKind, MarkLayer, RecordingContent, Written, require_new, write_recording};
