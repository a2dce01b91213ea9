//! Reading robot descriptions.

use std::collections::BTreeMap;
use std::path::Path;

use crate::said::assert_says;
use nalgebra::Vector3;
use robotcal::geom::Pose;
use robotcal::model::robot::Robot;
use robotcal::urdf::{JointKind, RobotDescription, patch_origins, read};
use robotcal::{Code, Error};

fn robot(text: &str) -> RobotDescription {
    RobotDescription::from_text(Path::new("r.urdf"), text.to_string()).unwrap()
}

/// The refusal of a description, as a person sees it.
fn refusal(text: &str) -> Error {
    RobotDescription::from_text(Path::new("r.urdf"), text.to_string()).unwrap_err()
}

fn joint(name: &str, kind: &str, parent: &str, child: &str, inner: &str) -> String {
    format!(
        "\n<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>{inner}</joint>"
    )
}

fn wrap(links: &[&str], joints: &[String]) -> String {
    let links: String = links.iter().map(|l| format!("\n<link name=\"{l}\"/>")).collect();
    format!("<robot name=\"r\">{links}{}\n</robot>", joints.concat())
}

const Z: &str = "<axis xyz=\"0 0 1\"/>";

#[test]
fn a_chain_has_the_joints_in_order_with_their_kinds_and_readings() {
    let limit = "<limit lower=\"-1\" upper=\"3\" effort=\"0\" velocity=\"0\"/>";
    let text = wrap(
        &["world", "rail", "a", "b", "c", "finger", "flange"],
        &[
            joint("x", "prismatic", "world", "rail", &format!("<axis xyz=\"2 0 0\"/>{limit}")),
            joint("j2", "continuous", "a", "b", "<axis xyz=\"0 1 0\"/>"),
            joint("mount", "fixed", "rail", "a", "<origin xyz=\"0 0 0.5\" rpy=\"0 0 0.1\"/>"),
            joint("j3", "revolute", "b", "c", &format!("{Z}<mimic joint=\"g\" multiplier=\"-2\" offset=\"0.25\"/>")),
            joint("g", "prismatic", "c", "finger", &format!("{Z}<mimic joint=\"x\" multiplier=\"3\" offset=\"0.5\"/>")),
            joint("end", "fixed", "c", "flange", ""),
        ],
    );
    let robot = robot(&text);
    let chain = robot.chain(None, Some("flange")).unwrap();
    assert_eq!((chain.base.as_str(), chain.tip.as_str()), ("world", "flange"));
    let kinds: Vec<_> = chain.joints.iter().map(|j| (j.name.as_str(), j.kind)).collect();
    use JointKind::{Fixed, Prismatic, Revolute};
    assert_eq!(kinds, [("x", Prismatic), ("mount", Fixed), ("j2", Revolute), ("j3", Revolute), ("end", Fixed)]);
    assert_eq!(chain.readings, ["x", "j2"]);
    assert_eq!(chain.reading_kinds, [Prismatic, Revolute]);
    assert_eq!(chain.joints[0].axis, Vector3::x(), "axes are normalised");
    assert_eq!(chain.joints[0].limits, Some((-1.0, 3.0)));
    assert_eq!(chain.joints[2].limits, None);
    // j3 = -2 (3 x + 0.5) + 0.25
    let drive = chain.joints[3].drive.unwrap();
    assert_eq!((drive.reading, drive.multiplier, drive.offset), (0, -6.0, -0.75));
    assert_eq!(chain.joints[1].origin, Pose::from_xyz_rpy([0.0, 0.0, 0.5], [0.0, 0.0, 0.1]));
    let said = |n: &robotcal::Notice| n.code == Code::UrdfAxis && n.place.contains("\"x\"") && n.what.contains(" 2;");
    assert!(robot.notices.iter().any(said), "{:?}", robot.notices);
}

#[test]
fn a_mimic_driver_outside_the_chain_is_a_reading_with_its_own_kind() {
    let text = wrap(
        &["base", "a", "beside"],
        &[
            joint("follower", "revolute", "base", "a", &format!("{Z}<mimic joint=\"leader\"/>")),
            joint("leader", "prismatic", "base", "beside", Z),
        ],
    );
    let chain = robot(&text).chain(None, Some("a")).unwrap();
    assert_eq!(chain.readings, ["leader"]);
    assert_eq!(chain.reading_kinds, [JointKind::Prismatic]);
}

