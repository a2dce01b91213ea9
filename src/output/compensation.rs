//! compensation.toml: what the corrected URDF cannot say of the joints.

use super::Context;
use super::controller_files::{exported, offsets_in_words};
use super::text::{key, list, number};
use crate::error::{Error, Result};
use crate::model::joint_terms::Term;
use crate::recipe::Solution;

const HEADER: &str = "\
# What the corrected URDF cannot say, for `robotcal compensate`. With q the reading and the URDF's own origins, the joint stands at
#   q + gear_scale q + sum_k [a_k cos kq + b_k sin kq] + sum_i gravity_i m_i(q) + backlash_rad tanh(step / 0.002)
# harmonics = [a1, b1, a2, b2, ..] and gravity in rad (m for a prismatic joint), step from the previous stop in rad (m).
# m_1, m_2: moment about the axis of a unit weight (along -z of the root) at unit levers u and axis x u of the joint's own link;
# m_3, m_4: the same about this axis for levers u' and axis' x u' of the link after the next moving joint.
# u is the unit vector along x (along y where |axis_x| >= 0.9) without its part along the axis.
";

/// The values of one joint.
#[derive(Default)]
struct Joint {
    gear_scale: Option<f64>,
    /// Index 2 (k - 1) is the cosine of harmonic k, the next the sine.
    harmonics: Vec<f64>,
    gravity: Vec<f64>,
    backlash: Option<f64>,
}

impl Joint {
    fn take(&mut self, term: Term, value: f64) -> Result<()> {
        match term {
            Term::Offset | Term::Local(_) => {}
            Term::Gear => self.gear_scale = Some(value),
            Term::Cosine(k) => put(&mut self.harmonics, harmonic(k)?, value),
            Term::Sine(k) => put(&mut self.harmonics, harmonic(k)? + 1, value),
            Term::Gravity(k) => put(&mut self.gravity, usize::from(k), value),
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
        line("backlash_rad", self.backlash.map(number));
        out
    }
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
        joints[t.reading].take(t.term, t.value)?;
    }
    let sections = robot.chain.readings.iter().zip(&joints).map(|(name, joint)| (name, joint.text()));
    let sections = sections.filter(|(_, text)| !text.is_empty());
    Ok(sections.fold(format!("{HEADER}# {}\n", offsets_in_words(context)), |out, (name, text)| {
        out + &format!("\n[joint.{}]\n{text}", key(name))
    }))
}
