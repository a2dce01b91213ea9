//! One error type for the whole program: where, what, and what to do about it.

mod code;
mod quantity;

use std::fmt;
use std::path::{MAIN_SEPARATOR, Path};

pub use code::{Code, ErrorKind};
pub use quantity::Quantity;

/// A failure that a person can act on.
///
/// `place` names the file, line, image, joint or parameter; `what` says what was found there;
/// `remedy` says the first thing to look at.
#[derive(Debug, Clone, PartialEq)]
pub struct Error {
    /// What is wrong with what.
    pub code: Code,
    /// File, line, image, joint or parameter.
    pub place: String,
    /// What was found there.
    pub what: String,
    /// The first thing to look at.
    pub remedy: String,
    /// Numbers of what was found, where it is a finding.
    pub quantities: Vec<Quantity>,
}

/// Result with the program's error.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// A failure; its code says whether it is of the input or of the solution.
    pub fn new(code: Code, place: impl fmt::Display, what: impl fmt::Display, remedy: impl fmt::Display) -> Self {
        let [place, what, remedy] = [place.to_string(), what.to_string(), remedy.to_string()];
        Self { code, place, what, remedy, quantities: Vec::new() }
    }

    /// A file that could not be read or written.
    pub fn io(path: &Path, error: &std::io::Error) -> Self {
        let (code, remedy) = match error.kind() {
            std::io::ErrorKind::NotFound if path.to_string_lossy().contains('\\') && MAIN_SEPARATOR == '/' => {
                (Code::FileMissing, "write / between folders: here a backslash is a character of a name")
            }
            std::io::ErrorKind::NotFound => (Code::FileMissing, "check the path and its spelling"),
            std::io::ErrorKind::PermissionDenied => {
                (Code::FileForbidden, "check the permissions of the file and its folder")
            }
            std::io::ErrorKind::NotADirectory => {
                (Code::FileNotRegular, "a file stands where a folder is wanted: check the path")
            }
            std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded => {
                (Code::FileFailed, "the disk (or your share of it) is full: make room, or write to another one")
            }
            std::io::ErrorKind::ReadOnlyFilesystem => {
                (Code::FileFailed, "the file system cannot be written to: write to another place")
            }
            _ => (Code::FileFailed, "check that the disk is readable and not full"),
        };
        Self::new(code, path.display(), error, remedy)
    }

    /// Exit code of the program for this failure.
    pub fn exit_code(&self) -> u8 {
        match self.code.kind() {
            ErrorKind::Input => 2,
            ErrorKind::Unsolved => 3,
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", shown(&format!("{}: {}\n  try: {}", self.place, self.what, self.remedy)))
    }
}

impl std::error::Error for Error {}

/// Places that a notice names when it says the same of several.
const MOST_PLACES: usize = 4;

/// Something seen on the way that the user should know of, though the work went on.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Notice {
    /// What was noticed of what.
    #[serde(default = "Code::of_earlier_versions")]
    pub code: Code,
    /// File, line, image, joint or parameter.
    pub place: String,
    /// What was seen and why it matters.
    pub what: String,
    /// What to try.
    pub remedy: String,
}

impl Notice {
    /// A notice about `place`.
    pub fn new(code: Code, place: impl fmt::Display, what: impl fmt::Display, remedy: impl fmt::Display) -> Self {
        let [place, what, remedy] = [place.to_string(), what.to_string(), remedy.to_string()].map(|t| shown(&t));
        Self { code, place, what, remedy }
    }

    /// The notice with its code behind it.
    pub fn coded(&self) -> String {
        format!("{self} [{}]", self.code)
    }

    /// Notices that say the same of several places, in the order of the first of each.
    pub fn alike(all: &[Self]) -> Vec<Vec<&Self>> {
        let mut groups: Vec<Vec<&Self>> = Vec::new();
        for notice in all {
            match groups.iter_mut().find(|g| notice.says_the_same_as(g[0])) {
                Some(group) => group.push(notice),
                None => groups.push(vec![notice]),
            }
        }
        groups
    }

