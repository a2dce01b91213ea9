//! CSV tables with a header, whose every complaint names file, line and column.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::path::Path;

use unicode_normalization::UnicodeNormalization;

use super::inputs::{InputFile, read_text};
use super::joint_names::{StatedUnit, remedy_of_names};
use super::spreadsheet::{is_date, mark_of_thousands};
use crate::error::{Code, Error, Result, closest_name, plain_name, renaming};
use crate::files::FileKind;

/// Columns that name what a row is of: they usually stand first.
const KEYS: [&str; 4] = ["image", "stop", "name", "id"];

/// A name with each accent in its letter. Some systems write it as a character of its own: to a person the names are the same, and so they are in all
/// tables.
pub(super) fn composed(name: &str) -> Cow<'_, str> {
    if name.is_ascii() { Cow::Borrowed(name) } else { Cow::Owned(name.nfc().collect()) }
}

/// One data row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row<'a> {
    pub line: u64,
    first: usize,
    cells: &'a Cells,
}

impl<'a> Row<'a> {
    /// Cell of a column, without blanks around it.
    pub fn cell(&self, column: usize) -> &'a str {
        self.cells.cell(self.first + column)
    }
}

/// All cells of a table, one after the other in one text: a table of many small cells stays small.
#[derive(Debug, Default)]
struct Cells {
    text: String,
    ends: Vec<u32>,
}

impl Cells {
    fn push(&mut self, cell: &str) {
        self.text.push_str(cell);
        self.ends.push(self.text.len() as u32);
    }

    fn cell(&self, index: usize) -> &str {
        let start = index.checked_sub(1).map_or(0, |before| self.ends[before] as usize);
        &self.text[start..self.ends[index] as usize]
    }
}

/// A table whose rows all have as many cells as the header.
#[derive(Debug)]
pub(crate) struct Table {
    file: String,
    pub headers: Vec<String>,
    lines: Vec<u64>,
    cells: Cells,
}

impl Table {
    pub fn read(path: &Path, inputs: &mut Vec<InputFile>) -> Result<Self> {
        Self::parse(path, &read_text(path, FileKind::Table, inputs)?)
    }

