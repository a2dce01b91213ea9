//! The tree of links, and chains through it.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use urdf_rs::JointType;

use super::chain::{Chain, Drive, Joint, JointKind};
use super::elements::JointElement;
use super::read::{RobotDescription, suggest};
use super::tips::listed;
use crate::error::{Code, Error, Result};
use crate::geom::Pose;

/// Links of an arm together are shorter, m; the smallest arms in millimetres are longer.
const LONGEST_ARM_M: f64 = 50.0;

/// Joints of a chain, fixed ones included; no arm has as many.
const MOST_JOINTS: usize = 256;

impl RobotDescription {
    /// Names of all links, in the order of the file.
    pub fn links(&self) -> impl Iterator<Item = &str> + Clone {
        self.links.iter().map(String::as_str)
    }

    /// The chain of joints from `base` (default: the root) to `tip` (default: the only leaf; of several the one that all
    /// moving joints lie before, `tool0` before `flange` before others, see [`RobotDescription::tip_notice`]).
    ///
    /// The base need not be above the tip: a link that hangs on one by fixed joints, as `base` of ur_description does on
    /// `base_link`, will do, and so will one that joints carry beside the arm, as a positioner or another arm does ([`Joint::upwards`]).
    ///
    /// A mimic joint is driven by the joint that it follows, inside the chain or not: `Chain::readings` has the
    /// name of that joint.
    ///
    /// # Errors
    /// Unknown links, several roots or leaves without a choice, a base that is not rigidly above the tip, joints of a type
    /// that has no single reading (floating, planar, spherical), mimic joints that lead nowhere, lengths in millimetres.
    pub fn chain(&self, base: Option<&str>, tip: Option<&str>) -> Result<Chain> {
        let base = match base {
            Some(name) => self.known_link(name, "base")?,
            None => self.only_root()?,
        };
        let tip = match tip {
            Some(name) => self.known_link(name, "tip")?,
            None => self.default_tip(base)?,
        };
        let mut chain =
            Chain { robot: self.name.clone(), base: base.to_string(), tip: tip.to_string(), ..Chain::empty() };
        let (up, down) = self.path(base, tip)?;
        let impossible = |what: String, remedy| Error::new(Code::ChainImpossible, self.path.display(), what, remedy);
        if up.len() + down.len() > MOST_JOINTS {
            let what = format!("has {} joints between \"{base}\" and \"{tip}\"", up.len() + down.len());
            return Err(impossible(what, "choose a base and a tip of the arm alone"));
        }
        for element in up {
            let motion = self.chain_joint(element, &mut chain)?;
            chain.joints.extend(upwards(motion));
        }
        for element in down {
            let joint = self.chain_joint(element, &mut chain)?;
            chain.joints.push(joint);
        }
        if chain.readings.is_empty() {
            let what = format!("no joint moves between \"{base}\" and \"{tip}\"");
            return Err(impossible(what, "choose another base or tip link"));
        }
        self.refuse_millimetres(&chain)?;
        chain.masses = self.stated_masses(&chain);
        let is_beside = |j: &&JointElement| j.joint_type != JointType::Fixed && !chain.readings.contains(&j.name);
        let beside = || self.joints.iter().filter(is_beside);
        chain.beside = beside().map(|j| j.name.clone()).collect();
        let carried = self.carried_by(tip);
        chain.behind_tip = beside().filter(|j| carried.contains(j.parent.as_str())).map(|j| j.name.clone()).collect();
        Ok(chain)
    }

    /// The first joint that moves may stand anywhere in a hall; from there on it is the arm.
    fn refuse_millimetres(&self, chain: &Chain) -> Result<()> {
        let arm = chain.joints.iter().skip_while(|j| j.drive.is_none()).skip(1);
        let length: f64 = arm.map(|j| j.origin.translation.norm()).sum();
        if length < LONGEST_ARM_M {
            return Ok(());
        }
        let what =
            format!("the links between \"{}\" and \"{}\" are {length:.0} m long together", chain.base, chain.tip);
        let remedy =
            "a URDF has metres: if these are millimetres, divide the xyz of all origins by 1000 (and scale the meshes)";
        Err(Error::new(Code::UrdfLengthUnit, self.path.display(), what, remedy))
    }

