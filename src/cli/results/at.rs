//! `--at`: the flange at given joint vectors.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;

use crate::assess::PredictedFlange;
use crate::cli::flags::joint_table::{self, Unit};
use crate::error::Result;
use crate::output::flange_table::{at_csv, flange_at, relative_to};
use crate::output::restore::{entered_offsets, exported_model};
use crate::output::solution_json::SolutionRecord;
use crate::output::{ResultFolder, write_beside};
use crate::urdf::Chain;

/// Flags of `--at`.
#[derive(Debug, Args)]
#[command(next_help_heading = "The flange at given readings")]
pub(super) struct AtArgs {
    /// Joint vectors (CSV, columns named as the joints): pose and uncertainty of the flange relative to the plate (of several placements that of most images, named in relative_to), by the corrected URDF with compensation.toml, go to at.csv. A constant displacement of the flange, which no series tells, is in no uncertainty there: that of the camera on it is in hand_camera.yaml
    #[arg(long, value_name = "FILE", requires = "at_unit")]
    at: Option<PathBuf>,
    /// Unit of the revolute joints in that file
    #[arg(long, value_enum)]
    at_unit: Option<Unit>,
}

/// Most rows that are printed.
const MOST_ROWS: usize = 20;

/// File of the predictions.
const AT: &str = "at.csv";

/// The joint vectors of `--at`, rad or m.
pub(super) struct AtTable<'a> {
    file: &'a Path,
    unit: Unit,
    readings: Vec<Vec<f64>>,
}

impl AtArgs {
    /// The place of a result, tried for the predictions as well.
    ///
    /// # Errors
    /// A file of their name that somebody else made.
    pub(super) fn place(&self, place: ResultFolder) -> Result<ResultFolder> {
        match self.at {
            Some(_) => place.for_files(&[AT]),
            None => Ok(place),
        }
    }

    /// The table, read before the work whose result it asks; nothing without `--at`.
    ///
    /// # Errors
    /// A table that cannot be read, or without the joints of the chain.
    pub(super) fn table(&self, chain: &Chain) -> Result<Option<AtTable<'_>>> {
        let (Some(file), Some(unit)) = (&self.at, self.at_unit) else { return Ok(None) };
        let rows = joint_table::read(file, &[], chain, (unit, "--at-unit"))?;
        Ok(Some(AtTable { file, unit, readings: rows.into_iter().map(|(_, q)| q).collect() }))
    }

    /// The same for a solution, whose chain is put together for it.
    ///
    /// # Errors
    /// As of [`AtArgs::table`]; a solution that does not hang together.
    pub(super) fn table_for(&self, record: &SolutionRecord) -> Result<Option<AtTable<'_>>> {
        match self.at {
            Some(_) => self.table(&exported_model(record)?.robot.chain),
            None => Ok(None),
        }
    }
}

impl AtTable<'_> {
    /// Predicts, writes at.csv into `folder` and says what it holds.
    ///
    /// # Errors
    /// A solution that does not tie robot and plate, a file that cannot be written.
    pub(super) fn run(&self, record: &SolutionRecord, folder: &Path) -> Result<String> {
        let Self { file, unit, readings } = self;
        let model = exported_model(record)?;
        let found = flange_at(&model, readings)?;
        let path = folder.join(AT);
        let table = at_csv(&model, (*unit).into(), readings, &found);
        write_beside(folder, &[(AT.to_owned(), table.as_bytes())], &[file.to_path_buf()])?;
        let rows = found.iter().enumerate().take(MOST_ROWS);
        let mut out: String = rows.map(|(k, found)| row_text(k, found)).collect();
        // Writing to a String cannot fail.
        if found.len() > MOST_ROWS {
            let _ = writeln!(out, "at        and {} more", found.len() - MOST_ROWS);
        }
        let still = relative_to(&model);
        let among = if still.starts_with("plate/") { record.placements.len() } else { record.mountings.len() };
        let _ = writeln!(
            out,
            "at        {} joint vectors in {} (readings in {}), relative to {}{}; the robot is the corrected URDF with compensation.toml{}",
            found.len(),
            path.display(),
            if *unit == Unit::Deg { "deg, m" } else { "rad, m" },
            still,
            if among > 1 { format!(" (of {among} that of most images on the robot)") } else { String::new() },
            if entered_offsets(record)?.iter().any(|offset| *offset != 0.0) {
                ", the readings those of the controller with the offsets of mastering.csv entered"
            } else {
                ""
            }
        );
        Ok(out)
    }
}

fn row_text(row: usize, found: &PredictedFlange) -> String {
    let [position, rotation] = found.sigmas();
    let [x, y, z] = found.pose.xyz().map(|v| 1e3 * v);
    let outside = match found.outside.is_empty() {
        true => String::new(),
        false => format!("; extrapolated: {} outside the stops", found.outside.join(", ")),
    };
    format!(
        "at        row {}: flange at ({x:.2}, {y:.2}, {z:.2}) mm, sigma {:.3} mm, {:.3} mrad{outside}\n",
        row + 1,
        1e3 * position,
        1e3 * rotation
    )
}
