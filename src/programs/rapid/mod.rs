//! ABB RAPID: moves to `robtarget` and `jointtarget`, declared or in the instruction, with `tooldata` and `wobjdata` (mm and degrees).

mod array;
mod calls;
mod carried;
mod cycle;
mod frames;
mod moves;
mod off_zero;
mod scopes;
mod statements;
mod still;
mod switched;
mod switching;
mod untold;
mod unvisited;
mod uses;
mod value;

use std::collections::BTreeMap;
use std::ops::Range;

use super::ProgramSetting;
use super::codes::{Codes, PostureCode};
use super::external::NO_AXIS;
use super::field::{Field, FieldPlace};
use super::flow::{Places, settled};
use super::itinerary::Itinerary;
use super::names::{plain_error, plain_names};
use super::program::{
    Approach, DisplacedTarget, Heed, JointTarget, Left, MeantPosture, PoseTarget, Program, RotationFields, Target,
    TargetKind, Understood, Way,
};
use super::reason::{DeclaredPoint, LeftReason, Why};
use super::references::References;
use super::scan::{Dialect, Reader};
use super::text_file::TextFile;
use crate::error::{Code, Error, Result};
use crate::geom::Pose;
use crate::urdf::JointKind;
use moves::{MoveSwitches, TWO_POINTS, is_of_joints, is_to_joints, targets_of};
use scopes::Scopes;
use switched::Watched;
use switching::{Now, Switching};
use untold::Untold;
use uses::Use;
use value::{
    Displacement, ExternalAxes, Node, TYPES, array_of, check, computed, element, foreign_axis, is_of_external_axes,
    is_placeholder, is_set, node, numbers, undeclared,
};

const DIALECT: Dialect =
    Dialect { comment: b'!', quotes: b"\"", header: None, based_numbers: false, latin_letters: true };
/// Most names that stand for each other.
const MOST_NAMES: usize = 8;
const DECIMALS_MM: usize = 4;
const DECIMALS_DEG: usize = 6;
const DECIMALS_QUATERNION: usize = 9;

/// Declared data.
#[derive(Debug, Clone)]
struct Datum {
    kind: String,
    file: usize,
    line: usize,
    is_constant: bool,
    /// `None` where the text does not give its numbers.
    value: Option<Node>,
    /// The value of its declaration, where something may change it.
    before: Option<Node>,
    /// What may change it, in words.
    changed: Option<String>,
}

/// Reads modules that belong together.
pub(super) fn read(files: Vec<TextFile>, setting: &ProgramSetting<'_>) -> Result<Program> {
    let mut scopes = Scopes::default();
    for (index, file) in files.iter().enumerate() {
        scopes.look_through(Reader::new(file, index, DIALECT)?);
    }
    let program = settled(|known| reading(&files, &scopes, setting, known)).map_err(plain_error)?;
    Ok(Program { files, ..plain_names(program) })
}

/// One reading, with what the one before found, and what it found itself.
fn reading(
    files: &[TextFile],
    scopes: &Scopes,
    setting: &ProgramSetting<'_>,
    known: Places<Now>,
) -> Result<(Program, Places<Now>)> {
    let reader = |(index, file)| Reader::renamed(file, index, DIALECT, |reader| scopes.names(reader));
    let mut task = Task {
        files,
        setting,
        data: BTreeMap::new(),
        bases: BTreeMap::new(),
        uses: BTreeMap::new(),
        switching: Switching::new(known, scopes.routines()),
        move_switches: MoveSwitches::default(),
        way: Itinerary::new(),
    };
    let mut references = References::default();
    for file in files.iter().enumerate() {
        task.declarations(reader(file)?)?;
    }
    for file in files.iter().enumerate() {
        task.assignments(reader(file)?);
        task.moves_external_axes(reader(file)?);
        Task::look_for_calls(&mut references, reader(file)?);
        task.switching.look_through(reader(file)?);
    }
    task.changed_by_calls(&references);
    for file in files.iter().enumerate() {
        task.way.start_afresh();
        task.statements(reader(file)?)?;
        task.switching.all_end();
    }
    task.unvisited();
    task.way.program.put = task.switching.put_anywhere.by_reading(setting.axes, |reading| task.unit(reading).0);
    Ok((task.way.finished(), task.switching.found()))
}

