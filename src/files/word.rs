//! Names as they are given on a command line, and to be copied to one.

use std::fmt::Display;
use std::path::Path;

/// A name as one word of a shell: in quotes where it needs them.
pub fn word(name: impl Display) -> String {
    let name = name.to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+=:,@%#".contains(c);
    match () {
        () if !name.is_empty() && name.chars().all(is_plain) && !name.starts_with('#') => name,
        () if name.contains(['"', '$', '`', '!']) || (cfg!(not(windows)) && name.contains('\\')) => {
            format!("'{}'", name.replace('\'', "'\\''"))
        }
        () => format!("\"{name}\""),
    }
}

/// The folder of a file that is named: the present one where its name stands alone.
pub fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_alone_is_in_the_present_folder() {
        let of = ["new.html", "a/new.html", "/new.html"].map(|file| folder_of(Path::new(file)));
        assert_eq!(of, [".", "a", "/"].map(Path::new));
    }

    #[test]
    fn names_with_blanks_stand_in_quotes() {
        for (name, in_shell) in [
            ("runs/größe-1.mcap", "runs/größe-1.mcap"),
            ("my run 1", "\"my run 1\""),
            ("it's (2)", "\"it's (2)\""),
            ("a$b's", "'a$b'\\''s'"),
            ("", "\"\""),
            ("my run\\", if cfg!(windows) { "\"my run\\\"" } else { "'my run\\'" }),
        ] {
            assert_eq!(word(name), in_shell);
        }
    }
}
