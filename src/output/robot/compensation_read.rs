//! compensation.toml read back into joint terms.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::compensation::largest_nm;
use super::corrected_robot::CALIBRATED;
use crate::error::{Code, Error, Result};
use crate::files::{self, FileKind};
use crate::geom::Pose;
use crate::model::joint_terms::{Exported, JointTerm, Term};
use crate::model::robot::Robot;
use crate::urdf::{Chain, Payload};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    payload: Option<Payload>,
    /// Origins of the URDF to which the terms belong, by their joints.
    #[serde(default)]
    urdf: BTreeMap<String, [f64; 6]>,
    #[serde(default)]
    joint: BTreeMap<String, BTreeMap<String, Values>>,
}

/// What stands under a key of a joint.
#[derive(Deserialize)]
#[serde(untagged)]
enum Values {
    Number(f64),
    List(Vec<f64>),
}

impl Values {
    /// True where all of it are numbers.
    fn is_finite(&self) -> bool {
        self.number().is_none_or(f64::is_finite) && self.list().iter().all(|number| number.is_finite())
    }

    fn list(&self) -> &[f64] {
        match self {
            Self::Number(_) => &[],
            Self::List(list) => list,
        }
    }

    fn number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number),
            Self::List(_) => None,
        }
    }
}

/// What the head of the file says of a key.
fn meaning(key: &str) -> &'static str {
    let of_key = Term::all(1).into_iter().find(|t| t.exported().key() == Some(key));
    of_key.and_then(|t| t.symbols().first().copied()).unwrap_or_default()
}

/// The terms of a joint with what stands for them, in the order of the table; else what is wrong.
fn terms_of(joint: &BTreeMap<String, Values>) -> std::result::Result<Vec<(Term, f64)>, String> {
    let longest = joint.values().map(|v| v.list().len()).max().unwrap_or_default().max(1);
    let all = Term::all(u8::try_from(longest).unwrap_or(u8::MAX));
    for (key, values) in joint {
        let places: Vec<Exported> = all.iter().map(|t| t.exported()).filter(|e| e.key() == Some(key)).collect();
        match (places.first(), values) {
            (Some(Exported::InList { together, .. }), Values::List(list)) => {
                let (given, most) = (list.len(), places.len());
                if given % together > 0 {
                    return Err(format!(
                        "{key} has {given} numbers, and they come {together} together: {}",
                        meaning(key)
                    ));
                }
                if given > most {
                    return Err(format!("{key} has {given} numbers, and there are {most} at most: {}", meaning(key)));
                }
            }
            (Some(Exported::InList { .. }), Values::Number(_)) => return Err(format!("{key} is no list")),
            (Some(_), Values::List(_)) => return Err(format!("{key} is no number")),
            (None, Values::List(list)) if list.is_empty() => {}
            (None, _) => return Err(format!("{key} is no term of a joint")),
            (Some(_), Values::Number(_)) => {}
        }
        if !values.is_finite() {
            return Err(format!("{key} is not finite"));
        }
    }
    let value = |term: Term| match term.exported() {
        Exported::Nowhere => None,
        Exported::Number(key) | Exported::PerMoment(key) => joint.get(key)?.number(),
        Exported::InList { key, place, .. } => joint.get(key)?.list().get(place).copied(),
    };
    Ok(all.into_iter().filter_map(|term| Some((term, value(term)?))).collect())
}

/// The robot of a chain of a URDF, with the joint terms of a compensation.toml where there is one.
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
/// a compliance where the URDF states no masses, terms of another URDF.
pub fn read_compensation(path: &Path, chain: Chain) -> Result<Robot> {
    parse_compensation(path, &files::read_text(path, FileKind::Settings)?, chain)
}

/// As [`read_compensation`] from the text of the file; `path` is for messages only.
///
/// # Errors
/// Those of [`read_compensation`].
pub fn parse_compensation(path: &Path, text: &str, chain: Chain) -> Result<Robot> {
    let file: File = toml::from_str(text).map_err(|e| {
        Error::new(Code::SettingSyntax, path.display(), e, "use the compensation.toml that identify wrote")
    })?;
    require_finite(path, &file)?;
    check_urdf(path, &file.urdf, &chain)?;
    let chain =
        chain.carrying(file.payload.as_ref()).map_err(|e| Error::new(e.code, path.display(), e.what, e.remedy))?;
    let mut terms = Vec::new();
    for (name, joint) in &file.joint {
        let place = || format!("{}: [joint.{name}]", path.display());
        let reading = chain.readings.iter().position(|r| r == name).ok_or_else(|| {
            Error::new(
                Code::JointUnknown,
                place(),
                format!("the robot has no such joint (it has {})", chain.readings.join(", ")),
                "use the compensation.toml of this robot",
            )
        })?;
        for (term, value) in terms_of(joint).map_err(|what| {
            Error::new(Code::SettingRange, place(), what, "use the compensation.toml that identify wrote")
        })? {
            if !term.applies(&chain) {
                let what = "has a compliance_rad_per_nm, and the URDF states no masses";
                return Err(Error::new(
                    Code::UrdfMassesMissing,
                    place(),
                    what,
                    "give the calibrated URDF that was written beside it",
                ));
            }
            let per_moment = matches!(term.exported(), Exported::PerMoment(_));
            let value = if per_moment { value * largest_nm(&chain, reading) } else { value };
            terms.push(JointTerm { reading, term, value });
        }
    }
    Ok(Robot { terms, ..Robot::nominal(chain) })
}

