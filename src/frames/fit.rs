//! Generalised least squares over tool, work object and unknown places, with the covariance and the joint noise of the robot.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::absorbed::{absorbed, region};
use super::determined::check;
use super::equations::{Columns, Given, Rows, Unknowns, rows, sigmas};
use super::knowledge::{Knowledge, scatter_m};
use super::robot::KnownRobot;
use super::start::start;
use super::touch::{Touch, TouchPlace, Touches};
use crate::assess::{Limits, root_of_mean};
use crate::error::{Code, Error, Result};
use crate::geom::Pose;
use crate::linalg::{SymmetricFactor, product};
use crate::model::robot::Posture;

/// Most steps.
const ROUNDS: usize = 50;
/// Step that ends them, m and rad.
const STEP: f64 = 1e-13;
/// Change of the size of the errors that ends its search.
const SIZE: f64 = 1e-6;
/// Degrees of freedom that a stated sigma is worth.
const STATED: f64 = 4.0;

/// One touch after the fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged {
    /// Measured less predicted in the base, m: latent joint noise is in it.
    pub residual_m: Vector3<f64>,
    /// Length of the residual in its own sigmas, scaled so that the bound is that of a free normal vector; by the others, where left out.
    pub sigmas: f64,
    /// True where it is left out: it disagrees with the others.
    pub left_out: bool,
}

/// Tool and work object with what is known of them.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameFit {
    /// `tip_from_tool` of every body.
    pub tools: Vec<Pose>,
    /// `base_from_work`; `None` where no place is known.
    pub work: Option<Pose>,
    /// Unknown places in the work object (in the base where there is none), m.
    pub places: Vec<Vector3<f64>>,
    /// Covariance of each tool: 3x3 along the axes of the tip, 6x6 of its body twist for a pose; `None` where it was given.
    pub tool_covariances: Vec<Option<DMatrix<f64>>>,
    /// Covariance of the work object, body twist; of the plate that of the solution.
    pub work_covariance: Option<DMatrix<f64>>,
    /// What goes on to targets.
    pub knowledge: Knowledge,
    /// Factor that the touches ask for on their stated sigmas.
    pub factor: f64,
    /// The residuals by the sigmas as they are stated.
    pub as_stated: AsStated,
    /// Factor that what the touches say of the robot asks for on the covariance of the solution.
    pub robot_factor: f64,
    /// Of the directions in which the touches say most of the robot the one in which it is farthest from the solution, in sigmas of that.
    pub robot_sigmas: f64,
    /// One for each touch.
    pub judged: Vec<Judged>,
    /// RMS of the lengths of the residuals in use, m.
    pub rms_m: f64,
    /// What can be expected of the tool over the stops and touches, RMS of the length.
    pub expected: Expected,
}

impl FrameFit {
    /// The largest of the factors: how far the touches contradict each other, or the solution, in all directions or in one.
    pub fn contradiction(&self, limits: &Limits) -> f64 {
        let in_one = self.robot_sigmas * limits.touch_factor / limits.sigmas_beyond_tolerance;
        self.factor.max(self.robot_factor).max(in_one)
    }
}

/// Residuals of touches in use by stated sigmas, joint noise and covariance of the solution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AsStated {
    /// Their size: root of the mean square over the degrees of freedom, 1 where the sigmas are right.
    pub size: f64,
    /// Degrees of freedom.
    pub freedom: usize,
}

/// Expected error of the tool over the stops and touches, RMS of the length, m. Joint noise is apart: no frame removes it.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Expected {
    /// With these frames.
    pub with_frames_m: f64,
    /// With tool and base where the description says.
    pub without_m: f64,
    /// By the joint noise of a stop.
    pub joint_noise_m: f64,
}

/// Normal equations solved at some values of the unknowns.
struct Solved {
    /// Step of the free columns, then `z`.
    step: DVector<f64>,
    /// `P`.
    inverse: DMatrix<f64>,
    /// `M L`.
    absorbed: DMatrix<f64>,
    stops: Vec<StopPart>,
}

