//! External axes `E1` to `E6`: where motions leave those that the description lacks. What a position leaves out keeps its place.

use super::aggregate::{external_name, is_foreign};
use super::{Aggregate, Module, Now, Value, unset};
use crate::programs::external::OffZero;
use crate::programs::flow::{Either, Held};
use crate::programs::program::Understood;

impl Module<'_> {
    /// Where a program begins, or a routine that no file calls: the program before may have left the axes anywhere.
    pub(super) fn begun(&self) -> Now {
        let (mut active, stands) = unset();
        active.off_zero = Held::new(self.off_zero_anywhere.clone());
        (active, stands)
    }

    /// Behind a motion to a value.
    pub(super) fn carries(&mut self, value: &Value) {
        let written: Option<Vec<_>> = match (self.resolved(value), value) {
            (Ok((a, _)), _) | (Err(_), Value::Aggregate(a)) => Some(a.externals().collect()),
            (Err(_), _) => None,
        };
        let Some(written) = written else { return self.goes_untold() };
        let mut off_zero = self.now.0.off_zero.value.clone();
        written.into_iter().for_each(|(axis, place)| off_zero.put(axis, place));
        self.axes_are(off_zero);
    }

    /// Behind something of which the text does not tell where it goes.
    pub(super) fn goes_untold(&mut self) {
        self.put_anywhere.note_untold();
        self.may_carry();
    }

    /// Where the text does not tell from where the robot comes.
    pub(super) fn may_carry(&mut self) {
        self.axes_are(self.now.0.off_zero.value.either(&self.off_zero_anywhere));
    }

    /// Behind the auxiliary point of a circle: whether its external axes count, the text does not tell.
    pub(super) fn may_stand_as(&mut self, before: &OffZero) {
        self.axes_are(self.now.0.off_zero.value.either(before));
    }

    fn axes_are(&mut self, off_zero: OffZero) {
        if off_zero != self.now.0.off_zero.value {
            self.now.0.off_zero.set(off_zero);
        }
    }

    /// Refuses a pose that leaves out an axis which the description lacks and which may stand elsewhere than at zero.
    pub(super) fn keeps_at_zero(&self, a: &Aggregate) -> Understood<()> {
        let axes = self.setting.axes;
        let leaves_out = |axis| is_foreign(axis, axes) && a.externals().all(|(written, _)| written != axis);
        let why = self.now.0.off_zero.value.why_kept(leaves_out, external_name);
        why.filter(|_| !self.setting.axes_apart).map_or(Ok(()), Err)
    }
}
