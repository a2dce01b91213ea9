//! `robotcal frames`: tool and work object of a robot that was identified, from touches.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;

use super::controller_base::controller_base;
use super::frames_text::text;
use super::zeros::{ReadingsArgs, Zeros};
use crate::assess::Limits;
use crate::cli::Verdict;
use crate::cli::flags::pose_argument::pose;
use crate::cli::results::show::read_solution;
use crate::cli::terminal::say::{self, say, say_line};
use crate::diagnose::Weight;
use crate::error::{Code, Error, Notice, Result, closest_name};
use crate::frames::{self, AsStated, FrameFit, Given, KnownRobot, TouchPlace, Touches, fit};
use crate::geom::{Pose, matrix_from_rpy};
use crate::identify::{NamedSeries, leave_out_repeated_bodies, measure_bodies, mirror_image, touch_mistake};
use crate::output::corrections::{FileFinding, untrusted};
use crate::output::frame_files::{self, Frames, Named};
use crate::output::frame_findings::{frame_findings, mirror_image_fits};
use crate::output::frames_record::{
    self, FILE_NAME, FORMAT, FramesRecord, KnowledgeRecord, RobotOfFrames, ToolKind, ToolRecord, TouchRecord, WorkKind,
    WorkRecord, checks, flat, rows,
};
use crate::output::restore::{FoundModel, chain, exported_model, markers_at, robot_description};
use crate::output::solution_json::SolutionRecord;
use crate::output::work_findings::{carried, from_below, other_frame};
use crate::output::{ResultFolder, folder_name, plan_files, touch_plan};
use crate::problem::MeasuredSeries;
use crate::series::{self, InputFile, JointsBeside, Series};
use crate::urdf::{RobotDescription, patch_origins};

/// Flags of `frames`.
#[derive(Debug, Args)]
pub struct FramesArgs {
    /// solution.json of the robot
    #[arg(long, value_name = "FILE")]
    from: PathBuf,
    /// Folder with series.toml, joints.csv and contacts.csv (or points.csv, poses.csv); several of them for several sessions with one tool
    #[arg(long, value_name = "FOLDER", num_args = 1.., required_unless_present = "plate")]
    touches: Vec<PathBuf>,
    /// The plate of the solution is the work object; of several placements this one. Touches of it are in its frame
    #[arg(long, value_name = "PLACEMENT", num_args = 0..=1, default_missing_value = "")]
    plate: Option<String>,
    /// The tool is known and not estimated: x,y,z[,roll,pitch,yaw] on the tip, m and degrees
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', allow_hyphen_values = true)]
    tool: Vec<f64>,
    /// Orientation of the tool that is written, where touches tell its point only: roll,pitch,yaw on the tip, degrees [default: that of the tip]
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', allow_hyphen_values = true, conflicts_with = "tool")]
    tool_rpy_deg: Vec<f64>,
    /// Name of the tool in what is written
    #[arg(long, value_name = "NAME", default_value = "tcp")]
    tool_name: String,
    /// Frame in which the controller computes, a link fixed beside the arm (`base` of ur_description): the work object is written in it, too
    #[arg(long, value_name = "LINK")]
    base: Option<String>,
    #[command(flatten)]
    readings: ReadingsArgs,
    /// Folder for frames.json, the programs and the URDF with both frames
    #[arg(long, value_name = "FOLDER", default_value = "frames")]
    out: PathBuf,
}

/// Touches with what they were read from.
struct Measured {
    touches: Touches,
    files: Vec<InputFile>,
    /// Their plans.
    plans: Vec<InputFile>,
    notices: Vec<Notice>,
    /// Stops with the joint values of a plan.
    as_planned: Vec<String>,
}

