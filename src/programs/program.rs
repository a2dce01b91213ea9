//! Targets of a program and how they are written.

use std::f64::consts::PI;

use super::codes::Codes;
use super::field::{Edit, Field, FieldPlace};
use super::reason::Why;
use super::text_file::TextFile;
use crate::error::Notice;
use crate::geom::{Pose, exp_so3, log_so3, matrix_from_rpy, rpy_from_matrix};

/// A program with what was found in it.
#[derive(Debug, Clone)]
pub struct Program {
    /// Its files.
    pub files: Vec<TextFile>,
    /// Targets in the order in which the robot first visits them.
    pub targets: Vec<Target>,
    /// Targets that are there, but cannot be understood from the text alone.
    pub left: Vec<Left>,
    /// Edits that are made in any case (names of new columns).
    pub edits: Vec<Edit>,
    /// What the user should know.
    pub notices: Vec<Notice>,
    /// Where the text puts external axes, wherever that is: by reading, rad or m, `None` where it does not tell.
    pub put: Vec<(usize, Option<f64>)>,
}

/// A target that stays as it is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Left {
    /// Index of the file.
    pub file: usize,
    /// Line, from 1.
    pub line: usize,
    /// Name in the program, or the instruction.
    pub name: String,
    /// Why.
    pub why: Why,
}

/// A value, or why its target stays as it is.
pub(super) type Understood<T> = std::result::Result<T, Why>;

/// One target.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// Index of the file.
    pub file: usize,
    /// Line, from 1.
    pub line: usize,
    /// Name in the program, or the instruction.
    pub name: String,
    /// From where the robot comes to it when it visits it first.
    pub approach: Approach,
    /// All ways to it, where there are others than its approach.
    pub arrivals: Vec<Arrival>,
    /// False for a point that no motion goes to, because only displacements start from it.
    pub visited: bool,
    /// What it says.
    pub kind: TargetKind,
}

impl Target {
    /// One in a file and line; from where the robot comes to it is not told yet.
    pub(super) fn at((file, line): (usize, usize), name: String, kind: TargetKind) -> Self {
        Self { file, line, name, approach: Approach::Unknown, arrivals: Vec::new(), visited: true, kind }
    }
}

impl Program {
    /// Takes codes of postures for nothing: a pose means the posture to which the way there leads.
    pub fn heed_no_codes(&mut self) {
        for target in &mut self.targets {
            if let TargetKind::Pose(pose) = &mut target.kind {
                pose.posture.heed_no_codes();
            }
            target.arrivals.iter_mut().for_each(|arrival| arrival.posture.heed_no_codes());
        }
    }
}

/// One way to a target.
#[derive(Debug, Clone, PartialEq)]
pub struct Arrival {
    /// From where the robot comes.
    pub from: Approach,
    /// Which posture the motion means.
    pub posture: MeantPosture,
}

/// From where the robot comes to a target; targets by their index in the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Approach {
    /// Straight from this target.
    From(usize),
    /// From this target by way of others that the text does not tell: the posture goes on, the direction is not known.
    Beyond(usize),
    /// From where it stands when the program begins.
    Begin,
    /// From where it stands when the routine is called.
    Call,
    /// The text does not tell.
    Unknown,
}

impl Approach {
    /// The same with something between that the text does not tell.
    pub fn beyond(self) -> Self {
        match self {
            Self::From(k) | Self::Beyond(k) => Self::Beyond(k),
            Self::Begin | Self::Call | Self::Unknown => Self::Unknown,
        }
    }

    /// The target whose posture goes on.
    pub fn target(self) -> Option<usize> {
        match self {
            Self::From(k) | Self::Beyond(k) => Some(k),
            Self::Begin | Self::Call | Self::Unknown => None,
        }
    }
}

/// What a target says.
#[derive(Debug, Clone, PartialEq)]
pub enum TargetKind {
    /// Joint values.
    Joints(JointTarget),
    /// A pose of the tool.
    Pose(Box<PoseTarget>),
}

