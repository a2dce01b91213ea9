//! Joints of a description and of a file whose names differ by a prefix alone.

/// What is to be done where all joints that are missing are there with a prefix, or without theirs.
pub fn remedy_of_prefix(missing: &[&str], there: &[String]) -> Option<String> {
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
