//! Markers eliminated: the dense columns and the slack of the images stay.
//!
//! With the information `V = F F'` of a marker (all images and the prior) and its coupling `B` with what stays, `Y = B F^-T`: the reduced
//! information is the information without the elimination less `sum Y Y'`, one Gram product.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::dense_rows::{FreeColumns, PoseRows};
use super::system::{Carried, FIXED_MARKER_SIGMA_M, Linearised};
use crate::linalg::{mirror_upper, product, subtract_gram};
use crate::model::plate_modes::MODES;
use crate::problem::{Problem, Slack, State, Step};

/// Every marker that was seen, with its elimination.
#[derive(Debug, Clone)]
pub(super) struct MarkersEliminated {
    /// Number of each marker among those that were seen, per plate.
    number: Vec<Vec<Option<usize>>>,
    /// `F^-1` of each that was seen.
    inverse_factors: Vec<Matrix3<f64>>,
    /// `Y`, unknowns that stay x 3 markers.
    y: DMatrix<f64>,
    /// `F^-1` times the right-hand side.
    rhs: DVector<f64>,
}

/// Number of each marker among those that were seen, per plate.
type Numbers = Vec<Vec<Option<usize>>>;

type Reduced = (DMatrix<f64>, DVector<f64>, Vec<usize>, MarkersEliminated);

impl MarkersEliminated {
    /// Information, right-hand side and start of each image's slack; priors of slack and markers are in, those of the dense
    /// columns are not.
    pub fn build(problem: &Problem, state: &State, lin: &Linearised, lambda: f64) -> Reduced {
        let mut n = problem.layout.len();
        let slack_start: Vec<usize> = (lin.chains.iter())
            .map(|c| {
                n += c.d_slack.ncols();
                n - c.d_slack.ncols()
            })
            .collect();
        let (mut a, mut b) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let poses = PoseRows::new(problem, lin);
        poses.add_to(problem, lin, &mut a, &mut b);
        add_slack(problem, state, lin, &poses, &slack_start, (&mut a, &mut b));
        let markers = Self::gather(problem, state, lin, lambda, (n, &slack_start));
        subtract_gram(&mut a, &markers.y);
        b.gemv(-1.0, &markers.y, &markers.rhs, 1.0);
        mirror_upper(&mut a);
        (a, b, slack_start, markers)
    }

    fn gather(
        problem: &Problem,
        state: &State,
        lin: &Linearised,
        lambda: f64,
        (n, slack_start): (usize, &[usize]),
    ) -> Self {
        let (number, order) = number_markers(problem, lin);
        let mut information: Vec<Matrix3<f64>> = Vec::with_capacity(order.len());
        let mut rhs = DVector::zeros(3 * order.len());
        for (at, &(plate, marker)) in order.iter().enumerate() {
            let prior = problem.plates[plate].markers[marker].sigma_m.max(FIXED_MARKER_SIGMA_M).powi(-2);
            information.push(Matrix3::from_diagonal_element(prior));
            rhs.fixed_rows_mut::<3>(3 * at).copy_from(&(state.plates[plate].corrections[marker] * -prior));
        }
        let mut y = DMatrix::zeros(n, 3 * order.len());
        for (k, (terms, &i)) in lin.terms.iter().zip(&lin.images).enumerate() {
            let (image, chain) = (&problem.images[i], &lin.chains[k]);
            let columns = FreeColumns::of(problem, image, chain);
            for t in &terms.markers {
                let Some(at) = number[image.plate][t.marker] else { continue };
                information[at] += t.mm;
                let mut own = rhs.fixed_rows_mut::<3>(3 * at);
                own += t.bm;
                columns.add_coupling(&mut y, 3 * at, t);
                for s in 0..chain.d_slack.ncols() {
                    let with_slack = t.mp * chain.d_slack.fixed_view::<6, 1>(0, s);
                    (0..3).for_each(|d| y[(slack_start[k] + s, 3 * at + d)] = with_slack[d]);
                }
            }
        }
        let damped = |mut v: Matrix3<f64>| {
            (0..3).for_each(|d| v[(d, d)] *= 1.0 + lambda);
            v.cholesky().and_then(|c| c.l().try_inverse()).unwrap_or_else(Matrix3::zeros)
        };
        let inverse_factors: Vec<Matrix3<f64>> = information.into_iter().map(damped).collect();
        for (at, inverse) in inverse_factors.iter().enumerate() {
            times_right(&mut y, 3 * at, &inverse.transpose());
            let own = inverse * rhs.fixed_rows::<3>(3 * at);
            rhs.fixed_rows_mut::<3>(3 * at).copy_from(&own);
        }
        Self { number, inverse_factors, y, rhs }
    }

