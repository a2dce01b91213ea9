//! Starting values of the frame of an instrument and of a body in the tip, from points.
//!
//! Points `p_j` of a body at `b` of the tip, `R p_j + t = R_j b + t_j`: linear least squares in the elements of `R`, in `t` and `b`, then in `t` and
//! `b` alone with the nearest rotation. Where some points disagree, again from the nearest half, then from all that agree; where these are no
//! majority, from parts of the rows.

use std::collections::BTreeSet;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::geom::{Pose, project_to_so3};
use crate::identify::mistakes::divided::ends_of_parts;
use crate::init::translations_by_rotations;
use crate::linalg::{SymmetricFactor, lower_median};
use crate::problem::{Adjustment, BodyMeasurement};

/// A point in the frame of its instrument, and the pose of the tip.
pub(super) type PointAt = (Vector3<f64>, Pose);

/// `base_from_instrument`, and the body in the tip.
pub(super) type Placed = (Pose, Pose);

/// Information of a prior on unknown lengths, 1/m^2 where measurements have 1: it holds what they do not tell near zero.
pub(super) const HOLD: f64 = 1e-6;

/// Rounds of rotation, then translations.
const ROUNDS: usize = 200;

/// Change of the translations, m, that ends them.
const STANDING_M: f64 = 1e-7;

/// Points that nine unknowns need.
pub(super) const FEWEST_POINTS: usize = 4;

/// Points of which half tell nine unknowns well.
pub(super) const MANY_POINTS: usize = 16;

/// Rounds in which points that disagree are left out of a start.
pub(super) const TRIMMINGS: usize = 5;

/// Times the median misfit beyond which a point disagrees.
pub(super) const DISAGREES: f64 = 4.0;

/// Parts of a metre and of a direction in which tips of one posture are alike.
const ONE_POSTURE: [f64; 2] = [1e-3, 5e-3];

/// The first of all with each key.
pub(super) fn once<T: Copy, K: Ord>(all: &[T], key: impl Fn(&T) -> K) -> Vec<T> {
    let mut known = BTreeSet::new();
    all.iter().filter(|one| known.insert(key(one))).copied().collect()
}

/// What tips of one posture have in common: a posture to which a robot returns again and again tells a start no more than once.
pub(super) fn posture(tip: &Pose) -> [i64; 9] {
    let [length, direction] = ONE_POSTURE;
    let mut parts = [0; 9];
    parts[..3].copy_from_slice(&tip.xyz().map(|v| (v / length).round() as i64));
    parts.iter_mut().skip(3).zip(tip.rotation.iter()).for_each(|(part, v)| *part = (v / direction).round() as i64);
    parts
}

/// One point of every posture.
pub(super) fn once_a_posture(points: &[PointAt]) -> Vec<PointAt> {
    once(points, |(_, tip)| posture(tip))
}

/// Places each once, in the order in which they come: those of contacts come again, number by number.
pub(super) fn each_place(places: impl IntoIterator<Item = Vector3<f64>>) -> Vec<Vector3<f64>> {
    let mut all: Vec<Vector3<f64>> = Vec::new();
    for place in places {
        if !all.contains(&place) {
            all.push(place);
        }
    }
    all
}

/// Pose of the tip at the stop of a measurement, by the robot as it stands; `None` off the robot.
pub(super) fn tip_at(Adjustment { problem, state }: &Adjustment, measured: &BodyMeasurement) -> Option<Pose> {
    let posture = problem.stops[measured.stop].posture.as_ref()?;
    Some(state.robot.base_from_tip(&posture.readings))
}

/// A measurement as a point; `None` off the robot.
pub(super) fn point_at(adjustment: &Adjustment, measured: &BodyMeasurement) -> Option<PointAt> {
    Some((measured.seen.position(), tip_at(adjustment, measured)?))
}

/// How far every point is from where the tip carries the body, m.
pub(super) fn distances(points: &[PointAt], (frame, body): &Placed) -> Vec<f64> {
    points.iter().map(|(p, tip)| (frame.transform(p) - tip.transform(&body.translation)).norm()).collect()
}

/// The median of these.
pub(super) fn usual_distance(points: &[PointAt], placed: &Placed) -> f64 {
    lower_median(distances(points, placed))
}

/// Frame and body that most of the points fit, every posture counting once.
pub(super) fn agreeing(points: &[PointAt]) -> Option<Placed> {
    let points = &once_a_posture(points);
    nearest(points).map(|placed| without_others(points, placed))
}

/// Frame and body that most of the points fit, or a part of them where most do not fit to `bound`, m.
pub(super) fn agreeing_in_part(points: &[PointAt], bound: f64) -> Option<Placed> {
    let points = &once_a_posture(points);
    let all = agreeing(points)?;
    let n = points.len();
    if n < MANY_POINTS || usual_distance(points, &all) < bound {
        return Some(all);
    }
    let divisions = ends_of_parts(n).skip(1).flat_map(|at| [&points[..at], &points[at..]]);
    let of_part = |part: &[PointAt]| Some(without_others(points, nearest(part)?));
    let of_parts = divisions.filter(|part| 2 * part.len() >= MANY_POINTS).filter_map(of_part);
    let best = |a: &Placed, b: &Placed| usual_distance(points, a).total_cmp(&usual_distance(points, b));
    of_parts.chain([all]).min_by(best)
}

