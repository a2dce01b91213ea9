//! Blocks of the normal equations that both eliminations are made of, and their right-hand sides.

use std::ops::Range;

use nalgebra::{DMatrix, DMatrixView, DVector, Matrix3, Vector3};
use rayon::prelude::*;

use super::linear::{BodyPart, LinearImage, LinearProblem, StopParts};
use super::runs::{Run, runs};
use crate::linalg::{add_product, product, wide};
use crate::problem::{Adjustment, E, Equations, Layout, Problem, Sight};

/// Stops whose equations are taken together.
pub(super) const STOPS_A_PRODUCT: usize = 48;

/// Markers that images in use show.
#[derive(Debug, Clone)]
pub struct SeenMarkers {
    /// Number of each marker among those that were seen, per plate.
    pub number: Vec<Vec<Option<usize>>>,
    /// Plate and index of each that was seen.
    pub order: Vec<(usize, usize)>,
}

impl SeenMarkers {
    /// None, so that all stay where they are.
    pub fn none(problem: &Problem) -> Self {
        Self { number: problem.plates.iter().map(|p| vec![None; p.markers.len()]).collect(), order: Vec::new() }
    }

    /// Numbered by plate and index.
    pub fn of(linear: LinearProblem) -> Self {
        let mut seen = Self::none(&linear.adjustment.problem);
        for LinearImage { image, terms, .. } in linear.images() {
            let number = &mut seen.number[image.plate];
            terms.markers.iter().for_each(|m| number[m.marker] = Some(0));
        }
        for (p, plate) in seen.number.iter_mut().enumerate() {
            for (m, at) in plate.iter_mut().enumerate().filter(|(_, at)| at.is_some()) {
                *at = Some(seen.order.len());
                seen.order.push((p, m));
            }
        }
        seen
    }

    /// A step of every marker of every plate, from that of each that was seen by its number.
    pub fn steps(&self, of: impl Fn(usize) -> Vector3<f64>) -> Vec<Vec<Vector3<f64>>> {
        let step = |at: &Option<usize>| at.map_or(Vector3::zeros(), &of);
        self.number.iter().map(|plate| plate.iter().map(step).collect()).collect()
    }

    /// Information of each, prior included.
    pub fn information(&self, linear: LinearProblem) -> Vec<Matrix3<f64>> {
        let prior = |&(p, m): &(usize, usize)| {
            Matrix3::from_diagonal_element(linear.adjustment.problem.marker_information(p, m))
        };
        let mut information: Vec<Matrix3<f64>> = self.order.iter().map(prior).collect();
        for LinearImage { image, terms, .. } in linear.images() {
            let number = &self.number[image.plate];
            for own in &terms.markers {
                number[own.marker].iter().for_each(|&at| information[at] += own.mm);
            }
        }
        information
    }

    /// Derivatives of the measured distances over their sigmas, 3 markers x distances, 1/m.
    pub fn by_distances(&self, linear: LinearProblem) -> DMatrix<f64> {
        let distances = &linear.lin.distances;
        let mut rows = DMatrix::zeros(3 * self.order.len(), distances.len());
        for (k, distance) in distances.iter().enumerate() {
            for (marker, direction) in &distance.ends {
                let at = self.number[distance.plate][*marker];
                at.iter().for_each(|at| rows.fixed_view_mut::<3, 1>(3 * at, k).copy_from(direction));
            }
        }
        rows
    }

    /// Right-hand side of each, prior included.
    pub fn gradient(&self, linear: LinearProblem) -> DVector<f64> {
        let Adjustment { problem, state } = linear.adjustment;
        let mut gradient = DVector::zeros(3 * self.order.len());
        for (at, &(p, m)) in self.order.iter().enumerate() {
            let pull = state.plates[p].corrections[m] * -problem.marker_information(p, m);
            gradient.fixed_rows_mut::<3>(3 * at).copy_from(&pull);
        }
        for LinearImage { image, terms, .. } in linear.images() {
            let number = &self.number[image.plate];
            for own in &terms.markers {
                if let Some(at) = number[own.marker] {
                    let mut sum = gradient.fixed_rows_mut::<3>(3 * at);
                    sum += own.bm;
                }
            }
        }
        gradient
    }
}

/// Coupling of some unknowns with the markers that were seen.
pub(super) struct MarkerRows {
    /// Unknowns x 3 markers.
    pub values: DMatrix<f64>,
}

/// Markers whose columns are made together: those of as many stay in the cache of a processor while the images are gone through.
const MARKERS_A_BLOCK: usize = 64;

