//! `controller.csv`: poses of the flange in the base, as the controller of the robot says them.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};

use super::controller_poses::{ControllerPoses, ReadOtherwise};
use super::inputs::InputFile;
use super::joints::{DEFAULT_PLACEMENT, OrderOfTimes, SeriesStop, Stops, key_column, placement, stop_name};
use super::quaternion::quaternion;
use super::rotation_kind::RotationKind;
use super::stop_index::{position, position_columns};
use super::table::{Row, Table};
use crate::error::{Code, Error, Result};
use crate::geom::Pose;

/// Name of the file.
pub(super) const NAME: &str = "controller.csv";

/// The file in a folder that says where the robot stood.
pub(super) fn table_of_stops(folder: &Path) -> &'static str {
    if folder.join(NAME).is_file() { NAME } else { "joints.csv" }
}

/// Flanges of most robots are nearer to their base than this, m; in millimetres they are farther.
const FARTHEST_M: f64 = 50.0;

/// Angles in radians, and the length of a rotation vector, stay below this; in degrees they seldom do.
const LARGEST_RAD: f64 = 2.0 * std::f64::consts::PI + 1e-3;

/// A pose as it is written.
#[derive(Clone)]
struct Written {
    position_m: Vector3<f64>,
    rotation: Matrix3<f64>,
    numbers: Vec<f64>,
}

/// Reads the stops of a controller.csv, and the poses of the flange at them.
///
/// # Errors
/// By file, line and stop: columns of another convention, numbers that are none, quaternions that are not of unit length, millimetres
/// and degrees where metres and radians stand.
pub(super) fn read(path: &Path, kind: RotationKind, inputs: &mut Vec<InputFile>) -> Result<(Stops, ControllerPoses)> {
    from_table(&Table::read(path, inputs)?, kind)
}

/// Reads the text of a controller.csv; `path` is for messages only.
///
/// # Errors
/// As for the file of a series: by file, line and stop.
pub fn parse_controller(path: &Path, text: &str, kind: RotationKind) -> Result<(Stops, ControllerPoses)> {
    from_table(&Table::parse(path, text)?, kind)
}

fn from_table(table: &Table, kind: RotationKind) -> Result<(Stops, ControllerPoses)> {
    let (key, name) = key_column(table)?;
    refuse_other_convention(table, kind)?;
    let known = [&["stop", "image", "x_m", "y_m", "z_m", "placement", "time_s"], kind.columns()].concat();
    let xyz = position_columns(table)?;
    table.refuse_unknown(&known)?;
    let rotation: Vec<usize> = kind.columns().iter().map(|c| table.require(c)).collect::<Result<_>>()?;
    let (placed, time) = (table.column("placement"), table.column("time_s"));
    let placed = placed.filter(|&c| table.rows().any(|r| !r.cell(c).is_empty()));
    let (mut stops, mut poses): (Vec<SeriesStop>, Vec<Option<Written>>) = (Vec::new(), Vec::new());
    for row in table.rows() {
        let stop = SeriesStop {
            image: stop_name(table, row, name, key)?,
            placement: placed.map_or_else(|| Ok(DEFAULT_PLACEMENT.to_owned()), |c| placement(table, row, Some(c)))?,
            time_s: table.optional_number(row, time)?,
            line: row.line,
            ..SeriesStop::default()
        };
        if let Some(first) = stops.iter().find(|s| s.image == stop.image) {
            let what = format!("is the {} of line {} already", key.column(), first.line);
            return Err(table.refuse(Code::CsvRowTwice, row, name, &what, "give every stop one row"));
        }
        poses.push(written(table, row, kind, xyz, &rotation, &stop.image)?);
        stops.push(stop);
    }
    let known: Vec<&Written> = poses.iter().flatten().collect();
    if known.is_empty() {
        let remedy = "give one row for every stop";
        return Err(Error::new(Code::FileEmpty, table.place_of_header(), "has no row with a pose", remedy));
    }
    refuse_units(table, kind, &known)?;
    if let OrderOfTimes::Sorted(order) = OrderOfTimes::of(&stops) {
        (stops, poses) = order.into_iter().map(|k| (stops[k].clone(), poses[k].clone())).unzip();
    }
    let stops = Stops { key, stops, ..Stops::default() };
    let stated_deg = vec![None; poses.len()];
    Ok((
        stops,
        ControllerPoses { base_from_flange: as_written(&poses), stated_deg, otherwise: otherwise(kind, &poses) },
    ))
}

