//! Flags that several subcommands share, and what is read by them: cameras, robots, poses, joint vectors, recordings, what is estimated.

pub mod arguments;
pub mod camera_args;
pub mod choices;
pub mod joint_table;
pub mod pose_argument;
pub mod recording;
pub mod robot;
