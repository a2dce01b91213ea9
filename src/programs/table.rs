//! CSV tables of targets: one row each, visited in their order.
//!
//! Joint targets have one column for every joint, named as in the URDF. Flange poses have `x_m,y_m,z_m,qx,qy,qz,qw`; they get joint
//! columns with the result, and joint columns that are there already say which posture is meant.
//! Columns `E1`, `eax_a`, `ext1` beside a pose are external axes that the description lacks.

use std::ops::Range;
use std::path::Path;

use super::ProgramSetting;
use super::compensate::empty_cells;
use super::external::{NO_AXIS, OffZero};
use super::field::{Edit, Field, FieldPlace};
use super::program::{
    Approach, JointTarget, Left, MeantPosture, PoseTarget, Program, RotationFields, Target, TargetKind, Way,
};
use super::reason::Why;
use super::text_file::TextFile;
use crate::error::{Code, Error, Notice, Result, closest_name, renaming};
use crate::geom::Pose;
use crate::series::{AngleUnit, StatedUnit, check_unit, remedy_of_names};
use crate::urdf::JointKind;

const POSE_COLUMNS: [&str; 7] = ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"];
/// Decimals of angles in rad and of lengths in m; two fewer for degrees.
const DECIMALS: usize = 9;

/// A row: its line and the bytes of its cells, quotes and blanks left out.
struct Row {
    line: usize,
    cells: Vec<Range<usize>>,
    /// Byte after its last cell.
    end: usize,
}

/// Cells of a row within `range` of the bytes.
fn cells(bytes: &[u8], range: Range<usize>, separator: u8) -> Vec<Range<usize>> {
    let mut out = Vec::new();
    let mut start = range.start;
    let mut quoted = false;
    for at in range.clone() {
        quoted ^= bytes[at] == b'"';
        if bytes[at] == separator && !quoted {
            out.push(trimmed(bytes, start..at));
            start = at + 1;
        }
    }
    out.push(trimmed(bytes, start..range.end));
    out
}

fn trimmed(bytes: &[u8], range: Range<usize>) -> Range<usize> {
    let cell = &bytes[range.clone()];
    let blank = |b: &u8| b.is_ascii_whitespace() || *b == b'"';
    let (head, tail) =
        (cell.iter().take_while(|b| blank(b)).count(), cell.iter().rev().take_while(|b| blank(b)).count());
    if head == cell.len() { range.start..range.start } else { range.start + head..range.end - tail }
}

/// All rows that are not blank; the first is the header.
fn rows(file: &TextFile) -> (Vec<Row>, u8) {
    let bytes = file.bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&file.bytes);
    let mut start = file.bytes.len() - bytes.len();
    let line_end = if bytes.contains(&b'\n') { b'\n' } else { b'\r' };
    let first = bytes.split(|b| *b == line_end).next().unwrap_or_default();
    let separator = [b',', b';', b'\t'].into_iter().find(|s| first.contains(s)).unwrap_or(b',');
    let mut out = Vec::new();
    for (number, text) in (1..).zip(bytes.split(|b| *b == line_end)) {
        let end = start + text.len() - usize::from(text.ends_with(b"\r"));
        if !text.trim_ascii().is_empty() {
            out.push(Row { line: number, cells: cells(&file.bytes, start..end, separator), end });
        }
        start += text.len() + 1;
    }
    (out, separator)
}

/// Columns of the table, by what they mean.
struct Columns {
    names: Vec<String>,
    pose: Option<[usize; 7]>,
    /// Column of every reading; empty where there are none.
    joints: Vec<usize>,
    /// External axes that the description lacks.
    external: Vec<usize>,
}

impl Columns {
    fn is_read(&self, column: usize) -> bool {
        self.pose.is_some_and(|pose| pose.contains(&column))
            || [&self.joints, &self.external].iter().any(|columns| columns.contains(&column))
    }
}

/// True for the name of a column of an external axis: `E1` of KRL, `eax_a` of RAPID, `ext1`, `ext_1`, `extaxis_1`.
fn is_external(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let numbered = name.strip_prefix("ext").map(|rest| {
        let rest = rest.strip_prefix("axis").unwrap_or(rest);
        rest.strip_prefix('_').unwrap_or(rest)
    });
    [name.strip_prefix('e'), numbered].into_iter().flatten().any(is_number) || name.starts_with("eax_")
}

