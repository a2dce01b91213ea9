//! How camera, robot and plate hang together, and how a camera pose moves with each of them.
//!
//! hand:  `camera_from_plate = flange_from_camera^-1 * base_from_flange^-1 * base_from_plate`
//! fixed: `camera_from_plate = base_from_camera^-1   * base_from_flange    * flange_from_plate`

use crate::geom::{Pose, adjoint};
use crate::series::CameraMount;
use nalgebra::Matrix6;

/// A predicted camera pose with its derivatives as body twists of `camera_from_plate`.
#[derive(Debug, Clone)]
pub struct MountedPose {
    /// Predicted pose.
    pub camera_from_plate: Pose,
    /// With respect to the body twist of `flange_from_camera` (hand) or `base_from_camera` (fixed).
    pub d_camera: Matrix6<f64>,
    /// With respect to the body twist of `base_from_tip`.
    pub d_robot: Matrix6<f64>,
}

impl CameraMount {
    /// The camera pose; that with respect to the body twist of the plate's pose is the identity.
    ///
    /// `camera` is `flange_from_camera` or `base_from_camera`; `plate` is `base_from_plate` or `flange_from_plate`.
    pub fn camera_from_plate(self, camera: &Pose, base_from_tip: &Pose, plate: &Pose) -> Pose {
        match self {
            Self::Hand => camera.inverse() * (&base_from_tip.inverse() * plate),
            Self::Fixed => camera.inverse() * (base_from_tip * plate),
        }
    }

    /// As [`CameraMount::camera_from_plate`], with derivatives.
    pub fn linearised(self, camera: &Pose, base_from_tip: &Pose, plate: &Pose) -> MountedPose {
        let camera_from_plate = self.camera_from_plate(camera, base_from_tip, plate);
        let d_camera = -adjoint(&camera_from_plate.inverse());
        let d_robot = match self {
            Self::Hand => -adjoint(&(&plate.inverse() * base_from_tip)),
            Self::Fixed => adjoint(&plate.inverse()),
        };
        MountedPose { camera_from_plate, d_camera, d_robot }
    }
}
