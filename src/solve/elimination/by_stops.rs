//! What is latent eliminated stop by stop: the dense columns and the markers stay.
//!
//! With the information `H = F F'` of what is latent at a stop (pixels of its images through `L`, and the priors) and its coupling `B` with
//! what stays, `Y = B F^-T`: the reduced information is the information without the elimination less `sum Y Y'`, one Gram product. What is latent is
//! coupled through the poses alone: with the coupling `C` of these, `B = C L`, and with `F^-1 L' = Q R` it is `Y = C R' Q'`. Where poses have fewer
//! components than there are latents, `C R'` stands for `Y`. Stops at which no image was taken need none of that ([`super::body_stops`]).

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use nalgebra::{DMatrix, DMatrixView, DVector, DVectorView, Matrix3, SMatrix};
use rayon::prelude::*;

use super::alike::alike;
use super::blocks::{DenseCoupling, PoseRows, STOPS_A_PRODUCT, pose_with_markers};
use super::body_stops::{BodyStops, touched};
use super::group::{Group, union};
use super::right_hand_sides::RightHandSides;
use super::seen_markers::SeenMarkers;
use super::stop_covariance::StopCovariance;
use crate::linalg::{gram, inverse_factor, mirror_upper, orthonormal, product, upper_product};
use crate::model::plate_modes::MODES;
use crate::problem::{Equations, Step};
use crate::solve::linear::Carried;
use crate::solve::linear::{LinearImage, LinearPose, LinearProblem, LinearStop};

/// What moves a marker with the modes of a plate.
type Modes = SMatrix<f64, 3, MODES>;

/// What is latent at one stop, with its elimination.
#[derive(Debug, Clone)]
struct Block {
    /// Place of the stop among those in use.
    at: usize,
    /// `F^-1`.
    inverse_factor: DMatrix<f64>,
    /// Unknowns that stay and that its images touch, ascending.
    rows: Arc<Vec<usize>>,
    /// `Y Q`, `rows` x columns of `Q`.
    y: Arc<DMatrix<f64>>,
    /// `Q`, orthonormal, latent x at most as many; `None` for one.
    basis: Option<DMatrix<f64>>,
    /// `F^-1` times the right-hand side.
    rhs: DVector<f64>,
}

/// How something moves, transposed: a column for each of its coordinates.
struct Through {
    /// By the unknowns that its stop touches, of as many combinations as move it.
    by_rows: DMatrix<f64>,
    /// Combinations x its coordinates; `None` where they are these.
    combined: Option<DMatrix<f64>>,
    /// By what is left of the latents of its stop, normalised.
    by_latents: DMatrix<f64>,
}

/// Every stop in use with its elimination.
#[derive(Debug, Clone)]
pub struct StopsEliminated {
    /// Stops with images, ascending.
    blocks: Vec<Block>,
    /// Their places, those together that show much the same markers.
    groups: Vec<Vec<usize>>,
    /// All others.
    bodies: BodyStops,
    seen: SeenMarkers,
    /// Number of dense columns: the first unknown of the markers.
    dense: usize,
}

