//! `robotcal compensate`: a program made for the nominal robot, corrected for the real one.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};

use super::compensate_frames::{Choice, Side, Sides, Solutions, known_error};
use super::compensate_models::{corrected_already, equal, exchanged, not_given};
use super::controller_base::controller_base;
use crate::cli::Verdict;
use crate::cli::flags::joint_table::Unit;
use crate::cli::flags::robot::noted_chain;
use crate::cli::terminal::say::{self, say, say_line};
use crate::diagnose::Weight;
use crate::error::{Code, Error, Result};
use crate::files;
use crate::geom::Pose;
use crate::model::joint_terms::Term;
use crate::model::robot::Robot;
use crate::output::corrections::{self, FileFinding, Meant, TABLE, untrusted};
use crate::output::written_programs::{OfOthers, RunFinding, WrittenProgram, require_same_source, seen_from};
use crate::output::{ResultFolder, compensated};
use crate::programs::compensate::Compensated;
use crate::programs::{
    self, Correction, Language, Left, Models, Postures, Program, ProgramSetting, Target, TargetKind, TargetOutcome,
    TextFile,
};
use crate::series::AngleUnit;
use crate::urdf::{self, Chain, JointKind, RobotDescription};

/// Flags of `compensate`.
#[derive(Debug, Args)]
pub struct CompensateArgs {
    /// Program files of one language that belong together: tables (.csv), KRL (.src, .dat), RAPID (.mod, .modx, .prg, .sys) or URScript (.script, .urscript)
    #[arg(value_name = "PROGRAM", required = true)]
    programs: Vec<PathBuf>,
    /// Robot description by which the controller computes, and for which the program was made unless --from names another; with --from it is needed for poses only
    #[arg(long, value_name = "FILE", required_unless_present = "from")]
    nominal: Option<PathBuf>,
    /// Robot description of the robot that runs the program (a corrected URDF)
    #[arg(long, visible_alias = "to", value_name = "FILE")]
    urdf: PathBuf,
    /// Its compensation.toml: gear scale, harmonics, gravity and backlash, which a URDF cannot hold
    #[arg(long, visible_alias = "to-compensation", value_name = "FILE")]
    compensation: Option<PathBuf>,
    /// Retarget: robot description of the robot on which the program was taught [default: the nominal one]
    #[arg(long, value_name = "FILE", help_heading = "Retargeting")]
    from: Option<PathBuf>,
    /// compensation.toml of the robot on which the program was taught
    #[arg(long, value_name = "FILE", requires = "from", help_heading = "Retargeting")]
    from_compensation: Option<PathBuf>,
    /// frames.json of this robot (`robotcal frames`): where its tool and work object really are; or `nominal`, to take them as the program has them
    #[arg(long, visible_alias = "to-frames", value_name = "FILE|nominal")]
    frames: Option<PathBuf>,
    /// frames.json of the robot on which the program was taught, with the same work object
    #[arg(long, value_name = "FILE", requires = "from", help_heading = "Retargeting")]
    from_frames: Option<PathBuf>,
    /// solution.json of the robot on which the program was taught [default: the one beside its description]
    #[arg(long, value_name = "FILE", requires = "from", help_heading = "Retargeting")]
    from_solution: Option<PathBuf>,
    /// solution.json from which the description came: says how far the tool is expected from where the program meant it [default: the one beside it]
    #[arg(long, value_name = "FILE")]
    solution: Option<PathBuf>,
    /// Folder for the corrected files, which keep their names
    #[arg(long, value_name = "FOLDER", default_value = "compensated")]
    out: PathBuf,
    /// Language [default: by the extension of the files]
    #[arg(long, value_enum, help_heading = "How the program is read")]
    language: Option<Language>,
    /// Base link: the frame in which the controller computes poses
    #[arg(long, value_name = "LINK", help_heading = "How the program is read")]
    base: Option<String>,
    /// Tip link: the controller's flange
    #[arg(long, value_name = "LINK", help_heading = "How the program is read")]
    tip: Option<String>,
    /// Unit of the revolute joints in tables
    #[arg(long, value_enum, help_heading = "How the program is read")]
    joint_unit: Option<Unit>,
    /// Joints in the order of the program's axes, separated by commas [default: as in the URDF, those that slide or carry the work last]
    #[arg(long, value_name = "NAMES", value_delimiter = ',', help_heading = "How the program is read")]
    axes: Vec<String>,
    /// Joints that keep their programmed value, separated by commas
    #[arg(long, value_name = "NAMES", value_delimiter = ',', help_heading = "How the program is read")]
    hold: Vec<String>,
    /// External axes of the program that the description lacks move neither robot nor work (a gun, a gripper)
    #[arg(long, help_heading = "How the program is read")]
    axes_apart: bool,
    /// Joint values near which a pose is reached where nothing tells its posture and from where the robot comes (the first pose), and where a rail or another external axis stands that it leaves out: deg, of prismatic joints mm, in the order of --axes, separated by commas
    #[arg(
        long,
        value_name = "VALUES",
        value_delimiter = ',',
        allow_hyphen_values = true,
        help_heading = "How the program is read"
    )]
    start: Vec<f64>,
    /// Tool on the flange, for poses whose tool the files do not tell
    ///
    /// That is where the program sets none, or one that is computed or in none of the files; never for one of several that the files have.
    /// Numbers with commas between, in the order and the units in which the controller shows them:
    ///   krl       X,Y,Z,A,B,C            mm, degrees
    ///   rapid     x,y,z,q1,q2,q3,q4      mm, quaternion with q1 its scalar part
    ///   urscript  x,y,z,rx,ry,rz         m, rotation vector in rad
    ///   csv       x,y,z,qx,qy,qz,qw      m, quaternion with qw its scalar part
    /// or as the language writes it, in quotes:
    ///   --tool '{X 10,Y 0,Z 150,A 0,B 0,C 0}'   --tool '[[10,0,150],[1,0,0,0]]'   --tool 'p[0.01,0,0.15,0,0,0]'
    #[arg(
        long,
        value_name = "FRAME",
        allow_hyphen_values = true,
        verbatim_doc_comment,
        help_heading = "How the program is read"
    )]
    tool: Option<String>,
    /// Work frame ($BASE, work object) in the base, for poses whose work frame the files do not tell; written as --tool
    ///
    /// A move of RAPID without \WObj is in wobj0, and a pose of URScript in the base, whatever this says. With measured --frames it says to
    /// which work object targets in joints, and poses of URScript, belong.
    #[arg(long, value_name = "FRAME", allow_hyphen_values = true, help_heading = "How the program is read")]
    work: Option<String>,
    /// The robot does not visit the targets in the order of the text: backlash stays out of account
    #[arg(long, help_heading = "How the program is read")]
    unordered: bool,
    /// Ignore status and turn, or confdata: a pose means the posture next to that of the target before it, or that to which its straight path leads
    #[arg(long, help_heading = "How the program is read")]
    nearest_posture: bool,
}

