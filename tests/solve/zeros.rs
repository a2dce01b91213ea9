//! A five-axis hobby arm: zeros off by up to 20 degrees and one axis that counts the other way, found without being told.

use std::path::Path;

use nalgebra::Vector3;
use robotcal::assess::{View, predict_pose};
use robotcal::diagnose::Subject;
use robotcal::error::Code;
use robotcal::geom::Pose;
use robotcal::identify::{Options, Solution, identify};
use robotcal::model::camera::{Camera, Lens};
use robotcal::model::robot::Robot;
use robotcal::problem::{MeasuredSeries, MeasuredStop};
use robotcal::series::{CameraMount, Edge, Observation, Plate, PlateKind};
use robotcal::urdf::{Chain, FoundOrigin, RobotDescription};

use crate::support::small::{Dice, Part, chain};

const URDF: &str = r#"<robot name="hobby">
  <link name="base"/><link name="turret"/><link name="upper"/><link name="fore"/><link name="wrist"/><link name="hand"/><link name="tip"/>
  <joint name="yaw" type="revolute"><parent link="base"/><child link="turret"/><origin xyz="0 0 0.07"/><axis xyz="0 0 1"/><limit lower="-3.1" upper="3.1" effort="1" velocity="1"/></joint>
  <joint name="shoulder" type="revolute"><parent link="turret"/><child link="upper"/><origin xyz="0.01 0 0.04"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0 0 0.13"/><axis xyz="0 1 0"/><limit lower="-2.6" upper="2.6" effort="1" velocity="1"/></joint>
  <joint name="wrist" type="revolute"><parent link="fore"/><child link="wrist"/><origin xyz="0 0 0.12"/><axis xyz="0 1 0"/><limit lower="-2.2" upper="2.2" effort="1" velocity="1"/></joint>
  <joint name="roll" type="revolute"><parent link="wrist"/><child link="hand"/><origin xyz="0 0 0.07"/><axis xyz="0 0 1"/><limit lower="-3.1" upper="3.1" effort="1" velocity="1"/></joint>
  <joint name="mount" type="fixed"><parent link="hand"/><child link="tip"/><origin xyz="0 0 0.03"/></joint>
</robot>"#;

const JOINT_SIGMA: f64 = 5e-3;
const PIXEL_SIGMA: f64 = 0.2;
const LARGEST_ZERO: f64 = 0.35;

/// A webcam in the hand before a chessboard on the table, and what is true of it.
struct World {
    nominal: Chain,
    truth: Robot,
    camera_pose: Pose,
    plate_pose: Pose,
    reversed: usize,
    offsets: Vec<f64>,
    series: MeasuredSeries,
    held_out: Vec<Vec<f64>>,
}

fn world(seed: u64, images: usize) -> World {
    world_with(seed, images, None)
}

