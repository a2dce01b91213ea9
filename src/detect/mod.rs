//! Pixels to identified observations; knows no robot.

pub mod circles;
mod picture;

pub use picture::Picture;
