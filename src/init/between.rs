//! Where two bases stand to each other: `X C_j = P_j V Q_j Z` for the unknown X, V and Z.
//!
//! C is `camera_from_plate`; P and Q are what the readings of the one arm and of the other say, V lies between them. With the rotation of V
//! known it is the hand-eye problem `X C_j = A_j Z` with `A_j = P_j V Q_j`, so rotations all over SO(3) are tried for V (quaternions of a Halton
//! sequence, K. Shoemake, *Uniform random rotations*, 1992), those with the least spread are refined together with the rotations of X and Z by
//! Gauss-Newton on `log(R_j' R_X R_Cj)`, and the three translations follow from linear equations.

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

use super::hand_eye::{PosePair, shah};
use crate::geom::{Pose, exp_so3, log_so3, project_to_so3};
use crate::linalg::SymmetricFactor;
use crate::linalg::median;

/// What one image says: `X * camera_from_plate = before * V * after * Z`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseTriple {
    /// `camera_from_plate` measured in the image.
    pub camera_from_plate: Pose,
    /// P.
    pub before: Pose,
    /// Q.
    pub after: Pose,
}

/// Rotations that are tried for V, and images with which they are.
const TRIED: usize = 600;
const TRIED_IMAGES: usize = 16;
/// The best of them that are refined, and steps of each.
const REFINED: usize = 12;
const STEPS: usize = 25;
/// Step that ends them, rad: far less than any start is asked for.
const STANDING_RAD: f64 = 1e-9;
/// Rounds of the translations, each with less weight for images that disagree.
const ROUNDS: usize = 4;
/// Share of the normal equations' diagonal that holds what the stops leave open.
const HELD: f64 = 1e-9;

type Rotations = [Matrix3<f64>; 3];

