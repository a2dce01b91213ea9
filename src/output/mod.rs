//! Solution -> bytes.

pub mod plate_drawing;
mod plate_pdf;
mod plate_png;
mod plate_svg;
