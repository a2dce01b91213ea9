//! `plate.toml` and `plate.csv`.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::inputs::{InputFile, read_text};
use super::plate::{Aruco, Marker, Plate, ScaleBar};
use super::plate_kind::{Ink, Places, PlateKind};
use super::puzzle::Puzzle;
use super::table::{Row, Table, to_csv};
use super::tag_plates::{TagKeys, dictionary_of, plate_of};
use super::tags::dictionary_named;
use super::toml_file::{check_format, parse_toml, read_toml, require_positive, to_toml};
use crate::error::{Code, Error, Result};
use crate::files::FileKind;

/// Prior sigma of a printed marker where the plate states none, m.
const DEFAULT_TOLERANCE_M: f64 = 1e-4;

const KNOWN: [&str; 10] =
    ["id", "x_m", "y_m", "z_m", "outer_radius_m", "inner_radius_m", "sigma_m", "sigma_x_m", "sigma_y_m", "sigma_z_m"];

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlateFile {
    format: u32,
    /// What the plate is called: another name is another plate.
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    kind: PlateKind,
    #[serde(skip_serializing_if = "Option::is_none")]
    columns: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rows: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pitch_m: Option<f64>,
    /// Radius of the dots of a circle-grid without a marker file.
    #[serde(skip_serializing_if = "Option::is_none")]
    radius_m: Option<f64>,
    /// Every other row of a circle-grid is shifted: rows are pitch_m apart, the dots of a row twice that.
    #[serde(skip_serializing_if = "Option::is_none")]
    asymmetric: Option<bool>,
    /// Columns and rows of the dots of a circle-grid that are not as most are.
    #[serde(skip_serializing_if = "Option::is_none")]
    large: Option<Vec<[u32; 2]>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tag_m: Option<f64>,
    /// Gap between the tags of an aprilgrid over their side.
    #[serde(skip_serializing_if = "Option::is_none")]
    spacing: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    family: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    marker_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gap_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    dictionary: Option<String>,
    /// The layout of a charuco board before OpenCV 4.6.
    #[serde(skip_serializing_if = "Option::is_none")]
    legacy: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    first_id: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    id: Option<u32>,
    /// Row and column of the pattern of a puzzleboard at its top-left.
    #[serde(skip_serializing_if = "Option::is_none")]
    origin_row: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    origin_col: Option<u32>,
    /// Diameter of its dots over the side of a square.
    #[serde(skip_serializing_if = "Option::is_none")]
    dot_diameter_rel: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    markers: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tolerance_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    aruco: Option<Aruco>,
    #[serde(skip_serializing_if = "Option::is_none")]
    scale: Option<ScaleBar>,
}

/// Reads a plate: `plate.toml` and the marker file that it names.
///
/// # Errors
/// By file and line: unknown keys or columns, missing sizes, doubles, circles that are none or overlap, markers that do
/// not lie where their id says, an impossible scale bar.
pub fn read_plate(path: &Path, inputs: &mut Vec<InputFile>) -> Result<Plate> {
    parse(path, &read_text(path, FileKind::Settings, inputs)?, |csv| read_text(csv, FileKind::Table, inputs))
}

/// Reads a plate from the text of its plate.toml and, where that names one, of its marker file; `path` is for messages only.
///
/// # Errors
/// As [`read_plate`].
pub fn parse_plate(path: &Path, toml: &str, markers: &str) -> Result<Plate> {
    parse(path, toml, |_| Ok(markers.to_string()))
}

fn parse(path: &Path, toml: &str, marker_text: impl FnOnce(&Path) -> Result<String>) -> Result<Plate> {
    let file: PlateFile = parse_toml(path, toml)?;
    check_format(path, file.format)?;
    let lengths = [
        ("pitch_m", file.pitch_m),
        ("tolerance_m", file.tolerance_m),
        ("radius_m", file.radius_m),
        ("tag_m", file.tag_m),
        ("spacing", file.spacing),
        ("marker_m", file.marker_m),
        ("gap_m", file.gap_m),
    ];
    for (key, value) in lengths {
        require_positive(path, key, value)?;
    }
    check_dictionary(path, toml, &file)?;
    let mut plate = nominal(path, &file)?;
    plate.name.clone_from(&file.name);
    if let Some(markers) = &file.markers {
        let csv = path.with_file_name(markers);
        let nominal = plate.clone();
        plate.markers = read_markers(&Table::parse(&csv, &marker_text(&csv)?)?, &plate)?;
        check_ids(&csv, &plate)?;
        check_spread(&csv, &plate, &nominal)?;
    }
    check_overlap(path, &plate)?;
    check_scale(path, &plate)?;
    Ok(plate)
}