impl TargetKind {
    /// True where the text leaves readings out, be it those that the target does not have.
    pub(super) fn leaves_out(&self) -> bool {
        match self {
            Self::Joints(joints) => joints.readings.iter().any(|q| !q.is_finite()),
            Self::Pose(pose) => pose.is_partial(),
        }
    }

    /// True where two poses have the same tool and work object.
    pub(super) fn has_frames_of(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Pose(a), Self::Pose(b)) => {
                (a.flange_from_tool, a.base_from_work) == (b.flange_from_tool, b.base_from_work)
            }
            _ => true,
        }
    }

    /// True where the text leaves numbers out that the target has.
    pub(super) fn is_partial(&self) -> bool {
        match self {
            Self::Joints(joints) => {
                joints.readings.iter().zip(&joints.fields).any(|(q, field)| field.is_some() && !q.is_finite())
            }
            Self::Pose(pose) => pose.is_partial(),
        }
    }

    /// Which posture a motion to it means.
    pub(super) fn posture(&self) -> MeantPosture {
        match self {
            Self::Pose(pose) => pose.posture.clone(),
            Self::Joints(_) => MeantPosture::ByWay(Way::Joints),
        }
    }

    /// Where its first number stands in its file.
    pub(super) fn first_byte(&self) -> usize {
        let start = |f: &Field| match &f.place {
            FieldPlace::At(range) => range.start,
            FieldPlace::Missing(at, _) => *at,
        };
        let first = match self {
            Self::Joints(joints) => joints.fields.iter().flatten().map(start).min(),
            Self::Pose(pose) => match &pose.displaced {
                Some(displaced) => displaced.by.iter().map(start).min(),
                None => pose.position.iter().map(start).min(),
            },
        };
        first.unwrap_or(0)
    }
}

/// Joint values, one for every reading of the chain.
#[derive(Debug, Clone, PartialEq)]
pub struct JointTarget {
    /// rad or m; not finite where the text leaves an axis out.
    pub readings: Vec<f64>,
    /// Their numbers in the text; `None` for those that are held: external axes, and axes that the target does not have.
    pub fields: Vec<Option<Field>>,
    /// `flange_from_tool` and `base_from_work` that the text has on the way there.
    pub frames: Box<[StatedFrame; 2]>,
}

/// A tool or a work object, as a text has it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum StatedFrame {
    /// It has none, or that of the flange or the base, which is what is set where nobody thinks of one.
    #[default]
    Unsaid,
    /// This one.
    One(Pose),
    /// One now, another at another time.
    Several,
    /// One that does not go with the flange, or does not stand in the base.
    Elsewhere,
}

impl StatedFrame {
    /// One that the text has, if it is known, beside that which stands where none was chosen.
    pub(super) fn beside(none: &Pose, known: Option<Pose>) -> Self {
        known.filter(|pose| pose != none).map_or(Self::Unsaid, Self::One)
    }

    /// The one that it has, if it has one.
    pub fn pose(self) -> Option<Pose> {
        if let Self::One(pose) = self { Some(pose) } else { None }
    }

    /// That which is stated beside the text, where the text has none.
    pub(super) fn else_as_stated(self, stated: Option<Pose>) -> Self {
        if self == Self::Unsaid { stated.map_or(self, Self::One) } else { self }
    }

    /// Of a target to which the robot goes again.
    fn again(self, other: Self) -> Self {
        match (self, other) {
            (one, Self::Unsaid) | (Self::Unsaid, one) => one,
            (one, other) if one == other => one,
            _ => Self::Several,
        }
    }
}

