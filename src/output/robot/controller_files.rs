//! The corrected robot for those who read no URDF: xacro properties, a table of MDH parameters.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::geom::Pose;
use crate::model::inverse;
use crate::model::mdh::{Mdh, Unfit};
use crate::model::robot::Robot;
use crate::output::text::number;
use crate::output::{Context, Offsets};
use crate::series::to_csv;
use crate::urdf::{Chain, JointKind};

/// How offsets are dealt with, as a sentence for the head of a file.
pub(super) fn offsets_in_words(context: &Context) -> &'static str {
    match context.offsets {
        Offsets::Folded => {
            "Joint offsets are folded in: controller angles stay as they are, and mastering must not be changed."
        }
        Offsets::Mastering => {
            "Joint offsets that mastering.csv has with in_urdf = no are NOT in here: enter them, and no others, in the controller first."
        }
    }
}

/// Names of properties for joints: letters, digits and `_`, a letter first, no two alike.
fn identifiers(joints: &[(&str, Pose)]) -> Vec<String> {
    let mut names: Vec<String> = Vec::with_capacity(joints.len());
    for (joint, _) in joints {
        let mut name: String = joint.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
            name.insert_str(0, "joint_");
        }
        while names.contains(&name) {
            name.push('_');
        }
        names.push(name);
    }
    names
}

/// A name as it may stand in a comment of XML.
fn in_comment(name: &str) -> String {
    name.replace("--", "- -")
}

/// Origins as xacro properties `NAME_origin_xyz` and `NAME_origin_rpy`, each under the element in which they are to be used; `note` says in
/// the head how joint offsets are dealt with.
pub fn kinematics_xacro(robot: &Robot, note: &str) -> String {
    let mut out = format!(
        "<?xml version=\"1.0\"?>\n<!-- Corrected joint origins (m, rad) as properties, for robot descriptions written in xacro (ROS): include this file, and write\n\
         \x20    in every joint the origin that stands here above its properties. {note} -->\n\
         <robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\">\n"
    );
    let origins = robot.urdf_origins();
    for ((joint, origin), name) in origins.iter().zip(identifiers(&origins)) {
        let list = |v: [f64; 3]| v.map(number).join(" ");
        out += &format!(
            "  <!-- {}: <origin xyz=\"${{{name}_origin_xyz}}\" rpy=\"${{{name}_origin_rpy}}\"/> -->\n",
            in_comment(joint)
        );
        out += &format!("  <xacro:property name=\"{name}_origin_xyz\" value=\"{}\"/>\n", list(origin.xyz()));
        out += &format!("  <xacro:property name=\"{name}_origin_rpy\" value=\"{}\"/>\n", list(origin.rpy()));
    }
    out + "</robot>\n"
}

/// Postures at which the table is held against the origins.
const POSTURES: usize = 500;
/// Seed of these postures.
const SEED: u64 = 8;

/// Postures within the limits of the joints.
pub(super) fn postures(chain: &Chain) -> impl Iterator<Item = Vec<f64>> {
    let limits = inverse::reading_limits(chain);
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    (0..POSTURES).map(move |_| inverse::random_readings(&limits, &chain.reading_kinds, &mut rng))
}

/// Modified Denavit-Hartenberg parameters, or why there are none; `note` as in [`kinematics_xacro`].
pub(super) fn mdh_csv(robot: &Robot, note: &str) -> String {
    let mut robot = robot.clone();
    let origins = robot.corrected_origins();
    robot.chain.joints.iter_mut().zip(origins).for_each(|(j, o)| j.origin = o);
    let robot = Robot::nominal(robot.chain);
    let head = format!(
        "# Modified Denavit-Hartenberg parameters (Craig), for controllers and toolboxes that take no other model. Link i:\n\
         # T = RotX(alpha_rad) TransX(a_m) RotZ(q + theta_offset_rad) TransZ(d_m) (prismatic: TransZ(d_m + q)); base and tip are full poses. {note}\n\
         # From base link \"{}\" to tip link \"{}\".\n",
        robot.chain.base, robot.chain.tip
    );
    let mdh = match Mdh::of(&robot.chain) {
        Ok(mdh) => mdh,
        Err(Unfit(why)) => return format!("{head}# No table: {why}. Use the URDF or kinematics.yaml.\n"),
    };
    let errors: Vec<(f64, f64)> =
        postures(&robot.chain).map(|q| mdh.base_from_tip(&q).distance(&robot.base_from_tip(&q))).collect();
    let worst = |of: fn(&(f64, f64)) -> f64| 1e3 * errors.iter().map(of).fold(0.0, f64::max);
    let rms = 1e3 * (errors.iter().map(|e| e.1 * e.1).sum::<f64>() / POSTURES as f64).sqrt();
    let mut out = head;
    if !mdh.parallel.is_empty() {
        let pairs: Vec<String> =
            mdh.parallel.iter().map(|(a, b, mrad)| format!("{a} and {b} ({mrad:.3} mrad)")).collect();
        out += &format!(
            "# WARNING: nearly parallel axes are taken as parallel, because no usable MDH parameters say otherwise: {}.\n",
            pairs.join(", ")
        );
    }
    out += &format!(
        "# Against the corrected URDF at {POSTURES} postures: {rms:.4} mm RMS, at most {:.4} mm and {:.4} mrad.\n",
        worst(|e| e.1),
        worst(|e| e.0)
    );
    let pose = |name: &str, p: &Pose| {
        let words = |v: [f64; 3]| v.map(number).join(" ");
        format!("# {name}: xyz_m {}, rpy_rad {}\n", words(p.xyz()), words(p.rpy()))
    };
    out += &pose("base_from_first", &mdh.base);
    out += &pose("last_from_tip", &mdh.tip);
    let mut rows = vec![["joint", "kind", "alpha_rad", "a_m", "theta_offset_rad", "d_m"].map(String::from).to_vec()];
    for link in &mdh.links {
        let kind = if link.kind == JointKind::Prismatic { "prismatic" } else { "revolute" };
        let numbers = [link.alpha_rad, link.a_m, link.theta_rad, link.d_m].map(number);
        rows.push([vec![link.joint.clone(), kind.into()], numbers.to_vec()].concat());
    }
    out + &to_csv(&rows)
}
