//! Boards that look the same after a turn: which way round they were in each image, from the readings of the robot.
//!
//! Two images of one camera mounting and one placement see the plate at M_i = X^-1 A_i Z (X, Z unknown, A from the readings), so that
//! M_i M_j^-1 turns by the same angle as A_i A_j^-1, whatever X and Z are. An image whose ids are off by a turn T of the plate shows M_i T,
//! and the angle does not fit. What is left open is one turn of all images together: a choice of the plate's frame.

use std::borrow::Cow;
use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::build::build;
use super::free_poses::adjust_free_poses;
use super::stated::focals_px;
use crate::assess::Limits;
use crate::geom::{exp_so3, log_so3};
use crate::init::PosePair;
use crate::model::robot::Robot;
use crate::problem::MeasuredSeries;
use crate::series::PlateTurn;

/// Angles further apart do not count more, rad: such an image has another fault.
const MOST_MISFIT: f64 = 0.3;
/// Most rounds in which every image is compared with all others.
const ROUNDS: usize = 10;

/// An image on the robot.
struct View {
    series: usize,
    stop: usize,
    /// `camera_from_plate` for every turn that the plate allows, by quarter turns.
    camera_from_plate: Vec<(u8, Matrix3<f64>)>,
    /// A.
    chain: Matrix3<f64>,
}

/// The series with ids as the readings demand them; unchanged where the plates have no symmetry or no camera poses are found.
pub(super) fn settled<'a>(robot: &Robot, series: &'a [MeasuredSeries], limits: &Limits) -> Cow<'a, [MeasuredSeries]> {
    let turns: Vec<Vec<PlateTurn>> = series.iter().map(|s| s.plate.turns()).collect();
    if turns.iter().all(Vec::is_empty) {
        return Cow::Borrowed(series);
    }
    let mut turned = series.to_vec();
    let mut changed = false;
    for views in groups(robot, series, &turns, limits) {
        for (view, quarters) in views.iter().zip(agreeing(&views)) {
            let turn = turns[view.series].iter().find(|t| t.quarters == quarters);
            let Some(turn) = turn else { continue };
            let observations = &mut turned[view.series].stops[view.stop].observations;
            observations.iter_mut().for_each(|o| o.marker = turn.id(o.marker));
            observations.sort_by_key(|o| (o.marker, o.edge));
            changed = true;
        }
    }
    if changed { Cow::Owned(turned) } else { Cow::Borrowed(series) }
}

/// Images that share a camera mounting and a placement, with the poses that the images alone give.
fn groups(robot: &Robot, series: &[MeasuredSeries], turns: &[Vec<PlateTurn>], limits: &Limits) -> Vec<Vec<View>> {
    let Ok(start) = build(robot, series, false, limits) else { return Vec::new() };
    let stated = focals_px(&start.problem.cameras, series);
    let Ok((adjustment, free, _)) = adjust_free_poses(start, &stated, limits) else { return Vec::new() };
    let mut groups: BTreeMap<(usize, usize), Vec<View>> = BTreeMap::new();
    let mut first = vec![0; series.len() + 1];
    series.iter().enumerate().for_each(|(k, s)| first[k + 1] = first[k] + s.stops.len());
    for (i, image, _) in adjustment.used() {
        let (Some(stop), Some(pose)) = (adjustment.problem.posture(i), &free.poses[i]) else { continue };
        let pair = PosePair::of_stop(robot, image.mount, &stop.readings, pose.camera_from_plate);
        let seen = pair.camera_from_plate.rotation;
        let about = |quarters: u8| {
            let angle = -f64::from(quarters) * std::f64::consts::FRAC_PI_2;
            (quarters, seen * exp_so3(&Vector3::new(0.0, 0.0, angle)))
        };
        let camera_from_plate = std::iter::once(0).chain(turns[image.series].iter().map(|t| t.quarters)).map(about);
        groups.entry((image.mounting, image.placement)).or_default().push(View {
            series: image.series,
            stop: i - first[image.series],
            camera_from_plate: camera_from_plate.collect(),
            chain: pair.chain.rotation,
        });
    }
    groups.into_values().filter(|views| views.iter().any(|v| v.camera_from_plate.len() > 1)).collect()
}

/// The turns, by quarters, with which the images agree best; that of most images is none.
fn agreeing(views: &[View]) -> Vec<u8> {
    let angle = |a: &Matrix3<f64>, b: &Matrix3<f64>| log_so3(&(a * b.transpose())).norm();
    let mut chosen: Vec<Option<usize>> = vec![None; views.len()];
    for round in 0..ROUNDS {
        let before = chosen.clone();
        for i in 0..views.len() {
            let misfit = |k: usize| -> f64 {
                let pairs = chosen.iter().enumerate().filter(|(j, _)| *j != i).filter_map(|(j, &c)| Some((j, c?)));
                pairs
                    .map(|(j, c)| {
                        let seen = angle(&views[i].camera_from_plate[k].1, &views[j].camera_from_plate[c].1);
                        (seen - angle(&views[i].chain, &views[j].chain)).abs().min(MOST_MISFIT)
                    })
                    .sum()
            };
            let misfits: Vec<f64> = (0..views[i].camera_from_plate.len()).map(misfit).collect();
            chosen[i] = (0..misfits.len()).min_by(|&a, &b| misfits[a].total_cmp(&misfits[b]));
        }
        if round > 0 && chosen == before {
            break;
        }
    }
    let quarters: Vec<u8> = views.iter().zip(&chosen).map(|(v, c)| v.camera_from_plate[c.unwrap_or(0)].0).collect();
    let count = |q: u8| quarters.iter().filter(|&&other| other == q).count();
    let usual = (0..4).max_by_key(|&q| (count(q), std::cmp::Reverse(q))).unwrap_or(0);
    quarters.iter().map(|q| (q + 4 - usual) % 4).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Images of a camera in the hand at eight postures, seen with ids that are off by these quarter turns.
    fn views(off: &[u8], allowed: &[u8]) -> Vec<View> {
        let rotation = |k: usize| {
            let angles = [0.9, 0.7, 1.3].map(|f: f64| (f * (k as f64 + 1.0) * 2.3).sin() * 1.4);
            exp_so3(&Vector3::from(angles))
        };
        let (x, z) = (rotation(40), rotation(50));
        let about = |quarters: u8| exp_so3(&Vector3::new(0.0, 0.0, -f64::from(quarters) * std::f64::consts::FRAC_PI_2));
        let view = |(k, &off): (usize, &u8)| {
            let seen = x.transpose() * rotation(k) * z * about(4 - off);
            let tried = std::iter::once(&0).chain(allowed);
            let camera_from_plate = tried.map(|&q| (q, seen * about(q))).collect();
            View { series: 0, stop: k, camera_from_plate, chain: rotation(k) }
        };
        off.iter().enumerate().map(view).collect()
    }

    #[test]
    fn turned_images_are_turned_back() {
        let half = [0, 0, 2, 0, 2, 0, 0, 2];
        assert_eq!(agreeing(&views(&half, &[2])), half);
        let quarter = [0, 1, 0, 3, 0, 2, 0, 0];
        assert_eq!(agreeing(&views(&quarter, &[1, 2, 3])), quarter);
    }
}