    /// Rows under the header.
    pub fn rows(&self) -> impl Iterator<Item = Row<'_>> + Clone {
        let width = self.headers.len();
        self.lines.iter().enumerate().map(move |(k, &line)| Row { line, first: k * width, cells: &self.cells })
    }

    /// Reads the text of a table; `path` is for messages only.
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let file = path.display().to_string();
        if text.len() as u64 > FileKind::Table.most_bytes() {
            return Err(Error::new(
                Code::FileTooLarge,
                file,
                "is too long for a table",
                "check that it is the right file",
            ));
        }
        refuse_other_separators(&file, text)?;
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        let mut table = Self { file, headers: Vec::new(), lines: Vec::new(), cells: Cells::default() };
        let (mut at, mut line) = (0, 1);
        let mut record = csv::StringRecord::new();
        loop {
            let more = reader.read_record(&mut record);
            let remedy = "correct the line (quotes must be closed)";
            if !more.map_err(|e| Error::new(Code::CsvSyntax, &table.file, e, remedy))? {
                break;
            }
            // The position of the csv reader may stand before line ends that it has yet to skip.
            let start = record.position().map_or(at, |p| p.byte() as usize);
            let start = start + text.as_bytes()[start..].iter().take_while(|b| matches!(b, b'\r' | b'\n')).count();
            line += text.as_bytes()[at..start].iter().filter(|b| **b == b'\n').count() as u64;
            at = start;
            table.push(line, &record)?;
        }
        match table.headers.is_empty() {
            true => Err(Error::new(Code::FileEmpty, table.file, "is empty", "its first line names the columns")),
            false => table.without_index(),
        }
    }

    /// Without the column of row numbers that pandas writes before the others, without a name.
    fn without_index(mut self) -> Result<Self> {
        if !self.headers[0].is_empty() {
            return Ok(self);
        }
        let is_index = self.rows().enumerate().all(|(k, row)| row.cell(0) == k.to_string());
        if !is_index || self.headers.len() == 1 {
            return Err(self.without_name(0));
        }
        let mut cells = Cells::default();
        self.rows().for_each(|row| (1..self.headers.len()).for_each(|column| cells.push(row.cell(column))));
        self.cells = cells;
        self.headers.remove(0);
        Ok(self)
    }

    /// Complaint about a column.
    fn without_name(&self, column: usize) -> Error {
        let what = format!("column {} has no name", column + 1);
        Error::new(Code::CsvColumnUnknown, self.place_of_header(), what, "name it or remove the extra comma")
    }

    /// The next row; the first is the header.
    fn push(&mut self, line: u64, record: &csv::StringRecord) -> Result<()> {
        if self.headers.is_empty() {
            self.headers = record.iter().map(str::to_string).collect();
            return self.check_headers();
        }
        let semicolons = record.iter().filter(|cell| cell.contains(';')).count();
        // Decimal commas may make as many cells as there are names.
        if semicolons > 1 || (semicolons > 0 && record.len() != self.headers.len()) {
            let what = "its columns are separated by semicolons, under names that are separated by commas";
            return Err(Error::new(Code::CsvSeparator, self.place_of_line(line), what, OTHER_SEPARATOR));
        }
        // Spreadsheets write rows of which all cells were emptied.
        if record.iter().all(str::is_empty) {
            return Ok(());
        }
        if record.len() != self.headers.len() {
            let remark = [(1, self.headers.first().map(String::as_str)), (line, record.get(0))];
            if let Some((line, _)) = remark.into_iter().find(|(_, cell)| cell.is_some_and(|c| c.starts_with('#'))) {
                let remedy = "remove the line: the first one names the columns, every other one is a row";
                return Err(Error::new(Code::CsvSyntax, self.place_of_line(line), "is a remark (#)", remedy));
            }
            let what = format!("{} cells under {} column names", record.len(), self.headers.len());
            let remedy = "give every row all cells; numbers need a decimal point, not a comma";
            return Err(Error::new(Code::CsvCellCount, self.place_of_line(line), what, remedy));
        }
        self.lines.push(line);
        for (cell, column) in record.iter().zip(&self.headers) {
            plain_name(column, cell, format_args!("{}:{line}", self.file))?;
            self.cells.push(&composed(cell));
        }
        Ok(())
    }

    fn check_headers(&self) -> Result<()> {
        let mut seen = BTreeSet::new();
        for (i, name) in self.headers.iter().enumerate() {
            plain_name("column", name, self.place_of_header())?;
            // The first one may be of row numbers.
            if name.is_empty() && i > 0 {
                return Err(self.without_name(i));
            }
            if !seen.insert(name) {
                let what = format!("two columns are named \"{name}\"");
                return Err(Error::new(Code::CsvColumnTwice, self.place_of_header(), what, "remove or rename one"));
            }
        }
        Ok(())
    }

    /// `file:line`.
    pub fn place_of_line(&self, line: u64) -> String {
        format!("{}:{line}", self.file)
    }

    pub fn place(&self, row: Row<'_>) -> String {
        self.place_of_line(row.line)
    }

    pub fn place_of_header(&self) -> String {
        self.place_of_line(1)
    }

    pub fn column(&self, name: &str) -> Option<usize> {
        self.headers.iter().position(|h| h == name)
    }

    pub fn require(&self, name: &str) -> Result<usize> {
        self.column(name).ok_or_else(|| {
            let what = format!("has no column \"{name}\"; its columns are: {}", self.headers.join(", "));
            let remedy = match closest_name(name, self.headers.iter().map(String::as_str)) {
                Some(meant) => renaming(meant, name),
                None => match self
                    .headers
                    .first()
                    .filter(|first| KEYS.contains(&name) && first.parse::<f64>().is_err() && !first.is_empty())
                {
                    Some(first) => format!("rename \"{first}\" to \"{name}\" where it is that, else add this column"),
                    None => format!("add the column \"{name}\""),
                },
            };
            Error::new(Code::CsvColumnMissing, self.place_of_header(), what, remedy)
        })
    }

    /// The columns of joints, in their order, with angles in the stated unit.
    pub fn require_joints(&self, joints: &[String], unit: StatedUnit<'_>) -> Result<Vec<usize>> {
        let missing: Vec<&str> = joints.iter().map(String::as_str).filter(|name| self.column(name).is_none()).collect();
        let columns = joints.iter().map(|name| self.require(name)).collect::<Result<_>>();
        columns.map_err(|error| match remedy_of_names(&missing, &self.headers, Some(unit)) {
            Some(remedy) => Error { remedy, ..error },
            None => error,
        })
    }

    /// Refuses columns that no reader asks for: a misspelt optional column would be ignored in silence.
    pub fn refuse_unknown(&self, known: &[&str]) -> Result<()> {
        match self.headers.iter().find(|h| !known.contains(&h.as_str())) {
            None => Ok(()),
            Some(name) => {
                let what = format!("unknown column \"{name}\"");
                let remedy = match closest_name(name, known.iter().copied()) {
                    Some(meant) => renaming(name, meant),
                    None => format!("known columns are: {}", known.join(", ")),
                };
                Err(Error::new(Code::CsvColumnUnknown, self.place_of_header(), what, remedy))
            }
        }
    }

    /// A finite number.
    pub fn number(&self, row: Row<'_>, column: usize) -> Result<f64> {
        let cell = row.cell(column);
        match cell.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => {
                if let Some((sign, remedy)) = self.without_sign(row, column) {
                    let what = format!("is not a number for its {sign}");
                    return Err(self.refuse(Code::CsvNumber, row, column, &what, remedy));
                }
                let (what, remedy) = match (is_date(cell), cell.contains(',')) {
                    (true, _) => (
                        "is a date or a time",
                        "write the number anew (times in seconds); a spreadsheet makes dates of numbers where the column is not text",
                    ),
                    (_, true) => {
                        ("is not a number", "write numbers with a decimal point, and nothing between thousands")
                    }
                    _ => ("is not a number", "write a finite number"),
                };
                Err(self.refuse(Code::CsvNumber, row, column, what, remedy))
            }
        }
    }

    /// The sign (or unit, or mark between thousands) without which a cell is a number, and what to do about it.
    pub fn without_sign(&self, row: Row<'_>, column: usize) -> Option<(String, &'static str)> {
        let cell = row.cell(column);
        if cell.parse::<f64>().is_ok() {
            return None;
        }
        if let Some(mark) = mark_of_thousands(cell) {
            return Some((
                format!("mark between thousands ({mark})"),
                "write numbers without it and with a decimal point, throughout the column",
            ));
        }
        let plain = cell.replace(MINUS, "-");
        let unit = UNITS.into_iter().find(|unit| plain.ends_with(unit));
        let number = unit.map_or(plain.as_str(), |unit| plain[..plain.len() - unit.len()].trim_end());
        number.replace(',', ".").parse::<f64>().ok().filter(|value| value.is_finite())?;
        match unit {
            Some(unit) => Some((format!("unit \"{unit}\""), "write numbers without a unit, throughout the column")),
            None => cell.chars().find(|c| MINUS.contains(c)).map(|c| {
                let remedy = "replace every such sign by the hyphen (-) that programs read as minus";
                (format!("minus sign (U+{:04X})", u32::from(c)), remedy)
            }),
        }
    }

    /// A number, or nothing where the cell is empty or the column does not exist.
    pub fn optional_number(&self, row: Row<'_>, column: Option<usize>) -> Result<Option<f64>> {
        match column {
            Some(column) if !row.cell(column).is_empty() => self.number(row, column).map(Some),
            _ => Ok(None),
        }
    }

    /// A marker id.
    pub fn id(&self, row: Row<'_>, column: usize) -> Result<u32> {
        let bad = || self.refuse(Code::CsvNumber, row, column, "is not a marker id", "ids are whole numbers from 0 on");
        row.cell(column).parse().map_err(|_| bad())
    }

    /// Complaint about one cell.
    pub fn refuse(&self, code: Code, row: Row<'_>, column: usize, what: &str, remedy: &str) -> Error {
        let cell = row.cell(column);
        let what = match cell.is_empty() {
            true => format!("column {}: an empty cell {what}", self.headers[column]),
            false => format!("column {}: \"{cell}\" {what}", self.headers[column]),
        };
        Error::new(code, self.place(row), what, remedy)
    }
}

