//! Drawings of a plate: exact millimetres in PDF and SVG, and a PNG for looking at it.
//!
//! The drawing is first a list of `Figure`s in metres (origin at the sheet's centre, x right, y up), then written by one file
//! per format. Everything but markers stays outside the quiet field, a pitch away from the outermost markers.
//!
//! Detectors that take each compact dark spot for a dot, as OpenCV's of blobs, must find none beside the markers: text stands on a line that
//! joins its letters, arrows are open, and nothing short stands alone.

use crate::plan::plate_design::{Sheet, quiet_field_m};
use crate::series::{Ink, Plate, Region, regions};

pub use super::plate_pdf::pdf;
pub use super::plate_png::png;
pub use super::plate_svg::svg;

/// What stands beside the markers.
#[derive(Debug, Clone, PartialEq)]
pub struct Caption {
    /// Name of the plate.
    pub name: String,
    /// The sheet to draw on.
    pub sheet: Sheet,
}

/// One thing to draw, black on white; lengths in m.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Figure {
    /// A disc, or an annulus when the inner radius is positive.
    Ring { centre: [f64; 2], outer: f64, inner: f64 },
    /// A filled polygon.
    Polygon(Vec<[f64; 2]>),
    /// A dark polygon with light ones within it.
    Region(Region),
    /// A straight line.
    Line { from: [f64; 2], to: [f64; 2], width: f64 },
    /// A line of text; `at` is the middle of its baseline.
    Text { at: [f64; 2], height: f64, text: String },
}

const LINE: f64 = 0.0002;
const TEXT: f64 = 0.0028;
/// Width of a line that joins letters: more than that of their strokes, so that it is seen wherever they are.
const RULE: f64 = 0.0006;
/// Half of the advance of a letter in the widest font, a dot font of 7 rows.
const HALF_LETTER: f64 = 3.0 / 7.0 * TEXT;
/// Of the bar below the quiet field, and of the lines of text.
const ROOMY: Below = Below { bar: 0.0045, text: 0.0105, step: 1.5 * TEXT };
/// The same where the sheet leaves little room: the text just clears the ticks of the bar.
const TIGHT: Below = Below { bar: 0.0032, text: 0.0088, step: 1.15 * TEXT };
/// Printers leave out what is nearer to the edge of the sheet.
const EDGE: f64 = 0.005;

/// How far what is said lies below the quiet field, m.
#[derive(Debug, Clone, Copy)]
struct Below {
    bar: f64,
    /// The first line.
    text: f64,
    /// From line to line.
    step: f64,
}

impl Below {
    /// As roomy as the strip below the field allows.
    fn of(room: f64) -> Self {
        let [roomy, tight] = [ROOMY, TIGHT].map(|below| below.text + below.step + EDGE);
        let share = ((room - tight) / (roomy - tight)).clamp(0.0, 1.0);
        let between = |pick: fn(&Self) -> f64| pick(&TIGHT) + share * (pick(&ROOMY) - pick(&TIGHT));
        Self { bar: between(|b| b.bar), text: between(|b| b.text), step: between(|b| b.step) }
    }
}

/// All figures of a plate on its sheet.
pub(super) fn figures(plate: &Plate, caption: &Caption) -> Vec<Figure> {
    let mut all = marks(plate);
    let quiet = quiet_field_m(plate);
    let half = [caption.sheet.width_m / 2.0, caption.sheet.height_m / 2.0];
    let below = Below::of(half[1] - quiet[1]);
    axes(quiet, half, below.bar, &mut all);
    let bottom = -quiet[1];
    let line = |k: f64| [0.0, bottom - below.text - k * below.step];
    let tens = bar_tens(half[0]);
    scale_bar(bottom - below.bar, tens, &mut all);
    ruled_text(line(0.0), half[0], &format!("{}.", caption.name), &mut all);
    ruled_text(line(1.0), half[0], &advice(&caption.sheet, tens), &mut all);
    all
}

fn advice(sheet: &Sheet, tens: u32) -> String {
    let size = format!("{:.0} x {:.0} mm", sheet.width_m * 1e3, sheet.height_m * 1e3);
    let paper = sheet.paper.map_or(size.clone(), |p| format!("{p} ({size})"));
    format!("Print in full size on {paper}, the bar must be {} mm.", tens * 10)
}