/// A pose of the tool in a work object, as the controller computes it with its own model.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseTarget {
    /// Position fields, m.
    pub position: [Field; 3],
    /// Rotation fields.
    pub rotation: RotationFields,
    /// `base_from_work`.
    pub base_from_work: Pose,
    /// `flange_from_tool`.
    pub flange_from_tool: Pose,
    /// Values of the axes that the target fixes beside the pose (external axes), by reading; not finite where the text leaves one out.
    pub fixed: Vec<Option<f64>>,
    /// Which of the postures that reach the pose is meant.
    pub posture: MeantPosture,
    /// Joints that the text gives beside the pose, as taught; rad or m.
    pub taught: Option<Vec<f64>>,
    /// What lies between the point that the fields above say and the target.
    pub displaced: Option<DisplacedTarget>,
    /// Where the joints of the corrected target go, beside the pose: numbers by reading.
    pub joint_fields: Vec<Option<Field>>,
}

/// How a rotation is written.
#[derive(Debug, Clone, PartialEq)]
pub enum RotationFields {
    /// `A`, `B`, `C` with `R = Rz(A) Ry(B) Rx(C)`, rad.
    Abc([Field; 3]),
    /// Rotation vector, rad.
    Vector([Field; 3]),
    /// Quaternion in the order x, y, z, w.
    Quaternion([Field; 4]),
}

/// A target that is another point, displaced (`Offs`, `RelTool`).
#[derive(Debug, Clone, PartialEq)]
pub struct DisplacedTarget {
    /// File and first byte of the other point, as of `TargetKind::first_byte`.
    pub base: (usize, usize),
    /// Displacement, m: along the axes of the tool with `turned`, else of the work object.
    pub by: [Field; 3],
    /// Rotations about x, then the new y, then the new z of the tool, rad.
    pub turned: Option<[Field; 3]>,
}

impl DisplacedTarget {
    /// The displaced pose of a pose in the work object.
    pub fn applied(&self, work_from_base: &Pose) -> Pose {
        let by: nalgebra::Vector3<f64> = self.by.each_ref().map(Field::value).into();
        match &self.turned {
            None => Pose::new(work_from_base.rotation, work_from_base.translation + by),
            Some(turned) => {
                let [x, y, z] = turned.each_ref().map(Field::value);
                *work_from_base * Pose::new(matrix_from_rpy([-x, -y, -z]).transpose(), by)
            }
        }
    }

    /// Edits that make the displacement lead from one pose in the work object to another (to its place only, without `turned`), and
    /// where a reader of the new text arrives.
    pub fn edits(&self, work_from_base: &Pose, wanted: &Pose, files: &[TextFile]) -> (Vec<Edit>, Pose) {
        let mut edits = Vec::new();
        let mut write = |field: &Field, value: f64| {
            let (edit, read) = field.edit(value, &files[field.file].bytes);
            edits.extend(edit);
            Field { written: read / field.si, ..field.clone() }
        };
        let between = work_from_base.inverse() * *wanted;
        let by = match self.turned {
            None => wanted.translation - work_from_base.translation,
            Some(_) => between.translation,
        };
        let by = [0, 1, 2].map(|i| write(&self.by[i], by[i]));
        let turned = self.turned.as_ref().map(|fields| {
            let [x, y, z] = rpy_from_matrix(&between.rotation.transpose());
            let turn = [-x, -y, -z];
            [0, 1, 2].map(|i| write(&fields[i], turn[i]))
        });
        let read = Self { base: self.base, by, turned }.applied(work_from_base);
        (edits, read)
    }
}

/// How the robot goes to a target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// By its joints: to the posture next to that before.
    Joints,
    /// A straight line of the tool: to the posture to which it leads.
    Line,
    /// Another path of the tool: no singular posture lies on it.
    Path,
}

/// Which of the postures that reach a pose is meant; the six readings beside codes are those of axes 1 to 6.
#[derive(Debug, Clone, PartialEq)]
pub enum MeantPosture {
    /// That to which the way from the target before leads.
    ByWay(Way),
    /// That next to these joint values, rad or m.
    Near(Vec<f64>),
    /// One of codes in the text, on this way.
    Coded(Codes, [usize; 6], Way, Heed),
}