pub fn run(args: &FramesArgs) -> Result<Verdict> {
    let place = ResultFolder::among(&args.out)?.for_files(&[FILE_NAME])?;
    let record = read_solution(&args.from)?;
    let description = robot_description(&record)?;
    let found = exported_model(&record)?;
    let Measured { mut touches, files, plans, notices, as_planned } = read_touches(args, &record, &description)?;
    let nothing = touches.all.is_empty();
    let zeros = if nothing { args.readings.of_none()? } else { args.readings.of(&record, &files)? };
    zeros.iter().for_each(|zeros| touches.add(&zeros.missing));
    let placement = args.plate.as_ref().map(|name| placement_named(&record, name)).transpose()?;
    let moved = placement.map_or_else(Vec::new, |p| touches.move_to_found(&markers_at(&record, p)));
    let robot = found.known_robot(placement)?;
    let plate = placement.map(|p| Pose::from(&record.placements[p].pose));
    let tool = known_tool(args)?;
    if nothing {
        touches.bodies.push(args.tool_name.clone());
        touches.frame = placement.map(|p| record.placements[p].name.clone());
    }
    let tool_told = tool.is_some() || !nothing;
    let given = Given { tool: tool.or_else(|| nothing.then(Pose::identity)), plate };
    let fitted = fitted(args, (&robot, &touches), &given, (&found.limits, tool.is_some()))?;
    let subject = args.touches.first().unwrap_or(&args.from).display().to_string();
    let (limits, subject) = (&found.limits, subject.as_str());
    let judged = FittedFrames { robot: &robot, touches: &touches, given: &given, fit: &fitted, limits, subject };
    let mut findings = judged.findings(&record.robot.base, placement, &as_planned, zeros.as_ref());
    let frames = written(args, &record, &description, &fitted, &touches, tool_told)?;
    let poses = (Weight::Note, "robotcal_frames.script has the plane");
    let of_base = [record.robot.base.as_str(), record.robot.tip.as_str()];
    let in_own = args.base.is_none() && frames.work.is_some();
    findings.extend(in_own.then(|| controller_base(&description, of_base, poses)).flatten());
    let is_carried = carried(robot.exported(), frames.work.as_ref().map(|w| w.name.as_str()), subject);
    let work = frames.work.clone().filter(|_| is_carried.is_none());
    let of_controller = Frames { work, ..frames.clone() };
    findings.extend(is_carried);
    findings.extend(untrusted(&record, Weight::Gate, args.from.display()));
    let robot_record = robot_record(args, &record, &robot)?;
    let made = FramesRecord {
        inputs: files.into_iter().chain(plans).collect(),
        tool: tool_told.then(|| tool_record(args, &record, &fitted, &touches)),
        findings: findings.clone(),
        ..record_of((&fitted, &touches), robot_record, placement)
    };
    let in_base = in_the_base(&frames, &record, &fitted);
    let files = files_of((&of_controller, &in_base), &made, (&record, &found))?;
    let listed: Vec<(String, &[u8])> = files.iter().map(|(name, bytes)| (name.clone(), bytes.as_slice())).collect();
    place.write_beside(&listed, std::slice::from_ref(&args.from))?;
    say!("{}", text(&args.from, &made, &fitted, &touches, &robot));
    zeros.iter().for_each(|zeros| say_line!("{}", zeros.line()));
    say_moved(&moved, touches.all.len());
    notices.iter().for_each(|notice| say_line!("note      {}", notice.coded()));
    say::findings(&findings);
    say_line!("results   {} ({})", args.out.display(), files.keys().cloned().collect::<Vec<_>>().join(", "));
    Ok(if findings.iter().all(|f| f.weight == Weight::Note) { Verdict::Good } else { Verdict::GateFailed })
}

/// The fit; a tool of which the touches tell its point alone has the orientation that is given.
fn fitted(
    args: &FramesArgs,
    (robot, touches): (&KnownRobot, &Touches),
    given: &Given,
    (limits, tool_is_given): (&Limits, bool),
) -> Result<FrameFit> {
    let mut fitted = fit(robot, touches, given, limits).map_err(|e| named(e, args))?;
    if !touches.is_pose(0) && !tool_is_given {
        fitted.tools[0].rotation = orientation(args)?;
    }
    Ok(fitted)
}

/// The result by the names of its files: the frames as the controller takes them, the URDF with those in its base, and what was made.
fn files_of(
    (of_controller, in_base): (&Frames, &Frames),
    made: &FramesRecord,
    (record, found): (&SolutionRecord, &FoundModel),
) -> Result<BTreeMap<String, Vec<u8>>> {
    let mut files = frame_files::files(of_controller);
    let urdf = corrected_urdf(record, found, in_base)?;
    files.insert(format!("{}.frames.urdf", folder_name(std::slice::from_ref(&record.robot.name))), urdf.into_bytes());
    files.insert(FILE_NAME.into(), frames_record::to_bytes(made)?);
    Ok(files)
}

