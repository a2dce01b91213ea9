//! Identified series to a solution: the steps in their order, and in rounds where a better robot tells postures anew.

use super::controller::choice::Before;
use super::controller::computed_postures::{ChosenPostures, told_by_seen};
use super::controller::tool::tool_in_poses;
use super::estimator::Estimator;
use super::joint_fit::fit::JointFit;
use super::model_choice::evidence::best_model;
use super::model_choice::lens_choice::{self, Lensed, with_lenses};
use super::model_choice::near_nominal::near_nominal;
use super::options::Options;
use super::solution::{Evidence, LensEvidence, Solution};
use super::start::turns;
use crate::diagnose::{Finding, ToolInPoses, Weight, follows_from_tool};
use crate::error::{Notice, Result};
use crate::model::joint_terms::RobotModel;
use crate::model::robot::Robot;
use crate::problem::{Adjustment, MeasuredSeries};
use crate::urdf::Chain;

/// Most times that postures are told anew by the identified robot.
const RETELLINGS: usize = 3;

/// Identifies robot, cameras, mountings and plates from identified series. The automatic model is the largest that no other
/// beats decisively; whoever names a joint term wants all of them.
///
/// # Errors
/// Input errors of the series; unsolved where the data do not determine camera or hand-camera offset, or readings and images do
/// not belong together.
pub fn identify(chain: Chain, series: &[MeasuredSeries], options: &Options) -> Result<Solution> {
    let chain = chain.carrying(options.payload.as_ref())?;
    let of_poses = chain.pose_coordinates().map(|_| options.without_robot()).transpose()?;
    let options = of_poses.as_ref().unwrap_or(options);
    let model = match options.model {
        RobotModel::Auto => RobotModel::Full,
        other => other,
    };
    let by_joint_fit = Options { model, estimator: Estimator::Joint, ..options.clone() };
    let robot = model.robot_with(chain.clone(), options.harmonics);
    let series = &turns::settled(&robot, series, &options.limits);
    let rigid = RobotModel::Rigid.robot_with(chain.clone(), options.harmonics);
    let (mut told, of_postures) = told_postures(&rigid, (series, Before::Nearest), options);
    let choose = |told: &[MeasuredSeries]| choose(&chain, told, options, &by_joint_fit);
    let (chosen, of_postures) = with_postures_retold(&mut told, of_postures, choose, options)?;
    let Chosen { fit, series: lensed, evidences, lenses, notices, .. } = chosen;
    let mut solution = Solution { evidences, lenses, ..fit.judged(&lensed, options.estimator)? };
    solution.findings.extend(notices.into_iter().map(Into::into));
    solution.findings.extend(of_postures.map(|t| t.finding(series, &told).into()));
    name_tool(&mut solution.findings, &rigid, &told, options);
    name_tried_lenses(&mut solution);
    let losses = lens_choice::losses(&solution.fit.adjustment, &solution.free_poses, series);
    solution.findings.extend(losses.into_iter().map(Into::into));
    Ok(Solution { options: options.clone(), ..solution })
}

/// What is `chosen` by the series as they are `told`, in rounds for as long as the identified robot tells other postures.
fn with_postures_retold(
    told: &mut [MeasuredSeries],
    mut of_postures: Option<ChosenPostures>,
    choose: impl Fn(&[MeasuredSeries]) -> Result<Chosen>,
    options: &Options,
) -> Result<(Chosen, Option<ChosenPostures>)> {
    let mut chosen = choose(told)?;
    for _ in 0..RETELLINGS {
        // A wrong posture hides the joint terms: the robot that has all of them tells what the first model could not.
        let fitted = (chosen.series.as_slice(), Before::Fitted);
        let (again, Some(found)) = told_postures(&chosen.widest, fitted, options) else { break };
        // Terms enough to fit any choice do not close what was open before.
        let is_open = found.is_open || of_postures.is_some_and(|before| before.is_open);
        of_postures = Some(ChosenPostures { is_open, ..found });
        if found.changed == 0 {
            break;
        }
        for (told, again) in told.iter_mut().zip(again) {
            (told.stops, told.postures) = (again.stops, again.postures);
        }
        chosen = choose(told)?;
    }
    Ok((chosen, of_postures))
}

/// A tool or frame in the poses, in place of what follows from it.
fn name_tool(findings: &mut Vec<Finding>, robot: &Robot, told: &[MeasuredSeries], options: &Options) {
    // What moved in the series fits with a tool or frame somewhat better, too.
    let moved = |f: &Finding| f.weight() == Weight::Gate && matches!(f, Finding::Displaced(_) | Finding::ZeroMoved(_));
    if findings.iter().any(moved) {
        return;
    }
    let Some(tool) = of_tool(robot, told, options) else { return };
    let of_tool = told.iter().filter(|series| tool.series.contains(&series.name));
    let mountings: Vec<&str> = of_tool.map(|series| series.mounting.as_str()).collect();
    findings.retain(|other| !follows_from_tool(other, &mountings));
    findings.push(tool.into());
}

/// No finding tells to try a lens that was tried, and has less evidence.
fn name_tried_lenses(solution: &mut Solution) {
    for finding in &mut solution.findings {
        let Finding::ResidualPattern(pattern) = finding else { continue };
        let of_camera = || solution.lenses.iter().filter(|lens| lens.camera == pattern.bearer);
        let taken = of_camera().find(|lens| lens.taken).map_or(f64::NEG_INFINITY, |lens| lens.log_evidence);
        pattern.tried = of_camera().filter(|l| !l.taken && l.log_evidence < taken).map(|lens| lens.lens).collect();
    }
}

fn of_tool(robot: &Robot, series: &[MeasuredSeries], options: &Options) -> Option<ToolInPoses> {
    tool_in_poses(robot, series, &options.limits, |start| selected(start, options))
}

fn told_postures(
    robot: &Robot,
    series: (&[MeasuredSeries], Before),
    options: &Options,
) -> (Vec<MeasuredSeries>, Option<ChosenPostures>) {
    let (told, found) = told_by_seen(robot, series, &options.limits, |start| selected(start, options));
    (told.into_owned(), found)
}

/// Holds what the options hold.
fn selected(start: &mut Adjustment, options: &Options) -> Result<()> {
    options.selection.apply(&mut start.problem.layout, &mut start.state, &options.limits)
}

/// The fit with the lenses and the robot model that the data support.
struct Chosen {
    fit: JointFit,
    /// The robot with all terms, local errors apart.
    widest: Robot,
    series: Vec<MeasuredSeries>,
    evidences: Vec<Evidence>,
    lenses: Vec<LensEvidence>,
    notices: Vec<Notice>,
}

fn choose(chain: &Chain, series: &[MeasuredSeries], options: &Options, by_joint_fit: &Options) -> Result<Chosen> {
    let Lensed { fit: full, series, lenses, mut notices } = with_lenses(chain, series, by_joint_fit)?;
    let widest = full.fit.state.robot.without_local_errors();
    let (fit, evidences) = match options.model_is_open() {
        true => best_model(chain.clone(), &series, options, (full, &mut notices))?,
        false => (full, Vec::new()),
    };
    let fit = near_nominal(chain.clone(), &series, options, fit)?;
    Ok(Chosen { fit, widest, series, evidences, lenses, notices })
}
