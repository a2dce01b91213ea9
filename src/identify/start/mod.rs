//! Free camera poses and readings -> where cameras and plates sit on the robot.
//!
//! `turns` first settles which way round a plate was seen; `robot` finds the starting values.

pub(super) mod robot;
pub(super) mod turns;