/// How many touches were brought to where the markers were found, and how far, m.
fn say_moved(moved: &[f64], touches: usize) {
    if let Some(farthest) = moved.iter().copied().reduce(f64::max) {
        let (count, mm) = (moved.len(), 1e3 * farthest);
        say_line!(
            "markers   {count} of {touches} touches are at nominal places of the plate: the markers count as found (plate.csv), up to {mm:.3} mm away"
        );
    }
}

/// Stops that are named.
const MOST_STOPS: usize = 5;

/// Frames that were fitted to touches, with what they are judged by.
struct FittedFrames<'a> {
    robot: &'a KnownRobot,
    touches: &'a Touches,
    given: &'a Given,
    fit: &'a FrameFit,
    limits: &'a Limits,
    /// What the findings are about.
    subject: &'a str,
}

impl FittedFrames<'_> {
    /// What is to be said of the fit.
    fn findings(
        &self,
        base: &str,
        placement: Option<usize>,
        as_planned: &[String],
        zeros: Option<&Zeros>,
    ) -> Vec<FileFinding> {
        let Self { robot, touches, given, fit, limits, subject } = *self;
        let mistake = touch_mistake(robot, touches, given, (fit, limits));
        let is_explained = mistake.is_some();
        // The plate of a solution counts by where it brings the tool: in the base it stands as uncertainly as the base itself, which no target sees.
        let work_covariance = if placement.is_some() { None } else { fit.work_covariance.clone() };
        let by_use = FrameFit { work_covariance, ..fit.clone() };
        let mut all = frame_findings((&by_use, mistake), touches, limits, subject);
        all.extend(placement.filter(|_| !is_explained).and_then(|_| self.plate_weak()));
        all.extend(self.computed(is_explained, as_planned));
        all.extend(other_frame(base, (fit, &work_name(touches)), limits, subject));
        all.extend(zeros.and_then(|zeros| self.other_zeros(zeros)));
        let mirrored = mirror_image(robot, touches, given, (fit, limits));
        all.extend(mirrored.map(|joints| mirror_image_fits(&joints, subject)));
        all.extend(from_below(robot.exported(), (fit, touches), limits, subject));
        all
    }

    /// The touches contradict the solution as their readings are taken, and do not the other way.
    fn other_zeros(&self, zeros: &Zeros) -> Option<FileFinding> {
        let Self { robot, touches, given, fit, limits, subject } = *self;
        let mut otherwise = touches.clone();
        otherwise.add(&zeros.instead());
        let factor = fit.contradiction(limits);
        let other = frames::fit(robot, &otherwise, given, limits).ok()?;
        let (other_factor, word) = (other.contradiction(limits), zeros.other());
        let text = format!(
            "the touches contradict the solution {factor:.1} times as far as they may with their readings as taken, and {other_factor:.1} times as those of the controller {word} the offsets of mastering.csv were entered: say --readings {word}"
        );
        let quantities = [("factor", factor), ("other_factor", other_factor)];
        let is_other = factor > limits.touch_factor && other_factor <= limits.touch_factor;
        is_other.then(|| FileFinding::new(Code::ReadingsOfOtherZeros, Weight::Gate, subject, quantities, text))
    }

    /// The tool is hardly known relative to the plate.
    fn plate_weak(&self) -> Option<FileFinding> {
        let sigma_mm = 1e3 * self.fit.expected.with_frames_m;
        let text = format!(
            "the tool relative to the plate is hardly told: {sigma_mm:.1} mm RMS expected over the stops of the solution and the touches; touch with the tip turned further, and markers further apart"
        );
        let is_weak = !self.touches.all.is_empty() && sigma_mm > self.limits.frame_sigma_mm;
        is_weak.then(|| FileFinding::new(Code::FrameWeak, Weight::Gate, self.subject, [("sigma_mm", sigma_mm)], text))
    }

    /// Touches that nobody made: with the joint values of a plan, or as exact as only computed ones are.
    fn computed(&self, is_explained: bool, as_planned: &[String]) -> Option<FileFinding> {
        let Self { fit, limits, subject, .. } = *self;
        let AsStated { size, freedom } = fit.as_stated;
        let is_exact = !is_explained && freedom >= limits.exact_touches_freedom && size < limits.exact_touches;
        let what = if as_planned.is_empty() {
            format!(
                "the touches fit {:.0} times better than their stated sigma and the joint noise let them ({:.4} mm RMS, {freedom} degrees of freedom): these are the joint values of a plan, or computed ones, not those at which the tool touched; write these into joints.csv (or correct sigma_m, if it is so much too large)",
                1.0 / size.max(f64::MIN_POSITIVE),
                1e3 * fit.rms_m
            )
        } else {
            format!(
                "{} of the stops have the joint values of plan.json to the last digit ({}{}): nobody jogged there; write those at which the tool touched into joints.csv, or take these rows out",
                as_planned.len(),
                as_planned.iter().take(MOST_STOPS).cloned().collect::<Vec<_>>().join(", "),
                if as_planned.len() > MOST_STOPS { ", .." } else { "" }
            )
        };
        let quantities = [
            ("size", size),
            ("freedom", freedom as f64),
            ("rms_mm", 1e3 * fit.rms_m),
            ("as_planned", as_planned.len() as f64),
        ];
        (is_exact || !as_planned.is_empty())
            .then(|| FileFinding::new(Code::TouchesExact, Weight::Gate, subject, quantities, what))
    }
}

