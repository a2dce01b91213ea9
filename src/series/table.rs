//! CSV tables with a header, whose every complaint names file, line and column.

use std::path::Path;

use super::inputs::{InputFile, read_text};
use crate::{Error, Result, closest_name, plain_name};

/// One data row.
#[derive(Debug)]
pub(super) struct Row {
    pub line: u64,
    cells: Vec<String>,
}

impl Row {
    /// Cell of a column, without blanks around it.
    pub fn cell(&self, column: usize) -> &str {
        &self.cells[column]
    }
}

/// A table whose rows all have as many cells as the header.
#[derive(Debug)]
pub(super) struct Table {
    file: String,
    pub headers: Vec<String>,
    pub rows: Vec<Row>,
}

impl Table {
    pub fn read(path: &Path, inputs: &mut Vec<InputFile>) -> Result<Self> {
        Self::parse(&path.display().to_string(), &read_text(path, inputs)?)
    }

    pub fn parse(file: &str, text: &str) -> Result<Self> {
        refuse_other_separators(file, text)?;
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        let mut rows = Vec::new();
        let (mut at, mut line) = (0, 1);
        for record in reader.records() {
            let record = record.map_err(|e| Error::input(file, e, "correct the line (quotes must be closed)"))?;
            // The position of the csv reader may stand before line ends that it has yet to skip.
            let start = record.position().map_or(at, |p| p.byte() as usize);
            let start = start + text.as_bytes()[start..].iter().take_while(|b| matches!(b, b'\r' | b'\n')).count();
            line += text.as_bytes()[at..start].iter().filter(|b| **b == b'\n').count() as u64;
            at = start;
            rows.push(Row { line, cells: record.iter().map(str::to_string).collect() });
        }
        let mut rows = rows.into_iter();
        let Some(header) = rows.next() else {
            return Err(Error::input(file, "is empty", "its first line names the columns"));
        };
        let table = Self { file: file.to_string(), headers: header.cells, rows: rows.collect() };
        table.check()?;
        Ok(table)
    }

    fn check(&self) -> Result<()> {
        for (i, name) in self.headers.iter().enumerate() {
            plain_name("column", name, self.place_of_header())?;
            if name.is_empty() {
                let what = format!("column {} has no name", i + 1);
                return Err(Error::input(self.place_of_header(), what, "name it or remove the extra comma"));
            }
            if self.headers[..i].contains(name) {
                let what = format!("two columns are named \"{name}\"");
                return Err(Error::input(self.place_of_header(), what, "remove or rename one"));
            }
        }
        for row in &self.rows {
            if row.cells.len() != self.headers.len() {
                let what = format!("{} cells under {} column names", row.cells.len(), self.headers.len());
                let remedy = "give every row all cells; numbers need a decimal point, not a comma";
                return Err(Error::input(self.place(row), what, remedy));
            }
            for (cell, column) in row.cells.iter().zip(&self.headers) {
                plain_name(column, cell, self.place(row))?;
            }
        }
        Ok(())
    }

    /// `file:line`.
    pub fn place_of_line(&self, line: u64) -> String {
        format!("{}:{line}", self.file)
    }

    pub fn place(&self, row: &Row) -> String {
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
                Some(meant) => format!("rename \"{meant}\" to \"{name}\""),
                None => format!("add the column \"{name}\""),
            };
            Error::input(self.place_of_header(), what, remedy)
        })
    }

    /// Refuses columns that no reader asks for: a misspelt optional column would be ignored in silence.
    pub fn refuse_unknown(&self, known: &[&str]) -> Result<()> {
        match self.headers.iter().find(|h| !known.contains(&h.as_str())) {
            None => Ok(()),
            Some(name) => {
                let what = format!("unknown column \"{name}\"");
                let remedy = match closest_name(name, known.iter().copied()) {
                    Some(meant) => format!("is \"{meant}\" meant?"),
                    None => format!("known columns are: {}", known.join(", ")),
                };
                Err(Error::input(self.place_of_header(), what, remedy))
            }
        }
    }

    /// A finite number.
    pub fn number(&self, row: &Row, column: usize) -> Result<f64> {
        let cell = row.cell(column);
        match cell.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => {
                let remedy = match cell.contains(',') {
                    true => "write numbers with a decimal point",
                    false => "write a finite number",
                };
                Err(self.refuse(row, column, "is not a number", remedy))
            }
        }
    }

    /// A number, or nothing where the cell is empty or the column does not exist.
    pub fn optional_number(&self, row: &Row, column: Option<usize>) -> Result<Option<f64>> {
        match column {
            Some(column) if !row.cell(column).is_empty() => self.number(row, column).map(Some),
            _ => Ok(None),
        }
    }

    /// A marker id.
    pub fn id(&self, row: &Row, column: usize) -> Result<u32> {
        let bad = || self.refuse(row, column, "is not a marker id", "ids are whole numbers from 0 on");
        row.cell(column).parse().map_err(|_| bad())
    }

    /// Complaint about one cell.
    pub fn refuse(&self, row: &Row, column: usize, what: &str, remedy: &str) -> Error {
        let cell = row.cell(column);
        let what = match cell.is_empty() {
            true => format!("column {}: an empty cell {what}", self.headers[column]),
            false => format!("column {}: \"{cell}\" {what}", self.headers[column]),
        };
        Error::input(self.place(row), what, remedy)
    }
}

/// A table separated by semicolons or tabs is named as such instead of read as one column.
fn refuse_other_separators(file: &str, text: &str) -> Result<()> {
    let mut lines = text.lines();
    let first = lines.next().unwrap_or_default();
    let (separator, name) = match (first.contains(','), first.contains(';'), first.contains('\t')) {
        (false, true, _) => (';', "semicolons"),
        (false, _, true) => ('\t', "tabs"),
        _ => return Ok(()),
    };
    let comma =
        lines.any(|l| l.split(separator).any(|c| c.contains(',') && c.replace(',', ".").trim().parse::<f64>().is_ok()));
    let decimal = if comma { " and its numbers have a decimal comma" } else { "" };
    let what = format!("its columns are separated by {name}{decimal}");
    let remedy = "save it with commas between columns and decimal points (spreadsheet language: English)";
    Err(Error::input(format!("{file}:1"), what, remedy))
}

/// Text of a table, quoted where needed.
pub(super) fn to_csv(rows: &[Vec<String>]) -> String {
    let quoted = |cell: &String| match cell.contains([',', '"', '\n', '\r']) || cell.trim() != cell {
        true => format!("\"{}\"", cell.replace('"', "\"\"")),
        false => cell.clone(),
    };
    rows.iter().map(|row| row.iter().map(quoted).collect::<Vec<_>>().join(",") + "\n").collect()
}
