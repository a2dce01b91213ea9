//! Optimal weights of candidates: Newton steps on the active ones, each a quadratic programme, with a bound from the linear one.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::criterion::{Criterion, Evaluated};
use crate::linalg::{LinearRow, NotSolved, minimise_quadratic};

/// The design problem: `0 <= w <= 1`, `sum w = count`, rows; minimise `criterion(M_0 + sum w_i M_i)`.
#[derive(Debug, Clone)]
pub struct Design<'a> {
    /// `M_0`.
    pub known: &'a DMatrix<f64>,
    /// `M_i`.
    pub candidates: &'a [DMatrix<f64>],
    /// Criterion.
    pub criterion: &'a Criterion,
    /// Number of images.
    pub count: usize,
    /// Further rows over the candidates.
    pub rows: &'a [LinearRow],
}

/// Weights with what they are worth.
#[derive(Debug, Clone, PartialEq)]
pub struct Relaxed {
    /// Weights of the candidates.
    pub weights: Vec<f64>,
    /// Criterion.
    pub value: f64,
    /// The least value that any weights can have.
    pub bound: f64,
    /// Certified share of what is reachable.
    pub efficiency: f64,
    /// Newton steps.
    pub steps: usize,
}

/// Why there are no weights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoDesign {
    /// Fewer candidates than images.
    TooFew,
    /// The rows exclude every design of this count.
    Contradiction,
    /// Singular information, or a programme that was not solved.
    Numerical,
}

/// Certified share at which the search ends.
pub(super) const GOOD_ENOUGH: f64 = 1.0 - 1e-6;
/// Newton steps at most.
const STEPS: usize = 80;
/// Weight below which a candidate is not active.
const ACTIVE: f64 = 1e-7;
/// Weight that is rounded to none.
const NOTHING: f64 = 1e-8;
/// Inactive candidates that join the active ones in a step, at most.
const JOINING: usize = 40;