#[test]
fn several_leaves_are_listed_and_unknown_names_get_a_suggestion() {
    let text = |tool: &str| {
        wrap(
            &["base", "a", tool, "camera"],
            &[
                joint("j1", "revolute", "base", "a", Z),
                joint("t", "fixed", "a", tool, ""),
                joint("c", "fixed", "a", "camera", ""),
            ],
        )
    };
    let error = robot(&text("spindle")).chain(None, None).unwrap_err();
    assert_says(&error, Code::TipAmbiguous, &["spindle", "camera"]);
    let robot = robot(&text("tool0"));
    let error = robot.chain(None, Some("tool_0")).unwrap_err();
    assert_says(&error, Code::LinkUnknown, &["tool_0", "\"tool0\""]);
    for (base, tip) in [("tool0", "camera"), ("a", "base"), ("a", "tool0")] {
        let error = robot.chain(Some(base), Some(tip)).unwrap_err();
        assert_says(&error, Code::ChainImpossible, &[base, tip]);
    }
}

/// Joints as in a URDF of ROS-Industrial: tool0 behind the arm, base (the frame of the controller) on base_link.
fn industrial(extra_links: &[&str], extra: &[String]) -> RobotDescription {
    let links = [&["base_link", "link_1", "link_2", "tool0", "base"], extra_links].concat();
    let arm = [
        joint("a1", "revolute", "base_link", "link_1", &format!("{Z}<origin xyz=\"0 0 0.4\"/>")),
        joint("a2", "revolute", "link_1", "link_2", &format!("{Z}<origin xyz=\"0.3 0 0\" rpy=\"1.2 0 0\"/>")),
        joint("t", "fixed", "link_2", "tool0", "<origin xyz=\"0 0 0.1\"/>"),
        joint("base_link-base", "fixed", "base_link", "base", "<origin xyz=\"0 0.1 0.2\" rpy=\"0 0 3\"/>"),
    ];
    robot(&wrap(&links, &[&arm, extra].concat()))
}

#[test]
fn of_several_leaves_the_one_behind_all_moving_joints_is_the_tip() {
    let fixed = |name: &str, child: &str| joint(name, "fixed", "link_2", child, "");
    let plain = industrial(&[], &[]);
    assert_eq!(plain.chain(None, None).unwrap().tip, "tool0");
    assert!(plain.tip_notice(None, None).unwrap().code == Code::TipChosen);
    assert!(plain.tip_notice(None, Some("tool0")).is_none(), "the user named it");
    let several = industrial(&["flange", "ft_frame"], &[fixed("f", "flange"), fixed("s", "ft_frame")]);
    assert_eq!(several.chain(None, None).unwrap().tip, "tool0");
    let branch = joint("finger", "prismatic", "link_2", "finger_tip", Z);
    let error = industrial(&["finger_tip"], std::slice::from_ref(&branch)).chain(None, None);
    assert_eq!(error.unwrap().tip, "finger_tip", "it is behind all joints that move");
    let other = joint("other", "prismatic", "link_2", "other_tip", Z);
    let error = industrial(&["finger_tip", "other_tip"], &[branch, other]).chain(None, None).unwrap_err();
    assert_says(&error, Code::TipAmbiguous, &["\"tool0\""]);
}

#[test]
fn the_tip_of_one_of_two_arms_is_found_from_its_base() {
    let arm = |side: &str| {
        let link = |name: &str| format!("{side}_{name}");
        [
            joint(&link("mount"), "fixed", "world", &link("base_link"), ""),
            joint(&link("b"), "fixed", &link("base_link"), &link("base"), ""),
            joint(&link("a1"), "revolute", &link("base_link"), &link("arm"), Z),
            joint(&link("t"), "fixed", &link("arm"), &link("tool0"), ""),
            joint(&link("f"), "fixed", &link("arm"), &link("flange"), ""),
        ]
    };
    let sides = ["left", "right"];
    let links: Vec<String> = sides
        .iter()
        .flat_map(|s| ["base_link", "base", "arm", "tool0", "flange"].map(|l| format!("{s}_{l}")))
        .collect();
    let links: Vec<&str> = std::iter::once("world").chain(links.iter().map(String::as_str)).collect();
    let cell = robot(&wrap(&links, &[arm("left"), arm("right")].concat()));
    for base in ["left_base_link", "left_base"] {
        let chain = cell.chain(Some(base), None).unwrap();
        assert_eq!((chain.tip.as_str(), chain.readings.len()), ("left_tool0", 1), "{base}");
    }
    let error = cell.chain(None, None).unwrap_err();
    assert_says(&error, Code::TipAmbiguous, &["6"]);
}

