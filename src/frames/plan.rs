//! Which touches tell most of the tool at the targets: joint stops and points, chosen one after the other and exchanged (A-optimal).
//!
//! With `N` the information of the touches so far and of the priors and `P` its inverse, a touch with the rows `J` and the covariance `V`
//! lowers the mean variance at the targets, `tr(P Q)`, by `tr((V + J P J')^-1 J P Q P J')`; `Q` is the mean of `[A, G'L]' [A, G'L]` over
//! the targets.

use nalgebra::{DMatrix, Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::absorbed::{absorbed, region};
use super::determined::extents_m;
use super::equations::{Columns, Unknowns, rows};
use super::robot::KnownRobot;
use super::touch::TouchPlace;
use crate::assess::Limits;
use crate::error::{Code, Error, Result};
use crate::geom::Pose;
use crate::linalg::{SymmetricFactor, dense, product};
use crate::model::inverse::{Reach, reading_limits, solve_from};
use crate::model::robot::Posture;

/// What is known of tool and work object before: 0.1 m and 0.1 rad, so that nearly nothing is.
const BEFORE: f64 = 0.1;
/// Rounds in which each touch is given up for a better one.
const EXCHANGES: usize = 3;
/// Gain of an exchange, relative to what is left, that is worth it.
const GAIN: f64 = 1e-3;
/// Seed of the postures that are tried.
const SEED: u64 = 1;

/// What touches are to be planned.
#[derive(Debug, Clone)]
pub struct TouchRequest {
    /// Points of the work object by name, m.
    pub points: Vec<(String, Vector3<f64>)>,
    /// `tip_from_tool`, roughly.
    pub tool: Pose,
    /// `base_from_work`, roughly.
    pub work: Pose,
    /// Number of touches.
    pub count: usize,
    /// Sigma of a touch per axis, m.
    pub sigma_m: f64,
    /// Largest angle between the tool's z axis and straight down on the work object (against its z axis), rad.
    pub tilt_rad: f64,
    /// Postures at which the tool is to be right; empty: the stops of the identification.
    pub targets: Vec<Posture>,
    /// Postures that are tried at each point.
    pub tries: usize,
}

/// One planned touch.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedTouch {
    /// Index of the point.
    pub point: usize,
    /// Readings, rad or m.
    pub readings: Vec<f64>,
    /// Expected error of the tool at the targets with this touch and all before it, RMS, m; joint noise of an arrival is apart.
    pub expected_m: f64,
}

/// A plan of touches.
#[derive(Debug, Clone, PartialEq)]
pub struct TouchPlan {
    /// In the order in which they tell most.
    pub touches: Vec<PlannedTouch>,
    /// Indices of points that no posture touches.
    pub unreached: Vec<usize>,
}

/// A posture that touches a point.
struct Candidate {
    point: usize,
    readings: Vec<f64>,
    /// `[A, G'L]`.
    j: DMatrix<f64>,
    v: Matrix3<f64>,
}

struct Search<'a> {
    robot: &'a KnownRobot,
    request: &'a TouchRequest,
    unknowns: Unknowns,
    columns: Columns,
    absorbed: DMatrix<f64>,
}

/// Touches for a robot, in the order in which they tell most.
///
/// # Errors
/// Points that are out of reach; fewer postures than touches.
pub fn plan_touches(robot: &KnownRobot, request: &TouchRequest, limits: &Limits) -> Result<TouchPlan> {
    let unknowns = Unknowns { tools: vec![request.tool], work: request.work, places: Vec::new() };
    let columns = Columns::of_one(3);
    let samples = region(robot, &request.targets);
    let undetermined = || {
        Error::new(
            Code::FramesUndetermined,
            "touches",
            "the covariance of the solution is not finite",
            "identify again",
        )
    };
    let absorbed = absorbed(robot, &unknowns, &columns, &samples).ok_or_else(undetermined)?;
    let search = Search { robot, request, unknowns, columns, absorbed };
    let candidates = search.candidates();
    let (reached, unreached): (Vec<usize>, Vec<usize>) =
        (0..request.points.len()).partition(|k| candidates.iter().any(|c| c.point == *k));
    let [along, across, _] = extents_m(&reached.iter().map(|k| request.points[*k].1).collect::<Vec<_>>());
    let is_line = across < limits.touches_on_a_line * along.max(f64::MIN_POSITIVE);
    if candidates.len() < request.count || is_line {
        let missing: Vec<&str> = unreached.iter().map(|k| request.points[*k].0.as_str()).collect();
        let what = match (missing.is_empty(), is_line) {
            (true, true) => "the points lie on a line".to_owned(),
            (true, false) => {
                format!("{} postures touch the points, {} touches are wanted", candidates.len(), request.count)
            }
            (false, _) => format!("no posture touches {}", missing.join(", ")),
        };
        let remedy = "check tool and work object as they are given (m and degrees), and the allowed tilt";
        return Err(Error::new(Code::PlanOutOfReach, "touches", what, remedy));
    }
    let targets = if request.targets.is_empty() { &samples } else { &request.targets };
    let touches = search.chosen(&candidates, targets).ok_or_else(undetermined)?;
    Ok(TouchPlan { touches, unreached })
}

