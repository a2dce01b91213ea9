//! Which lens: that which the joint fit supports by evidence, as the robot model is; see the formulation.

use std::collections::BTreeMap;

use crate::assess::{Limits, camera_shows_pattern};
use crate::diagnose::{GivenCamera, LensNotInRos};
use crate::error::{Code, Error, Notice, Result};
use crate::fit::{FreePoses, NoEvidence, fit_of_outcome, log_evidence_of_fit, log_evidence_of_outcome};
use crate::identify::joint_fit::fit::{JointFit, fit_model};
use crate::identify::options::Options;
use crate::identify::photogrammetry::free_poses::{free_poses_of, good_start};
use crate::identify::problem::build::build;
use crate::identify::solution::LensEvidence;
use crate::model::camera::{Camera, Lens, fit_lens};
use crate::model::robot::Robot;
use crate::problem::{Adjustment, Family, LensChoice, MeasuredSeries, Problem, predict};
use crate::solve::{ComponentOptions, LinearProblem, Outcome, Settings, estimate_components, side_by_side};
use crate::stage::stage;
use crate::urdf::Chain;

/// One observation of so many is kept aside, in every image and of every marker in other images.
const KEPT_ASIDE: usize = 4;
/// Share of the largest errors that does not count: what is wrongly identified says nothing of the lens.
const OUTLIERS: f64 = 0.02;
/// Stops beyond which some of them tell the lens, and how many those are: what they leave open of it is far below the noise of a circle.
const MANY_STOPS: usize = 500;
const SOME_STOPS: usize = 250;
/// Newton decrement of a fit that is judged by its evidence, whose logarithm is then known to a tenth or so.
const DECREMENT: f64 = 0.01;
/// Rounds in which image noise and fit follow the lens.
const ROUNDS: usize = 3;
/// The same for a lens with a displacement field.
const FIELD_ROUNDS: usize = 8;

/// The fit of one robot model with the lenses that its evidence supports.
pub(in crate::identify) struct Lensed {
    /// The fit.
    pub fit: JointFit,
    /// The series with these lenses.
    pub series: Vec<MeasuredSeries>,
    /// Evidence of the lenses of cameras whose lens was open.
    pub lenses: Vec<LensEvidence>,
    /// What is to be said of it.
    pub notices: Vec<Notice>,
}

/// Fits one robot model and, for cameras whose lens is open, the lens that its evidence supports.
///
/// # Errors
/// As of [`fit_model`]; where no fit with the first lens exists, a lens by hold-out of free poses stands in for it.
pub(in crate::identify) fn with_lenses(chain: &Chain, series: &[MeasuredSeries], options: &Options) -> Result<Lensed> {
    let mut series = series.to_vec();
    let open = if options.selection.names_cameras() { BTreeMap::new() } else { open_cameras(&series) };
    series.iter_mut().filter(|s| open.contains_key(&s.camera)).for_each(|s| s.lens = Lens::ALL[0]);
    for camera in open.iter().filter(|(_, choice)| choice.has(Lens::Fisheye)).map(|(camera, _)| camera) {
        begin_as_seen(chain, &mut series, camera, &options.limits);
    }
    let (fit, mut notices) = match fit_model(chain.clone(), &series, options, None) {
        Ok(fit) => (fit, Vec::new()),
        Err(error) => by_hold_out(chain, &mut series, &open, options).ok_or(error)?,
    };
    let mut near: Option<Adjustment> = None;
    let mut better_series = series.clone();
    let mut lenses = Vec::new();
    for (camera, choice) in &open {
        let (told, better) = compare_lenses(&fit, camera, *choice, &options.limits).unwrap_or_else(|why| {
            notices.extend(not_compared(&fit.fit, camera, why));
            (Vec::new(), None)
        });
        lenses.extend(told);
        if let Some(better) = better {
            better_series.iter_mut().filter(|s| s.camera == *camera).for_each(|s| s.lens = better.lens());
            near = Some(better.in_place_of(near.as_ref().unwrap_or(&fit.fit.adjustment)));
        }
    }
    let first = Lensed { fit, series, lenses, notices };
    if near.is_none() {
        return Ok(first);
    }
    Ok(match fit_model(chain.clone(), &better_series, options, Some((first.fit.start.clone(), near))) {
        Ok(fit) => Lensed { fit, series: better_series, ..first },
        Err(error) => first.kept(&error),
    })
}

