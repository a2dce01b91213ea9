//! Every hand-written derivative against dual numbers, over random states.
//!
//! Tolerances: both sides are sums of some tens of products in f64 and differ by rounding alone, about 1e-14 of the largest entry
//! of the block; circles lose two or three digits more, because moments of the contour (px^3) are divided by its area (px^2).

use crate::support::couplings::marker_couplings;
use crate::support::small::{Dice, Part, Request, all_terms, problem};
use crate::support::witness::{self, D, Seed, body_twist, constant, variable};
use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector6};
use robotcal::geom::{Pose, exp_so3, log_so3, right_jacobian_se3, right_jacobian_so3};
use robotcal::model::camera::{Camera, Lens};
use robotcal::model::circle;
use robotcal::model::joint_terms::Term;
use robotcal::model::plate_modes::MODES;
use robotcal::problem::{
    Adjustment, E, Image, Problem, State, TakenFrom, Tie, Weighting, equations, linearise, linearise_pose, predict,
};
use robotcal::series::CameraMount;
use robotcal::urdf::JointKind;
use std::f64::consts::PI;

/// Rounding of a robot chain, relative to the largest entry.
const CHAIN: f64 = 1e-12;

/// Rounding of a circle's centroid, relative to the largest entry.
const CIRCLE: f64 = 1e-10;

fn assert_same<const R: usize, const C: usize>(
    what: &str,
    library: &SMatrix<f64, R, C>,
    witness: &SMatrix<f64, R, C>,
    relative: f64,
) {
    let scale = witness.amax().max(library.amax());
    let difference = (library - witness).amax();
    assert!(
        difference <= relative * scale && difference.is_finite(),
        "{what}: {difference:e} of {scale:e}\nlibrary {library}witness {witness}"
    );
}

fn six(f: impl Fn(&[D; 6]) -> Vector6<f64>, at: &Vector6<f64>) -> Matrix6<f64> {
    Matrix6::from_columns(&std::array::from_fn::<_, 6, _>(|k| f(&std::array::from_fn(|c| variable(at[c], c == k)))))
}

#[test]
fn right_jacobians_of_the_exponentials() {
    let mut dice = Dice::new(1);
    for size in [0.0, 1e-9, 1e-5, 0.99e-4, 1.01e-4, 0.99e-3, 1.01e-3, 0.1, 1.0, 2.0, 3.1, PI] {
        for _ in 0..5 {
            let phi = dice.direction() * size;
            let rho = dice.direction() * dice.between(0.0, 1.0);
            let x = Vector6::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z);
            let truth = six(|t| body_twist(&witness::exp(t)), &x);
            assert_same(&format!("se3 at {size}"), &right_jacobian_se3(&x), &truth, CHAIN);
            let turning: Matrix3<f64> = truth.fixed_view::<3, 3>(3, 3).into_owned();
            assert_same(&format!("so3 at {size}"), &right_jacobian_so3(&phi), &turning, CHAIN);
        }
    }
}

#[test]
fn exponential_and_logarithm_undo_each_other_near_zero_and_near_pi() {
    let mut dice = Dice::new(2);
    for size in [0.0, 1e-12, 1e-9, 1e-6, 1e-4, 1e-2, 1.0, 3.0, PI - 1e-4, PI - 1e-7, PI - 1e-10, PI] {
        for _ in 0..20 {
            let phi = dice.direction() * size;
            let r = exp_so3(&phi);
            let rounding = 1e-15 * 10.0;
            assert!((r.transpose() * r - Matrix3::identity()).amax() < rounding, "not a rotation at {size}");
            let back = log_so3(&r);
            // At pi the axis may come back with the other sign: the same rotation.
            let turned = (exp_so3(&back) - r).amax();
            assert!(turned < rounding, "rotation off by {turned:e} at {size}");
            if size < PI - 1e-6 {
                assert!((back - phi).amax() < rounding.max(2.0 * rounding * size), "{phi} {back}");
            }
            let rho = dice.direction();
            let x = Vector6::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z);
            let pose = Pose::exp(&x);
            let witness = witness::exp(&std::array::from_fn(|c| constant(x[c]))).map(|d| d.re);
            assert!((pose.matrix() - witness).amax() < 1e-14, "exponential at {size}");
            let again = Pose::exp(&pose.log());
            assert!((again.matrix() - pose.matrix()).amax() < 1e-13, "pose logarithm at {size}");
        }
    }
}

