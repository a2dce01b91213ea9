//! Hand-camera and plate poses for all mountings and placements from the free camera poses.

use std::collections::BTreeMap;

use nalgebra::Matrix6;

use crate::assess::Limits;
use crate::diagnose::{Finding, Mistake, MistakeKind, ReadingRatio, RowsOf};
use crate::error::{Code, Error, Quantity, Result};
use crate::fit::FreePoses;
use crate::geom::{Pose, log_so3};
use crate::identify::bodies::rows_of::rows_of_images;
use crate::identify::mistakes::part_fits::{broken, in_parts};
use crate::identify::mistakes::suspects::Suspects;
use crate::identify::start::zeros::place_zeros;
use crate::identify::start_verdict::{StartReached, StartVerdict};
use crate::init::{HandEye, HandEyeStart, PosePair, SeenStop, bases, hand_eye_misfit, solve_hand_eye};
use crate::linalg::symmetric_eigen;
use crate::linalg::{dense, median};
use crate::model::one_direction::turns_about_one_direction;
use crate::model::robot::Robot;
use crate::problem::{
    Adjustment, ImageRejection, MeasuredSeries, Misfit, Mismatch, Problem, State, TakenFrom, different_readings,
    predict,
};
use crate::solve::{Covariance, Outcome};
use crate::urdf::BASE_FROM_BASE;

/// Closed forms whose pixel cost is compared.
const COMPARED: usize = 4;

/// Images, each with what it and its readings say.
type Pairs = Vec<(usize, PosePair)>;

/// What a start is judged by.
#[derive(Clone, Copy)]
pub(in crate::identify) struct StartGiven<'a> {
    /// The series of the images.
    pub series: &'a [MeasuredSeries],
    /// All images by mounting and placement, with what they and their readings say; filled in by the start.
    pub groups: &'a [Vec<(usize, PosePair)>],
    /// What becomes of zeros that are elsewhere than those of the robot.
    pub zeros: ZerosElsewhere,
    /// Limits.
    pub limits: &'a Limits,
}

impl<'a> StartGiven<'a> {
    /// That of series whose robot is given the zeros that they tell.
    pub fn of(series: &'a [MeasuredSeries], limits: &'a Limits) -> Self {
        Self { series, groups: &[], zeros: ZerosElsewhere::Placed, limits }
    }
}

/// Zeros of joints elsewhere than those of the robot, where readings and images fit with these and then only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::identify) enum ZerosElsewhere {
    /// The robot is given them.
    Placed,
    /// It stays as it is, and does not fit.
    Left,
}

/// Fills in mountings and placements; sets images aside that do not fit their readings, and returns which.
pub(in crate::identify) fn start_robot(
    adjustment: &mut Adjustment,
    free: &FreePoses,
    given: StartGiven<'_>,
    verdicts: &mut Vec<StartVerdict>,
) -> Result<Vec<usize>> {
    place_bases(adjustment, free)?;
    if given.zeros == ZerosElsewhere::Placed {
        place_zeros(adjustment, free, given.limits);
    }
    let mut aside = Vec::new();
    let (keys, groups): (Vec<_>, Vec<_>) = largest_first(adjustment, free).into_iter().unzip();
    let given = StartGiven { groups: &groups, ..given };
    let (mut cameras, mut plates) = (BTreeMap::new(), BTreeMap::new());
    for ((mounting, placement), pairs) in keys.iter().zip(&groups) {
        let poses: Vec<PosePair> = pairs.iter().map(|(_, p)| *p).collect();
        let problem = &adjustment.problem;
        let of = format!(
            "hand-eye transform {} and target pose {}",
            problem.mountings[*mounting], problem.placements[*placement]
        );
        let known = [cameras.get(mounting).copied(), plates.get(placement).copied()];
        let solution = match shared(&poses, known) {
            Some(solution) => {
                check_shared(adjustment, pairs, &solution, &of, given)?;
                solution
            }
            None => closed_form(adjustment, pairs, &poses, (*mounting, *placement), &of, given, verdicts)?,
        };
        cameras.insert(*mounting, solution.camera);
        plates.insert(*placement, solution.plate);
        aside.extend(set_aside(&mut adjustment.problem, pairs, &solution, given.limits));
    }
    place(&mut adjustment.state.mountings, &cameras);
    place(&mut adjustment.state.placements, &plates);
    Ok(aside)
}

