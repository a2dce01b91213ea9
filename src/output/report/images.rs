//! The table of images.

use maud::{Markup, html};

use super::figure::pointed;
use super::many;
use super::plots;
use super::words::fixed;
use crate::output::solution_json::{ImageRecord, SolutionRecord};

/// One row for each image: what it contributed, how well it is predicted, why it was left out.
pub(super) fn table(r: &SolutionRecord) -> Markup {
    if r.images.is_empty() {
        return html! {};
    }
    let several = r.images.iter().any(|i| i.series != r.images[0].series);
    let listed = many::listed(r);
    html! {
        @if let Some((svg, bars)) = plots::by_image(r) {
            (pointed(&svg, "Point at a bar, or touch it: image, pose, joints, residual."))
            (many::note(bars, r.images.len()))
        }
        p.note {
            "Markers: used of those found. Residual: RMS per point in the joint fit. Held out: how far the robot model misses the "
            "plate in an image that it had not seen, nominal and calibrated."
            @if listed.len() < r.images.len() {
                " Of " (r.images.len()) " images, those that were left out or fit worst; the others stand in solution.json."
            }
        }
        div.wide.long { table {
            thead { tr {
                th { "Image" } th.n { "markers" } th.n { "residual, px" } th.n { "nominal, mm" } th.n { "calibrated, mm" } th { "left out because" }
            } }
            tbody { @for (k, i) in listed.iter().enumerate() {
                @if several && (k == 0 || listed[k - 1].series != i.series) { tr { th colspan="6" { (i.series) } } }
                (row(i))
            } }
        } }
    }
}

fn row(i: &ImageRecord) -> Markup {
    let found = i.observations.reason.len();
    let used = match i.reason {
        None => i.observations.reason.iter().filter(|o| o.is_none()).count(),
        Some(_) => 0,
    };
    let number = |v: Option<f64>| v.map_or_else(|| "–".to_owned(), |v| fixed(v, 3));
    html! { tr {
        td.name { (i.name) }
        td.n { (used) " of " (found) }
        td.n { (number(i.rms_px)) }
        td.n { (number(i.held_out_mm.map(|e| e[0]))) }
        td.n { (number(i.held_out_mm.map(|e| e[1]))) }
        @if let Some(reason) = &i.reason { td.reason.out { (reason) } }
        @else if i.readings.is_none() { td { "taken off the robot: helps camera and plate only" } }
        @else { td {} }
    } }
}
