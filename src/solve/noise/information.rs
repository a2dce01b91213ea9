//! How well the data tell the sizes of the joint noise and of the twists: the information of restricted maximum likelihood on its variances.
//!
//! With the latents `l ~ N(0, D)`, their posterior covariance `C` over all images and `R = 1 - D^-1/2 C D^-1/2`, the information
//! on the logarithms of two variances is `F_ab = 1/2 sum_ij p_ia R_ij^2 p_jb`, where `p_ia` is the share of variance `a` in the
//! latent `i` (D. Harville, *Maximum likelihood approaches to variance component estimation*, 1977). See the formulation.

use nalgebra::{DMatrix, DVector};

use super::latent::{Latent, local_latents, stop_latents};
use super::tally::{JOINT_NOISE_FLOOR, SHRINKAGE};
use crate::linalg::SymmetricFactor;
use crate::problem::{Adjustment, Family, FamilyKind, Noise, Problem};
use crate::solve::elimination::system::Elimination;
use crate::solve::optimum::covariance::Covariance;
use crate::solve::optimum::fit::Fit;
use crate::urdf::JointKind;

/// Latents up to which those of different stops are taken together; of more, their coupling through the parameters is
/// a small part, and leaving it out states too large a spread.
const MOST_COUPLED: usize = 1200;

/// Covariance of the variances of the joint noise.
#[derive(Debug, Clone)]
pub struct NoiseInformation {
    readings: usize,
    series: usize,
    locals: usize,
    /// Of the joint noise per series and reading, of the local errors per reading, of the tilts per series, rad^2 or m^2; then the
    /// square of the factor on the stated sizes of the twists, where that is estimated.
    pub(super) variances: Vec<f64>,
    /// Covariance of the logarithms of those that the data touch, with their indices.
    covariance: DMatrix<f64>,
    pub(super) touched: Vec<usize>,
    /// Covariance of what is found of joints that are alike: drawing them together then takes scatter away and adds no bias.
    pub(super) scatter: DMatrix<f64>,
    /// Latents of all stops, where they are taken together, with the covariance that has them among its unknowns, where it is
    /// not the given one.
    pub(super) together: Vec<Latent>,
    pub(super) coupled: Option<Covariance>,
}

/// A standard deviation with what the data leave open.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Estimated variance.
    pub variance: f64,
    /// Standard deviation of it.
    pub sigma: f64,
}

impl Spread {
    /// Interval of the standard deviation: that of the variance at `z` of its sigmas, which is normal down to zero.
    pub fn interval(&self, z: f64) -> [f64; 2] {
        [self.variance - z * self.sigma, self.variance + z * self.sigma].map(|v| v.max(0.0).sqrt())
    }

    /// Standard deviation of the standard deviation: half its one-sigma interval.
    pub fn of_root(&self) -> f64 {
        let [low, high] = self.interval(1.0);
        0.5 * (high - low)
    }
}

/// The information of the data on so many variances, and the latents of all stops, where they are taken together.
fn from_data(fit: &Fit, cov: &Covariance, sizes: usize) -> (DMatrix<f64>, Vec<Latent>) {
    let (linear, Adjustment { problem, state }) = (fit.linear(), &fit.adjustment);
    let (readings, series) = (state.robot.chain.readings.len(), problem.noise.joint.len());
    let twists = problem.families.iter().find(|f| f.kind == FamilyKind::Twists);
    let mut information = DMatrix::zeros(sizes, sizes);
    let mut add = |a: &Latent, b: &Latent, covariance: f64| {
        let r = f64::from(a.row == b.row) - covariance / (a.sigma * b.sigma);
        for (ca, pa) in a.parts {
            b.parts.iter().for_each(|(cb, pb)| information[(ca, *cb)] += 0.5 * pa * r * r * pb);
        }
    };
    let touched = |c: usize| problem.layout.columns[c].free && cov.system.touched(c);
    let mut dense = local_latents(&fit.adjustment, touched, series * readings);
    dense.extend(twists.into_iter().flat_map(|f| twist_latents(problem, f, touched, sizes - 1)));
    for a in &dense {
        dense.iter().for_each(|b| add(a, b, cov.reduced[(a.row, b.row)]));
    }
    let mut together = Vec::new();
    let of_stops: Vec<Vec<Latent>> = linear.stops().map(|stop| stop_latents(&fit.adjustment, &stop)).collect();
    if cov.system.latent_start.is_empty() {
        let covariances = cov.latents(&linear.stops().collect::<Vec<_>>());
        for (c, own) in covariances.iter().zip(&of_stops) {
            own.iter().for_each(|a| own.iter().for_each(|b| add(a, b, c[(a.row, b.row)])));
        }
    } else {
        let starts = cov.system.latent_start.iter();
        let placed = of_stops.into_iter().zip(starts);
        let all: Vec<Latent> = (placed.flat_map(|(own, start)| own.into_iter().map(move |l| (l, *start))))
            .map(|(l, start)| Latent { row: start + l.row, ..l })
            .collect();
        for a in &all {
            all.iter().for_each(|b| add(a, b, cov.reduced[(a.row, b.row)]));
            dense.iter().for_each(|b| {
                add(a, b, cov.reduced[(a.row, b.row)]);
                add(b, a, cov.reduced[(b.row, a.row)]);
            });
        }
        together = dense.into_iter().chain(all).collect();
    }
    (information, together)
}

