//! Pixels to identified observations; knows no robot.

mod detection;
mod picture;

pub use detection::{Detection, Dropped};
pub use picture::Picture;