/// The same with this axis reversed.
fn world_with(seed: u64, images: usize, reversed: Option<usize>) -> World {
    let mut dice = Dice::new(seed);
    let robot = RobotDescription::from_text(Path::new("hobby.urdf"), URDF.into()).unwrap();
    let nominal = robot.chain(None, None).unwrap();
    let drawn = (dice.between(0.0, 4.999)) as usize;
    let reversed = reversed.unwrap_or(drawn);
    let offsets: Vec<f64> = (0..5).map(|_| dice.between(-LARGEST_ZERO, LARGEST_ZERO)).collect();
    let actual = (0..5).fold(nominal.clone(), |c, r| c.with_zero(r, offsets[r], r == reversed).unwrap());
    let mut truth = Robot::nominal(actual);
    truth.twists.iter_mut().for_each(|t| *t = dice.twist(0.5e-3, 2e-3));
    let camera_pose = Pose::from_xyz_rpy([0.02, -0.03, 0.03], [0.1, -0.15, 0.4]);
    let plate_pose = Pose::from_xyz_rpy([0.2, 0.0, 0.0], [0.02, 0.01, 0.3]);
    let mut camera = Camera::pinhole(Lens::Brown, 1280, 720, 950.0);
    camera.parameters = vec![953.0, 951.0, 645.0, 365.0, 0.08, -0.15, 8e-4, -5e-4, 0.0];
    let plate = Plate::lattice(PlateKind::Points, 9, 6, 0.018, 0.05e-3);
    // What the readings are where the arm stands at these positions.
    let reading = |r: usize, position: f64| if r == reversed { offsets[r] - position } else { position - offsets[r] };
    let (mut stops, mut held_out) = (Vec::new(), Vec::new());
    while held_out.len() < 60 {
        let reach = [[-0.7, 0.7], [-0.3, 1.2], [0.2, 1.9], [-0.2, 1.9], [-1.6, 1.6]];
        let readings: Vec<f64> = (0..5).map(|r| reading(r, dice.between(reach[r][0], reach[r][1]))).collect();
        let moved: Vec<f64> = readings.iter().map(|q| q + dice.normal(JOINT_SIGMA)).collect();
        let pose = CameraMount::Hand.camera_from_plate(&camera_pose, &truth.base_from_tip(&moved), &plate_pose);
        let faces = pose.rotation.column(2).dot(&pose.translation) < -0.4 * pose.translation.norm();
        if !faces || pose.translation.norm() > 0.6 {
            continue;
        }
        let see = |m: &robotcal::series::Marker| {
            let at = pose.transform(&m.position_m);
            let uv = (at.z > 0.05).then(|| camera.project(&at)).flatten().filter(|uv| camera.contains(uv, 8.0))?;
            Some((m.id, uv))
        };
        let seen: Vec<_> = plate.markers.iter().filter_map(see).collect();
        if seen.len() < plate.markers.len() {
            continue;
        }
        if stops.len() == images {
            held_out.push(readings);
            continue;
        }
        let variance = PIXEL_SIGMA * PIXEL_SIGMA;
        let observations = seen.into_iter().map(|(marker, uv)| Observation {
            marker,
            edge: Edge::Outer,
            uv: [uv.x + dice.normal(PIXEL_SIGMA), uv.y + dice.normal(PIXEL_SIGMA)],
            covariance: Some([variance, 0.0, variance]),
        });
        let row = stops.len();
        stops.push(MeasuredStop {
            row,
            image: format!("img_{row:03}.png"),
            observations: observations.collect(),
            readings: Some(readings),
            placement: "table".into(),
            left_out: None,
        });
    }
    let series = MeasuredSeries {
        camera: "webcam".into(),
        mounting: "hand".into(),
        mount: CameraMount::Hand,
        width_px: 1280,
        height_px: 720,
        centroid: false,
        plate,
        plate_name: "plate".into(),
        has_images: true,
        ..MeasuredSeries::without_images("hobby", true, stops)
    };
    World { nominal, truth, camera_pose, plate_pose, reversed, offsets, series, held_out }
}

/// RMS error of the camera in the frame of the plate at exact readings that were not measured: actual and stated, m.
fn errors_m(world: &World, solution: &Solution) -> [f64; 2] {
    let view = View::first(&solution.fit.problem).unwrap();
    let mut sums = [0.0; 2];
    for readings in &world.held_out {
        let p = predict_pose(&solution.fit, view, readings).unwrap();
        let tip = world.truth.base_from_tip(readings);
        let pose = CameraMount::Hand.camera_from_plate(&world.camera_pose, &tip, &world.plate_pose).inverse();
        let off: Vector3<f64> = (p.plate_from_camera.inverse() * pose).log().fixed_rows::<3>(0).into_owned();
        sums[0] += off.norm_squared();
        sums[1] += (0..3).map(|k| p.model[(k, k)]).sum::<f64>();
    }
    sums.map(|s| (s / world.held_out.len() as f64).sqrt())
}

/// True where the reversed axis is the right one and no other. The zeros are judged by the error of the camera: from poses with 5 mrad of noise
/// those of parallel axes are known in their sum only, and the fit shares them out between offsets and origins.
fn is_found(world: &World, solution: &Solution) -> bool {
    let joints = &solution.fit.state.robot.chain.joints;
    (0..5).all(|r| match joints[r].found {
        Some(FoundOrigin::Zero { offset, is_reversed }) => {
            println!("  {}: {offset:+.3} ({:+.3}), reversed {is_reversed}", joints[r].name, world.offsets[r]);
            is_reversed == (r == world.reversed)
        }
        _ => false,
    })
}

