//! Which stop to add: the one that lowers the uncertainty of what is unknown most.
//!
//! Candidates take one joint of a stop that was visited to another value of its range. What a candidate is worth follows from
//! the covariance `C` of what the stops tell: a pose with Jacobian `J` and noise `R` takes `C J' (R + J C J')^-1 J C` off it.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::limits::Limits;
use super::statistics::extent;
use super::stops::{StopsKnowledge, Structural};
use crate::linalg::dense;
use crate::model::robot::{Posture, Robot};
use crate::problem::Layout;
use crate::urdf::JointKind;

/// Values of every joint that are tried.
const VALUES: usize = 13;

/// Stops of which one joint is changed.
const BASES: usize = 4;

/// Most proposals.
const MOST_NEXT: usize = 4;

/// A proposal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Advice {
    /// Joint to move.
    pub joint: String,
    /// Where to, rad or m.
    pub near: f64,
    /// Where it was, rad or m.
    pub covered: (f64, f64),
    /// Readings of the stops next to it, below and above, rad or m; none where it lies outside of what was covered.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap: Option<(f64, f64)>,
    /// Share of the variance in question that one such stop removes.
    pub gain: f64,
    /// In words.
    pub words: String,
}

struct Candidate {
    reading: usize,
    value: f64,
    /// `L^-1 J C` with `L L' = R + J C J'`, 6 x parameters: its columns' squares are what the stop takes off the variances.
    taken: DMatrix<f64>,
}

/// All candidates with what they would tell.
pub(super) struct Adviser<'a> {
    robot: &'a Robot,
    never: &'a Structural,
    covariance: DMatrix<f64>,
    /// Readings of the stops in ascending order, for every reading.
    visited: Vec<Vec<f64>>,
    candidates: Vec<Candidate>,
    limits: &'a Limits,
}

/// Some of the stops, with one joint taken to values all over its range.
fn candidates(robot: &Robot, layout: &Layout, stops: &[Posture], known: &StopsKnowledge) -> Vec<Candidate> {
    let ranges = robot.chain.ranges();
    let mut all = Vec::new();
    for base in stops.iter().step_by((stops.len() / BASES).max(1)).take(BASES) {
        for (reading, &(low, high)) in ranges.iter().enumerate() {
            let values = (0..VALUES).map(|k| low + (high - low) * k as f64 / (VALUES - 1) as f64);
            all.extend(values.filter_map(|value| candidate(robot, layout, base, (reading, value), known)));
        }
    }
    all
}

/// A stop with a joint taken to a value.
fn candidate(
    robot: &Robot,
    layout: &Layout,
    base: &Posture,
    (reading, value): (usize, f64),
    known: &StopsKnowledge,
) -> Option<Candidate> {
    let mut stop = Posture::at(&base.readings);
    stop.readings[reading] = value;
    let (j, noise) = known.measurement(robot, layout, &stop);
    let jc = &j * &known.covariance;
    let factor = (dense(&noise) + &jc * j.transpose()).cholesky()?;
    let taken = factor.l().solve_lower_triangular(&jc.columns(0, known.columns.len()).into_owned())?;
    Some(Candidate { reading, value, taken })
}

impl<'a> Adviser<'a> {
    pub fn new(
        robot: &'a Robot,
        layout: &Layout,
        stops: &[Posture],
        known: &StopsKnowledge,
        never: &'a Structural,
        limits: &'a Limits,
    ) -> Self {
        let readings = robot.chain.readings.len();
        let n = known.columns.len();
        let visited = |r: usize| {
            let mut all: Vec<f64> = stops.iter().map(|s| s.readings[r]).collect();
            all.sort_by(f64::total_cmp);
            all
        };
        Self {
            robot,
            never,
            covariance: known.covariance.view((0, 0), (n, n)).into_owned(),
            visited: (0..readings).map(visited).collect(),
            candidates: candidates(robot, layout, stops, known),
            limits,
        }
    }

