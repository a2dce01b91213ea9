//! The tip of a chain where none is named.

use std::collections::BTreeSet;

use urdf_rs::JointType;

use super::elements::JointElement;
use super::read::RobotDescription;
use crate::error::{Code, Error, Notice, Result};

/// Most links that a message lists.
const MOST_LISTED: usize = 8;

/// What a tip is usually called, best first; a prefix (`left_tool0`) does not count.
const USUAL: [&str; 2] = ["tool0", "flange"];

/// The tip that was chosen, and the leaves that were not.
struct Choice<'a> {
    tip: &'a str,
    others: Vec<&'a str>,
}

impl RobotDescription {
    /// The single leaf; of several the one that all moving joints lie before, `tool0` before `flange` before others.
    pub(super) fn default_tip<'a>(&'a self, base: &'a str) -> Result<&'a str> {
        self.choose_tip(base).map(|c| c.tip)
    }

    /// What to say about the tip of [`RobotDescription::chain`] where none is named and there are several leaves.
    pub fn tip_notice(&self, base: Option<&str>, tip: Option<&str>) -> Option<Notice> {
        let roots = self.roots();
        let base = base.or_else(|| roots.first().copied()).filter(|_| tip.is_none())?;
        let choice = self.choose_tip(base).ok().filter(|c| !c.others.is_empty())?;
        let what = format!(
            "the tip is \"{}\", behind all moving joints (other leaf links: {})",
            choice.tip,
            listed(&choice.others)
        );
        Some(Notice::new(
            Code::TipChosen,
            self.path.display(),
            what,
            "give --tip, or tip in series.toml, for another one",
        ))
    }

    fn choose_tip<'a>(&'a self, base: &'a str) -> Result<Choice<'a>> {
        let moving = |joint: &&JointElement| joint.joint_type != JointType::Fixed;
        let moves_below = |top: &&str| {
            let below = self.below(top);
            self.joints.iter().filter(moving).any(|j| below.contains_key(j.parent.as_str()))
        };
        let above = self.fixed_ancestors(base).map(|j| j.parent.as_str());
        let top = std::iter::once(base).chain(above).find(moves_below).unwrap_or(base);
        let within = self.below(top);
        let below = |link: &str| within.contains_key(link);
        let parents: BTreeSet<&str> = self.joints.iter().map(|j| j.parent.as_str()).collect();
        let is_leaf = |link: &str| !parents.contains(link);
        let leaves: Vec<&str> = self.links().filter(|l| *l != base && *l != top && is_leaf(l) && below(l)).collect();
        let all = self.joints.iter().filter(moving).filter(|j| below(&j.parent)).count();
        let before = |leaf: &str| within.get(leaf).copied().unwrap_or(0);
        let rank = |leaf: &str| USUAL.iter().position(|name| is_called(leaf, name)).unwrap_or(USUAL.len());
        let behind_all: Vec<&str> = leaves.iter().copied().filter(|l| before(l) == all).collect();
        let best = behind_all.iter().map(|l| rank(l)).min();
        let candidates: Vec<&str> = match leaves[..] {
            [one] => vec![one],
            _ => behind_all.iter().copied().filter(|l| Some(rank(l)) == best).collect(),
        };
        if let [tip] = candidates[..] {
            return Ok(Choice { tip, others: leaves.into_iter().filter(|l| *l != tip).collect() });
        }
        let why = match behind_all.len() {
            0 if leaves.is_empty() => "",
            0 => ", and the moving joints lie before none of them alone",
            _ => ", and all moving joints lie before several of them",
        };
        let what = format!("has {} leaf links: {}{why}", leaves.len(), listed(&leaves));
        let usual = self.links().filter(|l| rank(l) < USUAL.len() && *l != base && below(l));
        let remedy = match usual.min_by_key(|l| rank(l)) {
            Some(link) => format!("name the tip: tip = \"...\" in series.toml or --tip (\"{link}\" is there)"),
            None => "name the tip: tip = \"...\" in series.toml or --tip, the link that carries camera or plate".into(),
        };
        Err(Error::new(Code::TipAmbiguous, self.path.display(), what, remedy))
    }

    /// Joints above a link, nearest first.
    pub(super) fn joints_above<'a>(&'a self, link: &'a str) -> impl Iterator<Item = &'a JointElement> {
        std::iter::successors(self.joint_to(link), |j| self.joint_to(&j.parent))
    }

    /// Fixed joints above a link up to the first that moves, nearest first.
    pub(super) fn fixed_ancestors<'a>(&'a self, link: &'a str) -> impl Iterator<Item = &'a JointElement> {
        self.joints_above(link).take_while(|j| j.joint_type == JointType::Fixed)
    }
}

/// The name itself, or the name behind a prefix.
fn is_called(link: &str, name: &str) -> bool {
    link.strip_suffix(name).is_some_and(|prefix| !prefix.ends_with(|c: char| c.is_ascii_alphanumeric()))
}

/// Names, the first few of many.
pub(super) fn listed(names: &[&str]) -> String {
    let first = names.iter().take(MOST_LISTED).copied().collect::<Vec<_>>().join(", ");
    match names.len().saturating_sub(MOST_LISTED) {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}