/// All measurements of one stop.
struct StopPart {
    /// Index of each measurement, and its rows.
    touches: Vec<(usize, std::ops::Range<usize>)>,
    /// `[A, G' L]`.
    j: DMatrix<f64>,
    r: DVector<f64>,
    /// `V`, with its inverse and `sigma^2` as stated.
    v: DMatrix<f64>,
    weight: DMatrix<f64>,
    stated: DVector<f64>,
}

struct Work<'a> {
    robot: &'a KnownRobot,
    touches: &'a Touches,
    columns: Columns,
    region: Vec<Posture>,
}

impl Work<'_> {
    fn solved(&self, unknowns: &Unknowns, used: &[bool], factor: f64) -> Option<Solved> {
        let absorbed = absorbed(self.robot, unknowns, &self.columns, &self.region)?;
        let (free, taking) = (&self.columns.free, self.columns.frames());
        let (x, z) = (free.len(), absorbed.ncols());
        let mut by_stop: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (k, t) in self.touches.all.iter().enumerate().filter(|(k, _)| used[*k]) {
            by_stop.entry(t.posture).or_default().push(k);
        }
        let (mut n, mut right) = (DMatrix::zeros(x + z, x + z), DVector::zeros(x + z));
        (x..x + z).for_each(|k| n[(k, k)] = 1.0);
        let mut stops = Vec::with_capacity(by_stop.len());
        for (posture, members) in by_stop {
            let part = self.stop(unknowns, (posture, &members), factor, &absorbed, (x, z, taking))?;
            let wj = product(&part.weight, &part.j);
            n += product(&part.j.transpose(), &wj);
            right += wj.tr_mul(&part.r);
            stops.push(part);
        }
        let solver = SymmetricFactor::new(&n).ok()?;
        Some(Solved { step: solver.solve(&right), inverse: solver.inverse(), absorbed, stops })
    }

    fn stop(
        &self,
        unknowns: &Unknowns,
        (posture, members): (usize, &[usize]),
        factor: f64,
        absorbed: &DMatrix<f64>,
        (x, z, taking): (usize, usize, usize),
    ) -> Option<StopPart> {
        let all: Vec<Rows> = members
            .iter()
            .map(|&k| {
                let t = &self.touches.all[k];
                rows(self.robot, unknowns, &self.columns, &self.touches.postures[posture], (t.body, &t.seen))
            })
            .collect();
        let count: usize = all.iter().map(|rows| rows.r.len()).sum();
        let mut j = DMatrix::zeros(count, x + z);
        let mut h = DMatrix::zeros(count, self.robot.joint_sigma.len());
        let (mut r, mut stated) = (DVector::zeros(count), DVector::zeros(count));
        let (mut touches, mut at) = (Vec::with_capacity(members.len()), 0);
        for (&k, rows) in members.iter().zip(&all) {
            let rows_here = rows.r.len();
            for (to, &column) in self.columns.free.iter().enumerate() {
                j.view_mut((at, to), (rows_here, 1)).copy_from(&rows.a.column(column));
            }
            let left = self.robot.in_units(&rows.g) - product(&rows.a.columns(0, taking).into_owned(), absorbed);
            j.view_mut((at, x), (rows_here, z)).copy_from(&left);
            h.rows_mut(at, rows_here).copy_from(&rows.h);
            r.rows_mut(at, rows_here).copy_from(&rows.r);
            for (i, sigma) in sigmas(&self.touches.all[k]).iter().enumerate() {
                stated[at + i] = sigma * sigma;
            }
            touches.push((k, at..at + rows_here));
            at += rows_here;
        }
        let v = &h * h.transpose() + DMatrix::from_diagonal(&(&stated * factor.powi(2)));
        let weight = SymmetricFactor::new(&v).ok()?.inverse();
        Some(StopPart { touches, j, r, v, weight, stated })
    }

    /// Unknowns and size of the errors at the optimum.
    fn converged(&self, from: &Unknowns, used: &[bool]) -> Option<(Unknowns, f64, Solved)> {
        let (mut unknowns, mut factor) = (from.clone(), 1.0);
        for round in 0.. {
            let solved = self.solved(&unknowns, used, factor)?;
            let step = solved.step.rows(0, self.columns.free.len()).into_owned();
            let next = size(&solved, factor);
            let is_still = step.amax() < STEP && (next / factor - 1.0).abs() < SIZE;
            if is_still || round == ROUNDS {
                return step.iter().all(|s| s.is_finite()).then_some((unknowns, factor, solved));
            }
            unknowns = unknowns.stepped(&self.columns, &step);
            factor = next;
        }
        None
    }
}

