//! at.csv: the flange at given joint vectors, with its covariance.

use super::restore::FoundModel;
use super::text::number;
use crate::assess::PredictedFlange;
use crate::error::{Code, Error, Result};
use crate::series::{AngleUnit, to_csv};
use crate::urdf::JointKind;

/// The flange at every joint vector (rad or m, in the order of the chain).
///
/// # Errors
/// A solution in which robot and plate (or fixed camera) are not tied.
pub fn flange_at(model: &FoundModel, readings: &[Vec<f64>]) -> Result<Vec<PredictedFlange>> {
    let flange = model.flange().ok_or_else(|| {
        Error::new(
            Code::FitUndetermined,
            "flange",
            "nothing ties the robot to the plate",
            "solve with images that the robot took",
        )
    })?;
    Ok(readings.iter().map(|q| flange.at(q)).collect())
}

/// What the flange is stated relative to, by its name among the parameters: of several placements of the plate (fixed cameras) that of
/// most images on the robot.
pub fn relative_to(model: &FoundModel) -> &str {
    let name = model.still.map(|(_, column)| model.layout.columns[column].name.as_str()).unwrap_or_default();
    name.rsplit_once('.').map_or(name, |(body, _)| body)
}

/// Text of at.csv: readings (those of revolute joints in `unit`, sliding ones in m), pose relative to the plate (a fixed camera), sigmas, joints outside the range of the stops, upper
/// triangle of the covariance of the body twist (m, rad, translation first), and relative to what.
pub fn at_csv(model: &FoundModel, unit: AngleUnit, readings: &[Vec<f64>], found: &[PredictedFlange]) -> String {
    let chain = &model.robot.chain;
    let in_degrees = |kind: &JointKind| unit == AngleUnit::Deg && *kind != JointKind::Prismatic;
    let written = |(q, kind): (&f64, &JointKind)| if in_degrees(kind) { q.to_degrees() } else { *q };
    let mut head: Vec<String> = chain.readings.clone();
    let plain = ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw", "sigma_mm", "sigma_mrad", "outside"];
    head.extend(plain.map(String::from));
    let upper = || (0..6).flat_map(|i| (i..6).map(move |j| (i, j)));
    head.extend(upper().map(|(i, j)| format!("c{}{}", i + 1, j + 1)));
    head.push("relative_to".into());
    let mut rows = vec![head];
    for (q, f) in readings.iter().zip(found) {
        let [position, rotation] = f.sigmas();
        let numbers = (q.iter().zip(&chain.reading_kinds).map(written))
            .chain(f.pose.xyz())
            .chain(f.pose.quaternion_xyzw())
            .chain([1e3 * position, 1e3 * rotation]);
        let mut row: Vec<String> = numbers.map(number).collect();
        row.push(f.outside.join(" "));
        row.extend(upper().map(|(i, j)| number(f.covariance[(i, j)])));
        row.push(relative_to(model).to_owned());
        rows.push(row);
    }
    to_csv(&rows)
}
