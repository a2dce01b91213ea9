//! The `<joint>` elements of a URDF, held against the text itself.
//!
//! `urdf-rs` fills what it cannot find with defaults and skips numbers that it cannot parse. Where that would give a
//! plausible wrong robot, the element is judged here on the XML and refused with its line.

use nalgebra::Vector3;
use roxmltree::Node;
use urdf_rs::JointType;

use crate::error::{Code, Error, Notice, Result, closest_name};
use crate::geom::Pose;

/// Elements that URDF knows below `<joint>`.
const KNOWN_CHILDREN: [&str; 9] =
    ["origin", "parent", "child", "axis", "limit", "mimic", "calibration", "dynamics", "safety_controller"];
/// Five turns, rad: no wrist with stops turns farther.
const MOST_RADIANS: f64 = 10.0 * std::f64::consts::PI;
/// Range of a joint that states no limits to both sides of zero, rad.
pub const UNLIMITED_RAD: f64 = std::f64::consts::PI;
/// Range of a slide that states none to both sides of zero, m.
pub const UNLIMITED_M: f64 = 0.5;
/// How far from zero a reading of such a slide is looked for, m.
pub const SEARCHED_M: f64 = 3.0;

/// Two turns, degrees; what is larger says that there is no limit.
const MOST_DEGREES: f64 = 720.0;
const TYPES: [&str; 7] = ["revolute", "continuous", "prismatic", "fixed", "floating", "planar", "spherical"];

/// One joint as the file states it.
#[derive(Debug, Clone)]
pub(super) struct JointElement {
    pub name: String,
    pub joint_type: JointType,
    pub parent: String,
    pub child: String,
    /// `parent_from_joint`.
    pub origin: Pose,
    /// Unit axis; zero where the joint does not move along or about one.
    pub axis: Vector3<f64>,
    pub limits: Option<(f64, f64)>,
    /// URDF demands limits of it, and none are stated.
    pub is_unlimited: bool,
    pub mimic: Option<MimicElement>,
    /// `file:line` of the element.
    pub place: String,
}

/// `position = multiplier * position of joint + offset`.
#[derive(Debug, Clone)]
pub(super) struct MimicElement {
    pub joint: String,
    pub multiplier: f64,
    pub offset: f64,
}

/// The XML of one file, for messages with lines.
pub(super) struct Source<'a> {
    pub file: String,
    pub document: &'a roxmltree::Document<'a>,
    /// Bytes at which lines end.
    pub line_ends: Vec<usize>,
    /// `quat_xyzw` counts from URDF 1.1 on.
    pub has_quaternions: bool,
}