/// By the camera, the plate or both as others have found them; `None` where neither is known.
fn shared(poses: &[PosePair], known: [Option<Pose>; 2]) -> Option<HandEye> {
    Some(match known {
        [Some(camera), Some(plate)] => HandEye { camera, plate },
        [Some(camera), None] => {
            closest(poses, |p| HandEye { camera, plate: p.chain.inverse() * (camera * p.camera_from_plate) })
        }
        [None, Some(plate)] => {
            closest(poses, |p| HandEye { camera: (p.chain * plate) * p.camera_from_plate.inverse(), plate })
        }
        [None, None] => return None,
    })
}

/// Images in use by mounting and placement, those with most images first, each image with what it and its readings say.
fn largest_first(adjustment: &Adjustment, free: &FreePoses) -> Vec<((usize, usize), Pairs)> {
    let robot = &adjustment.state.robot;
    let pairs = |seen: Vec<(usize, SeenStop)>| seen.into_iter().map(|(i, stop)| (i, stop.pair(robot))).collect();
    let seen = free.seen_stops(&adjustment.problem, used(adjustment)).into_iter();
    let mut order: Vec<(_, Pairs)> = seen.map(|(of, seen)| (of, pairs(seen))).collect();
    order.sort_by_key(|((m, p), pairs)| (std::cmp::Reverse(pairs.len()), *m, *p));
    order
}

/// Poses that were found, by their places; others stay as they are.
fn place(poses: &mut [Pose], found: &BTreeMap<usize, Pose>) {
    for (k, pose) in poses.iter_mut().enumerate() {
        *pose = found.get(&k).copied().unwrap_or(*pose);
    }
}

fn used(adjustment: &Adjustment) -> impl Iterator<Item = usize> {
    adjustment.problem.used().map(|(i, _)| i)
}

/// Gives the joint between the bases of two arms an origin, where it has none yet.
fn place_bases(adjustment: &mut Adjustment, free: &FreePoses) -> Result<()> {
    let robot = &adjustment.state.robot;
    let Some(joint) = bases::unplaced(robot) else { return Ok(()) };
    let stops = free.most_seen_stops(&adjustment.problem, used(adjustment));
    if stops.is_empty() {
        return Ok(());
    }
    let Some(placed) = bases::placed(robot, joint, &stops) else {
        let what = "how the bases of the two arms stand to each other does not come out of these stops";
        let remedy = "take more stops at which both arms move all their joints";
        return Err(Error::new(Code::StopsAlike, BASE_FROM_BASE, what, remedy));
    };
    adjustment.state.robot = placed;
    Ok(())
}

/// Of the solutions that single images give, the one that all images like best.
fn closest(poses: &[PosePair], solution: impl Fn(&PosePair) -> HandEye) -> HandEye {
    let median = |s: &HandEye| s.median_error(poses);
    let mut best = solution(&poses[0]);
    let mut best_error = median(&best);
    for s in poses[1..].iter().map(solution) {
        let error = median(&s);
        if error < best_error {
            (best, best_error) = (s, error);
        }
    }
    best
}

fn require_enough(images: usize, of: &str, limits: &Limits) -> Result<()> {
    let fewest = limits.hand_eye_images;
    if images >= fewest {
        return Ok(());
    }
    let what = format!(
        "only {images} images of the robot show the plate, at least {fewest} are needed and some 30 to 50 wanted"
    );
    let remedy = "take more images, or give series that share camera mounting and plate placement the same names";
    Err(Error::new(Code::ImagesTooFew, of, what, remedy))
}

