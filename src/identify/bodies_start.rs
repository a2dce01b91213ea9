//! Starting values of instruments and bodies, with the robot as it stands.
//!
//! Poses: the closed forms of the hand-eye transform. Points `p_j` of a body at `b` of the tip, `R p_j + t = R_j b + t_j`: linear least squares in
//! the elements of `R`, in `t` and `b`, then in `t` and `b` alone with the nearest rotation. Sockets: `s = R_j b + t_j` is linear in the places
//! and `b`.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::body_mistakes::{SeenAt, name_mistake};
use crate::assess::{Limits, median};
use crate::error::{Code, Error, Result};
use crate::geom::{Pose, project_to_so3};
use crate::init::{PosePair, solve_hand_eye};
use crate::linalg::SymmetricFactor;
use crate::model::robot::Robot;
use crate::problem::{Adjustment, BodyMeasurement, BodyRejection, BodySeen, InstrumentKind, Problem};

/// Information of a prior on unknown lengths, 1/m^2 where measurements have 1: it holds what they do not tell near zero.
const HOLD: f64 = 1e-6;

/// Rounds of rotation, then translations.
const ROUNDS: usize = 200;

/// Change of the translations, m, that ends them.
const STANDING_M: f64 = 1e-7;

/// Fills in instruments and bodies.
///
/// # Errors
/// Too few measurements of a body; poses that no closed form explains; a usual mistake in the readings that does.
pub(super) fn start_bodies(adjustment: &mut Adjustment, limits: &Limits) -> Result<()> {
    let mut groups: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for (k, measured) in adjustment.problem.used_bodies() {
        groups.entry((measured.instrument, measured.body)).or_default().push(k);
    }
    let mut by_body: BTreeMap<usize, Vec<(usize, Vec<usize>)>> = BTreeMap::new();
    for ((instrument, body), measured) in groups {
        by_body.entry(body).or_default().push((instrument, measured));
    }
    for (body, seen_by) in by_body {
        let is_socket = |instrument: &usize| adjustment.problem.instruments[*instrument].kind == InstrumentKind::Socket;
        let (sockets, others): (Vec<_>, Vec<_>) = seen_by.into_iter().partition(|(i, _)| is_socket(i));
        for (instrument, measured) in others {
            let (frame, at) = framed(adjustment, instrument, &measured)?;
            name_mistake(adjustment, &measured, limits, usual_misfit)?;
            adjustment.state.instruments[instrument] = frame;
            adjustment.state.bodies[body] = at;
        }
        if !sockets.is_empty() {
            start_sockets(adjustment, body, &sockets, limits)?;
        }
    }
    Ok(())
}

/// Pose of the tip at the stop of a measurement.
fn tip(adjustment: &Adjustment, measured: &BodyMeasurement) -> Option<Pose> {
    let posture = adjustment.problem.stops[measured.stop].posture.as_ref()?;
    Some(adjustment.state.robot.base_from_tip(&posture.readings))
}

fn too_few(problem: &Problem, instrument: usize, found: usize, needed: usize) -> Error {
    let instrument = &problem.instruments[instrument];
    let what = format!("only {found} measurements at stops of the robot, at least {needed} are needed");
    let place = format!("{} {}", instrument.kind.block(), instrument.name);
    Error::new(
        Code::MeasurementsTooFew,
        place,
        what,
        "measure at more stops, with the tip turned to different directions",
    )
}

/// Frame of an instrument, `base_from_instrument`, with the body that it sees, `tip_from_body`.
fn framed(adjustment: &Adjustment, instrument: usize, measured: &[usize]) -> Result<(Pose, Pose)> {
    let problem = &adjustment.problem;
    let of = |k: &usize| {
        let measured = &problem.body_measurements[*k];
        Some((measured.seen, tip(adjustment, measured)?))
    };
    let seen: Vec<(BodySeen, Pose)> = measured.iter().filter_map(of).collect();
    let pairs: Vec<PosePair> = seen
        .iter()
        .filter_map(|(seen, tip)| match seen {
            BodySeen::Pose(pose) => Some(PosePair { camera_from_plate: *pose, chain: *tip }),
            BodySeen::Point(_) => None,
        })
        .collect();
    if pairs.len() >= FEWEST_POSES {
        let best = solve_hand_eye(&pairs).into_iter().next();
        return best.map(|s| (s.solution.camera, s.solution.plate)).ok_or_else(|| {
            let place = format!("tracker {}", problem.instruments[instrument].name);
            let remedy =
                "check the unit, the order of the quaternion (qx, qy, qz, qw) and that the rows belong to these stops";
            Error::new(
                Code::ReadingsContradict,
                place,
                "no closed form of the hand-eye transform has a solution",
                remedy,
            )
        });
    }
    let points: Vec<(Vector3<f64>, Pose)> = seen.iter().map(|(seen, tip)| (seen.position(), *tip)).collect();
    if points.len() < FEWEST_POINTS {
        return Err(too_few(problem, instrument, points.len(), FEWEST_POINTS));
    }
    nearest(&points).ok_or_else(|| too_few(problem, instrument, points.len(), FEWEST_POINTS))
}