/// Columns of another convention than the one that is stated.
fn refuse_other_convention(table: &Table, kind: RotationKind) -> Result<()> {
    let has_all = |k: &RotationKind| k.columns().iter().all(|c| table.column(c).is_some());
    let others: Vec<RotationKind> = RotationKind::ALL.into_iter().filter(has_all).collect();
    let Some(other) = others.first().filter(|_| !has_all(&kind)) else { return Ok(()) };
    let names = others.iter().map(|k| format!("\"{}\"", k.name())).collect::<Vec<_>>().join(" or ");
    let what = format!(
        "has the columns {} of {names}, and series.toml says rotation = \"{}\" ({})",
        other.columns().join(", "),
        kind.name(),
        kind.columns().join(", ")
    );
    let remedy = format!("write rotation = {names} under [controller] of series.toml");
    Err(Error::new(Code::CsvColumnMissing, table.place_of_header(), what, remedy))
}

/// The pose of a row; `None` where all its cells are empty (an image off the robot).
fn written(
    table: &Table,
    row: Row<'_>,
    kind: RotationKind,
    xyz: [usize; 3],
    rotation: &[usize],
    stop: &str,
) -> Result<Option<Written>> {
    let mut cells = xyz.iter().chain(rotation);
    if cells.clone().all(|&c| row.cell(c).is_empty()) {
        return Ok(None);
    }
    if let Some(&c) = cells.find(|&&c| row.cell(c).is_empty()) {
        let remedy = "give the whole pose, or none of it for an image that was taken off the robot";
        return Err(table.refuse(Code::CsvCellEmpty, row, c, &format!("in the pose of stop {stop}"), remedy));
    }
    let position_m = position(table, row, xyz)?;
    let numbers: Vec<f64> = rotation.iter().map(|&c| table.number(row, c)).collect::<Result<_>>()?;
    let rotation = match (*rotation).try_into() {
        Ok(columns) => quaternion(table, row, columns, stop)?,
        Err(_) => of_numbers(kind, &numbers).unwrap_or_else(Matrix3::identity),
    };
    Ok(Some(Written { position_m, rotation, numbers }))
}

fn of_numbers(kind: RotationKind, numbers: &[f64]) -> Option<Matrix3<f64>> {
    kind.of_three(numbers.try_into().ok()?)
}

/// Millimetres in place of metres, degrees in place of radians: no robot is as large, no angle either.
fn refuse_units(table: &Table, kind: RotationKind, poses: &[&Written]) -> Result<()> {
    let place = table.place_of_line(1);
    let far = poses.iter().filter(|p| p.position_m.norm() > FARTHEST_M).count();
    if 2 * far > poses.len() {
        let farthest = poses.iter().map(|p| p.position_m.norm()).fold(0.0, f64::max);
        let what = format!(
            "{far} of {} flanges are more than {FARTHEST_M} m from the base (up to {farthest:.1})",
            poses.len()
        );
        let remedy =
            "x_m, y_m, z_m are metres: divide them by 1000 if they are millimetres, by 100 if they are centimetres";
        return Err(Error::new(Code::MillimetresAsMetres, place, what, remedy));
    }
    let is_rad = matches!(kind, RotationKind::RotationVector | RotationKind::Rpy);
    let turned = |p: &&Written| p.numbers.iter().any(|v| v.abs() > LARGEST_RAD);
    if is_rad && poses.iter().any(turned) {
        let largest = poses.iter().flat_map(|p| &p.numbers).fold(0.0_f64, |m, v| m.max(v.abs()));
        let what = format!("rotations are said to be \"{}\", and go up to {largest}", kind.name());
        let remedy = "convert them to radians; roll, pitch, yaw in degrees are w, p, r of rotation = \"wpr_deg\", rx, ry, rz of \
                      VAL3 (Staubli) are rotation = \"xyz_deg\"";
        return Err(Error::new(Code::DegreesAsRadians, place, what, remedy));
    }
    Ok(())
}

