//! The long table of `identify -v` and `show --all`: all of it stands in solution.json.

use std::collections::BTreeSet;
use std::fmt::Write;

use super::summary::{in_words, with_remedy};
use crate::assess::{Cause, Errors, Identifiability, UnknownDirection};
use crate::error::Notice;
use crate::identify::{Comparison, Estimator, LensEvidence};
use crate::linalg::median;
use crate::output::parameter_words::{self, grouped};
use crate::output::solution_json::{EstimateRecord, PlateRecord, SolutionRecord};
use crate::output::verdict::{Trust, Verdict};
use crate::problem::{InstrumentKind, OriginPrior, short_name};
use crate::urdf::JointKind;

/// Most lines of one kind before the rest is counted.
const MOST_LINES: usize = 12;

/// Most lines of advice of one kind: the table stays short, the report has them all.
const MOST_ADVICE: usize = 3;

/// The table: what was read, what was left out and why, joint noise, accuracy, what could not be determined, verdict.
pub fn text(record: &SolutionRecord) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = write_all(&mut out, record);
    out
}

/// What stops can tell, before the solve.
pub fn of_stops(found: &Identifiability) -> String {
    let mut out = String::new();
    // No report holds the rest.
    let _ = identifiability(&mut out, found, "the stops determine", usize::MAX);
    let frames = found.unknown.iter().filter(|d| d.cause != Cause::Stops).map(direction);
    let _ = at_most(usize::MAX, &mut out, "frames", frames);
    out
}

/// Every parameter with sigma, prior and share of data.
pub fn parameters(r: &SolutionRecord) -> String {
    let shown = |v: Option<f64>| v.map_or("-".to_owned(), |v| format!("{v:.4e}"));
    let mut out =
        String::from("parameter, unit: value, sigma, sigma by the scatter of images, prior sigma, share of data\n");
    for e in &r.estimates {
        let share = e.share_of_data.map_or("-".to_owned(), |s| format!("{:.0} %", 100.0 * s));
        let sigma = if e.free { shown(e.sigma) } else { "fixed".to_owned() };
        let (value, clustered, prior) = (shown(e.value), shown(e.sigma_clustered), shown(e.prior_sigma));
        out += &format!("{}, {}: {value}, {sigma}, {clustered}, {prior}, {share}\n", short_name(&e.name), e.unit);
    }
    out
}

fn write_all(out: &mut String, r: &SolutionRecord) -> std::fmt::Result {
    verdict(out, r)?;
    flange(out, r)?;
    accuracy(out, r)?;
    let robot = &r.robot;
    let moved = match r.has_no_robot() {
        true => "poses of the controller".to_owned(),
        false => format!("{} moving joints", robot.readings.len()),
    };
    writeln!(out, "robot     {} ({} -> {}, {moved})", robot.name, robot.base, robot.tip)?;
    if r.estimator != Estimator::Joint {
        writeln!(out, "estimator {}; by default the fit is joint", r.estimator.title())?;
    }
    series(out, r)?;
    limited(
        out,
        "left out",
        r.images.iter().filter_map(|i| i.reason.as_ref().map(|why| format!("{}: {why}", i.name))),
    )?;
    let (left_out, used) = (r.statistics.observations_left_out, r.statistics.observations_used);
    if left_out > 0 {
        writeln!(out, "left out  {left_out} of {} observations, with large residuals", left_out + used)?;
    }
    limited(
        out,
        "start",
        r.starts.iter().filter(|v| v.won).map(|v| format!("{}: {} ({})", v.of, v.origin, v.reached)),
    )?;
    cameras(out, r)?;
    if r.statistics.free_pose_observations > 0 {
        writeln!(
            out,
            "alone     {:.3} px RMS per point with a stand-alone camera pose for every image, over {} observations",
            r.statistics.free_pose_rms_px, r.statistics.free_pose_observations
        )?;
    }
    marker_tolerance(out, r)?;
    joint_noise(out, r)?;
    twists(out, r)?;
    evidences(out, r)?;
    lenses(out, r)?;
    two_stage(out, r)?;
    map(out, r)?;
    scales(out, r)?;
    undetermined(out, r)?;
    if let Some(found) = &r.identifiability {
        identifiability(out, found, "the data determine", MOST_ADVICE)?;
    }
    limited(out, "note", Notice::said_once(&r.notices).iter().map(Notice::coded))
}

