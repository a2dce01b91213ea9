//! The sections in words and plots.

use maud::{Markup, PreEscaped, html};

use crate::identify::StartReached;
use crate::output::photogrammetry::Photogrammetry;
use crate::output::report::figures::{maps, plots};
use crate::output::report::page::figure::figure;
use crate::output::report::wording::many;
use crate::output::report::wording::words::{count, data, plus_minus, significant, unit};
use crate::output::solution_json::SolutionRecord;

/// Before and after on held-out images.
pub(in crate::output::report) fn accuracy(r: &SolutionRecord) -> Markup {
    let are_images = !r.images.is_empty();
    let rows = match r.has_no_robot() {
        true => vec![("Poses of the controller", &r.accuracy.calibrated)],
        false => vec![("Nominal robot", &r.accuracy.nominal), ("Calibrated robot", &r.accuracy.calibrated)],
    };
    let readings = if r.has_no_robot() { "poses of the controller" } else { "joint readings" };
    html! {
        @if !are_images {
            p {
                "How well do the " (readings) " alone say where the body on the tip was measured? The stops were put aside in " (r.accuracy.folds)
                " groups in turn; a model fitted to the other groups had to predict them. The error includes how well the robot repeats."
            }
        } @else { p {
            "How well do the " (readings) " alone say where the plate appears? The images were put aside in "
            (r.accuracy.folds) " groups in turn; a model fitted to the other groups had to predict them. "
            "The images look at one plate: this is no figure for the whole workspace, and smaller than what the robot is off elsewhere. "
            "In millimetres it is the distance between where the image shows the markers and where the robot model puts them; "
            "it includes how well the robot repeats. "
            @if r.beyond_urdf() { "The calibrated robot is the whole model, corrected URDF and compensation.toml together." }
        } }
        div.wide { table {
            thead { tr { th { "Model" } th.n { "error, mm RMS" } @if are_images { th.n { "in the image, px RMS" } }
                th.n { "worst, mm" } th.n { (if are_images { "images" } else { "measurements" }) } } }
            tbody { @for (name, e) in rows { tr {
                td { (name) } td.n { (significant(e.rms_mm)) } @if are_images { td.n { (significant(e.rms_px)) } }
                td.n { (significant(e.worst_mm)) } td.n { (e.images) }
            } } }
        } }
        @if let Some(svg) = plots::histogram(r).filter(|_| !r.has_no_robot()) {
            figure {
                (PreEscaped(svg))
                figcaption { span.key.before {} "nominal robot   " span.key.after {} "calibrated robot" }
            }
        }
    }
}

/// What was read, what was left out and why, and what else should be known.
pub(in crate::output::report) fn left_out(r: &SolutionRecord) -> Markup {
    if r.images.is_empty() {
        return html! { p { (r.bodies.left_out()) " of " (count(r.bodies.measurements.len(), "measurement")) " left out." } };
    }
    images_left_out(r.photogrammetry())
}

/// The same of images.
pub(in crate::output::report) fn images_left_out(r: Photogrammetry) -> Markup {
    let mut series: Vec<&str> = Vec::new();
    r.images.iter().for_each(|i| {
        if !series.contains(&i.series.as_str()) {
            series.push(&i.series)
        }
    });
    let rejected: Vec<_> = r.images.iter().filter_map(|i| i.reason.as_ref().map(|reason| (&i.name, reason))).collect();
    html! {
        div.wide { table {
            thead { tr { th { "Series" } th { "camera" } th.n { "images" } th.n { "used" } @if r.robot.is_some() { th.n { "on the robot" } } th.n { "observations" } } }
            tbody { @for name in &series { (series_row(r, name)) } }
        } }
        @if rejected.is_empty() {
            p { "Every image was used." }
        } @else {
            p { (count(rejected.len(), "image")) " left out:" }
            ul { @for (name, reason) in &rejected { li { code { (name) } " " (reason) } } }
        }
        @if r.statistics.observations_left_out > 0 {
            p {
                (count(r.statistics.observations_left_out, "single observation")) " of "
                (r.statistics.observations_left_out + r.statistics.observations_used)
                " left out because of a large residual (all are in observations.csv)."
            }
        }
    }
}

fn series_row(r: Photogrammetry, name: &str) -> Markup {
    let images = || r.images.iter().filter(|i| i.series == name);
    let used = || images().filter(|i| i.is_used());
    let observations: usize = used().map(|i| i.observations.reason.iter().filter(|o| o.is_none()).count()).sum();
    let camera = images().next().and_then(|i| r.cameras.get(i.camera)).map_or("", |c| &c.name);
    html! { tr {
        td.name { (name) } td { (camera) } td.n { (images().count()) } td.n { (used().count()) }
        @if r.robot.is_some() { td.n { (images().filter(|i| i.is_on_robot()).count()) } } td.n { (observations) }
    } }
}

