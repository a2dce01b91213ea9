//! Parameters: robot, cameras, poses; what the data do not determine.

use std::collections::BTreeMap;

use maud::{Markup, html};

use crate::geom::Pose;
use crate::output::parameter_words::{grouped, split};
use crate::output::photogrammetry::Photogrammetry;
use crate::output::report::figures::maps;
use crate::output::report::page::figure::figure;
use crate::output::report::wording::words::{fixed, is_local, parameter, plus_minus, short, significant, unit};
use crate::output::solution_json::{EstimateRecord, PlacedRecord, SolutionRecord};
use crate::series::CameraMount;

/// Most corrections in the list of the strongest.
const MOST_CORRECTIONS: usize = 12;

/// Corrections of the robot; nothing where poses of the controller are all that is known of it.
pub(in crate::output::report) fn robot(r: &SolutionRecord) -> Markup {
    if r.has_no_robot() {
        return html! {};
    }
    let strongest = strongest(r);
    html! {
        h3 { "The corrections that are surest to be real" }
        @if strongest.is_empty() {
            p { "No correction is larger than three times its sigma." }
        } @else {
            div.wide { table {
                thead { tr { th { "Parameter" } th.n { "correction" } th { "unit" } th.n { "times its sigma" } } }
                tbody { @for (e, value, sigma) in strongest {
                    @let (factor, unit) = unit(e);
                    tr {
                        td { (parameter(&e.name)) } td.n { (plus_minus(factor * value, factor * sigma)) }
                        td { (unit) } td.n { (format!("{:.0}", (value / sigma).abs())) }
                    }
                } }
            } }
        }
        h3 { "All corrections" }
        p.note {
            "Estimate ± sigma. The bar says how much of it the data decided: full, they decided alone; "
            "empty, they said nothing and the parameter stays at its nominal value within the tolerance stated in the head."
        }
        (grid(r, "Joint origin", |block, _| block.strip_suffix("/origin")))
        (grid(r, "Joint", |block, c| other(block, !c.contains('_'))))
        (grid(r, "Gear harmonics of the reading q", |block, c| other(block, c.starts_with("cos_") || c.starts_with("sin_"))))
        (grid(r, "Sag under gravity", |block, c| other(block, c.starts_with("gravity_"))))
        (local_errors(r))
    }
}

/// Local errors of the joints, summed up: they are noise of the series.
fn local_errors(r: &SolutionRecord) -> Markup {
    let mut rows: Vec<(&str, Vec<f64>)> = Vec::new();
    for t in &r.robot.local_errors {
        match rows.iter_mut().find(|(joint, _)| *joint == t.reading) {
            Some((_, values)) => values.push(t.value),
            None => rows.push((&t.reading, vec![t.value])),
        }
    }
    let rms = |v: &[f64]| (v.iter().map(|x| x * x).sum::<f64>() / v.len().max(1) as f64).sqrt();
    let largest = |v: &[f64]| v.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    html! { @if !rows.is_empty() {
        h3 { "Local errors of the joints" }
        p.note {
            "What a joint was off by, again and again, at readings that several stops have in common. It is noise of this series, as far as it repeats: "
            "in none of the files, and in no stated pose of the flange."
        }
        div.wide { table {
            thead { tr { th { "Joint" } th.n { "readings" } th.n { "RMS, mrad (mm)" } th.n { "largest, mrad (mm)" } } }
            tbody { @for (joint, values) in &rows { tr {
                td { (joint) } td.n { (values.len()) } td.n { (significant(1e3 * rms(values))) } td.n { (significant(1e3 * largest(values))) }
            } } }
        } }
    } }
}

/// The joint of a block that is not its origin.
fn other(block: &str, wanted: bool) -> Option<&str> {
    (wanted && !block.ends_with("/origin")).then_some(block)
}

fn known(e: &EstimateRecord) -> Option<(f64, f64)> {
    e.value.zip(e.sigma).filter(|(_, sigma)| *sigma > 0.0)
}

