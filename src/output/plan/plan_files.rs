//! The files of a plan: series folder without images, plan.json.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::error::Result;
use crate::output::text::{as_written, json};
use crate::plan::{Forecast, Plan, PlanRequest, image_name};
use crate::series::{AngleUnit, DEFAULT_PLACEMENT, Manifest, SeriesStop, Stops, plate_files};
use crate::urdf::JointKind;

/// Name of the file that lists the others.
pub const FILE_NAME: &str = "plan.json";

/// Version of plan.json.
pub(super) const FORMAT: u32 = 1;

/// Digits after the point of a reading in degrees: finer than any controller shows.
const DEGREE_DIGITS: f64 = 1e4;

#[derive(Serialize)]
struct StopRecord {
    image: String,
    readings: Vec<f64>,
    placement: String,
    markers: usize,
    via: Vec<Vec<f64>>,
    way_is_free: bool,
}

#[derive(Serialize)]
struct ParameterRecord<'a> {
    name: &'a str,
    unit: &'a str,
    prior_sigma: f64,
    sigma: f64,
    flange_m: f64,
}

#[derive(Serialize)]
struct CurveRecord {
    images: usize,
    planned_m: f64,
    random_m: f64,
}

#[derive(Serialize)]
struct PlanRecord<'a> {
    format: u32,
    files: Vec<String>,
    as_written: BTreeMap<String, String>,
    command: &'a str,
    robot: &'a str,
    joints: &'a [String],
    candidates: usize,
    relaxed_efficiency: f64,
    rounded_efficiency: f64,
    flange_before_m: f64,
    flange_m: f64,
    curve: Vec<CurveRecord>,
    imbalance: &'a [f64],
    words: &'a [String],
    stops: Vec<StopRecord>,
    parameters: Vec<ParameterRecord<'a>>,
}

/// Readings of a stop as joints.csv shows them: degrees (m for a prismatic joint), rounded.
pub fn written(readings: &[f64], kinds: &[JointKind]) -> Vec<f64> {
    let one = |(q, kind): (&f64, &JointKind)| match kind {
        JointKind::Prismatic => (q * 1e6).round() / 1e6,
        _ => (q.to_degrees() * DEGREE_DIGITS).round() / DEGREE_DIGITS,
    };
    readings.iter().zip(kinds).map(one).collect()
}

/// Name of a placement in joints.csv.
fn placement_name(request: &PlanRequest, placement: usize) -> String {
    match request.setting.placements.len() {
        1 => DEFAULT_PLACEMENT.to_owned(),
        _ => request.setting.placements[placement].0.clone(),
    }
}

/// Every file of a plan: name -> bytes; `more` are added as they are.
///
/// # Errors
/// None in practice: everything can be written as text.
pub fn plan_files(
    request: &PlanRequest,
    plan: &Plan,
    forecast: &Forecast,
    command: &str,
    more: BTreeMap<String, Vec<u8>>,
) -> Result<BTreeMap<String, Vec<u8>>> {
    let setting = &request.setting;
    let chain = &setting.robot.chain;
    let stop = |(k, leg): (usize, &crate::plan::order::Leg)| SeriesStop {
        image: image_name(k),
        raw_readings: Some(written(&plan.pool[leg.stop].readings, &chain.reading_kinds)),
        placement: placement_name(request, plan.pool[leg.stop].placement),
        ..SeriesStop::default()
    };
    let stops = Stops {
        joints: chain.readings.clone(),
        stops: plan.legs.iter().enumerate().map(stop).collect(),
        ..Stops::default()
    };
    let manifest = Manifest {
        joint_unit: Some(AngleUnit::Deg),
        base: Some(chain.base.clone()),
        tip: Some(chain.tip.clone()),
        ..Manifest::plain(setting.mount, "plate.toml")
    };
    let mut files = more;
    files.insert("joints.csv".into(), stops.to_csv().into_bytes());
    files.insert("series.toml".into(), manifest.to_toml()?.into_bytes());
    files.extend(plate_files(&setting.plate)?.into_iter().map(|(name, text)| (name.into(), text.into_bytes())));
    let record = record(request, plan, forecast, command, &files);
    files.insert(FILE_NAME.to_owned(), json(&record, FILE_NAME)?);
    Ok(files)
}

fn record<'a>(
    request: &'a PlanRequest,
    plan: &'a Plan,
    forecast: &'a Forecast,
    command: &'a str,
    files: &BTreeMap<String, Vec<u8>>,
) -> PlanRecord<'a> {
    let chain = &request.setting.robot.chain;
    let stop = |(k, leg): (usize, &crate::plan::order::Leg)| {
        let c = &plan.pool[leg.stop];
        StopRecord {
            image: image_name(k),
            readings: c.readings.clone(),
            placement: placement_name(request, c.placement),
            markers: c.seen.len(),
            via: leg.via.clone(),
            way_is_free: leg.is_free,
        }
    };
    PlanRecord {
        format: FORMAT,
        files: files.keys().cloned().chain([FILE_NAME.to_owned()]).collect(),
        as_written: as_written(files),
        command,
        robot: &chain.robot,
        joints: &chain.readings,
        candidates: plan.pool.len(),
        relaxed_efficiency: plan.efficiency[0],
        rounded_efficiency: plan.efficiency[1],
        flange_before_m: forecast.before_m,
        flange_m: forecast.flange_m,
        curve: (forecast.curve.iter())
            .map(|p| CurveRecord { images: p.images, planned_m: p.planned_m, random_m: p.random_m })
            .collect(),
        imbalance: &plan.imbalance,
        words: &forecast.words,
        stops: plan.legs.iter().enumerate().map(stop).collect(),
        parameters: (forecast.parameters.iter())
            .map(|p| ParameterRecord {
                name: &p.name,
                unit: p.unit,
                prior_sigma: p.prior_sigma,
                sigma: p.sigma,
                flange_m: p.flange_m,
            })
            .collect(),
    }
}
