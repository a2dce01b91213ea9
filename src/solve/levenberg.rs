//! Levenberg-Marquardt on the reduced system.

use std::fmt;

use super::elimination::system::{Elimination, Singular, System};
use super::linear::{LinearProblem, Linearised};
use super::linearised_adjustment::LinearisedAdjustment;
use super::optimum::covariance::Covariance;
use super::optimum::fit::Fit;
use super::status::Status;
use crate::linalg::SymmetricFactor;
use crate::problem::{Adjustment, State, Step};

/// Bounds of the iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Most accepted or refused steps.
    pub iterations: usize,
    /// Stop when the Newton decrement, an upper bound of every |step| / sigma, falls below this.
    pub decrement: f64,
    /// Stop before a step that is predicted to be shorter than this share of that bound.
    pub margin: f64,
}

impl Settings {
    /// With the usual margin.
    pub const fn new(iterations: usize, decrement: f64) -> Self {
        Self { iterations, decrement, margin: 0.1 }
    }

    /// For sums of squares of what is measured at so many stops: the square of the decrement, which they change by, may be a share of them.
    pub fn of_stops(self, stops: usize) -> Self {
        Self { decrement: self.decrement.max((SQUARE_A_STOP * stops as f64).sqrt()), ..self }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self::new(100, 1e-3)
    }
}

/// Share of a sum of squares that is far below what so many are known to: 0.05 of a sigma for a hundred stops.
const SQUARE_A_STOP: f64 = 2.5e-5;

/// What the iteration reached.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// How it ended.
    pub status: Status,
    /// The adjustment at its best state.
    pub adjustment: Adjustment,
    /// Its linearisation; `None` only for a bad start.
    pub linearised: Option<Linearised>,
    /// Steps tried.
    pub iterations: usize,
}

impl Outcome {
    /// The linear problem at the best state; `None` only for a bad start.
    pub fn linear(&self) -> Option<LinearProblem<'_>> {
        Some(self.adjustment.linear(self.linearised.as_ref()?))
    }

    /// The adjustment linearised at its optimum; `None` where it came to no end.
    pub fn linearised_adjustment(self) -> Option<LinearisedAdjustment> {
        let Self { status: Status::Converged, adjustment, linearised, .. } = self else { return None };
        Some(LinearisedAdjustment { adjustment, linearised: linearised?, system: None })
    }

    /// How it ended, with its fit.
    pub fn ended(self) -> Ended {
        Ended { status: self.status, iterations: self.iterations, fit: self.fit() }
    }

    /// With its covariance.
    ///
    /// # Errors
    /// A bad start; singular normal equations.
    pub fn fit(self) -> Result<Fit, Box<NoFit>> {
        let covariance = self.linear().map(LinearProblem::covariance).transpose();
        match (covariance, self) {
            (Ok(Some(covariance)), Self { adjustment, linearised: Some(linearised), .. }) => {
                Ok(Fit { adjustment, linearised, covariance })
            }
            (Err(singular), outcome) => {
                let outcome = Self { status: Status::Stalled, ..outcome };
                Err(Box::new(NoFit { outcome, singular: Some(singular) }))
            }
            (_, outcome) => Err(Box::new(NoFit { outcome, singular: None })),
        }
    }
}

/// How an iteration ended, and its fit where there is one.
#[derive(Debug, Clone)]
pub struct Ended {
    /// How it ended.
    pub status: Status,
    /// Steps tried.
    pub iterations: usize,
    /// The fit.
    pub fit: Result<Fit, Box<NoFit>>,
}

impl Ended {
    /// The adjustment at its best state.
    pub fn adjustment(&self) -> &Adjustment {
        self.fit.as_ref().map_or_else(|unsolved| &unsolved.outcome.adjustment, |fit| &fit.adjustment)
    }

    /// The same, to be changed.
    pub fn adjustment_mut(&mut self) -> &mut Adjustment {
        match &mut self.fit {
            Ok(fit) => &mut fit.adjustment,
            Err(unsolved) => &mut unsolved.outcome.adjustment,
        }
    }
}

