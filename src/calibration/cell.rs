//! The robots of a cell: one URDF, or that of a second arm beside it.

use std::path::Path;

use crate::error::{Code, Error, Result};
use crate::series::{InputFile, Series};
use crate::urdf::{self, RobotDescription, SECOND_ARM_PREFIX};

/// Links between which the robot is identified; those that are not given are as series.toml and the URDF say.
#[derive(Debug, Clone, Copy, Default)]
pub struct Ends<'a> {
    /// Base link.
    pub base: Option<&'a str>,
    /// Tip link.
    pub tip: Option<&'a str>,
}

/// What the URDFs of a cell say.
pub(super) struct CellFiles {
    /// One robot, or two joined to one.
    pub description: RobotDescription,
    /// The files.
    pub files: Vec<InputFile>,
    /// Link of the second arm that carries the plate.
    pub second_tip: Option<String>,
}

impl CellFiles {
    /// Reads the URDF, and that of the second arm that the series name; one that has both arms already stays as it is.
    ///
    /// # Errors
    /// Those of [`urdf::read`]; series that do not name the same second arm.
    pub fn read(urdf: &Path, series: &[Series], ends: Ends) -> Result<Self> {
        let description = urdf::read(urdf)?;
        let mut files = vec![InputFile::of_bytes(urdf, description.text.as_bytes())];
        let Some(first) = series.first() else { return Ok(Self { description, files, second_tip: None }) };
        if let Some(other) = series.iter().find(|s| s.manifest.robot_2 != first.manifest.robot_2) {
            return Err(Error::new(
                Code::SeriesDisagree,
                other.manifest_file().display(),
                format!("its [robot_2] is not that of {}", first.name),
                "identify series with and without a second arm one by one",
            ));
        }
        let Some(arm) = &first.manifest.robot_2 else { return Ok(Self { description, files, second_tip: None }) };
        let path = arm.urdf.as_ref().map_or_else(|| urdf.to_path_buf(), |file| first.folder.join(file));
        let second = urdf::read(&path)?;
        files.extend((path != urdf).then(|| InputFile::of_bytes(&path, second.text.as_bytes())));
        let tip = second.chain(arm.base.as_deref(), arm.tip.as_deref())?.tip;
        if description.has_two_bases() {
            let prefixed = format!("{SECOND_ARM_PREFIX}{tip}");
            let second_tip = if description.links().any(|l| l == prefixed) { prefixed } else { tip };
            return Ok(Self { second_tip: Some(second_tip), description, files });
        }
        let base = ends.base.or(first.manifest.base.as_deref());
        let (description, prefix) = description.with_second(base, &second)?;
        Ok(Self { description, files, second_tip: Some(format!("{prefix}{tip}")) })
    }
}
