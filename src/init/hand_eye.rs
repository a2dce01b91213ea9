//! Hand-camera and plate pose in closed form: `X C_j = A_j Z` for the unknown X and Z.
//!
//! C is `camera_from_plate`; A is `flange_from_base` (camera in the hand) or `base_from_flange` (camera fixed); X is the pose of
//! the camera in the flange (or base) and Z that of the plate in the base (or flange). Three closed forms are tried on all images
//! and on small samples of them, so that wrongly paired images cannot spoil every start:
//! M. Shah, "Solving the robot-world/hand-eye calibration problem using the Kronecker product" (2013);
//! F. Park and B. Martin, "Robot sensor calibration: solving AX=XB on the Euclidean group" (1994);
//! A. Li, L. Wang and D. Wu, "Simultaneous robot-world and hand-eye calibration using dual-quaternions and Kronecker product" (2010),
//! the Kronecker variant.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, SMatrix, SVector, Vector3, Vector6};

use crate::geom::{Pose, log_so3, project_to_so3};
use crate::linalg::median;
use crate::linalg::{SymmetricFactor, symmetric_eigen};
use crate::model::robot::Robot;
use crate::series::{CameraMount, spread};

/// What one image says: `X * camera_from_plate = chain * Z`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PosePair {
    /// `camera_from_plate` measured in the image.
    pub camera_from_plate: Pose,
    /// `flange_from_base` (camera in the hand) or `base_from_flange` (fixed camera) from the readings.
    pub chain: Pose,
}

impl PosePair {
    /// That of a stop with these readings, in which the camera saw the plate.
    pub fn of_stop(robot: &Robot, mount: CameraMount, readings: &[f64], camera_from_plate: Pose) -> Self {
        Self::of_flange(mount, robot.base_from_tip(readings), camera_from_plate)
    }

    /// That of a stop with the tip there, in which the camera saw the plate.
    pub fn of_flange(mount: CameraMount, tip: Pose, camera_from_plate: Pose) -> Self {
        Self { camera_from_plate, chain: if mount == CameraMount::Hand { tip.inverse() } else { tip } }
    }
}

/// X and Z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandEye {
    /// `flange_from_camera` or `base_from_camera`.
    pub camera: Pose,
    /// `base_from_plate` or `flange_from_plate`.
    pub plate: Pose,
}

/// One candidate with the name of its closed form.
#[derive(Debug, Clone, PartialEq)]
pub struct HandEyeStart {
    /// Closed form and sample, in words.
    pub origin: String,
    /// The solution.
    pub solution: HandEye,
    /// Robust spread over the images: median of (rotation error + translation error over 1 m), rad.
    pub median_error: f64,
}

impl HandEye {
    /// Rotation error (rad) and translation error (m) of one image.
    pub fn error(&self, pair: &PosePair) -> (f64, f64) {
        (self.camera * pair.camera_from_plate).distance(&(pair.chain * self.plate))
    }

    /// Both in one figure, as [`Pose::misfit`].
    pub fn misfit(&self, pair: &PosePair) -> f64 {
        (self.camera * pair.camera_from_plate).misfit(&(pair.chain * self.plate))
    }

    /// Median misfit of the images, rad plus m; infinite where there are none.
    pub fn median_error(&self, pairs: &[PosePair]) -> f64 {
        median(pairs.iter().map(|p| self.misfit(p))).unwrap_or(f64::INFINITY)
    }

    /// No more than the misfit, and little less: the chord in the place of the angle.
    fn least_misfit(&self, pair: &PosePair) -> f64 {
        let (seen, carried) = (self.camera * pair.camera_from_plate, pair.chain * self.plate);
        let chord = (seen.rotation - carried.rotation).norm() * std::f64::consts::FRAC_1_SQRT_2;
        chord + (seen.translation - carried.translation).norm()
    }

    /// The median misfit where it is below `bound`; given up as soon as so many images miss by more that it cannot be.
    fn median_error_below(&self, pairs: &[PosePair], bound: f64) -> Option<f64> {
        let mut more = pairs.len() - pairs.len() / 2;
        let mut misfits = Vec::with_capacity(pairs.len());
        for pair in pairs {
            let least = self.least_misfit(pair);
            let misfit = if least < bound { self.misfit(pair) } else { least };
            if misfit.total_cmp(&bound).is_ge() {
                more -= 1;
            }
            if more == 0 {
                return None;
            }
            misfits.push(misfit);
        }
        median(misfits)
    }
}

