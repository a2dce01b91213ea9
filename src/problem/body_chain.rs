//! Where an instrument sees a body, as the unknowns say.

use nalgebra::{DMatrix, Matrix6};

use super::body::BodyMeasurement;
use super::linearise::Chained;
use super::{Layout, State, TakenFrom};
use crate::geom::Pose;
use crate::model::robot::LinearOrigins;
use crate::series::CameraMount;

impl State {
    /// `instrument_from_body` as the unknowns say; `None` off the robot.
    pub fn instrument_from_body(&self, measured: &BodyMeasurement, from: TakenFrom) -> Option<Pose> {
        let tip = self.robot.pose_at(from.posture?, &from.errors());
        let [instrument, body] = [&self.instruments[measured.instrument], &self.bodies[measured.body]];
        Some(CameraMount::Fixed.camera_from_plate(instrument, &tip, body))
    }

    /// The same with its derivatives.
    pub fn body_chained(
        &self,
        origins: &LinearOrigins,
        layout: &Layout,
        measured: &BodyMeasurement,
        from: TakenFrom,
    ) -> Option<Chained> {
        let kinematics = self.robot.kinematics_from(origins, from.posture?, &from.errors());
        let [instrument, body] = [&self.instruments[measured.instrument], &self.bodies[measured.body]];
        let mounted = CameraMount::Fixed.linearised(instrument, &kinematics.base_from_tip, body);
        let mut d_theta = DMatrix::zeros(6, layout.theta_len());
        kinematics.put(&mounted.d_robot, layout, &mut d_theta);
        let starts = [layout.instruments[measured.instrument].start, layout.bodies[measured.body].start];
        d_theta.fixed_view_mut::<6, 6>(0, starts[0]).copy_from(&mounted.d_camera);
        d_theta.fixed_view_mut::<6, 6>(0, starts[1]).copy_from(&Matrix6::identity());
        let d_latent = kinematics.by_readings(&mounted.d_robot, from.joints());
        Some(Chained { pose: mounted.camera_from_plate, d_theta, d_latent })
    }
}
