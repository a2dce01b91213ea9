//! Which markers a camera sees.

use std::f64::consts::FRAC_1_SQRT_2;

use nalgebra::{Matrix2, Vector3};

use super::plate_design::LEAST_MINOR_AXIS_PX;
use crate::geom::Pose;
use crate::model::camera::Camera;
use crate::series::{Marker, Plate};

/// How far a contour stays away from the border of the image, px.
const BORDER_PX: f64 = 3.0;

/// Where a contour is looked at, in radii from its middle: east, west, north and south of it, and between these.
const AXES: [[f64; 2]; 4] = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
const DIAGONALS: [[f64; 2]; 4] = [
    [FRAC_1_SQRT_2, FRAC_1_SQRT_2],
    [-FRAC_1_SQRT_2, FRAC_1_SQRT_2],
    [-FRAC_1_SQRT_2, -FRAC_1_SQRT_2],
    [FRAC_1_SQRT_2, -FRAC_1_SQRT_2],
];

/// True when the whole outer contour is in the image and its minor axis is large enough (a point: in the image).
pub fn is_seen(marker: &Marker, camera: &Camera, camera_from_plate: &Pose) -> bool {
    let in_image = |directions: &[[f64; 2]; 4]| {
        let mut points = [[0.0; 4]; 3];
        for (n, [dx, dy]) in directions.iter().enumerate() {
            let from_middle = Vector3::new(dx * marker.outer_radius_m, dy * marker.outer_radius_m, 0.0);
            let x = camera_from_plate.transform(&(marker.position_m + from_middle));
            (0..3).for_each(|i| points[i][n] = x[i]);
        }
        camera.project_all(&points).filter(|uv| uv.iter().all(|uv| camera.contains(uv, BORDER_PX)))
    };
    let Some([e, w, n, s]) = in_image(&AXES) else { return false };
    if marker.outer_radius_m == 0.0 {
        return true;
    }
    let half_axes = Matrix2::from_columns(&[(e - w) / 2.0, (n - s) / 2.0]).singular_values();
    let is_far_from_border = || camera.contains(&((e + w) / 2.0), BORDER_PX + (e - w).norm() + (n - s).norm());
    2.0 * half_axes.min() >= LEAST_MINOR_AXIS_PX && (is_far_from_border() || in_image(&DIAGONALS).is_some())
}

/// What a view must fulfil to be workable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VisibilityLimits {
    /// Markers wholly in the image, at least.
    pub least_markers: usize,
    /// Largest angle between a line of sight to a marker and the plate's normal, rad.
    pub incidence_rad: f64,
    /// Depths between which the image is sharp, m.
    pub focus_m: (f64, f64),
}

impl Default for VisibilityLimits {
    /// Twenty markers, 60 degrees, sharp everywhere.
    fn default() -> Self {
        Self { least_markers: 20, incidence_rad: 60_f64.to_radians(), focus_m: (0.0, f64::INFINITY) }
    }
}

/// Indices of the markers that are seen from `camera_from_plate`; none from behind the plate.
pub fn seen_markers(plate: &Plate, camera: &Camera, camera_from_plate: &Pose) -> Vec<usize> {
    if camera_from_plate.inverse().translation.z <= 0.0 {
        return Vec::new();
    }
    let seen = plate.markers.iter().enumerate().filter(|(_, m)| is_seen(m, camera, camera_from_plate));
    seen.map(|(k, _)| k).collect()
}

impl VisibilityLimits {
    /// True where the markers that are seen (indices) are enough, sharp and not too oblique.
    pub fn allow(&self, plate: &Plate, camera_from_plate: &Pose, seen: &[usize]) -> bool {
        let eye = camera_from_plate.inverse().translation;
        let good = |&k: &usize| {
            let x = plate.markers[k].position_m;
            let depth = camera_from_plate.transform(&x).z;
            let sight = eye - x;
            (self.focus_m.0..=self.focus_m.1).contains(&depth) && sight.z >= self.incidence_rad.cos() * sight.norm()
        };
        seen.len() >= self.least_markers && seen.iter().all(good)
    }
}