/// The equations of an image of a plate, and the rows of its unknowns.
pub(super) struct ImageRows<'a> {
    pub plate: usize,
    pub equations: &'a Equations,
    /// The first of the six of its pose, where that has rows.
    pub pose: Option<usize>,
    /// Those of its intrinsics, each where it has one.
    pub intrinsics: Vec<Option<usize>>,
}

/// An image with its observations in the order of the markers that were seen.
struct Ordered<'a> {
    image: &'a ImageRows<'a>,
    runs: Vec<Run>,
    sights: Vec<(usize, Sight<'a>)>,
}

impl<'a> Ordered<'a> {
    fn new(image: &'a ImageRows<'a>, seen: &SeenMarkers) -> Self {
        let ImageRows { plate, equations, pose, intrinsics } = image;
        let of_pose = pose.iter().flat_map(|&row| equations.pose_rows().zip(row..));
        let row_of = |e: usize| Some((equations.intrinsic_row(e)?, intrinsics[e]?));
        let runs = runs(of_pose.chain((0..E).filter_map(row_of)));
        let numbered = equations.markers.iter().zip(equations.sights());
        let mut sights: Vec<_> = numbered.filter_map(|(&m, sight)| Some((seen.number[*plate][m]?, sight))).collect();
        sights.sort_by_key(|(at, _)| *at);
        Self { image, runs, sights }
    }

    /// Adds the coupling with some markers to their columns, of so many rows each.
    fn add_to(&self, (columns, rows): (&mut [f64], usize), some: &Range<usize>) {
        let place = |at: usize| self.sights.partition_point(|sight| sight.0 < at);
        let sights = &self.sights[place(some.start)..place(some.end)];
        wide(
            #[inline(always)]
            || {
                for (at, sight) in sights {
                    let of_marker = columns[3 * (at - some.start) * rows..].chunks_exact_mut(rows);
                    for (into, w) in of_marker.zip(sight.by_marker().row_iter()) {
                        for run in &self.runs {
                            let of = sight.row_range(run.from..run.from + run.length);
                            add_combination(&mut into[run.into..run.into + run.length], of, [w[0], w[1]]);
                        }
                    }
                }
            },
        );
        for (at, sight) in sights {
            for (point, d) in sight.by_field() {
                let own = sight.by_marker() * d;
                for (component, column) in own.column_iter().enumerate() {
                    if let Some(row) = self.image.intrinsics[E + 2 * point + component] {
                        (0..3).for_each(|d| columns[(3 * (at - some.start) + d) * rows + row] += column[d]);
                    }
                }
            }
        }
    }
}

impl MarkerRows {
    /// Of no image yet.
    pub fn new(unknowns: usize, seen: &SeenMarkers) -> Self {
        Self { values: DMatrix::zeros(unknowns, 3 * seen.order.len()) }
    }

    /// Adds some images, blocks of markers side by side.
    pub fn add(&mut self, seen: &SeenMarkers, images: &[ImageRows]) {
        let rows = self.values.nrows();
        if rows == 0 {
            return;
        }
        let images: Vec<Ordered> = images.iter().map(|image| Ordered::new(image, seen)).collect();
        let blocks = self.values.as_mut_slice().par_chunks_mut(3 * MARKERS_A_BLOCK * rows);
        blocks.enumerate().for_each(|(block, columns)| {
            let some = block * MARKERS_A_BLOCK..(block + 1) * MARKERS_A_BLOCK;
            images.iter().for_each(|image| image.add_to((columns, rows), &some));
        });
    }

    /// Multiplies the columns of every marker from the right by a matrix of its own.
    pub fn times_right(&mut self, matrices: &[Matrix3<f64>]) {
        let rows = self.values.nrows();
        if rows == 0 {
            return;
        }
        let blocks = self.values.as_mut_slice().par_chunks_mut(3 * MARKERS_A_BLOCK * rows);
        blocks.zip(matrices.par_chunks(MARKERS_A_BLOCK)).for_each(|(columns, matrices)| {
            let each = columns.chunks_exact_mut(3 * rows).zip(matrices);
            wide(
                #[inline(always)]
                || each.for_each(|(columns, m)| times_right(columns, m)),
            );
        });
    }
}

/// Coupling of the free dense columns with the markers that were seen.
pub(super) struct DenseCoupling {
    /// The free columns.
    free: Vec<usize>,
    /// How many of them act through the camera poses.
    theta: usize,
    /// Of the free columns.
    rows: MarkerRows,
}

