//! The forward model once more, from its definitions, in dual numbers: a witness that shares no formula with the library.
//!
//! Exponentials are power series of the 4x4 matrix of a twist, the robot is a product of 4x4 matrices, the moment of gravity is
//! the slope of a height, the area centroid comes from the Fourier coefficients of the contour.

use nalgebra::{Matrix4, SMatrix, Vector3, Vector6};
use num_dual::{Dual64, DualNum};
use robotcal::geom::Pose;
use robotcal::model::camera::Lens;
use robotcal::model::joint_terms::Term;
use robotcal::model::robot::{Posture, Robot};
use robotcal::problem::{Image, Layout, MarkerObservation, State, TakenFrom, Tie};
use robotcal::series::{CameraMount, Edge};
use robotcal::urdf::{Chain, JointKind};
use std::f64::consts::TAU;

pub type D = Dual64;
pub type D4 = SMatrix<D, 4, 4>;

/// The one scalar unknown with respect to which everything is differentiated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Seed {
    /// A dense column.
    Column(usize),
    /// A component of what is latent in the pose of the image: joint errors of its stop, then its tie.
    Latent(usize),
    /// A coordinate of the correction of a marker.
    Marker(usize, usize),
}

pub fn constant(x: f64) -> D {
    D::from_re(x)
}

/// A value whose derivative is one where `seeded`.
pub fn variable(x: f64, seeded: bool) -> D {
    D::new(x, if seeded { 1.0 } else { 0.0 })
}

pub fn lift(m: &Matrix4<f64>) -> D4 {
    m.map(constant)
}

/// 4x4 matrix of a twist [rho, phi].
pub fn hat(t: &[D; 6]) -> D4 {
    let o = constant(0.0);
    let [x, y, z, a, b, c] = *t;
    D4::from_row_slice(&[o, -c, b, x, c, o, -a, y, -b, a, o, z, o, o, o, o])
}

/// Matrix exponential of a twist by its power series, after halving the twist until it is small.
pub fn exp(t: &[D; 6]) -> D4 {
    let halvings = 4;
    let m = hat(&t.map(|x| x * constant(0.5f64.powi(halvings))));
    let mut term = D4::identity();
    let mut sum = D4::identity();
    for n in 1..15 {
        term = term * m * constant(1.0 / f64::from(n));
        sum += term;
    }
    for _ in 0..halvings {
        sum = sum * sum;
    }
    sum
}

/// Inverse of a rigid motion.
pub fn inverse(m: &D4) -> D4 {
    let r = m.fixed_view::<3, 3>(0, 0).transpose();
    let t = r * m.fixed_view::<3, 1>(0, 3);
    let mut i = D4::identity();
    i.fixed_view_mut::<3, 3>(0, 0).copy_from(&r);
    i.fixed_view_mut::<3, 1>(0, 3).copy_from(&(-t));
    i
}

/// Value and body twist of the derivative: `vee(T^-1 dT)`.
pub fn body_twist(m: &D4) -> Vector6<f64> {
    let (value, change) = (m.map(|x| x.re), m.map(|x| x.eps));
    let inverse = inverse(&lift(&value)).map(|x| x.re);
    let w = inverse * change;
    Vector6::new(w[(0, 3)], w[(1, 3)], w[(2, 3)], w[(2, 1)], w[(0, 2)], w[(1, 0)])
}

fn motion(kind: JointKind, axis: &Vector3<f64>, position: D) -> D4 {
    let a = [axis.x, axis.y, axis.z].map(|x| position * constant(x));
    let o = constant(0.0);
    match kind {
        JointKind::Fixed => D4::identity(),
        JointKind::Revolute => exp(&[o, o, o, a[0], a[1], a[2]]),
        JointKind::Prismatic => exp(&[a[0], a[1], a[2], o, o, o]),
    }
}

/// Two unit vectors that complete an axis, as the formulation defines the levers of gravity.
fn levers(axis: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let helper = if axis.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let u = (helper - axis * axis.dot(&helper)).normalize();
    [u, axis.cross(&u)]
}

