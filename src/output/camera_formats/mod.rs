//! Camera models in the files of other programs: read, and written by name.
//!
//! To add a format: a file in this folder, a variant of [`CameraFormat`] and its place in `ALL`, which is not asked for; the compiler names what else is missing. A lens that a format cannot
//! express is refused with what its nearest model there loses, or written as that model where this is asked for.

mod distortion;
mod kalibr;
mod model;
mod mrcal;
mod opencv;
pub(super) mod ros;
mod yaml;

use std::path::Path;

use self::model::Sayable;
pub use self::model::{ReadCamera, loss_words};
use crate::error::{Code, Error, Result};
use crate::files::{self, FileKind};
use crate::model::camera::{Camera, LensFit, fit_lens_holding};

/// Loss below which a model is the same, px.
const SAME_PX: f64 = 1e-6;

/// Formats by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraFormat {
    /// `cv::FileStorage`, as the calibration sample of OpenCV writes it.
    OpenCv,
    /// The camchain of Kalibr.
    Kalibr,
    /// `.cameramodel` of mrcal.
    Mrcal,
    /// `camera_info` of ROS.
    Ros,
}

impl CameraFormat {
    /// All of them; the compiler does not ask for a new one here.
    pub const ALL: [Self; 4] = [Self::OpenCv, Self::Kalibr, Self::Mrcal, Self::Ros];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::OpenCv => "opencv",
            Self::Kalibr => "kalibr",
            Self::Mrcal => "mrcal",
            Self::Ros => "ros",
        }
    }

    /// The format of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|f| f.name() == name)
    }

    /// What its files can say.
    fn sayable(self) -> &'static [Sayable] {
        match self {
            Self::OpenCv => opencv::SAYABLE,
            Self::Kalibr => kalibr::SAYABLE,
            Self::Mrcal => mrcal::SAYABLE,
            Self::Ros => ros::SAYABLE,
        }
    }

    /// Text of a camera that the format can say.
    fn text(self, name: &str, camera: &Camera) -> String {
        match self {
            Self::OpenCv => opencv::text(camera),
            Self::Kalibr => kalibr::text(name, camera),
            Self::Mrcal => mrcal::text(camera),
            Self::Ros => ros::text(name, camera),
        }
    }

    /// The nearest camera that the format can say, for points between two depths (m), and what it loses; `None` where it says this one.
    fn nearest(self, camera: &Camera, depths_m: &[f64; 2]) -> Option<Option<LensFit>> {
        if self.sayable().iter().any(|s| s.says(camera)) {
            return None;
        }
        let fits = self.sayable().iter().filter_map(|s| fit_lens_holding(camera, s.lens, &s.held(), depths_m));
        Some(fits.min_by(|a, b| a.rms_px.total_cmp(&b.rms_px)))
    }
}

/// What is done with a lens that a format does not have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OtherLens {
    /// It is refused, with what the nearest model would lose.
    Refused,
    /// The nearest model is written, and what it loses stands in the file.
    Nearest,
}

/// A written camera.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraText {
    /// The file.
    pub text: String,
    /// RMS and largest loss over the image, px, where it is the nearest model.
    pub loss_px: Option<[f64; 2]>,
}

