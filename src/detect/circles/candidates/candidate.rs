//! Candidates: contours that may be the image of a marker, after the quality tests.

use super::contour::{Contour, Encloses, contours};
use super::levels::Levels;
use crate::detect::Picture;
use crate::detect::circles::ellipse::Ellipse;
use crate::detect::circles::types::{DroppedCandidate, Options, Reason};

/// A dark ellipse, perhaps with a light one in its middle.
#[derive(Debug, Clone, Copy)]
pub struct Candidate {
    pub ellipse: Ellipse,
    /// Light in the middle.
    pub open: bool,
    /// Ratio of the radius of the hole to that of the outer contour, where the hole has a contour of its own.
    pub hole: Option<f64>,
    /// Brightness of paper and ink, counts.
    pub paper: f32,
    pub ink: f32,
    /// First guess of the blur, px.
    pub blur_px: f64,
}

/// Shortest contour that is worth a look, in cracks; smaller specks are noise and not counted.
const SPECK: usize = 10;

/// Candidates in the order of the scan, and those dropped.
pub fn candidates(picture: &Picture, levels: &Levels, options: &Options) -> (Vec<Candidate>, Vec<DroppedCandidate>) {
    let largest = largest_marker(picture, options);
    let found = contours(picture, levels, SPECK, (4.0 * largest) as usize);
    let holes = holes(&found, options);
    let mut dropped = Vec::new();
    let mut kept = Vec::new();
    for contour in found.iter().filter(|c| c.too_long || c.encloses == Encloses::Dark) {
        match candidate(contour, picture, levels, options, largest) {
            Ok(c) => kept.push(with_hole(c, &holes)),
            Err((reason, ellipse)) => {
                dropped.push(DroppedCandidate { uv: contour.middle, reason, ellipse, marker: None })
            }
        }
    }
    (without_nested(kept, &mut dropped), dropped)
}

/// Largest diameter of a marker, px.
pub fn largest_marker(picture: &Picture, options: &Options) -> f64 {
    options.largest_marker_px.unwrap_or(picture.width.max(picture.height) as f64 / 5.0)
}

fn candidate(
    contour: &Contour,
    picture: &Picture,
    levels: &Levels,
    options: &Options,
    largest: f64,
) -> Result<Candidate, (Reason, Option<Ellipse>)> {
    if contour.too_long {
        return Err((Reason::TooLarge, None));
    }
    if contour.clipped {
        return Err((Reason::CutByBorder, None));
    }
    let smallest = options.smallest_semi_axis_px;
    if contour.area < std::f64::consts::PI * smallest * smallest {
        return Err((Reason::TooSmall, None));
    }
    let ellipse = Ellipse::fit(&contour.points).ok_or((Reason::NotAnEllipse, None))?;
    let drop = |reason| Err((reason, Some(ellipse)));
    let [major, minor] = ellipse.semi_axes();
    if minor < smallest {
        return drop(Reason::TooSmall);
    }
    if major > largest / 2.0 {
        return drop(Reason::TooLarge);
    }
    if minor < options.smallest_aspect * major {
        return drop(Reason::TooElongated);
    }
    // A crossing between two pixels is uncertain by the noise over the slope; a distorted circle departs from an
    // ellipse by up to about 1 % of its radius.
    let allowed = 0.25 + 0.02 * (major * minor).sqrt() + 2.0 * f64::from(levels.noise / contour.step.max(1e-3));
    if misfit(&ellipse, &contour.points) > allowed {
        return drop(Reason::NotAnEllipse);
    }
    let profile = Profile::of(picture, &ellipse);
    let contrast = profile.paper - profile.ring;
    let upper = levels.upper_at(ellipse.centre[0] as f32, ellipse.centre[1] as f32);
    if contrast < options.smallest_contrast as f32 * upper || contrast < 4.0 * levels.noise {
        return drop(Reason::LowContrast);
    }
    // For a blurred step the largest slope is contrast / (sqrt(2 pi) s); 0.8 is the mean over directions of the
    // difference along the better of the two axes.
    let blur_px = (0.8 * f64::from(contrast / contour.step.max(1e-3)) / 2.507).clamp(0.4, 4.0);
    Ok(Candidate {
        ellipse,
        open: profile.centre - profile.ring > 0.25 * contrast,
        hole: None,
        paper: profile.paper,
        ink: profile.ring,
        blur_px,
    })
}