fn as_written(poses: &[Option<Written>]) -> Vec<Option<Pose>> {
    let one = |p: &Written| Pose::new(p.rotation, p.position_m);
    poses.iter().map(|p| p.as_ref().map(one)).collect()
}

/// The same table read with one mistake undone, for each mistake that is usual.
fn otherwise(kind: RotationKind, poses: &[Option<Written>]) -> Vec<ReadOtherwise> {
    let written = as_written(poses);
    let mut all = vec![ReadOtherwise::inverted(&written, None), ReadOtherwise::turned_back(&written)];
    for (name, remedy, rotation) in other_rotations(kind) {
        let one = |p: &Written| Some(Pose::new(rotation(&p.numbers)?, p.position_m));
        let read: Vec<Option<Pose>> = poses.iter().map(|p| p.as_ref().and_then(one)).collect();
        all.push(ReadOtherwise::inverted(&read, Some(&name)));
        all.push(ReadOtherwise::of_convention(read, &name, remedy));
    }
    all
}

type OfNumbers = Box<dyn Fn(&[f64]) -> Option<Matrix3<f64>>>;

/// Other conventions that the numbers might follow: name, what to do, and the rotation.
fn other_rotations(kind: RotationKind) -> Vec<(String, String, OfNumbers)> {
    if kind == RotationKind::Quaternion {
        let first = |q: &[f64]| {
            Some(Pose::from_xyz_quaternion([0.0; 3], [*q.get(1)?, *q.get(2)?, *q.get(3)?, *q.first()?]).rotation)
        };
        let remedy = "name the columns in the order in which they stand: qw, qx, qy, qz".to_owned();
        return vec![("qw, qx, qy, qz".to_owned(), remedy, Box::new(first))];
    }
    let mut all: Vec<(String, String, OfNumbers)> = Vec::new();
    for other in RotationKind::ALL.into_iter().filter(|k| *k != RotationKind::Quaternion) {
        // W, P, R are the angles of roll, pitch, yaw in degrees.
        for (unit, of_unit) in [("rad", 1f64.to_radians()), ("deg", 1f64.to_degrees())] {
            let own_unit =
                if matches!(other, RotationKind::RotationVector | RotationKind::Rpy) { "rad" } else { "deg" };
            if other == RotationKind::Wpr || (other == kind && unit == own_unit) || same(kind, other, unit) {
                continue;
            }
            let (factor, named) = match (unit == own_unit, unit) {
                (true, _) => (1.0, other.name().to_owned()),
                (false, "deg") => (1.0 / of_unit, format!("{} in degrees", other.name())),
                (false, _) => (1.0 / of_unit, format!("{} in radians", other.name())),
            };
            let named = if other == RotationKind::Rpy && unit == "deg" { "wpr_deg".to_owned() } else { named };
            let remedy = remedy_of(&named);
            let rotation = move |n: &[f64]| {
                let n: Vec<f64> = n.iter().map(|v| v * factor).collect();
                of_numbers(other, &n)
            };
            all.push((named, remedy, Box::new(rotation)));
        }
    }
    all
}

/// W, P, R in degrees are roll, pitch, yaw in degrees.
fn same(kind: RotationKind, other: RotationKind, unit: &str) -> bool {
    kind == RotationKind::Wpr && other == RotationKind::Rpy && unit == "deg"
}

fn remedy_of(named: &str) -> String {
    match RotationKind::ALL.iter().find(|k| k.name() == named) {
        Some(kind) => format!(
            "write rotation = \"{named}\" under [controller] of series.toml, and name the columns {}",
            kind.columns().join(", ")
        ),
        None => "convert the angles to the unit of the convention, and name that under [controller] of series.toml"
            .to_owned(),
    }
}