impl DenseCoupling {
    /// Of no image yet.
    pub fn new(problem: &Problem, seen: &SeenMarkers) -> Self {
        let columns = &problem.layout.columns;
        let free: Vec<usize> = (0..columns.len()).filter(|&c| columns[c].free).collect();
        let theta = free.partition_point(|&c| c < problem.layout.theta_len());
        let rows = MarkerRows::new(free.len(), seen);
        Self { free, theta, rows }
    }

    /// Adds images with their equations: the pose of each moves by `G`, so that theirs are one product.
    pub fn add(&mut self, images: &[(LinearImage, &Equations)], seen: &SeenMarkers) {
        let place = |c: Option<usize>| self.free.binary_search(&c?).ok();
        let mut by_theta = DMatrix::zeros(self.theta, 6 * images.len());
        let (mut of_poses, mut direct) = (Vec::new(), Vec::new());
        for (k, (own, equations)) in images.iter().enumerate() {
            for (mut row, &c) in by_theta.row_iter_mut().zip(&self.free) {
                row.columns_mut(6 * k, 6).tr_copy_from(&own.chain.d_theta.column(c));
            }
            let (plate, columns) = (own.image.plate, own.columns());
            let none = vec![None; columns.len()];
            of_poses.push(ImageRows { plate, equations, pose: Some(6 * k), intrinsics: none });
            let intrinsics = columns.into_iter().map(place).collect();
            direct.push(ImageRows { plate, equations, pose: None, intrinsics });
        }
        self.rows.add(seen, &direct);
        let mut poses = MarkerRows::new(6 * images.len(), seen);
        poses.add(seen, &of_poses);
        add_product(&mut self.rows.values, &by_theta, &poses.values);
    }

    /// Copies the columns to those of `into` from `first` on.
    pub fn copy_to(&self, into: &mut DMatrix<f64>, first: usize) {
        for (mut into, from) in into.columns_range_mut(first..).column_iter_mut().zip(self.rows.values.column_iter()) {
            self.free.iter().zip(from.iter()).for_each(|(&row, value)| into[row] = *value);
        }
    }
}

/// Multiplies three columns by `m` from the right.
#[inline(always)]
fn times_right(columns: &mut [f64], m: &Matrix3<f64>) {
    let (x, rest) = columns.split_at_mut(columns.len() / 3);
    let (y, z) = rest.split_at_mut(x.len());
    for ((x, y), z) in x.iter_mut().zip(y).zip(z) {
        let old = [*x, *y, *z];
        let new = |k: usize| old[0] * m[(0, k)] + old[1] * m[(1, k)] + old[2] * m[(2, k)];
        (*x, *y, *z) = (new(0), new(1), new(2));
    }
}

/// `into += a s + b t`.
#[inline(always)]
pub(super) fn add_combination(into: &mut [f64], [a, b]: [&[f64]; 2], [s, t]: [f64; 2]) {
    for ((x, a), b) in into.iter_mut().zip(a).zip(b) {
        *x += a * s + b * t;
    }
}

/// Markers of an image, each once, and their coupling with what is latent through `l`: latent x 3 markers.
pub(super) fn latents_with_markers(l: &DMatrix<f64>, equations: &Equations) -> (Vec<usize>, DMatrix<f64>) {
    let by_latents = equations.through_pose(&l.transpose());
    let mut markers = equations.markers.clone();
    markers.dedup();
    let mut coupling = DMatrix::zeros(l.ncols(), 3 * markers.len());
    let mut at = 0;
    for (o, (&marker, sight)) in equations.markers.iter().zip(equations.sights()).enumerate() {
        at += usize::from(markers[at] != marker);
        let (a, b) = (by_latents.column(2 * o), by_latents.column(2 * o + 1));
        for (d, w) in sight.by_marker().row_iter().enumerate() {
            let mut column = coupling.column_mut(3 * at + d);
            add_combination(column.as_mut_slice(), [a.as_slice(), b.as_slice()], [w[0], w[1]]);
        }
    }
    (markers, coupling)
}

/// The equations of the images and measured bodies of some stops in the space of their poses, six rows each, images first.
pub(super) struct PoseRows<'a> {
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
            coupling.view_mut((6 * k, 0), (6, theta)).copy_from(&(terms.pp * &by_theta.d_theta));
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
            let (columns, terms) = (own.columns(), own.terms);
            let used = || columns.iter().enumerate().filter_map(|(e, c)| c.map(|c| (e, c)));
            for (e, c) in used() {
                used().filter(|(_, d)| *d <= c).for_each(|(f, d)| a[(d, c)] += terms.ee[(f, e)]);
            }
        }
    }
}
