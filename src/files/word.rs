//! Names as words of a command line, to be copied from there.

use std::fmt::Display;

/// A name as one word of a shell: in quotes where it needs them.
pub fn word(name: impl Display) -> String {
    let name = name.to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+=:,@%#".contains(c);
    match () {
        () if !name.is_empty() && name.chars().all(is_plain) && !name.starts_with('#') => name,
        () if name.contains(['"', '$', '`', '!']) => format!("'{}'", name.replace('\'', "'\\''")),
        () => format!("\"{name}\""),
    }
}

#[cfg(test)]
mod tests {
    use super::word;

    #[test]
    fn names_with_blanks_stand_in_quotes() {
        for (name, in_shell) in [
            ("runs/größe-1.mcap", "runs/größe-1.mcap"),
            ("my run 1", "\"my run 1\""),
            ("it's (2)", "\"it's (2)\""),
            ("a$b's", "'a$b'\\''s'"),
            ("", "\"\""),
        ] {
            assert_eq!(word(name), in_shell);
        }
    }
}
