//! Sag of the joints by the masses that a URDF states, and by a payload.

use std::path::{Path, PathBuf};

use robotcal::Code;
use robotcal::assess::flange_error_m;
use robotcal::geom::Pose;
use robotcal::identify::{Options, RobotModel, identify};
use robotcal::model::joint_terms::{JointTerm, Term, TermKind};
use robotcal::model::robot::Robot;
use robotcal::output::read_compensation;
use robotcal::series::{Plate, PlateKind};
use robotcal::simulate::{RobotErrors, WorldRequest, series};
use robotcal::study::measured;
use robotcal::urdf::{Chain, Payload, RobotDescription, read};

fn chain(name: &str) -> Chain {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("robots/{name}/{name}.urdf"));
    read(&path).unwrap().chain(None, None).unwrap()
}

const PAYLOAD: Payload = Payload { mass_kg: 8.0, centre_m: [0.02, 0.0, 0.11] };

fn terms_of(robot: &Robot, term: Term) -> Vec<f64> {
    robot.terms.iter().filter(|t| t.term == term).map(|t| t.value).collect()
}

#[test]
fn a_stretched_arm_has_the_moment_of_its_masses() {
    let loaded = chain("ur10e").carrying(Some(&PAYLOAD)).unwrap();
    assert_eq!(loaded.payload(), Some(PAYLOAD));
    // The masses of the URDF as they hang behind the shoulder, with the arm stretched out level.
    let sag = |reading, value| Robot {
        terms: vec![JointTerm { reading, term: Term::Sag, value }],
        ..Robot::nominal(loaded.clone())
    };
    let level = [0.0; 6];
    let poses = Robot::nominal(loaded.clone()).link_poses(&level);
    let shoulder = loaded.joints.iter().position(|j| j.name == "shoulder_lift_joint").unwrap();
    let axis = poses[shoulder].rotation * loaded.joints[shoulder].axis;
    let down = nalgebra::Vector3::new(0.0, 0.0, -1.0);
    let behind = loaded.masses.iter().filter(|m| m.joint >= shoulder);
    let moment: f64 = behind
        .map(|m| {
            axis.dot(&(poses[m.joint].transform(&m.centre_m) - poses[shoulder].translation).cross(&down)) * m.mass_kg
        })
        .sum();
    let relative = moment / loaded.largest_moment(shoulder);
    assert!((0.7..1.0).contains(&relative.abs()), "a stretched arm is near its largest moment: {relative}");
    let reading = loaded.readings.iter().position(|r| r == "shoulder_lift_joint").unwrap();
    let expected = {
        let mut q = level;
        q[reading] += 1e-3 * relative;
        Robot::nominal(loaded.clone()).base_from_tip(&q)
    };
    assert!((sag(reading, 1e-3).base_from_tip(&level).matrix() - expected.matrix()).amax() < 1e-12);
    // The first axis is vertical: nothing pulls.
    let vertical = sag(0, 1e-3).base_from_tip(&[0.3; 6]);
    assert!((vertical.matrix() - Robot::nominal(loaded).base_from_tip(&[0.3; 6]).matrix()).amax() < 1e-12);
}

#[test]
fn sag_of_the_loaded_arm_is_found() {
    let loaded = chain("ur10e").carrying(Some(&PAYLOAD)).unwrap();
    let plate = Plate::lattice(PlateKind::Points, 8, 6, 0.03, 0.03e-3);
    let errors = RobotErrors::default().with(TermKind::Sag, 0.5e-3);
    let request =
        WorldRequest { images: 40, held_out: 60, errors, seed: 3, ..WorldRequest::typical(loaded.clone(), plate) };
    let world = series(&request).unwrap();
    let seen = measured(&world, &loaded);
    let held: Vec<(Vec<f64>, Pose)> =
        world.truth.held_out.iter().map(|h| (h.readings.clone(), h.base_from_tip.pose())).collect();
    let error_mm = |model| {
        let options = Options { model, payload: Some(PAYLOAD), ..Options::default() };
        let solution = identify(chain("ur10e"), std::slice::from_ref(&seen), &options).unwrap();
        let robot = &solution.fit.state.robot;
        assert_eq!(robot.chain.payload(), Some(PAYLOAD));
        (1e3 * flange_error_m(robot, &solution.fit.state.placements[0], &held).unwrap(), terms_of(robot, Term::Sag))
    };
    let ((rigid, none), (full, sag)) = (error_mm(RobotModel::Rigid), error_mm(RobotModel::Full));
    println!("held out: rigid {rigid:.4} mm, full {full:.4} mm; sag {sag:?}");
    assert!(none.is_empty() && sag.len() == 6);
    assert!(full < rigid / 3.0, "{full} against {rigid} mm");
}

