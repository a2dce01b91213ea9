//! By how much a hold-out may be expected to miss an image.
//!
//! A fold predicts the camera of an image that it has not seen through `G`, the derivative by the model, and `L`, that by what is latent at the stop. With
//! `C` what the other images leave open of the model, `S` the noise of the stop and `P` what the image by itself leaves open of its own pose, the body
//! twist by which both differ has the covariance `G C G' + L S L' + P`; a marker at `x` of the plate is moved by `[I, -[x]x]` of it.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix3x6, Matrix6};

use super::hold_out::{MOST_STOPS, folds};
use super::limits::Limits;
use crate::geom::skew;
use crate::linalg::product;
use crate::solve::{LinearProblem, LinearisedAdjustment, Parts};

/// RMS distance by which the markers of some images are expected to be missed where [`super::hold_out`] holds these out, mm, by the index of the image.
/// Images whose fold leaves the model undetermined are not in it.
pub fn expected_mm(fit: LinearProblem, images: &[usize], limits: &Limits) -> BTreeMap<usize, f64> {
    let some = fit.some_stops(MOST_STOPS, MOST_STOPS);
    let fit = some.as_ref().map_or(fit, LinearisedAdjustment::linear);
    let problem = &fit.adjustment.problem;
    let is_asked = |fold: &Vec<usize>| fold.iter().any(|i| images.contains(i));
    let folds: Vec<Vec<usize>> = folds(problem, limits).into_iter().flatten().filter(is_asked).collect();
    let parts = Parts::of(fit, &folds);
    let of_fold = |(k, fold): (usize, &Vec<usize>)| -> Vec<(usize, f64)> {
        let left = fit.without_set(&folds, k, parts.as_ref());
        let Some(model) = left.covariance_of_first(problem.layout.theta_len()) else { return Vec::new() };
        let asked = fold.iter().filter(|i| images.contains(i));
        asked.filter_map(|&i| Some((i, 1e3 * of_image(fit, &model, i)?))).collect()
    };
    folds.iter().enumerate().flat_map(of_fold).collect()
}

/// The same of one image, m.
fn of_image(fit: LinearProblem, model: &DMatrix<f64>, index: usize) -> Option<f64> {
    let (problem, state) = (&fit.adjustment.problem, &fit.adjustment.state);
    let (image, from) = (&problem.images[index], fit.adjustment.taken_from(index));
    let (terms, chain) = fit.lin.of(index)?;
    let stop = &problem.stops[image.stop];
    let information = (0..from.joints())
        .map(|reading| problem.joint_error_information(stop, reading))
        .chain(problem.tie_information(image, from.tie));
    let latent = DVector::from_iterator(from.unknowns(), information.map(f64::recip));
    let through = |by: &DMatrix<f64>, covariance: &DMatrix<f64>| product(&product(by, covariance), &by.transpose());
    let twist = through(&chain.d_theta, model) + through(&chain.d_latent, &DMatrix::from_diagonal(&latent));
    let twist = Matrix6::from_column_slice(twist.as_slice()) + terms.pp.try_inverse()?;
    let variance = |x| {
        let mut by = Matrix3x6::identity();
        by.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew(&x));
        (by * twist * by.transpose()).trace()
    };
    let markers: Vec<f64> = image.used().map(|o| variance(state.plates[image.plate].position(o.marker))).collect();
    let mean = markers.iter().sum::<f64>() / markers.len() as f64;
    // Of an image whose pose is free, nothing is predicted from readings.
    (mean > 0.0 && mean.is_finite()).then(|| mean.sqrt())
}
