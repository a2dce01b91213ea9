//! Boards that look the same after a turn: which way round they were in each image, from the readings of the robot.
//!
//! Two images of one camera mounting and one placement see the plate at M_i = X^-1 A_i Z (X, Z unknown, A from the readings), so that
//! M_i M_j^-1 turns by the same angle as A_i A_j^-1, whatever X and Z are. An image whose ids are off by a turn T of the plate shows M_i T,
//! and the angle does not fit. What is left open is one turn of all images together: a choice of the plate's frame.
//!
//! An image of a grid whose larger dots are not seen is compared so with those that show them, and stays left out unless one turn alone fits.

use std::borrow::Cow;
use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use crate::assess::Limits;
use crate::geom::{exp_so3, log_so3};
use crate::identify::photogrammetry::free_poses::free_poses_of;
use crate::init::{PosePair, solve_hand_eye};
use crate::model::robot::Robot;
use crate::problem::{Image, MeasuredSeries, MeasuredStop};
use crate::series::PlateTurn;

/// Angles further apart do not count more, rad: such an image has another fault.
const MOST_MISFIT: f64 = 0.3;
/// A turn is told where its misfit is below this on the average, and that of every other turn above it by as much, rad: they are a quarter turn apart.
const TOLD: f64 = 0.1;
/// Fewest images with a known turn that tell that of another.
const FEWEST_KNOWN: usize = 3;
/// Most rounds in which every image is compared with all others.
const ROUNDS: usize = 10;

/// An image on the robot.
struct View {
    series: usize,
    stop: usize,
    /// `camera_from_plate` for every turn that the plate allows, by quarter turns.
    camera_from_plate: Vec<(u8, Matrix3<f64>)>,
    /// M as the ids are, and A.
    pair: PosePair,
    /// Whether the image does not tell the turn of a plate that others tell.
    is_open: bool,
}

/// The series with ids as the readings demand them; unchanged where the plates have no symmetry or no camera poses are found.
pub(in crate::identify) fn settled<'a>(
    robot: &Robot,
    series: &'a [MeasuredSeries],
    limits: &Limits,
) -> Cow<'a, [MeasuredSeries]> {
    let turns: Vec<Vec<PlateTurn>> = series.iter().map(|s| s.plate.turns()).collect();
    let has_open = series.iter().any(|s| s.stops.iter().any(MeasuredStop::is_turn_open));
    if turns.iter().all(Vec::is_empty) && !has_open {
        return Cow::Borrowed(series);
    }
    let mut turned = series.to_vec();
    let mut changed = false;
    let mut found: BTreeMap<usize, Matrix3<f64>> = BTreeMap::new();
    for (placement, views) in groups(robot, series, &turns, limits) {
        let (open, views): (Vec<View>, Vec<View>) = views.into_iter().partition(|view| view.is_open);
        if views.is_empty() {
            continue;
        }
        let own = agreeing(&views);
        let common = common_turn(&views, &own, &turns[views[0].series], found.get(&placement));
        if let Some(plate) = plate_of(&views, &own, common) {
            found.entry(placement).or_insert(plate);
        }
        let quarters: Vec<u8> = own.iter().map(|own| (own + common) % 4).collect();
        for view in &open {
            let Some(quarters) = told(view, &views, &quarters) else { continue };
            let stop = &mut turned[view.series].stops[view.stop];
            stop.left_out = None;
            changed = true;
            series[view.series].plate.turn_of_places(quarters).iter().for_each(|turn| turn_ids(stop, turn));
        }
        for (view, quarters) in views.iter().zip(quarters) {
            let Some(turn) = turns[view.series].iter().find(|t| t.quarters == quarters) else { continue };
            turn_ids(&mut turned[view.series].stops[view.stop], turn);
            changed = true;
        }
    }
    if changed { Cow::Owned(turned) } else { Cow::Borrowed(series) }
}

fn turn_ids(stop: &mut MeasuredStop, turn: &PlateTurn) {
    stop.observations.iter_mut().for_each(|o| o.marker = turn.id(o.marker));
    stop.observations.sort_by_key(|o| (o.marker, o.edge));
}

/// The series with the images that tell no turn as others, turned by so many quarters, so that they have a pose.
fn with_open(series: &[MeasuredSeries], quarters: u8) -> Vec<MeasuredSeries> {
    let mut all = series.to_vec();
    for own in &mut all {
        let turn = own.plate.turn_of_places(quarters);
        for stop in own.stops.iter_mut().filter(|stop| stop.is_turn_open()) {
            stop.left_out = None;
            turn.iter().for_each(|turn| turn_ids(stop, turn));
        }
    }
    all
}

/// Where an image on the robot stands, with what it sees and the readings.
struct Posed {
    series: usize,
    stop: usize,
    group: (usize, usize),
    pair: PosePair,
}

