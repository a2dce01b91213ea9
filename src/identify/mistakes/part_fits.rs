//! When no usual mistake explains why readings and images do not fit: a series of which a part fits by itself, or whose readings stand still.
//!
//! Parts by rows `[0, k)` and `[k, n)`: where something changed at `t`, the closed form of a part that holds more images of one side of `t` than of
//! the other goes by these, so that a few `k` find it; `t` is then where fewest images of that side miss it, and fewest of the other fit.

use std::collections::BTreeSet;
use std::ops::Range;

use super::divided::{divided, ends_of_parts};
use super::suspects::Suspects;
use crate::diagnose::{BodyMoved, Finding, agreement, all_stand_still, stands_still};
use crate::error::{Code, Error};
use crate::init::{HandEye, PosePair, SeenStop, solve_hand_eye};
use crate::problem::MeasuredSeries;

/// Why images of one mounting and placement that miss by `misfit` do not fit.
pub(in crate::identify) fn broken(suspects: &Suspects, misfit: f64, of: &str) -> Option<Error> {
    in_parts(suspects, misfit, of).or_else(|| not_read(suspects, misfit))
}

/// Images of which a part fits by itself, and the others agree on what is elsewhere, or fit by themselves, too.
pub(in crate::identify) fn in_parts(suspects: &Suspects, misfit: f64, of: &str) -> Option<Error> {
    let pairs: Vec<PosePair> = suspects.pairs.iter().map(|(_, pair)| *pair).collect();
    let left = suspects.limits.mistake_explains * misfit;
    let bound = suspects.limits.suspicious_misfit.min(left);
    let (n, fewest) = (pairs.len(), suspects.limits.hand_eye_images);
    let solved = |part: Range<usize>| {
        let best = (part.len() >= fewest).then(|| solve_hand_eye(&pairs[part])).and_then(|all| all.into_iter().next());
        best.filter(|start| start.median_error < bound).map(|start| start.solution)
    };
    let divisions = ends_of_parts(n).skip(1).map(|k| k.max(fewest).min(n.saturating_sub(fewest)));
    let parts = divisions.flat_map(|k| [(0..k, true), (k..n, false)]).filter_map(|(part, is_first)| {
        let solution = solved(part)?;
        let fits: Vec<bool> = pairs.iter().map(|pair| solution.misfit(pair) < left).collect();
        Some(Part::of(solution, &fits, is_first))
    });
    let part = parts.min_by_key(|part| (part.missed, part.others.len()));
    part.and_then(|part| {
        let both = || solved(part.others.clone()).map(|_| part.unnamed(of, n, misfit));
        part.named(suspects).or_else(both)
    })
}

/// Readings that stay the same for a while.
fn not_read(Suspects { problem, robot, series, pairs, limits, .. }: &Suspects, misfit: f64) -> Option<Error> {
    let shown: BTreeSet<usize> = pairs.iter().map(|(i, _)| problem.images[*i].series).collect();
    let own: Vec<&MeasuredSeries> = shown.into_iter().map(|k| &series[k]).collect();
    let few = limits.moved_images;
    let all = own.iter().find_map(|series| all_stand_still(series, few)).map(|still| ("joint readings", still));
    let names = robot.chain.readings.iter().map(String::as_str).enumerate();
    let mut of_one = names.flat_map(|(k, name)| own.iter().filter_map(move |s| Some((name, stands_still(s, k, few)?))));
    let (place, still) = all.or_else(|| of_one.next())?;
    let what = format!(
        "read {still}, though the robot moved, and do not fit the images (the camera poses miss by {:.0}, median, mm plus mrad)",
        1e3 * misfit
    );
    let remedy = "see whether the joints were read at these stops: correct their readings, or leave their rows out; if they were, check joint_unit, order and signs of the joints, the rows of the images and the URDF";
    Some(Error::new(Code::JointReadingsWrong, place, what, remedy))
}

/// A part of a series that fits by itself.
struct Part {
    solution: HandEye,
    /// The other images.
    others: Range<usize>,
    /// Images on the wrong side of the division.
    missed: usize,
}

impl Part {
    /// Divides where the solution of the first part, or the last, serves best.
    fn of(solution: HandEye, fits: &[bool], is_first: bool) -> Self {
        let (missed, at) = divided(fits, is_first);
        Self { solution, others: if is_first { at..fits.len() } else { 0..at }, missed }
    }

    /// What the others agree on, if most of them do.
    fn named(&self, suspects: &Suspects) -> Option<Error> {
        let found = finding(suspects, &self.solution, self.others.clone())?;
        (2 * found.images.len() > self.others.len()).then(|| Finding::from(found).refusal())
    }

    fn unnamed(&self, of: &str, all: usize, misfit: f64) -> Error {
        let what = format!(
            "{} of its images fit by themselves, and so do the other {}; together they miss by {:.0} (median, mm plus mrad): something was changed between them",
            all - self.others.len(),
            self.others.len(),
            1e3 * misfit
        );
        let remedy = "make two series of it, each with a mounting under [camera] and a placement of its own";
        Error::new(Code::SharedPoseDiffers, of, what, remedy)
    }
}

/// What some of the images agree on, beside the solution of the others.
fn finding(suspects: &Suspects, others: &HandEye, some: Range<usize>) -> Option<BodyMoved> {
    let (images, seen): (Vec<usize>, Vec<SeenStop>) = some
        .filter_map(|k| {
            let (i, pair) = &suspects.pairs[k];
            let readings = suspects.problem.posture(*i)?.readings.clone();
            let mount = suspects.problem.images[*i].mount;
            Some((*i, SeenStop { readings, mount, camera_from_plate: pair.camera_from_plate }))
        })
        .unzip();
    let found = agreement(suspects.robot, others, &seen, suspects.limits)?;
    BodyMoved::of(suspects.problem, &images, found, suspects.limits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Pose;

    #[test]
    fn a_series_is_divided_where_fewest_images_are_on_the_wrong_side() {
        let solution = HandEye { camera: Pose::identity(), plate: Pose::identity() };
        let fits = [true, true, false, true, true, false, false, true];
        let first = Part::of(solution, &fits, true);
        assert_eq!((first.others, first.missed), (5..8, 2));
        let fits = fits.map(|fits| !fits);
        let last = Part::of(solution, &fits, false);
        assert_eq!((last.others, last.missed), (0..5, 2));
    }
}
