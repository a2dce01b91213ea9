//! Anderson acceleration of a fixed-point iteration `x -> g(x)` (D. Anderson, *Iterative procedures for nonlinear integral equations*, 1965).
//!
//! With the residuals `f = g(x) - x` of this point and of those before, the coefficients `c` minimise `|f - sum c_i (f - f_i)|`, and the next
//! point is `g - sum c_i (g - g_i)`. Fixed points are the same, and so is the residual that tells how near they are.

use nalgebra::{DMatrix, DVector};

use crate::linalg::SymmetricFactor;

/// Points before that are taken into account.
const DEPTH: usize = 3;

/// Relative change up to which the iteration is accelerated.
const ACCELERATED: f64 = 0.3;

/// Share of the squares of the differences by which they are held small: an iteration is known to a few digits only.
const RIDGE: f64 = 1e-4;

/// Largest step of a component beyond what the iteration says.
const LARGEST_STEP: f64 = std::f64::consts::LN_2 * 2.0;

/// What the iteration made of a point.
#[derive(Debug)]
struct Point {
    g: DVector<f64>,
    /// How far that is from the point.
    f: DVector<f64>,
}

/// Growth of the change from which on the points before are taken to have misled.
const MISLED: f64 = 2.0;

/// The points before. Components are logarithms of sizes.
#[derive(Debug, Default)]
pub struct Acceleration {
    before: Vec<Point>,
    /// The largest change at the point before.
    change: Option<f64>,
}

impl Acceleration {
    /// The next point, from a point and what the iteration made of it, where the largest component changed by that share. After large changes it
    /// is that of the iteration, and all points before are forgotten: the way down from a first guess is none that others tell of. So they are
    /// where the change grew: they differed by no more than the iteration is known to.
    pub fn next_after(&mut self, change: f64, x: &DVector<f64>, g: DVector<f64>) -> DVector<f64> {
        let misled = self.change.replace(change).is_some_and(|before| change > MISLED * before);
        if misled || change > ACCELERATED {
            self.before.clear();
        }
        if change > ACCELERATED {
            return g;
        }
        self.next(x, g)
    }

    fn next(&mut self, x: &DVector<f64>, g: DVector<f64>) -> DVector<f64> {
        let of_x = Point { f: &g - x, g };
        let beyond = self.beyond(&of_x).unwrap_or_else(|| DVector::zeros(x.len()));
        let next = &of_x.g - &beyond * (LARGEST_STEP / beyond.amax()).min(1.0);
        self.before.insert(0, of_x);
        self.before.truncate(DEPTH);
        next
    }

    /// `sum c_i (g - g_i)`; none for the first point.
    fn beyond(&self, Point { g, f }: &Point) -> Option<DVector<f64>> {
        let n = self.before.len();
        let of_f = DMatrix::from_fn(f.len(), n, |i, k| f[i] - self.before[k].f[i]);
        let of_g = DMatrix::from_fn(g.len(), n, |i, k| g[i] - self.before[k].g[i]);
        let mut squares = of_f.tr_mul(&of_f);
        let ridge = RIDGE * squares.diagonal();
        squares += DMatrix::from_diagonal(&ridge);
        let c = SymmetricFactor::new(&squares).ok().filter(|_| n > 0)?.solve(&of_f.tr_mul(f));
        Some(of_g * c)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps until the residual is below 1e-3, and the point.
    fn steps(g: impl Fn(&DVector<f64>) -> DVector<f64>, accelerated: bool) -> (usize, DVector<f64>) {
        let (mut x, mut acceleration) = (DVector::from_element(2, 0.5), Acceleration::default());
        for k in 1.. {
            let next = g(&x);
            if (&next - &x).amax() < 1e-3 {
                return (k, next);
            }
            x = if accelerated { acceleration.next(&x, next) } else { next };
        }
        unreachable!()
    }

    #[test]
    fn a_slow_linear_iteration_reaches_its_fixed_point_in_a_few_steps() {
        let g = |x: &DVector<f64>| DVector::from_vec(vec![0.95 * x[0] + 0.05, 0.5 * x[1] - 0.01 * x[0]]);
        let ((plain, _), (few, found)) = (steps(g, false), steps(g, true));
        assert!(few <= 7 && plain > 40, "{few} steps instead of {plain}");
        // Off by less than the ridge leaves: a thousandth of residual is 0.02 of the slow direction.
        assert!((found[0] - 1.0).abs() < 0.02, "{found}");
    }

    #[test]
    fn points_after_which_the_change_grew_are_forgotten() {
        let point = |x: f64| DVector::from_vec(vec![x]);
        let third = |change: f64| {
            let mut acceleration = Acceleration::default();
            acceleration.next_after(0.05, &point(0.0), point(0.05));
            acceleration.next_after(0.04, &point(0.05), point(0.09));
            acceleration.next_after(change, &point(0.3), point(0.3 - change))
        };
        assert_eq!(third(0.1), point(0.3 - 0.1), "what the iteration says");
        assert!(third(0.07) != point(0.3 - 0.07), "accelerated");
    }

    #[test]
    fn a_size_that_goes_to_nothing_is_followed_by_factors_of_four_at_most() {
        // The logarithm of a size that shrinks by a share of its square: the residual falls as one over the step.
        let g = |x: &DVector<f64>| DVector::from_vec(vec![x[0] - 0.05 * (2.0 * x[0]).exp(), 0.0]);
        let ((plain, _), (few, _)) = (steps(g, false), steps(g, true));
        assert!(2 * few < plain, "{few} steps instead of {plain}");
    }
}
