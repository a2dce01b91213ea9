//! `robotcal verify --series`: a corrected model judged by another series.

use std::path::Path;

use nalgebra::Vector3;

use super::verify_args::VerifyArgs;
use super::verify_model::Model;
use super::verify_stated::Stated;
use super::verify_verdict::{Gain, Measured, Reasons, of_series};
use super::verify_zeros::{read_otherwise, words, zero_off};
use super::zeros::Zeros;
use crate::assess::{Limits, Ratio, bootstrap_ratio, by_cluster, root_mean_square, root_of_mean};
use crate::calibration::{Ends, Inputs, Observed};
use crate::cli::Verdict;
use crate::cli::flags::recording::RecordingArgs;
use crate::cli::terminal::progress;
use crate::cli::terminal::say::say_line;
use crate::diagnose::{Finding, SizeDifference, Weight};
use crate::error::{Code, Error, Result};
use crate::identify::{
    JudgedImage, JudgedSeries, Options, RobotModel, RobotOfOtherZeros, Selection, identify, in_told_postures,
    postures_are_computed, verify_series,
};
use crate::model::robot::Robot;
use crate::output::compensated;
use crate::output::corrections::FileFinding;
use crate::output::restore::add;
use crate::problem::MeasuredSeries;
use crate::series::InputFile;
use crate::urdf::Chain;

/// Judges the model, and the nominal one where it is given, by the images that both predict.
pub(super) fn run(args: &VerifyArgs, recording: &RecordingArgs) -> Result<Verdict> {
    let ends = Ends { base: args.base.as_deref(), tip: args.tip.as_deref() };
    let read = |urdf: &Path| Inputs::read(urdf, &args.series, ends);
    let judged_inputs = read(&args.urdf)?;
    let options = recording.options(&[])?;
    let Some(file) = &args.nominal else { return alone(args, judged_inputs.with_recordings(&options)?) };
    // Poses of a controller are those of the model that is in it, whichever robot is judged by them.
    let nominal_inputs = read(file)?;
    require_same_joints(&judged_inputs.chain, &nominal_inputs.chain, &args.urdf, file)?;
    let model = model(args, judged_inputs.chain)?;
    beside_nominal(args, &model, (file, nominal_inputs.with_recordings(&options)?))
}

/// The model without another one beside it.
fn alone(args: &VerifyArgs, inputs: Inputs) -> Result<Verdict> {
    require_readings(&inputs)?;
    let model = model(args, inputs.chain.clone())?;
    let Observed { series, files, .. } = inputs.observe(&model.limits, &progress::of_series())?;
    require_images(&series)?;
    let zeros = zeros(args, &model, &files)?;
    let series = with_added(series, &missing(zeros.as_ref()));
    let seen = Verified { series: &series, files: &files, zeros: zeros.as_ref() };
    let found = match judged((&model.robot, &args.urdf), &series, &model.limits)? {
        JudgedSeries::Images(found) => found,
        JudgedSeries::OtherZeros(other) => return Ok(of_other_zeros(args, &model, &seen, &other)?.verdict()),
    };
    let images: Vec<&JudgedImage> = found.images.iter().collect();
    say_line!("{}", line("model", &args.urdf, &images));
    Ok(weigh(args, &model, (&seen, &images, &found.plate_sizes()), None).verdict())
}

