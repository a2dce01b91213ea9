//! Images that disagree with their readings but agree with each other: the plate or the camera was moved, or a joint reads otherwise.

use std::collections::BTreeMap;

use super::agreement::{Agreement, Moved, agreement};
use crate::assess::Limits;
use crate::diagnose::kind::{CheckContext, Kind, Quantity, Subject, some_of};
use crate::error::Code;
use crate::init::{HandEye, SeenStop};
use crate::problem::{Adjustment, ImageRejection, Problem};

/// Images that are named one by one; the subjects have all.
const MOST_NAMED: usize = 12;

/// Something is another at some images of a series, by so much that these do not fit the others.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyMoved {
    /// What, and by how much.
    pub moved: Moved,
    /// Last image before and first image after it.
    pub between: [String; 2],
    /// Images that saw it.
    pub images: Vec<String>,
    /// Whether images that fit the others stand between them, again and again: nothing was moved once.
    pub by_turns: bool,
}

/// What the wrongly paired images of a series agree on, for each mounting and placement.
pub fn check(Adjustment { problem, state }: &Adjustment, setting: &CheckContext) -> Vec<BodyMoved> {
    let mut groups: BTreeMap<[usize; 3], Vec<(usize, SeenStop)>> = BTreeMap::new();
    for (i, image) in problem.images.iter().enumerate() {
        let suspect = image.rejected.as_ref().is_some_and(ImageRejection::is_wrong_pair);
        if let (true, Some(stop), Some(pose)) = (suspect, problem.posture(i), &setting.free.poses[i]) {
            let (readings, camera_from_plate) = (stop.readings.clone(), pose.camera_from_plate);
            let seen = SeenStop { readings, mount: image.mount, camera_from_plate };
            groups.entry([image.series, image.mounting, image.placement]).or_default().push((i, seen));
        }
    }
    let moved = |([_, mounting, placement], wrong): ([usize; 3], Vec<(usize, SeenStop)>)| {
        let others = HandEye { camera: state.mountings[mounting], plate: state.placements[placement] };
        let (images, seen): (Vec<usize>, Vec<SeenStop>) = wrong.into_iter().unzip();
        let found = agreement(&state.robot, &others, &seen, setting.limits)?;
        BodyMoved::of(problem, &images, found, setting.limits)
    };
    groups.into_iter().filter_map(moved).collect()
}

/// Whether images of the same mounting and placement that fit stand between the members, with so many changes from the one to the other.
fn stand_between(problem: &Problem, members: &[usize], changes: usize) -> bool {
    let (Some(&from), Some(&to)) = (members.first(), members.last()) else { return false };
    let group = |i: usize| {
        let image = &problem.images[i];
        [image.series, image.mounting, image.placement]
    };
    let own = (from..=to).filter(|&i| group(i) == group(from));
    let is_member = own.filter_map(|i| {
        let is_member = members.contains(&i);
        (is_member || problem.images[i].rejected.is_none()).then_some(is_member)
    });
    let is_member: Vec<bool> = is_member.collect();
    is_member.windows(2).filter(|two| two[0] != two[1]).count() >= changes
}

impl BodyMoved {
    /// What some `images`, by their index, agree on.
    pub fn of(problem: &Problem, images: &[usize], found: Agreement, limits: &Limits) -> Option<Self> {
        let images: Vec<usize> = found.members.iter().map(|&k| images[k]).collect();
        let (from, to) = (*images.first()?, *images.last()?);
        let own = |i: &usize| problem.images[*i].series == problem.images[from].series;
        let neighbour = (to + 1..problem.images.len()).find(own).or_else(|| (0..from).rev().find(own))?;
        let (early, late) = if neighbour > to { (to, neighbour) } else { (neighbour, from) };
        let name = |i: usize| problem.images[i].name.clone();
        let between = [name(early), name(late)];
        let by_turns = stand_between(problem, &images, limits.place_changes);
        Some(Self { moved: found.moved, between, images: images.into_iter().map(name).collect(), by_turns })
    }

    fn images_in_words(&self) -> String {
        let (count, end) = (self.images.len(), |image: Option<&String>| image.cloned().unwrap_or_default());
        match self.by_turns {
            // Between the first and the last stand others.
            true => format!("{count} images ({})", some_of(&self.images, MOST_NAMED)),
            false => format!("{count} images, {} to {}", end(self.images.first()), end(self.images.last())),
        }
    }
}

impl Kind for BodyMoved {
    fn code(&self) -> Code {
        match self.moved {
            Moved::Plate { .. } => Code::PlateMoved,
            Moved::Camera { .. } => Code::CameraMoved,
            Moved::Images { .. } => Code::ImagesTurned,
            Moved::Ids { .. } => Code::IdsReversed,
            Moved::Zero { .. } => Code::ZeroMoved,
            Moved::Readings { .. } => Code::JointReadingsWrong,
        }
    }

