//! The stops of the images in use, and what stands still while the robot moves.

use crate::geom::Pose;
use crate::model::robot::Posture;
use crate::problem::{Adjustment, Problem};
use crate::series::CameraMount;

/// Stops of the images in use.
pub fn stops(problem: &Problem) -> Vec<Posture> {
    problem.used_stops().into_iter().filter_map(|s| problem.stops[s].posture.clone()).collect()
}

/// Joint noise of every stop on the robot that is in use, rad or m.
pub(super) fn on_robot_sigmas(problem: &Problem) -> Vec<Vec<f64>> {
    let on_robot = problem.used_stops().into_iter().map(|s| &problem.stops[s]).filter(|s| s.posture.is_some());
    on_robot.map(|s| problem.joint_sigma(s.series)).collect()
}

/// Share of these stops that every noise of stops has.
pub(super) fn shares_of_series(problem: &Problem) -> Vec<f64> {
    let mut shares = vec![0.0; problem.noise.joint.len()];
    let on_robot: Vec<usize> =
        problem.used_stops().into_iter().filter(|s| problem.stops[*s].posture.is_some()).collect();
    on_robot.iter().for_each(|s| shares[problem.stops[*s].series] += 1.0 / on_robot.len() as f64);
    shares
}

/// What stands still in the base frame for the first image on the robot, with its first column: the plate, or a fixed camera; without images
/// an instrument.
pub fn still(Adjustment { problem, state }: &Adjustment) -> Option<(Pose, usize)> {
    let layout = &problem.layout;
    let Some(image) = problem.used_on_robot().next().map(|i| &problem.images[i]) else {
        let (_, measured) = problem.used_bodies().next()?;
        return Some((state.instruments[measured.instrument], layout.instruments[measured.instrument].start));
    };
    Some(match image.mount {
        CameraMount::Hand => (state.placements[image.placement], layout.placements[image.placement].start),
        CameraMount::Fixed => (state.mountings[image.mounting], layout.mountings[image.mounting].start),
    })
}
