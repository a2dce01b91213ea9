//! Slack eliminated image by image: the dense columns and the markers stay.
//!
//! With the information `H = F F'` of the slack of an image (pixels through `L`, and the prior) and its coupling `B` with what stays,
//! `Y = B F^-T`: the reduced information is the information without the elimination less `sum Y Y'`, one Gram product.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::by_markers::number_markers;
use super::dense_rows::{FreeColumns, PoseRows};
use super::system::{Carried, FIXED_MARKER_SIGMA_M, Linearised};
use crate::linalg::{mirror_upper, product, subtract_gram};
use crate::model::plate_modes::MODES;
use crate::problem::{Problem, Slack, State, Step};

/// Images whose couplings form one Gram product.
const IMAGES_A_PRODUCT: usize = 48;

/// The slack of one image with its elimination.
#[derive(Debug, Clone)]
struct Block {
    /// `F^-1`.
    inverse_factor: DMatrix<f64>,
    /// Unknowns that stay and that the image touches.
    rows: Vec<usize>,
    /// `Y`, `rows` x slack.
    y: DMatrix<f64>,
    /// `F^-1` times the right-hand side.
    rhs: DVector<f64>,
}

/// Every image's slack with its elimination.
#[derive(Debug, Clone)]
pub(super) struct SlackEliminated {
    blocks: Vec<Block>,
    /// First unknown of every marker that was seen, per plate.
    marker_start: Vec<Vec<Option<usize>>>,
}

impl SlackEliminated {
    /// Information and right-hand side; priors of slack and markers are in, those of the dense columns are not.
    pub fn build(
        problem: &Problem,
        state: &State,
        lin: &Linearised,
        lambda: f64,
    ) -> (DMatrix<f64>, DVector<f64>, Self) {
        let dense = problem.layout.len();
        let (number, order) = number_markers(problem, lin);
        let start = |at: &Option<usize>| at.map(|at| dense + 3 * at);
        let marker_start: Vec<Vec<Option<usize>>> =
            number.iter().map(|plate| plate.iter().map(start).collect()).collect();
        let n = dense + 3 * order.len();
        let (mut a, mut rhs) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for (at, &(plate, marker)) in order.iter().enumerate() {
            let prior = problem.plates[plate].markers[marker].sigma_m.max(FIXED_MARKER_SIGMA_M).powi(-2);
            let start = dense + 3 * at;
            a.fixed_view_mut::<3, 3>(start, start).copy_from(&Matrix3::from_diagonal_element(prior));
            rhs.fixed_rows_mut::<3>(start).copy_from(&(state.plates[plate].corrections[marker] * -prior));
        }
        let poses = PoseRows::new(problem, lin);
        poses.add_to(problem, lin, &mut a, &mut rhs);
        let mut blocks = Vec::with_capacity(lin.images.len());
        for k in 0..lin.images.len() {
            add_markers(problem, lin, k, &marker_start, (&mut a, &mut rhs));
            blocks.push(Block::new(problem, state, lin, k, lambda, (&poses, &marker_start)));
        }
        for part in blocks.chunks(IMAGES_A_PRODUCT) {
            let mut y = DMatrix::zeros(n, part.iter().map(|b| b.y.ncols()).sum());
            let mut first = 0;
            for block in part {
                for (at, &row) in block.rows.iter().enumerate() {
                    (0..block.y.ncols()).for_each(|s| y[(row, first + s)] = block.y[(at, s)]);
                    rhs[row] -= (block.y.row(at) * &block.rhs)[0];
                }
                first += block.y.ncols();
            }
            subtract_gram(&mut a, &y);
        }
        mirror_upper(&mut a);
        (a, rhs, Self { blocks, marker_start })
    }

    /// The whole step from the solution `x` of the reduced system.
    pub fn step(&self, problem: &Problem, lin: &Linearised, x: &DVector<f64>) -> Step {
        let mut slack = vec![Vec::new(); problem.images.len()];
        for (block, &image) in self.blocks.iter().zip(&lin.images) {
            let own = DVector::from_iterator(block.rows.len(), block.rows.iter().map(|&c| x[c]));
            let dl = block.inverse_factor.tr_mul(&(&block.rhs - block.y.tr_mul(&own)));
            slack[image] = dl.as_slice().to_vec();
        }
        let correction = |start: &Option<usize>| start.map_or(Vector3::zeros(), |s| x.fixed_rows::<3>(s).into_owned());
        let markers = self.marker_start.iter().map(|plate| plate.iter().map(correction).collect()).collect();
        Step { dense: x.rows(0, problem.layout.len()).into_owned(), slack, markers }
    }

