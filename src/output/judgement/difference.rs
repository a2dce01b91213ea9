//! Two solutions against each other over the workspace.

use nalgebra::Vector3;

use crate::assess::{MeasuredPoint, WorkspacePoint, fit_points, within_joint_limits};
use crate::error::{Code, Error, Result};
use crate::model::robot::Posture;
use crate::output::restore::{FoundModel, entered_offsets, found_model};
use crate::output::solution_json::SolutionRecord;
use crate::problem::short_name;

/// Sigmas of the difference from which two estimates disagree.
const DISAGREE: f64 = 3.0;

/// How far two solutions are apart.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// Places compared.
    pub places: usize,
    /// RMS distance of the flange, m, after the base frames and a point of the flange were brought together.
    pub rms_m: f64,
    /// Largest distance, m, with the readings (rad or m) where it is.
    pub worst_m: f64,
    /// Readings at the worst place.
    pub worst_at: Vec<f64>,
    /// What the stated uncertainties of both let expect of the RMS distance, m, what base frames and point of the flange take up left out; none where
    /// a solution states none.
    pub stated_m: Option<f64>,
}

impl Difference {
    /// Sigmas by which the flange differs: the RMS distance over that which is to be expected, about one where the two are as good as they say.
    pub fn sigmas(&self) -> Option<f64> {
        self.stated_m.filter(|stated| *stated > 0.0).map(|stated| self.rms_m / stated)
    }

    /// True where that is more than three.
    pub fn disagrees(&self) -> bool {
        self.sigmas().is_some_and(|sigmas| sigmas > DISAGREE)
    }
}

/// Estimates of parameters of both that differ by more than three sigmas of their difference: name, first, second, sigmas.
pub type Disagreement = (String, f64, f64, f64);

/// What differs.
#[derive(Debug, Clone, PartialEq)]
pub struct SolutionDifference {
    /// In the region that the stops of both covered.
    pub covered: Option<Difference>,
    /// Over all joint limits.
    pub everywhere: Difference,
    /// Parameters, largest first.
    pub parameters: Vec<Disagreement>,
    /// What the exported files of the second expect of readings beside those of the first, rad or m: not none where offsets are entered in the
    /// controller for one of them, and the two take different joint angles.
    pub zeros: Vec<f64>,
    /// Joint names.
    pub joints: Vec<String>,
}

impl SolutionDifference {
    /// True where the flange or a parameter differs by more than three sigmas.
    pub fn disagrees(&self) -> bool {
        !self.parameters.is_empty() || self.covered.iter().chain([&self.everywhere]).any(Difference::disagrees)
    }
}

/// Compares `b` with `a` at the places of both workspace maps, for the readings that they were identified from.
///
/// # Errors
/// Solutions of robots with different joints, or without workspace map.
pub fn compare_solutions(a: &SolutionRecord, b: &SolutionRecord) -> Result<SolutionDifference> {
    if a.robot.readings != b.robot.readings {
        let what = format!("joints {} against {}", a.robot.readings.join(", "), b.robot.readings.join(", "));
        return Err(Error::new(Code::RobotDiffers, "solutions", what, "compare solutions of the same robot"));
    }
    let (first, second) = (found_model(a)?, found_model(b)?);
    let sides = [(a, &second), (b, &first)];
    let everywhere = sides.iter().flat_map(|(record, _)| within_joint_limits(&record.workspace));
    let everywhere: Vec<&[f64]> = everywhere.map(|w| w.readings.as_slice()).collect();
    let covered = sides.iter().flat_map(|(record, other)| {
        let other = other.flange();
        let is_covered = move |w: &&WorkspacePoint| {
            w.covered && other.as_ref().is_some_and(|other| other.at(&w.readings).outside.is_empty())
        };
        record.workspace.iter().filter(is_covered)
    });
    let covered: Vec<&[f64]> = covered.map(|w| w.readings.as_slice()).collect();
    let everywhere = difference(&first, &second, &everywhere).ok_or_else(|| {
        Error::new(Code::SolutionDiffers, "solutions", "they have no workspace map in common", "identify both again")
    })?;
    Ok(SolutionDifference {
        covered: difference(&first, &second, &covered),
        everywhere,
        parameters: disagreements(a, b),
        zeros: entered_offsets(b)?.iter().zip(entered_offsets(a)?).map(|(b, a)| b - a).collect(),
        joints: a.robot.readings.clone(),
    })
}

/// Fewest places that determine frames and flange point.
const FEWEST_PLACES: usize = 8;

/// At these readings, rad or m.
fn difference(a: &FoundModel, b: &FoundModel, places: &[&[f64]]) -> Option<Difference> {
    if places.len() < FEWEST_PLACES {
        return None;
    }
    // The flange of the first as a device would see it; frame and point on the flange of the second are fitted.
    let points: Vec<MeasuredPoint> =
        places.iter().map(|q| MeasuredPoint::on_tip(&a.robot, &Vector3::zeros(), &Posture::at(q))).collect();
    let fit = fit_points(&b.robot, &points)?;
    let (worst, worst_m) = (fit.residuals_m.iter().map(|r| r.norm()).enumerate()).max_by(|x, y| x.1.total_cmp(&y.1))?;
    let stated_m = |of: &FoundModel| {
        let known = of.known_robot(None).ok()?;
        Some(fit.expected((&of.robot, None), &points, known.covariance(), &vec![0.0; of.joint_sigma.len()])?.model_m)
    };
    Some(Difference {
        places: places.len(),
        rms_m: fit.rms_m,
        worst_m,
        worst_at: places[worst].to_vec(),
        stated_m: stated_m(a).zip(stated_m(b)).map(|(a, b)| a.hypot(b)),
    })
}

fn disagreements(a: &SolutionRecord, b: &SolutionRecord) -> Vec<Disagreement> {
    let robot = |e: &&crate::output::solution_json::EstimateRecord| e.name.starts_with("robot/");
    let mut found: Vec<Disagreement> = (a.estimates.iter().filter(robot))
        .filter_map(|x| {
            let y = b.estimates.iter().find(|y| y.name == x.name)?;
            let (vx, vy, sx, sy) = (x.value?, y.value?, x.sigma?, y.sigma?);
            let sigmas = (vx - vy).abs() / sx.hypot(sy).max(f64::MIN_POSITIVE);
            Some((short_name(&x.name), vx, vy, sigmas)).filter(|d| d.3 > DISAGREE)
        })
        .collect();
    found.sort_by(|x, y| y.3.total_cmp(&x.3));
    found
}
