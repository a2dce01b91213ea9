//! Stand-alone camera poses beside those of another source: the common frames are fitted, what is left is told.
//!
//! With `A_i` the pose `plate_from_camera` found and `B_i` = `frame_from_body` of the other source, unknown are `X` = `plate_from_frame`, `Y` =
//! `camera_from_body` (where the body is not the camera itself) and the relative scale `s` of the plate:
//!
//! ```text
//! P_i = X B_i Y^-1    r_i = log(P_i^-1 A_i(s))    min sum |t(r_i)|^2 / sigma_t^2 + |w(r_i)|^2 / sigma_w^2
//! ```
//!
//! Gauss-Newton with `dr = -Ad(B_i Y^-1)^-1 x + Ad(Y) y + (R_A' t_A, 0) s`; the two sigmas follow the residuals.
//!
//! What the poses have in common, as the error of a camera, frames and scale take up. With `S` the covariance of all poses together, `J` the derivatives,
//! `G = (J' W J)^-1 J' W` and `C` the diagonal blocks of `S`, the residuals have the covariance `(1 - J G) S (1 - J G)'`, and the sum of `r' C^-1 r` is expected to be
//! `tr(C^-1 S) - 2 tr(C^-1 J G S) + tr(C^-1 J G S G' J')`.

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};

use super::stand_alone::StandAlone;
use crate::error::{Code, Error, Result};
use crate::geom::{Pose, adjoint};
use crate::init::{PosePair, solve_hand_eye};
use crate::linalg::{SymmetricFactor, dense};
use crate::series::CameraMount;

/// Rounds in which frames and sigmas settle.
const ROUNDS: usize = 30;
/// Poses that fix frame and scale with something left.
const FEWEST: usize = 3;
/// Weight of what the poses do not tell, beside what they do.
const HELD: f64 = 1e-12;
/// Ratio of sigmas of position (m) and direction (rad) to begin with.
const FIRST_M_PER_RAD: f64 = 0.3;

/// Whether the other source saw the camera itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OtherBody {
    /// The camera frame is the same.
    Camera,
    /// A body that moves with the camera, whose place on it is fitted.
    Unknown,
}

/// What is left of one pose.
#[derive(Debug, Clone)]
pub struct PoseDifference {
    /// Image.
    pub image: String,
    /// Body twist from the other pose to that found, m and rad.
    pub twist: Vector6<f64>,
}

/// Poses beside those of another source.
#[derive(Debug, Clone)]
pub struct PoseComparison {
    /// Every pose that both have.
    pub differences: Vec<PoseDifference>,
    /// RMS per axis: position, m, and direction, rad.
    pub rms: [f64; 2],
    /// Size of the plate by the poses found over that by the other source, less one.
    pub relative_scale: f64,
    /// Sum of `r' C^-1 r` by the stated covariances over what is expected of it: 1 where the other source is exact and what is stated is true.
    pub normalised: f64,
}

/// One pose of both.
struct Pair {
    image: String,
    /// Its index.
    index: usize,
    own: Pose,
    covariance: Matrix6<f64>,
    /// Its inverse, where there is one.
    information: Option<Matrix6<f64>>,
    other: Pose,
}

fn information(covariance: &Matrix6<f64>) -> Option<Matrix6<f64>> {
    let unit = covariance.diagonal().map(|v| v.max(f64::MIN_POSITIVE).sqrt());
    let scaled = Matrix6::from_fn(|i, k| covariance[(i, k)] / unit[i] / unit[k]);
    let inverse = scaled.cholesky()?.inverse();
    Some(Matrix6::from_fn(|i, k| inverse[(i, k)] / unit[i] / unit[k]))
}

/// Images of which both have a pose.
fn pairs(found: &StandAlone, others: &[(String, Pose)]) -> Vec<Pair> {
    let stem = |name: &str| name.rsplit_once('.').map_or(name, |(stem, _)| stem).to_owned();
    (found.fit.problem.images.iter().zip(&found.free_poses.poses))
        .enumerate()
        .filter_map(|(index, (image, pose))| {
            let placed = &pose.as_ref()?.in_frame;
            let (_, other) = others.iter().find(|(n, _)| *n == image.name || *n == stem(&image.name))?;
            let (own, covariance) = (placed.plate_from_camera, placed.covariance);
            let information = information(&covariance);
            Some(Pair { image: image.name.clone(), index, own, covariance, information, other: *other })
        })
        .collect()
}