/// Moment of gravity on the axis of `reading`: how fast a unit lever, fixed in its own link (`which` 0, 1) or in the link after
/// the next moving joint (2, 3), comes down as the joint moves. For a prismatic joint: how fast the link comes down.
fn gravity(chain: &Chain, stop: &Posture, reading: usize, which: usize) -> f64 {
    let own = chain.joints.iter().position(|j| j.drive.is_some_and(|d| d.reading == reading)).unwrap();
    let next = (own + 1..chain.joints.len()).find(|&k| chain.joints[k].drive.is_some());
    let Some(carrier) = (if which < 2 { Some(own) } else { next }) else { return 0.0 };
    let mut pose = D4::identity();
    for (k, joint) in chain.joints.iter().enumerate().take(carrier + 1) {
        let q = joint
            .drive
            .map_or(constant(0.0), |d| variable(stop.readings[d.reading] * d.multiplier + d.offset, k == own));
        pose = pose * lift(&joint.origin.matrix()) * motion(joint.kind, &joint.axis, q);
    }
    let lever = levers(&chain.joints[carrier].axis)[which % 2].map(constant);
    let arm = pose.fixed_view::<3, 3>(0, 0) * lever;
    let height = arm.z + pose[(2, 3)];
    // A lever has no position, only a direction; a slide has no lever, only a position.
    if chain.joints[own].kind == JointKind::Prismatic { -height.eps } else { -arm.z.eps }
}

/// Moment of the masses behind a joint over the largest that it can be: how fast they come down together.
fn sag(chain: &Chain, stop: &Posture, reading: usize) -> f64 {
    let own = chain.joints.iter().position(|j| j.drive.is_some_and(|d| d.reading == reading)).unwrap();
    let mut pose = D4::identity();
    let (mut falls, mut largest) = (0.0, 0.0);
    let mut reach = 0.0;
    for (k, joint) in chain.joints.iter().enumerate() {
        let q = joint
            .drive
            .map_or(constant(0.0), |d| variable(stop.readings[d.reading] * d.multiplier + d.offset, k == own));
        pose = pose * lift(&joint.origin.matrix()) * motion(joint.kind, &joint.axis, q);
        if k > own {
            reach += joint.origin.translation.norm();
        }
        for mass in chain.masses.iter().filter(|m| m.joint == k && k >= own) {
            let at = pose * mass.centre_m.push(1.0).map(constant);
            falls -= mass.mass_kg * at.z.eps;
            let lever = if chain.joints[own].kind == JointKind::Prismatic { 1.0 } else { reach + mass.centre_m.norm() };
            largest += mass.mass_kg * lever;
        }
    }
    falls / largest
}

fn phi(robot: &Robot, stop: &Posture, reading: usize, term: Term) -> f64 {
    let q = stop.readings[reading];
    match term {
        Term::Offset => 1.0,
        Term::Gear => q,
        Term::Cosine(k) => (f64::from(k) * q).cos(),
        Term::Sine(k) => (f64::from(k) * q).sin(),
        Term::Gravity(k) => gravity(&robot.chain, stop, reading, k.into()),
        Term::Sag => sag(&robot.chain, stop, reading),
        Term::Local(at) => (-((q - 1e-6 * f64::from(at)) / 3e-3).powi(2) / 2.0).exp(),
        Term::Backlash => stop.approach.as_ref().map_or(0.0, |a| (a[reading] / 2e-3).tanh()),
    }
}

/// `base_from_tip`.
pub fn base_from_tip(robot: &Robot, layout: &Layout, stop: &Posture, noise: &[f64], seed: Option<Seed>) -> D4 {
    let column = |c: usize, x: f64| variable(x, seed == Some(Seed::Column(c)));
    let mut moved: Vec<D> = (0..stop.readings.len())
        .map(|r| constant(stop.readings[r]) + variable(noise[r], seed == Some(Seed::Latent(r))))
        .collect();
    for (k, t) in robot.terms.iter().enumerate() {
        moved[t.reading] += column(layout.terms.start + k, t.value) * constant(phi(robot, stop, t.reading, t.term));
    }
    let mut pose = D4::identity();
    for (i, joint) in robot.chain.joints.iter().enumerate() {
        let twist = std::array::from_fn(|c| column(layout.twists.start + 6 * i + c, robot.twists[i][c]));
        let q = joint.drive.map_or(constant(0.0), |d| moved[d.reading] * constant(d.multiplier) + constant(d.offset));
        pose = pose * lift(&joint.origin.matrix()) * exp(&twist) * motion(joint.kind, &joint.axis, q);
    }
    pose
}

