//! Whether the parts of a solution.json fit together, judged once when it is read: nothing behind it has to ask again.

use std::collections::BTreeSet;

use super::restore;
use super::solution_json::{
    CameraRecord, FILE_NAME, ImageRecord, PlacedRecord, PlateRecord, PoseRecord, SolutionRecord,
};
use crate::error::{Code, Error, Result};
use crate::files::MOST_SIDE_PX;
use crate::model::camera::Camera;
use crate::problem::KnownCamera;

/// Numbers of a covariance of a pose.
const POSE_COVARIANCE: usize = 36;

/// Markers across and down a plate, as plate.toml allows.
const MOST_ACROSS: u32 = 1000;

/// What the norm of a quaternion may differ from one.
const ROUNDING: f64 = 1e-6;

/// Refuses a record whose lengths, indices or names contradict each other; the error names the field.
pub(super) fn check(r: &SolutionRecord) -> Result<()> {
    robot(r)?;
    r.cameras.iter().enumerate().try_for_each(|(k, c)| camera(&format!("cameras[{k}]"), c, r.robot.readings.len()))?;
    placed("mountings", &r.mountings)?;
    placed("placements", &r.placements)?;
    bodies(r)?;
    r.plates.iter().enumerate().try_for_each(|(k, p)| plate(&format!("plates[{k}]"), p))?;
    series(r)?;
    r.images.iter().enumerate().try_for_each(|(k, i)| image(&format!("images[{k}]"), i, r))?;
    for (k, w) in r.workspace.iter().enumerate() {
        length(&format!("workspace[{k}].readings"), w.readings.len(), r.robot.readings.len())?;
    }
    let n = r.estimates.len();
    length("covariance_lower", r.covariance_lower.len(), n * (n + 1) / 2)?;
    restore::found_model(r).map(|_| ())
}

fn refuse(field: &str, what: impl std::fmt::Display) -> Error {
    Error::new(
        Code::SolutionDamaged,
        format!("{FILE_NAME}: {field}"),
        what,
        "give the solution.json as `robotcal identify` wrote it",
    )
}

fn length(field: &str, given: usize, wanted: usize) -> Result<()> {
    match given == wanted {
        true => Ok(()),
        false => Err(refuse(field, format!("has {given} entries where {wanted} belong"))),
    }
}

fn index(field: &str, given: usize, count: usize) -> Result<()> {
    match given < count {
        true => Ok(()),
        false => Err(refuse(field, format!("is {given}, and there are {count}"))),
    }
}

fn require(holds: bool, field: &str, what: impl std::fmt::Display) -> Result<()> {
    if holds { Ok(()) } else { Err(refuse(field, what)) }
}

fn pose(field: &str, p: &PoseRecord) -> Result<()> {
    let norm = p.quat_xyzw.iter().map(|q| q * q).sum::<f64>().sqrt();
    require((norm - 1.0).abs() < ROUNDING, &format!("{field}.quat_xyzw"), format!("has the norm {norm}, not 1"))
}

fn robot(r: &SolutionRecord) -> Result<()> {
    let robot = &r.robot;
    require(!robot.readings.is_empty(), "robot.readings", "is empty")?;
    length("robot.reading_kinds", robot.reading_kinds.len(), robot.readings.len())?;
    if !r.offsets_to_enter.is_empty() {
        length("offsets_to_enter", r.offsets_to_enter.len(), robot.readings.len())?;
    }
    for (k, joint) in robot.joints.iter().enumerate() {
        let field = |name: &str| format!("robot.joints[{k}].{name}");
        pose(&field("nominal_origin"), &joint.nominal_origin)?;
        pose(&field("corrected_origin"), &joint.corrected_origin)?;
        let driven = joint.drive.as_ref().is_none_or(|(reading, ..)| robot.readings.contains(reading));
        require(driven, &field("drive"), "names no reading of the robot")?;
        let ordered = joint.limits.is_none_or(|(low, high)| low < high);
        require(ordered, &field("limits"), "are not in order")?;
    }
    Ok(())
}

