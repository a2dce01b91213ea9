//! The markers that images show, their information and their right-hand sides.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::alike::neighbours;
use crate::problem::{Adjustment, Problem};
use crate::solve::linear::{LinearImage, LinearProblem};

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

    /// Those beside each other follow each other.
    pub fn of(linear: LinearProblem) -> Self {
        let problem = &linear.adjustment.problem;
        let mut is_seen: Vec<Vec<bool>> = problem.plates.iter().map(|p| vec![false; p.markers.len()]).collect();
        for LinearImage { image, terms, .. } in linear.images() {
            terms.markers.iter().for_each(|m| is_seen[image.plate][m.marker] = true);
        }
        let all = is_seen.iter().enumerate().flat_map(|(p, of)| (0..of.len()).map(move |m| (p, m)));
        let all: Vec<(usize, usize)> = all.filter(|(p, m)| is_seen[*p][*m]).collect();
        let groups = neighbours(all.iter().map(|&(p, m)| (p, &problem.plates[p].markers[m].position_m)));
        let mut seen = Self::none(problem);
        seen.order = groups.into_iter().flatten().map(|k| all[k]).collect();
        seen.order.iter().enumerate().for_each(|(at, &(p, m))| seen.number[p][m] = Some(at));
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
                number[own.marker].iter().for_each(|&at| information[at] += own.information());
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
