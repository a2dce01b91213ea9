//! What a solution says of the images of a series, for a recording: camera, frames, and marks on every image.

use super::camera_file;
use crate::error::{Code, Error, Result};
use crate::geom::Pose;
use crate::output::restore::{camera, found_model};
use crate::output::solution_json::{ImageRecord, SolutionRecord};
use crate::series::{CameraInfo, CameraMount, FramePoses, ImageMarks, MarkKind, MarkLayer};

/// Residuals are drawn so many times longer than they are.
pub const MAGNIFIED: f64 = 100.0;

/// Colours: measured and used, left out, residuals.
const USED: [f64; 3] = [0.0, 0.8, 0.2];
const LEFT_OUT: [f64; 3] = [1.0, 0.5, 0.0];
const RESIDUAL: [f64; 3] = [1.0, 0.1, 0.1];

/// What a recording of one series shows of a solution.
#[derive(Debug, Clone)]
pub struct Overlay {
    /// The camera, as ROS can say it.
    pub camera: CameraInfo,
    /// Base to tip of the identified robot, camera and plate.
    pub frames: Vec<FramePoses>,
    /// Measured places, what was left out, and residuals.
    pub marks: Vec<ImageMarks>,
}

/// The overlay of the images `names` (file names in the order of the stops) whose readings (rad, m) are given.
///
/// # Errors
/// A solution without any of these images, and files that do not hang together.
pub fn overlay(record: &SolutionRecord, names: &[&str], readings: &[Option<Vec<f64>>]) -> Result<Overlay> {
    let own: Vec<Option<&ImageRecord>> = names.iter().map(|name| image(record, name)).collect();
    let Some(first) = own.iter().flatten().next() else {
        let remedy = "give the solution.json that was identified from this series";
        return Err(Error::new(Code::SolutionDiffers, "solution.json", "has none of the images of the series", remedy));
    };
    let found = &record.cameras[first.camera];
    let depths = own.iter().flatten().filter_map(|i| i.camera_from_plate.as_ref()).map(|p| p.xyz_m[2]);
    let [near, far] = depths.fold([f64::INFINITY, 0.0], |[a, b]: [f64; 2], z| [a.min(z), b.max(z)]);
    let depths = if far > 0.0 { [near, far] } else { [1.0, 1.0] };
    Ok(Overlay {
        camera: camera_file::camera_info(&found.name, &camera(found), &depths)?,
        frames: frames(record, first.camera_mount, &own, readings)?,
        marks: names.iter().zip(&own).filter_map(|(name, i)| Some(marks(name, (*i)?))).collect(),
    })
}

/// An image by its name, with the series before it or not.
fn image<'a>(record: &'a SolutionRecord, name: &str) -> Option<&'a ImageRecord> {
    record.images.iter().find(|i| i.name == name || i.name.strip_suffix(name).is_some_and(|s| s.ends_with('/')))
}

fn frames(
    record: &SolutionRecord,
    mount: CameraMount,
    own: &[Option<&ImageRecord>],
    readings: &[Option<Vec<f64>>],
) -> Result<Vec<FramePoses>> {
    let robot = found_model(record)?.robot;
    let (base, tip) = (&record.robot.base, &record.robot.tip);
    let (camera_parent, plate_parent) = match mount {
        CameraMount::Hand => (tip, base),
        CameraMount::Fixed => (base, tip),
    };
    let frame = |parent: &String, child: &str, poses: Vec<Option<Pose>>| FramePoses {
        parent: parent.clone(),
        child: child.to_owned(),
        poses,
    };
    let placed = |pose: fn(&SolutionRecord, &ImageRecord) -> Pose| {
        own.iter().map(|i| i.map(|i| pose(record, i))).collect::<Vec<_>>()
    };
    let tips = readings.iter().map(|q| q.as_ref().map(|q| robot.base_from_tip(q))).collect();
    Ok(vec![
        frame(base, tip, tips),
        frame(camera_parent, "camera", placed(|r, i| (&r.mountings[i.mounting].pose).into())),
        frame(plate_parent, "plate", placed(|r, i| (&r.placements[i.placement].pose).into())),
    ])
}

fn marks(name: &str, image: &ImageRecord) -> ImageMarks {
    let o = &image.observations;
    let used = |k: &usize| image.is_used() && o.reason[*k].is_none();
    let all = 0..o.uv.len();
    let residual = |k: usize| {
        let (uv, d) = (o.uv[k], o.duv[k]?);
        Some([uv, [uv[0] - MAGNIFIED * d[0], uv[1] - MAGNIFIED * d[1]]])
    };
    let layer = |kind, colour, points| MarkLayer { kind, colour, points };
    let layers = [
        layer(MarkKind::Lines, RESIDUAL, all.clone().filter(used).filter_map(residual).flatten().collect()),
        layer(MarkKind::Points, USED, all.clone().filter(used).map(|k| o.uv[k]).collect()),
        layer(MarkKind::Points, LEFT_OUT, all.filter(|k| !used(k)).map(|k| o.uv[k]).collect()),
    ];
    ImageMarks { image: name.to_owned(), layers: layers.into_iter().filter(|l| !l.points.is_empty()).collect() }
}
