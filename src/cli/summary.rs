//! What `identify` says on stdout.

use std::fmt::Write;

use crate::assess::Errors;
use crate::problem::Problem;
use crate::recipe::{MeasuredSeries, Solution};
use crate::urdf::JointKind;

/// Most lines of one kind before the rest is counted.
const MOST_LINES: usize = 12;

/// The short table: what was read, what was left out and why, joint noise, accuracy, what could not be determined, verdict.
pub(super) fn text(solution: &Solution, series: &[MeasuredSeries]) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = write_all(&mut out, solution, series);
    out
}

fn write_all(out: &mut String, s: &Solution, series: &[MeasuredSeries]) -> std::fmt::Result {
    let p = &s.problem;
    let chain = &s.state.robot.chain;
    writeln!(
        out,
        "robot     {} ({} -> {}, {} moving joints)",
        chain.robot,
        chain.base,
        chain.tip,
        chain.readings.len()
    )?;
    for (k, one) in series.iter().enumerate() {
        let images: Vec<_> = p.images.iter().filter(|i| i.series == k).collect();
        let used = images.iter().filter(|i| i.rejected.is_none()).count();
        let observations: usize = images.iter().filter(|i| i.rejected.is_none()).map(|i| i.used().count()).sum();
        writeln!(
            out,
            "series    {}: {used} of {} images used, {observations} markers observed, {}x{} px",
            one.name,
            images.len(),
            one.width_px,
            one.height_px
        )?;
    }
    left_out(out, p)?;
    limited(
        out,
        "start",
        s.starts.iter().filter(|v| v.won).map(|v| format!("{}: {} ({})", v.of, v.origin, v.verdict)),
    )?;
    for (k, name) in p.cameras.iter().enumerate() {
        let c = &s.state.cameras[k].parameters;
        let sigma = s.covariance.sigma(p.layout.cameras[k].start);
        writeln!(
            out,
            "camera    {name}: fx {:.2} +- {sigma:.2}, fy {:.2}, centre ({:.2}, {:.2}) px; image noise {:.3} px per axis",
            c[0],
            c[1],
            c[2],
            c[3],
            image_noise_px(s, k)
        )?;
    }
    writeln!(
        out,
        "free pose {:.3} px RMS per point over {} observations",
        s.free_poses.rms_px, s.free_poses.observations
    )?;
    joint_noise(out, s)?;
    accuracy(out, s)?;
    undetermined(out, s)?;
    limited(out, "note", s.notices.iter().map(ToString::to_string))?;
    if s.failed_gates.is_empty() {
        writeln!(out, "verdict   good")
    } else {
        writeln!(out, "verdict   NOT TO BE TRUSTED:")?;
        s.failed_gates.iter().try_for_each(|g| writeln!(out, "          - {g}"))
    }
}

fn limited(out: &mut String, label: &str, lines: impl Iterator<Item = String>) -> std::fmt::Result {
    let lines: Vec<String> = lines.collect();
    for line in lines.iter().take(MOST_LINES) {
        writeln!(out, "{label:<9} {line}")?;
    }
    if lines.len() > MOST_LINES {
        writeln!(out, "{label:<9} ... and {} more (all in the report)", lines.len() - MOST_LINES)?;
    }
    Ok(())
}

fn left_out(out: &mut String, p: &Problem) -> std::fmt::Result {
    let images = p.images.iter().filter_map(|i| i.rejected.as_ref().map(|r| format!("{}: {r}", i.name)));
    limited(out, "left out", images)?;
    let outliers: usize = p.used().map(|(_, i)| i.observations.len() - i.used().count()).sum();
    if outliers > 0 {
        writeln!(out, "left out  {outliers} single observations with large residuals")?;
    }
    Ok(())
}

/// Typical standard deviation of an observation per axis, px: stated sigma times the estimated factor.
fn image_noise_px(s: &Solution, camera: usize) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (_, image) in s.problem.used().filter(|(_, i)| i.camera == camera) {
        for o in image.used() {
            let determinant = o.information.determinant();
            if determinant > 0.0 {
                sum += determinant.powf(-0.5);
                count += 1.0;
            }
        }
    }
    (sum / f64::max(count, 1.0)).sqrt() * s.problem.noise.pixel_factor[camera]
}

