//! What a design is judged by: a convex function of its information matrix, with derivatives.

use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::linalg::{NotPositiveDefinite, SymmetricFactor, product, symmetric_eigen};

/// What is to be small.
#[derive(Debug, Clone, PartialEq)]
pub enum Criterion {
    /// `tr(B' M^-1 B)`: a mean variance, `W = B B'`.
    MeanVariance(DMatrix<f64>),
    /// `-log det` of the marginal information of the first `n` columns, over `n`: a mean logarithm of variances.
    Volume(usize),
}

/// Share of the largest eigenvalue of a weight below which its direction does not count.
const NEGLIGIBLE: f64 = 1e-12;

/// A criterion at an information matrix `M`.
pub struct Evaluated {
    /// Value.
    pub value: f64,
    /// `Q`: the derivative towards `X` is `-tr(Q X)`.
    pub slope: DMatrix<f64>,
    /// `M^-1`.
    pub covariance: DMatrix<f64>,
    /// Inverse of the nuisance block, padded with zeros (volume only).
    nuisance: Option<DMatrix<f64>>,
}

impl Criterion {
    /// Mean variance under a symmetric weight.
    pub fn weighted(weight: &DMatrix<f64>) -> Self {
        let Some((values, vectors)) = symmetric_eigen(weight) else {
            return Self::MeanVariance(DMatrix::zeros(weight.nrows(), 0));
        };
        let least = NEGLIGIBLE * values.amax();
        let kept: Vec<usize> = (0..values.len()).filter(|&k| values[k] > least).collect();
        Self::MeanVariance(DMatrix::from_fn(weight.nrows(), kept.len(), |i, k| {
            vectors[(i, kept[k])] * values[kept[k]].sqrt()
        }))
    }

    /// The value alone.
    ///
    /// # Errors
    /// Where `m` is not positive definite.
    pub fn value(&self, m: &DMatrix<f64>) -> Result<f64, NotPositiveDefinite> {
        let factor = SymmetricFactor::new(m)?;
        match self {
            Self::MeanVariance(b) => Ok(b.dot(&factor.solve_many(b))),
            Self::Volume(n) => {
                let rest = SymmetricFactor::new(&nuisance_block(m, *n))?;
                Ok((rest.log_determinant() - factor.log_determinant()) / *n as f64)
            }
        }
    }

    /// Value, slope and what curvatures need.
    ///
    /// # Errors
    /// Where `m` is not positive definite.
    pub fn evaluate(&self, m: &DMatrix<f64>) -> Result<Evaluated, NotPositiveDefinite> {
        let factor = SymmetricFactor::new(m)?;
        let covariance = factor.inverse();
        match self {
            Self::MeanVariance(b) => {
                let cb = factor.solve_many(b);
                let slope = product(&cb, &cb.transpose());
                Ok(Evaluated { value: b.dot(&cb), slope, covariance, nuisance: None })
            }
            Self::Volume(n) => {
                let rest = SymmetricFactor::new(&nuisance_block(m, *n))?;
                let mut padded = DMatrix::zeros(m.nrows(), m.nrows());
                let size = m.nrows() - n;
                padded.view_mut((*n, *n), (size, size)).copy_from(&rest.inverse());
                let slope = (&covariance - &padded) / *n as f64;
                let value = (rest.log_determinant() - factor.log_determinant()) / *n as f64;
                Ok(Evaluated { value, slope, covariance, nuisance: Some(padded / *n as f64) })
            }
        }
    }

    /// Share of what is reachable: at least this, when no step along the polytope gains more than `gap` to first order.
    ///
    /// For a mean variance `1/f` is concave; for the volume the share is one of standard deviations squared, `exp(-gap)`.
    pub fn efficiency(&self, value: f64, gap: f64) -> f64 {
        match self {
            Self::MeanVariance(_) => 1.0 / (1.0 + gap.max(0.0) / value),
            Self::Volume(_) => (-gap.max(0.0)).exp(),
        }
    }

    /// Share of a reachable bound that another value is: of the mean variance, or of the geometric mean of variances.
    pub fn share(&self, best: f64, value: f64) -> f64 {
        match self {
            Self::MeanVariance(_) => best / value,
            Self::Volume(_) => (best - value).exp(),
        }
    }

    /// The least value that any design of the polytope can have, from a value and its gap.
    pub fn bound(&self, value: f64, gap: f64) -> f64 {
        match self {
            Self::MeanVariance(_) => value * self.efficiency(value, gap),
            Self::Volume(_) => value - gap.max(0.0),
        }
    }
}

fn nuisance_block(m: &DMatrix<f64>, n: usize) -> DMatrix<f64> {
    m.view((n, n), (m.nrows() - n, m.nrows() - n)).into_owned()
}

impl Evaluated {
    /// Derivative with respect to the weight of a candidate with this information (negative: it helps).
    pub fn gradient(&self, information: &DMatrix<f64>) -> f64 {
        -self.slope.dot(information)
    }

    /// Second derivatives with respect to the weights of these candidates.
    pub fn hessian(&self, of: &[&DMatrix<f64>], criterion: &Criterion) -> DMatrix<f64> {
        let p = self.covariance.nrows();
        // tr(A M_i C M_j) as products of rows of (A M_i)' with rows of C M_j.
        let flat = |left: &DMatrix<f64>, transposed: bool| {
            let mut all = DMatrix::zeros(p * p, of.len());
            all.as_mut_slice().par_chunks_mut(p * p).zip(of).for_each(|(column, m)| {
                let x = product(left, m);
                let x = if transposed { x.transpose() } else { x };
                column.copy_from_slice(x.as_slice());
            });
            all
        };
        let right = flat(&self.covariance, false);
        let h = match (criterion, &self.nuisance) {
            (Criterion::Volume(n), Some(rest)) => {
                let scale = *n as f64;
                let whole = product(&flat(&self.covariance, true).transpose(), &right) / scale;
                let inner = flat(rest, false);
                whole - product(&flat(rest, true).transpose(), &inner) * scale
            }
            _ => product(&flat(&self.slope, true).transpose(), &right) * 2.0,
        };
        (&h + h.transpose()) * 0.5
    }
}
