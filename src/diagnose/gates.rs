//! Quality gates: what a result must fulfil to be trusted, and remarks that do not stop anyone.

use super::loose::loose_mountings;
use super::shift::Shift;
use crate::assess::Worth;
use crate::assess::{Accuracy, median};
use crate::error::Notice;
use crate::fit::FreePoses;
use crate::problem::MeasuredSeries;
use crate::problem::{Problem, State};

/// Free-pose RMS beyond which the camera model does not explain the images, px per point.
const WORST_FREE_RMS_PX: f64 = 1.0;

/// Joint noise beyond which the readings do not explain the images, rad or m: robots repeat to some 0.1 mrad.
const WORST_JOINT_NOISE: f64 = 2e-3;

/// Joint noise that no robot in order has, rad or m: two to five times what was found of real ones.
const UNUSUAL_JOINT_NOISE: f64 = 5e-4;

/// Sigma of the flange that is no reason to distrust, mm.
const NO_MISS_MM: f64 = 1.0;

/// Share of the robot's images that may be left out in a result worth having.
const WORST_SHARE_LEFT_OUT: f64 = 0.25;

/// Share of single observations that may be left out: clean data lose 4e-5.
const WORST_SHARE_REJECTED: f64 = 0.05;

/// Times the median held-out error from which an image stands out.
const STANDS_OUT: f64 = 2.5;

/// Times the median sigma of a marker from which an image is badly seen.
const BLURRED: f64 = 2.0;

/// Most images that are named.
const MOST_IMAGES: usize = 4;

/// Prior sigmas beyond which a deviation is no longer within tolerance.
const BEYOND_TOLERANCE: f64 = 5.0;

/// Gates that failed, in words with the first thing to look at.
pub fn gates(
    problem: &Problem,
    series: &[MeasuredSeries],
    state: &State,
    free: &FreePoses,
    accuracy: &Accuracy,
    shifts: &[Shift],
    on_robot: usize,
) -> Vec<String> {
    let mut failed: Vec<String> = free.focus_change.iter().map(|f| format!("{f}; fix focus and zoom")).collect();
    if free.rms_px > WORST_FREE_RMS_PX {
        failed.push(format!(
            "camera: free poses leave {:.2} px per point; the camera model or the plate does not describe these images",
            free.rms_px
        ));
    }
    for (k, of) in series.iter().enumerate() {
        if let Some((joint, worst)) = noisiest_joint(problem, state, k).filter(|(_, s)| *s > WORST_JOINT_NOISE) {
            failed.push(format!(
                "joint noise: {:.1} mrad ({joint} most) in series {}; the readings do not explain the images: look for loose camera or plate, motion, wrong robot model{}",
                1e3 * worst,
                of.name,
                worst_predicted(problem, k, accuracy)
            ));
        }
    }
    failed.extend(loose_mountings(problem, state, shifts));
    let out = left_out(problem, on_robot);
    if out as f64 > WORST_SHARE_LEFT_OUT * on_robot as f64 {
        failed.push(format!("images: {out} of {on_robot} do not fit their joint readings"));
    }
    failed.extend(rejected_observations(problem));
    if accuracy.calibrated.rms_mm > accuracy.nominal.rms_mm {
        failed.push(format!(
            "hold-out: the corrected robot predicts images no better than the nominal one ({:.3} mm against {:.3} mm)",
            accuracy.calibrated.rms_mm, accuracy.nominal.rms_mm
        ));
    }
    failed
}

/// Where the corrected robot is known less well than the nominal one misses, in words; up to [`NO_MISS_MM`] it may be.
pub fn undetermined(worth: &Worth, accuracy: &Accuracy) -> Option<String> {
    let covered = worth.workspace.iter().filter(|w| w.covered);
    let usual = 1e3 * median(&covered.map(|w| w.sigma_m).collect::<Vec<f64>>())?;
    (usual > accuracy.nominal.rms_mm.max(NO_MISS_MM)).then(|| {
        format!(
            "flange: its place is known to {usual:.1} mm only in the region of the stops, and the nominal robot is off by {:.2} mm: these stops do \
             not determine the robot; see what is untold, and what to add",
            accuracy.nominal.rms_mm
        )
    })
}

