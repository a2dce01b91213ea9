//! Whether the poses of a controller are those of a tool, which was taken for the flange, or stand in another frame than the base.
//!
//! With a tool `T` on the flange, or a frame `T` in the base, the controller states `P = N(q) T` or `T^-1 N(q)`, and the readings are
//! `q(T) = N^-1(P T^-1)` or `N^-1(T P)`. A robot that is as in its model would absorb `T` in the hand-eye transform or the target pose, whatever it
//! is; of the real one the errors at `q(T)` are others. So it has the least
//!
//! ```text
//! c(T) = min_x sum_i |e_i - G_i(q(T)) x|^2 + x' P^-1 x
//! ```
//!
//! with `G_i`, `e_i`, `x` as in `computed_postures`; `c` is minimised by Levenberg-Marquardt, `x` eliminated (G. Golub and V. Pereyra 1973).
//!
//! The postures that were told without a tool may be wrong with one. So the search starts from them and from all in which the stops are alike, which
//! is how robots are driven; and where a tool gains, every stop takes the posture that all others predict best with it, in turns.

use nalgebra::{DMatrix, DVector, Matrix6, SymmetricEigen, Vector3, Vector6};
use rayon::prelude::*;

use super::choice::{Candidate, Knowledge, Least, Stop, Stops};
use super::compared::{Compared, SeenAt};
use super::readings::Arm;
use crate::assess::Limits;
use crate::diagnose::{PosesOf, ToolInPoses};
use crate::error::Result;
use crate::geom::{Pose, exp_so3};
use crate::model::robot::Robot;
use crate::problem::{Adjustment, MeasuredSeries, State};
use crate::series::{CameraMount, spread};

/// Stops that are compared, at most.
const MOST_STOPS: usize = 40;
/// Lengths of tools along the axis of the flange from which the search starts, m.
const STARTS_M: [f64; 3] = [0.0, 0.15, -0.15];
/// Most steps of the search.
const STEPS: usize = 12;
/// Rounds in which the stops settle on one family of postures.
const FAMILY_ROUNDS: usize = 4;
/// The best tools, with which postures are looked for all over the joint ranges.
const RECHOSEN: usize = 3;
/// Most times that postures are chosen anew.
const RECHOICES: usize = 4;
/// Step of numerical derivatives, m and rad.
const DIFFERENCE: f64 = 2e-3;
/// Damping beyond which no step gains anything.
const MOST_DAMPING: f64 = 1e3;
/// A step that gains less of the cost ends the search.
const GAINED: f64 = 1e-4;

/// The tool or the frame with which the images fit decidedly better, where the readings of the series were computed from poses.
pub(in crate::identify) fn tool_in_poses(
    robot: &Robot,
    series: &[MeasuredSeries],
    limits: &Limits,
    hold: impl FnOnce(&mut Adjustment) -> Result<()>,
) -> Option<ToolInPoses> {
    let best = Compared::with("tool in poses", robot, (series, limits), hold, |compared| {
        let search = Search::new(compared, series, robot)?.started()?;
        let of = |of: PosesOf| Search { of, ..search.clone() }.told(limits);
        let found = [PosesOf::Tool, PosesOf::Frame].into_iter().filter_map(of);
        found.min_by(|a, b| a.1.cost().total_cmp(&b.1.cost()))
    });
    let (of, best, sigma_m, gain) = best?;
    let place_m = best.tool.fixed_rows::<3>(0).into_owned();
    let names = series.iter().filter(|s| s.readings_are_computed()).map(|s| s.name.clone()).collect();
    Some(ToolInPoses { series: names, of, place_m: place_m.into(), sigma_m: sigma_m.into(), gain })
}

/// A stop as images saw it.
#[derive(Clone)]
struct PosedStop {
    seen: SeenAt,
    /// Readings that reach the pose that was stated; first those that were taken.
    postures: Vec<Vec<f64>>,
    stated: Pose,
}

