//! Maps: residuals over the image and over the plate, plate corrections, distortion and uncertainty of a camera.

use nalgebra::{Matrix2, Vector2, Vector3};

use crate::geom::Pose;
use crate::model::camera::Camera;
use crate::output::photogrammetry::Photogrammetry;
use crate::output::report::page::svg::{Anchor, Svg, round_below};
use crate::output::report::wording::words::{ordinal, plain};
use crate::output::restore::camera;
use crate::output::solution_json::{CameraRecord, ImageRecord, PlateRecord};

const WIDTH: f64 = 560.0;
const MARGIN: f64 = 6.0;
/// Usual length of a scale bar on paper.
const BAR: f64 = 34.0;
/// Room for the scale below a map.
const LEGEND: f64 = 34.0;

/// Most vectors in one map; beyond that every k-th is drawn.
const MOST_VECTORS: usize = 4000;

/// A drawn map with what it needs to be said under it.
pub(in crate::output::report) struct Map {
    /// The drawing.
    pub svg: String,
    /// Scale and selection, in words.
    pub caption: String,
}

/// A vector at a place, both in the unit of the map.
type Arrow = ([f64; 2], [f64; 2]);

/// The RMS length of vectors.
fn rms(arrows: &[Arrow]) -> f64 {
    let squares: f64 = arrows.iter().map(|(_, v)| v[0] * v[0] + v[1] * v[1]).sum();
    (squares / arrows.len().max(1) as f64).sqrt()
}

/// The rectangle of a map and how it lies on the paper.
pub(in crate::output::report) struct Field {
    pub low: [f64; 2],
    pub high: [f64; 2],
    /// True where the second coordinate grows upwards.
    pub up: bool,
}

impl Field {
    fn scale(&self) -> f64 {
        let [w, h] = [self.high[0] - self.low[0], self.high[1] - self.low[1]];
        let across = (WIDTH - 2.0 * MARGIN) / w.max(f64::MIN_POSITIVE);
        // No map is higher than it is wide.
        across.min((WIDTH - 2.0 * MARGIN) / h.max(f64::MIN_POSITIVE))
    }

    /// Width and height on paper, margins included.
    pub fn size(&self) -> (f64, f64) {
        let side = |k: usize| self.scale() * (self.high[k] - self.low[k]) + 2.0 * MARGIN;
        (side(0), side(1))
    }

    pub fn place(&self, at: [f64; 2]) -> [f64; 2] {
        let s = self.scale();
        let y = if self.up { self.high[1] - at[1] } else { at[1] - self.low[1] };
        [MARGIN + s * (at[0] - self.low[0]), MARGIN + s * y]
    }

    /// Draws vectors in `unit` with a scale bar, which is some twice their RMS length and `bar_length` long on paper.
    fn draw(&self, arrows: &[Arrow], label: &str, unit: &str, bar_length: f64) -> (Svg, f64) {
        let class = "vector";
        let size = |k: usize| self.scale() * (self.high[k] - self.low[k]);
        let mut svg = Svg::new(WIDTH.min(size(0) + 2.0 * MARGIN), size(1) + 2.0 * MARGIN + LEGEND, label);
        svg.rect([MARGIN, MARGIN], [size(0), size(1)], "frame");
        let typical = rms(arrows);
        let bar = round_below(2.0 * typical);
        let paper_per_unit = bar_length / bar.max(f64::MIN_POSITIVE);
        let flip = if self.up { -1.0 } else { 1.0 };
        let step = arrows.len().div_ceil(MOST_VECTORS).max(1);
        let drawn = arrows
            .iter()
            .step_by(step)
            .map(|(at, v)| (self.place(*at), [paper_per_unit * v[0], flip * paper_per_unit * v[1]]));
        svg.vectors_inside([MARGIN, MARGIN], [size(0), size(1)], drawn, class);
        let y = MARGIN + size(1) + 20.0;
        svg.vectors([([MARGIN, y], [bar_length, 0.0])].into_iter(), class);
        svg.text([MARGIN + bar_length + 8.0, y + 4.0], Anchor::Start, &format!("{} {unit}", plain(bar)));
        (svg, typical)
    }
}

fn selection(all: usize) -> String {
    let step = all.div_ceil(MOST_VECTORS).max(1);
    if step == 1 { format!("all {all} vectors") } else { format!("every {} of {all} vectors", ordinal(step)) }
}

fn used(image: &ImageRecord) -> impl Iterator<Item = (usize, [f64; 2])> + '_ {
    let o = &image.observations;
    let in_use = image.is_used();
    (0..o.marker.len()).filter(move |&k| in_use && o.reason[k].is_none()).filter_map(|k| o.duv[k].map(|d| (k, d)))
}