/// The fisheye for a camera of a wide angle whose images it explains and the simplest lens does not: that one is a long way to a bad end.
fn begin_as_seen(chain: &Chain, series: &mut [MeasuredSeries], camera: &str, limits: &Limits) {
    let robot = Robot::nominal(chain.clone());
    let start = |series: &[MeasuredSeries]| good_start(&robot, series, camera, limits).unwrap_or_default();
    if start(series).is_some() {
        return;
    }
    let set = |series: &mut [MeasuredSeries], lens: Lens| {
        series.iter_mut().filter(|s| s.camera == camera).for_each(|s| s.lens = lens);
    };
    set(series, Lens::Fisheye);
    if start(series).is_none_or(|camera| camera.corner() <= limits.fisheye_tangent) {
        set(series, Lens::ALL[0]);
    }
}

impl Lensed {
    /// The first lenses, where the fit with those of the evidence came to no end.
    fn kept(mut self, error: &Error) -> Self {
        let evidences = self.lenses.clone();
        for lens in self.lenses.iter_mut().filter(|l| l.taken) {
            let first = self.series.iter().find(|s| s.camera == lens.camera).map(|s| s.lens);
            let Some(first) = first.filter(|first| *first != lens.lens) else { continue };
            lens.taken = false;
            let of_first = evidences.iter().find(|l| l.camera == lens.camera && l.lens == first);
            let more = of_first.map_or(f64::NAN, |l| lens.log_evidence - l.log_evidence);
            let what = format!(
                "lens '{}' has {more:.0} more in log evidence, and the fit with it came to no end ({}): '{}' is kept, and what it does not describe is left out or spoils the rest",
                lens.lens.name(),
                error.what,
                first.name()
            );
            let remedy = format!("name another lens with --camera, or look at the residuals of camera {}", lens.camera);
            self.notices.push(Notice::new(Code::NotConverged, format!("camera {}", lens.camera), what, remedy));
        }
        let kept = |l: &LensEvidence| self.series.iter().any(|s| s.camera == l.camera && s.lens == l.lens);
        self.lenses.iter_mut().filter(|l| kept(l)).for_each(|l| l.taken = true);
        self
    }
}

/// Cameras none of whose series settles the lens.
pub(in crate::identify) fn open_cameras(series: &[MeasuredSeries]) -> BTreeMap<String, LensChoice> {
    let mut open = BTreeMap::new();
    for s in series {
        let choice = open.entry(s.camera.clone()).or_insert(s.lens_choice);
        *choice = (*choice).min(s.lens_choice);
    }
    open.retain(|_, choice| *choice != LensChoice::Settled);
    open
}

/// The fit with other lenses for the open cameras, where free poses speak for others.
fn by_hold_out(
    chain: &Chain,
    series: &mut [MeasuredSeries],
    open: &BTreeMap<String, LensChoice>,
    options: &Options,
) -> Option<(JointFit, Vec<Notice>)> {
    let first: Vec<Lens> = series.iter().map(|s| s.lens).collect();
    let names: Vec<String> = open.keys().cloned().collect();
    if open.is_empty() {
        return None;
    }
    // A formula that explains the images at all is enough to begin with.
    let choices: Vec<LensChoice> = series.iter().map(|s| s.lens_choice).collect();
    series.iter_mut().for_each(|s| s.lens_choice = s.lens_choice.min(LensChoice::Exported));
    let chosen = choose_lens(chain, series, &names, &options.limits);
    series.iter_mut().zip(choices).for_each(|(s, choice)| s.lens_choice = choice);
    let notices = chosen.ok()?;
    let is_another = series.iter().zip(first).any(|(s, first)| s.lens != first);
    let fit = if is_another { fit_model(chain.clone(), series, options, None).ok()? } else { return None };
    Some((fit, notices))
}

/// The lens of a camera that is kept because the fit with it has no evidence to which that of others could be compared.
fn not_compared(fit: &Adjustment, camera: &str, why: NoEvidence) -> Option<Notice> {
    let k = fit.problem.cameras.iter().position(|c| c == camera)?;
    let what = format!("lens '{}' is kept, and no other was tried: {why}", fit.state.cameras[k].lens.name());
    let remedy = "name a lens with --camera to have its own fit";
    Some(Notice::new(why.code(), format!("camera {camera}"), what, remedy))
}

