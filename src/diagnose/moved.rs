//! Images that disagree with their readings but agree with each other: the plate or the camera was moved.

use crate::fit::FreePoses;
use crate::geom::Pose;
use crate::init::PosePair;
use crate::problem::{ImageRejection, Problem, State};

/// Fewest wrongly paired images that make a new place of plate or camera credible.
const FEWEST: usize = 3;

/// Robust agreement of the new place over its images, as a share of the distance to the old one.
const AGREEMENT: f64 = 0.2;

/// What moved, and when.
#[derive(Debug, Clone, PartialEq)]
pub struct Move {
    /// Images that saw the new place.
    pub images: Vec<usize>,
    /// In words.
    pub what: String,
    /// What to do.
    pub remedy: String,
}

/// Looks for one common new place among the wrongly paired images of a series.
pub fn find_move(problem: &Problem, state: &State, free: &FreePoses, series: usize) -> Option<Move> {
    let mut wrong: Vec<(usize, PosePair)> = Vec::new();
    for (i, image) in problem.images.iter().enumerate().filter(|(_, image)| image.series == series) {
        let suspect = image.rejected.as_ref().is_some_and(ImageRejection::is_wrong_pair);
        if let (true, Some(stop), Some(pose)) = (suspect, &image.stop, &free.poses[i]) {
            wrong.push((i, PosePair::of_stop(&state.robot, image.mount, &stop.readings, pose.camera_from_plate)));
        }
    }
    let first = &problem.images[wrong.first()?.0];
    let (camera, plate) = (state.mountings[first.mounting], state.placements[first.placement]);
    let plate_at = |p: &PosePair| p.chain.inverse() * camera * p.camera_from_plate;
    let camera_at = |p: &PosePair| p.chain * plate * p.camera_from_plate.inverse();
    let plates: Vec<Pose> = wrong.iter().map(|(_, p)| plate_at(p)).collect();
    let cameras: Vec<Pose> = wrong.iter().map(|(_, p)| camera_at(p)).collect();
    let candidates = [
        (
            "the plate",
            common(&plates, &plate),
            "give the rows after the move a placement of their own in joints.csv, and fix the plate better",
        ),
        (
            "the camera on its mount",
            common(&cameras, &camera),
            "put the images after the move into a series of their own with another [camera] mounting",
        ),
    ];
    let (name, place, remedy) = candidates
        .into_iter()
        .filter_map(|(n, c, r)| c.map(|c| (n, c, r)))
        .min_by(|a, b| a.1.spread.total_cmp(&b.1.spread))?;
    let images: Vec<usize> = place.members.iter().map(|&k| wrong[k].0).collect();
    let (from, to) = (images.first()?, images.last()?);
    let own = |i: &usize| problem.images[*i].series == series;
    let neighbour = (*to + 1..problem.images.len()).find(own).or_else(|| (0..*from).rev().find(own))?;
    let (early, late) = if neighbour > *to { (*to, neighbour) } else { (neighbour, *from) };
    let what = format!(
        "{name} was moved between {} and {}: {} images, {} to {}, agree on a place {:.1} mm and {:.1} mrad from that of the others",
        problem.images[early].name,
        problem.images[late].name,
        images.len(),
        problem.images[*from].name,
        problem.images[*to].name,
        1e3 * place.moved.1,
        1e3 * place.moved.0
    );
    Some(Move { images, what, remedy: remedy.to_owned() })
}

struct Place {
    members: Vec<usize>,
    /// Angle and distance from the old place.
    moved: (f64, f64),
    spread: f64,
}

/// The place that most of the poses agree on, if they do and it is not the old one.
fn common(poses: &[Pose], old: &Pose) -> Option<Place> {
    let mut best: Option<Place> = None;
    for candidate in poses {
        let moved = old.distance(candidate);
        let bound = AGREEMENT * (moved.0 + moved.1);
        let mut members = Vec::new();
        let mut spread = 0.0;
        for (k, pose) in poses.iter().enumerate() {
            let (angle, distance) = candidate.distance(pose);
            if angle + distance < bound {
                members.push(k);
                spread += angle + distance;
            }
        }
        spread /= (members.len().max(2) - 1) as f64;
        let more = best.as_ref().is_none_or(|b| (members.len(), -spread) > (b.members.len(), -b.spread));
        if members.len() >= FEWEST && more {
            best = Some(Place { members, moved, spread });
        }
    }
    best
}