/// The dictionary is known, by whichever key it is stated.
fn check_dictionary(path: &Path, toml: &str, file: &PlateFile) -> Result<()> {
    let of_family = file.family.as_deref().map(dictionary_of);
    let in_table = file.aruco.as_ref().map(|aruco| aruco.dictionary.clone());
    let stated = [("dictionary", file.dictionary.clone()), ("family", of_family), ("dictionary", in_table)];
    for (key, name) in stated.into_iter().filter_map(|(key, name)| Some((key, name?))) {
        // A key in a table within a line stands behind others.
        let line = toml.lines().position(|line| line.split('#').next().is_some_and(|l| l.contains(key)));
        let place = line.map_or_else(|| path.display().to_string(), |l| format!("{}:{}", path.display(), l + 1));
        dictionary_named(&name, &place)?;
    }
    Ok(())
}

/// The marker file that a plate names.
pub(super) fn marker_file(path: &Path) -> Result<Option<PathBuf>> {
    let file: PlateFile = read_toml(path, &mut Vec::new())?;
    Ok(file.markers.map(|markers| path.with_file_name(markers)))
}

/// The plate as its TOML alone describes it.
fn nominal(path: &Path, file: &PlateFile) -> Result<Plate> {
    let tolerance_m = file.tolerance_m.unwrap_or(DEFAULT_TOLERANCE_M);
    let print = file.kind.print();
    if print.needs_marker_file && file.markers.is_none() {
        let what = "a plate of this kind needs a marker file";
        return Err(Error::new(Code::SettingMissing, path.display(), what, "add markers = \"plate.csv\""));
    }
    if file.radius_m.is_some() && (!print.has_radius || file.markers.is_some()) {
        let what = "radius_m is only for a circle-grid without a marker file";
        return Err(Error::new(Code::SettingConflict, path.display(), what, "remove radius_m"));
    }
    if print.ink == Ink::Tags {
        let (tags, size) = tag_keys(file).tags(path, file.kind, [file.columns, file.rows])?;
        return Ok(Plate { scale: file.scale, ..plate_of(tags, file.kind, size, tolerance_m) });
    }
    if print.places == Places::Anywhere {
        let size = [file.columns, file.rows].map(|n| n.unwrap_or(0));
        let bare = Plate::without_markers(file.kind, size, file.pitch_m.unwrap_or(0.0), tolerance_m);
        return Ok(Plate { scale: file.scale, ..bare });
    }
    let (size, pitch_m) = lattice_keys(path, file)?;
    let mut plate = Plate {
        aruco: aruco(path, file, pitch_m)?,
        puzzle: puzzle(path, file, size)?,
        scale: file.scale,
        ..Plate::lattice(file.kind, size[0], size[1], pitch_m, tolerance_m)
    };
    for marker in &mut plate.markers {
        marker.outer_radius_m = file.radius_m.unwrap_or(0.0);
    }
    if (file.asymmetric.is_some() || file.large.is_some()) && !print.has_radius {
        let what = "asymmetric and large are only for a circle-grid";
        return Err(Error::new(Code::SettingConflict, path.display(), what, "remove them or correct `kind`"));
    }
    if file.asymmetric == Some(true) {
        plate.shift_rows();
    }
    plate.large = large(path, file, size)?;
    Ok(plate)
}