fn camera(field: &str, c: &CameraRecord, readings: usize) -> Result<()> {
    for (name, side) in [("width_px", c.width_px), ("height_px", c.height_px)] {
        require((2..=MOST_SIDE_PX).contains(&side), &format!("{field}.{name}"), format!("is {side}"))?;
    }
    let parameters = format!("{field}.parameters");
    let model = Camera::pinhole(c.lens, c.width_px, c.height_px, 1.0);
    length(&parameters, c.parameters.len(), model.parameters.len())?;
    for (name, (given, _)) in model.parameter_names().zip(&c.parameters) {
        require(name == *given, &parameters, format!("has \"{given}\" where \"{name}\" belongs"))?;
    }
    require(
        c.parameters[0].1 > 0.0 && c.parameters[1].1 > 0.0,
        &parameters,
        "has a focal length that is not positive",
    )?;
    require(c.pixel_factor > 0.0, &format!("{field}.pixel_factor"), "is not positive")?;
    length(&format!("{field}.joint_noise"), c.joint_noise.len(), readings)?;
    if !c.joint_noise_interval.is_empty() {
        length(&format!("{field}.joint_noise_interval"), c.joint_noise_interval.len(), readings)?;
    }
    let Some(map) = &c.projection else { return Ok(()) };
    let places = map.columns.checked_mul(map.rows).filter(|_| map.columns >= 2 && map.rows >= 2);
    let places = places.ok_or_else(|| refuse(&format!("{field}.projection"), "has fewer than two columns or rows"))?;
    length(&format!("{field}.projection.sigma_px"), map.sigma_px.len(), places)
}

fn bodies(r: &SolutionRecord) -> Result<()> {
    placed("bodies.bodies", &r.bodies.bodies)?;
    for (k, i) in r.bodies.instruments.iter().enumerate() {
        pose(&format!("bodies.instruments[{k}].pose"), &i.pose)?;
        length(&format!("bodies.instruments[{k}].covariance"), i.covariance.len(), POSE_COVARIANCE)?;
    }
    for (k, m) in r.bodies.measurements.iter().enumerate() {
        let field = format!("bodies.measurements[{k}]");
        let stops = r.bodies.stops.iter().filter(|s| s.series == m.series).count();
        let images = r.images.iter().filter(|i| i.series == m.series).count();
        index(&format!("{field}.stop"), m.stop, stops.max(images))?;
        require(m.sigma.iter().all(|s| *s > 0.0), &format!("{field}.sigma"), "is not positive")?;
        require(r.bodies.bodies.iter().any(|b| b.name == m.body), &format!("{field}.body"), "names no body")?;
    }
    for (k, s) in r.bodies.stops.iter().enumerate() {
        let readings = s.readings.as_ref().map_or(r.robot.readings.len(), Vec::len);
        length(&format!("bodies.stops[{k}].readings"), readings, r.robot.readings.len())?;
    }
    Ok(())
}

fn placed(field: &str, all: &[PlacedRecord]) -> Result<()> {
    for (k, p) in all.iter().enumerate() {
        pose(&format!("{field}[{k}].pose"), &p.pose)?;
        if let Some(covariance) = &p.covariance {
            length(&format!("{field}[{k}].covariance"), covariance.len(), POSE_COVARIANCE)?;
        }
    }
    Ok(())
}

