//! Joint fits -> the lens and the robot model that the data support.
//!
//! First `lens_choice`, with all terms of the robot; then `evidence` of the robot models; then `near_nominal`, where a fit extrapolates badly.

pub(super) mod evidence;
pub(super) mod lens_choice;
pub(super) mod near_nominal;
