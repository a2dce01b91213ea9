//! Parameters to predictions and Jacobians: camera, robot, plate, and the chain that joins them.

pub mod camera;
pub mod circle;