/// The information at a solution; `None` without joint noise, or where the data do not tell it at all.
pub fn noise_information(fit: &Fit) -> Option<NoiseInformation> {
    let (linear, Adjustment { problem, state }, cov) = (fit.linear(), &fit.adjustment, &fit.covariance);
    let (readings, series) = (state.robot.chain.readings.len(), problem.noise.joint.len());
    let latent: usize = linear.stops().map(|stop| stop.unknowns()).sum();
    let coupled = if cov.system.latent_start.is_empty() && latent <= MOST_COUPLED {
        Some(linear.covariance_by(Elimination::Markers).ok()?)
    } else {
        None
    };
    let cov = coupled.as_ref().unwrap_or(cov);
    let of_errors = problem.noise.latent_sizes();
    let twists = problem.families.iter().find(|f| f.kind == FamilyKind::Twists);
    let variances: Vec<f64> = of_errors.chain(twists.map(|f| f.factor)).map(|s| s * s).collect();
    let of_twists = variances.len() - usize::from(twists.is_some());
    let (mut information, together) = from_data(fit, cov, variances.len());
    let touched: Vec<usize> = (0..variances.len()).filter(|&c| information[(c, c)] > 0.0).collect();
    touched.iter().find(|c| **c < of_twists)?;
    let of_touched =
        |m: &DMatrix<f64>| DMatrix::from_fn(touched.len(), touched.len(), |a, b| m[(touched[a], touched[b])]);
    let of_data = of_touched(&information);
    draw_together(
        &problem.noise,
        &state.robot.chain.reading_kinds,
        &variances[..of_twists],
        &touched,
        &mut information,
    );
    if let Some(family) = twists {
        information[(of_twists, of_twists)] += 0.5 * family.drawn;
    }
    let factor = SymmetricFactor::new(&of_touched(&information)).ok()?;
    let covariance = factor.inverse();
    let scatter = &covariance * of_data * &covariance;
    let locals = problem.noise.local.len();
    Some(NoiseInformation { readings, series, locals, variances, covariance, touched, scatter, together, coupled })
}

/// Twists whose common size is estimated: their priors have one variance.
fn twist_latents(
    problem: &Problem,
    family: &Family,
    touched: impl Fn(usize) -> bool,
    component: usize,
) -> impl Iterator<Item = Latent> {
    let used = family.columns.iter().filter(move |&&c| touched(c));
    used.map(move |&row| {
        let sigma = problem.layout.columns[row].prior_sigma;
        Latent { row, sigma, parts: [(component, 1.0), (component, 0.0)] }
    })
}

/// Every variance is drawn to a common one as by so many observations, as in the estimate: joint noise to that of the readings of its group in the
/// series, this and apparent displacements to that of all series, local errors to that of all readings of the kind, in which every variance counts
/// with its size and its information.
fn draw_together(
    noise: &Noise,
    kinds: &[JointKind],
    variances: &[f64],
    touched: &[usize],
    information: &mut DMatrix<f64>,
) {
    let (n, series) = (kinds.len(), noise.joint.len());
    let is_local = |r: usize| noise.local.get(r).is_some_and(|s| *s > 0.0);
    let weight: Vec<f64> = variances.iter().enumerate().map(|(c, v)| v * information[(c, c)]).collect();
    let mean = |of: &[(usize, f64)]| {
        let of: Vec<_> = of.iter().filter(|(c, _)| touched.contains(c)).collect();
        let whole: f64 = of.iter().map(|(_, w)| w).sum();
        let mut mean = DVector::zeros(information.nrows());
        of.iter().for_each(|(c, w)| mean[*c] += w / whole);
        (whole > 0.0).then_some(mean)
    };
    let mut drawn = Draws::new();
    for group in noise.groups(kinds) {
        draw_readings(&mut drawn, &group, n, series);
        if is_local(group[0]) {
            let alike = (0..n).filter(|&r| kinds[r] == kinds[group[0]]);
            let (local, others): (Vec<usize>, Vec<usize>) = alike.partition(|&r| is_local(r));
            let local: Vec<usize> = local.iter().map(|r| series * n + r).collect();
            let own = (0..series).flat_map(|s| others.iter().map(move |r| s * n + r));
            let common: Vec<_> = local.iter().copied().chain(own).map(|c| (c, weight[c])).collect();
            drawn.extend(local.iter().map(|c| (alone(*c), common.clone())));
        }
    }
    for group in noise.displacement_groups() {
        let group: Vec<usize> = group.iter().map(|k| series * n + noise.local.len() + k).collect();
        let all: Vec<_> = group.iter().flat_map(|c| alone(*c)).collect();
        drawn.extend(group.iter().map(|c| (alone(*c), all.clone())));
    }
    let contrast = |(from, to): &(Weighted, Weighted)| Some(mean(from)? - mean(to)?);
    let contrasts: Vec<DVector<f64>> = drawn.iter().filter_map(contrast).collect();
    contrasts.iter().for_each(|contrast| information.ger(0.5 * SHRINKAGE, contrast, contrast, 1.0));
}

