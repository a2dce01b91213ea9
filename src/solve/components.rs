//! Variance components: how noisy pixels and joints are, decided by the data (REML fixed point, after Foerstner and MacKay).
//!
//! `s^2 = sum r^2 / (redundancy)`: every group of residuals is divided by the number of them that the parameters did not use up.
//! For joint noise the redundancy of one latent is `1 - C / sigma^2` with its posterior variance C. Started from above.

use nalgebra::{DMatrix, DVector, Matrix3};

use super::acceleration::Acceleration;
use super::body_components::{BodyTally, update_bodies};
use super::fit::Fit;
use super::levenberg::{Outcome, Settings, Status, minimise, minimise_near, minimise_with_priors};
use super::linear::{LinearImage, LinearStop};
use crate::problem::{Adjustment, Noise, Problem};
use crate::urdf::JointKind;

/// What is estimated and how long.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ComponentOptions {
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
        Self { joint: true, displacement: true, rounds: 60, settings: Settings::default() }
    }
}

/// Smallest joint noise, rad or m: a tenth of what forty images of a good camera can tell from none.
pub const JOINT_NOISE_FLOOR: f64 = 1e-7;

/// Smallest joint noise, rad or m, that a neighbouring fit gives as a first guess: sizes grow by two in a round at most.
pub const LEAST_FIRST_GUESS: f64 = 10.0 * JOINT_NOISE_FLOOR;

/// Weight, in observations, with which the noise of a single joint is drawn to that of all joints of its series, and this to what is usual of all series.
pub(super) const SHRINKAGE: f64 = 5.0;

/// Relative change of every component below which the rounds end.
const CONVERGED: f64 = 0.01;

/// Smallest factor of a family: with it, its parameters are as good as left out.
const SMALLEST_FACTOR: f64 = 1e-3;

/// Determined parameters of a family below which its factor stays.
const FEWEST_DETERMINED: f64 = 1e-6;

/// Coordinates of markers that the data must tell before they decide how far markers are off: the deviation is then known to a tenth.
const FEWEST_MARKER_COORDINATES: f64 = 50.0;

/// Newton decrement between rounds: the components need no better.
const ROUGH_DECREMENT: f64 = 0.05;

/// Relative change of a factor on the noise of measurements up to which it stays as it is, and what was linearised with it serves on.
const STAYS: f64 = 1e-3;

/// Stops of which some tell where the components of all will be, and how many those are: of few stops the components tell little.
const MANY_STOPS: usize = 400;
const SOME_STOPS: usize = 150;

/// As [`estimate_components`], from sizes that are far off: of many stops, some come near at a small part of the cost.
pub fn estimate_components_from_above(start: Adjustment, options: &ComponentOptions) -> Outcome {
    let some = start.some_stops(MANY_STOPS, SOME_STOPS).map(|some| estimate_components(some, options));
    let mut start = start;
    if let Some(some) = some.filter(|some| some.status == Status::Converged) {
        start.start_near_some(&some.adjustment, LEAST_FIRST_GUESS);
    }
    estimate_components(start, options)
}

/// Alternates solving and re-estimating until the components stand. The adjustment keeps the final components.
pub fn estimate_components(start: Adjustment, options: &ComponentOptions) -> Outcome {
    let rough = Settings { decrement: ROUGH_DECREMENT.max(options.settings.decrement), ..options.settings };
    let mut minimised = minimise(start, &rough);
    let mut iterations = minimised.outcome.iterations;
    let mut acceleration = Acceleration::default();
    for round in 0..options.rounds {
        let mut fit = match minimised.fit() {
            Ok(fit) => fit,
            Err(unsolved) => return Outcome { iterations, ..unsolved.outcome },
        };
        let (before, factors) = (sizes(&mut fit.problem), fit.problem.noise.clone());
        let change = fit.update_components(options);
        if change >= CONVERGED {
            let next = acceleration.next_after(change, &before, sizes(&mut fit.problem));
            set_sizes(&mut fit.problem, &next);
            fit.hold_component_priors();
        }
        let serves_on = fit.keep_factors(&factors);
        let noise = &fit.problem.noise;
        tracing::debug!(round, change, pixel = ?noise.pixel_factor, joint = ?noise.joint, "variance components");
        minimised = match serves_on {
            true => minimise_with_priors(fit.adjustment, fit.linearised, &rough),
            false => minimise_near(fit.adjustment, &rough),
        };
        iterations += minimised.outcome.iterations;
        if change < CONVERGED || minimised.outcome.status == Status::BadStart {
            break;
        }
    }
    if minimised.outcome.status == Status::Converged {
        minimised = minimised.polished(&options.settings);
        iterations += minimised.outcome.iterations;
        // The rough solve converged to 0.05 sigma; polishing lowered the cost further, if slowly.
        if minimised.outcome.status == Status::OutOfIterations {
            minimised.outcome.status = Status::Converged;
        }
    }
    Outcome { iterations, ..minimised.outcome }
}

