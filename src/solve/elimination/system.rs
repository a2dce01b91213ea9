//! Reduced normal equations: dense columns, and either what is latent at stops or the markers; the other family is eliminated.

use std::fmt;

use nalgebra::{DMatrix, DVector, Matrix3};

use super::by_markers::MarkersEliminated;
use super::by_stops::StopsEliminated;
use super::distances::Distances;
use super::right_hand_sides::RightHandSides;
use super::seen_markers::SeenMarkers;
use super::stop_covariance::StopCovariance;
use crate::linalg::{NotPositiveDefinite, SymmetricFactor};
use crate::model::plate_modes::MODES;
use crate::problem::{Adjustment, Length, Problem, Step};
use crate::solve::linear::{Carried, LinearProblem, LinearStop};

/// Which family of unknowns is eliminated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Elimination {
    /// Markers, by their 3x3 blocks: what is latent at stops stays. Cheaper for up to some 250 stops.
    Markers,
    /// What is latent, stop by stop: the markers stay. Cheaper for many stops.
    Stops,
    /// The same, and no marker moves: costs next to nothing beside the others.
    StopsMarkersHeld,
}

impl Elimination {
    /// The cheaper one: the one that leaves fewer unknowns.
    pub fn cheaper(linear: LinearProblem) -> Self {
        let latent: usize = linear.stops().map(|stop| stop.unknowns()).sum();
        let markers: usize = linear.adjustment.problem.plates.iter().map(|p| 3 * p.markers.len()).sum();
        if latent > markers { Self::Stops } else { Self::Markers }
    }

    /// That of steps: where every marker is held, none moves.
    pub fn of_steps(linear: LinearProblem) -> Self {
        let plates = &linear.adjustment.problem.plates;
        let are_held = plates.iter().flat_map(|p| &p.markers).all(|m| m.sigma_m == 0.0);
        if are_held { Self::StopsMarkersHeld } else { Self::cheaper(linear) }
    }
}

/// What is needed to get the eliminated family back.
#[derive(Debug, Clone)]
pub enum Eliminated {
    Markers(Box<MarkersEliminated>),
    Stops(StopsEliminated),
}

/// Reduced normal equations; unknowns in the order dense columns, then the family that stays.
#[derive(Debug, Clone)]
pub struct System {
    /// Information matrix, symmetric.
    pub information: DMatrix<f64>,
    /// Right-hand side.
    pub rhs: DVector<f64>,
    /// First unknown of what is latent at each stop in use; empty where that was eliminated.
    pub latent_start: Vec<usize>,
    touched: Vec<bool>,
    pub(in crate::solve) eliminated: Eliminated,
    distances: Distances,
}

/// The normal equations have no unique solution.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Singular {
    /// The first unknown that cannot be told from those before it.
    pub unknown: String,
}

impl fmt::Display for Singular {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the normal equations are singular at {}", self.unknown)
    }
}

impl System {
    /// Builds the system at a linearisation by the cheaper elimination, with Levenberg-Marquardt damping `lambda` on the
    /// scaled diagonal.
    pub fn new(linear: LinearProblem, lambda: f64) -> Self {
        Self::with(Elimination::cheaper(linear), linear, lambda)
    }

    /// As [`System::new`] by a given elimination.
    pub fn with(which: Elimination, linear: LinearProblem, lambda: f64) -> Self {
        let mut system = Self::without_distances(which, linear, lambda);
        system.add_distances(linear, None);
        system.take_gradient(linear);
        system
    }

    /// The information of images and priors alone, without right-hand sides.
    pub(in crate::solve) fn without_distances(which: Elimination, linear: LinearProblem, lambda: f64) -> Self {
        let problem = &linear.adjustment.problem;
        let (information, eliminated) = match which {
            Elimination::Markers => {
                let (a, rest) = MarkersEliminated::build(linear, lambda);
                (a, Eliminated::Markers(Box::new(rest)))
            }
            Elimination::Stops | Elimination::StopsMarkersHeld => {
                let held = which == Elimination::StopsMarkersHeld;
                let seen = if held { SeenMarkers::none(problem) } else { SeenMarkers::of(linear) };
                let (a, rest) = StopsEliminated::build(linear, lambda, seen);
                (a, Eliminated::Stops(rest))
            }
        };
        Self::completed(linear, lambda, information, eliminated)
    }

    /// Of an information without the priors of the dense columns, what is latent eliminated stop by stop.
    pub(super) fn by_stops(linear: LinearProblem, information: DMatrix<f64>, rest: StopsEliminated) -> Self {
        let mut system = Self::completed(linear, 0.0, information, Eliminated::Stops(rest));
        system.add_distances(linear, None);
        system.take_gradient(linear);
        system
    }

