//! What was measured of the tip in space: points and poses of a tracker, and contacts.

use std::path::Path;

use super::contact_file::{self, ContactRow};
use super::inputs::InputFile;
use super::joints::Stops;
use super::point_file::{self, PointRow};
use super::pose_file::{self, PoseRow};
use super::stop_index::StopIndex;
use super::table::Table;
use crate::error::Result;

/// Everything of this kind in a series.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SpatialFiles {
    /// Rows of points.csv.
    pub points: Vec<PointRow>,
    /// Rows of poses.csv.
    pub poses: Vec<PoseRow>,
    /// Rows of contacts.csv.
    pub contacts: Vec<ContactRow>,
}

impl SpatialFiles {
    /// Names of the files.
    pub const NAMES: [&str; 3] = ["points.csv", "poses.csv", "contacts.csv"];

    /// Reads those of the files that a series folder has.
    ///
    /// # Errors
    /// By file, line and stop: stops that are not there, numbers that are none, rows that say the same thing.
    pub fn read(folder: &Path, stops: &Stops, inputs: &mut Vec<InputFile>) -> Result<Self> {
        let index = StopIndex::of(stops);
        let mut table = |name: &str| -> Result<Option<Table>> {
            let path = folder.join(name);
            path.is_file().then(|| Table::read(&path, inputs)).transpose()
        };
        let [points, poses, contacts] = Self::NAMES.map(&mut table);
        let [points, poses, contacts] = [points?, poses?, contacts?];
        Ok(Self {
            points: points.map_or_else(|| Ok(Vec::new()), |t| point_file::rows(&t, &index))?,
            poses: poses.map_or_else(|| Ok(Vec::new()), |t| pose_file::rows(&t, &index))?,
            contacts: contacts.map_or_else(|| Ok(Vec::new()), |t| contact_file::rows(&t, &index))?,
        })
    }

    /// True where there is none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty() && self.poses.is_empty() && self.contacts.is_empty()
    }
}
