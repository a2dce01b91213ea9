//! A simulated series as if it had been measured.

use crate::problem::{MeasuredSeries, MeasuredStop};
use crate::series::{AngleUnit, StopOrder};
use crate::simulate::SimulatedSeries;
use crate::urdf::{Chain, JointKind};

/// The observations of a simulated series, ready to be adjusted.
pub fn measured(series: &SimulatedSeries, chain: &Chain) -> MeasuredSeries {
    let unit = series.manifest.joint_unit.map_or(1.0, AngleUnit::in_rad);
    let in_si = |raw: &Vec<f64>| {
        let factor = |kind: &JointKind| if *kind == JointKind::Revolute { unit } else { 1.0 };
        raw.iter().zip(&chain.reading_kinds).map(|(q, kind)| q * factor(kind)).collect()
    };
    let stops = (series.stops.stops.iter().zip(&series.observations))
        .enumerate()
        .map(|(row, (stop, seen))| MeasuredStop {
            row,
            image: stop.image.clone(),
            readings: stop.raw_readings.as_ref().map(in_si),
            placement: stop.placement.clone(),
            observations: seen.observations.clone().into(),
            left_out: None,
        })
        .collect();
    let camera = &series.truth.camera;
    MeasuredSeries {
        camera: "camera".into(),
        mounting: "mounting".into(),
        mount: series.manifest.mount(),
        width_px: camera.width_px,
        height_px: camera.height_px,
        lens: camera.lens,
        plate: series.plate.clone(),
        plate_name: "plate".into(),
        has_images: true,
        ..MeasuredSeries::without_images("simulated", series.manifest.robot.order == StopOrder::Visited, stops)
    }
}
