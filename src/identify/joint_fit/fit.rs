//! The joint fit: robot, cameras, hand-camera offsets and plates directly against the pixels, with joint noise.

use super::measured_lengths::{leave_all_out, leave_worst_out, take_agreeing};
use super::moved_markers::let_go;
use super::unpredicted::nothing_held_out;
use crate::assess::{Accuracy, ImageError, Limits, hold_out, hold_out_bodies, judge, refitted_near};
use crate::diagnose::{CheckContext, Diagnosis, Finding, StatedNoise};
use crate::error::{Code, Error, Result};
use crate::fit::{Fit, FreePoses};
use crate::identify::bodies::start::start_bodies;
use crate::identify::bodies::taken_back::take_bodies_back;
use crate::identify::estimator::Estimator;
use crate::identify::options::{JointNoise, MarkerTolerance, Options};
use crate::identify::photogrammetry::camera_start::camera_starts;
use crate::identify::photogrammetry::free_poses::{FreeStart, adjust_free_poses};
use crate::identify::problem::build::build;
use crate::identify::solution::Solution;
use crate::identify::start::robot::{StartGiven, start_robot, take_back, usual_misfit};
use crate::identify::start_verdict::StartVerdict;
use crate::identify::two_stage::fit::PoseStage;
use crate::identify::two_stage::staged::{refit, staged};
use crate::problem::MeasuredSeries;
use crate::problem::{Adjustment, Family, FitsReadings, ImageRejection, Misfit, Mismatch, Problem};
use crate::solve::{
    ComponentOptions, Ended, LEAST_FIRST_GUESS, LinearisedAdjustment, NoiseInformation, Outcome, Status,
    estimate_components, estimate_components_from_above, estimate_components_near, noise_information, reject_bodies,
    reject_contradicting, reject_observations, reject_stops, without_unidentified_noise,
};
use crate::stage::stage;
use crate::urdf::Chain;

/// Most rounds of rejection.
const ROUNDS: usize = 12;

/// A joint fit with one robot model, not judged yet.
pub(in crate::identify) struct JointFit {
    /// How it was made.
    options: Options,
    /// The fit.
    pub fit: Fit,
    /// What the free-pose adjustment left.
    pub start: FreeStart,
    starts: Vec<StartVerdict>,
    /// Images on the robot at the start.
    on_robot: usize,
    /// What was known of the joint noise before some of it was set to none.
    before: Option<NoiseInformation>,
    status: Status,
    iterations: usize,
}

/// Fits one robot model jointly. Of the same series with another robot model, the free-pose adjustment, in which the robot takes no part, and an
/// adjustment near the end may be `known`; with other lenses both.
///
/// # Errors
/// As of [`crate::identify::identify`].
pub(in crate::identify) fn fit_model(
    chain: Chain,
    series: &[MeasuredSeries],
    options: &Options,
    known: Option<(FreeStart, Option<Adjustment>)>,
) -> Result<JointFit> {
    let _stage = stage(options.model.title());
    let start = unknowns(chain, series, options)?;
    let (known, near) = known.map_or((None, None), |(start, near)| (Some(start), near));
    let has_same_lenses = known.as_ref().is_none_or(|known| known.has_lenses_of(&start.state));
    let other_lenses = near.as_ref().filter(|_| !has_same_lenses);
    let (mut start, left) = with_free_poses(start, series, (known, other_lenses), &options.limits)?;
    let free = &left.free;
    let mut starts = left.verdicts.clone();
    let on_robot = start.problem.used_on_robot().count();
    check_on_robot(&start.problem, on_robot, series)?;
    let aside = start_robot(&mut start, free, StartGiven::of(series, &options.limits), &mut starts)?;
    start_bodies(&mut start, series, &options.limits)?;
    let (mut ended, before) = {
        let _stage = stage("joint fit");
        fit(start, free, (&aside, near.as_ref(), has_same_lenses), options)
    };
    name_wrong_pairs(ended.adjustment_mut(), free, options.limits.other_readings_explain);
    let context = CheckContext {
        series,
        free,
        on_robot,
        stated_noise: None,
        fixed: &options.selection.fix,
        limits: &options.limits,
    };
    Diagnosis::of_left_out(context, ended.adjustment())?;
    let Ended { status, iterations, fit } = ended;
    if status != Status::Converged {
        return Err(Error::new(Code::NotConverged, "joint fit", status.words(), status.remedy()));
    }
    let fit = fit.map_err(|e| {
        Error::new(Code::FitUndetermined, "joint fit", e.to_string(), "take stops that move every joint")
    })?;
    let options = options.clone();
    Ok(JointFit { options, fit, start: left, starts, on_robot, before, status, iterations })
}

