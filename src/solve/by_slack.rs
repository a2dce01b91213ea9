//! Slack eliminated image by image in the space of its camera pose: dense columns and markers stay.
//!
//! With `dp = G dtheta + L dl`, information `Lambda` on the slack and `K = L (L' H_pp L + Lambda)^-1 L'`, every pair of blocks x, y of
//! the image loses `H_xp K H_py`; this holds for pose, intrinsics and markers alike.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rayon::prelude::*;

use super::system::{Carried, FIXED_MARKER_SIGMA_M, Linearised};
use crate::linalg::product;
use crate::model::plate_modes::MODES;
use crate::problem::{Problem, Slack, State, Step};

/// Parts in which images are summed; fixed, so that the sums do not depend on the number of threads.
const PARTS: usize = 4;

/// The slack of one image with its elimination.
#[derive(Debug, Clone)]
struct Block {
    /// `(L' H_pp L + Lambda)^-1`.
    inverse: DMatrix<f64>,
    /// Coupling with the reduced unknowns in `columns`.
    coupling: DMatrix<f64>,
    columns: Vec<usize>,
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
        let (marker_start, n) = number_markers(problem, lin);
        let all: Vec<usize> = (0..lin.images.len()).collect();
        let size = all.len().div_ceil(PARTS).max(1);
        let parts: Vec<(DMatrix<f64>, DVector<f64>, Vec<Block>)> = all
            .par_chunks(size)
            .map(|part| {
                let (mut a, mut rhs) = (DMatrix::zeros(n, n), DVector::zeros(n));
                let blocks = part
                    .iter()
                    .map(|&k| add_image(problem, state, lin, k, lambda, &marker_start, &mut a, &mut rhs))
                    .collect();
                (a, rhs, blocks)
            })
            .collect();
        let (mut a, mut rhs) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let mut blocks = Vec::with_capacity(all.len());
        for (pa, pb, part) in parts {
            a += pa;
            rhs += pb;
            blocks.extend(part);
        }
        for (p, plate) in marker_start.iter().enumerate() {
            for (m, start) in plate.iter().enumerate().filter_map(|(m, s)| s.map(|s| (m, s))) {
                let information = problem.plates[p].markers[m].sigma_m.max(FIXED_MARKER_SIGMA_M).powi(-2);
                for d in 0..3 {
                    a[(start + d, start + d)] += information;
                    rhs[start + d] -= information * state.plates[p].corrections[m][d];
                }
            }
        }
        (a, rhs, Self { blocks, marker_start })
    }

    /// The whole step from the solution `x` of the reduced system.
    pub fn step(&self, problem: &Problem, lin: &Linearised, x: &DVector<f64>) -> Step {
        let mut slack = vec![Vec::new(); problem.images.len()];
        for (block, &image) in self.blocks.iter().zip(&lin.images) {
            let own = DVector::from_iterator(block.columns.len(), block.columns.iter().map(|&c| x[c]));
            let dl = &block.inverse * (&block.rhs - &block.coupling * own);
            slack[image] = dl.as_slice().to_vec();
        }
        let correction = |start: &Option<usize>| start.map_or(Vector3::zeros(), |s| x.fixed_rows::<3>(s).into_owned());
        let markers = self.marker_start.iter().map(|plate| plate.iter().map(correction).collect()).collect();
        Step { dense: x.rows(0, problem.layout.len()).into_owned(), slack, markers }
    }

    /// `H^-1 + H^-1 C cov(x) C' H^-1`.
    pub fn slack_covariance(&self, reduced: &DMatrix<f64>, k: usize) -> DMatrix<f64> {
        let block = &self.blocks[k];
        let n = block.columns.len();
        let own = DMatrix::from_fn(n, n, |i, j| reduced[(block.columns[i], block.columns[j])]);
        let d = &block.inverse * &block.coupling;
        &block.inverse + product(&d, &own) * d.transpose()
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

fn number_markers(problem: &Problem, lin: &Linearised) -> (Vec<Vec<Option<usize>>>, usize) {
    let mut start: Vec<Vec<Option<usize>>> = problem.plates.iter().map(|p| vec![None; p.markers.len()]).collect();
    for (terms, &i) in lin.terms.iter().zip(&lin.images) {
        for t in &terms.markers {
            start[problem.images[i].plate][t.marker] = Some(0);
        }
    }
    let mut next = problem.layout.len();
    for slot in start.iter_mut().flatten().filter(|s| s.is_some()) {
        *slot = Some(next);
        next += 3;
    }
    (start, next)
}

/// Adds one image to the reduced equations and returns its eliminated slack.
#[allow(clippy::too_many_arguments)]
fn add_image(
    problem: &Problem,
    state: &State,
    lin: &Linearised,
    k: usize,
    lambda: f64,
    marker_start: &[Vec<Option<usize>>],
    a: &mut DMatrix<f64>,
    rhs: &mut DVector<f64>,
) -> Block {
    let (terms, chain, image) = (&lin.terms[k], &lin.chains[k], &problem.images[lin.images[k]]);
    let theta = problem.layout.theta_len();
    let intrinsics = problem.layout.intrinsics(image);
    let used: Vec<(usize, usize)> = intrinsics.iter().enumerate().filter_map(|(e, c)| c.map(|c| (e, c))).collect();
    let seen: Vec<(usize, usize)> = (terms.markers.iter().enumerate())
        .filter_map(|(at, t)| marker_start[image.plate][t.marker].map(|s| (at, s)))
        .collect();
    // Rows of this image's unknowns in reduced numbering: theta, intrinsics, markers.
    let mut columns: Vec<usize> = (0..theta).collect();
    columns.extend(used.iter().map(|(_, c)| *c));
    columns.extend(seen.iter().flat_map(|(_, s)| *s..*s + 3));
    let (n, first_marker) = (columns.len(), theta + used.len());
    // The intrinsics stand in ascending order of their index.
    let place = |e: usize| used.binary_search_by_key(&e, |u| u.0).ok().map(|at| theta + at);
    let pp = DMatrix::from_column_slice(6, 6, terms.pp.as_slice());
    // Coupling of all of them with the pose, 6 x n, and their own block without the elimination.
    let mut p = DMatrix::zeros(6, n);
    p.columns_mut(0, theta).copy_from(&(&pp * &chain.d_theta));
    for (at, (e, _)) in used.iter().enumerate() {
        p.column_mut(theta + at).copy_from(&terms.pe.column(*e));
    }
    for (at, (m, _)) in seen.iter().enumerate() {
        p.view_mut((0, first_marker + 3 * at), (6, 3)).copy_from(&terms.markers[*m].mp.transpose());
    }
    let gt = chain.d_theta.transpose();
    let bp = DVector::from_column_slice(terms.bp.as_slice());
    let mut own = DMatrix::zeros(n, n);
    let mut b = DVector::zeros(n);
    let with_theta = product(&gt, &p);
    own.rows_mut(0, theta).copy_from(&with_theta);
    own.columns_mut(0, theta).copy_from(&with_theta.transpose());
    b.rows_mut(0, theta).copy_from(&(&gt * &bp));
    for (i, (e, _)) in used.iter().enumerate() {
        b[theta + i] = terms.be[*e];
        for (j, (f, _)) in used.iter().enumerate() {
            own[(theta + i, theta + j)] = terms.ee[(*e, *f)];
        }
    }
    for (at, (m, _)) in seen.iter().enumerate() {
        let (t, row) = (&terms.markers[*m], first_marker + 3 * at);
        own.view_mut((row, row), (3, 3)).copy_from(&t.mm);
        b.rows_mut(row, 3).copy_from(&t.bm);
        for (e, coupling) in t.intrinsics() {
            let Some(i) = place(e) else { continue };
            for d in 0..3 {
                own[(row + d, i)] = coupling[d];
                own[(i, row + d)] = coupling[d];
            }
        }
    }
    // Columns that stay at their value take no part in the back-substitution either.
    let l = &chain.d_slack;
    let mut h = l.transpose() * &pp * l;
    let mut slack_rhs = l.transpose() * &bp;
    if let Slack::Joints(dq) = &state.slack[lin.images[k]] {
        for (r, q) in dq.iter().enumerate() {
            let information = problem.slack_information(image, r);
            h[(r, r)] += information;
            slack_rhs[r] -= q * information;
        }
    }
    for r in 0..h.nrows() {
        h[(r, r)] *= 1.0 + lambda;
    }
    let inverse = h.try_inverse().unwrap_or_else(|| DMatrix::zeros(l.ncols(), l.ncols()));
    let mut coupling = l.transpose() * &p;
    let reduction = product(&coupling.transpose(), &(&inverse * &coupling));
    b -= coupling.transpose() * (&inverse * &slack_rhs);
    for (j, &cj) in columns.iter().enumerate() {
        rhs[cj] += b[j];
        for (i, &ci) in columns.iter().enumerate() {
            a[(ci, cj)] += own[(i, j)] - reduction[(i, j)];
        }
    }
    for (at, &c) in columns.iter().enumerate() {
        if problem.layout.columns.get(c).is_some_and(|column| !column.free) {
            coupling.column_mut(at).fill(0.0);
        }
    }
    Block { inverse, coupling, columns, rhs: slack_rhs }
}
