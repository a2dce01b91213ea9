//! Names in files: of images, plates and parameters, free of paths and safe as file names.

use std::collections::{BTreeMap, BTreeSet};

use super::Context;
use crate::problem::{Image, Problem};

/// Names of images: that of the file; with its series in front where two series have an image of the same name.
pub(super) struct ImageNames {
    names: Vec<String>,
}

impl ImageNames {
    pub fn new(problem: &Problem, context: &Context) -> Self {
        let mut count: BTreeMap<&str, usize> = BTreeMap::new();
        problem.images.iter().for_each(|i| *count.entry(&i.name).or_default() += 1);
        let name = |image: &Image| match count[image.name.as_str()] {
            1 => image.name.clone(),
            _ => format!("{}/{}", series_name(context, image.series), image.name),
        };
        Self { names: problem.images.iter().map(name).collect() }
    }

    pub fn of(&self, image: usize) -> &str {
        &self.names[image]
    }
}

/// Name of a series, or its number where it has none.
pub(super) fn series_name(context: &Context, series: usize) -> String {
    context.series.get(series).cloned().unwrap_or_else(|| format!("series {}", series + 1))
}

/// Name of a plate: that of the first series that shows it.
pub(super) fn plate_name(problem: &Problem, context: &Context, plate: usize) -> String {
    let first = problem.images.iter().find(|i| i.plate == plate);
    first.map_or_else(|| format!("plate {}", plate + 1), |i| series_name(context, i.series))
}

/// Names of all columns; those of several plates by series instead of by path.
pub(super) fn column_names(problem: &Problem, context: &Context) -> Vec<String> {
    let layout = &problem.layout;
    let mut names: Vec<String> = layout.columns.iter().map(|c| c.name.clone()).collect();
    if layout.shapes.len() > 1 {
        for (plate, range) in layout.shapes.iter().enumerate() {
            for name in &mut names[range.clone()] {
                let mode = name.rsplit_once('.').map_or("", |(_, mode)| mode).to_owned();
                *name = format!("plate_shape/{}.{mode}", plate_name(problem, context, plate));
            }
        }
    }
    names
}

/// Letters, digits, `-`, `_` and `.`; everything else becomes `_`.
pub(super) fn file_part(name: &str) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    let part: String = name.chars().map(safe).collect();
    if part.trim_matches('.').is_empty() { "unnamed".into() } else { part }
}

/// `stem.extension` for one, `stem.name.extension` for each of several; no two alike, whatever the case.
pub(super) fn file_names(stem: &str, extension: &str, names: &[String]) -> Vec<String> {
    if names.len() == 1 {
        return vec![format!("{stem}.{extension}")];
    }
    let mut taken = BTreeSet::new();
    let mut unique = |name: &String| {
        let part = file_part(name);
        let mut candidate = part.clone();
        let mut k = 2;
        while !taken.insert(candidate.to_lowercase()) {
            candidate = format!("{part}-{k}");
            k += 1;
        }
        format!("{stem}.{candidate}.{extension}")
    };
    names.iter().map(&mut unique).collect()
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
}