/// Residuals of all images of a camera over its field.
pub(in crate::output::report) fn residuals_over_image(record: Photogrammetry, camera: usize) -> Option<Map> {
    let c = &record.cameras[camera];
    let images = record.images.iter().filter(|i| i.camera == camera);
    let arrows: Vec<Arrow> = images.flat_map(|i| used(i).map(|(k, d)| (i.observations.uv[k], d))).collect();
    if arrows.is_empty() {
        return None;
    }
    let field = Field { low: [-0.5; 2], high: [f64::from(c.width_px) - 0.5, f64::from(c.height_px) - 0.5], up: false };
    let label = format!("Residuals of all images of camera {} over the image", c.name);
    let (svg, typical) = field.draw(&arrows, &label, "px", BAR);
    let caption = format!("RMS length {typical:.3} px; {}.", selection(arrows.len()));
    Some(Map { svg: svg.finish(), caption })
}

/// Mean residual of every marker, carried back to the plate, mm.
pub(in crate::output::report) fn residuals_over_plate(record: Photogrammetry, plate: usize) -> Option<Map> {
    let p = &record.plates[plate];
    let mut sums = vec![(Vector2::zeros(), 0.0); p.id.len()];
    for image in record.images.iter().filter(|i| i.plate == plate) {
        let (Some(pose), Some(c)) = (&image.camera_from_plate, record.cameras.get(image.camera)) else { continue };
        let (pose, camera) = (Pose::from(pose), camera(c));
        for (k, duv) in used(image) {
            let Ok(marker) = p.id.binary_search(&image.observations.marker[k]) else { continue };
            let Some(j) = plate_jacobian(&camera, &pose, &p.position_m[marker].into()) else { continue };
            let Some(inverse) = j.try_inverse() else { continue };
            sums[marker].0 += inverse * Vector2::from(duv);
            sums[marker].1 += 1.0;
        }
    }
    let arrows: Vec<Arrow> = (sums.iter().enumerate().filter(|(_, (_, n))| *n > 0.0))
        .map(|(m, (sum, n))| (plate_place(p, m), (1e6 * sum / *n).into()))
        .collect();
    if arrows.is_empty() {
        return None;
    }
    let (svg, typical) = plate_field(p).draw(&arrows, "Mean residual of every marker over the plate", "µm", BAR);
    let caption = format!("RMS length {typical:.1} µm; {}.", selection(arrows.len()));
    Some(Map { svg: with_markers(svg, p), caption })
}

/// Correction of every marker against nominal: arrows in the plane, circles for the height.
pub(in crate::output::report) fn plate_corrections(record: Photogrammetry, plate: usize) -> Option<Map> {
    let p = &record.plates[plate];
    let difference = |m: usize| Vector3::from(p.position_m[m]) - Vector3::from(p.nominal_m[m]);
    let arrows: Vec<Arrow> =
        (0..p.id.len()).map(|m| (plate_place(p, m), [1e6 * difference(m).x, 1e6 * difference(m).y])).collect();
    let heights: Vec<f64> = (0..p.id.len()).map(|m| 1e6 * difference(m).z).collect();
    let highest = heights.iter().map(|z| z.abs()).fold(0.0, f64::max);
    if arrows.is_empty() || (rms(&arrows) == 0.0 && highest == 0.0) {
        return None;
    }
    let field = plate_field(p);
    let (mut svg, typical) = field.draw(&arrows, "Corrections of the markers against nominal", "µm", BAR);
    for (m, z) in heights.iter().enumerate() {
        let class = if *z >= 0.0 { "above" } else { "below" };
        svg.circle(field.place(plate_place(p, m)), 0.5 + 7.0 * (z.abs() / highest.max(1e-9)).sqrt(), class);
    }
    let sigmas = p.sigma_m.iter().flatten();
    let sigma = 1e6 * (sigmas.clone().map(|s| s * s).sum::<f64>() / sigmas.count().max(1) as f64).sqrt();
    let caption = format!(
        "Lines: shift in the plane, RMS {typical:.1} µm. Circles: height, up to {highest:.0} µm; orange comes out of the plate, \
         blue lies behind it; area in proportion. Typical sigma of a coordinate {sigma:.1} µm."
    );
    Some(Map { svg: svg.finish(), caption })
}

