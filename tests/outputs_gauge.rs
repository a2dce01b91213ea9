//! Covariances of plate, placement and stand-alone poses against a solve with explicit inner constraints.

mod outputs_support;

use std::collections::BTreeMap;

use nalgebra::{DMatrix, Matrix6};
use outputs_support::{context, robot, solved};
use robotcal::geom::{Pose, adjoint, skew};
use robotcal::model::camera::MAX_PARAMETERS;
use robotcal::model::plate_modes::{MODES, basis};
use robotcal::output::files;
use robotcal::problem::{Problem, Slack, State};
use robotcal::recipe::{RobotModel, Solution};
use robotcal::series::CameraMount;
use robotcal::solve::{Linearised, linearise_all};

/// Covariance of all unknowns (dense columns, slack of each image, markers) under `N' P m = 0` on the marker corrections, from the
/// bordered normal equations: nothing is eliminated and nothing subtracted.
struct Bordered {
    covariance: DMatrix<f64>,
    slack_start: Vec<usize>,
    marker_start: usize,
}

impl Bordered {
    fn new(problem: &Problem, state: &State, lin: &Linearised) -> Self {
        let layout = &problem.layout;
        let mut slack_start = Vec::new();
        let mut n = layout.len();
        for chain in &lin.chains {
            slack_start.push(n);
            n += chain.d_slack.ncols();
        }
        let (marker_start, markers) = (n, &problem.plates[0].markers);
        n += 3 * markers.len();
        let mut a = DMatrix::<f64>::zeros(n + 6, n + 6);
        for (k, terms) in lin.terms.iter().enumerate() {
            // Jacobian of (pose, intrinsics) by all unknowns, then of each marker.
            let chain = &lin.chains[k];
            let camera = &layout.cameras[0];
            let e = MAX_PARAMETERS + MODES;
            let mut j = DMatrix::<f64>::zeros(6 + e, n + 6);
            j.view_mut((0, 0), (6, layout.theta_len())).copy_from(&chain.d_theta);
            j.view_mut((0, slack_start[k]), chain.d_slack.shape()).copy_from(&chain.d_slack);
            (0..camera.len()).for_each(|c| j[(6 + c, camera.start + c)] = 1.0);
            (0..MODES).for_each(|c| j[(6 + MAX_PARAMETERS + c, layout.shapes[0].start + c)] = 1.0);
            let mut h = DMatrix::<f64>::zeros(6 + e, 6 + e);
            h.view_mut((0, 0), (6, 6)).copy_from(&terms.pp);
            h.view_mut((0, 6), (6, e)).copy_from(&terms.pe);
            h.view_mut((6, 0), (e, 6)).copy_from(&terms.pe.transpose());
            h.view_mut((6, 6), (e, e)).copy_from(&terms.ee);
            a += j.transpose() * h * &j;
            let couplings = lin.equations(problem, state, k).unwrap().marker_couplings();
            for (own_terms, t) in terms.markers.iter().zip(&couplings) {
                let mut c = DMatrix::<f64>::zeros(3, 6 + e);
                c.view_mut((0, 0), (3, 6)).copy_from(&t.mp);
                c.view_mut((0, 6), (3, e)).copy_from(&t.me);
                let row = c * &j;
                let at = marker_start + 3 * t.marker;
                let mut own = a.view_mut((at, at), (3, 3));
                own += own_terms.mm;
                let mut rows = a.rows_mut(at, 3);
                rows += &row;
                let mut columns = a.columns_mut(at, 3);
                columns += row.transpose();
            }
            if let Slack::Joints(dq) = &state.slack[lin.images[k]] {
                for r in 0..dq.len() {
                    a[(slack_start[k] + r, slack_start[k] + r)] +=
                        problem.slack_information(&problem.images[lin.images[k]], r);
                }
            }
        }
        for (c, column) in layout.columns.iter().enumerate() {
            a[(c, c)] += column.prior_sigma.powi(-2);
            if !column.free {
                a.row_mut(c).fill(0.0);
                a.column_mut(c).fill(0.0);
                a[(c, c)] = 1.0;
            }
        }
        for (m, marker) in markers.iter().enumerate() {
            let information = marker.sigma_m.powi(-2);
            let at = marker_start + 3 * m;
            let x = skew(&marker.position_m);
            for d in 0..3 {
                a[(at + d, at + d)] += information;
                a[(at + d, n + d)] += information;
                a[(n + d, at + d)] += information;
                for r in 0..3 {
                    a[(at + d, n + 3 + r)] -= information * x[(d, r)];
                    a[(n + 3 + r, at + d)] -= information * x[(d, r)];
                }
            }
        }
        let scale: Vec<f64> =
            (0..n + 6).map(|i| if a[(i, i)] > 0.0 { a[(i, i)].sqrt().recip() } else { 1e-6 }).collect();
        let scaled = DMatrix::from_fn(n + 6, n + 6, |i, j| a[(i, j)] * scale[i] * scale[j]);
        let inverse = scaled.lu().try_inverse().expect("regular");
        let covariance = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]);
        Self { covariance, slack_start, marker_start }
    }

    fn block(&self, start: usize) -> Matrix6<f64> {
        self.covariance.fixed_view::<6, 6>(start, start).into_owned()
    }

    fn position_sigmas(&self, problem: &Problem, state: &State, marker: usize) -> [f64; 3] {
        let shape = &state.plates[0];
        let mut f = DMatrix::<f64>::zeros(3, self.covariance.nrows());
        f.view_mut((0, problem.layout.shapes[0].start), (3, MODES))
            .copy_from(&basis(&shape.nominal[marker], shape.half_diagonal_m));
        (0..3).for_each(|d| f[(d, self.marker_start + 3 * marker + d)] = 1.0);
        let c = &f * &self.covariance * f.transpose();
        [0, 1, 2].map(|d| c[(d, d)].sqrt())
    }
}

