//! `robotcal identify`: series in, corrected robot out.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::at::AtArgs;
use super::choices::{ChoiceArgs, in_words};
use super::recording::{Pictures, RecordingArgs};
use super::say::{say, say_line};
use super::show::read_solution;
use super::{Verdict, progress, summary};
use crate::error::{Error, Notice, Result};
use crate::identify::{Estimator, Options};
use crate::output::solution_json::{self, FILE_NAME};
use crate::output::{self, Context, Offsets, Place, Poses, folder_name, recover, restore};
use crate::problem::{LensChoice, MeasuredSeries};
use crate::series::{self, InputFile, Series};
use crate::urdf::{self, Chain, RobotDescription};

/// Flags of `identify`.
#[derive(Debug, Args)]
pub(super) struct IdentifyArgs {
    /// Robot description (URDF)
    #[arg(long, value_name = "FILE", required_unless_present = "from")]
    urdf: Option<PathBuf>,
    /// Series folder or recording (.mcap, rosbag2 folder); give it several times to fit several series of the same robot together
    #[arg(long, value_name = "FOLDER", required_unless_present = "from")]
    series: Vec<PathBuf>,
    /// Solve again from an earlier solution.json alone, with other options
    #[arg(long, value_name = "SOLUTION", conflicts_with_all = ["urdf", "series", "dry_run"], requires = "out")]
    from: Option<PathBuf>,
    /// Only say what the stops of the series can tell of the robot, and what to add; no image is looked at
    #[arg(long)]
    dry_run: bool,
    /// Folder for the results [default: reports/<series name>]
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Base link (overrides series.toml)
    #[arg(long, value_name = "LINK")]
    base: Option<String>,
    /// Tip link that carries camera or plate (overrides series.toml)
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// Lens: auto (the simplest of all that none beats decisively by the evidence of the joint fit), brown, fisheye, parallax, rational, thin_prism, brown+field or fisheye+field [default: as in series.toml, else by evidence among those that camera.yaml can express]
    #[arg(long, value_name = "LENS")]
    camera: Option<String>,
    /// Where joint offsets go
    #[arg(long, value_enum, default_value_t = OffsetsName::Folded)]
    offsets: OffsetsName,
    /// Fit in two stages (camera poses first, the robot from the poses) instead of jointly; `compare` says what each would reach
    #[arg(long, value_enum, value_name = "ESTIMATOR", ignore_case = true, conflicts_with = "dry_run")]
    two_stage: Option<TwoStage>,
    /// Also write the stand-alone camera poses (poses.csv)
    #[arg(long)]
    poses: bool,
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
    /// Into mastering.csv, for the controller; the origins are without them
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

/// What is solved.
struct Task {
    description: RobotDescription,
    chain: Chain,
    measured: Vec<MeasuredSeries>,
    notices: Vec<Notice>,
    inputs: Vec<InputFile>,
    /// How an earlier solution was fitted.
    estimator: Estimator,
}

pub(super) fn run(args: &IdentifyArgs) -> Result<Verdict> {
    let options = args.choices.options()?;
    // Tried before the work that the result costs.
    let mut place = args.out.as_deref().filter(|_| !args.dry_run).map(Place::claim).transpose()?;
    let task = match (&args.from, &args.urdf) {
        (Some(solution), _) => again(args, solution)?,
        (None, Some(urdf)) => {
            let description = urdf::read(urdf)?;
            let all = read_all(&args.series)?;
            let chain = chain(&description, &all, args.base.as_deref(), args.tip.as_deref())?;
            if place.is_none() && !args.dry_run {
                let names: Vec<String> = all.iter().map(|s| s.name.clone()).collect();
                place = Some(Place::claim(&Path::new("reports").join(folder_name(&names)))?);
            }
            let pictures = Pictures::new();
            let all = pictures.of_recordings(all, &args.recording.options(&chain.readings)?)?;
            if args.dry_run {
                if let Some(notice) = tip_notice(&description, &all, args.base.as_deref(), args.tip.as_deref())? {
                    say_line!("note      {notice}");
                }
                say!("{}", summary::of_stops(&crate::identify::dry_run(chain, &all, &options)?));
                return Ok(Verdict::Good);
            }
            let mut notices = description.notices.clone();
            notices.extend(tip_notice(&description, &all, args.base.as_deref(), args.tip.as_deref())?);
            let inputs = inputs(urdf, &description, &all)?;
            let measured = measure_all(&all, &chain, &mut notices)?;
            all.iter().try_for_each(|s| require_unchanged(&inputs, &s.image_hashes()?))?;
            Task { inputs, estimator: Estimator::Joint, description, chain, measured, notices }
        }
        (None, None) => {
            return Err(Error::input("identify", "no robot is given", "give --urdf and --series, or --from"));
        }
    };
    let place = place.ok_or_else(|| Error::input("identify", "no folder for the results is given", "give --out"))?;
    let estimator = args.two_stage.map_or(task.estimator, Into::into);
    solve(args, &Options { estimator, ..options }, task, place)
}

/// The task of an earlier solution.
fn again(args: &IdentifyArgs, path: &Path) -> Result<Task> {
    let record = read_solution(path)?;
    let description = restore::robot_description(&record)?;
    let base = args.base.as_deref().unwrap_or(&record.robot.base);
    let tip = args.tip.as_deref().unwrap_or(&record.robot.tip);
    let chain = restore::chain(&record, &description, base, tip)?;
    if chain.readings != record.robot.readings {
        let what = format!("is of the joints {}", record.robot.readings.join(", "));
        return Err(Error::input(path.display(), what, "choose --base and --tip with the same joints between them"));
    }
    let mut inputs = record.inputs.clone();
    inputs.push(InputFile::of_file(path)?);
    let notices = description.notices.clone();
    let estimator = record.estimator;
    Ok(Task { chain, estimator, measured: restore::measured_series(&record)?, notices, inputs, description })
}

fn solve(args: &IdentifyArgs, options: &Options, task: Task, place: Place) -> Result<Verdict> {
    let Task { description, chain, mut measured, mut notices, inputs, .. } = task;
    match args.camera.as_deref() {
        Some("auto") => measured.iter_mut().for_each(|s| s.lens_choice = LensChoice::All),
        Some(name) => {
            let lens = super::simulate::lens(name)?;
            measured.iter_mut().for_each(|s| (s.lens, s.lens_choice) = (lens, LensChoice::Settled));
        }
        None => {}
    }
    let mut solution = crate::identify::identify(chain, &measured, options)?;
    solution.two_stage = crate::identify::beside_two_stages(&solution);
    notices.append(&mut solution.notices);
    solution.notices = notices;
    let names: Vec<String> = measured.iter().map(|s| s.name.clone()).collect();
    let context = Context {
        robot: &description,
        robot_name: &description.name,
        series: names,
        inputs,
        options: in_words(options),
        command: super::command_line().join(" "),
        offsets: args.offsets.into(),
        poses: if args.poses { Poses::Written } else { Poses::LeftOut },
    };
    let files = output::files(&solution, &context)?;
    let folder = place.path().to_path_buf();
    place.write_all(&files)?;
    // What is printed is what `show` prints: it comes from the file.
    let record = files.get(FILE_NAME).map_or(&[][..], Vec::as_slice);
    let record = solution_json::read(record)?;
    say!("{}", summary::text(&record));
    say!("{}", args.at.run(&record, &folder)?);
    say_line!("results   {} ({} files)", folder.display(), files.len());
    Ok(if solution.failed_gates.is_empty() { Verdict::Good } else { Verdict::GateFailed })
}

/// All files with the hashes of what was read, or is about to be.
fn inputs(urdf: &Path, description: &RobotDescription, all: &[Series]) -> Result<Vec<InputFile>> {
    let mut inputs = vec![InputFile::of_bytes(urdf, description.text.as_bytes())];
    for s in all {
        inputs.extend(s.inputs.iter().cloned());
        inputs.extend(s.image_hashes()?);
    }
    Ok(inputs)
}

/// The hashes in a result are those of what was looked at: a file must be the same before and after.
pub(super) fn require_unchanged(before: &[InputFile], after: &[InputFile]) -> Result<()> {
    let is_changed = |a: &&InputFile| before.iter().any(|b| b.path == a.path && b.sha256 != a.sha256);
    after.iter().find(is_changed).map_or(Ok(()), |changed| {
        let remedy = "wait until nothing writes to the series any more, then run again";
        Err(Error::input(changed.path.display(), "changed while it was looked at", remedy))
    })
}

pub(super) fn read_all(folders: &[PathBuf]) -> Result<Vec<Series>> {
    let mut all: Vec<Series> = Vec::new();
    for folder in folders {
        recover(&folder.join("series.toml"))?;
        let s = series::read(folder)?;
        if let Some(twin) = all.iter().find(|a| a.name == s.name) {
            return Err(Error::input(
                folder.display(),
                format!("is named '{}' like the series in {}", s.name, twin.folder.display()),
                "give every series folder a name of its own, and each series only once",
            ));
        }
        all.push(s);
    }
    Ok(all)
}

pub(super) fn chain(
    description: &RobotDescription,
    all: &[Series],
    base: Option<&str>,
    tip: Option<&str>,
) -> Result<Chain> {
    let base = agreed("base", base, all, |s| s.manifest.base.as_deref())?;
    let tip = agreed("tip", tip, all, |s| s.manifest.tip.as_deref())?;
    description.chain(base, tip)
}

/// What to say where the tip was chosen among several leaves.
fn tip_notice(
    description: &RobotDescription,
    all: &[Series],
    base: Option<&str>,
    tip: Option<&str>,
) -> Result<Option<Notice>> {
    let base = agreed("base", base, all, |s| s.manifest.base.as_deref())?;
    let tip = agreed("tip", tip, all, |s| s.manifest.tip.as_deref())?;
    Ok(description.tip_notice(base, tip))
}

/// A link that the flag or the manifests name; they must agree.
fn agreed<'a>(
    what: &str,
    flag: Option<&'a str>,
    all: &'a [Series],
    of: impl Fn(&'a Series) -> Option<&'a str>,
) -> Result<Option<&'a str>> {
    if flag.is_some() {
        return Ok(flag);
    }
    let mut named = all.iter().filter_map(|s| of(s).map(|link| (s, link)));
    let Some((first, link)) = named.next() else { return Ok(None) };
    match named.find(|(_, other)| *other != link) {
        None => Ok(Some(link)),
        Some((second, other)) => Err(Error::input(
            second.folder.join("series.toml").display(),
            format!("{what} = \"{other}\", while {} has {what} = \"{link}\"", first.name),
            format!("series of one robot share base and tip: correct one, or give --{what}"),
        )),
    }
}

pub(super) fn measure_all(all: &[Series], chain: &Chain, notices: &mut Vec<Notice>) -> Result<Vec<MeasuredSeries>> {
    let mut measured = Vec::new();
    for s in all {
        let bar = progress::bar(s.stops.stops.len(), &s.name);
        let m = crate::identify::measure(s, chain, all.len() > 1, |_| bar.inc(1))?;
        bar.finish_and_clear();
        notices.extend(m.notices);
        measured.push(m.series);
    }
    Ok(measured)
}
