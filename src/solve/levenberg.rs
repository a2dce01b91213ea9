//! Levenberg-Marquardt on the reduced system.

use super::system::{Linearised, System, linearise_all};
use crate::linalg::SymmetricFactor;
use crate::problem::{Problem, State};

/// Bounds of the iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Most accepted or refused steps.
    pub iterations: usize,
    /// Stop when the Newton decrement, an upper bound of every |step| / sigma, falls below this.
    pub decrement: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { iterations: 100, decrement: 1e-3 }
    }
}

/// How the iteration ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// The last step was below the bound.
    Converged,
    /// No step lowered the cost any more.
    Stalled,
    /// The bound on the iterations was reached.
    OutOfIterations,
    /// A marker lies behind its camera at the starting values, or they are not finite.
    BadStart,
}

/// What the iteration reached.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// How it ended.
    pub status: Status,
    /// Best state.
    pub state: State,
    /// Its linearisation; `None` only for a bad start.
    pub linearised: Option<Linearised>,
    /// Steps tried.
    pub iterations: usize,
}

const FIRST_LAMBDA: f64 = 1e-6;
/// Relative rounding of a cost summed over thousands of residuals.
const ROUNDING: f64 = 1e-12;
/// A step that was not taken must be predicted to be this much below the bound.
const PREDICTION_MARGIN: f64 = 0.1;
const LARGEST_LAMBDA: f64 = 1e10;

/// Minimises the cost from `start`.
pub fn solve(problem: &Problem, start: State, settings: &Settings) -> Outcome {
    let Some(mut lin) = linearise_all(problem, &start) else {
        return Outcome { status: Status::BadStart, state: start, linearised: None, iterations: 0 };
    };
    let mut state = start;
    let mut lambda = FIRST_LAMBDA;
    let mut status = Status::OutOfIterations;
    let mut iterations = 0;
    // Decrement of the step before, where that step was taken.
    let mut before: Option<f64> = None;
    while iterations < settings.iterations {
        iterations += 1;
        let system = System::new(problem, &state, &lin, lambda);
        let Ok(factor) = SymmetricFactor::new(&system.information) else {
            lambda = (lambda * 10.0).max(1e-3);
            if lambda > LARGEST_LAMBDA {
                status = Status::Stalled;
                break;
            }
            continue;
        };
        let x = factor.solve(&system.rhs);
        // Every |step| / sigma is at most the square root of step' N step = step' rhs.
        let decrement = x.dot(&system.rhs).max(0.0).sqrt();
        let moved = state.moved(&problem.layout, &system.step(problem, &lin, &x));
        let tried = linearise_all(problem, &moved);
        let small = decrement < settings.decrement;
        // Gauss-Newton contracts at least linearly: the next step will be shorter by the same factor, or more.
        let next = before.filter(|b| decrement < 0.1 * b).map_or(f64::INFINITY, |b| decrement * decrement / b);
        let last = small || next < PREDICTION_MARGIN * settings.decrement;
        // Where the step promises less than the cost can resolve, the gradient is the better judge.
        let below_rounding = small || decrement * decrement < 10.0 * ROUNDING * lin.cost;
        match tried {
            Some(better)
                if better.cost <= lin.cost || (below_rounding && better.cost <= lin.cost * (1.0 + ROUNDING)) =>
            {
                (state, lin) = (moved, better);
                before = Some(decrement);
                lambda = (lambda * 0.1).max(1e-12);
                if last {
                    status = Status::Converged;
                    break;
                }
            }
            _ if small => {
                status = Status::Converged;
                break;
            }
            _ => {
                before = None;
                lambda = (lambda * 10.0).max(1e-6);
            }
        }
        if lambda > LARGEST_LAMBDA {
            status = Status::Stalled;
            break;
        }
    }
    tracing::debug!(iterations, ?status, cost = lin.cost, "levenberg-marquardt");
    Outcome { status, state, linearised: Some(lin), iterations }
}
