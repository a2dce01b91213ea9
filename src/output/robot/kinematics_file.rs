//! kinematics.yaml, in the layout that the robot's own description reads.
//!
//! A new layout is a row in [`recognised`] and an arm in [`Reader::head`].

use sha2::{Digest, Sha256};

use super::controller_files::postures;
use super::ur_frames::{self, along_z};
use crate::geom::Pose;
use crate::model::robot::Robot;
use crate::output::text::{key, number};
use crate::urdf::{Chain, JointKind, RobotDescription};

/// Joints of ur_description without prefix, and what its kinematics file calls them.
const UR: [(&str, &str); 6] = [
    ("shoulder", "shoulder_pan_joint"),
    ("upper_arm", "shoulder_lift_joint"),
    ("forearm", "elbow_joint"),
    ("wrist_1", "wrist_1_joint"),
    ("wrist_2", "wrist_2_joint"),
    ("wrist_3", "wrist_3_joint"),
];

/// Numbers of moving joints that the robots of xarm_description have.
const XARM: [usize; 3] = [7, 6, 5];

/// Directions and places nearer than this are the same; the numbers of many URDFs have five digits.
const SAME_RAD: f64 = 1e-4;
const SAME_M: f64 = 1e-6;

/// Loss (m) from which a file cannot stand for the corrected URDF.
const LOSS_M: f64 = 1e-6;

/// The flange of a robot of Universal Robots stands so far (m) from the axis of its second wrist joint: 82 mm of a UR5 to 154 mm of a UR20.
const FLANGE_OFF_WRIST_2_M: std::ops::Range<f64> = 0.05..0.17;

/// Robot descriptions (packages of ROS) that read a file of kinematics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Package {
    Ur,
    Franka,
    XArm,
}

/// What reads the file: its keys with the joints that they stand for, and what hangs behind the last of them there.
struct Reader {
    package: Package,
    keyed: Vec<(String, String)>,
    /// Pose behind the last joint that the package has nowhere else, and takes up in that joint.
    behind: Pose,
    /// The tip of the chain behind the last joint as the package has it, where it is fixed there.
    tip: Option<Pose>,
    /// How far along its axis the package has the frame of every one of them, m.
    slides: Vec<f64>,
}

/// Corrected origins of a robot in the layout that its own description reads, under the names of its joints where none does; `note`
/// says in the head how joint offsets are dealt with.
pub fn kinematics_yaml(robot: &Robot, description: &RobotDescription, note: &str) -> String {
    let Some(reader) = recognised(description, &robot.chain) else {
        let head = "# Corrected joint origins (m, rad) under the joint names of the URDF, for programs of your own: this is none of the robots whose description\n\
                    # reads a file of kinematics (ur_description with a flange tool0, franka_description, xarm_description). The URDF and the xacro file\n\
                    # beside it say the same.";
        let origins = robot.urdf_origins();
        let body: String = origins.iter().map(|(name, o)| entry("  ", name, o)).collect();
        return format!("{head} {note}\nkinematics:\n{body}");
    };
    let read = reader.origins(robot);
    let loss_m = reader.loss_m(robot, &read);
    let loss = match loss_m > LOSS_M {
        true => format!(
            "# WARNING: other joints were corrected, too, and have no place here: the flange is off by up to {:.3} mm. Use the corrected URDF.\n",
            1e3 * loss_m
        ),
        false => String::new(),
    };
    format!("{}\n# {note}\n{loss}{}", reader.head(), reader.body(&robot.chain, &read, description))
}