/// Minus signs that word processors and web pages write.
const MINUS: [char; 2] = ['\u{2212}', '\u{2013}'];
/// Units that stand behind angles.
const UNITS: [&str; 5] = ["\u{b0}", "deg", "Deg", "Grad", "grad"];

const OTHER_SEPARATOR: &str = "save it with commas between columns and decimal points (spreadsheet language: English)";

/// Whether blanks separate the columns: every line has as many words as there are names, and some of them are numbers.
fn are_blanks<'a>(first: &str, lines: impl Iterator<Item = &'a str>) -> bool {
    let count = first.split_whitespace().count();
    let number = |word: &str| word.replace(',', ".").parse::<f64>().is_ok();
    let mut rows = lines.filter(|line| !line.trim().is_empty()).peekable();
    count > 1
        && rows.peek().is_some()
        && rows.all(|line| line.split_whitespace().count() == count && line.split_whitespace().any(number))
}

/// A table separated by semicolons, tabs or blanks is named as such instead of read as one column.
fn refuse_other_separators(file: &str, text: &str) -> Result<()> {
    let mut lines = text.lines();
    let first = lines.next().unwrap_or_default();
    // A line by which spreadsheets tell each other of the separator.
    if first.trim_start_matches('\u{feff}').trim().to_lowercase().starts_with("sep=") {
        let remedy = "remove the first line, and separate columns by commas: the first line names the columns";
        let what = "its first line names a separator, and no columns";
        return Err(Error::new(Code::CsvSeparator, format!("{file}:1"), what, remedy));
    }
    let (separator, name) = match (first.contains(','), first.contains(';'), first.contains('\t')) {
        (false, true, _) => (';', "semicolons"),
        (false, _, true) => ('\t', "tabs"),
        (false, ..) if are_blanks(first, lines.clone()) => (' ', "blanks"),
        _ => return Ok(()),
    };
    let comma =
        lines.any(|l| l.split(separator).any(|c| c.contains(',') && c.replace(',', ".").trim().parse::<f64>().is_ok()));
    let decimal = if comma { " and its numbers have a decimal comma" } else { "" };
    let what = format!("its columns are separated by {name}{decimal}");
    Err(Error::new(Code::CsvSeparator, format!("{file}:1"), what, OTHER_SEPARATOR))
}

