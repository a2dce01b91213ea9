//! Ink of neighbours that blur carries into the pixels of a marker.
//!
//! Where the paper between two markers is narrow against the blur, each darkens the edge of the other: by 2 % of the
//! contrast at two sigma, which is some 0.03 px. Once the neighbours are measured, what they take from a pixel is known
//! and given back; pixels that they cover by more than [`MOST`] are left out.

use super::exact::Contour;
use super::gauss::LANES;
use super::model::Pixels;
use crate::detect::circles::ellipse::Ellipse;
use crate::detect::circles::types::Measured;

/// Largest coverage by neighbours of a pixel that is still used: one sigma of the blur from their edge. Beyond it their
/// own uncertainty would count.
const MOST: f32 = 0.16;
/// The same for a neighbour that is not measured, whose place is known to a tenth of a pixel: two sigma from its edge.
const MOST_UNSEEN: f32 = 0.023;

/// A contour of a neighbour and what it takes from the light.
#[derive(Debug, Clone, Copy)]
pub struct NearbyInk {
    /// Position in the picture.
    contour: Contour,
    /// Paper less ink at the centre, counts; negative for the hole of an annulus.
    contrast: f64,
    /// Gradient of the light as a share, 1/px.
    gradient: [f64; 2],
    /// Largest coverage of a pixel that is still used.
    most: f32,
}

impl NearbyInk {
    /// The contours of a measured marker.
    pub fn of(measured: &Measured) -> impl Iterator<Item = Self> {
        let one = |ellipse: &Ellipse, sign| Self { most: MOST, ..Self::at(ellipse, measured, sign) };
        std::iter::once(one(&measured.outer.ellipse, 1.0)).chain(measured.hole.map(|h| one(&h, -1.0)))
    }

    /// A contour that is not measured, in the light around `like` and with its blur; `sign` is 1 for ink and -1 for a hole in it.
    pub fn at(ellipse: &Ellipse, like: &Measured, sign: f64) -> Self {
        let s2 = like.blur_px * like.blur_px;
        let from = like.outer.ellipse.centre;
        let along = |a: usize| like.gradient[a] * (ellipse.centre[a] - from[a]);
        // the light where the contour is, as a share of that at `like`
        let light = (1.0 + along(0) + along(1)).max(0.1);
        let gradient = like.gradient.map(|g| g / light);
        let centre = [0, 1].map(|a| ellipse.centre[a] - s2 * gradient[a]);
        let contour = Contour { centre, to_unit: ellipse.normaliser(), third: [0.0; 2], blur: like.blur_px };
        Self { contour, contrast: sign * light * (like.paper - like.ink), gradient, most: MOST_UNSEEN }
    }
}

/// Gives back to every pixel what the neighbours take, and leaves out the pixels that they cover.
pub(super) fn lift(pixels: &mut Pixels, nearby: &[NearbyInk], anchor: [f64; 2]) {
    let n = pixels.x.len();
    let (mut covered, mut one, all) = (vec![0.0f32; n], vec![0.0f32; n], vec![true; n / LANES]);
    for ink in nearby {
        let centre = [0, 1].map(|a| ink.contour.centre[a] - anchor[a]);
        let contour = Contour { centre, ..ink.contour };
        contour.coverage(&pixels.x, &pixels.y, &all, &mut pixels.nodes, &mut one, &mut []);
        let contrast = ink.contrast as f32;
        let ([cx, cy], [gx, gy]) = (centre.map(|v| v as f32), ink.gradient.map(|v| v as f32));
        for (i, b) in one.iter().enumerate() {
            let light = 1.0 + gx * (pixels.x[i] - cx) + gy * (pixels.y[i] - cy);
            pixels.value[i] += contrast * light * b;
            covered[i] += contrast.signum() * b / ink.most;
        }
    }
    let mut keep = 0;
    for (i, covered) in covered.iter().enumerate().take(pixels.count) {
        if covered.abs() <= 1.0 {
            pixels.x[keep] = pixels.x[i];
            pixels.y[keep] = pixels.y[i];
            pixels.value[keep] = pixels.value[i];
            keep += 1;
        }
    }
    pixels.truncate(keep);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::circles::types::Imaged;
    use crate::series::Edge;

    #[test]
    fn a_neighbour_is_taken_off_and_its_inside_left_out() {
        let ellipse = Ellipse { centre: [112.0, 50.5], shape: [1.0 / 16.0, 0.0, 1.0 / 16.0] };
        let measured = Measured {
            outer: Imaged { edge: Edge::Outer, ellipse, covariance: [0.0; 3] },
            inner: None,
            hole: None,
            blur_px: 1.2,
            paper: 200.0,
            ink: 20.0,
            rms: 0.0,
            gradient: [0.0; 2],
            visible: 1.0,
        };
        let nearby: Vec<NearbyInk> = NearbyInk::of(&measured).collect();
        let contour = Contour { centre: [12.0, 0.5], ..nearby[0].contour };
        let mut pixels = Pixels::default();
        (-15..=15).for_each(|y| pixels.push_row(-15.0, y as f32, &[200.0; 31]));
        pixels.finish();
        let mut covered = vec![0.0; pixels.x.len()];
        let all = vec![true; pixels.x.len() / LANES];
        contour.coverage(&pixels.x, &pixels.y, &all, &mut pixels.nodes, &mut covered, &mut []);
        pixels.value.iter_mut().zip(&covered).for_each(|(v, b)| *v -= 180.0 * b);
        let before = pixels.count;
        lift(&mut pixels, &nearby, [100.0, 50.0]);
        // the disc of radius 4 px covers 34 pixels fully at this place and 16 % of those 1.2 px beyond its edge
        assert!((50..110).contains(&(before - pixels.count)), "{}", before - pixels.count);
        assert!(pixels.value[..pixels.count].iter().all(|v| (v - 200.0).abs() < 1e-2));
    }
}