/// Difference in units of the standard deviations of `whole`, the covariance from which the rigid part was subtracted.
fn relative(a: &Matrix6<f64>, b: &Matrix6<f64>, whole: &Matrix6<f64>) -> f64 {
    let scale = whole.diagonal().map(f64::sqrt);
    Matrix6::from_fn(|i, j| (a[(i, j)] - b[(i, j)]) / (scale[i] * scale[j])).amax()
}

/// Estimated markers lie up to 0.2 mm beside the nominal ones 130 mm from the centre, so that the rigid motion of the data and that
/// of the nominal markers differ by this share.
const TOLERANCE: f64 = 2e-4 / 0.13;

fn table(files: &BTreeMap<String, Vec<u8>>, name: &str) -> Vec<BTreeMap<String, String>> {
    csv::Reader::from_reader(files[name].as_slice()).deserialize().map(|r| r.unwrap()).collect()
}

fn check(solution: &Solution, files: &BTreeMap<String, Vec<u8>>) {
    let (problem, state) = (&solution.problem, &solution.state);
    let joint = Bordered::new(problem, state, &solution.linearised);
    #[derive(serde::Deserialize)]
    struct PoseYaml {
        covariance: Vec<f64>,
    }
    let read = |name: &str| -> Matrix6<f64> {
        let yaml: PoseYaml = serde_saphyr::from_str(std::str::from_utf8(&files[name]).unwrap()).unwrap();
        Matrix6::from_row_slice(&yaml.covariance)
    };
    let (plate_start, camera_start) = (problem.layout.placements[0].start, problem.layout.mountings[0].start);
    let whole = solution.covariance.block(plate_start);
    let plate = relative(&read("plate_pose.yaml"), &joint.block(plate_start), &whole);
    let of_camera = solution.covariance.block(camera_start);
    let camera = relative(&read("hand_camera.yaml"), &joint.block(camera_start), &of_camera);
    println!("plate pose {plate:e}, hand-camera {camera:e}, tolerance {TOLERANCE:e}");
    assert!(plate < TOLERANCE && camera < TOLERANCE);
    // The rigid part is a visible one: without its subtraction the test fails.
    let rigid = relative(&whole, &read("plate_pose.yaml"), &whole);
    assert!(rigid > 2.0 * TOLERANCE, "the rigid part is {rigid:e} of the covariance only");
    let raw = solution.covariance.positions(problem, state).swap_remove(0);
    for (m, row) in table(files, "plate.csv").iter().enumerate() {
        let expected = joint.position_sigmas(problem, state, m);
        for (d, column) in ["sigma_x_m", "sigma_y_m", "sigma_z_m"].iter().enumerate() {
            let sigma: f64 = row[*column].parse().unwrap();
            // The share is one of what was subtracted, which is several times what remains.
            let difference = (sigma.powi(2) - expected[d].powi(2)).abs() / raw[m].unwrap()[(d, d)];
            assert!(difference < 2.0 * TOLERANCE, "marker {m} {column}: {sigma:e} {:e}", expected[d]);
        }
    }
    check_poses(solution, files);
}

fn check_poses(solution: &Solution, files: &BTreeMap<String, Vec<u8>>) {
    let mut problem = solution.problem.clone();
    let theta = problem.layout.theta_len();
    problem.layout.columns[..theta].iter_mut().for_each(|c| c.free = false);
    problem.noise.pixel_factor = solution.free_poses.pixel_factor.clone();
    let state = &solution.free_poses.state;
    let lin = linearise_all(&problem, state).unwrap();
    let free = Bordered::new(&problem, state, &lin);
    let rows = table(files, "poses.csv");
    assert_eq!(rows.len(), lin.images.len());
    for (k, row) in rows.iter().enumerate() {
        let number = |name: &str| -> f64 { row[name].parse().unwrap() };
        let pose = Pose::from_xyz_quaternion(["x_m", "y_m", "z_m"].map(number), ["qx", "qy", "qz", "qw"].map(number));
        let (angle, distance) = pose.inverse().distance(&lin.chains[k].pose);
        assert!(angle < 1e-12 && distance < 1e-12, "{}", row["image"]);
        let written = Matrix6::from_fn(|i, j| number(&format!("c{}{}", i.min(j) + 1, i.max(j) + 1)));
        // From the plate's side of the pose back to the camera's.
        let back = adjoint(&pose);
        let from_camera = back * written * back.transpose();
        let whole = &solution.free_poses.poses[lin.images[k]].as_ref().unwrap().covariance;
        let difference = relative(&from_camera, &free.block(free.slack_start[k]), whole);
        let rigid = relative(whole, &from_camera, whole);
        assert!(difference < 2.0 * TOLERANCE && rigid > 0.1, "{}: {difference:e} {rigid:e}", row["image"]);
        assert!(from_camera.symmetric_eigenvalues().min() > 0.0);
    }
}

#[test]
fn covariances_are_those_of_a_solve_with_inner_constraints() {
    let description = robot();
    for mount in [CameraMount::Hand, CameraMount::Fixed] {
        let solution = solved(mount, RobotModel::Rigid, &description);
        let left_out = solution.problem.images.iter().flat_map(|i| &i.observations).filter(|o| o.rejected.is_some());
        println!("{mount:?}: {} observations left out", left_out.count());
        check(&solution, &files(&solution, &context(&description)).unwrap());
    }
}
