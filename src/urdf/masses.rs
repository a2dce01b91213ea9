//! Masses of the links, for gravity terms.

use nalgebra::Vector3;
use roxmltree::Node;

use super::chain::Chain;
use super::elements::{Source, child, numbers};
use super::read::RobotDescription;
use crate::geom::Pose;
use crate::{Error, Result};

/// Mass of a link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertial {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the link frame, m.
    pub centre_m: Vector3<f64>,
}

/// A mass that a joint of the chain carries rigidly with its child link.
#[derive(Debug, Clone, PartialEq)]
pub struct CarriedMass {
    /// Link whose mass it is.
    pub link: String,
    /// Index in [`Chain::joints`] of the last joint before it; all joints up to there bear it.
    pub joint: usize,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the child frame of that joint, m; joints beside the chain stand at zero.
    pub centre_m: Vector3<f64>,
}

impl RobotDescription {
    /// Every mass that the joints of a chain of this robot carry, grippers and other side branches included (their own
    /// joints at position zero). Links before the first joint of the chain carry nothing and are left out.
    pub fn carried_masses(&self, chain: &Chain) -> Vec<CarriedMass> {
        let mut carried = Vec::new();
        for (link, inertial) in self.inertials.iter().filter(|(_, i)| i.mass_kg > 0.0) {
            let mut here_from_link = Pose::identity();
            let mut current = link.as_str();
            while let Some(parent) = self.joint_to(current) {
                if let Some(joint) = chain.joints.iter().position(|j| j.name == parent.name) {
                    let centre_m = here_from_link.transform(&inertial.centre_m);
                    carried.push(CarriedMass { link: link.clone(), joint, mass_kg: inertial.mass_kg, centre_m });
                    break;
                }
                here_from_link = parent.origin * here_from_link;
                current = &parent.parent;
            }
        }
        carried
    }
}

/// The `<inertial>` of a link; `None` where there is none (`urdf-rs` would say zero).
pub(super) fn inertial(source: &Source<'_>, node: Node<'_, '_>, link: &urdf_rs::Link) -> Result<Option<Inertial>> {
    let Some(element) = child(node, "inertial") else { return Ok(None) };
    let place = || format!("{}, link \"{}\"", source.place(element), link.name);
    if let Some(xyz) = child(element, "origin").and_then(|o| o.attribute("xyz"))
        && numbers(xyz, 3).is_none()
    {
        let what = format!("centre of mass \"{xyz}\" is not 3 finite numbers");
        return Err(Error::input(place(), what, "correct the numbers (point as decimal mark)"));
    }
    let mass_kg = link.inertial.mass.value;
    if !(mass_kg >= 0.0 && mass_kg.is_finite()) {
        return Err(Error::input(place(), format!("mass {mass_kg} kg"), "a mass is zero or positive"));
    }
    Ok(Some(Inertial { mass_kg, centre_m: link.inertial.origin.xyz.0.into() }))
}