    /// The same notices with those that say the same of several places made into one.
    pub fn said_once(all: &[Self]) -> Vec<Self> {
        Self::alike(all).into_iter().map(|group| Self::of_group(&group)).collect()
    }

    /// Apart from numbers that stand by themselves.
    fn says_the_same_as(&self, other: &Self) -> bool {
        if self.code != other.code {
            return false;
        }
        let alike = self.place != other.place && without_numbers(&self.what) == without_numbers(&other.what);
        self.remedy == other.remedy && (self.what == other.what || alike)
    }

    fn of_group(group: &[&Self]) -> Self {
        let first = group[0];
        let mut places: Vec<&str> = group.iter().map(|n| n.place.as_str()).collect();
        places.dedup();
        if places.len() < 2 {
            return first.clone();
        }
        let differ = if group.iter().any(|n| n.what != first.what) { " (numbers of the first)" } else { "" };
        let named = places[..places.len().min(MOST_PLACES)].join(", ");
        let more = places.len().saturating_sub(MOST_PLACES);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        Self {
            place: format!("{} places ({named}{more})", places.len()),
            what: format!("{}{differ}", first.what),
            ..first.clone()
        }
    }
}

/// Words of a text, numbers with their brackets and signs left out.
fn without_numbers(text: &str) -> Vec<&str> {
    let is_number = |w: &&str| {
        w.trim_matches(|c: char| !c.is_ascii_digit()).parse::<f64>().is_ok() && !w.contains(char::is_alphabetic)
    };
    text.split_whitespace().filter(|w| !is_number(w)).collect()
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

/// Characters of a name that cannot be printed which are shown.
const MOST_SHOWN: usize = 40;

/// Characters that change a terminal or end a line of a program: control characters, line and paragraph separators, changes of direction.
fn is_hidden(c: char) -> bool {
    c.is_control() || matches!(c, '\u{2028}' | '\u{2029}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// A name as it was read, where every character of it can be seen: names go into programs, file names and the terminal.
///
/// # Errors
/// A name with control characters; they are shown escaped.
pub fn plain_name<'a>(kind: &str, name: &'a str, place: impl fmt::Display) -> Result<&'a str> {
    if !name.contains(is_hidden) {
        return Ok(name);
    }
    let article = if kind.starts_with(['a', 'e', 'i', 'o']) { "an" } else { "a" };
    let escaped = name.chars().take(MOST_SHOWN).flat_map(char::escape_debug).collect::<String>();
    let more = if name.chars().nth(MOST_SHOWN).is_some() { " .." } else { "" };
    let what = format!("the name of {article} {kind} has control characters: \"{escaped}\"{more}");
    let remedy = match name.contains('\0') {
        true => "the file is damaged (zeros stand where text should be), or no text in UTF-8: take a good copy of it",
        false => "give it a name of letters, digits, - and _",
    };
    Err(Error::new(Code::NameUnprintable, place, what, remedy))
}

/// Text of files for the terminal: what cannot be seen is escaped, line ends and tabs stay.
fn shown(text: &str) -> String {
    let escaped = |c: char| is_hidden(c) && !matches!(c, '\n' | '\t');
    match text.contains(escaped) {
        false => text.to_owned(),
        true => text.chars().map(|c| if escaped(c) { c.escape_unicode().to_string() } else { c.to_string() }).collect(),
    }
}

/// The known name that was probably meant by `given`: at most two letters (a third of a short word) away, else `None`.
///
/// Case and the choice between `-`, `_` and blank do not count. Numbers do: `stop 7` was not meant by `stop 8`. So do axes: `x_m` was not meant by
/// `z_m`. And so do units that stand alone: `rad` was not meant by `mrad`. Of equally near names the first one wins.
pub fn closest_name<'a>(given: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let given = plain(given);
    let numbers_of_given = numbers(&given);
    let reach = given.len().div_ceil(3).min(2);
    known
        .into_iter()
        .map(|name| (plain(name), name))
        .filter(|(name, _)| name.len().abs_diff(given.len()) <= reach && numbers(name) == numbers_of_given)
        .filter(|(name, _)| !is_of_another_axis(&given, name) && !are_other_units(&given, name))
        .map(|(plain, name)| (edit_distance(&given, &plain), name))
        .filter(|(distance, _)| *distance <= reach)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, name)| name)
}