/// Columns and rows of a lattice, and its pitch in m.
fn lattice_keys(path: &Path, file: &PlateFile) -> Result<([u32; 2], f64)> {
    let (Some(columns), Some(rows), Some(pitch_m)) = (file.columns, file.rows, file.pitch_m) else {
        let what = "columns, rows and pitch_m are needed for a plate of this kind";
        return Err(Error::new(Code::SettingMissing, path.display(), what, "add what is missing (pitch in metres)"));
    };
    if !(2..=1000).contains(&columns) || !(2..=1000).contains(&rows) {
        let what = format!("columns = {columns}, rows = {rows}");
        return Err(Error::new(
            Code::SettingRange,
            path.display(),
            what,
            "give 2 to 1000 of each (inner corners of a chessboard)",
        ));
    }
    if pitch_m >= 1.0 {
        let what = format!("pitch_m = {pitch_m} makes a plate of {:.0} m", pitch_m * f64::from(columns));
        return Err(Error::new(Code::PlateUnitUnlikely, path.display(), what, "pitch_m is in metres: 18 mm are 0.018"));
    }
    Ok(([columns, rows], pitch_m))
}

/// The part of the pattern that a puzzleboard is; no other kind has any.
fn puzzle(path: &Path, file: &PlateFile, size: [u32; 2]) -> Result<Option<Puzzle>> {
    let origin = [file.origin_col, file.origin_row];
    if file.kind.print().ink == Ink::SquaresAndDots {
        return Puzzle::new(path, size, origin, file.dot_diameter_rel).map(Some);
    }
    if origin != [None; 2] || file.dot_diameter_rel.is_some() {
        let what = "origin_row, origin_col and dot_diameter_rel are only for a puzzleboard";
        return Err(Error::new(Code::SettingConflict, path.display(), what, "remove them or correct `kind`"));
    }
    Ok(None)
}

fn tag_keys(file: &PlateFile) -> TagKeys {
    TagKeys {
        tag_m: file.tag_m,
        marker_m: file.marker_m,
        spacing: file.spacing,
        gap_m: file.gap_m,
        family: file.family.clone(),
        dictionary: file.dictionary.clone(),
        first_id: file.first_id,
        id: file.id,
    }
}

/// Ids of the dots that are stated to be of another size.
fn large(path: &Path, file: &PlateFile, [columns, rows]: [u32; 2]) -> Result<Vec<u32>> {
    let stated = file.large.as_deref().unwrap_or_default();
    if let Some([column, row]) = stated.iter().find(|[column, row]| *column >= columns || *row >= rows) {
        let what = format!("large names column {column}, row {row} of a grid of {columns} x {rows}");
        return Err(Error::new(Code::SettingRange, path.display(), what, "count both from 0, from the top-left dot"));
    }
    let mut ids: Vec<u32> = stated.iter().map(|[column, row]| row * columns + column).collect();
    ids.sort_unstable();
    ids.dedup();
    Ok(ids)
}

/// The markers of a ChArUco board, where they are stated, by its own keys or in a table; no other kind has any.
fn aruco(path: &Path, file: &PlateFile, pitch_m: f64) -> Result<Option<Aruco>> {
    let conflict =
        |what: &str| Err(Error::new(Code::SettingConflict, path.display(), what, "remove them, or correct `kind`"));
    let of_tags = [file.tag_m, file.spacing, file.gap_m].iter().any(Option::is_some) || file.family.is_some();
    if of_tags || file.id.is_some() {
        return conflict("tag_m, spacing, gap_m, family and id are only for plates of tags");
    }
    let own = file.marker_m.is_some() || file.dictionary.is_some() || file.legacy.is_some() || file.first_id.is_some();
    if !file.kind.print().has_tags {
        return match own || file.aruco.is_some() {
            true => {
                conflict("marker_m, dictionary, legacy, first_id and [aruco] are only for plates with markers in them")
            }
            false => Ok(None),
        };
    }
    let aruco = match (&file.aruco, file.marker_m, &file.dictionary) {
        (None, None, None) if !own => return Ok(None),
        (Some(aruco), ..) if !own => aruco.clone(),
        (None, Some(side_m), Some(dictionary)) => Aruco {
            dictionary: dictionary.clone(),
            side_m,
            legacy: file.legacy.unwrap_or(false),
            first_id: file.first_id.unwrap_or(0),
        },
        (None, ..) => {
            let what = "marker_m and dictionary state the markers of a charuco board together";
            return Err(Error::new(Code::SettingMissing, path.display(), what, "add what is missing, or remove all"));
        }
        (Some(_), ..) => {
            return conflict("marker_m, dictionary, legacy and first_id stand beside [aruco], which says the same");
        }
    };
    if !(aruco.side_m > 0.0 && aruco.side_m < pitch_m) {
        let what = format!("a marker of {} m does not fit into a square of {pitch_m} m", aruco.side_m);
        let remedy = "give the side of a marker with its black border, in metres";
        return Err(Error::new(Code::SettingRange, path.display(), what, remedy));
    }
    Ok(Some(aruco))
}

