//! Variance components: how noisy pixels and joints are, decided by the data (REML fixed point, after Foerstner and MacKay).
//!
//! `s^2 = sum r^2 / (redundancy)`: every group of residuals is divided by the number of them that the parameters did not use up.
//! For joint noise the redundancy of one latent is `1 - C / sigma^2` with its posterior variance C. Started from above.

use nalgebra::{DMatrix, DVector, Matrix3};

use super::acceleration::Acceleration;
use super::body_components::{BodyTally, update_bodies};
use super::tally::JOINT_NOISE_FLOOR;
use crate::problem::{Adjustment, Noise, Problem};
use crate::solve::levenberg::{Minimised, Outcome, Settings, minimise, minimise_near, minimise_with_priors};
use crate::solve::linear::{LinearImage, LinearStop};
use crate::solve::optimum::fit::Fit;
use crate::solve::status::Status;

/// What is estimated and how long.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ComponentOptions {
    /// Estimate the factors on stated sigmas: of pixels, bodies, markers and families; else they stay as given in the problem.
    pub factors: bool,
    /// Estimate the joint noise; else it stays as given in the problem.
    pub joint: bool,
    /// Estimate the apparent displacements of the plate; else they stay as given in the problem.
    pub displacement: bool,
    /// Most rounds.
    pub rounds: usize,
    /// Bounds of each inner solve.
    pub settings: Settings,
}

impl Default for ComponentOptions {
    fn default() -> Self {
        Self { factors: true, joint: true, displacement: true, rounds: 60, settings: Settings::default() }
    }
}

/// Smallest joint noise, rad or m, that a neighbouring fit gives as a first guess: sizes grow by two in a round at most.
pub const LEAST_FIRST_GUESS: f64 = 10.0 * JOINT_NOISE_FLOOR;

/// Relative change of every component below which the rounds end.
const CONVERGED: f64 = 0.01;

/// Determined parameters of a family below which its factor stays.
const FEWEST_DETERMINED: f64 = 1e-6;

/// Coordinates of markers that the data must tell before they decide how far markers are off: the deviation is then known to a tenth.
pub const FEWEST_MARKER_COORDINATES: f64 = 50.0;

/// Newton decrement between rounds: the components need no better.
const ROUGH_DECREMENT: f64 = 0.05;

/// Relative change of a factor on the noise of pixels up to which it stays as it is, and what was linearised with it serves on.
const STAYS: f64 = 1e-3;

/// Stops of which some tell where the components of all will be, and how many those are, at least: of few stops the components tell little.
const MANY_STOPS: usize = 400;
const SOME_STOPS: usize = 150;
/// One in so many of more.
const ONE_IN: usize = 8;
/// Steps at most after the rough solve converged: along a direction that is hardly determined, each lowers the cost by little.
const POLISHING_STEPS: usize = 20;

/// As [`estimate_components`], from sizes that are far off: of many stops, some come near at a small part of the cost.
pub fn estimate_components_from_above(start: Adjustment, options: &ComponentOptions) -> Outcome {
    let stops = start.used_stops().len();
    let some = start.some_stops(MANY_STOPS, SOME_STOPS.max(stops / ONE_IN));
    let some = some.map(|some| estimate_components_from_above(some, options));
    let mut start = start;
    if let Some(some) = some.filter(|some| some.status == Status::Converged) {
        start.start_near_some(&some.adjustment, LEAST_FIRST_GUESS);
    }
    estimate_components(start, options)
}

/// Alternates solving and re-estimating until the components stand. The adjustment keeps the final components.
pub fn estimate_components(start: Adjustment, options: &ComponentOptions) -> Outcome {
    let rough = rough(&start, options);
    polish(rounds(minimise(start, &rough), (options, &rough)), options)
}

/// As [`estimate_components`], from near the end.
pub fn estimate_components_near(start: Adjustment, options: &ComponentOptions) -> Outcome {
    let rough = rough(&start, options);
    polish(rounds(minimise_near(start, &rough), (options, &rough)), options)
}

/// As [`estimate_components`], and then as long as `judge` changes what takes part, which says whether it did. What it judges on the way is as good
/// as the components need; it has the last word where the iteration ends.
pub fn estimate_components_judged(
    start: Adjustment,
    options: &ComponentOptions,
    (most, mut judge): (usize, impl FnMut(&mut Adjustment) -> bool),
) -> Outcome {
    let bounds = rough(&start, options);
    let (mut minimised, mut is_polished) = (rounds(minimise(start, &bounds), (options, &bounds)), false);
    for _ in 0..most {
        minimised = match judge(&mut minimised.outcome.adjustment) {
            true => {
                is_polished = false;
                let bounds = rough(&minimised.outcome.adjustment, options);
                rounds(minimise_near(minimised.outcome.adjustment, &bounds), (options, &bounds))
            }
            false if is_polished => break,
            false => {
                is_polished = true;
                polished(minimised, options)
            }
        };
    }
    if is_polished { minimised.outcome } else { polish(minimised, options) }
}

