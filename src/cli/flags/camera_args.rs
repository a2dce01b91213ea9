//! Which cameras an adjustment begins with: a lens by name, or the camera file of another program.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::Args;

use crate::error::{Code, Error, Notice, Result};
use crate::files::word;
use crate::model::camera::Lens;
use crate::output::camera_formats::{ReadCamera, read_camera_file};
use crate::problem::{KnownCamera, LensChoice, MeasuredSeries};

/// The lens is chosen by the data.
const AUTO: &str = "auto";
/// The same, of those that camera.yaml can express.
const ROS: &str = "ros";

/// Flags of cameras.
#[derive(Debug, Args)]
pub struct CameraArgs {
    /// Lens: brown, fisheye, parallax, rational, thin_prism, brown+field, fisheye+field; auto: the simplest of all that none beats decisively; ros: of those that camera.yaml can express [default: as in series.toml, else auto]
    #[arg(long, value_name = "LENS", help_heading = "What is estimated")]
    camera: Option<String>,
    /// Camera to start from, in a file of OpenCV, Kalibr, mrcal or ROS; of several cameras NAME=FILE for each; of a file of several cameras (Kalibr) FILE#cam1, NAME=FILE#cam1
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
        if self.camera.is_some() {
            // A series of an earlier solution may have the camera of a file.
            series.iter_mut().for_each(|s| s.known_camera = None);
        }
        match self.camera.as_deref() {
            Some(AUTO) => series.iter_mut().for_each(|s| s.lens_choice = LensChoice::All),
            Some(ROS) => series.iter_mut().for_each(|s| s.lens_choice = LensChoice::Exported),
            Some(name) => {
                let lens = lens(name).map_err(with_choices)?;
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
        let names: BTreeSet<&str> = series.iter().filter(|s| s.has_images).map(|s| s.camera.as_str()).collect();
        let names: Vec<String> = names.into_iter().map(str::to_owned).collect();
        let (name, path) = match given.split_once('=') {
            Some((name, path)) if names.iter().any(|n| n == name) => (name.to_owned(), PathBuf::from(path)),
            _ => match &names[..] {
                [only] if !names_another(given) => (only.clone(), PathBuf::from(given)),
                _ => {
                    let what = format!("\"{given}\" does not say which camera of {}", names.join(", "));
                    return Err(Error::new(
                        Code::OptionRange,
                        "--camera-file",
                        what,
                        "write NAME=FILE for each camera (NAME=FILE#cam1 where a camchain of Kalibr holds several)",
                    ));
                }
            },
        };
        let (path, in_file) = camera_in_file(path);
        let read =
            read_camera_file(&path, Some(in_file.as_deref().unwrap_or(&name))).map_err(|e| which(e, &name, &path))?;
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

/// The lens of a name on the command line.
pub fn lens(name: &str) -> Result<Lens> {
    Lens::from_name(name).ok_or_else(|| {
        let remedy = format!("use one of: {}", Lens::names().join(", "));
        Error::new(Code::LensUnknown, "lens", format!("'{name}' is not a lens model of this program"), remedy)
    })
}

/// Whether a file that is there stands behind a name.
fn names_another(given: &str) -> bool {
    let behind = given.split_once('=').map(|(_, path)| camera_in_file(PathBuf::from(path)).0);
    !Path::new(given).exists() && behind.is_some_and(|path| path.exists())
}

/// Beside the lenses, those that the data choose.
fn with_choices(error: Error) -> Error {
    let remedy = format!("{}; {AUTO} or {ROS} where the data are to choose", error.remedy);
    Error { remedy, ..error }
}

/// A file, and the camera in it that is named behind a `#`.
fn camera_in_file(given: PathBuf) -> (PathBuf, Option<String>) {
    let parts = given.to_str().and_then(|text| text.rsplit_once('#'));
    match parts {
        Some((file, camera)) if !given.exists() => (PathBuf::from(file), Some(camera.to_owned())),
        _ => (given, None),
    }
}

/// Of several cameras in a file none is named: how it is done here.
fn which(error: Error, name: &str, path: &Path) -> Error {
    if error.code != Code::OptionMissing {
        return error;
    }
    let remedy = format!("name one of them behind a #: {}", word(format!("{name}={}#cam0", path.display())));
    Error { remedy, ..error }
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

#[cfg(test)]
mod tests {
    use super::*;

    const CAMCHAIN: &str = "\
cam0:
  camera_model: pinhole
  intrinsics: [1100.0, 1100.0, 640.0, 512.0]
  distortion_model: radtan
  distortion_coeffs: [-0.11, 0.09, 0.0004, -0.0003]
  resolution: [1280, 1024]
cam1:
  camera_model: pinhole
  intrinsics: [800.0, 800.0, 640.0, 512.0]
  distortion_model: radtan
  distortion_coeffs: [-0.05, 0.03, 0.0, 0.0]
  resolution: [1280, 1024]
";

    fn series(camera: &str) -> MeasuredSeries {
        let own = MeasuredSeries::without_images(camera, true, Vec::new());
        MeasuredSeries { camera: camera.to_owned(), has_images: true, width_px: 1280, height_px: 1024, ..own }
    }

    fn focal_lengths(given: &[String], cameras: &[&str]) -> Result<Vec<f64>> {
        let args = CameraArgs { camera: None, camera_file: given.to_vec(), hold_camera: false };
        let mut all: Vec<MeasuredSeries> = cameras.iter().map(|name| series(name)).collect();
        args.apply(&mut all)?;
        Ok(all.iter().map(|s| s.known_camera.as_ref().map_or(f64::NAN, |c| c.camera.parameters[0])).collect())
    }

    #[test]
    fn an_unknown_lens_is_answered_with_all_that_can_be_given() {
        let args = CameraArgs { camera: Some("pinhole".into()), camera_file: Vec::new(), hold_camera: false };
        let refused = args.apply(&mut [series("front")]).unwrap_err();
        assert_eq!(refused.code, Code::LensUnknown);
        assert!([AUTO, ROS, "brown"].iter().all(|name| refused.remedy.contains(name)), "{}", refused.remedy);
    }

    #[test]
    fn a_lens_that_is_named_takes_the_place_of_a_camera_that_was_given_before() {
        let args = CameraArgs { camera: Some("brown".into()), camera_file: Vec::new(), hold_camera: false };
        let camera = crate::model::camera::Camera::pinhole(crate::model::camera::Lens::Fisheye, 1280, 1024, 900.0);
        let mut all = [MeasuredSeries { known_camera: Some(KnownCamera { camera, held: true }), ..series("front") }];
        args.apply(&mut all).unwrap();
        assert_eq!((all[0].known_camera.is_none(), all[0].lens.name()), (true, "brown"));
    }

    /// Kalibr calls its cameras cam0 and cam1, whatever they are called in series.toml.
    #[test]
    fn cameras_of_a_camchain_are_named_behind_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("camchain.yaml");
        std::fs::write(&file, CAMCHAIN).unwrap();
        let of = |text: &str| text.replace("FILE", file.to_str().unwrap());
        let both = [of("left=FILE#cam1"), of("right=FILE#cam0")];
        assert_eq!(focal_lengths(&both, &["left", "right"]).unwrap(), [800.0, 1100.0]);
        assert_eq!(focal_lengths(&[of("FILE#cam1")], &["front"]).unwrap(), [800.0]);
        // Of cameras by turns each is named once, too.
        let by_turns = [of("left=FILE#cam1"), of("right=FILE#cam0")];
        assert_eq!(focal_lengths(&by_turns, &["left", "right", "left"]).unwrap(), [800.0, 1100.0, 800.0]);
        let refused = focal_lengths(&[of("FILE#cam1")], &["left", "right", "left"]).unwrap_err();
        assert_eq!((refused.code, refused.what.matches("left").count()), (Code::OptionRange, 1));
        for given in ["back=FILE#cam1", "back=FILE"] {
            assert_eq!(focal_lengths(&[of(given)], &["front"]).unwrap_err().code, Code::OptionRange);
        }
        for given in ["FILE", "front=FILE", "FILE#cam2"] {
            let refused = focal_lengths(&[of(given)], &["front"]).unwrap_err();
            assert_eq!(refused.code, Code::OptionMissing);
            assert!(refused.remedy.ends_with(&of("front=FILE#cam0")), "{}", refused.remedy);
        }
    }
}
