//! A prior that holds the robot near nominal where the data do not say.
//!
//! Errors of drives that come back with the reading are no noise from stop to stop. Where stops lie near each other the fit takes some of them for
//! links and offsets, and this shows elsewhere, with a lever. What the usual priors allow elsewhere then decides, and they are those of robots
//! that nobody has calibrated. Of this one it is known by how much the corrected robot differs from the nominal one at the stops, `s`. The prior
//! says the same of the whole workspace. With `H` the mean square of the displacement of the tip over it per unit of the parameters (base and
//! tool fitted out) and `S` the usual prior, it is the information `c H` that makes the displacement that is expected, `tr(H (S^-1 + c H)^-1)`,
//! equal to `s^2`: a prior in the space of functions (A. Zellner's g-prior, 1986, with the workspace in place of the data). Stops whose errors
//! repeat tell less than the fit counts, so that the prior weighs more by as much.

use nalgebra::{DMatrix, DVector};

use super::WorkspacePoint;
use super::flange::{FlangeModel, everywhere};
use super::limits::Limits;
use super::promise::{FlangeErrors, NoiseAtStop, nominal_laid_over, usual_joint_sigma};
use super::repeating::Repeats;
use super::used_stops::{on_robot_sigmas, stops};
use crate::geom::adjoint;
use crate::linalg::median;
use crate::linalg::{SymmetricFactor, symmetric_eigen};
use crate::model::robot::{Posture, Robot};
use crate::problem::{Layout, Restraint};
use crate::solve::Fit;

/// Halvings of the interval of the factor.
const HALVINGS: usize = 60;

/// Sigma of the flange outside the region of the stops, m, where it is so large against the error of the nominal robot inside that it must be said.
pub fn extrapolation_m(workspace: &[WorkspacePoint], nominal_m: f64, limits: &Limits) -> Option<f64> {
    let outside: Vec<f64> = workspace.iter().filter(|w| !w.covered).map(|w| w.sigma_m).collect();
    median(&outside).filter(|outside_m| *outside_m > limits.extrapolation_ratio * nominal_m)
}

/// What holds the robot near nominal, where a fit of bodies alone extrapolates badly and its joint errors are no noise; `None` where nothing asks for it.
pub fn restraint(fit: &Fit, limits: &Limits) -> Option<Restraint> {
    if fit.problem.used_on_robot().next().is_some() {
        return None;
    }
    let repeats = Repeats::of(fit).filter(|r| r.deviate > limits.pattern_sigmas)?;
    let (robot, layout, stops) = (&fit.state.robot, &fit.problem.layout, stops(&fit.problem));
    let model = FlangeModel::of(fit, &fit.covariance.reduced, limits)?;
    let joint_sigma = &usual_joint_sigma(&on_robot_sigmas(&fit.problem));
    let flange = FlangeErrors::new(&model, (robot, None), NoiseAtStop { joint_sigma, told: None }, &stops)?;
    extrapolation_m(&model.workspace(), flange.nominal_m, limits)?;
    let exported = robot.without_local_errors();
    let displacement_m = nominal_laid_over(&exported, &stops)?.rms_m;
    // A column whose prior says that it is not nominal stays with that.
    let is_held = |c: &usize| {
        let column = &layout.columns[*c];
        column.free && column.prior_mean == 0.0 && !layout.is_between_bases(*c)
    };
    let columns: Vec<usize> = layout.robot().filter(is_held).collect();
    let per_unit = mean_square_displacement(&exported, layout, &columns)?;
    let sigmas = DVector::from_iterator(columns.len(), columns.iter().map(|&c| layout.columns[c].prior_sigma));
    // The fit counts every stop as one of its own: what it weighs too much is put on the other side, too.
    let information = &per_unit * (factor(&per_unit, &sigmas, displacement_m)? * repeats.stops_for_one());
    Some(Restraint { columns, information, displacement_m, repeats: repeats.deviate })
}

/// Mean square of the displacement of the tip over the workspace, base and tool fitted out, m^2: a quadratic form of some columns of the robot.
fn mean_square_displacement(robot: &Robot, layout: &Layout, columns: &[usize]) -> Option<DMatrix<f64>> {
    let samples = everywhere(robot);
    let n = columns.len();
    let (mut own, mut mixed, mut fitted) = (DMatrix::zeros(n, n), DMatrix::zeros(9, n), DMatrix::zeros(9, 9));
    for sample in &samples {
        let (j, f) = derivatives(robot, layout, columns, sample);
        own += j.tr_mul(&j);
        mixed += f.tr_mul(&j);
        fitted += f.tr_mul(&f);
    }
    let taken = SymmetricFactor::new(&fitted).ok()?.solve_many(&mixed);
    Some((own - mixed.tr_mul(&taken)) / samples.len() as f64)
}

/// Displacement of the tip in its own frame by columns of the robot, and by base (6) and tool (3).
fn derivatives(robot: &Robot, layout: &Layout, columns: &[usize], at: &Posture) -> (DMatrix<f64>, DMatrix<f64>) {
    let kinematics = robot.kinematics_at(at);
    let mut j = DMatrix::zeros(3, columns.len());
    for (place, &c) in columns.iter().enumerate() {
        j.set_column(place, &layout.derivative(&kinematics, c).fixed_rows::<3>(0));
    }
    let mut f = DMatrix::identity(3, 9);
    f.view_mut((0, 3), (3, 6)).copy_from(&adjoint(&kinematics.base_from_tip.inverse()).fixed_rows::<3>(0));
    (j, f)
}

/// The factor on `h` with which priors of `sigmas` expect the displacement; `None` where they expect no more without it.
fn factor(h: &DMatrix<f64>, sigmas: &DVector<f64>, displacement_m: f64) -> Option<f64> {
    let scaled = DMatrix::from_fn(h.nrows(), h.ncols(), |i, k| sigmas[i] * h[(i, k)] * sigmas[k]);
    let (squares, _) = symmetric_eigen(&scaled)?;
    let expected = |factor: f64| squares.iter().map(|s| s.max(0.0) / (1.0 + factor * s.max(0.0))).sum::<f64>();
    let wanted = displacement_m * displacement_m;
    if wanted <= 0.0 || expected(0.0) <= wanted {
        return None;
    }
    // Every direction is expected to less than 1 / factor.
    let (mut low, mut high) = (0.0, squares.len() as f64 / wanted);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if expected(middle) > wanted { low = middle } else { high = middle }
    }
    Some(high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_leaves_the_displacement_that_is_wanted() {
        let h = DMatrix::from_diagonal(&DVector::from_vec(vec![4.0, 1.0, 0.0]));
        let sigmas = DVector::from_vec(vec![1.0, 2.0, 1.0]);
        // 4 and 4, together 8: with 1/4 each is halved.
        assert!((factor(&h, &sigmas, 2.0).unwrap() - 0.25).abs() < 1e-12);
        assert_eq!(factor(&h, &sigmas, 3.0), None);
        assert_eq!(factor(&h, &sigmas, 0.0), None);
    }
}