pub fn run(args: &CompensateArgs) -> Result<Verdict> {
    let place = ResultFolder::among(&args.out)?;
    let nominal = args.nominal.as_ref().or(args.from.as_ref()).unwrap_or(&args.urdf);
    let robots = Robots::read(args, nominal)?;
    let (controller, sides) = (&robots.controller, robots.sides(args));
    let axes = axes(args, &controller.chain)?;
    let (language, files) = program_files(args)?;
    let setting = setting(args, nominal, &controller.chain, &axes, language)?;
    let mut program = programs::read(language, files, &setting)?;
    poses_have_model(args, &program)?;
    if args.nearest_posture {
        program.heed_no_codes();
    }
    let choice = Choice::read(args.frames.as_deref(), args.from_frames.as_deref(), &sides)?;
    let solutions = choice.solutions(&sides)?;
    let framed = choice.framed(&solutions)?;
    let frames = choice.measured(&solutions, language, &setting)?;
    let models = Models {
        controller,
        from: robots.from.as_ref().unwrap_or(controller),
        to: &robots.to,
        frames: frames.as_ref(),
        beyond: [true, false].map(|taught| framed.as_ref().ok().and_then(|all| known_error(all, taught))),
    };
    let done = programs::compensate(&program, models, &postures(args, &controller.chain, &axes)?);
    done.tell_what_moves(&mut program);
    let left = done.left(&program);
    let (expected, meant) = (choice.expected((&sides, &solutions), &framed, &program, &done)?, choice.meant());
    let mut findings = model_findings(args, nominal, &models, (&sides, &solutions))?;
    findings.extend(in_other_base(args, nominal, (language, &program), &controller.chain)?);
    let said = expected.as_deref().map_err(|why| why.as_str());
    findings.extend(program_findings(args, (&program, &done, &left), (said, &meant)));
    let report = corrections::table(&program, &done, expected.as_deref().ok(), &controller.chain);
    let written = write(args, &place, &program, &done, &findings, &report)?;
    say!("{}", text(&program, &done.outcomes, &left, &controller.chain));
    // Targets that are left are listed already.
    say::findings(findings.iter().filter(|f| f.code != Code::TargetsLeft));
    let verdict = verdict(&left, &findings, &meant);
    say_line!("results   {} ({} files)", args.out.display(), written);
    Ok(verdict)
}