/// How well each joint repeats its reading.
pub(in crate::output::report) fn joint_noise(r: &SolutionRecord) -> Markup {
    let poses = r.has_no_robot();
    let caption = match poses {
        true => "Each bar is one axis of the poses; the second number is the effect on a tool 1 m from it.",
        false => "Each bar is one joint; the second number is the effect on a tool 1 m from the axis.",
    };
    html! {
        @if poses {
            p { "How far the poses of the controller are typically off (one sigma), as the " (data(r)) " show it: errors of its own model of the robot among them." }
        } @else { p {
            "How far a joint typically stands from where its reading and the model say (one sigma), as the " (data(r)) " show it. "
            "No model can remove this part: it bounds the accuracy of a single move."
        } }
        @match plots::joint_noise(r) {
            Some(svg) => (figure(&svg, caption)),
            None => p { "The readings were taken as exact." },
        }
    }
}

/// Residual maps.
pub(in crate::output::report) fn residuals(r: Photogrammetry) -> Markup {
    if r.images.is_empty() {
        return html! {};
    }
    html! {
        p {
            "What the model leaves unexplained in the images (measured minus predicted). A healthy map looks like noise: "
            "short lines in all directions. A pattern means that the lens model or the plate does not describe what was seen."
        }
        div.pair {
            @for (k, camera) in r.cameras.iter().enumerate() {
                @if let Some(map) = maps::residuals_over_image(r, k) {
                    (figure(&map.svg, &format!("Over the image of camera {}, all images together. {}", camera.name, map.caption)))
                }
            }
            @for (k, plate) in r.plates.iter().enumerate() {
                @if let Some(map) = maps::residuals_over_plate(r, k) {
                    (figure(&map.svg, &format!("Over the plate{}, mean of all images for each marker. {}", of_several(r, &plate.name), map.caption)))
                }
            }
        }
    }
}

/// " of run1" where there are several plates.
pub(in crate::output::report) fn of_several(r: Photogrammetry, plate: &str) -> String {
    if r.plates.len() > 1 { format!(" of {plate}") } else { String::new() }
}

/// The plates as found.
pub(in crate::output::report) fn plates(r: Photogrammetry) -> Markup {
    if r.plates.is_empty() {
        return html! {};
    }
    let modes: Vec<_> = r.estimates.iter().filter(|e| e.name.starts_with("plate_shape")).collect();
    let tables = || r.files.iter().filter(|f| f.starts_with("plate") && f.ends_with(".csv"));
    html! {
        p {
            "The plate is part of what is estimated: corrected positions with sigmas are in "
            @for (k, f) in tables().enumerate() { @if k > 0 { ", " } code { (f) } } "."
        }
        @if !modes.is_empty() {
            div.wide { table {
                thead { tr { th { "Shape of the whole plate" } th.n { "estimate" } th { "unit" } th.n { "tolerance" } th.n { "share of data" } } }
                tbody { @for e in modes { @if let (Some(value), Some(sigma)) = (e.value, e.sigma) {
                    @let (factor, unit) = unit(e);
                    tr {
                        td { (crate::output::report::wording::words::parameter(&e.name)) }
                        td.n { (plus_minus(factor * value, factor * sigma)) } td { (unit) }
                        td.n { @if let Some(p) = e.prior_sigma { (significant(factor * p)) } }
                        td.n { @if let Some(s) = e.share_of_data { (format!("{:.0} %", 100.0 * s)) } }
                    }
                } } }
            } }
        }
        div.pair { @for (k, plate) in r.plates.iter().enumerate() {
            @if let Some(map) = maps::plate_corrections(r, k) {
                (figure(&map.svg, &format!("Corrected markers{} against nominal. {}", of_several(r, &plate.name), map.caption)))
            }
        } }
    }
}

/// Where the solution started.
pub(in crate::output::report) fn starts(r: Photogrammetry) -> Markup {
    let tried = || r.starts.iter().filter(|s| s.reached != StartReached::NotNeeded);
    let spared = r.starts.len() - tried().count();
    html! {
        p {
            "No guess was needed. These starts were tried; the ones in bold won."
            @if spared > 0 { " " (count(spared, "further start")) " not needed." }
        }
        div.wide.long { table {
            thead { tr { th { "Of" } th { "from" } th { "reached" } } }
            tbody { @for s in tried() { tr {
                @if s.won { td { b { (s.of) } } td { b { (s.origin) } } td { b { (s.reached.to_string()) } } }
                @else { td { (s.of) } td { (s.origin) } td { (s.reached.to_string()) } }
            } } }
        } }
    }
}

/// What is needed to repeat the result, behind what `ended` says of its end.
pub(in crate::output::report) fn record(r: Photogrammetry, ended: &str) -> Markup {
    let files = many::files(r);
    html! {
        p { code { (r.program.command) } }
        p { (r.program.name) " " (r.program.version) (ended) "." }
        @if !r.program.options.is_empty() {
            div.wide { table {
                thead { tr { th { "Option" } th { "value" } } }
                tbody { @for (name, value) in &r.program.options { tr { td { (name) } td { (value) } } } }
            } }
        }
        h3 { "Files of this result" }
        p { @for (k, f) in r.files.iter().enumerate() { @if k > 0 { ", " } code { (f) } } }
        h3 { "Files read, with SHA-256" }
        div.wide.long { table {
            thead { tr { th { "File" } th { "SHA-256" } } }
            tbody { @for f in &files { tr { td.name { code { (f.path.display()) } } td.name { code { (f.sha256) } } } } }
        } }
        @if files.len() < r.inputs.len() { p.note { "Those of all images stand in " (r.record) "." } }
    }
}