#[test]
fn compliance_and_payload_survive_their_file() {
    let folder = tempfile::tempdir().unwrap();
    let write = |text: &str| -> PathBuf {
        let path = folder.path().join("compensation.toml");
        std::fs::write(&path, text).unwrap();
        path
    };
    let text = "[payload]\nmass_kg = 8.0\ncentre_m = [0.02, 0.0, 0.11]\n[joint.shoulder_lift_joint]\ncompliance_rad_per_nm = 2e-6\n";
    let robot = read_compensation(&write(text), chain("ur10e")).unwrap();
    assert_eq!(robot.chain.payload(), Some(PAYLOAD));
    let shoulder = robot.chain.joints.iter().position(|j| j.name == "shoulder_lift_joint").unwrap();
    let value = terms_of(&robot, Term::Sag)[0];
    assert!((value - 2e-6 * 9.80665 * robot.chain.largest_moment(shoulder)).abs() < 1e-15);

    let refused = read_compensation(&write(text), chain("kuka_kr6_r900")).unwrap_err();
    assert!(refused.code == Code::UrdfMassesMissing && refused.place.ends_with("compensation.toml"), "{refused}");
    let without = "[joint.joint_a2]\ncompliance_rad_per_nm = 2e-6\n";
    let refused = read_compensation(&write(without), chain("kuka_kr6_r900")).unwrap_err();
    assert!(refused.code == Code::UrdfMassesMissing && refused.place.contains("joint_a2"), "{refused}");
    let heavy = chain("ur10e").carrying(Some(&Payload { mass_kg: f64::NAN, ..PAYLOAD })).unwrap_err();
    assert!(heavy.code == Code::PayloadRange && heavy.what.starts_with(&f64::NAN.to_string()), "{heavy}");
}

#[test]
fn a_payload_in_grams_or_millimetres_is_refused() {
    let refused = |payload: Payload| chain("ur10e").carrying(Some(&payload)).unwrap_err();
    let grams = refused(Payload { mass_kg: 8000.0, ..PAYLOAD });
    assert!(grams.code == Code::PayloadRange && grams.what.contains("8000"), "{grams}");
    let millimetres = refused(Payload { centre_m: [20.0, 0.0, 110.0], ..PAYLOAD });
    assert!(millimetres.code == Code::PayloadRange && millimetres.what.contains("110"), "{millimetres}");
}

#[test]
fn masses_that_are_all_the_same_are_placeholders() {
    let link = |name: &str| {
        format!(
            "<link name=\"{name}\"><inertial><mass value=\"2\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link>"
        )
    };
    let joint = |name: &str, parent: &str, child: &str| {
        format!(
            "<joint name=\"{name}\" type=\"continuous\"><parent link=\"{parent}\"/><child link=\"{child}\"/><axis xyz=\"0 1 0\"/></joint>"
        )
    };
    let text = [
        "<robot name=\"r\">",
        &link("a"),
        &link("b"),
        &link("c"),
        &joint("j", "a", "b"),
        &joint("k", "b", "c"),
        "</robot>",
    ];
    let robot = RobotDescription::from_text(Path::new("r.urdf"), text.concat()).unwrap();
    assert!(robot.chain(None, None).unwrap().masses.is_empty());
    assert!(robot.notices.iter().any(|n| n.code == Code::UrdfMassPlaceholder), "{:?}", robot.notices);
}