/// Whether a controller heeds codes of a posture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Heed {
    /// The posture is that of the codes.
    Heeded,
    /// It is that to which the way leads; the codes must not say another one.
    Unheeded,
    /// It is one or the other: the text does not tell which.
    Unknown,
}

impl MeantPosture {
    /// The same on another way.
    pub fn on(self, way: Way) -> Self {
        match self {
            Self::ByWay(_) => Self::ByWay(way),
            Self::Coded(codes, axes, _, heed) => Self::Coded(codes, axes, way, heed),
            Self::Near(_) => self,
        }
    }

    fn heed_no_codes(&mut self) {
        if let Self::Coded(_, _, way, _) = self {
            *self = Self::ByWay(*way);
        }
    }

    /// Codes that stand in the text, heeded or not.
    pub fn codes(&self) -> Option<(&Codes, &[usize; 6])> {
        match self {
            Self::Coded(codes, axes, ..) => Some((codes, axes)),
            Self::ByWay(_) | Self::Near(_) => None,
        }
    }
}

impl PoseTarget {
    /// `base_from_flange` of the text as it is.
    pub fn base_from_flange(&self) -> Pose {
        self.base_from_work * self.work_from_tool() * self.flange_from_tool.inverse()
    }

    /// Fills numbers of the pose that the text leaves out (not finite so far) with those of the pose before.
    pub(super) fn complete(&mut self, base_from_flange: &Pose) {
        let before = self.base_from_work.inverse() * *base_from_flange * self.flange_from_tool;
        let fill = |field: &mut Field, value: f64| {
            if !field.written.is_finite() {
                field.written = value / field.si;
            }
        };
        self.position.iter_mut().zip(before.xyz()).for_each(|(f, v)| fill(f, v));
        if let RotationFields::Abc(fields) = &mut self.rotation {
            let [c, b, a] = before.rpy();
            fields.iter_mut().zip([a, b, c]).for_each(|(f, v)| fill(f, v));
        }
    }

    /// True where joints are written beside the pose.
    pub fn has_joint_fields(&self) -> bool {
        self.joint_fields.iter().any(Option::is_some)
    }

    /// True where the text leaves numbers out.
    pub(super) fn is_partial(&self) -> bool {
        let rotation = match &self.rotation {
            RotationFields::Abc(f) | RotationFields::Vector(f) => &f[..],
            RotationFields::Quaternion(f) => &f[..],
        };
        let leaves_axes = self.fixed.iter().flatten().any(|place| !place.is_finite());
        leaves_axes || self.position.iter().chain(rotation).any(|f| !f.written.is_finite())
    }

    /// The point that the fields say, in the work object.
    pub(super) fn work_from_base(&self) -> Pose {
        let position = self.position.each_ref().map(Field::value);
        Pose::new(self.rotation.matrix(), position.into())
    }

    fn work_from_tool(&self) -> Pose {
        let base = self.work_from_base();
        self.displaced.as_ref().map_or(base, |displaced| displaced.applied(&base))
    }

    /// Edits that write another `base_from_flange`, and the pose that a reader of the new text finds.
    pub fn edits(&self, base_from_flange: &Pose, files: &[TextFile]) -> (Vec<Edit>, Pose) {
        let new = self.base_from_work.inverse() * *base_from_flange * self.flange_from_tool;
        let mut edits = Vec::new();
        let mut write = |field: &Field, value: f64| {
            let (edit, read) = field.edit(value, &files[field.file].bytes);
            edits.extend(edit);
            read
        };
        let position = [0, 1, 2].map(|i| write(&self.position[i], new.translation[i]));
        let rotation = self.rotation.write(&new, &mut write);
        let read = Pose::new(rotation, position.into());
        (edits, self.base_from_work * read * self.flange_from_tool.inverse())
    }
}