/// Which description reads the kinematics of this robot, by the names of its joints; all axes are z there.
fn recognised(description: &RobotDescription, chain: &Chain) -> Option<Reader> {
    let along_z = |name: &str| {
        let joint = chain.joints.iter().find(|j| j.name == name);
        joint.is_some_and(|j| j.kind == JointKind::Revolute && j.axis.z > 0.0 && j.axis.xy().norm() < SAME_RAD)
    };
    let first = |name: &str| {
        let of = |j: &crate::urdf::Joint| j.name.strip_suffix(name).map(str::to_owned);
        chain.joints.iter().find_map(of)
    };
    let numbered = |prefix: &str, count: usize| -> Vec<(String, String)> {
        (1..=count).map(|k| (format!("joint{k}"), format!("{prefix}joint{k}"))).collect()
    };
    let all_along_z = |keyed: &[(String, String)]| keyed.iter().all(|(_, joint)| along_z(joint));
    if let Some(prefix) = first(UR[0].1) {
        let keyed: Vec<_> = UR.iter().map(|(key, joint)| ((*key).to_owned(), format!("{prefix}{joint}"))).collect();
        let flange = Flange::of(description, chain, &prefix, &keyed[5].1).filter(|_| all_along_z(&keyed))?;
        let slides = vec![0.0; keyed.len()];
        let in_place = Reader { package: Package::Ur, keyed, behind: flange.behind, tip: flange.tip, slides };
        let nominal = <[Pose; 6]>::try_from(in_place.steps(chain)).ok()?;
        return ur_frames::slides(&nominal).map(|slides| Reader { slides: slides.into(), ..in_place });
    }
    let prefix = first("joint1")?;
    let franka = numbered(&prefix, 7);
    let last = format!("{prefix}joint8");
    if all_along_z(&franka) && description.fixed_joint(&last).is_some() {
        let keyed = franka.into_iter().chain([("joint8".to_owned(), last)]).collect();
        return Some(Reader::of_own_frames(Package::Franka, keyed));
    }
    let count = XARM.into_iter().find(|&count| all_along_z(&numbered(&prefix, count)))?;
    let (base, _) = description.joint_links(&format!("{prefix}joint1"))?;
    let keyed = numbered(&prefix, count);
    let of_xarm = base == format!("{prefix}link_base") && chain.readings.len() == count;
    of_xarm.then(|| Reader::of_own_frames(Package::XArm, keyed))
}

/// The flange of a robot of Universal Robots. In ur_description it is the frame of the last joint.
struct Flange {
    /// `wrist_from_flange`, which the last joint takes up.
    behind: Pose,
    /// `flange_from_tip`, where the tip of the chain is fixed to it.
    tip: Option<Pose>,
}

impl Flange {
    /// The link tool0; without one the frame of the last joint, or else the tip of the chain, where that stands as a flange does.
    fn of(description: &RobotDescription, chain: &Chain, prefix: &str, wrist_3: &str) -> Option<Self> {
        let (_, wrist) = description.joint_links(wrist_3)?;
        let tip = description.rigid_pose(wrist, &chain.tip);
        let own = format!("{prefix}tool0");
        let named = [own.as_str(), "tool0"].into_iter().find_map(|link| description.rigid_pose(wrist, link));
        let origin = chain.joints.iter().find(|j| j.name == wrist_3)?.origin;
        let is_flange = |behind: &Pose| FLANGE_OFF_WRIST_2_M.contains(&(origin * *behind).translation.xy().norm());
        let alike = description.links().filter(|link| link.ends_with("tool0"));
        let alike = alike.filter_map(|link| description.rigid_pose(wrist, link));
        let mut unnamed = alike.chain([Pose::identity()]).chain(tip);
        let behind = named.or_else(|| unnamed.find(is_flange)).filter(turns_about_z)?;
        let (angle, distance) = behind.distance(&Pose::identity());
        let behind = if angle < SAME_RAD && distance < SAME_M { Pose::identity() } else { behind };
        Some(Self { behind, tip: tip.map(|tip| behind.inverse() * tip) })
    }
}

/// True for a pose that a rotation about z can be exchanged with.
fn turns_about_z(pose: &Pose) -> bool {
    let tilt = pose.rotation.column(2).xy().norm();
    pose.rotation[(2, 2)] > 0.0 && tilt < SAME_RAD && pose.translation.xy().norm() < SAME_M
}

fn entry(indent: &str, name: &str, origin: &Pose) -> String {
    format!("{indent}{}:\n{}", key(name), numbers(&format!("{indent}  "), origin))
}

fn numbers(indent: &str, origin: &Pose) -> String {
    // `y` alone is a boolean in YAML 1.1, but a plain key in every file of these layouts.
    let named = ["x", "y", "z", "roll", "pitch", "yaw"].into_iter().zip(origin.xyz().into_iter().chain(origin.rpy()));
    named.map(|(name, value)| format!("{indent}{name}: {}\n", number(value))).collect()
}

impl Reader {
    /// Of a package whose frames are those of the URDF.
    fn of_own_frames(package: Package, keyed: Vec<(String, String)>) -> Self {
        Self { package, slides: vec![0.0; keyed.len()], keyed, behind: Pose::identity(), tip: None }
    }

    /// Nominal origins of the joints with a key, each in the frame of the one before.
    fn steps(&self, chain: &Chain) -> Vec<Pose> {
        let mut steps = Vec::new();
        let mut from_before = Pose::identity();
        for joint in &chain.joints {
            from_before = from_before * joint.origin;
            if self.key_of(&joint.name).is_some() {
                steps.push(std::mem::replace(&mut from_before, Pose::identity()));
            }
        }
        steps
    }

    fn key_of(&self, joint: &str) -> Option<usize> {
        self.keyed.iter().position(|(_, name)| name == joint)
    }