#[test]
fn a_base_that_hangs_on_the_root_by_fixed_joints_is_a_base() {
    let description = industrial(&[], &[]);
    let (root, base) = (description.chain(None, None).unwrap(), description.chain(Some("base"), None).unwrap());
    assert_eq!((base.base.as_str(), base.tip.as_str(), &base.readings), ("base", "tool0", &root.readings));
    let q = [0.4, -1.1];
    let base_from_root =
        Robot::nominal(base.clone()).base_from_tip(&q) * Robot::nominal(root).base_from_tip(&q).inverse();
    let stated = description.fixed_joint("base_link-base").unwrap();
    let (angle, distance) = base_from_root.inverse().distance(&stated);
    assert!(angle < 1e-12 && distance < 1e-12, "{angle:e} {distance:e}");
    // What the URDF states stays what it is.
    let origins = Robot::nominal(base).urdf_origins().into_iter().map(|(n, o)| (n.to_owned(), o)).collect();
    let again =
        RobotDescription::from_text(Path::new("again.urdf"), patch_origins(&description.text, &origins).unwrap());
    let (angle, distance) = again.unwrap().fixed_joint("base_link-base").unwrap().distance(&stated);
    assert!(angle < 1e-12 && distance < 1e-12, "{angle:e} {distance:e}");
    let error = description.chain(Some("tool0"), Some("base")).unwrap_err();
    assert_eq!(error.code, Code::ChainImpossible, "joints that move are not climbed: {error}");
}

#[test]
fn joints_without_a_single_reading_are_refused_by_name() {
    for kind in ["floating", "planar"] {
        let joints = [joint("free", kind, "world", "base", ""), joint("j1", "revolute", "base", "tip", Z)];
        let robot = robot(&wrap(&["world", "base", "tip"], &joints));
        let error = robot.chain(None, None).unwrap_err();
        assert_says(&error, Code::ChainImpossible, &["\"free\"", kind, "base = \"base\""]);
        assert_eq!(robot.chain(Some("base"), None).unwrap().readings, ["j1"]);
    }
}

#[test]
fn bad_joints_name_line_and_joint() {
    for (inner, code, names) in [
        ("<axis xyz=\"0 0 0\"/>", Code::UrdfAxis, ["r.urdf:4", "\"j1\""]),
        ("<axis xyz=\"0 0 1 x\"/>", Code::UrdfNumber, ["r.urdf:4", "0 0 1 x"]),
        ("\n<origin xyz=\"0 0,5 1 2\"/>", Code::UrdfNumber, ["r.urdf:5", "0 0,5 1 2"]),
        ("<origin rpv=\"0 0 1\"/>", Code::UrdfElement, ["r.urdf:4", "rpv"]),
        ("<orign xyz=\"0 0 1\"/>", Code::UrdfElement, ["<orign>", "<origin>"]),
        ("<origin/><origin xyz=\"0 0 1\"/>", Code::UrdfTwice, ["r.urdf:4", "<origin>"]),
        ("<origin quat_xyzw=\"0 0 0 1\"/>", Code::UrdfRotation, ["quat_xyzw", "1.1"]),
        ("<mimic joint=\"j9\" multiplier=\"two\"/>", Code::UrdfNumber, ["r.urdf:4", "multiplier=\"two\""]),
    ] {
        let message = refusal(&wrap(&["a", "b"], &[joint("j1", "revolute", "a", "b", inner)]));
        assert_says(&message, code, &[names[0], names[1], "\"j1\""]);
    }
}

