//! A picture of what was seen in an image: contours with their ids, axes of the plate, and what was dropped and why.

use std::collections::BTreeMap;
use std::io::Cursor;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::canvas::{Canvas, Colour, GROUND, text_width};
use crate::detect::Picture;
use crate::detect::circles::{Ellipse, Found, Outcome};
use crate::error::{Code, Error, Result};
use crate::geom::PlaneMap;
use crate::identify::SeenImage;
use crate::output::detection_files::{dropped_counts, marker_counts};
use crate::series::{Edge, Plate};

const OUTER: Colour = Colour(0, 214, 90);
const INNER: Colour = Colour(0, 200, 255);
const RESCUED: Colour = Colour(60, 120, 255);
const AXIS_X: Colour = Colour(255, 40, 40);
const AXIS_Y: Colour = Colour(40, 220, 40);
const NUMBER: Colour = Colour(0, 40, 160);
const TEXT: Colour = Colour(235, 235, 235);
const ALARM: Colour = Colour(255, 110, 90);

/// Colours of the reasons, the most frequent reason first.
const REASONS: [Colour; 12] = [
    Colour(255, 60, 60),
    Colour(255, 150, 30),
    Colour(240, 60, 230),
    Colour(255, 225, 40),
    Colour(160, 60, 200),
    Colour(255, 160, 200),
    Colour(170, 110, 50),
    Colour(80, 160, 160),
    Colour(130, 160, 20),
    Colour(160, 20, 20),
    Colour(120, 130, 255),
    Colour(140, 140, 140),
];

/// One colour for every reason that occurs in a series.
#[derive(Debug, Clone)]
pub struct Palette(BTreeMap<&'static str, Colour>);

impl Palette {
    /// Colours for the reasons in these images; beyond the twelfth they begin anew.
    pub fn of(images: &[SeenImage]) -> Self {
        let mut reasons: Vec<(&'static str, usize)> = dropped_counts(images.iter()).into_iter().collect();
        reasons.sort_by_key(|(reason, count)| (std::cmp::Reverse(*count), *reason));
        Self(reasons.iter().zip(REASONS.iter().cycle()).map(|((reason, _), colour)| (*reason, *colour)).collect())
    }

    fn colour(&self, reason: &str) -> Colour {
        self.0.get(reason).copied().unwrap_or(ALARM)
    }
}

/// Distance of neighbouring markers in the picture at which their numbers can be read, px.
const READABLE_PITCH_PX: f64 = 43.0;
/// Enlarged pictures have at most this many pixels.
const MOST_PIXELS: f64 = 1.4e7;

/// Draws what was seen in `picture` as PNG. Small markers are enlarged, so that their numbers can be read.
///
/// # Errors
/// A picture that is too large to be drawn on.
pub fn overlay_png(picture: &Picture, image: &SeenImage, plate: &Plate, palette: &Palette) -> Result<Vec<u8>> {
    let too_large =
        || Error::new(Code::ImageSizeImpossible, &image.name, "is too large to be drawn on", "leave --overlay out");
    let pitch = pitch_px(image);
    let scale = enlargement(picture, pitch);
    let width = picture.width as f64 * scale;
    let dot = (width / 640.0).round().clamp(1.0, 4.0);
    let legend = legend(image, palette, plate);
    let lines = wrapped(&legend, width, dot);
    let line_height = 11.0 * dot;
    let head = line_height * lines.len() as f64 + 4.0 * dot;
    let size = [width as u32, (picture.height as f64 * scale + head) as u32];
    let mut canvas = Canvas::new(size).ok_or_else(too_large)?;
    paint_picture(&mut canvas, picture, scale as usize, head as usize);
    let view = View { scale, head, number_dot: (0.047 * pitch * scale).floor().clamp(1.0, 4.0), pitch };
    view.draw(&mut canvas, image, palette);
    view.axes(&mut canvas, image, plate, [picture.width, picture.height]);
    // last: contours may reach beyond the border of the picture
    canvas.rectangle([0.0; 2], [width, head], GROUND);
    for (row, line) in lines.iter().enumerate() {
        let mut at = [3.0 * dot, 3.0 * dot + line_height * row as f64];
        for item in line {
            at[0] += item.draw(&mut canvas, at, dot);
        }
    }
    let mut bytes = Cursor::new(Vec::new());
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Sub);
    let encoded = encoder.write_image(&canvas.rgb(), size[0], size[1], ExtendedColorType::Rgb8);
    encoded.map_err(|e| Error::new(Code::OutputFailed, &image.name, e, "leave --overlay out"))?;
    Ok(bytes.into_inner())
}

/// Median distance of an observed marker to its nearest neighbour, px; 0 for fewer than two.
fn pitch_px(image: &SeenImage) -> f64 {
    let points: Vec<[f64; 2]> =
        image.detection.observations.iter().filter(|o| o.edge == Edge::Outer).map(|o| o.uv).collect();
    let nearest = |k: usize| {
        let others = points.iter().enumerate().filter(|(i, _)| *i != k);
        others.map(|(_, p)| (p[0] - points[k][0]).hypot(p[1] - points[k][1])).fold(f64::INFINITY, f64::min)
    };
    let mut distances: Vec<f64> = (0..points.len()).map(nearest).filter(|d| d.is_finite()).collect();
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() / 2).copied().unwrap_or(0.0)
}

