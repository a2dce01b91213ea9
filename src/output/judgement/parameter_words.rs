//! How parameters and directions are named for people, alike on the terminal and in the report.

use crate::assess::UnknownDirection;
use crate::problem::short_name;

/// Most proposals of what to measure next where the answer is short.
pub const MOST_NEXT: usize = 3;

/// Most parameters of a direction that are named.
const MOST_NAMED: usize = 4;

/// What the component of a local error begins with, with the point before it.
pub(in crate::output) const LOCAL: &str = ".local_";

/// Block and component of a parameter's name; the component of a local error has a point of its own (`local_0.3298`).
pub(in crate::output) fn split(name: &str) -> (&str, &str) {
    let local = name.find(LOCAL).map(|at| (&name[..at], &name[at + 1..]));
    local.or_else(|| name.rsplit_once('.')).unwrap_or((name, ""))
}

/// The first parameters of a direction: "joint_1.gear with joint_2.origin.x and 3 more".
pub fn direction(d: &UnknownDirection) -> String {
    let names: Vec<&str> = d.parameters.iter().take(MOST_NAMED).map(|(name, _)| name.as_str()).collect();
    let rest = d.parameters.len().saturating_sub(MOST_NAMED);
    let more = if rest > 0 { format!(" and {rest} more") } else { String::new() };
    names.join(" with ") + &more
}

/// Parameters by block: `robot/joint_1/origin.x`, `robot/joint_1/origin.y` -> "joint_1.origin (x y)".
pub fn grouped<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<String> {
    let mut groups: Vec<(String, Vec<String>)> = Vec::new();
    for name in names.into_iter().map(short_name) {
        let (block, component) = split(&name);
        match groups.last_mut().filter(|(last, _)| last == block) {
            Some((_, components)) => components.push(component.to_owned()),
            None => groups.push((block.to_owned(), vec![component.to_owned()])),
        }
    }
    groups.iter().map(|(block, components)| format!("{block} ({})", components.join(" "))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assess::Cause;

    #[test]
    fn parameters_stand_together_by_block() {
        let names =
            ["robot/a/origin.x", "robot/a/origin.rz", "robot/a.gear", "robot/a.local_-0.3298", "plate_shape.bow_xx"];
        assert_eq!(grouped(names), ["a.origin (x rz)", "a (gear local_-0.3298)", "plate_shape (bow_xx)"]);
    }

    #[test]
    fn a_direction_names_its_first_parameters() {
        let parameters = |n: usize| (0..n).map(|k| (format!("p{k}"), 1.0)).collect();
        let named =
            |n: usize| direction(&UnknownDirection { parameters: parameters(n), cause: Cause::Stops, remedy: None });
        assert_eq!([named(1), named(6)], ["p0", "p0 with p1 with p2 with p3 and 2 more"]);
    }
}
