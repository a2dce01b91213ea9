//! `series.toml`: how a series was taken. `plate.toml` shares the reader for TOML.

use std::path::Path;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::inputs::{InputFile, read_text};
use crate::error::{Code, Error, Result, closest_name, plain_name};
use crate::files::Kind;

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

/// Where the camera is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CameraMount {
    /// Camera on the tip, plate fixed in the base.
    Hand,
    /// Plate on the tip, camera fixed in the base.
    Fixed,
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

/// `[camera]`: everything optional, every starting value can be found from the data.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraSection {
    /// Series with the same name share intrinsics; default the name of the series folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Series with the same mounting share the hand-camera offset; default the name of the series folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mounting: Option<String>,
    /// Lens model by name; default chosen from the data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// Starting value of the focal length, px.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focal_px: Option<f64>,
    /// Image width, px; needed only when there are no images.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub width_px: Option<u32>,
    /// Image height, px.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height_px: Option<u32>,
    /// Valid bits when they sit in the low end of 16.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bits: Option<u32>,
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
    /// Camera in the hand or fixed.
    pub camera_mount: CameraMount,
    /// Plate file, relative to the manifest.
    pub plate: String,
    /// Recording that replaces images and joints.csv, relative to the manifest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mcap: Option<String>,
    /// Camera.
    #[serde(default, skip_serializing_if = "is_default")]
    pub camera: CameraSection,
    /// Observations.
    #[serde(default, skip_serializing_if = "is_default")]
    pub observations: ObservationsSection,
    /// Robot.
    #[serde(default, skip_serializing_if = "is_default")]
    pub robot: RobotSection,
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
            camera_mount,
            plate: plate.to_string(),
            mcap: None,
            camera: CameraSection::default(),
            observations: ObservationsSection::default(),
            robot: RobotSection::default(),
        }
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
        Self::parse(path, &read_text(path, Kind::Settings, inputs)?)
    }

    /// Checks the text of a `series.toml`; `path` is for messages only.
    ///
    /// # Errors
    /// By line: unknown keys, wrong values, another version of the format.
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let manifest: Self = parse_toml(path, text)?;
        check_format(path, manifest.format)?;
        let camera = &manifest.camera;
        let positive = [
            ("camera.focal_px", camera.focal_px),
            ("camera.width_px", camera.width_px.map(f64::from)),
            ("camera.height_px", camera.height_px.map(f64::from)),
            ("robot.repeatability_m", manifest.robot.repeatability_m),
        ];
        for (key, value) in positive {
            require_positive(path, key, value)?;
        }
        if let Some(bits) = camera.bits.filter(|b| !(8..=16).contains(b)) {
            let what = format!("camera.bits = {bits}");
            return Err(Error::new(
                Code::SettingRange,
                path.display(),
                what,
                "give 8 to 16, the bits that the sensor delivers",
            ));
        }
        if camera.width_px.is_some() != camera.height_px.is_some() {
            let what = "one of camera.width_px and camera.height_px is missing";
            return Err(Error::new(Code::SettingConflict, path.display(), what, "give both or none"));
        }
        Ok(manifest)
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

/// A value that must be positive and finite where it is given.
pub(super) fn require_positive(path: &Path, key: &str, value: Option<f64>) -> Result<()> {
    match value {
        Some(v) if !(v > 0.0 && v.is_finite()) => {
            Err(Error::new(Code::SettingRange, path.display(), format!("{key} = {v}"), "give a positive number"))
        }
        _ => Ok(()),
    }
}

/// Refuses other versions of a format.
pub(super) fn check_format(path: &Path, format: u32) -> Result<()> {
    if format == 1 {
        return Ok(());
    }
    let remedy = "this program reads format = 1; a newer one may be needed";
    Err(Error::new(Code::SettingVersion, path.display(), format!("format = {format}"), remedy))
}

/// Text of a TOML file.
pub(super) fn to_toml(file: &str, value: &impl Serialize) -> Result<String> {
    toml::to_string(value)
        .map_err(|e| Error::new(Code::OutputFailed, file, format!("cannot be written: {e}"), "report this"))
}

/// Reads a TOML file; unknown keys and wrong values are named with their line.
pub(crate) fn read_toml<T: DeserializeOwned>(path: &Path, inputs: &mut Vec<InputFile>) -> Result<T> {
    parse_toml(path, &read_text(path, Kind::Settings, inputs)?)
}

/// A value from the text of a TOML file; `path` is for messages only.
pub(super) fn parse_toml<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T> {
    let value = toml::from_str(text).map_err(|error| {
        let line = error.span().map(|s| 1 + text[..s.start.min(text.len())].matches('\n').count());
        let place = line.map_or_else(|| path.display().to_string(), |l| format!("{}:{l}", path.display()));
        let message = error.message().trim().replace('\n', "; ");
        let remedy = toml_remedy(&message);
        Error::new(Code::SettingSyntax, place, message, remedy)
    })?;
    plain_toml(path, text)?;
    Ok(value)
}

/// Keys and strings of a TOML file without control characters; the line is that of the innermost key.
fn plain_toml(path: &Path, text: &str) -> Result<()> {
    fn walk(value: &toml::Value, key: &str, place: &dyn Fn(&str) -> String) -> Result<()> {
        match value {
            toml::Value::String(text) => plain_name(key, text, place(key)).map(|_| ()),
            toml::Value::Array(all) => all.iter().try_for_each(|v| walk(v, key, place)),
            toml::Value::Table(all) => all.iter().try_for_each(|(k, v)| {
                plain_name("key", k, place(key))?;
                walk(v, k, place)
            }),
            _ => Ok(()),
        }
    }
    let place = |key: &str| {
        let line = text.lines().position(|l| l.trim_start().starts_with(key) && l.contains('\\'));
        line.map_or_else(|| path.display().to_string(), |l| format!("{}:{}", path.display(), l + 1))
    };
    toml::from_str::<toml::Value>(text).map_or(Ok(()), |value| walk(&value, "", &place))
}

/// What to try after a message of the TOML reader, which quotes names in backticks: the offender, then what it knows.
fn toml_remedy(message: &str) -> String {
    let mut quoted = message.split('`').skip(1).step_by(2);
    let first = quoted.next().unwrap_or_default();
    if message.starts_with("unknown") {
        return match closest_name(first, quoted) {
            Some(meant) => format!("is \"{meant}\" meant?"),
            None => "remove it or correct its name".into(),
        };
    }
    if message.starts_with("missing field") {
        return format!("add {first} = ...");
    }
    "correct the line (text stands in quotes, numbers have a decimal point)".into()
}