/// The robots as their files describe them.
struct Robots {
    /// By which the controller computes.
    controller: Robot,
    /// That runs the program.
    to: Robot,
    /// On which it was taught.
    from: Option<Robot>,
}

impl Robots {
    /// # Errors
    /// Files that cannot be read, or are of robots of several types.
    fn read(args: &CompensateArgs, nominal: &Path) -> Result<Self> {
        let controller = robot(args, nominal, None)?;
        let to = robot(args, &args.urdf, args.compensation.as_deref())?;
        let from = args.from.as_ref().map(|file| robot(args, file, args.from_compensation.as_deref())).transpose()?;
        for (file, other) in [(Some(&args.urdf), Some(&to)), (args.from.as_ref(), from.as_ref())] {
            if let (Some(file), Some(other)) = (file, other) {
                same_joints(nominal, &controller.chain, file, &other.chain)?;
            }
        }
        Ok(Self { controller, to, from })
    }

    fn sides<'a>(&'a self, args: &'a CompensateArgs) -> Sides<'a> {
        Sides {
            to: Side { robot: &self.to, urdf: &args.urdf, solution: args.solution.as_deref() },
            from: self.from.as_ref().zip(args.from.as_ref()).map(|(robot, urdf)| Side {
                robot,
                urdf,
                solution: args.from_solution.as_deref(),
            }),
        }
    }
}

/// The files of the program and their language.
fn program_files(args: &CompensateArgs) -> Result<(Language, Vec<TextFile>)> {
    let files = args.programs.iter().map(|p| text_file(p)).collect::<Result<Vec<_>>>()?;
    let language = language(args)?;
    files.iter().try_for_each(is_text)?;
    Ok((language, files))
}

/// How the program is read.
fn setting<'a>(
    args: &CompensateArgs,
    nominal: &Path,
    chain: &'a Chain,
    axes: &'a [usize],
    language: Language,
) -> Result<ProgramSetting<'a>> {
    Ok(ProgramSetting {
        chain,
        axes,
        rad_per_unit: args.joint_unit.map(|unit| AngleUnit::from(unit).in_rad()),
        base: stands_on(args, &urdf::read(nominal)?).map_or_else(Pose::identity, |(_, pose)| pose),
        tool: frame("--tool", args.tool.as_deref(), language)?,
        work: frame("--work", args.work.as_deref(), language)?,
        axes_apart: args.axes_apart,
    })
}

/// Says whether all was corrected.
fn verdict(left: &[Left], findings: &[FileFinding], meant: &Meant) -> Verdict {
    let good = left.is_empty() && findings.iter().all(|f| f.weight == Weight::Note);
    let gates: Vec<&str> = findings.iter().filter(|f| f.weight == Weight::Gate).map(|f| f.code.name()).collect();
    match good {
        true => say_line!("verdict   corrected{}", meant.in_words()),
        false => say_line!("verdict   NOT CORRECTED AS A WHOLE: {}", gates.join(", ")),
    }
    if good { Verdict::Good } else { Verdict::GateFailed }
}

/// A robot as its files describe it.
fn robot(args: &CompensateArgs, file: &Path, compensation: Option<&Path>) -> Result<Robot> {
    let description = urdf::read(file)?;
    let base = stands_on(args, &description).map(|(link, _)| link).or(args.base.as_deref());
    let chain = noted_chain(&description, base, args.tip.as_deref())?;
    let mut robot = compensated(chain, compensation)?;
    robot.terms.retain(|t| !args.unordered || t.term != Term::Backlash);
    Ok(robot)
}

/// Poses are turned into joints by the model of the controller, which must be given for them.
fn poses_have_model(args: &CompensateArgs, program: &Program) -> Result<()> {
    let needs_controller = |t: &&Target| matches!(&t.kind, TargetKind::Pose(p) if !p.has_joint_fields());
    let (None, Some(t)) = (&args.nominal, program.targets.iter().find(needs_controller)) else { return Ok(()) };
    let place = format!("{}:{} {}", program.files[t.file].name, t.line, t.name);
    let what = "is a pose, which the controller turns into joints by its own model";
    Err(Error::new(Code::ProgramModelMissing, place, what, "give that model with --nominal"))
}

