//! Focal length from homographies (Zhang's constraints, square pixels, principal point in the middle of the image).

use nalgebra::{Matrix3, Vector2};

use super::homography::Homography;

/// One starting focal length, with where it came from.
#[derive(Debug, Clone, PartialEq)]
pub struct FocalCandidate {
    /// Focal length, px.
    pub focal_px: f64,
    /// Where it came from, in words.
    pub origin: String,
}

/// Focal lengths, in widths of the image, that are tried when the data give none of their own.
const LADDER: [f64; 5] = [0.6, 0.9, 1.4, 2.2, 3.5];

/// Starting values in the order of trust: stated, from the homographies, from a ladder of common lenses.
pub fn focal_candidates(
    homographies: &[Homography],
    width_px: u32,
    height_px: u32,
    stated_px: Option<f64>,
) -> Vec<FocalCandidate> {
    let mut candidates = Vec::new();
    let mut add = |focal_px: f64, origin: &str| candidates.push(FocalCandidate { focal_px, origin: origin.to_owned() });
    if let Some(f) = stated_px {
        add(f, "manifest");
    }
    let centre = Vector2::new((f64::from(width_px) - 1.0) / 2.0, (f64::from(height_px) - 1.0) / 2.0);
    if let Some(f) = focal_from_homographies(homographies, centre, f64::from(width_px)) {
        add(f, "homographies");
    }
    for factor in LADDER {
        add(factor * f64::from(width_px), "ladder of common lenses");
    }
    candidates
}

/// Least squares for 1/f^2 over the two constraints of every image; `None` where they contradict each other.
fn focal_from_homographies(homographies: &[Homography], centre: Vector2<f64>, width: f64) -> Option<f64> {
    let shift = Matrix3::new(1.0 / width, 0.0, -centre.x / width, 0.0, 1.0 / width, -centre.y / width, 0.0, 0.0, 1.0);
    let (mut uu, mut uv) = (0.0, 0.0);
    for h in homographies {
        let m = shift * h.0;
        let (a, b) = (m.column(0), m.column(1));
        let size = a.norm() * b.norm();
        for (u, v) in [
            (a.x * b.x + a.y * b.y, a.z * b.z),
            ((a.x * a.x + a.y * a.y - b.x * b.x - b.y * b.y) / 2.0, (a.z * a.z - b.z * b.z) / 2.0),
        ] {
            uu += u * u / (size * size);
            uv += u * v / (size * size);
        }
    }
    let inverse_square = -uv / uu;
    let focal = width / inverse_square.sqrt();
    (focal.is_finite() && focal > 0.2 * width && focal < 20.0 * width).then_some(focal)
}