struct Task<'a> {
    files: &'a [TextFile],
    setting: &'a ProgramSetting<'a>,
    data: BTreeMap<String, Datum>,
    /// Points from which displaced ones start: how they would be visited.
    bases: BTreeMap<String, Target>,
    /// What statements that are no known moves do with points.
    uses: BTreeMap<String, Vec<Use>>,
    /// What instructions switch for those behind them.
    switching: Switching,
    /// What switches of the move say that is being read.
    move_switches: MoveSwitches,
    way: Itinerary,
}

impl Task<'_> {
    /// All data of a file.
    fn declarations(&mut self, mut reader: Reader<'_>) -> Result<()> {
        while !reader.done() {
            let Some(word) = reader.name() else {
                reader.at += 1;
                continue;
            };
            reader.at += 1;
            if TYPES.contains(&word.as_str()) && reader.word().is_some() {
                self.declaration(&mut reader, word)?;
            }
        }
        Ok(())
    }

    /// Assignments of a file to data of any.
    fn assignments(&mut self, mut reader: Reader<'_>) {
        while !reader.done() {
            let Some(word) = reader.name() else {
                reader.at += 1;
                continue;
            };
            let is_type = TYPES.contains(&word.as_str()) && reader.name_of(reader.at + 1).is_some();
            if self.data.contains_key(&word) && is_set(&mut reader) {
                self.is_assigned(&word, &format!("{} sets it", reader.place()));
            }
            // A declaration assigns nothing.
            reader.at += if is_type { 2 } else { 1 };
        }
    }

    /// `TYPE name := value;` behind its type.
    fn declaration(&mut self, reader: &mut Reader<'_>, kind: String) -> Result<()> {
        let (Some(name), line) = (reader.name(), reader.line()) else { return Ok(()) };
        let is_constant = reader.ahead_is_word(-2, "CONST");
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
            let what = format!("{name} is declared in {}:{} already", self.files[twin.file].name, twin.line);
            return Err(Error::new(
                Code::ProgramTwin,
                reader.place(),
                what,
                "correct these modules one after the other, or make one of the two LOCAL",
            ));
        }
        // Two data of one name in one file belong to different routines.
        let is_twin = twin.is_some();
        let changed = is_twin.then(|| "it is declared twice".to_owned());
        let datum = Datum { kind, file: reader.index, line, is_constant, value: None, before: None, changed };
        if is_twin {
            self.is_assigned(&name, "it is declared twice");
        } else if let (true, Some((rows, place))) = (is_array, &value) {
            self.elements_declared(&name, &datum, rows, place)?;
        }
        let value = value.filter(|_| !is_twin && !is_array).map(|(value, _)| value);
        self.data.insert(name, Datum { value, ..datum });
        Ok(())
    }

    fn leave(&mut self, (file, line): (usize, usize), name: &str, why: Why) {
        // Confdata may mean another posture, but on a path of the tool it goes on.
        let same_posture = !is_of_joints(&name.to_ascii_uppercase());
        self.way.leave(Left { file, line, name: name.to_owned(), why }, same_posture, self.switching.stands());
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
                let kind = if is_to_joints(&name.to_ascii_uppercase()) { "JOINTTARGET" } else { "ROBTARGET" };
                check(kind, name, value, &place)?;
                (value.clone(), from, name.to_owned())
            }
            Node::Word(word) => match (word.strip_suffix("{}"), self.declared(word)) {
                (Some(array), _) => return self.visit_any(array, name, from, tool, work),
                (_, Ok((value, place))) => (value, place, self.meant(word).to_owned()),
                (_, Err(why)) => return Ok(Err(why)),
            },
            _ => return Ok(Err(Why::computed())),
        };
        let kind = self.kind(&value, place.0, tool.as_deref(), self.work(work));
        let about = |why: Why| Why { about: Some(named.clone()), ..why };
        let kind = kind.and_then(|kind| self.as_told(kind, name)).map_err(about);
        Ok(kind.map(|kind| self.way.visit(Target::at(place, named, kind), self.switching.stands())))
    }

    /// The name whose numbers a name has: `CONST robtarget name:=other;`.
    fn meant<'n>(&'n self, name: &'n str) -> &'n str {
        let mut meant = name;
        for _ in 0..MOST_NAMES {
            match self.data.get(meant).and_then(|datum| datum.value.as_ref()) {
                Some(Node::Word(other)) => meant = other,
                _ => break,
            }
        }
        meant
    }

    /// The numbers of a declared target, and where they stand: file and line.
    fn declared(&self, word: &str) -> Understood<(Node, (usize, usize))> {
        let word = self.meant(word);
        match self.data.get(word) {
            Some(Datum { value: Some(value), file, line, .. }) => Ok((value.clone(), (*file, *line))),
            Some(_) => Err(computed(word)),
            None if array_of(word).is_some_and(|array| self.data.contains_key(array)) => Err(computed(word)),
            None => Err(undeclared(word)),
        }
    }

    /// A target with the posture that a kind of move gives it; refused where the tool is turned otherwise than it says.
    fn as_told(&self, kind: TargetKind, name: &str) -> Understood<TargetKind> {
        let TargetKind::Pose(mut pose) = kind else { return Ok(kind) };
        let upper = name.to_ascii_uppercase();
        if !is_of_joints(&upper) && *self.switching.now().locked.value() {
            let words =
                "axis 4 is locked, or may be (SingArea\\LockAxis4): the tool turns as it can, whatever the target says";
            return Err(Why::new(LeftReason::OrientationKept, words));
        }
        let way = match targets_of(&upper) {
            _ if is_of_joints(&upper) => Way::Joints,
            Some(targets) if targets.count == TWO_POINTS => Way::Path,
            _ => Way::Line,
        };
        pose.posture = match (*self.switching.now().watched[usize::from(!is_of_joints(&upper))].value(), pose.posture) {
            (Watched::Off, _) => MeantPosture::ByWay(way),
            (Watched::Unknown, MeantPosture::Coded(codes, axes, ..)) => {
                MeantPosture::Coded(codes, axes, way, Heed::Unknown)
            }
            (_, posture) => posture.on(way),
        };
        Ok(TargetKind::Pose(pose))
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
        let point = &self.meant(&displaced.point).to_owned();
        let (value, (file, line)) = self.declared(point)?;
        let by = displaced.by.clone().ok_or_else(|| {
            let words = "its displacement is computed, not written in numbers";
            let declared = DeclaredPoint { name: point.clone(), file, line };
            Why::of(point, LeftReason::Computed, words).starting_from(vec![declared])
        })?;
        let base = self.kind(&value, file, tool, self.work(work))?;
        let base = self.as_told(base, name)?;
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
        let target = Target::at(from, format!("{words}({point})"), TargetKind::Pose(pose));
        self.way.visit(target, self.switching.stands());
        // Its posture is that of the displaced point, where nothing else tells it.
        let approach = Approach::Beyond(index);
        let target = Target { approach, visited: false, ..Target::at((file, line), point.clone(), base) };
        self.bases.entry(point.clone()).or_insert(target);
        Ok(())
    }

    fn kind(
        &self,
        value: &Node,
        file: usize,
        tool: Option<&str>,
        work: std::result::Result<Pose, Untold>,
    ) -> Understood<TargetKind> {
        let Node::List(parts) = value else {
            return Err(Why::new(LeftReason::NotATarget, "it is no robtarget and no jointtarget"));
        };
        let external = self.external(parts);
        if is_of_external_axes(value) {
            let words = "it moves external axes alone: the arm stays where it is";
            return Err(Why::new(LeftReason::NotATarget, words));
        }
        if is_placeholder(value) {
            return Err(Why::new(LeftReason::NotATarget, "its quaternion is zero: it has no value yet"));
        }
        self.goes_as_told(parts.len() == 2, &external)?;
        if parts.len() == 2 {
            let frames = Box::new(self.beside_joints(tool, work));
            return Ok(TargetKind::Joints(JointTarget { frames, ..self.joints(&parts[0], &external?, file)? }));
        }
        let pose = self.pose(parts, file, external, (tool, work))?;
        Ok(TargetKind::Pose(Box::new(pose)))
    }

    /// The pose of a robtarget.
    fn pose(
        &self,
        parts: &[Node],
        file: usize,
        external: Understood<ExternalAxes>,
        (tool, work): (Option<&str>, std::result::Result<Pose, Untold>),
    ) -> Understood<PoseTarget> {
        if *self.switching.now().displaced.value() {
            let words = "a program displacement (PDispOn, PDispSet) may be active";
            return Err(Why::new(LeftReason::FrameUnknown, words));
        }
        if self.move_switches.is_led {
            let words = "a sensor or the program moves the tool off it (\\Corr, \\Track)";
            return Err(Why::new(LeftReason::FrameUnknown, words));
        }
        let trans = numbers::<3>(&parts[0]).ok_or_else(Why::computed)?;
        let [w, x, y, z] = numbers::<4>(&parts[1]).ok_or_else(Why::computed)?;
        let cf = numbers::<4>(&parts[2]).ok_or_else(Why::computed)?;
        let external = external?;
        let field = |(written, range): (f64, Range<usize>), si: f64, decimals: usize| Field {
            file,
            place: FieldPlace::At(range),
            written,
            si,
            decimals,
        };
        let axes = self.setting.axes;
        let posture = match axes.get(..6).and_then(|a| <[usize; 6]>::try_from(a).ok()) {
            None => MeantPosture::ByWay(Way::Joints),
            Some(six) => {
                let cf = cf.map(|(value, range)| PostureCode { file, range, value: value as i64 });
                MeantPosture::Coded(Codes::Rapid(Box::new(cf)), six, Way::Joints, Heed::Heeded)
            }
        };
        if let Some((axis, value)) = foreign_axis(&external, axes.len()).filter(|_| !self.setting.axes_apart) {
            return Err(Why::external(&axis, value));
        }
        self.keeps_at_zero(&external)?;
        let mut fixed = vec![None; axes.len()];
        for (&reading, (value, _)) in axes.iter().skip(6).zip(&external) {
            fixed[reading] = Some(if *value < NO_AXIS { value * self.unit(reading).0 } else { f64::NAN });
        }
        Ok(PoseTarget {
            position: trans.map(|t| field(t, 1e-3, DECIMALS_MM)),
            rotation: RotationFields::Quaternion([x, y, z, w].map(|q| field(q, 1.0, DECIMALS_QUATERNION))),
            base_from_work: self.setting.base * work.or_else(|untold| untold.or_stated(self.setting.work))?,
            flange_from_tool: self.tool(tool)?,
            fixed,
            posture,
            taught: None,
            displaced: None,
            joint_fields: vec![None; axes.len()],
        })
    }

    /// External axes of a target; where they are computed, none where they move nothing.
    fn external(&self, parts: &[Node]) -> Understood<ExternalAxes> {
        let matters = self.setting.axes.len() > 6 || !self.setting.axes_apart;
        match parts.last().and_then(numbers::<6>) {
            None if matters => Err(Why::computed()),
            numbers => Ok(numbers.unwrap_or_default()),
        }
    }

    /// SI value and decimals of a reading's unit.
    fn unit(&self, reading: usize) -> (f64, usize) {
        match self.setting.chain.reading_kinds[reading] {
            JointKind::Prismatic => (1e-3, DECIMALS_MM),
            _ => (1f64.to_radians(), DECIMALS_DEG),
        }
    }

    fn joints(&self, axes: &Node, external: &ExternalAxes, file: usize) -> Understood<JointTarget> {
        let values = numbers::<6>(axes)
            .ok_or_else(|| Why::new(LeftReason::Computed, "it is computed, not written in numbers"))?;
        let n = self.setting.axes.len();
        let mut target = JointTarget { readings: vec![f64::NAN; n], fields: vec![None; n], frames: Default::default() };
        for (k, (&reading, (written, range))) in self.setting.axes.iter().zip(values.iter().chain(external)).enumerate()
        {
            if *written >= NO_AXIS {
                continue;
            }
            let (si, decimals) = self.unit(reading);
            target.readings[reading] = written * si;
            let place = FieldPlace::At(range.clone());
            // External axes keep their value.
            target.fields[reading] = (k < 6).then_some(Field { file, place, written: *written, si, decimals });
        }
        Ok(target)
    }
}