/// Writes the programs, the table and the findings, with what they say of programs that other runs wrote there; says how many files these are.
fn write(
    args: &CompensateArgs,
    place: &ResultFolder,
    program: &Program,
    done: &Compensated,
    findings: &[FileFinding],
    report: &str,
) -> Result<usize> {
    let mut written: Vec<(String, &[u8])> = Vec::new();
    for (path, bytes) in args.programs.iter().zip(&done.files) {
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        written.push((name, bytes));
    }
    let names: Vec<&str> = written.iter().map(|(name, _)| name.as_str()).collect();
    let OfOthers { programs: mut records, findings: of_others, corrections } =
        OfOthers::read(place.path(), &names, report);
    for ((path, file), (name, bytes)) in args.programs.iter().zip(&program.files).zip(&written) {
        let made_of = seen_from(place.path(), path);
        require_same_source(place.path(), name, &made_of)?;
        records.push(WrittenProgram::new((name, bytes), &file.bytes, made_of));
    }
    let findings = [RunFinding::all(findings, &names), of_others].concat();
    let said = corrections::findings_json(&findings, &records)?;
    let report = format!("{report}{corrections}");
    written.push((corrections::TABLE.to_owned(), report.as_bytes()));
    written.push((corrections::FINDINGS.to_owned(), said.as_bytes()));
    place.write_beside(&written, &args.programs)?;
    Ok(written.len())
}

/// Whether the descriptions are those that were meant.
fn model_findings(
    args: &CompensateArgs,
    nominal: &Path,
    models: &Models<'_>,
    (sides, solutions): (&Sides, &Solutions),
) -> Result<Vec<FileFinding>> {
    let mut findings = Vec::new();
    findings.extend(models.frames.is_none().then(|| equal(models.from, sides)).flatten());
    // From a real robot to a nominal one is a retargeting as any other.
    if sides.from.is_none() {
        findings.extend(exchanged(models.controller, nominal, sides)?);
    }
    let of_sides = [(Some(&sides.to), Some(&solutions.to)), (sides.from.as_ref(), solutions.from.as_ref())];
    for (side, found) in of_sides.into_iter().filter_map(|(side, found)| side.zip(found)) {
        let record = found.as_ref().ok();
        findings.extend(record.and_then(|record| untrusted(record, Weight::Gate, side.urdf.display())));
    }
    findings.extend(not_given(&sides.to, args.compensation.as_deref(), "--compensation"));
    let taught = sides.from.as_ref();
    findings.extend(taught.and_then(|from| not_given(from, args.from_compensation.as_deref(), "--from-compensation")));
    Ok(findings)
}

/// What the program asks for and could not be done, and how accurate what was done is `expected` to be, or why nobody knows.
fn program_findings(
    args: &CompensateArgs,
    (program, done, left): (&Program, &Compensated, &[Left]),
    (expected, meant): (std::result::Result<&[Option<f64>], &str>, &Meant),
) -> Vec<FileFinding> {
    let subject = args.urdf.display().to_string();
    let read = args.programs.iter().zip(&program.files);
    (read.filter_map(|(path, file)| corrected_already(path, file, args.from.is_some())))
        .chain(corrections::nominal_findings(program, done))
        .chain(corrections::displaced_finding(program, done))
        .chain(corrections::poses_kept_finding(program, done))
        .chain(corrections::expected_findings(expected, done, meant, &subject))
        .chain(corrections::left_finding(left.iter().map(|l| l.why.reason.name()), &subject))
        .chain(corrections::missing_finding(program, left, &subject))
        .collect()
}

/// Poses of URScript where no base is named, and the controller computes in another one than that of the chain. Joints that were taught with a pose tell its
/// base themselves.
fn in_other_base(
    args: &CompensateArgs,
    nominal: &Path,
    (language, program): (Language, &Program),
    chain: &Chain,
) -> Result<Option<FileFinding>> {
    let is_pose = |target: &Target| matches!(&target.kind, TargetKind::Pose(pose) if pose.taught.is_none());
    let has_poses = program.targets.iter().any(is_pose);
    if args.base.is_some() || language != Language::UrScript || !has_poses {
        return Ok(None);
    }
    let poses = (Weight::Gate, "poses are read");
    Ok(controller_base(&urdf::read(nominal)?, [&chain.base, &chain.tip], poses))
}

