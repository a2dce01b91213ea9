//! Laplace's approximation of the evidence of a model (D. MacKay, *Bayesian interpolation*, 1992).

use std::fmt;

use crate::error::Code;
use crate::problem::Family;
use crate::solve::{Elimination, Fit, LinearProblem, Outcome, Status, System};

/// Why something has no evidence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoEvidence {
    /// Its fit came to no end: the cost is not that of the optimum.
    Unfinished(Status),
    /// The data do not determine all of its unknowns.
    Undetermined,
}

impl NoEvidence {
    /// What is to be said of it.
    pub fn code(self) -> Code {
        match self {
            Self::Unfinished(_) => Code::NotConverged,
            Self::Undetermined => Code::FitUndetermined,
        }
    }
}

impl fmt::Display for NoEvidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unfinished(status) => write!(f, "its fit {}", status.words()),
            Self::Undetermined => f.write_str("its fit does not determine all unknowns"),
        }
    }
}

/// As [`log_evidence`], of what an iteration reached.
///
/// # Errors
/// It came to no end; the data do not determine all unknowns.
pub fn log_evidence_of_outcome(outcome: &Outcome) -> Result<f64, NoEvidence> {
    let linear = outcome.linear().filter(|_| outcome.status == Status::Converged);
    log_evidence(linear.ok_or(NoEvidence::Unfinished(outcome.status))?).ok_or(NoEvidence::Undetermined)
}

/// The fit of an iteration that is judged by its evidence.
///
/// # Errors
/// As of [`log_evidence_of_outcome`].
pub fn fit_of_outcome(outcome: Outcome) -> Result<Fit, NoEvidence> {
    match outcome.status {
        Status::Converged => outcome.fit().map_err(|_| NoEvidence::Undetermined),
        unfinished => Err(NoEvidence::Unfinished(unfinished)),
    }
}

/// `ln E = -cost - 1/2 ln det N - sum ln sigma_prior` up to what models of the same data share, with the whole information `N`
/// (dense columns, latents and markers) at the optimum and the priors of columns and of what is latent at stops, and what holding directions of a family adds to the density of its prior; `None` where it
/// is not finite.
pub fn log_evidence(linear: LinearProblem) -> Option<f64> {
    let system = System::with(Elimination::cheaper(linear), linear, 0.0);
    let reduced = system.factor(linear).ok()?.log_determinant();
    of_determinant(linear, &system, reduced)
}

/// As [`log_evidence`], of a fit whose covariance is at hand.
pub fn log_evidence_of_fit(fit: &Fit) -> Option<f64> {
    of_determinant(fit.linear(), &fit.covariance.system, fit.covariance.log_determinant)
}

/// With the logarithm of the determinant of the information of a system.
fn of_determinant(linear: LinearProblem, system: &System, reduced: f64) -> Option<f64> {
    let eliminated = system.log_determinant_of_eliminated(linear);
    let distances = system.log_determinant_of_distances();
    let priors: f64 = (linear.adjustment.problem.layout.columns.iter())
        .filter(|c| c.free && c.prior_sigma.is_finite())
        .map(|c| c.prior_sigma.ln())
        .sum();
    let of_latent: f64 = linear.stops().flat_map(|s| s.prior()).filter(|p| *p > 0.0).map(|p| 0.5 * p.ln()).sum();
    let families = linear.adjustment.problem.families.iter();
    let held: f64 = families.map(Family::log_density_of_held).sum();
    Some(-linear.lin.cost - 0.5 * (reduced + eliminated + distances) - priors + of_latent + held)
        .filter(|e| e.is_finite())
}
