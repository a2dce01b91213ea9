//! Free camera poses and readings -> where cameras and plates sit on the robot.
//!
//! `turns` first settles which way round a plate was seen; `robot` finds the starting values, for two arms with how their `bases` stand to each other.

pub(super) mod bases;
pub(super) mod robot;
pub(super) mod turns;
