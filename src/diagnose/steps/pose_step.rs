//! A plate, a camera, a tracker or its target that stands elsewhere from some stop on, creeps all through a series or differs between series,
//! a joint whose zero does, or a given place that is misstated, by too little for anything to be left out.
//!
//! Rao's score test on the linearised fit: what the images of a stop tell of their poses, joint noise eliminated, has the root score `s` and
//! the derivatives `T` by all columns ([`StopInformation`]). Let the pose of one body differ by a constant `x` at the stops of a part `P` of a
//! series, `A` its columns of `T`; or by `w x` at all of them, `w` growing from 0 to 1 with the rows, `A` its columns times `w`. With `K` the covariance of all columns, `g = sum_P A' s` and
//! `J = sum_P A' A - V' K V`, `V = sum_P T' A`, the cost falls by `D = g' J^-1 g`, chi-squared with six degrees of freedom where nothing
//! moved, and `x = J^-1 g` with the covariance `J^-1`.
//!
//! The estimated joint noise has grown with the fault, so that `D` is small beside what the sizes say; it is compared with the squares `R` of what
//! the poses of the images miss those of the readings, in units of the noise of both, which are as many as the degrees of freedom that the robot
//! left, and with the squares `P` of the robot's errors over their priors, which are as many as it took: a step may take up either. `D / (R + P)`
//! has a beta distribution where noise is Gaussian; what the step leaves of `R + P` says how much of them it explains. Priors on several columns together
//! are part of the information and of `P`. `R` has every direction of the poses that were seen: what two cameras contradict each other by is in it.
//! Where errors repeat over neighbouring readings, several stops count as one. Real robots err alike in postures that are alike, so that chance alone
//! does not acquit them: the step must also explain most of `R`; one that explains less, but much, is a doubt. What follows the posture, as a camera
//! that its weight moves, must explain more than such errors may, of which a stop has one. It must be beyond its own sigmas.
//!
//! Several targets on the tip may be held by one bracket: its twist `x` about their middle moves each of them, `A = sum_k T_k B_k`, with the columns
//! `T_k` of a target and `B_k = [R' , -R' [d]; 0, R']` of its rotation `R` in the tip and its place `d` from the middle.
//!
//! Several sockets may be on one fixture: likewise, about their middle along the axes of the base, where two of them at least hold the body on either side.
//! It is named where steps of fewer single sockets do not explain more.
//!
//! A given place that is misstated is, at its touches, as its frame shifted along its axes: `x` of three components.
//!
//! Another focal length looks like a camera that moved along its axis, as far as all images are taken from one distance: where a step of it falls by
//! more than that of plate or camera, it is named instead; and so is another principal point, as of pictures that are cut out elsewhere.

use std::collections::BTreeSet;

use super::candidates::{Changed, Order, Shown, is_socket};
use super::displaced::{Carried, Displaced, Displacement};
use super::images_shifted::ImagesShifted;
use super::place_misstated::PlaceMisstated;
use super::rows::{Chances, Linear, Part, Step};
use super::zero_moved::ZeroMoved;
use crate::assess::{Accuracy, Limits, log_chance as chance_of_share, stops_for_one};
use crate::diagnose::finding::Finding;
use crate::diagnose::focus::{self, FocusChange};
use crate::diagnose::kind::{CheckContext, Weight};
use crate::fit::Fit;
use crate::problem::{InstrumentKind, Problem, stop_name};
use crate::series::CameraMount;
use crate::urdf::{Chain, JointKind};

pub fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Vec<Finding> {
    let fit = setting.with_noise_found(fit);
    find_steps(fit, setting.limits).iter().filter_map(|step| finding(step, fit, setting)).collect()
}

