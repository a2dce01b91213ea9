//! One error type for the whole program: where, what, and what to do about it.

use std::fmt;
use std::path::Path;

/// What kind of failure it was; fixes the exit code of the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorKind {
    /// Input or usage is wrong: exit code 2.
    Input,
    /// The problem was understood but not converged or not identifiable: exit code 3.
    Unsolved,
}

/// A failure that a person can act on.
///
/// `place` names the file, line, image, joint or parameter; `what` says what was found there;
/// `remedy` says the first thing to look at.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Error {
    /// Kind of failure.
    pub kind: ErrorKind,
    /// File, line, image, joint or parameter.
    pub place: String,
    /// What was found there.
    pub what: String,
    /// The first thing to look at.
    pub remedy: String,
}

/// Result with the program's error.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// Bad input or usage.
    pub fn input(place: impl fmt::Display, what: impl fmt::Display, remedy: impl fmt::Display) -> Self {
        Self { kind: ErrorKind::Input, place: place.to_string(), what: what.to_string(), remedy: remedy.to_string() }
    }

    /// A well-formed problem without a trustworthy solution.
    pub fn unsolved(place: impl fmt::Display, what: impl fmt::Display, remedy: impl fmt::Display) -> Self {
        Self { kind: ErrorKind::Unsolved, ..Self::input(place, what, remedy) }
    }

    /// A file that could not be read or written.
    pub fn io(path: &Path, error: &std::io::Error) -> Self {
        let remedy = match error.kind() {
            std::io::ErrorKind::NotFound => "check the path and its spelling",
            std::io::ErrorKind::PermissionDenied => "check the permissions of the file and its folder",
            _ => "check that the disk is readable and not full",
        };
        Self::input(path.display(), error, remedy)
    }

    /// Exit code of the program for this failure.
    pub fn exit_code(&self) -> u8 {
        match self.kind {
            ErrorKind::Input => 2,
            ErrorKind::Unsolved => 3,
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}\n  try: {}", self.place, self.what, self.remedy)
    }
}

impl std::error::Error for Error {}

/// Something seen on the way that the user should know of, though the work went on.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Notice {
    /// File, line, image, joint or parameter.
    pub place: String,
    /// What was seen and why it matters.
    pub what: String,
    /// What to try.
    pub remedy: String,
}

impl Notice {
    /// A notice about `place`.
    pub fn new(place: impl fmt::Display, what: impl fmt::Display, remedy: impl fmt::Display) -> Self {
        Self { place: place.to_string(), what: what.to_string(), remedy: remedy.to_string() }
    }
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.what)?;
        if !self.remedy.is_empty() {
            write!(f, " ({})", self.remedy)?;
        }
        Ok(())
    }
}

/// The known name that was probably meant by `given`: at most two letters (a third of a short word) away, else `None`.
///
/// Case and the choice between `-`, `_` and blank do not count. Of equally near names the first one wins.
pub fn closest_name<'a>(given: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = |s: &str| s.to_lowercase().replace(['-', ' '], "_").chars().collect::<Vec<_>>();
    let given = plain(given);
    let reach = given.len().div_ceil(3).min(2);
    known
        .into_iter()
        .map(|name| (edit_distance(&given, &plain(name)), name))
        .filter(|(distance, _)| *distance <= reach)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, name)| name)
}

/// Levenshtein distance.
fn edit_distance(a: &[char], b: &[char]) -> usize {
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::closest_name;

    #[test]
    fn a_misspelt_name_is_recognised_and_a_strange_one_is_not() {
        let known = ["joint_unit", "base", "tip", "camera_mount"];
        assert_eq!(closest_name("joint-units", known), Some("joint_unit"));
        assert_eq!(closest_name("Camera_Mont", known), Some("camera_mount"));
        assert_eq!(closest_name("tpi", known), None);
        assert_eq!(closest_name("tipp", known), Some("tip"));
        assert_eq!(closest_name("velocity", known), None);
        assert_eq!(closest_name("", known), None);
    }
}
