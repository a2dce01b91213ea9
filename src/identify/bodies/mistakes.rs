//! When readings and what an instrument saw of a body do not fit: the usual mistakes in either, tried one by one, named where one of them
//! explains it.

use std::collections::BTreeSet;

use nalgebra::Vector3;
use rayon::prelude::*;

use super::misfit::{BodyAtStop, FEWEST_POSES};
use super::points_start::FEWEST_POINTS;
use super::rows_of::{rows_of_bodies, table};
use crate::assess::Limits;
use crate::diagnose::{Finding, Mistake, MistakeKind};
use crate::error::Result;
use crate::identify::mistakes::likeliest::{Explained, likeliest};
use crate::identify::mistakes::misread::all_misread;
use crate::identify::mistakes::readings::{columns_undone, mirrored_signs_undone, whole_and_parted};
use crate::identify::mistakes::suspects::some_of;
use crate::linalg::lower_median;
use crate::model::robot::Robot;
use crate::problem::{Adjustment, BodyMeasurement, BodySeen, InstrumentKind, Problem, different_readings};

/// What was seen with a mistake undone, and its name.
type Undone = (Vec<BodyAtStop>, MistakeKind);

/// Refuses measurements and readings that fit with one of the usual mistakes undone, and only then.
///
/// # Errors
/// The mistake that explains most.
pub(super) fn name_mistake(
    adjustment: &Adjustment,
    measured: &[usize],
    limits: &Limits,
    misfit: impl Fn(&Robot, &[BodyAtStop]) -> f64 + Sync,
) -> Result<()> {
    mistake(adjustment, measured, limits, misfit).map_or(Ok(()), |mistake| Err(Finding::from(mistake).refusal()))
}

/// The usual mistake without which measurements and readings fit, and only then. `misfit` is the median misfit of poses
/// (rad + m), or of points (m), with given readings; what shrinks them counts by what it leaves of it in their own unit. A small one may have a mistake, too: the sign of a joint moves a body near its axis by little.
pub(super) fn mistake(
    adjustment: &Adjustment,
    measured: &[usize],
    limits: &Limits,
    misfit: impl Fn(&Robot, &[BodyAtStop]) -> f64 + Sync,
) -> Option<Mistake> {
    let Adjustment { problem, state } = adjustment;
    let robot = &state.robot;
    let mut given: Vec<BodyAtStop> =
        measured.iter().filter_map(|k| BodyAtStop::of(problem, &problem.body_measurements[*k])).collect();
    let of_all = misfit(robot, &given);
    let is_suspicious = of_all >= limits.suspicious_misfit;
    if !(is_suspicious || is_contradicted(problem, measured, of_all, limits))
        || robot.chain.pose_coordinates().is_some()
    {
        return None;
    }
    // Any change of the readings fits what was measured again and again at a few.
    let (readings, fewest) = (given.iter().map(|s| s.readings.as_slice()), limits.hand_eye_images);
    if different_readings(readings, limits.joint_noise, fewest) < fewest {
        return None;
    }
    let stops: Vec<usize> = given.iter().map(|s| s.stop).collect::<BTreeSet<usize>>().into_iter().collect();
    if !is_suspicious {
        given = some_of(given.len()).map(|k| given[k].at(given[k].readings.clone())).collect();
    }
    let as_described = misfit(robot, &given);
    let instrument = &problem.instruments[given[0].instrument];
    let in_sockets = instrument.kind == InstrumentKind::Socket;
    let mut undone = all_undone(problem, robot, (&given, stops), limits);
    undone.retain(|(_, kind)| !hardly_moves(kind) || is_suspicious);
    // In sockets an arm that hardly moves fits without a cause: what is left counts by how far the tip moves.
    let slower = undone.iter().find(|(_, kind)| in_sockets && hardly_moves(kind));
    let slower = slower.map_or(1.0, |(undone, _)| tip_moves(robot, &given) / tip_moves(robot, undone));
    let shrinks = |kind: &MistakeKind| if hardly_moves(kind) { kind.shrinks() / slower } else { kind.shrinks() };
    let tried = undone.into_par_iter().map(|(undone, kind)| (misfit(robot, &undone) / shrinks(&kind), kind));
    let apart = if in_sockets { f64::INFINITY } else { usually_apart(given.iter().map(|s| s.seen.position())) };
    let explains = |(left, kind): &Explained| {
        let told_by = if hardly_moves(kind) { apart.min(as_described) } else { as_described };
        *left < limits.mistake_explains * told_by && left * shrinks(kind) < limits.suspicious_misfit
    };
    let explaining: Vec<Explained> = tried.filter(explains).collect();
    let (named, kind) = likeliest(&explaining, robot, limits)?;
    let left = explaining[named].0 * shrinks(&explaining[named].1);
    let table = table(problem, &problem.body_measurements[measured[0]]);
    let of = place_of(&kind, instrument.place(), table);
    let rows_of = rows_of_bodies(adjustment, measured, limits);
    Some(Mistake { kind, of, misfit: as_described, misfit_undone: Some(left), by_images: false, rows_of })
}

