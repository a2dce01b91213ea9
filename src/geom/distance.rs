//! Distances of line segments from each other and from boxes.

use nalgebra::Vector3;

use super::Pose;

/// A box: its middle pose and half its edges, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrientedBox {
    /// `frame_from_box`, origin in the middle.
    pub pose: Pose,
    /// Half the edges, m.
    pub half_m: Vector3<f64>,
}

impl OrientedBox {
    /// The same box in the frame in which its own frame has this pose.
    pub fn placed(&self, pose: &Pose) -> Self {
        Self { pose: *pose * self.pose, half_m: self.half_m }
    }

    /// Distance of a point, m; zero inside.
    pub fn distance_m(&self, point: &Vector3<f64>) -> f64 {
        self.distance_within_m(&self.pose.inverse().transform(point))
    }

    /// Distance of a point of the box's own frame, m.
    fn distance_within_m(&self, local: &Vector3<f64>) -> f64 {
        local.abs().zip_map(&self.half_m, |x, h| (x - h).max(0.0)).norm()
    }

    /// Distance of the segment from `a` to `b`, m.
    ///
    /// The distance along the segment is convex: golden sections find its minimum.
    pub fn distance_to_segment_m(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        const ROUNDS: usize = 30;
        let box_from_frame = self.pose.inverse();
        let [a, b] = [a, b].map(|x| box_from_frame.transform(x));
        let at = |t: f64| self.distance_within_m(&(a + (b - a) * t));
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..ROUNDS {
            let (s, t) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
            if at(s) <= at(t) { high = t } else { low = s }
        }
        at(0.5 * (low + high)).min(at(0.0)).min(at(1.0))
    }

    /// True where the segment from `a` to `b` passes through the box, or ends in it (T. Kay and J. Kajiya 1986).
    pub fn is_cut_by(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> bool {
        let box_from_frame = self.pose.inverse();
        let [a, b] = [a, b].map(|x| box_from_frame.transform(x));
        let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
        for ((a, b), half) in a.iter().zip(&b).zip(&self.half_m) {
            let along = b - a;
            if along == 0.0 {
                if a.abs() > *half {
                    return false;
                }
                continue;
            }
            let (s, t) = ((-half - a) / along, (half - a) / along);
            (enters, leaves) = (enters.max(s.min(t)), leaves.min(s.max(t)));
        }
        enters <= leaves
    }

    /// The eight corners.
    pub fn corners(&self) -> [Vector3<f64>; 8] {
        std::array::from_fn(|k| {
            let sign = |bit: usize| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
            self.pose.transform(&self.half_m.component_mul(&Vector3::new(sign(0), sign(1), sign(2))))
        })
    }
}

/// Distance of two segments, m.
pub fn segment_distance_m(a: [&Vector3<f64>; 2], b: [&Vector3<f64>; 2]) -> f64 {
    let (u, v, w) = (a[1] - a[0], b[1] - b[0], a[0] - b[0]);
    let (uu, uv, vv, uw, vw) = (u.dot(&u), u.dot(&v), v.dot(&v), u.dot(&w), v.dot(&w));
    // The nearest point of a segment (from p along d) to x.
    let clamp = |numerator: f64, square: f64| if square > 0.0 { (numerator / square).clamp(0.0, 1.0) } else { 0.0 };
    let determinant = uu * vv - uv * uv;
    let s = if determinant > 1e-12 * uu * vv { ((uv * vw - vv * uw) / determinant).clamp(0.0, 1.0) } else { 0.0 };
    let t = clamp(vw + uv * s, vv);
    let s = clamp(uv * t - uw, uu);
    let t = clamp(vw + uv * s, vv);
    (w + u * s - v * t).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A deterministic spread of segments.
    fn point(k: usize) -> Vector3<f64> {
        let x = |m: f64| ((k as f64 + 1.0) * m).sin();
        Vector3::new(x(12.9898), x(78.233), x(37.719))
    }

    fn sampled(steps: usize, distance: impl Fn(f64) -> f64) -> f64 {
        (0..=steps).map(|i| distance(i as f64 / steps as f64)).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn segments_are_as_far_apart_as_their_nearest_points() {
        for k in 0..200 {
            let [a, b, c, d] = std::array::from_fn(|i| point(4 * k + i));
            let nearest = sampled(300, |s| sampled(300, |t| ((a + (b - a) * s) - (c + (d - c) * t)).norm()));
            let found = segment_distance_m([&a, &b], [&c, &d]);
            assert!(found <= nearest + 1e-12 && found > nearest - 0.01, "{k}: {found} {nearest}");
        }
        let o = Vector3::zeros();
        assert_eq!(segment_distance_m([&o, &o], [&Vector3::x(), &Vector3::x()]), 1.0);
        let (e, f) = (Vector3::y(), Vector3::new(5.0, 1.0, 0.0));
        assert!((segment_distance_m([&o, &Vector3::new(4.0, 0.0, 0.0)], [&e, &f]) - 1.0).abs() < 1e-12, "parallel");
    }

    #[test]
    fn a_segment_is_as_far_from_a_box_as_its_nearest_point() {
        for k in 0..100 {
            let [a, b, half] = std::array::from_fn(|i| point(3 * k + i));
            let twist = nalgebra::Vector6::new(a.y, a.z, b.x, b.y, half.x, 1.0);
            let around = OrientedBox { pose: Pose::exp(&twist), half_m: 0.3 * half.abs() };
            let (a, b) = (a * 2.0, b * 2.0);
            let nearest = sampled(2000, |t| around.distance_m(&(a + (b - a) * t)));
            let found = around.distance_to_segment_m(&a, &b);
            assert!((found - nearest).abs() < 3e-3, "{k}: {found} {nearest}");
            assert_eq!(around.is_cut_by(&a, &b), found == 0.0, "{k}: {found}");
        }
    }
}
