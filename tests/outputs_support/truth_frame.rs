//! Files of a result judged by a simulated truth: poses.csv and plate.csv as a reader of them would do it.

use std::collections::BTreeMap;

use nalgebra::{Matrix2, Matrix3, Matrix6, Vector3, Vector6};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use robotcal::assess::Limits;
use robotcal::geom::{Pose, project_to_so3};
use robotcal::identify::{JointNoise, Options, RobotModel, Solution, adjust_free_poses, identify};
use robotcal::problem::{Adjustment, Mark, MarkerObservation, PlateShape, State, Tie, release_measured_scales};
use robotcal::series::{Plate, PlateKind, ScaleBar};
use robotcal::simulate::{SimulatedSeries, WorldRequest, series};
use robotcal::solve::{Fit, Settings, in_frame, solve};
use robotcal::study::measured;

use super::{context, robot};

/// What was judged of one world; each mean is 1 where the stated uncertainty is true.
#[derive(Debug, Clone, Copy, Default)]
pub struct Judged {
    pub poses: usize,
    pub not_positive_definite: usize,
    pub poses_shape: f64,
    pub poses_with_scale: f64,
    pub markers_shape: f64,
    pub markers_with_scale: f64,
}

/// The similarity that takes nominal markers to others, by least squares: `x = size R n + t`.
pub struct Alignment {
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
    size: f64,
}

impl Alignment {
    pub fn of(nominal: &[Vector3<f64>], others: &[Vector3<f64>]) -> Self {
        let mean = |all: &[Vector3<f64>]| all.iter().sum::<Vector3<f64>>() / all.len() as f64;
        let (n0, x0) = (mean(nominal), mean(others));
        let pairs = || nominal.iter().zip(others).map(|(n, x)| (n - n0, x - x0));
        let moment: Matrix3<f64> = pairs().map(|(n, x)| x * n.transpose()).sum();
        let svd = moment.svd(true, true);
        let (u, v_t) = (svd.u.unwrap(), svd.v_t.unwrap());
        let proper = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v_t).determinant().signum()));
        let rotation = project_to_so3(&(u * proper * v_t)).unwrap();
        let along: f64 = pairs().map(|(n, x)| (rotation * n).dot(&x)).sum();
        let size = along / pairs().map(|(n, _)| n.norm_squared()).sum::<f64>();
        Self { rotation, translation: x0 - size * (rotation * n0), size }
    }

    /// Rotation and translation.
    pub fn motion(&self) -> Pose {
        Pose::new(self.rotation, self.translation)
    }

    /// A camera pose (`plate_from_camera`) in the frame of the nominal markers, at their size.
    pub fn camera(&self, plate_from_camera: &Pose) -> Pose {
        let turned = self.rotation.transpose() * plate_from_camera.rotation;
        Pose::new(turned, self.undo(&plate_from_camera.translation) / self.size)
    }

    /// Positions in the frame of the nominal markers, at their size.
    pub fn shapes(&self, others: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        others.iter().map(|x| self.undo(x) / self.size).collect()
    }

    fn undo(&self, x: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.transpose() * (x - self.translation)
    }
}

fn table(files: &BTreeMap<String, Vec<u8>>, name: &str) -> Vec<BTreeMap<String, String>> {
    csv::Reader::from_reader(files[name].as_slice()).deserialize().map(|r| r.unwrap()).collect()
}

/// Pose and covariance of a row of poses.csv.
pub fn pose_row(row: &BTreeMap<String, String>) -> (Pose, Matrix6<f64>) {
    let number = |name: &str| -> f64 { row[name].parse().unwrap() };
    let pose = Pose::from_xyz_quaternion(["x_m", "y_m", "z_m"].map(number), ["qx", "qy", "qz", "qw"].map(number));
    (pose, Matrix6::from_fn(|i, j| number(&format!("c{}{}", i.min(j) + 1, i.max(j) + 1))))
}

/// Smallest eigenvalue with all variances brought to 1; below zero where a variance is.
pub fn least_eigenvalue(covariance: &Matrix6<f64>) -> f64 {
    let sigma = covariance.diagonal().map(f64::sqrt);
    if !sigma.iter().all(|s| *s > 0.0) {
        return -1.0;
    }
    Matrix6::from_fn(|i, j| covariance[(i, j)] / sigma[i] / sigma[j]).symmetric_eigenvalues().min()
}

