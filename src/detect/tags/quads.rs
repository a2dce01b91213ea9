//! Dark quadrilaterals on light ground.
//!
//! Contours are followed in the negative of the picture, where what is dark hangs together over sides and not over corners: the
//! squares between the tags of an AprilGrid touch them there.

use crate::detect::Picture;
use crate::detect::circles::{Contour, Encloses, Levels, contours};

/// Shortest side, px.
const SHORTEST_PX: f64 = 7.0;
/// Rms distance of the contour from the four lines, as a part of the shorter side and px on top.
const CROOKED: f64 = 0.015;
const CROOKED_PX: f64 = 0.6;
/// Part of a side that is left out at either end of it.
const ENDS: f64 = 0.12;

/// Corners of a quadrilateral, clockwise on the screen.
pub type Quad = [[f64; 2]; 4];

/// A picture in which what was dark is bright, of levels below zero.
pub fn inverted(picture: &Picture) -> Picture {
    Picture { pixels: picture.pixels.iter().map(|v| -v).collect(), ..*picture }
}

/// The dark quadrilaterals of a picture, which is given `inverted`, that are at most `largest_px` across. `threshold` lies between paper (0) and ink (1).
pub fn quads(inverted: &Picture, largest_px: f64, threshold: f32) -> Vec<Quad> {
    let levels = Levels::of(inverted, largest_px, threshold);
    let found = contours(inverted, &levels, (4.0 * SHORTEST_PX) as usize, (6.0 * largest_px) as usize);
    found.iter().filter(|c| c.encloses == Encloses::Light && !c.clipped && !c.too_long).filter_map(quad).collect()
}

fn quad(contour: &Contour) -> Option<Quad> {
    let points: Vec<[f64; 2]> = contour.points.iter().map(|p| p.map(f64::from)).collect();
    let first = clockwise(corners(&points)?);
    let rough = [0, 1, 2, 3].map(|k: usize| Line::through(first[k], first[(k + 1) % 4]));
    let lines: Vec<Line> = (0..4).map(|k| Line::along(&points, &first, k, &rough)).collect::<Option<_>>()?;
    let quad: Quad = [0, 1, 2, 3].map(|k: usize| lines[(k + 3) % 4].meets(&lines[k]).unwrap_or([f64::NAN; 2]));
    let sides = [0, 1, 2, 3].map(|k: usize| distance(quad[k], quad[(k + 1) % 4]));
    let shortest = sides.iter().fold(f64::MAX, |m, s| m.min(*s));
    if !quad.iter().flatten().all(|v| v.is_finite()) || shortest < SHORTEST_PX || !is_convex(&quad) {
        return None;
    }
    let misfit = |p: &[f64; 2]| lines.iter().map(|l| l.distance(*p).abs()).fold(f64::MAX, f64::min);
    let square: f64 = points.iter().map(|p| misfit(p).powi(2)).sum::<f64>() / points.len() as f64;
    let same_area = (area(&quad) / contour.area - 1.0).abs() < 0.15;
    (same_area && square.sqrt() < CROOKED_PX + CROOKED * shortest).then_some(quad)
}

/// The two ends of the longest diagonal and the points farthest from it on both sides.
fn corners(points: &[[f64; 2]]) -> Option<Quad> {
    let farthest =
        |from: [f64; 2]| points.iter().max_by(|a, b| distance(**a, from).total_cmp(&distance(**b, from))).copied();
    let a = farthest(*points.first()?)?;
    let b = farthest(a)?;
    let off = |p: &[f64; 2]| cross(a, b, *p);
    let left = points.iter().max_by(|p, q| off(p).total_cmp(&off(q)))?;
    let right = points.iter().min_by(|p, q| off(p).total_cmp(&off(q)))?;
    Some([a, *left, b, *right])
}

/// A line through points: `normal . p = offset`.
struct Line {
    normal: [f64; 2],
    offset: f64,
}

impl Line {
    fn through(from: [f64; 2], to: [f64; 2]) -> Self {
        let length = distance(from, to);
        let normal = [(from[1] - to[1]) / length, (to[0] - from[0]) / length];
        Self { normal, offset: normal[0] * from[0] + normal[1] * from[1] }
    }