/// Beside those of the joint terms.
fn require_finite(path: &Path, file: &File) -> Result<()> {
    let payload = file.payload.iter().map(|load| ("[payload]", load.mass_kg + load.centre_m.iter().sum::<f64>()));
    let origins = file.urdf.iter().map(|(name, origin)| (name.as_str(), origin.iter().sum()));
    match payload.chain(origins).find(|(_, sum)| !sum.is_finite()) {
        None => Ok(()),
        Some((name, _)) => Err(Error::new(
            Code::SettingRange,
            format!("{}: {name}", path.display()),
            "holds a number that is not finite",
            "use the compensation.toml that identify wrote",
        )),
    }
}

/// Numbers of a URDF that was written again by others may be rounded by this, m and rad.
const ROUNDED: f64 = 1e-5;

/// Terms were found beside origins; with others they are wrong, or count twice.
fn check_urdf(path: &Path, stated: &BTreeMap<String, [f64; 6]>, chain: &Chain) -> Result<()> {
    for (name, own) in Robot::nominal(chain.clone()).urdf_origins() {
        let Some([x, y, z, roll, pitch, yaw]) = stated.get(name).copied() else { continue };
        let (angle, distance) = own.distance(&Pose::from_xyz_rpy([x, y, z], [roll, pitch, yaw]));
        if angle > ROUNDED || distance > ROUNDED {
            let what = format!(
                "belongs to another URDF: the origin of {name} is {:.3} mm and {:.3} mrad elsewhere there",
                1e3 * distance,
                1e3 * angle
            );
            let remedy = format!("give the *{CALIBRATED} that was written beside it, or leave compensation.toml out");
            return Err(Error::new(Code::OptionConflict, path.display(), what, remedy));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(joint: &str) -> std::result::Result<Vec<(Term, f64)>, String> {
        terms_of(&toml::from_str(joint).unwrap())
    }

    #[test]
    fn harmonics_come_in_pairs() {
        let terms = read("harmonics = [1.0, 2.0, 3.0, 4.0]").unwrap();
        assert_eq!(terms.len(), 4);
        assert_eq!(terms[3], (Term::Sine(2), 4.0));
        for odd in ["harmonics = [1e-4]", "harmonics = [1e-4, 0, 2e-4]"] {
            let what = read(odd).unwrap_err();
            assert!(what.contains("2 together") && what.contains("[a1, b1"), "{what}");
        }
    }

    #[test]
    fn a_number_that_is_none_is_refused_with_its_joint_and_key() {
        for (key, number) in [("gear_scale", "nan"), ("backlash", "inf"), ("gravity", "[0.1, nan]")] {
            assert!(read(&format!("{key} = {number}")).unwrap_err().contains(key), "{key}");
        }
        let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/kuka_kr6_r900/kuka_kr6_r900.urdf");
        let chain = crate::urdf::read(&urdf).unwrap().chain(None, None).unwrap();
        for (text, place) in [
            ("[joint.joint_a2]\ngear_scale = nan", "joint_a2"),
            ("[urdf]\njoint_a2 = [0, nan, 0, 0, 0, 0]", "joint_a2"),
            ("[payload]\nmass_kg = 1.0\ncentre_m = [0.0, 0.0, inf]", "payload"),
        ] {
            let refused = parse_compensation(Path::new("compensation.toml"), text, chain.clone()).unwrap_err();
            assert_eq!(refused.code, Code::SettingRange, "{text}");
            assert!(refused.place.contains(place), "{}", refused.place);
        }
    }

    #[test]
    fn what_a_key_cannot_hold_is_named_with_it() {
        assert!(read("gravity = [0, 0, 0, 0, 0]").unwrap_err().contains("4 at most"));
        assert_eq!(read("gravity = [0.0, 0.0, 0.5]").unwrap()[2], (Term::Gravity(2), 0.5));
        assert!(read("gear_scale = [1.0]").unwrap_err().contains("gear_scale is no number"));
        assert!(read("harmonics = 1.0").unwrap_err().contains("harmonics is no list"));
        assert!(read("offset = 1.0").unwrap_err().contains("offset is no term"));
    }
}