/// Evidence of the lenses for a camera, from the fit with its present one, and another one where that is better; of the present one alone, where its
/// residuals show no pattern.
///
/// # Errors
/// The present one has no evidence, or that of a part of many stops has none.
fn compare_lenses(
    joint: &JointFit,
    camera: &str,
    choice: LensChoice,
    limits: &Limits,
) -> std::result::Result<(Vec<LensEvidence>, Option<BetterLens>), NoEvidence> {
    let _stage = stage("evidence of lenses");
    let fit = &joint.fit;
    let Some(k) = fit.problem.cameras.iter().position(|c| c == camera) else { return Ok((Vec::new(), None)) };
    let some = fit.adjustment.some_stops(MANY_STOPS, SOME_STOPS).map(|some| fit_of_outcome(settled(some, ROUNDS)));
    let some = some.transpose()?;
    let present = some.as_ref().unwrap_or(fit);
    let of_present = log_evidence_of_fit(present).ok_or(NoEvidence::Undetermined)?;
    let lens = present.state.cameras[k].lens;
    let is_wide = fit.state.cameras[k].corner() > limits.fisheye_tangent;
    let depths = depths_m(&fit.problem, &joint.start.free)[k];
    let is_asked = |l: &Lens| *l == lens || (choice.has(*l) && (l.formula() != Lens::Fisheye || is_wide));
    let lenses: Vec<Lens> = match camera_shows_pattern(present, k, limits) {
        Ok(false) => vec![lens],
        _ => Lens::ALL.into_iter().filter(is_asked).collect(),
    };
    let found = side_by_side(&fit.problem, &lenses, |_, next| match *next == lens {
        true => Some((told(present.linear(), k, of_present), None)),
        false => evidence(&present.adjustment, (k, &depths), *next),
    });
    let mut all: Vec<(LensEvidence, Option<BetterLens>)> = found.into_iter().flatten().collect();
    let best = all.iter().map(|(e, _)| e.log_evidence).fold(f64::NEG_INFINITY, f64::max);
    all.iter_mut().for_each(|(e, _)| e.log_evidence -= best);
    let simplest = all.iter_mut().find(|(e, _)| e.log_evidence > -limits.decisive_log_odds);
    let better = simplest.and_then(|(e, better)| {
        e.taken = true;
        better.take()
    });
    Ok((all.into_iter().map(|(e, _)| e).collect(), better))
}

/// Another lens than the present one, at its optimum.
struct BetterLens {
    index: usize,
    camera: Camera,
    pixel_factor: f64,
    families: Vec<Family>,
}

impl BetterLens {
    fn of(linear: LinearProblem, index: usize) -> Self {
        let Adjustment { problem, state } = linear.adjustment;
        let pixel_factor = problem.noise.pixel_factor[index];
        Self { index, camera: state.cameras[index].clone(), pixel_factor, families: problem.families.clone() }
    }

    fn lens(&self) -> Lens {
        self.camera.lens
    }

    /// A fit with this lens.
    fn in_place_of(self, fit: &Adjustment) -> Adjustment {
        let mut other = fit.with_camera(self.index, self.camera);
        let problem = &mut other.problem;
        problem.noise.pixel_factor[self.index] = self.pixel_factor;
        problem.families.iter_mut().filter(|f| f.held.ncols() > 0).for_each(|f| f.take_factor(&self.families));
        other
    }
}

fn evidence(
    fit: &Adjustment,
    (camera, depths_m): (usize, &[f64; 2]),
    lens: Lens,
) -> Option<(LensEvidence, Option<BetterLens>)> {
    // The size of a displacement field is found from above.
    let rounds = if lens.has_field() { FIELD_ROUNDS } else { ROUNDS };
    let outcome = settled(with_lens(fit, (camera, depths_m), lens)?, rounds);
    let log_evidence = log_evidence_of_outcome(&outcome).ok()?;
    let linear = outcome.linear()?;
    Some((told(linear, camera, log_evidence), Some(BetterLens::of(linear, camera))))
}