    /// With the priors of the dense columns, those damped by `lambda` and those fixed held.
    fn completed(linear: LinearProblem, lambda: f64, information: DMatrix<f64>, eliminated: Eliminated) -> Self {
        let problem = &linear.adjustment.problem;
        let latent_start = if let Eliminated::Markers(e) = &eliminated { e.latent_start.clone() } else { Vec::new() };
        let rhs = DVector::zeros(information.nrows());
        let distances = Distances::none();
        let mut system = Self { information, rhs, latent_start, touched: Vec::new(), eliminated, distances };
        system.add_priors(problem);
        for (a, b) in linear.lin.lengths.iter().flat_map(Length::pairs) {
            system.information[(a.0, b.0)] += a.1 * b.1;
        }
        for i in 0..system.rhs.len() {
            system.information[(i, i)] *= 1.0 + lambda;
        }
        system.hold_fixed(problem);
        system
    }

    /// Adds the information of the measured distances; with the orthonormal combinations of markers that are held where markers stay.
    pub(in crate::solve) fn add_distances(&mut self, linear: LinearProblem, held: Option<&DMatrix<f64>>) {
        if linear.lin.distances.is_empty() {
            return;
        }
        let layout = &linear.adjustment.problem.layout;
        let mut by_reduced = DMatrix::zeros(self.rhs.len(), linear.lin.distances.len());
        for (mut row, distance) in by_reduced.column_iter_mut().zip(&linear.lin.distances) {
            let start = layout.shapes[distance.plate].start;
            let free = |m: usize| layout.columns[start + m].free && self.touched[start + m];
            (0..MODES).filter(|m| free(*m)).for_each(|m| row[start + m] = distance.by_modes[m]);
        }
        let by_markers = match &self.eliminated {
            Eliminated::Markers(e) => e.reduce_rows(linear, &mut by_reduced),
            Eliminated::Stops(e) => e.complete_rows(linear, held, &mut by_reduced),
        };
        self.distances = Distances::new(by_reduced, by_markers);
        self.information += self.distances.information().unwrap_or_else(|| DMatrix::zeros(0, 0));
    }

    /// Variance of a measured distance as all other data predict it, in units of its own, from the covariance of the reduced unknowns;
    /// `None` where they do not.
    pub fn predicted_variance(&self, reduced: &DMatrix<f64>, distance: usize) -> Option<f64> {
        self.distances.predicted_variance(reduced, distance)
    }

    /// What eliminating the markers leaves of the determinant of the measured distances, as a natural logarithm.
    pub fn log_determinant_of_distances(&self) -> f64 {
        self.distances.log_determinant
    }

    /// Natural logarithm of the determinant of the information of the family that was eliminated.
    pub fn log_determinant_of_eliminated(&self, linear: LinearProblem) -> f64 {
        match &self.eliminated {
            Eliminated::Markers(_) => {
                SeenMarkers::of(linear).information(linear).iter().map(|block| block.determinant().ln()).sum()
            }
            Eliminated::Stops(e) => e.log_determinant(),
        }
    }

    /// Factor of the information.
    ///
    /// # Errors
    /// Information that is not positive definite.
    pub fn factor(&self, linear: LinearProblem) -> Result<SymmetricFactor, Singular> {
        let named = |NotPositiveDefinite { row }| Singular { unknown: self.unknown(linear, row) };
        SymmetricFactor::new(&self.information).map_err(named)
    }

    /// Name of an unknown.
    fn unknown(&self, linear: LinearProblem, row: usize) -> String {
        let problem = &linear.adjustment.problem;
        if let Some(column) = problem.layout.columns.get(row) {
            return column.name.clone();
        }
        match &self.eliminated {
            Eliminated::Markers(e) => {
                let at = e.latent_start.partition_point(|start| *start <= row).saturating_sub(1);
                let first = linear.stop(at).places().start;
                format!("the deviation of {}", linear.image(first).image.name)
            }
            Eliminated::Stops(e) => {
                let (plate, marker) = e.marker(row);
                format!("marker {} of plate {plate}", problem.plates[plate].markers[marker].id)
            }
        }
    }

    /// Takes over the right-hand sides at another linearisation; the information stays.
    pub fn take_gradient(&mut self, linear: LinearProblem) {
        let Adjustment { problem, state } = linear.adjustment;
        self.rhs = match &mut self.eliminated {
            Eliminated::Markers(e) => e.reduce_gradient(linear),
            Eliminated::Stops(e) => e.reduce_gradient(linear),
        };
        let markers = if let Eliminated::Markers(e) = &self.eliminated { Some(e.whitened_gradient()) } else { None };
        self.distances.take_residuals(linear, markers, &mut self.rhs);
        let values = state.values(&problem.layout);
        for length in &linear.lin.lengths {
            length.by_columns.iter().for_each(|(c, d)| self.rhs[*c] += d * length.residual);
        }
        for (i, c) in problem.layout.columns.iter().enumerate() {
            self.rhs[i] += (c.prior_mean - values[i]) * c.prior_sigma.powi(-2);
        }
        for prior in problem.joint_priors() {
            let pull = prior.pull(&values);
            prior.columns.iter().zip(pull.iter()).for_each(|(&row, pull)| self.rhs[row] -= pull);
        }
        for (i, c) in problem.layout.columns.iter().enumerate() {
            if !c.free || !self.touched[i] {
                self.rhs[i] = 0.0;
            }
        }
    }