fn random_camera(dice: &mut Dice) -> Camera {
    let mut camera = Camera::pinhole(Lens::Brown, 1280, 1024, dice.between(500.0, 3000.0));
    camera.parameters[1] *= dice.between(0.9, 1.1);
    let spread = [0.2, 0.05, 2e-3, 2e-3, 0.01];
    camera.parameters[4..].iter_mut().zip(spread).for_each(|(c, s)| *c = dice.normal(s));
    camera
}

/// Columns of the derivative of `f` by `N` inputs.
fn columns<const N: usize>(f: impl Fn([bool; N]) -> [D; 2]) -> SMatrix<f64, 2, N> {
    SMatrix::from_fn(|r, c| f(std::array::from_fn(|k| k == c))[r].eps)
}

#[test]
fn projection_through_the_lens() {
    let mut dice = Dice::new(3);
    for _ in 0..200 {
        let camera = random_camera(&mut dice);
        let x = Vector3::new(dice.between(-0.3, 0.3), dice.between(-0.3, 0.3), dice.between(0.2, 1.5));
        let library = camera.project_with_jacobian(&x).unwrap();
        let by_point = columns::<3>(|s| {
            let p: Vec<D> = camera.parameters.iter().map(|v| constant(*v)).collect();
            witness::project(&p, &std::array::from_fn(|k| variable(x[k], s[k])))
        });
        let by_camera = columns::<9>(|s| {
            let p: Vec<D> = camera.parameters.iter().zip(s).map(|(v, s)| variable(*v, s)).collect();
            witness::project(&p, &std::array::from_fn(|k| constant(x[k])))
        });
        let value = witness::project(
            &camera.parameters.iter().map(|v| constant(*v)).collect::<Vec<_>>(),
            &std::array::from_fn(|k| constant(x[k])),
        );
        assert!((library.uv.x - value[0].re).abs() + (library.uv.y - value[1].re).abs() < 1e-10);
        assert_same("point", &library.d_point, &by_point, CHAIN);
        assert_same("camera", &library.d_parameters.fixed_columns::<9>(0).into_owned(), &by_camera, CHAIN);
        assert_eq!(library.d_parameters.columns(9, 4).amax(), 0.0, "columns of parameters that the lens does not have");
    }
}

/// Spread of the coefficients of every lens, as they are in use.
fn spread(lens: Lens) -> &'static [f64] {
    match lens {
        Lens::Brown | Lens::BrownField => &[0.2, 0.05, 2e-3, 2e-3, 0.01],
        Lens::Fisheye | Lens::FisheyeField => &[0.05, 0.02, 0.01, 0.005],
        Lens::Rational => &[0.3, 0.1, 2e-3, 2e-3, 0.02, 0.3, 0.1, 0.02],
        Lens::ThinPrism => &[0.2, 0.05, 2e-3, 2e-3, 0.01, 3e-3, 1e-3, 3e-3, 1e-3],
        Lens::Parallax => &[0.2, 0.05, 2e-3, 2e-3, 0.01, 0.01, 0.005],
    }
}

