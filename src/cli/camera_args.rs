//! Which cameras an adjustment begins with: a lens by name, or the camera file of another program.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::error::{Code, Error, Notice, Result};
use crate::output::camera_formats::{ReadCamera, read_camera_file};
use crate::problem::{KnownCamera, LensChoice, MeasuredSeries};

/// Flags of cameras.
#[derive(Debug, Args)]
pub(super) struct CameraArgs {
    /// Lens: brown, fisheye, parallax, rational, thin_prism, brown+field, fisheye+field; auto: the simplest of all that none beats decisively; ros: of those that camera.yaml can express [default: as in series.toml, else auto]
    #[arg(long, value_name = "LENS", help_heading = "What is estimated")]
    camera: Option<String>,
    /// Camera to start from, in a file of OpenCV, Kalibr, mrcal or ROS; of several cameras NAME=FILE for each
    #[arg(long, value_name = "FILE", conflicts_with = "camera", help_heading = "What is estimated")]
    camera_file: Vec<String>,
    /// Take the cameras of --camera-file as they are instead of starting from them
    #[arg(long, requires = "camera_file", help_heading = "What is estimated")]
    hold_camera: bool,
}

impl CameraArgs {
    /// Sets lens or camera of every series; returns what is to be said of them.
    ///
    /// # Errors
    /// Lenses that are not known, files that cannot be read or are of another camera.
    pub fn apply(&self, series: &mut [MeasuredSeries]) -> Result<Vec<Notice>> {
        match self.camera.as_deref() {
            Some("auto") => series.iter_mut().for_each(|s| s.lens_choice = LensChoice::All),
            Some("ros") => series.iter_mut().for_each(|s| s.lens_choice = LensChoice::Exported),
            Some(name) => {
                let lens = super::simulate::lens(name)?;
                series.iter_mut().for_each(|s| (s.lens, s.lens_choice) = (lens, LensChoice::Settled));
            }
            None => {}
        }
        let mut notices = Vec::new();
        for given in &self.camera_file {
            notices.extend(self.take(given, series)?);
        }
        Ok(notices)
    }

    fn take(&self, given: &str, series: &mut [MeasuredSeries]) -> Result<Option<Notice>> {
        let mut names: Vec<String> = series.iter().filter(|s| s.has_images).map(|s| s.camera.clone()).collect();
        names.dedup();
        let (name, path) = match given.split_once('=') {
            Some((name, path)) if names.iter().any(|n| n == name) => (name.to_owned(), PathBuf::from(path)),
            _ => match &names[..] {
                [only] => (only.clone(), PathBuf::from(given)),
                _ => {
                    let what = format!("\"{given}\" does not say which camera: there are {}", names.join(", "));
                    return Err(Error::new(
                        Code::OptionRange,
                        "--camera-file",
                        what,
                        "write NAME=FILE for each camera",
                    ));
                }
            },
        };
        let read = read_camera_file(&path, Some(&name))?;
        let lost = read.what_is_lost();
        if let (true, Some(lost)) = (self.hold_camera, &lost) {
            let remedy = "leave --hold-camera out, to start from the nearest";
            return Err(Error::new(Code::LensUnknown, path.display(), lost, remedy));
        }
        let ReadCamera { camera, .. } = read;
        for s in series.iter_mut().filter(|s| s.camera == name) {
            require_size(&path, [camera.width_px, camera.height_px], s)?;
            (s.lens, s.lens_choice) = (camera.lens, LensChoice::Settled);
            s.known_camera = Some(KnownCamera { camera: camera.clone(), held: self.hold_camera });
        }
        Ok(lost.map(|lost| Notice::new(Code::LensChosen, path.display(), lost, "")))
    }
}

fn require_size(path: &Path, [width, height]: [u32; 2], s: &MeasuredSeries) -> Result<()> {
    if [width, height] == [s.width_px, s.height_px] {
        return Ok(());
    }
    let what = format!(
        "is of a camera with {width}x{height} px; the images of series {} have {}x{} px",
        s.name, s.width_px, s.height_px
    );
    Err(Error::new(Code::SeriesDisagree, path.display(), what, "give the file of this camera, at this resolution"))
}