/// The model and the nominal one, by the images that both predict.
fn beside_nominal(args: &VerifyArgs, model: &Model, (file, inputs): (&Path, Inputs)) -> Result<Verdict> {
    let Observed { chain, series, files, .. } = inputs.observe(&model.limits, &progress::of_series())?;
    require_images(&series)?;
    let zeros = zeros(args, model, &files)?;
    let missing = missing(zeros.as_ref());
    let series = in_told_postures(&model.robot, &with_added(series, &missing), &model.limits);
    let seen = Verified { series: &series, files: &files, zeros: zeros.as_ref() };
    let found = match judged((&model.robot, &args.urdf), &series, &model.limits)? {
        JudgedSeries::Images(found) => found,
        JudgedSeries::OtherZeros(other) => return Ok(of_other_zeros(args, model, &seen, &other)?.verdict()),
    };
    let as_shown: Vec<f64> = missing.iter().map(|offset| -offset).collect();
    let (robot, nominal) =
        compared((Robot::nominal(chain), file), &with_added(series.clone(), &as_shown), &model.limits)?;
    let (images, nominal) = of_both(&found.images, &nominal);
    let ratio = compare(args, file, &images, &nominal)?;
    let gain = Gain { ratio, nominal: &robot, of: "images", at: at_images(&model.robot, &series) };
    Ok(weigh(args, model, (&seen, &images, &found.plate_sizes()), Some(gain)).verdict())
}

/// The model of the flags. One of them that means nothing is refused before images are read.
fn model(args: &VerifyArgs, chain: Chain) -> Result<Model> {
    let model = Model::of(compensated(chain, args.compensation.as_deref())?, &args.urdf)?;
    args.readings.beside(model.stated.as_ref(), &args.urdf, &[])?;
    Ok(model)
}

/// Which controller readings are of; says so.
fn zeros(args: &VerifyArgs, model: &Model, files: &[InputFile]) -> Result<Option<Zeros>> {
    let zeros = args.readings.beside(model.stated.as_ref(), &args.urdf, files)?;
    zeros.iter().for_each(|zeros| say_line!("{}", zeros.line()));
    Ok(zeros)
}

/// What is to be added to readings so that they are of the controller to which the model belongs, rad or m.
fn missing(zeros: Option<&Zeros>) -> Vec<f64> {
    zeros.map_or_else(Vec::new, |zeros| zeros.missing.clone())
}

/// The series with this added to all readings, rad or m, those of other postures included.
fn with_added(mut series: Vec<MeasuredSeries>, offsets: &[f64]) -> Vec<MeasuredSeries> {
    for s in &mut series {
        let of_stops = s.stops.iter_mut().filter_map(|stop| stop.readings.as_mut());
        of_stops.chain(s.postures.iter_mut().flatten()).for_each(|readings| add(readings, offsets));
    }
    series
}

/// What was measured.
struct Verified<'a> {
    series: &'a [MeasuredSeries],
    files: &'a [InputFile],
    zeros: Option<&'a Zeros>,
}

