//! Planning: candidates, choice, order, and what the chosen images will be worth.

use std::time::Instant;

use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::error::{Code, Error, Result};
use crate::linalg::LinearRow;
use crate::linalg::median;
use crate::plan::candidates::{Candidate, CandidateCounts, CandidateOptions, Search, candidates, workspace};
use crate::plan::criterion::Criterion;
use crate::plan::information::{Identified, candidate_information, flange_weight, stop_information};
use crate::plan::order::{Leg, imbalance, leg_across, tour};
use crate::plan::refine::{Refined, Refinement};
use crate::plan::relax::NoDesign;
use crate::plan::rounding::round;
use crate::plan::scene::{Scene, SceneOptions};
use crate::plan::setting::{PlannedStop, Setting, rough_knowledge};
use crate::problem::{Adjustment, Layout};

/// What the user wants to know.
#[derive(Debug, Clone, PartialEq)]
pub enum Demand {
    /// The position of the flange over the workspace (I-optimal).
    Workspace,
    /// The position of the flange at these joint vectors (I-optimal).
    Targets(Vec<Vec<f64>>),
    /// All parameters of the robot alike (D-optimal).
    Parameters,
    /// These parameters, each in units of its prior sigma.
    Named(Vec<String>),
}

/// Linear limits on the choice.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Budget {
    /// Images at most with the plate at one place.
    pub most_per_placement: Option<usize>,
    /// Images at least with the plate at every place.
    pub least_per_placement: Option<usize>,
    /// Images at most in one posture of the arm.
    pub most_per_posture: Option<usize>,
    /// Sum over the images of the greatest joint motion from the middle posture, rad, at most.
    pub travel_rad: Option<f64>,
}

/// What is to be planned.
#[derive(Debug, Clone)]
pub struct PlanRequest {
    /// What is roughly known.
    pub setting: Setting,
    /// Images that were taken already.
    pub taken: Vec<PlannedStop>,
    /// Images.
    pub count: usize,
    /// Criterion.
    pub demand: Demand,
    /// Limits on the choice.
    pub budget: Budget,
    /// Candidates.
    pub candidates: CandidateOptions,
    /// Rounds of search for further candidates where they pay.
    pub rounds: usize,
    /// What must not be touched.
    pub scene: SceneOptions,
}

/// The planned stops.
#[derive(Debug, Clone)]
pub struct Plan {
    /// What they were chosen from.
    pub choice: Choice,
    /// Chosen candidates in the order of the visit, with the ways to them.
    pub legs: Vec<Leg>,
    /// One-sidedness of the approach of each joint.
    pub imbalance: Vec<f64>,
}

impl std::ops::Deref for Plan {
    type Target = Choice;

    fn deref(&self) -> &Choice {
        &self.choice
    }
}

/// Joint vectors that stand for the workspace.
const TARGETS: usize = 250;

/// The choice before it is put in order.
#[derive(Debug, Clone)]
pub struct Choice {
    /// All candidates: those drawn at random, then those found near the best.
    pub pool: Vec<Candidate>,
    /// How many of them were drawn at random.
    pub drawn: usize,
    /// Criterion of the relaxed weights before the first round of search and after each.
    pub values: Vec<f64>,
    /// Their information, in the identified directions ([`Identified`]).
    pub information: Vec<DMatrix<f64>>,
    /// What fell out.
    pub tally: CandidateCounts,
    /// Relaxed weights.
    pub weights: Vec<f64>,
    /// Chosen candidates, ascending.
    pub chosen: Vec<usize>,
    /// Certified efficiency of relaxation and whole images.
    pub efficiency: [f64; 2],
    /// Joint vectors over which the accuracy of the flange is meant.
    pub targets: Vec<Vec<f64>>,
    /// Its weight: the mean squared error is `tr(W cov)`.
    pub weight: DMatrix<f64>,
    /// Information before the first image, in the identified directions ([`Identified`]).
    pub known: DMatrix<f64>,
    /// What images tell.
    pub identified: Identified,
    /// The problem without images, at the state about which it is linearised.
    pub adjustment: Adjustment,
}

/// Does something and logs how long it took.
fn timed<T>(phase: &str, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let done = work();
    tracing::info!("{phase}: {:.2} s", start.elapsed().as_secs_f64());
    done
}

