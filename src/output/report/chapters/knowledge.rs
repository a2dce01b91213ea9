//! What the data tell, what to measure next, and how well the flange is known where.

use maud::{Markup, html};

use crate::assess::{Cause, Identifiability, UnknownDirection};
use crate::linalg::median;
use crate::output::parameter_words::direction;
use crate::output::report::figures::maps;
use crate::output::report::page::figure::figure;
use crate::output::report::page::svg::{Anchor, Svg};
use crate::output::report::wording::words::{count, data, significant};
use crate::output::solution_json::SolutionRecord;

/// Most correlations that are listed.
const MOST_PAIRS: usize = 20;

/// Rank, directions that stay unknown, observability indices, what to measure next.
pub(in crate::output::report) fn identifiable(r: &SolutionRecord) -> Markup {
    let Some(found) = &r.identifiability else { return html! {} };
    html! {
        @if !r.has_no_robot() { (of_robot(r, found)) }
        (correlated(found))
        @if let Some(o) = found.observability {
            h3 { "Observability" }
            p.note { "Over the directions that the data tell, in units of the priors; larger is better. For comparing series of the same robot." }
            div.wide { table {
                thead { tr { th.n { "O1" } th.n { "O2" } th.n { "O3" } th.n { "O4" } th.n { "O5" } } }
                tbody { tr { @for v in [o.o1, o.o2, o.o3, o.o4, o.o5] { td.n { (format!("{v:.3e}")) } } } }
            } }
        }
        @if !r.evidences.is_empty() {
            h3 { "Which robot model the data support" }
            div.wide { table {
                thead { tr { th { "Model" } th.n { "log evidence, relative" } th.n { "parameters" } } }
                tbody { @for e in &r.evidences { tr {
                    td { (e.model.name()) } td.n { (format!("{:.1}", e.log_evidence)) } td.n { (e.parameters) }
                } } }
            } }
        }
    }
}

/// What the data tell of the robot.
fn of_robot(r: &SolutionRecord, found: &Identifiability) -> Markup {
    let of = |causes: &'static [Cause]| found.unknown.iter().filter(move |d| causes.contains(&d.cause));
    html! {
        p {
            "The robot model has " (count(found.parameters, "free parameter")) ". Stops over the whole range of all joints could tell "
            (found.tellable) " independent directions of them; these " (data(r)) " tell " b { (found.rank) } ". "
            "The rest follows from the priors (the nominal model)."
        }
        @if found.next.is_empty() {
            p { "No single further stop would tell much more." }
        } @else {
            h3 { "What to measure next" }
            ul { @for a in &found.next { li { (a.words) span.note { " (takes " (format!("{:.0}", 100.0 * a.gain)) " % off what is left unknown)" } } } }
        }
        @if of(&[Cause::Stops]).next().is_some() {
            h3 { "What other stops could tell" }
            ul { @for d in of(&[Cause::Stops]) { li { (direction(d)) @if let Some(remedy) = &d.remedy { ": " (remedy) } } } }
        }
        h3 { "What is unobservable, and does no harm" }
        p.note { "These directions change nothing that is measured, or only what target pose and hand-eye transform take up as well." }
        ul {
            (group("Unobservable beside the target pose (base frame)", of(&[Cause::Base])))
            (group("Unobservable beside the hand-eye transform (tip frame)", of(&[Cause::Tip])))
            (group("Parameters that do the same to this robot", of(&[Cause::Redundant])))
            (group("Parameters that do nothing to this robot", of(&[Cause::Idle])))
        }
    }
}

/// Pairs that are hard to tell apart.
fn correlated(found: &Identifiability) -> Markup {
    html! {
        @if !found.correlations.is_empty() {
            h3 { "Correlated parameters" }
            p.note {
                "The data fix a combination of the two well, and each alone badly (correlation beyond 0.9). "
                "This does not harm the accuracy as long as both are used together."
            }
            ul { @for c in found.correlations.iter().take(MOST_PAIRS) { li {
                (c.first) " and " (c.second) " (" (format!("{:.3}", c.correlation)) "): " span.note { (c.remedy) }
            } } }
            @if found.correlations.len() > MOST_PAIRS { p.note { "and " (found.correlations.len() - MOST_PAIRS) " weaker pairs." } }
        }
    }
}

