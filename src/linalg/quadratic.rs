//! Convex quadratic programmes with bounds and linear rows, by Clarabel.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus, ZeroConeT};
use nalgebra::{DMatrix, DVector};

/// `low <= coefficients' x <= high`; equal bounds make an equation, infinite ones are left out.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearRow {
    /// One coefficient for each unknown.
    pub coefficients: Vec<f64>,
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
}

/// The programme has no solution, or none was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NotSolved {
    /// No point fulfils bounds and rows.
    Infeasible,
    /// The solver gave up.
    Failed,
}

/// Triplets of `A`, with `b`, of Clarabel's form `A x + s = b`.
#[derive(Default)]
struct Rows {
    row: Vec<usize>,
    column: Vec<usize>,
    value: Vec<f64>,
    bound: Vec<f64>,
}

impl Rows {
    /// Of rows and bounds, `a x <= bound`; so many of the first are equations.
    fn of(bounds: &[(f64, f64)], rows: &[LinearRow]) -> (Self, usize) {
        let mut a = Self::default();
        let dense = |c: &[f64], sign: f64| c.iter().map(|v| sign * v).enumerate().collect::<Vec<_>>().into_iter();
        for r in rows.iter().filter(|r| r.low == r.high) {
            a.push(dense(&r.coefficients, 1.0), r.low);
        }
        let equations = a.bound.len();
        for r in rows.iter().filter(|r| r.low != r.high) {
            if r.high.is_finite() {
                a.push(dense(&r.coefficients, 1.0), r.high);
            }
            if r.low.is_finite() {
                a.push(dense(&r.coefficients, -1.0), -r.low);
            }
        }
        for (k, (low, high)) in bounds.iter().enumerate() {
            a.push(std::iter::once((k, 1.0)), *high);
            a.push(std::iter::once((k, -1.0)), -low);
        }
        (a, equations)
    }

    fn push(&mut self, coefficients: impl Iterator<Item = (usize, f64)>, bound: f64) {
        for (column, value) in coefficients.filter(|(_, v)| *v != 0.0) {
            self.row.push(self.bound.len());
            self.column.push(column);
            self.value.push(value);
        }
        self.bound.push(bound);
    }
}

/// What is not zero on and above the diagonal.
fn upper_triangle(hessian: &DMatrix<f64>) -> CscMatrix {
    let n = hessian.nrows();
    let upper = (0..n).flat_map(|j| (0..=j).map(move |i| (i, j))).filter(|&(i, j)| hessian[(i, j)] != 0.0);
    let (rows, columns): (Vec<usize>, Vec<usize>) = upper.unzip();
    let values = rows.iter().zip(&columns).map(|(&i, &j)| hessian[(i, j)]).collect();
    CscMatrix::new_from_triplets(n, n, rows, columns, values)
}

/// The point that minimises `x' hessian x / 2 + gradient' x` over `bounds` (low, high of every unknown) and `rows`.
///
/// # Errors
/// Where bounds and rows exclude each other, and where the solver does not reach its tolerance.
pub fn minimise_quadratic(
    hessian: &DMatrix<f64>,
    gradient: &DVector<f64>,
    bounds: &[(f64, f64)],
    rows: &[LinearRow],
) -> Result<DVector<f64>, NotSolved> {
    let n = gradient.len();
    let (a, equations) = Rows::of(bounds, rows);
    let m = a.bound.len();
    let matrix = CscMatrix::new_from_triplets(m, n, a.row, a.column, a.value);
    let p = upper_triangle(hessian);
    let cones = [ZeroConeT(equations), NonnegativeConeT(m - equations)];
    let settings = DefaultSettings { verbose: false, max_iter: 200, ..DefaultSettings::default() };
    let mut solver = DefaultSolver::new(&p, gradient.as_slice(), &matrix, &a.bound, &cones, settings)
        .map_err(|_| NotSolved::Failed)?;
    solver.solve();
    match solver.solution.status {
        SolverStatus::Solved | SolverStatus::AlmostSolved => {
            Ok(DVector::from_fn(n, |k, _| solver.solution.x[k].clamp(bounds[k].0, bounds[k].1)))
        }
        SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => Err(NotSolved::Infeasible),
        _ => Err(NotSolved::Failed),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_point_of_a_simplex() {
        // Nearest to (2, 0.5, -1) on x + y + z = 1, 0 <= x <= 0.7: the multiplier of the sum shifts what is not at a bound.
        let target = [2.0, 0.5, -1.0];
        let rows = [LinearRow { coefficients: vec![1.0; 3], low: 1.0, high: 1.0 }];
        let bounds = [(0.0, 0.7), (0.0, 1.0), (0.0, 1.0)];
        let gradient = DVector::from_fn(3, |k, _| -target[k]);
        let x = minimise_quadratic(&DMatrix::identity(3, 3), &gradient, &bounds, &rows).unwrap();
        assert!((x - DVector::from_column_slice(&[0.7, 0.3, 0.0])).amax() < 1e-6);
    }

    #[test]
    fn rows_that_exclude_each_other_are_told() {
        let row = |low, high| LinearRow { coefficients: vec![1.0, 1.0], low, high };
        let made =
            |rows: &[LinearRow]| minimise_quadratic(&DMatrix::zeros(2, 2), &DVector::zeros(2), &[(0.0, 1.0); 2], rows);
        assert_eq!(made(&[row(3.0, 3.0)]), Err(NotSolved::Infeasible));
        assert_eq!(made(&[row(f64::NEG_INFINITY, 0.5), row(0.8, f64::INFINITY)]), Err(NotSolved::Infeasible));
        assert!(made(&[row(1.0, 1.5)]).is_ok());
    }
}
