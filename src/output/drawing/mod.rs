//! Pictures: plates for printing, and images with what was seen in them.
//!
//! `plate_drawing` says what is on a plate; `plate_pdf`, `plate_svg` and `plate_png` draw it. `overlay` marks an image on a `canvas`; letters in pictures
//! are those of `dot_font`.

mod canvas;
mod dot_font;
pub mod overlay;
pub mod plate_drawing;
mod plate_pdf;
mod plate_png;
mod plate_svg;
