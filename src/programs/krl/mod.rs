//! KUKA KRL, `.src` with its `.dat`: motions to `E6POS`, `POS`, `FRAME`, `E6AXIS` and `AXIS`, `$TOOL` and `$BASE` (mm and degrees).

mod aggregate;
mod assigned;
mod beside;
mod called;
mod calls;
mod copies;
mod external;
mod frames;
mod given;
mod motions;
mod moves;
mod off_zero;
mod orientation;
mod reads;
mod scopes;
mod stated;
mod unvisited;
mod uses;

use std::collections::BTreeMap;
use std::path::Path;

use aggregate::{Aggregate, index};
use assigned::{Assigned, assigned};
use calls::{is_beside, routine_name};
use frames::{Active, FrameIs, Frames, OwnFrames};
use given::Given;
use moves::{MOVES, RELATIVE, begins_spline, is_seen_from_null};
use scopes::Scopes;
use uses::Uses;

use super::ProgramSetting;
use super::external::{OffZero, PutAnywhere};
use super::flow::{Branching, Flow, Places, settled};
use super::itinerary::{Itinerary, Stands};
use super::names::{plain_error, plain_names};
use super::program::{JointTarget, Left, PoseTarget, Program, TargetKind, Understood};
use super::reason::{LeftReason, Why};
use super::references::References;
use super::routines::Routines;
use super::scan::{Dialect, Reader, TokenKind};
use super::text_file::TextFile;
use crate::error::{Code, Error, Result};
use crate::geom::Pose;
use crate::urdf::JointKind;

const DIALECT: Dialect =
    Dialect { comment: b';', quotes: b"\"", header: Some(b'&'), based_numbers: true, latin_letters: false };
const POSE_NAMES: [&str; 8] = ["X", "Y", "Z", "A", "B", "C", "S", "T"];
const AXIS_NAMES: [&str; 6] = ["A1", "A2", "A3", "A4", "A5", "A6"];

const EXTERNAL_NAMES: [&str; 6] = ["E1", "E2", "E3", "E4", "E5", "E6"];

/// What a name stands for.
#[derive(Debug, Clone)]
enum Value {
    Aggregate(Aggregate),
    /// Another name.
    Name(String),
    /// What another name held when a statement copied it, and the name with which its numbers stand in the text.
    Copied(Understood<(Aggregate, String)>),
    Expression,
}

/// Reads a module of one or more files.
pub(super) fn read(files: Vec<TextFile>, setting: &ProgramSetting<'_>) -> Result<Program> {
    let mut scopes = Scopes::new(&files);
    for (index, file) in files.iter().enumerate().filter(|(_, file)| !has_moves(file)) {
        scopes.look_through(Reader::new(file, index, DIALECT)?, is_of_program(file));
    }
    let program = settled(|known| reading(&files, &scopes, setting, known)).map_err(plain_error)?;
    Ok(Program { files, ..plain_names(program) })
}

/// True for the data list of a program; those of the controller begin with `$`.
fn is_of_program(file: &TextFile) -> bool {
    let name = Path::new(&file.name).file_name();
    name.is_some_and(|name| !name.to_string_lossy().starts_with('$'))
}

fn has_moves(file: &TextFile) -> bool {
    !file.name.to_ascii_lowercase().ends_with(".dat")
}

/// True for data lists other than the configuration of the controller.
fn declares_targets(file: &TextFile) -> bool {
    !has_moves(file) && !file.name.to_ascii_lowercase().ends_with("$config.dat")
}

/// Routines of all files.
fn routines(files: &[TextFile]) -> Result<Routines> {
    let mut all = Routines::default();
    for (index, file) in files.iter().enumerate().filter(|(_, file)| has_moves(file)) {
        calls::routines_in(Reader::new(file, index, DIALECT)?, &mut all);
    }
    Ok(all)
}