/// Those to which the images alone give a pose.
fn posed(robot: &Robot, series: &[MeasuredSeries], limits: &Limits) -> Vec<Posed> {
    let Ok((adjustment, free, _)) = free_poses_of(robot, series, limits, |_| Ok(())) else { return Vec::new() };
    let images = &adjustment.problem.images;
    let place = |i: usize| images[..i].iter().filter(|other| other.series == images[i].series).count();
    let of = |(i, image): (usize, &Image)| {
        let (readings, pose) = (&adjustment.problem.posture(i)?.readings, free.poses[i].as_ref()?);
        let pair = PosePair::of_stop(robot, image.mount, readings, pose.camera_from_plate);
        Some(Posed { series: image.series, stop: place(i), group: (image.mounting, image.placement), pair })
    };
    adjustment.used().filter_map(|(i, image, _)| of((i, image))).collect()
}

/// The same, with the images that tell no turn as they are. One whose ids are off by a turn may not fit the plate as the others found it, and has a pose only
/// where it is turned back.
fn posed_as_they_are(robot: &Robot, series: &[MeasuredSeries], limits: &Limits) -> Vec<Posed> {
    let mut all = posed(robot, &with_open(series, 0), limits);
    for quarters in 1..4 {
        let has_pose = |s: usize, k: usize| all.iter().any(|posed| (posed.series, posed.stop) == (s, k));
        let lacks = |(s, own): (usize, &MeasuredSeries)| {
            let has_turn = own.plate.turn_of_places(quarters).is_some();
            let open = own.stops.iter().enumerate().filter(|(_, stop)| stop.is_turn_open() && stop.readings.is_some());
            has_turn && open.into_iter().any(|(k, _)| !has_pose(s, k))
        };
        if !series.iter().enumerate().any(lacks) {
            continue;
        }
        let turned = posed(robot, &with_open(series, quarters), limits).into_iter();
        let new = turned.filter(|p| series[p.series].stops[p.stop].is_turn_open() && !has_pose(p.series, p.stop));
        let turned_back = |mut posed: Posed| {
            posed.pair.camera_from_plate.rotation *= about(4 - quarters);
            posed
        };
        let new: Vec<Posed> = new.map(turned_back).collect();
        all.extend(new);
    }
    all
}

/// Images that share a camera mounting and a placement, with the index of this and the poses that the images alone give; the largest first.
fn groups(
    robot: &Robot,
    series: &[MeasuredSeries],
    turns: &[Vec<PlateTurn>],
    limits: &Limits,
) -> Vec<(usize, Vec<View>)> {
    let mut groups: BTreeMap<(usize, usize), Vec<View>> = BTreeMap::new();
    for Posed { series: s, stop, group, pair } in posed_as_they_are(robot, series, limits) {
        let (seen, own) = (pair.camera_from_plate.rotation, &series[s]);
        let is_open = own.stops[stop].is_turn_open();
        let allowed = if is_open { own.plate.turns_of_places() } else { turns[s].clone() };
        let tried = std::iter::once(0).chain(allowed.iter().map(|t| t.quarters));
        let camera_from_plate = tried.map(|quarters| (quarters, seen * about(quarters))).collect();
        groups.entry(group).or_default().push(View { series: s, stop, camera_from_plate, pair, is_open });
    }
    let of_placement = |((_, placement), views)| (placement, views);
    let mut all: Vec<(usize, Vec<View>)> = groups.into_iter().map(of_placement).collect();
    all.retain(|(_, views)| views.iter().any(|v| v.camera_from_plate.len() > 1));
    all.sort_by_key(|(_, views)| std::cmp::Reverse(views.len()));
    all
}

/// Rotation of the plate in what holds it, from images that are turned by their `own` quarters and a common one.
fn plate_of(views: &[View], own: &[u8], common: u8) -> Option<Matrix3<f64>> {
    let turned = |(view, own): (&View, &u8)| {
        let mut pair = view.pair;
        pair.camera_from_plate.rotation *= about(own + common);
        pair
    };
    let pairs: Vec<PosePair> = views.iter().zip(own).map(turned).collect();
    solve_hand_eye(&pairs).first().map(|s| s.solution.plate.rotation)
}

/// The turn of all images with which another camera sees the plate the way round that the first one does.
fn common_turn(views: &[View], own: &[u8], turns: &[PlateTurn], known: Option<&Matrix3<f64>>) -> u8 {
    let (Some(known), Some(plate)) = (known, plate_of(views, own, 0)) else { return 0 };
    let off = |quarters: &u8| log_so3(&(known.transpose() * plate * about(*quarters))).norm();
    let allowed = std::iter::once(0).chain(turns.iter().map(|t| t.quarters));
    allowed.min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0)
}

