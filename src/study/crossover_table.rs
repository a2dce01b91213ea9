//! The study of estimators, as Markdown and as one self-contained page.

use std::fmt::Write;

use maud::{Markup, PreEscaped, html};

use super::crossover::{Study, StudyCell};
use crate::assess::Ratio;
use crate::identify::Estimator;
use crate::output::comparison::ratio_text;
use crate::output::report::page::frame::page;
use crate::study::made_with::made_with;

/// How to read the estimators, for both reports.
fn legend() -> Vec<String> {
    Estimator::ALL.iter().map(|e| format!("{}: {}", e.letter(), e.title())).collect()
}

/// What the figures say, in words.
pub fn study_verdict(study: &Study) -> Vec<String> {
    let (wins, losses, ties) = outcomes(study);
    let list = |cells: &[(&StudyCell, Ratio)]| -> String {
        let place = |c: &StudyCell| format!("ratio {} with {} markers", c.ratio, c.markers);
        cells.iter().map(|(c, r)| format!("{} ({:.3})", place(c), r.value)).collect::<Vec<_>>().join(", ")
    };
    let mut words = vec![format!(
        "The joint fit with joint noise (F) is better than every two-stage fit (A to D), beyond the 95 % interval, in {} of {} cells; \
         no difference is seen in {ties}; the best two-stage fit is better in {}.",
        wins.len(),
        study.cells.len(),
        losses.len()
    )];
    if !wins.is_empty() {
        words.push(format!("Joint wins at: {} (error of the best two-stage fit over that of F).", list(&wins)));
    }
    if !losses.is_empty() {
        words.push(format!("Joint loses at: {}.", list(&losses)));
    }
    words.extend(Estimator::ALL.iter().enumerate().take(5).map(|(k, e)| range(study, k, e)));
    let worst = |least_noise: f64| {
        let cells = study.cells.iter().filter(|c| c.joint_noise_rad >= least_noise);
        cells.map(StudyCell::joint_over_best).fold(0.0, f64::max)
    };
    words.push(format!(
        "In its worst cell the error of F is {:.3} times that of the best of A to F; {:.3} times where there is joint noise.",
        worst(0.0),
        worst(f64::MIN_POSITIVE)
    ));
    words
}

/// Cells, each with the ratio of its errors.
type Judged<'a> = Vec<(&'a StudyCell, Ratio)>;

/// Cells in which F is better than the best two-stage estimator that knows the repeatability, and those in which it is worse,
/// and how many show no difference.
fn outcomes(study: &Study) -> (Judged<'_>, Judged<'_>, usize) {
    let (mut wins, mut losses, mut ties) = (Vec::new(), Vec::new(), 0);
    for cell in &study.cells {
        let rivals = cell.to_joint[..4].iter().flatten();
        match rivals.copied().min_by(|a, b| a.value.total_cmp(&b.value)) {
            Some(best) if best.low > 1.0 => wins.push((cell, best)),
            Some(best) if best.high < 1.0 => losses.push((cell, best)),
            Some(_) => ties += 1,
            None => {}
        }
    }
    (wins, losses, ties)
}

/// Least and largest error of an estimator over that of F.
fn range(study: &Study, k: usize, estimator: &Estimator) -> String {
    let extreme = |f: fn(f64, f64) -> f64, start: f64| {
        study.cells.iter().filter_map(|c| c.to_joint[k]).map(|r| r.value).fold(start, f)
    };
    format!(
        "{} ({}): error {:.2} to {:.2} times that of F.",
        estimator.letter(),
        estimator.title(),
        extreme(f64::min, f64::INFINITY),
        extreme(f64::max, 0.0)
    )
}

fn study_setup(study: &Study) -> String {
    let r = &study.request;
    let noise = 1e3 * r.pixel_sigma_px;
    format!(
        "Robot {}, {} images a series, {} worlds a cell, robot errors of 0.3 mm, 1 mrad and offsets of 3 mrad, observations with \
         {noise:.0} thousandths of a pixel of noise, marker positions known to 0.05 mm; all estimators share data, priors and frames. Error: RMS over \
         the worlds of the flange position relative to the plate at 60 joint vectors that took no part, plate and tool frames aligned. Ratio: \
         repeatability (joint noise seen at the camera) over the error of the position of a free camera pose.",
        r.chain.robot, r.images, r.seeds
    )
}