fn series(out: &mut String, r: &SolutionRecord) -> std::fmt::Result {
    for one in &r.series {
        let images = || r.images.iter().filter(|i| i.series == one.name);
        let used = || images().filter(|i| i.is_used());
        let observations: usize = used().map(|i| i.observations.reason.iter().filter(|o| o.is_none()).count()).sum();
        if images().next().is_none() {
            let of_series = r.bodies.stops.iter().filter(|s| s.series == one.name).count();
            writeln!(out, "series    {}: no images; {of_series} stops", one.name)?;
            continue;
        }
        writeln!(
            out,
            "series    {}: {} of {} images used, {observations} observations, {}x{} px",
            one.name,
            used().count(),
            images().count(),
            one.width_px,
            one.height_px
        )?;
    }
    Ok(())
}

fn verdict(out: &mut String, r: &SolutionRecord) -> std::fmt::Result {
    let verdict = Verdict::of(r);
    writeln!(out, "verdict   {}", in_words(&verdict))?;
    let reasons = match verdict.trust {
        Trust::Failed => r.failed_gates.clone(),
        _ => verdict.reasons.iter().map(with_remedy).collect(),
    };
    reasons.iter().try_for_each(|reason| writeln!(out, "          - {reason}"))
}

/// What may be promised of the corrected robot: by model and covariance.
fn flange(out: &mut String, r: &SolutionRecord) -> std::fmt::Result {
    let Some(e) = &r.flange else { return Ok(()) };
    let mm = |m: f64| format!("{:>8.3} mm", 1e3 * m);
    writeln!(
        out,
        "flange    expected error of its position relative to {} {}, by model and covariance, RMS:",
        r.flange_is_relative_to(),
        r.flange_holds()
    )?;
    let (alone_m, _) = e.best_urdf_m();
    if r.has_no_robot() {
        writeln!(
            out,
            "          as given   {}   poses of the controller, with camera and plate as found",
            mm(alone_m)
        )?;
        let scatter_mm = 1e3 * e.scatter_m;
        return writeln!(
            out,
            "          {scatter_mm:.3} mm of it is how these poses are off from stop to stop: errors of the controller's own model of the robot among them, which are others between them; --urdf takes them away"
        );
    }
    writeln!(out, "          nominal    {}   base and tool that fit it best", mm(e.nominal_m))?;
    writeln!(out, "          calibrated {}   corrected URDF alone", mm(alone_m))?;
    if r.beyond_urdf() {
        if e.alone_m.is_some() {
            let words = "the URDF that belongs to compensation.toml, without it";
            writeln!(out, "          calibrated {}   {words}", mm(e.urdf_m))?;
        }
        writeln!(out, "          calibrated {}   with compensation.toml", mm(e.model_m))?;
    }
    writeln!(out, "          {:.3} mm of each is noise from stop to stop, which no model takes away", 1e3 * e.scatter_m)
}

fn limited(out: &mut String, label: &str, lines: impl Iterator<Item = String>) -> std::fmt::Result {
    at_most(MOST_LINES, out, label, lines)
}

fn at_most(most: usize, out: &mut String, label: &str, lines: impl Iterator<Item = String>) -> std::fmt::Result {
    let lines: Vec<String> = lines.collect();
    for line in lines.iter().take(most) {
        writeln!(out, "{label:<9} {line}")?;
    }
    if lines.len() > most {
        writeln!(out, "{label:<9} ... and {} more (all in the report)", lines.len() - most)?;
    }
    Ok(())
}

fn cameras(out: &mut String, r: &SolutionRecord) -> std::fmt::Result {
    for (k, camera) in r.cameras.iter().enumerate() {
        let value = |k: usize| camera.parameters.get(k).map_or(0.0, |(_, v)| *v);
        let first = format!("camera/{}/", camera.name);
        let sigma = r.estimates.iter().find(|e| e.name.starts_with(&first)).and_then(|e| e.sigma);
        let sigma = sigma.map_or("fixed".to_owned(), |s| format!("+- {s:.2}"));
        let known = camera.projection_known(r.photogrammetry().seen_by(k).map(|(uv, _)| uv));
        let known = known.map_or(String::new(), |[seen, largest]| {
            format!("; projection known to {seen:.3} px where markers were seen, at worst {largest:.3} px")
        });
        let loss = camera.ros_loss_px.map_or(String::new(), |[rms, most]| {
            format!("; {} lens, which camera.yaml misses by {rms:.3} px RMS, at most {most:.3} px", camera.lens.name())
        });
        writeln!(
            out,
            "camera    {}: fx {:.2} {sigma}, fy {:.2}, centre ({:.2}, {:.2}) px; image noise {:.3} px per axis{known}{loss}",
            camera.name,
            value(0),
            value(1),
            value(2),
            value(3),
            image_noise_px(r, k)
        )?;
    }
    Ok(())
}