/// `e' C^-1 e / 6` in units in which all variances are 1.
fn normalised(error: &Vector6<f64>, covariance: &Matrix6<f64>) -> f64 {
    let sigma = covariance.diagonal().map(f64::sqrt);
    let scaled = Matrix6::from_fn(|i, j| covariance[(i, j)] / sigma[i] / sigma[j]);
    let error = error.component_div(&sigma);
    scaled.cholesky().map_or(f64::NAN, |c| error.dot(&c.solve(&error)) / 6.0)
}

/// What else there is in a world.
#[derive(Debug, Clone, Copy)]
pub struct Setup {
    /// Places where the plate stands.
    pub placements: usize,
    /// Standard deviation of the measured distance of the outermost two markers, m.
    pub bar_sigma_m: Option<f64>,
}

/// One place, nothing measured.
pub const PLAIN: Setup = Setup { placements: 1, bar_sigma_m: None };

/// A world of the plate tolerances of the estimator, 24 to 30 images.
pub fn world(pixel_sigma_px: f64, seed: u64, setup: Setup) -> SimulatedSeries {
    let mut plate = Plate::lattice(PlateKind::Points, 8, 6, 0.038, 1e-4);
    plate.markers.iter_mut().for_each(|m| m.outer_radius_m = 0.01);
    let wanted = WorldRequest {
        images: 24 + (seed % 7) as usize,
        pixel_sigma_px,
        marker_sigma_m: 1e-4,
        plate_modes: true,
        placements: setup.placements,
        held_out: 1,
        seed,
        ..WorldRequest::typical(robot().chain(None, None).unwrap(), plate)
    };
    let mut world = series(&wanted).unwrap();
    world.plate.scale = setup.bar_sigma_m.map(|sigma_m| {
        let ends = [0, 47].map(|m| world.true_plate.markers[m].position_m);
        let error: f64 = StandardNormal.sample(&mut ChaCha8Rng::seed_from_u64(seed));
        ScaleBar { from: 0, to: 47, distance_m: (ends[0] - ends[1]).norm() + sigma_m * error, sigma_m }
    });
    world
}

/// A solution of a world with the images that every world has, whose robot, report and so on the files of others have, too.
pub fn template(setup: Setup) -> Solution {
    let chain = robot().chain(None, None).unwrap();
    let options = Options { model: RobotModel::Rigid, joint_noise: JointNoise::Known(2e-5), ..Options::default() };
    identify(chain.clone(), &[measured(&world(0.05, 0, setup), &chain)], &options).unwrap()
}

/// All files of a world of which cameras, plate and free poses are adjusted, from nothing, and nothing else.
pub fn result(template: &Solution, world: &SimulatedSeries) -> BTreeMap<String, Vec<u8>> {
    let mut problem = template.fit.problem.clone();
    problem.plates = vec![world.plate.clone()];
    let images = std::mem::take(&mut problem.images);
    for (k, seen) in world.observations.iter().enumerate() {
        // The places of the plate take turns in every world.
        let mut image = images[k % problem.placements.len()].clone();
        image.name = seen.image.clone();
        let measured = seen.observations.iter().map(|o| MarkerObservation {
            marker: o.marker as usize,
            edge: o.edge,
            mark: Mark::of_radius(world.plate.markers[o.marker as usize].outer_radius_m),
            uv: o.uv.into(),
            information: Matrix2::from_diagonal_element(1.0 / o.covariance.unwrap()[0]),
            rejected: None,
        });
        image.observations = measured.collect();
        problem.images.push(image);
    }
    problem.noise.pixel_factor = vec![1.0];
    let start = State {
        joint_errors: vec![Vec::new(); problem.stops.len()],
        ties: vec![Tie::Free(Pose::identity()); problem.images.len()],
        plates: vec![PlateShape::nominal(&world.plate)],
        ..template.fit.state.clone()
    };
    release_measured_scales(&mut problem.layout, &problem.plates);
    let start = Adjustment { problem, state: start };
    let (mut adjustment, free_poses, _) =
        adjust_free_poses(start, &[robotcal::identify::CameraStart::Unknown], &Limits::default()).unwrap();
    adjustment.hold_poses();
    let adjustment = solve(adjustment, &Settings::default()).adjustment;
    let linearised = adjustment.linearise().unwrap();
    let covariance = adjustment.linear(&linearised).covariance().unwrap();
    let fit = Fit { adjustment, linearised, covariance };
    let description = robot();
    let series = vec![measured(world, &description.chain(None, None).unwrap())];
    let in_frame = in_frame(fit.linear(), &fit.covariance).unwrap();
    let solution = Solution { fit, in_frame, free_poses, series, ..template.clone() };
    robotcal::output::files(&solution, &context(&description)).unwrap()
}