/// Two arms of three joints on one root, no masses stated.
fn two_arms() -> RobotDescription {
    let joint = |name: &str, parent: &str, child: &str, origin: &str, axis: &str| {
        format!(
            r#"<link name="{child}"/><joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin {origin}/>
            <axis xyz="{axis}"/><limit lower="-3" upper="3" effort="0" velocity="1"/></joint>"#
        )
    };
    let arm = |side: &str, x: f64| {
        let link = |k: u8| format!("{side}_{k}");
        [
            joint(&format!("{side}1"), "root", &link(1), &format!(r#"xyz="{x} 0.1 0.3" rpy="0.2 -0.1 0.4""#), "0 0 1"),
            joint(&format!("{side}2"), &link(1), &link(2), r#"xyz="0.05 0 0.25" rpy="-1.5 0.1 0""#, "0 1 0"),
            joint(&format!("{side}3"), &link(2), &link(3), r#"xyz="0.4 0.02 0" rpy="0.3 0 -0.2""#, "-1 0.5 0"),
        ]
        .concat()
    };
    let text = format!(r#"<robot name="two"><link name="root"/>{}{}</robot>"#, arm("a", 0.0), arm("b", 1.2));
    RobotDescription::from_text(Path::new("two.urdf"), text).unwrap()
}

#[test]
fn an_arm_that_carries_the_plate_sags_as_by_itself() {
    let cell = two_arms();
    let both = cell.chain(Some("b_3"), Some("a_3")).unwrap();
    let [left, right] = ["a_3", "b_3"].map(|tip| cell.chain(Some("root"), Some(tip)).unwrap());
    let at = [("a1", 0.3), ("a2", -0.7), ("a3", 0.5), ("b1", -0.4), ("b2", 0.9), ("b3", -1.1)];
    let readings = |chain: &Chain| -> Vec<f64> {
        chain.readings.iter().map(|r| at.iter().find(|(name, _)| name == r).unwrap().1).collect()
    };
    let root_from_left = Robot::nominal(left.clone()).base_from_tip(&readings(&left));
    for joint in ["b1", "b2", "b3"] {
        for lever in 0..4 {
            let sagging = |chain: &Chain| {
                let reading = chain.readings.iter().position(|r| r == joint).unwrap();
                let terms = vec![JointTerm { reading, term: Term::Gravity(lever), value: 1e-2 }];
                Robot { terms, ..Robot::nominal(chain.clone()) }.base_from_tip(&readings(chain))
            };
            let moved = sagging(&right) * sagging(&both);
            assert!((moved.matrix() - root_from_left.matrix()).amax() < 1e-12, "{joint}, lever {lever}");
            let nominal = Robot::nominal(right.clone()).base_from_tip(&readings(&right));
            let turned = (sagging(&right).matrix() - nominal.matrix()).amax();
            // Nothing moves behind the last joint.
            assert_eq!(turned > 1e-5, joint != "b3" || lever < 2, "{joint}, lever {lever}: {turned}");
        }
    }
}

/// A parallelogram: the third joint turns back by what the second turns, and reads nothing of its own.
#[test]
fn gravity_of_a_joint_that_another_mimics_is_that_of_the_last_of_them() {
    let joint = |name: &str, parent: &str, more: &str| {
        format!(
            r#"<link name="{name}_link"/><joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{name}_link"/>
            <origin xyz="0.3 0.02 0.1" rpy="0.1 0 0.2"/><axis xyz="0 1 0"/>{more}<limit lower="-3" upper="3" effort="0" velocity="1"/></joint>"#
        )
    };
    let joints = [
        joint("a", "root", ""),
        joint("b", "a_link", ""),
        joint("p", "b_link", r#"<mimic joint="b" multiplier="-1"/>"#),
        joint("c", "p_link", ""),
    ];
    let text = format!(r#"<robot name="parallel"><link name="root"/>{}</robot>"#, joints.concat());
    let chain = RobotDescription::from_text(Path::new("parallel.urdf"), text).unwrap().chain(None, None).unwrap();
    let (q, value) = ([0.4, -0.9, 0.7], 1e-2);
    let poses = Robot::nominal(chain.clone()).link_poses(&q);
    let [p, c] = [2, 3].map(|k: usize| poses[k].rotation);
    let axis = p * chain.joints[2].axis;
    // The levers of an axis along y are x and -z.
    let levers = [p.column(0).into_owned(), -p.column(2), c.column(0).into_owned(), -c.column(2)];
    for (lever, arm) in (0..4).zip(levers) {
        let terms = vec![JointTerm { reading: 1, term: Term::Gravity(lever), value }];
        let sagging = Robot { terms, ..Robot::nominal(chain.clone()) }.base_from_tip(&q);
        let moment = axis.dot(&arm.cross(&nalgebra::Vector3::new(0.0, 0.0, -1.0)));
        let expected = Robot::nominal(chain.clone()).base_from_tip(&[q[0], q[1] + value * moment, q[2]]);
        assert!((sagging.matrix() - expected.matrix()).amax() < 1e-12, "lever {lever}");
    }
}