/// Typical standard deviation of an observation per axis, px: stated sigma times the estimated factor.
fn image_noise_px(r: &SolutionRecord, camera: usize) -> f64 {
    let determinants = r.photogrammetry().seen_by(camera).map(|(_, c)| c[0] * c[2] - c[1] * c[1]).filter(|d| *d > 0.0);
    let (sum, count) = determinants.fold((0.0, 0.0), |(s, n), d| (s + d.sqrt(), n + 1.0));
    (sum / f64::max(count, 1.0)).sqrt() * r.cameras[camera].pixel_factor
}

fn marker_tolerance(out: &mut String, r: &SolutionRecord) -> std::fmt::Result {
    for plate in r.plates.iter().filter(|p| p.tolerance_factor != 1.0) {
        let stated = 1e3 * median(&plate.prior_sigma_m).unwrap_or(plate.tolerance_m);
        let found = plate.tolerance_factor * stated;
        writeln!(out, "plate     {}: markers are off by {found:.3} mm per axis, {stated:.3} mm stated", plate.name)?;
    }
    Ok(())
}

fn joint_noise(out: &mut String, r: &SolutionRecord) -> std::fmt::Result {
    let all = r.stop_noise();
    for (name, noise) in &all {
        let readings = r.robot.readings.iter().zip(&r.robot.reading_kinds).zip(&noise.joint);
        let parts: Vec<String> = readings
            .enumerate()
            .map(|(k, ((name, kind), s))| {
                let unit = if *kind == JointKind::Prismatic { " mm" } else { "" };
                let told = match noise.joint_interval.get(k) {
                    Some([Some(low), Some(high)]) if *low == 0.0 => format!(" (below {:.3})", 1e3 * high),
                    Some([Some(low), Some(high)]) => format!(" ({:.3} to {:.3})", 1e3 * low, 1e3 * high),
                    _ => String::new(),
                };
                format!("{name} {:.3}{unit}{told}", 1e3 * s)
            })
            .collect();
        let of = if all.len() > 1 { format!(" ({name})") } else { String::new() };
        let saw_no_plate =
            r.series.iter().any(|s| s.name == *name) && r.images.iter().all(|image| image.series != *name);
        let tilt = Some(noise.apparent_tilt_rad).filter(|t| *t > 0.0 && !saw_no_plate);
        let tilt = tilt.map(|t| format!("; apparent tilt of the plate {:.3}", 1e3 * t));
        let shift = noise.apparent_shift.map(|shift| {
            let [spin, across, along] = [shift.spin_rad, shift.across_m, shift.along_m].map(|size| 1e3 * size);
            format!(", spin {spin:.3}, shift across the optical axis {across:.3} mm, along it {along:.3} mm")
        });
        let displaced = [tilt, shift].map(Option::unwrap_or_default).concat();
        let slides = r.robot.reading_kinds.contains(&JointKind::Prismatic);
        let unit = if slides { "mrad, where a joint slides in mm" } else { "mrad" };
        writeln!(out, "joints    noise in {unit} (95 %){of}: {}{displaced}", parts.join(", "))?;
    }
    Ok(())
}

/// How far the origins of this robot are from nominal, beside what is assumed of robots.
fn twists(out: &mut String, r: &SolutionRecord) -> std::fmt::Result {
    let (factor, usual) = (r.robot.twist_factor, OriginPrior::default());
    if factor == 1.0 {
        return Ok(());
    }
    let [mm, mrad] = [usual.translation_m, usual.rotation_rad].map(|size| 1e3 * size);
    writeln!(
        out,
        "origins   of the joints are off by {:.2} mm and {:.2} mrad per axis ({factor:.2} times the usual {mm} mm and {mrad} mrad)",
        factor * mm,
        factor * mrad
    )
}