/// Every component that is not zero, with its smallest value.
fn components(problem: &mut Problem) -> impl Iterator<Item = (&mut f64, f64)> {
    let Noise { pixel_factor, joint, local, displacement, marker, body } = &mut problem.noise;
    let factors =
        pixel_factor.iter_mut().chain(marker).chain(body.iter_mut().flatten()).map(|s| (s, f64::MIN_POSITIVE));
    let sizes = joint.iter_mut().flatten().chain(local).chain(displacement).map(|s| (s, JOINT_NOISE_FLOOR));
    let families = problem.families.iter_mut().map(|f| (&mut f.factor, SMALLEST_FACTOR));
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
    /// Keeps the factors on the noise of measurements that are nearly as `before`; true where all are.
    fn keep_factors(&mut self, before: &Noise) -> bool {
        let noise = &mut self.problem.noise;
        let own = noise.pixel_factor.iter_mut().chain(noise.body.iter_mut().flatten());
        let before = before.pixel_factor.iter().chain(before.body.iter().flatten());
        let mut all_stay = true;
        for (own, before) in own.zip(before) {
            match (*own / before - 1.0).abs() < STAYS {
                true => *own = *before,
                false => all_stay = false,
            }
        }
        all_stay
    }

    /// One round; returns the largest relative change.
    fn update_components(&mut self, options: &ComponentOptions) -> f64 {
        let problem = &self.problem;
        let mut noise = problem.noise.clone();
        let markers = self.marker_tallies();
        let bodies = self.body_tallies();
        let by_bodies: f64 = bodies.iter().flatten().map(BodyTally::taken).sum();
        let stops = self.stops_with_noise();
        let latents = self.covariance.latents(&stops);
        let taken = self.effective_parameters(&stops, &latents, markers.iter().map(|[_, told]| told).sum()) - by_bodies;
        let mut change = update_markers(&markers, &mut noise).max(update_bodies(&bodies, &mut noise));
        let counts = self.linearised.terms.iter().map(|t| 2.0 * t.residuals.len() as f64);
        let total: f64 = counts.clone().sum();
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
            let ratio = (squares * huber_consistency(problem.huber) / redundancy).sqrt();
            *factor *= ratio;
            change = change.max((ratio - 1.0).abs());
        }
        if options.joint || options.displacement {
            let found = self.tallies(stops.iter().zip(&latents));
            if options.displacement {
                change = change.max(update_displacements(&found.displacement, &mut noise));
            }
            if options.joint {
                change = change.max(found.update_joint(self.state.robot.chain.reading_kinds.as_slice(), &mut noise));
            }
        }
        self.problem.noise = noise;
        change = change.max(self.update_families());
        self.hold_component_priors();
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
            let next = family.asked(squares, determined).clamp(SMALLEST_FACTOR, 2.0 * family.factor);
            if next > SMALLEST_FACTOR {
                change = change.max((next / family.factor - 1.0).abs());
            }
            family.factor = next;
        }
        change
    }

    /// Of every plate: sum of squares of the corrections of its markers in units of their prior, and how many coordinates the data tell.
    pub fn marker_tallies(&self) -> Vec<[f64; 2]> {
        let Adjustment { problem, state } = &self.adjustment;
        let of_plate = |(p, covariances): (usize, &Vec<Option<Matrix3<f64>>>)| {
            let seen = covariances.iter().enumerate().filter_map(|(m, c)| c.map(|c| (m, c)));
            seen.fold([0.0; 2], |[squares, told], (m, c)| {
                let information = problem.marker_information(p, m);
                let square = state.plates[p].corrections[m].norm_squared() * information;
                [squares + square, told + 3.0 - c.trace() * information]
            })
        };
        self.covariance.markers().iter().enumerate().map(of_plate).collect()
    }

    /// Stops at which something latent has a prior.
    fn stops_with_noise(&self) -> Vec<LinearStop<'_>> {
        self.linear().stops().filter(|stop| stop.prior().iter().any(|prior| *prior > 0.0)).collect()
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

    /// What is latent at stops, with its covariance, tells of the sizes.
    fn tallies<'a>(&self, stops: impl Iterator<Item = (&'a LinearStop<'a>, &'a DMatrix<f64>)>) -> Tallies {
        let (Adjustment { problem, state }, cov) = (&self.adjustment, &self.covariance);
        let (robot, noise) = (&state.robot, &problem.noise);
        let n = robot.chain.readings.len();
        let mut own = vec![Tally::new(n); noise.joint.len()];
        let mut local = Tally::new(n);
        let mut displacement = Tally::new(noise.displacement.len());
        for (at, c) in stops {
            let LinearStop { stop, joint_errors, .. } = at;
            for image in at.images() {
                let [_, places] = image.latents();
                for (component, (k, value)) in places.zip(image.tie.displacement()).enumerate() {
                    let size = problem.size_of_displacement(image.image, component);
                    let prior = problem.displacement_variance(image.image, component);
                    displacement.add(size, *value, c[(k, k)], prior, prior);
                }
            }
            for (r, value) in joint_errors.iter().enumerate() {
                let [own_part, local_part] = problem.joint_error_variance(stop, r);
                let prior = own_part + local_part;
                own[stop.series].add(r, *value, c[(r, r)], prior, own_part);
                if local_part > 0.0 {
                    local.add(r, *value, c[(r, r)], prior, local_part);
                }
            }
        }
        let first = problem.layout.terms.start;
        for c in problem.layout.locals.clone().filter(|&c| cov.system.touched(c)) {
            let term = &robot.terms[c - first];
            let prior = noise.local[term.reading].powi(2);
            local.add(term.reading, term.value, cov.reduced[(c, c)], prior, prior);
        }
        Tallies { own, local, displacement }
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

/// Sums of squares of latents per reading, and how many of them the data determine.
#[derive(Debug, Clone)]
pub struct Tally {
    /// Sums of squares, rad^2 or m^2.
    pub squares: Vec<f64>,
    /// Redundancies.
    pub redundancy: Vec<f64>,
    /// Sums of squares of the redundancies of single latents: half of it is the information on the logarithm of the variance.
    pub information: Vec<f64>,
}

impl Tally {
    /// Nothing counted yet.
    pub fn new(readings: usize) -> Self {
        Self { squares: vec![0.0; readings], redundancy: vec![0.0; readings], information: vec![0.0; readings] }
    }

    /// Counts the square of a latent, and how far the data determine it.
    pub fn count(&mut self, reading: usize, square: f64, redundancy: f64) {
        self.squares[reading] += square;
        self.redundancy[reading] += redundancy;
        self.information[reading] += redundancy * redundancy;
    }

    /// Variance of the readings of a group together; `None` where the data say nothing.
    pub fn common(&self, group: &[usize]) -> Option<f64> {
        let sum = |v: &[f64]| group.iter().map(|&r| v[r]).sum::<f64>();
        let free = sum(&self.redundancy);
        (free > 1e-9).then(|| (sum(&self.squares) / free).max(JOINT_NOISE_FLOOR * JOINT_NOISE_FLOOR))
    }

    /// As [`Tally::common`], drawn to what is usual of all series.
    pub fn drawn(&self, group: &[usize], overall: Option<f64>) -> Option<f64> {
        let free = group.iter().map(|&r| self.redundancy[r]).sum::<f64>();
        let squares = group.iter().map(|&r| self.squares[r]).sum::<f64>();
        overall.map(|overall| (squares + SHRINKAGE * overall) / (free + SHRINKAGE))
    }

    /// Geometric mean over the series of the variance of the readings of a group, by what is told of each: a noisy series must not draw the others.
    pub fn usual<'a>(all: impl Iterator<Item = (&'a Self, Vec<usize>)>) -> Option<f64> {
        let (mut sum, mut weight) = (0.0, 0.0);
        for (tally, group) in all {
            let Some(variance) = tally.common(&group) else { continue };
            let told: f64 = group.iter().map(|&r| tally.redundancy[r]).sum();
            sum += told * variance.ln();
            weight += told;
        }
        (weight > 0.0).then(|| (sum / weight).exp())
    }

    /// All series together.
    pub fn together(all: &[Self], readings: usize) -> Self {
        all.iter().fold(Self::new(readings), |sum, tally| sum.with(tally, |_| true))
    }

    fn with(mut self, other: &Self, which: impl Fn(usize) -> bool) -> Self {
        for r in (0..self.squares.len()).filter(|&r| which(r)) {
            self.squares[r] += other.squares[r];
            self.redundancy[r] += other.redundancy[r];
            self.information[r] += other.information[r];
        }
        self
    }

    /// Adds a latent with its prior variance and the variance that the data leave it. Where the latent is the sum of several,
    /// `part` is the variance of the one that is counted: its share in the estimate, and in what was learnt of it.
    fn add(&mut self, reading: usize, value: f64, left: f64, prior: f64, part: f64) {
        let share = part / prior;
        self.count(reading, (share * value).powi(2), share * (1.0 - left / prior).max(0.0));
    }
}

