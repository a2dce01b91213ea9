//! What an instrument saw stands in the rows of a neighbour, in a part of the rows: one was lost there, or written twice.
//!
//! Rows are divided at many places into those that are taken as they stand and those of the neighbour. Of points the linear least squares of a division
//! tell which come nearest, and the robust start of these is taken; of poses, whose closed forms go by samples, few divisions do. The part is then the
//! run of rows in which the readings of the neighbour fit better by most in sum.

use std::ops::Range;

use rayon::prelude::*;

use super::placed::{SeenFrom, missed, pairs, placed, points};
use super::points_start::{MANY_POINTS, Placed, roughly};
use super::rows_of::rows_of_bodies;
use crate::assess::{Limits, best_run};
use crate::diagnose::{Finding, Mistake, MistakeKind, ShiftedPart};
use crate::error::Result;
use crate::identify::mistakes::suspects::ENOUGH;
use crate::linalg::lower_median;
use crate::problem::{Adjustment, MeasuredSeries, Problem, stop_name};
use crate::series::spread;

/// Of all divisions, those whose robust start is taken.
const TAKEN: usize = 4;

/// Rounds of a start from the rows as they are read, and of the part by that start.
const ROUNDS: usize = 3;

/// Refuses measurements of which a part fits the readings of the neighbouring row, and the others fit their own: where the start of all is of no
/// majority, or too many rows would be left out.
///
/// # Errors
/// The rows, from the first to the last stop.
pub(super) fn name_part(
    adjustment: &Adjustment,
    series: &[MeasuredSeries],
    (measured, start): (&[usize], &Placed),
    limits: &Limits,
) -> Result<()> {
    let Adjustment { problem, state } = adjustment;
    let tip = |stop: usize| Some(state.robot.base_from_tip(&problem.stops[stop].posture.as_ref()?.readings));
    let of = |&k: &usize| {
        let measured = &problem.body_measurements[k];
        Some((k, (measured.seen, tip(measured.stop)?)))
    };
    let (rows, own): (Vec<usize>, Vec<SeenFrom>) = measured.iter().filter_map(of).unzip();
    let misfits: Vec<f64> = own.iter().map(|seen| missed(seen, start)).collect();
    let bound = limits.suspicious_misfit;
    let far = misfits.iter().filter(|misfit| **misfit > bound).count();
    let is_by_tracker = rows.first().is_some_and(|k| problem.is_by_tracker(&problem.body_measurements[*k]));
    if !is_by_tracker || far < limits.moved_images || state.robot.chain.pose_coordinates().is_some() {
        return Ok(());
    }
    let read = |(stops, below): (Vec<Option<usize>>, bool)| {
        let other: Vec<Option<SeenFrom>> =
            own.iter().zip(&stops).map(|((seen, _), stop)| Some((*seen, tip((*stop)?)?))).collect();
        let found = Read { own: &own, other: &other }.part(&misfits, limits)?;
        Some((found, below))
    };
    let tried = neighbours(problem, &rows).into_iter().filter_map(read);
    let Some((part, below)) = tried.min_by(|a, b| a.0.missed.cmp(&b.0.missed)) else { return Ok(()) };
    let others = |k: &usize| !part.rows.contains(k);
    let of_others = lower_median((0..own.len()).filter(others).map(|k| misfits[k]));
    if part.others_missed as f64 <= limits.share_of_images_left_out * own.len() as f64 && of_others < bound {
        // They are left out like single rows, and named by the fit.
        return Ok(());
    }
    let mistake = Mistake {
        kind: MistakeKind::Rows { below, columns: Vec::new(), part: Some(shifted(problem, series, &rows, &part.rows)) },
        of: problem.instruments[problem.body_measurements[rows[0]].instrument].place(),
        misfit: lower_median(misfits),
        misfit_undone: Some(part.misfit),
        by_images: false,
        rows_of: rows_of_bodies(adjustment, measured, limits),
    };
    Err(Finding::from(mistake).refusal())
}

/// The part of the rows, by the names of its stops.
fn shifted(problem: &Problem, series: &[MeasuredSeries], rows: &[usize], part: &Range<usize>) -> ShiftedPart {
    let name = |k: usize| stop_name(series, problem.body_measurements[rows[k]].read);
    ShiftedPart {
        first: name(part.start),
        last: name(part.end - 1),
        images: part.len(),
        to_the_end: part.end == rows.len(),
    }
}

/// For each row the stop of the next one, or the one before, in its series: of all stops, and of those that were measured.
fn neighbours(problem: &Problem, rows: &[usize]) -> Vec<(Vec<Option<usize>>, bool)> {
    let own: Vec<usize> = rows.iter().map(|k| problem.body_measurements[*k].stop).collect();
    let orders = problem.orders_of_rows(&own);
    let shifts = orders.iter().flat_map(|order| [true, false].map(|below| (order, below)));
    shifts
        .map(|(order, below)| (own.iter().map(|stop| problem.neighbour(order, *stop, below)).collect(), below))
        .collect()
}

