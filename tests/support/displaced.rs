//! Series in which a body was displaced: the observations as they are then.

use std::ops::Range;

use robotcal::geom::Pose;
use robotcal::model::circle::centroid_uv;
use robotcal::simulate::SimulatedSeries;

/// The images of these stops as they are where `change` makes another pose of the plate before the camera, without markers that no camera sees there.
pub fn change(series: &mut SimulatedSeries, stops: Range<usize>, change: impl Fn(Pose) -> Pose) {
    for k in stops {
        let before = series.truth.stops[k].camera_from_plate.pose();
        let after = change(before);
        series.observations[k].observations.retain_mut(|o| {
            let marker = &series.true_plate.markers[series.true_plate.index_of(o.marker).unwrap()];
            let at = |pose: &Pose| match marker.outer_radius_m {
                0.0 => series.truth.camera.project(&pose.transform(&marker.position_m)),
                radius => centroid_uv(&series.truth.camera, pose, &marker.position_m, radius),
            };
            let Some(moved) = at(&after) else { return false };
            let by = moved - at(&before).unwrap();
            o.uv = [o.uv[0] + by.x, o.uv[1] + by.y];
            true
        });
    }
}
