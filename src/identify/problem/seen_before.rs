//! Images that show exactly what one before them shows: copies, by themselves or with their readings.

use std::collections::HashMap;

use crate::problem::{MeasuredSeries, MeasuredStop};

/// A marker and the bits of its place in the image.
type FirstSeen = (u32, [u64; 2]);

/// Images that were looked at, with their series, by what they show first.
#[derive(Default)]
pub(super) struct SeenBefore<'a>(HashMap<FirstSeen, Vec<(&'a MeasuredSeries, &'a MeasuredStop)>>);

impl<'a> SeenBefore<'a> {
    /// Of every image of the next series the name of the first before it that shows exactly the same: in the series itself, or with the same
    /// readings in one before it, which is named then.
    pub fn originals(&mut self, series: &'a MeasuredSeries) -> Vec<Option<String>> {
        series.stops.iter().map(|stop| self.original(series, stop)).collect()
    }

    fn original(&mut self, series: &'a MeasuredSeries, stop: &'a MeasuredStop) -> Option<String> {
        let first = stop.observations.first()?;
        let alike = self.0.entry((first.marker, first.uv.map(f64::to_bits))).or_default();
        let is_own = |other: &MeasuredSeries| std::ptr::eq(other, series);
        let is_original = |(other, before): &&(&MeasuredSeries, &MeasuredStop)| {
            before.observations == stop.observations && (is_own(other) || before.readings == stop.readings)
        };
        let original = alike.iter().find(is_original).map(|(other, before)| match is_own(other) {
            true => before.image.clone(),
            false => format!("{}/{}", other.name, before.image),
        });
        alike.push((series, stop));
        original
    }
}
