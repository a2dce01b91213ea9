//! The views of a series whose stops were seen by several cameras: a series for each camera, with the stops that it saw.

use std::path::{Path, PathBuf};

use super::camera_section::{CameraMount, CameraSection};
use super::controller_poses::ControllerPoses;
use super::image_file::ImageRow;
use super::joints::{SeriesStop, StopKey, Stops};
use super::manifest::Manifest;

/// What one camera saw.
pub(super) struct CameraView {
    /// Name for messages and results.
    pub name: String,
    /// The manifest as if there were this camera alone.
    pub manifest: Manifest,
    /// Where its images lie.
    pub images: PathBuf,
    /// The stops that it saw, one an image.
    pub stops: Stops,
    /// Lines of images.csv that name the images.
    pub lines: Vec<u64>,
    /// Their places among all stops.
    pub rows: Vec<usize>,
    /// Poses of the controller at these stops.
    pub controller: Option<ControllerPoses>,
}

/// All stops of a series, and where they come from.
pub(super) struct WholeSeries<'a> {
    pub series: &'a str,
    pub folder: &'a Path,
    pub manifest: &'a Manifest,
    pub stops: &'a Stops,
    pub controller: Option<&'a ControllerPoses>,
}

impl WholeSeries<'_> {
    /// The views of all cameras, by the rows of images.csv.
    pub fn views(&self, rows: &[ImageRow]) -> Vec<CameraView> {
        let unstated = [CameraSection::UNSTATED];
        let stated = self.manifest.cameras.as_slice();
        let cameras = if stated.is_empty() { &unstated[..] } else { stated };
        let view = |(k, camera): (usize, &CameraSection)| {
            // In the order of the stops, whatever that of the table is: images of a problem stand in it.
            let mut own: Vec<&ImageRow> = rows.iter().filter(|r| r.camera == k).collect();
            own.sort_by_key(|r| r.stop);
            self.view(camera, cameras.len() > 1, &own)
        };
        cameras.iter().enumerate().map(view).collect()
    }

    fn view(&self, camera: &CameraSection, several: bool, rows: &[&ImageRow]) -> CameraView {
        let called = camera.name.as_deref().filter(|_| several);
        let folder = match (&camera.images, called) {
            (Some(folder), _) => self.folder.join(folder),
            (None, Some(name)) => self.folder.join("images").join(name),
            (None, None) => self.folder.join("images"),
        };
        let stop = |row: &&ImageRow| {
            let stop = &self.stops.stops[row.stop];
            SeriesStop { image: row.image.clone(), ..stop.clone() }
        };
        CameraView {
            name: called.map_or_else(|| self.series.to_owned(), |name| format!("{} {name}", self.series)),
            manifest: Manifest {
                cameras: camera.clone().into(),
                camera_mount: self.manifest.mount_of(camera),
                ..self.manifest.clone()
            },
            images: folder,
            stops: Stops { stops: rows.iter().map(stop).collect(), key: StopKey::Image, ..self.stops.clone() },
            lines: rows.iter().map(|r| r.line).collect(),
            rows: rows.iter().map(|r| r.stop).collect(),
            controller: self.controller.map(|c| c.of_rows(rows.iter().map(|r| r.stop))),
        }
    }
}

/// True where some cameras are in the hand and others are fixed: they see different plates.
pub(super) fn has_mixed_mounts(manifest: &Manifest) -> bool {
    let mounts = || manifest.cameras.iter().map(|c| manifest.mount_of(c));
    mounts().any(|m| m == Some(CameraMount::Hand)) && mounts().any(|m| m == Some(CameraMount::Fixed))
}