    /// The links that a link carries by joints, itself among them.
    fn carried_by<'a>(&'a self, link: &'a str) -> BTreeSet<&'a str> {
        let mut below: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        self.joints.iter().for_each(|j| below.entry(&j.parent).or_default().push(&j.child));
        let (mut carried, mut next) = (BTreeSet::new(), vec![link]);
        while let Some(link) = next.pop() {
            if carried.insert(link) {
                next.extend(below.get(link).into_iter().flatten());
            }
        }
        carried
    }

    /// The joint above a link.
    pub(super) fn joint_to(&self, link: &str) -> Option<&JointElement> {
        self.joint_above.get(link).map(|k| &self.joints[*k])
    }

    /// Parent and child link of a joint.
    pub fn joint_links(&self, joint: &str) -> Option<(&str, &str)> {
        self.joints.iter().find(|j| j.name == joint).map(|j| (j.parent.as_str(), j.child.as_str()))
    }

    /// `parent_from_joint` of a joint that is fixed.
    pub fn fixed_joint(&self, joint: &str) -> Option<Pose> {
        self.joints.iter().find(|j| j.name == joint && j.joint_type == JointType::Fixed).map(|j| j.origin)
    }

    /// `above_from_link` of a link that hangs on another by fixed joints.
    pub fn rigid_pose(&self, above: &str, link: &str) -> Option<Pose> {
        let mut pose = Pose::identity();
        let mut current = link;
        let mut fixed = self.fixed_ancestors(link);
        while current != above {
            let joint = fixed.next()?;
            pose = joint.origin * pose;
            current = &joint.parent;
        }
        Some(pose)
    }

    /// Known links, one parent each, no loops.
    pub(super) fn check_tree(&self) -> Result<()> {
        let links: BTreeSet<&str> = self.links().collect();
        if links.is_empty() {
            return Err(Error::new(
                Code::UrdfElement,
                self.path.display(),
                "has no links",
                "give a URDF that describes a robot",
            ));
        }
        let mut parents: BTreeMap<&str, &JointElement> = BTreeMap::new();
        for joint in &self.joints {
            let place = || format!("{}, joint \"{}\"", joint.place, joint.name);
            for link in [&joint.parent, &joint.child] {
                if !links.contains(link.as_str()) {
                    let what = format!("names the link \"{link}\", which does not exist");
                    return Err(Error::new(Code::LinkUnknown, place(), what, suggest(link, self.links())));
                }
            }
            if let Some(other) = parents.insert(&joint.child, joint) {
                let what = format!("link \"{}\" has a second parent (the first by \"{}\")", joint.child, other.name);
                return Err(Error::new(Code::TreeBroken, place(), what, "a URDF is a tree: remove one of the joints"));
            }
        }
        // Links that a root is known to be above.
        let mut rooted: BTreeSet<&str> = BTreeSet::new();
        for link in &links {
            let (mut current, mut way) = (*link, BTreeSet::new());
            while let Some(joint) = parents.get(current).filter(|_| !rooted.contains(current)) {
                if !way.insert(current) {
                    let what = format!("links form a loop through \"{current}\"");
                    let place = format!("{}, joint \"{}\"", joint.place, joint.name);
                    return Err(Error::new(
                        Code::TreeBroken,
                        place,
                        what,
                        "a URDF is a tree: remove the joint that closes the loop",
                    ));
                }
                current = &joint.parent;
            }
            rooted.extend(way);
        }
        Ok(())
    }

    /// The link above `tip` on which `base` is fixed, and `link_from_base`: a frame like `base` of ur_description, beside the arm.
    /// `None` where joints that move lie between, or the links are not there.
    pub fn fixed_base(&self, base: &str, tip: &str) -> Option<(&str, Pose)> {
        let tip = self.links().find(|l| *l == tip)?;
        let above = self.ancestors(tip);
        let mut current = self.links().find(|l| *l == base)?;
        let mut pose = Pose::identity();
        while !above.contains(&current) {
            let joint = self.joint_to(current).filter(|j| j.joint_type == JointType::Fixed)?;
            pose = joint.origin * pose;
            current = &joint.parent;
        }
        Some((current, pose))
    }

