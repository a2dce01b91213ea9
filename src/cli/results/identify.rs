//! `robotcal identify`: series in, corrected robot out.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde::Deserialize;

use super::at::{AtArgs, AtTable};
use super::show::{read_solution, read_solution_with_bytes, solution_file};
use super::{long_table, summary};
use crate::calibration::{Calibration, Ends, Export, Inputs, Observed};
use crate::cli::Verdict;
use crate::cli::flags::camera_args::CameraArgs;
use crate::cli::flags::choices::ChoiceArgs;
use crate::cli::flags::recording::RecordingArgs;
use crate::cli::terminal::say::{say, say_line};
use crate::cli::terminal::{progress, stages};
use crate::error::{Code, Error, Notice, Result};
use crate::identify::{Estimator, Options, dry_run};
use crate::output::solution_json::{FILE_NAME, TIMINGS};
use crate::output::{Offsets, Poses, REPORT, ResultFolder, folder_name, restore};
use crate::series::InputFile;

/// Flags of `identify`.
#[derive(Debug, Args)]
pub struct IdentifyArgs {
    /// Robot description (URDF); without it a series of controller poses (controller.csv) calibrates camera, hand-eye transform and plate alone
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// Series folder or recording (.mcap, rosbag2 folder); several of them to fit several series of the same robot together
    #[arg(long, value_name = "FOLDER", num_args = 1.., required_unless_present = "from")]
    series: Vec<PathBuf>,
    /// Solve again from an earlier solution.json alone: with its options, or with those given
    #[arg(long, value_name = "SOLUTION", conflicts_with_all = ["urdf", "series", "dry_run"], requires = "out")]
    from: Option<PathBuf>,
    /// Only say what the stops of the series can tell of the robot, and what to add; no image is looked at
    #[arg(long)]
    dry_run: bool,
    /// Folder for the results [default: reports/<series name>]
    #[arg(long, value_name = "FOLDER", help_heading = "What is written")]
    out: Option<PathBuf>,
    /// Base link (overrides series.toml)
    #[arg(long, value_name = "LINK", help_heading = "Robot")]
    base: Option<String>,
    /// Tip link that carries camera or plate (overrides series.toml)
    #[arg(long, value_name = "LINK", help_heading = "Robot")]
    tip: Option<String>,
    /// Where joint offsets go
    #[arg(long, value_enum, default_value_t = OffsetsName::Folded, help_heading = "What is written")]
    offsets: OffsetsName,
    /// Two-step calibration (camera poses first, the robot from the poses) instead of the joint fit; `compare` says what each would reach
    #[arg(
        long,
        value_enum,
        value_name = "ESTIMATOR",
        ignore_case = true,
        conflicts_with = "dry_run",
        help_heading = "What is estimated"
    )]
    two_stage: Option<TwoStage>,
    /// Also write the stand-alone camera poses (poses.csv)
    #[arg(long, help_heading = "What is written")]
    poses: bool,
    /// Print solution.json and nothing else
    #[arg(long, conflicts_with_all = ["dry_run", "at"], help_heading = "What is written")]
    json: bool,
    #[command(flatten)]
    cameras: CameraArgs,
    #[command(flatten)]
    choices: ChoiceArgs,
    #[command(flatten)]
    at: AtArgs,
    #[command(flatten)]
    recording: RecordingArgs,
}

/// Names of the ways for joint offsets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum OffsetsName {
    /// Into the origins: controller angles stay as they are
    Folded,
    /// Those that are determined into mastering.csv, for the controller; the origins are without them, and hold the others
    Mastering,
}

impl From<OffsetsName> for Offsets {
    fn from(name: OffsetsName) -> Self {
        match name {
            OffsetsName::Folded => Self::Folded,
            OffsetsName::Mastering => Self::Mastering,
        }
    }
}

/// Letters of the two-stage estimators, as in the tables of `compare`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum TwoStage {
    /// One variance for the positions of the camera poses and one for their rotations, from the data
    A,
    /// The 6x6 covariance of every pose, with a common factor from the data
    B,
    /// The 6x6 covariance of every pose, and joint noise
    C,
    /// The covariance of all poses together, and joint noise
    D,
}

impl From<TwoStage> for Estimator {
    fn from(letter: TwoStage) -> Self {
        match letter {
            TwoStage::A => Self::Isotropic,
            TwoStage::B => Self::Blocks,
            TwoStage::C => Self::BlocksAndRepeatability,
            TwoStage::D => Self::FullAndRepeatability,
        }
    }
}