    /// `H^-1 + H^-1 B' cov(x) B H^-1`.
    pub fn slack_covariance(&self, reduced: &DMatrix<f64>, k: usize) -> DMatrix<f64> {
        let block = &self.blocks[k];
        let n = block.rows.len();
        let own = DMatrix::from_fn(n, n, |i, j| reduced[(block.rows[i], block.rows[j])]);
        let d = &block.y * &block.inverse_factor;
        block.inverse_factor.tr_mul(&block.inverse_factor) + d.tr_mul(&product(&own, &d))
    }

    /// Covariance of every marker that was seen; with what moves it with the dense columns for a position.
    pub fn marker_covariances(
        &self,
        reduced: &DMatrix<f64>,
        carried: Option<&Carried>,
    ) -> Vec<Vec<Option<Matrix3<f64>>>> {
        let of = |p: usize, m: usize, start: usize| {
            let own = reduced.fixed_view::<3, 3>(start, start).into_owned();
            let Some((modes_start, modes)) = carried.map(|c| c(p, m)) else { return own };
            let with_modes = reduced.fixed_view::<3, MODES>(start, modes_start) * modes.transpose();
            let of_modes = modes * reduced.fixed_view::<MODES, MODES>(modes_start, modes_start) * modes.transpose();
            own + with_modes + with_modes.transpose() + of_modes
        };
        let plate = |(p, starts): (usize, &Vec<Option<usize>>)| {
            starts.iter().enumerate().map(|(m, start)| start.map(|s| of(p, m, s))).collect()
        };
        self.marker_start.iter().enumerate().map(plate).collect()
    }
}

/// Markers of an image with themselves and with the dense columns: upper triangle.
fn add_markers(
    problem: &Problem,
    lin: &Linearised,
    k: usize,
    marker_start: &[Vec<Option<usize>>],
    (a, rhs): (&mut DMatrix<f64>, &mut DVector<f64>),
) {
    let image = &problem.images[lin.images[k]];
    let columns = FreeColumns::of(problem, image, &lin.chains[k]);
    for t in &lin.terms[k].markers {
        let Some(start) = marker_start[image.plate][t.marker] else { continue };
        columns.add_coupling(a, start, t);
        let mut own = a.fixed_view_mut::<3, 3>(start, start);
        own += t.mm;
        let mut b = rhs.fixed_rows_mut::<3>(start);
        b += t.bm;
    }
}

impl Block {
    fn new(
        problem: &Problem,
        state: &State,
        lin: &Linearised,
        k: usize,
        lambda: f64,
        (poses, marker_start): (&PoseRows, &[Vec<Option<usize>>]),
    ) -> Self {
        let (terms, l, image) = (&lin.terms[k], &lin.chains[k].d_slack, &problem.images[lin.images[k]]);
        let mut h = l.tr_mul(&(terms.pp * l));
        let mut rhs = l.tr_mul(&terms.bp);
        if let Slack::Joints(dq) = &state.slack[lin.images[k]] {
            for (s, q) in dq.iter().enumerate() {
                let information = problem.slack_information(image, s);
                h[(s, s)] += information;
                rhs[s] -= q * information;
            }
        }
        for s in 0..h.nrows() {
            h[(s, s)] *= 1.0 + lambda;
        }
        let factor = h.cholesky().and_then(|c| c.l().try_inverse());
        let inverse_factor = factor.unwrap_or_else(|| DMatrix::zeros(l.ncols(), l.ncols()));
        // Columns that stay at their value take no part, nor in the back-substitution.
        let columns = FreeColumns::of(problem, image, &lin.chains[k]);
        let mut rows: Vec<usize> = columns.all().collect();
        let first_marker = rows.len();
        let seen = terms.markers.iter().filter_map(|t| marker_start[image.plate][t.marker]);
        rows.extend(seen.flat_map(|s| s..s + 3));
        let mut b = DMatrix::zeros(rows.len(), l.ncols());
        for (at, &c) in rows[..first_marker].iter().enumerate() {
            b.row_mut(at).copy_from(&poses.coupling.fixed_view::<6, 1>(6 * k, c).tr_mul(l));
        }
        for (m, t) in terms.markers.iter().enumerate() {
            b.rows_mut(first_marker + 3 * m, 3).copy_from(&(t.mp * l));
        }
        let y = b * inverse_factor.transpose();
        let rhs = &inverse_factor * rhs;
        Self { inverse_factor, rows, y, rhs }
    }
}