impl Source<'_> {
    /// `file:line` of a node.
    pub fn place(&self, node: Node<'_, '_>) -> String {
        format!("{}:{}", self.file, self.line(node))
    }

    /// Line of a node, from 1.
    pub fn line(&self, node: Node<'_, '_>) -> u32 {
        1 + self.line_ends.partition_point(|end| *end < node.range().start) as u32
    }

    fn refuse(&self, code: Code, node: Node<'_, '_>, joint: &str, what: String, remedy: &str) -> Error {
        Error::new(code, format!("{}, joint \"{joint}\"", self.place(node)), what, remedy)
    }

    /// Checks the text of a joint before `urdf-rs` reads it.
    pub fn check(&self, node: Node<'_, '_>) -> Result<()> {
        let name = node.attribute("name").unwrap_or_default();
        if name.trim().is_empty() {
            return Err(Error::new(
                Code::UrdfElement,
                self.place(node),
                "a <joint> without a name",
                "give the joint a name",
            ));
        }
        match node.attribute("type") {
            Some(kind) if TYPES.contains(&kind) => {}
            kind => {
                let there = kind.map_or_else(|| "no joint type".to_owned(), |kind| format!("joint type \"{kind}\""));
                let what = format!("{there}: there are {}", TYPES.join(", "));
                let meant = kind.and_then(|kind| closest_name(kind, TYPES));
                let remedy =
                    meant.map_or_else(|| "state one of them".to_owned(), |meant| format!("write type=\"{meant}\""));
                return Err(self.refuse(Code::UrdfElement, node, name, what, &remedy));
            }
        }
        self.check_children(node, name)?;
        for (element, attribute) in [("parent", "link"), ("child", "link")] {
            let found = child(node, element).and_then(|n| n.attribute(attribute));
            if found.is_none_or(str::is_empty) {
                let what = format!("no <{element} {attribute}=\"...\"/>");
                return Err(self.refuse(Code::UrdfElement, node, name, what, "name the link"));
            }
        }
        Ok(())
    }

    fn check_children(&self, joint: Node<'_, '_>, name: &str) -> Result<()> {
        for element in joint.children().filter(Node::is_element) {
            let tag = element.tag_name().name();
            if !KNOWN_CHILDREN.contains(&tag) {
                if let Some(meant) = closest_name(tag, ["origin", "axis", "mimic", "limit"]) {
                    let what = format!("unknown element <{tag}>, and without <{meant}> a default would be used");
                    return Err(self.refuse(
                        Code::UrdfElement,
                        element,
                        name,
                        what,
                        &format!("write <{meant}> if that is meant"),
                    ));
                }
                continue;
            }
            if child(joint, tag) != Some(element) {
                let what = format!("<{tag}> stands twice");
                return Err(self.refuse(Code::UrdfTwice, element, name, what, "remove the one that does not hold"));
            }
            self.check_attributes(element, name)?;
        }
        Ok(())
    }

    fn check_attributes(&self, element: Node<'_, '_>, joint: &str) -> Result<()> {
        let tag = element.tag_name().name();
        let known: &[(&str, usize)] = match tag {
            "origin" => &[("xyz", 3), ("rpy", 3), ("quat_xyzw", 4)],
            "axis" => &[("xyz", 3)],
            "limit" => &[("lower", 1), ("upper", 1)],
            "mimic" => &[("multiplier", 1), ("offset", 1)],
            _ => return Ok(()),
        };
        for attribute in element.attributes() {
            let (key, value) = (attribute.name(), attribute.value());
            match known.iter().find(|(name, _)| *name == key) {
                Some((_, count)) if numbers(value, *count).is_none() => {
                    let what = format!("{tag} {key}=\"{value}\" is not {count} finite number(s) separated by blanks");
                    return Err(self.refuse(
                        Code::UrdfNumber,
                        element,
                        joint,
                        what,
                        "correct the numbers (point as decimal mark)",
                    ));
                }
                None if matches!(tag, "origin" | "axis") || is_misspelt_mimic(tag, key) => {
                    let what = format!("<{tag}> has an unknown attribute {key}=\"{value}\"");
                    let names = known.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
                    return Err(self.refuse(Code::UrdfElement, element, joint, what, &format!("known are {names}")));
                }
                _ => {}
            }
        }
        if tag == "origin" && element.has_attribute("quat_xyzw") {
            self.check_quaternion(element, joint)?;
        }
        Ok(())
    }

    fn check_quaternion(&self, origin: Node<'_, '_>, joint: &str) -> Result<()> {
        if !self.has_quaternions {
            let what = "quat_xyzw counts only from URDF 1.1 on, older files mean no rotation by it".to_string();
            return Err(self.refuse(
                Code::UrdfRotation,
                origin,
                joint,
                what,
                "write <robot version=\"1.1\"> or use rpy",
            ));
        }
        if origin.has_attribute("rpy") {
            let what = "both rpy and quat_xyzw are given".to_string();
            return Err(self.refuse(Code::UrdfTwice, origin, joint, what, "remove the one that does not hold"));
        }
        let norm = origin.attribute("quat_xyzw").and_then(|q| numbers(q, 4)).map_or(0.0, |q| norm(&q));
        if (norm - 1.0).abs() > 1e-3 {
            let what = format!("quat_xyzw has the norm {norm}, not 1");
            return Err(self.refuse(Code::UrdfRotation, origin, joint, what, "correct the quaternion (order x y z w)"));
        }
        Ok(())
    }

    /// Joins what `urdf-rs` read with what only the text tells.
    pub fn joint(&self, node: Node<'_, '_>, read: &urdf_rs::Joint, notices: &mut Vec<Notice>) -> Result<JointElement> {
        let place = self.place(node);
        if node.attribute("name") != Some(read.name.as_str()) {
            let what = format!("two readers disagree on the name of this joint (\"{}\")", read.name);
            return Err(Error::new(Code::UrdfSyntax, place, what, "write the name without XML entities"));
        }
        let origin = match child(node, "origin").and_then(|o| o.attribute("quat_xyzw")).and_then(|q| numbers(q, 4)) {
            Some(q) => Pose::from_xyz_quaternion(read.origin.xyz.0, [q[0], q[1], q[2], q[3]]),
            None => Pose::from_xyz_rpy(read.origin.xyz.0, read.origin.rpy.0),
        };
        let at = || format!("{place}, joint \"{}\"", read.name);
        if read.origin.rpy.0.iter().any(|a| a.abs() > 2.0 * std::f64::consts::PI + 0.01) {
            let what = format!("rpy {:?} exceeds a full turn; URDF angles are radians", read.origin.rpy.0);
            notices.push(Notice::new(Code::UrdfAngleUnit, at(), what, "convert degrees to radians"));
        }
        Ok(JointElement {
            axis: self.axis(node, read, notices)?,
            limits: limits(node, read, &at, notices),
            is_unlimited: needs_limits(read) && read.mimic.is_none() && stated_limit(node).is_none(),
            mimic: read.mimic.as_ref().map(|m| MimicElement {
                joint: m.joint.clone(),
                multiplier: m.multiplier.unwrap_or(1.0),
                offset: m.offset.unwrap_or(0.0),
            }),
            name: read.name.clone(),
            joint_type: read.joint_type.clone(),
            parent: read.parent.link.clone(),
            child: read.child.link.clone(),
            origin,
            place,
        })
    }

    fn axis(&self, node: Node<'_, '_>, read: &urdf_rs::Joint, notices: &mut Vec<Notice>) -> Result<Vector3<f64>> {
        if !matches!(read.joint_type, JointType::Revolute | JointType::Continuous | JointType::Prismatic) {
            return Ok(Vector3::zeros());
        }
        let place = || format!("{}, joint \"{}\"", self.place(node), read.name);
        if child(node, "axis").is_none_or(|a| !a.has_attribute("xyz")) {
            let what = "moves but states no axis; URDF means 1 0 0 by that";
            notices.push(Notice::new(
                Code::UrdfAxis,
                place(),
                what,
                "write <axis xyz=\"...\"/> if another axis is meant",
            ));
        }
        let axis = Vector3::from(read.axis.xyz.0);
        let norm = axis.norm();
        if norm < 1e-9 {
            let remedy = "state the axis of motion, for example 0 0 1";
            return Err(self.refuse(
                Code::UrdfAxis,
                node,
                &read.name,
                format!("its axis {:?} is zero", read.axis.xyz.0),
                remedy,
            ));
        }
        if (norm - 1.0).abs() > 1e-6 {
            let what = format!("its axis {:?} has the length {norm}; the direction alone is used", read.axis.xyz.0);
            notices.push(Notice::new(Code::UrdfAxis, place(), what, "write a unit vector"));
        }
        Ok(axis / norm)
    }
}