/// Median misfit of the best closed form, rad plus m; infinite where none has a solution.
pub fn hand_eye_misfit(pairs: &[PosePair]) -> f64 {
    let most = if pairs.len() < MANY { SAMPLES } else { SAMPLES_FOR_MISFIT };
    by_samples(pairs, most).first().map_or(f64::INFINITY, |start| start.median_error)
}

type ClosedForm = fn(&[PosePair]) -> Option<HandEye>;

const CLOSED_FORMS: [(&str, ClosedForm); 3] = [
    ("Shah, Kronecker product", shah),
    ("Park-Martin, relative motions", park_martin),
    ("Li, linear least squares", li),
];

/// Number of samples of images that are tried beside all of them.
const SAMPLES: usize = 500;

/// The same where the misfit of many images alone is asked for: where half of 30 are right, all of a sample of five are in 1 of 47, and none of 200
/// samples is right in 1 of 70 cases.
const SAMPLES_FOR_MISFIT: usize = 200;

/// Images that are many: of fewer of which half are right, few samples are.
const MANY: usize = 26;

/// Images in a sample: enough rotation to fix X and Z, few enough to avoid a wrong pair.
const SAMPLE_SIZE: usize = 5;

/// Share of the images, by smallest error, with which the best sample is solved again.
const CONSENSUS_SHARE: f64 = 0.5;

/// Pairs that are enough for a start: its median error is then known to a twentieth.
const ENOUGH: usize = 500;

/// Candidates, best robust spread first. Empty where no closed form has a solution. Of very many pairs, some tell as much.
pub fn solve_hand_eye(pairs: &[PosePair]) -> Vec<HandEyeStart> {
    by_samples(pairs, SAMPLES)
}

fn by_samples(pairs: &[PosePair], most: usize) -> Vec<HandEyeStart> {
    let some: Vec<PosePair> = spread(pairs.len(), ENOUGH).map(|k| pairs[k]).collect();
    let pairs = some.as_slice();
    let mut starts = Vec::new();
    let mut add = |origin: String, solution: Option<HandEye>| {
        if let Some(solution) = solution {
            starts.push(HandEyeStart { origin, solution, median_error: solution.median_error(pairs) });
        }
    };
    for (name, form) in CLOSED_FORMS {
        add(format!("{name}, all images"), form(pairs));
    }
    if pairs.len() > SAMPLE_SIZE {
        let mut best: Option<HandEye> = None;
        let mut best_error = f64::INFINITY;
        for sample in samples(pairs.len()).take(most) {
            let chosen = sample.map(|i| pairs[i]);
            let Some(solution) = shah(&chosen) else { continue };
            if let Some(error) = solution.median_error_below(pairs, best_error) {
                (best, best_error) = (Some(solution), error);
            }
        }
        if let Some(solution) = best {
            let mut ranked: Vec<&PosePair> = pairs.iter().collect();
            ranked.sort_by(|a, b| solution.misfit(a).total_cmp(&solution.misfit(b)));
            let keep = ((pairs.len() as f64 * CONSENSUS_SHARE) as usize).max(SAMPLE_SIZE);
            let consensus: Vec<PosePair> = ranked.into_iter().take(keep).copied().collect();
            add("Shah, best sample of images".into(), Some(solution));
            for (name, form) in CLOSED_FORMS {
                add(format!("{name}, consensus"), form(&consensus));
            }
        }
    }
    starts.sort_by(|a, b| a.median_error.total_cmp(&b.median_error));
    starts
}

/// Samples of image indices from a fixed linear congruential sequence, so that every run tries the same.
fn samples(count: usize) -> impl Iterator<Item = [usize; SAMPLE_SIZE]> {
    let mut seed: u64 = 0x9E37_79B9_7F4A_7C15;
    let mut next = move |bound: usize| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((seed >> 33) as usize) % bound
    };
    let mut order: Vec<usize> = (0..count).collect();
    (0..SAMPLES).map(move |_| {
        let others: [usize; SAMPLE_SIZE] = std::array::from_fn(|k| k + next(count - k));
        others.iter().enumerate().for_each(|(k, &other)| order.swap(k, other));
        let sample = std::array::from_fn(|k| order[k]);
        others.iter().enumerate().rev().for_each(|(k, &other)| order.swap(k, other));
        sample
    })
}

