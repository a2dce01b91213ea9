//! Starting values of instruments and bodies, with the robot as it stands.
//!
//! Poses: the closed forms of the hand-eye transform; points: [`super::points_start`]. Sockets: `s = R_j b + t_j` is linear in the places and `b`.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::misfit::{FEWEST_POSES, usual_misfit};
use super::mistakes::name_mistake;
use super::moved_between::name_break;
use super::placed::{SeenFrom, missed, pairs, placed};
use super::places_exchanged::name_exchange;
use super::points_start::{DISAGREES, FEWEST_POINTS, HOLD, Placed, TRIMMINGS, once, posture, tip_at};
use super::repeated_rows::leave_out_stuck;
use super::rows_in_part::name_part;
use super::unrelated_rows::name_unrelated;
use crate::assess::Limits;
use crate::error::{Code, Error, Result};
use crate::geom::Pose;
use crate::linalg::{SymmetricFactor, lower_median, median};
use crate::problem::{Adjustment, BodyRejection, InstrumentKind, MeasuredSeries, Problem};

/// Fills in instruments and bodies.
///
/// # Errors
/// Too few measurements of a body; poses that no closed form explains; a usual mistake that does; an instrument or a body that was moved.
pub(in crate::identify) fn start_bodies(
    adjustment: &mut Adjustment,
    series: &[MeasuredSeries],
    limits: &Limits,
) -> Result<()> {
    leave_out_stuck(adjustment, limits);
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
            let placed = framed(adjustment, instrument, &measured, limits)?;
            name_exchange(adjustment, &measured, limits)?;
            // What fits in two parts fits no better by chance, as undone by a mistake that changes little.
            name_break(adjustment, series, (&measured, &placed), limits)?;
            name_part(adjustment, series, (&measured, &placed), limits)?;
            name_mistake(adjustment, &measured, limits, usual_misfit)?;
            name_unrelated(adjustment, (&measured, &placed), limits)?;
            leave_out_others(adjustment, &measured, &placed, limits);
            (adjustment.state.instruments[instrument], adjustment.state.bodies[body]) = placed;
        }
        if !sockets.is_empty() {
            start_sockets(adjustment, body, &sockets, limits)?;
        }
    }
    Ok(())
}

/// Leaves out what disagrees with most of the others: it would spoil the noise of all before it is left out by its residual. Where much
/// does, that is no matter of single ones.
fn leave_out_others(adjustment: &mut Adjustment, measured: &[usize], placed: &Placed, limits: &Limits) {
    let seen = |&k: &usize| {
        let measured = &adjustment.problem.body_measurements[k];
        Some((k, missed(&(measured.seen, tip_at(adjustment, measured)?), placed)))
    };
    let all: Vec<(usize, f64)> = measured.iter().filter_map(seen).collect();
    let usual = lower_median(all.iter().map(|(_, distance)| *distance));
    let bound = f64::max(limits.suspicious_misfit, DISAGREES * usual);
    leave_far_out(&mut adjustment.problem, all.into_iter(), bound, limits);
}

/// Leaves out measurements that miss by more than this, m, where they are no more than may be left out of all.
fn leave_far_out(
    problem: &mut Problem,
    missed: impl ExactSizeIterator<Item = (usize, f64)>,
    bound: f64,
    limits: &Limits,
) {
    let most = limits.share_of_images_left_out * missed.len() as f64;
    let far: Vec<(usize, f64)> = missed.filter(|(_, distance)| *distance > bound).collect();
    if far.len() as f64 > most {
        return;
    }
    for (k, distance) in far {
        let measured = &mut problem.body_measurements[k];
        measured.rejected = Some(BodyRejection::Residual { sigmas: distance / measured.sigma_m });
    }
}

fn too_few(problem: &Problem, instrument: usize, found: usize, needed: usize) -> Error {
    let instrument = &problem.instruments[instrument];
    let what = format!("only {found} measurements at stops of the robot, at least {needed} are needed");
    Error::new(
        Code::MeasurementsTooFew,
        instrument.place(),
        what,
        "measure at more stops, with the tip turned to different directions",
    )
}

