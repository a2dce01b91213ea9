//! What is latent at the stops tells of the sizes of its priors: sums of squares, redundancies, and the sizes that follow.

use crate::problem::Noise;
use crate::urdf::JointKind;

/// Smallest joint noise, rad or m: a tenth of what forty images of a good camera can tell from none.
pub const JOINT_NOISE_FLOOR: f64 = 1e-7;

/// Weight, in observations, with which the noise of a single joint is drawn to that of all joints of its series, and this to what is usual of all series.
pub(super) const SHRINKAGE: f64 = 5.0;

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

    /// Of some of its readings.
    fn part(&self, readings: std::ops::Range<usize>) -> Self {
        let of = |all: &[f64]| all[readings.clone()].to_vec();
        Self { squares: of(&self.squares), redundancy: of(&self.redundancy), information: of(&self.information) }
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

    /// Adds a latent with its prior variance and the variance that the data leave it. Where the latent is the sum of several, the one that is counted
    /// has a `share` of the prior variance: its share in the estimate, and in what was learnt of it.
    fn add(&mut self, reading: usize, value: f64, left: f64, prior: f64, share: f64) {
        self.count(reading, (share * value).powi(2), share * (1.0 - left / prior).max(0.0));
    }
}

/// What is latent at the stops tells of each size.
#[derive(Debug, Clone)]
pub struct Tallies {
    /// In the order of [`Noise::latent_sizes`].
    all: Tally,
    series: usize,
    readings: usize,
    locals: usize,
}

impl Tallies {
    /// Nothing counted yet of `readings` and their noise.
    pub fn new(noise: &Noise, readings: usize) -> Self {
        let all = Tally::new(noise.latent_sizes().count());
        Self { all, series: noise.joint.len(), readings, locals: noise.local.len() }
    }

    /// As [`Tally::add`], for a size by its place among [`Noise::latent_sizes`].
    pub fn add(&mut self, size: usize, value: f64, left: f64, prior: f64, share: f64) {
        self.all.add(size, value, left, prior, share);
    }

    /// Sizes that shrink and may be none go back to where they were `before`.
    pub fn keep_untold(&self, before: &[f64], noise: &mut Noise) {
        let sizes = noise.latent_sizes_mut().zip(before).zip(&self.all.information);
        for ((size, before), _) in sizes.filter(|((s, before), told)| **s < **before && is_not_told(**told)) {
            *size = *before;
        }
    }

    /// New sizes of the apparent displacements; returns as [`share_out`].
    pub fn update_displacements(&self, noise: &mut Noise) -> f64 {
        let tally = self.all.part(self.series * self.readings + self.locals..self.all.squares.len());
        let mut change: f64 = 0.0;
        for all in noise.displacement_groups() {
            let usual = Tally::usual(all.iter().map(|&size| (&tally, vec![size])));
            change = change.max(share_out(&all, &tally, usual, &mut noise.displacement));
        }
        change
    }

    /// Noise of the stops by themselves, and local errors where stops share readings.
    pub fn update_joint(&self, kinds: &[JointKind], noise: &mut Noise) -> f64 {
        let n = self.readings;
        let own: Vec<Tally> = (0..self.series).map(|s| self.all.part(s * n..(s + 1) * n)).collect();
        let local = &self.all.part(self.series * n..self.series * n + self.locals);
        let together = Tally::together(&own, n);
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
