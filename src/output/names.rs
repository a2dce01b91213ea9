//! Names in files: of images, plates and parameters, free of paths and safe as file names.

use std::collections::{BTreeMap, BTreeSet};

use crate::problem::{Image, Problem};

/// Names of images: that of the file; with its series in front where two series have an image of the same name.
pub(super) struct ImageNames {
    names: Vec<String>,
}

impl ImageNames {
    pub fn new(problem: &Problem, series: &[String]) -> Self {
        let mut count: BTreeMap<&str, usize> = BTreeMap::new();
        problem.images.iter().for_each(|i| *count.entry(&i.name).or_default() += 1);
        let name = |image: &Image| match count[image.name.as_str()] {
            1 => image.name.clone(),
            _ => format!("{}/{}", series_name(series, image.series), image.name),
        };
        Self { names: problem.images.iter().map(name).collect() }
    }

    pub fn of(&self, image: usize) -> &str {
        &self.names[image]
    }
}

/// Name of a series, or its number where it has none.
pub(super) fn series_name(all: &[String], series: usize) -> String {
    all.get(series).cloned().unwrap_or_else(|| format!("series {}", series + 1))
}

/// Name of a plate: as stated, with that of the first series that shows it where another plate is called the same; else that of the series.
pub(super) fn plate_name(problem: &Problem, series: &[String], plate: usize) -> String {
    let stated = problem.plates.get(plate).and_then(|p| p.name.as_ref());
    let is_of_others = |name: &String| problem.plates.iter().filter(|p| p.name.as_ref() == Some(name)).count() > 1;
    let first = problem.images.iter().find(|i| i.plate == plate);
    let of_series = || first.map_or_else(|| format!("plate {}", plate + 1), |i| series_name(series, i.series));
    match stated {
        Some(name) if is_of_others(name) => format!("{name} ({})", of_series()),
        Some(name) => name.clone(),
        None => of_series(),
    }
}

/// Names of all columns; those of several plates by series instead of by path.
pub(super) fn column_names(problem: &Problem, series: &[String]) -> Vec<String> {
    let layout = &problem.layout;
    let mut names: Vec<String> = layout.columns.iter().map(|c| c.name.clone()).collect();
    if layout.shapes.len() > 1 {
        for (plate, range) in layout.shapes.iter().enumerate() {
            for name in &mut names[range.clone()] {
                let mode = name.rsplit_once('.').map_or("", |(_, mode)| mode).to_owned();
                *name = format!("plate_shape/{}.{mode}", plate_name(problem, series, plate));
            }
        }
    }
    names
}

/// Most characters of a name within the name of a file, which may have 255 bytes on the usual disks.
const LONGEST: usize = 100;

/// Letters, digits, `-`, `_` and `.`; everything else becomes `_`. Never hidden, never too long, never one of the names
/// that some systems keep for devices.
pub(super) fn file_part(name: &str) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    let part: String = name.chars().map(safe).take(LONGEST).collect();
    let part = part.trim_end_matches('.');
    match part.strip_prefix('.') {
        Some(hidden) if !hidden.trim_matches('.').is_empty() => format!("_{hidden}"),
        Some(_) => "unnamed".into(),
        None if part.is_empty() => "unnamed".into(),
        None if is_device(part) => format!("_{part}"),
        None => part.into(),
    }
}

/// A name that Windows does not give to files, whatever its extension.
fn is_device(name: &str) -> bool {
    let stem = name.split('.').next().unwrap_or(name).to_ascii_uppercase();
    let port = |p: &str| stem.strip_prefix(p).is_some_and(|n| n.len() == 1 && n != "0" && n.parse::<u8>().is_ok());
    ["CON", "PRN", "AUX", "NUL"].contains(&stem.as_str()) || port("COM") || port("LPT")
}

/// Safe parts of file names, no two alike, whatever the case.
pub(super) fn file_parts<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut taken = BTreeSet::new();
    let mut unique = |name: &str| {
        let part = file_part(name);
        let mut candidate = part.clone();
        let mut k = 2;
        while !taken.insert(candidate.to_lowercase()) {
            candidate = format!("{part}-{k}");
            k += 1;
        }
        candidate
    };
    names.map(&mut unique).collect()
}

/// `stem.extension` for one, `stem.name.extension` for each of several; no two alike, whatever the case.
pub(super) fn file_names(stem: &str, extension: &str, names: &[String]) -> Vec<String> {
    if names.len() == 1 {
        return vec![format!("{stem}.{extension}")];
    }
    file_parts(names.iter().map(String::as_str)).iter().map(|part| format!("{stem}.{part}.{extension}")).collect()
}

/// Name of the folder for the results of these series: theirs, without what would lead elsewhere or cannot be typed.
pub fn folder_name(series: &[String]) -> String {
    let safe = |c: char| if c.is_control() || "/\\:*?\"<>|".contains(c) { '_' } else { c };
    let name: String = series.join("+").chars().map(safe).take(LONGEST).collect();
    match name.trim_matches('.').is_empty() {
        true => "results".into(),
        false if name.starts_with('.') => format!("_{}", &name[1..]),
        false => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn several_files_have_safe_and_different_names() {
        let names = ["left".to_string(), "a b/../c".into(), "a b_.._c".into(), "Left".into()];
        let files = file_names("camera", "yaml", &names);
        assert_eq!(files, ["camera.left.yaml", "camera.a_b_.._c.yaml", "camera.a_b_.._c-2.yaml", "camera.Left-2.yaml"]);
        assert_eq!(file_names("camera", "yaml", &names[..1]), ["camera.yaml"]);
        assert_eq!(file_part(".."), "unnamed");
    }

    #[test]
    fn names_of_devices_hidden_and_endless_names_are_changed() {
        for (name, part) in [
            ("", "unnamed"),
            ("...", "unnamed"),
            (".hidden", "_hidden"),
            ("../../etc", "_._.._etc"),
            ("nul", "_nul"),
            ("COM7.left", "_COM7.left"),
            ("com10", "com10"),
            ("\u{1b}[2J\n", "__2J_"),
            ("dots..", "dots"),
        ] {
            assert_eq!(file_part(name), part, "{name:?}");
        }
        assert_eq!(file_part(&"x".repeat(300)).len(), LONGEST);
        let long = ["y".repeat(300), "y".repeat(301)];
        let parts = file_parts(long.iter().map(String::as_str));
        assert!(parts[0] != parts[1] && parts.iter().all(|p| p.len() < 110));
    }

    #[test]
    fn the_folder_of_a_series_is_a_name_and_no_way() {
        let folder = |names: &[&str]| folder_name(&names.iter().map(|n| n.to_string()).collect::<Vec<_>>());
        assert_eq!(folder(&["run 1", "M\u{fc}nchen"]), "run 1+M\u{fc}nchen");
        assert_eq!(folder(&["../x"]), "_._x");
        assert_eq!(folder(&[".."]), "results");
        assert_eq!(folder(&["a\u{1b}[31m\n"]), "a_[31m_");
        assert!(folder(&["z".repeat(400).as_str()]).len() < 255);
    }
}