#[test]
fn bad_trees_and_texts_name_the_place() {
    let fixed = |name: &str, parent: &str, child: &str| joint(name, "fixed", parent, child, "");
    let cases: &[(String, Code, &[&str])] = &[
        (wrap(&["a", "a"], &[]), Code::UrdfTwice, &["r.urdf:3", "\"a\""]),
        (wrap(&["a"], &[fixed("j1", "a", "b2")]), Code::LinkUnknown, &["r.urdf:3", "\"b2\""]),
        (
            wrap(&["a", "b"], &[joint("j1", "Revolute", "a", "b", Z)]),
            Code::UrdfElement,
            &["\"Revolute\"", "type=\"revolute\""],
        ),
        (
            wrap(&["a", "b"], &[joint("j1", "", "a", "b", Z).replace(" type=\"\"", "")]),
            Code::UrdfElement,
            &["\"j1\"", "revolute"],
        ),
        (wrap(&["a", "b", "c"], &[fixed("j", "a", "c"), fixed("k", "b", "c")]), Code::TreeBroken, &["\"k\"", "\"j\""]),
        (wrap(&["a", "b"], &[fixed("j", "a", "b"), fixed("k", "b", "a")]), Code::TreeBroken, &[]),
        (wrap(&["a", "b", "c"], &[fixed("j", "a", "b"), fixed("j", "b", "c")]), Code::UrdfTwice, &["\"j\""]),
        ("<robot name='r'>\n<link name='a'>\n</robot>".into(), Code::UrdfSyntax, &["r.urdf:3"]),
        // Files that were cut off: between elements, within one, within an attribute.
        ("<robot name='r'>\n<link name='a'/>\n<link name='b'/>\n".into(), Code::UrdfSyntax, &["r.urdf:3", "</robot>"]),
        ("<robot name='r'>\n<link name='a'/>\n<link".into(), Code::UrdfSyntax, &["r.urdf:3", "</robot>"]),
        ("<robot name='r'>\n<link name='a'/>\n<link name='b".into(), Code::UrdfSyntax, &["r.urdf:3", "</robot>"]),
        ("<sdf/>".into(), Code::UrdfSyntax, &["<sdf>"]),
        ("<robot name='r'/>".into(), Code::UrdfElement, &[]),
    ];
    for (text, code, names) in cases {
        assert_says(&refusal(text), *code, names);
    }
    for (encoding, bytes) in
        [("UTF-16LE", u16::to_le_bytes as fn(u16) -> [u8; 2]), ("UTF-16BE", u16::to_be_bytes as fn(u16) -> [u8; 2])]
    {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.urdf");
        std::fs::write(&path, wrap(&["a"], &[]).encode_utf16().flat_map(bytes).collect::<Vec<u8>>()).unwrap();
        assert_says(&read(&path).unwrap_err(), Code::TextEncoding, &["r.urdf", encoding, "UTF-8"]);
    }
    let error = read(Path::new("no/such.urdf")).unwrap_err();
    assert_says(&error, Code::FileMissing, &["no/such.urdf"]);
}

#[test]
fn mimic_joints_that_lead_nowhere_are_refused() {
    let pair = |a: &str, b: &str| {
        let joints = [
            joint("p", "revolute", "a", "b", &format!("{Z}<mimic joint=\"{a}\"/>")),
            joint("q", "revolute", "b", "c", &format!("{Z}<mimic joint=\"{b}\"/>")),
            joint("f", "fixed", "c", "d", ""),
        ];
        robot(&wrap(&["a", "b", "c", "d"], &joints)).chain(None, None).unwrap_err()
    };
    for (followed, named) in [("q", "\"p\""), ("nobody", "\"nobody\""), ("f", "\"f\"")] {
        assert_says(&pair(followed, "p"), Code::MimicBroken, &[named]);
    }
}

#[test]
fn an_unexpanded_xacro_is_refused_with_the_command_that_expands_it() {
    let declared = "<robot name=\"r\" xmlns:xacro=\"http://ros.org/wiki/xacro\">\n<link name=\"a\"/>";
    let cases = [
        format!("{declared}\n<xacro:include filename=\"x\"/></robot>"),
        "<robot name=\"r\">\n<link name=\"a\"/>\n<xacro:arm/></robot>".to_string(),
        wrap(&["a", "b"], &[joint("${prefix}j", "fixed", "a", "b", "")]),
    ];
    for text in cases {
        let error = RobotDescription::from_text(Path::new("arm.urdf.xacro"), text).unwrap_err();
        assert_says(&error, Code::UrdfXacro, &["arm.urdf.xacro:", "arm.expanded.urdf"]);
    }
    let expanded = format!("{declared}<!-- <xacro:arm/> --></robot>");
    assert_eq!(robot(&expanded).links().count(), 1, "a leftover declaration or comment is no macro");
}