impl Solved {
    /// `z` has the covariance `I` by the solution, of which `I - P_zz` is what the touches can tell.
    fn robot_factor(&self, free: usize) -> f64 {
        let z = self.step.rows(free, self.step.len() - free);
        let told = (0..z.len()).map(|k| 1.0 - self.inverse[(free + k, free + k)]).sum::<f64>();
        ((z.norm_squared() + STATED) / (told.max(0.0) + STATED)).sqrt()
    }

    /// `z` in the directions of `I - P_zz`, each in its own sigmas: the largest of those that the touches tell more of than the solution does.
    fn robot_sigmas(&self, free: usize) -> f64 {
        let n = self.step.len() - free;
        let z = self.step.rows(free, n);
        let told = DMatrix::identity(n, n) - self.inverse.view((free, free), (n, n));
        let eigen = told.symmetric_eigen();
        let of = |k: usize| eigen.eigenvectors.column(k).dot(&z).abs() / eigen.eigenvalues[k].sqrt();
        (0..n).filter(|&k| eigen.eigenvalues[k] > 0.5).map(of).fold(0.0, f64::max)
    }
}

/// `v = r - J step`.
fn residual(part: &StopPart, solved: &Solved) -> DVector<f64> {
    &part.r - &part.j * &solved.step
}

/// The factor on the stated sigmas that the residuals ask for.
fn size(solved: &Solved, factor: f64) -> f64 {
    let (mut squares, mut trace) = (0.0, 0.0);
    for part in &solved.stops {
        let pull = &part.weight * residual(part, solved);
        let wj = product(&part.weight, &part.j);
        let told = product(&wj, &product(&solved.inverse, &wj.transpose()));
        for (k, stated) in part.stated.iter().enumerate() {
            squares += stated * pull[k].powi(2);
            trace += stated * (part.weight[(k, k)] - told[(k, k)]);
        }
    }
    let s2 = factor.powi(2);
    ((s2 * s2 * squares + STATED) / (s2 * trace.max(0.0) + STATED)).sqrt()
}

/// Length of a vector in the sigmas of its covariance; directions without any are left out.
fn length(v: &DVector<f64>, covariance: &DMatrix<f64>, scale: &DMatrix<f64>) -> f64 {
    let whole = scale.diagonal().max();
    let eigen = ((covariance + covariance.transpose()) * 0.5).symmetric_eigen();
    let square = |k: usize| match eigen.eigenvalues[k] > UNCONTROLLED * whole {
        true => eigen.eigenvectors.column(k).dot(v).powi(2) / eigen.eigenvalues[k],
        false => 0.0,
    };
    (0..v.len()).map(square).sum::<f64>().sqrt()
}

/// Share of its variance below which a residual is no witness.
const UNCONTROLLED: f64 = 1e-3;

/// Residual of every measurement in use and its length in sigmas.
fn judged(solved: &Solved) -> BTreeMap<usize, (DVector<f64>, f64)> {
    let mut all = BTreeMap::new();
    for part in &solved.stops {
        let v = residual(part, solved);
        let covariance = &part.v - product(&part.j, &product(&solved.inverse, &part.j.transpose()));
        for (k, range) in &part.touches {
            let (at, n) = (range.start, range.len());
            let own = v.rows(at, n).into_owned();
            let block = |m: &DMatrix<f64>| m.view((at, at), (n, n)).into_owned();
            all.insert(*k, (own.clone(), length(&own, &block(&covariance), &block(&part.v))));
        }
    }
    all
}

