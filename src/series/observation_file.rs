//! `observations.csv`: identified image points from any detector.

use std::collections::BTreeMap;
use std::path::Path;

use super::inputs::InputFile;
use super::observation::{Edge, ImageObservations, Observation};
use super::plate::Plate;
use super::table::{Row, Table, to_csv};
use crate::error::{Code, Error, Result};

const KNOWN: [&str; 11] = ["image", "marker", "u", "v", "edge", "cov_uu", "cov_uv", "cov_vv", "du", "dv", "reason"];
const COVARIANCE: [&str; 3] = ["cov_uu", "cov_uv", "cov_vv"];

/// Reads the observations of every image, by image name. Rows that the program itself left out (a `reason`) are skipped.
///
/// `size_px` is the size of an image, by its name, where it is known: cameras of several sizes may share a table.
///
/// # Errors
/// By line: unknown markers, an inner edge of a disc, numbers that are none, points outside the image, doubles.
pub(super) fn read(
    path: &Path,
    plate: &Plate,
    size_px: &dyn Fn(&str) -> Option<(u32, u32)>,
    inputs: &mut Vec<InputFile>,
) -> Result<BTreeMap<String, ImageObservations>> {
    from_table(&Table::read(path, inputs)?, plate, size_px)
}

/// Reads the text of an observations.csv; `path` is for messages only.
///
/// # Errors
/// By line: unknown markers, an inner edge of a disc, numbers that are none, points outside the image, doubles.
pub fn parse_observations(
    path: &Path,
    text: &str,
    plate: &Plate,
    size_px: Option<(u32, u32)>,
) -> Result<BTreeMap<String, ImageObservations>> {
    from_table(&Table::parse(path, text)?, plate, &|_| size_px)
}

fn from_table(
    table: &Table,
    plate: &Plate,
    size_px: &dyn Fn(&str) -> Option<(u32, u32)>,
) -> Result<BTreeMap<String, ImageObservations>> {
    table.refuse_unknown(&KNOWN)?;
    let reader = Reader::new(table, plate, size_px)?;
    let mut seen: BTreeMap<(&str, u32, Edge), u64> = BTreeMap::new();
    let mut images: BTreeMap<String, ImageObservations> = BTreeMap::new();
    for row in table.rows() {
        if reader.reason.is_some_and(|c| !row.cell(c).is_empty()) {
            continue;
        }
        let image = row.cell(reader.image);
        if image.is_empty() {
            return Err(table.refuse(Code::CsvCellEmpty, row, reader.image, "names no image", "name the image"));
        }
        let observation = reader.observation(row)?;
        let key = (image, observation.marker, observation.edge);
        if let Some(first) = seen.insert(key, row.line) {
            let what = format!("was observed in {image} by line {first} already");
            return Err(table.refuse(Code::CsvRowTwice, row, reader.marker, &what, "remove one of the two rows"));
        }
        let entry = images
            .entry(image.to_string())
            .or_insert_with(|| ImageObservations { image: image.to_string(), observations: Vec::new() });
        entry.observations.push(observation);
    }
    for image in images.values_mut() {
        image.observations.sort_by_key(|o| (o.marker, o.edge));
    }
    Ok(images)
}

/// Columns of the table, and what its rows are held against.
struct Reader<'a> {
    table: &'a Table,
    plate: &'a Plate,
    size_px: &'a dyn Fn(&str) -> Option<(u32, u32)>,
    image: usize,
    marker: usize,
    uv: [usize; 2],
    edge: Option<usize>,
    covariance: Option<[usize; 3]>,
    reason: Option<usize>,
}

impl<'a> Reader<'a> {
    fn new(table: &'a Table, plate: &'a Plate, size_px: &'a dyn Fn(&str) -> Option<(u32, u32)>) -> Result<Self> {
        let covariance = match COVARIANCE.map(|name| table.column(name)) {
            [None, None, None] => None,
            _ => {
                let [uu, uv, vv] = COVARIANCE.map(|name| table.require(name));
                Some([uu?, uv?, vv?])
            }
        };
        Ok(Self {
            table,
            plate,
            size_px,
            image: table.require("image")?,
            marker: table.require("marker")?,
            uv: [table.require("u")?, table.require("v")?],
            edge: table.column("edge"),
            covariance,
            reason: table.column("reason"),
        })
    }

    fn observation(&self, row: Row<'_>) -> Result<Observation> {
        let id = self.table.id(row, self.marker)?;
        let Some(index) = self.plate.index_of(id) else {
            let range = (self.plate.markers.first().map(|m| m.id), self.plate.markers.last().map(|m| m.id));
            let remedy = match range {
                (Some(first), Some(last)) => format!("the plate has ids {first} to {last}; is it the right plate?"),
                _ => "the plate has no markers".into(),
            };
            return Err(self.table.refuse(Code::MarkerUnknown, row, self.marker, "is no marker of the plate", &remedy));
        };
        let edge = self.edge(row)?;
        if edge == Edge::Inner && self.plate.markers[index].inner_radius_m == 0.0 {
            let column = self.edge.unwrap_or(self.marker);
            let what = format!("of marker {id}, which is a disc on the plate");
            return Err(self.table.refuse(
                Code::CsvName,
                row,
                column,
                &what,
                "only annuli have an inner edge; check the plate",
            ));
        }
        Ok(Observation { marker: id, edge, uv: self.point(row)?, covariance: self.covariance(row)? })
    }

