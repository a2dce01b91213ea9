//! What a perfect detector reports: exact centroids of the markers that can be seen, with noise.

use nalgebra::{Matrix2, Vector3};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use crate::geom::Pose;
use crate::model::camera::Camera;
use crate::model::circle;
use crate::plan::plate_design::LEAST_MINOR_AXIS_PX;
use crate::series::{Edge, Marker, Observation, Plate};

/// How far a contour stays away from the border of the image, px.
const BORDER_PX: f64 = 3.0;

/// Observations of all markers that are wholly in the image and large enough, both edges of annuli, with independent noise of
/// `sigma_px` per axis.
pub fn observe(
    plate: &Plate,
    camera: &Camera,
    camera_from_plate: &Pose,
    sigma_px: f64,
    rng: &mut impl Rng,
) -> Vec<Observation> {
    let mut seen = Vec::new();
    if camera_from_plate.inverse().translation.z <= 0.0 {
        return seen; // The back of the plate.
    }
    for marker in plate.markers.iter().filter(|m| is_seen(m, camera, camera_from_plate)) {
        for (edge, radius_m) in [(Edge::Outer, marker.outer_radius_m), (Edge::Inner, marker.inner_radius_m)] {
            if edge == Edge::Inner && radius_m <= 0.0 {
                continue;
            }
            let Some(uv) = circle::centroid_uv(camera, camera_from_plate, &marker.position_m, radius_m) else {
                continue;
            };
            let mut noise = || sigma_px * rng.sample::<f64, _>(StandardNormal);
            let (u, v) = (noise(), noise());
            let covariance = (sigma_px > 0.0).then_some([sigma_px * sigma_px, 0.0, sigma_px * sigma_px]);
            seen.push(Observation { marker: marker.id, edge, uv: [uv.x + u, uv.y + v], covariance });
        }
    }
    seen
}

/// True when the whole outer contour is in the image and its minor axis is large enough (a point: in the image).
pub fn is_seen(marker: &Marker, camera: &Camera, camera_from_plate: &Pose) -> bool {
    let image = |dx: f64, dy: f64| {
        let r = marker.outer_radius_m;
        let x = marker.position_m + Vector3::new(dx * r, dy * r, 0.0);
        camera.project(&camera_from_plate.transform(&x)).filter(|uv| camera.contains(uv, BORDER_PX))
    };
    let diagonal = std::f64::consts::FRAC_1_SQRT_2;
    let corners = [(diagonal, diagonal), (-diagonal, diagonal), (-diagonal, -diagonal), (diagonal, -diagonal)];
    if corners.iter().any(|&(x, y)| image(x, y).is_none()) {
        return false;
    }
    let (Some(e), Some(w), Some(n), Some(s)) = (image(1.0, 0.0), image(-1.0, 0.0), image(0.0, 1.0), image(0.0, -1.0))
    else {
        return false;
    };
    let half_axes = Matrix2::from_columns(&[(e - w) / 2.0, (n - s) / 2.0]).singular_values();
    marker.outer_radius_m == 0.0 || 2.0 * half_axes.min() >= LEAST_MINOR_AXIS_PX
}
