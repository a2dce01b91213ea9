//! What to print and where to look: the design of the plate, the choice of poses.

pub mod inverse;
pub mod plate_code;
pub mod plate_design;
pub mod viewpoint;