/// Rms distance of the points from the ellipse, px.
fn misfit(ellipse: &Ellipse, points: &[[f32; 2]]) -> f64 {
    let sum: f64 = points.iter().map(|p| ellipse.distance(p.map(f64::from)).powi(2)).sum();
    (sum / points.len() as f64).sqrt()
}

/// Brightness in the middle, on the way to the edge, and outside.
pub struct Profile {
    pub centre: f32,
    pub ring: f32,
    pub paper: f32,
}

impl Profile {
    pub fn of(picture: &Picture, ellipse: &Ellipse) -> Self {
        const RAYS: usize = 16;
        let beyond = 1.0 + 2.5 / ellipse.semi_axes()[1];
        let at = |relative: f64| {
            let mut values = [0.0f32; RAYS];
            let mut count = 0;
            for k in 0..RAYS {
                let p = ellipse.point(k as f64 * std::f64::consts::TAU / RAYS as f64, relative);
                let (x, y) = (p[0].round(), p[1].round());
                if x >= 0.0 && y >= 0.0 && (x as usize) < picture.width && (y as usize) < picture.height {
                    values[count] = picture.at(x as usize, y as usize);
                    count += 1;
                }
            }
            if count == 0 { 0.0 } else { *values[..count].select_nth_unstable_by(count / 2, f32::total_cmp).1 }
        };
        let mean = |a: f32, b: f32| 0.5 * (a + b);
        Self { centre: mean(at(0.0), at(0.2)), ring: at(0.76), paper: at(beyond) }
    }
}

/// Light contours that may be the inside of an annulus, ordered by column.
fn holes(found: &[Contour], options: &Options) -> Vec<([f64; 2], f64)> {
    let smallest = 0.25 * options.smallest_semi_axis_px.powi(2);
    let mut holes: Vec<([f64; 2], f64)> = found
        .iter()
        .filter(|c| c.encloses == Encloses::Light && !c.too_long && !c.clipped && c.area > smallest)
        .map(|c| (c.middle, c.area))
        .collect();
    holes.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]).then(a.0[1].total_cmp(&b.0[1])));
    holes
}

fn with_hole(candidate: Candidate, holes: &[([f64; 2], f64)]) -> Candidate {
    if !candidate.open {
        return candidate;
    }
    let [x, _] = candidate.ellipse.centre;
    let reach = 0.35 * candidate.ellipse.semi_axes()[0];
    let area = std::f64::consts::PI * candidate.ellipse.mean_radius().powi(2);
    let first = holes.partition_point(|h| h.0[0] < x - reach);
    let ratio = holes[first..]
        .iter()
        .take_while(|h| h.0[0] <= x + reach)
        .filter(|h| candidate.ellipse.relative_radius(h.0) < 0.3 && h.1 < area)
        .map(|h| (h.1 / area).sqrt())
        .max_by(f64::total_cmp);
    Candidate { hole: ratio, ..candidate }
}

/// Drops candidates that lie inside another one (a target in a target is none of ours).
fn without_nested(candidates: Vec<Candidate>, dropped: &mut Vec<DroppedCandidate>) -> Vec<Candidate> {
    let mut order: Vec<usize> = (0..candidates.len()).collect();
    order.sort_by(|&a, &b| candidates[a].ellipse.centre[0].total_cmp(&candidates[b].ellipse.centre[0]));
    let reach = candidates.iter().map(|c| c.ellipse.half_extent()[0]).fold(0.0, f64::max);
    let mut nested = vec![false; candidates.len()];
    for (k, &i) in order.iter().enumerate() {
        let inner = &candidates[i].ellipse;
        let near = |&&j: &&usize| (candidates[j].ellipse.centre[0] - inner.centre[0]).abs() <= reach;
        let holds = |&j: &usize| {
            let outer = &candidates[j].ellipse;
            outer.mean_radius() > inner.mean_radius() && outer.relative_radius(inner.centre) < 1.0
        };
        nested[i] =
            order[..k].iter().rev().take_while(near).any(holds) || order[k + 1..].iter().take_while(near).any(holds);
    }
    for (c, _) in candidates.iter().zip(&nested).filter(|(_, n)| **n) {
        let ellipse = Some(c.ellipse);
        dropped.push(DroppedCandidate { uv: c.ellipse.centre, reason: Reason::Nesting, ellipse, marker: None });
    }
    candidates.into_iter().zip(nested).filter(|(_, n)| !n).map(|(c, _)| c).collect()
}