/// Refuses images of a few stops that were taken again and again, by readings and camera poses: anything fits them.
fn require_different(problem: &Problem, pairs: &[(usize, PosePair)], of: &str, limits: &Limits) -> Result<()> {
    let fewest = limits.hand_eye_images;
    let Some((_, PosePair { camera_from_plate: first, .. })) = pairs.first() else { return Ok(()) };
    let seen = pairs.iter().map(|(_, PosePair { camera_from_plate: pose, .. })| {
        let turned = log_so3(&(first.rotation.transpose() * pose.rotation));
        [pose.translation.as_slice(), turned.as_slice()].concat()
    });
    let seen: Vec<Vec<f64>> = seen.collect();
    let read = pairs.iter().filter_map(|(i, _)| problem.posture(*i).map(|posture| posture.readings.as_slice()));
    let different = different_readings(seen.iter().map(Vec::as_slice), limits.suspicious_misfit, fewest)
        .max(different_readings(read, limits.joint_noise, fewest));
    if different >= fewest {
        return Ok(());
    }
    let what = format!(
        "the {} images of the robot are of {different} different stops only, at least {fewest} are needed and some 30 to 50 wanted",
        pairs.len()
    );
    let remedy = "move every joint between the images, and tilt the camera to all sides";
    Err(Error::new(Code::ImagesTooFew, of, what, remedy))
}

fn closed_form(
    Adjustment { problem, state }: &Adjustment,
    pairs: &[(usize, PosePair)],
    poses: &[PosePair],
    (mounting, placement): (usize, usize),
    of: &str,
    StartGiven { series, groups, limits, .. }: StartGiven<'_>,
    verdicts: &mut Vec<StartVerdict>,
) -> Result<HandEye> {
    require_enough(pairs.len(), of, limits)?;
    check_rotations(of, poses, &state.robot, limits)?;
    require_different(problem, pairs, of, limits)?;
    let starts = solve_hand_eye(poses);
    let cost = |s: &HandEyeStart| {
        let mut trial = state.clone();
        trial.mountings[mounting] = s.solution.camera;
        trial.placements[placement] = s.solution.plate;
        let errors = pairs.iter().map(|(i, _)| pixels(problem, &trial, *i).unwrap_or(f64::INFINITY));
        median(errors).unwrap_or(f64::INFINITY)
    };
    let mut ranked: Vec<(f64, &HandEyeStart)> = starts.iter().take(COMPARED).map(|s| (cost(s), s)).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let Some((_, best)) = ranked.first() else {
        return Err(no_fit(of, &state.robot, "no closed form has a solution"));
    };
    let winner = best.origin.clone();
    for s in &starts {
        let median_px = ranked.iter().find(|(_, r)| r.origin == s.origin).map(|(c, _)| *c).filter(|c| c.is_finite());
        verdicts.push(StartVerdict {
            of: of.to_owned(),
            origin: s.origin.clone(),
            reached: StartReached::HandEye { median_px, misfit: s.median_error },
            won: s.origin == winner,
        });
    }
    let suspects = Suspects { problem, robot: &state.robot, series, pairs, groups, limits };
    check_fit(&suspects, best.median_error, of, "even at the best start")?;
    Ok(best.solution)
}

/// Refuses images that share the mounting or the placement of others and do not fit there: for a mistake of theirs, or because what they
/// share was moved.
fn check_shared(
    Adjustment { problem, state }: &Adjustment,
    pairs: &[(usize, PosePair)],
    shared: &HandEye,
    of: &str,
    StartGiven { series, groups, limits, .. }: StartGiven<'_>,
) -> Result<()> {
    let poses: Vec<PosePair> = pairs.iter().map(|(_, pair)| *pair).collect();
    let misfit = shared.median_error(&poses);
    if misfit < limits.suspicious_misfit || pairs.len() < limits.hand_eye_images {
        return Ok(());
    }
    let alone = hand_eye_misfit(&poses);
    if alone < limits.suspicious_misfit && alone < limits.mistake_explains * misfit {
        let what = format!(
            "by themselves its {} images fit to {:.1} (mm plus mrad), with what they share with others they miss by {:.0}: camera or plate were \
             moved between them",
            pairs.len(),
            1e3 * alone,
            1e3 * misfit
        );
        let remedy =
            "write another mounting under [camera] of one of the series, or another placement in its joints.csv";
        return Err(Error::new(Code::SharedPoseDiffers, of, what, remedy));
    }
    let suspects = Suspects { problem, robot: &state.robot, series, pairs, groups, limits };
    check_fit(&suspects, misfit, of, "with what is shared with other images")
}