/// One reading, with what the one before found, and what it found itself.
fn reading(
    files: &[TextFile],
    scopes: &Scopes,
    setting: &ProgramSetting<'_>,
    known: Places<Now>,
) -> Result<(Program, Places<Now>)> {
    let reader = |index: usize, file| Reader::renamed(file, index, DIALECT, |reader| scopes.names(reader));
    let mut module = Module::new(files, setting, known)?;
    module.look_through(files, reader)?;
    // Data first: programs use them in whatever order the files are given.
    for wanted in [false, true] {
        for (index, file) in files.iter().enumerate().filter(|(_, f)| has_moves(f) == wanted) {
            module.file(reader(index, file)?)?;
        }
    }
    module.unvisited();
    module.given_away(|file| has_moves(&files[file]));
    let si = |reading: usize| if module.prismatic[reading] { 1e-3 } else { 1f64.to_radians() };
    module.way.program.put = module.put_anywhere.by_reading(setting.axes, si);
    Ok((module.way.finished(), module.flow.found()))
}

/// Frames that statements have set, and where the robot stands.
type Now = (Active, Stands);

/// Nothing set, and nothing moved.
fn unset() -> Now {
    (Active::unset(), Stands::default())
}

struct Module<'a> {
    setting: &'a ProgramSetting<'a>,
    prismatic: Vec<bool>,
    values: BTreeMap<String, Value>,
    /// What of them changes.
    assigned: Assigned,
    /// What statements do with names beside going there.
    uses: Uses,
    /// Positions declared in data files that are no data of the controller: name, file, line.
    declared: Vec<(String, usize, usize)>,
    /// `$ROBROOT`: the foot of the robot in the world, of which `$BASE` is a part.
    root: FrameIs,
    now: Now,
    /// How they change.
    flow: Flow<Now>,
    /// Motion data (`FDAT_ACT`): `None` where nothing stated them, of those that were none where they are in none of the files.
    motion_data: Option<Option<Aggregate>>,
    /// Whether the tool keeps its orientation by the data of a path (`LDAT_ACT`); `None` where nothing stated them.
    path_data: Option<bool>,
    /// Where the files put external axes.
    put_anywhere: PutAnywhere,
    /// External axes that the files put elsewhere than at zero.
    off_zero_anywhere: OffZero,
    /// Frames of the spline block that is open.
    spline: Option<OwnFrames>,
    /// True where an interrupt may leave the routines that it has come upon.
    resumes: bool,
    /// Names that the routine has copied before any statement of the text above gave them a value, with their copies.
    copies: BTreeMap<String, Vec<String>>,
    /// True before the first routine of the only file with motions: where no other calls it, the program begins with it.
    begins: bool,
    /// Variables that routines in none of the files are given.
    given: Vec<Given>,
    way: Itinerary,
}

impl<'a> Module<'a> {
    /// Before any statement.
    fn new(files: &[TextFile], setting: &'a ProgramSetting<'a>, known: Places<Now>) -> Result<Self> {
        Ok(Self {
            setting,
            prismatic: setting.chain.reading_kinds.iter().map(|k| *k == JointKind::Prismatic).collect(),
            values: BTreeMap::new(),
            assigned: Assigned::default(),
            uses: Uses::default(),
            declared: Vec::new(),
            root: FrameIs::Unset,
            now: unset(),
            flow: Flow::new(known).among(&routines(files)?),
            motion_data: None,
            path_data: None,
            put_anywhere: PutAnywhere::default(),
            off_zero_anywhere: OffZero::default(),
            spline: None,
            resumes: false,
            copies: BTreeMap::new(),
            begins: files.iter().filter(|file| has_moves(file)).count() == 1,
            given: Vec::new(),
            way: Itinerary::new(),
        })
    }

