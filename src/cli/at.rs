//! `--at`: the flange at given joint vectors.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;

use super::joint_table::{self, Unit};
use crate::error::Result;
use crate::output::flange_table::{at_csv, flange_at};
use crate::output::restore::found_model;
use crate::output::solution_json::SolutionRecord;
use crate::output::write_beside;

/// Flags of `--at`.
#[derive(Debug, Args)]
#[command(next_help_heading = "The flange at given readings")]
pub(super) struct AtArgs {
    /// Joint vectors (CSV, columns named as the joints): pose and uncertainty of the flange relative to the plate, by the corrected URDF with compensation.toml, go to at.csv. A constant displacement of the flange, which no series tells, is in no uncertainty there: that of the camera on it is in hand_camera.yaml
    #[arg(long, value_name = "FILE", requires = "at_unit")]
    at: Option<PathBuf>,
    /// Unit of the revolute joints in that file
    #[arg(long, value_enum)]
    at_unit: Option<Unit>,
}

/// Most rows that are printed.
const MOST_ROWS: usize = 20;

impl AtArgs {
    /// Predicts, writes at.csv into `folder` and says what it holds; nothing without `--at`.
    ///
    /// # Errors
    /// A table that cannot be read, a solution that does not tie robot and plate, a file that cannot be written.
    pub(super) fn run(&self, record: &SolutionRecord, folder: &Path) -> Result<String> {
        let (Some(file), Some(unit)) = (&self.at, self.at_unit) else { return Ok(String::new()) };
        let model = found_model(record)?;
        let rows = joint_table::read(file, &[], &model.robot.chain, (unit, "--at-unit"))?;
        let readings: Vec<Vec<f64>> = rows.into_iter().map(|(_, q)| q).collect();
        let found = flange_at(&model, &readings)?;
        let path = folder.join("at.csv");
        let table = at_csv(&model, &readings, &found);
        write_beside(folder, &[("at.csv".to_owned(), table.as_bytes())], std::slice::from_ref(file))?;
        let mut out = String::new();
        for (k, f) in found.iter().enumerate().take(MOST_ROWS) {
            let [position, rotation] = f.sigmas();
            let [x, y, z] = f.pose.xyz().map(|v| 1e3 * v);
            let outside = if f.outside.is_empty() {
                String::new()
            } else {
                format!("; extrapolated: {} outside the stops", f.outside.join(", "))
            };
            // Writing to a String cannot fail.
            let _ = writeln!(
                out,
                "at        row {}: flange at ({x:.2}, {y:.2}, {z:.2}) mm, sigma {:.3} mm, {:.3} mrad{outside}",
                k + 1,
                1e3 * position,
                1e3 * rotation
            );
        }
        let _ = writeln!(
            out,
            "at        {} joint vectors in {}; the robot is the corrected URDF with compensation.toml",
            found.len(),
            path.display()
        );
        Ok(out)
    }
}