/// The model beside what its solution states, and what the series shows of itself where it misses more.
fn weigh(
    args: &VerifyArgs,
    model: &Model,
    (seen, images, sizes): (&Verified<'_>, &[&JudgedImage], &[(String, SizeDifference)]),
    gain: Option<Gain<'_>>,
) -> Reasons {
    let Model { robot, stated, limits, .. } = model;
    let urdf = &args.urdf;
    let expected = stated.as_ref().and_then(|s| Some((s, s.at_stops(seen.series)?)));
    let rms_m = 1e-3 * root_mean_square(&units(images));
    let is_unexplained = expected.is_none() && rms_m > 1e-3 * limits.flange_sigma_mm;
    let mut reasons = Reasons::default();
    reasons.add(&Measured { urdf, rms_m, stated: expected, gain }, limits);
    if let Some(stated) = stated.as_ref().filter(|s| s.was_fitted_to(seen.files, seen.series)) {
        reasons.add_own(urdf, stated);
    }
    reasons.findings.extend(sizes.iter().filter_map(|size| of_another_size(size, model, (urdf, seen.series))));
    reasons.findings.extend(model.doubts(urdf, args.compensation.as_deref()));
    if reasons.misses() || is_unexplained {
        match by_other_readings(urdf, model, seen) {
            Some(found) => reasons.findings.push(found),
            None => reasons.findings.extend(shown_by_series(robot.chain.clone(), seen.series, limits)),
        }
    }
    reasons
}

/// A plate that the model contradicts: its lengths are as wrong as the size of the plate, and the errors of the images hold a part of that at most.
fn of_another_size(
    (plate, SizeDifference { off, sigma }): &(String, SizeDifference),
    model: &Model,
    (urdf, series): (&Path, &[MeasuredSeries]),
) -> Option<FileFinding> {
    // Lengths of which nothing is stated may be off as those of robots are.
    let stated = model.stated.as_ref().and_then(Stated::size_sigma);
    let weight = if stated.is_some() { Weight::Gate } else { Weight::Note };
    let sigma = sigma.hypot(stated.unwrap_or_default());
    let is_off = off.abs() > model.limits.plate_size_sigmas * sigma;
    if !is_off {
        return None;
    }
    let (readings, _) = at_images(&model.robot, series);
    let tips: Vec<Vector3<f64>> = readings.iter().map(|q| model.robot.base_from_tip(q).translation).collect();
    let middle = tips.iter().sum::<Vector3<f64>>() / tips.len().max(1) as f64;
    let off_m = off.abs() * root_of_mean(tips.iter().map(|tip| (tip - middle).norm_squared()));
    let text = format!(
        "{plate}: for this model it is {:.3} % (+- {:.3} %) {} than its file says, so that the lengths of the model are off by that, {:.3} mm RMS at the \
         stops, of which the other figures here hold a part at most; check the size of this plate, and that of the plate from which the model was identified: measure two far \
         markers of each and give [scale]",
        100.0 * off.abs(),
        100.0 * sigma,
        if *off > 0.0 { "larger" } else { "smaller" },
        1e3 * off_m
    );
    let quantities = [("relative_size", *off), ("sigma", sigma), ("rms_mm", 1e3 * off_m)];
    Some(FileFinding::new(Code::PlateSizeContradicted, weight, urdf.display(), quantities, text))
}

/// A model that is judged with its own zeros, which do not fit: there is no figure of it, and which zeros would fit is said.
fn of_other_zeros(args: &VerifyArgs, model: &Model, seen: &Verified<'_>, other: &RobotOfOtherZeros) -> Result<Reasons> {
    let urdf = &args.urdf;
    let with_these = judged((&other.robot, urdf), seen.series, &model.limits);
    say_line!(
        "model     {}: as it is, readings and images miss by {:.0} (median, mm plus mrad): nothing can be fitted",
        urdf.display(),
        1e3 * other.misfit
    );
    if let Some(images) = with_these.map(JudgedSeries::into_images).ok().filter(|images| !images.is_empty()) {
        say_line!("{}", line("zeros", urdf, &images.iter().collect::<Vec<_>>()) + ", with those that fit");
    }
    let mut reasons = Reasons::default();
    let subject = urdf.display().to_string();
    match by_other_readings(urdf, model, seen) {
        Some(found) => reasons.findings.push(found),
        None => reasons.findings.extend(other.zeros.iter().map(|zero| zero_off(zero, &subject))),
    }
    reasons.findings.extend(model.doubts(urdf, args.compensation.as_deref()));
    Ok(reasons)
}

/// The series with its readings taken the other way, where the model then misses no more than it may.
fn by_other_readings(urdf: &Path, model: &Model, seen: &Verified<'_>) -> Option<FileFinding> {
    let (zeros, stated) = (seen.zeros?, model.stated.as_ref()?);
    let series = with_added(seen.series.to_vec(), &zeros.instead());
    let images = verify_series(&model.robot, &series, &model.limits).ok()?.into_images();
    let images: Vec<&JudgedImage> = images.iter().collect();
    let rms_m = (!images.is_empty()).then(|| 1e-3 * root_mean_square(&units(&images)))?;
    read_otherwise((urdf, stated), (zeros, rms_m), &series, &model.limits)
}

/// Readings of the stops, and a point as far from the tip as what stands still, along no axis.
fn at_images(robot: &Robot, series: &[MeasuredSeries]) -> (Vec<Vec<f64>>, Vector3<f64>) {
    let readings: Vec<Vec<f64>> = series.iter().flat_map(|s| &s.stops).filter_map(|s| s.readings.clone()).collect();
    let lever_m = root_of_mean(readings.iter().map(|q| robot.base_from_tip(q).translation.norm_squared()));
    (readings, Vector3::repeat(lever_m / 3.0f64.sqrt()))
}

/// What the series shows of itself with the origins of the model held: a plate or a camera that was moved, a zero that is off.
fn shown_by_series(chain: Chain, series: &[MeasuredSeries], limits: &Limits) -> Vec<FileFinding> {
    let selection = Selection { fix: vec![ROBOT.to_owned()], ..Selection::default() };
    let options = Options { model: RobotModel::Rigid, selection, limits: *limits, ..Options::default() };
    let found = identify(chain, series, &options);
    let of = |found: &Finding| match found {
        Finding::ZeroOff(zero) => Some(zero_off(zero, &found.notice().place)),
        _ => of_series(found),
    };
    match found {
        Ok(solution) => solution.findings.iter().filter_map(of).collect(),
        Err(error) => vec![refused(&error)],
    }
}

/// Why the series cannot be fitted with the origins of the model held, which may be why the model misses it.
fn refused(error: &Error) -> FileFinding {
    let Error { code, place, what, remedy, .. } = error;
    let text = format!("{place}: {what}, with the origins of the model held; {remedy}");
    FileFinding::new(*code, Weight::Note, place, [], text)
}

/// The robot that a model is compared with, and its images. It is there to compare with and is not judged: where its zeros do not fit, it is taken
/// with those that do, which is said.
fn compared(
    (robot, file): (Robot, &Path),
    series: &[MeasuredSeries],
    limits: &Limits,
) -> Result<(Robot, Vec<JudgedImage>)> {
    let other = match judged((&robot, file), series, limits)? {
        JudgedSeries::Images(judged) => return Ok((robot, judged.images)),
        JudgedSeries::OtherZeros(other) => *other,
    };
    let found: Vec<String> = other.zeros.iter().map(words).collect();
    say_line!(
        "zeros     {}: as it is, readings and images miss by {:.0} (median, mm plus mrad); compared with it where {}",
        file.display(),
        1e3 * other.misfit,
        found.join(", and ")
    );
    let images = judged((&other.robot, file), series, limits)?.into_images();
    Ok((other.robot, images))
}

/// Name of all parameters of the robot.
const ROBOT: &str = "robot";

/// The images that both models predict.
fn of_both<'a>(model: &'a [JudgedImage], nominal: &'a [JudgedImage]) -> (Vec<&'a JudgedImage>, Vec<&'a JudgedImage>) {
    let same = |a: &JudgedImage, b: &JudgedImage| a.series == b.series && a.name == b.name;
    model.iter().filter_map(|m| nominal.iter().find(|n| same(m, n)).map(|n| (m, n))).unzip()
}

