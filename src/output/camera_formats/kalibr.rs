//! The camchain of Kalibr: `pinhole` cameras with `radtan`, `equidistant` or no distortion.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::model::{ReadCamera, Sayable, camera_of, unknown_model};
use super::yaml::parse;
use crate::error::{Code, Error, Result};
use crate::model::camera::{Camera, Lens};
use crate::output::text::{list, quoted};

pub(super) const SAYABLE: &[Sayable] = &[Sayable { lens: Lens::Brown, zeros: &["k3"] }, Sayable::whole(Lens::Fisheye)];

#[derive(Deserialize)]
struct Entry {
    camera_model: String,
    intrinsics: Vec<f64>,
    distortion_model: String,
    #[serde(default)]
    distortion_coeffs: Vec<f64>,
    resolution: [u32; 2],
    rostopic: Option<String>,
}

pub(super) fn text(name: &str, camera: &Camera) -> String {
    let p = &camera.parameters;
    let model = if camera.lens == Lens::Fisheye { "equidistant" } else { "radtan" };
    format!(
        "cam0:\n  camera_model: pinhole\n  intrinsics: {}\n  distortion_model: {model}\n  distortion_coeffs: {}\n  \
         resolution: [{}, {}]\n  rostopic: {}\n",
        list(p[..4].iter().copied()),
        list(p[4..8].iter().copied()),
        camera.width_px,
        camera.height_px,
        quoted(&format!("/{name}/image_raw")),
    )
}

pub(super) fn read(path: &Path, text: &str, wanted: Option<&str>) -> Result<ReadCamera> {
    let remedy = "give a camchain with camera_model, intrinsics, distortion_model, distortion_coeffs and resolution of every camera";
    let all: BTreeMap<String, Entry> = parse(path, text, remedy)?;
    let is_wanted = |(key, entry): &(&String, &Entry)| {
        let topic = entry.rostopic.iter().flat_map(|t| t.split('/')).any(|part| Some(part) == wanted);
        Some(key.as_str()) == wanted || topic
    };
    let only = if all.len() == 1 { all.iter().next() } else { None };
    let Some((name, entry)) = only.or_else(|| all.iter().find(is_wanted)) else {
        let names: Vec<&str> = all.keys().map(String::as_str).collect();
        let what = format!("has the cameras {}", names.join(", "));
        return Err(Error::new(
            Code::OptionMissing,
            path.display(),
            what,
            "name one of them: NAME=FILE, or --name with convert",
        ));
    };
    if entry.camera_model != "pinhole" {
        return Err(unknown_model(path, &entry.camera_model, "pinhole"));
    }
    let [fx, fy, cx, cy] = entry.intrinsics[..] else {
        let what = format!("{} intrinsics of {name}", entry.intrinsics.len());
        return Err(Error::new(Code::SettingRange, path.display(), what, "a pinhole camera has fu, fv, pu, pv"));
    };
    let lens = match entry.distortion_model.as_str() {
        "radtan" | "none" => Lens::Brown,
        "equidistant" => Lens::Fisheye,
        other => return Err(unknown_model(path, other, "radtan, equidistant, none")),
    };
    let camera = camera_of(path, lens, entry.resolution, [fx, fy, cx, cy], &entry.distortion_coeffs)?;
    Ok(ReadCamera { name: Some(name.clone()), camera, loss_px: None })
}
