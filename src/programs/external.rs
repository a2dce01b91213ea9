//! External axes of which the description knows nothing: where statements have left them.

use std::collections::BTreeMap;

use super::held::Either;
use super::reason::Why;

/// What RAPID writes for an external axis that a target does not use (ABB, *Technical reference manual: RAPID Instructions, Functions and Data types*, `extjoint`), and beyond.
pub(super) const NO_AXIS: f64 = 9e9;

/// Axes of the arm in the languages of programs; those behind them are external.
pub(super) const ARM_AXES: usize = 6;
/// External axes of KRL (`E1` to `E6`) and of RAPID (`eax_a` to `eax_f`).
const EXTERNAL_AXES: usize = 6;

/// Those that may stand elsewhere than at zero, by their number from 0: in the unit of the program, `None` where the text does not tell where.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct OffZero(BTreeMap<usize, Option<f64>>);

impl OffZero {
    /// A target moves an axis.
    pub fn put(&mut self, axis: usize, place: Option<f64>) {
        match place {
            Some(0.0) => _ = self.0.remove(&axis),
            _ => _ = self.0.insert(axis, place),
        }
    }

    /// Why a pose stays as it is that leaves an axis out: one of which `leaves_out` is true stands elsewhere than at zero, or may do so.
    pub fn why_kept(&self, leaves_out: impl Fn(usize) -> bool, name: impl Fn(usize) -> String) -> Option<Why> {
        let (axis, place) = self.0.iter().find(|(axis, _)| leaves_out(**axis))?;
        Some(Why::external_kept(&name(*axis), *place))
    }
}

/// Where the texts put external axes, wherever that is.
#[derive(Debug, Clone, Default)]
pub(super) struct PutAnywhere {
    /// By their number from 0: in the unit of the program, `None` where they do not tell.
    places: Vec<(usize, Option<f64>)>,
    /// True where something goes of which they do not tell where.
    goes_untold: bool,
}

impl PutAnywhere {
    /// A text puts an axis there.
    pub fn note(&mut self, axis: usize, place: Option<f64>) {
        self.places.push((axis, place));
    }

    /// A text may put any of them anywhere: it moves such axes alone, to where none tells.
    pub fn note_all(&mut self) {
        self.places.extend((0..EXTERNAL_AXES).map(|axis| (axis, None)));
    }

    /// Something goes of which the texts do not tell where. Of an axis that the description lacks it is taken that it stands at zero, unless a text
    /// itself puts it elsewhere.
    pub fn note_untold(&mut self) {
        self.goes_untold = true;
    }

    /// Those that the texts put elsewhere than at zero, at places that count as not known.
    pub fn off_zero(&self) -> OffZero {
        OffZero(self.places.iter().filter(|(_, place)| *place != Some(0.0)).map(|(axis, _)| (*axis, None)).collect())
    }

    /// Those of the description, by their readings: `axes` are the readings of the program's axes, `si` the unit of a reading.
    pub fn by_reading(&self, axes: &[usize], si: impl Fn(usize) -> f64) -> Vec<(usize, Option<f64>)> {
        let one = |(axis, place): &(usize, Option<f64>)| {
            let reading = *axes.get(ARM_AXES + axis)?;
            Some((reading, place.map(|value| value * si(reading))))
        };
        let untold = axes.iter().skip(ARM_AXES).filter(|_| self.goes_untold).map(|reading| (*reading, None));
        self.places.iter().filter_map(one).chain(untold).collect()
    }
}

/// One of several ways: an axis that stands at zero on one of them only may stand elsewhere.
impl Either for OffZero {
    fn either(&self, other: &Self) -> Self {
        let place = |of: &Self, axis: &usize| of.0.get(axis).copied().unwrap_or(Some(0.0));
        let one = |axis: &usize| {
            let (own, other) = (place(self, axis), place(other, axis));
            (*axis, own.filter(|_| own == other))
        };
        Self(self.0.keys().chain(other.0.keys()).map(one).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_goes_where_no_text_tells_may_have_moved_axes_of_the_description_alone() {
        let axes = [1, 2, 3, 4, 5, 6, 0];
        let mut put = PutAnywhere::default();
        put.note(0, Some(500.0));
        assert_eq!(put.by_reading(&axes, |_| 1e-3), [(0, Some(0.5))]);
        put.note_untold();
        assert_eq!(put.by_reading(&axes, |_| 1e-3), [(0, Some(0.5)), (0, None)]);
        assert_eq!(put.by_reading(&axes[..6], |_| 1e-3), []);
        assert_eq!(put.off_zero(), OffZero(BTreeMap::from([(0, None)])));
    }

    #[test]
    fn an_axis_that_is_at_zero_on_one_way_only_may_stand_anywhere() {
        let mut rail = OffZero::default();
        rail.put(0, Some(500.0));
        rail.put(1, Some(20.0));
        rail.put(1, Some(0.0));
        assert_eq!(rail, OffZero(BTreeMap::from([(0, Some(500.0))])));
        let unknown = OffZero(BTreeMap::from([(0, None)]));
        assert_eq!(rail.either(&OffZero::default()), unknown);
        assert_eq!(OffZero::default().either(&rail), unknown);
        assert_eq!(rail.either(&unknown), unknown);
        assert_eq!(rail.either(&rail), rail);
        assert_eq!(rail.why_kept(|axis| axis == 1, |_| String::new()), None);
    }
}
