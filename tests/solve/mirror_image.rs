//! Signs of joints that make the mirror image of the arm, by trackers and contacts: said where nothing tells, named where it is a mistake.

use nalgebra::Vector3;
use robotcal::diagnose::Subject;
use robotcal::error::{Code, Error};
use robotcal::geom::Pose;
use robotcal::identify::{Options, RobotModel, Solution, identify};
use robotcal::problem::{BodySeen, InstrumentKind, MeasuredSeries};

use crate::measured_worlds::{Kind, World};
use crate::said::assert_says;

/// The joints of the KR 6 about axes in the plane of the arm.
const MIRRORED: [usize; 3] = [0, 3, 5];
const NAMES: [&str; 3] = ["joint_a1", "joint_a4", "joint_a6"];

fn negated(series: &MeasuredSeries, joints: &[usize]) -> MeasuredSeries {
    let mut series = series.clone();
    for q in series.stops.iter_mut().filter_map(|s| s.readings.as_mut()) {
        joints.iter().for_each(|&k| q[k] = -q[k]);
    }
    series
}

fn solved(world: &World, series: MeasuredSeries) -> Solution {
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    identify(world.chain.clone(), &[series], &options).unwrap()
}

fn refused(world: &World, series: MeasuredSeries) -> Error {
    identify(world.chain.clone(), &[series], &Options::default()).map(|_| ()).unwrap_err()
}

/// Joints of the note that nothing tells the arm from its mirror image.
fn ambiguous(solution: &Solution) -> Option<Vec<Subject>> {
    let note = solution.findings.iter().find(|f| f.code() == Code::MirrorImageFits)?;
    assert!(!note.fails());
    Some(note.subjects())
}

fn mirrored_joints() -> Option<Vec<Subject>> {
    Some(NAMES.map(|name| Subject::Joint(name.into())).into())
}

#[test]
fn sockets_do_not_tell_an_arm_from_its_mirror_image() {
    let world = World::sockets(71, 4, 15, 5e-5, 2e-5);
    for joints in [&[][..], &MIRRORED] {
        assert_eq!(ambiguous(&solved(&world, negated(&world.series, joints))), mirrored_joints());
    }
}

/// The first sockets at places of a fixture, and no others.
fn at_places(world: &World, places: usize) -> MeasuredSeries {
    let fit = solved(world, world.series.clone()).fit;
    let fixture = Pose::from_xyz_rpy([0.3, 0.2, -0.1], [0.1, 0.2, 0.3]);
    let place = |name: &str| fit.problem.instruments[..places].iter().position(|i| i.name == name);
    let mut series = world.series.clone();
    series.bodies.retain(|seen| place(&seen.instrument).is_some());
    for seen in &mut series.bodies {
        let k = place(&seen.instrument).unwrap();
        seen.seen = BodySeen::Point(fixture.transform(&fit.state.instruments[k].translation));
        seen.kind = InstrumentKind::Places;
        seen.instrument = "fixture".into();
    }
    series.lengths.clear();
    series
}

/// Three places lie in a plane, whose mirror image is itself turned over.
#[test]
fn places_in_a_plane_do_not_tell_it_and_places_in_space_and_a_tracker_do() {
    let world = World::sockets(72, 4, 15, 5e-5, 2e-5);
    assert_eq!(ambiguous(&solved(&world, at_places(&world, 3))), mirrored_joints());
    assert_eq!(ambiguous(&solved(&world, at_places(&world, 4))), None);
    let seen_in_space =
        [World::new(73, Kind::Points, 40, (3e-5, 0.0), 2e-5), World::new(73, Kind::Poses, 30, (3e-5, 5e-5), 2e-5)];
    for world in seen_in_space {
        assert_eq!(ambiguous(&solved(&world, world.series.clone())), None);
    }
}

#[test]
fn of_signs_that_fit_alike_those_of_the_fewest_joints_are_named_and_the_others_said() {
    let world = World::sockets(74, 4, 15, 5e-5, 2e-5);
    for (k, own) in MIRRORED.into_iter().zip(NAMES) {
        let said = refused(&world, negated(&world.series, &[k]));
        assert_says(&said, Code::JointSignWrong, &NAMES);
        assert_eq!(said.place, own);
    }
}

#[test]
fn a_tracker_does_not_tell_its_left_handed_axes_from_joints_that_count_the_other_way() {
    for (kind, sigma_rad) in [(Kind::Points, 0.0), (Kind::Poses, 1e-4)] {
        let world = World::new(75, kind, 40, (3e-5, sigma_rad), 2e-5);
        assert_says(&refused(&world, negated(&world.series, &MIRRORED)), Code::AxesMirrored, &NAMES);
        let mut left_handed = world.series.clone();
        for seen in &mut left_handed.bodies {
            match &mut seen.seen {
                BodySeen::Point(at) => at.y = -at.y,
                BodySeen::Pose(pose) => {
                    let [x, y, z, w] = pose.quaternion_xyzw();
                    let [px, py, pz] = pose.xyz();
                    *pose = Pose::from_xyz_quaternion([px, -py, pz], [-x, y, -z, w]);
                }
            }
        }
        assert_says(&refused(&world, left_handed), Code::AxesMirrored, &NAMES);
    }
}

/// Points of a reflector this far off the last axis, m.
fn near_the_last_axis(off_m: f64) -> World {
    let mut world = World::new(76, Kind::Points, 40, (3e-5, 0.0), 2e-5);
    let last = world.chain.joints.iter().rposition(|j| j.drive.is_some()).unwrap();
    let [at_zero, axis] = {
        let poses = world.truth.link_poses(&[0.0; 6]);
        [*poses.last().unwrap(), poses[last]]
    };
    let along = axis.rotation * world.chain.joints[last].axis;
    let across = along.cross(&Vector3::new(0.3, 0.5, -0.7)).normalize();
    let body = at_zero.inverse().transform(&(axis.translation + 0.12 * along + off_m * across));
    let tracker_from_base = Pose::from_xyz_rpy([2.5, 0.4, -0.6], [0.2, -0.1, 1.9]);
    for seen in &mut world.series.bodies {
        let tip = world.truth.base_from_tip(world.series.stops[seen.stop].readings.as_ref().unwrap());
        seen.seen = BodySeen::Point(tracker_from_base.transform(&tip.transform(&body)));
    }
    world
}

/// It moves the reflector by less than robots in order miss by where their zeros are off.
#[test]
fn the_sign_of_the_last_joint_is_named_by_a_reflector_near_its_axis() {
    for off_m in [0.022, 0.06] {
        let world = near_the_last_axis(off_m);
        let said = refused(&world, negated(&world.series, &[5]));
        assert_says(&said, Code::JointSignWrong, &[]);
        assert_eq!(said.place, "joint_a6");
        assert!(world.error_mm(&solved(&world, world.series.clone()).exported_robot()) < 1.0);
    }
}
