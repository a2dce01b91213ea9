//! Numerical inverse kinematics: damped Newton steps with the analytic Jacobian, inside the joint limits.
//!
//! From starts all over the joint ranges the iteration ends in every configuration of the arm (elbow, wrist flips, the
//! redundant axis of a seven-axis arm); none is preferred.

use std::f64::consts::TAU;

use nalgebra::{Matrix6, Vector6};
use rand::{Rng, RngExt};

use crate::geom::Pose;
use crate::model::robot::{Posture, Robot};
use crate::urdf::{Chain, JointKind, SEARCHED_M};

/// Newton steps before a start is given up.
const STEPS: usize = 40;
/// Longest step, rad or m per reading.
const LONGEST_STEP: f64 = 0.5;
/// Error of a solution, m and rad.
const TOLERANCE: f64 = 1e-9;

/// Random starts from which all postures of a pose are looked for; those of a six-axis arm are found several times by then.
pub const POSTURE_STARTS: usize = 200;
/// Readings that differ by less are the same, rad or m.
pub const SAME_READING: f64 = 1e-3;
/// Angles that are stated for a posture are nearer than this to it, rad: another posture is farther.
pub const FARTHEST_STATED_RAD: f64 = 0.5;

/// Whether readings that a full turn parts are of two postures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FullTurns {
    /// They are.
    Apart,
    /// They are not.
    Alike,
}

impl FullTurns {
    /// Whether two sets of readings are of two postures.
    fn apart(self, a: &[f64], b: &[f64], kinds: &[JointKind]) -> bool {
        let off = |((a, b), kind): ((&f64, &f64), &JointKind)| match (self, kind) {
            (Self::Alike, JointKind::Revolute | JointKind::Fixed) => (a - b - TAU * ((a - b) / TAU).round()).abs(),
            _ => (a - b).abs(),
        };
        a.iter().zip(b).zip(kinds).map(off).any(|off| off > SAME_READING)
    }

    /// Adds a posture to others, unless it is one of them.
    pub fn add(self, found: Vec<f64>, all: &mut Vec<Vec<f64>>, kinds: &[JointKind]) {
        if all.iter().all(|other| self.apart(&found, other, kinds)) {
            all.push(found);
        }
    }
}

/// An angle by full turns as near to another one as the limits allow, rad; `beyond`: by how many turns more or less it may be where the nearest
/// lies outside, in this order.
pub fn turned(angle: f64, near: f64, (low, high): (f64, f64), beyond: &[f64]) -> f64 {
    let nearest = angle + TAU * ((near - angle) / TAU).round();
    let beside = beyond.iter().map(|turns| nearest + TAU * turns);
    std::iter::once(nearest).chain(beside).find(|v| (low..=high).contains(v)).unwrap_or(angle)
}

/// Lower and upper limit of every reading within which a posture is looked for, rad or m.
pub fn reading_limits(chain: &Chain) -> Vec<(f64, f64)> {
    chain.limits_or(SEARCHED_M)
}

/// Readings drawn evenly from the joint ranges; from the inner full turn where a joint has more.
pub fn random_readings(limits: &[(f64, f64)], kinds: &[JointKind], rng: &mut impl Rng) -> Vec<f64> {
    let draw = |(limits, kind): (&(f64, f64), &JointKind)| {
        let (low, high) = kind.inner_turn(*limits);
        if high > low { rng.random_range(low..high) } else { low }
    };
    limits.iter().zip(kinds).map(draw).collect()
}

/// A robot that is to bring its tip somewhere, and what its joints may do.
#[derive(Debug, Clone, Copy)]
pub struct Reach<'a> {
    /// The robot, with its joint terms.
    pub robot: &'a Robot,
    /// Lower and upper limit of every reading, rad or m.
    pub limits: &'a [(f64, f64)],
    /// True for readings that keep the value of the start; empty: none.
    pub held: &'a [bool],
    /// Readings of the stop before, which tell the side of the backlash.
    pub previous: Option<&'a [f64]>,
}

/// An iteration that did not arrive.
#[derive(Debug, Clone, PartialEq)]
pub struct Stalled {
    /// Where it ended, rad or m.
    pub readings: Vec<f64>,
    /// Body twist from there to the wanted pose, m and rad.
    pub error: Vector6<f64>,
}

