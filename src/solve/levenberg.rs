//! Levenberg-Marquardt on the reduced system.

use super::system::{Elimination, Linearised, System, linearise_all, linearise_some};
use crate::linalg::SymmetricFactor;
use crate::problem::{Problem, State, Step};

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

/// Observations an image that are enough to come close.
const ENOUGH: usize = 32;
/// The approach goes on while its next step promises to take this share off the cost.
const WORTH_A_STEP: f64 = 0.1;
/// A model serves for the next step, too, while steps shrink at least this much from one to the next.
const CONTRACTION: f64 = 0.1;

/// Quadratic model of the cost.
struct Model {
    system: System,
    factor: SymmetricFactor,
}

impl Model {
    fn new(which: Elimination, problem: &Problem, state: &State, lin: &Linearised, lambda: f64) -> Option<Self> {
        let system = System::with(which, problem, state, lin, lambda);
        let factor = SymmetricFactor::new(&system.information).ok()?;
        Some(Self { system, factor })
    }

    fn proposal(&self, problem: &Problem, lin: &Linearised) -> Proposal {
        let x = self.factor.solve(&self.system.rhs);
        Proposal { step: self.system.step(problem, lin, &x), decrement: self.system.decrement(&x), kept: false }
    }
}

struct Proposal {
    step: Step,
    /// Newton decrement: every |step| / sigma is at most this.
    decrement: f64,
    /// From the model of a state before, with the gradient of this one.
    kept: bool,
}

/// What proposes the steps.
struct Proposer<'a> {
    problem: &'a Problem,
    model: Option<Model>,
    /// Decrement of the step before, where that step was taken.
    before: Option<f64>,
}

impl Proposer<'_> {
    /// The next step; `None` where the information is not positive definite.
    fn propose(&mut self, state: &State, lin: &Linearised, lambda: f64) -> Option<Proposal> {
        let problem = self.problem;
        if let (Some(mut model), Some(before)) = (self.model.take(), self.before) {
            model.system.take_gradient(problem, state, lin);
            let proposal = model.proposal(problem, lin);
            if proposal.decrement < CONTRACTION * before {
                self.model = Some(model);
                return Some(Proposal { kept: true, ..proposal });
            }
        }
        let model = Model::new(Elimination::cheaper(lin, problem), problem, state, lin, lambda)?;
        let proposal = model.proposal(problem, lin);
        self.model = Some(model);
        Some(proposal)
    }

    fn refused(&mut self) {
        (self.model, self.before) = (None, None);
    }
}

/// Comes close to the optimum with some of the observations, no marker moved; returns how many steps were tried. A good start stays as it is.
fn approach(problem: &Problem, state: &mut State, most: usize) -> usize {
    let mut lambda = FIRST_LAMBDA;
    let Some(mut lin) = linearise_some(problem, state, ENOUGH) else { return 0 };
    for tried in 0..most {
        let model = Model::new(Elimination::SlackMarkersHeld, problem, state, &lin, lambda);
        let Some(Proposal { step, decrement, .. }) = model.map(|m| m.proposal(problem, &lin)) else { return tried };
        if 0.5 * decrement * decrement < WORTH_A_STEP * lin.cost {
            return tried;
        }
        let moved = state.moved(&problem.layout, &step);
        match linearise_some(problem, &moved, ENOUGH).filter(|better| better.cost < lin.cost) {
            Some(better) => {
                (*state, lin) = (moved, better);
                lambda *= 0.1;
            }
            None => lambda = (lambda * 10.0).max(FIRST_LAMBDA),
        }
    }
    most
}

/// Minimises the cost from `start`.
pub fn solve(problem: &Problem, start: State, settings: &Settings) -> Outcome {
    let mut state = start.clone();
    let mut iterations = approach(problem, &mut state, settings.iterations);
    let mut linearised = linearise_all(problem, &state);
    if linearised.is_none() {
        state = start;
        linearised = linearise_all(problem, &state);
    }
    let Some(mut lin) = linearised else {
        return Outcome { status: Status::BadStart, state, linearised: None, iterations };
    };
    let mut lambda = FIRST_LAMBDA;
    let mut status = Status::OutOfIterations;
    let mut proposer = Proposer { problem, model: None, before: None };
    while iterations < settings.iterations && lambda <= LARGEST_LAMBDA {
        iterations += 1;
        let Some(Proposal { step, decrement, kept }) = proposer.propose(&state, &lin, lambda) else {
            lambda = (lambda * 10.0).max(1e-3);
            continue;
        };
        let moved = state.moved(&problem.layout, &step);
        let tried = linearise_all(problem, &moved);
        tracing::trace!(iterations, kept, lambda, decrement, from = lin.cost, to = tried.as_ref().map(|t| t.cost));
        let small = decrement < settings.decrement;
        // Gauss-Newton contracts at least linearly: the next step will be shorter by the same factor, or more.
        let shrunk = proposer.before.filter(|b| decrement < 0.1 * b);
        let next = shrunk.map_or(f64::INFINITY, |b| decrement * decrement / b);
        let last = small || next < PREDICTION_MARGIN * settings.decrement;
        // Where the step promises less than the cost can resolve, the gradient is the better judge.
        let below_rounding = small || decrement * decrement < 10.0 * ROUNDING * lin.cost;
        match tried {
            Some(better)
                if better.cost <= lin.cost || (below_rounding && better.cost <= lin.cost * (1.0 + ROUNDING)) =>
            {
                (state, lin) = (moved, better);
                proposer.before = Some(decrement);
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
                proposer.refused();
                if !kept {
                    lambda = (lambda * 10.0).max(1e-6);
                }
            }
        }
    }
    if lambda > LARGEST_LAMBDA {
        status = Status::Stalled;
    }
    tracing::debug!(iterations, ?status, cost = lin.cost, "levenberg-marquardt");
    Outcome { status, state, linearised: Some(lin), iterations }
}