fn read_markers(table: &Table, plate: &Plate) -> Result<Vec<Marker>> {
    table.refuse_unknown(&KNOWN)?;
    let id = table.require("id")?;
    let xyz = [table.require("x_m")?, table.require("y_m")?, table.require("z_m")?];
    let circles = plate.kind.print().ink == Ink::Circles;
    let radius = |name: &str| if circles { table.require(name).map(Some) } else { Ok(table.column(name)) };
    let radii = [radius("outer_radius_m")?, radius("inner_radius_m")?];
    let sigmas = ["sigma_m", "sigma_x_m", "sigma_y_m", "sigma_z_m"].map(|name| table.column(name));
    let mut markers: Vec<(u64, Marker)> = Vec::new();
    for row in table.rows() {
        let [x, y, z] = xyz.map(|c| table.number(row, c));
        let [outer_radius_m, inner_radius_m] = marker_radii(table, row, radii, circles)?;
        let id = table.id(row, id)?;
        let position_m = Vector3::new(x?, y?, z?);
        let sigma_m = marker_sigma(table, row, sigmas)?.unwrap_or(plate.tolerance_m);
        markers.push((row.line, Marker { id, position_m, outer_radius_m, inner_radius_m, sigma_m }));
    }
    if markers.is_empty() {
        return Err(Error::new(
            Code::FileEmpty,
            table.place_of_header(),
            "has no markers",
            "give one row for every marker",
        ));
    }
    markers.sort_by_key(|(line, m)| (m.id, *line));
    if let Some(pair) = markers.windows(2).find(|p| p[0].1.id == p[1].1.id) {
        let place = table.place_of_line(pair[1].0);
        let what = format!("marker {} stands in line {} already", pair[1].1.id, pair[0].0);
        return Err(Error::new(Code::CsvRowTwice, place, what, "give every marker one row"));
    }
    Ok(markers.into_iter().map(|(_, m)| m).collect())
}

/// Outer and inner radius, m; zero where a plate of points has no such column.
fn marker_radii(table: &Table, row: Row<'_>, columns: [Option<usize>; 2], circles: bool) -> Result<[f64; 2]> {
    let read = |c: Option<usize>| c.map_or(Ok(0.0), |c| table.number(row, c));
    let [outer, inner] = columns.map(read);
    let (outer, inner) = (outer?, inner?);
    let [Some(outer_column), inner_column] = columns else { return Ok([outer, inner]) };
    if outer < 0.0 || (circles && outer == 0.0) {
        return Err(table.refuse(
            Code::CsvRange,
            row,
            outer_column,
            "is no radius",
            "give a positive radius in metres",
        ));
    }
    if inner < 0.0 || inner > 0.0 && inner >= outer {
        let what = format!("is not inside the outer radius {outer}");
        return Err(table.refuse(
            Code::CsvRange,
            row,
            inner_column.unwrap_or(outer_column),
            &what,
            "0 is a disc, else below outer",
        ));
    }
    Ok([outer, inner])
}

/// `sigma_m`, or the largest of the three sigmas of a corrected plate.
fn marker_sigma(table: &Table, row: Row<'_>, columns: [Option<usize>; 4]) -> Result<Option<f64>> {
    let mut sigma = None;
    for column in columns.into_iter().flatten() {
        let value = table.optional_number(row, Some(column))?;
        if value.is_some_and(|v| v <= 0.0) {
            return Err(table.refuse(Code::CsvRange, row, column, "is no sigma", "give a positive number of metres"));
        }
        sigma = value.into_iter().chain(sigma).reduce(f64::max);
    }
    Ok(sigma)
}

