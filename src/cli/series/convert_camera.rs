//! A camera model from one file format to another.

use std::path::Path;

use serde::Deserialize;

use crate::cli::results::show::read_solution;
use crate::cli::terminal::say::say_line;
use crate::error::{Code, Error, Result};
use crate::files::{self, FileKind, folder_of};
use crate::model::camera::{Camera, Lens};
use crate::output::ResultFolder;
use crate::output::camera_formats::{
    CameraFormat, OtherLens, camera_text, is_camera_file, loss_words, read_camera_file,
};
use crate::output::restore::{self, depths_of_record};

/// Depths of a camera of which no image is known, m: they matter to a lens that sees the distance alone.
const UNKNOWN_DEPTHS_M: [f64; 2] = [1.0, 1.0];

/// What is asked for.
pub(super) struct Wanted<'a> {
    pub from: &'a Path,
    pub to: &'a Path,
    /// Name of the format.
    pub format: Option<&'a str>,
    /// Which camera, where there are several.
    pub name: Option<&'a str>,
    pub nearest: bool,
}

/// A camera with its name and the depths between which it sees, m.
struct Named {
    name: String,
    camera: Camera,
    depths_m: [f64; 2],
}

/// A camera in poses.json.
#[derive(Deserialize)]
struct OfPoses {
    cameras: Vec<PosesCamera>,
}

#[derive(Deserialize)]
struct PosesCamera {
    name: String,
    lens: Lens,
    width_px: u32,
    height_px: u32,
    parameters: std::collections::BTreeMap<String, Value>,
    depths_m: [f64; 2],
}

#[derive(Deserialize)]
struct Value {
    value: f64,
}

/// The format that is asked for: by name, or by the extension that only mrcal has.
pub(super) fn format(wanted: &Wanted) -> Result<Option<CameraFormat>> {
    let names = CameraFormat::ALL.map(CameraFormat::name).join(", ");
    let of_mrcal = wanted.to.extension().is_some_and(|e| e == "cameramodel");
    match wanted.format {
        None if !of_mrcal && wanted.from.is_file() && is_camera_file(wanted.from) => Err(Error::new(
            Code::OptionMissing,
            wanted.from.display(),
            "is a camera file, and the format to write is not named",
            format!("add --as with one of: {names}"),
        )),
        None => Ok(of_mrcal.then_some(CameraFormat::Mrcal)),
        Some(name) => CameraFormat::from_name(name).map(Some).ok_or_else(|| {
            Error::new(
                Code::OptionRange,
                "--as",
                format!("\"{name}\" is no camera format"),
                format!("use one of: {names}"),
            )
        }),
    }
}

pub(super) fn run(wanted: &Wanted, format: CameraFormat) -> Result<()> {
    let Named { name, camera, depths_m } = camera(wanted)?;
    let other = if wanted.nearest { OtherLens::Nearest } else { OtherLens::Refused };
    let written = camera_text(format, (&name, &camera), &depths_m, other)?;
    let name_of_file = wanted.to.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let folder = folder_of(wanted.to);
    let place = ResultFolder::among(folder)?.named_by("TO");
    place.write_beside(&[(name_of_file, written.text.as_bytes())], &[wanted.from.to_path_buf()])?;
    say_line!("camera    {name}: {}, written for {}", camera.lens.name(), format.name());
    if let Some(loss_px) = written.loss_px {
        say_line!("loss      {}: the nearest model of {}", loss_words(loss_px), format.name());
    }
    Ok(())
}

fn camera(wanted: &Wanted) -> Result<Named> {
    let is_json = wanted.from.extension().is_some_and(|e| e == "json");
    let all = if is_json && !is_camera_file(wanted.from) && !is_of_others(wanted.from)? {
        of_results(wanted.from)?
    } else {
        let read = read_camera_file(wanted.from, wanted.name)?;
        if let Some(what) = read.what_is_lost() {
            return Err(Error::new(
                Code::LensUnknown,
                wanted.from.display(),
                what,
                "calibrate it with a lens of this program",
            ));
        }
        let name = wanted.name.map(str::to_owned).or(read.name).unwrap_or_else(|| "camera".to_owned());
        return Ok(Named { name, camera: read.camera, depths_m: UNKNOWN_DEPTHS_M });
    };
    let names: Vec<String> = all.iter().map(|n| n.name.clone()).collect();
    let count = all.len();
    let mut found = all.into_iter().filter(|n| wanted.name.map_or(count == 1, |name| name == n.name));
    found.next().ok_or_else(|| {
        let what = format!("has the cameras {}", names.join(", "));
        Error::new(Code::OptionMissing, wanted.from.display(), what, "name one of them with --name")
    })
}

/// Whether a JSON file is none of this program, as it has neither its format nor cameras.
fn is_of_others(path: &Path) -> Result<bool> {
    #[derive(Deserialize)]
    struct Own {
        format: Option<serde::de::IgnoredAny>,
        cameras: Option<serde::de::IgnoredAny>,
    }
    let read = serde_json::from_slice::<Own>(&files::read(path, FileKind::Solution)?);
    Ok(read.is_ok_and(|own| own.format.is_none() && own.cameras.is_none()))
}

/// Cameras of a solution.json or poses.json.
fn of_results(path: &Path) -> Result<Vec<Named>> {
    let bytes = files::read(path, FileKind::Solution)?;
    if let Ok(OfPoses { cameras }) = serde_json::from_slice(&bytes) {
        return cameras.into_iter().map(|c| of_poses(path, c)).collect();
    }
    let record = read_solution(path)?;
    let depths = depths_of_record(&record);
    let named = record.cameras.iter().zip(depths);
    Ok(named.map(|(c, depths_m)| Named { name: c.name.clone(), camera: restore::camera(c), depths_m }).collect())
}

fn of_poses(path: &Path, c: PosesCamera) -> Result<Named> {
    let damaged = |what: String| {
        Error::new(Code::SolutionDamaged, path.display(), what, "give the file as `robotcal poses` wrote it")
    };
    if !(1..=files::MOST_SIDE_PX).contains(&c.width_px) || !(1..=files::MOST_SIDE_PX).contains(&c.height_px) {
        return Err(damaged(format!("camera {} has {}x{} px", c.name, c.width_px, c.height_px)));
    }
    let mut camera = Camera::pinhole(c.lens, c.width_px, c.height_px, 1.0);
    let names: Vec<String> = camera.parameter_names().map(Into::into).collect();
    for (slot, name) in camera.parameters.iter_mut().zip(&names) {
        let known = c.parameters.get(name).ok_or_else(|| damaged(format!("camera {} has no {name}", c.name)))?;
        *slot = known.value;
    }
    Ok(Named { name: c.name, camera, depths_m: c.depths_m })
}