/// The place of a touch less that of the tool, in the base, m.
fn missed(robot: &KnownRobot, touches: &Touches, unknowns: &Unknowns, t: &Touch) -> Vector3<f64> {
    let tip = robot.at(&touches.postures[t.posture]).0;
    let place = match t.seen {
        TouchPlace::Point(place) => place,
        TouchPlace::Pose(pose) => pose.translation,
        TouchPlace::Unknown(contact) => unknowns.places[contact],
    };
    unknowns.work.transform(&place) - tip.transform(&unknowns.tools[t.body].translation)
}

/// By the closed form that the fit starts from: what the touches miss, m RMS, and unknown places in the work object, m; `None` where there is none.
pub fn closed_form(robot: &KnownRobot, touches: &Touches, given: &Given) -> Option<(f64, Vec<Vector3<f64>>)> {
    let unknowns = start(robot, touches, &Columns::new(touches, given), given)?;
    let rms_m = root_of_mean(touches.all.iter().map(|t| missed(robot, touches, &unknowns, t).norm_squared()));
    rms_m.is_finite().then_some((rms_m, unknowns.places))
}

/// Tool and work object that fit the touches best.
///
/// # Errors
/// Touches that do not determine them ([`Code::TouchesFew`] and others say why).
pub fn fit(robot: &KnownRobot, touches: &Touches, given: &Given, limits: &Limits) -> Result<FrameFit> {
    let columns = Columns::new(touches, given);
    check(robot, touches, &columns, given, limits)?;
    let undetermined = || {
        let what = "the touches do not determine tool and work object together";
        let remedy = "touch more points, spread over the region, with the tip turned by 30 degrees and more about different axes";
        Error::new(Code::FramesUndetermined, "touches", what, remedy)
    };
    let begin = start(robot, touches, &columns, given).ok_or_else(undetermined)?;
    let work = Work { robot, touches, columns, region: region(robot, &touches.postures) };
    let mut used = vec![true; touches.all.len()];
    let (mut unknowns, mut factor, mut solved) = work.converged(&begin, &used).ok_or_else(undetermined)?;
    let most_left_out = touches.all.len() / limits.touches_for_one_left_out;
    let mut without: BTreeMap<usize, f64> = BTreeMap::new();
    while without.len() < most_left_out {
        let lengths = judged(&solved);
        let Some((&worst, _)) = lengths.iter().max_by(|a, b| a.1.1.total_cmp(&b.1.1)) else { break };
        used[worst] = false;
        let others = work.converged(&unknowns, &used);
        let beyond = others.as_ref().and_then(|(u, s, solved)| {
            let sigmas = predicted(&work, u, *s, solved, worst)?;
            let is_pose = matches!(touches.all[worst].seen, TouchPlace::Pose(_));
            (sigmas > limits.bounds().of_body(is_pose, false)).then_some(sigmas)
        });
        match (beyond, others) {
            (Some(sigmas), Some(found)) => {
                without.insert(worst, sigmas);
                (unknowns, factor, solved) = found;
            }
            _ => {
                used[worst] = true;
                break;
            }
        }
    }
    Ok(work.finished(&unknowns, factor, &solved, &without))
}

/// Length in sigmas of the difference between a measurement and what the others predict.
fn predicted(work: &Work<'_>, unknowns: &Unknowns, factor: f64, solved: &Solved, touch: usize) -> Option<f64> {
    let (x, z) = (work.columns.free.len(), solved.absorbed.ncols());
    let member = (work.touches.all[touch].posture, &[touch][..]);
    let part = work.stop(unknowns, member, factor, &solved.absorbed, (x, z, work.columns.frames()))?;
    let covariance = &part.v + product(&part.j, &product(&solved.inverse, &part.j.transpose()));
    Some(length(&residual(&part, solved), &covariance, &covariance))
}