/// Units of lengths, angles and times, alone or at the ends of names.
const UNITS: [&str; 21] = [
    "m", "mm", "cm", "um", "in", "inch", "ft", "rad", "mrad", "urad", "deg", "mdeg", "grad", "gon", "arcmin", "arcsec",
    "rev", "s", "ms", "us", "ns",
];

/// What to do with a name that is there instead of the wanted one: one of another unit is not renamed alone.
pub fn renaming(there: &str, wanted: &str) -> String {
    conversion(there, wanted).unwrap_or_else(|| format!("rename \"{there}\" to \"{wanted}\""))
}

/// What to do where the name that is there ends in another unit than the wanted one.
pub fn conversion(there: &str, wanted: &str) -> Option<String> {
    let unit = |name: &str| name.rsplit_once('_').and_then(|(_, end)| UNITS.into_iter().find(|u| *u == end));
    let (from, to) = (unit(there)?, unit(wanted)?);
    (from != to).then(|| format!("convert \"{there}\" from {from} to {to}, and name it \"{wanted}\""))
}

/// Letters without case, one separator, and digits for the letters that look like them behind a digit.
fn plain(name: &str) -> Vec<char> {
    let mut plain: Vec<char> = Vec::with_capacity(name.len());
    for c in name.to_lowercase().chars() {
        let behind_a_digit = plain.last().is_some_and(char::is_ascii_digit);
        plain.push(match c {
            '-' | ' ' => '_',
            'o' if behind_a_digit => '0',
            'l' | 'i' if behind_a_digit => '1',
            c => c,
        });
    }
    plain
}

/// The numbers in a name, without leading zeros.
fn numbers(plain: &[char]) -> Vec<String> {
    let digits = plain.split(|c| !c.is_ascii_digit()).filter(|digits| !digits.is_empty());
    digits.map(|digits| digits.iter().skip_while(|c| **c == '0').collect()).collect()
}

/// Whether names differ in the letter of an axis alone, or in a word of one letter: `qx` and `qw`, `a_deg` and `b_deg`.
fn is_of_another_axis(a: &[char], b: &[char]) -> bool {
    let is_axis = |c: char| matches!(c, 'u'..='z');
    let is_end = |c: Option<&char>| c.is_none_or(|c| *c == '_');
    let mut apart = (0..a.len()).filter(|&k| b.get(k) != Some(&a[k]));
    match (apart.next(), apart.next()) {
        (Some(k), None) if a.len() == b.len() => {
            let is_word = is_end(k.checked_sub(1).map(|before| &a[before])) && is_end(a.get(k + 1));
            is_word || (is_axis(a[k]) && is_axis(b[k]))
        }
        _ => false,
    }
}

/// Whether both names are of units, and not of the same one.
pub fn is_another_unit(a: &str, b: &str) -> bool {
    are_other_units(&plain(a), &plain(b))
}