/// Steps that explain much of the joint noise of their series, in the order of the images.
fn find_steps(fit: &Fit, limits: &Limits) -> Vec<Step> {
    let problem = &fit.problem;
    let mut linear = Linear::of(fit.linear());
    let columns = linear.columns();
    let chances = Chances { stops_for_one: stops_for_one(fit, limits), share: limits.displaced_share };
    let all = Squares::of(&linear, problem);
    let (mut left, mut found, mut good) = (all.clone(), Vec::<Step>::new(), Vec::new());
    while found.len() < limits.displacements {
        let Some((mut best, tried)) = most_unlikely(&linear, problem, &left, chances, limits) else { break };
        let Some((next, step)) = linear.with(problem, &best) else { break };
        linear = next;
        let before = std::mem::replace(&mut left, Squares::of(&linear, problem));
        let share = before.explained(&left, &best);
        tracing::debug!(?best.changed, ?best.order, first = ?best.shown.first(), moved = best.shown.len(), fall = best.fall, share,
            log_chance = best.log_chance, change = ?best.change, "step");
        let stops = linear.stops(best.group) as f64 / chances.stops_for_one;
        let by_posture = chance_of_share(share, stops, best.told) + (tried as f64).ln();
        let is_beyond_posture = !matches!(best.order, Order::Up(_)) || by_posture < limits.displaced_by_posture.ln();
        let explains_most = share > limits.displaced_share && is_beyond_posture;
        best.change.fill(0.0);
        found.push(best);
        let mut first = columns;
        for own in &mut found {
            let size = own.change.len();
            own.change += step.rows(first, size);
            own.share = all.explained(&left, own);
            first += size;
        }
        if explains_most {
            found.iter_mut().for_each(|own| own.explains_most = true);
        }
        if share > limits.displaced_doubt {
            good.clone_from(&found);
        }
    }
    good.retain(|step| step.is_beyond(limits.displaced_sigmas));
    let first = |step: &Step| step.shown.first().map(|shown| shown.place(problem));
    good.sort_by_key(|s| (matches!(s.order, Order::Up(_)), first(s)));
    good
}

/// The step that chance explains least, of how many; `None` where chance explains it.
fn most_unlikely(
    linear: &Linear,
    problem: &Problem,
    left: &Squares,
    chances: Chances,
    limits: &Limits,
) -> Option<(Step, usize)> {
    let tried = linear.candidates(problem, limits.displaced_images);
    let mut best = linear.best(problem, &tried, &left.zeros, chances)?;
    if best.log_chance + (tried.len() as f64).ln() > limits.displaced_false_alarms.ln() {
        return None;
    }
    if best.changed == Changed::Fixture
        && let Some(single) = linear.one_by_one(problem, &best, &tried, chances)
    {
        best = single;
    }
    if let Some(otherwise) = linear.seen_otherwise(problem, &best, limits.displaced_images) {
        best = otherwise;
    }
    Some((best, tried.len()))
}

/// Squares of what was seen against the readings, by the index of the noise.
#[derive(Clone)]
struct Squares {
    /// Of whole poses: `R`.
    poses: Vec<f64>,
    /// Of positions, and of rotations, of bodies.
    bodies: [Vec<f64>; 2],
    /// In the direction of every reading.
    zeros: Vec<Vec<f64>>,
}

impl Squares {
    fn of(linear: &Linear, problem: &Problem) -> Self {
        Self {
            poses: linear.squares(problem, Part::Pose),
            bodies: [Part::Position, Part::Rotation].map(|part| linear.squares(problem, part)),
            zeros: linear.zero_squares(problem.noise.joint.len()),
        }
    }

    /// Share of them that a change explains, of which `after` it so many are left. That of a tracker or a target may show in positions alone,
    /// or in rotations, and that of a zero in the direction of its reading, where noise has variance components of its own.
    fn explained(&self, after: &Self, step: &Step) -> f64 {
        let group = step.group;
        let share = |before: f64, after: f64| if before > 0.0 { 1.0 - after / before } else { 0.0 };
        let of_poses = share(self.poses[group], after.poses[group]);
        let of_part = match step.changed {
            Changed::Placement(_) | Changed::Mounting(_) | Changed::Focal(_) | Changed::Centre(_) => 0.0,
            Changed::Zero(reading) => share(self.zeros[group][reading], after.zeros[group][reading]),
            _ => {
                let parts = self.bodies.iter().zip(&after.bodies);
                parts.map(|(before, after)| share(before[group], after[group])).fold(0.0, f64::max)
            }
        };
        of_poses.max(of_part)
    }
}

