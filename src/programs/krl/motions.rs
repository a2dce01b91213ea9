//! Motions of KRL.

use super::aggregate::Aggregate;
use super::assigned::matching;
use super::frames::Frames;
use super::moves::NULL_FRAME;
use super::{EXTERNAL_NAMES, Module, POSE_NAMES, Value};
use crate::error::{Code, Error, Result};
use crate::programs::program::{Heed, MeantPosture, Target, TargetKind, Understood, Way};
use crate::programs::reason::{LeftReason, Why};
use crate::programs::scan::Reader;

/// Motions of the joints; the others lead the tool along a path.
const OF_JOINTS: [&str; 2] = ["PTP", "SPTP"];
/// Motions that lead it along a straight line.
const LINES: [&str; 2] = ["LIN", "SLIN"];
/// Variables of the controller that say where the robot stands.
const STANDS: [&str; 2] = ["$AXIS_ACT", "$POS_ACT"];
/// External axes that do not go where a segment of a spline says (KUKA, *Operating and programming instructions for system integrators*).
const IGNORES_EXTERNAL: &str = "$EX_AX_IGNORE";
/// Components of a pose; status and turn are those behind them.
const COMPONENTS: usize = 6;

/// The posture that a motion means: on paths of the tool, status and turn are not heeded.
fn posture_of(motion: &str, stated: MeantPosture) -> MeantPosture {
    let way = match motion {
        _ if OF_JOINTS.contains(&motion) => Way::Joints,
        _ if LINES.contains(&motion) => Way::Line,
        _ => Way::Path,
    };
    match stated {
        MeantPosture::Coded(codes, axes, ..) if way != Way::Joints => {
            MeantPosture::Coded(codes, axes, way, Heed::Unheeded)
        }
        stated => stated.on(way),
    }
}

/// The first component, or one of so many external axes, that the end of a circle leaves out and its auxiliary point has.
fn missing_at_end(auxiliary: &Aggregate, end: &Aggregate, external: usize) -> Option<&'static str> {
    let external = EXTERNAL_NAMES.into_iter().take(external);
    POSE_NAMES.into_iter().take(COMPONENTS).chain(external).find(|name| auxiliary.has(&[name]) && !end.has(&[name]))
}

/// A motion that is being read.
struct Motion<'m> {
    name: &'m str,
    /// File and line.
    place: (usize, usize),
    frames: Frames,
    /// True where the tool keeps its orientation, or may keep it.
    keeps_orientation: bool,
}

impl Motion<'_> {
    fn needs_target<T>(&self, reader: &Reader<'_>, what: String) -> Result<T> {
        let place = format!("{}:{}", reader.file.name, self.place.1);
        Err(Error::new(Code::ProgramTargets, place, what, "complete the motion"))
    }
}