    /// A link and all links below it, with the number of moving joints between.
    pub(super) fn below<'a>(&'a self, top: &'a str) -> BTreeMap<&'a str, usize> {
        let mut children: BTreeMap<&str, Vec<&JointElement>> = BTreeMap::new();
        for joint in &self.joints {
            children.entry(&joint.parent).or_default().push(joint);
        }
        let mut found = BTreeMap::from([(top, 0)]);
        let mut waiting = vec![(top, 0)];
        while let Some((link, moving)) = waiting.pop() {
            for joint in children.get(link).into_iter().flatten() {
                let moving = moving + usize::from(joint.joint_type != JointType::Fixed);
                found.insert(&joint.child, moving);
                waiting.push((&joint.child, moving));
            }
        }
        found
    }

    pub(super) fn known_link(&self, name: &str, role: &str) -> Result<&str> {
        self.links().find(|l| *l == name).ok_or_else(|| {
            let what =
                format!("has no link \"{name}\" (wanted as {role}, or as the link of camera or plate in its place)");
            Error::new(Code::LinkUnknown, self.path.display(), what, suggest(name, self.links()))
        })
    }

    pub(super) fn only_root(&self) -> Result<&str> {
        let roots = self.roots();
        if let [one] = roots[..] {
            return Ok(one);
        }
        let what = format!("has {} root links: {}", roots.len(), listed(&roots));
        Err(Error::new(
            Code::RootAmbiguous,
            self.path.display(),
            what,
            "name one: base = \"...\" in series.toml or --base",
        ))
    }

    pub(super) fn roots(&self) -> Vec<&str> {
        self.links().filter(|l| self.joint_to(l).is_none()).collect()
    }

    /// Links above `link`, nearest first.
    pub(super) fn ancestors<'a>(&'a self, link: &'a str) -> Vec<&'a str> {
        let up = |l: &&'a str| self.joint_to(l).map(|j| j.parent.as_str());
        std::iter::successors(up(&link), up).collect()
    }

    /// Joints from `base` up to the first link that is above the tip, then joints down to `tip`. A tip that no joint moves on
    /// its own way, as where base and tip are exchanged, is refused.
    fn path<'a>(&'a self, base: &'a str, tip: &'a str) -> Result<(Vec<&'a JointElement>, Vec<&'a JointElement>)> {
        let above = self.ancestors(tip);
        let reaches = |link: &str| link == tip || above.contains(&link);
        let climb: Vec<&JointElement> = self.joints_above(base).collect();
        let links: Vec<&str> = std::iter::once(base).chain(climb.iter().map(|j| j.parent.as_str())).collect();
        let moves = |joint: &JointElement| joint.joint_type != JointType::Fixed;
        let is_carried = |climbed: usize| climb[..climbed].iter().any(|j| moves(j));
        let tip_moves = |from: &str| self.joints_above(tip).take_while(|j| j.child != from).any(moves);
        let met = links.iter().position(|l| reaches(l));
        let Some(climbed) = met.filter(|&k| !is_carried(k) || tip_moves(links[k])) else {
            let what = format!("tip \"{tip}\" does not hang below base \"{base}\"");
            let remedy = match above[..] {
                [] => format!("\"{tip}\" is the root itself; are base and tip exchanged?"),
                _ => format!("links above the tip are: {}", above.join(", ")),
            };
            return Err(Error::new(Code::ChainImpossible, self.path.display(), what, remedy));
        };
        let mut down = Vec::new();
        let mut current = tip;
        while let Some(joint) = self.joint_to(current).filter(|_| current != links[climbed]) {
            down.push(joint);
            current = &joint.parent;
        }
        down.reverse();
        Ok((climb[..climbed].to_vec(), down))
    }

    fn chain_joint(&self, element: &JointElement, chain: &mut Chain) -> Result<Joint> {
        let kind = kind(element)?;
        let drive = (kind != JointKind::Fixed).then(|| self.drive(element, chain)).transpose()?;
        Ok(Joint {
            name: element.name.clone(),
            kind,
            origin: element.origin,
            axis: if kind == JointKind::Fixed { Vector3::zeros() } else { element.axis },
            limits: element.limits,
            drive,
            upwards: false,
            found: None,
        })
    }

    /// Follows mimic joints to the one that is read, and registers its reading.
    fn drive(&self, element: &JointElement, chain: &mut Chain) -> Result<Drive> {
        let (mut multiplier, mut offset) = (1.0, 0.0);
        let mut driver = element;
        let mut followed = BTreeSet::new();
        while let Some(mimic) = &driver.mimic {
            let place = format!("{}, joint \"{}\"", driver.place, driver.name);
            if !followed.insert(&driver.name) {
                let what = "mimic joints follow each other in a loop";
                return Err(Error::new(Code::MimicBroken, place, what, "let one of them move by itself"));
            }
            // q = m (m' r + o') + o
            offset += multiplier * mimic.offset;
            multiplier *= mimic.multiplier;
            driver = self.joints.iter().find(|j| j.name == mimic.joint).ok_or_else(|| {
                let what = format!("mimics \"{}\", which does not exist", mimic.joint);
                Error::new(
                    Code::MimicBroken,
                    place,
                    what,
                    suggest(&mimic.joint, self.joints.iter().map(|j| j.name.as_str())),
                )
            })?;
        }
        let kind = kind(driver)?;
        if kind == JointKind::Fixed {
            let place = format!("{}, joint \"{}\"", element.place, element.name);
            let what = format!("mimics \"{}\", which is fixed", driver.name);
            return Err(Error::new(Code::MimicBroken, place, what, "name a joint that moves"));
        }
        let known = chain.readings.iter().position(|r| *r == driver.name);
        let reading = known.unwrap_or_else(|| {
            chain.readings.push(driver.name.clone());
            chain.reading_kinds.push(kind);
            chain.readings.len() - 1
        });
        Ok(Drive { reading, multiplier, offset })
    }
}

