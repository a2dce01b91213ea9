//! The rigid motion between two sets of points.

use nalgebra::Vector3;

use super::pose::Pose;
use super::rotation::project_to_so3;

/// A point in both frames, m.
type Pair = (Vector3<f64>, Vector3<f64>);

/// `b_from_a` that brings the first point of every pair nearest to the second, least squares (Kabsch); `None` where there are no
/// points, or they are not finite.
pub fn rigid_fit(pairs: &[Pair]) -> Option<Pose> {
    let n = pairs.len() as f64;
    let mean_a = pairs.iter().map(|p| p.0).sum::<Vector3<f64>>() / n;
    let mean_b = pairs.iter().map(|p| p.1).sum::<Vector3<f64>>() / n;
    let m = pairs.iter().map(|(a, b)| (b - mean_b) * (a - mean_a).transpose()).sum();
    let rotation = project_to_so3(&m)?;
    Some(Pose::new(rotation, mean_b - rotation * mean_a))
}