/// Translations of X and Z for given rotations.
fn translations(pairs: &[PosePair], rx: Matrix3<f64>, rz: Matrix3<f64>) -> Option<HandEye> {
    let seen = pairs.iter().map(|p| (rx * p.camera_from_plate.translation, p.chain));
    // Directions that a sample leaves open (all rotations about one axis) stay near zero.
    let [camera, plate] = translations_by_rotations(seen, 1e-9 * pairs.len() as f64)?;
    Some(HandEye { camera: Pose::new(rx, camera), plate: Pose::new(rz, plate) })
}

/// `t_X` and `t_Z` of `R_X t_C + t_X = R_A t_Z + t_A`, linear, from `R_X t_C` and A of every equation; `hold`, of one for each of them, keeps near zero
/// what they do not tell.
pub fn translations_by_rotations(
    seen: impl Iterator<Item = (Vector3<f64>, Pose)>,
    hold: f64,
) -> Option<[Vector3<f64>; 2]> {
    // Unknowns t_X, t_Z with rows [I, -R_A].
    let (mut count, mut turns, mut rhs) = (hold, Matrix3::zeros(), Vector6::zeros());
    for (turned, chain) in seen {
        let y = chain.translation - turned;
        count += 1.0;
        turns -= chain.rotation;
        let carried = -chain.rotation.tr_mul(&y);
        rhs += Vector6::new(y.x, y.y, y.z, carried.x, carried.y, carried.z);
    }
    let mut n = Matrix6::identity() * count;
    n.fixed_view_mut::<3, 3>(0, 3).copy_from(&turns);
    n.fixed_view_mut::<3, 3>(3, 0).copy_from(&turns.transpose());
    let t = n.cholesky()?.solve(&rhs);
    Some([t.fixed_rows::<3>(0).into_owned(), t.fixed_rows::<3>(3).into_owned()])
}

/// Share of the squares of the distances to the plate, at least, that the rotations of the stops leave to tell its scale: a hundredth of the
/// distance, which is more than the error of a camera pose.
const LEAST_TOLD: f64 = 1e-4;

/// Scale of the plate against the robot's link lengths that fits the pairs best, for the rotations of `solution`; about 1
/// where the pitch of the plate is right. `None` where the stops do not determine it.
pub fn plate_scale(pairs: &[PosePair], solution: &HandEye) -> Option<f64> {
    let (rx, n) = (solution.camera.rotation, 7);
    let mut normal = DMatrix::<f64>::zeros(n, n);
    let mut rhs = DVector::<f64>::zeros(n);
    for p in pairs {
        // Unknowns t_X, t_Z, s with rows [I, -R_A, R_X t_C].
        let mut rows = DMatrix::<f64>::zeros(3, n);
        rows.view_mut((0, 0), (3, 3)).fill_with_identity();
        rows.view_mut((0, 3), (3, 3)).copy_from(&-p.chain.rotation);
        rows.view_mut((0, 6), (3, 1)).copy_from(&(rx * p.camera_from_plate.translation));
        rhs += rows.transpose() * p.chain.translation;
        normal += rows.transpose() * rows;
    }
    let factor = SymmetricFactor::new(&normal).ok()?;
    // A camera that turns about one point: the translations of its poses are told by their rotations, whatever the scale.
    let told = 1.0 / (factor.inverse()[(6, 6)] * normal[(6, 6)]);
    let scale = factor.solve(&rhs)[6];
    (scale.is_finite() && scale > 0.0 && told > LEAST_TOLD).then_some(scale)
}

/// X and Z by the Kronecker product (M. Shah 2013); `None` where there is no solution.
pub fn shah(pairs: &[PosePair]) -> Option<HandEye> {
    // R_X = sum R_A R_Z R_C' in the least-squares sense: K = sum kron(R_C, R_A) maps vec(R_Z) to vec(R_X).
    let mut k = SMatrix::<f64, 9, 9>::zeros();
    for p in pairs {
        k += p.camera_from_plate.rotation.kronecker(&p.chain.rotation);
    }
    let z = longest_axis(k.tr_mul(&k))?;
    let rotation = |v: SVector<f64, 9>| {
        let m = Matrix3::from_column_slice(v.as_slice());
        project_to_so3(&(m * m.determinant().signum()))
    };
    translations(pairs, rotation(k * z)?, rotation(z)?)
}

