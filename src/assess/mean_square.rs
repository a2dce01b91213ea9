//! How far the mean square of an error may be from what is expected of it.
//!
//! The error of the flange at a place is `d + J x` with a known `d` and `x ~ N(0, C)`: its mean square over places is a quadratic form
//! `x' A x + 2 g' x + d2` with the cumulants `k_s = 2^(s-1) (s-1)! (tr((A C)^s) + s g' C (A C)^(s-2) g)`, `d2` on the first. It is taken as a
//! shifted multiple of a chi square of the same three (P. Hall 1983, M. Buckley and G. Eagleson 1988), whose quantiles are those of Wilson
//! and Hilferty.

use nalgebra::{DMatrix, DVector, Matrix3xX, Vector3};

/// Sigmas of a 95 % interval.
const NORMAL_95: f64 = 1.96;

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

    /// 95 % interval of the root mean square, m, for columns of this covariance.
    pub fn interval_m(&self, covariance: &DMatrix<f64>) -> [f64; 2] {
        let n = self.places.max(1.0);
        let ac = &self.a * covariance / n;
        let g = &self.g / n;
        let twice = &ac * &ac;
        let cg = covariance * &g;
        let mean = ac.trace() + self.d2 / n;
        let variance = (2.0 * twice.trace() + 4.0 * g.dot(&cg)).max(0.0);
        let third = 8.0 * twice.component_mul(&ac.transpose()).sum() + 24.0 / n * cg.dot(&(&self.a * &cg));
        let freedom = 8.0 * variance.powi(3) / (third * third).max(f64::MIN_POSITIVE);
        [-NORMAL_95, NORMAL_95].map(|z| (mean + variance.sqrt() * standard_chi_square(freedom, z)).max(0.0).sqrt())
    }
}

/// Quantile at `z` normal sigmas of a chi square of mean 0 and variance 1 with so many degrees of freedom; that of a normal one where they are
/// without bound.
fn standard_chi_square(freedom: f64, z: f64) -> f64 {
    if freedom > NEARLY_NORMAL {
        return z;
    }
    let spread = 2.0 / (9.0 * freedom);
    let quantile = freedom * (1.0 - spread + z * spread.sqrt()).max(0.0).powi(3);
    (quantile - freedom) / (2.0 * freedom).sqrt()
}

/// Degrees of freedom from which a chi square counts as normal.
const NEARLY_NORMAL: f64 = 1e8;

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

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
        let [low, high] = sums.interval_m(&covariance);
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

    #[test]
    fn without_uncertainty_the_interval_is_the_known_error() {
        let mut sums = MeanSquare::new(2);
        sums.add(&Matrix3xX::zeros(2), &Vector3::new(3e-3, 0.0, 4e-3));
        let [low, high] = sums.interval_m(&DMatrix::zeros(2, 2));
        assert!((low - 5e-3).abs() < 1e-12 && (high - 5e-3).abs() < 1e-12);
    }
}
