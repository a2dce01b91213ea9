//! Solution -> bytes.
//!
//! Exporters are pure: [`each_file`] and [`stand_alone_files`] make every file of a result in memory (for small pictures in the report they look at images of the series),
//! [`ResultFolder`] alone writes.
//! A new exporter is one file here and one row in [`each_file`].

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
mod mastering;
mod names;
mod npy;
mod observation_table;
#[cfg(feature = "draw")]
pub mod overlay;
pub mod parameter_words;
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
mod ur_frames;
pub mod verdict;
pub mod work_findings;
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
    let gauge = gauge::Gauge::of(&solution.fit)?;
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
        robot_files::all(solution, context)?.into_iter().try_for_each(|(name, text)| add(name, text.into_bytes()))?;
    }
    let images = names::ImageNames::new(problem, &context.series);
    let texts = (camera_file::cameras(&problem.cameras, &state.cameras, &depths).into_iter())
        .chain(pose_files::mountings(solution))
        .chain(pose_files::placements(solution, &gauge))
        .chain(plate_files::plates(&solution.fit, &context.series, &gauge)?);
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
