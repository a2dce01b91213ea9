//! Drawing on a coloured picture: smooth lines by tiny-skia, text in the dot font.

use tiny_skia::{FillRule, LineCap, Paint, PathBuilder, Pixmap, Rect, Stroke, Transform};

use super::dot_font::{ADVANCE, dots};

/// Red, green, blue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Colour(pub u8, pub u8, pub u8);

/// Where nothing is drawn.
pub(super) const GROUND: Colour = Colour(20, 20, 24);

/// Width of a text, px.
pub(super) fn text_width(text: &str, dot: f64) -> f64 {
    ((ADVANCE * text.chars().count()) as f64 - 1.0) * dot
}

/// A picture to draw on; (0, 0) is the outer corner of the top-left pixel.
pub(super) struct Canvas(Pixmap);

impl Canvas {
    /// An empty picture; `None` when it is empty or too large.
    pub fn new(size: [u32; 2]) -> Option<Self> {
        let mut pixmap = Pixmap::new(size[0], size[1])?;
        let Colour(r, g, b) = GROUND;
        pixmap.fill(tiny_skia::Color::from_rgba8(r, g, b, 255));
        Some(Self(pixmap))
    }

    /// Sets a pixel; those outside are ignored.
    pub fn set_grey(&mut self, x: usize, y: usize, grey: u8) {
        let at = 4 * (y * self.0.width() as usize + x);
        if let Some(pixel) = self.0.data_mut().get_mut(at..at + 4) {
            pixel.copy_from_slice(&[grey, grey, grey, 255]);
        }
    }

    /// Red, green and blue of all pixels, row by row.
    pub fn rgb(&self) -> Vec<u8> {
        self.0.data().chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect()
    }

    /// A closed curve through points.
    pub fn curve(&mut self, points: &[[f64; 2]], width: f64, colour: Colour) {
        let mut path = PathBuilder::new();
        trace(&mut path, points);
        path.close();
        self.stroke(path, width, colour);
    }

    /// A straight line.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], width: f64, colour: Colour) {
        let mut path = PathBuilder::new();
        trace(&mut path, &[from, to]);
        self.stroke(path, width, colour);
    }

    /// A line with a head.
    pub fn arrow(&mut self, from: [f64; 2], to: [f64; 2], width: f64, colour: Colour) {
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let length = dx.hypot(dy).max(1e-9);
        let (x, y) = (dx / length, dy / length);
        let head = (4.0 * width).min(length);
        let foot = [to[0] - x * head, to[1] - y * head];
        self.line(from, foot, width, colour);
        let mut path = PathBuilder::new();
        let side = 0.45 * head;
        trace(&mut path, &[to, [foot[0] - y * side, foot[1] + x * side], [foot[0] + y * side, foot[1] - x * side]]);
        path.close();
        if let Some(path) = path.finish() {
            self.0.fill_path(&path, &paint(colour, 255), FillRule::Winding, Transform::identity(), None);
        }
    }

    /// A filled rectangle.
    pub fn rectangle(&mut self, at: [f64; 2], size: [f64; 2], colour: Colour) {
        self.fill(at, size, &paint(colour, 255));
    }

    /// Text from its upper left corner; the font has capitals only.
    pub fn text(&mut self, at: [f64; 2], dot: f64, text: &str, colour: Colour) {
        self.dots(at, dot, 0.0, text, &paint(colour, 255));
    }

    /// Text that can be read on any ground.
    pub fn text_with_halo(&mut self, at: [f64; 2], dot: f64, text: &str, colour: Colour) {
        let at = at.map(f64::round);
        self.dots(at, dot, 1.0, text, &paint(Colour(255, 255, 255), 255));
        self.text(at, dot, text, colour);
    }

    fn dots(&mut self, at: [f64; 2], dot: f64, beyond: f64, text: &str, paint: &Paint) {
        for [column, row] in dots(text) {
            let x = at[0] + column as f64 * dot - beyond;
            let y = at[1] + row as f64 * dot - beyond;
            self.fill([x, y], [dot + 2.0 * beyond; 2], paint);
        }
    }

    fn fill(&mut self, at: [f64; 2], size: [f64; 2], paint: &Paint) {
        let [x, y, w, h] = [at[0], at[1], size[0], size[1]].map(|v| v as f32);
        if let Some(rect) = Rect::from_xywh(x, y, w, h) {
            self.0.fill_rect(rect, paint, Transform::identity(), None);
        }
    }

    fn stroke(&mut self, path: PathBuilder, width: f64, colour: Colour) {
        let stroke = Stroke { width: width as f32, line_cap: LineCap::Round, ..Stroke::default() };
        if let Some(path) = path.finish() {
            self.0.stroke_path(&path, &paint(colour, 255), &stroke, Transform::identity(), None);
        }
    }
}

fn trace(path: &mut PathBuilder, points: &[[f64; 2]]) {
    for (k, p) in points.iter().enumerate() {
        let [x, y] = p.map(|v| v as f32);
        if k == 0 {
            path.move_to(x, y);
        } else {
            path.line_to(x, y);
        }
    }
}

fn paint(colour: Colour, alpha: u8) -> Paint<'static> {
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color_rgba8(colour.0, colour.1, colour.2, alpha);
    paint
}