fn finding(step: &Step, fit: &Fit, setting: &CheckContext) -> Option<Finding> {
    let (problem, first) = (&fit.problem, *step.shown.first()?);
    let name = |shown: &Shown| match *shown {
        Shown::Image { index, .. } => problem.images[index].name.clone(),
        Shown::Measurement(k) => stop_name(setting.series, problem.body_measurements[k].read),
    };
    let series = setting.series[first.series(problem)].name.clone();
    let displacement = match step.order {
        Order::Time => Displacement::FromThenOn,
        Order::Up(axis) => Displacement::AxisUp(axis),
        Order::Drift => Displacement::AllThrough,
        Order::Whole => Displacement::InAll,
    };
    let images: Vec<String> = step.shown.iter().map(name).collect();
    let (limits, explains_most) = (setting.limits, step.explains_most);
    match step.changed {
        Changed::Zero(reading) => {
            let of = (series, displacement, images);
            Some(zero_moved(step, &fit.state.robot.chain, reading, of, limits).into())
        }
        Changed::Focal(camera) => refocused(step, fit, camera, images.into_iter().next()?, explains_most, setting),
        Changed::Centre(camera) => Some(ImagesShifted::of(step, problem, camera, images).into()),
        Changed::Place { first, .. } => {
            let matters = step.size(0).0 > limits.displaced_m;
            Some(PlaceMisstated::of(step, problem, first, (series, images), weight(step, matters)).into())
        }
        _ => {
            let (distance_m, angle_rad) = (step.size(0), (step.change.len() > 3).then(|| step.size(3)));
            let is_turned = angle_rad.is_some_and(|angle| angle.0 > limits.displaced_rad);
            let matters = distance_m.0 > limits.displaced_m || is_turned;
            let (body, mounting) = carried(step, first, problem)?;
            Some(
                Displaced {
                    series,
                    body,
                    places: places(step, body, problem),
                    mounting,
                    displacement,
                    images,
                    distance_m,
                    angle_rad,
                    share: step.share,
                    explains_most,
                    weight: weight(step, matters),
                }
                .into(),
            )
        }
    }
}

fn zero_moved(
    step: &Step,
    chain: &Chain,
    reading: usize,
    (series, displacement, stops): (String, Displacement, Vec<String>),
    limits: &Limits,
) -> ZeroMoved {
    let (joint, kind) = (chain.readings[reading].clone(), chain.reading_kinds[reading]);
    let repeats_to = if kind == JointKind::Prismatic { limits.displaced_m } else { limits.displaced_rad };
    let offset = (step.change[0], step.covariance[(0, 0)].sqrt());
    let matters = offset.0.abs() > repeats_to;
    let weight = weight(step, matters);
    ZeroMoved { joint, kind, series, displacement, stops, offset, share: step.share, weight }
}

fn weight(step: &Step, matters: bool) -> Weight {
    if matters && step.explains_most { Weight::Gate } else { Weight::Note }
}

/// Names of the sockets that moved; none where it is another body.
fn places(step: &Step, body: Carried, problem: &Problem) -> Vec<String> {
    match body {
        Carried::Socket => names(&sockets(step, problem), problem),
        Carried::Fixture | Carried::FixtureOfSome => names(&told_sockets(step, problem), problem),
        _ => Vec::new(),
    }
}

/// The sockets that it moves.
fn sockets(step: &Step, problem: &Problem) -> BTreeSet<usize> {
    step.shown.iter().filter_map(|shown| shown.socket(problem)).collect()
}