pub fn run(args: &IdentifyArgs) -> Result<Verdict> {
    let claim = |folder: &Path| args.at.place(ResultFolder::claim(folder, FILE_NAME)?);
    // Tried before the work that the result costs.
    let mut place = args.out.as_deref().filter(|_| !args.dry_run).map(claim).transpose()?;
    let from = args.from.as_deref().map(solution_file);
    let earlier = from.as_deref().map(read_solution).transpose()?;
    let options = args.choices.options(earlier.as_ref().map_or_else(Options::default, restore::options))?;
    let ends = Ends { base: args.base.as_deref(), tip: args.tip.as_deref() };
    let mut at = None;
    let mut observed = match (earlier.as_ref().zip(from.as_deref()), &args.urdf) {
        (Some((record, path)), _) => Observed::of_record(record, path, ends)?,
        (None, urdf) => {
            let inputs = match urdf {
                Some(urdf) => Inputs::read(urdf, &args.series, ends)?,
                None => Inputs::without_robot(&args.series)?,
            };
            if args.dry_run {
                return say_dry_run(args, inputs, &options);
            }
            if place.is_none() {
                let names: Vec<String> = inputs.series.iter().map(|s| s.name.clone()).collect();
                place = Some(claim(&Path::new("reports").join(folder_name(&names)))?);
            }
            at = args.at.table(&inputs.chain)?;
            let inputs = inputs.with_recordings(&args.recording.options(&[])?)?;
            if let (Some(unnamed), None) = (&place, &args.out) {
                require_same_series(unnamed.path(), &args.series, &inputs)?;
            }
            inputs.observe(&options.limits, &progress::of_series())?
        }
    };
    if at.is_none() {
        at = args.at.table(&observed.chain)?;
    }
    let place = place.ok_or_else(|| {
        Error::new(Code::OptionMissing, "identify", "no folder for the results is given", "give --out")
    })?;
    let estimator = args.two_stage.map_or(options.estimator, Into::into);
    let of_cameras = args.cameras.apply(&mut observed.series)?;
    observed.notices.extend(of_cameras);
    let noticed = observed.notices.clone();
    // A refusal says nothing of what was noticed before, which may be its cause.
    let calibration = Calibration::of(observed, &Options { estimator, ..options })
        .inspect_err(|_| Notice::said_once(&noticed).iter().for_each(|n| tracing::warn!("{}", n.coded())))?;
    write(args, calibration, place, at.as_ref())
}

/// What the stops can tell before any image is looked at.
fn say_dry_run(args: &IdentifyArgs, inputs: Inputs, options: &Options) -> Result<Verdict> {
    let inputs = inputs.with_recordings(&args.recording.options(&[])?)?;
    inputs.tip_notice.iter().for_each(|notice| say_line!("note      {}", notice.coded()));
    say!("{}", long_table::of_stops(&dry_run(inputs.chain, &inputs.series, options)?));
    Ok(Verdict::Good)
}

/// Refuses to replace, in a folder that nobody named, the result of another robot or of other series of the same names. A series is the same where it
/// stands where it stood, or where its files have the hashes that are recorded.
fn require_same_series(folder: &Path, given: &[PathBuf], inputs: &Inputs) -> Result<()> {
    #[derive(Deserialize)]
    struct Earlier {
        robot: Robot,
        inputs: Vec<InputFile>,
    }
    #[derive(Deserialize)]
    struct Robot {
        name: String,
    }
    let bytes = std::fs::read(folder.join(FILE_NAME)).unwrap_or_default();
    let Ok(earlier) = serde_json::from_slice::<Earlier>(&bytes) else { return Ok(()) };
    let refused = |what: String| {
        Err(Error::new(Code::OutputExists, folder.display(), what, "name a folder for this result with --out"))
    };
    if earlier.robot.name != inputs.chain.robot {
        return refused(format!("holds the result of another robot, {}", earlier.robot.name));
    }
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    let paths: Vec<PathBuf> = earlier.inputs.iter().map(|file| real(&file.path)).collect();
    let hashes: BTreeSet<&str> = earlier.inputs.iter().map(|file| file.sha256.as_str()).collect();
    for (path, s) in given.iter().zip(&inputs.series) {
        let stands_there = paths.iter().any(|file| file.starts_with(real(path)));
        let is_known = |file: &InputFile| hashes.contains(file.sha256.as_str());
        let is_same = stands_there || s.inputs.iter().all(is_known) && s.image_hashes()?.iter().all(is_known);
        if !is_same {
            return refused(format!("holds the result of other series than {}", path.display()));
        }
    }
    Ok(())
}

fn write(
    args: &IdentifyArgs,
    calibration: Calibration,
    place: ResultFolder,
    at: Option<&AtTable<'_>>,
) -> Result<Verdict> {
    let poses = if args.poses { Poses::Written } else { Poses::LeftOut };
    let command = crate::cli::command_text();
    let folder = place.path().to_path_buf();
    let result = place.begin()?;
    calibration.write(&Export { offsets: args.offsets.into(), poses, command }, &result)?;
    drop(calibration);
    if stages::are_told() {
        result.put(TIMINGS, &stages::timings())?;
    }
    result.finish()?;
    // What is printed is what `show` prints: it comes from the file.
    let (record, bytes) = read_solution_with_bytes(&folder)?;
    match (args.json, stages::are_told()) {
        (true, _) => say!("{}", String::from_utf8_lossy(&bytes)),
        (_, true) => say!("{}", long_table::text(&record)),
        _ => say!("{}", summary::text(&record, &folder, &folder.join(REPORT))),
    }
    if let Some(at) = at {
        say!("{}", at.run(&record, &folder)?);
    }
    if stages::are_told() && !args.json {
        // The times of the stages go with the result.
        say_line!("results   {} ({} files)", folder.display(), record.files.len() + 1);
    }
    Ok(if record.failed_gates.is_empty() { Verdict::Good } else { Verdict::GateFailed })
}