/// The rotation of the plate frame that quarter turns of its ids are.
fn about(quarters: u8) -> Matrix3<f64> {
    exp_so3(&Vector3::new(0.0, 0.0, -f64::from(quarters) * std::f64::consts::FRAC_PI_2))
}

/// How far the angle between two images, each turned by one of its quarters, is from that between the readings, rad.
fn misfit((a, turn_a): (&View, usize), (b, turn_b): (&View, usize)) -> f64 {
    let angle = |a: &Matrix3<f64>, b: &Matrix3<f64>| log_so3(&(a * b.transpose())).norm();
    let seen = angle(&a.camera_from_plate[turn_a].1, &b.camera_from_plate[turn_b].1);
    (seen - angle(&a.pair.chain.rotation, &b.pair.chain.rotation)).abs().min(MOST_MISFIT)
}

/// The turn of an image with which alone it agrees with those whose turns, by quarters, are known.
fn told(view: &View, known: &[View], quarters: &[u8]) -> Option<u8> {
    let place = |(other, quarters): (&View, &u8)| other.camera_from_plate.iter().position(|(q, _)| q == quarters);
    let places: Option<Vec<usize>> = known.iter().zip(quarters).map(place).collect();
    let places = places.filter(|places| places.len() >= FEWEST_KNOWN)?;
    let mean = |k: usize| {
        let all = known.iter().zip(&places).map(|(other, turn)| misfit((view, k), (other, *turn)));
        all.sum::<f64>() / known.len() as f64
    };
    let mut misfits: Vec<(f64, u8)> =
        view.camera_from_plate.iter().enumerate().map(|(k, (quarters, _))| (mean(k), *quarters)).collect();
    misfits.sort_by(|a, b| a.0.total_cmp(&b.0));
    let [(best, quarters), (next, _), ..] = misfits[..] else { return None };
    (best < TOLD && next > best + TOLD).then_some(quarters)
}

/// The turns, by quarters, with which the images agree best; that of most images is none.
fn agreeing(views: &[View]) -> Vec<u8> {
    let mut chosen: Vec<Option<usize>> = vec![None; views.len()];
    for round in 0..ROUNDS {
        let before = chosen.clone();
        for i in 0..views.len() {
            let sum = |k: usize| -> f64 {
                let pairs = chosen.iter().enumerate().filter(|(j, _)| *j != i).filter_map(|(j, &c)| Some((j, c?)));
                pairs.map(|(j, c)| misfit((&views[i], k), (&views[j], c))).sum()
            };
            let misfits: Vec<f64> = (0..views[i].camera_from_plate.len()).map(sum).collect();
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
    use crate::geom::Pose;

    /// Images of a camera in the hand at eight postures, seen with ids that are off by these quarter turns.
    fn views(off: &[u8], allowed: &[u8]) -> Vec<View> {
        let rotation = |k: usize| {
            let angles = [0.9, 0.7, 1.3].map(|f: f64| (f * (k as f64 + 1.0) * 2.3).sin() * 1.4);
            exp_so3(&Vector3::from(angles))
        };
        let (x, z) = (rotation(40), rotation(50));
        let view = |(k, &off): (usize, &u8)| {
            let seen = x.transpose() * rotation(k) * z * about(4 - off);
            let tried = std::iter::once(&0).chain(allowed);
            let camera_from_plate = tried.map(|&q| (q, seen * about(q))).collect();
            let [chain, seen] = [rotation(k), seen].map(|r| Pose::new(r, Vector3::zeros()));
            let pair = PosePair { camera_from_plate: seen, chain };
            View { series: 0, stop: k, camera_from_plate, pair, is_open: false }
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

    /// The images that tell their turn tell that of another; not too few of them, not readings that do not belong to the image, and not
    /// images that turn with the camera about the plate by a quarter, where two turns fit alike.
    #[test]
    fn an_open_turn_is_told_or_left_open() {
        for quarters in 0..4 {
            let mut all = views(&[quarters, 0, 0, 0, 0, 0, 0, 0], &[1, 2, 3]);
            assert_eq!(told(&all[0], &all[1..], &[0; 7]), Some(quarters));
            assert_eq!(told(&all[0], &all[1..3], &[0; 2]), None);
            all[0].pair.chain.rotation *= exp_so3(&Vector3::new(0.4, -0.5, 0.3));
            assert_eq!(told(&all[0], &all[1..], &[0; 7]), None);
        }
        let mut all = views(&[0; 5], &[1, 2, 3]);
        let (seen, chain) = (all[0].camera_from_plate[0].1, all[0].pair.chain.rotation);
        for view in &mut all[1..] {
            view.camera_from_plate = vec![(0, seen * about(1))];
            view.pair.chain.rotation = chain * about(1);
        }
        assert_eq!(told(&all[0], &all[1..], &[0; 4]), None);
    }
}
