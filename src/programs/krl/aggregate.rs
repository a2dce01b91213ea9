//! Aggregates of KRL: `{E6POS: X 1.0, Y 2.0, .. S 2, T 'B1010'}`.

use std::ops::Range;

use crate::error::{Code, Error, Result};
use crate::geom::{Pose, matrix_from_rpy};
use crate::programs::codes::PostureCode;
use crate::programs::field::{Field, FieldPlace};
use crate::programs::program::{Heed, JointTarget, MeantPosture, RotationFields, Way};
use crate::programs::scan::Reader;

const MM: f64 = 1e-3;
/// Decimals of mm and of degrees.
const DECIMALS_MM: usize = 4;
const DECIMALS_DEG: usize = 6;

/// A number of an aggregate, or something that the text does not say in numbers.
#[derive(Debug, Clone, PartialEq)]
enum Element {
    Number(f64, Range<usize>),
    Word(String),
    Other,
}

/// An aggregate with its elements in the order of the text; names in capital letters.
#[derive(Debug, Clone)]
pub(super) struct Aggregate {
    pub file: usize,
    pub line: usize,
    elements: Vec<(String, Element)>,
    /// Byte before the closing brace and its blanks.
    end: usize,
}

impl Aggregate {
    /// Reads an aggregate; the reader stands on its brace and ends behind it.
    ///
    /// # Errors
    /// An element without name or value, a name that stands twice, a brace that is not closed on its line.
    pub fn read(reader: &mut Reader<'_>) -> Result<Self> {
        let (file, line) = (reader.index, reader.line());
        reader.take_mark(b'{');
        if reader.word().is_some() && reader.ahead_is_mark(1, b':') {
            reader.at += 2;
        }
        let mut aggregate = Self { file, line, elements: Vec::new(), end: 0 };
        loop {
            let Some(name) = reader.name() else {
                let what = format!("{} stands where the name of a component belongs", reader.shown());
                return Err(Error::new(
                    Code::ProgramSyntax,
                    reader.place(),
                    what,
                    "write {X 1.0,Y 2.0,...} with decimal points",
                ));
            };
            reader.at += 1;
            let name = name + &index(reader);
            if aggregate.elements.iter().any(|(n, _)| *n == name) {
                let what = format!("the component {name} stands twice");
                return Err(Error::new(Code::ProgramSyntax, reader.place(), what, "remove the one that does not hold"));
            }
            let element = element(reader, &name)?;
            aggregate.elements.push((name, element));
            aggregate.end = reader.ahead(-1).map_or(0, |t| t.range.end);
            if reader.take_mark(b'}') {
                return Ok(aggregate);
            }
            reader.take_mark(b',');
        }
    }

    fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|(n, _)| n == name).map(|(_, e)| e)
    }

    pub fn has(&self, names: &[&str]) -> bool {
        names.iter().any(|n| self.element(n).is_some())
    }

    /// A whole number.
    pub fn whole(&self, name: &str) -> Option<i64> {
        match self.element(name) {
            Some(Element::Number(value, _)) if value.fract() == 0.0 => Some(*value as i64),
            _ => None,
        }
    }

    pub fn word(&self, name: &str) -> Option<&str> {
        match self.element(name) {
            Some(Element::Word(word)) => Some(word),
            _ => None,
        }
    }

    /// True where components are variables or computed.
    pub fn is_computed(&self) -> bool {
        self.elements.iter().any(|(_, e)| !matches!(e, Element::Number(..)))
    }

    /// A number of the text, or the place where it has to be put.
    fn field(&self, name: &str, si: f64, decimals: usize) -> Field {
        let (place, written) = match self.element(name) {
            Some(Element::Number(value, range)) => (FieldPlace::At(range.clone()), *value),
            _ => (FieldPlace::Missing(self.end, format!(", {name} ")), f64::NAN),
        };
        Field { file: self.file, place, written, si, decimals }
    }

    pub fn position(&self) -> [Field; 3] {
        ["X", "Y", "Z"].map(|n| self.field(n, MM, DECIMALS_MM))
    }

    pub fn rotation(&self) -> RotationFields {
        RotationFields::Abc(["A", "B", "C"].map(|n| self.field(n, 1f64.to_radians(), DECIMALS_DEG)))
    }

    /// A frame with all its components.
    pub fn frame(&self) -> Option<Pose> {
        let value =
            |name: &str, si: f64| Some(self.field(name, si, 0)).filter(|f| f.written.is_finite()).map(|f| f.value());
        let [x, y, z] = ["X", "Y", "Z"].map(|n| value(n, MM));
        let [a, b, c] = ["A", "B", "C"].map(|n| value(n, 1f64.to_radians()));
        Some(Pose::new(matrix_from_rpy([c?, b?, a?]), [x?, y?, z?].into()))
    }

    fn code(&self, name: &str) -> Option<PostureCode> {
        match self.element(name) {
            Some(Element::Number(value, range)) => {
                Some(PostureCode { file: self.file, range: range.clone(), value: *value as i64 })
            }
            _ => None,
        }
    }

    /// Status and turn, where there are any and the robot has six axes.
    pub fn posture(&self, axes: &[usize]) -> MeantPosture {
        let (status, turn) = (self.code("S"), self.code("T"));
        match axes.get(..6).and_then(|a| <[usize; 6]>::try_from(a).ok()) {
            Some(six) if status.is_some() || turn.is_some() => {
                MeantPosture::Coded(crate::programs::codes::Codes::Krl { status, turn }, six, Way::Joints, Heed::Heeded)
            }
            _ => MeantPosture::ByWay(Way::Joints),
        }
    }

    /// Field of the `k`-th axis of the program: A1 to A6, then E1 on.
    fn axis_field(&self, k: usize, prismatic: bool) -> (String, Field) {
        let name = if k < 6 { format!("A{}", k + 1) } else { format!("E{}", k - 5) };
        let (si, decimals) = if prismatic { (MM, DECIMALS_MM) } else { (1f64.to_radians(), DECIMALS_DEG) };
        let field = self.field(&name, si, decimals);
        (name, field)
    }

    /// Axis values by reading; external axes keep theirs and have no field.
    pub fn joints(&self, axes: &[usize], prismatic: &[bool]) -> JointTarget {
        let mut target = JointTarget {
            readings: vec![f64::NAN; axes.len()],
            fields: vec![None; axes.len()],
            frames: Default::default(),
        };
        for (k, &reading) in axes.iter().enumerate() {
            let (_, field) = self.axis_field(k, prismatic[reading]);
            target.readings[reading] = field.value();
            target.fields[reading] = (k < 6).then_some(field);
        }
        target
    }

    /// The first external axis behind `axes` that is not at zero.
    pub fn foreign(&self, axes: &[usize]) -> Option<(String, f64)> {
        let foreign = self.externals().filter(|(axis, _)| is_foreign(*axis, axes));
        let mut off_zero = foreign.filter_map(|(axis, value)| Some((axis, value.filter(|v| *v != 0.0)?)));
        off_zero.next().map(|(axis, value)| (external_name(axis), value))
    }

    /// External axes that it names, by their number from 0, and where it puts them: `None` where the text does not tell.
    pub fn externals(&self) -> impl Iterator<Item = (usize, Option<f64>)> + '_ {
        let place = |element: &Element| if let Element::Number(value, _) = element { Some(*value) } else { None };
        self.elements.iter().filter_map(move |(name, element)| Some((external_axis(name)?, place(element))))
    }

    /// Values of the external axes by reading, not finite for those that are missing; `None` for the others.
    pub fn external(&self, axes: &[usize], prismatic: &[bool]) -> Vec<Option<f64>> {
        let mut fixed = vec![None; axes.len()];
        for (k, &reading) in axes.iter().enumerate().skip(6) {
            fixed[reading] = Some(self.axis_field(k, prismatic[reading]).1.value());
        }
        fixed
    }
}