/// The optimum near an adjustment. Image noise follows the lens; joint noise, tilt and the sizes of families stay.
fn settled(mut near: Adjustment, rounds: usize) -> Outcome {
    near.problem.families.retain(|f| f.held.ncols() > 0);
    let settings = Settings { decrement: DECREMENT, ..Settings::default() };
    let options =
        ComponentOptions { joint: false, displacement: false, rounds, settings, ..ComponentOptions::default() };
    estimate_components(near, &options)
}

/// Of the lens that a camera has at an optimum.
fn told(linear: LinearProblem, camera: usize, log_evidence: f64) -> LensEvidence {
    let Adjustment { problem, state } = linear.adjustment;
    let (found, camera) = (&state.cameras[camera], problem.cameras[camera].clone());
    let log_evidence = log_evidence + of_noise(linear) + of_formula(found);
    let centre_px = [found.parameters[2], found.parameters[3]];
    LensEvidence { camera, lens: found.lens, log_evidence, centre_px, taken: false }
}

/// The adjustment with another lens for one camera, which images as the present one does.
fn with_lens(fit: &Adjustment, (camera, depths_m): (usize, &[f64; 2]), lens: Lens) -> Option<Adjustment> {
    let present = &fit.state.cameras[camera];
    let next = match present.extended(lens) {
        Some(extended) => extended,
        None => fit_lens(present, lens, depths_m)?.camera,
    };
    Some(fit.with_camera(camera, next))
}

/// What the size of the image noise adds to the logarithm of the density of the observations.
fn of_noise(linear: LinearProblem) -> f64 {
    let factors = &linear.adjustment.problem.noise.pixel_factor;
    -linear.images().map(|i| 2.0 * i.terms.residuals.len() as f64 * factors[i.image.camera].ln()).sum::<f64>()
}

/// Logarithm of the density of coefficients that the fit has no prior for: evidences of formulas need one.
fn of_formula(camera: &Camera) -> f64 {
    let improper = (4..camera.parametric()).filter(|&k| camera.prior_sigma(k).is_infinite());
    improper
        .map(|k| {
            let sigma = camera.lens.typical(k - 4);
            -0.5 * (camera.parameters[k] / sigma).powi(2) - sigma.ln()
        })
        .sum()
}

/// Nearest and farthest plate centre that each camera saw, m.
pub fn depths_m(problem: &Problem, free: &FreePoses) -> Vec<[f64; 2]> {
    let mut all = vec![[f64::INFINITY, 0.0f64]; problem.cameras.len()];
    for (i, image) in problem.used() {
        let Some(pose) = &free.poses[i] else { continue };
        let z = pose.camera_from_plate.translation.z;
        let range = &mut all[image.camera];
        *range = [range[0].min(z), range[1].max(z)];
    }
    all.into_iter().map(|[near, far]| if far > 0.0 { [near, far] } else { [1.0, 1.0] }).collect()
}

/// What the cameras of ROS cannot say of the lenses that were identified.
pub(in crate::identify) fn losses(
    Adjustment { problem, state }: &Adjustment,
    free: &FreePoses,
    series: &[MeasuredSeries],
) -> Vec<LensNotInRos> {
    let named = problem.cameras.iter().zip(&state.cameras).zip(depths_m(problem, free));
    let loss = |((name, camera), depths): ((&String, &Camera), [f64; 2])| {
        let loss_px = camera.in_ros(&depths).map(|fit| [fit.rms_px, fit.worst_px]);
        let (lens, is_in_ros) = (camera.lens.name(), camera.lens.is_in_ros());
        (!is_in_ros).then(|| LensNotInRos {
            camera: name.clone(),
            lens,
            loss_px,
            given: GivenCamera::of(series, Some(name)),
        })
    };
    named.filter_map(loss).collect()
}

