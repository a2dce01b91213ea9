//! What the manifest of a series states of its camera, beside what its stops show.

use crate::error::{Code, Error, Result};
use crate::model::camera::Lens;
use crate::problem::{LensChoice, MeasuredSeries, MeasuredStop};
use crate::series::{CameraMount, Series, StopOrder};

/// A series with what its stops show.
pub(super) fn measured_series(
    series: &Series,
    lens: Lens,
    (width_px, height_px): (u32, u32),
    centroid: bool,
    stops: Vec<MeasuredStop>,
) -> MeasuredSeries {
    let camera = series.manifest.camera();
    let plate_file = series.manifest.plate_in(&series.folder).unwrap_or_default();
    let plate_name = plate_file.canonicalize().unwrap_or(plate_file).display().to_string();
    MeasuredSeries {
        run: series.run.as_ref().map(|run| run.name.clone()),
        name: series.name.clone(),
        camera: series.camera_name().to_owned(),
        mounting: series.mounting().to_owned(),
        mount: series.manifest.mount(),
        width_px,
        height_px,
        focal_px: camera.focal_px,
        known_camera: None,
        lens,
        lens_choice: match camera.model {
            Some(_) => LensChoice::Settled,
            None => LensChoice::All,
        },
        centroid,
        plate: series.plate.clone(),
        plate_name: if on_the_tip_beside_others(series) { format!("{plate_name} on the tip") } else { plate_name },
        has_images: true,
        bodies: Vec::new(),
        lengths: Vec::new(),
        order_known: series.manifest.robot.order == StopOrder::Visited,
        postures: Vec::new(),
        otherwise: series.controller.as_ref().map(|c| c.otherwise.clone()).unwrap_or_default(),
        stops,
    }
}

/// True for a plate on the tip where other cameras of the series are in the hand, and see one in the cell.
pub(super) fn on_the_tip_beside_others(series: &Series) -> bool {
    let is_mixed = series.run.as_ref().is_some_and(|run| run.has_mixed_mounts);
    is_mixed && series.manifest.mount() == CameraMount::Fixed
}

/// The lens model that a series states, or with which the choice begins.
pub(super) fn lens_of(series: &Series) -> Result<Lens> {
    let Some(name) = series.manifest.camera().model.as_deref() else { return Ok(Lens::Brown) };
    Lens::from_name(name).ok_or_else(|| {
        Error::new(
            Code::LensUnknown,
            series.manifest_file().display(),
            format!("[camera] model = \"{name}\" is not a lens model of this program"),
            format!("use one of: {}", Lens::names().join(", ")),
        )
    })
}