/// Compares with poses by the name of the image, or by that without its extension.
///
/// # Errors
/// Fewer than three poses in common; poses that leave the place of the body open.
pub fn compare_poses(
    found: &StandAlone,
    others: &[(String, Pose)],
    body: OtherBody,
    place: &str,
) -> Result<PoseComparison> {
    let pairs = pairs(found, others);
    if pairs.len() < FEWEST {
        let what = format!("has {} poses of images that were measured; {FEWEST} are needed", pairs.len());
        return Err(Error::new(
            Code::ImagesTooFew,
            place,
            what,
            "name its rows as the images, in the column image or stop",
        ));
    }
    let start = start(&pairs, body).ok_or_else(|| {
        let what = "its poses do not tell where the body is on the camera";
        Error::new(Code::FitUndetermined, place, what, "give poses that are turned about two axes at least")
    })?;
    let (equations, scale, sigmas) = fitted(&pairs, start, body);
    let together = found.covariance_together()?;
    let expected =
        gain(&equations, sigmas).and_then(|gain| expected_squares(&pairs, &equations, &gain, together.as_ref()));
    let square = |(pair, (r, _)): (&Pair, &Equation)| Some(r.dot(&(pair.information? * r)));
    let squares = pairs.iter().zip(&equations).filter_map(square).sum::<f64>();
    let normalised = expected.map_or(f64::NAN, |expected| squares / expected);
    let rms = rms(&equations);
    let differences = pairs.into_iter().zip(equations).map(|(p, (twist, _))| PoseDifference { image: p.image, twist });
    Ok(PoseComparison { differences: differences.collect(), rms, relative_scale: scale, normalised })
}

/// The equations at the best poses of frame and body and the best scale, from a start; the scale, and the sigmas by which they are weighed.
fn fitted(pairs: &[Pair], (mut x, mut y): (Pose, Pose), body: OtherBody) -> (Vec<Equation>, f64, [f64; 2]) {
    let (mut scale, mut sigmas) = (0.0, [FIRST_M_PER_RAD, 1.0]);
    let unknowns = if body == OtherBody::Camera { 7 } else { 13 };
    let equations_at = |x: &Pose, y: &Pose, scale: f64| -> Vec<Equation> {
        pairs.iter().map(|pair| equation(pair, (x, y, scale), unknowns)).collect()
    };
    let mut equations = equations_at(&x, &y, scale);
    for _ in 0..ROUNDS {
        let Some(gain) = gain(&equations, sigmas) else { break };
        let moved = |((r, _), gain): (&Equation, &DMatrix<f64>)| gain * DVector::from_column_slice(r.as_slice());
        let step = -equations.iter().zip(&gain).map(moved).sum::<DVector<f64>>();
        x = x.perturbed(&step.fixed_rows::<6>(0).into_owned());
        scale += step[6];
        if unknowns > 7 {
            y = y.perturbed(&step.fixed_rows::<6>(7).into_owned());
        }
        equations = equations_at(&x, &y, scale);
        sigmas = rms(&equations).map(|s| s.max(f64::MIN_POSITIVE.sqrt()));
    }
    (equations, scale, sigmas)
}

/// Residual of a pose, and its derivative by the unknowns.
type Equation = (Vector6<f64>, DMatrix<f64>);

/// By how much the residual of each pose moves the unknowns, `(J' W J)^-1 J_k' W`; `None` where they are not told.
fn gain(equations: &[Equation], sigmas: [f64; 2]) -> Option<Vec<DMatrix<f64>>> {
    let weight = DMatrix::from_diagonal(&DVector::from_fn(6, |k, _| sigmas[k / 3].powi(-2)));
    let weighted: Vec<DMatrix<f64>> = equations.iter().map(|(_, j)| j.tr_mul(&weight)).collect();
    let mut n = weighted.iter().zip(equations).map(|(weighted, (_, j))| weighted * j).sum::<DMatrix<f64>>();
    let size = n.diagonal();
    (0..n.nrows()).for_each(|k| n[(k, k)] += HELD * size[k]);
    let factor = SymmetricFactor::new(&n).ok()?;
    Some(weighted.iter().map(|weighted| factor.solve_many(weighted)).collect())
}

