//! Images that disagree with their readings but agree with each other: the plate or the camera was moved.

use super::kind::{CheckContext, Kind, Quantity, Subject};
use crate::error::Code;
use crate::geom::Pose;
use crate::init::PosePair;
use crate::problem::{Adjustment, ImageRejection};

/// Plate or camera was moved within a series, by so much that its images were left out.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyMoved {
    /// What was moved.
    pub body: MovedBody,
    /// Last image before and first image after it.
    pub between: [String; 2],
    /// Images that saw the new place.
    pub images: Vec<String>,
    /// How far, m.
    pub distance_m: f64,
    /// By which angle, rad.
    pub angle_rad: f64,
}

/// What can be moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MovedBody {
    /// The plate.
    Plate,
    /// The camera on its mount.
    Camera,
}

pub(super) fn check(adjustment: &Adjustment, setting: &CheckContext) -> Vec<BodyMoved> {
    let series = 0..setting.series.len();
    series.filter_map(|k| find_move(adjustment, setting, k)).collect()
}

/// Looks for one common new place among the wrongly paired images of a series.
fn find_move(Adjustment { problem, state }: &Adjustment, setting: &CheckContext, series: usize) -> Option<BodyMoved> {
    let free = setting.free;
    let mut wrong: Vec<(usize, PosePair)> = Vec::new();
    for (i, image) in problem.images.iter().enumerate().filter(|(_, image)| image.series == series) {
        let suspect = image.rejected.as_ref().is_some_and(ImageRejection::is_wrong_pair);
        if let (true, Some(stop), Some(pose)) = (suspect, problem.posture(i), &free.poses[i]) {
            wrong.push((i, PosePair::of_stop(&state.robot, image.mount, &stop.readings, pose.camera_from_plate)));
        }
    }
    let first = &problem.images[wrong.first()?.0];
    let (camera, plate) = (state.mountings[first.mounting], state.placements[first.placement]);
    let plate_at = |p: &PosePair| p.chain.inverse() * camera * p.camera_from_plate;
    let camera_at = |p: &PosePair| p.chain * plate * p.camera_from_plate.inverse();
    let plates: Vec<Pose> = wrong.iter().map(|(_, p)| plate_at(p)).collect();
    let cameras: Vec<Pose> = wrong.iter().map(|(_, p)| camera_at(p)).collect();
    let (fewest, agreement) = (setting.limits.moved_images, setting.limits.moved_agreement);
    let candidates = [
        (MovedBody::Plate, common(&plates, &plate, fewest, agreement)),
        (MovedBody::Camera, common(&cameras, &camera, fewest, agreement)),
    ];
    let (body, place) = candidates
        .into_iter()
        .filter_map(|(body, common)| common.map(|c| (body, c)))
        .min_by(|a, b| a.1.spread.total_cmp(&b.1.spread))?;
    let images: Vec<usize> = place.members.iter().map(|&k| wrong[k].0).collect();
    let (from, to) = (images.first()?, images.last()?);
    let own = |i: &usize| problem.images[*i].series == series;
    let neighbour = (*to + 1..problem.images.len()).find(own).or_else(|| (0..*from).rev().find(own))?;
    let (early, late) = if neighbour > *to { (*to, neighbour) } else { (neighbour, *from) };
    let name = |i: usize| problem.images[i].name.clone();
    Some(BodyMoved {
        body,
        between: [name(early), name(late)],
        distance_m: place.moved.1,
        angle_rad: place.moved.0,
        images: images.into_iter().map(name).collect(),
    })
}

impl Kind for BodyMoved {
    fn code(&self) -> Code {
        match self.body {
            MovedBody::Plate => Code::PlateMoved,
            MovedBody::Camera => Code::CameraMoved,
        }
    }

    fn subjects(&self) -> Vec<Subject> {
        self.images.iter().cloned().map(Subject::Image).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![Quantity::new("distance", self.distance_m, "m"), Quantity::new("angle", self.angle_rad, "rad")]
    }

    fn place(&self) -> String {
        match self.body {
            MovedBody::Plate => "plate".into(),
            MovedBody::Camera => "camera on its mount".into(),
        }
    }

    fn seen(&self) -> String {
        format!(
            "was moved between {} and {}: {} images, {} to {}, agree on a place {:.1} mm and {:.1} mrad from that of the others",
            self.between[0],
            self.between[1],
            self.images.len(),
            self.images.first().map_or("", String::as_str),
            self.images.last().map_or("", String::as_str),
            1e3 * self.distance_m,
            1e3 * self.angle_rad
        )
    }

    fn remedy(&self) -> String {
        let remedy = match self.body {
            MovedBody::Plate => {
                "give the rows after the move a placement of their own in joints.csv, and fix the plate better"
            }
            MovedBody::Camera => {
                "put the images after the move into a series of their own with another [camera] mounting"
            }
        };
        remedy.into()
    }
}

struct Place {
    members: Vec<usize>,
    /// Angle and distance from the old place.
    moved: (f64, f64),
    spread: f64,
}

/// The place that most of the poses agree on, if they do and it is not the old one.
fn common(poses: &[Pose], old: &Pose, fewest: usize, agreement: f64) -> Option<Place> {
    let mut best: Option<Place> = None;
    for candidate in poses {
        let moved = old.distance(candidate);
        let bound = agreement * (moved.0 + moved.1);
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
        if members.len() >= fewest && more {
            best = Some(Place { members, moved, spread });
        }
    }
    best
}
