//! Every unknown, with its value.

use nalgebra::{Matrix6, Matrix6x3, Vector3, Vector6};

use super::image::Image;
use super::plate_shape::PlateShape;
use super::stop::{TakenFrom, Tie};
use crate::geom::{Pose, right_jacobian_se3};
use crate::model::camera::Camera;
use crate::model::robot::Robot;

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
        match from.tie.displacement() {
            [] => Some(pose),
            values => Some(Displaced::new(&pose, &seen_centre(image, self), values).pose),
        }
    }
}

/// A camera pose with an apparent displacement of the plate.
pub(super) struct Displaced {
    /// `camera_from_plate`.
    pub pose: Pose,
    /// By which the plate is turned, plate frame.
    pub turned: Pose,
    /// The twist of that, and its derivative by the turns.
    twist: Vector6<f64>,
    axes: Matrix6x3<f64>,
}

impl Displaced {
    /// The plate turned about the axes through `centre` (plate frame, m), then shifted along the axes of the camera.
    pub fn new(pose: &Pose, centre: &Vector3<f64>, values: &[f64]) -> Self {
        let component = |k: usize| values.get(k).copied().unwrap_or(0.0);
        let axes = turning_axes(centre);
        let twist = axes * Vector3::from_fn(|k, _| component(k));
        let turned = Pose::exp(&twist);
        let mut pose = *pose * turned;
        pose.translation += Vector3::from_fn(|k, _| component(3 + k));
        Self { pose, turned, twist, axes }
    }

    /// Derivatives of the pose by all components, body twists.
    pub fn d_components(&self) -> Matrix6<f64> {
        let mut all = Matrix6::zeros();
        all.fixed_columns_mut::<3>(0).copy_from(&(right_jacobian_se3(&self.twist) * self.axes));
        all.fixed_view_mut::<3, 3>(0, 3).copy_from(&self.pose.rotation.transpose());
        all
    }
}

/// Middle of the markers that an image shows, plate frame, m.
pub(super) fn seen_centre(image: &Image, state: &State) -> Vector3<f64> {
    let nominal = &state.plates[image.plate].nominal;
    let sum: Vector3<f64> = image.observations.iter().map(|o| nominal[o.marker]).sum();
    sum / image.observations.len().max(1) as f64
}

/// Body twists of `camera_from_plate` that turn the plate about its axes through `centre`.
fn turning_axes(centre: &Vector3<f64>) -> Matrix6x3<f64> {
    let mut axes = Matrix6x3::zeros();
    for (k, axis) in [Vector3::x(), Vector3::y(), Vector3::z()].into_iter().enumerate() {
        axes.fixed_view_mut::<3, 1>(0, k).copy_from(&centre.cross(&axis));
        axes.fixed_view_mut::<3, 1>(3, k).copy_from(&axis);
    }
    axes
}