#[test]
fn projection_through_every_lens() {
    let mut dice = Dice::new(13);
    for lens in Lens::ALL.into_iter().filter(|l| !l.has_field()) {
        for k in 0..200 {
            let mut camera = Camera::pinhole(lens, 1280, 1024, dice.between(300.0, 2000.0));
            assert_eq!(camera.parameters.len(), 4 + spread(lens).len());
            camera.parameters[4..].iter_mut().zip(spread(lens)).for_each(|(c, s)| *c = dice.normal(*s));
            // Near the axis some lenses need a series of their own.
            let reach = [0.9, 1e-2, 3e-4, 2e-5][k % 4];
            let x = Vector3::new(dice.between(-reach, reach), dice.between(-reach, reach), dice.between(0.4, 1.5));
            let library = camera.project_with_jacobian(&x).unwrap();
            let at: Vec<D> = camera.parameters.iter().map(|v| constant(*v)).collect();
            let by_point =
                columns::<3>(|s| witness::project_through(lens, &at, &std::array::from_fn(|k| variable(x[k], s[k]))));
            let by_camera = columns::<13>(|s| {
                let p: Vec<D> = camera.parameters.iter().zip(s).map(|(v, s)| variable(*v, s)).collect();
                witness::project_through(lens, &p, &std::array::from_fn(|k| constant(x[k])))
            });
            let value = witness::project_through(lens, &at, &std::array::from_fn(|k| constant(x[k])));
            let off = (library.uv.x - value[0].re).abs() + (library.uv.y - value[1].re).abs();
            assert!(off < 1e-9, "{lens:?}: {off:e}");
            // The series near the axis leaves out r^2 (1e-8).
            let relative = if lens == Lens::Fisheye && reach < 1e-3 { 3e-8 } else { CHAIN };
            assert_same(&format!("{lens:?}, point"), &library.d_point, &by_point, relative);
            for c in 0..13 {
                let scale = by_camera.column(c).amax().max(1e-9);
                let off = (library.d_parameters.column(c) - by_camera.column(c)).amax();
                assert!(off <= scale * relative.max(1e-11), "{lens:?}, parameter {c}: {off:e} of {scale:e}");
            }
        }
    }
}

#[test]
fn projection_through_a_displacement_field() {
    let mut dice = Dice::new(14);
    let (mut seen, mut beyond) = (0, 0);
    for (k, lens) in [Lens::BrownField, Lens::FisheyeField].into_iter().cycle().take(40).enumerate() {
        // Ten cells across and squares as near as whole ones can be; sizes of 4:3, 5:4 and a narrow strip.
        let ([width, height], cells) = [([1280, 1024], [10, 8]), ([640, 480], [10, 8]), ([900, 100], [10, 1])][k % 3];
        let mut camera = Camera::pinhole(lens, width, height, 0.8 * f64::from(width));
        let formula = camera.parametric();
        camera.parameters[4..formula].iter_mut().zip(spread(lens)).for_each(|(c, s)| *c = dice.normal(*s));
        camera.parameters[formula..].iter_mut().for_each(|c| *c = dice.normal(3.0));
        let x = Vector3::new(dice.between(-0.7, 0.7), dice.between(-0.3, 0.3), dice.between(0.8, 1.5));
        let library = camera.project_with_jacobian(&x).unwrap();
        let evaluate = |seed: Option<usize>| {
            let p: Vec<D> = camera.parameters.iter().enumerate().map(|(i, v)| variable(*v, seed == Some(i))).collect();
            let at = |c: usize| variable(x[c], seed == Some(usize::MAX - c));
            let h = witness::project_through(lens, &p, &[at(0), at(1), at(2)]);
            witness::displaced(h, &p[formula..], [f64::from(width), f64::from(height)], cells)
        };
        let value = evaluate(None).map(|d| d.re);
        assert!((library.uv.x - value[0]).abs() + (library.uv.y - value[1]).abs() < 1e-9, "{lens:?}, {k}");
        let inside = camera.contains(&library.uv, 8.0);
        (seen, beyond) = (seen + usize::from(inside), beyond + usize::from(!inside));
        let by_point = columns::<3>(|s| evaluate(s.iter().position(|s| *s).map(|c| usize::MAX - c)));
        assert_same(&format!("{lens:?}, point"), &library.d_point, &by_point, 1e-11);
        let touched = camera.touched(&library.by_formula).unwrap();
        for c in 0..camera.parameters.len() {
            let w = evaluate(Some(c)).map(|d| d.eps);
            let own = match c.checked_sub(formula) {
                None => [library.d_parameters[(0, c)], library.d_parameters[(1, c)]],
                Some(f) => {
                    let b = touched.points().find(|(at, _)| *at == f / 2).map_or(0.0, |(_, b)| b);
                    if f % 2 == 0 { [b, 0.0] } else { [0.0, b] }
                }
            };
            let scale = w[0].abs().max(w[1].abs()).max(1e-3);
            assert!(
                (own[0] - w[0]).abs().max((own[1] - w[1]).abs()) < 1e-10 * scale,
                "{lens:?}, parameter {c}: {own:?} {w:?}"
            );
        }
    }
    assert!(seen > 10 && beyond > 3, "inside {seen}, beyond the border {beyond}");
}

