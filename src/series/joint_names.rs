//! Joints of a description and of a file whose names differ by a prefix or a unit alone.

use super::manifest::AngleUnit;

/// The unit in which a file is said to have its angles.
#[derive(Clone, Copy)]
pub struct StatedUnit<'a> {
    /// The unit.
    pub unit: AngleUnit,
    /// How another one is stated, `"deg"` or `"rad"`.
    pub stating: &'a dyn Fn(&str) -> String,
}

/// Units behind the names of columns, in lower case, with that of angles where it is one.
const SIGNS: [(&str, Option<AngleUnit>); 9] = [
    ("deg", Some(AngleUnit::Deg)),
    ("degree", Some(AngleUnit::Deg)),
    ("degrees", Some(AngleUnit::Deg)),
    ("\u{b0}", Some(AngleUnit::Deg)),
    ("rad", Some(AngleUnit::Rad)),
    ("radian", Some(AngleUnit::Rad)),
    ("radians", Some(AngleUnit::Rad)),
    ("m", None),
    ("mm", None),
];

/// What is to be done where all joints that are missing are there with a unit or a prefix, or without theirs.
pub fn remedy_of_names(missing: &[&str], there: &[String], unit: Option<StatedUnit<'_>>) -> Option<String> {
    remedy_of_unit(missing, there, unit).or_else(|| remedy_of_prefix(missing, there))
}

/// The unit that stands behind the name of a joint: `j1 [deg]`, `j1_rad`, `j1 (deg)`.
fn unit_behind(column: &str, joint: &str) -> Option<(&'static str, Option<AngleUnit>)> {
    let behind = column.get(joint.len()..).filter(|_| column.to_lowercase().starts_with(&joint.to_lowercase()))?;
    let behind = behind.trim_matches([' ', '_', '-', '/', '.', ',', ':', '[', ']', '(', ')']).to_lowercase();
    SIGNS.into_iter().find(|(sign, _)| *sign == behind)
}

fn remedy_of_unit(missing: &[&str], there: &[String], stated: Option<StatedUnit<'_>>) -> Option<String> {
    let of = |joint: &&str| {
        there.iter().find_map(|column| unit_behind(column, joint).map(|(sign, angle)| (column, sign, angle)))
    };
    let found: Vec<(&String, &str, Option<AngleUnit>)> = missing.iter().map(of).collect::<Option<_>>()?;
    let others = if found.len() > 1 { ", and the others alike" } else { "" };
    let mut remedy = format!("rename \"{}\" to \"{}\"{others}", found.first()?.0, missing[0]);
    if let Some((column, ..)) = found.iter().find(|(_, sign, _)| *sign == "mm") {
        remedy += &format!("; lengths are in metres: convert \"{column}\"");
    }
    let contradicts = |stated: &StatedUnit<'_>| found.iter().find_map(|f| f.2.filter(|unit| *unit != stated.unit));
    if let Some((stated, unit)) = stated.and_then(|stated| Some((stated, contradicts(&stated)?))) {
        let (said, named) = (stated.unit.name(), unit.name());
        remedy += &format!(
            "; the stated unit is {said}, that of the columns {named}: {} if theirs is right",
            (stated.stating)(named)
        );
    }
    Some(remedy)
}

/// What is to be done where all joints that are missing are there with a prefix, or without theirs.
fn remedy_of_prefix(missing: &[&str], there: &[String]) -> Option<String> {
    let first = missing.first()?;
    let are_there = |renamed: &dyn Fn(&str) -> Option<String>| {
        missing.iter().all(|name| renamed(name).is_some_and(|name| there.contains(&name)))
    };
    let added = there.iter().filter_map(|name| name.strip_suffix(first)).filter(|prefix| !prefix.is_empty());
    let added: Vec<&str> = added.filter(|prefix| are_there(&|name| Some(format!("{prefix}{name}")))).collect();
    let taken = there.iter().filter_map(|name| first.strip_suffix(name.as_str())).filter(|prefix| !prefix.is_empty());
    let mut taken = taken.filter(|prefix| are_there(&|name| name.strip_prefix(prefix).map(str::to_owned)));
    match (added.as_slice(), taken.next()) {
        ([], None) => None,
        ([], Some(prefix)) => Some(format!(
            "all of them are there without the prefix '{prefix}': take it off the joints in the URDF, or add it in the file"
        )),
        ([prefix], _) => Some(format!(
            "all of them are there with the prefix '{prefix}': give the joints in the URDF that prefix, or take it off in the file"
        )),
        (several, _) => Some(format!(
            "all of them are there with each of the prefixes '{}': give the joints in the URDF that of its arm",
            several.join("', '")
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_behind_the_names_is_named_and_held_against_the_stated_one() {
        let names = |all: [&str; 2]| all.map(str::to_owned);
        let stating = |unit: &str| format!("STATE {unit}");
        let of = |all: [&str; 2], unit| {
            remedy_of_names(&["j1", "j2"], &names(all), Some(StatedUnit { unit, stating: &stating }))
        };
        for (all, named) in [
            (["j1 [deg]", "j2 [deg]"], "deg"),
            (["j1 (\u{b0})", "j2 (\u{b0})"], "deg"),
            (["J1_rad", "j2_rad"], "rad"),
            (["j1 (Radians)", "j2 [m]"], "rad"),
        ] {
            for unit in [AngleUnit::Deg, AngleUnit::Rad] {
                let remedy = of(all, unit).unwrap();
                // words: the column, the joint, and the unit where it is another one.
                assert!(remedy.contains(&format!("\"{}\" to \"j1\"", all[0])), "{remedy}");
                assert_eq!(remedy.contains(&stating(named)), named != unit.name(), "{remedy}");
            }
        }
        assert!(of(["j1 [rad]", "j2_mm"], AngleUnit::Rad).unwrap().contains("\"j2_mm\""));
        for all in [["j1 [deg]", "j3 [deg]"], ["j1_x", "j2_x"], ["j1", "j2x"], ["\u{df}", "\u{df}j2"]] {
            assert_eq!(of(all, AngleUnit::Rad), None, "{all:?}");
        }
    }

    #[test]
    fn a_prefix_that_all_joints_have_or_lack_is_named() {
        let names = |all: &[&str]| all.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        let with = remedy_of_prefix(&["a1", "a2"], &names(&["left_a1", "left_a2", "right_a1"])).unwrap();
        let without = remedy_of_prefix(&["left_a1", "left_a2"], &names(&["a2", "a1"])).unwrap();
        // words: the prefix.
        assert!(with.contains("'left_'") && without.contains("'left_'"), "{with}; {without}");
        let either = names(&["left_a1", "right_a1", "left_a2", "right_a2"]);
        assert!(remedy_of_prefix(&["a1", "a2"], &either).unwrap().contains("'left_', 'right_'"));
        assert_eq!(remedy_of_prefix(&["a1", "a2"], &names(&["left_a1", "right_a2"])), None);
        assert_eq!(remedy_of_prefix(&["a1", "a2"], &names(&["a1"])), None);
        assert_eq!(remedy_of_prefix(&["left_a1", "left_a2"], &names(&["a1", "a3"])), None);
    }
}
