//! Images of the series with what was measured in them: the best, the worst, and those left out.

use std::fmt::Write as _;

use maud::{Markup, PreEscaped, html};

use crate::output::photogrammetry::Photogrammetry;
use crate::output::report::figures::thumbnails::{Shown, Thumbnail, Thumbnails, data_uri, shown};
use crate::output::report::page::svg::escaped;
use crate::output::report::wording::words::{count, fixed};
use crate::output::solution_json::ImageRecord;

/// Length of a typical residual as drawn, as a share of the width of the image.
const RESIDUAL: f64 = 0.02;

/// One figure an image; nothing where the files of the images are not there.
pub(in crate::output::report) fn gallery(r: Photogrammetry, pictures: &Thumbnails) -> Markup {
    if pictures.0.is_empty() {
        return html! {};
    }
    let magnified = magnification(r);
    let of = |kind: Shown| shown(r).into_iter().filter(move |(_, k)| *k == kind).map(|(k, _)| k).collect::<Vec<_>>();
    html! {
        p.note {
            "Green: observations in use. Orange: left out. Red: residuals, " (count(magnified as usize, "time")) " their length. "
            "A good image is sharp, shows the plate large, and its residuals point in all directions."
        }
        @for (title, kind) in [("Smallest residuals", Shown::Best), ("Largest residuals", Shown::Worst), ("Left out", Shown::LeftOut)] {
            @let images: Vec<usize> = of(kind).into_iter().filter(|k| pictures.0.contains_key(k)).collect();
            @if !images.is_empty() {
                h3 { (title) }
                div.thumbs { @for k in images { @if let Some(picture) = pictures.0.get(&k) { (one(r, k, picture, magnified)) } } }
            }
        }
    }
}

/// One factor for all residuals, so that images can be compared.
fn magnification(r: Photogrammetry) -> f64 {
    let width = r.images.first().and_then(|i| r.cameras.get(i.camera)).map_or(1000.0, |c| f64::from(c.width_px));
    let factor = RESIDUAL * width / r.statistics.rms_px.max(1e-6);
    crate::output::report::page::svg::round_below(factor).max(1.0)
}

fn one(r: Photogrammetry, k: usize, picture: &Thumbnail, magnified: f64) -> Markup {
    let image = &r.images[k];
    let several = r.series.len() > 1;
    let words = match (&image.reason, image.rms_px) {
        (Some(reason), _) => reason.clone(),
        (None, Some(px)) => format!("{} px RMS, {}", fixed(px, 3), count(used(image), "observation")),
        (None, None) => String::new(),
    };
    html! {
        figure {
            (PreEscaped(drawing(image, picture, magnified)))
            figcaption { b { (image.name) } @if several { " (" (image.series) ")" } br; (words) }
        }
    }
}

fn used(image: &ImageRecord) -> usize {
    image.observations.reason.iter().filter(|o| o.is_none()).count()
}

fn drawing(image: &ImageRecord, picture: &Thumbnail, magnified: f64) -> String {
    let [w, h] = picture.size;
    let dot = w as f64 / 90.0;
    let o = &image.observations;
    let dots = |wanted: &dyn Fn(usize) -> bool| {
        let mut d = String::new();
        for uv in (0..o.uv.len()).filter(|k| wanted(*k)).map(|k| o.uv[k]) {
            // Writing to a String cannot fail.
            let _ = write!(d, "M{:.0} {:.0}h0", uv[0] + 0.5, uv[1] + 0.5);
        }
        d
    };
    let mut lines = String::new();
    for (uv, duv) in o.uv.iter().zip(&o.duv).filter_map(|(uv, duv)| Some((uv, (*duv)?))) {
        let [dx, dy] = duv.map(|d| magnified * d);
        let _ = write!(lines, "M{:.0} {:.0}l{dx:.1} {dy:.1}", uv[0] + 0.5, uv[1] + 0.5);
    }
    let in_use = image.is_used();
    let (used, out) = (dots(&|k| in_use && o.reason[k].is_none()), dots(&|k| !in_use || o.reason[k].is_some()));
    let lines = if in_use { lines } else { String::new() };
    let label = escaped(&format!("Image {} with the observations", image.name));
    let uri = data_uri(&picture.jpeg);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" aria-label=\"{label}\" viewBox=\"0 0 {w} {h}\">\
         <image href=\"{uri}\" width=\"{w}\" height=\"{h}\" preserveAspectRatio=\"none\"/>\
         <g fill=\"none\" stroke-linecap=\"round\" stroke-width=\"{dot:.1}\">\
         <path stroke=\"#00d65a\" d=\"{used}\"/><path stroke=\"#ff9500\" d=\"{out}\"/>\
         <path stroke=\"#ff2d2d\" stroke-width=\"{:.1}\" d=\"{lines}\"/></g></svg>",
        dot / 2.5
    )
}
