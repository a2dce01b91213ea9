//! What the uncertainty of the joint noise does to the covariance of the parameters: its second-order correction (M. Kenward,
//! J. Roger, *Small sample inference for fixed effects from restricted maximum likelihood*, 1997), and the spread of normalised
//! errors. See the formulation.

use nalgebra::DMatrix;

use super::information::NoiseInformation;
use super::latent::Latent;
use super::tally::JOINT_NOISE_FLOOR;
use crate::linalg::{SymmetricFactor, product};
use crate::solve::optimum::fit::Fit;

/// Standard deviation of the logarithm of a variance up to which terms of second order mean anything; what the data do not tell at all, as
/// the local error of a joint that never moved, would else be stated as an error of any size.
const MOST_SPREAD: f64 = 2.0;

/// The latents of all stops, and how the estimated variances of each two of them scatter together.
#[derive(Debug, Clone)]
pub struct NoiseUncertainty {
    /// Covariance of the reduced unknowns (of dense columns alone where other unknowns stay than these latents) and latents in units of
    /// the latents' sigmas, `Y`.
    columns: DMatrix<f64>,
    /// Scatter of the logarithms of the variances of two latents, `p_i' W p_j`.
    shared: DMatrix<f64>,
    /// Covariance of the latents at all columns and at known ones, in units of their sigmas, added up.
    left: DMatrix<f64>,
}

impl NoiseUncertainty {
    /// Beside the covariance of a fit; none where all variances count as known, and for so many images that it is nothing beside the
    /// rest. A variance at its floor counts as known.
    pub fn of(told: &NoiseInformation, fit: &Fit) -> Option<Self> {
        let cov = told.coupled.as_ref().unwrap_or(&fit.covariance);
        let place = |c: usize| {
            let is_estimated = told.variances[c] > JOINT_NOISE_FLOOR * JOINT_NOISE_FLOOR;
            told.touched.iter().position(|t| *t == c).filter(|_| is_estimated)
        };
        let parts = |l: &Latent| -> Vec<(usize, f64)> {
            let used = l.parts.iter().filter(|(_, share)| *share > 0.0);
            used.filter_map(|(c, share)| Some((place(*c)?, *share))).collect()
        };
        let (latents, parts): (Vec<&Latent>, Vec<_>) =
            told.together.iter().map(|l| (l, parts(l))).filter(|(_, parts)| !parts.is_empty()).unzip();
        if latents.is_empty() {
            return None;
        }
        let n = latents.len();
        let scaled = |m: &DMatrix<f64>, power: i32| {
            DMatrix::from_fn(n, n, |i, k| {
                let (a, b) = (latents[i], latents[k]);
                m[(a.row, b.row)] * (a.sigma * b.sigma).powi(power)
            })
        };
        let at_known = SymmetricFactor::new(&scaled(&cov.system.information, 1)).ok()?.inverse();
        let bounded = |a: usize| (MOST_SPREAD / told.scatter[(a, a)].sqrt()).min(1.0);
        let shared = |i: usize, k: usize| {
            let products = parts[i].iter().flat_map(|(a, p)| parts[k].iter().map(move |(b, q)| (*a, *b, p * q)));
            products.map(|(a, b, weight)| weight * bounded(a) * bounded(b) * told.scatter[(a, b)]).sum::<f64>()
        };
        // Markers follow all unknowns that stay, so that these must be enlarged together.
        let stay = if told.coupled.is_some() { fit.problem.layout.len() } else { cov.reduced.nrows() };
        let columns = DMatrix::from_fn(stay, n, |c, i| cov.reduced[(c, latents[i].row)] / latents[i].sigma);
        Some(Self { columns, shared: DMatrix::from_fn(n, n, shared), left: scaled(&cov.reduced, -1) + at_known })
    }

    /// What it adds to the covariance of these unknowns, in their units: `Y M Y'`, `M_ij = (p_i' W p_j) (2 - C - T)_ij`.
    pub fn added(&self) -> DMatrix<f64> {
        let middle = DMatrix::from_fn(self.shared.nrows(), self.shared.ncols(), |i, k| {
            self.shared[(i, k)] * (2.0 * f64::from(i == k) - self.left[(i, k)])
        });
        product(&product(&self.columns, &middle), &self.columns.transpose())
    }

    /// Variance that it gives to the normalised squared error `e' C^-1 e` of some dense columns with the covariance `block`, beside
    /// that of chi-squared: of `tr(C^-1 C_estimated)`. None where the block is singular.
    pub fn of_normalised(&self, columns: &[usize], block: &DMatrix<f64>) -> Option<f64> {
        let y = self.columns.select_rows(columns);
        let solved = product(&SymmetricFactor::new(block).ok()?.inverse(), &y);
        let slopes = y.component_mul(&solved).row_sum().transpose();
        Some((&self.shared * &slopes).dot(&slopes))
    }
}