/// The link of the chain on which `--base` is fixed, where it does not lie in the chain itself.
fn stands_on<'d>(args: &CompensateArgs, description: &'d RobotDescription) -> Option<(&'d str, Pose)> {
    description.fixed_base(args.base.as_deref()?, args.tip.as_deref()?)
}

/// Languages as values of a flag.
impl ValueEnum for Language {
    fn value_variants<'a>() -> &'a [Self] {
        Self::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.name()).help(self.words()))
    }
}

fn language(args: &CompensateArgs) -> Result<Language> {
    if let Some(name) = args.language {
        return Ok(name);
    }
    let mut all = args.programs.iter().map(|p| Language::of_file(p).map(|l| (p, l)));
    let Some((first, language)) = all.next().transpose()? else {
        return Err(Error::new(Code::OptionMissing, "compensate", "no program is given", "name at least one file"));
    };
    for other in all {
        let (path, other) = other?;
        if other != language {
            let what = format!("is of another language than {}", first.display());
            return Err(Error::new(
                Code::ProgramLanguage,
                path.display(),
                what,
                "give programs of one language, or --language",
            ));
        }
    }
    Ok(language)
}

fn text_file(path: &Path) -> Result<TextFile> {
    let bytes = files::read(path, files::FileKind::Program)?;
    if let Some((what, remedy)) = programs::packed(&bytes) {
        return Err(Error::new(Code::ProgramLanguage, path.display(), what, remedy));
    }
    Ok(TextFile { name: path.display().to_string(), bytes })
}

fn is_text(file: &TextFile) -> Result<()> {
    if file.bytes.contains(&0) {
        let what = "is not a text of single bytes (it holds zero bytes, as UTF-16 does)";
        return Err(Error::new(
            Code::TextEncoding,
            &file.name,
            what,
            "save it as UTF-8 or as the controller writes it",
        ));
    }
    Ok(())
}

/// The readings of both chains are the same.
fn same_joints(file: &Path, chain: &Chain, other_file: &Path, other: &Chain) -> Result<()> {
    if chain.readings == other.readings && chain.reading_kinds == other.reading_kinds {
        return Ok(());
    }
    let what = format!(
        "has the joints {} from {} to {}, but {} has {}",
        other.readings.join(", "),
        other.base,
        other.tip,
        file.display(),
        chain.readings.join(", ")
    );
    Err(Error::new(
        Code::RobotDiffers,
        other_file.display(),
        what,
        "give descriptions of the same type of robot; choose --base and --tip",
    ))
}

fn known(flag: &str, name: &str, chain: &Chain) -> Result<usize> {
    chain.readings.iter().position(|r| r == name).ok_or_else(|| {
        let what = format!("\"{name}\" is no joint of the chain");
        Error::new(Code::JointUnknown, flag, what, format!("its joints are {}", chain.readings.join(", ")))
    })
}

/// Readings in the order of the program's axes.
fn axes(args: &CompensateArgs, chain: &Chain) -> Result<Vec<usize>> {
    let n = chain.readings.len();
    if args.axes.is_empty() {
        let carries_work: Vec<usize> =
            chain.joints[..chain.climbed()].iter().filter_map(|joint| Some(joint.drive?.reading)).collect();
        let is_of_arm = |i: &usize| chain.reading_kinds[*i] != JointKind::Prismatic && !carries_work.contains(i);
        return Ok((0..n).filter(is_of_arm).chain((0..n).filter(|i| !is_of_arm(i))).collect());
    }
    let axes: Vec<usize> = args.axes.iter().map(|name| known("--axes", name, chain)).collect::<Result<_>>()?;
    let all = (0..n).all(|i| axes.iter().filter(|a| **a == i).count() == 1);
    let remedy = format!("name each of {} once", chain.readings.join(", "));
    if all { Ok(axes) } else { Err(Error::new(Code::OptionRange, "--axes", "does not name every joint once", remedy)) }
}

fn postures(args: &CompensateArgs, chain: &Chain, axes: &[usize]) -> Result<Postures> {
    let mut held = vec![false; chain.readings.len()];
    for name in &args.hold {
        held[known("--hold", name, chain)?] = true;
    }
    if args.start.is_empty() {
        return Ok(Postures { held, start: None });
    }
    if args.start.len() != axes.len() {
        let what = format!("{} values for {} joints", args.start.len(), axes.len());
        return Err(Error::new(Code::OptionRange, "--start", what, "give one value for each joint, in deg (mm)"));
    }
    let mut start = vec![0.0; axes.len()];
    for (&reading, value) in axes.iter().zip(&args.start) {
        let prismatic = chain.reading_kinds[reading] == JointKind::Prismatic;
        start[reading] = if prismatic { 1e-3 * value } else { value.to_radians() };
    }
    Ok(Postures { held, start: Some(start) })
}

