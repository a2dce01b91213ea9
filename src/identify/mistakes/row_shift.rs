//! Readings that stand beside the next image, or the one before, in a part of the rows: one of them was lost, or written twice.
//!
//! Rows are divided at a few places into those that are taken as they stand and those of the neighbour; the closed form of the division that comes
//! nearest goes by most images. The part is then the run of rows in which the readings of the neighbour fit better by most in sum.

use std::ops::Range;

use super::divided::ends_of_parts;
use super::readings::shifted_rows;
use super::suspects::{Suspects, some_of};
use crate::assess::best_run;
use crate::diagnose::{MistakeKind, ShiftedPart};
use crate::init::{PosePair, SeenStop, bases, solve_hand_eye};

impl Suspects<'_> {
    /// Shifts of a part of the rows by one, for either direction in which there is one, with the misfit that they leave.
    pub(super) fn partly_shifted(&self, misfit: f64) -> Vec<(f64, MistakeKind)> {
        // Where the bases of two arms were found by these readings, they stand elsewhere by others.
        if bases::found(self.robot).is_some() {
            return Vec::new();
        }
        let given = self.readings();
        let part_of = |(shifted, whole): (Vec<Vec<f64>>, MistakeKind)| {
            let MistakeKind::Rows { below, columns, .. } = whole else { return None };
            let rows = self.part(&shifted, below, misfit)?;
            let mut readings = given.clone();
            readings[rows.clone()].clone_from_slice(&shifted[rows.clone()]);
            let left = self.misfit(&readings);
            let is_explained = left < self.limits.mistake_explains * misfit;
            is_explained.then(|| (left, MistakeKind::Rows { below, columns, part: Some(self.named(rows, below)) }))
        };
        shifted_rows(&given).into_iter().filter_map(part_of).collect()
    }

    /// The rows whose images fit the readings of the neighbour, where others fit their own.
    fn part(&self, shifted: &[Vec<f64>], below: bool, misfit: f64) -> Option<Range<usize>> {
        let own: Vec<PosePair> = self.pairs.iter().map(|(_, pair)| *pair).collect();
        let of_neighbour = |((i, pair), readings): (&(usize, PosePair), &Vec<f64>)| {
            let (readings, mount) = (readings.clone(), self.problem.images[*i].mount);
            SeenStop { readings, mount, camera_from_plate: pair.camera_from_plate }.pair(self.robot)
        };
        let other: Vec<PosePair> = self.pairs.iter().zip(shifted).map(of_neighbour).collect();
        let n = own.len();
        let divided = |(at, [first, last]): (usize, [&[PosePair]; 2])| {
            let pairs: Vec<PosePair> = some_of(n).map(|k| if k < at { first[k] } else { last[k] }).collect();
            solve_hand_eye(&pairs).into_iter().next()
        };
        let divisions = ends_of_parts(n)
            .flat_map(|at| [(at, [own.as_slice(), other.as_slice()]), (at, [other.as_slice(), own.as_slice()])]);
        let solved = divisions.filter_map(divided).min_by(|a, b| a.median_error.total_cmp(&b.median_error))?;
        let most = self.limits.mistake_explains * misfit;
        let left =
            |pairs: &[PosePair]| -> Vec<f64> { pairs.iter().map(|p| solved.solution.misfit(p).min(most)).collect() };
        let (by_own, by_other) = (left(&own), left(&other));
        let gains: Vec<f64> = by_own.iter().zip(&by_other).map(|(own, other)| own - other).collect();
        let mut rows = best_run(&gains);
        let fits = rows.clone().filter(|k| by_other[*k] < most).count();
        // One that fits by chance, where the neighbour is that of the other end, is no sign of others.
        let at_the_end = if below { n - 1 } else { 0 };
        let as_usual = self.limits.set_aside_floor.min(most);
        let fits_as_it_stands =
            |k: usize| k != at_the_end && !rows.contains(&k) && by_own[k] < as_usual && gains[k] < 0.0;
        let is_part = (0..n).any(fits_as_it_stands);
        // The last row has none below it.
        if below && rows.end + 1 == n {
            rows.end = n;
        }
        (is_part && fits >= self.limits.moved_images && 2 * fits > rows.len()).then_some(rows)
    }

    fn named(&self, rows: Range<usize>, below: bool) -> ShiftedPart {
        let name = |k: usize| self.problem.images[self.pairs[k].0].name.clone();
        let n = self.pairs.len();
        // Of images without a partner at the end nothing is seen.
        let last_seen = if below { rows.end.min(n - 1) } else { rows.end };
        ShiftedPart {
            first: name(rows.start),
            last: name(last_seen.max(1) - 1),
            images: last_seen - rows.start,
            to_the_end: rows.end == n,
        }
    }
}