#[test]
fn defaults_that_were_never_written_are_not_invented() {
    let limit = |attributes: &str| format!("{Z}<limit {attributes} effort=\"0\" velocity=\"0\"/>");
    for (inner, wanted) in [
        (Z.to_string(), None),
        (limit(""), None),
        (limit("lower=\"0\" upper=\"0\""), None),
        (limit("upper=\"1\""), Some((0.0, 1.0))),
    ] {
        let chain = robot(&wrap(&["a", "b"], &[joint("j", "revolute", "a", "b", &inner)])).chain(None, None).unwrap();
        assert_eq!(chain.joints[0].limits, wanted, "{inner}");
    }
    let noticed = |inner: &str| robot(&wrap(&["a", "b"], &[joint("j", "revolute", "a", "b", inner)])).notices;
    assert_eq!(noticed("")[0].code, Code::UrdfAxis);
    assert_eq!(noticed(&format!("{Z}<origin rpy=\"90 0 0\"/>"))[0].code, Code::UrdfAngleUnit);
    let limited = limit("lower=\"-1\" upper=\"1\"");
    assert!(noticed(&format!("{limited}<origin rpy=\"1.57 0 0\"/>")).is_empty());
}

#[test]
fn a_joint_without_limits_is_told_of_and_one_that_follows_another_is_not() {
    let limit = |attributes: &str| format!("<limit {attributes} effort=\"0\" velocity=\"0\"/>");
    let limited = joint("i", "revolute", "a", "b", &format!("{Z}{}", limit("lower=\"-1\" upper=\"1\"")));
    let follows = "<mimic joint=\"i\"/>";
    for (kind, inner, told) in [
        ("revolute", String::new(), true),
        ("prismatic", String::new(), true),
        ("revolute", limit(""), true),
        ("revolute", limit("upper=\"1\""), false),
        ("continuous", String::new(), false),
        ("revolute", follows.to_owned(), false),
    ] {
        let joints = [limited.clone(), joint("j", kind, "b", "c", &format!("{Z}{inner}"))];
        let codes: Vec<Code> = robot(&wrap(&["a", "b", "c"], &joints)).notices.iter().map(|n| n.code).collect();
        assert_eq!(codes, vec![Code::UrdfUnlimited; usize::from(told)], "{kind} {inner}");
    }
    // Of all joints of a file it is told once, by their names.
    let joints = [
        joint("j", "revolute", "a", "b", Z),
        joint("k", "prismatic", "b", "c", Z),
        joint("l", "revolute", "c", "d", Z),
    ];
    let notices = robot(&wrap(&["a", "b", "c", "d"], &joints)).notices;
    assert_eq!(notices.len(), 1, "{notices:?}");
    assert_says(&notices[0], Code::UrdfUnlimited, &["r.urdf:6", "j, k, l", "urdfdom", "pinocchio"]);
}

#[test]
fn masses_are_carried_by_the_last_joint_of_the_chain_before_them() {
    let link = |name: &str, mass: f64| {
        let inertia = "<inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/>";
        format!(
            "<link name=\"{name}\"><inertial><origin xyz=\"0.1 0 0\"/><mass value=\"{mass}\"/>{inertia}</inertial></link>"
        )
    };
    let text = [
        "<robot name=\"r\"><link name=\"tool\"/>".to_string(),
        link("base", 50.0),
        link("arm", 4.0),
        link("gripper", 2.0),
        joint("j1", "revolute", "base", "arm", Z),
        joint("t", "fixed", "arm", "tool", ""),
        joint("g", "revolute", "arm", "gripper", &format!("{Z}<origin xyz=\"0 0 1\" rpy=\"0 0 1.5707963267948966\"/>")),
        "</robot>".to_string(),
    ];
    let robot = robot(&text.concat());
    assert_eq!(robot.inertials().len(), 3, "a link without <inertial> has none");
    let carried = robot.carried_masses(&robot.chain(None, Some("tool")).unwrap());
    let by_link: BTreeMap<_, _> = carried.iter().map(|c| (c.link.as_str(), c)).collect();
    assert_eq!(by_link.keys().copied().collect::<Vec<_>>(), ["arm", "gripper"]);
    assert_eq!((by_link["gripper"].joint, by_link["gripper"].mass_kg), (0, 2.0));
    // Rounding of cos(pi/2).
    assert!((by_link["gripper"].centre_m - Vector3::new(0.0, 0.1, 1.0)).norm() < 1e-15);
}