/// Frame of an instrument, `base_from_instrument`, with the body that it sees, `tip_from_body`.
fn framed(adjustment: &Adjustment, instrument: usize, measured: &[usize], limits: &Limits) -> Result<Placed> {
    let problem = &adjustment.problem;
    let of = |k: &usize| {
        let measured = &problem.body_measurements[*k];
        Some((measured.seen, tip_at(adjustment, measured)?))
    };
    let seen: Vec<SeenFrom> = measured.iter().filter_map(of).collect();
    placed(&seen, limits.suspicious_misfit).ok_or_else(|| {
        if pairs(&seen).len() < FEWEST_POSES {
            return too_few(problem, instrument, seen.len(), FEWEST_POINTS);
        }
        let remedy =
            "check the unit, the order of the quaternion (qx, qy, qz, qw) and that the rows belong to these stops";
        let what = "no closed form of the hand-eye transform has a solution";
        Error::new(Code::ReadingsContradict, problem.instruments[instrument].place(), what, remedy)
    })
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
        Some((k, (measured.instrument, tip_at(adjustment, measured)?)))
    };
    let (all, held): (Vec<usize>, Vec<(usize, Pose)>) = all.filter_map(at_robot).unzip();
    // Every stop gives three coordinates: a place and the body are told by three stops.
    let needed = sockets.len() + 2;
    let too_few = || too_few(&adjustment.problem, sockets[0].0, held.len(), needed);
    if held.len() < needed {
        return Err(too_few());
    }
    let most_out = limits.share_of_images_left_out;
    let found = in_sockets(&held, most_out).ok_or_else(too_few)?;
    name_mistake(adjustment, &all, limits, |robot, seen| {
        let held: Vec<(usize, Pose)> = seen.iter().map(|s| (s.instrument, robot.base_from_tip(&s.readings))).collect();
        let held = of_postures(&held);
        in_sockets(&held, most_out).and_then(|found| median(found.misfits(&held))).unwrap_or(f64::INFINITY)
    })?;
    // What sat in another socket than is said would spoil the noise of all before it is left out by its residual.
    let misfits = found.misfits(&held);
    let bound = f64::max(limits.suspicious_misfit, DISAGREES * median(&misfits).unwrap_or(0.0));
    leave_far_out(&mut adjustment.problem, all.into_iter().zip(misfits), bound, limits);
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

    /// With every socket where most of its stops have the body: some of another socket would draw their mean away from all.
    fn with_usual_places(&self, held: &[(usize, Pose)]) -> Self {
        let mut touched: BTreeMap<usize, Vec<Vector3<f64>>> = BTreeMap::new();
        for (socket, tip) in held {
            touched.entry(*socket).or_default().push(tip.transform(&self.body));
        }
        let along = |all: &[Vector3<f64>], axis: usize| {
            median(all.iter().map(|at| at[axis]).collect::<Vec<f64>>()).unwrap_or_default()
        };
        let middle = |all: Vec<Vector3<f64>>| Vector3::from_fn(|axis, _| along(&all, axis));
        Self { body: self.body, places: touched.into_iter().map(|(socket, all)| (socket, middle(all))).collect() }
    }
}

/// One stop of every posture in every socket.
fn of_postures(held: &[(usize, Pose)]) -> Vec<(usize, Pose)> {
    once(held, |(socket, tip)| (*socket, posture(tip)))
}

/// From the stops that agree: those of a wrong socket would spoil it for all. Postures count once, and no more than this share of them is left out.
fn in_sockets(held: &[(usize, Pose)], most_out: f64) -> Option<InSockets> {
    let held = &of_postures(held);
    let mut touches: BTreeMap<usize, usize> = BTreeMap::new();
    held.iter().for_each(|(socket, _)| *touches.entry(*socket).or_default() += 1);
    // A socket that was touched once is where that touch is.
    let tells: Vec<bool> = held.iter().map(|(socket, _)| touches[socket] > 1).collect();
    let mut found = by_all(held)?;
    for _ in 0..TRIMMINGS {
        let misfits = found.with_usual_places(held).misfits(held);
        let told: Vec<f64> = misfits.iter().zip(&tells).filter(|(_, tells)| **tells).map(|(m, _)| *m).collect();
        let Some(usual) = median(&told) else { break };
        let agreeing: Vec<(usize, Pose)> =
            held.iter().zip(&misfits).filter(|(_, misfit)| **misfit <= DISAGREES * usual).map(|(s, _)| *s).collect();
        let is_most = agreeing.len() as f64 >= (1.0 - most_out) * held.len() as f64;
        match by_all(&agreeing).filter(|_| is_most) {
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
