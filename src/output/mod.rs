//! Solution -> bytes.
//!
//! Exporters are pure: [`files`] makes every file of a result in memory, [`write_all`] alone touches the disk.
//! A new exporter is one file here and one row in [`files`].

mod camera_file;
mod canvas;
pub mod comparison;
mod compensation;
mod compensation_read;
mod controller_files;
pub mod corrections;
pub mod detection_files;
pub mod difference;
mod dot_font;
mod estimates;
pub mod flange_table;
mod gauge;
mod kinematics_file;
mod names;
mod observation_table;
pub mod overlay;
pub mod plan_files;
pub mod plan_programs;
pub mod plan_start;
pub mod plate_drawing;
mod plate_files;
mod plate_pdf;
mod plate_png;
mod plate_svg;
mod pose_files;
pub mod recording;
pub(crate) mod report;
mod residuals;
pub mod restore;
mod robot_files;
mod solution_bytes;
mod solution_check;
pub mod solution_json;
mod solution_record;
mod text;
mod write;

pub use compensation_read::{compensated, parse_compensation, read_compensation};
pub use controller_files::kinematics_xacro;
pub use kinematics_file::kinematics_yaml;
pub use names::folder_name;
pub use report::{plan_html, report_html, sigma_text};
pub use write::{NewFolder, NewResult, Place, recover, write_all, write_beside};

use std::collections::BTreeMap;

use crate::error::Result;
use crate::identify::Solution;
use crate::series::InputFile;
use crate::urdf::RobotDescription;

/// What the exporters need beside the solution.
#[derive(Debug, Clone)]
pub struct Context<'a> {
    /// The robot as read, whose text is patched.
    pub robot: &'a RobotDescription,
    /// Name of the robot in file names.
    pub robot_name: &'a str,
    /// Names of the series, in the order in which they were given.
    pub series: Vec<String>,
    /// All files that were read, with their hashes.
    pub inputs: Vec<InputFile>,
    /// Options in words: name and value, in the order in which they are to be shown.
    pub options: Vec<(String, String)>,
    /// The command line.
    pub command: String,
    /// Where joint offsets go (`--offsets`).
    pub offsets: Offsets,
    /// Whether stand-alone poses are wanted (`--poses`).
    pub poses: Poses,
}

/// Where joint offsets go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Offsets {
    /// Into the origins: controller angles stay as they are.
    Folded,
    /// Into the mastering table of the controller; the origins are without them.
    Mastering,
}

/// Whether poses.csv is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Poses {
    /// Write the stand-alone camera poses.
    Written,
    /// Leave them out.
    LeftOut,
}

/// Every file of the result: name -> bytes.
///
/// # Errors
/// A camera that a ROS camera_info cannot express, a URDF that cannot be patched, estimates that are not finite.
pub fn files(solution: &Solution, context: &Context) -> Result<BTreeMap<String, Vec<u8>>> {
    let gauge = gauge::Gauge::of(solution)?;
    let mut files = BTreeMap::new();
    let mut add = |name: String, text: String| files.insert(name, text.into_bytes());
    add(robot_files::urdf_name(context), robot_files::urdf(solution, context)?);
    add("kinematics.yaml".into(), kinematics_file::of_solution(solution, context));
    add("kinematics.xacro".into(), controller_files::xacro(solution, context));
    add("mdh.csv".into(), controller_files::mdh_csv(solution, context));
    add("mastering.csv".into(), controller_files::mastering_csv(solution, context));
    add("compensation.toml".into(), compensation::compensation_toml(solution, context)?);
    for (name, text) in camera_file::cameras(solution)? {
        add(name, text);
    }
    for (name, text) in pose_files::mountings(solution).into_iter().chain(pose_files::placements(solution, &gauge)) {
        add(name, text);
    }
    for (name, text) in plate_files::plates(solution, context, &gauge)? {
        add(name, text);
    }
    if context.poses == Poses::Written {
        add("poses.csv".into(), pose_files::poses_csv(solution, context));
    }
    add("observations.csv".into(), observation_table::observations_csv(solution, context));
    let mut names: Vec<String> = files.keys().cloned().collect();
    names.extend([REPORT.to_owned(), solution_json::FILE_NAME.to_owned()]);
    names.sort();
    let record = solution_record::record(solution, context, &gauge, names)?;
    files.insert(REPORT.into(), report::report_html(&record).into_bytes());
    files.insert(solution_json::FILE_NAME.into(), solution_json::to_bytes(&record)?);
    Ok(files)
}

/// Name of the report.
const REPORT: &str = "report.html";
