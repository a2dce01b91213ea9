//! compensation.toml: what the corrected URDF cannot say of the joints.

use super::Context;
use super::controller_files::{exported, offsets_in_words};
use super::text::{key, list, number};
use crate::error::{Error, Result};
use crate::identify::Solution;
use crate::model::joint_terms::Term;
use crate::urdf::Chain;

/// Acceleration of gravity, m/s^2 (standard).
const GRAVITY: f64 = 9.80665;

const HEADER: &str = "\
# What the corrected URDF cannot say, for `robotcal compensate`. With q the reading and the URDF's own origins, the joint stands at
#   q + gear_scale q + sum_k [a_k cos kq + b_k sin kq] + sum_i gravity_i m_i(q) + compliance_rad_per_nm T(q) + backlash_rad tanh(step / 0.002)
# harmonics = [a1, b1, a2, b2, ..] and gravity in rad (m for a prismatic joint), step from the previous stop in rad (m).
# m_1, m_2: moment about the axis of a unit weight (along -z of the root) at unit levers u and axis x u of the joint's own link;
# m_3, m_4: the same about this axis for levers u' and axis' x u' of the link after the next moving joint.
# T: moment of gravity about the axis, N m (force along it, N, for a prismatic joint), of the masses in the URDF and the [payload]
# (centre in the frame of the tip link).
# u is the unit vector along x (along y where |axis_x| >= 0.9) without its part along the axis.
";

/// The values of one joint.
#[derive(Default)]
struct Joint {
    gear_scale: Option<f64>,
    /// Index 2 (k - 1) is the cosine of harmonic k, the next the sine.
    harmonics: Vec<f64>,
    gravity: Vec<f64>,
    compliance: Option<f64>,
    backlash: Option<f64>,
}

impl Joint {
    /// `largest_nm`: largest moment of gravity about the axis, N m.
    fn take(&mut self, term: Term, value: f64, largest_nm: f64) -> Result<()> {
        match term {
            Term::Offset | Term::Local(_) => {}
            Term::Gear => self.gear_scale = Some(value),
            Term::Cosine(k) => put(&mut self.harmonics, harmonic(k)?, value),
            Term::Sine(k) => put(&mut self.harmonics, harmonic(k)? + 1, value),
            Term::Gravity(k) => put(&mut self.gravity, usize::from(k), value),
            Term::Sag => self.compliance = (largest_nm > 0.0).then(|| value / largest_nm),
            Term::Backlash => self.backlash = Some(value),
        }
        Ok(())
    }

    fn text(&self) -> String {
        let mut out = String::new();
        let mut line = |name: &str, value: Option<String>| {
            if let Some(value) = value {
                out += &format!("{name} = {value}\n");
            }
        };
        let non_empty = |values: &Vec<f64>| (!values.is_empty()).then(|| list(values.iter().copied()));
        line("gear_scale", self.gear_scale.map(number));
        line("harmonics", non_empty(&self.harmonics));
        line("gravity", non_empty(&self.gravity));
        line("compliance_rad_per_nm", self.compliance.map(number));
        line("backlash_rad", self.backlash.map(number));
        out
    }
}

/// Largest moment of gravity about the axis of the joint of a reading, N m (N for a prismatic joint).
pub(super) fn largest_nm(chain: &Chain, reading: usize) -> f64 {
    let joint = chain.joints.iter().rposition(|j| j.drive.is_some_and(|d| d.reading == reading));
    GRAVITY * joint.map_or(0.0, |j| chain.largest_moment(j))
}

fn harmonic(k: u8) -> Result<usize> {
    let index = usize::from(k).checked_sub(1).map(|k| 2 * k);
    index.ok_or_else(|| Error::unsolved("compensation.toml", "harmonics count from 1", "use an offset for a constant"))
}

fn put(values: &mut Vec<f64>, index: usize, value: f64) {
    if values.len() <= index {
        values.resize(index + 1, 0.0);
    }
    values[index] = value;
}

/// Text of compensation.toml; joints without any such term are not in it.
///
/// # Errors
/// A harmonic of order 0.
pub(super) fn compensation_toml(solution: &Solution, context: &Context) -> Result<String> {
    let robot = exported(solution, context);
    let mut joints: Vec<Joint> = robot.chain.readings.iter().map(|_| Joint::default()).collect();
    for t in &robot.terms {
        joints[t.reading].take(t.term, t.value, largest_nm(&robot.chain, t.reading))?;
    }
    let sections = robot.chain.readings.iter().zip(&joints).map(|(name, joint)| (name, joint.text()));
    let sections = sections.filter(|(_, text)| !text.is_empty());
    let payload = robot.chain.payload().map_or_else(String::new, |p| {
        format!("\n[payload]\nmass_kg = {}\ncentre_m = {}\n", number(p.mass_kg), list(p.centre_m.iter().copied()))
    });
    Ok(sections.fold(format!("{HEADER}# {}\n{payload}", offsets_in_words(context)), |out, (name, text)| {
        out + &format!("\n[joint.{}]\n{text}", key(name))
    }))
}
