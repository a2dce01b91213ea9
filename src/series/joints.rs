//! `joints.csv`: the stops of the robot in the order in which they were visited.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::inputs::InputFile;
use super::table::{Row, Table};
use crate::error::{Code, Error, Notice, Result};

/// The placement of a series that names none.
pub const DEFAULT_PLACEMENT: &str = "placement_0";

/// Columns that are no joints.
const RESERVED: [&str; 5] = ["image", "stop", "placement", "time_s", TEMPERATURE];

const TEMPERATURE: &str = "temperature_c";

/// Before the name of a joint: its measured torque.
const TORQUE: &str = "tau_nm:";

/// What the first column of joints.csv names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StopKey {
    /// The image of the stop, the only one.
    #[default]
    Image,
    /// The stop; whatever was measured at it refers to it by this name.
    Stop,
}

impl StopKey {
    /// Name of the column.
    pub fn column(self) -> &'static str {
        match self {
            Self::Image => "image",
            Self::Stop => "stop",
        }
    }
}

/// What was measured of the state of the robot beside its readings.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Covariates {
    /// Temperature, degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Torque of each joint in `Stops::torque_joints`, Nm.
    pub torques_nm: Vec<Option<f64>>,
}

/// One standstill of the robot, with its joint readings.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SeriesStop {
    /// Name of the stop: with [`StopKey::Image`] the file name of its image.
    pub image: String,
    /// The image file; `None` when it is not there, or when observations are given instead.
    pub path: Option<PathBuf>,
    /// Readings as written, in the order and unit of the file; `None` for an image taken off the robot.
    pub raw_readings: Option<Vec<f64>>,
    /// Where the plate stood.
    pub placement: String,
    /// Time of the image, s, on any clock. Where all stops have one, they were visited in its order.
    pub time_s: Option<f64>,
    /// What else was measured of the robot.
    pub covariates: Covariates,
    /// Line in joints.csv; 0 when it does not come from one.
    pub line: u64,
}

impl SeriesStop {
    /// Name of the stop.
    pub fn name(&self) -> &str {
        &self.image
    }
}

/// All stops, with the names of the joint columns.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Stops {
    /// Joint names in the order of `Stop::raw_readings`.
    pub joints: Vec<String>,
    /// What the first column names.
    pub key: StopKey,
    /// Joints whose torques were measured, in the order of `Covariates::torques_nm`.
    pub torque_joints: Vec<String>,
    /// The stops in visiting order.
    pub stops: Vec<SeriesStop>,
}

impl Stops {
    /// Reads joints.csv.
    ///
    /// # Errors
    /// Unreadable files, rows without an image, cells that are no numbers, some joints of a row empty.
    pub fn read(path: &Path, inputs: &mut Vec<InputFile>) -> Result<Self> {
        Self::from_table(&Table::read(path, inputs)?)
    }

