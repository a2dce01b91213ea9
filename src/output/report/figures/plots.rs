//! Plots of numbers: histogram of held-out errors, joint noise.

use crate::output::photogrammetry::Photogrammetry;
use crate::output::report::page::svg::{Anchor, Svg, ticks};
use crate::output::report::wording::describe::describe;
use crate::output::report::wording::many;
use crate::output::report::wording::words::plain;
use crate::output::solution_json::SolutionRecord;
use crate::urdf::JointKind;

const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 220.0;
const LEFT: f64 = 46.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 12.0;
const BOTTOM: f64 = 44.0;

/// Bins of the histogram.
const BINS: usize = 18;

/// Ratio of largest to smallest error from which the axis is logarithmic.
const WIDE_RANGE: f64 = 6.0;

/// Axis of errors in mm, linear or logarithmic.
struct Axis {
    low: f64,
    high: f64,
    logarithmic: bool,
}

impl Axis {
    fn of(errors: &[[f64; 2]]) -> Self {
        let all = || errors.iter().flatten().copied().filter(|e| *e > 0.0);
        let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
        match high / low > WIDE_RANGE {
            true => Self { low: low * 0.9, high: high * 1.1, logarithmic: true },
            false => Self { low: 0.0, high: high.max(1e-9) * 1.05, logarithmic: false },
        }
    }

    /// Place on the axis, 0 to 1.
    fn place(&self, value: f64) -> f64 {
        match self.logarithmic {
            true => (value / self.low).ln() / (self.high / self.low).ln(),
            false => (value - self.low) / (self.high - self.low),
        }
    }

    fn marks(&self) -> Vec<f64> {
        if !self.logarithmic {
            return ticks(self.high);
        }
        let first = self.low.log10().floor() as i32;
        let decades = (first..first + 12).flat_map(|p| [1.0, 2.0, 5.0].map(|m| m * 10f64.powi(p)));
        decades.filter(|v| (self.low..=self.high).contains(v)).collect()
    }
}

/// Held-out error of every image before and after.
pub(in crate::output::report) fn histogram(record: &SolutionRecord) -> Option<String> {
    let errors: Vec<[f64; 2]> = record.images.iter().filter_map(|i| i.held_out_mm).collect();
    if errors.is_empty() {
        return None;
    }
    let axis = Axis::of(&errors);
    let bins = counts(&axis, &errors);
    let most = bins.iter().flatten().copied().max().unwrap_or(1).max(4) as f64;
    let mut svg =
        Svg::new(WIDTH, HEIGHT, "Histogram of the error of each held-out image before and after calibration, in mm");
    let (w, h) = (WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM);
    let y = |count: f64| TOP + h * (1.0 - count / most);
    for t in ticks(most).into_iter().filter(|t| t.fract() == 0.0) {
        svg.line([LEFT, y(t)], [LEFT + w, y(t)], "grid");
        svg.text([LEFT - 6.0, y(t) + 4.0], Anchor::End, &format!("{t:.0}"));
    }
    let step = w / BINS as f64;
    for (k, [before, after]) in bins.iter().enumerate() {
        let x = LEFT + step * k as f64;
        for (count, shift, class) in [(*before, 0.06, "before"), (*after, 0.5, "after")] {
            if count > 0 {
                svg.rect([x + shift * step, y(count as f64)], [0.44 * step, TOP + h - y(count as f64)], class);
            }
        }
    }
    svg.line([LEFT, TOP + h], [LEFT + w, TOP + h], "axis");
    for mark in axis.marks() {
        let x = LEFT + w * axis.place(mark);
        svg.line([x, TOP + h], [x, TOP + h + 4.0], "axis");
        svg.text([x, TOP + h + 17.0], Anchor::Middle, &plain(mark));
    }
    let scale = if axis.logarithmic { " (logarithmic)" } else { "" };
    svg.text([LEFT + w / 2.0, HEIGHT - 8.0], Anchor::Middle, &format!("error of an image, mm{scale}"));
    svg.text_upwards([13.0, TOP + h / 2.0], "images");
    Some(svg.finish())
}

