//! Parameters to predictions and Jacobians: camera, robot, plate, and the chain that joins them.

pub mod camera;
pub mod circle;
pub mod inverse;
pub mod joint_terms;
pub mod mdh;
pub mod mirror;
pub mod mount;
pub mod one_direction;
pub mod plate_modes;
pub mod robot;
