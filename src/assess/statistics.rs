//! Small statistics of comparisons.

use std::collections::BTreeMap;
use std::ops::Range;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// A ratio with its interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Ratio {
    /// Ratio of the root mean squares.
    pub value: f64,
    /// 2.5 % point over resampled units.
    pub low: f64,
    /// 97.5 % point.
    pub high: f64,
}

impl std::fmt::Display for Ratio {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{:.3} ({:.3} to {:.3})", self.value, self.low, self.high)
    }
}

/// Resamplings of a bootstrap.
const RESAMPLINGS: usize = 2000;

/// Ratio of the RMS of `a` to that of `b`, paired by unit (a seed, or images that share joint readings): `(sum of squares, weight)` each, with the
/// percentile bootstrap interval over units. The same input gives the same interval. `None` without units or where b is zero.
pub fn bootstrap_ratio(a: &[(f64, f64)], b: &[(f64, f64)]) -> Option<Ratio> {
    let n = a.len();
    if n == 0 || n != b.len() {
        return None;
    }
    let ratio = |units: &mut dyn Iterator<Item = usize>| {
        let (mut sa, mut wa, mut sb, mut wb) = (0.0, 0.0, 0.0, 0.0);
        for i in units {
            sa += a[i].0;
            wa += a[i].1;
            sb += b[i].0;
            wb += b[i].1;
        }
        ((sa / wa) / (sb / wb)).sqrt()
    };
    let value = ratio(&mut (0..n));
    let mut rng = ChaCha8Rng::seed_from_u64(n as u64);
    let mut all: Vec<f64> = (0..RESAMPLINGS).map(|_| ratio(&mut (0..n).map(|_| rng.random_range(0..n)))).collect();
    all.retain(|r| r.is_finite());
    all.sort_by(f64::total_cmp);
    let at = |p: f64| all.get(((all.len() as f64 - 1.0) * p).round().max(0.0) as usize).copied();
    Some(Ratio { value, low: at(0.025)?, high: at(0.975)? }).filter(|r| r.value.is_finite())
}

/// Units of one cluster each, from units that are alike within clusters: an interval over these is wide enough.
///
/// `clusters` names the cluster of every unit.
pub fn by_cluster(clusters: &[usize], units: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut sums: BTreeMap<usize, (f64, f64)> = BTreeMap::new();
    for (cluster, unit) in clusters.iter().zip(units) {
        let sum = sums.entry(*cluster).or_default();
        *sum = (sum.0 + unit.0, sum.1 + unit.1);
    }
    sums.into_values().collect()
}

/// The smallest and the largest value; infinite of nothing.
pub(super) fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

/// Root of the mean square of `(sum of squares, weight)` units.
pub fn root_mean_square(units: &[(f64, f64)]) -> f64 {
    let (s, w) = units.iter().fold((0.0, 0.0), |(s, w), u| (s + u.0, w + u.1));
    (s / w).sqrt()
}

/// Root of the mean of squares that count alike.
pub fn root_of_mean(squares: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = squares.into_iter().fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0));
    (sum / count).sqrt()
}

/// Upper end of the 95 % interval of a sum of independent variances, each with the upper end of its own: `s + sqrt(sum_i (u_i - s_i)^2)`
/// (F. Graybill, C.-M. Wang, *Confidence intervals on nonnegative linear combinations of variances*, 1980).
pub fn most_of_sum(parts: impl IntoIterator<Item = [f64; 2]>) -> f64 {
    let (sum, squares) =
        parts.into_iter().fold((0.0, 0.0), |(sum, squares), [s, most]| (sum + s, squares + (most - s).powi(2)));
    sum + squares.sqrt()
}

/// Logarithm of the probability that so many parameters explain this share of so many squares or more, of Gaussian noise; of an odd number
/// of parameters a bound, that of one more.
pub fn log_chance(share: f64, squares: f64, parameters: usize) -> f64 {
    let pairs = parameters.div_ceil(2);
    let b = 0.5 * squares - pairs as f64;
    if b <= 0.0 {
        return 0.0;
    }
    let x = share.clamp(0.0, 1.0);
    let (mut term, mut sum) = (1.0, 0.0);
    for j in 0..pairs {
        sum += term;
        term *= (b + j as f64) * x / (j + 1) as f64;
    }
    b * (-x).ln_1p() + f64::ln(sum)
}