fn joint_noise(out: &mut String, s: &Solution) -> std::fmt::Result {
    let chain = &s.state.robot.chain;
    for k in 0..s.problem.cameras.len() {
        let sigma = s.problem.joint_sigma(k);
        let parts: Vec<String> = (chain.readings.iter().zip(&chain.reading_kinds).zip(&sigma))
            .map(|((name, kind), s)| match kind {
                JointKind::Prismatic => format!("{name} {:.3} mm", 1e3 * s),
                _ => format!("{name} {:.3}", 1e3 * s),
            })
            .collect();
        let camera = if s.problem.cameras.len() > 1 { format!(" ({})", s.problem.cameras[k]) } else { String::new() };
        let tilt = s.problem.noise.tilt.get(k).map(|t| format!("; apparent tilt of the plate {:.3}", 1e3 * t));
        writeln!(out, "joints    noise in mrad{camera}: {}{}", parts.join(", "), tilt.unwrap_or_default())?;
    }
    Ok(())
}

fn accuracy(out: &mut String, s: &Solution) -> std::fmt::Result {
    let row = |e: &Errors| format!("{:>8.3} mm {:>8.3} px   worst image {:.3} mm", e.rms_mm, e.rms_px, e.worst_mm);
    writeln!(out, "accuracy  of images that the fit had not seen ({} folds), RMS over the markers:", s.accuracy.folds)?;
    writeln!(out, "          nominal    {}", row(&s.accuracy.nominal))?;
    writeln!(out, "          calibrated {}", row(&s.accuracy.calibrated))
}

/// Share of the prior variance below which a parameter counts as not determined by the data.
const LEAST_SHARE: f64 = 0.1;

fn undetermined(out: &mut String, s: &Solution) -> std::fmt::Result {
    let layout = &s.problem.layout;
    let robot = layout.robot();
    let gauge = GaugeNames::of(s);
    let weak: Vec<&str> = robot
        .clone()
        .filter(|&c| {
            let column = &layout.columns[c];
            column.free && 1.0 - (s.covariance.sigma(c) / column.prior_sigma).powi(2) < LEAST_SHARE
        })
        .map(|c| layout.columns[c].name.trim_start_matches("robot/"))
        .filter(|name| !gauge.contains(name))
        .collect();
    writeln!(out, "gauge     {}", gauge.in_words())?;
    if weak.is_empty() {
        return writeln!(out, "unknown   nothing else: the data determine every robot parameter");
    }
    writeln!(
        out,
        "unknown   {} of {} robot parameters stay near nominal, the data say little of them: {}",
        weak.len(),
        robot.len(),
        grouped(&weak)
    )
}

/// Robot parameters that no series can tell from the pose of plate and camera.
struct GaugeNames {
    first: Vec<String>,
    last: Vec<String>,
}

impl GaugeNames {
    fn of(s: &Solution) -> Self {
        let chain = &s.state.robot.chain;
        let moving = |j: &&crate::urdf::Joint| j.drive.is_some();
        let before = chain.joints.iter().take_while(|j| j.drive.is_none());
        let after = chain.joints.iter().rev().take_while(|j| j.drive.is_none());
        let mut first: Vec<String> =
            before.chain(chain.joints.iter().find(moving)).map(|j| format!("{}/origin", j.name)).collect();
        let mut last: Vec<String> = after.map(|j| format!("{}/origin", j.name)).collect();
        first.extend(chain.readings.first().map(|r| format!("{r}.offset")));
        last.extend(chain.readings.last().map(|r| format!("{r}.offset")));
        Self { first, last }
    }

    fn contains(&self, name: &str) -> bool {
        self.first
            .iter()
            .chain(&self.last)
            .any(|g| name == g || name.strip_prefix(g.as_str()).is_some_and(|rest| rest.starts_with('.')))
    }

    fn in_words(&self) -> String {
        let (first, last) = (self.first.join(", "), self.last.join(", "));
        format!(
            "{first} cannot be told from the pose of the plate, {last} not from that of the camera: they need not be"
        )
    }
}

/// `joint_1/origin.x`, `joint_1/origin.y` -> `joint_1/origin (x y)`.
fn grouped(names: &[&str]) -> String {
    let mut groups: Vec<(&str, Vec<&str>)> = Vec::new();
    for name in names {
        let (block, component) = name.rsplit_once('.').unwrap_or((name, ""));
        match groups.last_mut().filter(|(b, _)| *b == block) {
            Some((_, components)) => components.push(component),
            None => groups.push((block, vec![component])),
        }
    }
    let parts: Vec<String> = groups.iter().map(|(b, c)| format!("{b} ({})", c.join(" "))).collect();
    parts.join(", ")
}