/// Library and witness at one view of one circle: value and the 6 + 3 + 9 + 1 derivatives.
fn circle_witness(
    camera: &Camera,
    pose: &Pose,
    centre: &Vector3<f64>,
    radius: f64,
    n: usize,
) -> (SMatrix<f64, 2, 19>, [f64; 2]) {
    let evaluate = |s: [bool; 19]| {
        let twist = std::array::from_fn(|k| variable(0.0, s[k]));
        let at = std::array::from_fn(|k| variable(centre[k], s[6 + k]));
        let p: Vec<D> = camera.parameters.iter().enumerate().map(|(k, v)| variable(*v, s[9 + k])).collect();
        witness::circle(
            |x| witness::project(&p, x),
            &(witness::lift(&pose.matrix()) * witness::exp(&twist)),
            &at,
            variable(radius, s[18]),
            n,
        )
    };
    (columns::<19>(evaluate), evaluate([false; 19]).map(|d| d.re))
}

fn circle_library(camera: &Camera, pose: &Pose, centre: &Vector3<f64>, radius: f64) -> (SMatrix<f64, 2, 19>, [f64; 2]) {
    let p = circle::centroid(camera, pose, centre, radius).unwrap();
    let mut all = SMatrix::<f64, 2, 19>::zeros();
    all.fixed_view_mut::<2, 6>(0, 0).copy_from(&p.d_pose.transpose());
    all.fixed_view_mut::<2, 3>(0, 6).copy_from(&p.d_marker);
    all.fixed_view_mut::<2, 9>(0, 9).copy_from(&p.d_camera.fixed_rows::<9>(0).transpose());
    all.set_column(18, &p.d_radius);
    (all, p.uv.into())
}

fn per_block(what: &str, library: &SMatrix<f64, 2, 19>, witness: &SMatrix<f64, 2, 19>, relative: f64) {
    for c in 0..19 {
        // Columns differ in unit; translations and marker coordinates near the image plane's normal may nearly vanish.
        let scale =
            witness.column(c).amax().max(1e-3 * witness.columns(3 * (c / 3), if c == 18 { 1 } else { 3 }).amax());
        let off = (library.column(c) - witness.column(c)).amax();
        assert!(off <= relative * scale, "{what}, column {c}: {off:e} of {scale:e}");
    }
}