/// An outcome that is no fit.
#[derive(Debug, Clone)]
pub struct NoFit {
    /// The outcome; stalled where the normal equations are singular.
    pub outcome: Outcome,
    /// Where they are; `None` after a bad start.
    pub singular: Option<Singular>,
}

impl fmt::Display for NoFit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.singular {
            Some(singular) => singular.fmt(f),
            None => f.write_str("a marker lies behind its camera"),
        }
    }
}

/// Damping of the first step of the approach.
const FIRST_LAMBDA: f64 = 1e-6;
/// Relative rounding of a cost summed over thousands of residuals.
const ROUNDING: f64 = 1e-12;
const LARGEST_LAMBDA: f64 = 1e10;

/// Observations an image that are enough to come close.
const ENOUGH: usize = 32;
/// The approach goes on while its next step promises to take this share off the cost.
const WORTH_A_STEP: f64 = 0.1;
/// A model serves for the next step, too, while steps shrink at least this much from one to the next.
const CONTRACTION: f64 = 0.1;

/// Damping after a step that raised the cost, at least. Priors alone tell of some directions, a billionth of what images tell of others: more
/// damping than that holds them up, and the short steps look like the end.
const LAMBDA_IF_REFUSED: f64 = 1e-9;

/// Damping where the information was not positive definite, at least.
const LAMBDA_IF_SINGULAR: f64 = 1e-3;
const SMALLEST_LAMBDA: f64 = 1e-12;

/// Most steps of a detour.
const LONGEST_DETOUR: usize = 6;
/// A detour goes on while every step leaves at most this share of the cost of the one before.
const COMING_DOWN: f64 = 0.5;

/// Square of the Newton decrement, as a share of the cost, from which on the robust cost is taken as it bends: few residuals pass their bound on
/// the way, each moving by some hundredths of a sigma.
const NEARLY_THERE: f64 = 5e-4;
/// What that bound is multiplied by after a step by that curvature that raised the cost.
const REFUSED_NEARER: f64 = 0.1;

/// Newton decrement of the first step of a model up to which its information is that of the end: no unknown moved by more sigmas.
const NEAR: f64 = 1.0;

/// Quadratic model of the cost.
struct Model {
    system: System,
    factor: SymmetricFactor,
    /// Levenberg-Marquardt damping.
    lambda: f64,
    /// Nothing is held that is free.
    is_whole: bool,
    /// It has the curvature of the robust cost in place of the information.
    is_curved: bool,
    /// Newton decrement of its first step.
    decrement: f64,
}

impl Model {
    fn new(which: Elimination, linear: LinearProblem, lambda: f64) -> Option<Self> {
        let is_whole = which != Elimination::StopsMarkersHeld || linear.adjustment.problem.plates.is_empty();
        Some(Self { is_whole, ..Self::of(System::with(which, linear, lambda), linear, lambda)? })
    }

    /// Of a whole system.
    fn of(system: System, linear: LinearProblem, lambda: f64) -> Option<Self> {
        let factor = system.factor(linear).inspect_err(|singular| tracing::debug!(lambda, "{singular}")).ok()?;
        Some(Self { system, factor, lambda, is_whole: true, is_curved: false, decrement: f64::INFINITY })
    }

    /// The covariance, where the model stands for the end of the iteration.
    fn covariance(self, adjustment: &Adjustment) -> Option<Covariance> {
        let is_near = self.is_whole && !self.is_curved && self.decrement <= NEAR && self.lambda <= LAMBDA_IF_REFUSED;
        is_near.then(|| Covariance::of(&adjustment.problem, self.system, self.factor))
    }