/// Markers of a lattice lie where their id says: a mirrored, turned or millimetre plate is seen here.
fn check_ids(csv: &Path, plate: &Plate) -> Result<()> {
    if plate.kind.print().places != Places::LatticeById {
        return Ok(());
    }
    let lattice = Plate::lattice(plate.kind, plate.columns, plate.rows, plate.pitch_m, plate.tolerance_m);
    for marker in &plate.markers {
        let place = || format!("{}, marker {}", csv.display(), marker.id);
        let Some(wanted) = lattice.index_of(marker.id).map(|i| lattice.markers[i].position_m) else {
            let what = format!("does not exist on a plate of {} x {}", plate.columns, plate.rows);
            return Err(Error::new(Code::MarkerUnknown, place(), what, "ids are row-major from 0 at the top-left"));
        };
        let at = marker.position_m;
        if (at - wanted).norm() > 0.5 * plate.pitch_m {
            let what = format!(
                "lies at ({}, {}, {}) m, but columns, rows and pitch_m put this id at ({}, {}, 0) m",
                at.x, at.y, at.z, wanted.x, wanted.y
            );
            let remedy =
                "metres; origin at the plate's centre, x right, y UP on the printed face, ids row-major from top-left";
            return Err(Error::new(Code::MarkerMisplaced, place(), what, remedy));
        }
    }
    Ok(())
}

/// Markers that may be numbered otherwise spread over the lattice that columns, rows and pitch make.
fn check_spread(csv: &Path, plate: &Plate, nominal: &Plate) -> Result<()> {
    if plate.kind.print().places != Places::Lattice {
        return Ok(());
    }
    let spread = |plate: &Plate, axis: usize| {
        let all = || plate.markers.iter().map(|m| m.position_m[axis]);
        all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min)
    };
    let [own, wanted] = [plate, nominal].map(|plate| [0, 1].map(|axis| spread(plate, axis)));
    if (0..2).all(|axis| (own[axis] - wanted[axis]).abs() < 0.5 * plate.pitch_m) {
        return Ok(());
    }
    let [own, wanted] = [own, wanted].map(|[x, y]| format!("{x:.4} x {y:.4} m"));
    let what = format!("its markers spread over {own}, but columns, rows and pitch_m of plate.toml over {wanted}");
    let remedy = "correct columns, rows or pitch_m, or the marker file: metres, x right, y UP on the printed face";
    Err(Error::new(Code::MarkerMisplaced, csv.display(), what, remedy))
}

/// Neighbours must be apart by more than their radii.
fn check_overlap(path: &Path, plate: &Plate) -> Result<()> {
    let mut order: Vec<&Marker> = plate.markers.iter().collect();
    order.sort_by(|a, b| a.position_m.x.total_cmp(&b.position_m.x));
    let largest = order.iter().map(|m| m.outer_radius_m).fold(0.0, f64::max);
    for (i, a) in order.iter().enumerate() {
        // A point still occupies a micrometre, so that two of them cannot coincide.
        let reach = a.outer_radius_m + largest + 1e-6;
        for b in order[i + 1..].iter().take_while(|b| b.position_m.x - a.position_m.x <= reach) {
            let distance = (a.position_m - b.position_m).norm();
            if distance <= a.outer_radius_m + b.outer_radius_m + 1e-6 {
                let (first, second) = (a.id.min(b.id), a.id.max(b.id));
                let what = format!("markers {first} and {second} overlap: their centres are {distance} m apart");
                return Err(Error::new(
                    Code::MarkersOverlap,
                    path.display(),
                    what,
                    "check positions and radii (not diameters), in metres",
                ));
            }
        }
    }
    Ok(())
}

fn check_scale(path: &Path, plate: &Plate) -> Result<()> {
    let Some(scale) = plate.scale else { return Ok(()) };
    require_positive(path, "scale.distance_m", Some(scale.distance_m))?;
    require_positive(path, "scale.sigma_m", Some(scale.sigma_m))?;
    let position = |id: u32| {
        plate.index_of(id).map(|i| plate.markers[i].position_m).ok_or_else(|| {
            let what = format!("[scale] names marker {id}, which does not exist");
            Error::new(Code::MarkerUnknown, path.display(), what, "name two markers of the plate")
        })
    };
    let nominal = (position(scale.from)? - position(scale.to)?).norm();
    if (scale.distance_m / nominal - 1.0).abs() > 0.05 || nominal == 0.0 {
        let what = format!(
            "[scale] distance_m = {}, but markers {} and {} are nominally {nominal} m apart",
            scale.distance_m, scale.from, scale.to
        );
        return Err(Error::new(
            Code::PlateScaleUnlikely,
            path.display(),
            what,
            "check the marker ids and the unit (metres)",
        ));
    }
    Ok(())
}

