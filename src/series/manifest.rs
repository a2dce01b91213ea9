//! `series.toml`: how a series was taken.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::camera_section::{CameraMount, CameraSection, Cameras};
use super::inputs::{InputFile, read_text};
use super::sections::{
    ContactSection, ControllerSection, DistanceSection, PlateMountSection, SecondRobotSection, TrackerSection,
};
use super::toml_file::{check_format, parse_toml, require_positive, require_sigma_m, require_sigma_rad, to_toml};
use crate::error::{Code, Error, Result};
use crate::files::FileKind;

/// Unit of the revolute columns of joints.csv.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AngleUnit {
    /// Degrees.
    Deg,
    /// Radians.
    Rad,
}

impl AngleUnit {
    /// The value in rad of one unit.
    pub fn in_rad(self) -> f64 {
        match self {
            Self::Deg => std::f64::consts::PI / 180.0,
            Self::Rad => 1.0,
        }
    }

    /// Name in the manifest.
    pub fn name(self) -> &'static str {
        match self {
            Self::Deg => "deg",
            Self::Rad => "rad",
        }
    }
}

/// What u, v of an observed circle mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Default)]
#[serde(rename_all = "lowercase")]
pub enum CirclePoint {
    /// Area centroid of the circle's image.
    #[default]
    Centroid,
    /// Image of the circle's centre.
    Centre,
}

/// Whether the rows of joints.csv stand in the order in which the stops were visited.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Default)]
#[serde(rename_all = "lowercase")]
pub enum StopOrder {
    /// They do: the approach direction can be taken from them.
    #[default]
    Visited,
    /// Nothing is known of the order.
    Unknown,
}

/// `[observations]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObservationsSection {
    /// What u, v of a circle mean.
    #[serde(default)]
    pub point: CirclePoint,
}

/// `[robot]`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotSection {
    /// Repeatability at the flange as stated, m; for the record, the joint noise is estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub repeatability_m: Option<f64>,
    /// Meaning of the order of rows.
    #[serde(default)]
    pub order: StopOrder,
}

