//! Joints of a description and of a file whose names differ by a prefix alone.

/// What is to be done where all joints that are missing are there with a prefix, or without theirs.
pub(super) fn remedy_of_prefix(missing: &[&str], there: &[String]) -> Option<String> {
    let first = missing.first()?;
    let is_all = |renamed: &dyn Fn(&str) -> Option<String>| {
        missing.iter().all(|name| renamed(name).is_some_and(|name| there.contains(&name)))
    };
    there.iter().find_map(|name| {
        if let Some(prefix) = name.strip_suffix(first).filter(|p| !p.is_empty()) {
            let remedy = format!(
                "all of them are there with the prefix '{prefix}': give the joints in the URDF that prefix, or take it off in the file"
            );
            return is_all(&|name| Some(format!("{prefix}{name}"))).then_some(remedy);
        }
        let prefix = first.strip_suffix(name.as_str()).filter(|p| !p.is_empty())?;
        let remedy = format!(
            "all of them are there without the prefix '{prefix}': take it off the joints in the URDF, or add it in the file"
        );
        is_all(&|name| name.strip_prefix(prefix).map(str::to_owned)).then_some(remedy)
    })
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
        assert_eq!(remedy_of_prefix(&["a1", "a2"], &names(&["left_a1", "right_a2"])), None);
        assert_eq!(remedy_of_prefix(&["a1", "a2"], &names(&["a1"])), None);
        assert_eq!(remedy_of_prefix(&["left_a1", "left_a2"], &names(&["a1", "a3"])), None);
    }
}