/// Text of `plate.toml`; `markers` is the name of the marker file, which coded circles and points need.
///
/// # Errors
/// None in practice: every field can be written as TOML.
pub fn plate_toml(plate: &Plate, markers: Option<&str>) -> Result<String> {
    let lattice = plate.kind.print().places != Places::Anywhere || plate.columns > 0;
    let tags = plate.tags.as_ref().map_or_else(TagKeys::default, |tags| TagKeys::of(plate.kind, tags));
    let lattice = lattice && plate.kind != PlateKind::Tag;
    let radius = plate.markers.first().map(|m| m.outer_radius_m).filter(|r| *r > 0.0);
    to_toml(
        "plate.toml",
        &PlateFile {
            format: 1,
            name: plate.name.clone(),
            kind: plate.kind,
            columns: lattice.then_some(plate.columns),
            rows: lattice.then_some(plate.rows),
            pitch_m: Some(plate.pitch_m).filter(|p| *p > 0.0 && plate.tags.is_none()),
            tag_m: tags.tag_m,
            spacing: tags.spacing,
            family: tags.family,
            marker_m: tags.marker_m,
            gap_m: tags.gap_m,
            dictionary: tags.dictionary,
            legacy: None,
            first_id: tags.first_id,
            id: tags.id,
            radius_m: radius.filter(|_| plate.kind.print().has_radius && markers.is_none()),
            asymmetric: plate.has_shifted_rows().then_some(true).filter(|_| plate.kind.print().has_radius),
            large: Some(plate.large.iter().map(|id| [id % plate.columns, id / plate.columns]).collect())
                .filter(|large: &Vec<_>| !large.is_empty()),
            origin_row: plate.puzzle.map(|p| p.origin_row),
            origin_col: plate.puzzle.map(|p| p.origin_col),
            dot_diameter_rel: plate.puzzle.map(|p| p.dot_diameter_rel),
            markers: markers.map(str::to_string),
            tolerance_m: Some(plate.tolerance_m),
            aruco: plate.aruco.clone(),
            scale: plate.scale,
        },
    )
}

/// Names and texts of the files of a plate: plate.toml, and plate.csv where circles have sizes of their own, or where plate.toml alone says other markers.
///
/// # Errors
/// A plate that cannot be written.
pub fn plate_files(plate: &Plate) -> Result<Vec<(&'static str, String)>> {
    let has_circles = plate.markers.iter().any(|m| m.outer_radius_m > 0.0);
    let alone = plate_toml(plate, None)?;
    let is_told = |read: Plate| read.markers == plate.markers;
    if !has_circles && parse_plate(Path::new("plate.toml"), &alone, "").is_ok_and(is_told) {
        return Ok(vec![("plate.toml", alone)]);
    }
    Ok(vec![("plate.toml", plate_toml(plate, Some("plate.csv"))?), ("plate.csv", plate_csv(plate))])
}

/// Text of `plate.csv`; `sigma_m` only where a marker's differs from the plate's tolerance.
pub fn plate_csv(plate: &Plate) -> String {
    let sigmas = plate.markers.iter().any(|m| m.sigma_m != plate.tolerance_m);
    let mut names: Vec<String> = KNOWN[..6].iter().map(|n| n.to_string()).collect();
    names.extend(sigmas.then(|| "sigma_m".into()));
    let mut rows = vec![names];
    for m in &plate.markers {
        let p = m.position_m;
        let mut cells = vec![m.id.to_string()];
        cells.extend([p.x, p.y, p.z, m.outer_radius_m, m.inner_radius_m].map(|v| format!("{v:?}")));
        cells.extend(sigmas.then(|| format!("{:?}", m.sigma_m)));
        rows.push(cells);
    }
    to_csv(&rows)
}
