//! URScript: `movej`, `movel`, `movep`, `movec` and `servoj` with joints `[..]` (rad) or poses `p[..]` (m, rotation vector in rad),
//! written in the call or in a variable, `get_inverse_kin` around a pose, and `set_tcp`.

use std::collections::BTreeMap;

use super::Setting;
use super::field::{Field, Place};
use super::itinerary::Itinerary;
use super::program::{
    JointTarget, Kind, Left, PoseTarget, Posture, Program, RotationFields, Target, TextFile, Understood,
};
use super::scan::{Dialect, Reader, TokenKind};
use crate::error::{Error, Result};
use crate::geom::{Pose, exp_so3};

const DIALECT: Dialect = Dialect { comment: b'#', quotes: b"\"'", header: None, based_numbers: false };
/// Calls that move the robot to their first arguments, and how many of them are targets.
const MOVES: [(&[u8], usize); 5] = [(b"movej", 1), (b"movel", 1), (b"movep", 1), (b"movec", 2), (b"servoj", 1)];
/// Decimals in rad and m.
const DECIMALS: usize = 8;

/// What stands where a target may stand.
#[derive(Debug, Clone)]
enum Value {
    /// `[..]` with numbers.
    Joints(Vec<Field>, usize),
    /// `p[..]` with six numbers.
    Pose(Box<[Field; 6]>, usize),
    /// Anything else.
    Expression,
}

/// Reads scripts; each file is a program of its own.
pub(super) fn read(files: Vec<TextFile>, setting: &Setting<'_>) -> Result<Program> {
    let mut way = Itinerary::new();
    for (index, file) in files.iter().enumerate() {
        way.start_afresh();
        let script = Script {
            reader: Reader::new(file, index, DIALECT)?,
            setting,
            variables: BTreeMap::new(),
            tool: setting.tool.map(Tool::Known).unwrap_or(Tool::Unknown),
            way: &mut way,
        };
        script.read()?;
    }
    let mut program = way.program;
    program.files = files;
    Ok(program)
}

/// The active tool.
#[derive(Debug, Clone, Copy)]
enum Tool {
    Known(Pose),
    Unknown,
}

struct Script<'a> {
    reader: Reader<'a>,
    setting: &'a Setting<'a>,
    /// Last value given to each variable.
    variables: BTreeMap<Vec<u8>, Value>,
    tool: Tool,
    way: &'a mut Itinerary,
}