#[derive(Clone)]
struct Search<'a> {
    compared: &'a Compared,
    of: PosesOf,
    arm: Arm,
    /// The stops that are compared.
    stops: Vec<PosedStop>,
    equations: usize,
    /// Every coordinate of a stop that is out of reach.
    unreached: f64,
    /// The least cost without a tool.
    without: f64,
    /// Readings of all stops to start from; none where the stops fit as they are: there their postures are right.
    families: Vec<Vec<Vec<f64>>>,
}

/// A stop with a tool or a frame.
struct StopWith {
    candidate: Candidate,
    is_reached: bool,
}

/// A tool or a frame, and what the stops say with it.
struct Tried {
    /// m, and rad as a rotation vector.
    tool: Vector6<f64>,
    stops: Vec<StopWith>,
    least: Least,
}

impl Tried {
    const fn cost(&self) -> f64 {
        self.least.cost
    }

    fn readings(&self, stop: usize) -> &[f64] {
        &self.stops[stop].candidate.readings
    }
}

fn pose(tool: &Vector6<f64>) -> Pose {
    let turn: Vector3<f64> = tool.fixed_rows::<3>(3).into_owned();
    Pose::new(exp_so3(&turn), tool.fixed_rows::<3>(0).into_owned())
}

/// A tool or a frame, and the readings of all stops near which theirs are looked for.
type Start = (Vector6<f64>, Vec<Vec<f64>>);

/// Other postures of a stop that reach a pose of the flange than its readings.
trait Others: Fn(&PosedStop, &Pose, &[f64]) -> Vec<Vec<f64>> + Sync {}
impl<F: Fn(&PosedStop, &Pose, &[f64]) -> Vec<Vec<f64>> + Sync> Others for F {}

/// Sum of squares of the differences of readings.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}

/// Readings of all stops near to each other: one for every posture of the stop that has most, as far as they differ.
fn families(stops: &[PosedStop]) -> Vec<Vec<Vec<f64>>> {
    let Some(anchor) = stops.iter().max_by_key(|stop| stop.postures.len()) else { return Vec::new() };
    let nearest = |to: &[f64]| {
        let of = |stop: &PosedStop| {
            stop.postures.iter().min_by(|a, b| apart(a, to).total_cmp(&apart(b, to))).cloned().unwrap_or_default()
        };
        stops.iter().map(of).collect::<Vec<_>>()
    };
    let mut all: Vec<Vec<Vec<f64>>> = Vec::new();
    for posture in &anchor.postures {
        let mut family = nearest(posture);
        for _ in 0..FAMILY_ROUNDS {
            let mean = |k: usize| family.iter().map(|q| q[k]).sum::<f64>() / family.len() as f64;
            family = nearest(&(0..posture.len()).map(mean).collect::<Vec<_>>());
        }
        if !all.contains(&family) {
            all.push(family);
        }
    }
    all
}

impl<'a> Search<'a> {
    fn new(compared: &'a Compared, series: &[MeasuredSeries], robot: &Robot) -> Option<Self> {
        // With another tool the robot may have been where its limits do not let it with this one.
        let arm = Arm::beyond_limits(&robot.chain);
        let problem = &compared.adjustment.problem;
        let taken = |seen: &SeenAt| {
            let seen = seen.by_images()?;
            let first = &problem.images[*seen.images.first()?];
            if !series[first.series].readings_are_computed() {
                return None;
            }
            let taken = problem.stops[first.stop].posture.as_ref()?.readings.clone();
            Some((seen, arm.tip(&taken), taken))
        };
        let all: Vec<_> = compared.stops.iter().filter_map(taken).collect();
        let posed = |k: usize| {
            let (seen, stated, taken) = all[k].clone();
            PosedStop { seen, stated, postures: vec![taken] }
        };
        let stops: Vec<PosedStop> = spread(all.len(), MOST_STOPS).map(posed).collect();
        let equations = stops.iter().map(|stop| 6 * stop.seen.images.len()).sum();
        let (of, unreached, without, families) = (PosesOf::Tool, 0.0, 0.0, Vec::new());
        (!stops.is_empty()).then_some(Self { compared, of, arm, stops, equations, unreached, without, families })
    }

