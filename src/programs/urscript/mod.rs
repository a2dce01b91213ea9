//! URScript: `movej`, `movel`, `movep`, `movec`, `servoj`, `servoc`, `optimovej` and `optimovel` with joints `[..]` (rad) or poses `p[..]` (m, rotation vector in rad),
//! written in the call or in a variable, `get_inverse_kin` around a pose, and `set_tcp`.

mod active;
mod arguments;
mod calls;
mod routines;
mod threads;

use std::collections::{BTreeMap, BTreeSet};

use super::ProgramSetting;
use super::field::{Field, FieldPlace};
use super::flow::{Branching, Flow, Places, settled};
use super::itinerary::{Itinerary, Stands};
use super::program::{
    JointTarget, Left, MeantPosture, PoseTarget, Program, RotationFields, StatedFrame, Target, TargetKind, Understood,
    Way,
};
use super::reason::{DeclaredPoint, LeftReason, Why};
use super::routines::Routines;
use super::scan::{Dialect, Reader, TokenKind};
use super::text_file::TextFile;
use crate::error::{Code, Error, Result};
use crate::geom::{Pose, exp_so3};
use active::{Active, ToolIs};
use routines::{BLOCKS, Blocks};

const DIALECT: Dialect =
    Dialect { comment: b'#', quotes: b"\"'", header: None, based_numbers: false, latin_letters: false };
/// Calls that move the robot to their first arguments, how many of them are targets, and how the tool gets there.
const MOVES: [(&[u8], usize, Way); 8] = [
    (b"movej", 1, Way::Joints),
    (b"movel", 1, Way::Line),
    (b"movep", 1, Way::Line),
    (b"movec", 2, Way::Path),
    (b"servoj", 1, Way::Joints),
    (b"servoc", 1, Way::Path),
    (b"optimovej", 1, Way::Joints),
    (b"optimovel", 1, Way::Line),
];
/// Decimals in rad and m.
const DECIMALS: usize = 8;

/// What stands where a target may stand.
#[derive(Debug, Clone)]
enum Value {
    /// `[..]` with numbers.
    Joints(Vec<Field>, usize),
    /// `p[..]` with six numbers.
    Pose(Box<[Field; 6]>, usize),
    /// Anything else; where it was computed by `get_inverse_kin`, the posture goes on.
    Expression,
}

/// A target in a call.
struct Argument {
    value: Value,
    /// Joints beside the pose: `name_q` of `name_p`.
    taught: Option<Vec<f64>>,
    posture: MeantPosture,
    /// The tool that is at a pose.
    tool: Understood<Pose>,
    /// Points in variables that an expression names.
    points: Vec<DeclaredPoint>,
    /// False where the move may change the posture to one that the text does not tell.
    keeps: bool,
    /// False where the tool may be turned otherwise than it says.
    turns_as_told: bool,
}

/// Reads scripts; each file is a program of its own.
pub(super) fn read(files: Vec<TextFile>, setting: &ProgramSetting<'_>) -> Result<Program> {
    let mut named = Routines::default();
    for (index, file) in files.iter().enumerate() {
        routines::routines_in(Reader::new(file, index, DIALECT)?, &mut named);
    }
    let program = settled(|known| reading(&files, &named, setting, known))?;
    Ok(Program { files, ..program })
}

/// One reading, with what the one before found, and what it found itself.
fn reading(
    files: &[TextFile],
    routines: &Routines,
    setting: &ProgramSetting<'_>,
    known: Places<Now>,
) -> Result<(Program, Places<Now>)> {
    let (mut way, mut flow) = (Itinerary::new(), Flow::new(known).among(routines));
    for (index, file) in files.iter().enumerate() {
        way.start_afresh();
        flow.file_begins(index);
        let mut script = Script {
            reader: Reader::new(file, index, DIALECT)?,
            setting,
            variables: BTreeMap::new(),
            computed: BTreeSet::new(),
            blocks: Vec::new(),
            handing_on: BTreeSet::new(),
            perhaps: Vec::new(),
            now: (Active::new(setting.tool), Stands::default()),
            flow: &mut flow,
            way: &mut way,
        };
        script.find_computed()?;
        script.find_routines_that_hand_on();
        script.read()?;
    }
    Ok((way.finished(), flow.found()))
}