/// The unit of the joint columns, where it is stated.
fn stated_unit(setting: &ProgramSetting<'_>) -> Option<AngleUnit> {
    setting.rad_per_unit.map(|rad| if rad == 1.0 { AngleUnit::Rad } else { AngleUnit::Deg })
}

/// How it is stated.
fn stating(unit: &str) -> String {
    format!("give --joint-unit {unit}")
}

fn columns(file: &TextFile, header: &Row, setting: &ProgramSetting<'_>) -> Result<Columns> {
    let text = |r: &Range<usize>| String::from_utf8_lossy(&file.bytes[r.clone()]).into_owned();
    let names: Vec<String> = header.cells.iter().map(text).collect();
    let place = || format!("{}:{}", file.name, header.line);
    if let Some(twice) = (1..names.len()).find(|&i| names[..i].contains(&names[i])) {
        return Err(Error::new(
            Code::CsvColumnTwice,
            place(),
            format!("two columns are named \"{}\"", names[twice]),
            "rename one",
        ));
    }
    let find = |name: &str| names.iter().position(|n| n == name);
    let all = |wanted: &[&str]| -> Result<Vec<usize>> {
        let (there, missing): (Vec<&str>, Vec<&str>) = wanted.iter().copied().partition(|n| find(n).is_some());
        match missing.first() {
            Some(name) if !there.is_empty() => {
                let what = format!("has no column \"{name}\" (its columns are {})", names.join(", "));
                let remedy = match closest_name(name, names.iter().map(String::as_str)) {
                    Some(meant) => renaming(meant, name),
                    None => format!("add it: {} belong together", wanted.join(", ")),
                };
                Err(Error::new(Code::CsvColumnMissing, place(), what, remedy))
            }
            _ => Ok(there.into_iter().filter_map(find).collect()),
        }
    };
    let pose = <[usize; 7]>::try_from(all(&POSE_COLUMNS)?).ok();
    let readings: Vec<&str> = setting.chain.readings.iter().map(String::as_str).collect();
    let joints = all(&readings)?;
    if pose.is_none() && joints.is_empty() {
        let what = format!("has neither joint columns nor pose columns (its columns are {})", names.join(", "));
        let unit = stated_unit(setting).map(|unit| StatedUnit { unit, stating: &stating });
        let remedy = remedy_of_names(&readings, &names, unit)
            .unwrap_or_else(|| format!("name them {}, or {}", readings.join(", "), POSE_COLUMNS.join(", ")));
        return Err(Error::new(Code::CsvColumnMissing, place(), what, remedy));
    }
    let is_extra = |i: &usize| pose.is_some() && !joints.contains(i) && is_external(&names[*i]);
    let external = (0..names.len()).filter(is_extra).collect();
    Ok(Columns { names, pose, joints, external })
}

/// Reads one table.
pub(super) fn read(files: Vec<TextFile>, setting: &ProgramSetting<'_>) -> Result<Program> {
    let mut program = Program { files, targets: vec![], left: vec![], edits: vec![], notices: vec![], put: vec![] };
    let mut targets = Vec::new();
    for index in 0..program.files.len() {
        let file = &program.files[index];
        let (rows, separator) = rows(file);
        let Some((header, rows)) = rows.split_first() else {
            return Err(Error::new(Code::FileEmpty, &file.name, "is empty", "its first line names the columns"));
        };
        let columns = columns(file, header, setting)?;
        let table = Table { file, index, columns, separator, setting };
        if table.columns.joints.is_empty() {
            let quoted = |n: &String| match n.contains(['"', char::from(separator)]) {
                true => format!("\"{}\"", n.replace('"', "\"\"")),
                false => n.clone(),
            };
            let names = setting.chain.readings.iter().map(|n| format!("{}{}", char::from(separator), quoted(n)));
            program.edits.push(Edit { file: index, range: header.end..header.end, text: names.collect() });
        }
        let (mut from, mut off_zero) = (Approach::Unknown, table.off_zero_anywhere(rows));
        for row in rows {
            let target = table.target(row, from)?;
            let why = table.external(row, &mut off_zero).filter(|_| !setting.axes_apart);
            let Some(why) = why else {
                from = Approach::From(targets.len());
                targets.push(target);
                continue;
            };
            program.edits.extend(empty_cells(&target));
            program.left.push(Left { file: index, line: row.line, name: target.name, why });
            from = from.beyond();
        }
        table.check_unit(&targets)?;
        program.notices.extend(table.unread(rows));
    }
    program.targets = targets;
    Ok(program)
}

