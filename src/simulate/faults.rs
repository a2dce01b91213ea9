//! Series with one thing wrong, for testing that it is found and named.
//!
//! To add a fault: a variant of [`Fault`], its row in [`FAULTS`] with what is expected, and what it does in
//! [`Fault::apply`] (readings, plate, observations) or [`Fault::apply_to_folder`] (files).

use std::path::Path;

use nalgebra::{Vector3, Vector6};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::folder::save;
use super::observe::observe;
use super::truth::TruePose;
use super::world::SimulatedSeries;
use crate::detect::{Picture, load};
use crate::error::{Code, Error, Result};
use crate::geom::Pose;
use crate::model::camera::Camera;
use crate::series::{AngleUnit, CameraMount, Plate};

/// One thing that is wrong with a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fault {
    /// Readings in degrees that the manifest calls radians.
    DegreesAsRadians,
    /// Readings in radians that the manifest calls degrees.
    RadiansAsDegrees,
    /// A joint column with a name that the robot does not have.
    UnknownJoint,
    /// A tip link that the robot does not have.
    UnknownTip,
    /// A row whose image is not there.
    MissingImage,
    /// All images but two are not there.
    MissingImages,
    /// A truncated image file.
    UnreadableImage,
    /// One image of half the size.
    ImageOfOtherSize,
    /// One empty joint cell.
    EmptyCell,
    /// One joint cell that is no number.
    NotANumber,
    /// Images that show no plate.
    NoMarkers,
    /// Two stops only.
    TooFewImages,
    /// All images from the same place.
    AllAlike,
    /// Three rows of readings that belong to each other's images.
    WrongPairs,
    /// A plate printed mirrored (or images mirrored by the camera's driver).
    MirroredPlate,
    /// A plate that was pushed half-way through.
    MovedPlate,
    /// A joint counted the wrong way round.
    NegatedJoint,
    /// Two joint columns under each other's name.
    SwappedJoints,
    /// A plate whose pitch is not what its file says.
    WrongPitch,
    /// Images that are copies of another one.
    DuplicateImages,
    /// A lens that was refocused half-way through.
    ChangedFocus,
    /// Images taken while the robot was moving.
    MovingRobot,
    /// A few markers that are not where the plate file says.
    MovedMarkers,
    /// A camera that tips over between two positions on its mount.
    LooseCamera,
    /// A camera that creeps on its mount all through the series, as while it grows warm.
    DriftingCamera,
}

/// What a fault is called and what the program must answer.
#[derive(Debug, Clone, Copy)]
pub struct Expectation {
    /// The fault.
    pub fault: Fault,
    /// Name on the command line and of its folder.
    pub name: &'static str,
    /// True when pictures are needed to show it.
    pub needs_images: bool,
    /// Exit codes that are right.
    pub exit_codes: &'static [u8],
    /// What must be said: codes of the error, of findings, or of images that are left out.
    pub codes: &'static [Code],
    /// Images, joints, links, lines of files and markers that must be named.
    pub names: &'static [&'static str],
}

const fn row(
    fault: Fault,
    name: &'static str,
    needs_images: bool,
    exit_codes: &'static [u8],
    codes: &'static [Code],
    names: &'static [&'static str],
) -> Expectation {
    Expectation { fault, name, needs_images, exit_codes, codes, names }
}

