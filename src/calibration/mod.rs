//! The front door: robot and series in, a calibration out.
//!
//! ```no_run
//! use robotcal::{Options, calibrate};
//!
//! let calibration = calibrate("kuka.urdf", ["run1"], &Options::default())?;
//! println!("{} mm held out", calibration.solution().accuracy.calibrated.rms_mm);
//! calibration.save("reports/run1")?;
//! # Ok::<(), robotcal::Error>(())
//! ```

mod cell;
mod inputs;
mod pictures;

pub use cell::Ends;
pub use inputs::{Inputs, Observed, Watch, require_unchanged};
pub use pictures::Pictures;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::diagnose::Finding;
use crate::error::Result;
use crate::geom::Pose;
use crate::identify::{Options, Solution, beside_two_stages, identify};
use crate::model::robot::Robot;
use crate::output::{self, Context, NewResult, Offsets, Poses, ResultFolder, solution_json};
use crate::series::{InputFile, RecordingOptions};
use crate::stage::stage;
use crate::urdf::RobotDescription;

/// Identifies the robot of a URDF from series folders or recordings.
///
/// # Errors
/// As of [`Inputs::read`], [`Inputs::observe`] and [`identify`].
pub fn calibrate<S: Into<PathBuf>>(
    urdf: impl AsRef<Path>,
    series: impl IntoIterator<Item = S>,
    options: &Options,
) -> Result<Calibration> {
    let folders: Vec<PathBuf> = series.into_iter().map(Into::into).collect();
    let inputs = Inputs::read(urdf.as_ref(), &folders, Ends::default())?;
    let observed = inputs.with_recordings(&RecordingOptions::default())?.observe(&options.limits, &|_, _| ())?;
    Calibration::of(observed, options)
}

/// A solution with the robot that it corrects.
#[derive(Debug)]
pub struct Calibration {
    solution: Solution,
    robot: Robot,
    description: RobotDescription,
    series: Vec<String>,
    files: Vec<InputFile>,
    options: Options,
}

/// How a calibration is written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Export {
    /// Where joint offsets go.
    pub offsets: Offsets,
    /// Whether poses.csv is written.
    pub poses: Poses,
    /// The command line, for the record.
    pub command: String,
}

impl Default for Export {
    fn default() -> Self {
        Self { offsets: Offsets::Folded, poses: Poses::LeftOut, command: String::new() }
    }
}

impl Calibration {
    /// Solves, and compares with two stages.
    ///
    /// # Errors
    /// As of [`identify`].
    pub fn of(observed: Observed, options: &Options) -> Result<Self> {
        let Observed { description, chain, series: measured, notices, files } = observed;
        let mut solution = identify(chain, &measured, options)?;
        solution.two_stage = beside_two_stages(&solution);
        solution.findings.splice(0..0, notices.into_iter().map(Into::into));
        let series = measured.into_iter().map(|s| s.name).collect();
        let robot = solution.exported_robot();
        Ok(Self { solution, robot, description, series, files, options: options.clone() })
    }

    /// The fit with everything that was found.
    pub fn solution(&self) -> &Solution {
        &self.solution
    }

    /// What was found out about the data, doubts and failed gates among it.
    pub fn findings(&self) -> &[Finding] {
        &self.solution.findings
    }

    /// The identified robot, as the exported files describe it.
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// `base_from_tip` at readings in rad or m, in the order of the chain.
    pub fn fk(&self, readings: &[f64]) -> Pose {
        self.robot.base_from_tip(readings)
    }

    /// Every file of the result: name -> bytes.
    ///
    /// # Errors
    /// As of [`output::files`].
    pub fn files(&self, export: &Export) -> Result<BTreeMap<String, Vec<u8>>> {
        output::files(&self.solution, &self.context(export))
    }

    /// Writes the files of the result one after the other, so that only one of them is in memory.
    ///
    /// # Errors
    /// As of [`output::each_file`]; a file that cannot be written.
    pub fn write(&self, export: &Export, result: &NewResult) -> Result<()> {
        let _stage = stage("files");
        output::each_file(&self.solution, &self.context(export), &mut |name, bytes| result.put(name, &bytes))
    }

    /// Writes the result into a folder, replacing an earlier one as a whole.
    ///
    /// # Errors
    /// As of [`Calibration::write`] and [`output::write_all`].
    pub fn save(&self, folder: impl AsRef<Path>) -> Result<()> {
        let result = ResultFolder::claim(folder.as_ref(), solution_json::FILE_NAME)?.begin()?;
        self.write(&Export::default(), &result)?;
        result.finish()
    }

    /// The report, a self-contained page.
    ///
    /// # Errors
    /// As of [`Calibration::files`].
    #[cfg(feature = "report")]
    pub fn report_html(&self) -> Result<String> {
        let page = self.files(&Export::default())?.remove(output::REPORT).unwrap_or_default();
        Ok(String::from_utf8_lossy(&page).into_owned())
    }

    fn context(&self, export: &Export) -> Context<'_> {
        Context {
            robot: &self.description,
            robot_name: &self.description.name,
            series: self.series.clone(),
            inputs: self.files.clone(),
            options: self.options.in_words(),
            command: export.command.clone(),
            offsets: export.offsets,
            poses: export.poses,
        }
    }
}
