//! External axes: where moves leave those that the description lacks. One that a target does not use (`9E9`) keeps its place.

use std::ops::Range;

use super::Task;
use super::off_zero::places;
use super::still::is_still;
use super::value::{Node, external_name, is_set};
use crate::programs::external::NO_AXIS;
use crate::programs::flow::Either;
use crate::programs::program::Understood;
use crate::programs::reason::{LeftReason, Why};
use crate::programs::scan::Reader;

/// Instructions under which a sensor or another computer moves the robot (ABB, *Application manual Externally Guided Motion*).
const GUIDED: [&str; 2] = ["EGMRUNJOINT", "EGMRUNPOSE"];

impl Task<'_> {
    /// Behind a move to a value.
    pub(super) fn carries(&mut self, value: &Node) {
        let target = match value {
            Node::List(_) => Some(value.clone()),
            Node::Word(name) => self.declared(name).ok().map(|(target, _)| target),
            Node::DisplacedTarget(displaced) => self.declared(&displaced.point).ok().map(|(target, _)| target),
            _ => None,
        };
        let Some(places) = target.as_ref().and_then(places) else { return self.may_carry() };
        let mut off_zero = self.switching.now().off_zero.value().clone();
        places.into_iter().for_each(|(axis, place)| off_zero.put(axis, place));
        self.switching.axes_are(off_zero);
    }

    /// Behind something of which the text does not tell where it goes.
    pub(super) fn may_carry(&mut self) {
        let off_zero = self.switching.now().off_zero.value().either(&self.switching.off_zero_anywhere);
        self.switching.axes_are(off_zero);
    }

    /// Behind a statement that is no known move, on whose first word the reader stands: an instruction that moves external axes alone, or a routine in
    /// none of the files, may have moved anything.
    pub(super) fn may_go(&mut self, reader: &mut Reader<'_>, word: &str) {
        if self.switching.has_routine(word) || is_still(word) || is_set(reader) {
            return;
        }
        self.may_carry();
        match GUIDED.contains(&word) {
            true => self.way.lose(self.switching.stands()),
            false => self.way.may_go(self.switching.stands()),
        }
    }

    /// Refuses a target whose axes do not go where it says: one is moved independently of it, or external ones by more.
    pub(super) fn goes_as_told(
        &self,
        is_of_joints: bool,
        external: &Understood<[(f64, Range<usize>); 6]>,
    ) -> Understood<()> {
        let known = self.setting.axes.len().saturating_sub(6);
        let left = |words| Err(Why::new(LeftReason::ExternalAxis, words));
        if !is_of_joints && self.has_seventh_joint() {
            return left(
                "its eax is the angle of an arm with seven joints, not that of a joint (write it as a jointtarget)",
            );
        }
        if self.setting.axes_apart && known == 0 {
            return Ok(());
        }
        if *self.switching.now().independent.value() {
            return left("an axis is moved independently of it (IndAMove, IndRMove, ..), or may be");
        }
        // Axis angles are those of the robot wherever an axis stands that the description lacks.
        let matter = if is_of_joints || self.setting.axes_apart { known } else { usize::MAX };
        let Ok(external) = external else { return Ok(()) };
        let has_external = external.iter().take(matter).any(|(value, _)| *value < NO_AXIS);
        if *self.switching.now().offset.value() && has_external && !self.move_switches.has_no_offset {
            return left("an offset of external axes (EOffsOn, EOffsSet) may be active");
        }
        Ok(())
    }

    /// True where an axis beside the first six lies above axis 1, in the arm: a robtarget then says how its elbow is turned about the line from shoulder to wrist
    /// (ABB, *Product manual IRB 14000*, arm angle).
    fn has_seventh_joint(&self) -> bool {
        let (arm, beside) = self.setting.axes.split_at(self.setting.axes.len().min(6));
        let joints = &self.setting.chain.joints;
        let place = |reading: &usize| {
            joints.iter().position(|joint| joint.drive.as_ref().is_some_and(|drive| drive.reading == *reading))
        };
        let first = arm.iter().filter_map(place).min();
        beside.iter().filter_map(place).any(|k| first.is_some_and(|first| k > first))
    }

    /// Refuses a pose that does not use an axis which the description lacks and which may stand elsewhere than at zero.
    pub(super) fn keeps_at_zero(&self, external: &[(f64, Range<usize>); 6]) -> Understood<()> {
        let known = self.setting.axes.len().saturating_sub(6);
        let leaves_out = |axis| axis >= known && external.get(axis).is_none_or(|(value, _)| *value >= NO_AXIS);
        let why = self.switching.now().off_zero.value().why_kept(leaves_out, external_name);
        why.filter(|_| !self.setting.axes_apart).map_or(Ok(()), Err)
    }
}