#[test]
fn area_centroid_of_a_circle() {
    let mut dice = Dice::new(4);
    for view in 0..200 {
        let camera = random_camera(&mut dice);
        let tilt = Vector3::new(dice.normal(1.0), dice.normal(1.0), 0.0).normalize() * dice.between(0.0, 0.9);
        let pose = Pose::new(
            exp_so3(&tilt) * exp_so3(&Vector3::new(PI, 0.0, 0.0)),
            Vector3::new(dice.between(-0.1, 0.1), dice.between(-0.1, 0.1), dice.between(0.25, 0.6)),
        );
        let centre = Vector3::new(dice.between(-0.05, 0.05), dice.between(-0.05, 0.05), dice.normal(1e-3));
        let radius = if dice.between(0.0, 1.0) < 0.2 { 0.0 } else { dice.between(1e-3, 8e-3) };
        let (library, uv) = circle_library(&camera, &pose, &centre, radius);
        let samples =
            witness::samples(&witness::lift(&pose.matrix()), &[centre.x, centre.y, centre.z].map(constant), radius);
        let (same, value) = circle_witness(&camera, &pose, &centre, radius, samples);
        assert!((uv[0] - value[0]).abs() + (uv[1] - value[1]).abs() < 1e-9, "{uv:?} {value:?}");
        per_block("as many samples", &library, &same, CIRCLE);
        if view % 10 > 0 {
            continue;
        }
        // Against the true area centroid only the truncation at 8 or 12 samples remains: harmonics fall off like
        // (radius / distance)^n, the lens adds products of them; derivatives are right to 1e-6.
        let (true_centroid, value) = circle_witness(&camera, &pose, &centre, radius, 48);
        assert!((uv[0] - value[0]).abs() + (uv[1] - value[1]).abs() < 1e-6, "{uv:?} {value:?}");
        per_block("true centroid", &library, &true_centroid, 1e-6);
    }
}

/// Chains that have every kind of joint in every position that matters.
fn chains() -> Vec<Vec<Part>> {
    use Part::{Fixed, Mimic, Prismatic, Revolute};
    vec![
        vec![Revolute; 6],
        vec![Fixed, Revolute, Prismatic, Fixed, Revolute, Revolute, Fixed],
        vec![Prismatic, Prismatic, Prismatic, Revolute],
        vec![Revolute, Mimic(JointKind::Revolute), Fixed, Revolute, Mimic(JointKind::Prismatic), Revolute],
    ]
}

fn problems(mount: CameraMount, deviation: f64, dice: &mut Dice) -> Vec<(Problem, State)> {
    chains()
        .into_iter()
        .map(|parts| {
            // Gravity of a reading that moves several joints is defined by the last of them; it has its own test.
            let mimic = parts.iter().any(|p| matches!(p, Part::Mimic(_)));
            let mut terms = all_terms();
            terms.retain(|t| !(mimic && matches!(t, Term::Gravity(_) | Term::Sag)));
            let request = Request {
                parts,
                terms,
                mount,
                deviation,
                joint_noise: deviation,
                images: 3,
                placements: 3,
                lattice: (3, 2),
                ..Request::default()
            };
            problem(dice, &request)
        })
        .collect()
}

/// The camera pose and its derivatives by all columns that act through it, and by what is latent.
fn check_chained(problem: &Problem, state: &State, image: &Image, from: TakenFrom) {
    let library = state.chained(&problem.layout, image, from).unwrap();
    let value = witness::camera_from_plate(state, &problem.layout, image, from, None).map(|d| d.re);
    assert!((library.pose.matrix() - value).amax() < 1e-12, "pose of {}", image.name);
    let twist = |seed| body_twist(&witness::camera_from_plate(state, &problem.layout, image, from, Some(seed)));
    for (c, column) in problem.layout.columns.iter().enumerate().take(problem.layout.theta_len()) {
        let (g, w) = (library.d_theta.column(c).into_owned(), twist(Seed::Column(c)));
        // Levers of up to some metres multiply the rounding.
        let off = (&g - w).amax();
        assert!(off <= CHAIN * w.amax().max(1.0), "{} by {}: {off:e}\n{g}{w}", image.name, column.name);
    }
    assert_eq!(library.d_latent.ncols(), from.unknowns());
    for k in 0..from.unknowns() {
        let (l, w) = (library.d_latent.column(k).into_owned(), twist(Seed::Latent(k)));
        assert!((&l - w).amax() <= CHAIN * w.amax().max(1.0), "{} by latent {k}\n{l}{w}", image.name);
    }
}