/// Squarings after which eigenvalues that differ by 1e-9 are told apart.
const SQUARINGS: usize = 36;

/// Eigenvector of the largest eigenvalue of a positive semidefinite matrix: squared again and again, with its trace at one, it becomes the
/// projection on it.
fn longest_axis(m: SMatrix<f64, 9, 9>) -> Option<SVector<f64, 9>> {
    let unit = |m: SMatrix<f64, 9, 9>, trace: f64| (trace.is_finite() && trace > 0.0).then(|| m * trace.recip());
    let mut power = unit(m, m.trace())?;
    for _ in 0..SQUARINGS {
        let squared = power * power;
        // The sum of the squared eigenvalues, of which the sum is one.
        let trace = squared.trace();
        power = unit(squared, trace)?;
        if 1.0 - trace < 1e-9 {
            break;
        }
    }
    power.column(power.diagonal().imax()).into_owned().try_normalize(0.0)
}

fn park_martin(pairs: &[PosePair]) -> Option<HandEye> {
    // R_Ai R_Aj' log = R_X (R_Ci R_Cj' log): rotation vectors of the relative motions of flange and camera.
    let mut m = Matrix3::zeros();
    for (i, a) in pairs.iter().enumerate() {
        for b in &pairs[..i] {
            let flange = log_so3(&(a.chain.rotation * b.chain.rotation.transpose()));
            let camera = log_so3(&(a.camera_from_plate.rotation * b.camera_from_plate.rotation.transpose()));
            if flange.norm() < 3.0 && camera.norm() < 3.0 {
                m += flange * camera.transpose();
            }
        }
    }
    let rx = project_to_so3(&m)?;
    let mut sum = Matrix3::zeros();
    for p in pairs {
        sum += p.chain.rotation.transpose() * rx * p.camera_from_plate.rotation;
    }
    translations(pairs, rx, project_to_so3(&sum)?)
}