/// What statements have set, and where the robot stands.
type Now = (Active, Stands);

struct Script<'a> {
    reader: Reader<'a>,
    setting: &'a ProgramSetting<'a>,
    /// Last value given to each variable.
    variables: BTreeMap<Vec<u8>, Value>,
    /// Variables that get a computed value, or another number, anywhere: which value a move in a loop finds is not known.
    computed: BTreeSet<Vec<u8>>,
    /// Statements that wait for their `end`; true for routines.
    blocks: Vec<bool>,
    /// Routines that hand what they are given on to one that is in none of the files.
    handing_on: BTreeSet<String>,
    /// Positions in variables to which a call in none of the files may go: where their numbers begin, and what is left where nothing else goes there.
    perhaps: Vec<(usize, Left)>,
    now: Now,
    /// How it changes.
    flow: &'a mut Flow<Now>,
    way: &'a mut Itinerary,
}

impl Script<'_> {
    /// Looks through the whole text for variables with computed values, or with one of several: which of them holds is known only where the text
    /// is read from top to bottom.
    fn find_computed(&mut self) -> Result<()> {
        let (mut given, mut blocks) = (BTreeMap::<Vec<u8>, (usize, bool)>::new(), Blocks::default());
        while !self.reader.done() {
            let name = self.reader.word().map(<[u8]>::to_vec);
            self.reader.at += 1;
            let Some(name) = name else { continue };
            blocks.follow(&name);
            if name == b"def" {
                self.computed.extend(self.parameters());
            }
            let assigned = |reader: &Reader<'_>, ahead| {
                reader.ahead_is_mark(ahead, b'=') && !reader.ahead_is_mark(ahead + 1, b'=')
            };
            if self.reader.is_mark(b'[') {
                let close = self.reader.closing(self.reader.at);
                let behind = close.map(|c| (c + 1) as isize - self.reader.at as isize);
                if behind.is_some_and(|behind| assigned(&self.reader, behind)) {
                    self.computed.insert(name);
                }
            } else if assigned(&self.reader, 0) {
                self.reader.at += 1;
                match self.value()? {
                    Value::Expression => _ = self.computed.insert(name),
                    _ => {
                        let (times, nested) = given.entry(name).or_default();
                        (*times, *nested) = (*times + 1, *nested || blocks.is_nested());
                    }
                }
            }
        }
        let several = given.into_iter().filter(|(_, (times, nested))| *times > 1 && (*nested || blocks.routines > 1));
        self.computed.extend(several.map(|(name, _)| name));
        self.reader.at = 0;
        Ok(())
    }

    /// Parameters of the routine on whose name the reader stands.
    fn parameters(&self) -> Vec<Vec<u8>> {
        let open = self.reader.at + 1;
        let close = self.reader.closing(open).filter(|_| self.reader.ahead_is_mark(1, b'(')).unwrap_or(open);
        let tokens = (1..).map_while(|n| self.reader.ahead(n).filter(|_| self.reader.at + (n as usize) < close));
        tokens.filter(|t| t.kind == TokenKind::Word).map(|t| self.reader.text(t).to_vec()).collect()
    }

    fn read(mut self) -> Result<()> {
        while !self.reader.done() {
            let at = self.reader.at;
            let Some(word) = self.reader.word() else {
                self.reader.at += 1;
                continue;
            };
            let next = self.reader.ahead(1).map(|t| t.kind);
            if let Some((_, count, way)) = MOVES.iter().find(|(name, ..)| *name == word)
                && next == Some(TokenKind::Mark(b'('))
            {
                self.moves(*count, *way)?;
            } else if self.block(word, next) {
                // Behind the name of a routine, too: there it is not called.
                self.reader.at = at + 1 + usize::from(matches!(word, b"def" | b"thread"));
            } else if self.now.0.switched(word) {
                self.set_for_threads();
                self.reader.at = at + 1;
            } else if self.ends_thread(word, next) {
                self.reader.at = at + 2;
            } else if word == b"set_tcp" && next == Some(TokenKind::Mark(b'(')) {
                self.reader.at += 2;
                let value = self.argument()?;
                self.now.0.tool.set(match &value {
                    Value::Pose(fields, _) => ToolIs::Known(pose_of(fields)),
                    _ => self.setting.tool.map_or(ToolIs::Computed, ToolIs::Known),
                });
                self.set_for_threads();
            } else if next == Some(TokenKind::Mark(b'='))
                && self.reader.ahead(2).map(|t| t.kind) != Some(TokenKind::Mark(b'='))
            {
                let name = word.to_vec();
                self.reader.at += 2;
                let value = self.value()?;
                self.variables.insert(name, value);
            } else {
                self.other_call();
                self.reader.at = at + 1;
            }
        }
        self.leave_unvisited();
        self.flow.all_end(&mut self.now);
        Ok(())
    }

    /// Follows statements that end with `end`; false for any other word.
    fn block(&mut self, word: &[u8], next: Option<TokenKind>) -> bool {
        let assigned = next == Some(TokenKind::Mark(b'='));
        let begins = BLOCKS.contains(&word);
        let routine = matches!(word, b"def" | b"thread");
        match word {
            _ if assigned => return false,
            _ if begins && routine => self.routine_begins(word),
            _ if begins => self.branches_begin(word),
            b"else" | b"elif" | b"case" | b"default" => {
                self.way.next_branch();
                self.flow.next(&mut self.now, matches!(word, b"else" | b"default"));
            }
            b"end" => match self.blocks.pop() {
                Some(true) => {
                    self.way.routine_ends();
                    self.flow.routine_ends(&mut self.now);
                }
                Some(false) => {
                    self.way.branches_end();
                    self.flow.end(&mut self.now);
                }
                None => {}
            },
            b"return" => {
                self.flow.returns(&self.now);
                return false;
            }
            b"break" => self.flow.leaves(&self.now),
            b"continue" => self.flow.begins_again(&self.now),
            _ => return false,
        }
        if begins {
            self.blocks.push(routine);
        }
        true
    }

    fn routine_begins(&mut self, word: &[u8]) {
        self.way.routine_begins();
        let name = self.reader.ahead(1).map(|t| String::from_utf8_lossy(self.reader.text(t)).into_owned());
        let first = (Active::new(self.setting.tool), Stands::default());
        self.flow.routine_begins(name.unwrap_or_default(), &mut self.now, &first);
        if word == b"thread" {
            self.time_passes();
        }
    }

    fn branches_begin(&mut self, word: &[u8]) {
        self.way.branches_begin();
        let kind = match word {
            b"if" => Branching::If,
            b"switch" => Branching::Cases,
            b"while" if self.is_endless() => Branching::LoopForever,
            _ => Branching::Loop,
        };
        self.flow.begin(&mut self.now, kind);
    }

    /// `while True:`
    fn is_endless(&self) -> bool {
        let condition = if self.reader.ahead_is_mark(1, b'(') { 2 } else { 1 };
        let behind = condition + 1;
        self.reader.ahead_is_word(condition, "True")
            && (self.reader.ahead_is_mark(behind, b':') || self.reader.ahead_is_mark(behind, b')'))
    }

    /// A call that moves; the reader stands on its name.
    fn moves(&mut self, count: usize, way: Way) -> Result<()> {
        let line = self.reader.line();
        let name = String::from_utf8_lossy(self.reader.word().unwrap_or_default()).into_owned();
        let open = self.reader.at + 1;
        let Some(close) = self.reader.closing(open) else {
            return Err(Error::new(
                Code::ProgramSyntax,
                self.reader.place(),
                format!("the bracket of {name}( is not closed"),
                "close it",
            ));
        };
        let turns_as_told = name != "movec" || self.turns_as_told(open, close);
        self.reader.at = open + 1;
        for k in 0..count {
            if self.reader.at >= close {
                let what = format!("{name}(..) has {k} targets, not {count}");
                return Err(Error::new(
                    Code::ProgramTargets,
                    format!("{}:{line}", self.reader.file.name),
                    what,
                    "complete the call",
                ));
            }
            let points = self.points_in_argument(close);
            let argument = Argument { points, turns_as_told, ..self.target_argument(way)? };
            self.visit(&name, line, argument)?;
            // To the next argument.
            while self.reader.at < close && !self.reader.take_mark(b',') {
                let bracket = matches!(self.reader.peek().map(|t| t.kind), Some(TokenKind::Mark(b'(' | b'[')));
                self.reader.at =
                    if bracket { self.reader.closing(self.reader.at).unwrap_or(close) } else { self.reader.at } + 1;
            }
        }
        self.reader.at = close + 1;
        self.time_passes();
        Ok(())
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
            return Err(Error::new(
                Code::ProgramSyntax,
                self.reader.place(),
                "a list [ is not closed",
                "close it with ]",
            ));
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
            Error::new(
                Code::ProgramTargets,
                place,
                format!("a pose p[..] has 6 numbers, this one has {count}"),
                "x, y, z, rx, ry, rz",
            )
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
        Some(Field { file: self.reader.index, place: FieldPlace::At(range), written, si, decimals: DECIMALS })
    }

    fn readings(&self, fields: &[Field]) -> Vec<f64> {
        let mut readings = vec![0.0; self.setting.chain.readings.len()];
        for (field, &reading) in fields.iter().zip(self.setting.axes) {
            readings[reading] = field.value();
        }
        readings
    }

    fn visit(&mut self, name: &str, line: usize, argument: Argument) -> Result<()> {
        if let Value::Joints(fields, line) = &argument.value
            && fields.len() != self.setting.axes.len()
        {
            let what = format!("{} joint values for the {} joints of the robot", fields.len(), self.setting.axes.len());
            return Err(Error::new(
                Code::ProgramTargets,
                format!("{}:{line}", self.reader.file.name),
                what,
                "give one value for each joint",
            ));
        }
        let keeps = argument.keeps;
        if let Err(why) = self.take(name, argument) {
            let left = Left { file: self.reader.index, line, name: name.to_owned(), why };
            self.way.leave(left, keeps, &mut self.now.1);
        }
        Ok(())
    }

    fn take(&mut self, name: &str, argument: Argument) -> Understood<()> {
        if self.now.0.has_motion_on_top() {
            let words = "a conveyor or an offset of the path moves the tool on top of it";
            return Err(Why::new(LeftReason::FrameUnknown, words));
        }
        if !argument.turns_as_told {
            let words = "on the arc the tool keeps its orientation, or may keep it, whatever its targets say (mode)";
            return Err(Why::new(LeftReason::OrientationKept, words));
        }
        let (kind, line) = match argument.value {
            Value::Joints(fields, line) => {
                let mut by_reading = vec![None; self.setting.chain.readings.len()];
                let readings = self.readings(&fields);
                for (field, &reading) in fields.into_iter().zip(self.setting.axes) {
                    by_reading[reading] = Some(field);
                }
                let tool = self.now.0.tool.value.beside_joints();
                let frames = Box::new([tool, StatedFrame::Unsaid]);
                (TargetKind::Joints(JointTarget { readings, fields: by_reading, frames }), line)
            }
            Value::Pose(fields, line) => {
                let pose = self.pose(*fields, argument.posture, argument.tool?);
                (TargetKind::Pose(Box::new(PoseTarget { taught: argument.taught, ..pose })), line)
            }
            Value::Expression => return Err(Why::computed().starting_from(argument.points)),
        };
        let target = Target::at((self.reader.index, line), name.to_owned(), kind);
        self.way.visit(target, &mut self.now.1);
        Ok(())
    }

    /// The tool that `set_tcp` has set.
    fn active_tool(&self) -> Understood<Pose> {
        self.now.0.tool.value.known()
    }

    fn pose(&self, fields: [Field; 6], posture: MeantPosture, tool: Pose) -> PoseTarget {
        let [x, y, z, rx, ry, rz] = fields;
        let readings = self.setting.chain.readings.len();
        PoseTarget {
            position: [x, y, z],
            rotation: RotationFields::Vector([rx, ry, rz]),
            base_from_work: self.setting.base,
            flange_from_tool: tool,
            fixed: vec![None; readings],
            posture,
            taught: None,
            displaced: None,
            joint_fields: vec![None; readings],
        }
    }
}

fn pose_of(fields: &[Field; 6]) -> Pose {
    let [x, y, z, rx, ry, rz] = fields.each_ref().map(Field::value);
    Pose::new(exp_so3(&[rx, ry, rz].into()), [x, y, z].into())
}
