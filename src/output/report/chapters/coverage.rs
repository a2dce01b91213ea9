//! What the stops covered: the range of every joint, and the image of every camera.

use std::collections::BTreeSet;

use maud::{Markup, html};

use crate::output::photogrammetry::Photogrammetry;
use crate::output::report::page::figure::pointed;
use crate::output::report::page::svg::{Anchor, Svg};
use crate::output::report::wording::describe::name;
use crate::output::report::wording::words::fixed;
use crate::output::solution_json::{ImageRecord, SolutionRecord};
use crate::urdf::JointKind;

const WIDTH: f64 = 640.0;
/// Stops of which those in one place of the drawing are one dot.
const MANY: usize = 400;
/// Columns of the picture of the image.
const COLUMNS: usize = 20;

const SEEN_EVERYWHERE: &str = "Markers should have been seen everywhere in the image, the corners too.";

/// Both.
pub(in crate::output::report) fn section(r: &SolutionRecord) -> Markup {
    if r.has_no_robot() {
        return of_images(r.photogrammetry());
    }
    html! {
        p {
            "Each dot is the reading of a joint at a stop, within the limits of the joint. What no stop covered is extrapolated. "
            @if !r.images.is_empty() { (SEEN_EVERYWHERE) }
        }
        @if let Some(svg) = joints(r) { (pointed(&svg, "Readings of every joint; the bar is its range by the URDF.")) }
        (fields(r.photogrammetry()))
    }
}

/// That of images alone.
pub(in crate::output::report) fn of_images(p: Photogrammetry) -> Markup {
    html! {
        p { (SEEN_EVERYWHERE) }
        (fields(p))
    }
}

fn fields(p: Photogrammetry) -> Markup {
    html! {
        div.pair { @for k in 0..p.cameras.len() { @if let Some(svg) = field(p, k) {
            (pointed(&svg, &format!("Observations in use over the image of camera {}; darker: more of them.", p.cameras[k].name)))
        } } }
    }
}

/// A stop of the robot, as it is drawn.
struct Stop<'a> {
    name: String,
    readings: &'a [f64],
    is_gone: bool,
}

/// Those of images, then those of series without images.
fn stops(r: &SolutionRecord) -> impl Iterator<Item = Stop<'_>> {
    let of_image = |i: &'_ ImageRecord| (name(r.photogrammetry(), i), !i.is_used());
    let images = r.images.iter().filter_map(move |i| Some((of_image(i), i.readings.as_deref()?)));
    let bodies = r.bodies.stops.iter().filter_map(|s| Some(((s.name.clone(), false), s.readings.as_deref()?)));
    images.chain(bodies).map(|((name, is_gone), readings)| Stop { name, readings, is_gone })
}

/// Range that is drawn of a reading: its limits, widened to what was read.
fn range(r: &SolutionRecord, reading: usize) -> (f64, f64) {
    let name = &r.robot.readings[reading];
    let joint = r.robot.joints.iter().find(|j| j.drive.as_ref().is_some_and(|(of, ..)| of == name));
    let (low, high) = joint.and_then(|j| j.limits).unwrap_or((-std::f64::consts::PI, std::f64::consts::PI));
    let read = || stops(r).map(|stop| stop.readings[reading]);
    (read().fold(low, f64::min), read().fold(high, f64::max))
}

fn joints(r: &SolutionRecord) -> Option<String> {
    let names = &r.robot.readings;
    if names.is_empty() || stops(r).next().is_none() {
        return None;
    }
    let are_many = stops(r).count() > MANY;
    let (left, row) = (130.0, 34.0);
    let reach = WIDTH - left - 12.0;
    let mut svg = Svg::new(WIDTH, row * names.len() as f64 + 8.0, "Readings of every joint within its range");
    for (k, joint) in names.iter().enumerate() {
        let top = 4.0 + row * k as f64;
        let (low, high) = range(r, k);
        let x = |q: f64| left + reach * (q - low) / (high - low).max(1e-9);
        let shown = |q: f64| match r.robot.reading_kinds[k] {
            JointKind::Prismatic => format!("{} mm", fixed(1e3 * q, 0)),
            _ => format!("{}°", fixed(q.to_degrees(), 0)),
        };
        svg.text([left - 8.0, top + 12.0], Anchor::End, &joint.chars().take(18).collect::<String>());
        svg.rect([left, top], [reach, 16.0], "span");
        let mut drawn = BTreeSet::new();
        for stop in stops(r) {
            let place = (x(stop.readings[k]).round() as i64, stop.is_gone);
            if !drawn.insert(place) && are_many {
                continue;
            }
            let (q, class) = (stop.readings[k], if stop.is_gone { "gone" } else { "stop" });
            svg.titled(&format!("{}: {joint} {}", stop.name, shown(q)), |svg| {
                svg.circle([x(q), top + 8.0], 4.0, class);
            });
        }
        svg.text([left, top + 28.0], Anchor::Start, &shown(low));
        svg.text([left + reach, top + 28.0], Anchor::End, &shown(high));
    }
    Some(svg.finish())
}

fn field(r: Photogrammetry, camera: usize) -> Option<String> {
    let c = &r.cameras[camera];
    let size = [f64::from(c.width_px), f64::from(c.height_px)];
    let rows = ((COLUMNS as f64 * size[1] / size[0]).round() as usize).clamp(2, 40);
    let cells = [COLUMNS, rows];
    let mut counts = vec![0usize; COLUMNS * rows];
    for (uv, _) in r.seen_by(camera) {
        let cell = |k: usize| ((uv[k] + 0.5) / size[k] * cells[k] as f64).clamp(0.0, cells[k] as f64 - 1.0) as usize;
        counts[cell(1) * COLUMNS + cell(0)] += 1;
    }
    let most = counts.iter().copied().max().filter(|most| *most > 0)? as f64;
    let height = 420.0 * size[1] / size[0];
    let step = [420.0 / COLUMNS as f64, height / rows as f64];
    let mut svg = Svg::new(420.0, height, &format!("Observations over the image of camera {}", c.name));
    svg.rect([0.0; 2], [420.0, height], "frame");
    for (k, n) in counts.iter().enumerate() {
        let at = [(k % COLUMNS) as f64 * step[0], (k / COLUMNS) as f64 * step[1]];
        let class =
            ["h0", "h1", "h2", "h3", "h4"][if *n == 0 { 0 } else { 1 + ((3.99 * *n as f64 / most) as usize).min(3) }];
        svg.titled(&format!("{n} observations"), |svg| svg.rect(at, step, class));
    }
    Some(svg.finish())
}
