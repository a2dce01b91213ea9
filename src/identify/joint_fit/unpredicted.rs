//! Why no image could be held out.

use crate::assess::{Limits, folds};
use crate::error::{Code, Error};
use crate::identify::options::JointNoise;
use crate::problem::Problem;

/// Too few images; or enough, but fits without some of them cannot predict these.
pub(in crate::identify) fn nothing_held_out(
    place: &str,
    problem: &Problem,
    limits: &Limits,
    noise: JointNoise,
) -> Error {
    let (what, remedy) = match (folds(problem, limits), noise) {
        (None, _) => ("too few images to hold any out", "take more images"),
        (Some(_), JointNoise::Known(_)) => (
            "fits without some of the images do not predict these at all: the readings do not err as little as was stated",
            "leave out --joint-noise: it is estimated then",
        ),
        (Some(_), JointNoise::Estimated) => (
            "fits without some of the images do not predict these at all",
            "look at the per-image table for images that do not belong, and take stops that move every joint",
        ),
    };
    Error::new(Code::NothingHeldOut, place, what, remedy)
}
