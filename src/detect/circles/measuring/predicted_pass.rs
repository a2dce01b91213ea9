//! The second pass: markers are measured where neighbours, or camera and pose, say that they are.

use super::measure::{Camera, INK_SLOPE};
use super::overlapping::{measure_alone, measure_beside};
use super::predicted::Predicted;
use crate::detect::circles::types::{Found, Measured};
use crate::detect::{Circles, Detection, Picture};

/// The second pass: looks for the markers that are predicted and were not found. What is found is added to the detection.
///
/// Markers across the border of the picture are measured from the part that is in it; those with neighbours within the reach
/// of the blur together with them.
pub fn detect_predicted(picture: &Picture, detection: &mut Detection, predicted: &[Predicted]) {
    let Detection { observations, dropped, circles: Some(Circles { found, blur_px, noise, correlation, .. }), .. } =
        detection
    else {
        return;
    };
    let camera =
        Camera { blur_px: *blur_px, noise: noise.map(|n| n * n), correlation: *correlation, ink_slope: INK_SLOPE };
    let is_known = |p: &&Predicted| found.iter().any(|f| f.marker == p.marker);
    let missing: Vec<Predicted> = predicted.iter().filter(|p| !is_known(p)).copied().collect();
    let known: Vec<Measured> = found.iter().map(|f| f.measured).collect();
    let fits = measure_beside(picture, camera, &known, &missing);
    for (p, fit) in missing.iter().zip(fits) {
        let Some(new) = fit.and_then(|f| p.accepted(f)) else { continue };
        dropped.retain(|d| !p.lies_at(d.uv));
        observations.extend(new.observations());
        found.push(new);
    }
    found.sort_by_key(|f| f.marker);
    observations.sort_by_key(|o| (o.marker, o.edge));
}

/// Measures markers in a picture of which nothing is known but where they are; blur and noise are learned from them.
///
/// For pictures in which no marker can be identified because all are too small against the blur: precision does not need
/// what identity needs. The contours must be predicted to about a quarter of a radius, the shape to 1 %.
pub fn measure_predicted(picture: &Picture, predicted: &[Predicted]) -> Vec<Found> {
    predicted.iter().zip(measure_alone(picture, predicted)).filter_map(|(p, fit)| p.accepted(fit?)).collect()
}
