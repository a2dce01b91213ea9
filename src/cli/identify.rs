//! `robotcal identify`: series in, corrected robot out.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::recording::{Pictures, RecordingArgs};
use super::{Verdict, progress, summary};
use crate::error::{Error, Notice, Result};
use crate::output::{self, Context, Offsets, Poses};
use crate::recipe::{self, JointNoise, MeasuredSeries, Options, RobotModel};
use crate::series::{self, InputFile, Series};
use crate::urdf::{self, Chain, RobotDescription};

/// Flags of `identify`.
#[derive(Debug, Args)]
pub(super) struct IdentifyArgs {
    /// Robot description (URDF)
    #[arg(long, value_name = "FILE")]
    urdf: PathBuf,
    /// Series folder or recording (.mcap, rosbag2 folder); give it several times to fit several series of the same robot together
    #[arg(long, value_name = "FOLDER", required = true)]
    series: Vec<PathBuf>,
    /// Folder for the results [default: reports/<series name>]
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Base link (overrides series.toml)
    #[arg(long, value_name = "LINK")]
    base: Option<String>,
    /// Tip link that carries camera or plate (overrides series.toml)
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// Joint noise in rad (m for a prismatic joint) instead of the estimate; 0 takes the readings as exact
    #[arg(long, value_name = "SIGMA")]
    joint_noise: Option<f64>,
    /// Joint terms beside rigid geometry and offsets
    #[arg(long, value_enum, default_value_t = Model::Full)]
    robot_model: Model,
    /// Lens: auto (by hold-out, says why), brown, fisheye, parallax, rational or thin_prism [default: as in series.toml, else brown]
    #[arg(long, value_name = "LENS")]
    camera: Option<String>,
    /// Where joint offsets go
    #[arg(long, value_enum, default_value_t = OffsetsName::Folded)]
    offsets: OffsetsName,
    /// Also write the stand-alone camera poses (poses.csv)
    #[arg(long)]
    poses: bool,
    #[command(flatten)]
    recording: RecordingArgs,
}

/// Names of the robot models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Model {
    /// Link geometry and joint offsets
    Rigid,
    /// Also gear scale and two harmonics
    Gear,
    /// Also gravity and backlash
    Full,
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

impl From<Model> for RobotModel {
    fn from(model: Model) -> Self {
        match model {
            Model::Rigid => Self::Rigid,
            Model::Gear => Self::Gear,
            Model::Full => Self::Full,
        }
    }
}

pub(super) fn run(args: &IdentifyArgs) -> Result<Verdict> {
    let options = Options { joint_noise: joint_noise(args.joint_noise)?, model: args.robot_model.into() };
    let description = urdf::read(&args.urdf)?;
    let all = read_all(&args.series)?;
    let chain = chain(&description, &all, args.base.as_deref(), args.tip.as_deref())?;
    let pictures = Pictures::new();
    let all = pictures.of_recordings(all, &args.recording.options(&chain.readings)?)?;
    let mut notices = description.notices.clone();
    let mut measured = measure_all(&all, &chain, &mut notices)?;
    match args.camera.as_deref() {
        None => {}
        Some("auto") => notices.extend(recipe::choose_lens(&chain, &mut measured)?),
        Some(name) => {
            let lens = super::simulate::lens(name)?;
            measured.iter_mut().for_each(|s| s.lens = lens);
        }
    }
    let mut solution = recipe::identify(chain, &measured, &options)?;
    notices.append(&mut solution.notices);
    solution.notices = notices;
    let names: Vec<String> = all.iter().map(|s| s.name.clone()).collect();
    let folder = args.out.clone().unwrap_or_else(|| Path::new("reports").join(names.join("+")));
    let context = Context {
        robot: &description,
        robot_name: &description.name,
        series: names,
        inputs: inputs(args, &all)?,
        options: in_words(args),
        command: std::env::args().collect::<Vec<_>>().join(" "),
        offsets: args.offsets.into(),
        poses: if args.poses { Poses::Written } else { Poses::LeftOut },
    };
    let files = output::files(&solution, &context)?;
    output::write_all(&folder, &files)?;
    print!("{}", summary::text(&solution, &measured));
    println!("results   {} ({} files)", folder.display(), files.len());
    Ok(if solution.failed_gates.is_empty() { Verdict::Good } else { Verdict::GateFailed })
}

fn inputs(args: &IdentifyArgs, all: &[Series]) -> Result<Vec<InputFile>> {
    let mut inputs = vec![InputFile::of_file(&args.urdf)?];
    for s in all {
        inputs.extend(s.inputs.iter().cloned());
        inputs.extend(s.image_hashes()?);
    }
    Ok(inputs)
}

fn in_words(args: &IdentifyArgs) -> Vec<(String, String)> {
    let joint_noise = args.joint_noise.map_or("estimated".to_owned(), |s| format!("{s} rad"));
    let robot_model = args.robot_model.to_possible_value().map_or_else(String::new, |v| v.get_name().to_owned());
    vec![("joint noise".to_owned(), joint_noise), ("robot model".to_owned(), robot_model)]
}

fn joint_noise(sigma: Option<f64>) -> Result<JointNoise> {
    match sigma {
        None => Ok(JointNoise::Estimated),
        Some(s) if (0.0..0.1).contains(&s) => Ok(JointNoise::Known(s)),
        Some(s) => Err(Error::input(
            "--joint-noise",
            format!("{s} is no joint noise in rad"),
            "give 0 for exact readings or a value like 0.00005 (0.05 mrad)",
        )),
    }
}

pub(super) fn read_all(folders: &[PathBuf]) -> Result<Vec<Series>> {
    let mut all: Vec<Series> = Vec::new();
    for folder in folders {
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
        let m = recipe::measure(s, chain, all.len() > 1, |_| bar.inc(1))?;
        bar.finish_and_clear();
        notices.extend(m.notices);
        measured.push(m.series);
    }
    Ok(measured)
}
