//! Covariance that trusts the scatter between images more than the model of the noise.
//!
//! With the score `g_j` of image `j` (slack of the image included, whose own score is zero at the optimum), the covariance `C` and
//! the prior information `P`, the sandwich is `C (sum f_j^2 g_j g_j' + P) C`; priors count as the observations that they stand for.
//! `f_j` gives back what the fit took of the scatter of an image: with the information `S_j` of its pose and the covariance `Q_j`
//! of the predicted one, `f^2 = tr QS / (tr QS - tr QSQS)` (after R. Bell, D. McCaffrey 2002, in the trace). Where noise is as the
//! model says the sandwich has the expectation `C` (K.-Y. Liang, S. Zeger 1986).

use nalgebra::{DMatrix, DVector, Matrix3};

use crate::linalg::product;
use crate::problem::{Problem, Slack, State};
use crate::solve::{Covariance, Linearised, SeenMarkers};

/// Largest correction of the scatter of one image: beyond it the image alone decides what it is compared with.
const MOST_CORRECTION: f64 = 5.0;

/// Fewest images whose scatter says anything.
const FEWEST_IMAGES: usize = 10;

/// Covariance of the dense columns by clusters of images; `None` for too few images.
pub fn clustered_covariance(
    problem: &Problem,
    state: &State,
    lin: &Linearised,
    covariance: &Covariance,
) -> Option<DMatrix<f64>> {
    if lin.images.len() < FEWEST_IMAGES {
        return None;
    }
    let dense = problem.layout.len();
    let of_dense = covariance.reduced.view((0, 0), (dense, dense)).into_owned();
    let markers = SeenMarkers::of(problem, lin);
    let with_markers = covariance_with_dense(&markers, problem, state, lin, covariance);
    let mut sum = DMatrix::zeros(dense, dense);
    for k in 0..lin.images.len() {
        let (of_image, of_markers) = score(problem, lin, k, &markers);
        let influence = &of_dense * of_image + &with_markers * of_markers;
        sum += &influence * influence.transpose() * correction(problem, state, lin, k, &of_dense);
    }
    let priors = DVector::from_iterator(dense, problem.layout.columns.iter().map(|c| c.prior_sigma.recip()));
    let by_priors = &of_dense * DMatrix::from_diagonal(&priors);
    let mut by_markers = with_markers.clone();
    for (at, &(plate, marker)) in markers.order.iter().enumerate() {
        by_markers.columns_mut(3 * at, 3).scale_mut(problem.marker_information(plate, marker).sqrt());
    }
    sum += product(&by_priors, &by_priors.transpose()) + product(&by_markers, &by_markers.transpose());
    Some((&sum + sum.transpose()) * 0.5)
}

/// Dense columns x 3 markers.
fn covariance_with_dense(
    markers: &SeenMarkers,
    problem: &Problem,
    state: &State,
    lin: &Linearised,
    covariance: &Covariance,
) -> DMatrix<f64> {
    let dense = problem.layout.len();
    let reduced = &covariance.reduced;
    let slack_start = &covariance.system.slack_start;
    if slack_start.is_empty() {
        // The slack was eliminated: markers follow the dense columns in this order.
        return reduced.view((0, dense), (dense, 3 * markers.order.len())).into_owned();
    }
    let mut coupling = DMatrix::zeros(3 * markers.order.len(), reduced.nrows());
    for (k, &i) in lin.images.iter().enumerate() {
        let image = &problem.images[i];
        let chain = &lin.chains[k];
        let columns = problem.layout.intrinsics(image);
        let couplings = lin.equations(problem, state, k).map_or_else(Vec::new, |e| e.marker_couplings());
        for t in &couplings {
            let Some(at) = markers.number[image.plate][t.marker] else { continue };
            let mp = DMatrix::from_column_slice(3, 6, t.mp.as_slice());
            let mut rows = coupling.rows_mut(3 * at, 3);
            let mut theta = rows.columns_mut(0, chain.d_theta.ncols());
            theta += &mp * &chain.d_theta;
            let mut slack = rows.columns_mut(slack_start[k], chain.d_slack.ncols());
            slack += &mp * &chain.d_slack;
            for (e, values) in t.intrinsics() {
                if let Some(c) = columns[e] {
                    let mut column = rows.fixed_columns_mut::<1>(c);
                    column += values;
                }
            }
        }
    }
    for (at, information) in markers.information(problem, lin).iter().enumerate() {
        let inverse = information.try_inverse().unwrap_or_else(Matrix3::zeros);
        let rows = DMatrix::from_column_slice(3, 3, inverse.as_slice()) * coupling.rows(3 * at, 3);
        coupling.rows_mut(3 * at, 3).copy_from(&rows);
    }
    -product(&reduced.rows(0, dense).into_owned(), &coupling.transpose())
}

/// Gradient of the k-th image in use: dense columns, and markers.
fn score(problem: &Problem, lin: &Linearised, k: usize, markers: &SeenMarkers) -> (DVector<f64>, DVector<f64>) {
    let (terms, chain, image) = (&lin.terms[k], &lin.chains[k], &problem.images[lin.images[k]]);
    let mut dense = DVector::zeros(problem.layout.len());
    let of_theta = chain.d_theta.transpose() * DVector::from_column_slice(terms.bp.as_slice());
    dense.rows_mut(0, of_theta.len()).copy_from(&of_theta);
    for (e, column) in problem.layout.intrinsics(image).into_iter().enumerate() {
        if let Some(c) = column {
            dense[c] += terms.be[e];
        }
    }
    let mut of_markers = DVector::zeros(3 * markers.order.len());
    for t in &terms.markers {
        if let Some(at) = markers.number[image.plate][t.marker] {
            of_markers.fixed_rows_mut::<3>(3 * at).copy_from(&t.bm);
        }
    }
    (dense, of_markers)
}

/// `f_j^2` of the k-th image in use.
fn correction(problem: &Problem, state: &State, lin: &Linearised, k: usize, of_dense: &DMatrix<f64>) -> f64 {
    let (terms, chain, i) = (&lin.terms[k], &lin.chains[k], lin.images[k]);
    let pp = DMatrix::from_column_slice(6, 6, terms.pp.as_slice());
    let s = match &state.slack[i] {
        Slack::Pose(_) => return 1.0,
        Slack::None => pp,
        Slack::Joints(dq) => {
            let l = &chain.d_slack;
            let mut h = l.transpose() * &pp * l;
            for r in 0..dq.len() {
                h[(r, r)] += problem.slack_information(&problem.images[i], r);
            }
            let Some(inverse) = h.try_inverse() else { return 1.0 };
            let pl = &pp * l;
            &pp - &pl * inverse * pl.transpose()
        }
    };
    let theta = chain.d_theta.ncols();
    let q = &chain.d_theta * of_dense.view((0, 0), (theta, theta)) * chain.d_theta.transpose();
    let qs = q * s;
    let (first, second) = (qs.trace(), (&qs * &qs).trace());
    if first > 0.0 && first > second { (first / (first - second)).clamp(1.0, MOST_CORRECTION) } else { MOST_CORRECTION }
}
