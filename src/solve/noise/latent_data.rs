//! Sizes of what is latent, estimated to the end at one linearisation.
//!
//! With the prior variances `D` of what is latent at a stop and its posterior mean `l` and covariance `C`, everything else estimated, the data by
//! themselves say `J = C^-1 - D^-1` and `J m = C^-1 l`. Under other variances `D'` follow `C' = (J + D'^-1)^-1` and `l' = C' J m`, from which sizes are
//! estimated anew: rounds that solve no equations of the whole. How the parameters depend on the sizes is left to the rounds that do.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::acceleration::Acceleration;
use super::components::ComponentOptions;
use super::latent::{Latent, local_latents, stop_latents};
use super::tally::{JOINT_NOISE_FLOOR, Tallies};
use crate::problem::Noise;
use crate::solve::linear::LinearStop;
use crate::solve::optimum::fit::Fit;
use crate::urdf::JointKind;

/// Relative change of every size below which the rounds end.
const STANDS: f64 = 1e-3;

/// Most rounds.
const MOST_ROUNDS: usize = 40;

/// Relative change in the first round above which it is the only one: parameters follow that far.
const FAR_OFF: f64 = 0.7;

/// Most that a size grows: beyond that, the linearisation says little of it.
const MOST_GROWTH: f64 = 8.0;

/// What the data say of latents that have a prior of their own.
struct OfData {
    latents: Vec<Latent>,
    /// `J`.
    information: DMatrix<f64>,
    /// `J m`.
    pull: DVector<f64>,
}

/// What the data say of everything latent.
pub struct LatentData {
    all: Vec<OfData>,
    /// Variances of the sizes that it was found with.
    variances: Vec<f64>,
    nothing: Tallies,
}

impl Fit {
    /// From the covariances of what is latent at the stops where something has a prior.
    pub(super) fn latent_data(&self, stops: &[LinearStop], covariances: &[DMatrix<f64>]) -> LatentData {
        let (problem, cov, robot) = (&self.problem, &self.covariance, &self.state.robot);
        let (noise, readings) = (&problem.noise, robot.chain.readings.len());
        let of_stop = |(stop, covariance): (&LinearStop, &DMatrix<f64>)| {
            OfData::new(stop_latents(&self.adjustment, stop), &stop.values(), covariance, &stop.prior())
        };
        let first = problem.layout.terms.start;
        let of_local = |latent: Latent| {
            let value = DVector::from_element(1, robot.terms[latent.row - first].value);
            let covariance = DMatrix::from_element(1, 1, cov.reduced[(latent.row, latent.row)]);
            let prior = latent.sigma.powi(-2);
            OfData::new(vec![Latent { row: 0, ..latent }], &value, &covariance, &[prior])
        };
        let local = local_latents(&self.adjustment, |c| cov.system.touched(c), noise.joint.len() * readings);
        let of_stops = stops.iter().zip(covariances).filter_map(of_stop);
        LatentData {
            all: of_stops.chain(local.into_iter().filter_map(of_local)).collect(),
            variances: noise.latent_sizes().map(|s| s * s).collect(),
            nothing: Tallies::new(noise, readings),
        }
    }
}

impl OfData {
    /// `None` where nothing is latent, or the covariance is not positive definite.
    fn new(latents: Vec<Latent>, values: &DVector<f64>, covariance: &DMatrix<f64>, prior: &[f64]) -> Option<Self> {
        if latents.is_empty() {
            return None;
        }
        let mut information = covariance.clone().cholesky()?.inverse();
        let pull = &information * values;
        prior.iter().enumerate().for_each(|(k, prior)| information[(k, k)] -= prior);
        Some(Self { latents, information, pull })
    }

    /// Mean and variance of every latent under prior variances that are larger than those by factors of the sizes, with its prior variance.
    fn under(&self, factors: &[f64]) -> Option<Vec<[f64; 3]>> {
        let prior =
            |l: &Latent| l.sigma.powi(2) * l.parts.iter().map(|(size, share)| share * factors[*size]).sum::<f64>();
        let priors: Vec<f64> = self.latents.iter().map(prior).collect();
        let mut information = self.information.clone();
        self.latents.iter().zip(&priors).for_each(|(l, prior)| information[(l.row, l.row)] += 1.0 / prior);
        let covariance = information.cholesky()?.inverse();
        let mean = &covariance * &self.pull;
        let of = |(l, prior): (&Latent, &f64)| [mean[l.row], covariance[(l.row, l.row)], *prior];
        Some(self.latents.iter().zip(&priors).map(of).collect())
    }
}

