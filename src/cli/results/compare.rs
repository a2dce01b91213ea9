//! `robotcal compare`: two-stage estimators beside the joint fit, on a series or as a simulated study.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::calibration::{Ends, Inputs, Observed};
use crate::cli::Verdict;
use crate::cli::flags::arguments::command_of_report;
use crate::cli::flags::choices::Model;
use crate::cli::flags::recording::RecordingArgs;
use crate::cli::flags::robot::read_chain;
use crate::cli::terminal::progress;
use crate::cli::terminal::say::{say, say_line};
use crate::error::{Code, Error, Result};
use crate::identify::Options;
use crate::output::ResultFolder;
use crate::output::comparison::comparison_markdown;
use crate::series::Series;
use crate::simulate::truth::Truth;
use crate::study::monte_carlo_markdown;
use crate::study::{MonteCarloRequest, StudyRequest};
use crate::study::{study_html, study_markdown, study_verdict};

/// Flags of `compare`.
#[derive(Debug, Args)]
pub struct CompareArgs {
    /// Robot description (URDF)
    #[arg(long, value_name = "FILE")]
    urdf: PathBuf,
    /// Series folder; several of them to fit several series of the same robot together
    #[arg(long, value_name = "FOLDER", num_args = 1.., required_unless_present_any = ["study", "monte_carlo"])]
    series: Vec<PathBuf>,
    /// Simulate where the joint fit beats two-step calibration, over repeatability and number of markers, instead of reading a series
    #[arg(long, conflicts_with = "series")]
    study: bool,
    /// Simulate series with errors drawn from the priors, and judge the stated uncertainties by the known truth
    #[arg(long, conflicts_with_all = ["series", "study"])]
    monte_carlo: bool,
    /// Simulated series in every cell of the study, or for each joint noise of the Monte-Carlo test
    #[arg(long, value_name = "N", default_value_t = 30)]
    seeds: u64,
    /// Folder for the report (default: reports for --study and --monte-carlo; a comparison on a series is only printed)
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Base link (overrides series.toml)
    #[arg(long, value_name = "LINK")]
    base: Option<String>,
    /// Tip link that carries camera or plate (overrides series.toml)
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// Joint terms beside rigid geometry and offsets
    #[arg(long, value_enum, default_value_t = Model::Auto)]
    robot_model: Model,
    #[command(flatten)]
    recording: RecordingArgs,
}

/// Files of the reports.
const COMPARISON: &str = "comparison.md";
const STUDY: [&str; 2] = ["two-stage-vs-joint.md", "two-stage-vs-joint.html"];
const MONTE_CARLO: &str = "monte-carlo.md";

impl CompareArgs {
    /// The folder for reports, tried before the work.
    fn place(&self, files: &[&str]) -> Result<ResultFolder> {
        ResultFolder::among(self.out.as_deref().unwrap_or(Path::new("reports")))?.for_files(files)
    }
}

pub fn run(args: &CompareArgs) -> Result<Verdict> {
    require_worlds(args)?;
    match (args.study, args.monte_carlo) {
        (true, _) => study(args),
        (_, true) => monte_carlo(args),
        _ => series(args),
    }
}

/// Simulated worlds enough for an interval.
fn require_worlds(args: &CompareArgs) -> Result<()> {
    if args.seeds >= 2 || !(args.study || args.monte_carlo) {
        return Ok(());
    }
    let what = "fewer than 2 worlds give no interval";
    Err(Error::new(Code::OptionRange, "--seeds", what, "give 30 or more"))
}

fn series(args: &CompareArgs) -> Result<Verdict> {
    let place = args.out.is_some().then(|| args.place(&[COMPARISON])).transpose()?;
    let ends = Ends { base: args.base.as_deref(), tip: args.tip.as_deref() };
    let inputs = Inputs::read(&args.urdf, &args.series, ends)?.with_recordings(&args.recording.options(&[])?)?;
    let truth = truth_of(&inputs.series)?;
    let options = Options { model: args.robot_model.into(), ..Options::default() };
    let Observed { chain, series: measured, .. } = inputs.observe(&options.limits, &progress::of_series())?;
    let solution = crate::identify::identify(chain, &measured, &options)?;
    let bar = progress::bar(1, "folds");
    let comparison = crate::identify::compare(&solution, truth.as_ref(), |done, total| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    let text = comparison_markdown(&comparison);
    say!("{text}");
    if let Some(place) = place {
        let command = command_of_report();
        let report = format!("# Two-step calibration against the joint fit, on a series\n\n    {command}\n\n{text}");
        write(&place, [(COMPARISON, report)])?;
    }
    Ok(Verdict::Good)
}

/// truth.toml of a single simulated series.
fn truth_of(all: &[Series]) -> Result<Option<Truth>> {
    let [only] = all else { return Ok(None) };
    let path = only.folder.join("truth.toml");
    if path.exists() { Truth::read(&path).map(Some) } else { Ok(None) }
}

fn study(args: &CompareArgs) -> Result<Verdict> {
    let place = args.place(&STUDY)?;
    let chain = read_chain(&args.urdf, args.base.as_deref(), args.tip.as_deref())?;
    let request = StudyRequest { seeds: args.seeds, ..StudyRequest::full(chain) };
    let bar = progress::bar(1, "cells");
    let study = crate::study::study(&request, |done, total| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    let command = command_of_report();
    study_verdict(&study).iter().for_each(|line| say_line!("{line}"));
    let files = [(STUDY[0], study_markdown(&study, &command)), (STUDY[1], study_html(&study, &command))];
    write(&place, files)?;
    Ok(Verdict::Good)
}

/// Joint noise of the Monte-Carlo test, rad (the second is seldom told from none), and images of a series.
const MONTE_CARLO_NOISE: [f64; 5] = [0.0, 2.5e-6, 5e-6, 2e-5, 1e-4];
const MONTE_CARLO_IMAGES: usize = 40;

fn monte_carlo(args: &CompareArgs) -> Result<Verdict> {
    let place = args.place(&[MONTE_CARLO])?;
    let chain = read_chain(&args.urdf, args.base.as_deref(), args.tip.as_deref())?;
    let request = MonteCarloRequest {
        chain,
        seeds: args.seeds,
        images: MONTE_CARLO_IMAGES,
        joint_noise_rad: MONTE_CARLO_NOISE.to_vec(),
    };
    let bar = progress::bar(1, "noise levels");
    let cells = crate::study::monte_carlo(&request, |done, total| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    let text = monte_carlo_markdown(&cells, &command_of_report());
    say!("{text}");
    write(&place, [(MONTE_CARLO, text)])?;
    Ok(Verdict::Good)
}

/// Writes the files of a report and names the last of them.
fn write<const N: usize>(place: &ResultFolder, files: [(&str, String); N]) -> Result<()> {
    let listed = files.each_ref().map(|(name, text)| ((*name).to_owned(), text.as_bytes()));
    place.write_beside(&listed, &[])?;
    if let Some((name, _)) = files.last() {
        say_line!("report    {}", place.path().join(name).display());
    }
    Ok(())
}