/// Sets the lens of `open` cameras by hold-out of free poses, and says why.
///
/// # Errors
/// Those of the adjustment, when no lens explains the images at all.
pub fn choose_lens(
    chain: &Chain,
    series: &mut [MeasuredSeries],
    open: &[String],
    limits: &Limits,
) -> Result<Vec<Notice>> {
    let trials = lens_trials(chain, series, open, limits)?;
    let mut notices = Vec::new();
    let names: Vec<String> = trials.first().map_or_else(Vec::new, |t| t.1.iter().map(|e| e.0.clone()).collect());
    for (camera, name) in names.iter().enumerate().filter(|(_, name)| open.contains(name)) {
        let errors: Vec<(Lens, f64)> = trials.iter().map(|(lens, e)| (*lens, e[camera].1)).collect();
        let best = errors.iter().fold(f64::INFINITY, |m, e| m.min(e.1));
        let Some((lens, error)) = errors.iter().find(|e| e.1 <= (1.0 + limits.lens_as_good) * best) else {
            let what = "shows nothing that could tell one lens from another";
            return Err(Error::new(Code::LensUndecided, format!("camera {name}"), what, "name its lens with --camera"));
        };
        series.iter_mut().filter(|s| s.camera == *name).for_each(|s| s.lens = *lens);
        let all: Vec<String> = errors.iter().map(|(l, e)| format!("{} {e:.4}", l.name())).collect();
        let what = format!(
            "lens '{}' is taken: {error:.4} px RMS over every {KEPT_ASIDE}th observation, which the adjustment had not seen ({}); a simpler \
             lens wins where it is within {:.0} % of the best",
            lens.name(),
            all.join(", "),
            100.0 * limits.lens_as_good
        );
        notices.push(Notice::new(Code::LensChosen, format!("camera {name}"), what, ""));
    }
    Ok(notices)
}

/// A lens, and the error of every camera with it, by its name.
type LensTrial = (Lens, Vec<(String, f64)>);

/// The error of every camera with each lens that is open to one of the `open` cameras.
fn lens_trials(chain: &Chain, series: &[MeasuredSeries], open: &[String], limits: &Limits) -> Result<Vec<LensTrial>> {
    let among = |s: &MeasuredSeries, lens: Lens| s.lens_choice == LensChoice::Settled || s.lens_choice.has(lens);
    let is_open = |lens: &Lens| series.iter().any(|s| open.contains(&s.camera) && among(s, *lens));
    let (mut trials, mut last_error) = (Vec::new(), None);
    for lens in Lens::ALL.into_iter().filter(is_open) {
        match held_out_errors(chain, series, lens, limits) {
            Ok(errors) => trials.push((lens, errors)),
            Err(error) => last_error = Some(error),
        }
    }
    match last_error {
        Some(error) if trials.is_empty() => Err(error),
        _ => Ok(trials),
    }
}

/// Error of every camera over the observations kept aside, px RMS per point.
fn held_out_errors(
    chain: &Chain,
    series: &[MeasuredSeries],
    lens: Lens,
    limits: &Limits,
) -> Result<Vec<(String, f64)>> {
    let robot = Robot::nominal(chain.clone());
    let mut all = series.to_vec();
    all.iter_mut().for_each(|s| s.lens = lens);
    let full = build(&robot, &all, false, limits)?.problem;
    let aside = |image: usize, marker: usize| (marker + 7 * image).is_multiple_of(KEPT_ASIDE);
    let thin = |start: &mut Adjustment| {
        for (i, image) in start.problem.images.iter_mut().enumerate() {
            image.observations.retain(|o| !aside(i, o.marker));
        }
        Ok(())
    };
    let (_, free, _) = free_poses_of(&robot, &all, limits, thin)?;
    let mut squares: Vec<Vec<f64>> = vec![Vec::new(); full.cameras.len()];
    for (i, image) in full.images.iter().enumerate() {
        let Some(pose) = &free.poses[i] else { continue };
        for o in image.observations.iter().filter(|o| aside(i, o.marker)) {
            let predicted = predict(image, &free.state, &pose.camera_from_plate, o);
            squares[image.camera].extend(predicted.map(|p| (p.uv - o.uv).norm_squared()));
        }
    }
    Ok(full.cameras.iter().cloned().zip(squares.into_iter().map(trimmed_rms)).collect())
}

fn trimmed_rms(mut squares: Vec<f64>) -> f64 {
    squares.sort_by(f64::total_cmp);
    squares.truncate(((1.0 - OUTLIERS) * squares.len() as f64).ceil() as usize);
    if squares.is_empty() { f64::INFINITY } else { (squares.iter().sum::<f64>() / squares.len() as f64).sqrt() }
}