/// The failure of the fit with the folders of the touches that it is about.
fn named(error: Error, args: &FramesArgs) -> Error {
    let folders: Vec<String> = args.touches.iter().map(|t| t.display().to_string()).collect();
    if folders.is_empty() { error } else { Error { place: folders.join(", "), ..error } }
}

fn read_touches(args: &FramesArgs, record: &SolutionRecord, description: &RobotDescription) -> Result<Measured> {
    if args.touches.is_empty() {
        return Ok(Measured {
            touches: Touches::default(),
            files: Vec::new(),
            plans: Vec::new(),
            notices: Vec::new(),
            as_planned: Vec::new(),
        });
    }
    let chain = chain(record, description, &record.robot.base, &record.robot.tip)?;
    let (mut all, mut files, mut notices, mut as_planned): (Vec<MeasuredSeries>, Vec<_>, Vec<_>, Vec<_>) =
        Default::default();
    let (mut plans, mut beside) = (Vec::new(), JointsBeside::default());
    for folder in &args.touches {
        holds_touches(folder)?;
        let s = series::read(folder)?;
        same_links(&s, record)?;
        let measured = measure_bodies(NamedSeries { series: &s, is_one_of_several: false }, &chain)?;
        beside.add(s.joints_beside(&chain));
        files.extend(s.inputs);
        notices.extend(measured.notices);
        let plan = folder.join(plan_files::FILE_NAME);
        if plan.is_file() {
            as_planned.extend(touch_plan::as_planned(&plan, &chain, touched(&measured.series))?);
            plans.push(InputFile::of_file(&plan)?);
        }
        all.push(measured.series);
    }
    notices.extend(leave_out_repeated_bodies(&mut all)?);
    let touches = Touches { beside, ..Touches::of(&all)? };
    Ok(Measured { touches, files, plans, notices, as_planned })
}

/// Stops at which something was touched, with their readings.
fn touched(series: &MeasuredSeries) -> impl Iterator<Item = (&str, &[f64])> {
    let is_touched = |k: usize| series.bodies.iter().any(|b| b.stop == k);
    let stops = series.stops.iter().enumerate().filter(move |(k, _)| is_touched(*k));
    stops.filter_map(|(_, stop)| Some((stop.image.as_str(), stop.readings.as_deref()?)))
}

/// A folder that has none of the files is another one than was meant.
fn holds_touches(folder: &Path) -> Result<()> {
    let names = series::SpatialFiles::NAMES;
    if !folder.join("series.toml").is_file() || names.iter().any(|name| folder.join(name).is_file()) {
        return Ok(());
    }
    let what = format!("has none of {}: nothing was touched or tracked", names.join(", "));
    let remedy = "write contacts.csv with the columns stop,contact,x_m,y_m,z_m";
    Err(Error::new(Code::FileMissing, folder.display(), what, remedy))
}

/// Base and tip that a series states are those of the solution.
fn same_links(s: &Series, record: &SolutionRecord) -> Result<()> {
    let stated = [("base", &s.manifest.base, &record.robot.base), ("tip", &s.manifest.tip, &record.robot.tip)];
    for (key, stated, of_solution) in stated {
        if let Some(link) = stated.as_ref().filter(|link| *link != of_solution) {
            let what = format!("{key} = \"{link}\", and the solution is of {key} \"{of_solution}\"");
            let remedy = format!(
                "the frames go with the robot of the solution: write {key} = \"{of_solution}\" or leave it out, or identify to this {key}"
            );
            return Err(Error::new(Code::SolutionDiffers, s.manifest_file().display(), what, remedy));
        }
    }
    Ok(())
}

