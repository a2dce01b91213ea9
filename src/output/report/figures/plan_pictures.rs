//! Pictures of a plan: arm and views, image field, joint ranges, accuracy curve.

use nalgebra::{Vector2, Vector3};

use crate::geom::Pose;
use crate::output::report::page::svg::{Anchor, Svg};
use crate::output::report::wording::words::plain;
use crate::plan::{Forecast, JointRange, Plan, PlanRequest};
use crate::series::CameraMount;
use crate::urdf::JointKind;

const WIDTH: f64 = 460.0;
const MARGIN: f64 = 30.0;

/// Side of a drawing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::output::report) enum View {
    /// Along y: x to the right, z up.
    Side,
    /// Along -z: x to the right, y up.
    Top,
}

impl View {
    fn flat(self, p: &Vector3<f64>) -> [f64; 2] {
        match self {
            Self::Side => [p.x, p.z],
            Self::Top => [p.x, p.y],
        }
    }
}

/// Length of the drawn edges of a view, as a share of the distance to the plate.
const CONE: f64 = 0.35;

/// A segment of the drawing, in metres, with its class.
type Segment = ([f64; 2], [f64; 2], &'static str);

/// Arm, views and plates of all stops.
pub(in crate::output::report) fn scene(request: &PlanRequest, plan: &Plan, view: View) -> String {
    let setting = &request.setting;
    let mut segments: Vec<Segment> = Vec::new();
    let mut add = |a: &Vector3<f64>, b: &Vector3<f64>, class| segments.push((view.flat(a), view.flat(b), class));
    for leg in &plan.legs {
        let stop = &plan.pool[leg.stop];
        let links = setting.robot.link_poses(&stop.readings);
        let mut joints = vec![Vector3::zeros()];
        joints.extend(links.iter().map(|l| l.translation));
        joints.windows(2).for_each(|w| add(&w[0], &w[1], "arm"));
        let tip = links.last().copied().unwrap_or(Pose::identity());
        let placed = setting.placements[stop.placement].1;
        let (camera, plate, outline) = match setting.mount {
            CameraMount::Hand => (tip * setting.mounting, placed, "plate"),
            CameraMount::Fixed => (setting.mounting, tip * placed, "carried"),
        };
        let reach = CONE * stop.camera_from_plate.translation.norm();
        let corners = frustum(setting, reach).map(|c| camera.transform(&c));
        for k in 0..4 {
            add(&camera.translation, &corners[k], "cone");
            add(&corners[k], &corners[(k + 1) % 4], "cone");
        }
        let edges = plate_corners(setting).map(|c| plate.transform(&c));
        (0..4).for_each(|k| add(&edges[k], &edges[(k + 1) % 4], outline));
    }
    drawn(&segments, view)
}

/// Corners of the image at a distance, in the camera frame.
fn frustum(setting: &crate::plan::setting::Setting, reach: f64) -> [Vector3<f64>; 4] {
    let c = &setting.camera;
    let (w, h) = (f64::from(c.width_px) - 1.0, f64::from(c.height_px) - 1.0);
    [(0.0, 0.0), (w, 0.0), (w, h), (0.0, h)].map(|(u, v)| {
        let p = &c.parameters;
        let straight = Vector3::new((u - p[2]) / p[0], (v - p[3]) / p[1], 1.0);
        c.ray(&Vector2::new(u, v)).unwrap_or(straight) * reach
    })
}

fn plate_corners(setting: &crate::plan::setting::Setting) -> [Vector3<f64>; 4] {
    let most = |k: usize| setting.plate.markers.iter().map(|m| m.position_m[k].abs()).fold(0.0, f64::max);
    let (x, y) = (most(0), most(1));
    [(x, y), (-x, y), (-x, -y), (x, -y)].map(|(x, y)| Vector3::new(x, y, 0.0))
}

fn drawn(segments: &[Segment], view: View) -> String {
    let ends = || segments.iter().flat_map(|s| [s.0, s.1]);
    let range = |k: usize| {
        let low = ends().map(|e| e[k]).fold(0.0, f64::min);
        (low, ends().map(|e| e[k]).fold(0.0, f64::max))
    };
    let ((x0, x1), (y0, y1)) = (range(0), range(1));
    let scale = (WIDTH - 2.0 * MARGIN) / (x1 - x0).max(y1 - y0).max(1e-6);
    let height = 2.0 * MARGIN + scale * (y1 - y0);
    let at = |p: [f64; 2]| [MARGIN + scale * (p[0] - x0), MARGIN + scale * (y1 - p[1])];
    let label =
        if view == View::Side { "Arm and camera views from the side" } else { "Arm and camera views from above" };
    let mut svg = Svg::new(WIDTH, height, label);
    let first = (x0 / 0.2).ceil() as i32;
    for k in first..=(x1 / 0.2).floor() as i32 {
        let x = at([0.2 * f64::from(k), 0.0])[0];
        svg.line([x, MARGIN / 2.0], [x, height - MARGIN / 2.0], "grid");
        svg.text([x, height - 3.0], Anchor::Middle, &format!("{:.1}", 0.2 * f64::from(k)));
    }
    let ground = at([0.0, 0.0])[1];
    svg.line([MARGIN / 2.0, ground], [WIDTH - MARGIN / 2.0, ground], "axis");
    for class in ["arm", "carried", "cone", "plate"] {
        let own = segments.iter().filter(|s| s.2 == class);
        let vectors = own.map(|s| {
            let (a, b) = (at(s.0), at(s.1));
            (a, [b[0] - a[0], b[1] - a[1]])
        });
        svg.vectors(vectors, class);
    }
    svg.finish()
}

/// Columns and rows of the picture of the image field.
const CELLS: [usize; 2] = [20, 16];

/// Where in the image the markers of all planned images lie.
pub(in crate::output::report) fn coverage(request: &PlanRequest, plan: &Plan) -> String {
    let setting = &request.setting;
    let camera = &setting.camera;
    let size = [f64::from(camera.width_px), f64::from(camera.height_px)];
    let mut counts = vec![0usize; CELLS[0] * CELLS[1]];
    for leg in &plan.legs {
        let candidate = &plan.pool[leg.stop];
        for &k in &candidate.seen {
            let at = candidate.camera_from_plate.transform(&setting.plate.markers[k].position_m);
            let Some(uv) = camera.project(&at) else { continue };
            let cell =
                |a: usize| ((uv[a] + 0.5) / size[a] * CELLS[a] as f64).clamp(0.0, CELLS[a] as f64 - 1.0) as usize;
            counts[cell(1) * CELLS[0] + cell(0)] += 1;
        }
    }
    let most = counts.iter().copied().max().unwrap_or(0).max(1) as f64;
    let height = WIDTH * size[1] / size[0];
    let mut svg = Svg::new(WIDTH, height, "Markers over the image field");
    let cell = [WIDTH / CELLS[0] as f64, height / CELLS[1] as f64];
    for (k, &count) in counts.iter().enumerate().filter(|(_, c)| **c > 0) {
        let at = [(k % CELLS[0]) as f64 * cell[0], (k / CELLS[0]) as f64 * cell[1]];
        let class = ["h1", "h2", "h3", "h4"][((4.0 * count as f64 / most) as usize).min(3)];
        svg.rect(at, cell, class);
    }
    let edges = [
        ([0.0, 0.0], [WIDTH, 0.0]),
        ([WIDTH, 0.0], [0.0, height]),
        ([WIDTH, height], [-WIDTH, 0.0]),
        ([0.0, height], [0.0, -height]),
    ];
    svg.vectors(edges.into_iter(), "axis");
    svg.finish()
}

/// Letters of a joint's name at most, and the width of one.
const LONGEST_NAME: usize = 24;
const LETTER: f64 = 7.0;

/// Limits and planned readings of every joint.
pub(in crate::output::report) fn joint_ranges(forecast: &Forecast) -> String {
    let name = |range: &JointRange| range.name.chars().take(LONGEST_NAME).collect::<String>();
    let longest = forecast.ranges.iter().map(|r| name(r).len()).max().unwrap_or(0);
    let (left, row) = (16.0 + LETTER * longest as f64, 36.0);
    let height = row * forecast.ranges.len() as f64 + 6.0;
    let mut svg = Svg::new(WIDTH, height, "Joint ranges with planned readings");
    let reach = WIDTH - left - 12.0;
    for (k, range) in forecast.ranges.iter().enumerate() {
        let top = 4.0 + row * k as f64;
        let (low, high) = range.limits;
        let x = |q: f64| left + reach * ((q - low) / (high - low).max(1e-9)).clamp(0.0, 1.0);
        svg.text([left - 8.0, top + 13.0], Anchor::End, &name(range));
        svg.rect([left, top], [reach, 14.0], "frame");
        range.planned.iter().for_each(|q| svg.line([x(*q), top], [x(*q), top + 14.0], "tick"));
        let shown = |q: f64| match range.kind {
            JointKind::Prismatic => format!("{:.0} mm", 1e3 * q),
            _ => format!("{:.0}°", q.to_degrees()),
        };
        svg.text([left, top + 25.0], Anchor::Start, &shown(low));
        svg.text([left + reach, top + 25.0], Anchor::End, &shown(high));
    }
    svg.finish()
}

/// Error over the number of images, both axes logarithmic.
pub(in crate::output::report) fn curve(forecast: &Forecast) -> String {
    let (height, left, bottom) = (260.0, 56.0, 40.0);
    let mut svg = Svg::new(WIDTH, height, "Expected error of the flange over the number of images");
    let points = &forecast.curve;
    let all =
        || points.iter().flat_map(|p| [1e3 * p.planned_m, 1e3 * p.random_m]).filter(|v| v.is_finite() && *v > 0.0);
    let (low, high) = (all().fold(f64::INFINITY, f64::min) / 1.15, all().fold(0.0, f64::max) * 1.15);
    if points.len() < 2 || low >= high {
        svg.text([WIDTH / 2.0, height / 2.0], Anchor::Middle, "too few images for a curve");
        return svg.finish();
    }
    let (first, last) = (points[0].images as f64, points[points.len() - 1].images as f64);
    let x = |n: f64| left + (WIDTH - left - 14.0) * (n / first).ln() / (last / first).ln();
    let y = |mm: f64| 10.0 + (height - 10.0 - bottom) * (high / mm).ln() / (high / low).ln();
    let decades = (-6..6).flat_map(|p| [1.0, 2.0, 5.0].map(|m| m * 10f64.powi(p)));
    for mark in decades.filter(|v| (low..=high).contains(v)) {
        svg.line([left, y(mark)], [WIDTH - 14.0, y(mark)], "grid");
        svg.text([left - 6.0, y(mark) + 4.0], Anchor::End, &plain(mark));
    }
    svg.line([left, height - bottom], [WIDTH - 14.0, height - bottom], "axis");
    let mut free_from = f64::NEG_INFINITY;
    for p in points {
        let at = x(p.images as f64);
        if at > free_from {
            svg.text([at, height - bottom + 16.0], Anchor::Middle, &p.images.to_string());
            free_from = at + 24.0;
        }
    }
    for (class, of) in [("random", 1), ("planned", 0)] {
        let value = |k: usize| 1e3 * [points[k].planned_m, points[k].random_m][of];
        let place = |k: usize| [x(points[k].images as f64), y(value(k))];
        let steps = (1..points.len()).map(|k| {
            let (a, b) = (place(k - 1), place(k));
            (a, [b[0] - a[0], b[1] - a[1]])
        });
        svg.vectors(steps, class);
    }
    svg.text([left + (WIDTH - left) / 2.0, height - 6.0], Anchor::Middle, "images");
    svg.text_upwards([13.0, height / 2.0 - 10.0], "flange, mm (RMS)");
    svg.finish()
}
