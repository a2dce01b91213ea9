//! Trackers and contacts: how well every frame and every stop agrees with the robot.

use maud::{Markup, html};

use crate::output::report::wording::words::{count, significant};
use crate::output::solution::bodies_record::{BodiesRecord, MeasurementRecord};
use crate::output::solution_json::SolutionRecord;
use crate::problem::InstrumentKind;

/// Most measurements that are listed.
const WORST: usize = 12;

/// Tables of frames, of distances and of the worst measurements; nothing without such measurements.
pub(in crate::output::report) fn section(r: &SolutionRecord) -> Markup {
    let b = &r.bodies;
    if b.is_empty() {
        return html! {};
    }
    let mut worst: Vec<&MeasurementRecord> = b.measurements.iter().collect();
    worst.sort_by(|a, b| held_out(b).total_cmp(&held_out(a)));
    html! {
        p {
            "What a tracker saw of the tip, or where a ball on it sat, against where the robot puts it. The held-out error is by joint readings alone, of a model "
            "that had not seen the stop; the residual is what is left with the latent joint error of the stop. All in mm, RMS of the length."
        }
        div.wide { table {
            thead { tr {
                th { "Frame" } th { "what it is" } th.n { "measurements" } th.n { "residual" }
                th.n { "held out, nominal" } th.n { "held out, calibrated" } th.n { "sigma found / stated" }
            } }
            tbody { @for i in &b.instruments { (frame(b, &i.name, i.kind, i.sigma_factors[0])) } }
        } }
        @if !b.lengths.is_empty() {
            div.wide { table {
                thead { tr { th { "Measured distance" } th.n { "measured, mm" } th.n { "sigma, mm" } th.n { "fitted, mm" } } }
                tbody { @for l in &b.lengths { tr {
                    td { (l.between[0]) " to " (l.between[1]) @if l.left_out { " (left out)" } } td.n { (format!("{:.3}", 1e3 * l.distance_m)) }
                    td.n { (significant(1e3 * l.sigma_m)) }
                    td.n { (l.fitted_m.map_or_else(String::new, |m| format!("{:.3}", 1e3 * m))) }
                } } }
            } }
        }
        p { "The " (count(worst.len().min(WORST), "measurement")) " with the largest held-out error:" }
        div.wide { table {
            thead { tr { th { "Stop" } th { "frame" } th.n { "held out, nominal" } th.n { "held out, calibrated" } th.n { "residual" } th { "left out" } } }
            tbody { @for m in worst.iter().take(WORST) { tr {
                td { (m.name) } td { (m.instrument) }
                td.n { (mm(m.held_out_mm.map(|e| e[0]))) } td.n { (mm(m.held_out_mm.map(|e| e[1]))) } td.n { (mm(residual_mm(m))) }
                td.reason { @if let Some(why) = &m.rejection { (why) } }
            } } }
        } }
    }
}

fn frame(b: &BodiesRecord, name: &str, kind: InstrumentKind, factor: f64) -> Markup {
    let own = || b.measurements.iter().filter(move |m| m.instrument == name && m.kind == kind);
    let rms = |of: &dyn Fn(&MeasurementRecord) -> Option<f64>| {
        let all: Vec<f64> = own().filter_map(of).collect();
        (!all.is_empty()).then(|| (all.iter().map(|e| e * e).sum::<f64>() / all.len() as f64).sqrt())
    };
    let what = match kind {
        InstrumentKind::Tracker => "tracker",
        InstrumentKind::Socket => "socket",
        InstrumentKind::Places => "given places",
    };
    html! { tr {
        td { (name) } td { (what) } td.n { (own().count()) } td.n { (mm(rms(&residual_mm))) }
        td.n { (mm(rms(&|m| Some(m.held_out_mm?[0])))) } td.n { (mm(rms(&|m| Some(m.held_out_mm?[1])))) } td.n { (significant(factor)) }
    } }
}

fn held_out(m: &MeasurementRecord) -> f64 {
    m.held_out_mm.map_or(f64::INFINITY, |e| e[1])
}

fn residual_mm(m: &MeasurementRecord) -> Option<f64> {
    let r = m.residual?;
    Some(1e3 * (r[0] * r[0] + r[1] * r[1] + r[2] * r[2]).sqrt())
}

fn mm(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), significant)
}
