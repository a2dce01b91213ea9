//! `--frames` of `compensate`: where tool and work object of the robots are, and what is known of them.

use std::path::Path;

use crate::assess::Limits;
use crate::cli::results::show::read_solution;
use crate::error::{Code, Error, Result};
use crate::files::{self, FileKind};
use crate::geom::Pose;
use crate::model::robot::Robot;
use crate::output::ALONE;
use crate::output::corrections::{self, FramedRobot, Meant};
use crate::output::frames_record::{self, FramesRecord, ToolKind};
use crate::output::restore::{exported_model, exported_robot};
use crate::output::solution_json::{self, SolutionRecord};
use crate::programs::compensate::Compensated;
use crate::programs::{
    KnownError, Language, MeasuredFrames, MeasuredTool, Program, ProgramSetting, RobotFrames, SameFrames,
};
use crate::urdf::{Chain, Joint};

/// One of the calibrated robots.
pub(super) struct Side<'a> {
    pub robot: &'a Robot,
    pub urdf: &'a Path,
    /// Its solution.json as given; else the one beside the description.
    pub solution: Option<&'a Path>,
}

/// The robot that runs the program, and the one on which it was taught.
pub(super) struct Sides<'a> {
    pub to: Side<'a>,
    pub from: Option<Side<'a>>,
}

/// What was said of tool and base.
pub(super) enum Choice {
    Untold,
    Nominal,
    Measured { to: Box<FramesRecord>, from: Option<Box<FramesRecord>> },
}

/// Value of `--frames` that takes tool and base as they are in the program.
const NOMINAL: &str = "nominal";

/// Distance (m and rad) within which the origins of two descriptions are those of one robot.
pub(super) const SAME_ORIGIN: f64 = 1e-6;

/// Why a value is not known.
type Known<T> = std::result::Result<T, String>;

/// Why the solution from which a description came is not at hand.
pub(super) enum NoSolution {
    /// None stands beside it.
    Absent(String),
    /// The one that stands there is of another description.
    OfOther(Error),
    /// The one that stands there cannot be used.
    Unusable(Error),
}

impl NoSolution {
    /// In words.
    fn why(&self) -> String {
        match self {
            Self::Absent(why) => why.clone(),
            Self::OfOther(error) | Self::Unusable(error) => format!("{} {}; {}", error.place, error.what, error.remedy),
        }
    }
}

/// The solution from which a description came, or why it is not at hand.
type Found = std::result::Result<SolutionRecord, NoSolution>;

/// Those of both robots.
pub(super) struct Solutions {
    pub to: Found,
    pub from: Option<Found>,
}

fn read_frames(path: &Path, side: &Side) -> Result<FramesRecord> {
    let named =
        |e: Error| Error { place: e.place.replacen(frames_record::FILE_NAME, &path.display().to_string(), 1), ..e };
    let record = frames_record::read(&files::read(path, FileKind::Solution)?).map_err(named)?;
    record.check_robot(side.robot, &side.urdf.display().to_string())?;
    Ok(record)
}

impl Choice {
    /// Reads the frames and refuses those of other robots.
    pub fn read(frames: Option<&Path>, from_frames: Option<&Path>, sides: &Sides) -> Result<Self> {
        let Some(frames) = frames.filter(|f| *f != Path::new(NOMINAL)) else {
            if let Some(other) = from_frames {
                let what = "gives the frames of the robot on which the program was taught alone";
                return Err(Error::new(
                    Code::OptionMissing,
                    other.display(),
                    what,
                    "give those of the other robot with --frames",
                ));
            }
            return Ok(if frames.is_none() { Self::Untold } else { Self::Nominal });
        };
        let to = Box::new(read_frames(frames, &sides.to)?);
        let from = match (&sides.from, from_frames) {
            (Some(side), Some(path)) => Some(Box::new(read_frames(path, side)?)),
            (Some(side), None) => {
                let what = "taught the program, and where its tool and work object are is not given";
                let remedy = "give its frames.json with --from-frames: of the same work object, touched with the tool of that robot";
                return Err(Error::new(Code::OptionMissing, side.urdf.display(), what, remedy));
            }
            (None, _) => None,
        };
        let choice = Self::Measured { to, from };
        choice.common(frames, from_frames)?;
        Ok(choice)
    }