/// Every fault.
pub const FAULTS: [Expectation; 25] = [
    row(Fault::DegreesAsRadians, "degrees-as-radians", false, &[2], &[Code::DegreesAsRadians], &["joints.csv"]),
    row(Fault::RadiansAsDegrees, "radians-as-degrees", false, &[2], &[Code::RadiansAsDegrees], &["joints.csv"]),
    row(Fault::UnknownJoint, "unknown-joint", false, &[2], &[Code::JointMissing], &["joints.csv", "joint_a3"]),
    row(Fault::UnknownTip, "unknown-tip", false, &[2], &[Code::LinkUnknown], &["gripper_tip"]),
    row(Fault::MissingImage, "missing-image", true, &[0, 1], &[Code::ImageNotThere], &["img_003.png"]),
    row(Fault::MissingImages, "missing-images", true, &[2], &[Code::ImageNotThere], &["img_002.png"]),
    row(Fault::UnreadableImage, "unreadable-image", true, &[0, 1], &[Code::ImageTruncated], &["img_003.png"]),
    row(Fault::ImageOfOtherSize, "image-of-other-size", true, &[0, 1], &[Code::ImageSizeDiffers], &["img_003.png"]),
    row(Fault::EmptyCell, "empty-cell", false, &[2], &[Code::CsvCellEmpty], &["joints.csv:5", "joint_a3"]),
    row(Fault::NotANumber, "not-a-number", false, &[2], &[Code::CsvNumber], &["joints.csv:5", "joint_a3"]),
    row(Fault::NoMarkers, "no-markers", true, &[2, 3], &[Code::PlateNowhere], &["img_000.png"]),
    row(Fault::TooFewImages, "too-few-images", false, &[2, 3], &[Code::ImagesTooFew], &[]),
    row(Fault::AllAlike, "all-alike", false, &[2, 3], &[Code::ViewsAlike], &[]),
    row(
        Fault::WrongPairs,
        "wrong-pairs",
        false,
        &[0, 1],
        &[Code::ReadingsExchanged, Code::WronglyPaired],
        &["img_004.png", "img_009.png", "img_012.png"],
    ),
    row(Fault::MirroredPlate, "mirrored-plate", false, &[2, 3], &[Code::PlateMirrored], &[]),
    row(Fault::MovedPlate, "moved-plate", false, &[1, 3], &[Code::PlateMoved], &["img_010.png"]),
    row(Fault::NegatedJoint, "negated-joint", false, &[1, 2, 3], &[Code::JointSignWrong], &["joint_a5"]),
    row(Fault::SwappedJoints, "swapped-joints", false, &[1, 2, 3], &[Code::JointOrderWrong], &["joint_a4", "joint_a6"]),
    row(Fault::WrongPitch, "wrong-pitch", false, &[1, 2, 3], &[Code::PlatePitchWrong], &["plate.toml"]),
    row(
        Fault::DuplicateImages,
        "duplicate-images",
        false,
        &[0, 1, 2],
        &[Code::ImageDuplicate],
        &["img_006.png", "img_011.png"],
    ),
    row(Fault::ChangedFocus, "changed-focus", false, &[1, 3], &[Code::FocusChanged], &["img_010.png"]),
    row(Fault::MovingRobot, "moving-robot", false, &[0, 1], &[Code::WronglyPaired], &["img_005.png", "img_013.png"]),
    row(Fault::MovedMarkers, "moved-markers", false, &[0, 1], &[Code::MarkerOff], &["17", "40"]),
    row(Fault::LooseCamera, "loose-camera", false, &[1], &[Code::LooseMounting], &["loose-camera"]),
    row(Fault::DriftingCamera, "drifting-camera", false, &[1], &[Code::CameraDrifts], &["drifting-camera"]),
];

impl Fault {
    /// The fault of a name on the command line.
    pub fn from_name(name: &str) -> Option<Self> {
        FAULTS.iter().find(|e| e.name == name).map(|e| e.fault)
    }