/// What the sum of `r' C^-1 r` is expected to be by the covariance of the poses `together`, of these images; of very many poses, by that of each.
fn expected_squares(
    pairs: &[Pair],
    equations: &[Equation],
    gain: &[DMatrix<f64>],
    together: Option<&(Vec<usize>, DMatrix<f64>)>,
) -> Option<f64> {
    let row = |pair: &Pair| together?.0.iter().position(|image| *image == pair.index);
    let rows: Vec<Option<usize>> = pairs.iter().map(row).collect();
    let block = |a: usize, b: usize| match together.zip(rows[a].zip(rows[b])) {
        Some(((_, all), (row, column))) => all.view((6 * row, 6 * column), (6, 6)).into_owned(),
        None if a == b => dense(&pairs[a].covariance),
        None => DMatrix::zeros(6, 6),
    };
    let moved = |b: usize| -> DMatrix<f64> { gain.iter().enumerate().map(|(a, gain)| gain * block(a, b)).sum() };
    let moved: Vec<DMatrix<f64>> = (0..pairs.len()).map(moved).collect();
    let of_unknowns: DMatrix<f64> = moved.iter().zip(gain).map(|(moved, gain)| moved * gain.transpose()).sum();
    let of_pose = |(k, pair): (usize, &Pair)| {
        let (information, j) = (dense(&pair.information?), &equations[k].1);
        let own = (&information * block(k, k)).trace();
        let taken_up = (&information * (j * &moved[k])).trace();
        Some(own - 2.0 * taken_up + (information * (j * &of_unknowns * j.transpose())).trace())
    };
    Some(pairs.iter().enumerate().filter_map(of_pose).sum()).filter(|sum: &f64| *sum > 0.0)
}

fn rms(equations: &[Equation]) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for (r, _) in equations {
        sums[0] += r.fixed_rows::<3>(0).norm_squared() / 3.0;
        sums[1] += r.fixed_rows::<3>(3).norm_squared() / 3.0;
    }
    sums.map(|s| (s / equations.len().max(1) as f64).sqrt())
}

/// `X` and `Y` to begin with: where the body is the camera, from one pose; else in closed form.
fn start(pairs: &[Pair], body: OtherBody) -> Option<(Pose, Pose)> {
    let first = pairs.first()?;
    if body == OtherBody::Camera {
        return Some((first.own * first.other.inverse(), Pose::identity()));
    }
    let all: Vec<PosePair> =
        pairs.iter().map(|p| PosePair::of_flange(CameraMount::Hand, p.other, p.own.inverse())).collect();
    let best = solve_hand_eye(&all).into_iter().next()?.solution;
    Some((best.plate.inverse(), best.camera.inverse()))
}

fn residual(pair: &Pair, (x, y, scale): (&Pose, &Pose, f64)) -> Vector6<f64> {
    let own = Pose::new(pair.own.rotation, pair.own.translation / (1.0 + scale));
    ((*x * pair.other * y.inverse()).inverse() * own).log()
}