/// True for an attribute of `<mimic>` that nearly is one that would count.
fn is_misspelt_mimic(tag: &str, key: &str) -> bool {
    tag == "mimic" && key != "joint" && closest_name(key, ["multiplier", "offset"]).is_some()
}

/// Whether URDF demands limits of a joint.
fn needs_limits(read: &urdf_rs::Joint) -> bool {
    matches!(read.joint_type, JointType::Revolute | JointType::Prismatic)
}

/// The `<limit>` of a joint that limits its range.
fn stated_limit<'a, 'i>(joint: Node<'a, 'i>) -> Option<Node<'a, 'i>> {
    child(joint, "limit").filter(|element| element.has_attribute("lower") || element.has_attribute("upper"))
}

/// Limits where they mean something: not for continuous joints, not the pair 0, 0 that defaults and CAD exports leave.
fn limits(
    node: Node<'_, '_>,
    read: &urdf_rs::Joint,
    place: &impl Fn() -> String,
    notices: &mut Vec<Notice>,
) -> Option<(f64, f64)> {
    let element = stated_limit(node).filter(|_| needs_limits(read))?;
    let bound = |key: &str| element.attribute(key).and_then(|v| numbers(v, 1)).map_or(0.0, |v| v[0]);
    let (lower, upper) = (bound("lower"), bound("upper"));
    if lower < upper {
        let farthest = upper.max(-lower);
        if read.joint_type == JointType::Revolute && farthest > MOST_RADIANS && farthest <= MOST_DEGREES {
            let what = format!(
                "its limits, lower {lower} and upper {upper}, are more than five turns; URDF angles are radians"
            );
            notices.push(Notice::new(Code::UrdfAngleUnit, place(), what, "convert degrees to radians"));
        }
        return Some((lower, upper));
    }
    let what = format!("its limits, lower {lower} and upper {upper}, leave no room to move and are not used");
    notices.push(Notice::new(Code::UrdfLimits, place(), what, "correct the <limit>"));
    None
}

/// First child element of that name.
pub(super) fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|n| n.is_element() && n.tag_name().name() == name)
}

/// A name within double quotes of XML.
pub(super) fn escaped(name: &str) -> String {
    name.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

/// Exactly `count` finite numbers separated by blanks.
pub(super) fn numbers(text: &str, count: usize) -> Option<Vec<f64>> {
    let values: Vec<f64> = text.split_whitespace().map(|t| t.parse().ok()).collect::<Option<_>>()?;
    (values.len() == count && values.iter().all(|v| v.is_finite())).then_some(values)
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum::<f64>().sqrt()
}