    /// What is expected of it.
    pub fn expectation(self) -> &'static Expectation {
        // The table has a row for each variant: the test below proves it.
        FAULTS.iter().find(|e| e.fault == self).unwrap_or(&FAULTS[0])
    }

    fn require_enough(self, stops: usize, joints: usize) -> Result<()> {
        if stops >= 6 && joints >= 6 {
            return Ok(());
        }
        let place = format!("fault {}", self.expectation().name);
        let what = format!("{stops} stops and {joints} joints are too few to show it");
        Err(Error::new(Code::OptionConflict, place, what, "take 16 stops of a 6-axis arm"))
    }

    /// Puts the fault into a series before it is written.
    ///
    /// # Errors
    /// When the series has too few stops or joints to show it.
    pub fn apply(self, series: &mut SimulatedSeries) -> Result<()> {
        self.require_enough(series.stops.stops.len(), series.stops.joints.len())?;
        series.truth.fault = Some(self.expectation().name.to_owned());
        match self {
            Self::DegreesAsRadians => series.manifest.joint_unit = Some(AngleUnit::Rad),
            Self::RadiansAsDegrees => in_radians(series),
            Self::UnknownJoint => series.stops.joints[2] = "joint_x".to_owned(),
            Self::UnknownTip => series.manifest.tip = Some("gripper_tip".to_owned()),
            Self::TooFewImages => keep(series, 2),
            Self::AllAlike => all_alike(series),
            Self::WrongPairs => wrong_pairs(series),
            Self::MirroredPlate => mirror(series),
            Self::MovedPlate => move_plate(series),
            Self::NegatedJoint => on_readings(series, |q| q[4] = -q[4]),
            Self::SwappedJoints => on_readings(series, |q| q.swap(3, 5)),
            Self::WrongPitch => series.plate = scaled_plate(&series.plate, 0.9),
            Self::DuplicateImages => duplicate(series),
            Self::ChangedFocus => refocus(series),
            Self::MovingRobot => move_robot(series),
            Self::MovedMarkers => move_markers(series),
            Self::LooseCamera => loosen_camera(series),
            Self::DriftingCamera => creep_camera(series),
            Self::MissingImage
            | Self::MissingImages
            | Self::UnreadableImage
            | Self::ImageOfOtherSize
            | Self::EmptyCell
            | Self::NotANumber
            | Self::NoMarkers => {}
        }
        Ok(())
    }

    /// Puts the fault into the files of a written series, and writes `expected.toml` beside them.
    ///
    /// # Errors
    /// When a file cannot be read or written.
    pub fn apply_to_folder(self, folder: &Path) -> Result<()> {
        let third = folder.join("images/img_003.png");
        match self {
            Self::MissingImage => remove(&third)?,
            Self::MissingImages => {
                let keep = ["img_000.png", "img_001.png"];
                for entry in std::fs::read_dir(folder.join("images")).map_err(|e| Error::io(folder, &e))? {
                    let path = entry.map_err(|e| Error::io(folder, &e))?.path();
                    if !keep.iter().any(|k| path.ends_with(k)) {
                        remove(&path)?;
                    }
                }
            }
            Self::UnreadableImage => {
                let bytes = std::fs::read(&third).map_err(|e| Error::io(&third, &e))?;
                std::fs::write(&third, &bytes[..bytes.len() / 2]).map_err(|e| Error::io(&third, &e))?;
            }
            Self::ImageOfOtherSize => save(&third, &halved(&load(&third, None)?))?,
            Self::EmptyCell => edit_cell(folder, "")?,
            Self::NotANumber => edit_cell(folder, "12.5o")?,
            Self::NoMarkers => blank_images(folder)?,
            _ => {}
        }
        let path = folder.join("expected.toml");
        std::fs::write(&path, self.expectation().expected_toml()).map_err(|e| Error::io(&path, &e))
    }
}

impl Expectation {
    fn expected_toml(&self) -> String {
        let quoted = |all: Vec<&str>| all.iter().map(|w| format!("\"{w}\"")).collect::<Vec<_>>().join(", ");
        let exits: Vec<String> = self.exit_codes.iter().map(u8::to_string).collect();
        let codes = quoted(self.codes.iter().map(|c| c.name()).collect());
        format!("exit_codes = [{}]\ncodes = [{codes}]\nnames = [{}]\n", exits.join(", "), quoted(self.names.to_vec()))
    }
}

fn on_readings(series: &mut SimulatedSeries, change: impl Fn(&mut Vec<f64>)) {
    series.stops.stops.iter_mut().filter_map(|s| s.raw_readings.as_mut()).for_each(change);
}