/// What is to be found, as the options say, nothing of it started yet.
fn unknowns(chain: Chain, series: &[MeasuredSeries], options: &Options) -> Result<Adjustment> {
    let robot = options.model.robot_with(chain, options.harmonics);
    let mut start = build(&robot, series, options.joint_noise == JointNoise::Estimated, &options.limits)?;
    let Adjustment { problem, state } = &mut start;
    options.selection.apply(&mut problem.layout, state, &options.limits)?;
    let stated = options.selection.with_priors(&problem.layout)?;
    problem.families.extend(Family::of_twists(&problem.layout, |c| stated.contains(&c)));
    problem.families.extend(Family::of_gravity(&problem.layout, &state.robot, |c| stated.contains(&c)));
    if options.marker_tolerance == MarkerTolerance::Estimated {
        problem.noise.marker = vec![1.0; problem.plates.len()];
    }
    Ok(start)
}

/// Cameras, plates and poses by the images alone: those that are known, adjusted to the lenses of another fit where these are others, else found.
fn with_free_poses(
    mut start: Adjustment,
    series: &[MeasuredSeries],
    (known, other_lenses): (Option<FreeStart>, Option<&Adjustment>),
    limits: &Limits,
) -> Result<(Adjustment, FreeStart)> {
    let (free, verdicts) = match (known, other_lenses) {
        (Some(known), Some(near)) => return known.with_lenses_of(near, start, limits),
        (Some(known), None) => {
            known.carry_to(&mut start);
            return Ok((start, known));
        }
        (None, _) if start.problem.images.is_empty() => (FreePoses::none(start.state.clone()), Vec::new()),
        (None, _) => {
            let stated = camera_starts(&start.problem.cameras, series);
            let (adjusted, free, verdicts) = adjust_free_poses(start, &stated, limits)?;
            start = adjusted;
            (free, verdicts)
        }
    };
    let left = FreeStart::of(&start, free, verdicts);
    Ok((start, left))
}

impl JointFit {
    /// The same fit with the joint noise that the data show, where one was stated and they show one.
    fn with_noise_found(&self, series: &[MeasuredSeries]) -> Option<Self> {
        self.options.joint_noise.stated()?;
        let options = Options { joint_noise: JointNoise::Estimated, ..self.options.clone() };
        let chain = self.fit.state.robot.chain.clone();
        fit_model(chain, series, &options, Some((self.start.clone(), None))).ok()
    }

    /// What the data tell of the joint noise, also of that which counts as none.
    fn noise_information(&self) -> Option<NoiseInformation> {
        self.before.clone().or_else(|| noise_information(&self.fit))
    }

    /// The result by an estimator, with everything that is known of it.
    ///
    /// # Errors
    /// Too few images to hold any out; an estimator that has no solution.
    pub fn judged(self, series: &[MeasuredSeries], estimator: Estimator) -> Result<Solution> {
        let _stage = stage(self.options.model.title());
        let with_noise_found = self.with_noise_found(series);
        let told = with_noise_found.as_ref().and_then(Self::noise_information);
        let Self { options, fit, start, starts, on_robot, before, status, iterations } = self;
        let options = Options { estimator, ..options };
        let (free, limits, noise) = (start.free, &options.limits, options.joint_noise);
        let stated = noise.stated().zip(with_noise_found.as_ref());
        let stated_noise = stated.map(|(sigma, own)| StatedNoise { sigma, found: &own.fit, told: told.as_ref() });
        let fixed = &options.selection.fix;
        let context = CheckContext { series, free: &free, on_robot, stated_noise, fixed, limits };
        let mut diagnosis = Diagnosis::of_left_out(context, &fit)?;
        let (accuracy, held_out) = held_out(&fit, &options)?;
        {
            let _stage = stage("diagnoses");
            diagnosis.after_fit(&fit, &accuracy);
        }
        let (mut fit, joint, held_out) = match estimator.is_two_stage() {
            true => (staged(&fit, estimator, noise)?, Some(Box::new(fit.adjustment)), Vec::new()),
            false => (fit, None, held_out),
        };
        let estimated = noise == JointNoise::Estimated && joint.is_none();
        let (mut uncertainty, in_frame) = {
            let _stage = stage("uncertainty");
            judge(&mut fit, estimated, before, limits)?
        };
        diagnosis.after_uncertainty(&fit, &uncertainty, &accuracy);
        let findings = diagnosis.findings();
        if let Some(flange) = &mut uncertainty.flange {
            flange.without_size_doubt = doubt_of_size(&findings);
        }
        Ok(Solution {
            options,
            estimator,
            joint,
            series: series.to_vec(),
            uncertainty,
            in_frame,
            evidences: Vec::new(),
            lenses: Vec::new(),
            fit,
            free_poses: free,
            two_stage: None,
            accuracy,
            held_out,
            starts,
            findings,
            status,
            iterations,
        })
    }
}