/// V with the smallest median of the remaining rotation (rad) plus translation (m); `None` where no start leads anywhere.
pub fn solve_between(triples: &[PoseTriple]) -> Option<(Pose, f64)> {
    let few = spread(triples);
    let mut tried: Vec<(f64, Rotations)> =
        (1..=TRIED).filter_map(|k| start(&few, rotation(k)).map(|r| (median_angle(&few, &r), r))).collect();
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    let refined = tried.iter().take(REFINED).map(|(_, start)| refined(triples, *start));
    let solved = refined.filter_map(|rotations| translated(triples, &rotations));
    solved.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Some images, evenly chosen.
fn spread(triples: &[PoseTriple]) -> Vec<PoseTriple> {
    let count = triples.len().min(TRIED_IMAGES);
    (0..count).map(|k| triples[k * triples.len() / count]).collect()
}

/// The k-th rotation of the sequence.
fn rotation(k: usize) -> Matrix3<f64> {
    let halton = |base: usize| {
        let (mut f, mut sum, mut rest) = (1.0, 0.0, k);
        while rest > 0 {
            f /= base as f64;
            sum += f * (rest % base) as f64;
            rest /= base;
        }
        sum
    };
    let [u, a, b] = [2, 3, 5].map(halton);
    let (a, b) = (a * std::f64::consts::TAU, b * std::f64::consts::TAU);
    let (p, q) = ((1.0 - u).sqrt(), u.sqrt());
    let quaternion = nalgebra::Quaternion::new(q * b.cos(), p * a.sin(), p * a.cos(), q * b.sin());
    UnitQuaternion::from_quaternion(quaternion).to_rotation_matrix().into_inner()
}

/// Rotations of X and Z for that of V.
fn start(triples: &[PoseTriple], v: Matrix3<f64>) -> Option<Rotations> {
    let between = Pose::new(v, Vector3::zeros());
    let pair =
        |t: &PoseTriple| PosePair { camera_from_plate: t.camera_from_plate, chain: t.before * between * t.after };
    let found = shah(&triples.iter().map(pair).collect::<Vec<_>>())?;
    Some([found.camera.rotation, v, found.plate.rotation])
}

/// `log(R' R_X R_C)` with `R = R_P R_V R_Q R_Z`.
fn angle(t: &PoseTriple, [x, v, z]: &Rotations) -> Vector3<f64> {
    let right = t.before.rotation * v * t.after.rotation * z;
    log_so3(&(right.transpose() * x * t.camera_from_plate.rotation))
}

fn median_angle(triples: &[PoseTriple], rotations: &Rotations) -> f64 {
    median(triples.iter().map(|t| angle(t, rotations).norm())).unwrap_or(f64::INFINITY)
}

/// Gauss-Newton with weights for images that disagree.
fn refined(triples: &[PoseTriple], mut rotations: Rotations) -> Rotations {
    for _ in 0..STEPS {
        let angles: Vec<Vector3<f64>> = triples.iter().map(|t| angle(t, &rotations)).collect();
        let usual = median(angles.iter().map(|r| r.norm())).unwrap_or(f64::INFINITY);
        let bound = 2.0 * usual + f64::EPSILON;
        let (mut n, mut b) = (SMatrix::<f64, 9, 9>::zeros(), SVector::<f64, 9>::zeros());
        for (t, r) in triples.iter().zip(angles) {
            let weight = (bound / r.norm().max(f64::MIN_POSITIVE)).min(1.0);
            let mut j = SMatrix::<f64, 3, 9>::zeros();
            j.fixed_view_mut::<3, 3>(0, 0).copy_from(&t.camera_from_plate.rotation.transpose());
            j.fixed_view_mut::<3, 3>(0, 3).copy_from(&-(t.after.rotation * rotations[2]).transpose());
            j.fixed_view_mut::<3, 3>(0, 6).copy_from(&-Matrix3::identity());
            n += weight * j.transpose() * j;
            b -= weight * j.transpose() * r;
        }
        let scale = n.diagonal().mean();
        (0..9).for_each(|k| n[(k, k)] += HELD * scale);
        let Some(step) = n.cholesky().map(|c| c.solve(&b)) else { break };
        for (k, r) in rotations.iter_mut().enumerate() {
            let moved = *r * exp_so3(&step.fixed_rows::<3>(3 * k).into_owned());
            *r = project_to_so3(&moved).unwrap_or(moved);
        }
        if step.amax() < STANDING_RAD {
            break;
        }
    }
    rotations
}

/// V with its translation, and the median of what remains: `R_X t_C + t_X = R_P (R_V (R_Q t_Z + t_Q) + t_V) + t_P`.
fn translated(triples: &[PoseTriple], rotations: &Rotations) -> Option<(Pose, f64)> {
    let [x, v, _] = rotations;
    let equations: Vec<(SMatrix<f64, 3, 9>, Vector3<f64>)> = triples
        .iter()
        .map(|t| {
            let (p, pv) = (t.before.rotation, t.before.rotation * v);
            let mut a = SMatrix::<f64, 3, 9>::zeros();
            a.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
            a.fixed_view_mut::<3, 3>(0, 3).copy_from(&-p);
            a.fixed_view_mut::<3, 3>(0, 6).copy_from(&-(pv * t.after.rotation));
            (a, t.before.translation + pv * t.after.translation - x * t.camera_from_plate.translation)
        })
        .collect();
    let mut weights = vec![1.0; triples.len()];
    let mut left = Vec::new();
    let mut solution = DVector::zeros(9);
    for _ in 0..ROUNDS {
        let (mut n, mut b) = (DMatrix::<f64>::zeros(9, 9), DVector::<f64>::zeros(9));
        for ((a, y), w) in equations.iter().zip(&weights) {
            n += *w * a.transpose() * a;
            b += *w * a.transpose() * y;
        }
        let scale = n.diagonal().mean();
        (0..9).for_each(|k| n[(k, k)] += HELD * scale);
        solution = SymmetricFactor::new(&n).ok()?.solve(&b);
        left = equations.iter().map(|(a, y)| (a * &solution - y).norm()).collect::<Vec<f64>>();
        let bound = 2.0 * median(&left).unwrap_or(f64::INFINITY) + f64::EPSILON;
        weights = left.iter().map(|l| (bound / l.max(f64::MIN_POSITIVE)).min(1.0)).collect();
    }
    let sizes = triples.iter().zip(&left).map(|(t, l)| angle(t, rotations).norm() + l);
    let translation = Vector3::new(solution[3], solution[4], solution[5]);
    Some((Pose::new(*v, translation), median(sizes).unwrap_or(f64::INFINITY)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector6;

    fn twist(seed: usize, size: f64) -> Vector6<f64> {
        Vector6::from_fn(|i, _| size * ((seed * 7 + i * 13 + seed * seed * (i + 2)) as f64).sin())
    }

    #[test]
    fn the_pose_between_two_arms_is_found_wherever_it_is() {
        for case in 0..6 {
            let [x, v, z] =
                [twist(31 + case, 0.9), twist(500 + 17 * case, 1.9), twist(77 + case, 1.3)].map(|t| Pose::exp(&t));
            let triples: Vec<PoseTriple> = (0..20)
                .map(|k| {
                    let (before, after) = (Pose::exp(&twist(k + 1, 1.0)), Pose::exp(&twist(300 + 3 * k, 0.8)));
                    PoseTriple { camera_from_plate: x.inverse() * before * v * after * z, before, after }
                })
                .collect();
            let (found, left) = solve_between(&triples).unwrap();
            let (angle, distance) = found.distance(&v);
            println!("{case}: {angle:.1e} rad, {distance:.1e} m, {left:.1e}");
            assert!(angle < 1e-6 && distance < 1e-6 && left < 1e-6);
        }
    }
}
