//! Pictures: files to grey values, the flat field of a camera, and pictures in 8 bits for finding corners.

pub(super) mod bytes;
pub(super) mod flat_field;
pub(super) mod flat_field_facts;
pub(super) mod load;
pub(super) mod picture;