fn placement_named(record: &SolutionRecord, name: &str) -> Result<usize> {
    let in_base: Vec<usize> = (0..record.placements.len())
        .filter(|&k| record.mount_of_placement(k) == Some(series::CameraMount::Hand))
        .collect();
    let names: Vec<&str> = in_base.iter().map(|&k| record.placements[k].name.as_str()).collect();
    let refuse = |what: String, remedy: String| Err(Error::new(Code::OptionRange, "--plate", what, remedy));
    if names.is_empty() {
        let what = "the solution has no plate that stands in the base".to_owned();
        return refuse(what, "give touches of the work object with --touches".into());
    }
    match names.iter().position(|n| *n == name) {
        Some(found) => Ok(in_base[found]),
        None if name.is_empty() && names.len() == 1 => Ok(in_base[0]),
        None if name.is_empty() => {
            refuse(format!("the plate stood at {} places", names.len()), format!("name one: {}", names.join(", ")))
        }
        None => {
            let meant =
                closest_name(name, names.iter().copied()).map_or_else(String::new, |m| format!("is \"{m}\" meant? "));
            refuse(
                format!("\"{name}\" is no placement in the base"),
                format!("{meant}its placements are {}", names.join(", ")),
            )
        }
    }
}

fn orientation(args: &FramesArgs) -> Result<nalgebra::Matrix3<f64>> {
    match *args.tool_rpy_deg {
        [] => Ok(nalgebra::Matrix3::identity()),
        [roll, pitch, yaw] => Ok(matrix_from_rpy([roll, pitch, yaw].map(f64::to_radians))),
        _ => {
            let what = format!("{} numbers", args.tool_rpy_deg.len());
            Err(Error::new(Code::OptionRange, "--tool-rpy-deg", what, "give roll,pitch,yaw in degrees"))
        }
    }
}

/// A tool that is not further away than any is, m.
const FARTHEST_TOOL_M: f64 = 10.0;

fn known_tool(args: &FramesArgs) -> Result<Option<Pose>> {
    let xyz = args.tool.iter().take(3);
    if xyz.clone().any(|v| v.abs() > FARTHEST_TOOL_M || !v.is_finite()) {
        let what = format!("a tool {:.0} m from the tip", xyz.fold(0.0, |m: f64, v| m.max(v.abs())));
        let remedy = "give x,y,z[,roll,pitch,yaw] on the tip, in metres and degrees";
        return Err(Error::new(Code::OptionRange, "--tool", what, remedy));
    }
    pose("--tool", &args.tool)
}

/// Name of a frame of places that has none.
const UNNAMED: &str = "work";

fn work_name(touches: &Touches) -> String {
    let name = touches.frame.as_deref().unwrap_or(UNNAMED);
    // What places are called whose frame `[contact]` does not name.
    if name == "contact" { UNNAMED.to_owned() } else { name.to_owned() }
}

/// The robot of the frames, by the solution that it comes from.
fn robot_record(args: &FramesArgs, record: &SolutionRecord, robot: &KnownRobot) -> Result<RobotOfFrames> {
    Ok(RobotOfFrames {
        solution: InputFile::of_file(&args.from)?,
        name: record.robot.name.clone(),
        base: record.robot.base.clone(),
        tip: record.robot.tip.clone(),
        checks: checks(robot),
    })
}

/// What was fitted, without inputs, tool and findings.
fn record_of((fit, touches): (&FrameFit, &Touches), robot: RobotOfFrames, placement: Option<usize>) -> FramesRecord {
    FramesRecord {
        format: FORMAT,
        version: env!("CARGO_PKG_VERSION").into(),
        command: std::env::args().collect::<Vec<_>>().join(" "),
        inputs: Vec::new(),
        tool: None,
        work: fit.work.as_ref().map(|pose| WorkRecord {
            name: work_name(touches),
            parent: robot.base.clone(),
            measured: if placement.is_some() { WorkKind::Plate } else { WorkKind::Measured },
            pose: pose.into(),
            covariance: fit.work_covariance.as_ref().map_or_else(Vec::new, flat),
        }),
        robot,
        sigma_factor: fit.factor,
        rms_m: fit.rms_m,
        expected: fit.expected,
        touches: touch_records(fit, touches),
        findings: Vec::new(),
        knowledge: KnowledgeRecord {
            placement,
            frames: rows(&fit.knowledge.frames),
            cross: rows(&fit.knowledge.cross),
            learned: fit.knowledge.learned.as_slice().to_vec(),
            taken: fit.knowledge.taken.as_slice().to_vec(),
        },
    }
}

