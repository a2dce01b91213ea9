//! What stops are compared by, where readings were computed from poses: what was seen at them, linearised at the nominal robot.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use super::choice::Candidate;
use crate::assess::Limits;
use crate::error::Result;
use crate::fit::FreePoses;
use crate::identify::bodies::start::start_bodies;
use crate::identify::photogrammetry::free_poses::free_poses_of;
use crate::identify::problem::build::build;
use crate::identify::start::robot::{StartGiven, start_robot};
use crate::linalg::dense;
use crate::model::robot::{LinearOrigins, Posture, Robot};
use crate::problem::{Adjustment, Chained, MeasuredSeries, State, TakenFrom};
use crate::stage::stage;

/// Noise of the readings of the stops that are compared, rad or m.
const JOINT_SIGMA: f64 = 1e-4;

/// The robot at its start beside free camera poses: what stops are compared by.
pub(super) struct Compared {
    pub adjustment: Adjustment,
    free: FreePoses,
    columns: Vec<usize>,
    /// Prior information of the parameters.
    pub prior: DVector<f64>,
    pub stops: Vec<SeenAt>,
}

/// What was seen at a stop.
#[derive(Debug, Clone, Default)]
pub(super) struct SeenAt {
    pub stop: usize,
    /// Images by their indices.
    pub images: Vec<usize>,
    /// Measurements of bodies by their indices.
    pub bodies: Vec<usize>,
}

impl SeenAt {
    /// What images alone saw; `None` where there is none.
    pub fn by_images(&self) -> Option<Self> {
        (!self.images.is_empty()).then(|| Self { bodies: Vec::new(), ..self.clone() })
    }
}

impl Compared {
    /// What is `found` with series of which some have readings that were computed from poses; `None` where all were read. `hold` holds the columns
    /// that are not to be fitted.
    pub fn with<T>(
        stage_name: &'static str,
        robot: &Robot,
        (series, limits): (&[MeasuredSeries], &Limits),
        hold: impl FnOnce(&mut Adjustment) -> Result<()>,
        found: impl FnOnce(&Self) -> Option<T>,
    ) -> Option<T> {
        if !series.iter().any(MeasuredSeries::readings_are_computed) {
            return None;
        }
        let _stage = stage(stage_name);
        found(&Self::of(robot, series, limits, hold)?)
    }

    fn of(
        robot: &Robot,
        series: &[MeasuredSeries],
        limits: &Limits,
        hold: impl FnOnce(&mut Adjustment) -> Result<()>,
    ) -> Option<Self> {
        let has_images = series.iter().any(|s| s.stops.iter().any(|stop| !stop.observations.is_empty()));
        let (mut adjustment, free, mut verdicts) = match has_images {
            true => free_poses_of(robot, series, limits, hold).ok()?,
            false => {
                let mut start = build(robot, series, false, limits).ok()?;
                hold(&mut start).ok()?;
                let free = FreePoses::none(start.state.clone());
                (start, free, Vec::new())
            }
        };
        start_robot(&mut adjustment, &free, StartGiven::of(series, limits), &mut verdicts).ok()?;
        // Where they do not fit, the joint fit says why, and the images tell by themselves.
        let bodies_fit = start_bodies(&mut adjustment, series, limits).is_ok();
        let layout = &adjustment.problem.layout;
        let columns: Vec<usize> = (0..layout.theta_len()).filter(|&c| layout.columns[c].free).collect();
        let prior = columns.iter().map(|&c| layout.columns[c].prior_sigma.powi(-2));
        let prior = DVector::from_iterator(columns.len(), prior);
        let mut by_stop: BTreeMap<usize, SeenAt> = BTreeMap::new();
        for i in adjustment.problem.used_on_robot() {
            by_stop.entry(adjustment.problem.images[i].stop).or_default().images.push(i);
        }
        for (k, measured) in adjustment.problem.used_bodies().filter(|_| bodies_fit) {
            by_stop.entry(measured.stop).or_default().bodies.push(k);
        }
        let stops = by_stop.into_iter().map(|(stop, seen)| SeenAt { stop, ..seen }).collect();
        Some(Self { adjustment, free, columns, prior, stops })
    }

    /// What was seen at a stop says of some readings, by the unknowns of a state.
    pub fn candidate(
        &self,
        (state, origins): (&State, &LinearOrigins),
        seen: &SeenAt,
        readings: Vec<f64>,
    ) -> Option<Candidate> {
        let problem = &self.adjustment.problem;
        let read = problem.stops[seen.stop].posture.as_ref()?;
        let (posture, zeros) = (approached(read, &readings), vec![0.0; readings.len()]);
        let from = || TakenFrom::rigid(&posture, &zeros);
        let of_image = |&i: &usize| {
            let pose = self.free.poses[i].as_ref()?;
            let chained = state.chained_from(origins, &problem.layout, &problem.images[i], from())?;
            let e = (chained.pose.inverse() * pose.camera_from_plate).log();
            let noise = dense(&pose.covariance);
            self.whitened(&chained, DMatrix::identity(6, 6), (DVector::from_column_slice(e.as_slice()), noise))
        };
        let of_body = |&k: &usize| {
            let measured = &problem.body_measurements[k];
            let chained = state.body_chained(origins, &problem.layout, measured, from())?;
            let (e, by_pose) = measured.residual(&chained.pose);
            let count = measured.seen.coordinates();
            let by_pose = DMatrix::from_fn(count, 6, |row, column| by_pose[(row, column)]);
            let sigma = |row: usize| if row < 3 { measured.sigma_m } else { measured.sigma_rad };
            let noise = DMatrix::from_diagonal(&DVector::from_fn(count, |row, _| sigma(row).powi(2)));
            self.whitened(&chained, by_pose, (DVector::from_fn(count, |row, _| e[row]), noise))
        };
        let all = seen.images.iter().map(of_image).chain(seen.bodies.iter().map(of_body));
        let (g, e): (Vec<_>, Vec<_>) = all.collect::<Option<Vec<_>>>()?.into_iter().unzip();
        let rows: Vec<_> = g.iter().flat_map(DMatrix::row_iter).collect();
        let e = e.iter().flatten().copied().collect();
        (!rows.is_empty()).then(|| Candidate { readings, g: DMatrix::from_rows(&rows), e: DVector::from_vec(e) })
    }

    /// Of a residual that depends on a pose, with the noise of what was seen and that of the readings.
    fn whitened(
        &self,
        chained: &Chained,
        by_pose: DMatrix<f64>,
        (e, noise): (DVector<f64>, DMatrix<f64>),
    ) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let by_readings = &by_pose * &chained.d_latent * JOINT_SIGMA;
        let root = (noise + &by_readings * by_readings.transpose()).cholesky()?.l().try_inverse()?;
        Some((&root * by_pose * chained.d_theta.select_columns(&self.columns), root * e))
    }
}

/// A stop in another posture than that in which it was `read`, reached from the same stop before.
fn approached(read: &Posture, readings: &[f64]) -> Posture {
    let from_there = |approach: &Vec<f64>| {
        let before = read.readings.iter().zip(approach).map(|(q, a)| q - a);
        readings.iter().zip(before).map(|(q, before)| q - before).collect()
    };
    Posture { readings: readings.to_vec(), approach: read.approach.as_ref().map(from_there) }
}