fn plate(field: &str, p: &PlateRecord) -> Result<()> {
    for (name, count) in [("columns", p.columns), ("rows", p.rows)] {
        require(count <= MOST_ACROSS, &format!("{field}.{name}"), format!("is {count}"))?;
    }
    let n = p.id.len();
    require(n > 0, &format!("{field}.id"), "is empty")?;
    require(p.id.windows(2).all(|w| w[0] < w[1]), &format!("{field}.id"), "is not in ascending order")?;
    for (name, given) in [
        ("nominal_m", p.nominal_m.len()),
        ("radii_m", p.radii_m.len()),
        ("prior_sigma_m", p.prior_sigma_m.len()),
        ("correction_m", p.correction_m.len()),
        ("position_m", p.position_m.len()),
        ("sigma_m", p.sigma_m.len()),
    ] {
        length(&format!("{field}.{name}"), given, n)?;
    }
    require(p.prior_sigma_m.iter().all(|s| *s > 0.0), &format!("{field}.prior_sigma_m"), "is not positive")?;
    let known = |id: u32| p.id.binary_search(&id).is_ok();
    let scale = p.scale.is_none_or(|s| known(s.from) && known(s.to) && s.from != s.to);
    require(scale, &format!("{field}.scale"), "names markers that the plate does not have")
}

fn series(r: &SolutionRecord) -> Result<()> {
    let mut names = BTreeSet::new();
    for (k, s) in r.series.iter().enumerate() {
        let field = |name: &str| format!("series[{k}].{name}");
        require(names.insert(&s.name), &field("name"), format!("is \"{}\" a second time", s.name))?;
        if !s.has_images {
            continue;
        }
        index(&field("plate"), s.plate, r.plates.len())?;
        for (name, side) in [("width_px", s.width_px), ("height_px", s.height_px)] {
            require((2..=MOST_SIDE_PX).contains(&side), &field(name), format!("is {side}"))?;
        }
        require(s.focal_px.is_none_or(|f| f > 0.0), &field("focal_px"), "is not positive")?;
        let fits = |known: &KnownCamera| {
            let Camera { lens, width_px, height_px, .. } = known.camera;
            let like = |of: &Camera| of.parameters.len() == known.camera.parameters.len();
            [width_px, height_px] == [s.width_px, s.height_px] && like(&Camera::pinhole(lens, width_px, height_px, 1.0))
        };
        require(
            s.known_camera.as_ref().is_none_or(fits),
            &field("known_camera"),
            "is of other images or another lens",
        )?;
    }
    match r.images.iter().position(|i| !names.contains(&i.series)) {
        None => Ok(()),
        Some(k) => Err(refuse(&format!("images[{k}].series"), "names no series")),
    }
}

fn image(field: &str, i: &ImageRecord, r: &SolutionRecord) -> Result<()> {
    for (name, given, count) in [
        ("camera", i.camera, r.cameras.len()),
        ("mounting", i.mounting, r.mountings.len()),
        ("placement", i.placement, r.placements.len()),
        ("plate", i.plate, r.plates.len()),
    ] {
        index(&format!("{field}.{name}"), given, count)?;
    }
    for (name, values) in [("readings", &i.readings), ("approach", &i.approach), ("joint_noise", &i.joint_noise)] {
        if let Some(values) = values {
            length(&format!("{field}.{name}"), values.len(), r.robot.readings.len())?;
        }
    }
    if let Some(p) = &i.camera_from_plate {
        pose(&format!("{field}.camera_from_plate"), p)?;
    }
    if let Some(free) = &i.free_pose {
        pose(&format!("{field}.free_pose.plate_from_camera"), &free.plate_from_camera)?;
        length(&format!("{field}.free_pose.covariance"), free.covariance.len(), POSE_COVARIANCE)?;
    }
    let o = &i.observations;
    for (name, given) in [
        ("edge", o.edge.len()),
        ("radius_m", o.radius_m.len()),
        ("uv", o.uv.len()),
        ("covariance", o.covariance.len()),
        ("duv", o.duv.len()),
        ("reason", o.reason.len()),
    ] {
        length(&format!("{field}.observations.{name}"), given, o.marker.len())?;
    }
    let ids = &r.plates[i.plate].id;
    let known = o.marker.iter().all(|id| ids.binary_search(id).is_ok());
    require(known, &format!("{field}.observations.marker"), "names markers that the plate does not have")
}
