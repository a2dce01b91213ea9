//! When measurements of a body fit in two parts: from some stop on, or in a series, its instrument stands elsewhere, or the body sits elsewhere on
//! the tip, by so much that no fit of all is of any use.

use std::ops::Range;

use nalgebra::{Matrix3, Vector3};

use super::misfit::usual_misfit;
use super::mistakes::mistake;
use super::points_start::{FEWEST_POINTS, Placed, PointAt, distances, each_place, point_at, usual_distance};
use crate::assess::Limits;
use crate::diagnose::Finding;
use crate::error::{Code, Error, Quantity, Result};
use crate::geom::{Pose, rigid_fit};
use crate::identify::mistakes::divided::divided;
use crate::problem::{Adjustment, BodySeen, InstrumentKind, MeasuredSeries, stop_name};

/// Of the rows that others do not fit, one in so many may.
const MOST_MISSED: usize = 4;

/// Refuses measurements that fit in two parts, by the usual mistake that explains more, if there is one.
///
/// # Errors
/// An instrument or a body that was moved, with the stop; or the mistake.
pub(super) fn name_break(
    adjustment: &Adjustment,
    series: &[MeasuredSeries],
    (measured, placed): (&[usize], &Placed),
    limits: &Limits,
) -> Result<()> {
    let Some((broken, left)) = broken(adjustment, series, (measured, placed), limits) else { return Ok(()) };
    let mistake = mistake(adjustment, measured, limits, usual_misfit);
    let better = mistake.filter(|mistake| mistake.misfit_undone.is_some_and(|undone| undone < left));
    Err(better.map_or(broken, |mistake| Finding::from(mistake).refusal()))
}

/// What stands elsewhere where measurements at one end fit by themselves, and by the start of the others do not; and what they miss by then, m. Poses
/// start from most of them, so that the fit names the stop; they are told here where the start is of no majority.
fn broken(
    adjustment: &Adjustment,
    series: &[MeasuredSeries],
    (measured, placed): (&[usize], &Placed),
    limits: &Limits,
) -> Option<(Error, f64)> {
    let problem = &adjustment.problem;
    let of = |&k: &usize| Some((k, point_at(adjustment, &problem.body_measurements[k])?));
    let (rows, points): (Vec<usize>, Vec<PointAt>) = measured.iter().filter_map(of).unzip();
    let bound = limits.suspicious_misfit;
    let are_poses = rows.iter().any(|&k| matches!(problem.body_measurements[k].seen, BodySeen::Pose(_)));
    if are_poses && usual_distance(&points, placed) < bound {
        return None;
    }
    let fits: Vec<bool> = distances(&points, placed).iter().map(|distance| *distance < bound).collect();
    let n = fits.len();
    let divisions = [true, false].map(|is_first| (divided(&fits, is_first), is_first));
    let ((missed, at), is_first) = divisions.into_iter().min()?;
    let others: Range<usize> = if is_first { at..n } else { 0..at };
    if others.is_empty() || MOST_MISSED * missed > others.len() || n - others.len() < 2 * FEWEST_POINTS {
        return None;
    }
    let moved = moved(&points[others], placed, limits)?;
    Some((moved.named(adjustment, series, (rows[at - 1], rows[at])), moved.left_m))
}

/// What stands elsewhere.
struct Moved {
    is_body: bool,
    distance_m: f64,
    angle_rad: f64,
    /// What is missed by then, median.
    left_m: f64,
}

/// What explains that points miss where the others are placed: another place of the body on the tip, else of the instrument.
fn moved(points: &[PointAt], placed: &Placed, limits: &Limits) -> Option<Moved> {
    let before = usual_distance(points, placed);
    let left_by = |other: &Placed| {
        let left = usual_distance(points, other);
        (left < limits.suspicious_misfit && left < limits.mistake_explains * before).then_some(left)
    };
    let (frame, body) = placed;
    let on_tip = |(p, tip): &PointAt| tip.inverse().transform(&frame.transform(p));
    let middle = points.iter().map(on_tip).sum::<Vector3<f64>>() / points.len().max(1) as f64;
    let other_body = (*frame, Pose::new(Matrix3::identity(), middle));
    if let Some(left_m) = left_by(&other_body).filter(|_| points.len() >= limits.displaced_images) {
        let distance_m = (middle - body.translation).norm();
        return Some(Moved { is_body: true, distance_m, angle_rad: 0.0, left_m });
    }
    let carried: Vec<(Vector3<f64>, Vector3<f64>)> =
        points.iter().map(|(p, tip)| (*p, tip.transform(&body.translation))).collect();
    let places = each_place(points.iter().map(|(place, _)| *place)).len();
    let is_told = points.len() >= limits.hand_eye_images && places >= limits.fewest_places;
    let other_frame = rigid_fit(&carried).filter(|_| is_told)?;
    let (angle_rad, distance_m) = frame.distance(&other_frame);
    left_by(&(other_frame, *body)).map(|left_m| Moved { is_body: false, distance_m, angle_rad, left_m })
}

impl Moved {
    /// Between two measurements.
    fn named(
        &self,
        Adjustment { problem, .. }: &Adjustment,
        series: &[MeasuredSeries],
        (last, first): (usize, usize),
    ) -> Error {
        let [last, first] = [last, first].map(|k| &problem.body_measurements[k]);
        let instrument = &problem.instruments[first.instrument];
        let (displaced, other) = match instrument.kind {
            InstrumentKind::Tracker => (Code::TrackerDisplaced, "[tracker] name"),
            InstrumentKind::Socket | InstrumentKind::Places => (Code::WorkDisplaced, "[contact] frame"),
        };
        let own = &series[first.read.0];
        let stop = stop_name(series, first.read);
        let (from, rows) = match first.read.0 == last.read.0 {
            true => {
                (format!("from {stop} on"), format!("put the stops from {stop} on into a series of their own with"))
            }
            false => (format!("in series {}", own.name), format!("give series {}", own.name)),
        };
        let target = &problem.bodies[first.body];
        let (code, what, remedy) = match self.is_body {
            true => (
                Code::TargetDisplaced,
                format!("{from} the target {target} on the tip sits {:.0} mm elsewhere", 1e3 * self.distance_m),
                format!(
                    "see that the names of two targets are not exchanged {from}; else give {target} another name {from}, or measure again"
                ),
            ),
            false => (
                displaced,
                format!("{from} it stands {:.0} mm, {:.0} mrad elsewhere", 1e3 * self.distance_m, 1e3 * self.angle_rad),
                format!("{rows} another {other}, or measure again"),
            ),
        };
        let what = format!(
            "{what}, or the zero of a joint slipped: the measurements on either side fit by themselves, and not together"
        );
        let quantities =
            vec![Quantity::new("distance", self.distance_m, "m"), Quantity::new("angle", self.angle_rad, "rad")];
        let place = format!("{}, stop {stop}", instrument.place());
        Error { quantities, ..Error::new(code, place, what, remedy) }
    }
}