/// The instrument, and the table of what it measured where the mistake stands there.
fn place_of(kind: &MistakeKind, instrument: String, table: &str) -> String {
    match kind {
        MistakeKind::Poses { .. } | MistakeKind::MeasuredUnit(_) => format!("{table}, {instrument}"),
        _ => instrument,
    }
}

/// What was seen with each of the usual mistakes undone: of what the instrument wrote, of columns and signs, and of the rows of stops at which something
/// was `measured`.
fn all_undone(
    problem: &Problem,
    robot: &Robot,
    (given, measured): (&[BodyAtStop], Vec<usize>),
    limits: &Limits,
) -> Vec<Undone> {
    let readings: Vec<Vec<f64>> = given.iter().map(|s| s.readings.clone()).collect();
    let read_otherwise = all_misread().filter_map(|misread| {
        let undone = |s: &BodyAtStop| Some(BodyAtStop { seen: misread.undone(s.seen)?, ..s.at(s.readings.clone()) });
        Some((given.iter().map(undone).collect::<Option<Vec<_>>>()?, misread.kind()))
    });
    let signs = mirrored_signs_undone(robot, &readings, limits.suspicious_misfit);
    let of_columns = columns_undone(robot, &readings).into_iter().chain(signs).map(|(readings, kind)| {
        let undone = given.iter().zip(readings).map(|(s, readings)| s.at(readings));
        (undone.collect(), kind)
    });
    read_otherwise.chain(of_columns).chain(rows_undone(problem, robot, (given, measured))).collect()
}

/// True for a mistake without which the arm hardly moves: places that hardly differ do not tell it from one that turns about them.
const fn hardly_moves(kind: &MistakeKind) -> bool {
    matches!(kind, MistakeKind::Unit { joint: None, are_degrees: true })
}

/// Median distance of places from their middle, m.
fn usually_apart(places: impl ExactSizeIterator<Item = Vector3<f64>> + Clone) -> f64 {
    let middle = places.clone().sum::<Vector3<f64>>() / places.len() as f64;
    lower_median(places.map(|place| (place - middle).norm()))
}

/// The same of the tip, m.
fn tip_moves(robot: &Robot, at: &[BodyAtStop]) -> f64 {
    usually_apart(at.iter().map(|s| robot.base_from_tip(&s.readings).translation))
}

/// True where a misfit is many times what is stated, of measurements enough to tell a mistake from chance.
fn is_contradicted(problem: &Problem, measured: &[usize], misfit: f64, limits: &Limits) -> bool {
    let stated = |k: &usize| {
        let BodyMeasurement { seen, sigma_m, sigma_rad, .. } = problem.body_measurements[*k];
        if matches!(seen, BodySeen::Pose(_)) { sigma_m + sigma_rad } else { sigma_m }
    };
    let sigma = lower_median(measured.iter().map(stated));
    measured.len() >= 2 * FEWEST_POINTS && misfit > limits.touch_factor * sigma
}

/// What was seen, with the readings of the next stop, or the one before, in its series: of those in joints.csv, and of `measured`, all at which
/// something was measured. A stop at the end has none.
fn rows_undone(problem: &Problem, robot: &Robot, (given, measured): (&[BodyAtStop], Vec<usize>)) -> Vec<Undone> {
    let all: Vec<usize> = (0..problem.stops.len()).collect();
    let orders = if measured.len() < all.len() { vec![all, measured] } else { vec![all] };
    // Few rows fit others by chance.
    let are_points = given.iter().any(|s| matches!(s.seen, BodySeen::Point(_)));
    let fewest = if are_points { 2 * FEWEST_POINTS } else { FEWEST_POSES + 1 };
    let shifts = orders.iter().flat_map(|order| [true, false].map(|below| (order, below)));
    let undone = shifts.flat_map(|(order, below)| {
        let seen = given.iter().filter_map(|s| {
            let own = order.binary_search(&s.stop).ok()?;
            let other = &problem.stops[*order.get(if below { own + 1 } else { own.checked_sub(1)? })?];
            let is_near = other.series == problem.stops[s.stop].series;
            Some((s, other.posture.as_ref().filter(|_| is_near)?.readings.clone()))
        });
        let (seen, shifted): (Vec<&BodyAtStop>, Vec<Vec<f64>>) = seen.unzip();
        if seen.len() < fewest {
            return Vec::new();
        }
        let own: Vec<Vec<f64>> = seen.iter().map(|s| s.readings.clone()).collect();
        let whole = MistakeKind::Rows { below, columns: Vec::new(), part: None };
        let undone = whole_and_parted(robot, &own, (shifted, whole)).into_iter();
        let at = move |(readings, kind): (Vec<Vec<f64>>, MistakeKind)| {
            (seen.iter().zip(readings).map(|(s, readings)| s.at(readings)).collect(), kind)
        };
        undone.map(at).collect::<Vec<Undone>>()
    });
    undone.collect()
}