fn are_other_units(a: &[char], b: &[char]) -> bool {
    let is_unit = |name: &[char]| UNITS.iter().any(|unit| unit.chars().eq(name.iter().copied()));
    a != b && is_unit(a) && is_unit(b)
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
    use super::{Code, Error, Notice, closest_name, plain_name, renaming};

    #[test]
    fn a_column_of_another_unit_is_converted_not_renamed() {
        assert!(renaming("x_mm", "x_m").contains("from mm to m"));
        assert!(renaming("pitch_deg", "pitch_rad").contains("from deg to rad"));
        for (there, wanted) in [("X_m", "x_m"), ("qx_", "qx"), ("joint_b", "joint_a")] {
            assert!(renaming(there, wanted).starts_with("rename"), "{there}");
        }
    }

    #[test]
    fn names_with_control_characters_are_refused_and_never_shown_raw() {
        for bad in ["a\nb", "a\u{1b}[2Jb", "a\u{85}b", "a\u{7f}", "a\rb", "a\tb", "a\u{2028}b", "a\u{202e}b"] {
            let error = plain_name("joint", bad, "robot.urdf:3").unwrap_err();
            assert_eq!((error.exit_code(), error.place.as_str()), (2, "robot.urdf:3"));
            assert!(!error.what.contains(bad) && error.what.is_ascii(), "{}", error.what);
        }
        let zeros = plain_name("column", &"\0".repeat(5000), "joints.csv:1").unwrap_err();
        assert!(
            zeros.what.len() < 200 && zeros.remedy != plain_name("column", "a\n", "x").unwrap_err().remedy,
            "{zeros}"
        );
        for good in ["joint_a1", "Gelenk 1", "schön", "a;b\"c"] {
            assert_eq!(plain_name("joint", good, "x"), Ok(good));
        }
        let raw = "\u{1b}]0;x\u{7}";
        assert!(!Error::new(Code::FileFailed, raw, raw, raw).to_string().contains(['\u{1b}', '\u{7}']));
        assert!(!Notice::new(Code::ImageTruncated, raw, raw, raw).what.contains('\u{1b}'));
    }

    #[test]
    fn what_is_said_of_several_places_is_said_once_with_their_number() {
        let of = |place: &str, px: f64| {
            Notice::new(Code::BlurAsymmetric, place, format!("off by ({px:.4}, 0.1) px"), "look")
        };
        let joint =
            |name: &str| Notice::new(Code::JointBeyondLimits, "joints.csv", format!("{name} is 2 deg beyond"), "look");
        let all = [of("a.png", 0.1), joint("joint_1"), of("b.png", 0.2), of("c.png", -0.1), joint("joint_2")];
        let said = Notice::said_once(&all);
        assert_eq!(said.len(), 3, "{said:?}");
        assert_eq!(said[0].place, "3 places (a.png, b.png, c.png)");
        assert_eq!(said[1..], [joint("joint_1"), joint("joint_2")]);
    }

    #[test]
    fn a_misspelt_name_is_recognised_and_a_strange_one_is_not() {
        let known = ["joint_unit", "base", "tip", "camera_mount"];
        assert_eq!(closest_name("joint-units", known), Some("joint_unit"));
        assert_eq!(closest_name("Camera_Mont", known), Some("camera_mount"));
        assert_eq!(closest_name("tpi", known), None);
        assert_eq!(closest_name("tipp", known), Some("tip"));
        assert_eq!(closest_name("velocity", known), None);
        assert_eq!(closest_name("", known), None);
        let numbered = ["stop01", "stop07", "stop50", "joint_a1"];
        assert_eq!(closest_name("stop5O", numbered), Some("stop50"));
        assert_eq!(closest_name("stop_1", numbered), Some("stop01"));
        assert_eq!(closest_name("stop60", numbered), None);
        assert_eq!(closest_name("jont_a1", numbered), Some("joint_a1"));
        assert_eq!(closest_name("joint_a2", numbered), None);
        let axes = ["x_m", "y_m", "qx", "qy", "a_deg", "b_deg", "sigma_x_m"];
        for missing in ["z_m", "qw", "c_deg", "sigma_y_m"] {
            assert_eq!(closest_name(missing, axes), None, "{missing}");
        }
        assert_eq!(closest_name("X m", axes), Some("x_m"));
    }

    #[test]
    fn a_unit_is_not_taken_for_another() {
        for unit in ["mrad", "urad", "mdeg", "grad", "gon"] {
            assert_eq!(closest_name(unit, ["deg", "rad"]), None, "{unit}");
        }
        for unit in ["mm", "um", "in"] {
            assert_eq!(closest_name(unit, ["m"]), None, "{unit}");
        }
        assert_eq!(closest_name("Rad", ["deg", "rad"]), Some("rad"));
    }
}