impl LatentData {
    /// Estimates the sizes; returns the largest relative change of the first round, which tells how far they were off. After that round, sizes that
    /// shrink and may be none stay: of a few stops they would go to nothing, and to overstate them is harmless.
    pub fn update(&self, options: &ComponentOptions, kinds: &[JointKind], noise: &mut Noise) -> f64 {
        let keep = |round: usize, found: &Tallies, before: &[f64], noise: &mut Noise| {
            if round > 0 {
                found.keep_untold(before, noise);
            }
        };
        self.rounds(options, kinds, noise, keep)
    }

    /// As [`LatentData::update`], with sizes that may be none where the likelihood has its maximum.
    pub fn most_likely(&self, options: &ComponentOptions, kinds: &[JointKind], noise: &mut Noise) {
        self.rounds(options, kinds, noise, |_, _, _, _| ());
    }

    fn rounds(
        &self,
        options: &ComponentOptions,
        kinds: &[JointKind],
        noise: &mut Noise,
        keep: impl Fn(usize, &Tallies, &[f64], &mut Noise),
    ) -> f64 {
        let nonzero = noise.latent_sizes().filter(|s| *s > 0.0);
        let most: Vec<f64> = nonzero.map(|s| MOST_GROWTH * s.max(JOINT_NOISE_FLOOR)).collect();
        let (mut acceleration, mut first) = (Acceleration::default(), None);
        for round in 0..MOST_ROUNDS {
            let before: Vec<f64> = noise.latent_sizes().collect();
            let found = self.tallies(noise);
            let mut change: f64 = 0.0;
            if options.displacement {
                change = change.max(found.update_displacements(noise));
            }
            if options.joint {
                change = change.max(found.update_joint(kinds, noise));
            }
            keep(round, &found, &before, noise);
            if change < STANDS || *first.get_or_insert(change) > FAR_OFF {
                break;
            }
            let next =
                acceleration.next_after(change, &logarithms(before.iter().copied()), logarithms(noise.latent_sizes()));
            let sizes = noise.latent_sizes_mut().zip(&before).filter(|(size, _)| **size > 0.0);
            for (k, (size, _)) in sizes.enumerate().filter(|(_, (size, before))| **size != **before) {
                *size = next[k].exp().clamp(JOINT_NOISE_FLOOR, most[k]);
            }
        }
        first.unwrap_or_default()
    }

    /// Under the sizes of a noise.
    fn tallies(&self, noise: &Noise) -> Tallies {
        let ratio = |(own, before): (f64, &f64)| if *before > 0.0 { own * own / before } else { 1.0 };
        let factors: Vec<f64> = noise.latent_sizes().zip(&self.variances).map(ratio).collect();
        let under: Vec<_> = self.all.par_iter().map(|data| data.under(&factors)).collect();
        let mut tallies = self.nothing.clone();
        for (data, latents) in self.all.iter().zip(under) {
            for (latent, [value, left, prior]) in data.latents.iter().zip(latents.into_iter().flatten()) {
                for (size, share) in latent.parts.iter().filter(|(_, share)| *share > 0.0) {
                    let share = latent.sigma.powi(2) * share * factors[*size] / prior;
                    tallies.add(*size, value, left, prior, share);
                }
            }
        }
        tallies
    }
}

/// Logarithms of the sizes that are not zero.
fn logarithms(sizes: impl Iterator<Item = f64>) -> DVector<f64> {
    DVector::from_vec(sizes.filter(|s| *s > 0.0).map(f64::ln).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two latents of one size and one of another, as one equation of all three tells them.
    fn data(variances: [f64; 2], count: usize) -> Vec<OfData> {
        let latent =
            |row: usize, size: usize| Latent { row, sigma: variances[size].sqrt(), parts: [(size, 1.0), (size, 0.0)] };
        let of = |k: usize| {
            let a = DMatrix::from_fn(3, 3, |i, j| ((3 * i + 7 * j + k) as f64).sin());
            let mut information = &a * a.transpose();
            let prior = [1.0 / variances[0], 1.0 / variances[0], 1.0 / variances[1]];
            (0..3).for_each(|i| information[(i, i)] += prior[i]);
            let covariance = information.cholesky().unwrap().inverse();
            let values = &covariance * (&a * DVector::from_fn(3, |i, _| ((5 * i + 11 * k) as f64).cos()));
            OfData::new(vec![latent(0, 0), latent(1, 0), latent(2, 1)], &values, &covariance, &prior).unwrap()
        };
        (0..count).map(of).collect()
    }

    #[test]
    fn other_variances_need_no_other_linearisation() {
        let (narrow, wide) = (data([0.3, 2.0], 5), data([0.9, 0.5], 5));
        for (from, direct) in narrow.iter().zip(&wide) {
            let found = from.under(&[3.0, 0.25]).unwrap();
            for (found, direct) in found.iter().flatten().zip(direct.under(&[1.0, 1.0]).unwrap().iter().flatten()) {
                assert!((found - direct).abs() < 1e-12 * (1.0 + direct.abs()));
            }
        }
    }
}