fn evidences(out: &mut String, r: &SolutionRecord) -> std::fmt::Result {
    if r.evidences.is_empty() {
        return Ok(());
    }
    let all: Vec<String> = (r.evidences.iter())
        .map(|e| format!("{} {:.1} ({} parameters)", e.model.name(), e.log_evidence, e.parameters))
        .collect();
    writeln!(out, "evidence  logarithm, relative to the best model: {}", all.join(", "))
}

fn lenses(out: &mut String, r: &SolutionRecord) -> std::fmt::Result {
    for camera in &r.cameras {
        let all: Vec<&LensEvidence> = r.lenses.iter().filter(|l| l.camera == camera.name).collect();
        let Some(taken) = all.iter().find(|l| l.taken) else { continue };
        let each: Vec<String> = all.iter().map(|l| format!("{} {:.1}", l.lens.name(), l.log_evidence)).collect();
        let why = match all.len() {
            1 => "its residuals show no pattern that asks for another".to_owned(),
            _ => format!("evidence, logarithm, relative to the best: {}", each.join(", ")),
        };
        writeln!(out, "lens      of {}: {}; {why}", camera.name, taken.lens.name())?;
    }
    Ok(())
}

fn accuracy(out: &mut String, r: &SolutionRecord) -> std::fmt::Result {
    let by_images = !r.images.is_empty();
    let row = |e: &Errors| match by_images {
        true => format!("{:>8.3} mm {:>8.3} px   worst image {:.3} mm", e.rms_mm, e.rms_px, e.worst_mm),
        false => format!("{:>8.3} mm   worst stop {:.3} mm", e.rms_mm, e.worst_mm),
    };
    let [unseen, over] = match by_images {
        true => {
            ["images that the fit had not seen", "where the plate stood, repeatability included, RMS over the markers"]
        }
        false => ["stops that the fit had not seen", "repeatability included, RMS over the measurements"],
    };
    writeln!(out, "held out  {unseen} ({} folds), {over}:", r.accuracy.folds)?;
    writeln!(out, "          nominal    {}", row(&r.accuracy.nominal))?;
    writeln!(out, "          calibrated {}", row(&r.accuracy.calibrated))
}

/// Two-stage fits beside the joint one.
fn two_stage(out: &mut String, r: &SolutionRecord) -> std::fmt::Result {
    let comparison = r.two_stage.as_ref();
    let Some((row, ratio)) = comparison.and_then(Comparison::best_two_stage) else { return Ok(()) };
    writeln!(
        out,
        "two-step  the best two-step calibration from the same images ({}) has {ratio} times the error of the joint fit",
        row.estimator.title()
    )
}

/// What the lengths of the robot hang on.
fn scales(out: &mut String, r: &SolutionRecord) -> std::fmt::Result {
    let of_plates = r.plate_sizes().filter_map(|(e, plate)| scale(e, plate));
    let measure = r.bodies.instruments.iter().filter(|i| i.kind != InstrumentKind::Socket);
    let of_trackers = measure.map(|i| {
        format!(
            "scale     the scale of {} counts as exact, and is in no sigma: 0.1 % is 1 mm a metre, 1 ppm 1 um",
            i.name
        )
    });
    let lines: BTreeSet<String> = of_plates.chain(of_trackers).collect();
    lines.into_iter().try_for_each(|line| writeln!(out, "{line}"))
}

fn scale(e: &EstimateRecord, plate: &PlateRecord) -> Option<String> {
    let (prior, sigma) = (e.prior_sigma?, e.sigma?);
    let known =
        format!("scale     the robot's lengths follow the plate, whose size is known to {:.3} %", 100.0 * sigma);
    let all_else = e.share_of_data.filter(|s| *s > 0.0).map(|s| 100.0 * prior / s.sqrt());
    Some(match (plate.scale, all_else) {
        (None, Some(all_else)) => format!(
            "{known} if its file is right (nobody measured it, and all else tells it to {all_else:.2} %); 0.1 % is 1 mm a metre: give [scale]"
        ),
        _ => known,
    })
}

