//! The second pass over the images of a series: cameras and stand-alone poses say where every marker must be.

use std::collections::BTreeSet;
use std::path::Path;

use nalgebra::Vector3;
use rayon::prelude::*;

use super::seen_image::SeenImage;
use super::stated::{lens_of, measured_series};
use crate::assess::Limits;
use crate::detect::circles::Predicted;
use crate::detect::{Loaded, examine_predicted};
use crate::error::Result;
use crate::geom::Pose;
use crate::identify::photogrammetry::camera_start::CameraStart;
use crate::identify::photogrammetry::free_poses::adjust_free_poses;
use crate::identify::problem::build::build;
use crate::model::robot::Robot;
use crate::problem::{ImageRejection, MeasuredStop, State};
use crate::series::{DEFAULT_PLACEMENT, Marker, Plate, Series};
use crate::urdf::Chain;

/// Fewest images for a first solve.
const FEWEST_IMAGES: usize = 3;
/// How far from the markers that were found, in pitches, camera and pose are trusted to say where others are.
const REACH: f64 = 2.5;

/// Looks again in every image for the markers that the first pass missed or that the border cuts; `picture` loads
/// them. Images stay as they are where the first solve fails: what is wrong is for the adjustment to say.
pub(super) fn second_pass(
    series: &Series,
    images: &mut [SeenImage],
    limits: &Limits,
    picture: impl Fn(&Path) -> Result<Loaded> + Sync,
) {
    if !series.plate.kind.print().is_predicted {
        return;
    }
    let Some((state, poses)) = first_solve(series, images, limits) else { return };
    images.par_iter_mut().zip(poses).for_each(|(image, pose)| {
        let (Some(pose), Some(path)) = (pose, &image.path) else { return };
        let predicted = predict(&state, &series.plate, image, &pose);
        if let Ok(picture) = picture(path) {
            examine_predicted(picture, &mut image.detection, &predicted);
        }
    });
}

/// Cameras, plates and the stand-alone pose of every image, without a robot.
fn first_solve(series: &Series, images: &[SeenImage], limits: &Limits) -> Option<(State, Vec<Option<Pose>>)> {
    let seen = images.iter().filter(|i| i.detection.failure.is_none() && i.detection.circles.is_some());
    let sizes: Vec<(usize, usize)> = seen.filter_map(|i| i.size).collect();
    let (width, height) = *sizes.first().filter(|_| sizes.len() >= FEWEST_IMAGES)?;
    let stop = |(row, image): (usize, &SeenImage)| MeasuredStop {
        row,
        image: image.name.clone(),
        readings: None,
        placement: DEFAULT_PLACEMENT.to_owned(),
        observations: image.detection.observations.clone().into(),
        left_out: image
            .detection
            .failure
            .as_ref()
            .map(|e| ImageRejection::Unusable { why: e.code, what: e.what.clone() }),
    };
    let stops = images.iter().enumerate().map(stop).collect();
    let measured = measured_series(series, lens_of(series).ok()?, (width as u32, height as u32), true, stops);
    let nobody = Robot::nominal(Chain::empty());
    let nothing = build(&nobody, &[measured], false, limits).ok()?;
    let (_, free, _) = adjust_free_poses(
        nothing,
        &[series.manifest.camera().focal_px.map_or(CameraStart::Unknown, CameraStart::Focal)],
        limits,
    )
    .ok()?;
    let pose = |k: usize| free.poses[k].as_ref().map(|p| p.camera_from_plate);
    // The adjustment takes one of two images that show the same; they stay the same when both have its pose.
    let original =
        |k: usize| images[..k].iter().position(|i| i.detection.observations == images[k].detection.observations);
    let poses = (0..images.len()).map(|k| pose(k).or_else(|| pose(original(k)?))).collect();
    Some((free.state, poses))
}

/// Images of all markers near those that were found.
fn predict(state: &State, plate: &Plate, image: &SeenImage, camera_from_plate: &Pose) -> Vec<Predicted> {
    let (camera, shape) = (&state.cameras[0], &state.plates[0]);
    let found: BTreeSet<u32> = image.detection.observations.iter().map(|o| o.marker).collect();
    let known: Vec<Vector3<f64>> =
        plate.markers.iter().filter(|m| found.contains(&m.id)).map(|m| m.position_m).collect();
    let largest = plate.markers.iter().map(|m| m.outer_radius_m).fold(0.0, f64::max);
    let one = |(index, marker): (usize, &Marker)| {
        let near = |k: &Vector3<f64>| (k - marker.position_m).norm() < REACH * plate.pitch_m;
        if found.contains(&marker.id) || !known.iter().any(near) {
            return None;
        }
        let centre = shape.position(index);
        let map = |[x, y]: [f64; 2]| {
            let p = camera.project(&camera_from_plate.transform(&(centre + Vector3::new(x, y, 0.0))))?;
            Some([p.x, p.y])
        };
        Predicted::by_map(marker, plate.pitch_m - largest, map)
    };
    plate.markers.iter().enumerate().filter_map(one).collect()
}
