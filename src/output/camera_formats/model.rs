//! What all formats share: which lenses they can say, and a camera as it was read.

use std::path::Path;

use crate::error::{Code, Error, Result};
use crate::files;
use crate::model::camera::{Camera, Lens};

/// A lens that a format has, and those of its coefficients that are zero there.
pub(super) struct Sayable {
    pub lens: Lens,
    pub zeros: &'static [&'static str],
}

impl Sayable {
    pub const fn whole(lens: Lens) -> Self {
        Self { lens, zeros: &[] }
    }

    /// Parameters of the camera that are zero.
    pub fn held(&self) -> Vec<usize> {
        let names = self.lens.coefficient_names().iter().enumerate();
        names.filter(|(_, n)| self.zeros.contains(n)).map(|(k, _)| 4 + k).collect()
    }

    pub fn says(&self, camera: &Camera) -> bool {
        camera.lens == self.lens && self.held().into_iter().all(|k| camera.parameters[k] == 0.0)
    }
}

/// A camera as it was read.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadCamera {
    /// Name in the file, where it has one.
    pub name: Option<String>,
    /// The camera, or the nearest that this program has.
    pub camera: Camera,
    /// RMS and largest loss over the image, px, where this program does not have the model of the file.
    pub loss_px: Option<[f64; 2]>,
}

/// RMS and largest loss over the image, px, with two digits that count at least.
pub fn loss_words([rms_px, worst_px]: [f64; 2]) -> String {
    let px = |value: f64| {
        let decimals = (1.0 - value.max(f64::MIN_POSITIVE).log10().floor()).clamp(4.0, 9.0) as usize;
        format!("{value:.decimals$} px")
    };
    format!("{} RMS over the image, at most {}", px(rms_px), px(worst_px))
}

impl ReadCamera {
    /// What the nearest lens loses; `None` where the lens is that of the file.
    pub fn what_is_lost(&self) -> Option<String> {
        let (loss, nearest) = (loss_words(self.loss_px?), self.camera.lens.name());
        Some(format!("its distortion is not a lens of this program: the nearest ({nearest}) loses {loss}"))
    }
}

/// A camera with its pinhole parameters and coefficients, all of them finite and of a sensible size.
pub(super) fn camera_of(
    path: &Path,
    lens: Lens,
    size_px: [u32; 2],
    pinhole: [f64; 4],
    coefficients: &[f64],
) -> Result<Camera> {
    let refuse = |what: String| {
        Error::new(Code::SettingRange, path.display(), what, "give the file as the other program wrote it")
    };
    let [width_px, height_px] = size_px;
    if !(1..=files::MOST_SIDE_PX).contains(&width_px) || !(1..=files::MOST_SIDE_PX).contains(&height_px) {
        return Err(refuse(format!("the image is {width_px} x {height_px} px")));
    }
    if !(pinhole[0] > 0.0 && pinhole[1] > 0.0) || pinhole.iter().chain(coefficients).any(|v| !v.is_finite()) {
        return Err(refuse(format!("focal lengths {} and {}, or a number that is not finite", pinhole[0], pinhole[1])));
    }
    let mut camera = Camera::pinhole(lens, width_px, height_px, pinhole[0]);
    camera.parameters[..4].copy_from_slice(&pinhole);
    if 4 + coefficients.len() > camera.parameters.len() {
        return Err(refuse(format!("{} distortion coefficients for a {} lens", coefficients.len(), lens.name())));
    }
    camera.parameters[4..4 + coefficients.len()].copy_from_slice(coefficients);
    Ok(camera)
}

/// A model that this program does not know.
pub(super) fn unknown_model(path: &Path, model: &str, known: &str) -> Error {
    let what = format!("camera model \"{model}\" is not one of this program");
    Error::new(Code::LensUnknown, path.display(), what, format!("calibrate with one of {known}, or leave the file out"))
}
