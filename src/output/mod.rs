//! Solution -> bytes.
//!
//! Exporters are pure: [`each_file`] and [`stand_alone_files`] make every file of a result in memory (for small pictures in the report they look at images of the series),
//! [`ResultFolder`] alone writes.
//! A new exporter is one file in the folder of its subject and one row in [`each_file`].
//!
//! `vision` holds what images tell, `solution` the records of solution.json, `robot` the corrected robot, `judgement` what all that is worth; `frames` and
//! `plan` are results of other commands. `report` and `drawing` show them, `camera_formats` speaks the formats of other programs, `write` puts files on the disk.
//! Beside them stands what many need: names, numbers as text, matrices, the frames of plates.

pub mod camera_formats;
mod context;
#[cfg(feature = "draw")]
mod drawing;
pub mod flange_table;
mod frames;
mod gauge;
mod judgement;
mod names;
mod npy;
mod plan;
#[cfg(feature = "report")]
pub(crate) mod report;
mod robot;
mod solution;
pub mod stand_alone_files;
mod text;
mod vision;
mod write;

pub use context::{Context, Offsets, Poses};
#[cfg(feature = "draw")]
pub use drawing::{overlay, plate_drawing};
pub use frames::{frame_files, frame_findings, frames_record, work_findings};
pub use judgement::{comparison, corrections, difference, parameter_words, verdict, written_programs};
pub use names::folder_name;
pub use plan::{plan_files, plan_programs, plan_start, touch_plan};
#[cfg(feature = "report")]
pub use report::{
    FILE_NAME as REPORT, FigureFile, Shown, Thumbnail, Thumbnails, figure_files, plan_html, report_html, sigma_text,
};
pub use robot::compensation_read::{compensated, parse_compensation, read_compensation};
pub use robot::controller_files::kinematics_xacro;
pub use robot::corrected_robot::{ALONE, CALIBRATED};
pub use robot::kinematics_file::kinematics_yaml;
pub use solution::{photogrammetry, restore, solution_json};
#[cfg(feature = "mcap")]
pub use vision::recording;
pub use vision::{detection_files, poses_record};
pub use write::{NewFolder, NewResult, ResultFolder, is_changed, recover, write_all, write_beside};

use std::collections::BTreeMap;

use crate::error::Result;
use crate::identify::{Solution, depths_m};
use crate::problem::Adjustment;
use robot::corrected_robot;
use solution::solution_record;
use vision::{camera_file, observation_table, plate_files, pose_files};

/// Every file of the result: name -> bytes.
///
/// # Errors
/// As of [`each_file`].
pub fn files(solution: &Solution, context: &Context) -> Result<BTreeMap<String, Vec<u8>>> {
    let mut files = BTreeMap::new();
    each_file(solution, context, &mut |name, bytes| {
        files.insert(name.to_owned(), bytes);
        Ok(())
    })?;
    Ok(files)
}

/// Makes the files of the result one after the other and hands each to `put`, by name: of very many images they are large, and
/// need not be in memory together.
///
/// # Errors
/// A URDF that cannot be patched, estimates that are not finite; errors of `put`.
pub fn each_file(
    solution: &Solution,
    context: &Context,
    put: &mut impl FnMut(&str, Vec<u8>) -> Result<()>,
) -> Result<()> {
    let gauge = gauge::Gauge::of(&solution.fit, &solution.in_frame)?;
    let Adjustment { problem, state } = &solution.fit.adjustment;
    let depths = depths_m(problem, &solution.free_poses);
    let mut names: Vec<String> = Vec::new();
    let mut add = |name: String, bytes: Vec<u8>| {
        put(&name, bytes)?;
        names.push(name);
        Ok(())
    };
    // Poses of a controller tell nothing of its robot.
    if state.robot.chain.pose_coordinates().is_none() {
        corrected_robot::all(solution, context)?
            .into_iter()
            .try_for_each(|(name, text)| add(name, text.into_bytes()))?;
    }
    let images = names::ImageNames::new(problem, &context.series);
    let texts = (camera_file::cameras(&problem.cameras, &state.cameras, &depths).into_iter())
        .chain(pose_files::mountings(solution))
        .chain(pose_files::placements(solution, &gauge))
        .chain(plate_files::plates(problem, &context.series, &gauge)?);
    texts.into_iter().try_for_each(|(name, text)| add(name, text.into_bytes()))?;
    let mut together = None;
    if context.poses == Poses::Written {
        add("poses.csv".into(), pose_files::poses_csv(&images, &solution.free_poses).into_bytes())?;
        if let Some((order, covariance)) = solution.poses_together()? {
            add(pose_files::TOGETHER.into(), npy::matrix(&covariance))?;
            together = Some(order.into_iter().map(|i| images.of(i).to_owned()).collect());
        }
    }
    names.extend([solution_json::FILE_NAME, observation_table::FILE_NAME].map(str::to_owned));
    #[cfg(feature = "report")]
    names.push(report::FILE_NAME.to_owned());
    names.sort();
    let mut record = solution_record::record(solution, context, &gauge, names)?;
    record.covariance_together = together;
    #[cfg(feature = "report")]
    put(report::FILE_NAME, report::report_html(&record, &Thumbnails::of_files(record.photogrammetry())).into_bytes())?;
    put(solution_json::FILE_NAME, solution_json::to_bytes(&record)?)?;
    drop(record);
    put(observation_table::FILE_NAME, observation_table::observations_csv(&solution.fit, &context.series).into_bytes())
}
