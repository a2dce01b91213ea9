//! How much of the errors that a robot may have a measurement of points can show.
//!
//! What frame and reflector take up no points show, and what joints do that do not move, neither. Errors of a robot that nobody corrected have the
//! priors of the full model; with `H` the mean square of the displacement of the reflector over places that matter per unit of these errors (frame
//! and reflector fitted out), and `A` the same sum over the points, a robot that fits the points as well as this one still misses by
//! `tr(H (I + A / s^2)^-1)` there, and without them by `tr(H)`: `s` is what the points scatter by in an axis.

use nalgebra::{DMatrix, Vector3};

use super::Limits;
use super::flange::everywhere;
use super::points::{Derivatives, MeasuredPoint, PointFit, held_weakly};
use super::usual_errors::usual_errors;
use crate::linalg::SymmetricFactor;
use crate::model::robot::Robot;

/// What a robot may miss by at places that matter, RMS, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeftOpen {
    /// One that nobody corrected.
    pub usual_m: f64,
    /// Such a one, where it fits the points as well.
    pub left_m: f64,
}

impl LeftOpen {
    /// By points with their fit, at places of these readings (rad or m), or anywhere within the joint limits where none are given. `None` where no
    /// points of the robot tell frame and reflector.
    pub fn of(
        robot: &Robot,
        (points, fit): (&[MeasuredPoint], &PointFit),
        places: &[Vec<f64>],
        limits: &Limits,
    ) -> Option<Self> {
        let (full, sigmas) = usual_errors(robot);
        let unit = vec![0.0; robot.chain.readings.len()];
        let squares = |all: &mut dyn Iterator<Item = Vec<f64>>| {
            let all = all.map(|readings| MeasuredPoint { position_m: Vector3::zeros(), readings });
            mean_squares(all.map(|point| fit.derivatives_at(&full, &point, &unit)), &sigmas)
        };
        let shown = squares(&mut points.iter().map(|p| p.readings.clone()))?;
        let open = match places {
            [] => squares(&mut everywhere(robot).into_iter().map(|stop| stop.readings))?,
            _ => squares(&mut places.iter().cloned())?,
        };
        let variance = (fit.rms_m.powi(2) + limits.displaced_m.powi(2)) / 3.0;
        let told = DMatrix::identity(sigmas.len(), sigmas.len()) + shown * (points.len() as f64 / variance);
        let left = SymmetricFactor::new(&told).ok()?.solve_many(&open);
        Some(Self { usual_m: open.trace().max(0.0).sqrt(), left_m: left.trace().max(0.0).sqrt() })
    }

    /// Whether points that leave so much open say something of the robot.
    pub fn tells(&self, limits: &Limits) -> bool {
        self.left_m.powi(2) <= limits.points_leave_open * self.usual_m.powi(2)
    }
}

/// Mean square of the displacement per unit of errors of these sigmas, frame and reflector fitted out, m^2.
fn mean_squares(all: impl Iterator<Item = Derivatives>, sigmas: &[f64]) -> Option<DMatrix<f64>> {
    let n = sigmas.len();
    let (mut own, mut mixed, mut fitted) = (DMatrix::zeros(n, n), DMatrix::zeros(9, n), DMatrix::zeros(9, 9));
    let mut count = 0.0;
    for Derivatives { by_model, fitted: by_fitted, .. } in all {
        own.gemm_tr(1.0, &by_model, &by_model, 1.0);
        mixed.gemm_tr(1.0, &by_fitted, &by_model, 1.0);
        fitted.gemm_tr(1.0, &by_fitted, &by_fitted, 1.0);
        count += 1.0;
    }
    let taken = SymmetricFactor::new(&held_weakly(fitted)).ok()?.solve_many(&mixed);
    own -= mixed.tr_mul(&taken);
    Some(DMatrix::from_fn(n, n, |i, k| sigmas[i] * own[(i, k)] * sigmas[k] / f64::max(count, 1.0)))
}
