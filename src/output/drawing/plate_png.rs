//! The plate as PNG, for looking at it, with its size; for printing take the PDF.

use std::collections::BTreeSet;
use std::io::Cursor;

use image::{GrayImage, ImageFormat};

use super::dot_font::dots;
use super::plate_drawing::{Caption, Figure, figures};
use crate::error::{Code, Error, Result};
use crate::series::Plate;

/// Samples per pixel and axis.
const SAMPLES: i32 = 4;

/// Signature and header of a PNG file: what follows may be a chunk of another kind.
const HEADER: usize = 8 + 25;
const METRES_PER_INCH: f64 = 0.0254;

/// Draws the plate with `dpi` pixels per inch, edges smoothed: with a whole number of pixels per metre, as PNG states its resolution.
///
/// # Errors
/// When the picture would be larger than 400 million pixels.
pub fn png(plate: &Plate, caption: &Caption, dpi: f64) -> Result<Vec<u8>> {
    let scale = (dpi / METRES_PER_INCH).round();
    let [width, height] = [caption.sheet.width_m, caption.sheet.height_m].map(|m| (m * scale).round());
    let pixels = width * height;
    if !(1.0..4e8).contains(&pixels) {
        return Err(Error::new(
            Code::OptionRange,
            "--dpi",
            format!("{dpi} gives {width} x {height} pixels"),
            "take 50 to 600",
        ));
    }
    let mut canvas = Canvas { image: GrayImage::from_pixel(width as u32, height as u32, image::Luma([255])), scale };
    figures(plate, caption).iter().for_each(|f| canvas.draw(f));
    let mut bytes = Cursor::new(Vec::new());
    canvas
        .image
        .write_to(&mut bytes, ImageFormat::Png)
        .map_err(|e| Error::new(Code::OutputFailed, "plate picture", e, "take another --dpi"))?;
    let mut bytes = bytes.into_inner();
    bytes.splice(HEADER..HEADER, resolution(scale as u32));
    Ok(bytes)
}

/// The chunk `pHYs`: pixels per metre along both axes.
fn resolution(pixels_per_metre: u32) -> Vec<u8> {
    let [x, y] = [pixels_per_metre.to_be_bytes(); 2];
    let content = [b"pHYs".as_slice(), &x, &y, &[1]].concat();
    let length = (content.len() - 4) as u32;
    [&length.to_be_bytes(), content.as_slice(), &crc32fast::hash(&content).to_be_bytes()].concat()
}

struct Canvas {
    image: GrayImage,
    scale: f64,
}

impl Canvas {
    fn draw(&mut self, figure: &Figure) {
        match figure {
            Figure::Ring { centre, outer, inner } => {
                let [x, y] = *centre;
                let box_ = [x - outer, y - outer, x + outer, y + outer];
                let ring = |p: [f64; 2]| {
                    let d2 = (p[0] - x).powi(2) + (p[1] - y).powi(2);
                    d2 < outer * outer && d2 >= inner * inner
                };
                self.fill(box_, ring);
            }
            Figure::Polygon(corners) => self.fill(box_of(corners), |p| contains(corners, p)),
            Figure::Region(outlines) => {
                let Some((dark, light)) = outlines.split_first() else { return };
                self.fill(box_of(dark), |p| contains(dark, p) && !light.iter().any(|hole| contains(hole, p)));
            }
            Figure::Line { from, to, width } => {
                // At least a pixel wide, so that it is seen at low resolution.
                self.stroke(*from, *to, width.max(1.0 / self.scale) / 2.0);
            }
            Figure::Text { at, height, text } => self.text(*at, *height, text),
        }
    }

    /// Darkens every pixel of the box (m) by the share of its samples that lie inside.
    fn fill(&mut self, [x0, y0, x1, y1]: [f64; 4], inside: impl Fn([f64; 2]) -> bool) {
        let (width, height) = (f64::from(self.image.width()), f64::from(self.image.height()));
        let column = |x: f64| (x * self.scale + width / 2.0).clamp(0.0, width - 1.0) as u32;
        let row = |y: f64| (height / 2.0 - y * self.scale).clamp(0.0, height - 1.0) as u32;
        for v in row(y1)..=row(y0) {
            for u in column(x0)..=column(x1) {
                let mut hits = 0;
                for k in 0..SAMPLES * SAMPLES {
                    let [du, dv] = [k % SAMPLES, k / SAMPLES].map(|i| (f64::from(i) + 0.5) / f64::from(SAMPLES));
                    let x = (f64::from(u) + du - width / 2.0) / self.scale;
                    let y = (height / 2.0 - f64::from(v) - dv) / self.scale;
                    hits += i32::from(inside([x, y]));
                }
                let pixel = &mut self.image.get_pixel_mut(u, v).0[0];
                *pixel = (i32::from(*pixel) - 255 * hits / (SAMPLES * SAMPLES)).max(0) as u8;
            }
        }
    }

    /// Text in a dot font of 5 x 7, capitals only; strokes join its dots.
    fn text(&mut self, at: [f64; 2], height: f64, text: &str) {
        let dot = height / 7.0;
        let left = at[0] - 3.0 * dot * text.chars().count() as f64;
        let place = |[column, row]: [usize; 2]| [left + (column as f64 + 0.5) * dot, at[1] + (6.5 - row as f64) * dot];
        let all: BTreeSet<[usize; 2]> = dots(text).collect();
        for [column, row] in &all {
            let next = [[*column, *row], [column + 1, *row], [*column, row + 1], [column + 1, row + 1]];
            let before = column.checked_sub(1).map(|before| [before, row + 1]);
            for other in next.into_iter().chain(before).filter(|other| all.contains(other)) {
                self.stroke(place([*column, *row]), place(other), dot / 2.0);
            }
        }
    }

    /// A straight line with round ends.
    fn stroke(&mut self, from: [f64; 2], to: [f64; 2], half: f64) {
        let low = [from[0].min(to[0]) - half, from[1].min(to[1]) - half];
        let high = [from[0].max(to[0]) + half, from[1].max(to[1]) + half];
        self.fill([low[0], low[1], high[0], high[1]], |p| distance_to_segment(p, from, to) <= half);
    }
}

/// Least and largest x and y, m.
fn box_of(corners: &[[f64; 2]]) -> [f64; 4] {
    let fold = |i: usize, f: fn(f64, f64) -> f64, start: f64| corners.iter().map(|c| c[i]).fold(start, f);
    let (low, high) = (f64::INFINITY, f64::NEG_INFINITY);
    [fold(0, f64::min, low), fold(1, f64::min, low), fold(0, f64::max, high), fold(1, f64::max, high)]
}

fn contains(corners: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let mut inside = false;
    for (k, a) in corners.iter().enumerate() {
        let b = corners[(k + 1) % corners.len()];
        if (a[1] > y) != (b[1] > y) && x < (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]) + a[0] {
            inside = !inside;
        }
    }
    inside
}

fn distance_to_segment(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (d, r) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let t = ((r[0] * d[0] + r[1] * d[1]) / (d[0] * d[0] + d[1] * d[1]).max(1e-30)).clamp(0.0, 1.0);
    (r[0] - t * d[0]).hypot(r[1] - t * d[1])
}
