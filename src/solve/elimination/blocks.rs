//! Blocks of the normal equations that both eliminations are made of.

use std::ops::Range;

use nalgebra::{DMatrix, DMatrixView};

use super::marker_rows::{ImageRows, MarkerRows};
use super::seen_markers::SeenMarkers;
use crate::linalg::{add_combination, product};
use crate::problem::{Equations, Layout};
use crate::solve::linear::{BodyPart, LinearImage, LinearProblem, StopParts};

/// Stops whose equations are taken together.
pub const STOPS_A_PRODUCT: usize = 48;

/// Coupling of the free dense columns with the markers that were seen.
pub struct DenseCoupling {
    /// The free columns.
    free: Vec<usize>,
    /// How many of them act through the camera poses.
    theta: usize,
    /// Free columns x 3 markers.
    values: DMatrix<f64>,
}

impl DenseCoupling {
    /// Of no image yet.
    pub fn new(layout: &Layout, seen: &SeenMarkers) -> Self {
        let free: Vec<usize> = (0..layout.len()).filter(|&c| layout.columns[c].free).collect();
        let theta = free.partition_point(|&c| c < layout.theta_len());
        let values = DMatrix::zeros(free.len(), 3 * seen.order.len());
        Self { free, theta, values }
    }

    /// Adds all images of some stops with their equations: markers are coupled with poses and direct columns, which the free columns move
    /// by `T`, so that theirs is one product.
    pub fn add(&mut self, stops: &PoseRows, images: &[(LinearImage, &Equations)], seen: &SeenMarkers) {
        let Self { free, theta, values } = self;
        let poses = 6 * images.len();
        let direct = free.len() - *theta;
        let mut transposed = DMatrix::zeros(free.len(), poses + direct);
        for (mut row, &c) in transposed.row_iter_mut().zip(&free[..*theta]) {
            row.columns_mut(0, poses).tr_copy_from(&stops.chain.view((0, c), (poses, 1)));
        }
        transposed.view_mut((*theta, poses), (direct, direct)).fill_with_identity();
        let row_of = |c: usize| Some(poses + free.binary_search(&c).ok()?.checked_sub(*theta)?);
        let images: Vec<ImageRows> = (images.iter().enumerate())
            .map(|(k, (own, equations))| ImageRows::of(own, equations, 6 * k, row_of))
            .collect();
        MarkerRows::of(poses + direct, seen, &images).add_product_to(values, &transposed);
    }

    /// With rows of all dense columns.
    pub fn of_all(&self, layout: &Layout) -> MarkerRows {
        let mut all = DMatrix::zeros(layout.len(), self.values.ncols());
        self.copy_to(&mut all, 0);
        MarkerRows::whole(&all)
    }

    /// Copies the columns to those of `into` from `first` on.
    pub fn copy_to(&self, into: &mut DMatrix<f64>, first: usize) {
        for (mut into, from) in into.columns_range_mut(first..).column_iter_mut().zip(self.values.column_iter()) {
            self.free.iter().zip(from.iter()).for_each(|(&row, value)| into[row] = *value);
        }
    }
}

/// Markers of an image, each once, and their coupling with its pose: 6 x 3 markers.
pub(super) fn pose_with_markers(equations: &Equations) -> (Vec<usize>, DMatrix<f64>) {
    let mut markers = equations.markers.clone();
    markers.dedup();
    let mut coupling = DMatrix::zeros(6, 3 * markers.len());
    let mut at = 0;
    for (&marker, sight) in equations.markers.iter().zip(equations.sights()) {
        at += usize::from(markers[at] != marker);
        let of_pose = sight.row_range(equations.pose_rows());
        for (d, w) in sight.by_marker().row_iter().enumerate() {
            let mut column = coupling.column_mut(3 * at + d);
            add_combination(column.as_mut_slice(), of_pose, [w[0], w[1]]);
        }
    }
    (markers, coupling)
}

/// The equations of the images and measured bodies of some stops in the space of their poses, six rows each, images first.
pub struct PoseRows<'a> {
    linear: LinearProblem<'a>,
    images: Range<usize>,
    bodies: Range<usize>,
    /// `G`, 6J x theta.
    chain: DMatrix<f64>,
    /// `[H_pp G, H_pe]`, 6J x dense.
    coupling: DMatrix<f64>,
}

impl<'a> PoseRows<'a> {
    /// Of stops one after the other, by their places among those in use.
    pub fn new(linear: LinearProblem<'a>, stops: &[StopParts]) -> Self {
        let layout = &linear.adjustment.problem.layout;
        let (theta, dense) = (layout.theta_len(), layout.len());
        let of = |parts: fn(&StopParts) -> &Range<usize>| {
            stops.first().map_or(0, |s| parts(s).start)..stops.last().map_or(0, |s| parts(s).end)
        };
        let (images, bodies) = (of(|s| &s.images), of(|s| &s.bodies));
        let rows = 6 * (images.len() + bodies.len());
        let (mut chain, mut coupling) = (DMatrix::zeros(rows, theta), DMatrix::zeros(rows, dense));
        for (k, own) in images.clone().map(|k| linear.image(k)).enumerate() {
            let LinearImage { terms, chain: by_theta, .. } = own;
            chain.rows_mut(6 * k, 6).copy_from(&by_theta.d_theta);
            coupling.view_mut((6 * k, 0), (6, theta)).copy_from(&(terms.pp * &by_theta.d_theta));
            for (e, c) in own.columns().iter().enumerate() {
                if let Some(c) = *c {
                    coupling.fixed_view_mut::<6, 1>(6 * k, c).copy_from(&terms.pe.column(e));
                }
            }
        }
        for (k, BodyPart { terms, chain: by_theta, .. }) in (images.len()..).zip(&linear.lin.bodies[bodies.clone()]) {
            chain.rows_mut(6 * k, 6).copy_from(&by_theta.d_theta);
            for c in 0..theta {
                let of_column = terms.pp * by_theta.d_theta.fixed_view::<6, 1>(0, c);
                coupling.fixed_view_mut::<6, 1>(6 * k, c).copy_from(&of_column);
            }
        }
        Self { linear, images, bodies, chain, coupling }
    }

    /// The dense columns.
    pub fn layout(&self) -> &Layout {
        &self.linear.adjustment.problem.layout
    }

    /// `[H_pp G, H_pe]` of a pose by its place among all of them, 6 x dense.
    pub fn of(&self, place: usize) -> DMatrixView<'_, f64> {
        let all = self.linear.images().len();
        let own = match place.checked_sub(all) {
            None => place - self.images.start,
            Some(body) => self.images.len() + body - self.bodies.start,
        };
        self.coupling.rows(6 * own, 6)
    }

    /// Adds the information of the dense columns: upper triangle.
    pub fn add_to(&self, a: &mut DMatrix<f64>) {
        let (theta, dense) = (self.layout().theta_len(), self.layout().len());
        let mut upper = a.view_mut((0, 0), (theta, dense));
        upper += product(&self.chain.transpose(), &self.coupling);
        for own in self.images.clone().map(|k| self.linear.image(k)) {
            let columns = own.columns().into_iter().enumerate();
            let mut used: Vec<(usize, usize)> = columns.filter_map(|(e, c)| Some((c?, e))).collect();
            used.sort_unstable();
            for (at, &(c, e)) in used.iter().enumerate() {
                let (mut into, of) = (a.column_mut(c), own.terms.ee.column(e));
                used[..=at].iter().for_each(|&(d, f)| into[d] += of[f]);
            }
        }
    }
}