impl StopsEliminated {
    /// Information with the priors of latents and markers, without those of the dense columns; markers that are not among those `seen` stay
    /// where they are.
    pub fn build(linear: LinearProblem, lambda: f64, seen: SeenMarkers) -> (DMatrix<f64>, Self) {
        let dense = linear.adjustment.problem.layout.len();
        let n = dense + 3 * seen.order.len();
        let mut a = DMatrix::zeros(n, n);
        for (at, information) in seen.information(linear).iter().enumerate() {
            a.fixed_view_mut::<3, 3>(dense + 3 * at, dense + 3 * at).copy_from(information);
        }
        let mut coupling = DenseCoupling::new(&linear.adjustment.problem.layout, &seen);
        let mut blocks = Vec::with_capacity(linear.stops().len());
        let alike_stops = linear.lin.stops.chunk_by(|a, b| a.images.is_empty() == b.images.is_empty());
        let with_images = alike_stops.filter(|stops| !stops[0].images.is_empty());
        for stops in with_images.flat_map(|stops| stops.chunks(STOPS_A_PRODUCT)) {
            let rows = PoseRows::new(linear, stops);
            rows.add_to(&mut a);
            let stops: Vec<LinearStop> = linear.stops_of(stops).collect();
            let own: Vec<_> = stops.par_iter().map(|stop| Block::of(stop, &rows, (dense, &seen), lambda)).collect();
            let (own, equations): (Vec<Block>, Vec<_>) = own.into_iter().unzip();
            let equations = equations.iter().flatten().map(Cow::as_ref);
            let images: Vec<_> = stops.iter().flat_map(LinearStop::images).zip(equations).collect();
            coupling.add(&rows, &images, &seen);
            blocks.extend(own);
        }
        coupling.copy_to(&mut a, dense);
        let bodies = BodyStops::build(linear, lambda, &mut a);
        let groups = alike(&blocks.iter().map(|block| linear.stop(block.at)).collect::<Vec<_>>());
        for places in &groups {
            let own = || places.iter().map(|&place: &usize| &blocks[place]);
            let group = Group::of(own().map(|block| &*block.rows));
            group.subtract_gram(&mut a, &group.side_by_side(own().map(|block| (&*block.rows, &*block.y))));
        }
        mirror_upper(&mut a);
        (a, Self { blocks, groups, bodies, seen, dense })
    }

