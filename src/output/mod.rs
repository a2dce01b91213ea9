//! Solution -> bytes.
//!
//! Exporters are pure: [`files`] and [`stand_alone_files`] make every file of a result in memory (for small pictures in the report they look at images of the series),
//! [`write_all`] alone writes.
//! A new exporter is one file here and one row in [`files`].

mod bodies_record;
mod camera_file;
pub mod camera_formats;
#[cfg(feature = "draw")]
mod canvas;
pub mod comparison;
mod compensation;
mod compensation_read;
mod context;
mod controller_files;
pub mod corrections;
pub mod detection_files;
pub mod difference;
#[cfg(feature = "draw")]
mod dot_font;
mod estimates;
mod finding_record;
pub mod flange_table;
pub mod frame_files;
pub mod frame_findings;
pub mod frames_record;
mod gauge;
mod image_records;
mod kinematics_file;
mod names;
mod npy;
mod observation_table;
#[cfg(feature = "draw")]
pub mod overlay;
pub mod photogrammetry;
pub mod plan_files;
pub mod plan_programs;
pub mod plan_start;
#[cfg(feature = "draw")]
pub mod plate_drawing;
mod plate_files;
#[cfg(feature = "draw")]
mod plate_pdf;
#[cfg(feature = "draw")]
mod plate_png;
#[cfg(feature = "draw")]
mod plate_svg;
mod pose_files;
mod pose_record;
pub mod poses_record;
#[cfg(feature = "mcap")]
pub mod recording;
#[cfg(feature = "report")]
pub(crate) mod report;
mod residuals;
pub mod restore;
mod robot_files;
mod series_record;
mod solution_bytes;
mod solution_check;
pub mod solution_json;
mod solution_record;
pub mod stand_alone_files;
mod text;
pub mod verdict;
mod write;

pub use compensation_read::{compensated, parse_compensation, read_compensation};
pub use context::{Context, Offsets, Poses};
pub use controller_files::kinematics_xacro;
pub use kinematics_file::kinematics_yaml;
pub use names::folder_name;
#[cfg(feature = "report")]
pub use report::{
    FILE_NAME as REPORT, FigureFile, Shown, Thumbnail, Thumbnails, figure_files, plan_html, report_html, sigma_text,
};
pub use robot_files::{ALONE, CALIBRATED};
pub use write::{NewFolder, NewResult, ResultFolder, recover, write_all, write_beside};

use std::collections::BTreeMap;

use crate::error::Result;
use crate::identify::{Solution, depths_m};
use crate::problem::Adjustment;

/// Every file of the result: name -> bytes.
///
/// # Errors
/// A camera that a ROS camera_info cannot express, a URDF that cannot be patched, estimates that are not finite.
pub fn files(solution: &Solution, context: &Context) -> Result<BTreeMap<String, Vec<u8>>> {
    let gauge = gauge::Gauge::of(&solution.fit)?;
    let Adjustment { problem, state } = &solution.fit.adjustment;
    let depths = depths_m(problem, &solution.free_poses);
    let mut files = BTreeMap::new();
    let mut add = |name: String, text: String| files.insert(name, text.into_bytes());
    // Poses of a controller tell nothing of its robot.
    if state.robot.chain.pose_coordinates().is_none() {
        for (name, text) in robot_files::all(solution, context)? {
            add(name, text);
        }
    }
    for (name, text) in camera_file::cameras(&problem.cameras, &state.cameras, &depths)? {
        add(name, text);
    }
    for (name, text) in pose_files::mountings(solution).into_iter().chain(pose_files::placements(solution, &gauge)) {
        add(name, text);
    }
    for (name, text) in plate_files::plates(&solution.fit, &context.series, &gauge)? {
        add(name, text);
    }
    let images = names::ImageNames::new(problem, &context.series);
    if context.poses == Poses::Written {
        add("poses.csv".into(), pose_files::poses_csv(&images, &solution.free_poses));
    }
    let together = if context.poses == Poses::Written { solution.poses_together()? } else { None };
    if let Some((_, covariance)) = &together {
        files.insert(pose_files::TOGETHER.into(), npy::matrix(covariance));
    }
    let mut names: Vec<String> = files.keys().cloned().collect();
    names.extend([solution_json::FILE_NAME, observation_table::FILE_NAME].map(str::to_owned));
    #[cfg(feature = "report")]
    names.push(report::FILE_NAME.to_owned());
    names.sort();
    let mut record = solution_record::record(solution, context, &gauge, names)?;
    record.covariance_together =
        together.map(|(order, _)| order.into_iter().map(|i| images.of(i).to_owned()).collect());
    #[cfg(feature = "report")]
    files.insert(
        report::FILE_NAME.into(),
        report::report_html(&record, &Thumbnails::of_files(record.photogrammetry())).into_bytes(),
    );
    files.insert(solution_json::FILE_NAME.into(), solution_json::to_bytes(&record)?);
    // Of very many images record and table are large, and not both are needed.
    drop(record);
    files.insert(
        observation_table::FILE_NAME.into(),
        observation_table::observations_csv(&solution.fit, &context.series).into_bytes(),
    );
    Ok(files)
}
