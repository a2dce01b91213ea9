//! The table of images.

use maud::{Markup, html};

use crate::identify::PoseSigma;
use crate::output::photogrammetry::Photogrammetry;
use crate::output::poses_record::PosesRecord;
use crate::output::report::figures::plots;
use crate::output::report::page::figure::pointed;
use crate::output::report::wording::many;
use crate::output::report::wording::words::{axes_mm, fixed};
use crate::output::solution_json::{ImageRecord, SolutionRecord};

/// One row for each image: what it contributed, how well it is predicted, why it was left out.
pub(in crate::output::report) fn table(r: &SolutionRecord) -> Markup {
    if r.images.is_empty() {
        return html! {};
    }
    let held_out: Vec<Option<f64>> = r.images.iter().map(|i| i.held_out_mm.map(|e| e[1])).collect();
    let listed = many::listed(&r.images, &held_out);
    html! {
        (bars(r.photogrammetry(), "Point at a bar, or touch it: image, pose, joints, residual."))
        p.note {
            "Observations: used of those found. Residual: RMS per point in the joint fit. Held out: how far the robot model misses the "
            "plate in an image that it had not seen, nominal and calibrated."
            (not_listed(r.photogrammetry(), listed.len()))
        }
        div.wide.long { table {
            thead { tr {
                th { "Image" } th.n { "observations" } th.n { "residual, px" } th.n { "nominal, mm" } th.n { "calibrated, mm" } th { "left out because" }
            } }
            tbody { (rows(&r.images, &listed, 6, |_, i| row(i))) }
        } }
    }
}

/// One row for each image: what it contributed, how well its pose is known, why it was left out.
pub(in crate::output::report) fn of_poses(r: &PosesRecord) -> Markup {
    let mut known: Vec<Option<&PoseSigma>> = vec![None; r.images.len()];
    r.known.iter().for_each(|sigma| known[sigma.image] = Some(sigma));
    let sigmas: Vec<Option<f64>> = known.iter().map(|k| k.map(|s| s.position_m)).collect();
    let listed = many::listed(&r.images, &sigmas);
    html! {
        (bars(r.photogrammetry(), "Point at a bar, or touch it: image, pose, residual."))
        p.note {
            "Observations: used of those found. Residual: RMS per point. Position and direction: one sigma of the camera in the frame of the plate, per axis. "
            "Semi-axes: of the ellipsoid of one sigma, of the camera, and of the plate's centre as the camera sees it. Errors of position and direction go "
            "together (correlation: the largest), so that what the camera measures of the plate is known better than where it stands."
            (not_listed(r.photogrammetry(), listed.len()))
        }
        div.wide.long { table {
            thead { tr {
                th { "Image" } th.n { "observations" } th.n { "residual, px" } th.n { "position, mm" } th.n { "direction, arcmin" }
                th.n { "semi-axes, mm:" br; "camera" } th.n { "semi-axes, mm:" br; "plate's centre" } th.n { "correlation" } th { "left out because" }
            } }
            tbody { (rows(&r.images, &listed, 9, |k, i| pose_row(i, known[k]))) }
        } }
    }
}

fn bars(p: Photogrammetry, caption: &str) -> Markup {
    html! {
        @if let Some((svg, bars)) = plots::by_image(p) {
            (pointed(&svg, caption))
            (many::note(bars, p.images.len()))
        }
    }
}

fn not_listed(p: Photogrammetry, listed: usize) -> Markup {
    html! {
        @if listed < p.images.len() {
            " Of " (p.images.len()) " images, those that were left out or fit worst; the others stand in " (p.record) "."
        }
    }
}

/// A row for each image, under the name of its series where there are several.
fn rows(
    all: &[ImageRecord],
    listed: &[(usize, &ImageRecord)],
    columns: usize,
    row: impl Fn(usize, &ImageRecord) -> Markup,
) -> Markup {
    let several = all.iter().any(|i| i.series != all[0].series);
    html! { @for (at, (k, i)) in listed.iter().enumerate() {
        @if several && (at == 0 || listed[at - 1].1.series != i.series) { tr { th colspan=(columns) { (i.series) } } }
        (row(*k, i))
    } }
}

/// Name, observations in use of those found, residual.
fn contributed(i: &ImageRecord) -> Markup {
    let found = i.observations.reason.len();
    let used = match i.reason {
        None => i.observations.reason.iter().filter(|o| o.is_none()).count(),
        Some(_) => 0,
    };
    html! {
        td.name { (i.name) }
        td.n { (used) " of " (found) }
        td.n { (number(i.rms_px)) }
    }
}

fn number(v: Option<f64>) -> String {
    v.map_or_else(|| "–".to_owned(), |v| fixed(v, 3))
}

fn row(i: &ImageRecord) -> Markup {
    html! { tr {
        (contributed(i))
        td.n { (number(i.held_out_mm.map(|e| e[0]))) }
        td.n { (number(i.held_out_mm.map(|e| e[1]))) }
        @if let Some(reason) = &i.reason { td.reason.out { (reason) } }
        @else if i.readings.is_none() { td { "taken off the robot: helps camera and plate only" } }
        @else { td {} }
    } }
}

fn pose_row(i: &ImageRecord, known: Option<&PoseSigma>) -> Markup {
    let words = |of: fn(&PoseSigma) -> String| known.map_or_else(|| "–".to_owned(), of);
    html! { tr {
        (contributed(i))
        td.n { (words(|s| fixed(1e3 * s.position_m, 4))) }
        td.n { (words(|s| fixed(60.0 * s.rotation_rad.to_degrees(), 3))) }
        td.grid { (words(|s| axes_mm(&s.camera_axes_m))) }
        td.grid { (words(|s| axes_mm(&s.centre_axes_m))) }
        td.n { (words(|s| fixed(s.correlation, 3))) }
        @if let Some(reason) = &i.reason { td.reason.out { (reason) } } @else { td {} }
    } }
}
