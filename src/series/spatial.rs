//! What was measured of the tip in space: points and poses of a tracker, and contacts.

use std::collections::BTreeSet;
use std::path::Path;

use nalgebra::Vector3;

use super::contact_file::{self, ContactRow};
use super::controller_file::table_of_stops;
use super::inputs::InputFile;
use super::joints::Stops;
use super::point_file::{self, PointRow};
use super::pose_file::{self, LostRow, PoseRow};
use super::stop_index::StopIndex;
use super::table::Table;
use crate::error::{Code, Error, Notice, Result};

/// Everything of this kind in a series.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SpatialFiles {
    /// Rows of points.csv.
    pub points: Vec<PointRow>,
    /// Rows of poses.csv.
    pub poses: Vec<PoseRow>,
    /// Rows of contacts.csv.
    pub contacts: Vec<ContactRow>,
    /// Names of targets that the tracker had lost in all their rows.
    pub lost: Vec<String>,
}

impl SpatialFiles {
    /// Names of the files.
    pub const NAMES: [&str; 3] = ["points.csv", "poses.csv", "contacts.csv"];

    /// Reads those of the files that a series folder has.
    ///
    /// # Errors
    /// By file, line and stop: stops that are not there, numbers that are none, rows that say the same thing.
    pub fn read(folder: &Path, stops: &Stops, inputs: &mut Vec<InputFile>, notices: &mut Vec<Notice>) -> Result<Self> {
        let index = StopIndex::of(stops, table_of_stops(folder));
        let mut table = |name: &str| -> Result<Option<Table>> {
            let path = folder.join(name);
            path.is_file().then(|| Table::read(&path, inputs)).transpose()
        };
        let [points, poses, contacts] = Self::NAMES.map(&mut table);
        let [points, poses, contacts] = [points?, poses?, contacts?];
        let (poses, no_poses) = poses.map_or_else(|| Ok((Vec::new(), Vec::new())), |t| pose_file::rows(&t, &index))?;
        let mut all = Self {
            points: points.map_or_else(|| Ok(Vec::new()), |t| point_file::rows(&t, &index))?,
            poses,
            contacts: contacts.map_or_else(|| Ok(Vec::new()), |t| contact_file::rows(&t, &index))?,
            lost: Vec::new(),
        };
        let [of_points, of_poses, _] = Self::NAMES.map(|name| folder.join(name));
        let points =
            Lost::of(&mut all.points, Vec::new(), |row| (row.tracker_from_point_m, row.target.as_str(), row.line));
        let poses = Lost::of(&mut all.poses, no_poses, |row| {
            (row.tracker_from_target.translation, row.target.as_str(), row.line)
        });
        let lost = [(of_points, points), (of_poses, poses)];
        for (file, lost) in lost.into_iter().filter(|(_, lost)| !lost.lines.is_empty()) {
            notices.push(lost.notice(&file)?);
            all.lost.extend(lost.targets);
        }
        Ok(all)
    }

    /// True where there is none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty() && self.poses.is_empty() && self.contacts.is_empty()
    }
}

/// Rows that a tracker wrote where it had lost the target.
struct Lost {
    /// Their lines.
    lines: BTreeSet<u64>,
    /// Targets that no row is left of.
    targets: BTreeSet<String>,
    /// Rows that are left, of all targets.
    left: usize,
}

impl Lost {
    /// Leaves out rows that some trackers write where they lost the beam: the origin of the instrument, to the last digit. One alone may be real, of
    /// a device with its frame in the target; not so one that is no rotation, either (`zeros`).
    fn of<R>(rows: &mut Vec<R>, zeros: Vec<LostRow>, at: impl Fn(&R) -> (Vector3<f64>, &str, u64)) -> Self {
        let is_zero = |row: &R| at(row).0 == Vector3::zeros();
        let at_zero = rows.iter().filter(|row| is_zero(row));
        let (mut targets, mut lines): (BTreeSet<String>, BTreeSet<u64>) =
            at_zero.map(|row| (at(row).1.to_owned(), at(row).2)).unzip();
        if lines.len() + zeros.len() < 2 {
            (targets, lines) = Default::default();
        } else {
            rows.retain(|row| !is_zero(row));
        }
        let (of_zeros, their_lines): (BTreeSet<String>, BTreeSet<u64>) =
            zeros.into_iter().map(|row| (row.target, row.line)).unzip();
        targets.extend(of_zeros);
        lines.extend(their_lines);
        rows.iter().for_each(|row| {
            targets.remove(at(row).1);
        });
        Self { lines, targets, left: rows.len() }
    }

    /// What is said of them.
    ///
    /// # Errors
    /// No row of the file is left.
    fn notice(&self, file: &Path) -> Result<Notice> {
        let lines: Vec<String> = self.lines.iter().map(u64::to_string).collect();
        let what = format!(
            "{} rows are exactly at (0, 0, 0), as where the tracker lost the target (lines {})",
            lines.len(),
            lines.join(", ")
        );
        if self.left == 0 {
            let what = format!("all {what}");
            let remedy = "measure again, or remove the file";
            return Err(Error::new(Code::TargetLost, file.display(), what, remedy));
        }
        let gone: Vec<&str> = self.targets.iter().map(String::as_str).collect();
        let what = match gone[..] {
            [] => what,
            _ => format!(
                "{what}; nothing is left of {} in this file, and a [[distance]] to it takes part only where another file has it",
                gone.join(", ")
            ),
        };
        Ok(Notice::new(Code::TargetLost, file.display(), what, "they are left out; measure again at these stops"))
    }
}