/// The reading with the largest joint noise in a series, and its size, rad or m.
fn noisiest_joint<'a>(problem: &Problem, state: &'a State, series: usize) -> Option<(&'a str, f64)> {
    let sigmas = problem.joint_sigma(series).into_iter();
    let named = state.robot.chain.readings.iter().map(String::as_str).zip(sigmas);
    named.max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Images that the others predict far worse than usual, in words; empty where none stands out.
fn worst_predicted(problem: &Problem, series: usize, accuracy: &Accuracy) -> String {
    let errors = |i: usize| accuracy.per_image_mm[i].map(|[_, calibrated]| calibrated);
    let standing_out: Vec<String> = standing_out(problem, series, errors, STANDS_OUT)
        .into_iter()
        .map(|(mm, name)| format!("{name} ({mm:.1} mm)"))
        .collect();
    in_words("; the others predict worst", &standing_out)
}

/// Images whose markers are known far less well than usual: blurred, badly lit, far away.
fn worst_seen(problem: &Problem, series: usize) -> String {
    let sigma = |i: usize| {
        let sigmas: Vec<f64> = problem.images[i].used().map(|o| o.information.determinant().powf(-0.25)).collect();
        median(&sigmas)
    };
    let standing_out: Vec<String> = standing_out(problem, series, sigma, BLURRED)
        .into_iter()
        .map(|(px, name)| format!("{name} (sigma {px:.3} px)"))
        .collect();
    in_words("; blurred or badly seen", &standing_out)
}

fn in_words(what: &str, images: &[String]) -> String {
    let more = images.len().saturating_sub(MOST_IMAGES);
    let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
    let named: Vec<&str> = images.iter().take(MOST_IMAGES).map(String::as_str).collect();
    if named.is_empty() { String::new() } else { format!("{what} {}{rest}", named.join(", ")) }
}

/// Images of a series of which something is more than so many times its median, the largest first.
fn standing_out(problem: &Problem, series: usize, of: impl Fn(usize) -> Option<f64>, times: f64) -> Vec<(f64, &str)> {
    let own = problem.used().filter(|(_, image)| image.series == series);
    let mut all: Vec<(f64, &str)> =
        own.filter_map(|(i, image)| of(i).map(|value| (value, image.name.as_str()))).collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let usual = all.get(all.len() / 2).map_or(0.0, |e| e.0);
    all.retain(|e| e.0 > times * usual);
    all
}

fn rejected_observations(problem: &Problem) -> Option<String> {
    let (mut out, mut all, mut worst) = (0, 0, (0.0, ""));
    for (_, image) in problem.used() {
        let (n, rejected) = (image.observations.len(), image.observations.len() - image.used().count());
        (out, all) = (out + rejected, all + n);
        let share = rejected as f64 / n.max(1) as f64;
        if share > worst.0 {
            worst = (share, image.name.as_str());
        }
    }
    let share = f64::from(out as u32) / f64::from(all.max(1) as u32);
    (share > WORST_SHARE_REJECTED).then(|| {
        format!(
            "observations: {:.0} % were left out, {:.0} % in {}; look for markers taken for others, a bent plate, changed focus",
            100.0 * share,
            100.0 * worst.0,
            worst.1
        )
    })
}

/// What the user should know, though the result stands.
pub fn remarks(
    problem: &Problem,
    series: &[MeasuredSeries],
    state: &State,
    accuracy: &Accuracy,
    on_robot: usize,
    notices: &mut Vec<Notice>,
) {
    if on_robot < 20 {
        notices.push(Notice::new(
            "series",
            format!(
                "{on_robot} images of the robot are few: expect the prior (nominal model) to decide much of the result"
            ),
            "take 30 to 50 stops that move every joint through its range",
        ));
    }
    for (k, of) in series.iter().enumerate() {
        let noisiest = noisiest_joint(problem, state, k);
        if let Some((joint, sigma)) = noisiest.filter(|(_, s)| (UNUSUAL_JOINT_NOISE..=WORST_JOINT_NOISE).contains(s)) {
            notices.push(Notice::new(
                format!("series {}", of.name),
                format!(
                    "the joint noise is {:.2} mrad ({joint} most); robots repeat to some 0.1 mrad{}{}",
                    1e3 * sigma,
                    worst_predicted(problem, k, accuracy),
                    worst_seen(problem, k)
                ),
                "did plate or camera move, were images taken before the arm stood still, are readings rounded? the stated sigmas contain it",
            ));
        }
    }
    for (plate, shape) in problem.plates.iter().zip(&state.plates) {
        for (marker, correction) in plate.markers.iter().zip(&shape.corrections) {
            if correction.norm() > BEYOND_TOLERANCE * marker.sigma_m {
                notices.push(Notice::new(
                    format!("marker {}", marker.id),
                    format!(
                        "lies {:.2} mm from where the plate file says, far beyond its tolerance",
                        1e3 * correction.norm()
                    ),
                    "printed wrongly, moved, or taken for another? its corrected position stands in plate.csv",
                ));
            }
        }
    }
    let values = state.values(&problem.layout);
    for c in problem.layout.robot() {
        let column = &problem.layout.columns[c];
        let sigmas = ((values[c] - column.prior_mean) / problem.stated_sigma(c)).abs();
        if sigmas > BEYOND_TOLERANCE {
            notices.push(Notice::new(
                &column.name,
                format!("{:.3e} {} is {sigmas:.0} times what robots usually deviate by", values[c], column.unit),
                "check that the URDF is of this robot, and its mastering",
            ));
        }
    }
}

/// Images of the robot that were left out, of `on_robot` at the start.
pub fn left_out(problem: &Problem, on_robot: usize) -> usize {
    on_robot - problem.used().filter(|(_, i)| i.stop.is_some()).count()
}