/// Those of them that tell of it: they were touched where it stands as before, too. All of them where it creeps.
fn told_sockets(step: &Step, problem: &Problem) -> BTreeSet<usize> {
    let is_moved = |k: usize| step.shown.iter().any(|shown| matches!(*shown, Shown::Measurement(moved) if moved == k));
    let mut told = sockets(step, problem);
    if step.order != Order::Drift {
        let still = problem.used_bodies().filter(|(k, _)| !is_moved(*k));
        let still: BTreeSet<usize> = still.map(|(_, measured)| measured.instrument).collect();
        told.retain(|socket| still.contains(socket));
    }
    told
}

/// Every socket that holds a body.
fn all_sockets(problem: &Problem) -> BTreeSet<usize> {
    let used = problem.used_bodies().map(|(_, measured)| measured.instrument);
    used.filter(|instrument| is_socket(problem, *instrument)).collect()
}

fn names(sockets: &BTreeSet<usize>, problem: &Problem) -> Vec<String> {
    sockets.iter().map(|socket| problem.instruments[*socket].name.clone()).collect()
}

/// Said where the images by themselves do not say so.
fn refocused(
    step: &Step,
    fit: &Fit,
    camera: usize,
    image: String,
    explains_most: bool,
    setting: &CheckContext,
) -> Option<Finding> {
    let (problem, focal_px) = (&fit.problem, &fit.state.cameras[camera].parameters);
    if focus::check(problem, setting).iter().any(|told| told.camera == problem.cameras[camera]) {
        return None;
    }
    let relative = |k: usize| step.change[k] / focal_px[k];
    let sigma = |k: usize| step.covariance[(k, k)].sqrt() / focal_px[k];
    let (change, sigma) = (0.5 * (relative(0) + relative(1)), sigma(0).max(sigma(1)));
    let significance = change.abs() / sigma.max(f64::MIN_POSITIVE);
    let weight = if explains_most { Weight::Gate } else { Weight::Note };
    Some(FocusChange::of(problem, camera, image, (change, significance), weight).into())
}

/// What stands elsewhere, and the name of its mounting, tracker or target.
fn carried(step: &Step, first: Shown, problem: &Problem) -> Option<(Carried, String)> {
    let changed = step.changed;
    Some(match (changed, first) {
        (Changed::Instrument(i), _) if !is_socket(problem, i) => {
            let instrument = &problem.instruments[i];
            let is_tracker = instrument.kind == InstrumentKind::Tracker;
            (if is_tracker { Carried::Instrument } else { Carried::Places }, instrument.name.clone())
        }
        (Changed::Target(_) | Changed::Bracket, Shown::Measurement(k)) => {
            let measured = &problem.body_measurements[k];
            let body = if changed == Changed::Bracket { Carried::Bracket } else { Carried::Target };
            (body, problem.instruments[measured.instrument].name.clone())
        }
        (Changed::Fixture | Changed::Instrument(_), Shown::Measurement(k)) => {
            let component = problem.instruments[problem.body_measurements[k].instrument].component;
            let first = problem.instruments.iter().find(|i| i.component == component)?;
            let body = match changed {
                Changed::Fixture if told_sockets(step, problem) == all_sockets(problem) => Carried::Fixture,
                Changed::Fixture => Carried::FixtureOfSome,
                _ => Carried::Socket,
            };
            (body, first.name.clone())
        }
        (Changed::Placement(_) | Changed::Mounting(_), Shown::Image { index, .. }) => {
            let image = &problem.images[index];
            let body = match (changed, image.mount) {
                (Changed::Placement(_), CameraMount::Hand) => Carried::Plate,
                (Changed::Placement(_), CameraMount::Fixed) => Carried::PlateInHand,
                (_, CameraMount::Hand) => Carried::CameraInHand,
                (_, CameraMount::Fixed) => Carried::Camera,
            };
            (body, problem.mountings[image.mounting].clone())
        }
        _ => return None,
    })
}
