//! Plot of the study of precision: what was reached over the exact bound.

use crate::output::report::page::svg::{Anchor, Svg};
use crate::study::image_stage::Precision;

const STYLE: &str = "text{font:11px sans-serif;fill:#222}.axis{stroke:#444}.grid{stroke:#ddd}.bound{stroke:#444}\
                     .limit{stroke:#c0392b;stroke-dasharray:4 3}.r0{fill:#1b9e77}.r1{fill:#d95f02}.r2{fill:#7570b3}.r3{fill:#e7298a}.r4{fill:#66a61e}";
const COLOURS: usize = 5;

/// Root mean square error of every cell over its exact bound, px, both axes logarithmic; discs and annuli side by side, coloured
/// by radius.
pub(super) fn plot(study: &[Precision], limit: f64) -> String {
    let (side, left, top) = (300.0, 56.0, 24.0);
    let mut svg =
        Svg::new(2.0 * (side + left) + 12.0, side + top + 40.0, "rms error of the centroids over the exact bound");
    let seen = || study.iter().filter(|p| p.markers > 0);
    let exponents = |pick: fn(f64, f64) -> f64, start: f64| {
        seen().flat_map(|p| [p.rms_px, p.rms_px / p.to_bound]).map(f64::log10).fold(start, pick)
    };
    let (low, high) = (exponents(f64::min, 0.0).floor(), exponents(f64::max, -3.0).ceil());
    let mut radii: Vec<f64> = study.iter().map(|p| p.cell.radius_px).collect();
    radii.sort_by(f64::total_cmp);
    radii.dedup();
    for (panel, (kind, annuli)) in [("discs", false), ("annuli", true)].into_iter().enumerate() {
        let x0 = left + (side + left) * panel as f64;
        let share = |exponent: f64| (exponent - low) / (high - low) * side;
        let (x, y) = (|px: f64| x0 + share(px.log10()), |px: f64| top + side - share(px.log10()));
        let mut exponent = low;
        while exponent <= high {
            let at = 10f64.powf(exponent);
            svg.line([x(at), top], [x(at), top + side], "grid");
            svg.line([x0, y(at)], [x0 + side, y(at)], "grid");
            svg.text([x(at), top + side + 14.0], Anchor::Middle, &format!("{at}"));
            svg.text([x0 - 4.0, y(at) + 4.0], Anchor::End, &format!("{at}"));
            exponent += 1.0;
        }
        let (first, last) = (10f64.powf(low), 10f64.powf(high));
        svg.line([x0, top], [x0, top + side], "axis");
        svg.line([x0, top + side], [x0 + side, top + side], "axis");
        svg.line([x(first), y(first)], [x(last), y(last)], "bound");
        svg.line([x(first), y(limit * first)], [x(last / limit), y(last)], "limit");
        for p in seen().filter(|p| p.annuli == annuli) {
            let colour = radii.iter().position(|r| *r == p.cell.radius_px).unwrap_or(0) % COLOURS;
            svg.circle([x(p.rms_px / p.to_bound), y(p.rms_px)], 2.0, &format!("r{colour}"));
        }
        svg.text([x0, 14.0], Anchor::Start, &format!("{kind}: rms error, px"));
        svg.text(
            [x0 + side / 2.0, top + side + 30.0],
            Anchor::Middle,
            &format!("exact bound, px (dashed: {limit} times)"),
        );
        for (k, radius) in radii.iter().enumerate() {
            let at = [x0 + 12.0, top + 14.0 + 14.0 * k as f64];
            svg.circle([at[0], at[1] - 4.0], 3.0, &format!("r{}", k % COLOURS));
            svg.text([at[0] + 8.0, at[1]], Anchor::Start, &format!("radius {radius} px"));
        }
    }
    svg.finish_alone(STYLE)
}