fn strongest(r: &SolutionRecord) -> Vec<(&EstimateRecord, f64, f64)> {
    let of_robot = r.estimates.iter().filter(|e| e.name.starts_with("robot/") && !is_local(&e.name));
    let mut all: Vec<_> = of_robot.filter_map(|e| known(e).map(|(v, s)| (e, v, s))).collect();
    all.retain(|(_, value, sigma)| value.abs() > 3.0 * sigma);
    all.sort_by(|a, b| (b.1 / b.2).abs().total_cmp(&(a.1 / a.2).abs()));
    all.truncate(MOST_CORRECTIONS);
    all
}

/// Blocks of the robot as rows, components as columns.
fn grid<'a>(r: &'a SolutionRecord, head: &str, row: impl Fn(&'a str, &'a str) -> Option<&'a str>) -> Markup {
    let mut rows: Vec<(&str, BTreeMap<&str, &EstimateRecord>)> = Vec::new();
    let mut columns: Vec<&EstimateRecord> = Vec::new();
    for e in r.estimates.iter().filter(|e| !is_local(&e.name)) {
        let Some((block, component)) = e.name.strip_prefix("robot/").map(split) else { continue };
        let Some(name) = row(block, component) else { continue };
        match rows.iter_mut().find(|(n, _)| *n == name) {
            Some((_, cells)) => {
                cells.insert(component, e);
            }
            None => rows.push((name, BTreeMap::from([(component, e)]))),
        }
        if !columns.iter().any(|c| component_of(c) == component) {
            columns.push(e);
        }
    }
    if rows.is_empty() {
        return html! {};
    }
    html! { div.wide { table {
        thead { tr { th { (head) } @for c in &columns { th.n { (column_head(c)) } } } }
        tbody { @for (name, cells) in &rows { tr {
            td { (name) }
            @for c in &columns { (cells.get(component_of(c)).map_or_else(|| html! { td {} }, |e| cell(r, e, c))) }
        } } }
    } } }
}

fn component_of(e: &EstimateRecord) -> &str {
    split(&e.name).1
}

fn column_head(e: &EstimateRecord) -> Markup {
    let (factor, unit) = unit(e);
    html! {
        (short(component_of(e))) ", " (unit)
        @if let Some(p) = e.prior_sigma { br; span.note { "tol. " (significant(factor * p)) } }
    }
}

fn cell(r: &SolutionRecord, e: &EstimateRecord, head: &EstimateRecord) -> Markup {
    let Some((value, sigma)) = known(e) else { return html! { td.grid { "fixed" } } };
    let (factor, own) = unit(e);
    let share = 100.0 * e.share_of_data.unwrap_or(1.0);
    let class = if r.hardly_determines(e) { "weak" } else { "" };
    html! { td.grid {
        (plus_minus(factor * value, factor * sigma)) @if own != unit(head).1 { " " (own) }
        span.bar title={ (format!("{share:.0}")) " % from the data" } { i class=(class) style={ "width:" (format!("{share:.0}")) "%" } {} }
    } }
}

/// What the data do not determine, and what they cannot tell apart.
pub(in crate::output::report) fn undetermined(r: &SolutionRecord) -> Markup {
    let weak: Vec<&str> = r.undetermined().iter().map(|e| e.name.as_str()).collect();
    let others = || r.estimates.iter().filter(|e| e.free && !e.name.starts_with("robot/"));
    let silent: Vec<&str> = others().filter(|e| r.hardly_determines(e)).map(|e| e.name.as_str()).collect();
    html! {
        @if r.has_no_robot() {
            p { "Nothing is identified of the robot: its poses are taken as the controller gives them." }
        } @else if weak.is_empty() {
            p { "Nothing: the data say something about every parameter of the robot." }
        } @else {
            p {
                (weak.len()) " of " (r.robot_parameters().count()) " robot parameters stay near nominal, because the data decide less than " (format!("{:.0}", 100.0 * r.limits().share_of_data)) " % of them: "
                "stops that move these joints further would. What only the target pose or the hand-eye transform takes up is not among them."
            }
            ul { @for line in grouped(weak.iter().copied()) { li { (line) } } }
        }
        @if !silent.is_empty() {
            p { (silent.len()) " of " (others().count()) " parameters of cameras and plates stay near their priors, too:" }
            ul { @for line in grouped(silent.iter().copied()) { li { (line) } } }
        }
    }
}

