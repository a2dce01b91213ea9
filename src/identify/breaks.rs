//! When no usual mistake explains why readings and images do not fit: a series that fits in two parts and not together, or a joint whose readings
//! stand still while the others move.
//!
//! Parts by rows `[0, k)` and `[k, n)`: where something changed at `t`, the closed forms of both parts go by the majority of their images, so that
//! a few `k` find it; `t` is then where fewest images miss the solution of their part.

use std::ops::Range;

use super::suspects::Suspects;
use crate::diagnose::{BodyMoved, Finding, agreement};
use crate::error::{Code, Error};
use crate::init::{HandEye, PosePair, SeenStop, solve_hand_eye};

/// Parts of a series at whose ends it is divided at first.
const PARTS: usize = 8;

/// Why images of one mounting and placement that miss by `misfit` do not fit.
pub(super) fn broken(suspects: &Suspects, misfit: f64, of: &str) -> Option<Error> {
    let pairs: Vec<PosePair> = suspects.pairs.iter().map(|(_, pair)| *pair).collect();
    let bound = suspects.limits.suspicious_misfit.min(suspects.limits.mistake_explains * misfit);
    let fewest = suspects.limits.hand_eye_images;
    let solved = |part: &[PosePair]| {
        let best = (part.len() >= fewest).then(|| solve_hand_eye(part)).and_then(|all| all.into_iter().next());
        best.filter(|start| start.median_error < bound).map(|start| start.solution)
    };
    let fits = |solution: &HandEye, pair: &PosePair| {
        let (angle, distance) = solution.error(pair);
        angle + distance < suspects.limits.mistake_explains * misfit
    };
    in_two_parts(&pairs, fewest, solved, fits)
        .map(|parts| parts.named(suspects).unwrap_or_else(|| parts.unnamed(of, misfit)))
        .or_else(|| stands_still(suspects, &pairs, solved))
}

/// A series that fits in two parts.
struct Parts {
    /// First of the second part.
    from: usize,
    all: usize,
    solutions: [HandEye; 2],
}

fn in_two_parts(
    pairs: &[PosePair],
    fewest: usize,
    solved: impl Fn(&[PosePair]) -> Option<HandEye>,
    fits: impl Fn(&HandEye, &PosePair) -> bool,
) -> Option<Parts> {
    let n = pairs.len();
    let divisions = (1..PARTS).map(|k| (k * n / PARTS).clamp(fewest, n.saturating_sub(fewest).max(fewest)));
    let parts = divisions.filter(|k| *k < n).filter_map(|k| Some([solved(&pairs[..k])?, solved(&pairs[k..])?]));
    let missing = |[first, second]: &[HandEye; 2], from: usize| {
        let before = pairs[..from].iter().filter(|pair| !fits(first, pair)).count();
        before + pairs[from..].iter().filter(|pair| !fits(second, pair)).count()
    };
    let best_from = |solutions: &[HandEye; 2]| (1..n).map(|from| (missing(solutions, from), from)).min();
    let (_, from, solutions) = parts
        .filter_map(|solutions| best_from(&solutions).map(|(missing, from)| (missing, from, solutions)))
        .min_by_key(|(missing, from, _)| (*missing, *from))?;
    Some(Parts { from, all: n, solutions })
}

impl Parts {
    /// What the smaller part agrees on, beside the larger one.
    fn named(&self, suspects: &Suspects) -> Option<Error> {
        let (first, second) = (0..self.from, self.from..self.all);
        let (others, smaller) =
            if first.len() > second.len() { (self.solutions[0], second) } else { (self.solutions[1], first) };
        let found = finding(suspects, &others, smaller.clone())?;
        (2 * found.images.len() > smaller.len()).then(|| Finding::from(found).refusal())
    }

    fn unnamed(&self, of: &str, misfit: f64) -> Error {
        let what = format!(
            "its first {} images fit by themselves, and so do the other {}; together they miss by {:.0} (median, mm plus mrad): something was changed between them",
            self.from,
            self.all - self.from,
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
    BodyMoved::of(suspects.problem, &images, found)
}

/// A joint that reads the same at many stops in a row, where the images of all others fit.
fn stands_still(
    suspects: &Suspects,
    pairs: &[PosePair],
    solved: impl Fn(&[PosePair]) -> Option<HandEye>,
) -> Option<Error> {
    let readings = suspects.readings();
    let joints = 0..suspects.robot.chain.readings.len();
    joints.filter(|_| suspects.robot.chain.pose_coordinates().is_none()).find_map(|joint| {
        let still = longest_run(&readings, joint);
        let others: Vec<PosePair> = [&pairs[..still.start], &pairs[still.end..]].concat();
        let found = finding(suspects, &solved(&others)?, still)?;
        Some(Finding::from(found).refusal())
    })
}

/// The longest run of stops at which a joint reads the same.
fn longest_run(readings: &[Vec<f64>], joint: usize) -> Range<usize> {
    let mut longest = 0..0;
    let mut from = 0;
    for k in 0..readings.len() {
        if readings[k][joint] != readings[from][joint] {
            from = k;
        }
        if k + 1 - from > longest.len() {
            longest = from..k + 1;
        }
    }
    longest
}

#[cfg(test)]
mod tests {
    use super::longest_run;

    #[test]
    fn the_longest_run_of_equal_readings_is_found() {
        let readings: Vec<Vec<f64>> = [1.0, 1.0, 2.0, 3.0, 3.0, 3.0, 1.0].map(|q| vec![0.0, q]).into();
        assert_eq!(longest_run(&readings, 1), 3..6);
        assert_eq!(longest_run(&readings, 0), 0..7);
        assert_eq!(longest_run(&[], 0), 0..0);
    }
}