fn in_radians(series: &mut SimulatedSeries) {
    on_readings(series, |q| q.iter_mut().for_each(|v| *v = (v.to_radians() * 1e6).round() / 1e6));
    series.manifest.joint_unit = Some(AngleUnit::Deg);
}

fn keep(series: &mut SimulatedSeries, count: usize) {
    series.stops.stops.truncate(count);
    series.observations.truncate(count);
    series.truth.stops.truncate(count);
}

/// What the first camera pose shows, at every stop anew with fresh noise.
fn all_alike(series: &mut SimulatedSeries) {
    let first = series.truth.stops[0].clone();
    let readings = series.stops.stops[0].raw_readings.clone();
    for stop in &mut series.truth.stops {
        stop.camera_from_plate = first.camera_from_plate;
        stop.joint_noise.clone_from(&first.joint_noise);
    }
    series.stops.stops.iter_mut().for_each(|s| s.raw_readings.clone_from(&readings));
    let all = 0..series.observations.len();
    observe_again(series, all, |_, _, _| {});
}

fn wrong_pairs(series: &mut SimulatedSeries) {
    let rows = [4, 9, 12].map(|k: usize| k.min(series.stops.stops.len() - 1));
    let readings = rows.map(|k| series.stops.stops[k].raw_readings.clone());
    for (k, row) in rows.into_iter().enumerate() {
        series.stops.stops[row].raw_readings.clone_from(&readings[(k + 1) % 3]);
    }
}

/// Ids as a detector gives them that takes the mirrored plate for the right one.
fn mirror(series: &mut SimulatedSeries) {
    let columns = series.plate.columns;
    for image in &mut series.observations {
        for o in &mut image.observations {
            o.marker = o.marker / columns * columns + columns - 1 - o.marker % columns;
        }
        image.observations.sort_by_key(|o| (o.marker, o.edge));
    }
}

fn scaled_plate(plate: &Plate, factor: f64) -> Plate {
    let mut scaled = plate.clone();
    scaled.pitch_m *= factor;
    for m in &mut scaled.markers {
        m.position_m *= factor;
        m.outer_radius_m *= factor;
        m.inner_radius_m *= factor;
    }
    scaled
}

fn duplicate(series: &mut SimulatedSeries) {
    let last = series.observations.len() - 1;
    let copy = series.observations[6.min(last)].observations.clone();
    series.observations[11.min(last)].observations = copy;
}

/// Observes the given stops again after `change` of plate pose, camera and plate.
fn observe_again(
    series: &mut SimulatedSeries,
    stops: std::ops::Range<usize>,
    change: impl Fn(&mut Pose, &mut Camera, &mut Plate),
) {
    let mut rng = ChaCha8Rng::seed_from_u64(series.truth.seed ^ 0x5eed);
    let sigma = series.truth.pixel_sigma_px.unwrap_or(0.0);
    for k in stops {
        let (mut camera, mut plate) = (series.truth.camera.clone(), series.true_plate.clone());
        let mut pose = series.truth.stops[k].camera_from_plate.pose();
        change(&mut pose, &mut camera, &mut plate);
        series.truth.stops[k].camera_from_plate = TruePose::from(&pose);
        series.observations[k].observations = observe(&plate, &camera, &pose, sigma, &mut rng);
    }
}

/// The plate slides by 15 mm and turns by 2 degrees before stop 10.
fn move_plate(series: &mut SimulatedSeries) {
    let push = Pose::exp(&Vector6::new(0.012, -0.009, 0.0, 0.0, 0.0, 2_f64.to_radians()));
    let all = 10.min(series.observations.len())..series.observations.len();
    observe_again(series, all, |pose, _, _| *pose = *pose * push);
}

/// The lens is refocused before stop 10: the focal length grows by 1.5 %.
fn refocus(series: &mut SimulatedSeries) {
    let all = 10.min(series.observations.len())..series.observations.len();
    observe_again(series, all, |_, camera, _| {
        camera.parameters[0] *= 1.015;
        camera.parameters[1] *= 1.015;
    });
}