/// Residual, and its derivative by `x`, `s` and `y`.
fn equation(pair: &Pair, at: (&Pose, &Pose, f64), unknowns: usize) -> Equation {
    let (_, y, _) = at;
    let mut j = DMatrix::zeros(6, unknowns);
    j.fixed_view_mut::<6, 6>(0, 0).copy_from(&-adjoint(&(pair.other * y.inverse()).inverse()));
    j.fixed_view_mut::<3, 1>(0, 6).copy_from(&-(pair.own.rotation.transpose() * pair.own.translation));
    if unknowns > 7 {
        j.fixed_view_mut::<6, 6>(0, 7).copy_from(&adjoint(y));
    }
    (residual(pair, at), j)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(x: &Pose, y: &Pose, scale: f64) -> Vec<Pair> {
        let pose = |k: f64| {
            Pose::exp(&Vector6::new(
                0.3 * k.sin(),
                0.2 * (2.0 * k).cos(),
                0.5,
                0.4 * (1.7 * k).sin(),
                0.3 * (1.1 * k).cos(),
                k,
            ))
        };
        (0..8)
            .map(|k| {
                let own = pose(f64::from(k));
                let scaled = Pose::new(own.rotation, own.translation / (1.0 + scale));
                let other = x.inverse() * scaled * *y;
                let (covariance, information) = (Matrix6::identity(), Some(Matrix6::identity()));
                Pair { image: format!("{k}"), index: k as usize, own, covariance, information, other }
            })
            .collect()
    }

    #[test]
    fn the_derivatives_are_those_of_the_residual() {
        let (x, y) = (
            Pose::exp(&Vector6::new(0.1, 0.2, 0.3, 0.4, 0.5, 0.6)),
            Pose::exp(&Vector6::new(0.05, 0.0, 0.1, 0.1, 0.2, -0.3)),
        );
        let pair = &pairs(&x, &y, 0.01)[3];
        let (_, j) = equation(pair, (&x, &y, 0.01), 13);
        let h = 1e-6;
        for k in 0..13 {
            let moved = |h: f64| {
                let unit = |first: usize| Vector6::from_fn(|i, _| if i + first == k { h } else { 0.0 });
                let s = if k == 6 { h } else { 0.0 };
                let (xm, ym) =
                    (if k < 6 { x.perturbed(&unit(0)) } else { x }, if k > 6 { y.perturbed(&unit(7)) } else { y });
                residual(pair, (&xm, &ym, 0.01 + s))
            };
            let slope = (moved(h) - moved(-h)) / (2.0 * h);
            // The derivative by the scale leaves out its square.
            let off = (slope - j.column(k)).amax();
            assert!(off < if k == 6 { 0.03 } else { 1e-6 }, "{k}: {slope:?} {:?}", j.column(k));
        }
    }

    #[test]
    fn frames_body_and_scale_are_found_in_closed_form() {
        let (x, y) = (
            Pose::exp(&Vector6::new(1.0, -2.0, 0.3, 0.4, 2.0, 0.6)),
            Pose::exp(&Vector6::new(0.05, 0.0, 0.1, 0.1, 0.2, -0.3)),
        );
        let all = pairs(&x, &y, 0.0);
        let (found_x, found_y) = start(&all, OtherBody::Unknown).unwrap();
        assert!(found_x.distance(&x).0 < 1e-6 && found_y.distance(&y).1 < 1e-6);
    }

    /// Poses whose errors are half common to all, as those of a camera are.
    #[test]
    fn what_frames_take_up_of_common_errors_is_expected() {
        let (x, y) = (Pose::identity(), Pose::exp(&Vector6::new(0.05, 0.0, 0.1, 0.1, 0.2, -0.3)));
        let all = pairs(&x, &y, 0.0);
        let together = DMatrix::from_fn(48, 48, |i, k| 1e-6 * (f64::from(i == k) + f64::from(i % 6 == k % 6)));
        let covariance = Matrix6::identity() * 2e-6;
        let information = information(&covariance);
        let known: Vec<Pair> = all.into_iter().map(|p| Pair { covariance, information, ..p }).collect();
        let equations: Vec<Equation> = known.iter().map(|p| equation(p, (&x, &y, 0.0), 13)).collect();
        let gain = gain(&equations, [1.0, 1.0]).unwrap();
        let expected = |together| expected_squares(&known, &equations, &gain, together).unwrap();
        let together = ((0..8).collect(), together);
        let own = expected(Some(&together));
        // `(1 - J G)` is a projection here: it leaves 35 of 48 directions, and nothing of six that `Y` takes up whole.
        assert!((own - 35.0 / 2.0).abs() < 1e-3, "{own}");
        assert!((expected(None) - 35.0).abs() < 1e-3);
    }
}
