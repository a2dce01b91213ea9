//! The corrected robot as files for controllers and for programs.
//!
//! `corrected_robot` makes them all: the URDF itself, `controller_files` and `kinematics_file` (by `ur_frames`) for those who read no URDF, `mastering` what is
//! entered at the controller, `compensation` what no URDF can say; `compensation_read` reads that back.

mod compensation;
pub mod compensation_read;
pub mod controller_files;
pub mod corrected_robot;
pub mod kinematics_file;
pub mod mastering;
mod ur_frames;
