//! Two-step calibration against the joint fit, on images that neither fit had seen.

use maud::{Markup, html};

use crate::identify::{Comparison, Estimator};
use crate::output::report::page::figure::figure;
use crate::output::report::page::svg::{Anchor, Svg, round_below};
use crate::output::report::wording::words::{count, fixed, significant};
use crate::output::solution_json::SolutionRecord;

/// What a fit of the robot to stand-alone camera poses would have reached.
pub(in crate::output::report) fn section(r: &SolutionRecord) -> Markup {
    let Some(comparison) = &r.two_stage else { return html! {} };
    html! {
        p {
            "Would it have done to find every camera pose by itself and to fit the robot to these poses? "
            "Both ways were fitted to the same " (count(comparison.images, "image"))
            @if comparison.images < r.images.iter().filter(|i| i.is_used_on_robot()).count() { ", chosen evenly among all of them" }
            ", less those put aside in "
            (count(comparison.folds[0], "group")) " in turn, and had to predict these from their joint readings. Observations, outliers and priors are the same; "
            "the two-stage fits find their own weights, the joint fit keeps the noise that the whole series showed."
        }
        p { b { (verdict(comparison)) } }
        div.wide { table {
            thead { tr { th { "Fit" } th.n { "error, mm RMS" } th.n { "in the image, px RMS" } th.n { "error over that of the joint fit" } } }
            tbody { @for row in &comparison.rows { tr {
                td { (row.estimator.title()) }
                @match row.by_image {
                    None => { td.n { "no solution" } td {} td {} },
                    Some(held) => {
                        td.n { (significant(held.rms_mm)) } td.n { (significant(held.rms_px)) }
                        td.n { @if let Some(ratio) = held.to_joint.filter(|_| row.estimator != Estimator::Joint) { (ratio) } }
                    }
                }
            } } }
        } }
        @if let Some(svg) = intervals(comparison) {
            (figure(&svg, "Error of each two-stage fit over that of the joint fit, with its 95 % interval over the images (those that share joint readings count once); right of the line the joint fit is better."))
        }
        p.note { "With the joint fit that takes the readings as exact, and regions of the workspace held out: " code { "robotcal compare" } "." }
    }
}

fn verdict(comparison: &Comparison) -> String {
    let Some((row, ratio)) = comparison.best_two_stage() else { return "No two-stage fit has a solution here.".into() };
    let title = row.estimator.title();
    let percent = |value: f64| fixed(100.0 * (value - 1.0).abs(), 1);
    if ratio.low > 1.0 {
        format!(
            "The joint fit is better than every two-stage fit; the best of these ({title}) is off by {} % more.",
            percent(ratio.value)
        )
    } else if ratio.high < 1.0 {
        format!("Here the best two-stage fit ({title}) is off by {} % less than the joint fit.", percent(ratio.value))
    } else {
        format!(
            "The best two-stage fit ({title}) and the joint fit cannot be told apart on these images: {} times the error, {} to {}.",
            fixed(ratio.value, 3),
            fixed(ratio.low, 3),
            fixed(ratio.high, 3)
        )
    }
}

const WIDTH: f64 = 620.0;
const LEFT: f64 = 290.0;
const RIGHT: f64 = 20.0;
const ROW: f64 = 24.0;

fn intervals(comparison: &Comparison) -> Option<String> {
    let rows: Vec<_> = comparison.two_stage().collect();
    let high = rows.iter().map(|(_, ratio)| ratio.high).fold(1.0, f64::max);
    let low = rows.iter().map(|(_, ratio)| ratio.low).fold(1.0, f64::min);
    if rows.is_empty() || !(high - low).is_finite() {
        return None;
    }
    let (from, to) = (low - 0.05 * (high - low) - 1e-3, high + 0.05 * (high - low) + 1e-3);
    let x = |value: f64| LEFT + (WIDTH - LEFT - RIGHT) * (value - from) / (to - from);
    let bottom = ROW * (rows.len() as f64 + 0.5);
    let mut svg = Svg::new(WIDTH, bottom + 38.0, "Error of the two-stage fits over that of the joint fit");
    let step = round_below((to - from) / 4.0);
    let digits = (-step.log10()).ceil().max(1.0) as usize;
    let first = (from / step).ceil() as i64;
    for t in (first..first + 20).map(|k| step * k as f64).take_while(|t| *t <= to) {
        svg.line([x(t), 6.0], [x(t), bottom], "grid");
        svg.text([x(t), bottom + 16.0], Anchor::Middle, &fixed(t, digits));
    }
    svg.line([x(1.0), 6.0], [x(1.0), bottom], "axis");
    for (k, (row, ratio)) in rows.iter().enumerate() {
        let y = ROW * (k as f64 + 0.75);
        svg.text([LEFT - 10.0, y + 4.0], Anchor::End, row.estimator.title());
        svg.line([x(ratio.low), y], [x(ratio.high), y], "vector");
        svg.circle([x(ratio.value), y], 4.0, "after");
    }
    svg.text([x((from + to) / 2.0), bottom + 33.0], Anchor::Middle, "error over that of the joint fit");
    Some(svg.finish())
}