/// Bounds of the solves between rounds.
fn rough(start: &Adjustment, options: &ComponentOptions) -> Settings {
    let rough = Settings { decrement: ROUGH_DECREMENT.max(options.settings.decrement), ..options.settings };
    rough.of_stops(start.used_stops().len())
}

/// Rounds from the first solve on.
fn rounds(mut minimised: Minimised, (options, rough): (&ComponentOptions, &Settings)) -> Minimised {
    let mut iterations = minimised.outcome.iterations;
    let mut acceleration = Acceleration::default();
    for round in 0..options.rounds {
        let mut fit = match minimised.fit() {
            Ok(fit) => fit,
            Err(unsolved) => return Minimised::stopped(Outcome { iterations, ..unsolved.outcome }),
        };
        let (before, factors) = (sizes(&mut fit.problem), fit.problem.noise.pixel_factor.clone());
        let change = fit.update_components(options);
        if change >= CONVERGED {
            let next = acceleration.next_after(change, &before, sizes(&mut fit.problem));
            set_sizes(&mut fit.problem, &next);
            fit.hold_component_priors();
        }
        let serves_on = fit.keep_factors(&factors);
        let noise = &fit.problem.noise;
        tracing::debug!(round, change, pixel = ?noise.pixel_factor, joint = ?noise.joint, "variance components");
        // The next systems take the place of this one and its factor, and do not stand beside them.
        let Fit { adjustment, linearised, covariance } = fit;
        drop(covariance);
        minimised = match serves_on {
            true => minimise_with_priors(adjustment, linearised, rough),
            false => {
                drop(linearised);
                minimise_near(adjustment, rough)
            }
        };
        iterations += minimised.outcome.iterations;
        if change < CONVERGED || minimised.outcome.status == Status::BadStart {
            break;
        }
    }
    minimised.outcome.iterations = iterations;
    minimised
}

/// The bounds of the options after those between rounds.
fn polished(mut minimised: Minimised, options: &ComponentOptions) -> Minimised {
    if minimised.outcome.status == Status::Converged {
        let (most, before) = (options.settings.iterations.min(POLISHING_STEPS), minimised.outcome.iterations);
        minimised = minimised.polished(&Settings { iterations: most, ..options.settings });
        minimised.outcome.iterations += before;
        // The rough solve converged to 0.05 sigma; polishing lowered the cost further, if slowly.
        if minimised.outcome.status == Status::OutOfIterations {
            minimised.outcome.status = Status::Converged;
        }
    }
    minimised
}

fn polish(minimised: Minimised, options: &ComponentOptions) -> Outcome {
    polished(minimised, options).outcome
}

/// Every component that is not zero, with its smallest value.
fn components(problem: &mut Problem) -> impl Iterator<Item = (&mut f64, f64)> {
    let Noise { pixel_factor, joint, local, displacement, marker, body } = &mut problem.noise;
    let factors =
        pixel_factor.iter_mut().chain(marker).chain(body.iter_mut().flatten()).map(|s| (s, f64::MIN_POSITIVE));
    let sizes = joint.iter_mut().flatten().chain(local).chain(displacement).map(|s| (s, JOINT_NOISE_FLOOR));
    let families = problem.families.iter_mut().map(|f| (&mut f.factor, f.least));
    factors.chain(sizes).chain(families).filter(|(s, _)| **s > 0.0)
}

/// Logarithms of all components.
fn sizes(problem: &mut Problem) -> DVector<f64> {
    DVector::from_vec(components(problem).map(|(s, _)| s.ln()).collect())
}

/// Takes over components from their logarithms, none below its smallest value; those that were given stay as they are.
fn set_sizes(problem: &mut Problem, logarithms: &DVector<f64>) {
    for ((size, smallest), logarithm) in components(problem).zip(logarithms.iter()) {
        if *logarithm != size.ln() {
            *size = logarithm.exp().max(smallest);
        }
    }
}

impl Fit {
    /// Keeps the factors on the noise of pixels that are nearly as `before`; true where all are.
    fn keep_factors(&mut self, before: &[f64]) -> bool {
        let mut all_stay = true;
        for (own, before) in self.problem.noise.pixel_factor.iter_mut().zip(before) {
            match (*own / before - 1.0).abs() < STAYS {
                true => *own = *before,
                false => all_stay = false,
            }
        }
        all_stay
    }

