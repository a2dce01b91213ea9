//! The `<inertial>` of a link.

use nalgebra::Vector3;
use roxmltree::Node;

use super::elements::{Source, child, numbers};
use crate::error::{Code, Error, Result};

/// Mass of a link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertial {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the link frame, m.
    pub centre_m: Vector3<f64>,
}

/// The `<inertial>` of a link; `None` where there is none (`urdf-rs` would say zero).
pub(super) fn inertial(source: &Source<'_>, node: Node<'_, '_>, link: &urdf_rs::Link) -> Result<Option<Inertial>> {
    let Some(element) = child(node, "inertial") else { return Ok(None) };
    let place = || format!("{}, link \"{}\"", source.place(element), link.name);
    if let Some(xyz) = child(element, "origin").and_then(|o| o.attribute("xyz"))
        && numbers(xyz, 3).is_none()
    {
        let what = format!("centre of mass \"{xyz}\" is not 3 finite numbers");
        return Err(Error::new(Code::UrdfNumber, place(), what, "correct the numbers (point as decimal mark)"));
    }
    let mass_kg = link.inertial.mass.value;
    if !(mass_kg >= 0.0 && mass_kg.is_finite()) {
        return Err(Error::new(Code::UrdfNumber, place(), format!("mass {mass_kg} kg"), "a mass is zero or positive"));
    }
    Ok(Some(Inertial { mass_kg, centre_m: link.inertial.origin.xyz.0.into() }))
}
