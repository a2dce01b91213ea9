//! Plane-to-image homographies and the camera pose that one gives.

use nalgebra::{Matrix3, Vector2};

use crate::geom::{PlaneMap, Pose, project_to_so3};

/// Map from plate coordinates (x, y in m, 1) to homogeneous pixels, positive where the points are that it was fitted to.
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

impl Homography {
    /// Normalised direct linear transform ([`PlaneMap::fit`]); `None` for fewer than four points or a degenerate set (all on a
    /// line).
    pub fn fit(plane_m: &[Vector2<f64>], pixels: &[Vector2<f64>]) -> Option<Self> {
        let pairs: Vec<_> = plane_m.iter().zip(pixels).map(|(p, q)| ((*p).into(), (*q).into())).collect();
        let full = PlaneMap::fit(&pairs)?.matrix();
        // What is seen lies in front of the camera; the origin of the plate need not.
        let middle = plane_m.iter().sum::<Vector2<f64>>() / plane_m.len() as f64;
        let sign = (full * middle.push(1.0)).z.signum();
        Some(Self(full * (sign / full.norm())))
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
        let scale = 2.0 / (r1.norm() + r2.norm());
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
