//! Do the latent joint errors repeat where readings are near each other?
//!
//! Noise from stop to stop has no order. In the order of the readings of a joint its errors `e_1 .. e_n` then have the ratio
//! `sum (e_k - e_{k-1})^2 / sum (e_k - mean)^2` with mean 2 and variance `4 (n - 2) / (n^2 - 1)` (J. von Neumann, *Distribution of the ratio of the
//! mean square successive difference to the variance*, 1941). Errors of a drive, which come back with the reading, make it smaller.

use super::limits::Limits;
use crate::problem::Adjustment;
use crate::solve::JOINT_NOISE_FLOOR;

/// Fewest errors of a joint whose ratio has a variance.
const FEWEST: usize = 3;

/// Number of stops that tell together as much as one whose errors are its own: 1 where errors do not repeat.
pub fn stops_for_one(fit: &Adjustment, limits: &Limits) -> f64 {
    let repeats = Repeats::of(fit).filter(|r| r.deviate > limits.pattern_sigmas);
    repeats.map_or(1.0, |repeats| repeats.stops_for_one().max(1.0))
}

/// How joint errors repeat over neighbouring readings, all joints together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Repeats {
    /// Normal deviate of the ratios, positive where errors repeat.
    pub deviate: f64,
    /// Correlation of the errors at neighbouring readings, mean over the joints: half of what the ratio lacks of 2.
    correlation: f64,
}

impl Repeats {
    /// Of the latent errors of a fit; `None` where nothing is known of them.
    pub fn of(fit: &Adjustment) -> Option<Self> {
        let Adjustment { problem, state } = fit;
        let used = problem.used_stops();
        let of_joint = |reading: usize| {
            let errors = used.iter().filter_map(|&s| {
                let (stop, posture) = (&problem.stops[s], problem.stops[s].posture.as_ref()?);
                let is_noise = problem.noise.joint[stop.series][reading] > JOINT_NOISE_FLOOR;
                let error = state.joint_errors[s].get(reading).filter(|_| is_noise)?;
                Some((posture.readings[reading], *error))
            });
            Self::of_errors(errors.collect())
        };
        let found: Vec<Self> = (0..state.robot.chain.readings.len()).filter_map(of_joint).collect();
        let mean = |of: fn(&Self) -> f64| found.iter().map(of).sum::<f64>() / found.len() as f64;
        let deviate = (found.len() as f64).sqrt() * mean(|r| r.deviate);
        (!found.is_empty()).then(|| Self { deviate, correlation: mean(|r| r.correlation) })
    }

    /// Of `(reading, error)` of one joint; `None` for too few, or errors that are all the same.
    fn of_errors(mut errors: Vec<(f64, f64)>) -> Option<Self> {
        if errors.len() < FEWEST {
            return None;
        }
        errors.sort_by(|a, b| a.0.total_cmp(&b.0));
        let n = errors.len() as f64;
        let mean = errors.iter().map(|(_, e)| e).sum::<f64>() / n;
        let square: f64 = errors.iter().map(|(_, e)| (e - mean).powi(2)).sum();
        let steps: f64 = errors.windows(2).map(|pair| (pair[1].1 - pair[0].1).powi(2)).sum();
        let correlation = 1.0 - 0.5 * steps / square;
        let deviate = 2.0 * correlation / (4.0 * (n - 2.0) / (n * n - 1.0)).sqrt();
        deviate.is_finite().then_some(Self { deviate, correlation })
    }

    /// Number of stops that together tell as much as one whose errors are its own: `(1 + r) / (1 - r)` for a correlation that falls off by `r` from
    /// each reading to the next (M. Bartlett, *Some aspects of the time-correlation problem*, 1935).
    pub fn stops_for_one(&self) -> f64 {
        (1.0 + self.correlation) / (1.0 - self.correlation)
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::*;

    #[test]
    fn errors_that_come_back_with_the_reading_are_told_from_noise() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let readings: Vec<f64> = (0..60).map(|_| rng.random_range(0.0..0.5)).collect();
        let noise: Vec<f64> = (0..60).map(|_| rng.random_range(-1.0..1.0)).collect();
        let of = |errors: Vec<f64>| Repeats::of_errors(readings.iter().copied().zip(errors).collect()).unwrap();
        // One joint alone: noise beyond 4 sigmas is one in thirty thousand.
        assert!(of(noise.clone()).deviate.abs() < 4.0);
        // Over six periods, half of the squares being noise, the ratio is near 1.2: three sigmas and more.
        let order = readings.clone();
        let smooth = readings.iter().zip(&noise).map(|(q, e)| (75.0 * q).sin() + e).collect();
        assert!(of(smooth).deviate > 2.5);
        // An error that grows with the reading repeats so much that hardly one stop is left.
        assert!(of(order).stops_for_one() > 10.0);
        assert_eq!(Repeats::of_errors(vec![(0.0, 1.0), (1.0, 1.0), (2.0, 1.0)]), None);
    }
}