#[derive(serde::Deserialize)]
struct Scale {
    value: f64,
    sigma: f64,
}

#[derive(serde::Deserialize)]
struct Sigma {
    sigma: f64,
}

#[derive(serde::Deserialize)]
struct PlateOf {
    relative_scale: Sigma,
    relative_scale_of_poses: Scale,
}

#[derive(serde::Deserialize)]
struct SolutionOf {
    plates: Vec<PlateOf>,
}

pub fn judged(world: &SimulatedSeries, files: &BTreeMap<String, Vec<u8>>) -> Judged {
    let positions = |plate: &Plate| plate.markers.iter().map(|m| m.position_m).collect::<Vec<_>>();
    let (nominal, actual) = (positions(&world.plate), positions(&world.true_plate));
    let truth = Alignment::of(&nominal, &actual);
    let record: SolutionOf = serde_json::from_slice(&files["solution.json"]).unwrap();
    let (scale, of_poses) = (&record.plates[0].relative_scale, &record.plates[0].relative_scale_of_poses);
    let mut judged = Judged::default();
    for row in table(files, "poses.csv") {
        let (pose, covariance) = pose_row(&row);
        let name = row["image"].rsplit('/').next().unwrap();
        let stop = world.truth.stops.iter().find(|s| s.image == name).unwrap();
        let actual = stop.camera_from_plate.pose().inverse();
        let turned = truth.rotation.transpose() * actual.rotation;
        let error = |size: f64| -> Vector6<f64> {
            (Pose::new(turned, truth.undo(&actual.translation) * size).inverse() * pose).log()
        };
        let by_scale =
            Vector6::from_row_slice(&[(pose.rotation.transpose() * pose.translation).as_slice(), &[0.0; 3]].concat())
                * of_poses.sigma;
        judged.poses += 1;
        judged.not_positive_definite +=
            usize::from(least_eigenvalue(&covariance).partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater));
        judged.poses_shape += normalised(&error((1.0 + of_poses.value) / truth.size), &covariance);
        judged.poses_with_scale += normalised(&error(1.0), &(covariance + by_scale * by_scale.transpose()));
    }
    judged.poses_shape /= judged.poses as f64;
    judged.poses_with_scale /= judged.poses as f64;
    let rows = table(files, "plate.csv");
    let xyz = |row: &BTreeMap<String, String>, names: [&str; 3]| Vector3::from(names.map(|n| row[n].parse().unwrap()));
    let found: Vec<Vector3<f64>> = rows.iter().map(|r| xyz(r, ["x_m", "y_m", "z_m"])).collect();
    let sigmas: Vec<Vector3<f64>> = rows.iter().map(|r| xyz(r, ["sigma_x_m", "sigma_y_m", "sigma_z_m"])).collect();
    let own = Alignment::of(&nominal, &found);
    for (k, (x, sigma)) in found.iter().zip(&sigmas).enumerate() {
        let (x, expected) = (own.undo(x), truth.undo(&actual[k]));
        let shape = (x / own.size - expected / truth.size).component_div(sigma);
        judged.markers_shape += shape.norm_squared() / 3.0;
        let common = scale.sigma * nominal[k];
        let sigma = sigma.zip_map(&common, f64::hypot);
        judged.markers_with_scale += (x - expected).component_div(&sigma).norm_squared() / 3.0;
    }
    judged.markers_shape /= found.len() as f64;
    judged.markers_with_scale /= found.len() as f64;
    judged
}
