//! Which posture every pose of a controller means, by what was seen at its stop: images, and bodies on the tip.
//!
//! A pose is reached in up to eight postures. The nominal robot is at the same place in all of them, the real one is not: with the derivatives
//! `G_ic` of the camera pose, or of a body as a tracker sees it, at posture `c` of stop `i`, and `e_i` from the nominal one to that which was seen, wanted
//! are the parameters `x` and the choice with the least
//!
//! ```text
//! sum_i min_c (e_i - G_ic x)' V_ic^-1 (e_i - G_ic x) + x' P^-1 x
//! ```
//!
//! `x` is fitted to a choice and the choice made by `x` in turns (S. Lloyd 1957), from the postures nearest to those before, from random ones, and
//! from those of a beam search (B. Lowerre 1976) that takes stop after stop in, forwards and backwards; then every stop takes the posture that all
//! others predict best, in turns. Where the axes of a wrist meet, all stops with the wrist turned over are a robot as likely as the first: the
//! images do not tell which.

use std::borrow::Cow;
use std::collections::BTreeSet;

use rayon::prelude::*;

use super::choice::{Before, Stop, Stops};
use super::compared::{Compared, SeenAt};
use crate::assess::Limits;
use crate::diagnose::ComputedPostures;
use crate::error::Result;
use crate::model::robot::Robot;
use crate::problem::{Adjustment, MeasuredSeries, Problem};

/// The series with the postures that images and bodies tell; unchanged where readings were read. `hold` holds the columns that are not to be fitted.
pub(in crate::identify) fn told_by_seen<'a>(
    robot: &Robot,
    (series, from): (&'a [MeasuredSeries], Before),
    limits: &Limits,
    hold: impl FnOnce(&mut Adjustment) -> Result<()>,
) -> (Cow<'a, [MeasuredSeries]>, Option<ChosenPostures>) {
    let found = Compared::with("postures", robot, (series, limits), hold, |compared| {
        let of = |seen: &SeenAt| stop(compared, series, seen);
        let (rows, all): (Vec<_>, Vec<_>) = compared.stops.par_iter().filter_map(of).unzip();
        let stops = Stops { all, prior: compared.prior.clone() };
        let chosen = (!rows.is_empty()).then(|| stops.chosen(from, limits))??;
        Some((rows, stops, chosen))
    });
    let Some((rows, stops, chosen)) = found else { return (Cow::Borrowed(series), None) };
    let mut told = series.to_vec();
    let mut changed = 0;
    let chosen_of = stops.all.iter().zip(&chosen.postures).zip(&rows);
    for ((stop, &c), rows) in chosen_of.filter(|((_, c), _)| **c > 0) {
        for &(s, row) in rows {
            let MeasuredSeries { stops, postures, .. } = &mut told[s];
            let before = stops[row].readings.replace(stop.candidates[c].readings.clone());
            if let Some((other, before)) = postures.get_mut(row).and_then(|own| own.get_mut(c - 1)).zip(before) {
                *other = before;
            }
        }
        changed += 1;
    }
    let count = rows.iter().filter(|rows| series[rows[0].0].readings_are_computed()).count();
    (
        Cow::Owned(told),
        Some(ChosenPostures { stops: count, changed, is_open: chosen.is_open, undecided: chosen.undecided }),
    )
}

/// What was told of the postures.
#[derive(Debug, Clone, Copy)]
pub(in crate::identify) struct ChosenPostures {
    /// Stops whose poses were read.
    pub stops: usize,
    /// Stops that are in another posture now.
    pub changed: usize,
    /// Whether other choices at many stops together are as good.
    pub is_open: bool,
    /// Stops that fit as well in another posture, the others as they are.
    pub undecided: usize,
}

impl ChosenPostures {
    /// What is to be said where the series were `given` and are `told` now.
    pub fn finding(&self, given: &[MeasuredSeries], told: &[MeasuredSeries]) -> ComputedPostures {
        // Cameras at the same stops say it once.
        let mut stops: BTreeSet<(&str, usize)> = BTreeSet::new();
        let mut others: Vec<String> = Vec::new();
        for (given, told) in given.iter().zip(told) {
            let run = given.run.as_deref().unwrap_or(&given.name);
            let turned = given.stops.iter().zip(&told.stops).filter(|(g, t)| g.readings != t.readings);
            others.extend(turned.filter(|(g, _)| stops.insert((run, g.row))).map(|(g, _)| g.image.clone()));
        }
        let series = given.iter().filter(|s| s.readings_are_computed()).map(|s| s.name.clone()).collect();
        ComputedPostures { series, stops: self.stops, others, is_open: self.is_open, undecided: self.undecided }
    }
}

/// What was seen at one stop says of its postures, with its series and rows.
fn stop(compared: &Compared, series: &[MeasuredSeries], seen: &SeenAt) -> Option<(Vec<(usize, usize)>, Stop)> {
    let Adjustment { problem, state } = &compared.adjustment;
    let rows = rows_of(problem, series, seen);
    let &(s, row) =
        rows.iter().find(|(s, row)| series[*s].postures.get(*row).is_some_and(|p| !p.is_empty())).or(rows.first())?;
    let own = series[s].stops[row].readings.clone()?;
    let others = series[s].postures.get(row).cloned().unwrap_or_default();
    let origins = state.robot.linear_origins();
    let of = |readings: Vec<f64>| compared.candidate((state, &origins), seen, readings);
    let candidates = std::iter::once(own).chain(others).map(of).collect::<Option<Vec<_>>>()?;
    Some((rows, Stop::of(candidates)))
}

/// Series and row of a stop, for every camera of its run.
fn rows_of(problem: &Problem, series: &[MeasuredSeries], seen: &SeenAt) -> Vec<(usize, usize)> {
    let of_image = |i: &usize| {
        let image = &problem.images[*i];
        Some((image.series, series[image.series].stops.iter().position(|s| s.image == image.name)?))
    };
    let of_body = |k: &usize| Some(problem.body_measurements[*k].read);
    let first = seen.images.iter().find_map(of_image).or_else(|| seen.bodies.iter().find_map(of_body));
    let Some((s, row)) = first else { return Vec::new() };
    let run = |s: usize| series[s].run.as_deref().unwrap_or(&series[s].name);
    let place = series[s].stops[row].row;
    let own = (0..series.len()).filter(|&other| run(other) == run(s));
    own.filter_map(|k| Some((k, series[k].stops.iter().position(|stop| stop.row == place)?))).collect()
}