    /// Several parts with stops of their own together, each with its stops by their places there; `place` is that of a stop among all. No part has
    /// stops without images.
    pub fn together<'a>(
        parts: impl Iterator<Item = (&'a Self, &'a [usize])>,
        place: impl Fn(usize) -> Option<usize>,
    ) -> Option<Self> {
        let (mut blocks, mut groups, mut first): (Vec<Block>, Vec<Vec<usize>>, _) = (Vec::new(), Vec::new(), None);
        for (part, stops) in parts {
            let at: Vec<usize> = part.blocks.iter().map(|block| place(stops[block.at])).collect::<Option<_>>()?;
            groups.extend(part.groups.iter().map(|group| group.iter().map(|&own| at[own]).collect()));
            blocks.extend(part.blocks.iter().zip(&at).map(|(block, &at)| Block { at, ..block.clone() }));
            first.get_or_insert(part);
        }
        blocks.sort_unstable_by_key(|block| block.at);
        let Self { bodies, seen, dense, .. } = first?.clone();
        Some(Self { blocks, groups, bodies, seen, dense })
    }

    /// Takes the priors of the markers so many times out of an information.
    pub fn take_priors(&self, linear: LinearProblem, times: usize, information: &mut DMatrix<f64>) {
        for (at, &(plate, marker)) in self.seen.order.iter().enumerate() {
            let taken = times as f64 * linear.adjustment.problem.marker_information(plate, marker);
            (0..3).map(|d| self.dense + 3 * at + d).for_each(|row| information[(row, row)] -= taken);
        }
    }

    /// Takes over the right-hand sides of the latents at a linearisation; returns the reduced one, without the priors of the dense columns.
    pub fn reduce_gradient(&mut self, linear: LinearProblem) -> DVector<f64> {
        let dense = self.dense;
        let bodies = self.blocks.iter().flat_map(|block| linear.stop(block.at).bodies());
        let mut reduced = linear.dense_gradient(bodies).resize_vertically(dense + 3 * self.seen.order.len(), 0.0);
        self.bodies.reduce_gradient(linear, &mut reduced);
        reduced.rows_range_mut(dense..).copy_from(&self.seen.gradient(linear));
        for block in &mut self.blocks {
            block.rhs = &block.inverse_factor * linear.stop(block.at).gradient();
            let taken = match &block.basis {
                Some(basis) => &*block.y * basis.tr_mul(&block.rhs),
                None => &*block.y * &block.rhs,
            };
            block.rows.iter().zip(taken.iter()).for_each(|(&row, value)| reduced[row] -= value);
        }
        reduced
    }

    /// Holds combinations of markers (3 markers x held) in the information of what stays; returns their orthonormal basis.
    pub fn hold(&self, combinations: DMatrix<f64>, information: &mut DMatrix<f64>) -> DMatrix<f64> {
        let held = orthonormal(combinations);
        let stiff = information.diagonal().rows_range(self.dense..).mean();
        self.project(&held, information);
        let mut markers = information.view_range_mut(self.dense.., self.dense..);
        markers += gram(&held) * stiff;
        held
    }

    /// `Q m Q` with what takes the orthonormal combinations of markers out of the unknowns.
    pub fn project(&self, held: &DMatrix<f64>, m: &mut DMatrix<f64>) {
        let taken = product(held, &held.tr_mul(&m.rows_range(self.dense..)));
        let mut rows = m.rows_range_mut(self.dense..);
        rows -= taken;
        let taken = product(&(m.columns_range(self.dense..) * held), &held.transpose());
        let mut columns = m.columns_range_mut(self.dense..);
        columns -= taken;
    }

    /// Takes what moves some of the latents of a stop, from `first` on, along with the unknowns from `to` on out of them.
    pub fn carry(&mut self, (stop, first): (usize, usize), to: usize, by: &DMatrix<f64>) {
        let Some(block) = self.blocks.iter_mut().find(|block| block.at == stop) else { return };
        let Some(factor) = block.inverse_factor.clone().try_inverse() else { return };
        if let Some(basis) = block.basis.take() {
            block.y = Arc::new(product(&block.y, &basis.transpose()));
        }
        let carried = by.tr_mul(&factor.rows(first, by.nrows()));
        for (at, row) in block.rows.iter().enumerate().filter(|(_, r)| (to..to + by.ncols()).contains(r)) {
            let mut own = Arc::make_mut(&mut block.y).row_mut(at);
            own += carried.row(row - to);
        }
    }

    /// Completes rows of measured distances by those of the markers, less what is held of them; nothing is eliminated of them.
    pub fn complete_rows(
        &self,
        linear: LinearProblem,
        held: Option<&DMatrix<f64>>,
        rows: &mut DMatrix<f64>,
    ) -> DMatrix<f64> {
        let mut markers = self.seen.by_distances(linear);
        if let Some(held) = held {
            markers -= held * held.tr_mul(&markers);
        }
        rows.rows_range_mut(self.dense..).copy_from(&markers);
        DMatrix::zeros(0, rows.ncols())
    }

    /// Plate and index of the marker that an unknown behind the dense columns moves.
    pub fn marker(&self, row: usize) -> (usize, usize) {
        self.seen.order[(row - self.dense) / 3]
    }

    /// Natural logarithm of the determinant of the information of what is latent at all stops.
    pub fn log_determinant(&self) -> f64 {
        let of = |block: &Block| -2.0 * block.inverse_factor.diagonal().iter().map(|d| d.ln()).sum::<f64>();
        self.blocks.iter().map(of).sum::<f64>() + self.bodies.log_determinant()
    }

    /// `b' H^-1 b` of the right-hand sides of the latents.
    pub fn squares(&self) -> f64 {
        self.blocks.iter().map(|b| b.rhs.norm_squared()).sum::<f64>() + self.bodies.squares()
    }

    /// The whole step from the solution `x` of the reduced system.
    pub fn step(&self, linear: LinearProblem, x: &DVector<f64>) -> Step {
        let mut step = self.of_what_stays(linear, x.column(0));
        for block in &self.blocks {
            let own = DVector::from_iterator(block.rows.len(), block.rows.iter().map(|&c| x[c]));
            let own = block.y.tr_mul(&own);
            let taken = block.basis.as_ref().map_or_else(|| own.clone(), |basis| basis * &own);
            let dl = block.inverse_factor.tr_mul(&(&block.rhs - taken));
            linear.stop(block.at).put(dl.as_slice(), &mut step);
        }
        self.bodies.put_step(linear, x, &mut step);
        step
    }

    /// The step of what stays.
    fn of_what_stays(&self, linear: LinearProblem, x: DVectorView<f64>) -> Step {
        let markers = self.seen.steps(|at| x.fixed_rows::<3>(self.dense + 3 * at).into_owned());
        Step::of(x.rows(0, self.dense).into_owned(), markers, &linear.adjustment.state)
    }

    /// Whole steps for right-hand sides of their own, by what solves the reduced system.
    pub fn steps(
        &self,
        linear: LinearProblem,
        of: &RightHandSides,
        solve: impl Fn(DMatrix<f64>) -> DMatrix<f64>,
    ) -> Vec<Step> {
        let dense = self.dense;
        let mut reduced = of.dense.clone().resize_vertically(dense + of.markers.nrows(), 0.0);
        reduced.rows_range_mut(dense..).copy_from(&of.markers);
        let whitened: Vec<DMatrix<f64>> =
            self.blocks.iter().map(|block| &block.inverse_factor * &of.stops[block.at]).collect();
        self.bodies.reduce(linear, of, &mut reduced);
        for (block, own) in self.blocks.iter().zip(&whitened) {
            let taken = product(&block.y, &block.in_basis(own));
            for (&row, taken) in block.rows.iter().zip(taken.row_iter()) {
                let mut row = reduced.row_mut(row);
                row -= taken;
            }
        }
        let x = solve(reduced);
        let mut steps: Vec<Step> = x.column_iter().map(|x| self.of_what_stays(linear, x)).collect();
        self.bodies.put_steps(linear, of, &x, &mut steps);
        for (block, own) in self.blocks.iter().zip(&whitened) {
            let left = own - block.out_of_basis(product(&block.y.transpose(), &x.select_rows(block.rows.iter())));
            let (latents, stop) = (block.inverse_factor.tr_mul(&left), linear.stop(block.at));
            steps.iter_mut().zip(latents.column_iter()).for_each(|(step, own)| stop.put(own.as_slice(), step));
        }
        steps
    }

    /// `D' cov(x) D + R' R` of what moves through `D'` and `R'`, of different stops.
    fn covariances(
        &self,
        reduced: &DMatrix<f64>,
        stops: &[LinearStop],
        moves: impl Fn(&Block, &LinearStop) -> Vec<Through> + Sync,
    ) -> HashMap<usize, Vec<DMatrix<f64>>> {
        let asked: HashMap<usize, &LinearStop> = stops.iter().map(|stop| (stop.at, stop)).collect();
        let of_group = |places: &Vec<usize>| {
            let own = places.iter().map(|&place| &self.blocks[place]);
            let own = own.filter_map(|block| Some((block, moves(block, asked.get(&block.at)?))));
            let own: Vec<(&Block, Vec<Through>)> = own.collect();
            let all = || own.iter().flat_map(|(block, of)| of.iter().map(|t| (&*block.rows, &t.by_rows)));
            let group = Group::of(all().map(|(rows, _)| rows));
            let d = group.side_by_side(all());
            let of_reduced = upper_product(&group.half_of(reduced), &d);
            let mut end = 0;
            let mut spread = |Through { by_rows, combined, by_latents }: &Through| {
                let columns = by_rows.ncols();
                end += columns;
                let half = d.columns(end - columns, columns).tr_mul(&of_reduced.columns(end - columns, columns));
                let whole = &half + half.transpose();
                let own = combined.as_ref().map_or_else(|| whole.clone(), |by| by.tr_mul(&(&whole * by)));
                own + by_latents.tr_mul(by_latents)
            };
            let mut of_stop = |(block, of): &(&Block, Vec<Through>)| (block.at, of.iter().map(&mut spread).collect());
            own.iter().map(&mut of_stop).collect::<Vec<(usize, Vec<DMatrix<f64>>)>>()
        };
        self.groups.par_iter().flat_map_iter(of_group).collect()
    }

    /// Of different stops: of what is latent there, `H^-1 + H^-1 B' cov(x) B H^-1`, and of measured bodies.
    pub fn stop_covariances(&self, reduced: &DMatrix<f64>, stops: &[LinearStop]) -> Vec<StopCovariance> {
        let moves = |block: &Block, stop: &LinearStop| {
            let Block { inverse_factor, y, basis, .. } = block;
            let combined = Some(basis.as_ref().map_or_else(|| inverse_factor.clone(), |q| q.tr_mul(inverse_factor)));
            let latents = Through { by_rows: (**y).clone(), combined, by_latents: inverse_factor.clone() };
            std::iter::once(latents).chain(stop.body_poses().map(|pose| block.through(&pose))).collect()
        };
        let of_images = self.covariances(reduced, stops, moves).into_iter();
        let of_images = of_images.map(|(at, mut all)| (at, StopCovariance { latents: all.remove(0), bodies: all }));
        let mut found: HashMap<usize, StopCovariance> =
            of_images.chain(self.bodies.stop_covariances(reduced, stops)).collect();
        stops.iter().filter_map(|stop| found.remove(&stop.at)).collect()
    }

    /// Covariances of the camera poses of different stops, as their body twists.
    pub fn camera_poses(&self, reduced: &DMatrix<f64>, stops: &[LinearStop]) -> Vec<DMatrix<f64>> {
        let cameras = |block: &Block, stop: &LinearStop| stop.camera_poses().map(|pose| block.through(&pose)).collect();
        let mut found = self.covariances(reduced, stops, cameras);
        stops.iter().filter_map(|stop| found.remove(&stop.at)).flatten().collect()
    }

    /// Covariance of every marker that was seen; with what moves it with the dense columns for a position.
    pub fn marker_covariances(
        &self,
        reduced: &DMatrix<f64>,
        carried: Option<&Carried>,
    ) -> Vec<Vec<Option<Matrix3<f64>>>> {
        let of = |p: usize, m: usize, start: usize| {
            let own = reduced.fixed_view::<3, 3>(start, start).into_owned();
            let carried: Vec<_> = carried.into_iter().flat_map(|c| c(p, m)).collect();
            let of_two = |(i, a): &(usize, Modes)| -> Matrix3<f64> {
                let with = |(k, b): &(usize, Modes)| a * reduced.fixed_view::<MODES, MODES>(*i, *k) * b.transpose();
                let with_marker = reduced.fixed_view::<3, MODES>(start, *i) * a.transpose();
                with_marker + with_marker.transpose() + carried.iter().map(with).sum::<Matrix3<f64>>()
            };
            own + carried.iter().map(of_two).sum::<Matrix3<f64>>()
        };
        let plate = |(p, number): (usize, &Vec<Option<usize>>)| {
            number.iter().enumerate().map(|(m, at)| at.map(|at| of(p, m, self.dense + 3 * at))).collect()
        };
        self.seen.number.iter().enumerate().map(plate).collect()
    }
}