    /// What is known without a tool, and so without a frame.
    fn started(mut self) -> Option<Self> {
        let none = self.at(Vector6::zeros(), |k| &self.stops[k].postures[0])?;
        // Out of reach is worse than a stop usually is without a tool.
        self.unreached = (2.0 * none.cost() / self.equations as f64).sqrt();
        self.without = none.cost();
        let fits = none.cost() < self.equations as f64;
        if !fits {
            self.look_all_over();
            let with_family = self.families.par_iter().filter_map(|family| self.cost_without(family));
            self.without = with_family.collect::<Vec<f64>>().into_iter().fold(self.without, f64::min);
        }
        Some(self)
    }

    /// All postures of the stops, and their families.
    fn look_all_over(&mut self) {
        let Self { stops, arm, .. } = self;
        stops.par_iter_mut().for_each(|stop| {
            let others = arm.others(&stop.stated, &stop.postures[0]);
            stop.postures.extend(others);
        });
        self.families = families(&self.stops);
    }

    /// What the flange carries stands as it was on the tool, what is fixed as it was in the frame.
    fn state(&self, of: &Pose) -> State {
        let Adjustment { problem, state } = &self.compared.adjustment;
        let mut moved = state.clone();
        for image in self.stops.iter().flat_map(|stop| &stop.seen.images).map(|i| &problem.images[*i]) {
            let moves_camera = (image.mount == CameraMount::Hand) == (self.of == PosesOf::Tool);
            match moves_camera {
                true => moved.mountings[image.mounting] = *of * state.mountings[image.mounting],
                false => moved.placements[image.placement] = *of * state.placements[image.placement],
            }
        }
        moved
    }

    /// The pose of the flange where one was stated for a tool, or in a frame.
    fn flange(&self, of: &Pose, stated: &Pose) -> Pose {
        match self.of {
            PosesOf::Tool => *stated * of.inverse(),
            PosesOf::Frame => *of * *stated,
        }
    }