/// Uncertainty of the flange over the workspace.
fn map(out: &mut String, r: &SolutionRecord) -> std::fmt::Result {
    let sorted = |covered: bool| {
        let mut all: Vec<f64> = r.workspace.iter().filter(|w| w.covered || !covered).map(|w| 1e3 * w.sigma_m).collect();
        all.sort_by(f64::total_cmp);
        all
    };
    let (inside, all) = (sorted(true), sorted(false));
    let at = |v: &[f64], share: f64| v.get(((v.len() as f64 - 1.0) * share).max(0.0) as usize).copied();
    if let (Some(median), Some(most)) = (at(&inside, 0.5), at(&inside, 0.95)) {
        writeln!(
            out,
            "map       sigma of the flange relative to {}, by the model: {median:.3} mm (95 % below {most:.3} mm) in the region of the stops{}",
            r.flange_is_relative_to(),
            at(&all, 1.0).map_or(String::new(), |w| format!(", up to {w:.2} mm elsewhere"))
        )?;
    }
    let Some((scatter, ratio)) = r.scatter.as_ref().and_then(|s| s.flange_ratio.map(|ratio| (s, ratio))) else {
        return Ok(());
    };
    let larger = if scatter.larger_stated { "; the larger ones are stated" } else { "" };
    writeln!(out, "scatter   the images scatter {ratio:.2} times as much as the noise model says (flange){larger}")
}

fn undetermined(out: &mut String, r: &SolutionRecord) -> std::fmt::Result {
    let Some(found) = &r.identifiability else { return Ok(()) };
    writeln!(out, "frames    {}", unobservable(found))?;
    let weak: Vec<&str> = r.undetermined().iter().map(|e| e.name.as_str()).collect();
    if weak.is_empty() {
        return writeln!(out, "unknown   nothing else: the data determine every robot parameter");
    }
    writeln!(
        out,
        "unknown   {} of {} robot parameters stay near nominal, the data say little of them: {}",
        weak.len(),
        r.robot_parameters().count(),
        grouped(weak.iter().copied()).join(", ")
    )
}

/// Which parameters no series can tell from the pose of plate and camera.
fn unobservable(found: &Identifiability) -> String {
    let of = |cause: Cause| {
        let names = found.unknown.iter().filter(|d| d.cause == cause).flat_map(|d| d.parameters.iter());
        let mut blocks: Vec<&str> = Vec::new();
        for (name, _) in names {
            let block = match name.rsplit_once('.') {
                Some((block, _)) if block.ends_with(".origin") => block,
                _ => name.as_str(),
            };
            if !blocks.contains(&block) {
                blocks.push(block);
            }
        }
        blocks.join(", ")
    };
    match (of(Cause::Base), of(Cause::Tip)) {
        (base, tip) if base.is_empty() && tip.is_empty() => {
            "every parameter is observable beside target pose and hand-eye transform".into()
        }
        (base, tip) => format!(
            "{} are unobservable beside the target pose, {} beside the hand-eye transform: nothing is lost by that",
            if base.is_empty() { "nothing" } else { &base },
            if tip.is_empty() { "nothing" } else { &tip }
        ),
    }
}

fn identifiability(out: &mut String, found: &Identifiability, who: &str, most: usize) -> std::fmt::Result {
    writeln!(
        out,
        "known     {who} {} of the {} directions of the robot that are identifiable ({} free parameters)",
        found.rank, found.tellable, found.parameters
    )?;
    if let Some(o) = found.observability {
        writeln!(
            out,
            "observe   O1 {:.3}, O2 {:.2e}, O3 {:.3}, O4 {:.2e}, O5 {:.3} (observability indices over these directions, in units of the priors)",
            o.o1, o.o2, o.o3, o.o4, o.o5
        )?;
    }
    let by_stops = found.unknown.iter().filter(|d| d.cause == Cause::Stops);
    at_most(
        most,
        out,
        "unknown",
        by_stops.map(|d| format!("{}: {}", direction(d), d.remedy.as_deref().unwrap_or("more stops"))),
    )?;
    at_most(
        most,
        out,
        "pairs",
        (found.correlations.iter())
            .map(|c| format!("{} and {} are correlated ({:.3}): {}", c.first, c.second, c.correlation, c.remedy)),
    )?;
    at_most(
        most,
        out,
        "next",
        found.next.iter().map(|a| format!("{} (takes {:.0} % off what is left unknown)", a.words, 100.0 * a.gain)),
    )
}

/// Parameters of a direction in words, and why the data do not tell it.
fn direction(d: &UnknownDirection) -> String {
    let why = match d.cause {
        Cause::Base => " (unobservable beside the target pose)",
        Cause::Tip => " (unobservable beside the hand-eye transform)",
        Cause::Redundant => " (do the same to this robot)",
        Cause::Idle => " (does nothing to this robot)",
        Cause::Stops => "",
    };
    parameter_words::direction(d) + why
}