/// Joint vectors over which the accuracy of the flange is meant; those of the candidates where there are none.
fn targets(request: &PlanRequest, scene: &Scene, pool: &[Candidate]) -> Vec<Vec<f64>> {
    let CandidateOptions { limit_margin, seed, .. } = request.candidates;
    let targets = match &request.demand {
        Demand::Targets(list) => list.clone(),
        _ => workspace(&request.setting, scene, TARGETS, limit_margin, seed),
    };
    if targets.is_empty() { pool.iter().map(|c| c.readings.clone()).collect() } else { targets }
}

/// Chooses poses.
///
/// # Errors
/// Where no pose is workable, where limits contradict each other, where a parameter asked for is unknown.
pub fn choose(request: &PlanRequest) -> Result<Choice> {
    let setting = &request.setting;
    let scene = Scene::new(setting, &request.scene);
    let (pool, tally) = timed("candidates", || candidates(setting, &scene, &request.candidates))?;
    let adjustment = setting.adjustment();
    let problem = &adjustment.problem;
    let rough = rough_knowledge(problem, &setting.camera);
    let prior: Vec<f64> = rough.diagonal().iter().map(|m| 1.0 / m).collect();
    let taken = request.taken.iter().filter_map(|stop| stop_information(&adjustment, stop));
    let known = taken.fold(rough, |known, m| known + m);
    let targets = targets(request, &scene, &pool);
    let weight = flange_weight(problem, &setting.robot, &targets);
    let criterion = criterion(&request.demand, &problem.layout, &weight)?;
    let drawn = pool.len();
    let refused = |reason| no_plan(reason, request, drawn);
    let (identified, known, information) = timed("information", || {
        let whole: Vec<DMatrix<f64>> =
            pool.par_iter().map(|c| candidate_information(&adjustment, setting, c)).collect();
        let identified = identified(&criterion, &prior, &known, &whole);
        let information: Vec<DMatrix<f64>> = whole.par_iter().map(|m| identified.information(m)).collect();
        let known = identified.known(&known);
        (identified, known, information)
    });
    let criterion = identified.criterion(&criterion);
    let refinement = Refinement {
        search: &Search::new(setting, &scene, &request.candidates),
        inform: &|candidate| identified.of_candidate(&adjustment, setting, candidate),
        rows: &|pool| rows(&request.budget, pool, drawn, setting.placements.len()),
        known: &known,
        criterion: &criterion,
        count: request.count,
        rounds: request.rounds,
    };
    let refined = timed("weights and further candidates", || refinement.refine(pool, information, tally));
    let mut refined = refined.map_err(refused)?;
    let rounded =
        timed("whole images", || round(&refinement.design(&refined.information, &refined.rows), &refined.relaxed));
    let mut rounded = rounded.ok_or_else(|| refused(NoDesign::Contradiction))?;
    timed("whole images made better", || refinement.polish(&mut refined, &mut rounded)).map_err(refused)?;
    let Refined { pool, information, relaxed, tally, values, .. } = refined;
    Ok(Choice {
        drawn,
        values,
        tally,
        weights: relaxed.weights,
        chosen: rounded.chosen,
        efficiency: [relaxed.efficiency, rounded.efficiency],
        targets,
        weight,
        adjustment,
        pool,
        information,
        known,
        identified,
    })
}

/// Chooses poses and their order.
///
/// # Errors
/// As [`choose`].
pub fn plan(request: &PlanRequest) -> Result<Plan> {
    let choice = choose(request)?;
    let scene = Scene::new(&request.setting, &request.scene);
    let legs = timed("order", || legs(&choice.pool, &choice.chosen, &scene, request.setting.placements.len()));
    let visited: Vec<&[f64]> = legs.iter().map(|l| choice.pool[l.stop].readings.as_slice()).collect();
    let imbalance = imbalance(&visited);
    Ok(Plan { choice, legs, imbalance })
}

/// What the images tell that were taken (they are in `known`) and those that could be; all columns where the criterion needs them.
fn identified(criterion: &Criterion, prior: &[f64], known: &DMatrix<f64>, all: &[DMatrix<f64>]) -> Identified {
    match criterion {
        Criterion::Volume(_) => Identified::everything(prior.len()),
        Criterion::MeanVariance(_) => {
            let mut sum = all.iter().fold(known.clone(), |sum, m| sum + m);
            (0..prior.len()).for_each(|k| sum[(k, k)] -= 1.0 / prior[k]);
            Identified::of(&sum, prior)
        }
    }
}

