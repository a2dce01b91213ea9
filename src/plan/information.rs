//! What one more image would tell: its information about the columns, joint noise eliminated.

use nalgebra::{DMatrix, Vector3};

use super::candidates::Candidate;
use super::setting::Setting;
use crate::geom::skew;
use crate::linalg::{SymmetricFactor, product};
use crate::model::robot::{Robot, Stop};
use crate::problem::{E, Image, Problem, State, Weighting, chained, linearise};

/// Information of an image about all columns; `None` where it shows nothing.
///
/// Joint noise is eliminated (Schur complement); the corrections of single markers and the displacement field of a lens are taken as
/// known.
pub fn image_information(problem: &Problem, setting: &Setting, state: &State, image: &Image) -> Option<DMatrix<f64>> {
    let slack = setting.slack();
    let chain = chained(problem, state, image, &slack)?;
    let terms = linearise(image, state, &chain.pose, &Weighting::of(problem, image))?;
    let mut h = DMatrix::zeros(6 + E, 6 + E);
    h.view_mut((0, 0), (6, 6)).copy_from(&terms.pp);
    h.view_mut((0, 6), (6, E)).copy_from(&terms.pe.columns(0, E));
    h.view_mut((6, 0), (E, 6)).copy_from(&terms.pe.columns(0, E).transpose());
    h.view_mut((6, 6), (E, E)).copy_from(&terms.ee.view((0, 0), (E, E)));
    let n = chain.d_slack.ncols();
    let coupling = chain.d_slack.transpose() * h.rows(0, 6);
    let mut joint = coupling.columns(0, 6) * &chain.d_slack;
    for k in 0..n {
        joint[(k, k)] += problem.noise.joint[image.camera][k].powi(-2);
    }
    h -= coupling.transpose() * SymmetricFactor::new(&joint).ok()?.solve_many(&coupling);
    // Columns of the layout by the pose and the intrinsics: T = [G 0; 0 1].
    let layout = &problem.layout;
    let mut t = DMatrix::zeros(6 + E, layout.len());
    t.view_mut((0, 0), (6, layout.theta_len())).copy_from(&chain.d_theta);
    for (k, column) in layout.intrinsics(image).into_iter().enumerate().take(E) {
        if let Some(c) = column {
            t[(6 + k, c)] = 1.0;
        }
    }
    let m = product(&t.transpose(), &product(&h, &t));
    Some((&m + m.transpose()) * 0.5)
}

/// Information of a candidate; zero where its image would show nothing.
pub fn candidate_information(
    problem: &Problem,
    setting: &Setting,
    state: &State,
    candidate: &Candidate,
) -> DMatrix<f64> {
    let image = setting.image(state, "", &candidate.readings, candidate.placement);
    let n = problem.layout.len();
    image.and_then(|image| image_information(problem, setting, state, &image)).unwrap_or_else(|| DMatrix::zeros(n, n))
}

/// `W = (P D)' (P D) / K`: the mean squared error of the flange's position over the targets is `tr(W cov)`, m^2.
///
/// `D` is the derivative of the position in the base frame; `P` takes out the rigid motion of that frame and the point on the
/// flange, which no measurement by another device could tell from errors of its own set-up.
pub fn flange_weight(problem: &Problem, robot: &Robot, targets: &[Vec<f64>]) -> DMatrix<f64> {
    const GAUGE: usize = 9;
    let (layout, rows) = (&problem.layout, 3 * targets.len());
    let mut d = DMatrix::zeros(rows, layout.len());
    let mut gauge = DMatrix::zeros(rows, GAUGE);
    for (k, readings) in targets.iter().enumerate() {
        let kinematics = robot.kinematics(&Stop::at(readings), &vec![0.0; readings.len()]);
        let tip = kinematics.base_from_tip;
        for (i, twist) in kinematics.d_twists.iter().enumerate() {
            let moved = tip.rotation * twist.fixed_rows::<3>(0);
            d.view_mut((3 * k, layout.twists.start + 6 * i), (3, 6)).copy_from(&moved);
        }
        for (i, term) in kinematics.d_terms.iter().enumerate() {
            let moved: Vector3<f64> = tip.rotation * term.fixed_rows::<3>(0);
            d.view_mut((3 * k, layout.terms.start + i), (3, 1)).copy_from(&moved);
        }
        gauge.view_mut((3 * k, 0), (3, 3)).fill_with_identity();
        gauge.view_mut((3 * k, 3), (3, 3)).copy_from(&-skew(&tip.translation));
        gauge.view_mut((3 * k, 6), (3, 3)).copy_from(&tip.rotation);
    }
    let q = gauge.qr().q();
    d -= &q * (q.transpose() * &d);
    product(&d.transpose(), &d) / targets.len().max(1) as f64
}