#[test]
fn an_arm_in_millimetres_is_refused_wherever_it_stands() {
    let arm = |stand: f64, link: f64| {
        let at = |x: f64| format!("{Z}<origin xyz=\"{x} 0 0\"/>");
        let joints = [joint("j1", "revolute", "hall", "a", &at(stand)), joint("j2", "revolute", "a", "b", &at(link))];
        robot(&wrap(&["hall", "a", "b"], &joints)).chain(None, None)
    };
    assert!(arm(80.0, 0.4).is_ok());
    let error = arm(80.0, 400.0).unwrap_err();
    assert_says(&error, Code::UrdfLengthUnit, &["400 m"]);
}

#[test]
fn names_that_would_break_a_program_or_a_terminal_are_refused_with_their_line() {
    let text = |robot: &str, link: &str, name: &str| {
        wrap(&["a", link], &[joint(name, "revolute", "a", link, Z)]).replace("name=\"r\"", &format!("name=\"{robot}\""))
    };
    assert_eq!(robot(&text("r", "b", "j;1 \u{e9}")).chain(None, None).unwrap().readings, ["j;1 \u{e9}"]);
    for hidden in ["&#10;HALT&#10;", "&#13;", "&#9;", "&#x9b;2J", "&#x7f;", "&#x2028;", "&#x202e;"] {
        let bad = format!("j{hidden}1");
        for (file, place) in [(text(&bad, "b", "j"), 1), (text("r", &bad, "j"), 3), (text("r", "b", &bad), 4)] {
            let error = RobotDescription::from_text(Path::new("r.urdf"), file.clone()).unwrap_err();
            assert_eq!((error.code, error.place), (Code::NameUnprintable, format!("r.urdf:{place}")), "{file}");
            assert!(!error.what.contains(|c: char| c.is_control() || !c.is_ascii()), "{:?}", error.what);
        }
    }
}

/// Simulators add elements of their own, often under a prefix that nothing declares; the parsers of ROS let them pass.
#[test]
fn elements_under_an_undeclared_prefix_are_passed_over_and_kept() {
    let tag = "<drake:proximity_properties><drake:mu value=\"1\"/></drake:proximity_properties>";
    let link =
        format!("<link name=\"a\"><collision>{tag}<geometry><sphere radius=\"0.1\"/></geometry></collision></link>");
    let text = wrap(
        &["b"],
        &[joint(
            "j",
            "revolute",
            "a",
            "b",
            "<origin xyz=\"0 0 1\"/><limit effort=\"1\" velocity=\"1\" lower=\"-1\" upper=\"1\" drake:acceleration=\"2\"/>",
        )],
    );
    let text = text.replacen("<link", &format!("{link}<link"), 1);
    assert_eq!(robot(&text).chain(None, None).unwrap().readings, ["j"]);
    let new = [("j".to_owned(), Pose::from_xyz_rpy([0.0, 0.0, 1.5], [0.0; 3]))].into();
    let patched = patch_origins(&text, &new).unwrap();
    assert_eq!(patched, text.replace("xyz=\"0 0 1\"", "xyz=\"0 0 1.5\""));
}

/// What the first arm may have, the second may have, too; and a remark behind the robot is no part of it.
#[test]
fn a_second_arm_may_have_what_the_first_may() {
    let arm = wrap(&["a", "b"], &[joint("j", "revolute", "a", "b", "<origin xyz=\"0 0 1\"/>")]);
    let marked = arm.replacen("<link name=\"a\"/>", "<link name=\"a\"><drake:mu value=\"1\"/></link>", 1);
    let behind = "\n<!-- made of </parts> -->\n";
    for (first, second) in [(&arm, &marked), (&marked, &arm), (&format!("{arm}{behind}"), &arm)] {
        let (both, prefix) = robot(first).with_second(None, &robot(second)).unwrap();
        let chain = both.chain(Some("robot_2_b"), Some("b")).unwrap();
        assert_eq!((prefix, chain.readings), ("robot_2_", vec!["robot_2_j".to_owned(), "j".to_owned()]));
        let file = both.text.as_str();
        assert_eq!(file.ends_with(behind), first.ends_with(behind));
    }
}