/// What is latent at the stops tells of each size.
struct Tallies {
    /// Noise of the stops by themselves, per series.
    own: Vec<Tally>,
    local: Tally,
    /// Apparent displacements, indexed as their sizes.
    displacement: Tally,
}

impl Tallies {
    /// Noise of the stops by themselves, and local errors where stops share readings.
    fn update_joint(&self, kinds: &[JointKind], noise: &mut Noise) -> f64 {
        let n = kinds.len();
        let Self { own, local, .. } = self;
        let together = Tally::together(own, n);
        let mut change: f64 = 0.0;
        for group in noise.groups(kinds) {
            if noise.local.get(group[0]).is_some_and(|s| *s > 0.0) {
                // A few postures tell little of their local errors: they are drawn to the noise of all joints of the kind.
                let alike: Vec<usize> = (0..n).filter(|&r| kinds[r] == kinds[group[0]]).collect();
                let whole = local.clone().with(&together, |r| noise.local[r] == 0.0);
                let common = whole.common(&alike);
                change = change.max(share_out(&group, local, common, &mut noise.local));
            }
            let overall = Tally::usual(own.iter().map(|tally| (tally, group.clone())));
            for (tally, sigma) in own.iter().zip(&mut noise.joint) {
                change = change.max(share_out(&group, tally, tally.drawn(&group, overall), sigma));
            }
        }
        change
    }
}