    /// Frames of two robots are of one work object.
    fn common(&self, frames: &Path, from_frames: Option<&Path>) -> Result<()> {
        let Self::Measured { to, from: Some(from) } = self else { return Ok(()) };
        let refuse = |what: String, remedy: &str| Err(Error::new(Code::FramesDiffer, frames.display(), what, remedy));
        let other = from_frames.map_or_else(String::new, |p| p.display().to_string());
        match (&to.work, &from.work) {
            (Some(a), Some(b)) if a.name == b.name => {}
            (Some(a), Some(b)) => {
                let what = format!("is of the work object '{}', and {other} of '{}'", a.name, b.name);
                return refuse(
                    what,
                    "two robots need a common frame: touch the same points of one work object, and name it in [contact] frame",
                );
            }
            _ => {
                let what = format!("and {other} do not both have a work object: nothing is common to the robots");
                return refuse(what, "touch three or more points of the common work object with each robot");
            }
        }
        if to.tool.is_some() != from.tool.is_some() {
            let what = format!("and {other} do not both have a tool");
            return refuse(what, "touch with the tools of both robots");
        }
        Ok(())
    }

    /// The solutions from which the descriptions came: as given, beside them, or those with which measured frames were found.
    ///
    /// # Errors
    /// One that was given and cannot be used, or is of another robot.
    pub fn solutions(&self, sides: &Sides) -> Result<Solutions> {
        let of_from = |side: &Side| solution(side, self.recorded(true));
        Ok(Solutions {
            to: solution(&sides.to, self.recorded(false))?,
            from: sides.from.as_ref().map(of_from).transpose()?,
        })
    }

    /// Where the solutions are with which measured frames of a side were found.
    fn recorded(&self, is_taught: bool) -> Option<&Path> {
        let Self::Measured { to, from } = self else { return None };
        let record = if is_taught { from.as_deref() } else { Some(to.as_ref()) };
        Some(&record?.robot.solution.path)
    }

    /// What takes the place of the program's own frames.
    ///
    /// # Errors
    /// A solution beside the description that cannot be used.
    pub fn measured(
        &self,
        solutions: &Solutions,
        language: Language,
        setting: &ProgramSetting,
    ) -> Result<Option<MeasuredFrames>> {
        let Self::Measured { to, from } = self else { return Ok(None) };
        // Those with which the frames were found.
        let limits = match &solutions.to {
            Ok(record) => record.limits(),
            Err(NoSolution::Unusable(error)) => return Err(error.clone()),
            Err(_) => Limits::default(),
        };
        Ok(Some(MeasuredFrames {
            to: frames_of(to),
            from: from.as_ref().map(|f| frames_of(f)),
            base_within: to.work_is_base().then_some((limits.same_base_m, limits.same_work_rad)),
            tool: setting.tool,
            work: setting.work.map(|work| setting.base * work),
            unsaid: (language == Language::UrScript).then_some(setting.base),
            same: SameFrames {
                work: (limits.same_work_m, limits.same_work_rad),
                tool: (limits.same_tool_m, limits.same_tool_rad),
                clearly_nearer: limits.frame_clearly_nearer,
            },
        }))
    }

