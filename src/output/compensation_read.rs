//! compensation.toml read back into joint terms.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::compensation::largest_nm;
use crate::error::{Error, Result};
use crate::files::{self, Kind};
use crate::model::joint_terms::{GRAVITY_TERMS, JointTerm, Term};
use crate::model::robot::Robot;
use crate::urdf::{Chain, Payload};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    payload: Option<Payload>,
    #[serde(default)]
    joint: BTreeMap<String, Joint>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Joint {
    gear_scale: Option<f64>,
    #[serde(default)]
    harmonics: Vec<f64>,
    #[serde(default)]
    gravity: Vec<f64>,
    compliance_rad_per_nm: Option<f64>,
    backlash_rad: Option<f64>,
}

/// The robot of a chain, with the joint terms of a compensation.toml where there is one.
///
/// # Errors
/// Those of [`read_compensation`].
pub fn compensated(chain: Chain, path: Option<&Path>) -> Result<Robot> {
    match path {
        Some(path) => read_compensation(path, chain),
        None => Ok(Robot::nominal(chain)),
    }
}

/// The robot of a chain with the joint terms of a compensation.toml, joints matched by name.
///
/// # Errors
/// Names the file, and the line or joint: unreadable text, unknown keys, a joint that the chain does not have, wrong counts,
/// a compliance where the URDF states no masses.
pub fn read_compensation(path: &Path, chain: Chain) -> Result<Robot> {
    parse_compensation(path, &files::read_text(path, Kind::Settings)?, chain)
}

/// As [`read_compensation`] from the text of the file; `path` is for messages only.
///
/// # Errors
/// Those of [`read_compensation`].
pub fn parse_compensation(path: &Path, text: &str, chain: Chain) -> Result<Robot> {
    let file: File = toml::from_str(text)
        .map_err(|e| Error::input(path.display(), e, "use the compensation.toml that identify wrote"))?;
    let chain = chain.carrying(file.payload.as_ref()).map_err(|e| Error::input(path.display(), e.what, e.remedy))?;
    let mut terms = Vec::new();
    for (name, joint) in &file.joint {
        let place = || format!("{}: [joint.{name}]", path.display());
        let reading = chain.readings.iter().position(|r| r == name).ok_or_else(|| {
            Error::input(
                place(),
                format!("the robot has no such joint (it has {})", chain.readings.join(", ")),
                "use the compensation.toml of this robot",
            )
        })?;
        if joint.harmonics.len() % 2 != 0 || joint.gravity.len() > usize::from(GRAVITY_TERMS) {
            return Err(Error::input(
                place(),
                "harmonics come in pairs (cosine, sine) and gravity in up to four terms",
                "use the compensation.toml that identify wrote",
            ));
        }
        let mut add = |term: Term, value: f64| terms.push(JointTerm { reading, term, value });
        joint.gear_scale.into_iter().for_each(|v| add(Term::Gear, v));
        for (k, pair) in (1u8..).zip(joint.harmonics.chunks(2)) {
            add(Term::Cosine(k), pair[0]);
            add(Term::Sine(k), pair[1]);
        }
        (0..GRAVITY_TERMS).zip(&joint.gravity).for_each(|(k, v)| add(Term::Gravity(k), *v));
        if let Some(compliance) = joint.compliance_rad_per_nm {
            if chain.masses.is_empty() {
                let what = "has a compliance_rad_per_nm, and the URDF states no masses";
                return Err(Error::input(place(), what, "give the calibrated URDF that was written beside it"));
            }
            add(Term::Sag, compliance * largest_nm(&chain, reading));
        }
        joint.backlash_rad.into_iter().for_each(|v| add(Term::Backlash, v));
    }
    Ok(Robot { terms, ..Robot::nominal(chain) })
}
