//! What every page is made of: `frame` with style and script, `svg` to draw with, `figure` around a drawing, `figure_files` for the drawings as files.

pub(super) mod figure;
pub(super) mod figure_files;
pub(crate) mod frame;
pub(crate) mod svg;
