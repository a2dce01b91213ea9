//! ABB RAPID: moves to `robtarget` and `jointtarget`, declared or in the instruction, with `tooldata` and `wobjdata` (mm and degrees).

mod array;
mod switched;
mod switching;
mod value;

use std::collections::BTreeMap;
use std::ops::Range;

use super::ProgramSetting;
use super::codes::{Codes, PostureCode};
use super::field::{Field, FieldPlace};
use super::flow::{Places, settled};
use super::itinerary::Itinerary;
use super::program::{
    Approach, DisplacedTarget, JointTarget, Left, MeantPosture, PoseTarget, Program, RotationFields, Target,
    TargetKind, Understood,
};
use super::reason::{LeftReason, Why};
use super::scan::{Dialect, Reader, TokenKind};
use super::text_file::TextFile;
use crate::error::{Code, Error, Result};
use crate::geom::Pose;
use crate::urdf::JointKind;
use switched::Watched;
use switching::{Now, ROUTINES, Switching};
use value::{
    Displacement, NO_AXIS, Node, array_of, check, computed, element, foreign_axis, frame, node, numbers, undeclared,
};

const DIALECT: Dialect = Dialect { comment: b'!', quotes: b"\"", header: None, based_numbers: false };
/// Beginnings of the names of instructions that move the robot to their first arguments.
const MOVES: [&str; 7] = ["MOVE", "TRIGGL", "TRIGGJ", "TRIGGC", "ARC", "SPOT", SEARCH];
/// Behind a signal and the point that is found.
const SEARCH: &str = "SEARCH";
/// Beginnings of lines in which a position in numbers is not where the robot goes.
const DECLARE: [&str; 8] = ["CONST", "PERS", "VAR", "LOCAL", "TASK", "PROC", "FUNC", "TRAP"];
/// Instructions that begin so, but move no robot.
const NO_MOVES: [&str; 2] = ["MOVEEXTJ", "ARCREFRESH"];
const TYPES: [&str; 4] = ["ROBTARGET", "JOINTTARGET", "TOOLDATA", "WOBJDATA"];
const DECIMALS_MM: usize = 4;
const DECIMALS_DEG: usize = 6;
const DECIMALS_QUATERNION: usize = 9;

/// Declared data.
#[derive(Debug, Clone)]
struct Datum {
    kind: String,
    file: usize,
    line: usize,
    /// `None` where the text does not give its numbers.
    value: Option<Node>,
}

/// Reads modules that belong together.
pub(super) fn read(files: Vec<TextFile>, setting: &ProgramSetting<'_>) -> Result<Program> {
    let program = settled(|known| reading(&files, setting, known))?;
    Ok(Program { files, ..program })
}

/// One reading, with what the one before found, and what it found itself.
fn reading(files: &[TextFile], setting: &ProgramSetting<'_>, known: Places<Now>) -> Result<(Program, Places<Now>)> {
    let mut task = Task {
        setting,
        data: BTreeMap::new(),
        bases: BTreeMap::new(),
        switching: Switching::new(known),
        way: Itinerary::new(),
    };
    for (index, file) in files.iter().enumerate() {
        task.declarations(Reader::new(file, index, DIALECT)?)?;
        task.switching.look_through(Reader::new(file, index, DIALECT)?);
    }
    for (index, file) in files.iter().enumerate() {
        task.way.start_afresh();
        task.moves(Reader::new(file, index, DIALECT)?)?;
        task.switching.all_end();
    }
    task.unvisited()?;
    Ok((task.way.program, task.switching.found()))
}

struct Task<'a> {
    setting: &'a ProgramSetting<'a>,
    data: BTreeMap<String, Datum>,
    /// Points from which displaced ones start: how they would be visited.
    bases: BTreeMap<String, Target>,
    /// What instructions switch for those behind them.
    switching: Switching,
    way: Itinerary,
}

/// To behind the next semicolon.
fn skip_statement(reader: &mut Reader<'_>) {
    while !reader.done() && !reader.take_mark(b';') {
        reader.at += 1;
    }
}

