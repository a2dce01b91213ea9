//! Pixels to identified observations; knows no robot.

mod picture;

pub use picture::Picture;