    /// Reads the text of a joints.csv; `path` is for messages only.
    ///
    /// # Errors
    /// As [`Stops::read`].
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        Self::from_table(&Table::parse(path, text)?)
    }

    fn from_table(table: &Table) -> Result<Self> {
        let columns = Columns::of(table)?;
        columns.refuse_text(table)?;
        let mut seen: BTreeMap<String, u64> = BTreeMap::new();
        let mut stops = Vec::new();
        for row in table.rows() {
            let stop = columns.stop(table, row)?;
            if let Some(first) = seen.insert(stop.image.clone(), row.line) {
                let what = format!("is the {} of line {first} already", columns.key.column());
                let remedy = format!("give every {} one row", columns.key.column());
                return Err(table.refuse(Code::CsvRowTwice, row, columns.name, &what, &remedy));
            }
            stops.push(stop);
        }
        if stops.is_empty() {
            let remedy = format!("give one row for every {}", columns.key.column());
            return Err(Error::new(Code::FileEmpty, table.place_of_header(), "has no rows", remedy));
        }
        if let OrderOfTimes::Sorted(order) = OrderOfTimes::of(&stops) {
            stops = order.into_iter().map(|k| stops[k].clone()).collect();
        }
        let named = |columns: &[usize]| columns.iter().map(|&c| table.headers[c].clone()).collect::<Vec<_>>();
        let torque_joints = named(&columns.torques).iter().map(|c| c[TORQUE.len()..].to_owned()).collect();
        Ok(Self { joints: named(&columns.joints), key: columns.key, torque_joints, stops })
    }

    /// What is to be said of their order and their times.
    pub(super) fn order_notice(&self, table: &Path) -> Option<Notice> {
        let is_untold = matches!(OrderOfTimes::of(&self.stops), OrderOfTimes::Untold);
        let was_reordered = !self.stops.iter().is_sorted_by_key(|s| s.line);
        let (code, what, remedy) = match (is_untold, was_reordered) {
            (false, false) => return None,
            (false, true) => (
                Code::RowsByTime,
                "its rows stand in another order than their times (time_s): the stops are taken as visited in the order of time",
                "remove the column where it holds something else",
            ),
            (true, _) => (
                Code::ClockSetBack,
                "its times (time_s) go back or are the same, as those of a clock that began anew: the stops are taken as visited in the order of the rows",
                "give times of one clock, or remove the column; where the rows are in no order, write order = \"unknown\" under [robot]",
            ),
        };
        Some(Notice::new(code, table.display(), what, remedy))
    }

    /// Index of the stop of that name.
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.stops.iter().position(|s| s.image == name)
    }

    /// Text of joints.csv; columns `placement` and `time_s` only where they say something.
    pub fn to_csv(&self) -> String {
        let placed = self.stops.iter().any(|s| s.placement != DEFAULT_PLACEMENT);
        let timed = self.stops.iter().any(|s| s.time_s.is_some());
        let mut names = vec![self.key.column().to_string()];
        names.extend(self.joints.iter().cloned());
        names.extend(placed.then(|| "placement".into()));
        names.extend(timed.then(|| "time_s".into()));
        let mut rows = vec![names];
        for stop in &self.stops {
            let mut cells = vec![stop.image.clone()];
            match &stop.raw_readings {
                Some(values) => cells.extend(values.iter().map(|v| format!("{v:?}"))),
                None => cells.extend(self.joints.iter().map(|_| String::new())),
            }
            cells.extend(placed.then(|| stop.placement.clone()));
            cells.extend(timed.then(|| stop.time_s.map_or_else(String::new, |t| format!("{t:?}"))));
            rows.push(cells);
        }
        super::table::to_csv(&rows)
    }
}

/// Where everything stands in a joints.csv.
struct Columns {
    key: StopKey,
    name: usize,
    placement: Option<usize>,
    time: Option<usize>,
    temperature: Option<usize>,
    torques: Vec<usize>,
    joints: Vec<usize>,
}

impl Columns {
    fn of(table: &Table) -> Result<Self> {
        let (key, name) = key_column(table)?;
        let placement = table.column("placement").filter(|&c| table.rows().any(|r| !r.cell(c).is_empty()));
        let (torques, others): (Vec<usize>, Vec<usize>) =
            (0..table.headers.len()).partition(|&c| table.headers[c].starts_with(TORQUE));
        let joints = others.into_iter().filter(|&c| !RESERVED.contains(&table.headers[c].as_str())).collect();
        let (time, temperature) = (table.column("time_s"), table.column(TEMPERATURE));
        Ok(Self { key, name, placement, time, temperature, torques, joints })
    }

    /// A column without a single number is a remark, and no joint.
    fn refuse_text(&self, table: &Table) -> Result<()> {
        let is_number = |cell: &str| cell.replace(',', ".").parse::<f64>().is_ok();
        let written = |c: usize| table.rows().map(move |row| row.cell(c)).filter(|cell| !cell.is_empty());
        let is_text = |c: &&usize| written(**c).nth(1).is_some() && !written(**c).any(is_number);
        match self.joints.iter().find(is_text) {
            Some(&text)
                if table.rows().all(|row| row.cell(text).is_empty() || table.without_sign(row, text).is_some()) =>
            {
                Ok(())
            }
            // Where no column has any, the file is another one.
            Some(&text) if self.joints.iter().any(|&c| written(c).any(is_number)) => {
                let what = format!(
                    "column \"{}\" is text (\"{}\"): every column but {} is a joint",
                    table.headers[text],
                    written(text).next().unwrap_or_default(),
                    RESERVED.join(", ")
                );
                let remedy = match written(text).any(|cell| cell.contains(|c: char| c.is_ascii_digit())) {
                    true => "write its cells as plain numbers; a column of remarks is removed",
                    false => "remove the column",
                };
                Err(Error::new(Code::CsvNumber, table.place_of_header(), what, remedy))
            }
            _ => Ok(()),
        }
    }

