//! A series as read to a series as seen: detection, readings in chain order, everything left out with its reason.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::build::{MeasuredSeries, MeasuredStop};
use crate::detect::{FlatField, Picture, detect_series};
use crate::error::{Error, Notice, Result};
use crate::model::camera::Lens;
use crate::series::{CirclePoint, Observation, Series, Source, StopOrder};
use crate::urdf::Chain;

/// A seen series with what the user should know of it.
#[derive(Debug, Clone)]
pub struct Measured {
    /// The series, ready to be adjusted.
    pub series: MeasuredSeries,
    /// Notices of reading and detection.
    pub notices: Vec<Notice>,
}

struct Seen {
    observations: Vec<Observation>,
    left_out: Option<String>,
}

/// Reads joint values in the order of the chain and finds the plate in every image. `several` series qualify the names
/// that a single one leaves to its defaults. `progress` is called after every image, from any thread.
///
/// # Errors
/// Of the readings (unit, missing joints), of a series none of whose images can be used, and of differently sized images.
pub fn measure(series: &Series, chain: &Chain, several: bool, progress: impl Fn(&Path) + Sync) -> Result<Measured> {
    let place = || format!("series {}", series.name);
    let readings = series.readings_for(chain)?;
    let mut notices = series.notices.clone();
    notices.extend(series.reading_notices(chain));
    let camera = &series.manifest.camera;
    let lens = match camera.model.as_deref() {
        None => Lens::Brown,
        Some(name) => Lens::from_name(name).ok_or_else(|| {
            Error::input(
                series.folder.join("series.toml").display(),
                format!("[camera] model = \"{name}\" is not a lens model of this program"),
                format!("use one of: {}", Lens::names().join(", ")),
            )
        })?,
    };
    let (mut seen, found_size) = match &series.source {
        Source::Images { dark, white, .. } => look(series, dark, white, progress, &mut notices)?,
        Source::Observations(all) => {
            let by_name: BTreeMap<&str, &Vec<Observation>> =
                all.iter().map(|i| (i.image.as_str(), &i.observations)).collect();
            let given = |image: &str| match by_name.get(image) {
                Some(o) => Seen { observations: (*o).clone(), left_out: None },
                None => Seen { observations: vec![], left_out: Some("no observations are given".into()) },
            };
            (series.stops.stops.iter().map(|s| given(&s.image)).collect(), None)
        }
        Source::Recording(path) => {
            return Err(Error::input(
                path.display(),
                "is a recording, not a series folder",
                "convert it first: robotcal convert run1.mcap run1/",
            ));
        }
    };
    require_some(series, &seen, &place())?;
    let stated = camera.width_px.zip(camera.height_px);
    let (width_px, height_px) = found_size.or(stated).ok_or_else(|| {
        Error::input(
            series.folder.join("series.toml").display(),
            "the size of the images is not known: there are observations and no images",
            "state width_px and height_px under [camera]",
        )
    })?;
    let mut stops = Vec::with_capacity(readings.len());
    for ((stop, readings), seen) in series.stops.stops.iter().zip(readings).zip(seen.drain(..)) {
        let placement = if several && stop.placement == crate::series::DEFAULT_PLACEMENT {
            format!("{} of {}", stop.placement, series.name)
        } else {
            stop.placement.clone()
        };
        let Seen { observations, left_out } = seen;
        stops.push(MeasuredStop { image: stop.image.clone(), readings, placement, observations, left_out });
    }
    let plate_file = series.folder.join(&series.manifest.plate);
    Ok(Measured {
        series: MeasuredSeries {
            name: series.name.clone(),
            camera: series.camera_name().to_owned(),
            mounting: series.mounting().to_owned(),
            mount: series.manifest.camera_mount,
            width_px,
            height_px,
            focal_px: camera.focal_px,
            lens,
            centroid: series.manifest.observations.point == CirclePoint::Centroid,
            plate: series.plate.clone(),
            plate_name: plate_file.canonicalize().unwrap_or(plate_file).display().to_string(),
            order_known: series.manifest.robot.order == StopOrder::Visited,
            stops,
        },
        notices,
    })
}

type Look = (Vec<Seen>, Option<(u32, u32)>);

fn look(
    series: &Series,
    dark: &[PathBuf],
    white: &[PathBuf],
    progress: impl Fn(&Path) + Sync,
    notices: &mut Vec<Notice>,
) -> Result<Look> {
    let bits = series.manifest.camera.bits;
    let flat_field = FlatField::from_images(dark, white, bits)?;
    let corrected = |picture: Picture| match &flat_field {
        Some(flat_field) => flat_field.apply(picture),
        None => Ok(picture),
    };
    let paths: Vec<PathBuf> = series.stops.stops.iter().filter_map(|s| s.path.clone()).collect();
    let mut found = detect_series(&paths, bits, &series.plate, corrected, progress).into_iter();
    let mut size = None;
    let mut seen = Vec::new();
    for stop in &series.stops.stops {
        let (observations, left_out) = match stop.path.as_ref().and_then(|_| found.next()) {
            None => (vec![], Some("the image file is missing".to_owned())),
            Some(Err(error)) => (vec![], Some(error.what)),
            Some(Ok(image)) => {
                // The detector has refused all images of another size.
                size = Some((image.size.0 as u32, image.size.1 as u32));
                let named = |n: &Notice| Notice { place: format!("{}: {}", stop.image, n.place), ..n.clone() };
                notices.extend(image.detection.notices.iter().map(named));
                (image.detection.observations, None)
            }
        };
        seen.push(Seen { observations, left_out });
    }
    Ok((seen, size))
}

fn require_some(series: &Series, seen: &[Seen], place: &str) -> Result<()> {
    if seen.iter().any(|s| s.left_out.is_none() && !s.observations.is_empty()) {
        return Ok(());
    }
    let reasons: Vec<String> = (series.stops.stops.iter().zip(seen).take(3))
        .map(|(stop, s)| format!("{}: {}", stop.image, s.left_out.as_deref().unwrap_or("no marker found")))
        .collect();
    Err(Error::input(
        place,
        format!("no image can be used ({})", reasons.join("; ")),
        "look at one of the images: is the plate in it, sharp, and the one that plate.toml describes?",
    ))
}