/// One image or measured body, whose pose is coupled with what stays.
struct Coupled {
    /// Unknowns that stay and that it touches, ascending.
    rows: Vec<usize>,
    /// 6 x `rows`.
    coupling: DMatrix<f64>,
}

impl Coupled {
    /// Of a measured body.
    fn of_body(body: &LinearPose, rows_of: &PoseRows) -> Self {
        let rows = touched(rows_of.layout(), std::iter::once(body.chain));
        let coupling = rows_of.of(body.place).select_columns(&rows);
        Self { rows, coupling }
    }

    /// With the coupling of its pose with the `dense` columns, and of the markers that were seen where they stay.
    fn new(
        image: LinearImage,
        of_pose: DMatrixView<f64>,
        (dense, seen, equations): (usize, &SeenMarkers, Option<&Equations>),
    ) -> Self {
        // Columns that stay at their value take no part, nor in the back-substitution.
        let mut rows = image.free_columns();
        let mut coupling = of_pose.select_columns(&rows);
        if let Some(equations) = equations {
            let number = &seen.number[image.image.plate];
            let (markers, with_markers) = pose_with_markers(equations);
            let first = rows.len();
            let numbered = markers.iter().enumerate().filter_map(|(k, &m)| Some((number[m]?, k)));
            let numbered: BTreeMap<usize, usize> = numbered.collect();
            rows.extend(numbered.keys().flat_map(|at| dense + 3 * at..dense + 3 * at + 3));
            coupling = coupling.resize_horizontally(rows.len(), 0.0);
            for (into, k) in (first..).step_by(3).zip(numbered.values()) {
                coupling.fixed_columns_mut::<3>(into).copy_from(&with_markers.fixed_columns::<3>(3 * k));
            }
        }
        Self { rows, coupling }
    }
}