/// The study as Markdown.
pub fn study_markdown(study: &Study, command: &str) -> String {
    let mut out = format!(
        "# Two-step calibration against the joint fit\n\n`{command}` ({})\n\n{}\n\n",
        made_with(),
        study_setup(study)
    );
    for line in study_verdict(study) {
        let _ = writeln!(out, "- {line}");
    }
    out.push('\n');
    for line in legend() {
        let _ = writeln!(out, "- {line}");
    }
    out.push_str("\nFlange error in mm; below it the ratio to F with its 95 % bootstrap interval over worlds.\n\n");
    out.push_str("| markers | ratio | joint noise mrad | pose sigma mm | A | B | C | D | E | F | F over best |\n");
    out.push_str("|---|---|---|---|---|---|---|---|---|---|---|\n");
    for c in &study.cells {
        let _ =
            write!(out, "| {} | {} | {:.4} | {:.4} |", c.markers, c.ratio, 1e3 * c.joint_noise_rad, c.pose_sigma_mm);
        for k in 0..6 {
            let failed = if c.failed[k] > 0 { format!("<br>{} failed", c.failed[k]) } else { String::new() };
            let ratio = if k < 5 { format!("<br>{}", ratio_text(c.to_joint[k])) } else { String::new() };
            let _ = write!(out, " {:.4}{ratio}{failed} |", c.flange_mm[k]);
        }
        let _ = writeln!(out, " {:.3} |", c.joint_over_best());
    }
    out
}

const STYLE: &str = "\
body{font:15px/1.5 sans-serif;max-width:62em;margin:2em auto;padding:0 1em}\
table{border-collapse:collapse;font-size:12px}\
td,th{border:1px solid #ccc;padding:3px 6px;text-align:right}small{color:#555}";

const COLOURS: [&str; 6] = ["#8c8c8c", "#b8860b", "#2a8f5b", "#1f5fbf", "#c0392b", "#000000"];

/// The field of a panel in its picture: cells from left to right, errors over that of F upwards, logarithmic.
struct Field {
    left: f64,
    top: f64,
    width: f64,
    height: f64,
    cells: f64,
    /// Decadic logarithms of the least and the largest error.
    low: f64,
    high: f64,
}

impl Field {
    fn x(&self, cell: usize) -> f64 {
        self.left + self.width * (cell as f64 + 0.5) / self.cells
    }

    fn y(&self, error: f64) -> f64 {
        self.top + self.height * (self.high - error.log10()) / (self.high - self.low)
    }

    /// Horizontal lines with their numbers.
    fn grid(&self, svg: &mut String) {
        let ticks = [0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0, 100.0];
        for tick in ticks.into_iter().filter(|t| (self.low..=self.high).contains(&f64::log10(*t))) {
            let _ = write!(
                svg,
                "<line x1=\"{0}\" x2=\"{1:.1}\" y1=\"{2:.1}\" y2=\"{2:.1}\" stroke=\"#ddd\"/><text x=\"{3:.1}\" y=\"{4:.1}\" text-anchor=\"end\">{tick}</text>",
                self.left,
                self.left + self.width,
                self.y(tick),
                self.left - 4.0,
                self.y(tick) + 4.0
            );
        }
    }