    /// Total least squares over the points near the middle part of side `k` that are nearer to no other one, as they are where two sides meet
    /// in a sharp corner.
    fn along(points: &[[f64; 2]], corners: &Quad, k: usize, rough: &[Self; 4]) -> Option<Self> {
        let (from, to) = (corners[k], corners[(k + 1) % 4]);
        let length = distance(from, to);
        let t = [(to[0] - from[0]) / length, (to[1] - from[1]) / length];
        let near = |p: &&[f64; 2]| {
            let along = (p[0] - from[0]) * t[0] + (p[1] - from[1]) * t[1];
            let off = rough[k].distance(**p).abs();
            let is_middle = (ENDS * length..(1.0 - ENDS) * length).contains(&along);
            is_middle && off < 0.1 * length + 1.5 && rough.iter().all(|side| side.distance(**p).abs() >= off)
        };
        let near: Vec<&[f64; 2]> = points.iter().filter(near).collect();
        if near.len() < 4 {
            return None;
        }
        let n = near.len() as f64;
        let mean = [0, 1].map(|a| near.iter().map(|p| p[a]).sum::<f64>() / n);
        let moment = |a: usize, b: usize| near.iter().map(|p| (p[a] - mean[a]) * (p[b] - mean[b])).sum::<f64>();
        let angle = 0.5 * (2.0 * moment(0, 1)).atan2(moment(0, 0) - moment(1, 1));
        let normal = [-angle.sin(), angle.cos()];
        Some(Self { normal, offset: normal[0] * mean[0] + normal[1] * mean[1] })
    }

    fn distance(&self, p: [f64; 2]) -> f64 {
        self.normal[0] * p[0] + self.normal[1] * p[1] - self.offset
    }

    fn meets(&self, other: &Self) -> Option<[f64; 2]> {
        let determinant = self.normal[0] * other.normal[1] - self.normal[1] * other.normal[0];
        let u = (self.offset * other.normal[1] - other.offset * self.normal[1]) / determinant;
        let v = (self.normal[0] * other.offset - other.normal[0] * self.offset) / determinant;
        (determinant.abs() > 0.05).then_some([u, v])
    }
}

pub(super) fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Mean of the corners.
pub(super) fn middle(q: &Quad) -> [f64; 2] {
    [0, 1].map(|a| q.iter().map(|p| p[a]).sum::<f64>() / 4.0)
}

/// Twice the area of a triangle; positive where it turns clockwise on the screen.
fn cross(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

fn area(q: &Quad) -> f64 {
    0.5 * (cross(q[0], q[1], q[2]) + cross(q[0], q[2], q[3]))
}

fn clockwise(mut q: Quad) -> Quad {
    if area(&q) < 0.0 {
        q.reverse();
    }
    q
}

fn is_convex(q: &Quad) -> bool {
    (0..4).all(|k| cross(q[k], q[(k + 1) % 4], q[(k + 2) % 4]) > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts of paper with a dark quadrilateral, of 16 places a pixel.
    fn picture(ink: &Quad) -> Picture {
        let (width, height) = (260, 200);
        let is_ink = |p: [f64; 2]| (0..4).all(|k| cross(ink[k], ink[(k + 1) % 4], p) > 0.0);
        let value = |k: usize| {
            let places = (0..16)
                .map(|i| [(k % width, i % 4), (k / width, i / 4)].map(|(p, i)| p as f64 - 0.375 + i as f64 / 4.0));
            200.0 - 10.0 * places.filter(|p| is_ink(*p)).count() as f32
        };
        Picture { width, height, pixels: (0..width * height).map(value).collect(), full_scale: 255.0 }
    }

    /// Tags seen slantwise have corners of 25 degrees: points of one side beside it are near the other one, too.
    #[test]
    fn a_sharp_corner_is_where_its_sides_meet() {
        for degrees in [25.0_f64, 40.0, 90.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let corner = |along: f64, up: f64| [40.3 + along * 100.0 + up * 90.0 * cos, 30.6 + up * 90.0 * sin];
            let ink = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
            let found = quads(&inverted(&picture(&ink)), 220.0, 0.6);
            let [quad] = &found[..] else { panic!("{degrees}: {found:?}") };
            for at in ink {
                let off = quad.iter().map(|p| distance(*p, at)).fold(f64::MAX, f64::min);
                assert!(off < 1.0 / sin, "{degrees}: {off} px");
            }
        }
    }
}