fn enlargement(picture: &Picture, pitch: f64) -> f64 {
    let area = (picture.width * picture.height) as f64;
    let affordable = (MOST_PIXELS / area).sqrt().floor().max(1.0);
    let wanted = if pitch > 0.0 { (READABLE_PITCH_PX / pitch).ceil() } else { 1.0 };
    wanted.clamp(1.0, 4.0).min(affordable)
}

/// The picture below the head: from the darkest to the brightest thousandth, a little pale, so that colours stand out.
fn paint_picture(canvas: &mut Canvas, picture: &Picture, scale: usize, head: usize) {
    let mut sample: Vec<f32> = picture.pixels.iter().step_by(37).copied().collect();
    sample.sort_by(f32::total_cmp);
    let at = |share: f64| sample.get((share * (sample.len().max(1) - 1) as f64) as usize).copied().unwrap_or(0.0);
    let (low, high) = (at(0.001), at(0.999));
    let gain = 200.0 / (high - low).max(1.0);
    for y in 0..picture.height * scale {
        for x in 0..picture.width * scale {
            let value = (picture.at(x / scale, y / scale) - low) * gain;
            canvas.set_grey(x, y + head, 40 + value.clamp(0.0, 200.0) as u8);
        }
    }
}

/// A part of the legend: a colour (none for plain text) and words.
struct Item {
    swatch: Option<Colour>,
    colour: Colour,
    words: String,
}

impl Item {
    fn plain(words: String) -> Self {
        Self { swatch: None, colour: TEXT, words }
    }

    fn sign(swatch: Colour, words: String) -> Self {
        Self { swatch: Some(swatch), colour: TEXT, words }
    }

    fn width(&self, dot: f64) -> f64 {
        let swatch = if self.swatch.is_some() { 10.0 } else { 0.0 };
        text_width(&self.words, dot) + (swatch + 12.0) * dot
    }

    fn draw(&self, canvas: &mut Canvas, at: [f64; 2], dot: f64) -> f64 {
        let mut left = at[0];
        if let Some(colour) = self.swatch {
            canvas.rectangle([left, at[1]], [7.0 * dot, 7.0 * dot], colour);
            left += 10.0 * dot;
        }
        canvas.text([left, at[1]], dot, &self.words, self.colour);
        self.width(dot)
    }
}

