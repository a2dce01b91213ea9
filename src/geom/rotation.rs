//! The rotation group: exponential, logarithm, roll-pitch-yaw.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// Cross-product matrix: `skew(a) * b = a x b`.
pub fn skew(v: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// Rotation by `|phi|` rad about `phi` (Rodrigues).
pub fn exp_so3(phi: &Vector3<f64>) -> Matrix3<f64> {
    let angle = phi.norm();
    let k = skew(phi);
    let (a, b) = if angle < 1e-4 {
        let s = angle * angle;
        (1.0 - s / 6.0, 0.5 - s / 24.0)
    } else {
        (angle.sin() / angle, (1.0 - angle.cos()) / (angle * angle))
    };
    Matrix3::identity() + k * a + k * k * b
}

/// Rotation vector (rad, norm at most pi) of a rotation matrix; exact near 0 and near pi.
pub fn log_so3(r: &Matrix3<f64>) -> Vector3<f64> {
    let (w, v) = quaternion_parts(r);
    let n = v.norm();
    if n < 1e-12 {
        return v * 2.0;
    }
    v * (2.0 * n.atan2(w) / n)
}

/// Scalar (non-negative) and vector part of the unit quaternion, by the largest diagonal (Shepperd).
pub(super) fn quaternion_parts(r: &Matrix3<f64>) -> (f64, Vector3<f64>) {
    let trace = r.trace();
    let (w, v) = if trace > r[(0, 0)] && trace > r[(1, 1)] && trace > r[(2, 2)] {
        let w = 0.5 * (1.0 + trace).max(0.0).sqrt();
        let s = 0.25 / w;
        (w, Vector3::new(r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]) * s)
    } else {
        let i = (0..3).fold(0, |m, k| if r[(k, k)] > r[(m, m)] { k } else { m });
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let x = 0.5 * (1.0 + r[(i, i)] - r[(j, j)] - r[(k, k)]).max(0.0).sqrt();
        let s = 0.25 / x;
        let mut v = Vector3::zeros();
        v[i] = x;
        v[j] = (r[(j, i)] + r[(i, j)]) * s;
        v[k] = (r[(k, i)] + r[(i, k)]) * s;
        ((r[(k, j)] - r[(j, k)]) * s, v)
    };
    if w < 0.0 { (-w, -v) } else { (w, v) }
}

/// Right Jacobian of SO(3): `Exp(phi + d) = Exp(phi) Exp(J_r(phi) d)` to first order.
pub fn right_jacobian_so3(phi: &Vector3<f64>) -> Matrix3<f64> {
    let angle = phi.norm();
    let k = skew(phi);
    let (a, b) = if angle < 1e-3 {
        let s = angle * angle;
        (0.5 - s / 24.0, 1.0 / 6.0 - s / 120.0)
    } else {
        let s = angle * angle;
        ((1.0 - angle.cos()) / s, (angle - angle.sin()) / (s * angle))
    };
    Matrix3::identity() - k * a + k * k * b
}

/// URDF fixed-axes roll, pitch, yaw (rad): `R = Rz(yaw) Ry(pitch) Rx(roll)`.
pub fn matrix_from_rpy(rpy: [f64; 3]) -> Matrix3<f64> {
    let [(sr, cr), (sp, cp), (sy, cy)] = rpy.map(f64::sin_cos);
    Matrix3::new(
        cy * cp,
        cy * sp * sr - sy * cr,
        cy * sp * cr + sy * sr,
        sy * cp,
        sy * sp * sr + cy * cr,
        sy * sp * cr - cy * sr,
        -sp,
        cp * sr,
        cp * cr,
    )
}

/// Roll, pitch, yaw (rad) of a rotation, exact to rounding also near gimbal lock; at gimbal lock yaw is (nearly) zero.
///
/// Near gimbal lock roll alone is ill determined, so yaw is taken from what the rounded roll and pitch leave over.
pub fn rpy_from_matrix(r: &Matrix3<f64>) -> [f64; 3] {
    let horizontal = r[(0, 0)].hypot(r[(1, 0)]);
    let pitch = (-r[(2, 0)]).atan2(horizontal);
    let roll = if horizontal > 1e-14 { r[(2, 1)].atan2(r[(2, 2)]) } else { (-r[(1, 2)]).atan2(r[(1, 1)]) };
    let left = r * matrix_from_rpy([roll, pitch, 0.0]).transpose();
    [roll, pitch, (left[(1, 0)] - left[(0, 1)]).atan2(left[(0, 0)] + left[(1, 1)])]
}

/// Second singular value over the first below which it is noise: it is the root of an eigenvalue of a product.
const SINGULAR: f64 = 1e-7;

/// The rotation nearest to `m` (polar decomposition by a symmetric eigenproblem); `None` where all of `m` is along one direction.
pub fn project_to_so3(m: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    if !m.iter().all(|x| x.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::new(m.transpose() * m);
    let mut v = eigen.eigenvectors;
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let s = order.map(|i| eigen.eigenvalues[i].max(0.0).sqrt());
    if s[1] <= SINGULAR * s[0] || s[0] == 0.0 {
        return None;
    }
    v = Matrix3::from_columns(&order.map(|i| v.column(i).into_owned()));
    let u0: Vector3<f64> = m * v.column(0) / s[0];
    let u1: Vector3<f64> = m * v.column(1) / s[1];
    let u0 = u0.normalize();
    let u1 = (u1 - u0 * u0.dot(&u1)).normalize();
    let u2 = u0.cross(&u1);
    let v2 = v.column(0).cross(&v.column(1));
    Some(u0 * v.column(0).transpose() + u1 * v.column(1).transpose() + u2 * v2.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_along_one_direction_has_no_nearest_rotation() {
        for k in 0..200 {
            let turned = |seed: f64| exp_so3(&Vector3::new(seed.sin(), (2.0 * seed).cos(), (3.0 * seed).sin()));
            let (a, b) = (turned(f64::from(k)), turned(0.7 * f64::from(k) + 1.0));
            let with = |across: f64| a * Matrix3::from_diagonal(&Vector3::new(2.0, across, 0.0)) * b.transpose();
            assert_eq!(project_to_so3(&with(0.0)), None, "{k}");
            let off = project_to_so3(&with(1e-4)).map(|r| (r - a * b.transpose()).norm());
            assert!(off.is_some_and(|off| off < 1e-6), "{k}: {off:?}");
        }
    }
}
