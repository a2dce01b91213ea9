//! The files in a folder of images.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::measurement_series::file_name;
use super::table::composed;
use crate::error::{Code, Error, Result, plain_name};

const IMAGE_EXTENSIONS: [&str; 9] = ["png", "tif", "tiff", "pgm", "pnm", "ppm", "jpg", "jpeg", "bmp"];

/// True for a file that is an image by the end of its name.
pub fn is_image(path: &Path) -> bool {
    path.extension().is_some_and(|end| IMAGE_EXTENSIONS.contains(&end.to_string_lossy().to_lowercase().as_str()))
}

/// Image files of a folder in the order of their names.
pub(super) fn image_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(|e| match Error::io(folder, &e) {
        error if error.code == Code::FileMissing => Error { remedy: "copy the images into it".to_owned(), ..error },
        error => error,
    })?;
    let mut files = Vec::new();
    for entry in entries {
        let path = entry.map_err(|e| Error::io(folder, &e))?.path();
        if is_image(&path) && !file_name(&path).starts_with('.') {
            plain_name("image", &file_name(&path), folder.display())?;
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// Names of the files of a folder that are no images by their names.
pub(super) fn other_files(folder: &Path, images: &BTreeSet<String>) -> Result<BTreeMap<String, PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(|e| Error::io(folder, &e))?;
    let paths = entries.map(|entry| entry.map(|e| e.path()).map_err(|e| Error::io(folder, &e)));
    let paths = paths.collect::<Result<Vec<PathBuf>>>()?;
    let all = by_name(paths.into_iter().filter(|p| p.is_file()).collect());
    Ok(all.into_iter().filter(|(name, _)| !images.contains(name)).collect())
}

/// Files by their names as tables have them.
pub(super) fn by_name(files: Vec<PathBuf>) -> BTreeMap<String, PathBuf> {
    files.into_iter().map(|path| (composed(&file_name(&path)).into_owned(), path)).collect()
}
