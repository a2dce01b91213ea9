//! Laplace's approximation of the evidence of a model (D. MacKay, *Bayesian interpolation*, 1992).

use crate::linalg::SymmetricFactor;
use crate::problem::{Problem, State};
use crate::solve::{Elimination, Linearised, SeenMarkers, System};

/// `ln E = -cost - 1/2 ln det N - sum ln sigma_prior` up to what models of the same data share, with the whole information `N`
/// (dense columns, slack and markers) at the optimum; `None` where it is not finite.
pub fn log_evidence(problem: &Problem, state: &State, lin: &Linearised) -> Option<f64> {
    let system = System::with(Elimination::Markers, problem, state, lin, 0.0);
    let reduced = SymmetricFactor::new(&system.information).ok()?.log_determinant();
    let markers = SeenMarkers::of(problem, lin).information(problem, lin);
    let eliminated: f64 = markers.iter().map(|block| block.determinant().ln()).sum();
    let priors: f64 = (problem.layout.columns.iter())
        .filter(|c| c.free && c.prior_sigma.is_finite())
        .map(|c| c.prior_sigma.ln())
        .sum();
    Some(-lin.cost - 0.5 * (reduced + eliminated) - priors).filter(|e| e.is_finite())
}