/// Without the model in the controller its poses tell no readings.
fn require_readings(inputs: &Inputs) -> Result<()> {
    let of_poses = inputs.series.iter().find(|s| postures_are_computed(s, &inputs.chain));
    of_poses.map_or(Ok(()), |s| {
        let what = "has poses of the controller, and the model by which it computes them is not given: the robot that is judged would reach \
                    them exactly, whatever its errors";
        let remedy = "give --nominal, the robot description that the controller computes with";
        Err(Error::new(Code::OptionMissing, s.readings_file().display(), what, remedy))
    })
}

/// Images judge; what trackers and contacts measured beside them is said not to.
fn require_images(series: &[MeasuredSeries]) -> Result<()> {
    let measured: Vec<&MeasuredSeries> = series.iter().filter(|s| !s.bodies.is_empty()).collect();
    let has_images = series.iter().any(|s| s.stops.iter().any(|stop| !stop.observations.is_empty()));
    let remedy = "give what a tracker measured as --points FILE, a table of joint readings with x_m, y_m, z_m";
    match measured.first() {
        Some(first) if !has_images => {
            let what = "a series is judged by its images, and there is none: trackers or contacts measured it";
            Err(Error::new(Code::ImagesMissing, format!("series {}", first.name), what, remedy))
        }
        Some(_) => {
            let count: usize = measured.iter().map(|s| s.bodies.len()).sum();
            say_line!(
                "left      {count} measurements of trackers and contacts: a series is judged by its images ({remedy})"
            );
            Ok(())
        }
        None => Ok(()),
    }
}