/// Refuses what does not fit: for the mistake that explains it, or because it is too far off.
fn check_fit(suspects: &Suspects, misfit: f64, of: &str, how: &str) -> Result<()> {
    if let Some((kind, misfit_undone)) = suspects.better_than(misfit) {
        // What is slid and hardly turned leaves directions as they were and changes distances, as other links do.
        if matches!(kind, MistakeKind::Lengths { .. })
            && let Some(moved) = in_parts(suspects, misfit, of)
        {
            return Err(moved);
        }
        let rows_of = match rows_of_images(
            suspects.problem,
            suspects.robot,
            (suspects.pairs, suspects.groups),
            suspects.limits,
        ) {
            RowsOf::Readings if suspects.are_of_poses() => RowsOf::Poses,
            rows => rows,
        };
        let mistake = Mistake { kind, of: of.to_owned(), misfit, misfit_undone, by_images: true, rows_of };
        return Err(Finding::from(mistake).refusal());
    }
    if misfit > suspects.limits.hand_eye_spread {
        if let Some(ratio) = ReadingRatio::of_misfit(suspects.robot, &suspects.stops(), misfit, suspects.limits) {
            return Err(Finding::from(ratio).refusal());
        }
        if let Some(broken) = broken(suspects, misfit, of) {
            return Err(broken);
        }
        let how = format!("{how} the camera poses miss by {:.0} (median, mm plus mrad)", 1e3 * misfit);
        return Err(suspects
            .constant_joints()
            .map_or_else(|| no_fit_of(suspects, of, &how), |joints| not_moved(&joints, suspects, &how)));
    }
    Ok(())
}

fn no_fit(of: &str, robot: &Robot, how: &str) -> Error {
    let (what, remedy) = match robot.chain.pose_coordinates() {
        Some(_) => (
            "poses of the controller",
            "check [controller] rotation and the unit of x_m, y_m, z_m (both may be wrong), that the poses are those of the flange in the base of the robot at these images (one tool, one user frame all through), that image names stand in the right rows of controller.csv, and that the plate did not move",
        ),
        None => (
            "joint readings",
            "check joint_unit, the order and signs of the joints in joints.csv, that image names stand in the right rows (of a recording: the clocks, see --image-delay and --clock log), that the URDF is of this robot, base and tip, that series.toml names the link that carries the plate ([plate_mount] link) or the camera ([camera] link) where that is not the base or the tip, and that the plate did not move",
        ),
    };
    let what = format!("{what} and images do not belong together: {how}");
    Error::new(Code::ReadingsContradict, of, what, remedy)
}

/// As [`no_fit`]; of fewer images than tell other zeros of the joints, these are named, too.
fn no_fit_of(suspects: &Suspects, of: &str, how: &str) -> Error {
    let error = no_fit(of, suspects.robot, how);
    let fewest = suspects.limits.zeros_images;
    if suspects.robot.chain.pose_coordinates().is_some() || suspects.pairs.len() >= fewest {
        return error;
    }
    let zeros =
        format!("; a joint may be mastered wrongly by degrees, which {fewest} images and more tell: take so many");
    Error { remedy: error.remedy + &zeros, ..error }
}

/// Refuses readings that contradict, where some joints read the same at all stops.
fn not_moved(joints: &[String], suspects: &Suspects, what: &str) -> Error {
    let (names, stops) = (joints.join(", "), suspects.pairs.len());
    let what = format!(
        "reads the same at all {stops} stops, and joint readings and images do not belong together: {what}; it may have moved without being read"
    );
    let remedy = format!(
        "see whether {names} moved between the stops, and write its readings into joints.csv; if it stood still, check joint_unit, the order and signs of the joints, the rows of the images, and that the URDF is of this robot, base, tip and the links of [plate_mount] and [camera]"
    );
    let stops = Quantity::new("stops", stops as f64, "1");
    Error { quantities: vec![stops], ..Error::new(Code::ReadingsContradict, names, what, remedy) }
}