impl Design<'_> {
    /// `M(w)`.
    pub fn information(&self, weights: &[f64]) -> DMatrix<f64> {
        let mut m = self.known.clone();
        for (w, mi) in weights.iter().zip(self.candidates).filter(|(w, _)| **w != 0.0) {
            m.zip_apply(mi, |a, b| *a += w * b);
        }
        m
    }

    /// All rows, the count first.
    fn all_rows(&self) -> Vec<LinearRow> {
        let count = self.count as f64;
        let sum = LinearRow { coefficients: vec![1.0; self.candidates.len()], low: count, high: count };
        std::iter::once(sum).chain(self.rows.iter().cloned()).collect()
    }

    /// The vertex of the polytope with the least `gradient' v`.
    fn vertex(&self, gradient: &[f64]) -> Result<Vec<f64>, NoDesign> {
        let n = gradient.len();
        if !self.rows.is_empty() {
            let scale = gradient.iter().fold(1e-300_f64, |m, g| m.max(g.abs()));
            let g = DVector::from_iterator(n, gradient.iter().map(|g| g / scale));
            let bounds = vec![(0.0, 1.0); n];
            let found = minimise_quadratic(&DMatrix::zeros(n, n), &g, &bounds, &self.all_rows());
            return found.map(|v| v.as_slice().to_vec()).map_err(no_design);
        }
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|&a, &b| gradient[a].total_cmp(&gradient[b]));
        let mut v = vec![0.0; n];
        order.iter().take(self.count).for_each(|&k| v[k] = 1.0);
        Ok(v)
    }

    /// Derivatives of the criterion by all weights.
    pub(super) fn gradient(&self, at: &Evaluated) -> Vec<f64> {
        self.candidates.par_iter().map(|m| at.gradient(m)).collect()
    }

    /// Optimal weights.
    ///
    /// # Errors
    /// Where the rows allow no design, or numbers break down.
    pub fn relax(&self) -> Result<Relaxed, NoDesign> {
        let n = self.candidates.len();
        if n < self.count {
            return Err(NoDesign::TooFew);
        }
        let even = vec![self.count as f64 / n as f64; n];
        let at = self.evaluate(&even)?;
        self.relax_from(self.vertex(&self.gradient(&at))?, GOOD_ENOUGH)
    }

    /// Optimal weights, found from others that keep to the rows; ends at the certified share `good_enough`.
    ///
    /// # Errors
    /// As [`Self::relax`].
    pub fn relax_from(&self, mut weights: Vec<f64>, good_enough: f64) -> Result<Relaxed, NoDesign> {
        let mut best_bound = f64::NEG_INFINITY;
        for step in 0..=STEPS {
            let at = self.evaluate(&weights)?;
            let gradient = self.gradient(&at);
            let vertex = self.vertex(&gradient)?;
            let gap: f64 = gradient.iter().zip(weights.iter().zip(&vertex)).map(|(g, (w, v))| g * (w - v)).sum();
            best_bound = best_bound.max(self.criterion.bound(at.value, gap));
            let efficiency = self.criterion.share(best_bound, at.value).min(1.0);
            let moved = if efficiency < good_enough && step < STEPS {
                self.newton(&at, &weights, &gradient, &vertex)?
            } else {
                None
            };
            match moved {
                Some(next) => weights = next,
                None => return Ok(Relaxed { weights, value: at.value, bound: best_bound, efficiency, steps: step }),
            }
        }
        Err(NoDesign::Numerical)
    }

    fn evaluate(&self, weights: &[f64]) -> Result<Evaluated, NoDesign> {
        self.criterion.evaluate(&self.information(weights)).map_err(|_| NoDesign::Numerical)
    }

    /// One Newton step with line search; `None` where no step gains anything.
    fn newton(
        &self,
        at: &Evaluated,
        weights: &[f64],
        gradient: &[f64],
        vertex: &[f64],
    ) -> Result<Option<Vec<f64>>, NoDesign> {
        let mut active: Vec<usize> = (0..weights.len()).filter(|&k| weights[k] > ACTIVE).collect();
        let mut joining: Vec<usize> = (0..weights.len()).filter(|&k| weights[k] <= ACTIVE).collect();
        joining.sort_by(|&a, &b| (vertex[b] > 0.5).cmp(&(vertex[a] > 0.5)).then(gradient[a].total_cmp(&gradient[b])));
        active.extend(joining.into_iter().take(JOINING.max(self.count / 2)));
        active.sort_unstable();
        let scale = 1.0 / gradient.iter().fold(1e-300_f64, |m, g| m.max(g.abs()));
        let informations: Vec<&DMatrix<f64>> = active.iter().map(|&k| &self.candidates[k]).collect();
        let mut hessian = at.hessian(&informations, self.criterion) * scale;
        let ridge = 1e-9 * hessian.diagonal().amax().max(1e-12);
        for k in 0..active.len() {
            hessian[(k, k)] += ridge;
        }
        let here = DVector::from_iterator(active.len(), active.iter().map(|&k| weights[k]));
        let g = DVector::from_iterator(active.len(), active.iter().map(|&k| gradient[k] * scale));
        let linear = &g - &hessian * &here;
        let rest = |c: &[f64]| -> f64 {
            (0..weights.len()).filter(|k| active.binary_search(k).is_err()).map(|k| c[k] * weights[k]).sum()
        };
        let rows: Vec<LinearRow> = (self.all_rows().iter())
            .map(|r| {
                let fixed = rest(&r.coefficients);
                let coefficients = active.iter().map(|&k| r.coefficients[k]).collect();
                LinearRow { coefficients, low: r.low - fixed, high: r.high - fixed }
            })
            .collect();
        let solved = minimise_quadratic(&hessian, &linear, &vec![(0.0, 1.0); active.len()], &rows).map_err(no_design);
        let aim = match solved {
            Ok(aim) => aim,
            // The programme is feasible (the weights are): a failure is one of numbers, and ends the search where it stands.
            Err(_) => return Ok(None),
        };
        Ok(self.line_search(at.value, weights, &active, &aim, gradient))
    }

    fn line_search(
        &self,
        value: f64,
        weights: &[f64],
        active: &[usize],
        aim: &DVector<f64>,
        gradient: &[f64],
    ) -> Option<Vec<f64>> {
        let slope: f64 = active.iter().zip(aim.iter()).map(|(&k, a)| gradient[k] * (a - weights[k])).sum();
        if slope >= 0.0 {
            return None;
        }
        let mut length = 1.0;
        while length > 1e-4 {
            let mut next = weights.to_vec();
            for (&k, a) in active.iter().zip(aim.iter()) {
                let w = weights[k] + length * (a - weights[k]);
                next[k] = if w < NOTHING { 0.0 } else { w.min(1.0) };
            }
            let reached = self.criterion.value(&self.information(&next));
            if reached.is_ok_and(|f| f < value + 1e-3 * length * slope) {
                return Some(next);
            }
            length *= 0.5;
        }
        None
    }
}

fn no_design(reason: NotSolved) -> NoDesign {
    match reason {
        NotSolved::Infeasible => NoDesign::Contradiction,
        NotSolved::Failed => NoDesign::Numerical,
    }
}