    /// What statements of any file do, wherever they stand.
    fn look_through<'f>(
        &mut self,
        files: &'f [TextFile],
        reader: impl Fn(usize, &'f TextFile) -> Result<Reader<'f>>,
    ) -> Result<()> {
        let mut references = References::default();
        for (index, file) in files.iter().enumerate() {
            self.assigned.look_through(reader(index, file)?, !has_moves(file));
            off_zero::look_through(&mut self.put_anywhere, reader(index, file)?);
            if has_moves(file) {
                self.uses.look_through(reader(index, file)?);
                self.resumes |= calls::resumes(reader(index, file)?);
                calls::look_through(&mut references, reader(index, file)?);
            }
        }
        // It is taken that it moves external axes of the description, where that has any.
        let lacks_all = self.setting.external_axes() == 0;
        for (index, file) in files.iter().enumerate().filter(|(_, file)| lacks_all && has_moves(file)) {
            off_zero::goes_beside(&mut self.put_anywhere, reader(index, file)?, |name| self.assigned.sets(name));
        }
        self.off_zero_anywhere = self.put_anywhere.off_zero();
        self.assigned.changed_by_calls(&references);
        Ok(())
    }
}

impl Module<'_> {
    fn file(&mut self, mut reader: Reader<'_>) -> Result<()> {
        let moves = has_moves(reader.file);
        self.start_afresh();
        self.flow.file_begins(reader.index);
        (self.now, self.motion_data, self.path_data, self.spline) = (self.begun(), None, None, None);
        while !reader.done() {
            let Some(word) = reader.name() else {
                reader.skip_line();
                continue;
            };
            if moves {
                self.calls(&mut reader);
            }
            if moves && begins_spline(&reader) {
                // Frames of a spline block hold for all of it.
                self.spline = Some(self.with(&mut reader));
            } else if moves && reader.ahead_is_mark(1, b':') {
                self.label();
            } else if moves && let Some((_, count)) = MOVES.iter().find(|(name, _)| *name == word) {
                self.motion(&mut reader, &word, *count)?;
            } else if moves && RELATIVE.contains(&word.as_str()) {
                let why = Why::new(LeftReason::Relative, "it is relative to the position before");
                self.leave_at(reader.index, reader.line(), &word, why);
                self.goes_untold();
                self.time_passes();
            } else if moves && off_zero::BESIDE.contains(&word.as_str()) {
                self.goes_untold();
                self.way.may_go(&mut self.now.1);
            } else if moves && is_beside(&reader) {
                self.sets_beside(&mut reader);
            } else if moves && self.flow(&reader, &word) {
            } else if moves && word == "BAS" {
                self.bas(&mut reader);
            } else {
                self.waits(&word);
                self.assignment(&mut reader)?;
            }
            reader.skip_line();
        }
        Ok(())
    }

    /// `[DECL] [GLOBAL] [TYPE] NAME[n] = value`.
    fn assignment(&mut self, reader: &mut Reader<'_>) -> Result<()> {
        let (file, line) = (reader.index, reader.line());
        let Some((name, component)) = assigned(reader) else { return Ok(()) };
        if name == "$IPO_MODE" {
            let mode = self.ipo_mode(reader);
            self.now.0.ipo_mode.set(mode);
            return Ok(());
        }
        if name == "$ORI_TYPE" {
            let keeps = self.keeps_orientation(reader);
            self.now.0.keeps_orientation.set(keeps);
            return Ok(());
        }
        let coupled = FrameIs::coupled(reader);
        let value = match component {
            true => Value::Expression,
            false => self.value(reader)?,
        };
        match name.as_str() {
            "$TOOL" => self.now.0.tool.set(self.frame(&value)),
            "$BASE" => self.now.0.base.set(coupled.unwrap_or_else(|| self.frame(&value))),
            "$ROBROOT" => self.root = self.frame(&value),
            "FDAT_ACT" => self.use_data(&value),
            "LDAT_ACT" => self.path_data = Some(self.keeps_by_data(&value)),
            _ => {
                if declares_targets(reader.file)
                    && let Value::Aggregate(a) = &value
                    && (a.has(&["S", "T"]) || a.has(&AXIS_NAMES))
                {
                    self.declared.push((name.clone(), file, line));
                }
                self.refuse_twins(&name, &value, reader)?;
                let value = if has_moves(reader.file) { self.copied(&name, value) } else { value };
                self.values.insert(name, value);
            }
        }
        Ok(())
    }

    /// Modules have names of their own: two of them cannot be read together.
    fn refuse_twins(&self, name: &str, value: &Value, reader: &Reader<'_>) -> Result<()> {
        match (self.values.get(name), value) {
            (Some(Value::Aggregate(a)), Value::Aggregate(b)) if a.file != b.file && !self.assigned.changes(name) => {
                let what = format!("{name} has a value in another of the files already");
                Err(Error::new(Code::ProgramTwin, reader.place(), what, "correct modules one after the other"))
            }
            _ => Ok(()),
        }
    }

    /// An aggregate, a name, or anything else; the reader ends behind it or somewhere before the end of the line.
    fn value(&self, reader: &mut Reader<'_>) -> Result<Value> {
        if is_seen_from_null(reader) {
            reader.at += 2;
        }
        let value = if reader.is_mark(b'{') {
            Value::Aggregate(Aggregate::read(reader)?)
        } else if let Some(word) = reader.name() {
            reader.at += 1;
            Value::Name(word + &index(reader))
        } else {
            Value::Expression
        };
        let next = reader.peek().map(|t| t.kind);
        let ends = reader.at_line_end() || next == Some(TokenKind::Mark(b',')) || next == Some(TokenKind::Word);
        Ok(if ends { value } else { Value::Expression })
    }

    /// The aggregate behind a value, through names.
    fn resolved<'v>(&'v self, value: &'v Value) -> Understood<(&'v Aggregate, Option<&'v str>)> {
        let mut value = value;
        let mut name = None;
        for _ in 0..8 {
            match value {
                Value::Aggregate(a) if a.is_computed() && !a.has(&["IPO_FRAME"]) => break,
                Value::Aggregate(a) => return Ok((a, name)),
                Value::Copied(Ok((a, origin))) => return Ok((a, Some(origin))),
                Value::Copied(Err(why)) => return Err(why.clone()),
                Value::Name(n) if self.assigned.changes(n) => {
                    let words =
                        format!("{n} gets another value in the program: which of them holds, the text does not tell");
                    return Err(Why::of(n, LeftReason::Computed, words));
                }
                Value::Name(n) => {
                    name = Some(n.as_str());
                    let missing = || {
                        let words = format!("{n} is in none of the files (give its .dat, or $config.dat, as well)");
                        Why::of(n, LeftReason::Undeclared, words)
                    };
                    value = self.values.get(n).ok_or_else(missing)?;
                }
                Value::Expression => break,
            }
        }
        Err(Why::computed())
    }

    /// Statements that decide from where the robot comes; false for any other word.
    fn flow(&mut self, reader: &Reader<'_>, word: &str) -> bool {
        match word {
            "DEF" | "DEFFCT" | "GLOBAL" => {
                let Some(name) = routine_name(reader) else { return false };
                self.start_afresh();
                self.copies = BTreeMap::new();
                let uncalled = self.begun();
                let is_first = std::mem::take(&mut self.begins) && !self.flow.is_called(&name);
                self.flow.routine_begins(name, &mut self.now, &uncalled);
                if is_first {
                    self.now.1 = Stands::begin();
                }
            }
            "RETURN" => self.flow.returns(&self.now),
            "GOTO" => self.flow.jumps(&self.now),
            "EXIT" => self.flow.leaves(&self.now),
            "END" | "ENDFCT" => self.flow.routine_ends(&mut self.now),
            "IF" | "SWITCH" | "WHILE" | "LOOP" | "FOR" | "REPEAT" => {
                self.way.branches_begin();
                let kind = match word {
                    "IF" => Branching::If,
                    "SWITCH" => Branching::Cases,
                    "LOOP" => Branching::LoopForever,
                    "REPEAT" => Branching::LoopTaken,
                    _ => Branching::Loop,
                };
                self.flow.begin(&mut self.now, kind);
            }
            "ELSE" | "CASE" | "DEFAULT" => {
                self.way.next_branch();
                self.flow.next(&mut self.now, word != "CASE");
            }
            "ENDIF" | "ENDSWITCH" | "ENDWHILE" | "ENDLOOP" | "ENDFOR" | "UNTIL" => {
                self.way.branches_end();
                self.flow.end(&mut self.now);
            }
            "ENDSPLINE" => {
                self.spline = None;
                self.time_passes();
            }
            _ => return false,
        }
        true
    }

    /// `NAME:`, to which GOTO may come from anywhere in the routine.
    fn label(&mut self) {
        let (mut active, _) = self.flow.at_label(&self.now);
        let [tool, base] =
            [&active.tool, &active.base].map(|is| is.value.at_some_time("a GOTO may come from elsewhere"));
        active.set(Frames { tool, base, ipo_mode: active.ipo_mode.value });
        self.now.0 = active;
        self.may_carry();
        self.flow.arrives();
        self.way.lose(&mut self.now.1);
    }

    fn start_afresh(&mut self) {
        self.way.start_afresh();
        self.flow.all_end(&mut self.now);
    }

    fn leave_at(&mut self, file: usize, line: usize, name: &str, why: Why) {
        // Status and turn may mean another posture, but on a path of the tool it goes on.
        let same_posture = !name.starts_with("PTP") && !name.starts_with("SPTP");
        self.way.leave(Left { file, line, name: name.to_owned(), why }, same_posture, &mut self.now.1);
    }

    fn stands_at_root(&self) -> Understood<()> {
        let at_root = match &self.root {
            FrameIs::Known(root) => *root == Pose::identity(),
            FrameIs::Unset => true,
            FrameIs::Unknown(_) => false,
        };
        let words = "$ROBROOT is not zero: $BASE does not stand in the foot of the robot \
                     (with --base of a link that is the world, leave out the file that sets it)";
        if at_root { Ok(()) } else { Err(Why::new(LeftReason::FrameUnknown, words)) }
    }

    fn kind(&self, a: &Aggregate, frames: &Frames) -> Understood<TargetKind> {
        let axes = self.setting.axes;
        if a.has(&AXIS_NAMES) {
            let stated = [self.setting.tool, self.setting.work];
            let frames = Box::new(frames.beside_joints(stated, &self.setting.base));
            return Ok(TargetKind::Joints(JointTarget { frames, ..a.joints(axes, &self.prismatic) }));
        }
        if !a.has(&POSE_NAMES) {
            let words = match a.has(&EXTERNAL_NAMES) {
                true => "it moves external axes alone: what the arm does meanwhile depends on the controller",
                false => "it has neither axes A1 to A6 nor components X to C",
            };
            return Err(Why::new(LeftReason::NotATarget, words));
        }
        frames.is_on_flange().map_err(|words| Why::new(LeftReason::ToolUnknown, words))?;
        self.stands_at_root()?;
        if let Some((name, value)) = a.foreign(axes).filter(|_| !self.setting.axes_apart) {
            return Err(Why::external(&name, value));
        }
        self.keeps_at_zero(a)?;
        let frame = |reason, name: &str, is: &FrameIs, stated: Option<Pose>, flag: &str| {
            is.or_stated(stated).ok_or_else(|| Why::new(reason, is.why(name, flag)))
        };
        Ok(TargetKind::Pose(Box::new(PoseTarget {
            position: a.position(),
            rotation: a.rotation(),
            base_from_work: self.setting.base
                * frame(LeftReason::FrameUnknown, "$BASE", &frames.base, self.setting.work, "--work")?,
            flange_from_tool: frame(LeftReason::ToolUnknown, "$TOOL", &frames.tool, self.setting.tool, "--tool")?,
            fixed: a.external(axes, &self.prismatic),
            posture: a.posture(axes),
            taught: None,
            displaced: None,
            joint_fields: vec![None; axes.len()],
        })))
    }
}