/// RMS pixel error of an image at the pose that its readings predict; `None` where a marker lies behind the camera.
fn pixels(problem: &Problem, state: &State, image: usize) -> Option<f64> {
    let (image, posture) = (&problem.images[image], problem.posture(image)?);
    let pose = state.camera_from_plate(image, TakenFrom::exact(posture))?;
    let (mut sum, mut count) = (0.0, 0.0);
    for o in image.used() {
        sum += (o.uv - predict(image, state, &pose, o)?.uv).norm_squared();
        count += 1.0;
    }
    Some((sum / f64::max(count, 1.0)).sqrt())
}

/// What an arm that tilts nothing can do.
const ONE_DIRECTION: &str = "this arm turns its flange about one direction alone, so that its images tell neither the hand-eye transform nor the plate: \
     measure it with a tracker (points.csv, poses.csv) or by touches (contacts.csv)";

/// Hand-camera and plate pose need rotations about at least two axes.
fn check_rotations(of: &str, poses: &[PosePair], robot: &Robot, limits: &Limits) -> Result<()> {
    let mut m = nalgebra::DMatrix::<f64>::zeros(3, 3);
    let (mut largest, first) = (0.0_f64, &poses[0]);
    let (mut travel, mut seen) = (0.0_f64, 0.0_f64);
    for p in poses {
        let v = log_so3(&(first.chain.rotation.transpose() * p.chain.rotation));
        let turned = first.camera_from_plate.rotation.transpose() * p.camera_from_plate.rotation;
        seen = seen.max(log_so3(&turned).norm());
        largest = largest.max(v.norm());
        travel = travel.max((first.chain.translation - p.chain.translation).norm());
        m += dense(&(v * v.transpose())) / poses.len() as f64;
    }
    let second = symmetric_eigen(&m).map_or(0.0, |(values, _)| values[1].max(0.0).sqrt());
    if second > limits.hand_eye_rotation_rad {
        return Ok(());
    }
    if seen > limits.hand_eye_rotation_rad && largest < limits.mistake_explains * seen {
        let what = format!(
            "the camera turned by {:.0} degrees between the images, the hand by {:.1} degrees by its readings: these are radians, read as degrees, or were not read anew at every stop",
            seen.to_degrees(),
            largest.to_degrees()
        );
        let remedy = "write joint_unit = \"rad\" in series.toml (of a recording: in the .toml of its name); in controller.csv convert the angles, or state the rotation in radians";
        return Err(Error::new(Code::JointUnitWrong, of, what, remedy));
    }
    Err(Error::new(
        Code::StopsAlike,
        of,
        format!(
            "the stops are too much alike: the hand turned by at most {:.1} degrees, about a second axis by {:.1} degrees only",
            largest.to_degrees(),
            second.to_degrees()
        ),
        match turns_about_one_direction(robot, limits.hand_eye_rotation_rad) {
            true => ONE_DIRECTION,
            false => "move the wrist: tilt the camera by 20 to 45 degrees to all sides and roll it between the images",
        },
    ))
}

fn set_aside(problem: &mut Problem, pairs: &[(usize, PosePair)], solution: &HandEye, limits: &Limits) -> Vec<usize> {
    let mut aside = Vec::new();
    let misfits: Vec<f64> = pairs.iter().map(|(_, p)| solution.misfit(p)).collect();
    let bound = (limits.set_aside_factor * median(misfits).unwrap_or(f64::INFINITY)).max(limits.set_aside_floor);
    for (i, pair) in pairs {
        if solution.misfit(pair) > bound {
            let (angle_rad, distance_m) = solution.error(pair);
            problem.images[*i].rejected =
                Some(ImageRejection::WronglyPaired(Mismatch::HandEye(Misfit { distance_m, angle_rad })));
            aside.push(*i);
        }
    }
    aside
}