/// How accurate the estimator is for what it has not seen, with the images among it.
fn held_out(fit: &Fit, options: &Options) -> Result<(Accuracy, Vec<(usize, ImageError)>)> {
    let Options { estimator, joint_noise, ref limits, .. } = *options;
    if estimator.is_two_stage() && !fit.problem.body_measurements.is_empty() {
        return Err(of_images_alone());
    }
    let free_poses = estimator.is_two_stage().then(|| PoseStage::solved(fit)).flatten();
    let fitted = |left: LinearisedAdjustment| match estimator.is_two_stage() {
        true => refit(&left.adjustment, free_poses.as_ref()?, estimator, joint_noise),
        false => Some(refitted_near(left)),
    };
    hold_out(fit.linear(), &fitted, limits)
        .or_else(|| Some((hold_out_bodies(fit.linear(), limits)?, Vec::new())))
        .ok_or_else(|| nothing_held_out("hold-out", &fit.problem, limits, joint_noise))
}

/// The fit, and what was known of the joint noise before some of it was set to none.
///
/// Images that were set `aside` before, and what was left out of bodies, take part where the fit says that they belong. A fit with another robot model may be `near`, and not
/// quite as near one with other lenses.
fn fit(
    mut start: Adjustment,
    free: &FreePoses,
    (aside, near, has_same_lenses): (&[usize], Option<&Adjustment>, bool),
    options: &Options,
) -> (Ended, Option<NoiseInformation>) {
    set_noise(&mut start, near, options.joint_noise);
    leave_all_out(&mut start.problem);
    let components =
        ComponentOptions { joint: options.joint_noise == JointNoise::Estimated, ..ComponentOptions::default() };
    let outcome = match near {
        Some(_) if has_same_lenses => estimate_components_near(start, &components),
        Some(_) => estimate_components(start, &components),
        None => estimate_components_from_above(start, &components),
    };
    let outcome = with_taken_back(outcome, free, aside, (&components, &options.limits));
    let outcome = without_contradicting(outcome, &components, &options.limits);
    let outcome = with_markers_let_go(outcome, &components, &options.limits);
    let outcome = with_agreeing_lengths(outcome, &components, &options.limits);
    if components.joint { without_unidentified_noise(outcome, &components.settings) } else { (outcome.ended(), None) }
}

/// The noise of joints and displacements that the fit starts from.
fn set_noise(start: &mut Adjustment, near: Option<&Adjustment>, joint_noise: JointNoise) {
    let exact = joint_noise == JointNoise::Known(0.0);
    if exact {
        start.problem.noise.displacement.clear();
    }
    start.tie_to_readings(exact);
    if let Some(solved) = near {
        start.start_near(solved, LEAST_FIRST_GUESS);
    }
    if let JointNoise::Known(sigma) = joint_noise {
        start.problem.noise.joint.iter_mut().flatten().for_each(|s| *s = sigma.max(f64::MIN_POSITIVE));
    }
}

/// Takes images and measurements back that fit the robot that was found.
fn with_taken_back(
    mut outcome: Outcome,
    free: &FreePoses,
    aside: &[usize],
    (components, limits): (&ComponentOptions, &Limits),
) -> Outcome {
    for _ in 0..ROUNDS {
        let images = take_back(&mut outcome, free, aside, limits);
        if !take_bodies_back(&mut outcome.adjustment, limits) && !images {
            break;
        }
        outcome = estimate_components(outcome.adjustment, components);
    }
    outcome
}

/// Lets go of markers that lie far off.
fn with_markers_let_go(mut outcome: Outcome, components: &ComponentOptions, limits: &Limits) -> Outcome {
    for _ in 0..ROUNDS {
        if !let_go(&mut outcome.adjustment, limits) {
            break;
        }
        outcome = without_contradicting(estimate_components(outcome.adjustment, components), components, limits);
    }
    outcome
}