/// What was seen with the readings of its own row, and with those of a neighbour where there is one.
struct Read<'a> {
    own: &'a [SeenFrom],
    other: &'a [Option<SeenFrom>],
}

/// Rows that fit the readings of the neighbour.
struct Part {
    rows: Range<usize>,
    /// Rows that miss, read so.
    missed: usize,
    /// Of those in the part, rows that do not fit as they stand.
    others_missed: usize,
    /// Median misfit, read so.
    misfit: f64,
}

impl Read<'_> {
    /// Some of the rows, those of a part with the readings of the neighbour.
    fn taken(&self, part: &Range<usize>, some: usize) -> Vec<SeenFrom> {
        let of = |k: usize| if part.contains(&k) { self.other[k] } else { Some(self.own[k]) };
        spread(self.own.len(), some).filter_map(of).collect()
    }

    /// By how much every row misses as it stands, and as the neighbour is read, up to a bound.
    fn missed(&self, placed: &Placed, most: f64) -> [Vec<f64>; 2] {
        let own = self.own.iter().map(|seen| missed(seen, placed).min(most)).collect();
        let other = self.other.iter().map(|seen| seen.map_or(most, |seen| missed(&seen, placed).min(most))).collect();
        [own, other]
    }

    /// The best run of rows, and what is left, up to a bound, with the neighbour read there.
    fn run(&self, placed: &Placed, most: f64) -> (Range<usize>, f64) {
        let [own, other] = self.missed(placed, most);
        let gains: Vec<f64> = own.iter().zip(&other).map(|(own, other)| own - other).collect();
        let rows = best_run(&gains);
        let left = own.iter().sum::<f64>() - gains[rows.clone()].iter().sum::<f64>();
        (rows, left)
    }

    /// Divisions from which a start is taken.
    fn divisions(&self, most: f64) -> Vec<Range<usize>> {
        let n = self.own.len();
        if !pairs(self.own).is_empty() {
            return vec![0..0, 0..n / 2, n / 2..n];
        }
        let mut ends: Vec<usize> = (0..=MANY_POINTS).map(|k| k * n / MANY_POINTS).collect();
        ends.dedup();
        let parts = ends.iter().flat_map(|from| ends.iter().map(move |to| *from..*to)).filter(|part| !part.is_empty());
        let left = |part: Range<usize>| {
            let placed = roughly(&points(&self.taken(&part, ENOUGH)))?;
            Some((self.run(&placed, most).1, part))
        };
        let parts: Vec<Range<usize>> = parts.collect();
        let mut all: Vec<(f64, Range<usize>)> = parts.into_par_iter().filter_map(left).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        all.into_iter().take(TAKEN).map(|(_, part)| part).collect()
    }

    /// The part, where most rows fit by it, those outside as they stand.
    fn part(&self, misfits: &[f64], limits: &Limits) -> Option<Part> {
        let bound = limits.suspicious_misfit;
        let most = f64::max(bound, limits.mistake_explains * lower_median(misfits.iter().copied()));
        let refined = |division: Range<usize>| {
            let mut rows = division;
            let mut found = None;
            for _ in 0..ROUNDS {
                let taken = self.taken(&rows, ENOUGH);
                // Parts of these were tried before.
                let by = placed(&taken, f64::INFINITY)?;
                if lower_median(taken.iter().map(|seen| missed(seen, &by))) > bound {
                    return None;
                }
                rows = self.run(&by, bound).0;
                found = Some(by);
            }
            found.and_then(|by| self.judged(rows, &by, limits))
        };
        self.divisions(most).into_par_iter().filter_map(refined).min_by_key(|part| part.missed)
    }

    /// A run, where it is a part that explains what the rows miss.
    fn judged(&self, mut rows: Range<usize>, placed: &Placed, limits: &Limits) -> Option<Part> {
        let (n, bound) = (self.own.len(), limits.suspicious_misfit);
        let [own, other] = self.missed(placed, f64::INFINITY);
        let fits = |k: &usize| other[*k] < bound;
        let in_part = rows.clone().filter(fits).count();
        let others_missed = rows.clone().filter(|k| fits(k) && own[*k] > bound).count();
        let outside = (0..n).filter(|k| !rows.contains(k));
        let as_they_stand = outside.clone().filter(|k| own[*k] < bound && other[*k] > bound).count();
        let fitting = in_part + outside.filter(|k| own[*k] < bound).count();
        // Of the row at the end the neighbour was lost.
        let is_alone = |k: usize| k < n && self.other[k].is_none() && own[k] > bound;
        if is_alone(rows.end) {
            rows.end += 1;
        }
        if rows.start == 1 && is_alone(0) {
            rows.start = 0;
        }
        let explains = (n - fitting) as f64 <= limits.share_of_images_left_out * n as f64;
        let is_part = others_missed >= limits.moved_images && as_they_stand >= limits.moved_images;
        let read = |k: usize| if rows.contains(&k) { other[k] } else { own[k] };
        let misfit = lower_median((0..n).map(read));
        (explains && is_part && 2 * in_part > rows.len()).then_some(Part {
            missed: n - fitting,
            others_missed,
            misfit,
            rows,
        })
    }
}