/// Median misfit of the poses (rad + m), or of the points (m), with readings.
fn usual_misfit(robot: &Robot, seen: &[SeenAt]) -> f64 {
    let tips: Vec<Pose> = seen.iter().map(|s| robot.base_from_tip(&s.readings)).collect();
    let pair = |(seen, tip): (&SeenAt, &Pose)| match seen.seen {
        BodySeen::Pose(pose) => Some(PosePair { camera_from_plate: pose, chain: *tip }),
        BodySeen::Point(_) => None,
    };
    let pairs: Vec<PosePair> = seen.iter().zip(&tips).filter_map(pair).collect();
    if pairs.len() >= FEWEST_POSES {
        return solve_hand_eye(&pairs).first().map_or(f64::INFINITY, |s| s.median_error);
    }
    let points: Vec<(Vector3<f64>, Pose)> = seen.iter().map(|s| s.seen.position()).zip(tips).collect();
    let distances = |(frame, body): (Pose, Pose)| {
        let of = |(p, tip): &(Vector3<f64>, Pose)| (frame.transform(p) - tip.transform(&body.translation)).norm();
        median(&points.iter().map(of).collect::<Vec<f64>>())
    };
    nearest(&points).and_then(distances).unwrap_or(f64::INFINITY)
}

/// Frame and body that points fit best.
fn nearest(points: &[(Vector3<f64>, Pose)]) -> Option<(Pose, Pose)> {
    let starts = [all_linear(points), Some(alternating(points, Matrix3::identity()))];
    let refined = starts.into_iter().flatten().map(|(frame, _)| alternating(points, frame.rotation));
    refined.min_by(|a, b| misfit(points, a).total_cmp(&misfit(points, b)))
}

/// Poses from which the closed forms follow.
const FEWEST_POSES: usize = 3;

/// Points that nine unknowns need.
const FEWEST_POINTS: usize = 4;

/// Sum of squared distances, m^2.
fn misfit(points: &[(Vector3<f64>, Pose)], (frame, body): &(Pose, Pose)) -> f64 {
    points.iter().map(|(p, tip)| (frame.transform(p) - tip.transform(&body.translation)).norm_squared()).sum()
}

