//! Pictures: files to grey values, the flat field of a camera, pictures in 8 bits for finding corners, and pixels that tell nothing.

pub(super) mod bytes;
pub(super) mod few_levels;
pub(super) mod flat_field;
pub(super) mod flat_field_facts;
pub(super) mod hot_pixels;
pub(super) mod load;
pub(super) mod loaded;
pub(super) mod picture;