    /// One round; returns the largest relative change.
    fn update_components(&mut self, options: &ComponentOptions) -> f64 {
        let mut noise = self.problem.noise.clone();
        let stops = self.stops_with_noise();
        let at_stops = self.covariance.at_stops(&stops);
        let (latents, of_bodies): (Vec<_>, Vec<_>) = at_stops.into_iter().map(|own| (own.latents, own.bodies)).unzip();
        let mut change = 0.0f64;
        if options.factors {
            change = self.update_factors(&stops, (&latents, &of_bodies), &mut noise);
        }
        if options.joint || options.displacement {
            let kinds = self.state.robot.chain.reading_kinds.as_slice();
            change = change.max(self.latent_data(&stops, &latents).update(options, kinds, &mut noise));
        }
        self.problem.noise = noise;
        if options.factors {
            change = change.max(self.update_families());
        }
        self.hold_component_priors();
        change
    }

    /// New factors on the stated sigmas of pixels, bodies and markers, from the covariances of what is latent at the stops and of bodies measured
    /// there; returns the largest relative change.
    fn update_factors(
        &self,
        stops: &[LinearStop],
        (latents, of_bodies): (&[DMatrix<f64>], &[Vec<DMatrix<f64>>]),
        noise: &mut Noise,
    ) -> f64 {
        let markers = self.marker_tallies();
        let bodies = self.body_tallies(stops, of_bodies);
        let by_bodies: f64 = bodies.iter().flatten().map(BodyTally::taken).sum();
        let by_markers =
            markers.iter().map(|[_, told]| told).sum::<f64>() + 3.0 * self.problem.moved_markers.len() as f64;
        let taken = self.effective_parameters(stops, latents, by_markers) - by_bodies;
        let mut change = update_markers(&markers, noise).max(update_bodies(&bodies, noise));
        let total: f64 = self.linearised.terms.iter().map(|t| 2.0 * t.residuals.len() as f64).sum();
        for (camera, factor) in noise.pixel_factor.iter_mut().enumerate() {
            let of_camera = self.linear().images().filter(|i| i.image.camera == camera);
            let (mut squares, mut count) = (0.0, 0.0);
            for LinearImage { terms, .. } in of_camera {
                squares += terms.residuals.iter().map(|r| r.weight * r.normalised * r.normalised).sum::<f64>();
                count += 2.0 * terms.residuals.len() as f64;
            }
            let redundancy = count * (1.0 - taken / total);
            if redundancy < 1.0 || squares <= 0.0 {
                continue;
            }
            let ratio = (squares * huber_consistency(self.problem.huber) / redundancy).sqrt();
            *factor *= ratio;
            change = change.max((ratio - 1.0).abs());
        }
        change
    }

    /// New factors of the families, from the sums of squares of their parameters and how many of them the data determine.
    fn update_families(&mut self) -> f64 {
        let Self { adjustment: Adjustment { problem, state }, covariance: cov, .. } = self;
        let values = state.values(&problem.layout);
        let (layout, mut change) = (&problem.layout, 0.0f64);
        for family in &mut problem.families {
            let (mut squares, mut determined) = (0.0, -(family.held.ncols() as f64));
            for (&c, base) in family.columns.iter().zip(&family.base).filter(|(c, _)| layout.columns[**c].free) {
                let prior = family.factor * base;
                squares += ((values[c] - layout.columns[c].prior_mean) / base).powi(2);
                determined += 1.0 - cov.reduced[(c, c)] / (prior * prior);
            }
            if determined < FEWEST_DETERMINED {
                continue;
            }
            let next = family.asked(squares, determined).min(2.0 * family.factor);
            if next.max(family.factor) > family.least {
                change = change.max((next / family.factor - 1.0).abs());
            }
            family.factor = next;
        }
        change
    }

    /// Of every plate: sum of squares of the corrections of its markers in units of their prior, and how many coordinates the data tell; without
    /// those of markers that are let go, whose prior is not that of the plate.
    pub fn marker_tallies(&self) -> Vec<[f64; 2]> {
        let Adjustment { problem, state } = &self.adjustment;
        let of_plate = |(p, covariances): (usize, &Vec<Option<Matrix3<f64>>>)| {
            let seen = covariances.iter().enumerate().filter_map(|(m, c)| c.map(|c| (m, c)));
            let kept = seen.filter(|(m, _)| !problem.moved_markers.contains(&(p, *m)));
            kept.fold([0.0; 2], |[squares, told], (m, c)| {
                let information = problem.marker_information(p, m);
                let square = state.plates[p].corrections[m].norm_squared() * information;
                [squares + square, told + 3.0 - c.trace() * information]
            })
        };
        self.covariance.markers().iter().enumerate().map(of_plate).collect()
    }