/// `R`, `t` and `b` together; `None` where they are not determined.
fn all_linear(points: &[(Vector3<f64>, Pose)]) -> Option<(Pose, Pose)> {
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
fn alternating(points: &[(Vector3<f64>, Pose)], mut rotation: Matrix3<f64>) -> (Pose, Pose) {
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
fn translations(points: &[(Vector3<f64>, Pose)], rotation: &Matrix3<f64>) -> Option<(Pose, Pose)> {
    let (mut n, mut rhs) = (DMatrix::identity(6, 6) * HOLD, DVector::zeros(6));
    for (p, tip) in points {
        let mut row = DMatrix::zeros(3, 6);
        row.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        row.fixed_view_mut::<3, 3>(0, 3).copy_from(&-tip.rotation);
        n += row.tr_mul(&row);
        rhs += row.tr_mul(&(tip.translation - rotation * p));
    }
    let x = SymmetricFactor::new(&n).ok()?.solve(&rhs);
    let part = |first: usize| x.fixed_rows::<3>(first).into_owned();
    Some((Pose::new(*rotation, part(0)), Pose::new(Matrix3::identity(), part(3))))
}

/// The rotation that brings the points to where the tip carries the body (K. Arun, T. Huang, S. Blostein 1987).
fn turn(points: &[(Vector3<f64>, Pose)], body: &Vector3<f64>) -> Option<Matrix3<f64>> {
    let count = points.len() as f64;
    let carried = |tip: &Pose| tip.transform(body);
    let mean_seen = points.iter().map(|(p, _)| p).sum::<Vector3<f64>>() / count;
    let mean_carried = points.iter().map(|(_, tip)| carried(tip)).sum::<Vector3<f64>>() / count;
    let product = |(p, tip): &(Vector3<f64>, Pose)| (carried(tip) - mean_carried) * (p - mean_seen).transpose();
    project_to_so3(&points.iter().map(product).sum::<Matrix3<f64>>())
}

/// Places of sockets and the body in the tip, from all sockets that hold it.
fn start_sockets(
    adjustment: &mut Adjustment,
    body: usize,
    sockets: &[(usize, Vec<usize>)],
    limits: &Limits,
) -> Result<()> {
    let all = sockets.iter().flat_map(|(_, measured)| measured.iter().copied());
    let at_robot = |k: usize| {
        let measured = &adjustment.problem.body_measurements[k];
        Some((k, (measured.instrument, tip(adjustment, measured)?)))
    };
    let (all, held): (Vec<usize>, Vec<(usize, Pose)>) = all.filter_map(at_robot).unzip();
    // Every stop gives three coordinates: a place and the body are told by three stops.
    let needed = sockets.len() + 2;
    let too_few = || too_few(&adjustment.problem, sockets[0].0, held.len(), needed);
    if held.len() < needed {
        return Err(too_few());
    }
    let found = in_sockets(&held).ok_or_else(too_few)?;
    name_mistake(adjustment, &all, limits, |robot, seen| {
        let held: Vec<(usize, Pose)> = seen.iter().map(|s| (s.instrument, robot.base_from_tip(&s.readings))).collect();
        in_sockets(&held).and_then(|found| median(&found.misfits(&held))).unwrap_or(f64::INFINITY)
    })?;
    // What sat in another socket than is said would spoil the noise of all before it is left out by its residual.
    let bound = f64::max(limits.suspicious_misfit, DISAGREES * median(&found.misfits(&held)).unwrap_or(0.0));
    for (k, misfit) in all.into_iter().zip(found.misfits(&held)).filter(|(_, misfit)| *misfit > bound) {
        let measured = &mut adjustment.problem.body_measurements[k];
        measured.rejected = Some(BodyRejection::Residual { sigmas: misfit / measured.sigma_m });
    }
    let at = |place: Vector3<f64>| Pose::new(Matrix3::identity(), place);
    adjustment.state.bodies[body] = at(found.body);
    for (instrument, place) in found.places {
        adjustment.state.instruments[instrument] = at(place);
    }
    Ok(())
}

/// A body in the tip, and the places of the sockets that hold it by their indices, m.
struct InSockets {
    body: Vector3<f64>,
    places: BTreeMap<usize, Vector3<f64>>,
}

impl InSockets {
    /// How far the body is from the place of its socket at each stop, m; infinite where no place was found.
    fn misfits(&self, held: &[(usize, Pose)]) -> Vec<f64> {
        let of = |(socket, tip): &(usize, Pose)| {
            self.places.get(socket).map_or(f64::INFINITY, |place| (tip.transform(&self.body) - place).norm())
        };
        held.iter().map(of).collect()
    }
}

/// Rounds in which stops that disagree are left out of a start.
const TRIMMINGS: usize = 5;

/// Times the median misfit beyond which a stop disagrees.
const DISAGREES: f64 = 4.0;

/// From the stops that agree: those of a wrong socket would spoil it for all.
fn in_sockets(held: &[(usize, Pose)]) -> Option<InSockets> {
    let mut found = by_all(held)?;
    for _ in 0..TRIMMINGS {
        let misfits = found.misfits(held);
        let bound = DISAGREES * median(&misfits)?;
        let agreeing: Vec<(usize, Pose)> =
            held.iter().zip(&misfits).filter(|(_, misfit)| **misfit <= bound).map(|(stop, _)| *stop).collect();
        match by_all(&agreeing) {
            Some(better) if better.places.len() == found.places.len() => found = better,
            _ => break,
        }
    }
    Some(found)
}

/// Least squares over the body and the places; `None` where they are not determined.
fn by_all(held: &[(usize, Pose)]) -> Option<InSockets> {
    let sockets: BTreeMap<usize, usize> = {
        let named: std::collections::BTreeSet<usize> = held.iter().map(|(socket, _)| *socket).collect();
        named.into_iter().zip((3..).step_by(3)).collect()
    };
    let unknowns = 3 + 3 * sockets.len();
    let (mut n, mut rhs) = (DMatrix::identity(unknowns, unknowns) * HOLD, DVector::zeros(unknowns));
    for (socket, tip) in held {
        let mut row = DMatrix::zeros(3, unknowns);
        row.fixed_view_mut::<3, 3>(0, 0).copy_from(&-tip.rotation);
        row.fixed_view_mut::<3, 3>(0, sockets[socket]).fill_with_identity();
        n += row.tr_mul(&row);
        rhs += row.tr_mul(&tip.translation);
    }
    let x = SymmetricFactor::new(&n).ok()?.solve(&rhs);
    let part = |first: usize| x.fixed_rows::<3>(first).into_owned();
    Some(InSockets { body: part(0), places: sockets.iter().map(|(socket, first)| (*socket, part(*first))).collect() })
}