#[test]
fn camera_poses_by_robot_terms_mounts_and_latents() {
    let mut dice = Dice::new(5);
    for mount in [CameraMount::Hand, CameraMount::Fixed] {
        // From usual deviations to twists and joint noise of a radian.
        for deviation in [0.0, 1e-3, 1.0] {
            for (problem, state) in problems(mount, deviation, &mut dice) {
                for (i, image) in problem.images.iter().enumerate() {
                    let given = Adjustment { problem: problem.clone(), state: state.clone() };
                    let from = given.taken_from(i);
                    check_chained(&problem, &state, image, from);
                    check_chained(&problem, &state, image, TakenFrom::exact(from.posture.unwrap()));
                    let values = [1.0, -0.7, 0.4, 0.3, -0.5, 0.8].map(|share| share * deviation);
                    for components in [2, 6] {
                        let tie = Tie::Displaced(values[..components].to_vec());
                        check_chained(&problem, &state, image, TakenFrom { tie: &tie, ..from });
                    }
                    let tie = Tie::Free(given.camera_from_plate(i).unwrap());
                    check_chained(&problem, &state, image, TakenFrom { tie: &tie, ..from });
                }
            }
        }
    }
}

/// Normal equations of one image from dual numbers: rows of J in the order pose, intrinsics; markers apart.
#[test]
fn normal_equations_of_an_image() {
    let mut dice = Dice::new(6);
    for mount in [CameraMount::Hand, CameraMount::Fixed] {
        for (mut problem, state) in problems(mount, 1e-3, &mut dice) {
            problem.huber = 1.0;
            for (i, image) in problem.images.iter().enumerate() {
                let given = Adjustment { problem: problem.clone(), state: state.clone() };
                check_image(&problem, &state, image, &given.camera_from_plate(i).unwrap());
            }
        }
    }
}

