//! Small problems with random states: every kind of joint, every term, both mounts, circles and points.

use nalgebra::{Matrix2, Vector2, Vector3, Vector6};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal, Uniform};
use robotcal::assess::Limits;
use robotcal::geom::{Pose, exp_so3};
use robotcal::model::camera::{Camera, Lens};
use robotcal::model::joint_terms::{GRAVITY_TERMS, JointTerm, Term};
use robotcal::model::robot::{Posture, Robot};
use robotcal::problem::{Adjustment, State, Stop, TakenFrom, Tie, predict};
use robotcal::problem::{
    Image, JOINTS_IN_COMMON, Layout, Mark, MarkerObservation, MeasuredSeries, MeasuredStop, Names, Noise, PlateShape,
    Problem,
};
use robotcal::series::{CameraMount, Edge, Observation, Plate, PlateKind};
use robotcal::urdf::{CarriedMass, Chain, Drive, Joint, JointKind};

/// Size of the images.
const WIDTH_PX: u32 = 1280;
const HEIGHT_PX: u32 = 1024;

/// Holds the columns whose name fulfils `which`.
pub fn hold(layout: &mut Layout, which: impl Fn(&str) -> bool) {
    layout.columns.iter_mut().filter(|c| which(&c.name)).for_each(|c| c.free = false);
}

/// Random numbers of a printed seed.
pub struct Dice(ChaCha8Rng);

impl Dice {
    pub fn new(seed: u64) -> Self {
        println!("seed {seed}");
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub fn normal(&mut self, sigma: f64) -> f64 {
        let x: f64 = StandardNormal.sample(&mut self.0);
        x * sigma
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        Uniform::new_inclusive(low, high).unwrap().sample(&mut self.0)
    }

    pub fn direction(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.normal(1.0)).normalize()
    }

    /// Translations up to `reach` (m) and rotations up to `angle` (rad).
    pub fn twist(&mut self, reach: f64, angle: f64) -> Vector6<f64> {
        let rho = self.direction() * self.between(0.0, reach);
        let phi = self.direction() * self.between(0.0, angle);
        Vector6::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z)
    }

    pub fn pose(&mut self, reach: f64, angle: f64) -> Pose {
        let t = self.twist(reach, angle);
        Pose::new(exp_so3(&t.fixed_rows::<3>(3).into_owned()), t.fixed_rows::<3>(0).into_owned())
    }
}

/// Kinds of a chain, base to tip; a mimic joint follows reading 0 with a factor and an offset of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Part {
    Fixed,
    Revolute,
    Prismatic,
    Mimic(JointKind),
}

pub fn chain(dice: &mut Dice, parts: &[Part]) -> Chain {
    let mut readings = Vec::new();
    let mut kinds = Vec::new();
    let joints = parts
        .iter()
        .enumerate()
        .map(|(i, part)| {
            let name = format!("joint_{i}");
            let mut own = |kind| {
                readings.push(name.clone());
                kinds.push(kind);
                Some(Drive { reading: readings.len() - 1, multiplier: 1.0, offset: 0.0 })
            };
            let (kind, drive) = match *part {
                Part::Fixed => (JointKind::Fixed, None),
                Part::Revolute => (JointKind::Revolute, own(JointKind::Revolute)),
                Part::Prismatic => (JointKind::Prismatic, own(JointKind::Prismatic)),
                Part::Mimic(kind) => (kind, Some(Drive { reading: 0, multiplier: -0.7, offset: 0.2 })),
            };
            let axis = if kind == JointKind::Fixed { Vector3::zeros() } else { dice.direction() };
            Joint {
                name,
                kind,
                origin: dice.pose(0.4, std::f64::consts::PI),
                axis,
                limits: None,
                drive,
                upwards: false,
                found: None,
            }
        })
        .collect();
    let masses = masses(parts.len());
    Chain {
        robot: "test".into(),
        base: "base".into(),
        tip: "tip".into(),
        joints,
        readings,
        reading_kinds: kinds,
        masses,
        beside: Vec::new(),
        behind_tip: Vec::new(),
    }
}

