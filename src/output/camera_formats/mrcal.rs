//! `.cameramodel` of mrcal: a dictionary, which is also YAML in flow style.

use std::path::Path;

use serde::Deserialize;

use super::model::{ReadCamera, Sayable, unknown_model};
use super::yaml::parse;
use super::{distortion, opencv};
use crate::error::{Code, Error, Result};
use crate::model::camera::{Camera, Lens};
use crate::output::text::list;

pub(super) const SAYABLE: &[Sayable] =
    &[Sayable::whole(Lens::Brown), Sayable::whole(Lens::Rational), Sayable::whole(Lens::ThinPrism)];

#[derive(Deserialize)]
struct Model {
    lensmodel: String,
    intrinsics: Vec<f64>,
    imagersize: [u32; 2],
}

/// Lens models with the number of coefficients of OpenCV.
const MODELS: [(&str, usize); 5] = [
    ("LENSMODEL_PINHOLE", 0),
    ("LENSMODEL_OPENCV4", 4),
    ("LENSMODEL_OPENCV5", 5),
    ("LENSMODEL_OPENCV8", 8),
    ("LENSMODEL_OPENCV12", 12),
];

pub(super) fn text(camera: &Camera) -> String {
    let d = opencv::coefficients(camera);
    let model = MODELS.iter().find(|(_, n)| *n == d.len()).map_or("LENSMODEL_OPENCV5", |(name, _)| name);
    let intrinsics = camera.parameters[..4].iter().copied().chain(d);
    format!(
        "{{\n    'lensmodel':  '{model}',\n\n    # fx,fy,cx,cy, then the coefficients in the order of OpenCV\n    'intrinsics': {},\n\n    \
         # the camera is its own reference\n    'extrinsics': [0, 0, 0, 0, 0, 0],\n\n    'imagersize': [{}, {}]\n}}\n",
        list(intrinsics),
        camera.width_px,
        camera.height_px,
    )
}

pub(super) fn read(path: &Path, text: &str) -> Result<ReadCamera> {
    let remedy = "give a .cameramodel with lensmodel, intrinsics and imagersize, as mrcal writes it";
    let model: Model = parse(path, text, remedy)?;
    let known = MODELS.iter().find(|(name, _)| *name == model.lensmodel);
    let Some((_, count)) = known else {
        return Err(unknown_model(path, &model.lensmodel, "LENSMODEL_PINHOLE, LENSMODEL_OPENCV4, 5, 8 or 12"));
    };
    match model.intrinsics.split_at_checked(4) {
        Some((&[fx, fy, cx, cy], d)) if d.len() == *count => {
            distortion::read(path, None, model.imagersize, [fx, fy, cx, cy], d)
        }
        _ => {
            let what = format!("{} intrinsics for {}", model.intrinsics.len(), model.lensmodel);
            Err(Error::new(Code::SettingRange, path.display(), what, remedy))
        }
    }
}
