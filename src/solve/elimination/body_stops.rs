//! Stops at which no image was taken, eliminated in the space of the poses that were measured there.
//!
//! Dense columns and what is latent move the poses of a stop by `G` and `L`. With the information `H = S S'` of the poses and the priors `P` of what
//! is latent, a stop tells `G' R R' G` of the dense columns, `R R' = S (1 + S' L P^-1 L' S)^-1 S'` (the identity of Woodbury): one Gram product,
//! from which nothing is subtracted. With the information `F F' = P + L' H L` and `K = (F F')^-1 L' H`, latents follow the dense columns by `-K G x`,
//! poses by `(1 - L K) G x`.

use nalgebra::{DMatrix, DVector, Vector6};
use rayon::prelude::*;

use super::group::Group;
use super::right_hand_sides::RightHandSides;
use super::stop_covariance::StopCovariance;
use crate::linalg::{self, add_gram, dot, inverse_factor, product};
use crate::problem::{Chained, Layout, Step};
use crate::solve::linear::{BodyPart, LinearPose, LinearProblem, LinearStop};

/// Stops whose equations are taken together: those after each other touch much the same columns.
const TOGETHER: usize = 48;

/// Share of a pivot that is rounding: what is left of it says nothing.
const ROUNDING: f64 = 1e-13;

/// One stop with its elimination.
#[derive(Debug, Clone)]
struct Block {
    /// Place among the stops in use.
    at: usize,
    /// `F^-1`.
    inverse_factor: DMatrix<f64>,
    /// `K`, latent x poses.
    gain: DMatrix<f64>,
    /// `F^-1` times the right-hand side.
    rhs: DVector<f64>,
}

/// Such stops, ascending.
#[derive(Debug, Clone)]
pub struct BodyStops(Vec<Block>);

/// The free columns that move any of some poses, ascending.
pub(super) fn touched<'a>(layout: &Layout, chains: impl Iterator<Item = &'a Chained>) -> Vec<usize> {
    let mut moves = vec![false; layout.theta_len()];
    for chain in chains {
        for (moves, by) in moves.iter_mut().zip(chain.columns()).filter(|(moves, _)| !**moves) {
            *moves = *by != [0.0; 6];
        }
    }
    (0..moves.len()).filter(|&c| moves[c] && layout.columns[c].free).collect()
}

fn chains<'a>(stops: &'a [LinearStop]) -> impl Iterator<Item = &'a Chained> {
    stops.iter().flat_map(|stop| stop.bodies()).map(|part| &*part.chain)
}

/// `S`, lower triangular less the columns of zeros, of a positive semidefinite matrix `S S'`.
fn root(mut m: DMatrix<f64>) -> DMatrix<f64> {
    let n = m.nrows();
    let least = m.diagonal() * ROUNDING;
    let mut told = Vec::with_capacity(n);
    for k in 0..n {
        if m[(k, k)] <= least[k] {
            continue;
        }
        let pivot = m[(k, k)].sqrt();
        let column: Vec<f64> = (k..n).map(|i| m[(i, k)] / pivot).collect();
        for j in k + 1..n {
            (j..n).for_each(|i| m[(i, j)] -= column[i - k] * column[j - k]);
        }
        (k..n).for_each(|i| m[(i, k)] = column[i - k]);
        told.push(k);
    }
    DMatrix::from_fn(n, told.len(), |i, k| if i < told[k] { 0.0 } else { m[(i, told[k])] })
}

/// `G' m` of the poses of some stops side by side, over some of the dense columns.
fn transposed_times(stops: &[LinearStop], rows: &[usize], m: &[DMatrix<f64>]) -> DMatrix<f64> {
    let mut all = DMatrix::zeros(rows.len(), m.iter().map(|m| m.ncols()).sum());
    let vectors = stops.iter().zip(m).flat_map(|(stop, m)| m.column_iter().map(|m| (stop.bodies(), m)));
    for (mut into, (bodies, m)) in all.column_iter_mut().zip(vectors) {
        for (part, m) in bodies.iter().zip(m.as_slice().as_chunks().0) {
            let by = part.chain.columns();
            into.iter_mut().zip(rows).for_each(|(sum, &c)| *sum += dot(&by[c], m));
        }
    }
    all
}

/// `G'` of the poses of some stops side by side, over some of the dense columns.
fn transposed(stops: &[LinearStop], rows: &[usize]) -> DMatrix<f64> {
    let poses: Vec<&[[f64; 6]]> =
        stops.iter().flat_map(|stop| stop.bodies()).map(|part| part.chain.columns()).collect();
    DMatrix::from_fn(rows.len(), 6 * poses.len(), |row, column| poses[column / 6][rows[row]][column % 6])
}

/// `G x` of the poses of a stop, one after the other.
fn times(bodies: &[BodyPart], x: &[f64]) -> DVector<f64> {
    let mut all = DVector::zeros(6 * bodies.len());
    for (part, sum) in bodies.iter().zip(all.as_mut_slice().as_chunks_mut::<6>().0) {
        for (by, x) in part.chain.columns().iter().zip(x) {
            sum.iter_mut().zip(by).for_each(|(sum, g)| *sum += g * x);
        }
    }
    all
}