impl Reach<'_> {
    /// The stop at these readings, with its approach.
    pub fn stop(&self, readings: &[f64]) -> Posture {
        let approach = self.previous.map(|p| readings.iter().zip(p).map(|(q, p)| q - p).collect());
        Posture { readings: readings.to_vec(), approach }
    }

    /// Readings that bring the tip to `base_from_tip`: of all steps that lead there the shortest ones from `start`.
    ///
    /// # Errors
    /// [`Stalled`] where the iteration does not get there within the limits.
    pub fn solve_from(&self, base_from_tip: &Pose, start: &[f64]) -> Result<Vec<f64>, Stalled> {
        let origins = self.robot.linear_origins();
        let mut q = start.to_vec();
        let mut last = f64::INFINITY;
        let mut error = Vector6::zeros();
        for _ in 0..STEPS {
            let (reached, d_readings) = self.robot.tip_by_readings(&origins, &self.stop(&q));
            error = (reached.inverse() * *base_from_tip).log();
            let size = error.norm();
            if size < TOLERANCE {
                return Ok(q);
            }
            // Damping that vanishes with the error keeps the last steps those of Newton.
            let damping = (1e-2 * size.min(last)).powi(2).max(1e-12);
            last = size;
            let free = |i: usize| !self.held.get(i).copied().unwrap_or(false);
            let mut normal = Matrix6::identity() * damping;
            for (_, j) in d_readings.iter().enumerate().filter(|(i, _)| free(*i)) {
                normal += j * j.transpose();
            }
            let Some(factor) = normal.cholesky() else { break };
            let weights: Vector6<f64> = factor.solve(&error);
            let step = |(i, j): (usize, &Vector6<f64>)| if free(i) { j.dot(&weights) } else { 0.0 };
            let step: Vec<f64> = d_readings.iter().enumerate().map(step).collect();
            let longest = step.iter().fold(LONGEST_STEP, |m, s| m.max(s.abs()));
            for (i, (q, s)) in q.iter_mut().zip(&step).enumerate().filter(|(i, _)| free(*i)) {
                let (low, high) = self.limits[i];
                *q = (*q + s * LONGEST_STEP / longest).clamp(low, high);
            }
        }
        Err(Stalled { readings: q, error })
    }
}

/// Readings that bring the tip to `base_from_tip`, found from `start`; `None` when the iteration does not get there within
/// the limits.
pub fn solve_from(robot: &Robot, limits: &[(f64, f64)], base_from_tip: &Pose, start: &[f64]) -> Option<Vec<f64>> {
    Reach { robot, limits, held: &[], previous: None }.solve_from(base_from_tip, start).ok()
}

/// Readings that bring the tip to `base_from_tip`, from up to `starts` random starts.
pub fn solve(
    robot: &Robot,
    limits: &[(f64, f64)],
    base_from_tip: &Pose,
    starts: usize,
    rng: &mut impl Rng,
) -> Option<Vec<f64>> {
    (0..starts).find_map(|_| {
        let start = random_readings(limits, &robot.chain.reading_kinds, rng);
        solve_from(robot, limits, base_from_tip, &start)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_angle_turns_towards_another_as_far_as_its_limits_allow() {
        let limits = (-6.0, 6.0);
        for (near, beyond, wanted) in [
            (0.2, &[][..], 1.0),
            (6.0, &[], 1.0),
            (6.0, &[-1.0, 1.0], 1.0),
            (-5.0, &[], 1.0 - TAU),
            (-12.0, &[], 1.0),
            (-12.0, &[-1.0, 1.0], 1.0 - TAU),
        ] {
            assert!((turned(1.0, near, limits, beyond) - wanted).abs() < 1e-12, "{near} {beyond:?}");
        }
    }

    #[test]
    fn a_full_turn_makes_another_posture_where_it_is_asked_for() {
        let kinds = [JointKind::Revolute, JointKind::Prismatic];
        let found = [vec![0.1, 0.0], vec![0.1 + TAU, 0.0], vec![0.1, TAU], vec![0.1 + 0.5 * SAME_READING, 0.0]];
        for (turns, count) in [(FullTurns::Apart, 3), (FullTurns::Alike, 2)] {
            let mut all = Vec::new();
            found.iter().for_each(|q| turns.add(q.clone(), &mut all, &kinds));
            assert_eq!(all.len(), count, "{turns:?}");
        }
    }
}