impl Search<'_> {
    /// `[A, G'L]` and `V` of a point at a posture.
    fn rows(&self, posture: &Posture, place: &TouchPlace) -> (DMatrix<f64>, Matrix3<f64>) {
        let rows = rows(self.robot, &self.unknowns, &self.columns, posture, (0, place));
        let (x, z) = (self.columns.len, self.absorbed.ncols());
        let mut j = DMatrix::zeros(3, x + z);
        j.columns_mut(0, x).copy_from(&rows.a);
        j.columns_mut(x, z).copy_from(&(self.robot.in_units(&rows.g) - product(&rows.a, &self.absorbed)));
        let v = Matrix3::from_column_slice((&rows.h * rows.h.transpose()).as_slice());
        (j, v + Matrix3::identity() * self.request.sigma_m.powi(2))
    }

    /// Postures that touch the points: down on the work object within the tilt, turned every way about the tool.
    fn candidates(&self) -> Vec<Candidate> {
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let exported = self.robot.exported();
        let limits = reading_limits(&exported.chain);
        let turn = std::f64::consts::PI;
        let mut found = Vec::new();
        for (point, (_, place)) in self.request.points.iter().enumerate() {
            for k in 0..self.request.tries {
                let tilt = self.request.tilt_rad * rng.random_range(0.0..1.0f64).sqrt();
                let [towards, spin] = [rng.random_range(-turn..turn), rng.random_range(-turn..turn)];
                // Down, tilted towards some side, spun about itself.
                let down = Pose::from_xyz_rpy([0.0; 3], [turn, 0.0, towards]);
                let tilted = down
                    * Pose::from_xyz_rpy([0.0; 3], [tilt, 0.0, 0.0])
                    * Pose::from_xyz_rpy([0.0; 3], [0.0, 0.0, spin]);
                let base_from_tool = self.request.work * Pose::new(tilted.rotation, *place);
                let wanted = base_from_tool * self.request.tool.inverse();
                let Some(start) = self.robot.stops.get(k % self.robot.stops.len().max(1)) else { continue };
                let Some(readings) = solve_from(exported, &limits, &wanted, &start.readings) else { continue };
                let (j, v) = self.rows(&Posture::at(&readings), &TouchPlace::Point(*place));
                found.push(Candidate { point, readings, j, v });
            }
        }
        found
    }

    /// Touches that are best together, in the order in which they help most.
    fn chosen(&self, candidates: &[Candidate], targets: &[Posture]) -> Option<Vec<PlannedTouch>> {
        let d = self.columns.len + self.absorbed.ncols();
        let mut q = DMatrix::zeros(d, d);
        for posture in targets {
            let seen = self.unknowns.virtual_touch(self.robot, posture, 0, false);
            let j = self.rows(posture, &seen).0;
            q += product(&j.transpose(), &j) / targets.len() as f64;
        }
        let mut information = DMatrix::identity(d, d);
        (0..self.columns.len).for_each(|k| information[(k, k)] = BEFORE.powi(-2));
        let mut set: Vec<usize> = Vec::new();
        for _ in 0..self.request.count {
            let next = self.best(candidates, &self.inverse(candidates, &set, &information)?, &q, &set)?;
            set.push(next);
        }
        for _ in 0..EXCHANGES {
            let before = self.left(candidates, &set, &information, &q)?;
            for k in 0..set.len() {
                let old = set[k];
                let rest: Vec<usize> = set.iter().copied().filter(|c| *c != old).collect();
                set[k] = self.best(candidates, &self.inverse(candidates, &rest, &information)?, &q, &rest)?;
            }
            let after = self.left(candidates, &set, &information, &q)?;
            if after > before * (1.0 - GAIN) {
                break;
            }
        }
        self.in_order(set.iter().map(|&k| &candidates[k]).collect(), &information, &q)
    }

    /// Touches in the order in which they help, each reached from the one before it, as [`super::Touches`] takes the rows of a series.
    fn in_order(
        &self,
        mut left: Vec<&Candidate>,
        before: &DMatrix<f64>,
        q: &DMatrix<f64>,
    ) -> Option<Vec<PlannedTouch>> {
        let mut placed: Vec<Candidate> = Vec::with_capacity(left.len());
        let mut planned = Vec::with_capacity(left.len());
        while !left.is_empty() {
            let inverse = self.inverse_of(placed.iter(), before)?;
            let pull = product(&product(&inverse, q), &inverse);
            let gain = |k: &usize| gain(left[*k], &inverse, &pull);
            let next = (0..left.len()).max_by(|a, b| gain(a).total_cmp(&gain(b)))?;
            placed.push(self.reached_after(left.remove(next), placed.last()));
            let inverse = self.inverse_of(placed.iter(), before)?;
            let expected_m = inverse.component_mul(q).sum().max(0.0).sqrt();
            let Candidate { point, readings, .. } = placed.last()?;
            planned.push(PlannedTouch { point: *point, readings: readings.clone(), expected_m });
        }
        Some(planned)
    }

    /// A touch whose joints come from those of another: backlash is on the side from which they come.
    fn reached_after(&self, touch: &Candidate, before: Option<&Candidate>) -> Candidate {
        let exported = self.robot.exported();
        let limits = reading_limits(&exported.chain);
        let previous = before.map(|b| b.readings.as_slice());
        let reach = Reach { robot: exported, limits: &limits, held: &[], previous };
        let wanted = self.robot.at(&Posture::at(&touch.readings)).0;
        // A joint at its limit cannot give way to the backlash.
        let readings = reach.solve_from(&wanted, &touch.readings).unwrap_or_else(|_| touch.readings.clone());
        let (j, v) = self.rows(&reach.stop(&readings), &TouchPlace::Point(self.request.points[touch.point].1));
        Candidate { point: touch.point, readings, j, v }
    }

    fn inverse(&self, candidates: &[Candidate], set: &[usize], before: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        self.inverse_of(set.iter().map(|&k| &candidates[k]), before)
    }

    fn inverse_of<'c>(&self, set: impl Iterator<Item = &'c Candidate>, before: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let mut n = before.clone();
        for c in set {
            let wj = dense(&c.v.try_inverse()?) * &c.j;
            n += product(&c.j.transpose(), &wj);
        }
        Some(SymmetricFactor::new(&n).ok()?.inverse())
    }

    fn left(&self, candidates: &[Candidate], set: &[usize], before: &DMatrix<f64>, q: &DMatrix<f64>) -> Option<f64> {
        Some(self.inverse(candidates, set, before)?.component_mul(q).sum())
    }

    /// The candidate outside `set` that lowers the error at the targets most.
    fn best(&self, candidates: &[Candidate], inverse: &DMatrix<f64>, q: &DMatrix<f64>, set: &[usize]) -> Option<usize> {
        let pull = product(&product(inverse, q), inverse);
        let outside = (0..candidates.len()).filter(|k| !set.contains(k));
        outside.map(|k| (k, gain(&candidates[k], inverse, &pull))).max_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
    }
}

/// By how much a touch lowers the mean variance at the targets, m^2.
fn gain(c: &Candidate, inverse: &DMatrix<f64>, pull: &DMatrix<f64>) -> f64 {
    let of = |m: &DMatrix<f64>| Matrix3::from_column_slice(product(&product(&c.j, m), &c.j.transpose()).as_slice());
    (c.v + of(inverse)).try_inverse().map_or(0.0, |s| (s * of(pull)).trace())
}