/// What a random problem contains.
pub struct Request {
    pub parts: Vec<Part>,
    pub terms: Vec<Term>,
    pub mount: CameraMount,
    /// Spread of the deviations from nominal: twists (m, rad) and joint terms (rad or m).
    pub deviation: f64,
    /// Sigma of the latent joint errors, rad or m.
    pub joint_noise: f64,
    pub images: usize,
    /// Images of every stop, each of a camera of its own.
    pub images_a_stop: usize,
    /// Image i sees placement i modulo this.
    pub placements: usize,
    pub lattice: (u32, u32),
    pub radius_m: f64,
    /// True noise of the observations in units of the stated covariance.
    pub pixel_factor: f64,
    pub lens: Lens,
}

impl Default for Request {
    fn default() -> Self {
        Self {
            parts: vec![Part::Revolute; 6],
            terms: vec![Term::Offset],
            mount: CameraMount::Hand,
            deviation: 1e-3,
            joint_noise: 1e-3,
            images: 6,
            images_a_stop: 1,
            placements: 1,
            lattice: (4, 3),
            radius_m: 0.006,
            pixel_factor: 1.3,
            lens: Lens::Brown,
        }
    }
}

/// A mass behind every joint.
fn masses(joints: usize) -> Vec<CarriedMass> {
    let mut dice = Dice::new(joints as u64);
    let mut mass = |joint| CarriedMass {
        link: format!("link_{joint}"),
        joint,
        mass_kg: dice.between(0.5, 20.0),
        centre_m: dice.direction() * dice.between(0.0, 0.3),
    };
    (0..joints).map(&mut mass).collect()
}

pub fn all_terms() -> Vec<Term> {
    let mut terms = vec![Term::Offset, Term::Gear, Term::Backlash];
    for k in 1..=3 {
        terms.extend([Term::Cosine(k), Term::Sine(k)]);
    }
    terms.extend((0..GRAVITY_TERMS).map(Term::Gravity));
    terms.extend([Term::Sag, Term::local(0.2)]);
    terms
}

