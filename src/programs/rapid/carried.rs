//! External axes: where moves leave those that the description lacks. One that a target does not use (`9E9`) keeps its place.

use super::moves::{external_target_of, writes_found};
use super::off_zero::places;
use super::statements::arguments;
use super::still::is_still;
use super::value::{ExternalAxes, Node, array_of, external_name, is_set};
use super::{Datum, Task};
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
        if let Node::Word(name) = value
            && self.has_known_elements(name)
        {
            return self.may_carry();
        }
        let Some(places) = self.places_of(value) else { return self.goes_untold() };
        let mut off_zero = self.switching.now().off_zero.value().clone();
        places.into_iter().for_each(|(axis, place)| off_zero.put(axis, place));
        self.switching.axes_are(off_zero);
    }

    /// Where a target puts external axes, by their number from 0; `None` where the text does not tell.
    fn places_of(&self, value: &Node) -> Option<Vec<(usize, Option<f64>)>> {
        let declared = |name: &str| self.declared(name).ok().map(|(target, _)| target);
        let target = match value {
            Node::List(_) => value.clone(),
            Node::Word(name) => declared(name)?,
            Node::DisplacedTarget(displaced) => declared(&displaced.point)?,
            _ => return None,
        };
        places(&target)
    }

    /// Notes what a text moves beside the arm: to where none of the files tells, external axes that the description lacks may stand anywhere. It is taken
    /// that it moves those of the description, where that has any.
    pub(super) fn moves_external_axes(&mut self, mut reader: Reader<'_>) {
        self.switching.file_begins(reader.index);
        while !reader.done() {
            let (word, line) = (reader.name().filter(|word| !self.switching.has_routine(word)), reader.line());
            reader.at += 1;
            let Some((word, targets)) = word.and_then(|word| external_target_of(&word).map(|targets| (word, targets)))
            else {
                continue;
            };
            let start = reader.at;
            let read = arguments(&mut reader, (&word, line)).ok();
            reader.at = start;
            let target = read.and_then(|read| read.plain.into_iter().nth(targets.skipped));
            let places = target.filter(|target| target.is_whole).and_then(|target| self.written_places(&target.value));
            let all = &mut self.switching.put_anywhere;
            match places {
                None if self.setting.external_axes() == 0 => all.note_all(),
                None => {}
                // It stops anywhere on the way.
                Some(places) if writes_found(&word) => places.iter().for_each(|(axis, _)| all.note(*axis, None)),
                // They are noted where the target stands.
                Some(_) => {}
            }
        }
    }

    /// Where the text of a target puts external axes, whatever changes it later, by their number from 0; of an array, where its elements do.
    fn written_places(&self, value: &Node) -> Option<Vec<(usize, Option<f64>)>> {
        let Node::Word(name) = value else { return places(value) };
        let of = |datum: &Datum| places(datum.value.as_ref().or(datum.before.as_ref())?);
        let Some(array) = name.strip_suffix("{}") else { return of(self.data.get(self.meant(name))?) };
        let elements = self.data.iter().filter(|(key, _)| array_of(key) == Some(array));
        let all = elements.map(|(_, datum)| of(datum)).collect::<Option<Vec<_>>>()?;
        (!all.is_empty()).then(|| all.concat())
    }

    /// Behind the point on a circle: its external axes are not heeded (ABB, *Technical reference manual RAPID Instructions, Functions and Data types*,
    /// `MoveC`).
    pub(super) fn passes(&mut self, value: &Node) {
        let before = self.switching.now().off_zero.value().clone();
        self.carries(value);
        let either = self.switching.now().off_zero.value().either(&before);
        self.switching.axes_are(either);
    }

    /// Refuses the end of a circle that leaves out an axis of the description which the point on it has: that stands where it stood before that point.
    pub(super) fn tells_axes_of(&self, end: &Node, on_circle: &Node) -> Understood<()> {
        let known = self.setting.external_axes();
        // An end that the text does not tell is left as such, and elements of an array are looked at one by one.
        let (Some(on_circle), Some(end)) = (self.places_of(on_circle), self.places_of(end)) else { return Ok(()) };
        let is_missing = |axis: &usize| *axis < known && end.iter().all(|(told, _)| told != axis);
        let missing = on_circle.into_iter().map(|(axis, _)| axis).find(is_missing);
        let why = missing.map(|axis| {
            let axis = external_name(axis);
            Why::new(
                LeftReason::Incomplete,
                format!("it leaves out {axis}, which the point on its circle has: write it"),
            )
        });
        why.map_or(Ok(()), Err)
    }

    /// Behind something of which the text does not tell where it goes.
    pub(super) fn goes_untold(&mut self) {
        self.switching.put_anywhere.note_untold();
        self.may_carry();
    }

    /// Where the text does not tell from where the robot comes.
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
        self.goes_untold();
        match GUIDED.contains(&word) {
            true => self.way.lose(self.switching.stands()),
            false => self.way.may_go(self.switching.stands()),
        }
    }

    /// Refuses a target whose axes do not go where it says: one is moved independently of it, or external ones by more.
    pub(super) fn goes_as_told(&self, is_of_joints: bool, external: &Understood<ExternalAxes>) -> Understood<()> {
        let known = self.setting.external_axes();
        let left = |words| Err(Why::new(LeftReason::ExternalAxis, words));
        if !is_of_joints && self.has_seventh_joint() {
            return left(
                "its eax is the angle of an arm with seven joints, not that of a joint (write it as a jointtarget)",
            );
        }
        if self.setting.axes_apart && known == 0 {
            return Ok(());
        }
        if !self.switching.now().independent.value().is_empty() {
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
    pub(super) fn keeps_at_zero(&self, external: &ExternalAxes) -> Understood<()> {
        let known = self.setting.external_axes();
        let leaves_out = |axis| axis >= known && external.get(axis).is_none_or(|(value, _)| *value >= NO_AXIS);
        let why = self.switching.now().off_zero.value().why_kept(leaves_out, external_name);
        why.filter(|_| !self.setting.axes_apart).map_or(Ok(()), Err)
    }
}