/// What the head of the picture says; each inner list begins on a new line.
fn legend(image: &SeenImage, palette: &Palette, plate: &Plate) -> Vec<Vec<Item>> {
    let (markers, rescued) = marker_counts(image);
    let detection = &image.detection;
    let mut first = vec![Item::plain(image.name.clone())];
    if let Some(circles) = &detection.circles {
        if let Outcome::Identified { agreeing, disagreeing, runner_up } = circles.outcome {
            first.push(Item::plain(format!(
                "code: {agreeing} agree, {disagreeing} not, next best place {runner_up} not"
            )));
        }
        if circles.blur_px.is_finite() {
            let [paper, ink] = circles.noise;
            first.push(Item::plain(format!(
                "blur {:.2} px, noise {paper:.1} on paper, {ink:.1} on ink",
                circles.blur_px
            )));
        }
    }
    let mut second = vec![Item::sign(OUTER, format!("{markers} of {} markers", plate.markers.len()))];
    let inner = detection.observations.iter().filter(|o| o.edge == Edge::Inner).count();
    if inner > 0 {
        second.push(Item::sign(INNER, format!("{inner} inner edges")));
    }
    if rescued > 0 {
        second.push(Item::sign(RESCUED, format!("{rescued} found where predicted")));
    }
    let dropped = dropped_counts(std::iter::once(image)).into_iter();
    second.extend(dropped.map(|(reason, n)| Item::sign(palette.colour(reason), format!("{n} {reason}"))));
    let alarm = |words: &str| vec![Item { swatch: None, colour: ALARM, words: words.to_owned() }];
    let failure = detection.failure.iter().map(|f| alarm(&f.what));
    let notices = detection.notices.iter().map(|n| alarm(&n.what));
    [first, second].into_iter().chain(failure).chain(notices).collect()
}

/// Items in lines that are no wider than the picture; an item that is too long for a line is cut.
fn wrapped(groups: &[Vec<Item>], width: f64, dot: f64) -> Vec<Vec<&Item>> {
    let mut lines = Vec::new();
    for group in groups {
        let (mut line, mut used) = (Vec::new(), 0.0);
        for item in group {
            if used + item.width(dot) > width && !line.is_empty() {
                lines.push(std::mem::take(&mut line));
                used = 0.0;
            }
            used += item.width(dot);
            line.push(item);
        }
        lines.push(line);
    }
    lines
}

/// Where the picture lies on the canvas.
struct View {
    scale: f64,
    head: f64,
    number_dot: f64,
    pitch: f64,
}

const CURVE_POINTS: usize = 72;

impl View {
    fn place(&self, uv: [f64; 2]) -> [f64; 2] {
        [(uv[0] + 0.5) * self.scale, (uv[1] + 0.5) * self.scale + self.head]
    }

    fn stroke(&self) -> f64 {
        (0.03 * self.pitch * self.scale).clamp(1.2, 3.0)
    }

    fn ellipse(&self, canvas: &mut Canvas, ellipse: &Ellipse, colour: Colour) {
        let point = |k: usize| self.place(ellipse.point(k as f64 * std::f64::consts::TAU / CURVE_POINTS as f64, 1.0));
        canvas.curve(&(0..CURVE_POINTS).map(point).collect::<Vec<_>>(), self.stroke(), colour);
    }

    fn cross(&self, canvas: &mut Canvas, uv: [f64; 2], arm: f64, colour: Colour) {
        let [x, y] = self.place(uv);
        for sign in [-1.0, 1.0] {
            canvas.line([x - arm, y - sign * arm], [x + arm, y + sign * arm], self.stroke(), colour);
        }
    }