    fn proposal(&self, linear: LinearProblem) -> Proposal {
        let x = self.factor.solve(&self.system.rhs);
        Proposal { step: self.system.step(linear, &x), decrement: self.system.decrement(&x), kept: false }
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
struct Proposer {
    /// The system of the first model, where it is known.
    first: Option<System>,
    model: Option<Model>,
    /// Decrement of the step before, where that step was taken.
    before: Option<f64>,
    /// Square of the decrement, as a share of the cost, below which the robust cost is taken as it bends.
    bent_below: f64,
}

impl Proposer {
    fn new() -> Self {
        Self { first: None, model: None, before: None, bent_below: NEARLY_THERE }
    }

    /// The next step; `None` where the information is not positive definite. Where the steps of a model shrink slowly, the robust cost bends
    /// less than the information says.
    fn propose(&mut self, linear: LinearProblem, lambda: f64) -> Option<Proposal> {
        let mut curved = None;
        if let (Some(mut model), Some(before)) = (self.model.take(), self.before) {
            model.system.take_gradient(linear);
            let proposal = model.proposal(linear);
            if proposal.decrement < CONTRACTION * before {
                self.model = Some(model);
                return Some(Proposal { kept: true, ..proposal });
            }
            if proposal.decrement.powi(2) < self.bent_below * linear.lin.cost {
                curved = linear.lin.with_robust_curvature();
            }
        }
        let which = Elimination::of_steps(linear);
        let curved = curved.and_then(|lin| Model::new(which, linear.adjustment.linear(&lin), lambda));
        let known = self.first.take().and_then(|system| Model::of(system, linear, 0.0));
        let mut model = match curved.map(|model| Model { is_curved: true, ..model }).or(known) {
            Some(model) => model,
            None => Model::new(which, linear, lambda)?,
        };
        let proposal = model.proposal(linear);
        model.decrement = proposal.decrement;
        self.model = Some(model);
        Some(proposal)
    }

    fn accepted(&mut self, proposal: &Proposal) {
        self.before = Some(proposal.decrement);
    }

    fn refused(&mut self) {
        (self.model, self.before) = (None, None);
    }

    /// True where the last step went by the curvature of the robust cost.
    fn is_curved(&self) -> bool {
        self.model.as_ref().is_some_and(|model| model.is_curved)
    }

    /// The curvature of the robust cost led uphill: goes on by the information, until much nearer to the end.
    fn refuse_curvature(&mut self) {
        self.refused();
        self.bent_below *= REFUSED_NEARER;
    }
}

/// What the decrement of a step lets expect of it.
struct Expected {
    /// It is below the bound: nothing is left to gain.
    small: bool,
    /// The next one will be.
    last: bool,
    /// Its cost may be larger by rounding.
    below_rounding: bool,
}

impl Expected {
    fn of(decrement: f64, before: Option<f64>, cost: f64, settings: &Settings) -> Self {
        let small = decrement < settings.decrement;
        // Gauss-Newton contracts at least linearly: the next step will be shorter by the same factor, or more.
        let shrunk = before.filter(|b| decrement < 0.1 * b);
        let next = shrunk.map_or(f64::INFINITY, |b| decrement * decrement / b);
        Self {
            small,
            last: small || next < settings.margin * settings.decrement,
            // Where the step promises less than the cost can resolve, the gradient is the better judge.
            below_rounding: small || decrement * decrement < 10.0 * ROUNDING * cost,
        }
    }

    fn accepts(&self, cost: f64, before: f64) -> bool {
        cost <= before || (self.below_rounding && cost <= before * (1.0 + ROUNDING))
    }
}

/// More damping.
fn raised(lambda: f64, least: f64) -> f64 {
    (lambda * 10.0).max(least)
}

/// Takes a step; returns the state before.
fn take_step(adjustment: &mut Adjustment, step: &Step) -> State {
    let moved = adjustment.state.moved(&adjustment.problem.layout, step);
    std::mem::replace(&mut adjustment.state, moved)
}

/// Comes close to the optimum with some of the observations of the images, no marker moved; returns how many steps were tried. A good start stays
/// as it is.
fn approach(adjustment: &mut Adjustment, most: usize) -> usize {
    if adjustment.used().next().is_none() {
        return 0;
    }
    let mut lambda = FIRST_LAMBDA;
    let Some(mut lin) = adjustment.linearise_some(ENOUGH) else { return 0 };
    for tried in 0..most {
        let linear = adjustment.linear(&lin);
        let model = Model::new(Elimination::StopsMarkersHeld, linear, lambda);
        let Some(Proposal { step, decrement, .. }) = model.map(|m| m.proposal(linear)) else { return tried };
        if 0.5 * decrement * decrement < WORTH_A_STEP * lin.cost {
            return tried;
        }
        let before = take_step(adjustment, &step);
        match adjustment.linearise_some(ENOUGH).filter(|better| better.cost < lin.cost) {
            Some(better) => {
                lin = better;
                lambda *= 0.1;
            }
            None => {
                adjustment.state = before;
                lambda = raised(lambda, FIRST_LAMBDA);
            }
        }
    }
    most
}

/// Minimises the cost from where the adjustment stands.
pub fn solve(adjustment: Adjustment, settings: &Settings) -> Outcome {
    minimise(adjustment, settings).outcome
}

/// As [`solve`], from near the end.
pub fn solve_near(adjustment: Adjustment, settings: &Settings) -> Outcome {
    minimise_near(adjustment, settings).outcome
}

/// An outcome with what proposed its steps.
pub(super) struct Minimised {
    pub outcome: Outcome,
    proposer: Proposer,
}

impl Minimised {
    /// Where no step follows.
    pub fn stopped(outcome: Outcome) -> Self {
        Self { outcome, proposer: Proposer::new() }
    }

    /// With its covariance: that of the last model where this is near the end, else a new one.
    ///
    /// # Errors
    /// A bad start; singular normal equations.
    pub fn fit(self) -> Result<Fit, Box<NoFit>> {
        let Self { outcome, proposer } = self;
        let kept = proposer.model.and_then(|model| model.covariance(&outcome.adjustment));
        match (kept, outcome) {
            (Some(covariance), Outcome { adjustment, linearised: Some(linearised), .. }) => {
                Ok(Fit { adjustment, linearised, covariance })
            }
            (_, outcome) => outcome.fit(),
        }
    }

    /// Goes on to other bounds.
    pub fn polished(self, settings: &Settings) -> Self {
        let Self { outcome: Outcome { adjustment, linearised, .. }, proposer } = self;
        minimise_by(proposer, adjustment, linearised, settings)
    }
}

/// As [`solve`], with what proposed its steps.
pub(super) fn minimise(mut adjustment: Adjustment, settings: &Settings) -> Minimised {
    let start = adjustment.state.clone();
    let tried = approach(&mut adjustment, settings.iterations);
    let linearised = adjustment.linearise().or_else(|| {
        adjustment.state = start;
        adjustment.linearise()
    });
    let left = Settings { iterations: settings.iterations.saturating_sub(tried), ..*settings };
    let mut minimised = minimise_by(Proposer::new(), adjustment, linearised, &left);
    minimised.outcome.iterations += tried;
    minimised
}

/// As [`minimise`], from near the end.
pub(super) fn minimise_near(adjustment: Adjustment, settings: &Settings) -> Minimised {
    let linearised = adjustment.linearise();
    minimise_by(Proposer::new(), adjustment, linearised, settings)
}

/// As [`minimise_near`], where a linearisation at the same state is known that differs in priors, sizes of what is latent and factors on the noise of
/// measured bodies alone.
pub(super) fn minimise_with_priors(adjustment: Adjustment, linearised: Linearised, settings: &Settings) -> Minimised {
    let linearised = adjustment.with_its_priors(adjustment.with_its_body_factors(linearised));
    minimise_by(Proposer::new(), adjustment, Some(linearised), settings)
}

impl LinearisedAdjustment {
    /// The state at the optimum alone: the last step is taken on trust, and nothing is linearised where it ends.
    pub fn settled(self, settings: &Settings) -> State {
        let proposer = Proposer { first: self.system, ..Proposer::new() };
        let descent = Descent::new(proposer, self.adjustment, self.linearised);
        let mut descent = Descent { is_trusting: true, ..descent };
        descent.run(settings);
        descent.adjustment.state
    }
}

fn minimise_by(
    proposer: Proposer,
    adjustment: Adjustment,
    linearised: Option<Linearised>,
    settings: &Settings,
) -> Minimised {
    let Some(lin) = linearised else {
        let outcome = Outcome { status: Status::BadStart, adjustment, linearised: None, iterations: 0 };
        return Minimised { outcome, proposer };
    };
    let mut descent = Descent::new(proposer, adjustment, lin);
    let (iterations, status) = descent.run(settings);
    let Descent { adjustment, lin, proposer, .. } = descent;
    let outcome = Outcome { status, adjustment, linearised: Some(lin), iterations };
    Minimised { outcome, proposer }
}

/// A way over higher ground: where it began, and the cost there.
struct Detour {
    from: State,
    cost: f64,
    steps: usize,
}

/// An iteration under way.
struct Descent {
    adjustment: Adjustment,
    /// At its state.
    lin: Linearised,
    proposer: Proposer,
    lambda: f64,
    detour: Option<Detour>,
    /// The last step is taken on trust: the linearisation stays where it is.
    is_trusting: bool,
}

impl Descent {
    fn new(proposer: Proposer, adjustment: Adjustment, lin: Linearised) -> Self {
        Self { adjustment, lin, proposer, lambda: SMALLEST_LAMBDA, detour: None, is_trusting: false }
    }

    /// Steps until it ends; returns how many there were, and how it ended.
    fn run(&mut self, settings: &Settings) -> (usize, Status) {
        let (mut iterations, mut status) = (0, Status::OutOfIterations);
        while iterations < settings.iterations && status == Status::OutOfIterations {
            iterations += 1;
            status = self.step(settings);
        }
        self.turn_back();
        tracing::debug!(iterations, ?status, cost = self.lin.cost, "levenberg-marquardt");
        (iterations, status)
    }

    /// Tries one more step; out of iterations for as long as others may follow.
    fn step(&mut self, settings: &Settings) -> Status {
        let Some(proposal) = self.proposer.propose(self.adjustment.linear(&self.lin), self.lambda) else {
            return self.refuse(raised(self.lambda, LAMBDA_IF_SINGULAR));
        };
        let Proposal { decrement, kept, .. } = proposal;
        let least = self.detour.as_ref().map_or(self.lin.cost, |detour| detour.cost);
        let expected = Expected::of(decrement, self.proposer.before, least, settings);
        let before = take_step(&mut self.adjustment, &proposal.step);
        if self.is_trusting && expected.last && self.detour.is_none() {
            return Status::Converged;
        }
        self.lin.equations = Vec::new();
        let tried = self.adjustment.linearise();
        let (lambda, to) = (self.lambda, tried.as_ref().map(|t| t.cost));
        tracing::trace!(kept, lambda, decrement, from = self.lin.cost, to);
        match tried {
            Some(better) if expected.accepts(better.cost, least) => {
                (self.lin, self.detour) = (better, None);
                self.proposer.accepted(&proposal);
                self.lambda = (lambda * 0.1).max(SMALLEST_LAMBDA);
                if expected.last { Status::Converged } else { Status::OutOfIterations }
            }
            _ if self.proposer.is_curved() && !expected.small => {
                self.adjustment.state = before;
                self.proposer.refuse_curvature();
                Status::OutOfIterations
            }
            Some(worse) if !kept && !expected.small && self.may_pass(worse.cost) => {
                let cost = std::mem::replace(&mut self.lin, worse).cost;
                self.detour.get_or_insert(Detour { from: before, cost, steps: 0 }).steps += 1;
                self.proposer.refused();
                Status::OutOfIterations
            }
            _ => {
                self.adjustment.state = before;
                if expected.small && self.detour.is_none() {
                    return Status::Converged;
                }
                self.refuse(if kept { lambda } else { raised(lambda, LAMBDA_IF_REFUSED) })
            }
        }
    }

    /// True where a step to a higher cost may be the first of a way that ends below: any one step, and those that come down at once after it.
    fn may_pass(&self, cost: f64) -> bool {
        self.detour.as_ref().is_none_or(|d| d.steps < LONGEST_DETOUR && cost < COMING_DOWN * self.lin.cost)
    }

    /// Goes on from the best state with other damping.
    fn refuse(&mut self, lambda: f64) -> Status {
        self.turn_back();
        self.proposer.refused();
        self.lambda = lambda;
        if lambda > LARGEST_LAMBDA { Status::Stalled } else { Status::OutOfIterations }
    }

    fn turn_back(&mut self) {
        let Some(Detour { from, .. }) = self.detour.take() else { return };
        let away = std::mem::replace(&mut self.adjustment.state, from);
        match self.adjustment.linearise() {
            Some(lin) => self.lin = lin,
            None => self.adjustment.state = away,
        }
    }
}