impl RotationFields {
    fn matrix(&self) -> nalgebra::Matrix3<f64> {
        match self {
            Self::Abc(fields) => {
                let [a, b, c] = fields.each_ref().map(Field::value);
                matrix_from_rpy([c, b, a])
            }
            Self::Vector(fields) => exp_so3(&fields.each_ref().map(Field::value).into()),
            Self::Quaternion(fields) => {
                Pose::from_xyz_quaternion([0.0; 3], fields.each_ref().map(Field::value)).rotation
            }
        }
    }

    /// Writes the rotation of `new` in the way nearest to the text as it is; returns what a reader finds.
    fn write(&self, new: &Pose, write: &mut impl FnMut(&Field, f64) -> f64) -> nalgebra::Matrix3<f64> {
        match self {
            Self::Abc(fields) => {
                let old = fields.each_ref().map(Field::value);
                let best = abc_near(&new.rotation, old);
                let [a, b, c] = [0, 1, 2].map(|i| write(&fields[i], best[i]));
                matrix_from_rpy([c, b, a])
            }
            Self::Vector(fields) => {
                let old = nalgebra::Vector3::from(fields.each_ref().map(Field::value));
                let short = log_so3(&new.rotation);
                let angle = short.norm();
                // Whole turns more or less about the same axis say the same.
                let turned =
                    |turns: f64| if angle < 1e-9 { short } else { short * ((angle + 2.0 * PI * turns) / angle) };
                let best = [-2.0, -1.0, 1.0, 2.0]
                    .map(turned)
                    .into_iter()
                    .fold(short, |best, v| if (v - old).norm() < (best - old).norm() - 1e-9 { v } else { best });
                exp_so3(&[0, 1, 2].map(|i| write(&fields[i], best[i])).into())
            }
            Self::Quaternion(fields) => {
                let old = fields.each_ref().map(Field::value);
                let q = new.quaternion_xyzw();
                let sign = if q.iter().zip(old).map(|(a, b)| a * b).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
                let read = [0, 1, 2, 3].map(|i| write(&fields[i], sign * q[i]));
                Pose::from_xyz_quaternion([0.0; 3], read).rotation
            }
        }
    }
}

/// Of all ways to write a rotation as A, B, C (rad), the one nearest to `old`.
fn abc_near(rotation: &nalgebra::Matrix3<f64>, old: [f64; 3]) -> [f64; 3] {
    let [c, b, a] = rpy_from_matrix(rotation);
    let unwound = |abc: [f64; 3]| {
        let turn = |k: usize| abc[k] + 2.0 * PI * ((old[k] - abc[k]) / (2.0 * PI)).round();
        [turn(0), turn(1), turn(2)]
    };
    let far = |abc: &[f64; 3]| abc.iter().zip(old).map(|(x, o)| (x - o).abs()).fold(0.0, f64::max);
    let ways = [unwound([a, b, c]), unwound([a + PI, PI - b, c + PI])];
    if far(&ways[1]) < far(&ways[0]) - 1e-9 { ways[1] } else { ways[0] }
}

impl JointTarget {
    /// The robot goes there again, with these frames.
    pub(super) fn again(&mut self, frames: &[StatedFrame; 2]) {
        self.frames.iter_mut().zip(frames).for_each(|(own, again)| *own = own.again(*again));
    }

    /// Edits that write other readings, and the readings that a reader of the new text finds.
    pub fn edits(&self, readings: &[f64], files: &[TextFile]) -> (Vec<Edit>, Vec<f64>) {
        write_joints(&self.fields, readings, files)
    }
}

/// Edits that write readings where they have a number in the text.
pub(super) fn write_joints(fields: &[Option<Field>], readings: &[f64], files: &[TextFile]) -> (Vec<Edit>, Vec<f64>) {
    let mut edits = Vec::new();
    let write = |(field, value): (&Option<Field>, &f64)| match field {
        None => *value,
        Some(field) => {
            let (edit, read) = field.edit(*value, &files[field.file].bytes);
            edits.extend(edit);
            read
        }
    };
    let read = fields.iter().zip(readings).map(write).collect();
    (edits, read)
}
