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

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};

use super::stand_alone::StandAlone;
use crate::error::{Code, Error, Result};
use crate::geom::{Pose, adjoint};
use crate::init::{PosePair, solve_hand_eye};
use crate::linalg::SymmetricFactor;
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
    /// Mean of `e' C^-1 e / 6` with the stated covariances: 1 where the other source is exact and what is stated is true.
    pub normalised: f64,
}

/// One pose of both.
struct Pair {
    image: String,
    own: Pose,
    covariance: Matrix6<f64>,
    other: Pose,
}

impl Pair {
    /// Square of a twist between both over the covariance, per component.
    fn normalised(&self, twist: &Vector6<f64>) -> Option<f64> {
        let unit = self.covariance.diagonal().map(|v| v.max(f64::MIN_POSITIVE).sqrt());
        let scaled = Matrix6::from_fn(|i, k| self.covariance[(i, k)] / unit[i] / unit[k]);
        let e = twist.component_div(&unit);
        Some(e.dot(&scaled.cholesky()?.solve(&e)) / 6.0)
    }
}

/// Images of which both have a pose.
fn pairs(found: &StandAlone, others: &[(String, Pose)]) -> Vec<Pair> {
    let stem = |name: &str| name.rsplit_once('.').map_or(name, |(stem, _)| stem).to_owned();
    (found.fit.problem.images.iter().zip(&found.free_poses.poses))
        .filter_map(|(image, pose)| {
            let placed = &pose.as_ref()?.in_frame;
            let (_, other) = others.iter().find(|(n, _)| *n == image.name || *n == stem(&image.name))?;
            let (own, covariance) = (placed.plate_from_camera, placed.covariance);
            Some(Pair { image: image.name.clone(), own, covariance, other: *other })
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
    let (mut x, mut y) = start(&pairs, body).ok_or_else(|| {
        let what = "its poses do not tell where the body is on the camera";
        Error::new(Code::FitUndetermined, place, what, "give poses that are turned about two axes at least")
    })?;
    let (mut scale, mut sigmas) = (0.0, [FIRST_M_PER_RAD, 1.0]);
    for _ in 0..ROUNDS {
        let unknowns = if body == OtherBody::Camera { 7 } else { 13 };
        let mut n = DMatrix::<f64>::zeros(unknowns, unknowns);
        let mut b = DVector::<f64>::zeros(unknowns);
        for pair in &pairs {
            let (r, j) = equation(pair, (&x, &y, scale), unknowns);
            let weight = DVector::from_fn(6, |k, _| sigmas[k / 3].powi(-2));
            let weighted = DMatrix::from_diagonal(&weight) * &j;
            n += j.tr_mul(&weighted);
            b -= weighted.tr_mul(&r);
        }
        let size = n.diagonal();
        (0..unknowns).for_each(|k| n[(k, k)] += HELD * size[k]);
        let Ok(factor) = SymmetricFactor::new(&n) else { break };
        let step = factor.solve(&b);
        x = x.perturbed(&step.fixed_rows::<6>(0).into_owned());
        scale += step[6];
        if unknowns > 7 {
            y = y.perturbed(&step.fixed_rows::<6>(7).into_owned());
        }
        sigmas = rms(pairs.iter().map(|p| residual(p, (&x, &y, scale)))).map(|s| s.max(f64::MIN_POSITIVE.sqrt()));
    }
    let twists: Vec<Vector6<f64>> = pairs.iter().map(|p| residual(p, (&x, &y, scale))).collect();
    let normalised = pairs.iter().zip(&twists).filter_map(|(p, e)| p.normalised(e)).sum::<f64>() / pairs.len() as f64;
    let rms = rms(twists.iter().copied());
    let differences = pairs.into_iter().zip(twists).map(|(p, twist)| PoseDifference { image: p.image, twist });
    Ok(PoseComparison { differences: differences.collect(), rms, relative_scale: scale, normalised })
}

fn rms(twists: impl Iterator<Item = Vector6<f64>>) -> [f64; 2] {
    let (mut sums, mut count) = ([0.0; 2], 0usize);
    for twist in twists {
        sums[0] += twist.fixed_rows::<3>(0).norm_squared() / 3.0;
        sums[1] += twist.fixed_rows::<3>(3).norm_squared() / 3.0;
        count += 1;
    }
    sums.map(|s| (s / count.max(1) as f64).sqrt())
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
fn equation(pair: &Pair, at: (&Pose, &Pose, f64), unknowns: usize) -> (DVector<f64>, DMatrix<f64>) {
    let (_, y, _) = at;
    let r = residual(pair, at);
    let mut j = DMatrix::zeros(6, unknowns);
    j.fixed_view_mut::<6, 6>(0, 0).copy_from(&-adjoint(&(pair.other * y.inverse()).inverse()));
    j.fixed_view_mut::<3, 1>(0, 6).copy_from(&-(pair.own.rotation.transpose() * pair.own.translation));
    if unknowns > 7 {
        j.fixed_view_mut::<6, 6>(0, 7).copy_from(&adjoint(y));
    }
    (DVector::from_column_slice(r.as_slice()), j)
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
                Pair { image: format!("{k}"), own, covariance: Matrix6::identity(), other }
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
}