impl Block {
    /// With `R`, and what is latent damped by `lambda`.
    fn of(stop: &LinearStop, lambda: f64) -> (Self, DMatrix<f64>) {
        let poses: Vec<LinearPose> = stop.poses().collect();
        let (n, latent) = (6 * poses.len(), stop.unknowns());
        let (mut h, mut l) = (DMatrix::zeros(n, n), DMatrix::zeros(n, latent));
        for (k, pose) in poses.iter().enumerate() {
            h.view_mut((6 * k, 6 * k), (6, 6)).copy_from(pose.pp);
            l.rows_mut(6 * k, 6).copy_from(&pose.by_latents(latent));
        }
        let with_latents = l.tr_mul(&h);
        let mut information = &with_latents * &l;
        let prior = stop.prior();
        let damped: Vec<f64> =
            prior.iter().zip(information.diagonal().iter()).map(|(p, i)| p + lambda * (p + i)).collect();
        damped.iter().enumerate().for_each(|(k, prior)| information[(k, k)] += prior);
        let inverse_factor = inverse_factor(information).unwrap_or_else(|| DMatrix::zeros(latent, latent));
        let gain = inverse_factor.tr_mul(&(&inverse_factor * with_latents));
        let s = root(h);
        let mut scaled = s.tr_mul(&l);
        scaled.column_iter_mut().zip(&damped).for_each(|(mut column, prior)| column.unscale_mut(prior.sqrt()));
        let r = match linalg::inverse_factor(DMatrix::identity(s.ncols(), s.ncols()) + &scaled * scaled.transpose()) {
            Some(left) => s * left.transpose(),
            None => DMatrix::zeros(n, 0),
        };
        (Self { at: stop.at, inverse_factor, gain, rhs: DVector::zeros(latent) }, r)
    }

    /// Covariances from `G cov(x) G'`.
    fn spread(&self, stop: &LinearStop, spread: &DMatrix<f64>) -> StopCovariance {
        let of_pose = |(k, pose): (usize, LinearPose)| {
            let l = pose.by_latents(stop.unknowns());
            let mut by_unknowns = -(&l * &self.gain);
            (0..6).for_each(|i| by_unknowns[(i, 6 * k + i)] += 1.0);
            let by_latents = &self.inverse_factor * l.transpose();
            &by_unknowns * spread * by_unknowns.transpose() + by_latents.tr_mul(&by_latents)
        };
        let latents = self.left() + &self.gain * spread * self.gain.transpose();
        StopCovariance { latents, bodies: stop.poses().enumerate().map(of_pose).collect() }
    }

    /// `H_l^-1`.
    fn left(&self) -> DMatrix<f64> {
        self.inverse_factor.tr_mul(&self.inverse_factor)
    }
}

impl BodyStops {
    /// Adds their information of the dense columns: upper triangle.
    pub fn build(linear: LinearProblem, lambda: f64, a: &mut DMatrix<f64>) -> Self {
        let layout = &linear.adjustment.problem.layout;
        let stops: Vec<LinearStop> = linear.stops().filter(|stop| stop.places().is_empty()).collect();
        let of = |stops: &[LinearStop]| {
            let (blocks, roots): (Vec<Block>, Vec<_>) = stops.iter().map(|stop| Block::of(stop, lambda)).unzip();
            let rows = touched(layout, chains(stops));
            let mut information = DMatrix::zeros(rows.len(), rows.len());
            add_gram(&mut information, &transposed_times(stops, &rows, &roots), 1.0);
            (blocks, Group::of(std::iter::once(&rows)), information)
        };
        let mut all = Vec::with_capacity(stops.len());
        for (blocks, group, information) in stops.par_chunks(TOGETHER).map(of).collect::<Vec<_>>() {
            group.add_upper(a, &information);
            all.extend(blocks);
        }
        Self(all)
    }

    /// Takes over the right-hand sides of the latents at a linearisation; adds to that of the dense columns.
    pub fn reduce_gradient(&mut self, linear: LinearProblem, reduced: &mut DVector<f64>) {
        let theta = linear.adjustment.problem.layout.theta_len();
        let of = |blocks: &mut [Block]| {
            let mut sum = DVector::zeros(theta);
            for block in blocks {
                let stop = linear.stop(block.at);
                let gradient = stop.gradient();
                block.rhs = &block.inverse_factor * &gradient;
                let taken = block.gain.tr_mul(&gradient);
                for (part, taken) in stop.bodies().iter().zip(taken.as_slice().as_chunks().0) {
                    let pull: [f64; 6] = (part.terms.bp - Vector6::from(*taken)).into();
                    for (sum, by) in sum.iter_mut().zip(part.chain.columns()) {
                        *sum += dot(by, &pull);
                    }
                }
            }
            sum
        };
        for sum in self.0.par_chunks_mut(TOGETHER).map(of).collect::<Vec<_>>() {
            let mut reduced = reduced.rows_mut(0, theta);
            reduced += sum;
        }
    }

