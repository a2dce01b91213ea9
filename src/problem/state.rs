//! Every unknown, with its value.

use nalgebra::{Matrix6x2, SMatrix, SVector, Vector2, Vector3};

use super::image::Image;
use super::stop::{TakenFrom, Tie};
use crate::geom::Pose;
use crate::model::camera::Camera;
use crate::model::plate_modes::{MODES, basis};
use crate::model::robot::Robot;
use crate::series::Plate;

/// Deviation of a plate from nominal.
#[derive(Debug, Clone, PartialEq)]
pub struct PlateShape {
    /// Amplitudes of the modes of [`crate::model::plate_modes`].
    pub modes: [f64; MODES],
    /// Correction of each marker on top of the modes, m.
    pub corrections: Vec<Vector3<f64>>,
    /// Nominal positions, m.
    pub nominal: Vec<Vector3<f64>>,
    /// Largest distance of a marker from the centre, m.
    pub half_diagonal_m: f64,
}

impl PlateShape {
    /// The nominal shape.
    pub fn nominal(plate: &Plate) -> Self {
        let nominal: Vec<_> = plate.markers.iter().map(|m| m.position_m).collect();
        Self {
            modes: [0.0; MODES],
            corrections: vec![Vector3::zeros(); nominal.len()],
            half_diagonal_m: nominal.iter().map(Vector3::norm).fold(0.0, f64::max),
            nominal,
        }
    }

    /// How a marker moves with the modes.
    #[inline(always)]
    pub fn modes_at(&self, marker: usize) -> SMatrix<f64, 3, MODES> {
        basis(&self.nominal[marker], self.half_diagonal_m)
    }

    /// Position of a marker in the plate frame, m.
    pub fn position(&self, marker: usize) -> Vector3<f64> {
        self.position_by(&self.modes_at(marker), marker)
    }

    /// The same, where what the modes do is at hand.
    #[inline(always)]
    pub fn position_by(&self, modes: &SMatrix<f64, 3, MODES>, marker: usize) -> Vector3<f64> {
        self.nominal[marker] + modes * SVector::from(self.modes) + self.corrections[marker]
    }
}

/// Every unknown of the problem.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Robot.
    pub robot: Robot,
    /// Camera poses: `flange_from_camera`, or `base_from_camera` for a fixed camera.
    pub mountings: Vec<Pose>,
    /// Plate poses: `base_from_plate`, or `flange_from_plate` for a fixed camera.
    pub placements: Vec<Pose>,
    /// Frames in which bodies are measured: `base_from_instrument`.
    pub instruments: Vec<Pose>,
    /// Bodies that the tip carries: `tip_from_body`.
    pub bodies: Vec<Pose>,
    /// Cameras.
    pub cameras: Vec<Camera>,
    /// Plates.
    pub plates: Vec<PlateShape>,
    /// Latent errors of the readings of every stop, rad or m; empty where the readings count as exact, and off the robot.
    pub joint_errors: Vec<Vec<f64>>,
    /// Tie of every image to its stop.
    pub ties: Vec<Tie>,
}

impl State {
    /// Pose of the camera of an image as these unknowns say; `None` off the robot without a free pose.
    pub fn camera_from_plate(&self, image: &Image, from: TakenFrom) -> Option<Pose> {
        if let Tie::Free(pose) = from.tie {
            return Some(*pose);
        }
        let tip = self.robot.pose_at(from.posture?, &from.errors());
        let pose =
            image.mount.camera_from_plate(&self.mountings[image.mounting], &tip, &self.placements[image.placement]);
        let Tie::Tilted([x, y]) = *from.tie else { return Some(pose) };
        Some(pose * Pose::exp(&(tilt_axes(&seen_centre(image, self)) * Vector2::new(x, y))))
    }
}

/// Middle of the markers that an image shows, plate frame, m.
pub(super) fn seen_centre(image: &Image, state: &State) -> Vector3<f64> {
    let nominal = &state.plates[image.plate].nominal;
    let sum: Vector3<f64> = image.observations.iter().map(|o| nominal[o.marker]).sum();
    sum / image.observations.len().max(1) as f64
}

/// Body twists of `camera_from_plate` that turn the plate about its x and y axes through `centre`.
pub(super) fn tilt_axes(centre: &Vector3<f64>) -> Matrix6x2<f64> {
    let mut axes = Matrix6x2::zeros();
    for (k, axis) in [Vector3::x(), Vector3::y()].into_iter().enumerate() {
        axes.fixed_view_mut::<3, 1>(0, k).copy_from(&centre.cross(&axis));
        axes.fixed_view_mut::<3, 1>(3, k).copy_from(&axis);
    }
    axes
}