/// At two stops the arm was still on its way: the tip is some millimetres and milliradians from where the readings say.
fn move_robot(series: &mut SimulatedSeries) {
    for k in [5, 13] {
        if k < series.observations.len() {
            let lag = Pose::exp(&Vector6::new(0.006, 0.004, -0.003, 0.004, -0.006, 0.005));
            let hand = series.truth.camera_mount == CameraMount::Hand;
            observe_again(series, k..k + 1, |pose, _, _| *pose = if hand { lag * *pose } else { *pose * lag });
        }
    }
}

/// At two stops of five the camera is rolled by 1.2 mrad on its mount.
fn loosen_camera(series: &mut SimulatedSeries) {
    for k in (0..series.observations.len()).filter(|k| matches!(k % 5, 1 | 2)) {
        let roll = Pose::exp(&Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, 1.2e-3));
        observe_again(series, k..k + 1, |pose, _, _| *pose = roll * *pose);
    }
}

/// From the first stop to the last the camera creeps by 0.2 mm and 0.6 mrad on its mount.
fn creep_camera(series: &mut SimulatedSeries) {
    let last = (series.observations.len().max(2) - 1) as f64;
    for k in 0..series.observations.len() {
        let crept = Vector6::new(0.1e-3, 0.0, 0.17e-3, 0.5e-3, -0.3e-3, 0.0) * (k as f64 / last);
        observe_again(series, k..k + 1, |pose, _, _| *pose = Pose::exp(&crept) * *pose);
    }
}

/// Markers 17 and 40 sit a millimetre beside their places.
fn move_markers(series: &mut SimulatedSeries) {
    let all = 0..series.observations.len();
    for id in [17, 40] {
        if let Some(index) = series.true_plate.index_of(id) {
            let beside = Vector3::new(0.0008, -0.0006, 0.0);
            series.true_plate.markers[index].position_m += beside;
            let error = &mut series.truth.marker_errors_m[index];
            *error = (Vector3::from(*error) + beside).into();
        }
    }
    observe_again(series, all, |_, _, _| {});
}

fn remove(path: &Path) -> Result<()> {
    std::fs::remove_file(path).map_err(|e| Error::io(path, &e))
}

/// Every second pixel of every second row.
fn halved(picture: &Picture) -> Picture {
    let (width, height) = (picture.width / 2, picture.height / 2);
    let pixels = (0..width * height).map(|k| picture.at(2 * (k % width), 2 * (k / width))).collect();
    Picture { width, height, pixels, full_scale: picture.full_scale }
}

fn blank_images(folder: &Path) -> Result<()> {
    for entry in std::fs::read_dir(folder.join("images")).map_err(|e| Error::io(folder, &e))? {
        let path = entry.map_err(|e| Error::io(folder, &e))?.path();
        let mut picture = load(&path, None)?;
        picture.pixels.fill(90.0);
        save(&path, &picture)?;
    }
    Ok(())
}

/// Overwrites the third joint of the fourth stop (line 5 of joints.csv).
fn edit_cell(folder: &Path, text: &str) -> Result<()> {
    let path = folder.join("joints.csv");
    let old = std::fs::read_to_string(&path).map_err(|e| Error::io(&path, &e))?;
    let edit = |(k, line): (usize, &str)| {
        let mut cells: Vec<&str> = line.split(',').collect();
        if k == 4 && cells.len() > 3 {
            cells[3] = text;
        }
        cells.join(",") + "\n"
    };
    let new: String = old.lines().enumerate().map(edit).collect();
    std::fs::write(&path, new).map_err(|e| Error::io(&path, &e))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_has_one_row_and_a_name_of_its_own() {
        for (k, e) in FAULTS.iter().enumerate() {
            assert_eq!(e.fault as usize, k, "{} stands in the order of the variants", e.name);
            assert_eq!(Fault::from_name(e.name), Some(e.fault));
            assert_eq!(e.fault.expectation().name, e.name);
        }
    }
}