/// How far the stand-alone camera pose of an image is from that of its readings, rad + m.
fn misfit(adjustment: &Adjustment, free: &FreePoses, image: usize) -> Option<f64> {
    Some(adjustment.camera_by_readings(image)?.misfit(&free.poses[image].as_ref()?.camera_from_plate))
}

/// Median of these of the images in use.
pub(in crate::identify) fn usual_misfit(adjustment: &Adjustment, free: &FreePoses) -> Option<f64> {
    let of_used = adjustment.problem.used_on_robot().filter_map(|i| misfit(adjustment, free, i));
    median(of_used)
}

/// Square of three sigmas of six components: the quantile of chi-squared at 0.9973.
const SQUARES_OF_POSE: f64 = 20.06;

/// What a fit knows of images that it does not use.
struct Prediction<'a> {
    adjustment: &'a Adjustment,
    covariance: Covariance,
    free: &'a FreePoses,
}

impl Prediction<'_> {
    /// Squares of the misfit of an image by the covariance of the fit in use (robot, hand-eye transform and plate), of its stand-alone pose, and of
    /// the noise of its readings.
    fn squares(&self, image: usize) -> Option<f64> {
        let Adjustment { problem, state } = self.adjustment;
        let (own, tie, seen) = (&problem.images[image], &state.ties[image], self.free.poses[image].as_ref()?);
        let stop = &problem.stops[own.stop];
        let errors = vec![0.0; state.joint_errors[own.stop].len()];
        let from = TakenFrom { posture: Some(problem.posture(image)?), joint_errors: &errors, tie };
        let predicted = state.chained(&problem.layout, own, from)?;
        let of_joints = (0..errors.len()).map(|r| problem.joint_error_variance(stop, r).iter().sum::<f64>());
        let of_tie = (0..tie.len()).map(|k| problem.displacement_variance(own, k));
        let mut latent = predicted.d_latent.clone();
        latent.column_iter_mut().zip(of_joints.chain(of_tie)).for_each(|(mut by, variance)| by *= variance);
        let (g, theta) = (&predicted.d_theta, problem.layout.theta_len());
        let by_fit = g * self.covariance.reduced.view((0, 0), (theta, theta)) * g.transpose();
        let all = by_fit + latent * predicted.d_latent.transpose();
        let all = Matrix6::from_column_slice(all.as_slice()) + seen.covariance;
        let apart = (predicted.pose.inverse() * seen.camera_from_plate).log();
        Some(apart.dot(&all.cholesky()?.solve(&apart)))
    }
}

/// Takes images back that were set `aside` with the nominal robot, and fit the robot that was found as the others do, or as well as it is known
/// where they were taken. True where there are some.
pub(in crate::identify) fn take_back(
    outcome: &mut Outcome,
    free: &FreePoses,
    aside: &[usize],
    limits: &Limits,
) -> bool {
    let adjustment = &outcome.adjustment;
    let Some(usual) = usual_misfit(adjustment, free) else { return false };
    let fits = |i: &usize| misfit(adjustment, free, *i).is_some_and(|s| s < limits.set_aside_factor * usual);
    let out: Vec<usize> = aside.iter().copied().filter(|&i| adjustment.problem.images[i].rejected.is_some()).collect();
    let mut back: Vec<usize> = out.iter().copied().filter(fits).collect();
    if back.is_empty() && !out.is_empty() {
        let covariance = outcome.linear().and_then(|linear| linear.covariance().ok());
        let known = covariance.map(|covariance| Prediction { adjustment, covariance, free });
        let squares = |i: &usize| known.as_ref()?.squares(*i);
        let is_predicted = |i: &usize| squares(i).is_some_and(|squares| squares < SQUARES_OF_POSE);
        back = out.into_iter().filter(is_predicted).collect();
    }
    back.iter().for_each(|&i| outcome.adjustment.problem.images[i].rejected = None);
    !back.is_empty()
}
