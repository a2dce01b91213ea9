//! Subcommands that need no robot: `plate` draws what is photographed, `detect` says what is seen of it in the images, `poses` what they tell together.
//!
//! `plate_board` draws boards of other kinds, `image_study` studies the image stage, `against` compares poses with those of another source.

mod against;
pub mod detect;
mod image_study;
pub mod plate;
mod plate_board;
pub mod poses;