fn perturbed(pose: &Pose, start: usize, seed: Option<Seed>) -> D4 {
    lift(&pose.matrix()) * exp(&std::array::from_fn(|c| variable(0.0, seed == Some(Seed::Column(start + c)))))
}

/// `camera_from_plate` of an image.
pub fn camera_from_plate(state: &State, layout: &Layout, image: &Image, from: TakenFrom, seed: Option<Seed>) -> D4 {
    if let Tie::Free(pose) = from.tie {
        return lift(&pose.matrix()) * exp(&std::array::from_fn(|c| variable(0.0, seed == Some(Seed::Latent(c)))));
    }
    let stop = from.posture.unwrap();
    let zero = vec![0.0; stop.readings.len()];
    let noise = if from.joint_errors.is_empty() { &zero } else { from.joint_errors };
    let tip = base_from_tip(&state.robot, layout, stop, noise, seed);
    let camera = perturbed(&state.mountings[image.mounting], layout.mountings[image.mounting].start, seed);
    let plate = perturbed(&state.placements[image.placement], layout.placements[image.placement].start, seed);
    let pose = match image.mount {
        CameraMount::Hand => inverse(&(tip * camera)) * plate,
        CameraMount::Fixed => inverse(&camera) * tip * plate,
    };
    let Tie::Displaced(values) = from.tie else { return pose };
    let component = |k: usize| {
        let value = values.get(k).copied().unwrap_or(0.0);
        variable(value, seed == Some(Seed::Latent(from.joint_errors.len() + k)))
    };
    // The plate turns about axes through the middle of what is seen: shift, turn, shift back.
    let seen = image.observations.iter().map(|o| state.plates[image.plate].nominal[o.marker]);
    let centre = seen.sum::<Vector3<f64>>() / image.observations.len() as f64;
    let mut turn = [constant(0.0); 6];
    (0..3).for_each(|k| turn[3 + k] = component(k));
    // The pose as it then shows is shifted along the axes of the camera.
    let mut along = [constant(0.0); 6];
    (0..3).for_each(|k| along[k] = component(3 + k));
    let shift = |sign: f64| lift(&nalgebra::Matrix4::new_translation(&(centre * sign)));
    exp(&along) * pose * shift(1.0) * exp(&turn) * shift(-1.0)
}

/// Pinhole and Brown-Conrady, in the order of OpenCV: fx fy cx cy k1 k2 p1 p2 k3.
pub fn project(p: &[D], x: &[D; 3]) -> [D; 2] {
    project_through(Lens::Brown, p, x)
}

/// The image of a point through any lens, by the formulas of the documentation of each.
pub fn project_through(lens: Lens, p: &[D], x: &[D; 3]) -> [D; 2] {
    let (a, b) = (x[0] / x[2], x[1] / x[2]);
    let r2 = a * a + b * b;
    let (one, two) = (constant(1.0), constant(2.0));
    let cubic = |k1: D, k2: D, k3: D| k1 * r2 + k2 * r2 * r2 + k3 * r2 * r2 * r2 + one;
    let tangential =
        |p1: D, p2: D| [p1 * two * a * b + p2 * (r2 + two * a * a), p1 * (r2 + two * b * b) + p2 * two * a * b];
    let [u, v] = match lens.formula() {
        Lens::Fisheye => {
            let r = r2.sqrt();
            let t = r.atan();
            let t2 = t * t;
            let f = t * (one + p[4] * t2 + p[5] * t2 * t2 + p[6] * t2 * t2 * t2 + p[7] * t2 * t2 * t2 * t2) / r;
            [a * f, b * f]
        }
        _ => {
            let zero = constant(0.0);
            let depth = |k: usize| if lens == Lens::Parallax { p[k] / x[2] } else { zero };
            let mut radial = cubic(p[4] + depth(9), p[5] + depth(10), p[8]);
            if lens == Lens::Rational {
                radial /= cubic(p[9], p[10], p[11]);
            }
            let [mut u, mut v] = tangential(p[6], p[7]);
            u += a * radial;
            v += b * radial;
            if lens == Lens::ThinPrism {
                u += p[9] * r2 + p[10] * r2 * r2;
                v += p[11] * r2 + p[12] * r2 * r2;
            }
            [u, v]
        }
    };
    [p[0] * u + p[2], p[1] * v + p[3]]
}