    fn draw(&self, canvas: &mut Canvas, image: &SeenImage, palette: &Palette) {
        for d in &image.detection.dropped {
            let colour = palette.colour(d.reason);
            match &d.ellipse {
                Some(e) => self.ellipse(canvas, e, colour),
                None => self.cross(canvas, d.uv, 4.0, colour),
            }
        }
        let found: BTreeMap<u32, &Found> =
            image.detection.circles.iter().flat_map(|c| &c.found).map(|f| (f.marker, f)).collect();
        for f in found.values() {
            self.ellipse(canvas, &f.measured.outer.ellipse, if f.rescued { RESCUED } else { OUTER });
            if let Some(inner) = &f.measured.inner {
                self.ellipse(canvas, &inner.ellipse, INNER);
            }
        }
        for o in image.detection.observations.iter().filter(|o| o.edge == Edge::Outer) {
            let below = match found.get(&o.marker) {
                Some(f) => f.measured.outer.ellipse.half_extent()[1] * self.scale,
                None => {
                    self.cross(canvas, o.uv, 4.0, OUTER);
                    6.0
                }
            };
            self.number(canvas, o.uv, below, o.marker);
        }
    }

    /// The marker's number under it; of markers that stand too close, every fifth.
    fn number(&self, canvas: &mut Canvas, uv: [f64; 2], below: f64, marker: u32) {
        let words = marker.to_string();
        let width = text_width(&words, self.number_dot);
        if width > self.pitch * self.scale && !marker.is_multiple_of(5) {
            return;
        }
        let [x, y] = self.place(uv);
        canvas.text_with_halo([x - width / 2.0, y + below + 2.0], self.number_dot, &words, NUMBER);
    }

    /// The plate's axes, two pitches long, from its origin, or from a marker in view with the same directions.
    fn axes(&self, canvas: &mut Canvas, image: &SeenImage, plate: &Plate, size: [usize; 2]) {
        let pairs: Vec<([f64; 2], [f64; 2])> = (image.detection.observations.iter())
            .filter(|o| o.edge == Edge::Outer)
            .filter_map(|o| {
                let m = plate.markers[plate.index_of(o.marker)?].position_m;
                Some(([m.x, m.y], o.uv))
            })
            .collect();
        let in_view = |p: &[f64; 2]| (0..2).all(|a| p[a] > 0.0 && p[a] < size[a] as f64);
        let at_origin = local_map(&pairs, |p| p.0[0].hypot(p.0[1]));
        let origin = at_origin.and_then(|m| m.apply([0.0, 0.0])).filter(in_view).map(|_| [0.0, 0.0]);
        let middle = [size[0] as f64 / 2.0, size[1] as f64 / 2.0];
        let off = |p: &([f64; 2], [f64; 2])| (p.1[0] - middle[0]).hypot(p.1[1] - middle[1]);
        let nearest = || pairs.iter().min_by(|a, b| off(a).total_cmp(&off(b))).map(|p| p.0);
        let Some(foot) = origin.or_else(nearest) else { return };
        let Some(map) = local_map(&pairs, |p| (p.0[0] - foot[0]).hypot(p.0[1] - foot[1])) else { return };
        let label = if origin.is_some() { ["x", "y"] } else { ["x direction", "y direction"] };
        let reach = 2.0 * plate.pitch_m;
        for (k, colour) in [AXIS_X, AXIS_Y].into_iter().enumerate() {
            let mut tip = foot;
            tip[k] += reach;
            let (Some(from), Some(to)) = (map.apply(foot), map.apply(tip)) else { continue };
            let dot = (self.number_dot + 1.0).max(2.0);
            canvas.arrow(self.place(from), self.place(to), 2.0 * self.stroke(), colour);
            let [x, y] = self.place(to);
            canvas.text_with_halo([x + 3.0 * dot, y - 8.0 * dot], dot, label[k], colour);
        }
    }
}

/// Markers that the map around a point is taken from.
const NEIGHBOURS: usize = 16;

/// Map from the plate to the image through the markers that are nearest by `distance`.
fn local_map(pairs: &[([f64; 2], [f64; 2])], distance: impl Fn(&([f64; 2], [f64; 2])) -> f64) -> Option<PlaneMap> {
    let mut near = pairs.to_vec();
    near.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    near.truncate(NEIGHBOURS);
    PlaneMap::fit(&near)
}