    /// The errors of an estimator as a line, with their intervals where it is not F itself.
    fn curve(&self, svg: &mut String, cells: &[&StudyCell], estimator: usize) {
        let colour = COLOURS[estimator];
        let mut points = String::new();
        for (k, c) in cells.iter().enumerate() {
            let Some(r) = c.to_joint[estimator] else { continue };
            let _ = write!(points, "{:.1},{:.1} ", self.x(k), self.y(r.value));
            if estimator < 5 {
                let (a, b) = (self.y(r.low.max(10f64.powf(self.low))), self.y(r.high));
                let _ = write!(
                    svg,
                    "<line x1=\"{0:.1}\" x2=\"{0:.1}\" y1=\"{a:.1}\" y2=\"{b:.1}\" stroke=\"{colour}\" stroke-opacity=\"0.5\"/>",
                    self.x(k) + 2.0 * (estimator as f64 - 2.0)
                );
            }
        }
        let _ = write!(svg, "<polyline points=\"{points}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.6\"/>");
    }
}

/// One panel for each plate: error over that of F, logarithmic, against the ratio.
fn panel(cells: &[&StudyCell], title: &str) -> String {
    let (w, h, left, top) = (360.0, 250.0, 46.0, 26.0);
    let values = || cells.iter().flat_map(|c| c.to_joint.iter().flatten().map(|r| r.value));
    let field = Field {
        left,
        top,
        width: w - left - 12.0,
        height: h - top - 40.0,
        cells: cells.len() as f64,
        low: values().fold(0.9, f64::min).log10() - 0.02,
        high: values().fold(2.0, f64::max).log10() + 0.05,
    };
    let mut svg = format!(
        "<svg viewBox=\"0 0 {w} {h}\" width=\"{w}\" height=\"{h}\" font-family=\"sans-serif\" font-size=\"11\"><text x=\"{left}\" y=\"14\" font-weight=\"bold\">{title}</text>"
    );
    field.grid(&mut svg);
    let mut centred = |x: f64, y: f64, text: &dyn std::fmt::Display| {
        let _ = write!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"middle\">{text}</text>");
    };
    cells.iter().enumerate().for_each(|(k, c)| centred(field.x(k), top + field.height + 15.0, &c.ratio));
    centred(left + field.width / 2.0, h - 8.0, &"repeatability / pose error");
    (0..COLOURS.len()).for_each(|estimator| field.curve(&mut svg, cells, estimator));
    svg.push_str("</svg>");
    svg
}

/// The study as one self-contained page.
pub fn study_html(study: &Study, command: &str) -> String {
    let mut plates: Vec<u32> = study.cells.iter().map(|c| c.markers).collect();
    plates.dedup();
    let panels: Vec<String> = plates
        .iter()
        .map(|m| {
            let cells: Vec<&StudyCell> = study.cells.iter().filter(|c| c.markers == *m).collect();
            panel(&cells, &format!("{m} markers an image: flange error over that of F"))
        })
        .collect();
    let body = html! {
        h1 { "Two-step calibration against the joint fit" }
        p { code { (command) } " (" (made_with()) ")" }
        p { (study_setup(study)) }
        ul { @for line in study_verdict(study) { li { (line) } } }
        p { @for (line, colour) in legend().iter().zip(COLOURS) { span style=(format!("color:{colour}")) { "\u{25A0} " } (line) br; } }
        div { @for p in &panels { (PreEscaped(p)) } }
        (table(study))
    };
    page("Two-step calibration against the joint fit", STYLE, &body)
}

fn table(study: &Study) -> Markup {
    html! {
        table {
            tr {
                th { "markers" } th { "ratio" } th { "joint noise mrad" } th { "pose sigma mm" }
                @for e in Estimator::ALL { th { (e.letter()) " mm" } }
                th { "F over best" }
            }
            @for c in &study.cells {
                tr {
                    td { (c.markers) } td { (c.ratio) }
                    td { (format!("{:.4}", 1e3 * c.joint_noise_rad)) } td { (format!("{:.4}", c.pose_sigma_mm)) }
                    @for k in 0..6 {
                        td {
                            (format!("{:.4}", c.flange_mm[k]))
                            @if k < 5 { br; small { (ratio_text(c.to_joint[k])) } }
                            @if c.failed[k] > 0 { br; small { (c.failed[k]) " failed" } }
                        }
                    }
                    td { (format!("{:.3}", c.joint_over_best())) }
                }
            }
        }
    }
}