fn update_displacements(tally: &Tally, noise: &mut Noise) -> f64 {
    let mut change: f64 = 0.0;
    for all in noise.displacement_groups() {
        let usual = Tally::usual(all.iter().map(|&size| (tally, vec![size])));
        change = change.max(share_out(&all, tally, usual, &mut noise.displacement));
    }
    change
}

/// A variance of less than so many of its own standard deviations may be none: to go on towards it changes nothing.
const NOT_TOLD_SIGMAS: f64 = 0.3;

/// True for a variance of which the data say less than [`NOT_TOLD_SIGMAS`]: its standard deviation over itself is `sqrt(2 / information)`.
fn is_not_told(information: f64) -> bool {
    (0.5 * information).sqrt() < NOT_TOLD_SIGMAS
}

/// New noise from the sum of squares and the redundancy of each reading's latents; every reading is drawn to the common
/// variance. Returns the largest relative change, but for sizes that go to nothing and matter no more.
pub fn share_out(group: &[usize], tally: &Tally, common: Option<f64>, sigma: &mut [f64]) -> f64 {
    let mut change: f64 = 0.0;
    let Some(common) = common else { return change };
    let (squares, redundancy) = (&tally.squares, &tally.redundancy);
    for &r in group {
        let variance = (squares[r] + SHRINKAGE * common) / (redundancy[r] + SHRINKAGE);
        let next = variance.sqrt().clamp(JOINT_NOISE_FLOOR, 2.0 * sigma[r].max(JOINT_NOISE_FLOOR));
        if next > sigma[r] || !is_not_told(tally.information[r]) {
            change = change.max((next / sigma[r] - 1.0).abs());
        }
        sigma[r] = next;
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
        let k = 2.45;
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