/// Poses of cameras and plates.
pub(in crate::output::report) fn placed(r: &SolutionRecord) -> Markup {
    let parents = |mount: Option<CameraMount>| match mount {
        Some(CameraMount::Fixed) => (&r.robot.base, &r.robot.tip),
        _ => (&r.robot.tip, &r.robot.base),
    };
    let cameras = r
        .mountings
        .iter()
        .enumerate()
        .map(|(k, m)| (format!("camera in {}", parents(r.mount_of_mounting(k)).0), m, r.mountings.len()));
    let plates = r
        .placements
        .iter()
        .enumerate()
        .map(|(k, p)| (format!("plate in {}", parents(r.mount_of_placement(k)).1), p, r.placements.len()));
    if r.mountings.is_empty() && r.placements.is_empty() {
        return html! {};
    }
    html! {
        p.note { "Sigmas are per axis of what is placed. Roll, pitch, yaw as in URDF." }
        div.wide { table {
            thead { tr {
                th { "Pose" } th.n { "x, mm" } th.n { "y, mm" } th.n { "z, mm" } th.n { "roll, °" } th.n { "pitch, °" } th.n { "yaw, °" }
                th.n { "sigma, mm" } th.n { "sigma, °" }
            } }
            tbody { @for (what, record, several) in cameras.chain(plates) { (placed_row(&what, record, several)) } }
        } }
    }
}

fn placed_row(what: &str, p: &PlacedRecord, several: usize) -> Markup {
    let pose = Pose::from(&p.pose);
    let sigma = |k: usize| p.covariance.as_ref().and_then(|c| c.get(7 * k)).map(|v| v.max(0.0).sqrt());
    let sigmas = |first: usize, factor: f64| match [first, first + 1, first + 2].map(sigma) {
        [Some(x), Some(y), Some(z)] => [x, y, z].map(|s| significant(factor * s)).join(" "),
        _ => "not determined".into(),
    };
    html! { tr {
        td { (what) @if several > 1 { " (" (p.name) ")" } }
        @for v in pose.xyz() { td.n { (fixed(1e3 * v, 3)) } }
        @for v in pose.rpy() { td.n { (fixed(v.to_degrees(), 4)) } }
        td.n { (sigmas(0, 1e3)) }
        td.n { (sigmas(3, 180.0 / std::f64::consts::PI)) }
    } }
}

/// A parameter of pinhole or lens formula; those of a displacement field are shown as a map.
fn is_of_formula(e: &EstimateRecord, camera: &str) -> bool {
    let rest = e.name.strip_prefix("camera/").and_then(|n| n.strip_prefix(camera));
    rest.is_some_and(|r| r.starts_with("/pinhole.") || r.starts_with("/lens."))
}

/// Cameras: parameters, distortion and uncertainty.
pub(in crate::output::report) fn cameras(r: Photogrammetry) -> Markup {
    html! {
        @for (k, camera) in r.cameras.iter().enumerate() {
            h3 { (camera.name) ", " (camera.lens.name()) " lens, " (camera.width_px) " × " (camera.height_px) " px" }
            div.pair {
                div.wide { table {
                    thead { tr { th { "Parameter" } th.n { "estimate" } th { "unit" } } }
                    tbody { @for e in r.estimates.iter().filter(|e| is_of_formula(e, &camera.name)) {
                        @if let Some((value, sigma)) = known(e) {
                            tr { td { (component_of(e)) } td.n { (plus_minus(value, sigma)) } td { (unit(e).1) } }
                        } @else if let (false, Some(value)) = (e.free, e.value) {
                            tr { td { (component_of(e)) } td.n { (fixed(value, 4)) " (held)" } td { (unit(e).1) } }
                        }
                    } }
                } }
                @if let Some(map) = maps::distortion(camera) { (figure(&map.svg, &map.caption)) }
                @if let Some(map) = maps::uncertainty(r, k) { (figure(&map.svg, &map.caption)) }
            }
        }
    }
}