    fn subjects(&self) -> Vec<Subject> {
        let joint = match &self.moved {
            Moved::Zero { joint, .. } | Moved::Readings { joint: Some(joint), .. } => {
                Some(Subject::Joint(joint.clone()))
            }
            _ => None,
        };
        joint.into_iter().chain(self.images.iter().cloned().map(Subject::Image)).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        match self.moved {
            Moved::Plate { distance_m, angle_rad } | Moved::Camera { distance_m, angle_rad } => {
                vec![Quantity::new("distance", distance_m, "m"), Quantity::new("angle", angle_rad, "rad")]
            }
            Moved::Images { turn_rad, distance_m } => {
                vec![Quantity::new("turn", turn_rad, "rad"), Quantity::new("distance", distance_m, "m")]
            }
            Moved::Ids { distance_m } => vec![Quantity::new("distance", distance_m, "m")],
            Moved::Zero { kind, offset, .. } => vec![Quantity::new("offset", offset, kind.units()[0])],
            Moved::Readings { .. } => Vec::new(),
        }
    }

    fn place(&self) -> String {
        match &self.moved {
            Moved::Plate { .. } => "plate".into(),
            Moved::Camera { .. } => "camera on its mount".into(),
            Moved::Images { .. } => "images".into(),
            Moved::Ids { .. } => "ids of the markers".into(),
            Moved::Zero { joint, .. } | Moved::Readings { joint: Some(joint), .. } => joint.clone(),
            Moved::Readings { joint: None, .. } => "joint readings".into(),
        }
    }

    fn seen(&self) -> String {
        let [before, after] = &self.between;
        let images = self.images_in_words();
        match &self.moved {
            Moved::Plate { distance_m, angle_rad } | Moved::Camera { distance_m, angle_rad } if self.by_turns => {
                format!(
                    "stands in two places by turns: {images}, agree on a place {:.1} mm and {:.1} mrad from that of the others, which stand between them",
                    1e3 * distance_m,
                    1e3 * angle_rad
                )
            }
            Moved::Plate { distance_m, angle_rad } | Moved::Camera { distance_m, angle_rad } => format!(
                "was moved between {before} and {after}: {images}, agree on a place {:.1} mm and {:.1} mrad from that of the others",
                1e3 * distance_m,
                1e3 * angle_rad
            ),
            Moved::Images { turn_rad, distance_m } if self.by_turns => format!(
                "{images} are turned by {:.0} degrees, others between them are not: they fit the others when they are turned back (to {:.1} mm of the place of the camera)",
                turn_rad.to_degrees().abs(),
                1e3 * distance_m
            ),
            Moved::Images { turn_rad, distance_m } => format!(
                "are turned by {:.0} degrees between {before} and {after}: {images}, fit the others when they are turned back (to {:.1} mm of the place of the camera)",
                turn_rad.to_degrees().abs(),
                1e3 * distance_m
            ),
            Moved::Ids { distance_m } => format!(
                "{images} show the plate turned by half a turn about its centre ({:.1} mm from its place): in them its markers are counted from the other end",
                1e3 * distance_m
            ),
            Moved::Zero { kind, offset, or, .. } if self.by_turns => format!(
                "its zero stands in two places by turns: {images} agree on {:+.3} {} from that of the others, which stand between them{}",
                1e3 * offset,
                kind.units()[1],
                or.map(|body| format!(" (or {body} was turned)")).unwrap_or_default()
            ),
            Moved::Zero { kind, offset, or, .. } => format!(
                "its zero was moved between {before} and {after}: {images}, agree on {:+.3} {} from that of the others: the joint was mastered anew, its encoder or belt slipped{}",
                1e3 * offset,
                kind.units()[1],
                or.map(|body| format!(", or {body} was turned")).unwrap_or_default()
            ),
            Moved::Readings { joint: None, .. } => {
                format!("are the same for {images}, which show different poses: nothing was read any more")
            }
            Moved::Readings { stand_still, .. } => format!(
                "its readings are wrong at some stops: {images}, fit where it stands elsewhere at each{}",
                if *stand_still { ", and it reads the same at all of them: it was not read any more" } else { "" }
            ),
        }
    }

    fn remedy(&self) -> String {
        let remedy = match self.moved {
            Moved::Plate { .. } if self.by_turns => {
                "two equal boards may be in view (cover one of them), or the plate was put to and fro: give the rows of each place a placement of their own in joints.csv"
            }
            Moved::Camera { .. } if self.by_turns => "fasten the camera: it goes to and fro between two places",
            Moved::Plate { .. } => {
                "give the rows after the move a placement of their own in joints.csv, and fix the plate better"
            }
            Moved::Camera { .. } => {
                "put the images after the move into a series of their own with another [camera] mounting"
            }
            Moved::Images { .. } => {
                "turn these images back, and see what turns them (camera, driver, viewer); another mounting is right only where the camera itself was turned, as its lens is then turned with it"
            }
            Moved::Ids { .. } => {
                "number the markers of these images from the same end as those of the others: the last id plus the first, less the id; a board with an odd and an even count of corners shows where it begins. Where the plate itself was turned, give these rows a placement of their own"
            }
            Moved::Zero { .. } => "identify the robot from the stops of one mastering, before the move or after it",
            Moved::Readings { .. } => "correct the readings of these stops, or leave their rows out",
        };
        remedy.into()
    }
}
