//! What a technician decides by: verdict, accuracy, what to do.

use maud::{Markup, html};

use super::chapters::findings::remedy;
use super::wording::words::{count, significant};
use crate::output::parameter_words::MOST_NEXT;
use crate::output::solution_json::{SolutionRecord, StatisticsRecord};
use crate::output::verdict::{Trust, Verdict};
use crate::output::{ALONE, CALIBRATED};

/// The first page.
pub(super) fn first_page(r: &SolutionRecord) -> Markup {
    let v = Verdict::of(r);
    html! {
        h1 { "Calibration of " (r.robot.name) }
        p.sub {
            (r.robot.base) " to " (r.robot.tip) ", "
            @if r.has_no_robot() { "poses of the controller; " } @else { (count(r.robot.readings.len(), "moving joint")) "; " }
            @if !r.images.is_empty() {
                (images_used(&r.statistics))
            }
            @if !r.bodies.is_empty() {
                (r.bodies.left_out()) " of " (count(r.bodies.measurements.len(), "measurement")) " by trackers and contacts left out. "
            }
            (r.program.name) " " (r.program.version) "."
        }
        (judged(&v, [
            "Good: the corrected model can be used",
            "Good, with doubts: look at the points below first",
            "Not to be trusted: do not use this model before the cause is found",
        ]))
        (promise(r, v.trust))
        (held_out(r))
        h2 { "What to do" }
        ol.steps { @for step in steps(r, &v) { li { (step) } } }
    }
}

/// How many images and observations take part.
pub(super) fn images_used(s: &StatisticsRecord) -> Markup {
    html! {
        (count(s.images_used, "image")) " of " (s.images) " used"
        @if s.images > s.images_used { " (" a href="#left-out" { "why not all" } ")" }
        ", " (s.observations_left_out) " of " (s.observations_left_out + s.observations_used)
        " observations left out. "
    }
}

/// The verdict with its reasons, under the headline of a good result, of one with doubts, or of one that failed.
pub(super) fn judged(v: &Verdict, [good, doubts, failed]: [&str; 3]) -> Markup {
    let (class, headline) = match v.trust {
        Trust::Good => ("good", good),
        Trust::Doubts => ("care", doubts),
        Trust::Failed => ("failed", failed),
    };
    html! {
        div class={ "verdict " (class) } {
            strong { (headline) }
            @if !v.reasons.is_empty() { ul { @for reason in &v.reasons {
                li { (reason.what) (remedy(&reason.remedy)) }
            } } }
        }
    }
}

/// The expected error of the flange: what may be promised.
fn promise(r: &SolutionRecord, trust: Trust) -> Markup {
    let Some(e) = &r.flange else { return html! {} };
    let i = e.intervals.as_ref();
    let (alone_m, of_alone) = e.best_urdf_m();
    let alone = if r.has_no_robot() { "Poses of the controller" } else { "Corrected URDF alone" };
    let mut rows = vec![(alone, alone_m, of_alone, "after")];
    if !r.has_no_robot() {
        rows.insert(0, ("Nominal robot", e.nominal_m, i.map(|i| i.nominal_m), "before"));
    }
    if r.beyond_urdf() {
        rows.push(("Corrected URDF with compensation.toml", e.model_m, i.map(|i| i.model_m), "after"));
    }
    let most = rows.iter().map(|row| row.1).fold(f64::MIN_POSITIVE, f64::max);
    html! {
        h2 { "Accuracy of the flange" }
        @if trust == Trust::Failed { p { b { "These figures hold only if the checks above are wrong." } } }
        div.wide { table {
            thead { tr { th { "Robot model" } th.n { "expected error, RMS" } @if i.is_some() { th.n { "95 % interval, mm" } } td.meter {} } }
            tbody { @for (name, m, interval, class) in rows { tr {
                th scope="row" { (name) }
                td.n { b { (significant(1e3 * m)) " mm" } }
                @if let Some([low, high]) = interval { td.n { (significant(1e3 * low)) " to " (significant(1e3 * high)) } }
                td.meter { span.bar { i.(class) style={ "width:" (format!("{:.0}", 100.0 * m / most)) "%" } {} } }
            } } }
        } }
        p.note {
            "Position of the flange relative to " (r.flange_is_relative_to()) " " (r.flange_holds()) ", by model and covariance"
            @if !r.has_no_robot() { "; the nominal robot with the base and the tool that fit it best" } ". " (significant(1e3 * e.scatter_m))
            @if r.has_no_robot() {
                " mm of it is how the poses of the controller are off from stop to stop: errors of its own model of the robot among them, which a run with "
                code { "--urdf" } " takes away. Between these poses those errors are others, and the flange may be off by more. "
            } @else {
                " mm of each is noise from stop to stop, which no model takes away. "
            }
            "This is the figure to quote" @if r.has_no_robot() { " at these poses" } "; " a href="#workspace" { "elsewhere in the workspace" } " it is larger."
        }
    }
}

