//! compensation.toml: what the corrected URDF cannot say of the joints.

use std::collections::BTreeMap;

use super::controller_files::offsets_in_words;
use super::mastering::exported;
use crate::geom::Pose;
use crate::identify::Solution;
use crate::model::joint_terms::{Exported, Term};
use crate::model::robot::Robot;
use crate::output::Context;
use crate::output::text::{key, list, number};
use crate::urdf::Chain;

/// Acceleration of gravity, m/s^2 (standard).
const GRAVITY: f64 = 9.80665;

/// What the numbers of the file mean, by the table of joint terms.
fn header() -> String {
    let mut terms = Term::all(1);
    terms.retain(|t| !t.summand().is_empty());
    terms.dedup_by_key(|t| t.summand());
    let sum = terms.iter().fold("q".to_owned(), |sum, t| format!("{sum} + {}", t.summand()));
    let symbols = terms.iter().flat_map(|t| t.symbols()).map(|line| format!("# {line}\n"));
    format!(
        "# What the corrected URDF cannot say, for `robotcal compensate`. With q the reading and the URDF's own origins, the joint stands at\n\
         #   {sum}\n{}",
        symbols.collect::<String>()
    )
}

/// The values of one joint by their keys: one number, or a list.
#[derive(Default)]
struct Joint {
    numbers: BTreeMap<&'static str, f64>,
    lists: BTreeMap<&'static str, Vec<f64>>,
}

impl Joint {
    /// `largest_nm`: largest moment of gravity about the axis, N m.
    fn take(&mut self, term: Term, value: f64, largest_nm: f64) {
        match term.exported() {
            Exported::Nowhere => {}
            Exported::Number(key) => drop(self.numbers.insert(key, value)),
            Exported::PerMoment(key) if largest_nm > 0.0 => drop(self.numbers.insert(key, value / largest_nm)),
            Exported::PerMoment(_) => {}
            Exported::InList { key, place, .. } => {
                let list = self.lists.entry(key).or_default();
                list.resize(list.len().max(place + 1), 0.0);
                list[place] = value;
            }
        }
    }

    fn text(&self) -> String {
        let mut keys: Vec<&str> = Term::all(1).into_iter().filter_map(|t| t.exported().key()).collect();
        keys.dedup();
        let value = |key: &str| {
            let number_of = self.numbers.get(key).copied().map(number);
            number_of.or_else(|| self.lists.get(key).map(|l| list(l.iter().copied())))
        };
        keys.into_iter().filter_map(|key| Some(format!("{key} = {}\n", value(key)?))).collect()
    }
}

/// Largest moment of gravity about the axis of the joint of a reading, N m (N for a prismatic joint).
pub(super) fn largest_nm(chain: &Chain, reading: usize) -> f64 {
    let joint = chain.joints.iter().rposition(|j| j.drive.is_some_and(|d| d.reading == reading));
    GRAVITY * joint.map_or(0.0, |j| chain.largest_moment(j))
}

/// Text of compensation.toml; joints without any such term are not in it.
pub(super) fn compensation_toml(solution: &Solution, context: &Context) -> String {
    let robot = exported(solution, context);
    let mut joints: Vec<Joint> = robot.chain.readings.iter().map(|_| Joint::default()).collect();
    for t in &robot.terms {
        joints[t.reading].take(t.term, t.value, largest_nm(&robot.chain, t.reading));
    }
    let sections = robot.chain.readings.iter().zip(&joints).map(|(name, joint)| (name, joint.text()));
    let sections: Vec<_> = sections.filter(|(_, text)| !text.is_empty()).collect();
    let urdf = if sections.is_empty() { String::new() } else { origins(&robot) };
    let payload = robot.chain.payload().map_or_else(String::new, |p| {
        format!("\n[payload]\nmass_kg = {}\ncentre_m = {}\n", number(p.mass_kg), list(p.centre_m.iter().copied()))
    });
    let head = format!("{}# {}\n{urdf}{payload}", header(), offsets_in_words(context));
    sections.into_iter().fold(head, |out, (name, text)| out + &format!("\n[joint.{}]\n{text}", key(name)))
}

/// The origins to which the terms were found, for a reader who mixes files up.
fn origins(robot: &Robot) -> String {
    let row = |(name, o): (&str, Pose)| format!("{} = {}\n", key(name), list(o.xyz().into_iter().chain(o.rpy())));
    let rows: String = robot.urdf_origins().into_iter().map(row).collect();
    format!(
        "\n# The URDF to which the terms belong, by its origins (x y z in m, roll pitch yaw in rad): with another one they are wrong.\n[urdf]\n{rows}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_head_names_every_key_of_the_file() {
        let head = header();
        for key in Term::all(1).into_iter().filter_map(|t| t.exported().key()) {
            assert!(head.contains(key), "{key} is not in\n{head}");
        }
        assert!(head.lines().all(|l| l.starts_with('#')), "{head}");
        println!("{head}");
    }
}
