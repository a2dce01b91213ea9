//! Collision geometry of the links as capsules: spheres and cylinders as they are, boxes by a capsule around them.

use nalgebra::Vector3;
use roxmltree::{Document, Node};

use super::chain::Chain;
use super::elements::{child, numbers};
use super::read::{RobotDescription, without_undeclared_prefixes};
use crate::geom::Pose;

/// A capsule that a joint of the chain carries.
#[derive(Debug, Clone, PartialEq)]
pub struct CarriedCapsule {
    /// Link that it belongs to.
    pub link: String,
    /// Index in [`Chain::joints`] of the last joint before it; `None` for the base.
    pub joint: Option<usize>,
    /// Ends of its axis, in the child frame of that joint (or the base frame), m.
    pub ends_m: [Vector3<f64>; 2],
    /// Radius, m.
    pub radius_m: f64,
}

impl RobotDescription {
    /// Capsules around the collision geometry of all links that the chain carries, and the number of meshes that were passed
    /// over. Links beside the chain move with their own joints at zero; links above the base of the chain are left out.
    pub fn carried_capsules(&self, chain: &Chain) -> (Vec<CarriedCapsule>, usize) {
        let (mut capsules, mut meshes) = (Vec::new(), 0);
        // The text was parsed before; a second failure would be one of the parser.
        let Ok(plain) = without_undeclared_prefixes(&self.path, &self.text) else { return (capsules, meshes) };
        let Ok(document) = Document::parse(&plain) else { return (capsules, meshes) };
        for link in document.root_element().children().filter(|n| n.has_tag_name("link")) {
            let Some(name) = link.attribute("name") else { continue };
            let Some((joint, here_from_link)) = self.carrier(chain, name) else { continue };
            for collision in link.children().filter(|n| n.has_tag_name("collision")) {
                match capsule(collision) {
                    Some((ends, radius_m)) => capsules.push(CarriedCapsule {
                        link: name.to_owned(),
                        joint,
                        ends_m: ends.map(|e| here_from_link.transform(&e)),
                        radius_m,
                    }),
                    None => meshes += 1,
                }
            }
        }
        (capsules, meshes)
    }

    /// The joint of the chain that carries a link, and the link in its child frame; `None` for a link above the base.
    fn carrier(&self, chain: &Chain, link: &str) -> Option<(Option<usize>, Pose)> {
        let mut here_from_link = Pose::identity();
        let mut current = link;
        loop {
            if current == chain.base {
                return Some((None, here_from_link));
            }
            let parent = self.joint_to(current)?;
            if let Some(joint) = chain.joints.iter().position(|j| j.name == parent.name) {
                return Some((Some(joint), here_from_link));
            }
            here_from_link = parent.origin * here_from_link;
            current = &parent.parent;
        }
    }
}

/// Ends and radius in the link frame; `None` for a mesh and for numbers that are none.
fn capsule(collision: Node<'_, '_>) -> Option<([Vector3<f64>; 2], f64)> {
    let triple = |node: Option<Node<'_, '_>>, name: &str| -> [f64; 3] {
        let values = node.and_then(|n| n.attribute(name)).and_then(|text| numbers(text, 3));
        values.and_then(|v| <[f64; 3]>::try_from(v.as_slice()).ok()).unwrap_or([0.0; 3])
    };
    let origin = child(collision, "origin");
    let pose = Pose::from_xyz_rpy(triple(origin, "xyz"), triple(origin, "rpy"));
    let geometry = child(collision, "geometry")?;
    let one = |node: Node<'_, '_>, name: &str| node.attribute(name)?.trim().parse::<f64>().ok().filter(|v| *v >= 0.0);
    let (axis, radius_m) = if let Some(sphere) = child(geometry, "sphere") {
        (Vector3::zeros(), one(sphere, "radius")?)
    } else if let Some(cylinder) = child(geometry, "cylinder").or_else(|| child(geometry, "capsule")) {
        (Vector3::z() * (0.5 * one(cylinder, "length")?), one(cylinder, "radius")?)
    } else {
        let half = Vector3::from(triple(Some(child(geometry, "box")?), "size")) / 2.0;
        let longest = half.imax();
        let across = (half.norm_squared() - half[longest] * half[longest]).sqrt();
        let mut axis = Vector3::zeros();
        axis[longest] = half[longest];
        (axis, across)
    };
    Some(([pose.transform(&-axis), pose.transform(&axis)], radius_m))
}