/// The printed field itself.
fn marks(plate: &Plate) -> Vec<Figure> {
    if plate.kind.print().ink == Ink::Squares {
        return squares(plate);
    }
    // whoever draws has asked before whether the dictionary has these tags
    let regions = regions(plate).unwrap_or_default();
    if !regions.is_empty() {
        return regions.into_iter().map(Figure::Region).collect();
    }
    let ring = |m: &crate::series::Marker| Figure::Ring {
        centre: [m.position_m.x, m.position_m.y],
        outer: m.outer_radius_m,
        inner: m.inner_radius_m,
    };
    plate.markers.iter().filter(|m| m.outer_radius_m > 0.0).map(ring).collect()
}

/// Dark squares around the inner corners, the one at the top-left dark.
fn squares(plate: &Plate) -> Vec<Figure> {
    let (columns, rows) = (plate.columns + 1, plate.rows + 1);
    let at = |r: u32, c: u32| {
        let x = (f64::from(c) - f64::from(columns) / 2.0) * plate.pitch_m;
        [x, (f64::from(rows) / 2.0 - f64::from(r)) * plate.pitch_m]
    };
    let square = |k: u32| {
        let (r, c) = (k / columns, k % columns);
        ((r + c) % 2 == 0).then(|| Figure::Polygon(vec![at(r, c), at(r, c + 1), at(r + 1, c + 1), at(r + 1, c)]))
    };
    (0..columns * rows).filter_map(square).collect()
}

/// Marks on all four sides that point at the origin, arrows where the axes leave the field.
fn axes(quiet: [f64; 2], half: [f64; 2], bar_below: f64, all: &mut Vec<Figure>) {
    let along = (half[0] - quiet[0] - EDGE - 0.003).clamp(0.004, 0.008);
    let up = (half[1] - quiet[1] - EDGE - 0.0005 - TEXT).clamp(0.004, 0.010);
    let (x, y) = (quiet[0] + along, quiet[1] + up);
    let mut line = |from, to| all.push(Figure::Line { from, to, width: LINE });
    line([-x, 0.0], [-quiet[0], 0.0]);
    line([quiet[0], 0.0], [x, 0.0]);
    line([0.0, -quiet[1] - bar_below], [0.0, -quiet[1]]);
    line([0.0, quiet[1]], [0.0, y]);
    for side in [-0.001, 0.001] {
        line([x - 0.003, side], [x, 0.0]);
        line([side, y - 0.003], [0.0, y]);
    }
    text([x + 0.0015, 0.0], "x", all);
    text([0.0, y + 0.0005], "y", all);
}

/// Length of the bar, 10 mm.
fn bar_tens(half_width: f64) -> u32 {
    if half_width > 0.075 { 10 } else { 5 }
}

/// A bar with a tick every 10 mm.
fn scale_bar(y: f64, tens: u32, all: &mut Vec<Figure>) {
    let half = f64::from(tens) * 0.005;
    all.push(Figure::Line { from: [-half, y], to: [half, y], width: LINE });
    for k in 0..=tens {
        let x = -half + f64::from(k) * 0.01;
        let tick = if k == 0 || k == tens { 0.0025 } else { 0.0012 };
        all.push(Figure::Line { from: [x, y - tick], to: [x, y + tick], width: LINE });
    }
}

/// A line of text on a line that joins its letters, as far as the sheet reaches: a dash, which does not reach down to it, is left out.
fn ruled_text(at: [f64; 2], half_width: f64, line: &str, all: &mut Vec<Figure>) {
    let half = (HALF_LETTER * line.len() as f64).min(half_width - EDGE);
    all.push(Figure::Line { from: [at[0] - half, at[1]], to: [at[0] + half, at[1]], width: RULE });
    text(at, &line.replace('-', " "), all);
}

