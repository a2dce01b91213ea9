//! What both eliminations share: the dense columns among themselves, and their coupling with a marker.

use nalgebra::{DMatrix, DVector};

use super::system::Linearised;
use crate::linalg::product;
use crate::problem::{Chained, Image, MarkerTerms, Problem};

/// The pixel equations of all images in the space of their camera poses, six rows an image.
pub(super) struct PoseRows {
    /// `G`, 6J x theta.
    chain: DMatrix<f64>,
    /// `[H_pp G, H_pe]`, 6J x dense.
    pub coupling: DMatrix<f64>,
}

impl PoseRows {
    pub fn new(problem: &Problem, lin: &Linearised) -> Self {
        let (theta, dense) = (problem.layout.theta_len(), problem.layout.len());
        let rows = 6 * lin.images.len();
        let (mut chain, mut coupling) = (DMatrix::zeros(rows, theta), DMatrix::zeros(rows, dense));
        for (k, (terms, own)) in lin.terms.iter().zip(&lin.chains).enumerate() {
            chain.rows_mut(6 * k, 6).copy_from(&own.d_theta);
            coupling.view_mut((6 * k, 0), (6, theta)).copy_from(&(terms.pp * &own.d_theta));
            for (e, c) in problem.layout.intrinsics(&problem.images[lin.images[k]]).iter().enumerate() {
                if let Some(c) = *c {
                    coupling.fixed_view_mut::<6, 1>(6 * k, c).copy_from(&terms.pe.column(e));
                }
            }
        }
        Self { chain, coupling }
    }

    /// Adds information (upper triangle) and right-hand side of the dense columns.
    pub fn add_to(&self, problem: &Problem, lin: &Linearised, a: &mut DMatrix<f64>, rhs: &mut DVector<f64>) {
        let (theta, dense) = (problem.layout.theta_len(), problem.layout.len());
        let transposed = self.chain.transpose();
        let mut upper = a.view_mut((0, 0), (theta, dense));
        upper += product(&transposed, &self.coupling);
        let poses = DVector::from_iterator(6 * lin.terms.len(), lin.terms.iter().flat_map(|t| t.bp.iter().copied()));
        let mut of_theta = rhs.rows_mut(0, theta);
        of_theta += transposed * poses;
        for (terms, &i) in lin.terms.iter().zip(&lin.images) {
            let columns = problem.layout.intrinsics(&problem.images[i]);
            let used = || columns.iter().enumerate().filter_map(|(e, c)| c.map(|c| (e, c)));
            for (e, c) in used() {
                rhs[c] += terms.be[e];
                used().filter(|(_, d)| *d <= c).for_each(|(f, d)| a[(d, c)] += terms.ee[(f, e)]);
            }
        }
    }
}

/// Dense columns of an image that are free: those of theta, and those of its intrinsic unknowns.
pub(super) struct FreeColumns {
    pub theta: Vec<usize>,
    intrinsic: Vec<Option<usize>>,
    /// `G'` with zeros for the columns that are not free; empty where none is.
    chain: DMatrix<f64>,
}

impl FreeColumns {
    pub fn of(problem: &Problem, image: &Image, chain: &Chained) -> Self {
        let columns = &problem.layout.columns;
        let intrinsic = problem.layout.intrinsics(image).into_iter();
        let intrinsic = intrinsic.map(|c| c.filter(|c| columns[*c].free)).collect();
        let theta: Vec<usize> = (0..problem.layout.theta_len()).filter(|&c| columns[c].free).collect();
        let mut transposed = DMatrix::zeros(theta.last().map_or(0, |c| c + 1), 6);
        for &c in &theta {
            transposed.row_mut(c).tr_copy_from(&chain.d_theta.column(c));
        }
        Self { theta, intrinsic, chain: transposed }
    }

    /// All of them.
    pub fn all(&self) -> impl Iterator<Item = usize> + '_ {
        self.theta.iter().copied().chain(self.intrinsic.iter().flatten().copied())
    }

    /// Adds the coupling of a marker with the free dense columns to three columns of `into`, from `first` on.
    pub fn add_coupling(&self, into: &mut DMatrix<f64>, first: usize, terms: &MarkerTerms) {
        let rows = self.chain.nrows();
        let g: [&[f64]; 6] = std::array::from_fn(|k| &self.chain.as_slice()[k * rows..(k + 1) * rows]);
        for d in 0..3 {
            let mp: [f64; 6] = std::array::from_fn(|k| terms.mp[(d, k)]);
            let mut column = into.column_mut(first + d);
            for (c, x) in column.as_mut_slice()[..rows].iter_mut().enumerate() {
                *x += mp[0] * g[0][c]
                    + mp[1] * g[1][c]
                    + mp[2] * g[2][c]
                    + mp[3] * g[3][c]
                    + mp[4] * g[4][c]
                    + mp[5] * g[5][c];
            }
        }
        for (e, values) in terms.intrinsics() {
            if let Some(c) = self.intrinsic[e] {
                (0..3).for_each(|d| into[(c, first + d)] += values[d]);
            }
        }
    }
}