    /// All stops, with readings near to those `from` which they are looked for.
    fn stops_with<'r>(&self, tool: &Vector6<f64>, from: impl Fn(usize) -> &'r [f64] + Sync) -> Option<Vec<StopWith>> {
        let of = pose(tool);
        let state = self.state(&of);
        let origins = state.robot.linear_origins();
        let one = |(k, stop): (usize, &PosedStop)| {
            let found = self.arm.reading_near(&self.flange(&of, &stop.stated), from(k));
            let Some(readings) = found else {
                let rows = 6 * stop.seen.images.len();
                let g = DMatrix::zeros(rows, self.compared.prior.len());
                let e = DVector::from_element(rows, self.unreached);
                let candidate = Candidate { readings: from(k).to_vec(), g, e };
                return Some(StopWith { candidate, is_reached: false });
            };
            let candidate = self.compared.candidate((&state, &origins), &stop.seen, readings)?;
            Some(StopWith { candidate, is_reached: true })
        };
        self.stops.par_iter().enumerate().map(one).collect()
    }

    /// The best one, with the sigma of its place (m) and the gain of the log likelihood, if it is told.
    fn told(&self, limits: &Limits) -> Option<(PosesOf, Tried, Vector3<f64>, f64)> {
        let taken: Vec<Vec<f64>> = self.stops.iter().map(|stop| stop.postures[0].clone()).collect();
        let along = STARTS_M.map(|z| (Vector6::new(0.0, 0.0, z, 0.0, 0.0, 0.0), taken.clone()));
        let best = match self.families.is_empty() {
            true => self.all_least(along.into(), |tried| tried).into_iter().next()?,
            false => self.best_of_postures(along)?,
        };
        let gain = 0.5 * self.equations as f64 * (self.without / best.cost()).ln();
        tracing::debug!(of = ?self.of, gain, left = best.cost(), at = ?best.tool.as_slice(), "tool in poses");
        let sigma_m = self.sigma_m(&best)?;
        let far_m = best.tool.fixed_rows::<3>(0).norm();
        let is_told = gain > limits.tool_log_odds && far_m > limits.tool_sigmas * sigma_m.norm();
        is_told.then_some((self.of, best, sigma_m, gain))
    }

    /// Those that the search ends at from all starts, each gone on with as told, the best first.
    fn all_least(&self, starts: Vec<Start>, then: impl Fn(Tried) -> Tried + Sync) -> Vec<Tried> {
        let least = |(tool, readings): Start| Some(then(self.least(self.at(tool, |k| &readings[k])?)?));
        let mut found: Vec<Tried> = starts.into_par_iter().filter_map(least).collect();
        found.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
        found
    }

    /// The best one with any postures, from these starts and from all families.
    fn best_of_postures(&self, along: [Start; 3]) -> Option<Tried> {
        let of_families = self.families.iter().map(|family| (Vector6::zeros(), family.clone()));
        let starts: Vec<Start> = along.into_iter().chain(of_families).collect();
        let mut found = self.all_least(starts, |tried| self.settled(tried, self.others_near()));
        found.truncate(RECHOSEN);
        let from_all = |_: &PosedStop, flange: &Pose, own: &[f64]| self.arm.others(flange, own);
        let found = found.into_iter().map(|tried| self.settled(tried, from_all));
        found.min_by(|a, b| a.cost().total_cmp(&b.cost()))
    }

    /// Looked for from the postures that a stop has without a tool.
    fn others_near(&self) -> impl Others {
        |stop: &PosedStop, flange: &Pose, own: &[f64]| self.arm.reached_from(&stop.postures, flange, own)
    }

    /// The cost without a tool, from a family of postures, each stop in the one that all others predict best.
    fn cost_without(&self, family: &[Vec<f64>]) -> Option<f64> {
        let mut tried = self.at(Vector6::zeros(), |k| &family[k])?;
        for _ in 0..RECHOICES {
            let Some(readings) = self.rechosen(&tried, &self.others_near()) else { break };
            tried = self.at(Vector6::zeros(), |k| &readings[k])?;
        }
        Some(tried.cost())
    }

    /// With the postures that all stops predict best of each other, of those that `others` gives, and the best tool with them, in turns.
    fn settled(&self, mut tried: Tried, others: impl Others) -> Tried {
        for _ in 0..RECHOICES {
            let next =
                self.rechosen(&tried, &others).and_then(|readings| self.least(self.at(tried.tool, |k| &readings[k])?));
            match next.filter(|next| next.cost() < tried.cost()) {
                Some(next) => tried = next,
                None => break,
            }
        }
        tried
    }

    /// Readings in other postures, some of them, with the same tool; `None` where all stay.
    fn rechosen(&self, tried: &Tried, others: &impl Others) -> Option<Vec<Vec<f64>>> {
        let of = pose(&tried.tool);
        let state = self.state(&of);
        let origins = state.robot.linear_origins();
        let one = |(stop, StopWith { candidate: own, .. }): (&PosedStop, &StopWith)| {
            let others = others(stop, &self.flange(&of, &stop.stated), &own.readings).into_iter();
            let others = others.map(|readings| self.compared.candidate((&state, &origins), &stop.seen, readings));
            let all: Option<Vec<_>> = std::iter::once(Some(own.clone())).chain(others).collect();
            all.map(Stop::of)
        };
        let all: Option<Vec<Stop>> = self.stops.par_iter().zip(&tried.stops).map(one).collect();
        let stops = Stops { all: all?, prior: self.compared.prior.clone() };
        let chosen = stops.descended(vec![0; stops.all.len()])?.postures;
        let of_choice = stops.all.iter().zip(&chosen).map(|(stop, &c)| stop.candidates[c].readings.clone());
        chosen.iter().any(|&c| c > 0).then(|| of_choice.collect())
    }

    /// A tool or a frame, with readings near to those `from` which they are looked for.
    fn at<'r>(&self, tool: Vector6<f64>, from: impl Fn(usize) -> &'r [f64] + Sync) -> Option<Tried> {
        let stops = self.stops_with(&tool, from)?;
        let mut known = Knowledge::of_priors(&self.compared.prior);
        stops.iter().for_each(|stop| known.add(&stop.candidate, 1.0));
        Some(Tried { tool, stops, least: known.least()? })
    }

    /// Residuals of all stops with a tool or frame beside the one that was tried; those that either does not reach as they were there.
    fn residuals_beside(&self, tried: &Tried, tool: &Vector6<f64>) -> Option<Vec<f64>> {
        let moved = self.stops_with(tool, |k| tried.readings(k))?;
        let of = |(moved, own): (&StopWith, &StopWith)| {
            let both = moved.is_reached && own.is_reached;
            let candidate = if both { &moved.candidate } else { &own.candidate };
            candidate.residual(&tried.least.x).data.as_vec().clone()
        };
        Some(moved.iter().zip(&tried.stops).flat_map(of).collect())
    }

    /// Normal equations of the tool with `x` eliminated: information, and the gradient.
    fn reduced(&self, tried: &Tried) -> Option<(Matrix6<f64>, Vector6<f64>)> {
        let own = tried.stops.iter().flat_map(|stop| stop.candidate.residual(&tried.least.x).data.as_vec().clone());
        let r = DVector::from_vec(own.collect());
        let mut j = DMatrix::zeros(r.len(), 6);
        for k in 0..6 {
            let mut moved = tried.tool;
            moved[k] += DIFFERENCE;
            let beside = DVector::from_vec(self.residuals_beside(tried, &moved)?);
            j.set_column(k, &((beside - &r) / DIFFERENCE));
        }
        let mut coupled = DMatrix::zeros(tried.least.x.len(), 6);
        let mut row = 0;
        for g in tried.stops.iter().map(|stop| &stop.candidate.g) {
            coupled.gemm_tr(1.0, g, &j.rows(row, g.nrows()), 1.0);
            row += g.nrows();
        }
        let information = j.transpose() * &j - coupled.transpose() * tried.least.factor.solve_many(&coupled);
        let information = Matrix6::from_column_slice(information.as_slice());
        Some((
            0.5 * (information + information.transpose()),
            Vector6::from_column_slice((j.transpose() * r).as_slice()),
        ))
    }

    fn least(&self, mut tried: Tried) -> Option<Tried> {
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            let (information, gradient) = self.reduced(&tried)?;
            let mut gained = 0.0;
            while damping < MOST_DAMPING {
                let damped = information + Matrix6::from_diagonal(&information.diagonal().map(|d| damping * d + 1.0));
                let step = damped.cholesky()?.solve(&-gradient);
                match self.at(tried.tool + step, |k| tried.readings(k)).filter(|next| next.cost() < tried.cost()) {
                    Some(next) => {
                        gained = 1.0 - next.cost() / tried.cost();
                        tried = next;
                        damping *= 0.1;
                        break;
                    }
                    None => damping *= 10.0,
                }
            }
            if gained < GAINED {
                break;
            }
        }
        Some(tried)
    }

    /// Sigma of the position of a tool, m, by the scatter that it leaves.
    fn sigma_m(&self, tried: &Tried) -> Option<Vector3<f64>> {
        let (information, _) = self.reduced(tried)?;
        let SymmetricEigen { eigenvectors, eigenvalues } = information.symmetric_eigen();
        // What nothing tells is a turn about the last axis, which the zero of that joint takes.
        let inverse = eigenvalues.map(|v| 1.0 / v.max(1.0));
        let covariance = eigenvectors * Matrix6::from_diagonal(&inverse) * eigenvectors.transpose();
        let scatter = tried.cost() / self.equations as f64;
        Some(covariance.diagonal().fixed_rows::<3>(0).map(|v| (scatter * v).sqrt()))
    }
}