impl Module<'_> {
    /// A motion; the reader stands on its name.
    pub(super) fn motion(&mut self, reader: &mut Reader<'_>, name: &str, count: usize) -> Result<()> {
        let place = (reader.index, reader.line());
        reader.at += 1;
        let at = reader.at;
        let own = self.with(reader).or(self.spline.as_ref());
        reader.at = at;
        let keeps_orientation = own.keeps_orientation.unwrap_or(self.now.0.keeps_orientation.value);
        let motion = Motion { name, place, frames: own.over(&self.now.0), keeps_orientation };
        let is_robot_alone = self.setting.axes_apart && self.setting.external_axes() == 0;
        if reader.rest_of_line_has(IGNORES_EXTERNAL) && !is_robot_alone {
            let words = "external axes do not go where it says, or may not ($EX_AX_IGNORE)";
            self.leave_at(place.0, place.1, name, Why::new(LeftReason::ExternalAxis, words));
            self.goes_untold();
            self.time_passes();
            return Ok(());
        }
        let mut auxiliary = None;
        for k in 0..count {
            if k > 0 && !reader.take_mark(b',') {
                return motion.needs_target(reader, format!("{name} has {k} targets, not {count}"));
            }
            if reader.at_line_end() {
                return motion.needs_target(reader, format!("{name} has no target"));
            }
            let value = self.value(reader)?;
            let before = self.now.0.off_zero.value.clone();
            self.goes_to(&value, &motion, auxiliary.as_ref());
            if k + 1 < count {
                self.may_stand_as(&before);
            }
            auxiliary = Some(value);
        }
        if reader.rest_of_line_has("CA") {
            let words = "its circle ends at an angle (CA), not at its points: where the real robot ends is not corrected (let it end at a point, without CA)";
            self.leave_at(place.0, place.1, name, Why::new(LeftReason::PathEnd, words));
        }
        self.time_passes();
        Ok(())
    }

    fn goes_to(&mut self, value: &Value, motion: &Motion<'_>, auxiliary: Option<&Value>) {
        if let Value::Name(name) = value
            && name.starts_with('$')
            && !self.values.contains_key(name)
        {
            self.goes_to_variable(name, motion);
            return;
        }
        let elements = self.elements(value);
        // Which element of several the robot goes to, the text does not tell.
        let several = elements.len() > 1;
        if several {
            self.may_carry();
        }
        for value in elements {
            if several {
                self.way.lose(&mut self.now.1);
            }
            let done = self.is_told(&value, auxiliary).and_then(|()| self.visit(&value, motion));
            if let Err(why) = done {
                let points = self.points_in(&value, motion.place.0, motion.place.1);
                self.leave_at(motion.place.0, motion.place.1, motion.name, why.starting_from(points));
            }
            match several {
                true => {
                    self.may_carry();
                    self.way.lose(&mut self.now.1);
                }
                false => self.carries(&value),
            }
        }
    }

    /// A motion to a variable of the controller: to where the robot stands, or to somewhere that the text does not tell.
    fn goes_to_variable(&mut self, name: &str, motion: &Motion<'_>) {
        if STANDS.iter().any(|stands| name.starts_with(stands)) {
            return;
        }
        let words = match name {
            NULL_FRAME => format!("{name} stands for zeros, and has no numbers in the text"),
            _ => format!("{name} is a variable of the controller: what it holds, the text does not tell"),
        };
        self.leave_at(motion.place.0, motion.place.1, motion.name, Why::of(name, LeftReason::Undeclared, words));
        self.goes_untold();
        self.way.lose(&mut self.now.1);
    }

    /// `P[I]` stands for all elements of `P` that the text has, in the order of their numbers; anything else for itself.
    fn elements(&self, value: &Value) -> Vec<Value> {
        let itself = || vec![value.clone()];
        let Value::Name(name) = value else { return itself() };
        if self.values.contains_key(name) || !name.ends_with(']') {
            return itself();
        }
        let mut all: Vec<(Vec<i64>, Value)> =
            self.values.keys().filter_map(|n| Some((matching(n, name)?, Value::Name(n.clone())))).collect();
        if all.is_empty() {
            return itself();
        }
        all.sort_by(|a, b| a.0.cmp(&b.0));
        all.into_iter().map(|(_, v)| v).collect()
    }

    /// What the end of a circle leaves out is that of the position before it: the text does not tell whether the auxiliary point is one.
    fn is_told(&self, value: &Value, auxiliary: Option<&Value>) -> Understood<()> {
        let Some(auxiliary) = auxiliary else { return Ok(()) };
        let (Ok((end, name)), Ok((auxiliary, _))) = (self.resolved(value), self.resolved(auxiliary)) else {
            return Ok(());
        };
        let external = self.setting.external_axes();
        let Some(missing) = missing_at_end(auxiliary, end, external) else { return Ok(()) };
        let words = format!(
            "it leaves out {missing}, which its auxiliary point has: whether that or the start of the circle counts, is not known"
        );
        let why = Why::new(LeftReason::Incomplete, words);
        Err(Why { about: name.map(str::to_owned), ..why })
    }

    fn visit(&mut self, value: &Value, motion: &Motion<'_>) -> Understood<()> {
        let (aggregate, name) = self.resolved(value)?;
        if let Some(frame) = name.filter(|name| self.uses.is_frame(name)) {
            let words = format!("{frame} is $BASE or $TOOL as well, of other targets; give it a position of its own");
            return Err(Why::of(frame, LeftReason::FramesDiffer, words));
        }
        let named = name.unwrap_or(motion.name).to_owned();
        let about = |why: Why| Why { about: name.map(str::to_owned).or(why.about.clone()), ..why };
        let mut kind = self.kind(aggregate, &motion.frames).map_err(about)?;
        self.goes_as_told(&kind, motion).map_err(about)?;
        if let TargetKind::Pose(pose) = &mut kind {
            pose.posture = posture_of(motion.name, pose.posture.clone());
        }
        let place = if name.is_some() { (aggregate.file, aggregate.line) } else { motion.place };
        self.way.visit(Target::at(place, named, kind), &mut self.now.1);
        Ok(())
    }

    /// Refuses targets where the robot does not go to all that they say, or by more.
    fn goes_as_told(&self, kind: &TargetKind, motion: &Motion<'_>) -> Understood<()> {
        if self.now.0.is_sensed.value {
            let words = "a sensor may move the robot on top of it (RSI_ON)";
            return Err(Why::new(LeftReason::FrameUnknown, words));
        }
        let is_path = matches!(kind, TargetKind::Pose(_)) && !OF_JOINTS.contains(&motion.name);
        if is_path && motion.keeps_orientation {
            let words = "the tool keeps its orientation, or may keep it, whatever A, B, C say ($ORI_TYPE, or ORI_TYP of its LDAT: give the .dat as well)";
            return Err(Why::new(LeftReason::OrientationKept, words));
        }
        Ok(())
    }
}
