//! How far the mean square of an error may be from what is expected of it.
//!
//! The error of the flange at a place is `d + J x` with a known `d` and `x ~ N(0, C)`: its mean square over places is a quadratic form
//! `x' A x + 2 g' x + d2`. In the principal axes of `C^1/2 A C^1/2` it is a sum over independent normal variables, `l y^2 + 2 h y`, whose
//! quantiles are taken from samples: closed approximations by moments miss the lower one (by Satterthwaite's, 97 of 100 lay in an interval of 95).

use nalgebra::{DMatrix, DVector, Matrix3xX, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::linalg::{product, symmetric_eigen};
use crate::solve::Spread;

/// Samples, of which a quantile of 2.5 % is known to 0.1 %.
const SAMPLES: usize = 20_000;

/// The seed of them: the same interval every time.
const SEED: u64 = 1995;

/// Share of the largest axis below which one does not count.
const NEGLIGIBLE: f64 = 1e-6;

/// Sums over places of a quadratic form in the errors of the model.
pub(super) struct MeanSquare {
    a: DMatrix<f64>,
    g: DVector<f64>,
    d2: f64,
    places: f64,
}

impl MeanSquare {
    /// Of nothing; `columns` is the length of `x`.
    pub fn new(columns: usize) -> Self {
        Self { a: DMatrix::zeros(columns, columns), g: DVector::zeros(columns), d2: 0.0, places: 0.0 }
    }

    /// Adds a place: its derivative by the columns and what is known of its error, m.
    pub fn add(&mut self, derivative: &Matrix3xX<f64>, known: &Vector3<f64>) {
        self.a.gemm_tr(1.0, derivative, derivative, 1.0);
        self.g.gemv_tr(1.0, derivative, known, 1.0);
        self.d2 += known.norm_squared();
        self.places += 1.0;
    }

    /// 95 % interval of the root mean square, m, for columns of this covariance, with the mean square `beside` it (m^2) that has nothing to do with
    /// them: its estimate is normal down to zero.
    pub fn interval_m(&self, covariance: &DMatrix<f64>, beside: Spread) -> [f64; 2] {
        let mut random = ChaCha8Rng::seed_from_u64(SEED - 1);
        let known = self.d2 / self.places.max(1.0);
        let mut with_others = || {
            let y: f64 = StandardNormal.sample(&mut random);
            known + (beside.variance + beside.sigma * y).max(0.0)
        };
        let mut squares: Vec<f64> = (0..SAMPLES).map(|_| with_others()).collect();
        for (k, [l, h]) in self.axes(covariance).unwrap_or_default().into_iter().enumerate() {
            // Each axis has samples of its own: one that hardly counts changes nothing of the others.
            let mut random = ChaCha8Rng::seed_from_u64(SEED + k as u64);
            for square in &mut squares {
                let y: f64 = StandardNormal.sample(&mut random);
                *square += y * (l * y + 2.0 * h);
            }
        }
        squares.sort_by(f64::total_cmp);
        [SAMPLES / 40, SAMPLES - SAMPLES / 40].map(|at| squares[at].max(0.0).sqrt())
    }

    /// `l` and the length of `h` of every axis that counts, the largest first: the direction of an axis is nobody's choice. `None` for what is
    /// not finite.
    fn axes(&self, covariance: &DMatrix<f64>) -> Option<Vec<[f64; 2]>> {
        let n = self.places.max(1.0);
        let (values, vectors) = symmetric_eigen(covariance)?;
        let root = vectors * DMatrix::from_diagonal(&values.map(|v| v.max(0.0).sqrt()));
        let (squares, turned) = symmetric_eigen(&(root.tr_mul(&product(&self.a, &root)) / n))?;
        let linear = turned.tr_mul(&(root.tr_mul(&self.g) / n));
        let least = NEGLIGIBLE * squares.amax().max(linear.amax());
        let all = squares.iter().zip(linear.iter()).rev().map(|(l, h)| [*l, h.abs()]);
        Some(all.filter(|[l, h]| l.abs() > least || h.abs() > least).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOTHING: Spread = Spread { variance: 0.0, sigma: 0.0 };

    #[test]
    fn as_many_mean_squares_lie_in_the_interval_as_it_says() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let columns = 4;
        let sigmas = [1e-3, 4e-4, 2e-4, 7e-4];
        let covariance = DMatrix::from_diagonal(&DVector::from_iterator(columns, sigmas.iter().map(|s| s * s)));
        let mut normal = || StandardNormal.sample(&mut random);
        let places: Vec<(Matrix3xX<f64>, Vector3<f64>)> = (0..40)
            .map(|_| (Matrix3xX::from_fn(columns, |_, _| normal()), 5e-4 * Vector3::from_fn(|_, _| normal())))
            .collect();
        let mut sums = MeanSquare::new(columns);
        places.iter().for_each(|(j, d)| sums.add(j, d));
        let [low, high] = sums.interval_m(&covariance, NOTHING);
        let trials = 4000;
        let inside = (0..trials)
            .filter(|_| {
                let x = DVector::from_iterator(columns, sigmas.iter().map(|s| s * normal()));
                let square: f64 = places.iter().map(|(j, d)| (d + j * &x).norm_squared()).sum();
                let rms = (square / places.len() as f64).sqrt();
                (low..high).contains(&rms)
            })
            .count();
        // Binomial scatter of 4000 trials is 0.3 %; the approximation of the quantiles takes the rest.
        let share = inside as f64 / f64::from(trials);
        assert!((0.93..0.97).contains(&share), "{share}, {low} to {high}");
    }

    /// Eigenvectors have a sign by rounding.
    #[test]
    fn the_interval_depends_neither_on_signs_nor_on_what_hardly_counts() {
        let interval = |mirrored: f64, negligible: f64| {
            let mut sums = MeanSquare::new(3);
            for k in 0..6 {
                let j = Matrix3xX::from_fn(3, |i, c| ((i + 3 * c + 7 * k) as f64).sin());
                sums.add(&j, &(Vector3::new(1e-3, -2e-4, 3e-4) * mirrored));
            }
            sums.interval_m(&DMatrix::from_diagonal(&DVector::from_vec(vec![1e-6, 4e-7, negligible])), NOTHING)
        };
        let [low, high] = interval(1.0, 0.0);
        for [a, b] in [interval(-1.0, 0.0), interval(1.0, 1e-17)] {
            assert!((a - low).abs() < 1e-4 * low && (b - high).abs() < 1e-4 * high, "{a} {low}, {b} {high}");
        }
    }

    #[test]
    fn without_uncertainty_the_interval_is_the_known_error() {
        let mut sums = MeanSquare::new(2);
        sums.add(&Matrix3xX::zeros(2), &Vector3::new(3e-3, 0.0, 4e-3));
        let [low, high] = sums.interval_m(&DMatrix::zeros(2, 2), NOTHING);
        assert!((low - 5e-3).abs() < 1e-12 && (high - 5e-3).abs() < 1e-12);
    }

    /// Quantiles of a normal variance alone: 1 +- 1.96 * 0.3, and one that may be none.
    #[test]
    fn a_scatter_that_is_not_known_makes_the_interval_wider() {
        let of = |sigma: f64| {
            let mut sums = MeanSquare::new(1);
            sums.add(&Matrix3xX::zeros(1), &Vector3::zeros());
            sums.interval_m(&DMatrix::zeros(1, 1), Spread { variance: 1e-6, sigma })
        };
        // 20000 samples know these quantiles to 0.02 of a sigma.
        for (end, expected) in of(3e-7).into_iter().zip([0.412_f64, 1.588]) {
            assert!((end - 1e-3 * expected.sqrt()).abs() < 2e-5, "{end}");
        }
        assert_eq!(of(8e-7)[0], 0.0);
        for end in of(0.0) {
            assert!((end - 1e-3).abs() < 1e-12, "{end}");
        }
    }
}