#[test]
fn the_zeros_of_a_hobby_arm_and_the_axis_that_counts_the_other_way_are_found_and_said() {
    for seed in 1..=2 {
        let world = world(seed, 40);
        let solution =
            identify(world.nominal.clone(), std::slice::from_ref(&world.series), &Options::default()).unwrap();
        let [actual, stated] = errors_m(&world, &solution);
        println!("seed {seed}: {:.3} mm, stated {:.3}", 1e3 * actual, 1e3 * stated);
        assert!(is_found(&world, &solution));
        assert!(solution.findings.iter().any(|f| f.code() == Code::ZeroOff));
        assert!(actual < 2.0 * stated, "{actual} {stated}");
    }
}

/// Another zero of the first joint turns the base alone, one of the last joint the hand.
#[test]
fn the_zero_of_a_joint_at_an_end_of_the_arm_is_not_told() {
    for reversed in [0, 4] {
        let world = world_with(3, 40, Some(reversed));
        let solution =
            identify(world.nominal.clone(), std::slice::from_ref(&world.series), &Options::default()).unwrap();
        let joint = Subject::Joint(world.nominal.readings[reversed].clone());
        let found = solution.findings.iter().find(|f| f.code() == Code::ZeroOff && f.subjects().contains(&joint));
        let names: Vec<String> = found.unwrap().quantities().into_iter().map(|q| q.name).collect();
        assert_eq!(names, ["sign"], "{reversed}");
    }
}

#[test]
#[ignore = "a minute; its figures stand in the guide, Questions"]
fn study_of_hobby_arms() {
    let (mut found, mut sums) = (0, [0.0; 2]);
    for seed in 1..=20 {
        let world = world(seed, 40);
        match identify(world.nominal.clone(), std::slice::from_ref(&world.series), &Options::default()) {
            Err(error) => println!("seed {seed}: {error}"),
            Ok(solution) => {
                let [actual, stated] = errors_m(&world, &solution);
                let is_found = is_found(&world, &solution) && actual < 2.0 * stated;
                println!("seed {seed}: found {is_found}, {:.3} mm, stated {:.3}", 1e3 * actual, 1e3 * stated);
                found += u32::from(is_found);
                (sums[0], sums[1]) = (sums[0] + actual * actual, sums[1] + stated * stated);
            }
        }
    }
    println!("found in {found} of 20; actual over stated {:.3}", (sums[0] / sums[1]).sqrt());
}

#[test]
fn another_zero_is_what_the_readings_say() {
    let mut dice = Dice::new(7);
    let parts = [
        Part::Revolute,
        Part::Prismatic,
        Part::Revolute,
        Part::Mimic(robotcal::urdf::JointKind::Revolute),
        Part::Fixed,
        Part::Revolute,
        Part::Fixed,
    ];
    let chain = chain(&mut dice, &parts);
    let n = chain.readings.len();
    for reversed in 0..n {
        let offsets: Vec<f64> = (0..n).map(|_| dice.between(-0.3, 0.3)).collect();
        let moved = (0..n).fold(chain.clone(), |c, r| c.with_zero(r, offsets[r], r == reversed).unwrap());
        let readings: Vec<f64> = (0..n).map(|_| dice.between(-1.0, 1.0)).collect();
        let meant: Vec<f64> =
            (0..n).map(|r| if r == reversed { offsets[r] - readings[r] } else { readings[r] + offsets[r] }).collect();
        let [a, b] =
            [Robot::nominal(moved).base_from_tip(&readings), Robot::nominal(chain.clone()).base_from_tip(&meant)];
        let (angle, distance) = a.distance(&b);
        assert!(angle < 1e-12 && distance < 1e-12, "{reversed}: {angle} {distance}");
    }
}