impl Script<'_> {
    fn read(mut self) -> Result<()> {
        while !self.reader.done() {
            let at = self.reader.at;
            let Some(word) = self.reader.word() else {
                self.reader.at += 1;
                continue;
            };
            let next = self.reader.ahead(1).map(|t| t.kind);
            if let Some((_, count)) = MOVES.iter().find(|(name, _)| *name == word)
                && next == Some(TokenKind::Mark(b'('))
            {
                self.moves(*count)?;
            } else if word == b"set_tcp" && next == Some(TokenKind::Mark(b'(')) {
                self.reader.at += 2;
                let value = self.argument()?;
                self.tool = match &value {
                    Value::Pose(fields, _) => Tool::Known(pose_of(fields)),
                    _ => Tool::Unknown,
                };
            } else if next == Some(TokenKind::Mark(b'='))
                && self.reader.ahead(2).map(|t| t.kind) != Some(TokenKind::Mark(b'='))
            {
                let name = word.to_vec();
                self.reader.at += 2;
                let value = self.value()?;
                self.variables.insert(name, value);
            } else {
                self.reader.at = at + 1;
            }
        }
        Ok(())
    }

    /// A call that moves; the reader stands on its name.
    fn moves(&mut self, count: usize) -> Result<()> {
        let line = self.reader.line();
        let name = String::from_utf8_lossy(self.reader.word().unwrap_or_default()).into_owned();
        let open = self.reader.at + 1;
        let Some(close) = self.reader.closing(open) else {
            return Err(Error::input(self.reader.place(), format!("the bracket of {name}( is not closed"), "close it"));
        };
        self.reader.at = open + 1;
        for k in 0..count {
            if self.reader.at >= close {
                let what = format!("{name}(..) has {k} targets, not {count}");
                return Err(Error::input(format!("{}:{line}", self.reader.file.name), what, "complete the call"));
            }
            let (value, posture) = self.target_argument()?;
            self.visit(&name, line, value, posture)?;
            // To the next argument.
            while self.reader.at < close && !self.reader.take_mark(b',') {
                let bracket = matches!(self.reader.peek().map(|t| t.kind), Some(TokenKind::Mark(b'(' | b'[')));
                self.reader.at =
                    if bracket { self.reader.closing(self.reader.at).unwrap_or(close) } else { self.reader.at } + 1;
            }
        }
        self.reader.at = close + 1;
        Ok(())
    }

    /// An argument, `name=` before it left out, `get_inverse_kin` around it looked into.
    fn target_argument(&mut self) -> Result<(Value, Posture)> {
        self.skip_argument_name();
        let inverse = self.reader.word() == Some(b"get_inverse_kin")
            && self.reader.ahead(1).is_some_and(|t| t.kind == TokenKind::Mark(b'('));
        if !inverse {
            return Ok((self.argument()?, Posture::Nearest));
        }
        let close = self.reader.closing(self.reader.at + 1);
        self.reader.at += 2;
        self.skip_argument_name();
        let value = self.argument()?;
        let mut posture = Posture::Nearest;
        if self.reader.take_mark(b',') {
            self.skip_argument_name();
            if let Value::Joints(fields, _) = self.argument()? {
                posture = Posture::Near(self.readings(&fields));
            }
        }
        if let Some(close) = close {
            self.reader.at = close + 1;
        }
        Ok((value, posture))
    }

    fn skip_argument_name(&mut self) {
        if self.reader.word().is_some() && self.reader.ahead(1).is_some_and(|t| t.kind == TokenKind::Mark(b'=')) {
            self.reader.at += 2;
        }
    }

    /// A value that ends with the argument; anything longer is an expression.
    fn argument(&mut self) -> Result<Value> {
        let value = match self.reader.word() {
            Some(word) if word != b"p" || !self.reader.ahead(1).is_some_and(|t| t.kind == TokenKind::Mark(b'[')) => {
                self.reader.at += 1;
                self.variables.get(word).cloned().unwrap_or(Value::Expression)
            }
            _ => self.value()?,
        };
        let ends = self.reader.is_mark(b',') || self.reader.is_mark(b')');
        Ok(if ends { value } else { Value::Expression })
    }

    /// `[..]` or `p[..]`; the reader ends behind it. Anything else is an expression and is not stepped over.
    fn value(&mut self) -> Result<Value> {
        let start = self.reader.at;
        let line = self.reader.line();
        let is_pose = self.reader.word() == Some(b"p");
        self.reader.at += usize::from(is_pose);
        if !self.reader.is_mark(b'[') {
            self.reader.at = start;
            return Ok(Value::Expression);
        }
        let Some(close) = self.reader.closing(self.reader.at) else {
            return Err(Error::input(self.reader.place(), "a list [ is not closed", "close it with ]"));
        };
        self.reader.at += 1;
        let mut fields = Vec::new();
        while self.reader.at < close {
            self.reader.skip_line_ends();
            match self.element() {
                Some(field) => fields.push(field),
                None => {
                    self.reader.at = close + 1;
                    return Ok(Value::Expression);
                }
            }
            self.reader.skip_line_ends();
            if self.reader.at < close && !self.reader.take_mark(b',') {
                // A sum or another call: no plain number.
                self.reader.at = close + 1;
                return Ok(Value::Expression);
            }
        }
        self.reader.at = close + 1;
        if !is_pose {
            return Ok(Value::Joints(fields, line));
        }
        let count = fields.len();
        let fields = <[Field; 6]>::try_from(fields).map_err(|_| {
            let place = format!("{}:{line}", self.reader.file.name);
            Error::input(place, format!("a pose p[..] has 6 numbers, this one has {count}"), "x, y, z, rx, ry, rz")
        })?;
        Ok(Value::Pose(Box::new(fields), line))
    }

    /// A number, or `d2r(number)`.
    fn element(&mut self) -> Option<Field> {
        let degrees = self.reader.word() == Some(b"d2r");
        if degrees {
            self.reader.at += 1;
            self.reader.take_mark(b'(').then_some(())?;
        }
        let (written, range) = self.reader.take_number()?;
        if degrees {
            self.reader.take_mark(b')').then_some(())?;
        }
        let si = if degrees { 1f64.to_radians() } else { 1.0 };
        Some(Field { file: self.reader.index, place: Place::At(range), written, si, decimals: DECIMALS })
    }

    fn readings(&self, fields: &[Field]) -> Vec<f64> {
        let mut readings = vec![0.0; self.setting.chain.readings.len()];
        for (field, &reading) in fields.iter().zip(self.setting.axes) {
            readings[reading] = field.value();
        }
        readings
    }

    fn visit(&mut self, name: &str, line: usize, value: Value, posture: Posture) -> Result<()> {
        if let Value::Joints(fields, line) = &value
            && fields.len() != self.setting.axes.len()
        {
            let what = format!("{} joint values for the {} joints of the robot", fields.len(), self.setting.axes.len());
            return Err(Error::input(
                format!("{}:{line}", self.reader.file.name),
                what,
                "give one value for each joint",
            ));
        }
        if let Err(why) = self.take(name, value, posture) {
            // Where this move ends is not known, so the next one has no known approach.
            self.way.leave(Left { file: self.reader.index, line, name: name.to_owned(), why });
        }
        Ok(())
    }

    fn take(&mut self, name: &str, value: Value, posture: Posture) -> Understood<()> {
        let (kind, line) = match value {
            Value::Joints(fields, line) => {
                let mut by_reading = vec![None; self.setting.chain.readings.len()];
                let readings = self.readings(&fields);
                for (field, &reading) in fields.into_iter().zip(self.setting.axes) {
                    by_reading[reading] = Some(field);
                }
                (Kind::Joints(JointTarget { readings, fields: by_reading }), line)
            }
            Value::Pose(fields, line) => (Kind::Pose(Box::new(self.pose(*fields, posture)?)), line),
            Value::Expression => return Err("its target is computed, not written in numbers".into()),
        };
        let follows = self.way.follows();
        let target = Target { file: self.reader.index, line, name: name.to_owned(), follows, kind };
        if self.way.visit(target) {
            Ok(())
        } else {
            Err("it is used with different tools; give it a pose for each".into())
        }
    }

    fn pose(&self, fields: [Field; 6], posture: Posture) -> Understood<PoseTarget> {
        let Tool::Known(tool) = self.tool else {
            return Err("its tool is not known: no set_tcp(p[..]) with numbers before it; give --tool".into());
        };
        let [x, y, z, rx, ry, rz] = fields;
        let readings = self.setting.chain.readings.len();
        Ok(PoseTarget {
            position: [x, y, z],
            rotation: RotationFields::Vector([rx, ry, rz]),
            base_from_work: self.setting.work.unwrap_or_else(Pose::identity),
            flange_from_tool: tool,
            fixed: vec![None; readings],
            posture,
            joint_fields: vec![None; readings],
        })
    }
}

fn pose_of(fields: &[Field; 6]) -> Pose {
    let [x, y, z, rx, ry, rz] = fields.each_ref().map(Field::value);
    Pose::new(exp_so3(&[rx, ry, rz].into()), [x, y, z].into())
}
