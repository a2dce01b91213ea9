//! Masses of the links, for gravity terms.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::chain::{CarriedMass, Chain, JointKind};
use super::read::RobotDescription;
use crate::error::{Code, Error, Result};
use crate::geom::Pose;

/// What the tip carries beside the links of the URDF: tool, camera, workpiece.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Payload {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the frame of the tip link, m.
    pub centre_m: [f64; 3],
}

/// Name of the payload among the carried masses.
const PAYLOAD: &str = "payload";

/// Mass (kg) that the joints of an arm carry at least; a URDF that states less leaves its masses out.
const LEAST_CARRIED_KG: f64 = 1.0;

/// How far a centre of mass may be from the tip link, m.
const FARTHEST_PAYLOAD_M: f64 = 3.0;

/// Share of the greatest length that a joint carries from which it carries the arm.
const OF_THE_ARM: f64 = 1.0 / 3.0;

/// Fewest links whose masses, all the same, are placeholders.
const ALIKE: usize = 3;

impl Chain {
    /// The chain with a payload in place of the one that it had; as it is where none is stated.
    ///
    /// # Errors
    /// A mass or a centre that is none or in other units, and a URDF that states no masses: the payload alone says little of the moments.
    pub fn carrying(mut self, payload: Option<&Payload>) -> Result<Self> {
        let Some(payload) = payload else { return Ok(self) };
        let refuse = |code, what: String, remedy: &str| Err(Error::new(code, "payload", what, remedy));
        if !(payload.mass_kg >= 0.0 && payload.mass_kg.is_finite()) || payload.centre_m.iter().any(|x| !x.is_finite()) {
            return refuse(
                Code::PayloadRange,
                format!("{} kg at {:?} m", payload.mass_kg, payload.centre_m),
                "give a mass and three numbers",
            );
        }
        if Vector3::from(payload.centre_m).norm() > FARTHEST_PAYLOAD_M {
            let what = format!("its centre of mass lies at {:?} m in the frame of the tip link", payload.centre_m);
            return refuse(Code::PayloadRange, what, "give centre_m in metres, not millimetres");
        }
        self.masses.retain(|m| m.link != PAYLOAD);
        let Some(joint) = self.joints.len().checked_sub(1).filter(|_| !self.masses.is_empty()) else {
            let what =
                "the URDF states no masses of its links, without which a payload does not give the moments of gravity";
            return refuse(
                Code::UrdfMassesMissing,
                what.into(),
                "leave the payload out, or add <inertial> to the links",
            );
        };
        let links: f64 = self.masses.iter().map(|m| m.mass_kg).sum();
        if payload.mass_kg > links {
            let what = format!("{} kg, more than the moving links of the arm ({links:.1} kg)", payload.mass_kg);
            return refuse(
                Code::PayloadRange,
                what,
                "give mass_kg in kilograms, not grams; or correct the masses in the URDF",
            );
        }
        self.masses.push(CarriedMass {
            link: PAYLOAD.into(),
            joint,
            mass_kg: payload.mass_kg,
            centre_m: payload.centre_m.into(),
        });
        Ok(self)
    }

    /// The payload, where one was stated.
    pub fn payload(&self) -> Option<Payload> {
        let stated = self.masses.iter().find(|m| m.link == PAYLOAD)?;
        Some(Payload { mass_kg: stated.mass_kg, centre_m: stated.centre_m.into() })
    }

    /// The masses that joint `index` of the chain carries.
    pub fn masses_on(&self, index: usize) -> impl Iterator<Item = &CarriedMass> {
        let upwards = self.joints[index].upwards;
        let carries = move |m: &&CarriedMass| match upwards {
            true => m.joint <= index,
            false => m.joint >= index,
        };
        self.masses.iter().filter(carries)
    }

    /// Largest moment of gravity about joint `index` of the chain, whatever the posture, as a mass on a lever (kg m; kg for a
    /// prismatic joint): the masses that it carries, each as far away as the links between allow.
    pub fn largest_moment(&self, index: usize) -> f64 {
        let lever = |m: &CarriedMass| {
            let between = if m.joint < index { m.joint + 1..=index } else { index + 1..=m.joint };
            let links: f64 = self.joints[between].iter().map(|j| j.origin.translation.norm()).sum();
            if self.joints[index].kind == JointKind::Prismatic { 1.0 } else { links + m.centre_m.norm() }
        };
        self.masses_on(index).map(|m| m.mass_kg * lever(m)).sum()
    }

    /// True where the joint of a reading carries the arm: links of a third at least of the greatest length that a joint carries. Those of
    /// a wrist carry a hand.
    pub fn carries_arm(&self, reading: usize) -> bool {
        let length = |index: usize| -> f64 {
            let carried = if self.joints[index].upwards { 0..index } else { index + 1..self.joints.len() };
            self.joints[carried].iter().map(|j| j.origin.translation.norm()).sum()
        };
        let driven = |index: &usize| self.joints[*index].drive.is_some();
        let of_reading = |index: &usize| self.joints[*index].drive.is_some_and(|d| d.reading == reading);
        let longest = |is: &dyn Fn(&usize) -> bool| (0..self.joints.len()).filter(is).map(length).fold(0.0, f64::max);
        longest(&of_reading) >= OF_THE_ARM * longest(&driven)
    }
}

impl RobotDescription {
    /// The mass that the URDF has for all links alike, kg: a placeholder.
    pub(super) fn placeholder_mass(&self) -> Option<f64> {
        let mut masses = self.inertials.values().map(|i| i.mass_kg).filter(|m| *m > 0.0);
        let first = masses.next()?;
        (masses.clone().count() + 1 >= ALIKE && masses.all(|m| m == first)).then_some(first)
    }

    /// The masses of a chain where the URDF states them in earnest; else none.
    pub(super) fn stated_masses(&self, chain: &Chain) -> Vec<CarriedMass> {
        let Some(first) = chain.joints.iter().position(|j| j.drive.is_some()) else { return Vec::new() };
        let mut carried = self.carried_masses(chain);
        carried.retain(|m| m.joint >= first);
        let total: f64 = carried.iter().map(|m| m.mass_kg).sum();
        if self.placeholder_mass().is_some() || total < LEAST_CARRIED_KG { Vec::new() } else { carried }
    }

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