impl Work<'_> {
    /// `sum v' V^-1 v + z' z` has as many degrees of freedom as there are rows beyond the free columns.
    fn as_stated(&self, unknowns: &Unknowns, without: &BTreeMap<usize, f64>) -> AsStated {
        let used: Vec<bool> = (0..self.touches.all.len()).map(|k| !without.contains_key(&k)).collect();
        let Some(solved) = self.solved(unknowns, &used, 1.0) else { return AsStated { size: 1.0, freedom: 0 } };
        let free = self.columns.free.len();
        let rows: usize = solved.stops.iter().map(|part| part.r.len()).sum();
        let of_stop = |part: &StopPart| {
            let v = residual(part, &solved);
            v.dot(&(&part.weight * &v))
        };
        let of_touches: f64 = solved.stops.iter().map(of_stop).sum();
        let of_robot = solved.step.rows(free, solved.step.len() - free).norm_squared();
        let freedom = rows.saturating_sub(free);
        AsStated { size: ((of_touches + of_robot) / freedom.max(1) as f64).sqrt(), freedom }
    }

    fn finished(&self, unknowns: &Unknowns, factor: f64, solved: &Solved, without: &BTreeMap<usize, f64>) -> FrameFit {
        let columns = &self.columns;
        let lengths = judged(solved);
        let judge = |(k, t): (usize, &Touch)| {
            let residual_m = missed(self.robot, self.touches, unknowns, t);
            let left_out = without.get(&k);
            let sigmas = left_out.copied().or_else(|| Some(lengths.get(&k)?.1)).unwrap_or_default();
            Judged { residual_m, sigmas, left_out: left_out.is_some() }
        };
        let judged: Vec<Judged> = self.touches.all.iter().enumerate().map(judge).collect();
        let used: Vec<f64> = judged.iter().filter(|j| !j.left_out).map(|j| j.residual_m.norm_squared()).collect();
        let block = |range: &std::ops::Range<usize>| {
            let first = columns.free.iter().position(|c| *c == range.start)?;
            Some(solved.inverse.view((first, first), (range.len(), range.len())).into_owned())
        };
        let plate = || {
            let first = self.robot.plate_column()?;
            Some(self.robot.covariance().view((first, first), (6, 6)).into_owned())
        };
        let has_work = self.touches.frame.is_some();
        let knowledge = Knowledge::new(self.robot, columns, (&solved.inverse, &solved.step), &solved.absorbed);
        let (tool, none) = (&unknowns.tools[0], Knowledge::none(self.robot));
        let rms = |of: &dyn Fn(&Posture) -> f64| root_of_mean(self.region.iter().map(|p| of(p).powi(2)));
        let expected = Expected {
            with_frames_m: rms(&|p| knowledge.sigma_m(self.robot, p, tool, &unknowns.work)),
            without_m: rms(&|p| none.sigma_m(self.robot, p, tool, &unknowns.work)),
            joint_noise_m: rms(&|p| scatter_m(self.robot, p, tool)),
        };
        FrameFit {
            expected,
            tool_covariances: columns.tools.iter().map(block).collect(),
            work_covariance: block(&columns.work).or_else(plate),
            knowledge,
            tools: unknowns.tools.clone(),
            work: has_work.then_some(unknowns.work),
            places: unknowns.places.clone(),
            factor,
            as_stated: self.as_stated(unknowns, without),
            robot_factor: solved.robot_factor(columns.free.len()),
            robot_sigmas: solved.robot_sigmas(columns.free.len()),
            rms_m: (used.iter().sum::<f64>() / used.len().max(1) as f64).sqrt(),
            judged,
        }
    }
}

/// Standard deviation along each axis, and the largest with its direction, of a covariance of positions.
pub fn widest(covariance: &Matrix3<f64>) -> (f64, Vector3<f64>) {
    let eigen = covariance.symmetric_eigen();
    let k = eigen.eigenvalues.imax();
    (eigen.eigenvalues[k].max(0.0).sqrt(), eigen.eigenvectors.column(k).into_owned())
}
