//! Dark and white images: which folders they are looked for in.

use std::path::{Path, PathBuf};

use super::image_folder::image_files;
use super::measurement_series::{Series, Source};
use crate::error::{Code, Notice, Result};

/// Names of their folders.
const NAMES: [&str; 2] = ["dark", "white"];

/// Images without light, and of a surface of even light.
#[derive(Debug, Default)]
pub(super) struct Light {
    pub dark: Vec<PathBuf>,
    pub white: Vec<PathBuf>,
}

impl Light {
    /// Those in dark/ and white/ of the first folder that has them.
    pub fn of(folders: &[&Path]) -> Result<Self> {
        let optional = |name: &str| {
            let there = folders.iter().map(|folder| folder.join(name)).find(|path| holds_images(path));
            there.map_or_else(|| Ok(Vec::new()), |path| image_files(&path))
        };
        let [dark, white] = NAMES.map(optional);
        Ok(Self { dark: dark?, white: white? })
    }
}

fn holds_images(path: &Path) -> bool {
    path.is_dir() && image_files(path).map_or(true, |files| !files.is_empty())
}

/// Folders that may hold those of a camera whose images lie in `images`: this one and the one above it, unless others have them, too, and that
/// of the series where it has this camera alone.
pub(super) fn lights_of<'a>(images: &'a Path, of_all: &[PathBuf], series: &'a Path) -> Vec<&'a Path> {
    if of_all.len() == 1 {
        return [Some(images), images.parent(), Some(series)].into_iter().flatten().collect();
    }
    let with = |folder: &Path| of_all.iter().filter(|other| other.starts_with(folder)).count();
    let own = [Some(images), images.parent()].into_iter().flatten();
    own.filter(|folder| with(folder) == 1 && !series.starts_with(folder)).collect()
}

/// The same of a series of one camera whose images lie in one folder.
pub(super) fn unused_light_of_one(series: &Series) -> Vec<Notice> {
    match &series.source {
        Source::Images { folder, .. } => {
            unused_light(series, std::slice::from_ref(folder), std::slice::from_ref(series))
        }
        _ => Vec::new(),
    }
}

/// Says of dark/ and white/ that lie beside the images, or within their folders, and are of no camera.
pub(super) fn unused_light(series: &Series, of_all: &[PathBuf], views: &[Series]) -> Vec<Notice> {
    let mut folders: Vec<&Path> =
        of_all.iter().flat_map(|images| [Some(images.as_path()), images.parent()]).flatten().collect();
    folders.push(&series.folder);
    folders.sort();
    folders.dedup();
    let is_used = |path: &Path| {
        let of_view = |view: &Series| match &view.source {
            Source::Images { dark, white, .. } => dark.iter().chain(white).any(|image| image.parent() == Some(path)),
            _ => false,
        };
        views.iter().any(of_view)
    };
    let there = folders.into_iter().flat_map(|folder| NAMES.map(|name| folder.join(name)));
    let unused = there.filter(|path| holds_images(path) && !is_used(path));
    let (what, remedy) = match of_all.len() {
        1 => (
            "holds images of light that are not used: another folder of this name, nearer to the images, is",
            "keep those of one of the two folders",
        ),
        _ => (
            "holds images of light, and nothing says of which camera: they are not used",
            "put those of each camera into dark/ and white/ beside or within the folder of its own images",
        ),
    };
    let said = unused.map(|path| Notice::new(Code::FlatFieldUnused, path.display(), what, remedy));
    said.collect()
}