/// Variances with their weights in a mean.
type Weighted = Vec<(usize, f64)>;
/// Means, and those that they are drawn to.
type Draws = Vec<(Weighted, Weighted)>;

fn alone(variance: usize) -> Weighted {
    vec![(variance, 1.0)]
}

/// The joint noise of a group of `n` readings in every series to that of the group there, and this to that of all series.
fn draw_readings(drawn: &mut Draws, group: &[usize], n: usize, series: usize) {
    let of = |s: usize| group.iter().map(move |r| (s * n + r, 1.0)).collect::<Weighted>();
    let overall: Weighted = (0..series).flat_map(of).collect();
    for s in 0..series {
        drawn.extend(of(s).iter().map(|(c, _)| (alone(*c), of(s))));
        drawn.push((of(s), overall.clone()));
    }
}

impl NoiseInformation {
    /// Without what it would need for [`crate::solve::NoiseUncertainty`].
    pub fn of_sizes(self) -> Self {
        Self { together: Vec::new(), coupled: None, ..self }
    }

    /// Root mean square of the joint noise of some readings in some series, rad or m, as a fit has it, and its interval at `z` sigmas: that of what
    /// counts as none starts at none.
    pub fn joint_noise(&self, noise: &Noise, series: &[usize], readings: &[usize], z: f64) -> (f64, [f64; 2]) {
        let local = |r: usize| noise.local.get(r).copied().unwrap_or(0.0);
        let sizes = || series.iter().flat_map(|s| readings.iter().map(|&r| noise.joint[*s][r].hypot(local(r))));
        let counted = sizes().filter(|size| *size > JOINT_NOISE_FLOOR);
        let sum: f64 = counted.map(|size| size * size).sum();
        let [low, high] = self.mean_variance(series, readings).interval(z);
        ((sum / sizes().count() as f64).sqrt(), [if sum > 0.0 { low } else { 0.0 }, high])
    }

    /// Mean variance of some readings in some series (the noise of the stops and local errors together).
    pub fn mean_variance(&self, series: &[usize], readings: &[usize]) -> Spread {
        let among = |all: &[usize], k: usize| if all.contains(&k) { 1.0 / all.len() as f64 } else { 0.0 };
        let shares: Vec<f64> = (0..self.series).map(|s| among(series, s)).collect();
        let weights: Vec<f64> = (0..self.readings).map(|r| among(readings, r)).collect();
        let (sum, are_told) = self.weighted(&shares, &weights);
        if are_told { sum } else { Spread { sigma: f64::INFINITY, ..sum } }
    }

    /// Sum of the variances of the readings with these weights, each the mean over the series with these shares; with whether the data tell of all of
    /// them: the others count as known.
    pub fn weighted(&self, shares: &[f64], weights: &[f64]) -> (Spread, bool) {
        let mut gradient = DVector::zeros(self.touched.len());
        let (mut variance, mut are_told) = (0.0, true);
        let first = self.series * self.readings;
        for (r, weight) in weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
            let own = shares.iter().enumerate().map(|(s, share)| (s * self.readings + r, *share));
            let local = Some((first + r, 1.0)).filter(|(c, _)| r < self.locals && self.variances[*c] > 0.0);
            for (c, share) in own.chain(local).filter(|(_, share)| *share > 0.0) {
                let part = self.variances[c] * share * weight;
                variance += part;
                match self.touched.iter().position(|t| *t == c) {
                    Some(at) => gradient[at] += part,
                    None => are_told = false,
                }
            }
        }
        let sigma = (&self.covariance * &gradient).dot(&gradient).max(0.0).sqrt();
        (Spread { variance, sigma }, are_told)
    }
}
