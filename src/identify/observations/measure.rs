//! A series as read to a series as seen: detection, readings in chain order, everything left out with its reason.

use std::collections::BTreeMap;
use std::path::Path;

use super::bodies::{NamedSeries, seen_bodies, seen_lengths};
use super::detections::{
    SeenSeries, Unused, detect_stops, flat_field_drift, no_images, recording, require_some, several_cameras,
};
use super::seen_image::SeenImage;
use super::stated::{lens_of, measured_series};
use crate::assess::Limits;
use crate::detect::{Detection, set_radii};
use crate::error::{Code, Error, Notice, Result};
use crate::identify::controller::readings::{self, is_unreached, other_postures, readings_of, readings_told};
use crate::identify::controller::told::told;
use crate::problem::{ImageRejection, MeasuredSeries, MeasuredStop, Shared};
use crate::series::{CirclePoint, ImageObservations, Observation, Plate, Series, Source, StopOrder};
use crate::urdf::Chain;

/// A seen series with what the user should know of it.
#[derive(Debug, Clone)]
pub struct MeasuredWithNotices {
    /// The series, ready to be adjusted.
    pub series: MeasuredSeries,
    /// Notices of reading and detection.
    pub notices: Vec<Notice>,
}

struct StopObservations {
    observations: Shared<Vec<Observation>>,
    left_out: Option<ImageRejection>,
    /// What the detector advises where it found no plate.
    remedy: Option<String>,
}

/// Reads joint values in the order of the chain and finds the plate in every image of what one camera saw; `limits` are those of the solve. `progress` is called after every image, from any thread.
///
/// # Errors
/// Of the readings (unit, missing joints), of a series none of whose images can be used, and of differently sized images.
pub fn measure(
    named: NamedSeries,
    chain: &Chain,
    limits: &Limits,
    progress: impl Fn(&Path) + Sync,
) -> Result<MeasuredWithNotices> {
    let series = named.series;
    let measured = |readings| match series.source {
        Source::NoImages => bodies_at(named, chain, readings),
        _ => seen_at(named, chain, (limits, &progress), readings),
    };
    let refused = match readings_of(series, chain) {
        Ok(readings) => return measured(readings),
        Err(refused) => refused,
    };
    let Some(poses) = series.controller.as_ref().filter(|_| is_unreached(&refused)) else { return Err(refused) };
    // What was seen tells a mistake in the poses from a frame or a tool.
    let Ok(seen) = measured(vec![None; series.stops.stops.len()]) else { return Err(refused) };
    let told = told(&seen.series, poses, limits);
    Err(readings_told(series, chain, &told).err().unwrap_or(refused))
}

/// What was seen at these readings.
fn seen_at(
    named: NamedSeries,
    chain: &Chain,
    (limits, progress): (&Limits, impl Fn(&Path) + Sync),
    readings: Vec<Option<Vec<f64>>>,
) -> Result<MeasuredWithNotices> {
    let (series, bodies) = (named.series, seen_bodies(named));
    let lengths = seen_lengths(named, &bodies)?;
    let mut notices = notices_of(series, chain);
    let lens = lens_of(series)?;
    let mut plate = series.plate.clone();
    let (mut seen, found_size) = match &series.source {
        Source::Images { .. } => look_through(series, (limits, progress), &mut notices, &mut plate)?,
        Source::Observations(all) => (observed(series, all), None),
        Source::Recording(path) => return Err(recording(path)),
        Source::NoImages => return Err(no_images(series)),
        Source::Cameras(_) => return Err(several_cameras(series)),
    };
    require_seen(series, &seen)?;
    let size_px = image_size(series, found_size)?;
    let mut stops = Vec::with_capacity(readings.len());
    for (k, ((stop, readings), seen)) in series.stops.stops.iter().zip(readings).zip(seen.drain(..)).enumerate() {
        let placement = named.placement(&stop.placement);
        let StopObservations { observations, left_out, .. } = seen;
        let (image, row) = (stop.image.clone(), series.row(k));
        stops.push(MeasuredStop { row, image, readings, placement, observations, left_out });
    }
    // The detector measures centroids, whatever observations would mean.
    let centroid = found_size.is_some() || series.manifest.observations.point == CirclePoint::Centroid;
    let measured = measured_series(series, lens, size_px, centroid, stops);
    let postures = other_postures(series, chain, (&measured.stops, &bodies));
    Ok(MeasuredWithNotices { series: MeasuredSeries { plate, bodies, lengths, postures, ..measured }, notices })
}

/// Refuses a series at no stop of which anything was seen.
fn require_seen(series: &Series, seen: &[StopObservations]) -> Result<()> {
    let said = |s: &StopObservations| s.left_out.as_ref().map(|why| (why.to_string(), s.remedy.clone()));
    let failures: Vec<Option<(String, Option<String>)>> = seen.iter().map(said).collect();
    let stops = series.stops.stops.iter().zip(seen).zip(&failures);
    let stops = stops.map(|((stop, s), failure)| {
        let unused = failure.as_ref().map(|(what, remedy)| Unused { what, remedy: remedy.as_deref() });
        (stop.image.as_str(), s.observations.len(), unused)
    });
    require_some(&format!("series {}", series.name), stops)
}