/// Squares of the field of an image of 1280 x 1024.
const FIELD_CELLS: [usize; 2] = [10, 8];

/// A displacement field on top of an image point, whose control points hold u and v in `c`, row by row; the image is divided into
/// `cells` squares, and the field goes on beyond it as it is at the border.
pub fn displaced(h: [D; 2], c: &[D], size_px: [f64; 2], cells: [usize; 2]) -> [D; 2] {
    // The cubic B-spline as a piecewise polynomial of the distance from its middle.
    let spline = |d: D| {
        let d = if d.re < 0.0 { -d } else { d };
        let two = constant(2.0);
        match d.re {
            r if r < 1.0 => constant(2.0 / 3.0) - d * d + d * d * d / two,
            r if r < 2.0 => (two - d) * (two - d) * (two - d) / constant(6.0),
            _ => constant(0.0),
        }
    };
    let along = |axis: usize| {
        let s = (h[axis] + constant(0.5)) * constant(cells[axis] as f64 / size_px[axis]);
        if s.re < 0.0 || s.re > cells[axis] as f64 { constant(s.re.clamp(0.0, cells[axis] as f64)) } else { s }
    };
    let (s, t) = (along(0), along(1));
    let across = cells[0] + 3;
    let mut out = h;
    for k in 0..c.len() / 2 {
        let middle = |at: usize| constant(at as f64 - 1.0);
        let b = spline(s - middle(k % across)) * spline(t - middle(k / across));
        out[0] += b * c[2 * k];
        out[1] += b * c[2 * k + 1];
    }
    out
}

/// Area centroid of the curve through `n` samples at equal steps of the angle, from its Fourier coefficients; area and moments
/// by the sum over the samples (Green).
pub fn centroid(samples: &[[D; 2]]) -> [D; 2] {
    let n = samples.len();
    let zero = constant(0.0);
    let mean = [0, 1].map(|c| samples.iter().fold(zero, |s, p| s + p[c]) / constant(n as f64));
    let x: Vec<[D; 2]> = samples.iter().map(|p| [p[0] - mean[0], p[1] - mean[1]]).collect();
    // Derivative: every harmonic below half the number of samples turned by a right angle and multiplied by its order.
    let slope = |c: usize, k: usize| {
        let mut sum = zero;
        for m in 1..n.div_ceil(2) {
            let (mut cosine, mut sine) = (zero, zero);
            for (j, p) in x.iter().enumerate() {
                let t = TAU * (m * j) as f64 / n as f64;
                cosine += p[c] * constant(t.cos());
                sine += p[c] * constant(t.sin());
            }
            let t = TAU * (m * k) as f64 / n as f64;
            sum += (sine * constant(t.cos()) - cosine * constant(t.sin())) * constant(2.0 * m as f64 / n as f64);
        }
        sum
    };
    let (mut area, mut mx, mut my) = (zero, zero, zero);
    for (k, p) in x.iter().enumerate() {
        let (dx, dy) = (slope(0, k), slope(1, k));
        area += p[0] * dy;
        mx += p[0] * p[0] * dy / constant(2.0);
        my -= p[1] * p[1] * dx / constant(2.0);
    }
    [mean[0] + mx / area, mean[1] + my / area]
}