/// The run with the largest sum; of several the first, without what adds nothing at its ends. Empty where nothing is above zero.
pub fn best_run(gains: &[f64]) -> Range<usize> {
    let (mut best, mut most) = (0..0, 0.0);
    let (mut first, mut sum) = (0, 0.0);
    for (k, gain) in gains.iter().enumerate() {
        if sum <= 0.0 {
            (first, sum) = (k, 0.0);
        }
        sum += gain;
        if sum > most {
            (best, most) = (first..k + 1, sum);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_begins_and_ends_with_rows_that_gain() {
        assert_eq!(best_run(&[-1.0, 0.0, 2.0, -0.5, 1.0, 0.0, -1.0]), 2..5);
        assert_eq!(best_run(&[1.0, -3.0, 1.0, 1.0]), 2..4);
        assert_eq!(best_run(&[-1.0, 0.0]), 0..0);
    }

    #[test]
    fn the_interval_holds_the_ratio_and_narrows_with_more_units() {
        let units = |n: usize, size: f64, shift: f64| -> Vec<(f64, f64)> {
            (0..n).map(|k| (size * (1.0 + 0.8 * (k as f64 * 2.4 + shift).sin()), 1.0)).collect()
        };
        let width = |n: usize| {
            let r = bootstrap_ratio(&units(n, 4.0, 0.0), &units(n, 1.0, 1.0)).unwrap();
            assert!(r.low < r.value && r.value < r.high, "{r:?}");
            assert!((r.value - 2.0).abs() < 0.2, "{r:?}");
            r.high - r.low
        };
        // The width falls like one over the root of the number of units.
        let (few, many) = (width(20), width(320));
        assert!(many < 0.4 * few, "{few} {many}");
        assert_eq!(bootstrap_ratio(&[], &[]), None);
    }

    #[test]
    fn the_upper_end_of_a_sum_is_that_of_its_only_part_and_less_than_the_sum_of_all() {
        assert!((most_of_sum([[2.0, 5.0]]) - 5.0).abs() < 1e-12);
        assert!((most_of_sum([[2.0, 5.0], [0.0, 4.0]]) - 7.0).abs() < 1e-12);
        assert!(most_of_sum([]) == 0.0);
    }

    #[test]
    fn units_that_say_the_same_thing_four_times_count_once() {
        let units = |count: usize, repeats: usize, shift: f64| -> Vec<(f64, f64)> {
            (0..count * repeats).map(|k| (1.0 + 0.8 * ((k / repeats) as f64 * 2.4 + shift).sin(), 1.0)).collect()
        };
        let clusters: Vec<usize> = (0..48).map(|k| k / 4).collect();
        let (a, b) = (units(12, 4, 0.0), units(12, 4, 1.0));
        let once = bootstrap_ratio(&units(12, 1, 0.0), &units(12, 1, 1.0)).unwrap();
        let clustered = bootstrap_ratio(&by_cluster(&clusters, &a), &by_cluster(&clusters, &b)).unwrap();
        assert!((clustered.low - once.low).abs() < 1e-12 && (clustered.high - once.high).abs() < 1e-12);
        let as_if_apart = bootstrap_ratio(&a, &b).unwrap();
        assert!(
            as_if_apart.high - as_if_apart.low < 0.7 * (clustered.high - clustered.low),
            "{as_if_apart} {clustered}"
        );
    }

    fn chance(share: f64, squares: f64) -> f64 {
        log_chance(share, squares, 6).exp()
    }

    #[test]
    fn the_chance_is_that_of_a_beta_distribution() {
        // Of eight squares six are explained: the share has the density 3 x^2.
        for x in [0.1, 0.5, 0.9] {
            assert!((chance(x, 8.0) - (1.0 - x * x * x)).abs() < 1e-12);
        }
        assert!((chance(0.0, 100.0) - 1.0).abs() < 1e-12 && chance(1.0, 100.0) == 0.0);
        assert!((chance(0.999, 6.0) - 1.0).abs() < 1e-12, "nothing is left to compare with");
    }

    #[test]
    fn many_squares_make_it_chi_squared() {
        // The 99.9 % points of chi-squared with two, four and six degrees of freedom.
        for (parameters, point) in [(2, 13.816), (4, 18.467), (6, 22.458)] {
            assert!((log_chance(point / 1e6, 1e6, parameters).exp() - 1e-3).abs() < 1e-5);
        }
        assert!(log_chance(0.3, 40.0, 1) == log_chance(0.3, 40.0, 2), "of an odd number a bound");
    }
}