/// True where a robtarget is written in the rest of a line that sets no data.
fn has_literal(reader: &mut Reader<'_>) -> Result<bool> {
    let start = reader.at;
    let mut found = false;
    while !found && !reader.at_line_end() && !reader.is_mark(b';') {
        let assigned = reader.is_mark(b':') && reader.ahead_is_mark(1, b'=') && !reader.ahead_is_mark(-2, b'\\');
        if assigned {
            break;
        }
        let nested = reader.is_mark(b'[') && reader.ahead_is_mark(1, b'[');
        let at = reader.at;
        found = nested && node(reader)?.is_robtarget();
        reader.at = at + 1;
    }
    reader.at = start;
    Ok(found)
}

impl Task<'_> {
    /// All data of a file, and assignments to them.
    fn declarations(&mut self, mut reader: Reader<'_>) -> Result<()> {
        while !reader.done() {
            let Some(word) = reader.name() else {
                reader.at += 1;
                continue;
            };
            reader.at += 1;
            if TYPES.contains(&word.as_str()) && reader.word().is_some() {
                self.declaration(&mut reader, word)?;
            } else if self.data.contains_key(&word) {
                let is_value = reader.ahead_is_mark(-2, b'\\');
                element(&mut reader, String::new());
                let assigned = reader.is_mark(b':') && reader.ahead_is_mark(1, b'=');
                let component = reader.is_mark(b'.');
                if (assigned && !is_value) || component {
                    self.is_assigned(&word);
                }
            }
        }
        Ok(())
    }

    /// `TYPE name := value;` behind its type.
    fn declaration(&mut self, reader: &mut Reader<'_>, kind: String) -> Result<()> {
        let (Some(name), line) = (reader.name(), reader.line()) else { return Ok(()) };
        reader.at += 1;
        let is_array = reader.is_mark(b'{');
        let has_rows = is_array && reader.ahead_is_mark(2, b'}');
        element(reader, String::new());
        let has_value = reader.is_mark(b':') && reader.ahead_is_mark(1, b'=');
        let mut value = None;
        if has_value && (has_rows || !is_array) {
            reader.at += 2;
            reader.skip_line_ends();
            let (place, read) = (reader.place(), node(reader)?);
            reader.skip_line_ends();
            if !reader.is_mark(b';') {
                let what = format!("{name} does not end with a semicolon");
                return Err(Error::new(Code::ProgramSyntax, place, what, "write TYPE name:=[..];"));
            }
            if !is_array {
                check(&kind, &name, &read, &place)?;
            }
            value = Some((read, place));
        }
        let twin = self.data.get(&name);
        if let Some(twin) = twin.filter(|t| t.file != reader.index) {
            let what = format!("{name} is declared in {} already", twin.line);
            return Err(Error::new(
                Code::ProgramTwin,
                reader.place(),
                what,
                "correct modules with equal names one after the other",
            ));
        }
        // Two data of one name in one file belong to different routines.
        let datum = Datum { kind, file: reader.index, line, value: None };
        let is_twin = twin.is_some();
        if is_twin {
            self.is_assigned(&name);
        } else if let (true, Some((rows, place))) = (is_array, &value) {
            self.elements_declared(&name, &datum, rows, place)?;
        }
        let value = value.filter(|_| !is_twin && !is_array).map(|(value, _)| value);
        self.data.insert(name, Datum { value, ..datum });
        Ok(())
    }

    fn moves(&mut self, mut reader: Reader<'_>) -> Result<()> {
        while !reader.done() {
            let Some(word) = reader.name() else {
                reader.at += 1;
                continue;
            };
            let begins = reader.at == 0
                || matches!(reader.ahead(-1).map(|t| t.kind), Some(TokenKind::LineEnd | TokenKind::Mark(b';' | b':')));
            let moves = MOVES.iter().any(|m| word.starts_with(m)) && !NO_MOVES.contains(&word.as_str());
            let follows = reader.ahead(1).map(|t| t.kind);
            let called = !matches!(follows, Some(TokenKind::Mark(b':' | b'(' | b';') | TokenKind::LineEnd));
            if begins && moves && called {
                self.instruction(&mut reader)?;
                skip_statement(&mut reader);
            } else {
                if begins && !DECLARE.contains(&word.as_str()) && has_literal(&mut reader)? {
                    let words = format!("a position stands in it, and what {word} does with it is not known");
                    self.leave((reader.index, reader.line()), &word, Why::new(LeftReason::NotATarget, words));
                }
                reader.at += if begins || ROUTINES.contains(&word.as_str()) {
                    self.switching.statement(&reader, &word, &mut self.way)
                } else {
                    self.switching.behind_condition(&word, &mut self.way);
                    1
                };
            }
        }
        Ok(())
    }

    /// A move; the reader stands on its name.
    fn instruction(&mut self, reader: &mut Reader<'_>) -> Result<()> {
        let line = reader.line();
        let name = String::from_utf8_lossy(reader.word().unwrap_or_default()).into_owned();
        reader.at += 1;
        let mut arguments = Vec::new();
        let mut work = None;
        let mut nothing = true;
        let mut plain = Vec::new();
        loop {
            reader.skip_line_ends();
            if reader.done() || (nothing && reader.is_mark(b';')) {
                let what = format!("{name} does not end with a semicolon");
                return Err(Error::new(
                    Code::ProgramSyntax,
                    format!("{}:{line}", reader.file.name),
                    what,
                    "complete the instruction",
                ));
            }
            if reader.take_mark(b'\\') {
                let switch = reader.name().unwrap_or_default();
                reader.at += 1;
                if reader.take_mark(b':') && reader.take_mark(b'=') {
                    let value = node(reader)?;
                    if switch == "WOBJ" {
                        work = Some(value);
                    }
                }
                continue;
            }
            if reader.is_mark(b';') {
                break;
            }
            if reader.take_mark(b',') {
                continue;
            }
            nothing = false;
            arguments.push(node(reader)?);
            plain.push(true);
            // What follows up to the comma makes it an expression.
            while !matches!(
                reader.peek().map(|t| t.kind),
                None | Some(TokenKind::Mark(b',' | b';' | b'\\') | TokenKind::LineEnd)
            ) {
                let open = matches!(reader.peek().map(|t| t.kind), Some(TokenKind::Mark(b'(' | b'[' | b'{')));
                reader.at = if open { reader.closing(reader.at).unwrap_or(reader.at) + 1 } else { reader.at + 1 };
                if let Some(last) = plain.last_mut() {
                    *last = false;
                }
            }
        }
        if name.to_ascii_uppercase().starts_with(SEARCH) {
            arguments.drain(..arguments.len().min(2));
            plain.drain(..plain.len().min(2));
        }
        let count = self.targets_of(&name, &arguments);
        let tool = self.tool_of(&arguments, count);
        for k in 0..count {
            let done = match plain[k] {
                true => self.visit(&arguments[k], &name, (reader.index, line), &tool, work.as_ref())?,
                false => Err(Why::computed()),
            };
            if let Err(why) = done {
                self.leave((reader.index, line), &name, why);
            }
        }
        Ok(())
    }

    /// Number of arguments that are targets: two for circles.
    fn targets_of(&self, name: &str, arguments: &[Node]) -> usize {
        let name = name.to_ascii_uppercase();
        let circle = ["MOVEC", "TRIGGC", "ARCC", "SPOTC", "SEARCHC"].iter().any(|c| name.starts_with(c));
        (1 + usize::from(circle)).min(arguments.len())
    }

    /// Name of the tool: the argument that is one, else that behind speed and zone.
    fn tool_of(&self, arguments: &[Node], targets: usize) -> Option<String> {
        let word = |n: &Node| if let Node::Word(w) = n { Some(w.clone()) } else { None };
        let is_tool = |w: &String| w == "TOOL0" || self.data.get(w).is_some_and(|d| d.kind == "TOOLDATA");
        let rest = arguments.get(targets..).unwrap_or_default();
        rest.iter().filter_map(word).find(is_tool).or_else(|| rest.get(2).and_then(word))
    }

    fn leave(&mut self, (file, line): (usize, usize), name: &str, why: Why) {
        // Confdata may mean another posture, but on a path of the tool it goes on.
        let upper = name.to_ascii_uppercase();
        let same_posture =
            !upper.starts_with("MOVEJ") && !upper.starts_with("MOVEABSJ") && !upper.starts_with("TRIGGJ");
        self.way.leave(Left { file, line, name: name.to_owned(), why }, same_posture);
        self.switching.moved(&self.way);
    }

    fn visit(
        &mut self,
        value: &Node,
        name: &str,
        from: (usize, usize),
        tool: &Option<String>,
        work: Option<&Node>,
    ) -> Result<Understood<()>> {
        if let Node::DisplacedTarget(displaced) = value {
            return Ok(self.displaced(displaced, name, from, tool.as_deref(), work));
        }
        let (value, place, named) = match value {
            Node::List(_) => {
                let place = format!("{}:{}", "the instruction in line", from.1);
                let kind = if name.to_ascii_uppercase().starts_with("MOVEABSJ") { "JOINTTARGET" } else { "ROBTARGET" };
                check(kind, name, value, &place)?;
                (value.clone(), from, name.to_owned())
            }
            Node::Word(word) => match (word.strip_suffix("{}"), self.declared(word)) {
                (Some(array), _) => return self.visit_any(array, name, from, tool, work),
                (_, Ok((value, place))) => (value, place, word.clone()),
                (_, Err(why)) => return Ok(Err(why)),
            },
            _ => return Ok(Err(Why::computed())),
        };
        let kind = self.kind(&value, place.0, tool.as_deref(), work);
        let about = |why: Why| Why { about: Some(named.clone()), ..why };
        Ok(kind.map_err(about).and_then(|kind| self.add(named, place, self.with_posture(kind, name))))
    }

    /// The numbers of a declared target, and where they stand: file and line.
    fn declared(&self, word: &str) -> Understood<(Node, (usize, usize))> {
        match self.data.get(word) {
            Some(Datum { value: Some(value), file, line, .. }) => Ok((value.clone(), (*file, *line))),
            Some(_) => Err(computed(word)),
            None if array_of(word).is_some_and(|array| self.data.contains_key(array)) => Err(computed(word)),
            None => Err(undeclared(word)),
        }
    }

    /// The posture that a kind of move gives a target.
    fn with_posture(&self, kind: TargetKind, name: &str) -> TargetKind {
        let TargetKind::Pose(mut pose) = kind else { return kind };
        let upper = name.to_ascii_uppercase();
        let of_joints = upper.starts_with("MOVEJ") || upper.starts_with("TRIGGJ") || upper.ends_with('J');
        let near = if upper.starts_with("MOVEL") { MeantPosture::Along } else { MeantPosture::Nearest };
        pose.posture = match (self.switching.now().watched[usize::from(!of_joints)].value, pose.posture) {
            (Watched::Off, _) => near,
            (Watched::Unknown, MeantPosture::Coded(codes, axes)) => MeantPosture::Either(codes, axes),
            (_, posture) => posture,
        };
        TargetKind::Pose(pose)
    }

    /// A move to `Offs(p, ..)` or `RelTool(p, ..)`.
    fn displaced(
        &mut self,
        displaced: &Displacement,
        name: &str,
        from: (usize, usize),
        tool: Option<&str>,
        work: Option<&Node>,
    ) -> Understood<()> {
        let point = &displaced.point;
        let by = displaced
            .by
            .clone()
            .ok_or_else(|| Why::new(LeftReason::Computed, "its displacement is computed, not written in numbers"))?;
        let (value, (file, line)) = self.declared(point)?;
        let base = self.kind(&value, file, tool, work)?;
        let base = self.with_posture(base, name);
        let place = (file, base.first_byte());
        let TargetKind::Pose(mut pose) = base.clone() else {
            return Err(Why::of(point, LeftReason::NotATarget, format!("{point} is no robtarget")));
        };
        let field = |(written, range): (f64, Range<usize>), si: f64, decimals: usize| Field {
            file: displaced.file,
            place: FieldPlace::At(range),
            written,
            si,
            decimals,
        };
        let turn = |k: usize| match displaced.turned[k].clone() {
            Some(number) => field(number, 1f64.to_radians(), DECIMALS_DEG),
            None => {
                let words = format!("\\R{}:=", ["x", "y", "z"][k]);
                let place = FieldPlace::Missing(displaced.missing_at[k], words);
                Field { file: displaced.file, place, written: 0.0, si: 1f64.to_radians(), decimals: DECIMALS_DEG }
            }
        };
        pose.displaced = Some(DisplacedTarget {
            base: place,
            by: by.map(|n| field(n, 1e-3, DECIMALS_MM)),
            turned: displaced.of_tool.then(|| [0, 1, 2].map(turn)),
        });
        let index = self.way.program.targets.len();
        let words = if displaced.of_tool { "RelTool" } else { "Offs" };
        self.add(format!("{words}({point})"), from, TargetKind::Pose(pose))
            .map_err(|why| Why { about: Some(point.clone()), ..why })?;
        // Its posture is that of the displaced point, where nothing else tells it.
        let approach = Approach::Beyond(index);
        let target = Target { file, line, name: point.clone(), approach, visited: false, kind: base };
        self.bases.entry(point.clone()).or_insert(target);
        Ok(())
    }

    fn add(&mut self, name: String, (file, line): (usize, usize), kind: TargetKind) -> Understood<()> {
        let clash = format!("{name} is used with different tools or work objects; give it a robtarget for each");
        let named = name.clone();
        let target = Target { file, line, name, approach: Approach::Unknown, visited: true, kind };
        let visited = self.way.visit(target);
        self.switching.moved(&self.way);
        if visited { Ok(()) } else { Err(Why::of(&named, LeftReason::FramesDiffer, clash)) }
    }

    fn kind(&self, value: &Node, file: usize, tool: Option<&str>, work: Option<&Node>) -> Understood<TargetKind> {
        let Node::List(parts) = value else {
            return Err(Why::new(LeftReason::NotATarget, "it is no robtarget and no jointtarget"));
        };
        let external = parts.last().and_then(numbers::<6>).unwrap_or_default();
        if parts.len() == 2 {
            return Ok(TargetKind::Joints(self.joints(&parts[0], &external, file)?));
        }
        if self.switching.now().displaced.value {
            let words = "a program displacement (PDispOn, PDispSet) may be active";
            return Err(Why::new(LeftReason::FrameUnknown, words));
        }
        let computed = || Why::new(LeftReason::Computed, "it is computed, not written in numbers");
        let trans = numbers::<3>(&parts[0]).ok_or_else(computed)?;
        let [w, x, y, z] = numbers::<4>(&parts[1]).ok_or_else(computed)?;
        let cf = numbers::<4>(&parts[2]).ok_or_else(computed)?;
        let field = |(written, range): (f64, Range<usize>), si: f64, decimals: usize| Field {
            file,
            place: FieldPlace::At(range),
            written,
            si,
            decimals,
        };
        let axes = self.setting.axes;
        let posture = match axes.get(..6).and_then(|a| <[usize; 6]>::try_from(a).ok()) {
            None => MeantPosture::Nearest,
            Some(six) => {
                let cf = cf.map(|(value, range)| PostureCode { file, range, value: value as i64 });
                MeantPosture::Coded(Codes::Rapid(Box::new(cf)), six)
            }
        };
        if let Some((axis, value)) = foreign_axis(&external, axes.len()).filter(|_| !self.setting.axes_apart) {
            return Err(Why::external(&axis, value));
        }
        let has_external = external.iter().any(|(value, _)| *value < NO_AXIS);
        if self.switching.now().offset.value && has_external && !self.setting.axes_apart {
            let words = "an offset of external axes (EOffsOn, EOffsSet) may be active";
            return Err(Why::new(LeftReason::ExternalAxis, words));
        }
        let mut fixed = vec![None; axes.len()];
        for (&reading, (value, _)) in axes.iter().skip(6).zip(&external) {
            fixed[reading] = (*value < NO_AXIS).then_some(value * self.unit(reading).0);
        }
        Ok(TargetKind::Pose(Box::new(PoseTarget {
            position: trans.map(|t| field(t, 1e-3, DECIMALS_MM)),
            rotation: RotationFields::Quaternion([x, y, z, w].map(|q| field(q, 1.0, DECIMALS_QUATERNION))),
            base_from_work: self.setting.base * self.work(work)?,
            flange_from_tool: self.tool(tool)?,
            fixed,
            posture,
            taught: None,
            displaced: None,
            joint_fields: vec![None; axes.len()],
        })))
    }

    /// SI value and decimals of a reading's unit.
    fn unit(&self, reading: usize) -> (f64, usize) {
        match self.setting.chain.reading_kinds[reading] {
            JointKind::Prismatic => (1e-3, DECIMALS_MM),
            _ => (1f64.to_radians(), DECIMALS_DEG),
        }
    }

    fn joints(&self, axes: &Node, external: &[(f64, Range<usize>); 6], file: usize) -> Understood<JointTarget> {
        let values = numbers::<6>(axes)
            .ok_or_else(|| Why::new(LeftReason::Computed, "it is computed, not written in numbers"))?;
        let n = self.setting.axes.len();
        let mut target = JointTarget { readings: vec![f64::NAN; n], fields: vec![None; n] };
        for (&reading, (written, range)) in self.setting.axes.iter().zip(values.iter().chain(external)) {
            if *written >= NO_AXIS {
                continue;
            }
            let (si, decimals) = self.unit(reading);
            target.readings[reading] = written * si;
            let place = FieldPlace::At(range.clone());
            target.fields[reading] = Some(Field { file, place, written: *written, si, decimals });
        }
        Ok(target)
    }

    fn datum(&self, name: &str, kind: &str, flag: &str, reason: LeftReason) -> Understood<&Node> {
        let of_kind = self.data.get(name).filter(|d| d.kind == kind);
        let missing = || {
            let words = format!("{name} is not written in numbers in the files (give its module as well, or {flag})");
            Why::new(reason, words)
        };
        of_kind.and_then(|d| d.value.as_ref()).ok_or_else(missing)
    }

    fn tool(&self, name: Option<&str>) -> Understood<Pose> {
        let read = || {
            let unknown = |words: String| Why::new(LeftReason::ToolUnknown, words);
            let name = name.ok_or_else(|| unknown("its tool is not named; give --tool".into()))?;
            if name == "TOOL0" {
                return Ok(Pose::identity());
            }
            let numbers = || unknown(format!("{name} is not written in numbers"));
            let found = self.datum(name, "TOOLDATA", "--tool", LeftReason::ToolUnknown)?;
            let Node::List(parts) = found else { return Err(numbers()) };
            match parts.first() {
                Some(Node::Word(w)) if w == "TRUE" => {}
                _ => return Err(unknown(format!("{name} is a tool fixed in the room"))),
            }
            parts.get(1).and_then(frame).ok_or_else(numbers)
        };
        read().or_else(|why| self.setting.tool.ok_or(why))
    }

    fn work(&self, name: Option<&Node>) -> Understood<Pose> {
        let name = match name {
            None => return Ok(self.setting.work.unwrap_or_else(Pose::identity)),
            Some(Node::Word(name)) if name == "WOBJ0" => return Ok(Pose::identity()),
            Some(Node::Word(name)) => name,
            Some(_) => return Err(Why::new(LeftReason::FrameUnknown, "its work object is computed")),
        };
        let read = || {
            let unknown = |words: &str| Why::new(LeftReason::FrameUnknown, format!("{name} {words}"));
            let found = self.datum(name, "WOBJDATA", "--work", LeftReason::FrameUnknown)?;
            let Node::List(parts) = found else { return Err(unknown("is not written in numbers")) };
            match (parts.first(), parts.get(1)) {
                (Some(Node::Word(held)), Some(Node::Word(fixed))) if held == "FALSE" && fixed == "TRUE" => {}
                _ => return Err(unknown("is held by the robot or moved by a unit")),
            }
            let frames = parts.get(3).and_then(frame).zip(parts.get(4).and_then(frame));
            frames.map(|(user, object)| user * object).ok_or_else(|| unknown("is not written in numbers"))
        };
        read().or_else(|why| self.setting.work.ok_or(why))
    }

    /// Declared targets to which no move of the files goes.
    fn unvisited(&mut self) -> Result<()> {
        let all: Vec<(String, Datum)> = self.data.iter().map(|(n, d)| (n.clone(), d.clone())).collect();
        for (name, datum) in all.into_iter().filter(|(_, d)| d.kind.ends_with("TARGET")) {
            let seen =
                self.way.program.targets.iter().any(|t| t.file == datum.file && t.line == datum.line && t.name == name);
            let some = array_of(&name).map(|array| format!("{array}{{}}"));
            let about = |left: &Left| left.why.about.as_ref().is_some_and(|a| *a == name || Some(a) == some.as_ref());
            let known = self.way.program.left.iter().any(about);
            let Some(value) = datum.value.filter(|_| !seen && (!known || self.bases.contains_key(&name))) else {
                continue;
            };
            let place = (datum.file, datum.line);
            if let Some(base) = self.bases.remove(&name) {
                self.way.declare(base);
                continue;
            }
            let done = self.kind(&value, datum.file, None, None).map(|kind| {
                let (file, line, approach) = (place.0, place.1, Approach::Unknown);
                self.way.declare(Target { file, line, name: name.clone(), approach, visited: true, kind });
            });
            if let Err(why) = done {
                let words = format!("no move of the files goes there, and {}", why.words);
                self.leave(place, &name, Why::new(LeftReason::Unvisited, words));
            }
        }
        Ok(())
    }
}