/// What the lens does to the image: from where a pinhole camera would see a point to where this one does.
pub(in crate::output::report) fn distortion(camera_record: &CameraRecord) -> Option<Map> {
    let camera = camera(camera_record);
    let mut plain = camera.clone();
    plain.parameters[4..].iter_mut().for_each(|p| *p = 0.0);
    let (w, h) = (f64::from(camera.width_px), f64::from(camera.height_px));
    let across = 24.0;
    let down = (across * h / w).round().max(2.0);
    let mut arrows: Vec<Arrow> = Vec::new();
    for i in 0..=across as usize {
        for k in 0..=down as usize {
            let uv = Vector2::new((w - 1.0) * i as f64 / across, (h - 1.0) * k as f64 / down);
            let straight = camera.ray(&uv).and_then(|ray| plain.project(&ray));
            arrows.extend(straight.map(|s| (uv.into(), (s - uv).into())));
        }
    }
    if arrows.is_empty() || rms(&arrows) == 0.0 {
        return None;
    }
    let largest = arrows.iter().map(|(_, v)| v[0].hypot(v[1])).fold(0.0, f64::max);
    let field = Field { low: [-0.5; 2], high: [w - 0.5, h - 0.5], up: false };
    let label = format!("Distortion of camera {}", camera_record.name);
    let (mut svg, _) = field.draw(&arrows, &label, "px", 0.6 * BAR);
    let centre = [camera.parameters[2], camera.parameters[3]];
    svg.circle(field.place(centre), 3.5, "above");
    let caption = format!(
        "From each place in the image to where a camera without distortion would see the same point; up to {largest:.1} px. \
         The dot is the principal point."
    );
    Some(Map { svg: svg.finish(), caption })
}

/// Bounds of the colours of the map of uncertainty, px.
const SIGMA_BOUNDS_PX: [f64; 4] = [0.02, 0.05, 0.1, 0.3];

/// How well it is known where in the image a direction shows.
pub(in crate::output::report) fn uncertainty(r: Photogrammetry, camera: usize) -> Option<Map> {
    let c = &r.cameras[camera];
    let map = c.projection.as_ref()?;
    let [seen, largest] = c.projection_known(r.seen_by(camera).map(|(uv, _)| uv))?;
    let (w, h) = (f64::from(c.width_px), f64::from(c.height_px));
    let field = Field { low: [-0.5; 2], high: [w - 0.5, h - 0.5], up: false };
    let (width, height) = field.size();
    let mut svg = Svg::new(width, height, &format!("Uncertainty of camera {} over the image", c.name));
    let half = [0.5 * w / (map.columns - 1) as f64, 0.5 * h / (map.rows - 1) as f64];
    svg.rect([MARGIN, MARGIN], [width - 2.0 * MARGIN, height - 2.0 * MARGIN], "frame");
    for (k, sigma) in map.sigma_px.iter().enumerate().filter_map(|(k, s)| s.map(|s| (k, s))) {
        let at = map.place(k, c.width_px, c.height_px);
        let corner = |side: f64| [0, 1].map(|d| (at[d] + side * half[d]).clamp(field.low[d], field.high[d]));
        let (low, high) = (field.place(corner(-1.0)), field.place(corner(1.0)));
        let class = ["m1", "m2", "m3", "m4", "m5"][SIGMA_BOUNDS_PX.iter().filter(|b| sigma >= **b).count()];
        svg.rect(low, [high[0] - low[0], high[1] - low[1]], class);
    }
    let [a, b, c, d] = SIGMA_BOUNDS_PX;
    let caption = format!(
        "Sigma of the place where a direction is imaged, per axis, without a turn of the camera (which the poses take up): {seen:.3} px (RMS) where \
         markers were seen, at most {largest:.3} px. Dark blue below {a} px, then to {b} px, to {c} px, orange to {d} px, dark orange beyond."
    );
    Some(Map { svg: svg.finish(), caption })
}

/// d(uv) / d(x, y) of a marker in the plane of the plate, px/m.
fn plate_jacobian(camera: &Camera, pose: &Pose, marker: &Vector3<f64>) -> Option<Matrix2<f64>> {
    let projection = camera.project_with_jacobian(&pose.transform(marker))?;
    Some((projection.d_point * pose.rotation).fixed_view::<2, 2>(0, 0).into_owned())
}

fn plate_place(p: &PlateRecord, marker: usize) -> [f64; 2] {
    [p.nominal_m[marker][0], p.nominal_m[marker][1]]
}

fn plate_field(p: &PlateRecord) -> Field {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for m in 0..p.id.len() {
        for (k, x) in plate_place(p, m).into_iter().enumerate() {
            low[k] = low[k].min(x);
            high[k] = high[k].max(x);
        }
    }
    let room = 0.09 * (high[0] - low[0]).max(high[1] - low[1]).max(1e-6);
    Field { low: low.map(|x| x - room), high: high.map(|x| x + room), up: true }
}

fn with_markers(mut svg: Svg, p: &PlateRecord) -> String {
    let field = plate_field(p);
    (0..p.id.len()).for_each(|m| svg.circle(field.place(plate_place(p, m)), 1.2, "marker"));
    svg.finish()
}
