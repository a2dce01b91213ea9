//! The unknowns as columns: their values, and the state after a step.

use nalgebra::{DVector, Vector3, Vector6};

use super::layout::Layout;
use super::state::State;

/// A step of every unknown.
#[derive(Debug, Clone)]
pub struct Step {
    /// Dense columns.
    pub dense: DVector<f64>,
    /// Latent errors of every stop (empty for one that takes no part).
    pub joint_errors: Vec<Vec<f64>>,
    /// Tie of every image (empty for one that takes no part).
    pub ties: Vec<Vec<f64>>,
    /// Marker corrections, per plate.
    pub markers: Vec<Vec<Vector3<f64>>>,
}

impl Step {
    /// A step of dense columns and markers alone.
    pub fn of(dense: DVector<f64>, markers: Vec<Vec<Vector3<f64>>>, state: &State) -> Self {
        let (stops, images) = (state.joint_errors.len(), state.ties.len());
        Self { dense, joint_errors: vec![Vec::new(); stops], ties: vec![Vec::new(); images], markers }
    }

    /// With `factor` times another step of the same unknowns.
    #[must_use]
    pub fn plus(mut self, factor: f64, other: &Self) -> Self {
        self.dense.axpy(factor, &other.dense, 1.0);
        let latents = self.joint_errors.iter_mut().chain(&mut self.ties).flatten();
        let of_other = other.joint_errors.iter().chain(&other.ties).flatten();
        latents.zip(of_other).for_each(|(a, b)| *a += factor * b);
        let markers = self.markers.iter_mut().flatten().zip(other.markers.iter().flatten());
        markers.for_each(|(a, b)| *a += factor * b);
        self
    }

    /// No step, of the same unknowns.
    pub fn none(&self) -> Self {
        self.clone().plus(-1.0, self)
    }
}

fn twist(step: &DVector<f64>, start: usize) -> Vector6<f64> {
    step.fixed_rows::<6>(start).into_owned()
}

impl State {
    /// The state after a step.
    pub fn moved(&self, layout: &Layout, step: &Step) -> Self {
        let mut next = self.clone();
        let x = &step.dense;
        for (k, xi) in next.robot.twists.iter_mut().enumerate() {
            *xi += twist(x, layout.twists.start + 6 * k);
        }
        for (k, term) in next.robot.terms.iter_mut().enumerate() {
            term.value += x[layout.terms.start + k];
        }
        let Self { mountings, placements, instruments, bodies, .. } = &mut next;
        let poses = mountings.iter_mut().chain(placements).chain(instruments).chain(bodies);
        let ranges = [&layout.mountings, &layout.placements, &layout.instruments, &layout.bodies];
        for (pose, range) in poses.zip(ranges.into_iter().flatten()) {
            *pose = pose.perturbed(&twist(x, range.start));
        }
        for (camera, range) in next.cameras.iter_mut().zip(&layout.cameras) {
            camera.parameters.iter_mut().zip(range.clone()).for_each(|(p, c)| *p += x[c]);
        }
        for (k, plate) in next.plates.iter_mut().enumerate() {
            plate.modes.iter_mut().zip(layout.shapes[k].clone()).for_each(|(m, c)| *m += x[c]);
            plate.corrections.iter_mut().zip(&step.markers[k]).for_each(|(m, s)| *m += s);
        }
        for (errors, step) in next.joint_errors.iter_mut().zip(&step.joint_errors) {
            errors.iter_mut().zip(step).for_each(|(q, s)| *q += s);
        }
        for (tie, step) in next.ties.iter_mut().zip(&step.ties).filter(|(_, step)| !step.is_empty()) {
            *tie = tie.moved(step);
        }
        next
    }

    /// Values of the columns that have a prior (others are poses on a manifold and give zero).
    pub fn values(&self, layout: &Layout) -> DVector<f64> {
        let mut v = DVector::zeros(layout.len());
        for (k, xi) in self.robot.twists.iter().enumerate() {
            v.fixed_rows_mut::<6>(layout.twists.start + 6 * k).copy_from(xi);
        }
        for (k, term) in self.robot.terms.iter().enumerate() {
            v[layout.terms.start + k] = term.value;
        }
        for (camera, range) in self.cameras.iter().zip(&layout.cameras) {
            camera.parameters.iter().zip(range.clone()).for_each(|(p, c)| v[c] = *p);
        }
        for (plate, range) in self.plates.iter().zip(&layout.shapes) {
            plate.modes.iter().zip(range.clone()).for_each(|(m, c)| v[c] = *m);
        }
        v
    }

    /// Sets the value of one column; components of poses have none and stay.
    pub fn set_value(&mut self, layout: &Layout, column: usize, value: f64) {
        if layout.twists.contains(&column) {
            let k = column - layout.twists.start;
            self.robot.twists[k / 6][k % 6] = value;
        } else if layout.terms.contains(&column) {
            self.robot.terms[column - layout.terms.start].value = value;
        }
        for (camera, range) in self.cameras.iter_mut().zip(&layout.cameras).filter(|(_, r)| r.contains(&column)) {
            camera.parameters[column - range.start] = value;
        }
        for (plate, range) in self.plates.iter_mut().zip(&layout.shapes).filter(|(_, r)| r.contains(&column)) {
            plate.modes[column - range.start] = value;
        }
    }
}
