//! What measured points show of themselves: a device that was moved, points that stand out, and errors of the robot that they cannot show.

use std::path::Path;

use super::verify_stated::{ExpectedAtPoints, Stated};
use super::verify_verdict::Reasons;
use crate::assess::{
    DeviceMoved, LeftOpen, Limits, MeasuredPoint, OddPoints, PointFit, SizeOfPoints, StepCause, device_moved,
    odd_points, size_of_points,
};
use crate::cli::terminal::say::say_line;
use crate::diagnose::Weight;
use crate::error::Code;
use crate::model::robot::Robot;
use crate::output::corrections::FileFinding;

/// A robot, points, and the fit of these to it.
pub(super) type Laid<'a> = (&'a Robot, &'a [MeasuredPoint], &'a PointFit);

/// Whether the device was moved, and wrong points: both said, with the points that stand out without being wrong for sure, and the doubts that all of
/// them leave.
pub(super) fn apart(
    (robot, points, fit): Laid<'_>,
    expected: Option<&ExpectedAtPoints>,
    limits: &Limits,
    reasons: &mut Reasons,
) -> (bool, Vec<usize>) {
    let stated_m = expected.map_or(&[][..], |expected| &expected.each_m);
    let odd = odd_points(robot, points, stated_m, limits);
    // What the model itself may miss, different in every posture, is no step of the device, nor is what single points do.
    let may_miss = expected.is_some_and(|expected| fit.rms_m <= expected.all.most_m);
    let is_step = |moved: &DeviceMoved| !may_miss && !odd.as_ref().is_some_and(|odd| odd.explain(moved, limits));
    let moved = device_moved(robot, points, fit, limits).filter(is_step);
    let is_moved = moved.is_some_and(|moved| moved.cause == StepCause::Device);
    let odd = odd.filter(|_| !is_moved);
    moved.iter().for_each(say_moved);
    odd.iter().for_each(say_odd);
    reasons.doubts.extend(odd.iter().map(in_verdict));
    if moved.is_some() && !is_moved {
        reasons.doubts.push("the points may not belong together".into());
    }
    (is_moved, odd.map_or_else(Vec::new, |odd| odd.wrong))
}

/// Points of which a robot that misses elsewhere as much as one that nobody corrected may fit as well.
pub(super) fn open(
    (robot, points, fit): Laid<'_>,
    stated: Option<&Stated>,
    file: &Path,
    limits: &Limits,
) -> Option<FileFinding> {
    let places = stated.map_or_else(Vec::new, Stated::own_stops);
    let found = LeftOpen::of(robot, (points, fit), &places, limits).filter(|found| !found.tells(limits))?;
    let [left, usual, mm] = [found.left_m, found.usual_m, fit.rms_m].map(|m| 1e3 * m);
    let place = if places.is_empty() { "within its joint limits" } else { "at the stops of its series" };
    let text = format!(
        "{}: these points do not tell the robot. One that fits them as well, to {mm:.3} mm, may miss by {left:.1} mm RMS {place}, of the \
         {usual:.1} mm that a robot with its errors at their priors does: frame and reflector take up the rest, or joints stand still; measure points that are spread over the workspace, in \
         position and in hand orientation, and move all joints",
        file.display()
    );
    let quantities = [("left_open_mm", left), ("by_priors_mm", usual), ("rms_mm", mm)];
    Some(FileFinding::new(Code::PointsUndetermined, Weight::Gate, file.display(), quantities, text))
}

/// Points whose device is of another size than the robot, which that explains.
pub(super) fn of_another_size((robot, points, fit): Laid<'_>, file: &Path, limits: &Limits) -> Option<FileFinding> {
    let SizeOfPoints { off, left_m } = size_of_points(robot, points, fit, limits)?;
    let text = format!(
        "{}: its lengths are {:.3} % {} than those of the model; without that the points leave {:.3} mm instead of {:.3} mm: check the device (its unit, temperature \
         and reflector constant) and the size of the plate, or of what else the model was identified with: measure two far markers and give [scale]",
        file.display(),
        100.0 * off.abs(),
        if off > 0.0 { "longer" } else { "shorter" },
        1e3 * left_m,
        1e3 * fit.rms_m
    );
    let quantities = [("relative_size", off), ("rms_undone_mm", 1e3 * left_m)];
    Some(FileFinding::new(Code::LengthsContradicted, Weight::Gate, file.display(), quantities, text))
}

/// What stands out, in the words of the verdict.
fn in_verdict(OddPoints { points, wrong, .. }: &OddPoints) -> String {
    let what = if wrong.len() == points.len() { "" } else { ", or the robot there" };
    match points.len() {
        1 => format!("one point stands out: the point, its readings{what}"),
        count => format!("{count} points stand out: the points, their readings{what}"),
    }
}

fn say_moved(DeviceMoved { first, by_m, rms_m, cause }: &DeviceMoved) {
    let [by_mm, rms_mm, row] = [format!("{:.1}", 1e3 * by_m), format!("{:.3}", 1e3 * rms_m), (first + 1).to_string()];
    match cause {
        StepCause::Device => say_line!(
            "moved     the device, or the base, stands {by_mm} mm elsewhere from row {row} on (without that {rms_mm} mm RMS): judge the rows before and after alone"
        ),
        StepCause::DeviceOrRobot => say_line!(
            "moved?    from row {row} on the points are {by_mm} mm elsewhere (without that {rms_mm} mm RMS), which errors of the robot may explain as well: judge the rows before and after alone, or measure in another order"
        ),
    }
}

fn say_odd(OddPoints { points, off_m, without, wrong }: &OddPoints) {
    let each: Vec<String> =
        points.iter().zip(off_m).map(|(k, off)| format!("{} ({:.1} mm)", k + 1, 1e3 * off)).collect();
    let judged = match wrong.as_slice() {
        [] => "the verdict is by all points".to_owned(),
        _ if wrong.len() == points.len() => "no error of a robot explains that, and the verdict is without".to_owned(),
        _ => format!(
            "no error of a robot explains row {}, without which the verdict is",
            wrong.iter().map(|k| (k + 1).to_string()).collect::<Vec<_>>().join(", ")
        ),
    };
    say_line!(
        "odd       row {}: the point, its readings, or the robot there? Without {:.3} mm RMS; {judged}: look there, measure again",
        each.join(", "),
        1e3 * without.rms_m
    );
}