/// Samples of a contour that the library takes: fewer where the circle is more than fifty radii away.
pub fn samples(camera_from_plate: &D4, centre: &[D; 3], radius_m: f64) -> usize {
    let at = camera_from_plate * SMatrix::<D, 4, 1>::new(centre[0], centre[1], centre[2], constant(1.0));
    let distance = (at[0].re.powi(2) + at[1].re.powi(2) + at[2].re.powi(2)).sqrt();
    if distance > 50.0 * radius_m { 8 } else { 12 }
}

/// Image of a circle with `samples` points of its contour, where `project` says what a point shows; radius 0 is a point.
pub fn circle(
    project: impl Fn(&[D; 3]) -> [D; 2],
    camera_from_plate: &D4,
    centre: &[D; 3],
    radius: D,
    samples: usize,
) -> [D; 2] {
    let image = |x: [D; 3]| {
        let h = camera_from_plate * SMatrix::<D, 4, 1>::new(x[0], x[1], x[2], constant(1.0));
        project(&[h[0], h[1], h[2]])
    };
    if radius.re == 0.0 {
        return image(*centre);
    }
    let contour: Vec<[D; 2]> = (0..samples)
        .map(|k| {
            let t = TAU * k as f64 / samples as f64;
            image([centre[0] + radius * constant(t.cos()), centre[1] + radius * constant(t.sin()), centre[2]])
        })
        .collect();
    centroid(&contour)
}

/// Position of a marker: nominal, modes (scale, aspect, skew, three bows), correction.
pub fn marker(state: &State, layout: &Layout, plate: usize, marker: usize, seed: Option<Seed>) -> [D; 3] {
    let shape = &state.plates[plate];
    let [x, y, z] = shape.nominal[marker].into();
    let reach = shape.nominal.iter().map(Vector3::norm).fold(0.0, f64::max);
    let m: Vec<D> = (layout.shapes[plate].clone())
        .zip(shape.modes)
        .map(|(c, value)| variable(value, seed == Some(Seed::Column(c))))
        .collect();
    let [one, half] = [1.0, 0.5].map(constant);
    let d = |a: usize| variable(shape.corrections[marker][a], seed == Some(Seed::Marker(marker, a)));
    let [xd, yd, zd] = [x, y, z].map(constant);
    let bow = [x * x, x * y, y * y].map(|b| constant(b / (reach * reach)));
    [
        xd * (one + m[0] + m[1] * half) + m[2] * half * yd + d(0),
        yd * (one + m[0] - m[1] * half) + m[2] * half * xd + d(1),
        zd * (one + m[0]) + m[3] * bow[0] + m[4] * bow[1] + m[5] * bow[2] + d(2),
    ]
}

/// Predicted observation through the whole chain.
pub fn predict(
    state: &State,
    layout: &Layout,
    image: &Image,
    from: TakenFrom,
    observation: &MarkerObservation,
    seed: Option<Seed>,
) -> [D; 2] {
    let pose = camera_from_plate(state, layout, image, from, seed);
    let centre = marker(state, layout, image.plate, observation.marker, seed);
    let range = layout.cameras[image.camera].clone();
    let camera = &state.cameras[image.camera];
    let parameters: Vec<D> =
        (camera.parameters.iter().zip(range)).map(|(p, c)| variable(*p, seed == Some(Seed::Column(c)))).collect();
    let (formula, field) = parameters.split_at(camera.parametric());
    let size_px = [camera.width_px, camera.height_px].map(f64::from);
    let project = |x: &[D; 3]| match project_through(camera.lens, formula, x) {
        h if field.is_empty() => h,
        h => displaced(h, field, size_px, FIELD_CELLS),
    };
    // samples and circle: with the dot gain, which moves no marker.
    let shapes = &layout.shapes[image.plate];
    let mode = |k: usize| variable(state.plates[image.plate].modes[k], seed == Some(Seed::Column(shapes.start + k)));
    let (size, gain) = (constant(1.0) + mode(0), mode(6));
    let radius = match (observation.mark.radius_m(), observation.edge) {
        (0.0, _) => constant(0.0),
        (radius_m, Edge::Outer) => constant(radius_m) * size + gain,
        (radius_m, Edge::Inner) => constant(radius_m) * size - gain,
    };
    circle(project, &pose, &centre, radius, samples(&pose, &centre, radius.re))
}