    fn add_priors(&mut self, problem: &Problem) {
        for (i, c) in problem.layout.columns.iter().enumerate() {
            self.information[(i, i)] += c.prior_sigma.powi(-2);
        }
        for prior in problem.joint_priors() {
            for (i, &row) in prior.columns.iter().enumerate() {
                for (k, &column) in prior.columns.iter().enumerate() {
                    self.information[(row, column)] += prior.information[(i, k)];
                }
            }
        }
    }

    /// Fixed columns, and columns that nothing in this series touches, get a step of zero.
    fn hold_fixed(&mut self, problem: &Problem) {
        self.touched = (0..problem.layout.len()).map(|i| self.information[(i, i)] > 0.0).collect();
        for (i, c) in problem.layout.columns.iter().enumerate() {
            if !c.free || !self.touched[i] {
                self.information.row_mut(i).fill(0.0);
                self.information.column_mut(i).fill(0.0);
                self.information[(i, i)] = 1.0;
            }
        }
    }

    /// False for a dense column that no image in use and no prior touches.
    pub fn touched(&self, column: usize) -> bool {
        self.touched[column]
    }

    /// Says of the first columns whether anything touches them.
    pub(in crate::solve) fn set_touched(&mut self, touched: impl Iterator<Item = bool>) {
        self.touched.iter_mut().zip(touched).for_each(|(slot, touched)| *slot = touched);
    }

    /// The whole step from the solution `x` of the reduced system.
    pub fn step(&self, linear: LinearProblem, x: &DVector<f64>) -> Step {
        match &self.eliminated {
            Eliminated::Markers(e) => e.step(linear, x, self.distances.of_markers(x)),
            Eliminated::Stops(e) => e.step(linear, x),
        }
    }

    /// Steps for right-hand sides of their own, from the factor of the information: those of the linearisation take no part.
    pub(in crate::solve) fn steps(
        &self,
        linear: LinearProblem,
        factor: &SymmetricFactor,
        of: &RightHandSides,
    ) -> Vec<Step> {
        let columns = &linear.adjustment.problem.layout.columns;
        let solve = |mut reduced: DMatrix<f64>| {
            let held = columns.iter().enumerate().filter(|(i, c)| !c.free || !self.touched[*i]);
            held.for_each(|(i, _)| reduced.row_mut(i).fill(0.0));
            factor.solve_many(&reduced)
        };
        match &self.eliminated {
            Eliminated::Markers(e) => e.steps(linear, of, &self.distances, solve),
            Eliminated::Stops(e) => e.steps(linear, of, solve),
        }
    }

    /// Newton decrement of the step that belongs to `x`: the square root of `step' rhs` of all unknowns, those eliminated included.
    pub fn decrement(&self, x: &DVector<f64>) -> f64 {
        let eliminated = match &self.eliminated {
            Eliminated::Markers(e) => e.squares(),
            Eliminated::Stops(e) => e.squares(),
        };
        (x.dot(&self.rhs) + eliminated + self.distances.squares()).max(0.0).sqrt()
    }

    /// Covariances of what is latent and of measured bodies at each of some stops, from the covariance of the reduced unknowns.
    pub(in crate::solve) fn stop_covariances(
        &self,
        reduced: &DMatrix<f64>,
        stops: &[LinearStop],
    ) -> Vec<StopCovariance> {
        let e = match &self.eliminated {
            Eliminated::Markers(e) => e,
            Eliminated::Stops(e) => return e.stop_covariances(reduced, stops),
        };
        let of = |stop: &LinearStop| {
            let (start, n) = (e.latent_start[stop.at], stop.unknowns());
            let latents = reduced.view((start, start), (n, n)).into_owned();
            let bodies = stop.body_poses().map(|pose| e.pose_covariance(reduced, stop, &pose)).collect();
            StopCovariance { latents, bodies }
        };
        stops.iter().map(of).collect()
    }

    /// Covariances of the camera poses of some stops, as their body twists, m and rad.
    pub(in crate::solve) fn camera_poses(&self, reduced: &DMatrix<f64>, stops: &[LinearStop]) -> Vec<DMatrix<f64>> {
        let e = match &self.eliminated {
            Eliminated::Markers(e) => e,
            Eliminated::Stops(e) => return e.camera_poses(reduced, stops),
        };
        let of_stop =
            |stop: &LinearStop| stop.camera_poses().map(|pose| e.pose_covariance(reduced, stop, &pose)).collect();
        stops.iter().flat_map(|stop| -> Vec<DMatrix<f64>> { of_stop(stop) }).collect()
    }

    /// Covariance of the correction of every marker that was seen, per plate and marker.
    pub fn marker_covariances(&self, reduced: &DMatrix<f64>) -> Vec<Vec<Option<Matrix3<f64>>>> {
        self.marker_covariances_with(reduced, None)
    }

    pub(in crate::solve) fn marker_covariances_with(
        &self,
        reduced: &DMatrix<f64>,
        carried: Option<&Carried>,
    ) -> Vec<Vec<Option<Matrix3<f64>>>> {
        match &self.eliminated {
            Eliminated::Markers(e) => e.marker_covariances(reduced, &self.distances, carried),
            Eliminated::Stops(e) => e.marker_covariances(reduced, carried),
        }
    }
}