    fn edge(&self, row: Row<'_>) -> Result<Edge> {
        let Some(column) = self.edge else { return Ok(Edge::Outer) };
        match row.cell(column) {
            "" | "outer" => Ok(Edge::Outer),
            "inner" => Ok(Edge::Inner),
            _ => Err(self.table.refuse(Code::CsvName, row, column, "is no edge", "write outer or inner")),
        }
    }

    fn point(&self, row: Row<'_>) -> Result<[f64; 2]> {
        let uv = [self.table.number(row, self.uv[0])?, self.table.number(row, self.uv[1])?];
        let Some((width, height)) = (self.size_px)(row.cell(self.image)) else { return Ok(uv) };
        for (column, value, size) in [(self.uv[0], uv[0], width), (self.uv[1], uv[1], height)] {
            if !is_inside(value, size) {
                let (what, remedy) = match self.fits_exchanged((width, height)) {
                    true => (
                        format!(
                            "is outside the image of {width} x {height} px, and with u and v exchanged all points are inside"
                        ),
                        "exchange the column names u and v: u is the column, v the row of the image",
                    ),
                    false => (
                        format!("is outside the image of {width} x {height} px"),
                        "check width_px and height_px; (0, 0) is the centre of the top-left pixel",
                    ),
                };
                return Err(self.table.refuse(Code::CsvRange, row, column, &what, remedy));
            }
        }
        Ok(uv)
    }

    /// Whether all points of images of this size are in the image where u is taken for v.
    fn fits_exchanged(&self, size: (u32, u32)) -> bool {
        let within = |row, column, size| self.table.number(row, column).is_ok_and(|value| is_inside(value, size));
        let mut alike = self.table.rows().filter(|row| (self.size_px)(row.cell(self.image)) == Some(size));
        alike.all(|row| within(row, self.uv[1], size.0) && within(row, self.uv[0], size.1))
    }

    fn covariance(&self, row: Row<'_>) -> Result<Option<[f64; 3]>> {
        let Some(columns) = self.covariance else { return Ok(None) };
        if columns.iter().all(|&c| row.cell(c).is_empty()) {
            return Ok(None);
        }
        let [uu, uv, vv] = columns.map(|c| self.table.number(row, c));
        let (uu, uv, vv) = (uu?, uv?, vv?);
        if !(uu > 0.0 && vv > 0.0 && uu * vv - uv * uv > 0.0) {
            let remedy = "cov_uu and cov_vv are variances in px^2, and |cov_uv| is below the root of their product";
            return Err(self.table.refuse(
                Code::CsvRange,
                row,
                columns[0],
                "begins a covariance that is not positive",
                remedy,
            ));
        }
        Ok(Some([uu, uv, vv]))
    }
}

/// Whether a coordinate lies in an image of so many pixels.
fn is_inside(value: f64, size: u32) -> bool {
    (-0.5..=f64::from(size) - 0.5).contains(&value)
}

/// Text of observations.csv; edge and covariance columns only where they say something.
pub fn observations_csv(images: &[ImageObservations]) -> String {
    let all = || images.iter().flat_map(|i| i.observations.iter().map(move |o| (&i.image, o)));
    let edges = all().any(|(_, o)| o.edge != Edge::Outer);
    let covariances = all().any(|(_, o)| o.covariance.is_some());
    let mut names: Vec<String> = ["image", "marker", "u", "v"].map(String::from).into();
    names.extend(edges.then(|| "edge".into()));
    names.extend(COVARIANCE.iter().filter(|_| covariances).map(|c| c.to_string()));
    let mut rows = vec![names];
    for (image, o) in all() {
        let mut cells = vec![image.clone(), o.marker.to_string(), format!("{:?}", o.uv[0]), format!("{:?}", o.uv[1])];
        let edge = match o.edge {
            Edge::Outer => "outer",
            Edge::Inner => "inner",
        };
        cells.extend(edges.then(|| edge.to_string()));
        if covariances {
            cells.extend((0..3).map(|k| o.covariance.map_or_else(String::new, |c| format!("{:?}", c[k]))));
        }
        rows.push(cells);
    }
    to_csv(&rows)
}

/// Puts observations into the order of the stops; images that no stop names are returned apart.
pub(super) fn in_order<'a>(
    mut images: BTreeMap<String, ImageObservations>,
    stops: impl Iterator<Item = &'a str>,
) -> (Vec<ImageObservations>, Vec<String>) {
    let ordered = stops.filter_map(|name| images.remove(name)).collect();
    (ordered, images.into_keys().collect())
}

/// No observation at all is an error: nothing could be solved from it.
pub(super) fn require_some(path: &Path, table: &str, images: &[ImageObservations], remedy: &str) -> Result<()> {
    if images.is_empty() {
        let what = format!("has no usable observation of any image in {table}");
        return Err(Error::new(Code::ObservationsMissing, path.display(), what, remedy));
    }
    Ok(())
}