    /// Puts their part of the step from that of the dense columns.
    pub fn put_step(&self, linear: LinearProblem, x: &DVector<f64>, step: &mut Step) {
        let of = |block: &Block| {
            let stop = linear.stop(block.at);
            let moved = times(stop.bodies(), x.as_slice());
            let own = block.inverse_factor.tr_mul(&block.rhs) - &block.gain * moved;
            (stop, own)
        };
        for (stop, own) in self.0.par_iter().map(of).collect::<Vec<_>>() {
            stop.put(own.as_slice(), step);
        }
    }

    /// Takes what is latent out of right-hand sides of the dense columns.
    pub fn reduce(&self, linear: LinearProblem, of: &RightHandSides, reduced: &mut DMatrix<f64>) {
        let theta: Vec<usize> = (0..linear.adjustment.problem.layout.theta_len()).collect();
        for block in &self.0 {
            let taken = block.gain.tr_mul(&of.stops[block.at]);
            let mut reduced = reduced.rows_mut(0, theta.len());
            reduced -= transposed_times(&[linear.stop(block.at)], &theta, &[taken]);
        }
    }

    /// Puts their part of steps from those of the dense columns, for right-hand sides of their own.
    pub fn put_steps(&self, linear: LinearProblem, of: &RightHandSides, x: &DMatrix<f64>, steps: &mut [Step]) {
        for block in &self.0 {
            let stop = linear.stop(block.at);
            let left = block.left() * &of.stops[block.at];
            for ((step, x), left) in steps.iter_mut().zip(x.column_iter()).zip(left.column_iter()) {
                let own = left - &block.gain * times(stop.bodies(), x.as_slice());
                stop.put(own.as_slice(), step);
            }
        }
    }

    /// Natural logarithm of the determinant of the information of what is latent.
    pub fn log_determinant(&self) -> f64 {
        let of = |block: &Block| -2.0 * block.inverse_factor.diagonal().iter().map(|d| d.ln()).sum::<f64>();
        self.0.iter().map(of).sum()
    }

    /// `b' H_l^-1 b` of the right-hand sides of the latents.
    pub fn squares(&self) -> f64 {
        self.0.iter().map(|block| block.rhs.norm_squared()).sum()
    }

    /// Of those of some stops that are among these, with their places. With `S = G cov(x) G'`: of what is latent `H_l^-1 + K S K'`, of the poses
    /// `(1 - L K) S (1 - L K)' + L H_l^-1 L'`.
    pub fn stop_covariances(&self, reduced: &DMatrix<f64>, stops: &[LinearStop]) -> Vec<(usize, StopCovariance)> {
        let own = |stop: &LinearStop| Some(&self.0[self.0.binary_search_by_key(&stop.at, |block| block.at).ok()?]);
        let own: Vec<(LinearStop, &Block)> = stops.iter().filter_map(|stop| Some((stop.clone(), own(stop)?))).collect();
        let of_some = |own: &[(LinearStop, &Block)]| {
            let (stops, blocks): (Vec<LinearStop>, Vec<&Block>) = own.iter().cloned().unzip();
            let spreads = spreads(reduced, &stops);
            let of =
                |((stop, block), spread): ((LinearStop, &Block), DMatrix<f64>)| (stop.at, block.spread(&stop, &spread));
            stops.into_iter().zip(blocks).zip(spreads).map(of).collect::<Vec<_>>()
        };
        own.par_chunks(TOGETHER).flat_map_iter(of_some).collect()
    }
}

/// `G cov(x) G'` of the poses of each of some stops.
fn spreads(reduced: &DMatrix<f64>, stops: &[LinearStop]) -> Vec<DMatrix<f64>> {
    let Some(problem) = stops.first().map(LinearStop::problem) else { return Vec::new() };
    let rows = touched(&problem.layout, chains(stops));
    let by_columns = transposed(stops, &rows);
    let of_reduced = product(&Group::of(std::iter::once(&rows)).part_of(reduced), &by_columns);
    let mut end = 0;
    let spread = |stop: &LinearStop| {
        let own = end..end + 6 * stop.bodies().len();
        end = own.end;
        by_columns.columns_range(own.clone()).tr_mul(&of_reduced.columns_range(own))
    };
    stops.iter().map(spread).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nothing_is_told_of_has_no_column_in_the_root() {
        let told = DMatrix::from_fn(6, 2, |i, k| ((3 * i + 5 * k + 1) as f64).sin() * 10f64.powi(i as i32));
        let m = &told * told.transpose();
        let s = root(m.clone());
        assert_eq!(s.ncols(), 2);
        let error = &s * s.transpose() - &m;
        let largest = (0..6).flat_map(|i| (0..6).map(move |j| (i, j)));
        for (i, j) in largest {
            assert!(error[(i, j)].abs() < 1e-12 * (m[(i, i)] * m[(j, j)]).sqrt(), "{i} {j}: {error}");
        }
        assert_eq!(root(DMatrix::zeros(6, 6)).ncols(), 0);
    }
}
