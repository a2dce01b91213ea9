//! By how much measured distances miss what a fit says of them.
//!
//! With the residual `r` of a distance in its sigmas, its derivatives `h` over its sigma and the covariance `C` of the columns,
//!
//! ```text
//! t = r / sqrt(1 + h' C h)   where it took no part in the fit
//! t = r / sqrt(1 - h' C h)   where it did (W. Baarda 1968)
//! ```
//!
//! is a normal deviate where nothing is wrong; a distance that took part misses all else by `r / (1 - h' C h)` of its sigmas. One of `n` passes `sqrt(b^2 + 2 ln n)` with a probability below `exp(-b^2 / 2)`.

use super::covariance::Covariance;
use crate::problem::{Adjustment, MeasuredLength};

/// Share of its variance that a fit must leave of a distance, or it follows that distance alone.
const LEFT: f64 = 1e-9;

/// A measured distance against what the fit says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LengthMisfit {
    /// Its index in the problem.
    pub index: usize,
    /// As all else has it, m.
    pub fitted_m: f64,
    /// Measured less that, m.
    pub off_m: f64,
    /// The difference in its standard deviations, `t`.
    pub deviate: f64,
}

impl LengthMisfit {
    /// True where chance does not make it, of so many distances: beyond `sigmas` of a single one.
    pub fn is_beyond(&self, sigmas: f64, of: usize) -> bool {
        self.deviate.powi(2) > sigmas.powi(2) + 2.0 * (of.max(1) as f64).ln()
    }

    /// Measured over fitted, less one.
    pub fn relative(&self) -> f64 {
        self.off_m / self.fitted_m
    }

    /// Standard deviation of that.
    pub fn relative_sigma(&self) -> f64 {
        self.relative().abs() / self.deviate.abs().max(f64::MIN_POSITIVE)
    }

    /// True where both are off by the same ratio, within so many standard deviations.
    pub fn is_alike(&self, other: &Self, sigmas: f64) -> bool {
        let apart = self.relative() - other.relative();
        apart.abs() < sigmas * self.relative_sigma().hypot(other.relative_sigma())
    }
}

impl Adjustment {
    /// All measured distances with a covariance of the columns; without those that the fit follows.
    pub fn length_misfits(&self, covariance: &Covariance) -> Vec<LengthMisfit> {
        let Self { problem, state } = self;
        let of = |(index, measured): (usize, &MeasuredLength)| {
            let length = measured.linearise(&problem.layout, state)?;
            let told: f64 = length.pairs().map(|((a, x), (b, y))| x * y * covariance.reduced[(a, b)]).sum();
            let variance = if measured.left_out { 1.0 + told } else { 1.0 - told };
            let residual = if measured.left_out { length.residual } else { length.residual / variance };
            let off_m = residual * measured.sigma_m;
            let fitted_m = measured.distance_m - off_m;
            let deviate = length.residual / variance.sqrt();
            (variance > LEFT).then_some(LengthMisfit { index, fitted_m, off_m, deviate })
        };
        problem.lengths.iter().enumerate().filter_map(of).collect()
    }
}