/// With the measured lengths that a fit without them does not contradict.
fn with_agreeing_lengths(mut outcome: Outcome, components: &ComponentOptions, limits: &Limits) -> Outcome {
    if !take_agreeing(&mut outcome, limits) {
        return outcome;
    }
    outcome = estimate_components(outcome.adjustment, components);
    without_contradicting(outcome, components, limits)
}

/// Leaves out what disagrees with all else, as long as something does.
fn without_contradicting(mut outcome: Outcome, components: &ComponentOptions, limits: &Limits) -> Outcome {
    for _ in 0..ROUNDS {
        let stops = reject_stops(&mut outcome.adjustment) || reject_contradicting(&mut outcome.adjustment).is_some();
        let of_images = if stops { 0 } else { reject_observations(&mut outcome.adjustment) };
        let anything = stops || of_images + reject_bodies(&mut outcome.adjustment) > 0;
        if !anything && !leave_worst_out(&mut outcome, limits) {
            break;
        }
        outcome = estimate_components_near(outcome.adjustment, components);
    }
    outcome
}

/// Adds to every wrongly paired image by how much its readings miss, and whose readings would fit it.
fn name_wrong_pairs(adjustment: &mut Adjustment, free: &FreePoses, explained: f64) {
    let problem = &adjustment.problem;
    let usual = usual_misfit(adjustment, free).unwrap_or(0.0);
    let mut remarks = Vec::new();
    for (i, image) in problem.images.iter().enumerate() {
        let wrong = image.rejected.as_ref().is_some_and(ImageRejection::is_wrong_pair);
        let (true, Some(pose)) = (wrong, &free.poses[i]) else { continue };
        let pose = &pose.camera_from_plate;
        let Some((angle_rad, distance_m)) = adjustment.misfit(pose, i) else { continue };
        let better = (0..problem.images.len())
            .filter(|&k| k != i && problem.images[k].series == image.series)
            .filter_map(|k| Some((adjustment.camera_by_readings_of(i, k)?.misfit(pose), k)))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let better = better.filter(|(size, _)| *size < usual + explained * (angle_rad + distance_m));
        let fits = better.map(|(misfit, k)| FitsReadings { of: problem.images[k].name.clone(), misfit });
        remarks.push((i, Mismatch::Fit { misfit: Misfit { distance_m, angle_rad }, fits }));
    }
    for (i, mismatch) in remarks {
        adjustment.problem.images[i].rejected = Some(ImageRejection::WronglyPaired(mismatch));
    }
}

/// A two-step calibration goes by camera poses.
fn of_images_alone() -> Error {
    let what =
        "a two-step calibration is made of camera poses, and these series have measurements of trackers or contacts";
    Error::new(Code::OptionConflict, "--two-stage", what, "leave it out, or give series of images alone")
}

/// By how much the size of a plate is in doubt, relative; that of the plate of which most is.
fn doubt_of_size(findings: &[Finding]) -> Option<f64> {
    let of = |finding: &Finding| match finding {
        Finding::DoubtedSize(doubt) => Some(doubt.relative()),
        _ => None,
    };
    findings.iter().filter_map(of).max_by(f64::total_cmp)
}

/// Without images of the robot there is no robot to fit.
fn check_on_robot(problem: &Problem, on_robot: usize, series: &[MeasuredSeries]) -> Result<()> {
    let all = problem.images.len();
    match (0..all).filter(|&i| problem.on_robot(i)).count() {
        _ if on_robot > 0 || problem.used_bodies().next().is_some() => Ok(()),
        0 => Err(Error::new(
            Code::ReadingsMissing,
            format!(
                "{} of {}",
                series.first().map_or("joints.csv", MeasuredSeries::readings_file),
                series.iter().map(|s| s.name.as_str()).collect::<Vec<_>>().join(", ")
            ),
            format!(
                "no row has joint readings: all {all} images were taken off the robot, and tell of the camera and the plate only"
            ),
            "record the joints of every stop; a row with empty joint cells is an image off the robot",
        )),
        given => Err(Error::new(
            Code::ImagesTooFew,
            "images",
            format!("none of the {given} images of the robot can be used, {all} images in all"),
            "look at them with `robotcal detect`: is the plate in view, sharp, and the one of plate.toml?",
        )),
    }
}