fn require_same_joints(model: &Chain, nominal: &Chain, urdf: &Path, file: &Path) -> Result<()> {
    if (&model.readings, &model.reading_kinds) == (&nominal.readings, &nominal.reading_kinds) {
        return Ok(());
    }
    let joints = |chain: &Chain| chain.readings.join(", ");
    let what = format!("has the joints {}, and {} has {}", joints(model), file.display(), joints(nominal));
    let remedy = "give two descriptions of one robot, and --base and --tip where the same joints stand between them";
    Err(Error::new(Code::JointUnknown, urdf.display(), what, remedy))
}

fn compare(args: &VerifyArgs, file: &Path, model: &[&JudgedImage], nominal: &[&JudgedImage]) -> Result<Ratio> {
    say_line!(
        "images    {} that both models predict; camera, hand-eye transform and plate fitted to the others",
        model.len()
    );
    say_line!("{}", line("model", &args.urdf, model));
    say_line!("{}", line("nominal", file, nominal));
    let postures: Vec<usize> = model.iter().map(|i| i.posture).collect();
    let of_postures = |images: &[&JudgedImage]| by_cluster(&postures, &units(images));
    bootstrap_ratio(&of_postures(model), &of_postures(nominal)).ok_or_else(|| {
        Error::new(
            Code::FitUndetermined,
            "verification",
            "the models have no image in common",
            "check that both URDFs are of this robot",
        )
    })
}

fn judged((robot, file): (&Robot, &Path), series: &[MeasuredSeries], limits: &Limits) -> Result<JudgedSeries> {
    let bar = progress::bar(1, &file.display().to_string());
    let found = verify_series(robot, series, limits);
    bar.finish_and_clear();
    found
}

fn units(images: &[&JudgedImage]) -> Vec<(f64, f64)> {
    images.iter().map(|i| (i.error.mm2, i.error.count)).collect()
}

fn line(what: &str, file: &Path, images: &[&JudgedImage]) -> String {
    let px: Vec<(f64, f64)> = images.iter().map(|i| (i.error.px2, i.error.count)).collect();
    let worst = images.iter().map(|i| (i.error.mm2 / i.error.count).sqrt()).fold(0.0, f64::max);
    format!(
        "{what:<9} {}: {:.3} mm RMS, {:.3} px RMS, worst image {worst:.3} mm",
        file.display(),
        root_mean_square(&units(images)),
        root_mean_square(&px)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn why_a_series_cannot_be_fitted_is_said() {
        let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/kuka_kr6_r900/kuka_kr6_r900.urdf");
        let chain = crate::urdf::read(&urdf).unwrap().chain(None, None).unwrap();
        let nothing = [MeasuredSeries::without_images("a", true, Vec::new())];
        let options = Options { model: RobotModel::Rigid, ..Options::default() };
        let code = identify(chain.clone(), &nothing, &options).err().map(|error| error.code);
        let found = shown_by_series(chain, &nothing, &Limits::default());
        let found: Vec<_> = found.iter().map(|f| (Some(f.code), f.weight)).collect();
        assert_eq!(found, [(code, Weight::Note)]);
    }
}