    /// Mean gain of taking a joint to a value, best first. `direction` in units of the priors; none for all that can be told.
    fn ranked(&self, direction: Option<&DVector<f64>>) -> Vec<(usize, f64, f64)> {
        let gain: Box<dyn Fn(&Candidate) -> f64> = match direction.map(|v| self.never.removed_from(v)) {
            Some(v) => {
                let before = v.dot(&(&self.covariance * &v)).max(f64::MIN_POSITIVE);
                Box::new(move |c| (&c.taken * &v).norm_squared() / before)
            }
            None => {
                let u = &self.never.directions;
                let free = |m: &DMatrix<f64>| m - (m * u) * u.transpose();
                let before = free(&free(&self.covariance).transpose()).trace().max(f64::MIN_POSITIVE);
                Box::new(move |c| (&c.taken - (&c.taken * u) * u.transpose()).norm_squared() / before)
            }
        };
        let mut sums: Vec<(usize, f64, f64, f64)> = Vec::new();
        for c in &self.candidates {
            let own = gain(c);
            match sums.iter_mut().find(|s| s.0 == c.reading && s.1 == c.value) {
                Some(s) => {
                    s.2 += own;
                    s.3 += 1.0;
                }
                None => sums.push((c.reading, c.value, own, 1.0)),
            }
        }
        let mut means: Vec<(usize, f64, f64)> = sums.into_iter().map(|(r, v, sum, n)| (r, v, sum / n)).collect();
        means.sort_by(|a, b| b.2.total_cmp(&a.2));
        means
    }

    /// What to do about one direction.
    pub fn in_words(&self, direction: Option<&DVector<f64>>) -> String {
        match self.ranked(direction).first().filter(|(_, _, gain)| *gain > self.limits.advised_gain) {
            Some(&(reading, value, _)) => self.words(reading, value),
            None => "no single stop helps much: take more stops over the whole range of all joints".into(),
        }
    }

    /// What to measure next: the best value of each joint, best joint first.
    pub fn next(&self) -> Vec<Advice> {
        let mut next: Vec<Advice> = Vec::new();
        for (reading, value, gain) in self.ranked(None) {
            let joint = &self.robot.chain.readings[reading];
            if gain < self.limits.advised_gain || next.len() == MOST_NEXT {
                break;
            }
            if next.iter().all(|a| a.joint != *joint) {
                next.push(Advice {
                    joint: joint.clone(),
                    near: value,
                    covered: self.covered(reading),
                    gap: self.gap(reading, value),
                    gain,
                    words: self.words(reading, value),
                });
            }
        }
        next
    }

    fn covered(&self, reading: usize) -> (f64, f64) {
        extent(self.visited[reading].iter().copied())
    }

    /// The nearest readings of stops on both sides of a value between them.
    fn gap(&self, reading: usize, value: f64) -> Option<(f64, f64)> {
        let visited = &self.visited[reading];
        let above = visited.partition_point(|q| *q < value);
        let (below, above) = (*visited.get(above.checked_sub(1)?)?, *visited.get(above)?);
        (above > value).then_some((below, above))
    }

    fn words(&self, reading: usize, value: f64) -> String {
        let joint = &self.robot.chain.readings[reading];
        let (low, high) = self.covered(reading);
        let shown = |v: f64| match self.robot.chain.reading_kinds[reading] {
            JointKind::Prismatic => format!("{:.0} mm", 1e3 * v),
            _ => format!("{:.0} deg", v.to_degrees()),
        };
        if high - low < self.limits.stands_still {
            return format!(
                "move {joint}, which stands at {} in all stops: add stops with {joint} near {}",
                shown(low),
                shown(value)
            );
        }
        let so_far = match self.gap(reading, value) {
            Some((below, above)) => format!("so far none between {} and {}", shown(below), shown(above)),
            None => format!("so far {} to {}", shown(low), shown(high)),
        };
        format!("add stops with {joint} near {} ({so_far})", shown(value))
    }
}