fn tool_record(args: &FramesArgs, record: &SolutionRecord, fit: &FrameFit, touches: &Touches) -> ToolRecord {
    let measured = match &fit.tool_covariances[0] {
        None if args.tool.len() == 3 => ToolKind::GivenPoint,
        None => ToolKind::Given,
        Some(_) if touches.is_pose(0) => ToolKind::Pose,
        Some(_) => ToolKind::Point,
    };
    ToolRecord {
        name: args.tool_name.clone(),
        parent: record.robot.tip.clone(),
        measured,
        pose: (&fit.tools[0]).into(),
        covariance: fit.tool_covariances[0].as_ref().map(flat),
    }
}

fn touch_records(fit: &FrameFit, touches: &Touches) -> Vec<TouchRecord> {
    let record = |(t, judged): (&crate::frames::Touch, &crate::frames::Judged)| {
        let (at, place) = match t.seen {
            TouchPlace::Point(place) => (work_name(touches), place),
            TouchPlace::Pose(pose) => (work_name(touches), pose.translation),
            TouchPlace::Unknown(contact) => (touches.contacts[contact].clone(), fit.places[contact]),
        };
        TouchRecord {
            stop: t.stop.clone(),
            body: touches.bodies[t.body].clone(),
            at,
            place_m: place.into(),
            sigma_m: t.sigma_m,
            residual_m: judged.residual_m.into(),
            sigmas: judged.sigmas,
            left_out: judged.left_out,
        }
    };
    touches.all.iter().zip(&fit.judged).map(record).collect()
}

/// Frames as controllers take them: the work object in the frame that it computes in.
fn written(
    args: &FramesArgs,
    record: &SolutionRecord,
    description: &RobotDescription,
    fit: &FrameFit,
    touches: &Touches,
    tool_told: bool,
) -> Result<Frames> {
    let own = &record.robot.base;
    let base = args.base.as_ref().unwrap_or(own);
    let own_from_base = match base == own {
        true => Pose::identity(),
        false => match description.fixed_base(base, &record.robot.tip) {
            Some((link, pose)) if link == own => pose,
            _ => {
                let what = format!("\"{base}\" is not fixed on \"{own}\", the base of the solution");
                return Err(Error::new(Code::LinkUnknown, "--base", what, "name a link that fixed joints tie to it"));
            }
        },
    };
    let work = fit.work.map(|pose| Named { name: work_name(touches), pose: own_from_base.inverse() * pose });
    Ok(Frames {
        tip: record.robot.tip.clone(),
        base: base.clone(),
        tool: tool_told.then(|| Named { name: args.tool_name.clone(), pose: fit.tools[0] }),
        work,
        payload: record.robot.payload,
    })
}

/// The same in the base of the solution, as the URDF has it.
fn in_the_base(frames: &Frames, record: &SolutionRecord, fit: &FrameFit) -> Frames {
    let work = frames.work.as_ref().zip(fit.work).map(|(w, pose)| Named { name: w.name.clone(), pose });
    Frames { base: record.robot.base.clone(), work, ..frames.clone() }
}

fn corrected_urdf(record: &SolutionRecord, found: &FoundModel, frames: &Frames) -> Result<String> {
    let origins = found.robot.urdf_origins().into_iter().map(|(joint, origin)| (joint.to_owned(), origin)).collect();
    frame_files::urdf(&patch_origins(&record.urdf.text, &origins)?, frames)
}

#[cfg(test)]
mod tests {
    use super::placement_named;
    use crate::error::Code;
    use crate::output::solution_json::SolutionRecord;

    #[test]
    fn a_plate_on_the_tip_is_no_work_object() {
        let record = SolutionRecord::with_both_mounts();
        assert_eq!(placement_named(&record, "").unwrap(), 0);
        assert_eq!(placement_named(&record, "placement_0").unwrap(), 0);
        assert_eq!(placement_named(&record, "carried").unwrap_err().code, Code::OptionRange);
    }
}
