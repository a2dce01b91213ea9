//! What images tell, as files: detections, cameras, plates, poses and residuals.
//!
//! `detection_files` holds what was seen before there is a fit; `camera_file`, `plate_files`, `pose_files` and `observation_table` what a fit made of it, with
//! or without a robot; `poses_record` the whole result without one; `recording` marks on the images of a recording.

pub mod camera_file;
pub mod detection_files;
pub mod observation_table;
pub mod plate_files;
pub mod pose_files;
pub mod poses_record;
#[cfg(feature = "mcap")]
pub mod recording;