pub(super) fn criterion(demand: &Demand, layout: &Layout, weight: &DMatrix<f64>) -> Result<Criterion> {
    let robot = layout.terms.end;
    match demand {
        Demand::Workspace | Demand::Targets(_) => Ok(Criterion::weighted(weight)),
        Demand::Parameters => Ok(Criterion::Volume(robot)),
        Demand::Named(names) => {
            let mut b = DMatrix::zeros(layout.len(), 0);
            for name in names {
                let wanted = layout.named_within(0..robot, "--parameters", name)?;
                for k in wanted {
                    b = b.insert_column(0, 0.0);
                    b[(k, 0)] = 1.0 / layout.columns[k].prior_sigma;
                }
            }
            Ok(Criterion::MeanVariance(b))
        }
    }
}

/// Rows of the polytope over candidates, the first `drawn` of them random.
fn rows(budget: &Budget, pool: &[Candidate], drawn: usize, placements: usize) -> Vec<LinearRow> {
    let mut rows = Vec::new();
    let mut group = |low: f64, high: f64, inside: &dyn Fn(&Candidate) -> f64| {
        rows.push(LinearRow { coefficients: pool.iter().map(inside).collect(), low, high });
    };
    if budget.most_per_placement.is_some() || budget.least_per_placement.is_some() {
        for p in 0..placements {
            let low = budget.least_per_placement.unwrap_or(0) as f64;
            let high = budget.most_per_placement.map_or(f64::INFINITY, |m| m as f64);
            group(low, high, &|c| f64::from(u8::from(c.placement == p)));
        }
    }
    if let Some(most) = budget.most_per_posture {
        let mut postures: Vec<u32> = pool.iter().map(|c| c.posture).collect();
        postures.sort_unstable();
        postures.dedup();
        for posture in postures {
            group(0.0, most as f64, &|c| f64::from(u8::from(c.posture == posture)));
        }
    }
    if let Some(travel) = budget.travel_rad {
        let joints = pool.first().map_or(0, |c| c.readings.len());
        let middle: Vec<f64> =
            (0..joints).map(|j| median(pool[..drawn].iter().map(|c| c.readings[j])).unwrap_or(0.0)).collect();
        group(f64::NEG_INFINITY, travel, &|c| crate::plan::order::motion(&c.readings, &middle));
    }
    rows
}

fn legs(pool: &[Candidate], chosen: &[usize], scene: &Scene, placements: usize) -> Vec<Leg> {
    let mut all: Vec<Leg> = Vec::new();
    let spare = |places: &[usize]| {
        let there = pool.iter().filter(|c| places.contains(&c.placement));
        there.map(|c| c.readings.clone()).collect::<Vec<_>>()
    };
    for placement in 0..placements {
        let here: Vec<usize> = chosen.iter().copied().filter(|&k| pool[k].placement == placement).collect();
        let stops: Vec<Vec<f64>> = here.iter().map(|&k| pool[k].readings.clone()).collect();
        let part = tour(&stops, scene, placement, &spare(&[placement]));
        let mut part: Vec<Leg> = part.into_iter().map(|leg| Leg { stop: here[leg.stop], ..leg }).collect();
        if let Some((last, first)) = all.last().zip(part.first_mut()) {
            let [from, to] = [last.stop, first.stop].map(|k| &pool[k]);
            let places = [from.placement, placement];
            *first = leg_across(first.stop, [&from.readings, &to.readings], scene, places, &spare(&places));
        }
        all.extend(part);
    }
    all
}

fn no_plan(reason: NoDesign, request: &PlanRequest, pool: usize) -> Error {
    let count = request.count;
    match reason {
        NoDesign::TooFew => Error::new(
            Code::PlanTooFewPoses,
            "plan",
            format!("only {pool} workable poses were found, {count} are wanted"),
            "ask for fewer images, search longer (--candidates), or loosen --markers, --tilt-deg, --distance-m",
        ),
        NoDesign::Contradiction => Error::new(
            Code::PlanContradiction,
            "plan",
            format!("no choice of {count} images fulfils the limits per placement, per posture and of travel"),
            "loosen --per-placement, --per-posture or --travel-rad, or ask for another --count",
        ),
        NoDesign::Numerical => Error::new(
            Code::PlanUndetermined,
            "plan",
            "the information of the candidates is not positive definite",
            "check --pixel-noise-px and --joint-noise-mrad, and the size of the plate",
        ),
    }
}
