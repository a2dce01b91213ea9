//! Which controller readings are of: that of the identification, or the one whose zero points were corrected by its result.

use std::path::Path;

use clap::{Args, ValueEnum};

use super::verify_stated::{Stated, were_fitted_to};
use crate::error::{Code, Error, Result};
use crate::output::restore::entered_offsets;
use crate::output::solution_json::SolutionRecord;
use crate::series::InputFile;

/// Flag of commands that read joint values to a robot that was identified.
#[derive(Debug, Clone, Copy, Args)]
pub(super) struct ReadingsArgs {
    /// With a result of `identify --offsets mastering`: whether the controller showed these joint values before the offsets of mastering.csv
    /// were entered, or after [default: before for measurements that the robot was identified from, after for others]
    #[arg(long, value_enum, value_name = "WHEN")]
    readings: Option<Readings>,
}

/// When readings were taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Readings {
    /// Before the offsets were entered
    Before,
    /// After
    After,
}

/// How readings are taken.
pub(super) struct Zeros {
    /// When they were read.
    readings: Readings,
    /// What the controller has added to its readings since it showed these, rad or m.
    pub missing: Vec<f64>,
    /// What it adds once the offsets are entered.
    entered: Vec<f64>,
    is_told: bool,
}

impl ReadingsArgs {
    /// As [`ReadingsArgs::of`], for the solution of a description, where there is one.
    ///
    /// # Errors
    /// The flag without such a solution: nothing says then by how much the two differ.
    pub(super) fn beside(self, stated: Option<&Stated>, urdf: &Path, files: &[InputFile]) -> Result<Option<Zeros>> {
        match (stated, self.readings) {
            (Some(stated), _) => self.of(stated.record(), files),
            (None, None) => Ok(None),
            (None, Some(_)) => {
                let what =
                    format!("needs the solution.json from which {} came, and none stands beside it", urdf.display());
                let remedy = "give the description in its folder of results, or leave the flag out";
                Err(Error::new(Code::OptionConflict, "--readings", what, remedy))
            }
        }
    }

    /// Where no joint values are read.
    ///
    /// # Errors
    /// The flag.
    pub(super) fn of_none(self) -> Result<Option<Zeros>> {
        self.readings.map_or(Ok(None), |_| {
            let (what, remedy) = ("no joint values are read here", "leave the flag out, or give touches");
            Err(Error::new(Code::OptionConflict, "--readings", what, remedy))
        })
    }

    /// How readings to a solution are taken that came with some files; nothing where the exported robot takes the readings of the identification.
    ///
    /// # Errors
    /// A solution that does not hang together; the flag where the two readings are the same; none where the files of some folders were inputs
    /// of the solution and those of others were not.
    pub(super) fn of(self, record: &SolutionRecord, files: &[InputFile]) -> Result<Option<Zeros>> {
        let entered = entered_offsets(record)?;
        if entered.iter().all(|offset| *offset == 0.0) {
            return self.readings.map_or(Ok(None), |_| {
                let what =
                    "the result has no offsets to enter in the controller: readings before and after are the same";
                Err(Error::new(Code::OptionConflict, "--readings", what, "leave the flag out"))
            });
        }
        let readings = self.readings.map_or_else(|| by_files(record, files), Ok)?;
        Ok(Some(Zeros::new(readings, entered, self.readings.is_some())))
    }
}

/// When readings were taken that came with some files.
fn by_files(record: &SolutionRecord, files: &[InputFile]) -> Result<Readings> {
    match were_fitted_to(record, files) {
        Some(true) => Ok(Readings::Before),
        Some(false) => Ok(Readings::After),
        None => {
            let what = "is needed: the robot was identified from some of the folders and not from others, and readings are taken one way";
            let remedy = "give these folders apart, or say --readings before or --readings after for all";
            Err(Error::new(Code::OptionConflict, "--readings", what, remedy))
        }
    }
}

impl Zeros {
    fn new(readings: Readings, entered: Vec<f64>, is_told: bool) -> Self {
        let missing = if readings == Readings::Before { entered.clone() } else { vec![0.0; entered.len()] };
        Self { readings, missing, entered, is_told }
    }

    /// The readings taken the other way: what is to be added to those that were taken this way.
    pub(super) fn instead(&self) -> Vec<f64> {
        let sign = if self.readings == Readings::Before { -1.0 } else { 1.0 };
        self.entered.iter().map(|offset| sign * offset).collect()
    }

    /// The other word for the option.
    pub(super) fn other(&self) -> &'static str {
        if self.readings == Readings::Before { "after" } else { "before" }
    }

    /// What is taken, for the user.
    pub(super) fn line(&self) -> String {
        let when = match self.readings {
            Readings::Before => "before the offsets of mastering.csv were entered (they are added)",
            Readings::After => "with the offsets of mastering.csv entered",
        };
        let why = if self.is_told { String::new() } else { format!("; else say --readings {}", self.other()) };
        format!("readings  taken as those of the controller {when}{why}")
    }
}