/// The entries of a joint of the way up from the base: its motion where it moves, then its origin.
fn upwards(joint: Joint) -> impl Iterator<Item = Joint> {
    let origin = Joint {
        name: joint.name.clone(),
        kind: JointKind::Fixed,
        origin: joint.origin.inverse(),
        axis: Vector3::zeros(),
        limits: None,
        drive: None,
        upwards: true,
        found: None,
    };
    let moves = joint.drive.is_some();
    let motion = Joint { origin: Pose::identity(), axis: -joint.axis, upwards: true, ..joint };
    moves.then_some(motion).into_iter().chain([origin])
}

fn kind(element: &JointElement) -> Result<JointKind> {
    match element.joint_type {
        JointType::Fixed => Ok(JointKind::Fixed),
        JointType::Revolute | JointType::Continuous => Ok(JointKind::Revolute),
        JointType::Prismatic => Ok(JointKind::Prismatic),
        JointType::Floating | JointType::Planar | JointType::Spherical => {
            let place = format!("{}, joint \"{}\"", element.place, element.name);
            let what = format!("is {:?} and has no single reading", element.joint_type).to_lowercase();
            let (above, below) = (&element.parent, &element.child);
            let remedy = format!(
                "choose a base below it, for example base = \"{below}\", or a tip before it, tip = \"{above}\""
            );
            Err(Error::new(Code::ChainImpossible, place, what, remedy))
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::urdf::RobotDescription;

    #[test]
    fn what_hangs_behind_the_tip_moves_nothing_beside_the_arm() {
        let joint = |(name, from, to): (&str, &str, &str)| {
            format!(
                "<joint name='{name}' type='revolute'><parent link='{from}'/><child link='{to}'/><origin xyz='0 0 0.3'/>\
                 <axis xyz='0 0 1'/><limit lower='-3' upper='3' effort='0' velocity='0'/></joint>"
            )
        };
        let joints = [
            ("a1", "base", "arm"),
            ("a2", "arm", "tool0"),
            ("finger", "tool0", "f"),
            ("nail", "f", "n"),
            ("table", "base", "t"),
        ];
        let links: String = ["base", "arm", "tool0", "f", "n", "t"].map(|l| format!("<link name='{l}'/>")).concat();
        let text = format!("<robot name='r'>{links}{}</robot>", joints.map(joint).concat());
        let robot = RobotDescription::from_text(Path::new("r.urdf"), text).unwrap();
        let chain = robot.chain(Some("base"), Some("tool0")).unwrap();
        assert_eq!(chain.beside, ["finger", "nail", "table"]);
        assert_eq!(chain.beside_arm().collect::<Vec<_>>(), ["table"]);
    }
}
