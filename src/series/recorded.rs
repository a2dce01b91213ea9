//! Series whose images and readings come from a recording, and recordings turned into series folders.

use std::path::Path;

use super::camera_section::CameraMount;
use super::light::Light;
use super::manifest::{AngleUnit, Manifest};
use super::measurement_series::{Series, Source, file_name};
use super::read::manifest_beside;
use super::recording::{CameraInfo, Extracted, RecordingOptions, extract};
use crate::error::{Code, Error, Notice, Result};

impl Series {
    /// The same series with the stops of its recording: pictures are written to `images`. A series that has no recording
    /// comes back as it is.
    ///
    /// # Errors
    /// As [`extract`].
    pub fn with_recording(mut self, images: &Path, options: &RecordingOptions) -> Result<Self> {
        let Source::Recording(recording) = &self.source else { return Ok(self) };
        let joint_unit = self.manifest.joint_unit.or(options.joint_unit);
        let options = RecordingOptions { joint_unit, ..options.clone() };
        let extracted = extract(recording, images, &options)?;
        let Light { dark, white } = Light::of(&[&self.folder])?;
        let written = self.manifest_file();
        self.manifest.joint_unit = joint_unit;
        self.source = Source::Images { folder: images.to_path_buf(), dark, white };
        self.notices.extend(extracted.notices);
        self.notices.extend(settle_unit(&mut self.manifest, extracted.joint_unit, &self.folder, &written));
        self.inputs.extend(extracted.inputs);
        fill_camera(&mut self.manifest, extracted.camera_info.as_ref());
        self.stops = extracted.stops;
        Ok(self)
    }
}

/// Joint states are in rad: what stands beside a recording may be of the series that it was made of, in degrees.
fn settle_unit(manifest: &mut Manifest, recorded: AngleUnit, recording: &Path, written: &Path) -> Option<Notice> {
    let stated = *manifest.joint_unit.get_or_insert(AngleUnit::Rad);
    if stated == recorded {
        return None;
    }
    manifest.joint_unit = Some(AngleUnit::Rad);
    let what =
        "joint_unit is deg, but its joint states are within a turn in radians, in which ROS has them, and are taken so";
    let remedy = format!("write joint_unit = \"rad\" in {}", written.display());
    Some(Notice::new(Code::RadiansAsDegrees, recording.display(), what, remedy))
}

/// What a camera info knows and the manifest does not.
fn fill_camera(manifest: &mut Manifest, info: Option<&CameraInfo>) {
    let Some(info) = info else { return };
    let camera = manifest.cameras.first_mut();
    if let Some([fx, fy, ..]) = info.intrinsics {
        camera.focal_px.get_or_insert(0.5 * (fx + fy));
    }
    if camera.width_px.is_none() && info.width_px > 0 && info.height_px > 0 {
        camera.width_px = Some(info.width_px);
        camera.height_px = Some(info.height_px);
    }
}

/// Writes the stops of a recording as a series folder: `series.toml`, `joints.csv`, `images/`. A manifest beside the
/// recording is carried over, and so is the plate that it names. A new folder appears when it is complete; an empty one is
/// filled.
///
/// # Errors
/// As [`extract`]; a folder that exists already and is not empty; files that cannot be written.
pub fn convert_recording(recording: &Path, folder: &Path, options: &RecordingOptions) -> Result<Extracted> {
    let is_empty = std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none());
    if folder.exists() && !is_empty {
        return Err(Error::new(
            Code::OutputExists,
            folder.display(),
            "exists already",
            "name a new folder, or remove this one",
        ));
    }
    if is_empty {
        return write_folder(recording, folder, folder, options);
    }
    let unfinished = folder.with_file_name(format!(".{}.unfinished", file_name(folder)));
    if unfinished.exists() {
        std::fs::remove_dir_all(&unfinished).map_err(|e| Error::io(&unfinished, &e))?;
    }
    std::fs::create_dir_all(&unfinished).map_err(|e| Error::io(&unfinished, &e))?;
    let done = write_folder(recording, &unfinished, folder, options);
    if done.is_err() {
        // The reason of the failure matters more than a folder that could not be removed.
        let _ = std::fs::remove_dir_all(&unfinished);
    }
    done
}

fn write_folder(recording: &Path, unfinished: &Path, folder: &Path, options: &RecordingOptions) -> Result<Extracted> {
    // What is wrong with the manifest is said when it is carried over.
    let beside = manifest_beside(recording).ok().and_then(|path| Manifest::read(&path, &mut Vec::new()).ok());
    let joint_unit = beside.and_then(|manifest| manifest.joint_unit).or(options.joint_unit);
    let options = RecordingOptions { joint_unit, ..options.clone() };
    let mut extracted = extract(recording, &unfinished.join("images"), &options)?;
    let manifest = carried_manifest(recording, unfinished, joint_unit, &mut extracted)?;
    write(&unfinished.join("series.toml"), manifest.as_bytes())?;
    write(&unfinished.join("joints.csv"), extracted.stops.to_csv().as_bytes())?;
    if unfinished != folder {
        std::fs::rename(unfinished, folder).map_err(|e| Error::io(folder, &e))?;
    }
    for stop in &mut extracted.stops.stops {
        stop.path = Some(folder.join("images").join(&stop.image));
    }
    Ok(extracted)
}

/// Text of the manifest for the folder, with its plate copied. Where there is none beside the recording, it does not say where
/// the camera is: nobody knows, and a guess would look like knowledge.
fn carried_manifest(
    recording: &Path,
    unfinished: &Path,
    stated: Option<AngleUnit>,
    extracted: &mut Extracted,
) -> Result<String> {
    let beside = manifest_beside(recording);
    let written = beside.clone().unwrap_or_else(|_| unfinished.join("series.toml"));
    let known = beside.is_ok();
    let mut manifest = match beside {
        Ok(path) => {
            let mut manifest = Manifest::read(&path, &mut extracted.inputs)?;
            if let Some(plate) = &manifest.plate {
                manifest.plate = Some(copy_plate(&path.with_file_name(plate), unfinished)?);
            }
            manifest
        }
        Err(_) => {
            let what = "nothing beside it says where the camera is and which plate was seen";
            let remedy = "add camera_mount = \"hand\" or \"fixed\" to series.toml and put plate.toml into the folder";
            extracted.notices.push(Notice::new(Code::RecordingManifest, recording.display(), what, remedy));
            Manifest::plain(CameraMount::Hand, "plate.toml")
        }
    };
    manifest.mcap = None;
    manifest.joint_unit = stated;
    extracted.notices.extend(settle_unit(&mut manifest, extracted.joint_unit, recording, &written));
    fill_camera(&mut manifest, extracted.camera_info.as_ref());
    if extracted.is_unit_in_doubt && stated.is_none() {
        // Nobody knows: the folder is refused until someone states it.
        manifest.joint_unit = None;
    }
    let text = manifest.to_toml()?;
    let stays = |line: &&str| known || !line.starts_with("camera_mount");
    Ok(text.lines().filter(stays).map(|line| format!("{line}\n")).collect())
}

/// Copies the plate file and the marker file that it names; returns the name of the plate file.
fn copy_plate(plate: &Path, folder: &Path) -> Result<String> {
    let copy = |from: &Path| {
        let to = folder.join(file_name(from));
        std::fs::copy(from, &to).map_err(|e| Error::io(from, &e))
    };
    copy(plate)?;
    if let Some(markers) = super::plate_file::marker_file(plate)? {
        copy(&markers)?;
    }
    Ok(file_name(plate))
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(|e| Error::io(path, &e))
}