fn li(pairs: &[PosePair]) -> Option<HandEye> {
    // Unknowns vec(R_X), vec(R_Z), t_X, t_Z in one homogeneous least-squares problem, rotations made orthogonal afterwards.
    let mut n = DMatrix::<f64>::zeros(25, 25);
    for p in pairs {
        let (c, a) = (&p.camera_from_plate, &p.chain);
        let mut rows = DMatrix::<f64>::zeros(12, 25);
        let left = c.rotation.transpose().kronecker(&Matrix3::identity());
        let right = Matrix3::identity().kronecker(&a.rotation);
        rows.view_mut((0, 0), (9, 9)).copy_from(&left);
        rows.view_mut((0, 9), (9, 9)).copy_from(&(-right));
        for i in 0..3 {
            for j in 0..3 {
                rows[(9 + i, 3 * j + i)] = c.translation[j];
                rows[(9 + i, 21 + j)] = -a.rotation[(i, j)];
            }
            rows[(9 + i, 18 + i)] = 1.0;
            rows[(9 + i, 24)] = -a.translation[i];
        }
        n += rows.transpose() * rows;
    }
    let (_, vectors) = symmetric_eigen(&n)?;
    let v = vectors.column(0);
    let scale = v[24];
    if scale.abs() < 1e-12 {
        return None;
    }
    let rotation = |start: usize| project_to_so3(&Matrix3::from_fn(|i, j| v[start + 3 * j + i] / scale));
    translations(pairs, rotation(0)?, rotation(9)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector6;

    fn twist(seed: usize, size: f64) -> Vector6<f64> {
        Vector6::from_fn(|i, _| size * ((seed * 7 + i * 13 + seed * seed * (i + 2)) as f64).sin())
    }

    fn world(count: usize) -> (HandEye, Vec<PosePair>) {
        let truth = HandEye { camera: Pose::exp(&twist(901, 0.8)), plate: Pose::exp(&twist(77, 1.2)) };
        let pairs = (0..count)
            .map(|k| {
                let chain = Pose::exp(&twist(k + 1, 1.1));
                let camera_from_plate = truth.camera.inverse() * chain * truth.plate;
                PosePair { camera_from_plate, chain }
            })
            .collect();
        (truth, pairs)
    }

    fn assert_close(a: &HandEye, b: &HandEye, bound: f64) {
        for (p, q) in [(a.camera, b.camera), (a.plate, b.plate)] {
            let (angle, distance) = p.distance(&q);
            assert!(angle < bound && distance < bound, "{angle} {distance}");
        }
    }

    #[test]
    fn every_closed_form_is_exact_on_exact_data() {
        let (truth, pairs) = world(8);
        for (name, form) in CLOSED_FORMS {
            println!("{name}");
            assert_close(&form(&pairs).unwrap(), &truth, 1e-6);
        }
    }

    #[test]
    fn the_longest_axis_is_that_of_the_largest_eigenvalue() {
        for case in 0..20 {
            // The two largest singular values differ by a share of 1e-1 to 1e-4.
            let a =
                SMatrix::<f64, 9, 9>::from_fn(|i, j| ((7 * i * i + 13 * j * j + 5 * i * j + 31 * case) as f64).sin());
            let orthogonal = a.qr().q();
            let near = 1.0 - 10f64.powi(-(case as i32 % 4) - 1);
            let values = SVector::<f64, 9>::from_fn(|k, _| if k == 4 { 3.0 } else { 3.0 * near / (1 + k) as f64 });
            let m = orthogonal * SMatrix::from_diagonal(&values.component_mul(&values)) * orthogonal.transpose();
            let found = longest_axis(m).unwrap();
            let along = found.dot(&orthogonal.column(4)).abs();
            assert!((1.0 - along).abs() < 1e-14, "{case}: {along}");
        }
        assert_eq!(longest_axis(SMatrix::zeros()), None);
        assert_eq!(longest_axis(SMatrix::from_element(f64::NAN)), None);
    }

    #[test]
    fn a_median_is_given_up_only_where_it_is_not_below() {
        let (truth, mut pairs) = world(9);
        for (k, pair) in pairs.iter_mut().enumerate() {
            pair.chain.translation.x += 0.01 * (k + 1) as f64;
        }
        for count in 1..=9 {
            let some = &pairs[..count];
            let all = truth.median_error(some);
            for bound in [0.5 * all, all, all * (1.0 + 1e-9), f64::INFINITY] {
                assert_eq!(truth.median_error_below(some, bound), (all < bound).then_some(all), "{count} {bound}");
            }
        }
    }

    #[test]
    fn samples_are_of_different_images_and_every_run_tries_the_same() {
        let all: Vec<_> = samples(7).collect();
        assert_eq!(all.len(), SAMPLES);
        assert_eq!(all, samples(7).collect::<Vec<_>>());
        for sample in &all {
            assert!((0..SAMPLE_SIZE).all(|k| sample[k] < 7 && !sample[..k].contains(&sample[k])), "{sample:?}");
        }
    }

    #[test]
    fn a_third_of_wrong_pairs_does_not_spoil_the_best_start() {
        let (truth, mut pairs) = world(18);
        for k in 0..6 {
            pairs[3 * k].chain = Pose::exp(&twist(400 + k, 1.0));
        }
        let starts = solve_hand_eye(&pairs);
        assert_close(&starts[0].solution, &truth, 1e-6);
        assert!(starts[0].median_error < 1e-6);
    }
    #[test]
    fn the_scale_of_the_plate_is_told_by_stops_that_go_somewhere() {
        let (truth, mut pairs) = world(12);
        pairs.iter_mut().for_each(|p| p.camera_from_plate.translation /= 1.25);
        assert!((plate_scale(&pairs, &truth).unwrap() - 1.25).abs() < 1e-9);
        // A wrist that turns about its centre, seen with an error: no scale fits better than another, and nought does exactly.
        for (k, p) in pairs.iter_mut().enumerate() {
            p.chain.translation = Vector3::new(0.3, 0.1, 0.9) + p.chain.rotation * Vector3::new(0.0, 0.0, 0.08);
            let seen = truth.camera.inverse() * p.chain * truth.plate;
            p.camera_from_plate =
                Pose { translation: seen.translation + Vector3::new(1e-4, 0.0, -1e-4) * (k % 3) as f64, ..seen };
        }
        assert_eq!(plate_scale(&pairs, &truth), None);
    }
}