fn text(at: [f64; 2], text: &str, all: &mut Vec<Figure>) {
    all.push(Figure::Text { at, height: TEXT, text: text.to_owned() });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::plate_design::{PlateRequest, design};
    use crate::series::parse_plate;
    use std::path::Path;

    fn small() -> (Plate, Caption) {
        let made = design(&PlateRequest { shape: Some((9, 7)), ..PlateRequest::default() }).unwrap();
        (made.plate, Caption { name: "test".to_owned(), sheet: made.sheet })
    }

    #[test]
    fn nothing_but_markers_lies_in_the_quiet_field_and_all_lies_on_the_sheet() {
        for shape in [(9, 7), (28, 18), (5, 4)] {
            let made = design(&PlateRequest { shape: Some(shape), ..PlateRequest::default() }).unwrap();
            let caption = Caption { name: "a name of usual length".to_owned(), sheet: made.sheet };
            let quiet = quiet_field_m(&made.plate);
            let in_field = |p: &[f64; 2]| p[0].abs() < quiet[0] - 1e-9 && p[1].abs() < quiet[1] - 1e-9;
            let on_sheet = |p: &[f64; 2]| {
                p[0].abs() < made.sheet.width_m / 2.0 - 0.003 && p[1].abs() < made.sheet.height_m / 2.0 - 0.003
            };
            for figure in figures(&made.plate, &caption) {
                let corners = match figure {
                    Figure::Ring { .. } | Figure::Region(_) => continue,
                    Figure::Polygon(corners) => corners,
                    Figure::Line { from, to, .. } => vec![from, to],
                    // Helvetica is about half as wide as high on average.
                    Figure::Text { at, height, text } => {
                        let w = 0.25 * height * text.len() as f64 / 0.72;
                        vec![[at[0] - w, at[1]], [at[0] + w, at[1] + height]]
                    }
                };
                assert!(corners.iter().all(|p| !in_field(p)), "{shape:?} {corners:?}");
                assert!(corners.iter().all(on_sheet), "{shape:?} {corners:?} {:?}", made.sheet);
            }
        }
    }

    /// Printers leave out some millimetres at the edge: 17 mm below the field are enough for the lines of text.
    #[test]
    fn text_keeps_five_millimetres_from_the_edge() {
        let plate = Plate::lattice(crate::series::PlateKind::Chessboard, 9, 6, 0.02, 1e-4);
        let quiet = quiet_field_m(&plate);
        for room in [0.0171, 0.0175, 0.019, 0.025] {
            let sheet = Sheet::of_size([2.0 * (quiet[0] + 0.013), 2.0 * (quiet[1] + room)]);
            let half = [sheet.width_m / 2.0, sheet.height_m / 2.0];
            let all = figures(&plate, &Caption { name: "a name".to_owned(), sheet });
            let lines = all.iter().filter_map(|figure| match figure {
                Figure::Text { at, height, .. } => Some((*at, *height)),
                _ => None,
            });
            for ([x, y], height) in lines {
                let free = [half[0] - x.abs() - HALF_LETTER, half[1] + y, half[1] - y - height];
                assert!(free.iter().all(|room| *room > EDGE - 1e-9), "{room}: {x} {y} {free:?}");
            }
        }
    }

    /// Rows of an asymmetric grid are twice as long as their dots are many.
    #[test]
    fn an_asymmetric_grid_lies_on_its_sheet_with_all_else_beside_it() {
        for (columns, rows, pitch_m) in [(4, 11, 0.02), (4, 7, 0.02), (6, 11, 0.02), (10, 5, 0.015)] {
            let toml = format!(
                "format = 1\nkind = \"circle-grid\"\ncolumns = {columns}\nrows = {rows}\npitch_m = {pitch_m}\nasymmetric = true\nradius_m = 0.004\n"
            );
            let plate = parse_plate(Path::new("plate.toml"), &toml, "").unwrap();
            let sheet = Sheet::fitting(&plate);
            let half = [sheet.width_m / 2.0, sheet.height_m / 2.0];
            let mut dots = Vec::new();
            let mut beside = Vec::new();
            for figure in figures(&plate, &Caption { name: "dots".to_owned(), sheet }) {
                match figure {
                    Figure::Ring { centre, outer, .. } => {
                        assert!((0..2).all(|k| centre[k].abs() + outer + pitch_m <= half[k]), "{columns} {centre:?}");
                        dots.push(centre);
                    }
                    Figure::Polygon(corners) => beside.extend(corners),
                    Figure::Line { from, to, .. } => beside.extend([from, to]),
                    Figure::Text { at, .. } => beside.push(at),
                    Figure::Region(_) => {}
                }
            }
            assert_eq!(dots.len(), columns * rows);
            let nearest =
                |p: &[f64; 2]| dots.iter().map(|c| (c[0] - p[0]).hypot(c[1] - p[1])).fold(f64::INFINITY, f64::min);
            assert!(beside.iter().all(|p| nearest(p) > pitch_m), "{columns} x {rows}");
            assert!(beside.iter().all(|p| (0..2).all(|k| p[k].abs() <= half[k])), "{columns} x {rows}");
        }
    }

    #[test]
    fn svg_states_every_marker_in_millimetres() {
        let (plate, caption) = small();
        let text = String::from_utf8(svg(&plate, &caption)).unwrap();
        let document = roxmltree::Document::parse(&text).unwrap();
        assert_eq!(document.root_element().attribute("width"), Some("297mm"));
        assert_eq!(document.root_element().attribute("viewBox"), Some("-148.5 -105 297 210"));
        let rings: Vec<_> = document.descendants().filter(|n| n.has_tag_name("circle")).collect();
        assert_eq!(rings.len(), plate.markers.len());
        let first = |name: &str| rings[0].attribute(name).unwrap().parse::<f64>().unwrap();
        assert!((first("cx") + 72.0).abs() < 1e-9 && (first("cy") + 54.0).abs() < 1e-9);
    }

    #[test]
    fn png_is_dark_on_every_marker_and_has_the_size_asked_for() {
        let (plate, caption) = small();
        let bytes = png(&plate, &caption, 150.0).unwrap();
        let image = image::load_from_memory(&bytes).unwrap().into_luma8();
        assert_eq!(
            image.dimensions(),
            ((0.297 / 0.0254 * 150.0_f64).round() as u32, (0.210 / 0.0254 * 150.0_f64).round() as u32)
        );
        let at = |x: f64, y: f64| {
            let px = |v: f64, size: f64| ((v + size / 2.0) / 0.0254 * 150.0) as u32;
            image.get_pixel(px(x, 0.297), px(-y, 0.210)).0[0]
        };
        for m in &plate.markers {
            let (x, y) = (m.position_m.x, m.position_m.y);
            assert_eq!(at(x, y) > 128, m.inner_radius_m > 0.0, "{}", m.id);
            assert_eq!(at(x + (m.outer_radius_m + m.inner_radius_m) / 2.0, y), 0);
            assert_eq!(at(x + 0.009, y + 0.009), 255);
        }
    }

    /// Kind and content of the chunks of a PNG file.
    fn chunks(png: &[u8]) -> Vec<(&[u8], &[u8])> {
        let (mut all, mut at) = (Vec::new(), 8);
        while at < png.len() {
            let number = |at: usize| u32::from_be_bytes(png[at..at + 4].try_into().unwrap());
            let end = at + 8 + number(at) as usize;
            assert_eq!(number(end), crc32fast::hash(&png[at + 4..end]));
            all.push((&png[at + 4..at + 8], &png[at + 8..end]));
            at = end + 4;
        }
        all
    }

    #[test]
    fn png_states_the_resolution_with_which_it_is_drawn() {
        let (plate, caption) = small();
        for (dpi, per_metre) in [(100.0, 3937_u32), (150.0, 5906), (254.0, 10_000)] {
            let bytes = png(&plate, &caption, dpi).unwrap();
            let all = chunks(&bytes);
            let place = all.iter().position(|(kind, _)| *kind == b"pHYs").unwrap();
            let pixels = all.iter().position(|(kind, _)| *kind == b"IDAT").unwrap();
            assert!(place < pixels && all.iter().filter(|(kind, _)| *kind == b"pHYs").count() == 1);
            let stated = per_metre.to_be_bytes();
            assert_eq!(all[place].1, [stated.as_slice(), &stated, &[1]].concat());
            let (width, height) = image::load_from_memory(&bytes).unwrap().into_luma8().dimensions();
            for (pixels, metres) in [(width, 0.297), (height, 0.210)] {
                assert!((f64::from(pixels) / f64::from(per_metre) - metres).abs() <= 0.5 / f64::from(per_metre));
            }
        }
    }

    #[test]
    fn pdf_page_is_the_sheet_to_a_micrometre() {
        let (plate, caption) = small();
        let bytes = pdf(&plate, &caption);
        let text = String::from_utf8_lossy(&bytes);
        let from = text.find("/MediaBox [").unwrap() + 11;
        let numbers: Vec<f64> =
            text[from..from + text[from..].find(']').unwrap()].split_whitespace().map(|n| n.parse().unwrap()).collect();
        assert!((numbers[2] / 72.0 * 25.4 - 297.0).abs() < 1e-3 && (numbers[3] / 72.0 * 25.4 - 210.0).abs() < 1e-3);
    }
}