/// The manifest of a series.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of the format: 1.
    pub format: u32,
    /// Unit of revolute readings; required unless the readings come from a recording (which is in rad).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint_unit: Option<AngleUnit>,
    /// Base link; default the root of the URDF.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base: Option<String>,
    /// Tip link; default the only leaf of the URDF.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tip: Option<String>,
    /// Camera in the hand or fixed; needed where there are images, and `mount` of the camera does not say it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera_mount: Option<CameraMount>,
    /// Plate file, relative to the manifest; needed where there are images.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plate: Option<String>,
    /// Recording that replaces images and joints.csv, relative to the manifest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mcap: Option<String>,
    /// Cameras: a table for one, a list for several.
    #[serde(default, rename = "camera", skip_serializing_if = "is_default")]
    pub cameras: Cameras,
    /// Observations.
    #[serde(default, skip_serializing_if = "is_default")]
    pub observations: ObservationsSection,
    /// Robot.
    #[serde(default, skip_serializing_if = "is_default")]
    pub robot: RobotSection,
    /// Tracker of points.csv and poses.csv.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracker: Option<TrackerSection>,
    /// What contacts.csv means.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contact: Option<ContactSection>,
    /// Measured distances.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub distance: Vec<DistanceSection>,
    /// What controller.csv means.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub controller: Option<ControllerSection>,
    /// Link that carries the plate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plate_mount: Option<PlateMountSection>,
    /// Second arm, which carries the plate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robot_2: Option<SecondRobotSection>,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl Manifest {
    /// A manifest with nothing but what must be said.
    pub fn plain(camera_mount: CameraMount, plate: &str) -> Self {
        Self {
            format: 1,
            joint_unit: Some(AngleUnit::Rad),
            base: None,
            tip: None,
            camera_mount: Some(camera_mount),
            plate: Some(plate.to_string()),
            mcap: None,
            cameras: Cameras::default(),
            observations: ObservationsSection::default(),
            robot: RobotSection::default(),
            tracker: None,
            contact: None,
            distance: Vec::new(),
            controller: None,
            plate_mount: None,
            robot_2: None,
        }
    }

    /// The camera, where there is one; of several the first.
    pub fn camera(&self) -> &CameraSection {
        self.cameras.first()
    }

    /// Where the plate file is; the manifest lies in `folder`.
    pub fn plate_in(&self, folder: &Path) -> Option<PathBuf> {
        self.plate.as_ref().map(|plate| folder.join(plate))
    }

    /// Where a camera is, as it states itself or as `camera_mount` says for all.
    pub fn mount_of(&self, camera: &CameraSection) -> Option<CameraMount> {
        camera.mount.or(self.camera_mount)
    }

    /// Where the first camera is; in the hand where nothing says it (a series without images).
    pub fn mount(&self) -> CameraMount {
        self.mount_of(self.camera()).unwrap_or(CameraMount::Hand)
    }

    /// Text of `series.toml`.
    ///
    /// # Errors
    /// None in practice: every field can be written as TOML.
    pub fn to_toml(&self) -> Result<String> {
        to_toml("series.toml", self)
    }

    /// Reads and checks `series.toml`.
    pub(super) fn read(path: &Path, inputs: &mut Vec<InputFile>) -> Result<Self> {
        Self::parse(path, &read_text(path, FileKind::Settings, inputs)?)
    }

    /// Checks the text of a `series.toml`; `path` is for messages only.
    ///
    /// # Errors
    /// By line: unknown keys, wrong values, another version of the format.
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let manifest: Self = parse_toml(path, text)?;
        check_format(path, manifest.format)?;
        require_positive(path, "robot.repeatability_m", manifest.robot.repeatability_m)?;
        manifest.cameras.check(path)?;
        manifest.check_measured(path)?;
        manifest.require_used_mount(path)?;
        manifest.require_same_links(path)?;
        manifest.require_one_carrier(path)?;
        Ok(manifest)
    }

    /// Sizes of errors and distances are positive.
    fn check_measured(&self, path: &Path) -> Result<()> {
        let tracker = self.tracker.as_ref();
        require_sigma_m(path, "tracker.sigma_m", tracker.and_then(|t| t.sigma_m))?;
        require_sigma_rad(path, "tracker.sigma_rad", tracker.and_then(|t| t.sigma_rad))?;
        require_sigma_m(path, "contact.sigma_m", self.contact.as_ref().and_then(|c| c.sigma_m))?;
        self.distance.iter().try_for_each(|d| d.check(path))
    }

    /// What is said of all cameras is that of some: cameras that state their own do not read it.
    fn require_used_mount(&self, path: &Path) -> Result<()> {
        let Some(of_all) = self.camera_mount else { return Ok(()) };
        let is_read = self.cameras.is_empty() || self.cameras.iter().any(|c| c.mount.is_none());
        let differs = |c: &&CameraSection| c.mount.is_some_and(|own| own != of_all);
        let Some(other) = self.cameras.iter().find(differs).filter(|_| !is_read) else { return Ok(()) };
        let named = other.name.as_ref().map_or_else(String::new, |name| format!(" of camera \"{name}\""));
        let what = format!("stands beside another mount{named}, and no camera is without a mount of its own");
        let remedy = "leave camera_mount out, and state mount = \"hand\" or \"fixed\" of each camera as it is";
        Err(Error::new(Code::SettingConflict, format!("{}, camera_mount", path.display()), what, remedy))
    }

    /// The plate hangs on one link.
    fn require_one_carrier(&self, path: &Path) -> Result<()> {
        let place = |key: &str| format!("{}, {key}", path.display());
        if self.robot_2.is_some() && self.plate_mount.is_some() {
            let remedy = "name the link that carries the plate as tip of [robot_2], and leave [plate_mount] out";
            return Err(Error::new(Code::SettingConflict, place("[plate_mount]"), "stands beside [robot_2]", remedy));
        }
        if self.robot_2.is_some() && self.mount() == CameraMount::Fixed {
            let what = "its arm carries the plate, so the first one carries the camera";
            let remedy = "write camera_mount = \"hand\"; exchange the arms where the second one carries the camera";
            return Err(Error::new(Code::SettingConflict, place("[robot_2]"), what, remedy));
        }
        Ok(())
    }

    /// Links that are named as those that carry camera and plate: in place of the base, and in place of the tip. A camera in the hand and
    /// the plate of a fixed one sit on the tip where no link is named.
    pub fn carriers(&self) -> [Option<&str>; 2] {
        let camera = self.camera().link.as_deref();
        let plate = self.plate_mount.as_ref().map(|p| p.link.as_str());
        match self.mount() {
            CameraMount::Hand => [plate, camera],
            CameraMount::Fixed => [camera, plate],
        }
    }

    /// Links between which the chain runs, as far as the manifest states them.
    pub fn ends(&self) -> [Option<&str>; 2] {
        let [base, tip] = self.carriers();
        [base.or(self.base.as_deref()), tip.or(self.tip.as_deref())]
    }

    /// All cameras of a series hang on the same links.
    fn require_same_links(&self, path: &Path) -> Result<()> {
        let is_carried = self.plate_mount.is_some() || self.robot_2.is_some() || self.camera().link.is_some();
        let differs = |c: &&CameraSection| {
            c.link != self.camera().link || (is_carried && self.mount_of(c) != self.mount_of(self.camera()))
        };
        let Some(other) = self.cameras.iter().find(differs) else { return Ok(()) };
        let name = other.name.as_deref().unwrap_or("another");
        let what = format!("camera \"{name}\" hangs on another link than the first camera");
        let remedy = "give cameras on different links as series of their own, each with its own base and tip";
        Err(Error::new(Code::SettingConflict, path.display(), what, remedy))
    }

    /// Images need a plate, and it must be known where their cameras are.
    pub(super) fn require_camera_and_plate(&self, path: &Path) -> Result<()> {
        let missing = |key: &str, remedy: &str| {
            Err(Error::new(Code::SettingMissing, path.display(), format!("missing field `{key}`"), remedy))
        };
        let unplaced = self.cameras.iter().any(|c| self.mount_of(c).is_none());
        if unplaced || (self.cameras.is_empty() && self.camera_mount.is_none()) {
            let remedy =
                "write camera_mount = \"hand\" (camera on the tip) or camera_mount = \"fixed\" (plate on the tip)";
            return missing("camera_mount", remedy);
        }
        if self.plate.is_none() {
            return missing("plate", "add plate = \"plate.toml\", the file that describes the plate in the images");
        }
        Ok(())
    }

    /// Readings of joints.csv need their unit; those of a recording are in rad.
    pub(super) fn require_joint_unit(&self, path: &Path) -> Result<()> {
        if self.joint_unit.is_some() {
            return Ok(());
        }
        let remedy = "write joint_unit = \"deg\" or joint_unit = \"rad\"; there is no default on purpose";
        Err(Error::new(Code::JointUnitMissing, path.display(), "does not say the unit of the joint readings", remedy))
    }
}
