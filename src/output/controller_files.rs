//! The corrected robot for those who read no URDF: xacro properties, joint offsets for the controller, a table of MDH parameters.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::text::number;
use super::{Context, Offsets};
use crate::geom::Pose;
use crate::identify::Solution;
use crate::model::inverse;
use crate::model::mdh::{Mdh, Unfit};
use crate::model::robot::Robot;
use crate::series::to_csv;
use crate::urdf::{Chain, JointKind};

/// The robot as the files of this result describe it: offsets folded into origins, or left to the controller.
pub(super) fn exported(solution: &Solution, context: &Context) -> Robot {
    of_controller(&solution.fit.state.robot, context)
}

/// A robot with its offsets folded into origins, or left to the controller.
pub(super) fn of_controller(robot: &Robot, context: &Context) -> Robot {
    match context.offsets {
        Offsets::Folded => robot.clone(),
        Offsets::Mastering => robot.mastered().0,
    }
}

/// How offsets are dealt with, as a sentence for the head of a file.
pub(super) fn offsets_in_words(context: &Context) -> &'static str {
    match context.offsets {
        Offsets::Folded => {
            "Joint offsets are folded in: controller angles stay as they are, and mastering must not be changed."
        }
        Offsets::Mastering => "Joint offsets are NOT in here: enter those of mastering.csv in the controller first.",
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

/// Sigma of an offset that is worth entering whatever the offset is: half a millimetre at a metre.
const USEFUL_SIGMA_RAD: f64 = 0.5e-3;
const USEFUL_SIGMA_M: f64 = 0.05e-3;
/// Sigmas by which a less well known offset must differ from none.
const LEAST_SIGMAS: f64 = 2.0;

/// An offset that the data decide (they say at least as much as the tolerance that was assumed), and whose entry makes the
/// robot better: known well, or far larger than its sigma.
fn is_determined(offset: f64, sigma: f64, prior: f64, prismatic: bool) -> bool {
    let useful = if prismatic { USEFUL_SIGMA_M } else { USEFUL_SIGMA_RAD };
    sigma < 0.5 * prior && (sigma <= useful || offset.abs() > LEAST_SIGMAS * sigma)
}

/// Joint offsets for the controller: one row for every joint.
pub(super) fn mastering_csv(solution: &Solution, context: &Context) -> String {
    let robot = &solution.fit.state.robot;
    let offsets = robot.mastered().1;
    let mut rows = vec![["joint", "offset", "sigma", "unit", "determined", "in_urdf"].map(String::from).to_vec()];
    for (reading, name) in robot.chain.readings.iter().enumerate() {
        let prismatic = robot.chain.reading_kinds[reading] == JointKind::Prismatic;
        let (unit, factor) = if prismatic { ("mm", 1e3) } else { ("deg", 1f64.to_degrees()) };
        let column = solution.fit.problem.layout.find(&format!("robot/{name}.offset"));
        let sigma = column.map_or(f64::NAN, |c| solution.fit.covariance.reduced[(c, c)].max(0.0).sqrt());
        let prior = column.map_or(f64::NAN, |c| solution.fit.problem.layout.columns[c].prior_sigma);
        let is_held = column.is_none_or(|c| !solution.fit.problem.layout.columns[c].free);
        let determined =
            if !is_held && is_determined(offsets[reading], sigma, prior, prismatic) { "yes" } else { "no" };
        let folded = if context.offsets == Offsets::Folded { "yes" } else { "no" };
        let numbers = [offsets[reading], sigma].map(|v| format!("{:.6}", v * factor + 0.0));
        let [offset, sigma] = numbers;
        let sigma = if is_held { String::new() } else { sigma };
        rows.push(vec![name.clone(), offset, sigma, unit.into(), determined.into(), folded.into()]);
    }
    let note = match context.offsets {
        Offsets::Folded => {
            "# They are in the corrected URDF already (in_urdf = yes): entering them in the controller as well would count them twice.\n"
        }
        Offsets::Mastering => {
            "# They are not in the corrected URDF, which belongs to a controller with these offsets entered.\n"
        }
    };
    format!(
        "# Joint offsets for the mastering (zero point) table of the controller: where it shows the angle q, the joint stands at q + offset,\n\
         # so that after the correction it has to show q + offset. Not determined (no): known only together with base, tool\n\
         # or the origins beside it, or within twice its sigma of none and that sigma beyond 0.5 mrad (0.05 mm); leave it. Without a sigma: held, not estimated.\n{note}{}",
        to_csv(&rows)
    )
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
         # T = RotX(alpha_rad) TransX(a_m) RotZ(q + theta_offset_rad) TransZ(d_m) (prismatic: TransZ(d_m + q)); base and tip are full poses. {note}\n"
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

#[cfg(test)]
mod tests {
    use super::is_determined;

    #[test]
    fn an_offset_is_determined_where_entering_it_helps() {
        let determined = |offset: f64, sigma: f64| is_determined(offset.to_radians(), sigma.to_radians(), 10e-3, false);
        assert!(!determined(-0.0094, 0.132), "nothing beside its sigma");
        assert!(!determined(0.0, 0.57), "the prior alone");
        assert!(!determined(1.5, 0.5), "far from none, but the data say too little");
        assert!(determined(0.4, 0.13));
        assert!(determined(0.001, 0.02), "known to be none");
    }
}
