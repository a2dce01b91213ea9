//! plan.html: the planned poses, what they will be worth, and pictures of both.

use maud::{Markup, html};

use super::figures::plan_pictures::{View, coverage, curve, joint_ranges, scene};
use super::page::figure::figure;
use super::page::frame::{STYLE, page};
use crate::output::plan_files::written;
use crate::plan::{Forecast, Plan, PlanRequest, image_name};

/// Rows of the table of parameters.
const PARAMETERS: usize = 15;

const PLAN_STYLE: &str = "\
svg .arm{stroke:#9aa4b0;stroke-width:1;fill:none;stroke-opacity:.55}\
svg .cone{stroke:#1f6feb;stroke-width:.8;fill:none;stroke-opacity:.7}\
svg .plate{stroke:#e8590c;stroke-width:2;fill:none}\
svg .carried{stroke:#e8590c;stroke-width:.8;fill:none;stroke-opacity:.7}\
svg .planned{stroke:#1f6feb;stroke-width:2;fill:none}\
svg .random{stroke:#9aa4b0;stroke-width:2;fill:none;stroke-dasharray:5 3}\
svg .tick{stroke:#1f6feb;stroke-width:1.5;stroke-opacity:.7}\
svg .h1{fill:#1f6feb;fill-opacity:.15}svg .h2{fill:#1f6feb;fill-opacity:.35}\
svg .h3{fill:#1f6feb;fill-opacity:.6}svg .h4{fill:#1f6feb;fill-opacity:.9}";

/// The page.
pub fn plan_html(request: &PlanRequest, plan: &Plan, forecast: &Forecast, command: &str) -> String {
    let robot = &request.setting.robot.chain.robot;
    let body = html! {
        h1 { "Plan for " (robot) }
        p class="sub" { (plan.legs.len()) " images, chosen from " (plan.pool.len()) " workable poses: " (plan.drawn) " drawn at random, "
            (plan.pool.len() - plan.drawn) " searched near the best" }
        (numbers(plan, forecast))
        (words(forecast))
        (pictures(request, plan, forecast))
        (gains(forecast, request.taken.len()))
        (parameters(forecast))
        (stops(request, plan))
        h2 { "Command" }
        p { code { (command) } }
    };
    page(&format!("Plan for {robot}"), &[STYLE, PLAN_STYLE].concat(), &body)
}

fn numbers(plan: &Plan, forecast: &Forecast) -> Markup {
    let taught = plan.legs.iter().filter(|l| !l.is_free).count();
    let worst = plan.imbalance.iter().copied().fold(0.0, f64::max);
    html! {
        div class="big" {
            div { b { (format!("{:.3} mm", 1e3 * forecast.flange_m)) } span { "expected error of the flange (RMS), base frame and a point of the flange fitted" } }
            div { b { (format!("{:.3} mm", 1e3 * forecast.before_m)) } span { "before" } }
            div { b { (format!("{:.1} %", 1e2 * plan.efficiency[1])) } span { "certified share of what any choice could reach" } }
            div { b { (format!("{:.0} %", 1e2 * worst)) } span { "largest one-sidedness of the approach of a joint" } }
            @if taught > 0 { div { b { (taught) } span { "ways between stops that must be taught" } } }
        }
    }
}

fn words(forecast: &Forecast) -> Markup {
    html! { ul { @for line in &forecast.words { li { (line) } } } }
}

fn pictures(request: &PlanRequest, plan: &Plan, forecast: &Forecast) -> Markup {
    html! {
        h2 { "Accuracy over the number of images" }
        (figure(&curve(forecast), "Expected error of the flange: the best images of this plan (solid), as many workable poses at \
                 random (dashed). Where the solid line is flat, more images help little."))
        h2 { "Robot and views" }
        div class="pair" {
            (figure(&scene(request, plan, View::Side), "From the side: arm (grey), view of the camera (blue), plate (orange); metres."))
            (figure(&scene(request, plan, View::Top), "From above."))
        }
        h2 { "Coverage" }
        div class="pair" {
            (figure(&coverage(request, plan), "The image field: the darker, the more markers of all planned images lie there."))
            (figure(&joint_ranges(forecast), "Joint ranges: limits (frame) and planned readings (ticks)."))
        }
    }
}

fn gains(forecast: &Forecast, taken: usize) -> Markup {
    html! {
        h2 { "What each pose brings" }
        p class="note" {
            @if taken > 0 { "By itself, on top of the " (taken) " images that were taken already." }
            @else { "On top of all other planned images." }
            @if forecast.gains.len() > PARAMETERS {
                " The " (PARAMETERS) " of " (forecast.gains.len()) " images that help most."
            }
        }
        div class="wide" { table {
            tr { th { "Image" } th class="n" { "Flange, mm" } th class="n" { "better by, µm" } th { "Helps most with" } th class="n" { "its sigma before" } th class="n" { "after" } }
            @for g in forecast.gains.iter().take(PARAMETERS) {
                tr {
                    td { (image_name(g.leg)) }
                    td class="n" { (format!("{:.4} → {:.4}", 1e3 * g.flange_m[0], 1e3 * g.flange_m[1])) }
                    td class="n" { (format!("{:.2}", 1e6 * g.gain_m())) }
                    td { (g.parameter) }
                    td class="n" { (sigma_text(g.sigma[0], g.unit)) }
                    td class="n" { (sigma_text(g.sigma[1], g.unit)) }
                }
            }
        } }
    }
}

/// A sigma in the units of reports.
pub fn sigma_text(value: f64, unit: &str) -> String {
    match unit {
        "m" => format!("{:.4} mm", 1e3 * value),
        "rad" => format!("{:.4} mrad", 1e3 * value),
        _ => format!("{value:.2e}"),
    }
}

fn parameters(forecast: &Forecast) -> Markup {
    let mut all: Vec<_> = forecast.parameters.iter().collect();
    all.sort_by(|a, b| a.share_of_data().total_cmp(&b.share_of_data()));
    let known = all.iter().rev().filter(|p| p.is_known()).take(PARAMETERS);
    html! {
        h2 { "Parameters that will be known one by one" }
        div class="wide" { table {
            tr { th { "Parameter" } th class="n" { "tolerance" } th class="n" { "expected sigma" } }
            @for p in known {
                tr { td { (p.name) } td class="n" { (sigma_text(p.prior_sigma, p.unit)) } td class="n" { (sigma_text(p.sigma, p.unit)) } }
            }
        } }
    }
}

fn stops(request: &PlanRequest, plan: &Plan) -> Markup {
    let chain = &request.setting.robot.chain;
    html! {
        h2 { "Stops" }
        div class="wide long" { table {
            tr { th { "Image" } @for j in &chain.readings { th class="n" { (j) } } th class="n" { "markers" } th { "way" } }
            @for (k, leg) in plan.legs.iter().enumerate() {
                @let c = &plan.pool[leg.stop];
                tr {
                    td { (image_name(k)) }
                    @for q in written(&c.readings, &chain.reading_kinds) { td class="n" { (format!("{q:.2}")) } }
                    td class="n" { (c.seen.len()) }
                    td { @if !leg.is_free { "teach" } @else if !leg.via.is_empty() { "by another posture" } }
                }
            }
        } }
    }
}