    /// Origins of the chain as the description will have them: those with a key take up the corrections of the fixed joints before
    /// them, which have none, and slide along their axes; all others are nominal.
    fn origins(&self, robot: &Robot) -> Vec<Pose> {
        let joints = &robot.chain.joints;
        let corrected = robot.corrected_origins();
        let mut read: Vec<Pose> = joints.iter().map(|j| j.origin).collect();
        let (mut nominal, mut moved, mut before_m) = (Pose::identity(), Pose::identity(), 0.0);
        for (k, joint) in joints.iter().enumerate() {
            let key = self.key_of(&joint.name);
            if let Some(key) = key {
                let slide_m = self.slides[key];
                read[k] = nominal.inverse() * along_z(-before_m) * moved * corrected[k] * along_z(slide_m);
                before_m = slide_m;
            }
            match key.is_some() || joint.drive.is_some() {
                true => (nominal, moved) = (Pose::identity(), Pose::identity()),
                false => (nominal, moved) = (nominal * joint.origin, moved * corrected[k]),
            }
        }
        read
    }

    /// How far the flange of the chain that the package makes of these origins is from that of the corrected URDF, at random postures.
    fn loss_m(&self, robot: &Robot, read: &[Pose]) -> f64 {
        let of = |origins: &[Pose]| {
            let mut chain = robot.chain.clone();
            chain.joints.iter_mut().zip(origins).for_each(|(j, o)| j.origin = *o);
            Robot::nominal(chain)
        };
        let (corrected, read) = (of(&robot.corrected_origins()), of(&self.of_package(&robot.chain, read)));
        let distances = postures(&robot.chain).map(|q| corrected.base_from_tip(&q).distance(&read.base_from_tip(&q)).1);
        distances.fold(0.0, f64::max)
    }

    /// Origins of the chain in the package: what is fixed behind the last joint stands there as the package has it.
    fn of_package(&self, chain: &Chain, read: &[Pose]) -> Vec<Pose> {
        let mut all = read.to_vec();
        let last = self.keyed.last().and_then(|(_, name)| chain.joints.iter().position(|j| j.name == *name));
        let (Some(last), Some(tip)) = (last, self.tip) else { return all };
        all[last] = read[last] * self.behind;
        match all.get_mut(last + 1..) {
            Some([first, others @ ..]) => {
                *first = tip;
                others.fill(Pose::identity());
            }
            // Turns about z may be exchanged.
            _ => all[last] = all[last] * tip,
        }
        all
    }

    /// The entries, those of joints beside the chain as the URDF has them.
    fn body(&self, chain: &Chain, read: &[Pose], description: &RobotDescription) -> String {
        let last_turning = self.keyed.len() - 1;
        let origin = |(index, (_, joint)): (usize, &(String, String))| {
            let found = chain.joints.iter().position(|j| j.name == *joint).map(|k| read[k]);
            let origin = found.or_else(|| description.fixed_joint(joint)).unwrap_or_else(Pose::identity);
            match index == last_turning {
                true => origin * self.behind,
                false => origin,
            }
        };
        let all = self.keyed.iter().enumerate().map(|e| (e.1.0.as_str(), origin(e)));
        match self.package {
            Package::Franka => all.map(|(key, o)| format!("{key}:\n  kinematic:\n{}", numbers("    ", &o))).collect(),
            Package::XArm => all.fold("kinematics:\n".to_owned(), |out, (key, o)| out + &entry("  ", key, &o)),
            Package::Ur => {
                let entries: String = all.map(|(key, o)| entry("  ", key, &o)).collect();
                let digest = Sha256::digest(entries.as_bytes());
                let hash: String = digest.iter().take(8).map(|byte| format!("{byte:02x}")).collect();
                format!("kinematics:\n{entries}  hash: robotcal_{hash}\n")
            }
        }
    }

    fn head(&self) -> &'static str {
        match self.package {
            Package::Ur => {
                "# Corrected joint origins (m, rad) as ur_description reads them: its argument kinematics_params names this file. The driver will say\n\
                 # that the hash is not that of the controller, whose own kinematics are others; it is that of these numbers."
            }
            Package::Franka => {
                "# Corrected joint origins (m, rad) as franka_description reads them: in the place of its robots/<robot>/kinematics.yaml."
            }
            Package::XArm => {
                "# Corrected joint origins (m, rad) as xarm_description reads them: save this as its config/kinematics/user/<robot>_kinematics_<suffix>.yaml\n\
                 # (<robot> as xarm6, lite6) and give kinematics_suffix:=<suffix>."
            }
        }
    }
}