    /// The sizes of what is latent where their likelihood has its maximum at this linearisation.
    pub(super) fn most_likely_noise(&self, options: &ComponentOptions) -> Noise {
        let stops = self.stops_with_noise();
        let data = self.latent_data(&stops, &self.covariance.latents(&stops));
        let mut noise = self.problem.noise.clone();
        data.most_likely(options, &self.state.robot.chain.reading_kinds, &mut noise);
        noise
    }

    /// Stops at which a body was measured, or something latent has a prior.
    fn stops_with_noise(&self) -> Vec<LinearStop<'_>> {
        let has_prior = |stop: &LinearStop| stop.prior().iter().any(|prior| *prior > 0.0);
        self.linear().stops().filter(|stop| !stop.bodies().is_empty() || has_prior(stop)).collect()
    }

    /// Number of parameters that the pixels (and not the priors) determine, with so many `markers` coordinates among them; `covariances` of what
    /// is latent at the stops where something has a prior.
    fn effective_parameters(&self, stops: &[LinearStop], covariances: &[DMatrix<f64>], markers: f64) -> f64 {
        let (problem, cov) = (&self.problem, &self.covariance);
        let columns = &problem.layout.columns;
        let dense: f64 = (columns.iter().enumerate())
            .filter(|(i, c)| c.free && cov.system.touched(*i))
            .map(|(i, c)| 1.0 - cov.reduced[(i, i)] / (c.prior_sigma * c.prior_sigma))
            .sum();
        let all: usize = self.linear().stops().map(|stop| stop.unknowns()).sum();
        let by_priors = |(stop, c): (&LinearStop, &DMatrix<f64>)| {
            stop.prior().into_iter().enumerate().map(|(k, prior)| c[(k, k)] * prior).sum::<f64>()
        };
        let latent = all as f64 - stops.iter().zip(covariances).map(by_priors).sum::<f64>();
        dense + latent + markers
    }
}

/// Huber's weights take a little off the sum of squares of clean Gaussian data (two components); this gives it back.
fn huber_consistency(k: f64) -> f64 {
    if k.is_infinite() {
        return 1.0;
    }
    let tail = (-0.5 * k * k).exp();
    let q = normal_upper_tail(k);
    let lost = (k * k + 2.0) * tail - k * (k * tail + (std::f64::consts::TAU).sqrt() * q);
    2.0 / (2.0 - lost)
}

/// `P(z > k)` by the continued fraction of Mills' ratio, good beyond k = 1.
fn normal_upper_tail(k: f64) -> f64 {
    let mut mills = k;
    for n in (1..60).rev() {
        mills = k + f64::from(n) / mills;
    }
    (-0.5 * k * k).exp() / std::f64::consts::TAU.sqrt() / mills
}

/// New factors on the tolerances of the markers. A factor goes down by halves at most, so that it stays where the data stop telling.
fn update_markers(tallies: &[[f64; 2]], noise: &mut Noise) -> f64 {
    let mut change: f64 = 0.0;
    for (factor, [squares, told]) in noise.marker.iter_mut().zip(tallies) {
        if *told >= FEWEST_MARKER_COORDINATES {
            let ratio = (squares / told).sqrt().clamp(0.5, 2.0);
            *factor *= ratio;
            change = change.max((ratio - 1.0).abs());
        }
    }
    change
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_upper_tail_of_the_normal_distribution_is_right() {
        // Tables: P(z > 1.959964) = 0.025, P(z > 3) = 1.349898e-3.
        assert!((normal_upper_tail(1.959_964) - 0.025).abs() < 1e-7);
        assert!((normal_upper_tail(3.0) - 1.349_898e-3).abs() < 1e-9);
    }

    #[test]
    fn huber_loses_three_percent_of_the_variance_at_its_usual_bound() {
        // Rayleigh quadrature of the same quantity.
        let k = crate::problem::HUBER;
        let n = 200_000;
        let h = 12.0 / f64::from(n);
        let (mut full, mut weighted) = (0.0, 0.0);
        for i in 0..n {
            let e = (f64::from(i) + 0.5) * h;
            let density = e * (-0.5 * e * e).exp() * h;
            full += e * e * density;
            weighted += (e * e).min(k * e) * density;
        }
        assert!((huber_consistency(k) - full / weighted).abs() < 1e-6);
    }
}