/// Text of a table; cells are quoted where needed.
pub fn to_csv(rows: &[Vec<String>]) -> String {
    rows.iter().map(|row| csv_line(row)).collect()
}

/// One line of a table.
pub fn csv_line(row: &[String]) -> String {
    let quoted = |cell: &String| match cell.contains([',', '"', '\n', '\r']) || cell.trim() != cell {
        true => format!("\"{}\"", cell.replace('"', "\"\"")),
        false => cell.clone(),
    };
    row.iter().map(quoted).collect::<Vec<_>>().join(",") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::series::AngleUnit;

    #[test]
    fn a_number_that_a_spreadsheet_wrote_otherwise_is_told_why_it_is_none() {
        let table =
            |cell: &str| Table::parse(Path::new("joints.csv"), &format!("image,j1\na.png,\"{cell}\"\n")).unwrap();
        let error = |cell: &str| {
            let table = table(cell);
            table.number(table.rows().next().unwrap(), 1).map_err(|e| (e.code, e.place, e.what, e.remedy)).unwrap_err()
        };
        let plain = error("a few");
        for (cell, datum) in [("1'234.5", "(')"), ("1,234.5", "(,)"), ("12. Mai", "date"), ("2026-05-12", "date")] {
            let (code, place, what, remedy) = error(cell);
            assert_eq!((code, place.as_str()), (Code::CsvNumber, "joints.csv:2"));
            assert!(what.contains(cell) && what.contains(datum) && remedy != plain.3, "{what}: {remedy}");
        }
    }

    #[test]
    fn joints_that_stand_with_a_prefix_are_told_so_and_others_renamed() {
        let remedy = |header: &str| {
            let table = Table::parse(Path::new("points.csv"), &format!("x_m,{header}\n0,1,2\n")).unwrap();
            let unit = StatedUnit { unit: AngleUnit::Rad, stating: &|_| unreachable!() };
            table.require_joints(&["joint_1".to_owned(), "joint_2".to_owned()], unit).unwrap_err().remedy
        };
        let names = |all: [&str; 2]| all.map(str::to_owned);
        let missing = ["joint_1", "joint_2"];
        let of_prefix = remedy_of_names(&missing, &names(["left_joint_1", "left_joint_2"]), None);
        assert_eq!(Some(remedy("left_joint_1,left_joint_2")), of_prefix);
        assert_eq!(remedy("jont_1,joint_2"), renaming("jont_1", "joint_1"));
    }
}