/// What was measured on images of the same series.
fn held_out(r: &SolutionRecord) -> Markup {
    let (before, after) = (&r.accuracy.nominal, &r.accuracy.calibrated);
    if r.images.is_empty() {
        return html! { p {
            "Measured at stops that the fit had not seen: " b { @if !r.has_no_robot() { (significant(before.rms_mm)) " → " } (significant(after.rms_mm)) " mm" }
            ", worst " (significant(after.worst_mm)) " mm (" a href="#accuracy" { "more" } ")."
        } };
    }
    html! { p {
        "Measured on images that the fit had not seen: " b { @if !r.has_no_robot() { (significant(before.rms_mm)) " → " } (significant(after.rms_mm)) " mm" }
        " on the plate, worst image " (significant(after.worst_mm)) " mm. They all look at one plate: this is no figure for the workspace ("
        a href="#accuracy" { "more" } ")."
    } }
}

/// With the full stop that it lacks; a question has its mark.
pub(super) fn sentence(words: &str) -> String {
    let end = if words.ends_with(['?', '.', '!']) { "" } else { "." };
    format!("{words}{end}")
}

/// Remedies of a failed result; else what to install, and what would help most.
fn steps(r: &SolutionRecord, v: &Verdict) -> Vec<Markup> {
    if v.trust == Trust::Failed {
        let remedies = v.remedies.iter().map(|remedy| html! { (sentence(remedy)) });
        return remedies.chain([html! { "Identify again; keep the earlier robot model until then." }]).collect();
    }
    let mut all = Vec::new();
    let alone = r.file_ending_with(ALONE);
    if let Some(urdf) = alone.or(r.file_ending_with(CALIBRATED)) {
        all.push(html! {
            "Use " code { (urdf) } @if alone.is_some() { " where nothing else than a URDF is read" }
            @if r.offsets_in_mastering {
                ", and enter the offsets of " code { "mastering.csv" } " with in_urdf = no in the controller first, and no others: these are not in the URDF."
            } @else {
                ": joint offsets are in it, controller angles stay as they are."
            }
        });
    }
    if r.beyond_urdf() {
        let with = r.file_ending_with(CALIBRATED);
        all.push(html! {
            "Correct programs with " code { "robotcal compensate" } ", "
            @if let Some(urdf) = with { code { (urdf) } " and " } code { "compensation.toml" }
            ": it holds what a URDF cannot (gears, sag, backlash)."
        });
    }
    if r.hangs_on_a_stated_size() {
        all.push(html! {
            "Measure the distance of two far markers and give " code { "[scale]" } " in plate.toml: all lengths of the robot are those of the plate, "
            "whose size nobody measured. 0.1 % off its stated size is 1 mm a metre, and no figure of this page has it."
        });
    }
    let next = r.identifiability.iter().flat_map(|found| &found.next).take(MOST_NEXT);
    let next: Vec<&str> = next.map(|a| a.words.as_str()).collect();
    if !next.is_empty() {
        all.push(html! { "To be more accurate, " (next.join("; ")) " (" a href="#known" { "why" } ")." });
    }
    all
}