    /// What the program is corrected with, in words.
    pub fn meant(&self) -> Meant {
        match self {
            Self::Untold => Meant::Untold,
            Self::Nominal => Meant::Nominal,
            Self::Measured { to, from } => {
                let work = to.work.as_ref().map(|w| match from {
                    Some(_) => format!("the common work object '{}'", w.name),
                    None => format!("the work object '{}'", w.name),
                });
                let tool = to.tool.as_ref().map(|t| match from {
                    Some(_) => "the tools of both robots".to_owned(),
                    None => format!("the tool '{}'", t.name),
                });
                let measured: Vec<String> = work.into_iter().chain(tool).collect();
                let nominal = match (&to.work, &to.tool) {
                    (None, _) => "; the base is nominal",
                    (_, None) => "; the tool is nominal",
                    _ => "",
                };
                Meant::Measured(format!("{} as measured{nominal}", measured.join(" and ")))
            }
        }
    }

    /// The robots with their measured frames; else why what is known of them is not at hand.
    pub fn framed(&self, solutions: &Solutions) -> Result<Known<Vec<FramedRobot>>> {
        let Self::Measured { to, from } = self else { return Ok(Ok(Vec::new())) };
        let mut all = Vec::new();
        let both = [(Some(&solutions.to), Some(to), false), (solutions.from.as_ref(), from.as_ref(), true)];
        for (solution, record, is_taught) in both {
            let (Some(solution), Some(record)) = (solution, record) else { continue };
            match framed(solution, record, is_taught)? {
                Ok(robot) => all.push(robot),
                Err(why) => return Ok(Err(why)),
            }
        }
        Ok(Ok(all))
    }

    /// Expected error of every target, m; else why it is not known.
    pub fn expected(
        &self,
        (sides, solutions): (&Sides, &Solutions),
        framed: &Known<Vec<FramedRobot>>,
        program: &Program,
        done: &Compensated,
    ) -> Result<Known<Vec<Option<f64>>>> {
        match (self, &sides.from) {
            (Self::Measured { .. }, _) => Ok(framed
                .as_ref()
                .map(|all| corrections::expected_with_frames(program, done, all))
                .map_err(Clone::clone)),
            (_, Some(_)) => Ok(Err("base and tool of both robots count, and no common frame is given".into())),
            (_, None) => Ok(match &solutions.to {
                Ok(record) => {
                    let part = part(record, sides.to.robot);
                    Ok(corrections::expected_errors(program, done, &exported_model(record)?, part))
                }
                Err(none) => Err(none.why()),
            }),
        }
    }
}

/// What is known beyond the model of the robot that taught, or that runs, the program.
pub(super) fn known_error(all: &[FramedRobot], is_taught: bool) -> Option<&dyn KnownError> {
    all.iter().find(|robot| robot.is_taught == is_taught).map(|robot| robot as &dyn KnownError)
}

fn frames_of(record: &FramesRecord) -> RobotFrames {
    let tool = record.tool.as_ref().map(|t| {
        let pose = Pose::from(&t.pose);
        match t.measured {
            ToolKind::Point | ToolKind::GivenPoint => MeasuredTool::Point(pose.translation),
            ToolKind::Pose | ToolKind::Given => MeasuredTool::Pose(pose),
        }
    });
    RobotFrames { tool, work: record.work.as_ref().map(|w| (&w.pose).into()) }
}

fn framed(solution: &Found, record: &FramesRecord, is_taught: bool) -> Result<Known<FramedRobot>> {
    let found = match solution {
        Ok(solution) => exported_model(solution)?,
        Err(none) => return Ok(Err(none.why())),
    };
    let (robot, knowledge) = record.known(&found)?;
    let tool = record.tool.as_ref().map(|t| Pose::from(&t.pose));
    Ok(Ok(FramedRobot { robot, knowledge, tool, work: record.base_from_work(), is_taught }))
}

