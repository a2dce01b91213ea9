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

/// The `<inertial>` of a link; `None` where there is none.
pub(super) fn inertial(source: &Source<'_>, node: Node<'_, '_>, link: &str) -> Result<Option<Inertial>> {
    let Some(element) = child(node, "inertial") else { return Ok(None) };
    let refuse = |what: String, remedy: &str| {
        let place = format!("{}, link \"{link}\"", source.place(element));
        Err(Error::new(Code::UrdfNumber, place, what, remedy))
    };
    let xyz = child(element, "origin").and_then(|o| o.attribute("xyz")).unwrap_or("0 0 0");
    let Some(centre_m) = numbers(xyz, 3) else {
        let what = format!("centre of mass \"{xyz}\" is not 3 finite numbers");
        return refuse(what, "correct the numbers (point as decimal mark)");
    };
    let mass = child(element, "mass").and_then(|m| m.attribute("value"));
    match mass.and_then(|m| numbers(m, 1)).filter(|m| m[0] >= 0.0) {
        Some(mass) => Ok(Some(Inertial { mass_kg: mass[0], centre_m: Vector3::from_column_slice(&centre_m) })),
        None => refuse(
            format!("mass \"{}\" kg is not a number that is zero or positive", mass.unwrap_or_default()),
            "write <mass value=\"...\"/> (point as decimal mark), or leave <inertial> out",
        ),
    }
}