/// The observations of every stop, of a series that has them instead of images.
fn observed(series: &Series, all: &[ImageObservations]) -> Vec<StopObservations> {
    let by_name: BTreeMap<&str, &Vec<Observation>> = all.iter().map(|i| (i.image.as_str(), &i.observations)).collect();
    let given = |image: &str| match by_name.get(image) {
        Some(o) => StopObservations { observations: (*o).clone().into(), left_out: None, remedy: None },
        None => StopObservations {
            observations: Shared::default(),
            left_out: Some(ImageRejection::NoObservations),
            remedy: None,
        },
    };
    series.stops.stops.iter().map(|s| given(&s.image)).collect()
}

/// Width and height of the images of one camera: those of its images, else as stated, px.
///
/// # Errors
/// Observations without images whose size is not stated.
pub fn image_size(series: &Series, found: Option<(u32, u32)>) -> Result<(u32, u32)> {
    found.or(series.manifest.camera().size_px()).ok_or_else(|| {
        Error::new(
            Code::SettingMissing,
            series.manifest_file().display(),
            "the size of the images is not known: there are observations and no images",
            "state width_px and height_px under [camera]",
        )
    })
}

/// What was measured in space alone: touches, and what a tracker saw. Images are not looked at.
///
/// # Errors
/// Of the readings (unit, missing joints); distances between what was not measured.
pub fn measure_bodies(named: NamedSeries, chain: &Chain) -> Result<MeasuredWithNotices> {
    bodies_at(named, chain, readings_of(named.series, chain)?)
}

/// What was measured in space alone at these readings.
fn bodies_at(named: NamedSeries, chain: &Chain, readings: Vec<Option<Vec<f64>>>) -> Result<MeasuredWithNotices> {
    let (series, bodies) = (named.series, seen_bodies(named));
    let lengths = seen_lengths(named, &bodies)?;
    let stops = without_images(series, readings);
    let postures = other_postures(series, chain, (&stops.stops, &bodies));
    Ok(MeasuredWithNotices {
        series: MeasuredSeries { bodies, lengths, postures, ..stops },
        notices: notices_of(series, chain),
    })
}

/// What reading a series gives reason to say.
fn notices_of(series: &Series, chain: &Chain) -> Vec<Notice> {
    let mut notices = series.notices.clone();
    notices.extend(readings::notice(series, chain));
    notices.extend(series.reading_notices(chain));
    notices.extend(unused_repeatability(series));
    notices
}

/// A series of stops at which no image was taken.
fn without_images(series: &Series, readings: Vec<Option<Vec<f64>>>) -> MeasuredSeries {
    let of = |(row, (stop, readings)): (usize, (&crate::series::SeriesStop, Option<Vec<f64>>))| MeasuredStop {
        row,
        image: stop.image.clone(),
        readings,
        placement: stop.placement.clone(),
        observations: Shared::default(),
        left_out: None,
    };
    let stops = series.stops.stops.iter().zip(readings).enumerate().map(of).collect();
    let run = series.run.as_ref().map(|run| run.name.clone());
    let order_known = series.manifest.robot.order == StopOrder::Visited;
    MeasuredSeries { run, ..MeasuredSeries::without_images(&series.name, order_known, stops) }
}

/// What all stops show, and the size of the images.
type SeenStops = (Vec<StopObservations>, Option<(u32, u32)>);

/// The joint noise is estimated: what a data sheet states says nothing of what the robot model lacks, which is part of it.
fn unused_repeatability(series: &Series) -> Option<Notice> {
    let stated = series.manifest.robot.repeatability_m?;
    Some(Notice::new(
        Code::RepeatabilityUnused,
        series.manifest_file().display(),
        format!("robot.repeatability_m = {stated} is not used: the joint noise is estimated from the images"),
        "give --joint-noise where it is known",
    ))
}

/// Looks at all images; sizes of dots that the plate does not state are those seen.
fn look_through(
    series: &Series,
    (limits, progress): (&Limits, impl Fn(&Path) + Sync),
    notices: &mut Vec<Notice>,
    plate: &mut Plate,
) -> Result<SeenStops> {
    let SeenSeries { images, flat_field } = detect_stops(series, limits, progress)?;
    set_radii(plate, images.iter().map(|image| &image.detection));
    notices.extend(images.iter().flat_map(SeenImage::notices));
    notices.extend(flat_field.iter().flat_map(|f| flat_field_drift(series, &f.facts, limits)));
    // The detector has refused all images of another size.
    let usable = images.iter().filter(|i| i.detection.failure.is_none());
    let size = usable.filter_map(|i| i.size).next().map(|(w, h)| (w as u32, h as u32));
    let seen = |image: SeenImage| {
        let Detection { observations, turn_open, failure, .. } = image.detection;
        let observations = if turn_open.is_empty() { observations } else { turn_open };
        let remedy = failure.as_ref().map(|error| error.remedy.clone());
        let left_out = failure.map(|error| ImageRejection::Unusable { why: error.code, what: error.what });
        StopObservations { observations: observations.into(), left_out, remedy }
    };
    Ok((images.into_iter().map(seen).collect(), size))
}
