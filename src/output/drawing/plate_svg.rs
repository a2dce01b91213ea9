//! The plate as SVG, one user unit for each millimetre.

use std::fmt::Write;

use super::plate_drawing::{Caption, Figure, figures};
use crate::series::Plate;

/// Draws the plate on its sheet; y of the drawing points down, as SVG has it.
pub fn svg(plate: &Plate, caption: &Caption) -> Vec<u8> {
    let (w, h) = (mm(caption.sheet.width_m), mm(caption.sheet.height_m));
    let (left, top) = (mm(-caption.sheet.width_m / 2.0), mm(-caption.sheet.height_m / 2.0));
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}mm\" height=\"{h}mm\" viewBox=\"{left} {top} {w} {h}\">\n\
         <rect x=\"{left}\" y=\"{top}\" width=\"{w}\" height=\"{h}\" fill=\"white\"/>\n"
    );
    for figure in figures(plate, caption) {
        out.push_str(&element(&figure));
    }
    out.push_str("</svg>\n");
    out.into_bytes()
}

/// Millimetres to the nanometre, without trailing zeros.
fn mm(metres: f64) -> f64 {
    (metres * 1e9).round() / 1e6
}

fn element(figure: &Figure) -> String {
    match figure {
        Figure::Ring { centre: [x, y], outer, inner } if *inner > 0.0 => {
            let (radius, width) = (mm((outer + inner) / 2.0), mm(outer - inner));
            let place = format!("<circle cx=\"{}\" cy=\"{}\" r=\"{radius}\"", mm(*x), mm(-*y));
            format!("{place} fill=\"none\" stroke=\"black\" stroke-width=\"{width}\"/>\n")
        }
        Figure::Ring { centre: [x, y], outer, .. } => {
            format!("<circle cx=\"{}\" cy=\"{}\" r=\"{}\"/>\n", mm(*x), mm(-*y), mm(*outer))
        }
        Figure::Polygon(corners) => {
            let mut points = String::new();
            for [x, y] in corners {
                let _ = write!(points, "{},{} ", mm(*x), mm(-*y));
            }
            format!("<polygon points=\"{}\"/>\n", points.trim_end())
        }
        Figure::Region(outlines) => {
            let mut path = String::new();
            for outline in outlines {
                for (k, [x, y]) in outline.iter().enumerate() {
                    let _ = write!(path, "{}{},{} ", if k == 0 { "M" } else { "L" }, mm(*x), mm(-*y));
                }
                path.push_str("Z ");
            }
            format!("<path fill-rule=\"evenodd\" d=\"{}\"/>\n", path.trim_end())
        }
        Figure::Line { from: [x1, y1], to: [x2, y2], width } => format!(
            "<line x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\" stroke=\"black\" stroke-width=\"{}\"/>\n",
            mm(*x1),
            mm(-*y1),
            mm(*x2),
            mm(-*y2),
            mm(*width)
        ),
        Figure::Text { at: [x, y], height, text } => format!(
            "<text x=\"{}\" y=\"{}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"{}\" text-anchor=\"middle\">{}</text>\n",
            mm(*x),
            mm(-*y),
            mm(height / 0.72),
            escaped(text)
        ),
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
