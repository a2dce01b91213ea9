//! `robotcal verify --series`: a corrected model judged by another series.

use std::path::Path;

use super::recording::RecordingArgs;
use super::say::say_line;
use super::verify_args::VerifyArgs;
use super::{Verdict, progress};
use crate::assess::{Ratio, bootstrap_ratio, by_cluster, root_mean_square};
use crate::calibration::{Ends, Inputs, Observed};
use crate::error::{Code, Error, Result};
use crate::identify::{JudgedImage, verify_series};
use crate::output::compensated;

/// Judges the model, and the nominal one where it is given, by the images that both predict.
pub(super) fn run(args: &VerifyArgs, recording: &RecordingArgs) -> Result<Verdict> {
    let model = judged(args, &args.urdf, args.compensation.as_deref(), recording)?;
    let Some(file) = &args.nominal else {
        say_line!("{}", line("model", &args.urdf, &model.iter().collect::<Vec<_>>()));
        return Ok(Verdict::Good);
    };
    let nominal = judged(args, file, None, recording)?;
    let same = |a: &JudgedImage, b: &JudgedImage| a.series == b.series && a.name == b.name;
    let pairs: Vec<(&JudgedImage, &JudgedImage)> =
        model.iter().filter_map(|m| nominal.iter().find(|n| same(m, n)).map(|n| (m, n))).collect();
    let (model, nominal): (Vec<_>, Vec<_>) = pairs.into_iter().unzip();
    say_line!(
        "images    {} that both models predict; camera, hand-eye transform and plate fitted to the others",
        model.len()
    );
    say_line!("{}", line("model", &args.urdf, &model));
    say_line!("{}", line("nominal", file, &nominal));
    let postures: Vec<usize> = model.iter().map(|i| i.posture).collect();
    let of_postures = |images: &[&JudgedImage]| by_cluster(&postures, &units(images));
    let ratio = bootstrap_ratio(&of_postures(&model), &of_postures(&nominal)).ok_or_else(|| {
        Error::new(
            Code::FitUndetermined,
            "verification",
            "the models have no image in common",
            "check that both URDFs are of this robot",
        )
    })?;
    let Ratio { value, low, high } = ratio;
    let share = format!("{:.0} % of the nominal error ({:.0} to {:.0} %)", 100.0 * value, 100.0 * low, 100.0 * high);
    if value < 1.0 {
        say_line!("verdict   good: {share}");
        return Ok(Verdict::Good);
    }
    say_line!("verdict   NOT TO BE TRUSTED: {share}");
    Ok(Verdict::GateFailed)
}

fn judged(
    args: &VerifyArgs,
    urdf: &Path,
    compensation: Option<&Path>,
    recording: &RecordingArgs,
) -> Result<Vec<JudgedImage>> {
    let ends = Ends { base: args.base.as_deref(), tip: args.tip.as_deref() };
    let inputs = Inputs::read(urdf, &args.series, ends)?.with_recordings(&recording.options(&[])?)?;
    let Observed { chain, series: measured, .. } = inputs.observe(&progress::of_series())?;
    let robot = compensated(chain, compensation)?;
    let bar = progress::bar(1, &urdf.display().to_string());
    let found = verify_series(&robot, &measured);
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