/// Number from 0 of the external axis `E1` to `E6` that a component is.
pub(super) fn external_axis(name: &str) -> Option<usize> {
    let number = name.strip_prefix('E')?.parse::<usize>().ok()?;
    number.checked_sub(1)
}

/// Its name.
pub(super) fn external_name(axis: usize) -> String {
    format!("E{}", axis + 1)
}

/// True for an external axis behind those of the description.
pub(super) fn is_foreign(axis: usize, axes: &[usize]) -> bool {
    axis >= axes.len().saturating_sub(6)
}

/// `[3]` behind a name, as it belongs to the name; empty where there is none.
pub(super) fn index(reader: &mut Reader<'_>) -> String {
    if !reader.is_mark(b'[') {
        return String::new();
    }
    let Some(close) = reader.closing(reader.at) else { return String::new() };
    reader.at += 1;
    let mut text = String::from("[");
    while reader.at < close {
        text += &reader.peek().map_or(String::new(), |t| String::from_utf8_lossy(reader.text(t)).to_ascii_uppercase());
        reader.at += 1;
    }
    reader.at = close + 1;
    text + "]"
}

fn element(reader: &mut Reader<'_>, name: &str) -> Result<Element> {
    let number = reader.take_number();
    let mut element = number.map_or(Element::Other, |(value, range)| Element::Number(value, range));
    let mut start = reader.at;
    while !reader.is_mark(b',') && !reader.is_mark(b'}') {
        if reader.at_line_end() {
            let what = format!("the brace is not closed behind the component {name}");
            let place = format!("{}:{}", reader.file.name, reader.line_of(reader.at.saturating_sub(1)));
            return Err(Error::new(Code::ProgramSyntax, place, what, "close it on its line"));
        }
        let begins = reader.at == start && matches!(element, Element::Other);
        if begins && reader.is_mark(b'#') {
            // A constant of an enumeration: its name is the word behind the mark.
            reader.at += 1;
            start += 1;
        }
        if begins && let Some(word) = reader.name() {
            element = Element::Word(word);
        } else if reader.at > start || !matches!(element, Element::Other) {
            element = Element::Other;
        }
        let nested =
            matches!(reader.peek().map(|t| t.kind), Some(crate::programs::scan::TokenKind::Mark(b'{' | b'(' | b'[')));
        reader.at = if nested { reader.closing(reader.at).unwrap_or(reader.at) + 1 } else { reader.at + 1 };
    }
    if reader.at == start && matches!(element, Element::Other) {
        let what = format!("the component {name} has no value");
        return Err(Error::new(
            Code::ProgramSyntax,
            reader.place(),
            what,
            "write its number, or leave the component out",
        ));
    }
    Ok(element)
}