fn group<'a>(what: &str, directions: impl Iterator<Item = &'a UnknownDirection>) -> Markup {
    let all: Vec<String> = directions.map(direction).collect();
    html! { @if !all.is_empty() { li { (what) ": " (all.join("; ")) } } }
}

/// Colours of the map, best first; they differ in lightness, too.
const CLASSES: [&str; 5] = ["m1", "m2", "m3", "m4", "m5"];

/// Sigma of the flange over the workspace.
pub(in crate::output::report) fn workspace(r: &SolutionRecord) -> Markup {
    if r.workspace.is_empty() {
        return html! {};
    }
    let inside = median(r.workspace.iter().filter(|w| w.covered).map(|w| 1e3 * w.sigma_m));
    let (bounds, agree) = (bounds(r), r.limits().scatter_ratio);
    html! {
        p {
            "Uncertainty of the position of the flange relative to " (r.flange_is_relative_to()) ", one sigma over all three axes, by the calibrated model. "
            "Joint noise of a single move comes on top. "
            @if let Some(sigma_mm) = inside {
                "In the region of the stops it is typically " b { (significant(sigma_mm)) " mm" } "; "
                "outside of it the model extrapolates."
            } @else {
                "No sampled place lies in the region of the stops."
            }
        }
        @if let Some(s) = &r.scatter { @if let Some(ratio) = s.flange_ratio {
            p.note {
                "Scatter between the images against the noise model: " (significant(ratio)) " times. "
                @if s.larger_stated { "The larger sigmas are stated." }
                @else if ratio <= agree { "They agree within " (agree) "; the noise model's sigmas are stated." }
                @else { "With so few images for what they tell, the scatter is no judge; the noise model's sigmas are stated." }
            }
        } }
        div.pair {
            (figure(&map(r, &bounds, "Workspace from above: sigma of the flange", |p| [p[0], p[1]], ["x", "y"]), "From above, base frame, m."))
            (figure(&map(r, &bounds, "Workspace from the side: sigma of the flange", |p| [p[0].hypot(p[1]), p[2]], ["r", "z"]), "From the side (r: distance from the axis of the base), m. Ringed: region of the stops."))
        }
        p.note { @for (k, class) in CLASSES.iter().enumerate() {
            span class={ "key " (class) } {}
            @match (k.checked_sub(1).and_then(|b| bounds.get(b)), bounds.get(k)) {
                (None, Some(b)) => { "below " (significant(*b)) " mm " }
                (Some(_), Some(b)) => { "to " (significant(*b)) " mm " }
                (Some(b), None) => { "above " (significant(*b)) " mm" }
                (None, None) => {}
            }
        } }
    }
}

/// Bounds between the colours, mm: fifths of all places.
fn bounds(r: &SolutionRecord) -> Vec<f64> {
    let mut all: Vec<f64> = r.workspace.iter().map(|w| 1e3 * w.sigma_m).collect();
    all.sort_by(f64::total_cmp);
    (1..CLASSES.len()).map(|k| all[(all.len() - 1) * k / CLASSES.len()]).collect()
}

fn map(
    r: &SolutionRecord,
    bounds: &[f64],
    label: &str,
    project: impl Fn(&[f64; 3]) -> [f64; 2],
    axes: [&str; 2],
) -> String {
    let places: Vec<[f64; 2]> = r.workspace.iter().map(|w| project(&w.xyz_m)).collect();
    let low = [0, 1].map(|k| places.iter().map(|p| p[k]).fold(f64::INFINITY, f64::min));
    let high = [0, 1].map(|k| places.iter().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max));
    let field = maps::Field { low, high, up: true };
    let (width, height) = field.size();
    let mut svg = Svg::new(width, height + 20.0, label);
    svg.rect([0.0, 0.0], [width, height], "frame");
    for (at, w) in places.iter().zip(&r.workspace) {
        let class = CLASSES[bounds.iter().filter(|b| 1e3 * w.sigma_m > **b).count()];
        let class = if w.covered { format!("{class} ring") } else { class.to_owned() };
        svg.circle(field.place(*at), 5.0, &class);
    }
    let words = format!("{} {:.2} to {:.2}, {} {:.2} to {:.2}", axes[0], low[0], high[0], axes[1], low[1], high[1]);
    svg.text([6.0, height + 14.0], Anchor::Start, &words);
    svg.finish()
}
