//! A measurement series as read.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::controller_file;
use super::controller_poses::ControllerPoses;
use super::inputs::InputFile;
use super::joints::Stops;
use super::manifest::{AngleUnit, Manifest};
use super::observation::ImageObservations;
use super::plate::Plate;
use super::run::Run;
use super::spatial::SpatialFiles;
use super::units::{self, JointsBeside};
use crate::error::{Code, Error, Notice, Result};
use crate::files::{self, FileKind};
use crate::urdf::Chain;

/// Where the image points come from.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// Images, `Stop::path` of every stop.
    Images {
        /// The folder of the images.
        folder: PathBuf,
        /// Images with the lens cap on, if any.
        dark: Vec<PathBuf>,
        /// Images of uniform white, if any.
        white: Vec<PathBuf>,
    },
    /// Observations from a file, in the order of the stops; stops without any are left out.
    Observations(Vec<ImageObservations>),
    /// A recording, which has the readings as well.
    Recording(PathBuf),
    /// Neither: what was measured stands in [`Series::spatial`].
    NoImages,
    /// Several cameras, or several images a stop: a view for each camera, see [`Series::views`].
    Cameras(Vec<Series>),
}

/// A measurement series as read: nothing is judged yet but the files themselves.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name of the series: that of its folder.
    pub name: String,
    /// The folder.
    pub folder: PathBuf,
    /// The manifest as written; see [`Series::camera_name`] and [`Series::mounting`] for its defaults.
    pub manifest: Manifest,
    /// The plate; without markers where there are no images.
    pub plate: Plate,
    /// Stops and raw readings (empty for a recording that has not been read yet).
    pub stops: Stops,
    /// Images, observations, a recording, or none of them.
    pub source: Source,
    /// Poses of the controller in the place of joint readings, in the order of the stops.
    pub controller: Option<ControllerPoses>,
    /// What was measured of the tip in space.
    pub spatial: SpatialFiles,
    /// What the view of one camera has in common with those of others; none for a series of its own.
    pub run: Option<Run>,
    /// What was seen while reading that the user should know.
    pub notices: Vec<Notice>,
    /// Text files that were read, with their hashes; see [`Series::image_hashes`] for the images.
    pub inputs: Vec<InputFile>,
}

impl Series {
    /// What each camera saw, a series each: the series itself where it has one camera.
    pub fn views(&self) -> &[Self] {
        match &self.source {
            Source::Cameras(views) => views,
            _ => std::slice::from_ref(self),
        }
    }

    /// Name of the series folder whose stops these are.
    pub fn run_name(&self) -> &str {
        self.run.as_ref().map_or(&self.name, |run| &run.name)
    }

    /// Place of a stop among those of the folder.
    pub fn row(&self, stop: usize) -> usize {
        self.run.as_ref().map_or(stop, |run| run.rows[stop])
    }

    /// Series with this camera share intrinsics.
    pub fn camera_name(&self) -> &str {
        self.manifest.camera().name.as_deref().unwrap_or(&self.name)
    }

    /// Series with this mounting share the hand-camera offset.
    pub fn mounting(&self) -> &str {
        self.manifest.camera().mounting.as_deref().unwrap_or(&self.name)
    }

    /// Unit of the revolute columns; recordings are in rad.
    pub fn joint_unit(&self) -> AngleUnit {
        self.manifest.joint_unit.unwrap_or(AngleUnit::Rad)
    }

    /// Readings of every stop in the order of `Chain::readings`, matched by name, rad and m; `None` for images taken
    /// off the robot.
    ///
    /// # Errors
    /// A joint of the chain that has no column (the columns are listed), and a `joint_unit` that cannot be true.
    pub fn readings_for(&self, chain: &Chain) -> Result<Vec<Option<Vec<f64>>>> {
        if let Source::Recording(path) = &self.source {
            let what = "the stops have not been taken out of this recording";
            return Err(Error::new(
                Code::RecordingNotConverted,
                path.display(),
                what,
                "convert it first: robotcal convert run1.mcap run1/",
            ));
        }
        if self.controller.is_some() {
            let what = "has poses and no joint readings";
            let remedy = "give a series with joints.csv";
            return Err(Error::new(Code::ReadingsMissing, self.readings_file().display(), what, remedy));
        }
        let stating = |unit: &str| format!("write joint_unit = \"{unit}\" in {}", self.manifest_file().display());
        units::readings_for(&self.readings_file(), &self.stops, self.joint_unit(), chain, stating)
    }

    /// What the readings of a chain give reason to say: columns that are not used, values beyond the URDF's limits.
    pub fn reading_notices(&self, chain: &Chain) -> Vec<Notice> {
        if self.controller.is_some() {
            return Vec::new();
        }
        units::notices(&self.readings_file(), (&self.stops, self.run.is_some()), self.joint_unit(), chain)
    }

    /// Joints that a chain does not need: those whose columns differ, and those without one.
    pub fn joints_beside(&self, chain: &Chain) -> JointsBeside {
        JointsBeside::of(&self.stops, chain)
    }

    /// The file that says where the robot stood, for messages.
    pub fn readings_file(&self) -> PathBuf {
        let written = if self.controller.is_some() { controller_file::NAME } else { "joints.csv" };
        self.folder.join(self.manifest.mcap.as_deref().unwrap_or(written))
    }

    /// The file that says what is said of the series, for messages: that of a recording has a name of its own.
    pub fn manifest_file(&self) -> PathBuf {
        let usual = self.folder.join("series.toml");
        let own = self.manifest.mcap.as_ref().map(|recording| own_manifest(&self.folder.join(recording)));
        own.filter(|own| self.inputs.iter().any(|input| input.path == *own)).unwrap_or(usual)
    }

    /// Hashes of all image files (stops in order, then dark and white). What cannot be opened has none: no image is seen there.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn image_hashes(&self) -> Result<Vec<InputFile>> {
        if let Source::Cameras(views) = &self.source {
            let of_views = views.iter().map(Self::image_hashes).collect::<Result<Vec<_>>>()?;
            return Ok(of_views.concat());
        }
        let mut files: Vec<&Path> = self.stops.stops.iter().filter_map(|s| s.path.as_deref()).collect();
        if let Source::Images { dark, white, .. } = &self.source {
            files.extend(dark.iter().chain(white).map(PathBuf::as_path));
        }
        let can_be_opened = |file: &&Path| files::open(file, FileKind::Image).is_ok();
        files.into_par_iter().filter(can_be_opened).map(InputFile::of_file).collect()
    }
}

/// `<its name>.toml` beside a recording; a dot in the name of a folder is a part of it.
pub(super) fn own_manifest(recording: &Path) -> PathBuf {
    let has_ending = recording.extension().is_some_and(|ending| ["mcap", "db3", "bag"].iter().any(|e| ending == *e));
    if has_ending || recording.is_file() {
        return recording.with_extension("toml");
    }
    recording.with_file_name(format!("{}.toml", file_name(recording)))
}

/// Last part of a path.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}