fn check_image(problem: &Problem, state: &State, image: &Image, pose: &Pose) {
    let tie = Tie::Free(*pose);
    let from = TakenFrom { posture: None, joint_errors: &[], tie: &tie };
    let layout = &problem.layout;
    let weighting = Weighting::of(problem, image);
    let library = linearise(image, state, pose, &weighting).unwrap();
    let (mut pp, mut pe, mut ee) =
        (Matrix6::<f64>::zeros(), SMatrix::<f64, 6, E>::zeros(), SMatrix::<f64, E, E>::zeros());
    let (mut bp, mut be) = (Vector6::zeros(), SMatrix::<f64, E, 1>::zeros());
    let mut cost = 0.0;
    let couplings = marker_couplings(&equations(image, state, pose, &weighting).unwrap());
    assert_eq!(library.markers.len(), image.used().count());
    assert_eq!(couplings.len(), library.markers.len());
    for ((o, terms), coupling) in image.used().zip(&library.markers).zip(&couplings) {
        let by = |seed| {
            let d = witness::predict(state, layout, image, from, o, Some(seed));
            [d[0].eps, d[1].eps]
        };
        let uv = witness::predict(state, layout, image, from, o, None).map(|d| d.re);
        let jp = SMatrix::<f64, 2, 6>::from_columns(&std::array::from_fn::<_, 6, _>(|k| by(Seed::Latent(k)).into()));
        let jm = SMatrix::<f64, 2, 3>::from_columns(&std::array::from_fn::<_, 3, _>(|k| {
            by(Seed::Marker(o.marker, k)).into()
        }));
        let cameras = layout.cameras[image.camera].clone();
        let mut je = SMatrix::<f64, 2, E>::zeros();
        for (k, c) in cameras.enumerate() {
            je.set_column(k, &by(Seed::Column(c)).into());
        }
        for (k, c) in layout.shapes[image.plate].clone().enumerate() {
            je.set_column(E - MODES + k, &by(Seed::Column(c)).into());
        }
        let r = o.uv - SMatrix::<f64, 2, 1>::from(uv);
        let information = o.information / weighting.pixel_factor.powi(2);
        let length = (r.transpose() * information * r)[0].sqrt();
        // Huber: half the square within the bound, linear beyond; the weight is its slope over the length.
        let (rho, weight) = if length <= problem.huber {
            (length * length / 2.0, 1.0)
        } else {
            (problem.huber * length - problem.huber * problem.huber / 2.0, problem.huber / length)
        };
        cost += rho;
        let w = information * weight;
        pp += jp.transpose() * w * jp;
        pe += jp.transpose() * w * je;
        ee += je.transpose() * w * je;
        bp += jp.transpose() * w * r;
        be += je.transpose() * w * r;
        assert_eq!([terms.marker, coupling.marker], [o.marker; 2]);
        assert_same("mm", &terms.information(), &(jm.transpose() * w * jm), CIRCLE);
        assert_same("mp", &coupling.with_pose, &(jm.transpose() * w * jp), CIRCLE);
        assert_same("me", &coupling.with_intrinsics, &(jm.transpose() * w * je), CIRCLE);
        assert_same("bm", &terms.bm, &(jm.transpose() * w * r), CIRCLE.max(1e-9 / r.norm()));
    }
    assert!((library.cost - cost).abs() < 1e-8 * cost.max(1.0), "{} {cost}", library.cost);
    // Units differ by powers of ten: compare with every unknown scaled to unit information.
    let sp = Matrix6::from_diagonal(&pp.diagonal().map(|d| 1.0 / d.sqrt()));
    let se = SMatrix::<f64, E, E>::from_diagonal(&ee.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 }));
    assert_same("pp", &(sp * library.pp * sp), &(sp * pp * sp), CIRCLE);
    let library_pe = library.pe.fixed_columns::<E>(0).into_owned();
    let library_ee = library.ee.fixed_view::<E, E>(0, 0).into_owned();
    assert_eq!(library.ee.nrows(), E, "a lens without a field has no columns for one");
    assert_same("pe", &(sp * library_pe * se), &(sp * pe * se), CIRCLE);
    assert_same("ee", &(se * library_ee * se), &(se * ee * se), CIRCLE);
    assert_same("bp", &(sp * library.bp), &(sp * bp), 10.0 * CIRCLE);
    assert_same("be", &(se * library.be.fixed_rows::<E>(0)), &(se * be), 10.0 * CIRCLE);
    let of_pose = linearise_pose(image, state, pose, &weighting).unwrap();
    assert_eq!(of_pose.cost, library.cost);
    assert_same("pp by itself", &(sp * of_pose.pp * sp), &(sp * pp * sp), CIRCLE);
    assert_same("bp by itself", &(sp * of_pose.bp), &(sp * bp), 10.0 * CIRCLE);
    let unused = (0..E).filter(|k| ee[(*k, *k)] == 0.0);
    assert!(unused.clone().all(|k| library_ee[(k, k)] == 0.0), "padding is not empty");
}

#[test]
fn predictions_through_the_whole_chain() {
    let mut dice = Dice::new(7);
    for mount in [CameraMount::Hand, CameraMount::Fixed] {
        for (problem, state) in problems(mount, 1e-3, &mut dice) {
            for (i, image) in problem.images.iter().enumerate() {
                let given = Adjustment { problem: problem.clone(), state: state.clone() };
                let from = given.taken_from(i);
                let chain = given.state.chained(&given.problem.layout, &given.problem.images[i], from).unwrap();
                for o in image.used() {
                    let p = predict(image, &state, &chain.pose, o).unwrap();
                    let through = p.d_pose.transpose() * &chain.d_theta;
                    let scale = through.amax();
                    for c in 0..problem.layout.theta_len() {
                        let w = witness::predict(&state, &problem.layout, image, from, o, Some(Seed::Column(c)));
                        let off = (through[(0, c)] - w[0].eps).abs().max((through[(1, c)] - w[1].eps).abs());
                        assert!(off < CIRCLE * scale, "{}: {off:e} of {scale:e}", problem.layout.columns[c].name);
                    }
                }
            }
        }
    }
}
