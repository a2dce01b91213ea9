//! Poses that a controller states, in place of joint readings.
//!
//! `readings`: a pose to readings, by the nominal robot; `computed_postures`: which of the postures of a pose it was, by the images; `told`:
//! how poses that are not reached are to be read, by what was seen; `tool`: whether the poses are those of the flange in the base at all.

pub(super) mod choice;
mod compared;
pub(super) mod computed_postures;
pub(super) mod readings;
pub(super) mod told;
pub(super) mod tool;
