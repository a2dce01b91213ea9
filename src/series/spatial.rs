//! What was measured of the tip in space: points and poses of a tracker, and contacts.

use std::path::Path;

use nalgebra::Vector3;

use super::contact_file::{self, ContactRow};
use super::inputs::InputFile;
use super::joints::Stops;
use super::point_file::{self, PointRow};
use super::pose_file::{self, PoseRow};
use super::stop_index::StopIndex;
use super::table::Table;
use crate::error::{Code, Notice, Result};

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
    pub fn read(folder: &Path, stops: &Stops, inputs: &mut Vec<InputFile>, notices: &mut Vec<Notice>) -> Result<Self> {
        let index = StopIndex::of(stops);
        let mut table = |name: &str| -> Result<Option<Table>> {
            let path = folder.join(name);
            path.is_file().then(|| Table::read(&path, inputs)).transpose()
        };
        let [points, poses, contacts] = Self::NAMES.map(&mut table);
        let [points, poses, contacts] = [points?, poses?, contacts?];
        let mut all = Self {
            points: points.map_or_else(|| Ok(Vec::new()), |t| point_file::rows(&t, &index))?,
            poses: poses.map_or_else(|| Ok(Vec::new()), |t| pose_file::rows(&t, &index))?,
            contacts: contacts.map_or_else(|| Ok(Vec::new()), |t| contact_file::rows(&t, &index))?,
        };
        let [of_points, of_poses, _] = Self::NAMES.map(|name| folder.join(name));
        notices.extend(leave_out_lost(&of_points, &mut all.points, |row| (row.tracker_from_point_m, row.line)));
        notices
            .extend(leave_out_lost(&of_poses, &mut all.poses, |row| (row.tracker_from_target.translation, row.line)));
        Ok(all)
    }

    /// True where there is none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty() && self.poses.is_empty() && self.contacts.is_empty()
    }
}

/// Leaves out rows that some trackers write where they lost the beam: the origin of the instrument, to the last digit. One alone may be real, of a
/// device with its frame in the target.
fn leave_out_lost<R>(file: &Path, rows: &mut Vec<R>, at: impl Fn(&R) -> (Vector3<f64>, u64)) -> Option<Notice> {
    let lost: Vec<String> = rows
        .iter()
        .map(&at)
        .filter(|(position, _)| *position == Vector3::zeros())
        .map(|(_, l)| l.to_string())
        .collect();
    if lost.len() < 2 || lost.len() == rows.len() {
        return None;
    }
    rows.retain(|row| at(row).0 != Vector3::zeros());
    let what = format!(
        "{} rows are exactly at (0, 0, 0), as where the tracker lost the target (lines {})",
        lost.len(),
        lost.join(", ")
    );
    Some(Notice::new(Code::TargetLost, file.display(), what, "they are left out; measure again at these stops"))
}
