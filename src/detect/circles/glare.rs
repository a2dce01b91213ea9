//! Dots in clipped glare.
//!
//! Paper that is clipped makes a dot of radius `R` smaller: its edge, with blur `s` and contrast `h`, moves inwards to where the light
//! passes the middle between ink and full scale. If that is the same all around, the centre stays. Glare adds the same light to ink
//! and paper, more on one side than on the other, and the centre moves away from it by about `s R |grad ink| / (2 h phi(0))`:
//! 0.1 px beside glare of full scale and 60 px. The ink tells: it is lighter than that of the other dots.

use super::measure::median;
use super::refine::SATURATED;
use super::types::{CircleDetection, DroppedCandidate, Found, Measured, Reason};

/// Glare of this part of the contrast moves a dot by what is stated of dots in clipped paper, some 0.015 px.
const LIFTED: f64 = 0.1;

/// Leaves out the dots in clipped paper whose ink is lighter than usual.
pub(super) fn leave_out_glare(found: &mut CircleDetection, full_scale: f32) {
    let usual = median(found.found.iter().map(|f| f.measured.ink).collect());
    let is_moved = |f: &Found| is_clipped(&f.measured, full_scale) && is_lifted(&f.measured, usual);
    let (moved, good): (Vec<Found>, Vec<Found>) = found.found.iter().partition(|f| is_moved(f));
    let lost = |f: Found| {
        let ellipse = f.measured.outer.ellipse;
        let marker = Some(f.marker);
        DroppedCandidate { uv: ellipse.centre, reason: Reason::Saturated, ellipse: Some(ellipse), marker }
    };
    found.dropped.extend(moved.into_iter().map(lost));
    found.observations = good.iter().flat_map(Found::observations).collect();
    found.found = good;
}

fn is_lifted(measured: &Measured, usual_ink: f64) -> bool {
    measured.ink - usual_ink > LIFTED * (measured.paper - measured.ink)
}

/// The paper on the light side of a dot reaches full scale.
fn is_clipped(measured: &Measured, full_scale: f32) -> bool {
    let [gx, gy] = measured.gradient;
    let rise = gx.hypot(gy) * measured.outer.ellipse.semi_axes()[0];
    measured.paper * (1.0 + rise) >= f64::from(SATURATED * full_scale)
}