/// The parsers of ROS let a document type pass; what an entity stands for could not be corrected in its place.
#[test]
fn a_document_type_is_kept_and_its_entities_are_refused() {
    let joints = joint("j", "revolute", "a", "b", &format!("{Z}<origin xyz=\"0 0 2\"/>"));
    let plain = wrap(&["a", "b"], &[joints]);
    let head = "<?xml version=\"1.0\"?>\n<!DOCTYPE robot [\n<!ELEMENT robot ANY>\n]>\n";
    let text = format!("{head}{plain}");
    assert_eq!(robot(&text).chain(None, None).unwrap().readings, ["j"]);
    let new = [("j".to_owned(), Pose::from_xyz_rpy([0.0, 0.0, 2.5], [0.0; 3]))].into();
    assert_eq!(patch_origins(&text, &new).unwrap(), text.replace("xyz=\"0 0 2\"", "xyz=\"0 0 2.5\""));
    let entity = text.replace("<!ELEMENT robot ANY>", "<!ENTITY height '1'>").replace("0 0 2", "0 0 &height;");
    assert_says(&refusal(&entity), Code::UrdfSyntax, &["r.urdf:3", "<!ENTITY"]);
}

#[test]
fn what_moves_no_link_may_be_incomplete() {
    let limit = "<limit lower=\"-1\" upper=\"3\"/><dynamics damping=\"\"/>";
    let links = "<material name=\"m\"><texture/><color rgba=\"1 0 0\"/></material><link name=\"a\"><visual/><visual><geometry><cone/></geometry></visual></link>\
                 <link name=\"b\"><inertial><mass value=\" 2.5 \"/></inertial></link>";
    let joints = joint("j", "revolute", "a", "b", &format!("{Z}<origin xyz=\"0 0 1\"/>{limit}"));
    let read = robot(&format!("\u{feff}<robot name=\"r\">{links}{joints}<gazebo><joint/></gazebo></robot>"));
    let chain = read.chain(None, None).unwrap();
    assert_eq!(chain.joints[0].origin.translation, Vector3::z());
    assert_eq!(chain.joints[0].limits, Some((-1.0, 3.0)));
    assert_eq!(read.inertials()["b"].mass_kg, 2.5);
    for mass in ["", "<mass/>", "<mass value=\"2,5\"/>", "<mass value=\"-1\"/>"] {
        let text = format!("<robot name=\"r\">\n<link name=\"a\"><inertial>{mass}</inertial></link></robot>");
        assert_says(&refusal(&text), Code::UrdfNumber, &["r.urdf:2", "\"a\""]);
    }
}

#[test]
fn a_misspelt_factor_of_a_mimic_joint_is_not_taken_as_one() {
    let text = |mimic: &str| {
        let follower = joint("f", "revolute", "b", "c", &format!("{Z}<mimic joint=\"j\" {mimic}/>"));
        wrap(&["a", "b", "c"], &[joint("j", "revolute", "a", "b", Z), follower])
    };
    for wrong in ["multiplyer=\"-2\"", "Multiplier=\"-2\"", "ofset=\"1\""] {
        assert_says(&refusal(&text(wrong)), Code::UrdfElement, &["\"f\"", wrong]);
    }
    assert_eq!(
        robot(&text("plugin=\"p\" multiplier=\"-2\"")).chain(None, None).unwrap().joints[1].drive.unwrap().multiplier,
        -2.0
    );
}

#[test]
fn limits_in_degrees_are_noticed() {
    let noticed = |kind: &str, bounds: &str| {
        let limit = format!("{Z}<limit {bounds} effort=\"0\" velocity=\"0\"/>");
        robot(&wrap(&["a", "b"], &[joint("j", kind, "a", "b", &limit)]))
            .notices
            .iter()
            .any(|n| n.code == Code::UrdfAngleUnit)
    };
    assert!(noticed("revolute", "lower=\"-170\" upper=\"170\""));
    assert!(!noticed("revolute", "lower=\"-15.8\" upper=\"15.8\""), "a wrist of 900 degrees");
    assert!(!noticed("revolute", "lower=\"-1e16\" upper=\"1e16\""), "no limit");
    assert!(!noticed("prismatic", "lower=\"0\" upper=\"40\""), "a rail of 40 m");
}