/// A problem whose images look at the plate from about 0.3 m, and the state that made it.
pub fn problem(dice: &mut Dice, request: &Request) -> (Problem, State) {
    let chain = chain(dice, &request.parts);
    let deviation = request.deviation;
    let readings = chain.readings.len();
    let terms = (0..readings)
        .flat_map(|reading| request.terms.iter().map(move |&term| (reading, term)))
        .map(|(reading, term)| JointTerm { reading, term, value: dice.normal(deviation) })
        .collect();
    let twists = chain.joints.iter().map(|_| dice.twist(deviation, deviation)).collect();
    let robot = Robot { chain, twists, terms };
    let (columns, rows) = request.lattice;
    let mut plate = Plate::lattice(PlateKind::Points, columns, rows, 0.03, 1e-4);
    plate.markers.iter_mut().for_each(|m| m.outer_radius_m = request.radius_m);
    let mut shape = PlateShape::nominal(&plate);
    shape.modes = std::array::from_fn(|_| dice.normal(1e-4));
    shape.corrections.iter_mut().for_each(|c| *c = Vector3::from_fn(|_, _| dice.normal(1e-4)));
    let mut camera = Camera::pinhole(request.lens, WIDTH_PX, HEIGHT_PX, 1000.0);
    camera.parameters[..9].copy_from_slice(&[1010.0, 990.0, 655.0, 505.0, -0.15, 0.03, 8e-4, -5e-4, 0.004]);
    let formula = camera.parametric();
    camera.parameters[formula..].iter_mut().for_each(|c| *c = dice.normal(0.3));
    let mounting = dice.pose(0.2, 3.0);
    let mut noise = || (0..readings).map(|_| dice.normal(request.joint_noise)).collect();
    let joint_errors = (0..request.images / request.images_a_stop).map(|_| noise()).collect();
    let mut state = State {
        robot,
        mountings: vec![mounting],
        placements: Vec::new(),
        instruments: Vec::new(),
        bodies: Vec::new(),
        cameras: vec![camera; request.images_a_stop],
        plates: vec![shape],
        joint_errors,
        ties: vec![Tie::Rigid; request.images],
    };
    let (mut stops, mut images): (Vec<Stop>, Vec<Image>) = (Vec::new(), Vec::new());
    let centre: Vec<f64> = (0..readings).map(|_| dice.between(-2.0, 2.0)).collect();
    while images.len() < request.images {
        let posture = Posture {
            readings: centre.iter().map(|c| c + dice.between(-0.3, 0.3)).collect(),
            approach: (!images.is_empty()).then(|| (0..readings).map(|_| dice.normal(2e-3)).collect()),
        };
        let mut own = Vec::new();
        for camera in 0..request.images_a_stop {
            let i = images.len() + camera;
            let image = Image {
                name: format!("{i:03}.png"),
                series: 0,
                stop: stops.len(),
                camera,
                mounting: camera,
                placement: i % request.placements,
                plate: 0,
                mount: request.mount,
                observations: Vec::new().into(),
                rejected: None,
            };
            let joint_errors = &state.joint_errors[stops.len()];
            let from = TakenFrom { posture: Some(&posture), joint_errors, tie: &Tie::Rigid };
            if state.placements.len() == i && i < request.placements {
                state.placements.push(Pose::identity());
                let wanted = view(dice);
                let seen_as = state.camera_from_plate(&image, from).unwrap();
                // Both mounts have the plate's pose as the last factor.
                state.placements[i] = seen_as.inverse() * wanted;
            }
            if state.mountings.len() == camera {
                let wanted = view(dice);
                let before = Image { mounting: 0, ..image.clone() };
                let seen_as = state.camera_from_plate(&before, from).unwrap();
                // camera_from_plate begins with the inverse of the camera's pose.
                state.mountings.push(state.mountings[0] * (seen_as * wanted.inverse()));
            }
            let image = observed(dice, request, &plate, &state, image, from);
            if image.observations.len() == plate.markers.len() {
                own.push(image);
            }
        }
        if own.len() == request.images_a_stop {
            images.extend(own);
            stops.push(Stop { series: 0, posture: Some(posture), local_share: Vec::new() });
        }
    }
    let names = |n: usize, what: &str| (0..n).map(|k| format!("{what}_{k}")).collect::<Vec<_>>();
    let count = request.images_a_stop;
    let (mountings, placements) = (names(count, "mounting"), names(state.placements.len(), "placement"));
    let cameras = if count == 1 { vec!["front".to_owned()] } else { names(count, "camera") };
    let plates = ["plate".to_owned()];
    let named = Names {
        mountings: &mountings,
        placements: &placements,
        cameras: &cameras,
        plates: &plates,
        ..Names::default()
    };
    let layout = Layout::new(&state, &named);
    let noise = Noise {
        pixel_factor: vec![request.pixel_factor; count],
        joint: vec![vec![request.joint_noise.max(1e-6); readings]],
        local: Vec::new(),
        displacement: Vec::new(),
        marker: Vec::new(),
        body: Vec::new(),
    };
    (
        Problem {
            layout,
            plates: vec![plate],
            placements,
            mountings,
            cameras,
            stops,
            fewest_in_common: JOINTS_IN_COMMON,
            images,
            instruments: Vec::new(),
            bodies: Vec::new(),
            body_measurements: Vec::new(),
            lengths: Vec::new(),
            noise,
            families: Vec::new(),
            moved_markers: Default::default(),
            restraint: None,
            huber: 2.45,
            bounds: Limits::default().bounds(),
        },
        state,
    )
}