/// Text of a camera that sees between two depths (m).
///
/// # Errors
/// A lens that the format cannot say, unless the nearest is asked for; one that nothing in the format comes near to.
pub fn camera_text(
    format: CameraFormat,
    (name, camera): (&str, &Camera),
    depths_m: &[f64; 2],
    other: OtherLens,
) -> Result<CameraText> {
    let Some(nearest) = format.nearest(camera, depths_m) else {
        return Ok(CameraText { text: format.text(name, camera), loss_px: None });
    };
    let lens = camera.lens.name();
    let refuse =
        |what: String, remedy: &str| Error::new(Code::CameraFileImpossible, format!("camera {name}"), what, remedy);
    let Some(LensFit { camera: near, rms_px, worst_px }) = nearest else {
        let what = format!("no camera model of {} comes near to its {lens} lens", format.name());
        return Err(refuse(what, "identify with --camera brown or rational"));
    };
    if other == OtherLens::Refused && rms_px > SAME_PX {
        let what = format!(
            "{} cannot express its {lens} lens: the nearest model there ({}) loses {}",
            format.name(),
            near.lens.name(),
            loss_words([rms_px, worst_px])
        );
        return Err(refuse(what, "give --nearest to write that model, or identify with a lens that the format has"));
    }
    let remark = format!(
        "# NOT THE IDENTIFIED LENS ({lens}) but the nearest {}: loss {},\n\
         # for points {:.3} to {:.3} m away.\n",
        near.lens.name(),
        loss_words([rms_px, worst_px]),
        depths_m[0],
        depths_m[1]
    );
    let text = remarked(&remark, &format.text(name, &near));
    Ok(CameraText { text, loss_px: Some([rms_px, worst_px]) })
}

/// With a remark first, but for a directive of YAML, which stands before all else.
fn remarked(remark: &str, text: &str) -> String {
    match text.strip_prefix("%YAML:1.0\n---\n") {
        Some(rest) => format!("%YAML:1.0\n---\n{remark}{rest}"),
        None => format!("{remark}{text}"),
    }
}

/// Reads a camera file of any of the formats; of several cameras in it that with the name `wanted`.
///
/// # Errors
/// Unreadable files, formats and models that are not known, several cameras of which none is named.
pub fn read_camera_file(path: &Path, wanted: Option<&str>) -> Result<ReadCamera> {
    refuse_mat(path)?;
    let text = files::read_text(path, FileKind::Settings)?;
    let found = match format_of(path, &text) {
        Some(CameraFormat::Mrcal) => mrcal::read(path, &text)?,
        Some(CameraFormat::Kalibr) => kalibr::read(path, &text, wanted)?,
        Some(CameraFormat::OpenCv) => opencv::read(path, &text)?,
        Some(CameraFormat::Ros) => ros::read(path, &text)?,
        None => {
            let what = "is no camera file of OpenCV, Kalibr, mrcal or ROS";
            let remedy = "give a FileStorage (yaml, xml or json) with camera_matrix and image_width, a camchain, a .cameramodel or a camera_info";
            return Err(Error::new(Code::SettingSyntax, path.display(), what, remedy));
        }
    };
    Ok(found)
}

/// How the files begin in which MATLAB stores its variables.
const MAT: [&[u8]; 2] = [b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file"];

fn refuse_mat(path: &Path) -> Result<()> {
    let bytes = files::read(path, FileKind::Settings)?;
    if !MAT.iter().any(|head| bytes.starts_with(head)) {
        return Ok(());
    }
    let what = "is a MAT-file of MATLAB, which is not read";
    let remedy = "write its camera into a FileStorage of OpenCV (yaml): camera_matrix, distortion_coefficients, image_width, image_height; \
                  the centre of the top-left pixel is (0, 0) there, and (1, 1) in MATLAB";
    Err(Error::new(Code::SettingSyntax, path.display(), what, remedy))
}

/// True for a camera file of another program.
pub fn is_camera_file(path: &Path) -> bool {
    files::read_text(path, FileKind::Settings).is_ok_and(|text| format_of(path, &text).is_some())
}

fn format_of(path: &Path, text: &str) -> Option<CameraFormat> {
    let has = |word: &str| text.contains(word);
    match () {
        () if path.extension().is_some_and(|e| e == "cameramodel") || has("lensmodel") => Some(CameraFormat::Mrcal),
        () if has("camera_model:") && has("intrinsics:") => Some(CameraFormat::Kalibr),
        () if has("opencv-matrix") || (has("%YAML") && has("camera_matrix")) => Some(CameraFormat::OpenCv),
        () if has("camera_matrix:") || ros::is_message(text) => Some(CameraFormat::Ros),
        () => None,
    }
}
