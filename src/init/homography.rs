//! Plane-to-image homographies and the camera pose that one gives.

use nalgebra::{DMatrix, Matrix3, Vector2, Vector3};

use crate::geom::{Pose, project_to_so3};
use crate::linalg::symmetric_eigen;

/// Map from plate coordinates (x, y in m, 1) to homogeneous pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Homography(pub Matrix3<f64>);

/// A camera pose read off a homography.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanarPose {
    /// `camera_from_plate`.
    pub camera_from_plate: Pose,
    /// True where the plate is seen from behind, as a mirrored pattern is.
    pub from_behind: bool,
}

/// Similarity that brings points to mean 0 and mean distance sqrt(2).
fn normaliser(points: &[Vector2<f64>]) -> Option<Matrix3<f64>> {
    let n = points.len() as f64;
    let mean = points.iter().sum::<Vector2<f64>>() / n;
    let spread = points.iter().map(|p| (p - mean).norm()).sum::<f64>() / n;
    if !(spread > 0.0 && spread.is_finite()) {
        return None;
    }
    let s = 2f64.sqrt() / spread;
    Some(Matrix3::new(s, 0.0, -s * mean.x, 0.0, s, -s * mean.y, 0.0, 0.0, 1.0))
}

fn apply(m: &Matrix3<f64>, p: &Vector2<f64>) -> Vector3<f64> {
    m * Vector3::new(p.x, p.y, 1.0)
}

impl Homography {
    /// Normalised direct linear transform; `None` for fewer than four points or a degenerate set (all on a line).
    pub fn fit(plane_m: &[Vector2<f64>], pixels: &[Vector2<f64>]) -> Option<Self> {
        if plane_m.len() < 4 || plane_m.len() != pixels.len() {
            return None;
        }
        let (tp, ti) = (normaliser(plane_m)?, normaliser(pixels)?);
        let mut ata = DMatrix::<f64>::zeros(9, 9);
        for (p, q) in plane_m.iter().zip(pixels) {
            let (x, u) = (apply(&tp, p), apply(&ti, q));
            let mut rows = [[0.0; 9]; 2];
            for k in 0..3 {
                rows[0][k] = -x[k];
                rows[0][6 + k] = u.x * x[k];
                rows[1][3 + k] = -x[k];
                rows[1][6 + k] = u.y * x[k];
            }
            for row in &rows {
                for i in 0..9 {
                    for j in 0..9 {
                        ata[(i, j)] += row[i] * row[j];
                    }
                }
            }
        }
        let (values, vectors) = symmetric_eigen(&ata)?;
        if values[1] < 1e-9 * values[8] {
            return None;
        }
        let h = vectors.column(0);
        let normalised = Matrix3::from_row_slice(h.as_slice());
        let full = ti.try_inverse()? * normalised * tp;
        Some(Self(full / full.norm()))
    }

    /// Pose of a camera with square pixels: focal length and principal point in px. `None` where the matrix is degenerate.
    pub fn pose(&self, focal_px: f64, centre_px: Vector2<f64>) -> Option<PlanarPose> {
        let to_rays = Matrix3::new(
            1.0 / focal_px,
            0.0,
            -centre_px.x / focal_px,
            0.0,
            1.0 / focal_px,
            -centre_px.y / focal_px,
            0.0,
            0.0,
            1.0,
        );
        let m = to_rays * self.0;
        let (mut r1, mut r2, mut t) = (m.column(0).into_owned(), m.column(1).into_owned(), m.column(2).into_owned());
        let mut scale = 2.0 / (r1.norm() + r2.norm());
        if t.z < 0.0 {
            scale = -scale;
        }
        (r1, r2, t) = (r1 * scale, r2 * scale, t * scale);
        let rotation = project_to_so3(&Matrix3::from_columns(&[r1, r2, r1.cross(&r2)]))?;
        let from_behind = rotation.column(2).dot(&t) > 0.0;
        t.iter().all(|x| x.is_finite()).then(|| PlanarPose { camera_from_plate: Pose::new(rotation, t), from_behind })
    }
}

impl PlanarPose {
    /// The other solution of the two-fold ambiguity of a nearly affine view: the plate's normal mirrored in the line of sight.
    pub fn flipped(&self) -> Self {
        let pose = self.camera_from_plate;
        let sight = pose.translation.normalize();
        let normal = pose.rotation.column(2).into_owned();
        let turn = 2.0 * normal.cross(&(-sight)).norm().atan2(normal.dot(&(-sight)));
        let axis = normal.cross(&(-sight));
        if axis.norm() < 1e-9 {
            return *self;
        }
        let rotation = crate::geom::exp_so3(&(axis.normalize() * turn)) * pose.rotation;
        Self { camera_from_plate: Pose::new(rotation, pose.translation), ..*self }
    }
}