    /// The whole step from the solution `x` of the reduced system.
    pub fn step(&self, problem: &Problem, lin: &Linearised, slack_start: &[usize], x: &DVector<f64>) -> Step {
        let mut slack = vec![Vec::new(); problem.images.len()];
        for (k, &image) in lin.images.iter().enumerate() {
            slack[image] = x.rows(slack_start[k], lin.chains[k].d_slack.ncols()).as_slice().to_vec();
        }
        let mut own = self.rhs.clone();
        own.gemv_tr(-1.0, &self.y, x, 1.0);
        let of = |at: usize| self.inverse_factors[at].transpose() * own.fixed_rows::<3>(3 * at);
        let step = |at: &Option<usize>| at.map_or(Vector3::zeros(), of);
        let markers = self.number.iter().map(|plate| plate.iter().map(step).collect()).collect();
        Step { dense: x.rows(0, problem.layout.len()).into_owned(), slack, markers }
    }

    /// Covariance of every marker that was seen: `V^-1 + D cov(x) D'` with `D = V^-1 B'`, less what moves the marker with `x`
    /// for a position instead of a correction.
    pub fn marker_covariances(
        &self,
        reduced: &DMatrix<f64>,
        carried: Option<&Carried>,
    ) -> Vec<Vec<Option<Matrix3<f64>>>> {
        let mut d = self.y.clone();
        for (p, plate) in self.number.iter().enumerate() {
            for (m, at) in plate.iter().enumerate().filter_map(|(m, at)| at.map(|at| (m, at))) {
                times_right(&mut d, 3 * at, &self.inverse_factors[at]);
                if let Some((start, modes)) = carried.map(|c| c(p, m)) {
                    let mut own = d.view_mut((start, 3 * at), (MODES, 3));
                    own -= modes.transpose();
                }
            }
        }
        let cd = product(reduced, &d);
        let of = |at: usize| {
            let c = d.columns(3 * at, 3).tr_mul(&cd.columns(3 * at, 3));
            let f = self.inverse_factors[at];
            f.transpose() * f + Matrix3::from_column_slice(c.as_slice())
        };
        self.number.iter().map(|plate| plate.iter().map(|at| at.map(of)).collect()).collect()
    }
}

/// Multiplies three columns from `first` on by `m` from the right.
fn times_right(y: &mut DMatrix<f64>, first: usize, m: &Matrix3<f64>) {
    let rows = y.nrows();
    let (x, rest) = y.as_mut_slice()[first * rows..(first + 3) * rows].split_at_mut(rows);
    let (y, z) = rest.split_at_mut(rows);
    for ((x, y), z) in x.iter_mut().zip(y).zip(z) {
        let old = [*x, *y, *z];
        let new = |k: usize| old[0] * m[(0, k)] + old[1] * m[(1, k)] + old[2] * m[(2, k)];
        (*x, *y, *z) = (new(0), new(1), new(2));
    }
}

/// Numbers the markers that were seen; returns also plate and index of each number.
pub(super) fn number_markers(problem: &Problem, lin: &Linearised) -> (Numbers, Vec<(usize, usize)>) {
    let mut number: Vec<Vec<Option<usize>>> = problem.plates.iter().map(|p| vec![None; p.markers.len()]).collect();
    for (terms, &i) in lin.terms.iter().zip(&lin.images) {
        terms.markers.iter().for_each(|t| number[problem.images[i].plate][t.marker] = Some(0));
    }
    let mut order = Vec::new();
    for (p, plate) in number.iter_mut().enumerate() {
        for (m, at) in plate.iter_mut().enumerate().filter(|(_, at)| at.is_some()) {
            *at = Some(order.len());
            order.push((p, m));
        }
    }
    (number, order)
}

/// Slack with the dense columns and with itself, and its prior: upper triangle.
fn add_slack(
    problem: &Problem,
    state: &State,
    lin: &Linearised,
    poses: &PoseRows,
    slack_start: &[usize],
    (a, rhs): (&mut DMatrix<f64>, &mut DVector<f64>),
) {
    let dense = problem.layout.len();
    for (k, (chain, terms)) in lin.chains.iter().zip(&lin.terms).enumerate() {
        let (l, start) = (&chain.d_slack, slack_start[k]);
        if l.ncols() == 0 {
            continue;
        }
        let with_dense = poses.coupling.rows(6 * k, 6).tr_mul(l);
        a.view_mut((0, start), (dense, l.ncols())).copy_from(&with_dense);
        a.view_mut((start, start), (l.ncols(), l.ncols())).copy_from(&l.tr_mul(&(terms.pp * l)));
        rhs.rows_mut(start, l.ncols()).copy_from(&l.tr_mul(&terms.bp));
        let image = &problem.images[lin.images[k]];
        if let Slack::Joints(dq) = &state.slack[lin.images[k]] {
            for (s, q) in dq.iter().enumerate() {
                let information = problem.slack_information(image, s);
                a[(start + s, start + s)] += information;
                rhs[start + s] -= q * information;
            }
        }
    }
}