/// From the nearest half, where some disagree, then from all that agree with these: others would spoil the start for all.
fn without_others(points: &[PointAt], placed: Placed) -> Placed {
    let usual = usual_distance(points, &placed);
    let agrees = |distance: f64| distance <= DISAGREES * usual;
    if points.len() < MANY_POINTS || distances(points, &placed).into_iter().all(agrees) {
        return placed;
    }
    let mut found = placed;
    for times in [[1.0; TRIMMINGS], [DISAGREES; TRIMMINGS]].concat() {
        let bound = times * usual_distance(points, &found);
        let near: Vec<PointAt> =
            points.iter().zip(distances(points, &found)).filter(|(_, d)| *d <= bound).map(|(p, _)| *p).collect();
        found = alternating(&near, found.0.rotation);
    }
    if usual_distance(points, &found) < usual { found } else { placed }
}

/// Frame and body that points fit best.
fn nearest(points: &[PointAt]) -> Option<Placed> {
    let starts = [all_linear(points), Some(alternating(points, Matrix3::identity()))];
    let refined = starts.into_iter().flatten().map(|(frame, _)| alternating(points, frame.rotation));
    refined.min_by(|a, b| misfit(points, a).total_cmp(&misfit(points, b)))
}

/// Sum of squared distances, m^2.
fn misfit(points: &[PointAt], (frame, body): &Placed) -> f64 {
    points.iter().map(|(p, tip)| (frame.transform(p) - tip.transform(&body.translation)).norm_squared()).sum()
}

/// Frame and body of all points, without iterations: near enough to see which of several readings of them is right.
pub(super) fn roughly(points: &[PointAt]) -> Option<Placed> {
    translations(points, &all_linear(points)?.0.rotation)
}

/// `R`, `t` and `b` together; `None` where they are not determined.
fn all_linear(points: &[PointAt]) -> Option<Placed> {
    let (mut n, mut rhs) = (DMatrix::zeros(15, 15), DVector::zeros(15));
    for (p, tip) in points {
        let mut row = DMatrix::zeros(3, 15);
        for k in 0..3 {
            (0..3).for_each(|d| row[(d, 3 * k + d)] = p[k]);
            row[(k, 9 + k)] = 1.0;
        }
        row.fixed_view_mut::<3, 3>(0, 12).copy_from(&-tip.rotation);
        n += row.tr_mul(&row);
        rhs += row.tr_mul(&tip.translation);
    }
    (9..15).for_each(|k| n[(k, k)] += HOLD);
    let x = SymmetricFactor::new(&n).ok()?.solve(&rhs);
    let rotation = project_to_so3(&Matrix3::from_column_slice(&x.as_slice()[..9]))?;
    Some((Pose::new(rotation, Vector3::zeros()), Pose::identity()))
}

/// Rotation and translations by turns, from a rotation.
fn alternating(points: &[PointAt], mut rotation: Matrix3<f64>) -> Placed {
    let mut found = (Pose::identity(), Pose::identity());
    for _ in 0..ROUNDS {
        let Some(next) = translations(points, &rotation) else { break };
        let moved =
            (next.0.translation - found.0.translation).norm() + (next.1.translation - found.1.translation).norm();
        found = next;
        let Some(better) = turn(points, &found.1.translation) else { break };
        rotation = better;
        if moved < STANDING_M {
            break;
        }
    }
    found
}

/// `t` and `b` for a rotation.
fn translations(points: &[PointAt], rotation: &Matrix3<f64>) -> Option<Placed> {
    let seen = points.iter().map(|(p, tip)| (rotation * p, *tip));
    let [frame, body] = translations_by_rotations(seen, HOLD)?;
    Some((Pose::new(*rotation, frame), Pose::new(Matrix3::identity(), body)))
}

/// The rotation that brings the points to where the tip carries the body (K. Arun, T. Huang, S. Blostein 1987).
fn turn(points: &[PointAt], body: &Vector3<f64>) -> Option<Matrix3<f64>> {
    let count = points.len() as f64;
    let carried = |tip: &Pose| tip.transform(body);
    let mean_seen = points.iter().map(|(p, _)| p).sum::<Vector3<f64>>() / count;
    let mean_carried = points.iter().map(|(_, tip)| carried(tip)).sum::<Vector3<f64>>() / count;
    let product = |(p, tip): &PointAt| (carried(tip) - mean_carried) * (p - mean_seen).transpose();
    project_to_so3(&points.iter().map(product).sum::<Matrix3<f64>>())
}