/// A frame on the command line, in the notation of the language.
fn frame(flag: &str, text: Option<&str>, language: Language) -> Result<Option<Pose>> {
    let bad = |text: &str, wanted| {
        let what = format!("\"{text}\" is no frame of {}", language.words());
        Error::new(Code::OptionRange, flag, what, format!("give {wanted}"))
    };
    text.map(|text| language.frame(text).map_err(|wanted| bad(text, wanted))).transpose()
}

/// Targets listed one by one on the terminal; more only by their largest corrections.
const SHOWN: usize = 10;

/// A target by its number, with what was corrected of it.
type Done<'a> = (usize, &'a Correction);

fn text(program: &Program, outcomes: &[TargetOutcome], left: &[Left], chain: &Chain) -> String {
    let done: Vec<Done> = outcomes
        .iter()
        .enumerate()
        .filter_map(|(k, o)| if let TargetOutcome::Done(c) = o { Some((k, c)) } else { None })
        .collect();
    let targets = format!("targets   {} rewritten, {} unchanged\n", done.len(), left.len());
    let sizes = if done.is_empty() { String::new() } else { sizes(&done) };
    let notices: String = program.notices.iter().map(|notice| format!("note      {}\n", notice.coded())).collect();
    [targets, sizes, largest(done, program, chain), notices, left_as_they_are(left, program)].concat()
}

/// How large the corrections are, and what rounding leaves.
fn sizes(done: &[Done]) -> String {
    let rms = |of: fn(&Correction) -> f64| {
        1e3 * (done.iter().map(|(_, c)| of(c).powi(2)).sum::<f64>() / done.len().max(1) as f64).sqrt()
    };
    let worst = |of: fn(&Correction) -> f64| done.iter().map(|(_, c)| of(c)).fold(0.0, f64::max);
    format!(
        "correction {:.3} mm and {:.3} mrad RMS, at most {:.3} mm and {:.3} mrad\n\
         rounding  the numbers as written give these joints to {:.1e} m and {:.1e} rad; how accurate the robot is with them is said below\n",
        rms(|c| c.shift_m),
        rms(|c| c.turn_rad),
        1e3 * worst(|c| c.shift_m),
        1e3 * worst(|c| c.turn_rad),
        worst(|c| c.residual_m),
        worst(|c| c.residual_rad)
    )
}

/// Every correction; of many the largest.
fn largest(mut done: Vec<Done>, program: &Program, chain: &Chain) -> String {
    let mut out = String::new();
    if done.len() > SHOWN {
        let _ = writeln!(out, "largest   {SHOWN} of {} (all in {TABLE}):", done.len());
        done.sort_by(|a, b| b.1.shift_m.total_cmp(&a.1.shift_m));
        done.truncate(SHOWN);
    }
    for (k, c) in done {
        let t = &program.targets[k];
        let (joint, change) = c.largest_change();
        let change = match chain.reading_kinds[joint] {
            JointKind::Prismatic => format!("{:+.4} mm", 1e3 * change),
            _ => format!("{:+.4} deg", change.to_degrees()),
        };
        let (mm, mrad) = (1e3 * c.shift_m, 1e3 * c.turn_rad);
        let file = &program.files[t.file].name;
        let _ = writeln!(
            out,
            "  {file}:{} {}: {mm:.3} mm, {mrad:.3} mrad; {} {change}",
            t.line, t.name, chain.readings[joint]
        );
    }
    out
}

/// Targets that are not rewritten, each with the reason; of many with one reason the first.
fn left_as_they_are(left: &[Left], program: &Program) -> String {
    let mut out = String::new();
    let mut told: BTreeMap<&str, usize> = BTreeMap::new();
    for l in left {
        let count = told.entry(&l.why.words).or_default();
        *count += 1;
        if *count <= SHOWN {
            let _ = writeln!(out, "left      {}:{} {}: {}", program.files[l.file].name, l.line, l.name, l.why.words);
        }
    }
    for (why, count) in told.iter().filter(|(_, count)| **count > SHOWN) {
        let _ = writeln!(out, "left      {} more (all in {TABLE}): {why}", count - SHOWN);
    }
    out
}
