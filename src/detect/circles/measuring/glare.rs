//! Dots in clipped paper, where the light changes.
//!
//! Paper that is clipped makes a dot of radius `R` smaller: its edge, with blur `s` and contrast `h`, moves inwards to where the light
//! passes the middle between ink and full scale. If that is the same all around, the centre stays, however light the ink is. Where glare
//! or a sheen adds more light on one side than on the other, the centre moves away from it by about
//!
//! ```text
//! b = s R |grad ink| / (2 h phi(0))
//! ```
//!
//! 0.1 px beside glare of full scale and 60 px, 0.01 px on a sheen over the whole board. Ink is not clipped, and the dots around one
//! tell how it changes: that is as well as the place of the dot is known, and its covariance says so.

use std::f64::consts::TAU;

use crate::detect::circles::types::{CircleDetection, DroppedCandidate, Found, Measured, Reason};
use crate::detect::shared::SATURATED;

/// Dots around one, to all sides of it.
const AROUND: usize = 8;
/// Fewer tell the change of the light along one line only.
const LEAST_AROUND: usize = 3;

/// Adds to the covariance of every dot in clipped paper what the light may have moved it by; `sigma_px`: of the smoothing before its
/// edge was fitted. A dot that stands too much alone to tell is left out.
pub fn allow_for_glare(found: &mut CircleDetection, full_scale: f32, sigma_px: f64) {
    let all = found.found.clone();
    let (mut good, mut lost) = (Vec::with_capacity(all.len()), Vec::new());
    for f in &all {
        if !is_clipped(&f.measured, full_scale) {
            good.push(*f);
            continue;
        }
        match ink_slope(f, &all) {
            Some(slope) => good.push(displaced(f, slope, sigma_px)),
            None => lost.push(left_out(f)),
        }
    }
    found.dropped.extend(lost);
    found.observations = good.iter().flat_map(Found::observations).collect();
    found.found = good;
}

/// The paper on the light side of a dot reaches full scale.
fn is_clipped(measured: &Measured, full_scale: f32) -> bool {
    let [gx, gy] = measured.gradient;
    let rise = gx.hypot(gy) * measured.outer.ellipse.semi_axes()[0];
    measured.paper * (1.0 + rise) >= f64::from(SATURATED * full_scale)
}

/// Steepest change of the ink to one of the dots around, counts per px.
fn ink_slope(of: &Found, all: &[Found]) -> Option<f64> {
    let at = |f: &Found| f.measured.outer.ellipse.centre;
    let others = all.iter().filter(|f| f.marker != of.marker);
    let mut around: Vec<(f64, f64)> = others
        .map(|f| ((at(f)[0] - at(of)[0]).hypot(at(f)[1] - at(of)[1]), (f.measured.ink - of.measured.ink).abs()))
        .collect();
    around.sort_by(|a, b| a.0.total_cmp(&b.0));
    around.truncate(AROUND);
    let steepest = around.iter().map(|(px, counts)| counts / px).fold(0.0, f64::max);
    (around.len() >= LEAST_AROUND).then_some(steepest)
}

fn displaced(of: &Found, slope: f64, sigma_px: f64) -> Found {
    let mut of = *of;
    let measured = &mut of.measured;
    let steepest_edge = (measured.paper - measured.ink) / (measured.blur_px.hypot(sigma_px) * TAU.sqrt());
    let moved_px = measured.outer.ellipse.semi_axes()[0] * slope / (2.0 * steepest_edge);
    for imaged in std::iter::once(&mut measured.outer).chain(&mut measured.inner) {
        imaged.covariance[0] += moved_px * moved_px;
        imaged.covariance[2] += moved_px * moved_px;
    }
    of
}

fn left_out(of: &Found) -> DroppedCandidate {
    let ellipse = of.measured.outer.ellipse;
    DroppedCandidate { uv: ellipse.centre, reason: Reason::Saturated, ellipse: Some(ellipse), marker: Some(of.marker) }
}