/// The solution from which a description came.
///
/// # Errors
/// One that was given and cannot be used, or is of another robot.
pub(super) fn solution(side: &Side, recorded: Option<&Path>) -> Result<Found> {
    let beside = side.urdf.with_file_name(solution_json::FILE_NAME);
    let there = [Some(beside.as_path()), recorded].into_iter().flatten().find(|p| p.is_file());
    let Some(path) = side.solution.or(there) else {
        let why = format!("no solution.json beside {}, and no --solution", side.urdf.display());
        return Ok(Err(NoSolution::Absent(why)));
    };
    let record = match read_solution(path) {
        Ok(record) => record,
        Err(error) if side.solution.is_some() => return Err(error),
        Err(error) => return Ok(Err(NoSolution::Unusable(error))),
    };
    let exported = exported_robot(&record)?.as_exported().chain;
    let chain = &side.robot.chain;
    if is_same(chain, &record, &exported) || is_alone_of(&record, side) {
        return Ok(Ok(record));
    }
    let differs = |what: String, remedy: String| Error::new(Code::SolutionDiffers, path.display(), what, remedy);
    let none = match base_that_differs(&exported, chain) {
        Some(base) => NoSolution::Unusable(differs(
            format!("is of the chain from {base}, and {} was read from {}", side.urdf.display(), chain.base),
            format!("give --base {base}, from which the robot was identified"),
        )),
        None => NoSolution::OfOther(differs(
            format!("is not the solution from which {} came", side.urdf.display()),
            "give the solution.json that was written beside it".to_owned(),
        )),
    };
    match (side.solution, none) {
        (Some(_), NoSolution::OfOther(error) | NoSolution::Unusable(error)) => Err(error),
        (_, none) => Ok(Err(none)),
    }
}

/// True for a chain with the moving joints of a solution where it has them.
fn is_same(chain: &Chain, record: &SolutionRecord, exported: &Chain) -> bool {
    let origin = |name: &str| exported.joints.iter().find(|j| j.name == name).map(|j| j.origin);
    let is_there = |j: &Joint| {
        origin(&j.name).is_some_and(|o| {
            let (rad, m) = o.distance(&j.origin);
            rad < SAME_ORIGIN && m < SAME_ORIGIN
        })
    };
    chain.readings == record.robot.readings
        && chain.tip == record.robot.tip
        && chain.joints.iter().filter(|j| j.drive.is_some()).all(is_there)
}

/// What is judged of the model of a solution, where that is not the whole: a URDF without its compensation.toml.
pub(super) fn part<'r>(record: &SolutionRecord, robot: &'r Robot) -> Option<&'r Robot> {
    (robot.terms.is_empty() && record.beyond_urdf()).then_some(robot)
}

/// True for the URDF that a solution lists for use without compensation.toml, whose origins it does not hold.
fn is_alone_of(record: &SolutionRecord, side: &Side) -> bool {
    let name = side.urdf.file_name().and_then(|name| name.to_str()).filter(|name| name.ends_with(ALONE));
    let chain = &side.robot.chain;
    let is_its_robot = chain.readings == record.robot.readings && chain.tip == record.robot.tip;
    let is_listed = name.is_some_and(|name| record.files.iter().any(|file| file == name));
    is_listed && is_its_robot && part(record, side.robot).is_some()
}

/// The base of a solution of this robot, where that alone is another: one chain goes on where the other ends.
fn base_that_differs<'r>(of_record: &'r Chain, chain: &Chain) -> Option<&'r str> {
    let found = |name: &str| of_record.joints.iter().find(|j| j.name == name);
    let driven = |chain: &'_ Chain| chain.joints.iter().filter(|j| j.drive.is_some()).count();
    let own = chain.joints.iter().filter(|j| j.drive.is_some());
    let common: Vec<_> = own.filter_map(|j| Some((j, found(&j.name)?))).collect();
    let are_same = common.iter().all(|(own, other)| {
        let (rad, m) = other.origin.distance(&own.origin);
        rad < SAME_ORIGIN && m < SAME_ORIGIN
    });
    let is_part = !common.is_empty() && common.len() == driven(of_record).min(driven(chain));
    let is_other = chain.tip == of_record.tip && chain.base != of_record.base;
    (is_other && is_part && are_same).then_some(of_record.base.as_str())
}
