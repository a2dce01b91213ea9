//! Rigid motions.

use std::ops::Mul;

use nalgebra::{Matrix3, Matrix4, Matrix6, Vector3, Vector6};
use serde::{Deserialize, Serialize};

use super::rotation::{exp_so3, log_so3, matrix_from_rpy, quaternion_parts, right_jacobian_so3, rpy_from_matrix, skew};

/// A rigid motion `a_from_b`: `x_a = rotation * x_b + translation` (metres).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Rotation matrix.
    pub rotation: Matrix3<f64>,
    /// Translation in metres.
    pub translation: Vector3<f64>,
}

impl Pose {
    /// No motion.
    pub fn identity() -> Self {
        Self::new(Matrix3::identity(), Vector3::zeros())
    }

    /// From a rotation matrix and a translation in metres.
    pub fn new(rotation: Matrix3<f64>, translation: Vector3<f64>) -> Self {
        Self { rotation, translation }
    }

    /// From URDF `xyz` (m) and fixed-axes `rpy` (rad).
    pub fn from_xyz_rpy(xyz: [f64; 3], rpy: [f64; 3]) -> Self {
        Self::new(matrix_from_rpy(rpy), xyz.into())
    }

    /// Roll, pitch, yaw in rad (URDF convention).
    pub fn rpy(&self) -> [f64; 3] {
        rpy_from_matrix(&self.rotation)
    }

    /// Translation as an array, m.
    pub fn xyz(&self) -> [f64; 3] {
        self.translation.into()
    }

    /// From a quaternion (qx, qy, qz, qw), normalised here, and a translation in metres.
    pub fn from_xyz_quaternion(xyz: [f64; 3], xyzw: [f64; 4]) -> Self {
        let q = nalgebra::Quaternion::new(xyzw[3], xyzw[0], xyzw[1], xyzw[2]);
        let q = nalgebra::UnitQuaternion::from_quaternion(q);
        Self::new(*q.to_rotation_matrix().matrix(), xyz.into())
    }

    /// Unit quaternion (qx, qy, qz, qw) with qw >= 0.
    pub fn quaternion_xyzw(&self) -> [f64; 4] {
        let (w, v) = quaternion_parts(&self.rotation);
        let n = (w * w + v.norm_squared()).sqrt();
        [v.x / n, v.y / n, v.z / n, w / n]
    }

    /// The inverse motion, `b_from_a`.
    pub fn inverse(&self) -> Self {
        let r = self.rotation.transpose();
        Self::new(r, -(r * self.translation))
    }

    /// Maps a point in b (m) to a.
    pub fn transform(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * point + self.translation
    }

    /// Exponential of a body twist `[rho (m), phi (rad)]`.
    pub fn exp(twist: &Vector6<f64>) -> Self {
        let rho = twist.fixed_rows::<3>(0).into_owned();
        let phi = twist.fixed_rows::<3>(3).into_owned();
        // The left Jacobian is the right one of the negated vector.
        Self::new(exp_so3(&phi), right_jacobian_so3(&-phi) * rho)
    }

    /// Body twist `[rho (m), phi (rad)]` with `Pose::exp(&p.log()) == p`.
    pub fn log(&self) -> Vector6<f64> {
        let phi = log_so3(&self.rotation);
        let left = right_jacobian_so3(&-phi);
        let rho = left.try_inverse().unwrap_or_else(Matrix3::identity) * self.translation;
        Vector6::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z)
    }

    /// The pose perturbed on the right: `self * Exp(twist)`.
    pub fn perturbed(&self, twist: &Vector6<f64>) -> Self {
        self * &Self::exp(twist)
    }

    /// 4x4 homogeneous matrix.
    pub fn matrix(&self) -> Matrix4<f64> {
        let mut m = Matrix4::identity();
        m.fixed_view_mut::<3, 3>(0, 0).copy_from(&self.rotation);
        m.fixed_view_mut::<3, 1>(0, 3).copy_from(&self.translation);
        m
    }

    /// Angle (rad) and distance (m) between two poses.
    pub fn distance(&self, other: &Self) -> (f64, f64) {
        let d = &self.inverse() * other;
        (log_so3(&d.rotation).norm(), d.translation.norm())
    }

    /// Both in one figure, the angle at an arm of 1 m: rad plus m.
    pub fn misfit(&self, other: &Self) -> f64 {
        let (angle, distance) = self.distance(other);
        angle + distance
    }
}

/// Adjoint for twists with translation first: `T Exp(x) T^-1 = Exp(Ad_T x)`.
pub fn adjoint(pose: &Pose) -> Matrix6<f64> {
    let mut ad = Matrix6::zeros();
    ad.fixed_view_mut::<3, 3>(0, 0).copy_from(&pose.rotation);
    ad.fixed_view_mut::<3, 3>(3, 3).copy_from(&pose.rotation);
    ad.fixed_view_mut::<3, 3>(0, 3).copy_from(&(skew(&pose.translation) * pose.rotation));
    ad
}

impl Mul<&Pose> for &Pose {
    type Output = Pose;
    fn mul(self, other: &Pose) -> Pose {
        *self * *other
    }
}

impl Mul for Pose {
    type Output = Pose;
    fn mul(self, other: Pose) -> Pose {
        Pose::new(self.rotation * other.rotation, self.transform(&other.translation))
    }
}

/// Right Jacobian of SE(3): `Exp(x + d) = Exp(x) Exp(J_r(x) d)` to first order, by its power series (exact to rounding for rotations up to pi).
pub fn right_jacobian_se3(twist: &Vector6<f64>) -> Matrix6<f64> {
    if *twist == Vector6::zeros() {
        return Matrix6::identity();
    }
    let rho = skew(&twist.fixed_rows::<3>(0).into_owned());
    let phi = skew(&twist.fixed_rows::<3>(3).into_owned());
    // Every term is [[own, cross], [0, own]].
    let (mut own, mut cross) = (Matrix3::<f64>::identity(), Matrix3::<f64>::zeros());
    let (mut own_sum, mut cross_sum) = (own, cross);
    for n in 1..60 {
        let factor = -1.0 / f64::from(n + 1);
        cross = (own * rho + cross * phi) * factor;
        own = own * phi * factor;
        own_sum += own;
        cross_sum += cross;
        if own.amax().max(cross.amax()) < 1e-18 {
            break;
        }
    }
    let mut sum = Matrix6::zeros();
    sum.fixed_view_mut::<3, 3>(0, 0).copy_from(&own_sum);
    sum.fixed_view_mut::<3, 3>(3, 3).copy_from(&own_sum);
    sum.fixed_view_mut::<3, 3>(0, 3).copy_from(&cross_sum);
    sum
}