    fn stop(&self, table: &Table, row: Row<'_>) -> Result<SeriesStop> {
        let torques = self.torques.iter().map(|&c| table.optional_number(row, Some(c)));
        let covariates = Covariates {
            temperature_c: table.optional_number(row, self.temperature)?,
            torques_nm: torques.collect::<Result<_>>()?,
        };
        Ok(SeriesStop {
            image: stop_name(table, row, self.name, self.key)?,
            path: None,
            raw_readings: readings(table, row, &self.joints)?,
            placement: placement(table, row, self.placement)?,
            time_s: table.optional_number(row, self.time)?,
            covariates,
            line: row.line,
        })
    }
}

/// What the times of stops say of the order of visiting.
pub(super) enum OrderOfTimes {
    /// The rows stand in it, or not all have a time.
    AsWritten,
    /// It is this one.
    Sorted(Vec<usize>),
    /// A clock began anew, or two stops have one time.
    Untold,
}

/// Stops of one clock, at least: rows that were put in another order make shorter runs of growing times.
const STOPS_OF_A_CLOCK: usize = 4;

impl OrderOfTimes {
    pub fn of(stops: &[SeriesStop]) -> Self {
        let Some(times) = stops.iter().map(|s| s.time_s).collect::<Option<Vec<f64>>>() else { return Self::AsWritten };
        let mut order: Vec<usize> = (0..times.len()).collect();
        order.sort_by(|&a, &b| times[a].total_cmp(&times[b]));
        let back = times.windows(2).filter(|w| w[1] < w[0]).count();
        if back == 0 {
            return Self::AsWritten;
        }
        let is_twice = order.windows(2).any(|w| times[w[0]] == times[w[1]]);
        // In the order of time the runs of rows follow each other where they are of one clock.
        let changes = order.windows(2).filter(|w| w[1] != w[0] + 1).count();
        let is_begun_anew = (back + 1) * STOPS_OF_A_CLOCK <= times.len() && changes > back;
        if is_twice || is_begun_anew { Self::Untold } else { Self::Sorted(order) }
    }
}

/// The column that names the stops, and what it names.
pub(super) fn key_column(table: &Table) -> Result<(StopKey, usize)> {
    match (table.column("stop"), table.column("image")) {
        (Some(_), Some(_)) => {
            let remedy = "name the stop here, and its images in images.csv";
            Err(Error::new(Code::CsvColumnTwice, table.place_of_header(), "has both \"stop\" and \"image\"", remedy))
        }
        (Some(column), None) => Ok((StopKey::Stop, column)),
        (None, _) => table.require("image").map(|column| (StopKey::Image, column)),
    }
}

pub(super) fn placement(table: &Table, row: Row<'_>, column: Option<usize>) -> Result<String> {
    match column {
        None => Ok(DEFAULT_PLACEMENT.to_string()),
        Some(c) if row.cell(c).is_empty() => {
            let remedy = "name it as in the other rows";
            Err(table.refuse(Code::CsvCellEmpty, row, c, "names no placement", remedy))
        }
        Some(c) => Ok(row.cell(c).to_string()),
    }
}

/// Name of a stop; that of an image is a file name, of which nothing else is taken.
pub(super) fn stop_name(table: &Table, row: Row<'_>, column: usize, key: StopKey) -> Result<String> {
    let name = row.cell(column);
    if name.is_empty() {
        let (what, remedy) = match key {
            StopKey::Image => ("names no image", "name the image of the stop"),
            StopKey::Stop => ("names no stop", "give every stop a name of its own"),
        };
        return Err(table.refuse(Code::CsvCellEmpty, row, column, what, remedy));
    }
    if key == StopKey::Image && name.contains(['/', '\\']) {
        let remedy = "write the file name alone; images lie in images/";
        return Err(table.refuse(Code::CsvName, row, column, "is a path", remedy));
    }
    Ok(name.to_string())
}

/// All cells or none.
fn readings(table: &Table, row: Row<'_>, columns: &[usize]) -> Result<Option<Vec<f64>>> {
    if columns.iter().all(|&c| row.cell(c).is_empty()) {
        return Ok(None);
    }
    if let Some(&column) = columns.iter().find(|&&c| row.cell(c).is_empty()) {
        let remedy = "give all joints, or none for an image that was taken off the robot";
        return Err(table.refuse(Code::CsvCellEmpty, row, column, "among joint readings", remedy));
    }
    columns.iter().map(|&c| table.number(row, c)).collect::<Result<_>>().map(Some)
}
