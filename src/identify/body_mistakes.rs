//! When readings and what an instrument saw of a body do not fit: the usual mistakes in either, tried one by one, named where one of them
//! explains it.

use super::misread::all_misread;
use super::mistakes::mistakes_undone;
use crate::assess::Limits;
use crate::diagnose::{Finding, Mistake};
use crate::error::Result;
use crate::model::robot::Robot;
use crate::problem::{Adjustment, BodyMeasurement, BodySeen};

/// What an instrument saw of a body, and the readings at its stop.
pub(super) struct SeenAt {
    /// The instrument, by its index.
    pub instrument: usize,
    /// What it saw.
    pub seen: BodySeen,
    /// Readings, rad or m.
    pub readings: Vec<f64>,
}

/// Refuses measurements and readings that fit with one of the usual mistakes undone, and only then. `misfit` is the median misfit of poses
/// (rad + m), or of points (m), with given readings.
///
/// # Errors
/// The mistake that explains most.
pub(super) fn name_mistake(
    Adjustment { problem, state }: &Adjustment,
    measured: &[usize],
    limits: &Limits,
    misfit: impl Fn(&Robot, &[SeenAt]) -> f64,
) -> Result<()> {
    let robot = &state.robot;
    let at = |k: &usize| {
        let BodyMeasurement { instrument, stop, seen, .. } = problem.body_measurements[*k];
        let readings = problem.stops[stop].posture.as_ref()?.readings.clone();
        Some(SeenAt { instrument, seen, readings })
    };
    let given: Vec<SeenAt> = measured.iter().filter_map(at).collect();
    let as_described = misfit(robot, &given);
    if as_described < limits.suspicious_misfit || robot.chain.pose_coordinates().is_some() {
        return Ok(());
    }
    let readings: Vec<Vec<f64>> = given.iter().map(|s| s.readings.clone()).collect();
    let read_otherwise = all_misread().filter_map(|misread| {
        let undone = |s: &SeenAt| Some(SeenAt { seen: misread.undone(s.seen)?, readings: s.readings.clone(), ..*s });
        Some((given.iter().map(undone).collect::<Option<Vec<_>>>()?, misread.kind()))
    });
    let of_readings = mistakes_undone(robot, &readings).into_iter().map(|(readings, kind)| {
        let undone = given.iter().zip(readings).map(|(s, readings)| SeenAt { readings, ..*s });
        (undone.collect(), kind)
    });
    let tried = read_otherwise.chain(of_readings).map(|(undone, kind)| (misfit(robot, &undone), kind));
    let best = tried
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .filter(|(left, _)| *left < limits.mistake_explains * as_described && *left < limits.suspicious_misfit);
    best.map_or(Ok(()), |(left, kind)| {
        let instrument = &problem.instruments[given[0].instrument];
        let of = format!("{} {}", instrument.kind.block(), instrument.name);
        let mistake = Mistake { kind, of, misfit: as_described, misfit_undone: Some(left), by_images: false };
        Err(Finding::from(mistake).refusal())
    })
}
