//! `[camera]` or `[[camera]]` of `series.toml`: the cameras of a series.

use std::fmt;
use std::path::Path;

use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::toml_file::require_positive;
use crate::error::{Code, Error, Result};

/// Where the camera is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CameraMount {
    /// Camera on the tip, plate fixed in the base.
    Hand,
    /// Plate on the tip, camera fixed in the base.
    Fixed,
}

impl CameraMount {
    /// The way that it is not.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::Hand => Self::Fixed,
            Self::Fixed => Self::Hand,
        }
    }
}

/// One camera: everything optional, every starting value can be found from the data.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraSection {
    /// Series with the same name share intrinsics; default the name of the series folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Series with the same mounting share the hand-camera offset; default the name of the series folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mounting: Option<String>,
    /// Where this camera is; default `camera_mount`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mount: Option<CameraMount>,
    /// Link of the robot that carries the camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub link: Option<String>,
    /// Folder of its images, relative to the manifest; default `images`, with several cameras `images/<name>`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub images: Option<String>,
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

impl CameraSection {
    /// A camera of which nothing is stated.
    pub const UNSTATED: Self = Self {
        name: None,
        mounting: None,
        mount: None,
        link: None,
        images: None,
        model: None,
        focal_px: None,
        width_px: None,
        height_px: None,
        bits: None,
    };

    /// Width and height of the images as stated, px.
    pub fn size_px(&self) -> Option<(u32, u32)> {
        self.width_px.zip(self.height_px)
    }

    fn check(&self, path: &Path) -> Result<()> {
        require_positive(path, "camera.focal_px", self.focal_px)?;
        require_positive(path, "camera.width_px", self.width_px.map(f64::from))?;
        require_positive(path, "camera.height_px", self.height_px.map(f64::from))?;
        if let Some(bits) = self.bits.filter(|b| !(8..=16).contains(b)) {
            let what = format!("camera.bits = {bits}");
            let remedy = "give 8 to 16, the bits that the sensor delivers";
            return Err(Error::new(Code::SettingRange, path.display(), what, remedy));
        }
        if self.width_px.is_some() != self.height_px.is_some() {
            let what = "one of camera.width_px and camera.height_px is missing";
            return Err(Error::new(Code::SettingConflict, path.display(), what, "give both or none"));
        }
        Ok(())
    }
}

/// The cameras of a series: none stated, one (`[camera]`), or several (`[[camera]]`), each with a name of its own.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cameras(Vec<CameraSection>);

impl Cameras {
    /// The only camera, or the first; one of which nothing is stated where there is none.
    pub fn first(&self) -> &CameraSection {
        self.0.first().unwrap_or(&CameraSection::UNSTATED)
    }

    /// The only camera, or the first, to be filled in.
    pub fn first_mut(&mut self) -> &mut CameraSection {
        if self.0.is_empty() {
            self.0.push(CameraSection::default());
        }
        &mut self.0[0]
    }

    /// The cameras as stated.
    pub fn iter(&self) -> std::slice::Iter<'_, CameraSection> {
        self.0.iter()
    }

    /// The cameras as stated.
    pub fn as_slice(&self) -> &[CameraSection] {
        &self.0
    }

    /// Number of cameras that are stated.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// True where none is stated.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn check(&self, path: &Path) -> Result<()> {
        self.0.iter().try_for_each(|c| c.check(path))?;
        if self.0.len() < 2 {
            return Ok(());
        }
        for (k, camera) in self.0.iter().enumerate() {
            let Some(name) = &camera.name else {
                let what = format!("camera {} of {} has no name", k + 1, self.0.len());
                let remedy = "give every [[camera]] a name, as it stands in images.csv";
                return Err(Error::new(Code::SettingMissing, path.display(), what, remedy));
            };
            if self.0[..k].iter().any(|c| c.name.as_ref() == Some(name)) {
                let what = format!("two cameras are named \"{name}\"");
                return Err(Error::new(Code::SettingConflict, path.display(), what, "rename one"));
            }
        }
        Ok(())
    }
}

impl From<CameraSection> for Cameras {
    fn from(camera: CameraSection) -> Self {
        Self(vec![camera])
    }
}

impl From<Vec<CameraSection>> for Cameras {
    fn from(cameras: Vec<CameraSection>) -> Self {
        Self(cameras)
    }
}

impl Serialize for Cameras {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        match self.0.as_slice() {
            [one] => one.serialize(serializer),
            all => all.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Cameras {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        deserializer.deserialize_any(TableOrList)
    }
}

/// Reads a table as one camera and a list as several; complaints keep their place in the file.
struct TableOrList;

impl<'de> Visitor<'de> for TableOrList {
    type Value = Cameras;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("[camera] or several [[camera]]")
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> std::result::Result<Cameras, A::Error> {
        CameraSection::deserialize(MapAccessDeserializer::new(map)).map(Cameras::from)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> std::result::Result<Cameras, A::Error> {
        Vec::deserialize(SeqAccessDeserializer::new(list)).map(Cameras)
    }
}
