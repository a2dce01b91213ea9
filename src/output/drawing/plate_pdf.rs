//! The plate as PDF, 1:1.

use pdf_writer::{Content, Finish, Name, Pdf, Rect, Ref, Str};
use std::f64::consts::TAU;

use super::plate_drawing::{Caption, Figure, figures};
use crate::series::Plate;

const POINTS_PER_METRE: f64 = 72.0 / 0.0254;
/// Cubic arcs per circle: eight are within 4e-6 of the radius.
const ARCS: usize = 8;
const FONT: Name = Name(b"F1");

/// Draws the plate on one page of its sheet's size; text in Helvetica, one of the fonts that every reader has.
pub fn pdf(plate: &Plate, caption: &Caption) -> Vec<u8> {
    let [catalog, pages, page, font, content] = [1, 2, 3, 4, 5].map(Ref::new);
    let (width, height) = (caption.sheet.width_m * POINTS_PER_METRE, caption.sheet.height_m * POINTS_PER_METRE);
    let mut document = Pdf::new();
    document.catalog(catalog).pages(pages);
    document.pages(pages).kids([page]).count(1);
    let mut sheet = document.page(page);
    sheet.media_box(Rect::new(0.0, 0.0, width as f32, height as f32)).parent(pages).contents(content);
    sheet.resources().fonts().pair(FONT, font);
    sheet.finish();
    document.type1_font(font).base_font(Name(b"Helvetica"));
    let mut canvas = Canvas { content: Content::new(), middle: [width / 2.0, height / 2.0] };
    figures(plate, caption).iter().for_each(|f| canvas.draw(f));
    document.stream(content, &canvas.content.finish());
    document.finish()
}

struct Canvas {
    content: Content,
    middle: [f64; 2],
}

impl Canvas {
    fn point(&self, p: [f64; 2]) -> [f32; 2] {
        [0, 1].map(|i: usize| (p[i] * POINTS_PER_METRE + self.middle[i]) as f32)
    }

    fn draw(&mut self, figure: &Figure) {
        match figure {
            Figure::Ring { centre, outer, inner } => {
                self.circle(*centre, *outer);
                if *inner > 0.0 {
                    self.circle(*centre, *inner);
                }
                self.content.fill_even_odd();
            }
            Figure::Polygon(corners) => {
                self.outline(corners);
                self.content.fill_nonzero();
            }
            Figure::Region(outlines) => {
                outlines.iter().for_each(|outline| self.outline(outline));
                self.content.fill_even_odd();
            }
            Figure::Line { from, to, width } => {
                let ([x0, y0], [x1, y1]) = (self.point(*from), self.point(*to));
                self.content.set_line_width((width * POINTS_PER_METRE) as f32);
                self.content.move_to(x0, y0).line_to(x1, y1).stroke();
            }
            Figure::Text { at, height, text } => {
                let size = height * POINTS_PER_METRE / CAP_HEIGHT;
                let start = [at[0] - width_of(text) * height / CAP_HEIGHT / 2.0, at[1]];
                let [x, y] = self.point(start);
                self.content.begin_text().set_font(FONT, size as f32).next_line(x, y);
                self.content.show(Str(text.as_bytes())).end_text();
            }
        }
    }

    fn outline(&mut self, corners: &[[f64; 2]]) {
        for (k, &corner) in corners.iter().enumerate() {
            let [x, y] = self.point(corner);
            if k == 0 {
                self.content.move_to(x, y)
            } else {
                self.content.line_to(x, y)
            };
        }
        self.content.close_path();
    }

    fn circle(&mut self, centre: [f64; 2], radius: f64) {
        let step = TAU / ARCS as f64;
        let handle = 4.0 / 3.0 * (step / 4.0).tan();
        let at = |angle: f64, along: f64| {
            let (s, c) = angle.sin_cos();
            [centre[0] + radius * (c - along * s), centre[1] + radius * (s + along * c)]
        };
        let [x, y] = self.point(at(0.0, 0.0));
        self.content.move_to(x, y);
        for k in 0..ARCS {
            let (a, b) = (k as f64 * step, (k as f64 + 1.0) * step);
            let [[x1, y1], [x2, y2], [x3, y3]] = [at(a, handle), at(b, -handle), at(b, 0.0)].map(|p| self.point(p));
            self.content.cubic_to(x1, y1, x2, y2, x3, y3);
        }
        self.content.close_path();
    }
}

/// Height of a capital of Helvetica in units of the font size.
const CAP_HEIGHT: f64 = 0.72;

/// Width of a text in units of the font size, good enough for centring.
fn width_of(text: &str) -> f64 {
    let width = |c: char| match c {
        ' ' | '.' | ',' | 'i' | 'l' | 'j' | 't' | 'f' | ':' => 0.28,
        'm' | '%' | 'M' | 'W' => 0.85,
        'A'..='Z' | 'w' => 0.68,
        _ => 0.55,
    };
    text.chars().map(width).sum()
}
