//! An image with what was seen in it.

use std::path::{Path, PathBuf};

use crate::detect::{Detection, SeriesImage};
use crate::error::Notice;

/// An image with what was seen in it.
#[derive(Debug, Clone, PartialEq)]
pub struct SeenImage {
    /// File name, the key of joints.csv.
    pub name: String,
    /// The file, where it is there.
    pub path: Option<PathBuf>,
    /// Width and height, px; `None` for an image that could not be read.
    pub size: Option<(usize, usize)>,
    /// What was found, or why the image cannot be used.
    pub detection: Detection,
}

impl SeenImage {
    /// What the detector saw in an image.
    pub(super) fn new(name: &str, path: Option<&Path>, seen: SeriesImage) -> Self {
        Self { name: name.to_owned(), path: path.map(Path::to_path_buf), size: seen.size, detection: seen.detection }
    }

    /// Notices of the detector, with the name of the image.
    pub fn notices(&self) -> impl Iterator<Item = Notice> {
        let named = |n: &Notice| Notice { place: format!("{}: {}", self.name, n.place), ..n.clone() };
        self.detection.notices.iter().map(named)
    }
}
