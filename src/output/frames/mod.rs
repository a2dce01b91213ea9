//! Tool and work object that were found by touches.
//!
//! `frame_findings` says what is wrong with them, `frames_record` keeps them (frames.json), `frame_files` writes them for controllers, and `work_findings`
//! judges a work object when a program is corrected by it.

pub mod frame_files;
pub mod frame_findings;
pub mod frames_record;
pub mod work_findings;