/// A camera pose 0.3 m in front of the plate, tilted by up to 50 degrees.
fn view(dice: &mut Dice) -> Pose {
    let tilt =
        Vector3::new(dice.between(-1.0, 1.0), dice.between(-1.0, 1.0), 0.0).normalize() * dice.between(0.0, 0.87);
    let facing = exp_so3(&Vector3::new(std::f64::consts::PI, 0.0, 0.0));
    let roll = exp_so3(&Vector3::new(0.0, 0.0, dice.between(-3.0, 3.0)));
    let translation = Vector3::new(dice.normal(0.01), dice.normal(0.01), dice.between(0.28, 0.4));
    Pose::new(exp_so3(&tilt) * facing * roll, translation)
}

/// The image with every marker that is in front of the camera and within 45 degrees of its axis.
fn observed(
    dice: &mut Dice,
    request: &Request,
    plate: &Plate,
    state: &State,
    mut image: Image,
    from: TakenFrom,
) -> Image {
    let pose = state.camera_from_plate(&image, from).unwrap();
    for marker in 0..plate.markers.len() {
        let x = pose.transform(&state.plates[0].position(marker));
        if x.z < 0.12 || x.xy().norm() > x.z {
            continue;
        }
        let (uu, vv) = (0.01 * dice.between(0.5, 2.0), 0.01 * dice.between(0.5, 2.0));
        let uv = 0.3 * (uu * vv).sqrt();
        let covariance = Matrix2::new(uu, uv, uv, vv);
        let mut o = MarkerObservation {
            marker,
            edge: Edge::Outer,
            mark: if marker % 5 == 4 { Mark::Corner } else { Mark::of_radius(request.radius_m) },
            uv: Vector2::zeros(),
            information: covariance.try_inverse().unwrap(),
            rejected: None,
        };
        let noise = Vector2::new(dice.normal(1.0), dice.normal(1.0)) * request.pixel_factor;
        o.uv = predict(&image, state, &pose, &o).unwrap().uv + covariance.cholesky().unwrap().l() * noise;
        image.observations.push(o);
    }
    image
}

/// The same data as a series for `identify`.
pub fn series(problem: &Problem) -> MeasuredSeries {
    let plate = problem.plates[0].clone();
    let stop = |(row, image): (usize, &Image)| MeasuredStop {
        row,
        image: image.name.clone(),
        readings: problem.stops[image.stop].posture.as_ref().map(|p| p.readings.clone()),
        placement: problem.placements[image.placement].clone(),
        observations: (image.observations.iter())
            .map(|o| {
                let c = o.information.try_inverse().unwrap();
                let covariance = Some([c[(0, 0)], c[(0, 1)], c[(1, 1)]]);
                Observation { marker: plate.markers[o.marker].id, edge: o.edge, uv: o.uv.into(), covariance }
            })
            .collect(),
        left_out: None,
    };
    let stops = problem.images.iter().enumerate().map(stop).collect();
    MeasuredSeries {
        camera: problem.cameras[0].clone(),
        mounting: problem.mountings[0].clone(),
        mount: problem.images[0].mount,
        width_px: WIDTH_PX,
        height_px: HEIGHT_PX,
        plate_name: "plate".into(),
        has_images: true,
        plate,
        ..MeasuredSeries::without_images("small", false, stops)
    }
}

/// With free camera poses of some images, where their readings put them.
pub fn free_poses(problem: &Problem, state: &State, which: impl Fn(usize) -> bool) -> State {
    let given = Adjustment { problem: problem.clone(), state: state.clone() };
    let mut free = state.clone();
    for i in (0..problem.images.len()).filter(|&i| which(i)) {
        free.ties[i] = Tie::Free(given.camera_from_plate(i).unwrap());
        // A stop whose images are all free has nothing latent of its own.
        if problem.images.iter().enumerate().all(|(k, image)| image.stop != problem.images[i].stop || which(k)) {
            free.joint_errors[problem.images[i].stop] = Vec::new();
        }
    }
    free
}
