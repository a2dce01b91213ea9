//! What a perfect detector reports: exact centroids of the markers that can be seen, with noise.

use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use crate::geom::Pose;
use crate::model::camera::Camera;
use crate::model::circle;
use crate::plan::visibility::is_seen;
use crate::series::{Edge, Observation, Plate};

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