/// How many errors before and after fall into each bin.
fn counts(axis: &Axis, errors: &[[f64; 2]]) -> [[usize; 2]; BINS] {
    let mut bins = [[0; 2]; BINS];
    for e in errors {
        for side in 0..2 {
            let bin = (axis.place(e[side]) * BINS as f64).floor().clamp(0.0, BINS as f64 - 1.0);
            bins[bin as usize][side] += 1;
        }
    }
    bins
}

/// Residuals of every image in use, a bar each in the order of the series; left-out images are marked at the foot. With the number of bars.
pub(in crate::output::report) fn by_image(record: Photogrammetry) -> Option<(String, usize)> {
    let most = record.images.iter().filter_map(|i| i.rms_px).fold(0.0, f64::max);
    if most <= 0.0 {
        return None;
    }
    // Ticks have up to six characters.
    let (width, left) = (720.0, 68.0);
    let mut svg = Svg::new(width, HEIGHT, "Residuals of every image, px RMS");
    let (w, h) = (width - left - RIGHT, HEIGHT - TOP - BOTTOM);
    let y = |px: f64| TOP + h * (1.0 - px / (1.05 * most));
    for t in ticks(most) {
        svg.line([left, y(t)], [left + w, y(t)], "grid");
        svg.text([left - 6.0, y(t) + 4.0], Anchor::End, &plain(t));
    }
    let drawn = many::drawn(record.images.iter().collect());
    let step = w / drawn.len() as f64;
    let bar = (0.8 * step).min(24.0);
    for (k, &image) in drawn.iter().enumerate() {
        let x = left + step * (k as f64 + 0.5) - bar / 2.0;
        svg.titled(&describe(record, image), |svg| match (image.rms_px, &image.reason) {
            (Some(px), None) => svg.rect([x, y(px)], [bar, TOP + h - y(px)], "after"),
            _ => svg.rect([x, TOP + h - 8.0], [bar, 8.0], "gone"),
        });
    }
    svg.line([left, TOP + h], [left + w, TOP + h], "axis");
    svg.text([left + w / 2.0, HEIGHT - 22.0], Anchor::Middle, "images in the order of the series; red: left out");
    svg.text_upwards([13.0, TOP + h / 2.0], "px RMS");
    Some((svg.finish(), drawn.len()))
}

/// Joint noise in thousandths of a degree (of a millimetre for a prismatic joint), a bar for each joint and series.
pub(in crate::output::report) fn joint_noise(record: &SolutionRecord) -> Option<String> {
    let all = record.stop_noise();
    let names = &record.robot.readings;
    let shown = |k: usize, sigma: f64| match record.robot.reading_kinds[k] {
        JointKind::Prismatic => (1e3 * sigma, format!("{} mm", plain_digits(1e3 * sigma))),
        _ => {
            let degrees = sigma.to_degrees();
            (1e3 * degrees, format!("{degrees:.4}° = {:.3} mm at 1 m", 1e3 * sigma))
        }
    };
    let largest =
        all.iter().flat_map(|(_, n)| n.joint.iter().enumerate().map(|(k, s)| shown(k, *s).0)).fold(0.0, f64::max);
    if largest <= 0.0 || names.is_empty() {
        return None;
    }
    let (left, bar, gap) = (106.0, 16.0, 8.0);
    let row = bar * all.len() as f64 + gap;
    let height = row * names.len() as f64 + gap;
    let mut svg = Svg::new(WIDTH, height, "Joint noise of each joint");
    let reach = WIDTH - left - 175.0;
    for (k, name) in names.iter().enumerate() {
        let top = gap / 2.0 + row * k as f64;
        svg.text([left - 8.0, top + row / 2.0], Anchor::End, &shortened(name));
        for (c, (series, noise)) in all.iter().enumerate() {
            let (size, label) = shown(k, noise.joint[k]);
            let y = top + bar * c as f64;
            let width = (reach * size / largest).max(1.0);
            svg.rect([left, y + 1.0], [width, bar - 2.0], "after");
            let of = if all.len() > 1 { format!(" ({series})") } else { String::new() };
            svg.text([left + width + 6.0, y + bar - 4.0], Anchor::Start, &(label + &of));
        }
    }
    Some(svg.finish())
}

fn plain_digits(value: f64) -> String {
    format!("{value:.4}")
}

fn shortened(name: &str) -> String {
    match name.chars().count() {
        0..=14 => name.to_owned(),
        _ => name.chars().take(13).chain(['…']).collect(),
    }
}