struct Table<'a> {
    file: &'a TextFile,
    index: usize,
    columns: Columns,
    separator: u8,
    setting: &'a ProgramSetting<'a>,
}

impl Table<'_> {
    fn target(&self, row: &Row, approach: Approach) -> Result<Target> {
        if row.cells.len() != self.columns.names.len() {
            let what = format!("{} cells under {} column names", row.cells.len(), self.columns.names.len());
            let place = format!("{}:{}", self.file.name, row.line);
            return Err(Error::new(
                Code::CsvCellCount,
                place,
                what,
                "give every row all cells; numbers need a decimal point",
            ));
        }
        let kind = match self.columns.pose {
            None => TargetKind::Joints(self.joints(row)?),
            Some(pose) => TargetKind::Pose(Box::new(self.pose(row, pose)?)),
        };
        let name = format!("row {}", row.line);
        Ok(Target { approach, ..Target::at((self.index, row.line), name, kind) })
    }

    /// Where a row puts external axes, by their columns: `None` where the text does not tell. An empty cell, or one that says that the axis is
    /// not used, leaves it where it is.
    fn places(&self, row: &Row) -> Vec<(usize, Option<f64>)> {
        let place = |column: usize| {
            let cell = self.cell(row, column);
            let value = cell.parse::<f64>().ok().filter(|value| value.is_finite());
            let is_left = cell.is_empty() || value.is_some_and(|value| value >= NO_AXIS);
            (!is_left).then_some((column, value))
        };
        self.columns.external.iter().filter_map(|&column| place(column)).collect()
    }

    /// Axes that any row puts elsewhere than at zero: the last run may have left them there.
    fn off_zero_anywhere(&self, rows: &[Row]) -> OffZero {
        let whole = rows.iter().filter(|row| row.cells.len() == self.columns.names.len());
        let mut all = OffZero::default();
        let places = whole.flat_map(|row| self.places(row)).filter(|(_, place)| *place != Some(0.0));
        places.for_each(|(column, _)| all.put(column, None));
        all
    }

    /// Why the pose of a row stays as it is: an axis that the description lacks is not at zero, where the row puts it or leaves it.
    fn external(&self, row: &Row, off_zero: &mut OffZero) -> Option<Why> {
        let name = |column: usize| self.columns.names[column].clone();
        let places = self.places(row);
        places.iter().for_each(|(column, place)| off_zero.put(*column, *place));
        let moved = places.iter().find(|(_, place)| *place != Some(0.0));
        moved
            .map(|(column, _)| Why::external(&name(*column), self.cell(row, *column)))
            .or_else(|| off_zero.why_kept(|column| places.iter().all(|(placed, _)| *placed != column), name))
    }

    /// Columns with numbers of which nothing is read.
    fn unread(&self, rows: &[Row]) -> Option<Notice> {
        let is_number = |column: &usize| rows.iter().any(|row| self.cell(row, *column).parse::<f64>().is_ok());
        let unread = (0..self.columns.names.len()).filter(|column| !self.columns.is_read(*column)).filter(is_number);
        let names: Vec<&str> = unread.map(|column| self.columns.names[column].as_str()).collect();
        let what = format!("columns of no joint and of no pose: {}", names.join(", "));
        let remedy = "they stay as they are, and are not read";
        (!names.is_empty()).then(|| Notice::new(Code::JointUnused, &self.file.name, what, remedy))
    }

    fn cell(&self, row: &Row, column: usize) -> String {
        String::from_utf8_lossy(&self.file.bytes[row.cells[column].clone()]).into_owned()
    }

    fn joints(&self, row: &Row) -> Result<JointTarget> {
        let fields = self.joint_fields(row)?;
        let readings = fields.iter().map(Field::value).collect();
        let fields = fields.into_iter().map(Some).collect();
        Ok(JointTarget { readings, fields, frames: Default::default() })
    }

    fn joint_fields(&self, row: &Row) -> Result<Vec<Field>> {
        let units = self.units()?;
        let field = |(&column, (si, decimals)): (&usize, (f64, usize))| self.field(row, column, si, decimals);
        self.columns.joints.iter().zip(units).map(field).collect()
    }

    /// Refuses joint columns that cannot be in the stated unit.
    fn check_unit(&self, targets: &[Target]) -> Result<()> {
        let Some(unit) = stated_unit(self.setting) else { return Ok(()) };
        let fields = |target: &Target| match &target.kind {
            TargetKind::Joints(joints) => joints.fields.clone(),
            TargetKind::Pose(pose) => pose.joint_fields.clone(),
        };
        let of_file = targets.iter().filter(|target| target.file == self.index);
        let rows: Vec<Vec<f64>> = of_file
            .map(|target| fields(target).iter().flatten().map(|field| field.written).collect())
            .filter(|row: &Vec<f64>| row.iter().all(|q| q.is_finite()))
            .collect();
        let rows: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
        check_unit(Path::new(&self.file.name), unit, self.setting.chain, &rows, stating)
    }

    /// SI value and decimals of every reading's unit.
    fn units(&self) -> Result<Vec<(f64, usize)>> {
        let kinds = &self.setting.chain.reading_kinds;
        let Some(rad) = self.setting.rad_per_unit else {
            let what = "does not tell whether its joints are in rad or deg";
            return Err(Error::new(
                Code::JointUnitMissing,
                &self.file.name,
                what,
                "add --joint-unit rad or --joint-unit deg",
            ));
        };
        let unit = |kind: &JointKind| match kind {
            JointKind::Prismatic => (1.0, DECIMALS),
            _ if rad == 1.0 => (1.0, DECIMALS),
            _ => (rad, DECIMALS - 2),
        };
        Ok(kinds.iter().map(unit).collect())
    }

    fn pose(&self, row: &Row, columns: [usize; 7]) -> Result<PoseTarget> {
        let field = |k: usize| self.field(row, columns[k], 1.0, DECIMALS);
        let q = [field(3)?, field(4)?, field(5)?, field(6)?];
        let norm = q.iter().map(|f| f.value().powi(2)).sum::<f64>().sqrt();
        if (norm - 1.0).abs() > 1e-3 {
            let place = format!("{}:{}", self.file.name, row.line);
            return Err(Error::new(
                Code::ProgramQuaternion,
                place,
                format!("the quaternion has the norm {norm}, not 1"),
                "order: qx, qy, qz, qw",
            ));
        }
        let empty = |c: &usize| row.cells[*c].is_empty();
        let given = !self.columns.joints.is_empty() && !self.columns.joints.iter().all(empty);
        let posture =
            if given { MeantPosture::Near(self.joints(row)?.readings) } else { MeantPosture::ByWay(Way::Joints) };
        let joint_fields = if given { self.joint_fields(row)? } else { self.new_joint_fields(row)? };
        Ok(PoseTarget {
            position: [field(0)?, field(1)?, field(2)?],
            rotation: RotationFields::Quaternion(q),
            base_from_work: self.setting.base * self.setting.work.unwrap_or_else(Pose::identity),
            flange_from_tool: self.setting.tool.unwrap_or_else(Pose::identity),
            fixed: vec![None; self.setting.chain.readings.len()],
            posture,
            taught: None,
            displaced: None,
            joint_fields: joint_fields.into_iter().map(Some).collect(),
        })
    }

    /// Fields of joints in empty cells, or behind the row.
    fn new_joint_fields(&self, row: &Row) -> Result<Vec<Field>> {
        let new = |(k, (si, decimals)): (usize, (f64, usize))| {
            let place = match self.columns.joints.get(k) {
                Some(&column) => FieldPlace::Missing(row.cells[column].start, String::new()),
                None => FieldPlace::Missing(row.end, char::from(self.separator).to_string()),
            };
            Field { file: self.index, place, written: f64::NAN, si, decimals }
        };
        Ok(self.units()?.into_iter().enumerate().map(new).collect())
    }

    fn field(&self, row: &Row, column: usize, si: f64, decimals: usize) -> Result<Field> {
        let range = row.cells[column].clone();
        let cell = self.cell(row, column);
        let written = cell.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| {
            let place = format!("{}:{}", self.file.name, row.line);
            let what = format!("column {}: \"{cell}\" is not a number", self.columns.names[column]);
            Error::new(Code::CsvNumber, place, what, "write a finite number with a decimal point")
        })?;
        Ok(Field { file: self.index, place: FieldPlace::At(range), written, si, decimals })
    }
}
