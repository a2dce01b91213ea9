//! Free camera poses and readings -> where cameras and plates sit on the robot.
//!
//! `turns` first settles which way round a plate was seen; `robot` finds the starting values, and `zeros` those of the joints.

pub(super) mod robot;
pub(super) mod turns;
pub(super) mod zeros;