impl Block {
    /// `Q'` times what has a row for everything latent.
    fn in_basis<'a>(&self, latents: &'a DMatrix<f64>) -> Cow<'a, DMatrix<f64>> {
        self.basis.as_ref().map_or(Cow::Borrowed(latents), |basis| Cow::Owned(basis.tr_mul(latents)))
    }

    /// `Q` times what has a row for every column of `Q`.
    fn out_of_basis(&self, own: DMatrix<f64>) -> DMatrix<f64> {
        match &self.basis {
            Some(basis) => basis * own,
            None => own,
        }
    }

    /// Of a pose at its stop, through `G - L D'` and `L F^-T`.
    fn through(&self, pose: &LinearPose) -> Through {
        let Self { inverse_factor, rows, y, .. } = self;
        let theta = pose.chain.d_theta.ncols();
        let by_latents = inverse_factor * pose.by_latents(inverse_factor.ncols()).transpose();
        let mut by_rows = -(&**y * self.in_basis(&by_latents).as_ref());
        for (mut row, &c) in by_rows.row_iter_mut().zip(&**rows).filter(|(_, c)| **c < theta) {
            row += pose.chain.d_theta.column(c).transpose();
        }
        Through { by_rows, combined: None, by_latents }
    }

    /// Of a stop with the equations of its images, where markers are among those `seen`; `dense` is the first unknown of the markers.
    fn of<'a>(
        stop: &LinearStop<'a>,
        rows: &PoseRows,
        (dense, seen): (usize, &SeenMarkers),
        lambda: f64,
    ) -> (Self, Vec<Cow<'a, Equations>>) {
        let mut own = Vec::with_capacity(stop.places().len());
        let mut all = Vec::new();
        for (k, image) in stop.places().zip(stop.images()) {
            let equations = if seen.order.is_empty() { None } else { image.equations() };
            own.push(Coupled::new(image, rows.of(k), (dense, seen, equations.as_deref())));
            all.extend(equations);
        }
        own.extend(stop.body_poses().map(|body| Coupled::of_body(&body, rows)));
        (Self::new(stop, &own, lambda), all)
    }

    fn new(stop: &LinearStop, poses: &[Coupled], lambda: f64) -> Self {
        let n = stop.unknowns();
        let mut h = stop.information();
        (0..n).for_each(|s| h[(s, s)] *= 1.0 + lambda);
        let inverse_factor = inverse_factor(h).unwrap_or_else(|| DMatrix::zeros(n, n));
        let rows = union(poses.iter().map(|own| &own.rows));
        let (mut coupling, mut l) = (DMatrix::zeros(rows.len(), 6 * poses.len()), DMatrix::zeros(6 * poses.len(), n));
        for (k, (Coupled { rows: touched, coupling: own }, pose)) in poses.iter().zip(stop.poses()).enumerate() {
            l.rows_mut(6 * k, 6).copy_from(&pose.by_latents(n));
            let mut at = 0;
            for (row, own) in touched.iter().zip(own.column_iter()) {
                at += rows[at..].partition_point(|r| r < row);
                coupling.fixed_view_mut::<1, 6>(at, 6 * k).copy_from(&own.fixed_rows::<6>(0).transpose());
            }
        }
        let normalised = &inverse_factor * l.transpose();
        let (y, basis) = match normalised.ncols() < n {
            true => {
                let qr = normalised.qr();
                (product(&coupling, &qr.r().transpose()), Some(qr.q()))
            }
            false => (product(&coupling, &normalised.transpose()), None),
        };
        let (rows, y) = (Arc::new(rows), Arc::new(y));
        Self { at: stop.at, inverse_factor, rows, y, basis, rhs: DVector::zeros(n) }
    }
}
