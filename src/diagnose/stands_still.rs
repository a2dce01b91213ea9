//! A joint that reads the same for a while, to the last digit, where the others move: it may not have been read any more.

use std::fmt;

use crate::problem::{MeasuredSeries, MeasuredStop};

/// Stops, one after the other, at which a joint reads the same.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StandsStill {
    /// How many.
    pub stops: usize,
    /// First and last of them.
    pub between: [String; 2],
}

impl StandsStill {
    /// The only run of more stops than `few`, if it is not all of them: a rail stands still again and again, and so does an arm of which several
    /// images are taken at every stop.
    fn only<'a>(runs: impl Iterator<Item = &'a [Read<'a>]>, few: usize, all: usize) -> Option<Self> {
        let mut long = runs.filter(|run| (few + 1..all).contains(&run.len()));
        let (run, None) = (long.next()?, long.next()) else { return None };
        let [(first, _), .., (last, _)] = run else { return None };
        Some(Self { stops: run.len(), between: [first, last].map(|stop| stop.image.clone()) })
    }
}

impl fmt::Display for StandsStill {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [first, last] = &self.between;
        write!(f, "the same at {} stops, {first} to {last}", self.stops)
    }
}

/// A stop with its readings.
type Read<'a> = (&'a MeasuredStop, &'a [f64]);

/// The stops of a series that are told apart by this.
fn stops<T: PartialEq>(series: &MeasuredSeries, by: impl Fn(&Read) -> T) -> Vec<Read<'_>> {
    let mut stops: Vec<Read> = series.stops.iter().filter_map(|stop| Some((stop, stop.readings.as_deref()?))).collect();
    stops.dedup_by(|a, b| by(a) == by(b));
    stops
}

/// The run of stops of a series at which this reading is the same while others change, where these are more than `few` and the reading
/// changes elsewhere.
pub fn stands_still(series: &MeasuredSeries, reading: usize, few: usize) -> Option<StandsStill> {
    let stops = stops(series, |(_, readings)| readings.to_vec());
    StandsStill::only(stops.chunk_by(|(_, a), (_, b)| a[reading] == b[reading]), few, stops.len())
}

/// The same of all readings together.
pub fn all_stand_still(series: &MeasuredSeries, few: usize) -> Option<StandsStill> {
    let stops = stops(series, |(stop, _)| stop.row);
    StandsStill::only(stops.chunk_by(|(_, a), (_, b)| a == b), few, stops.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(readings: &[[f64; 2]]) -> MeasuredSeries {
        let stop = |(row, readings): (usize, &[f64; 2])| MeasuredStop {
            row,
            image: format!("{row}"),
            readings: Some(readings.to_vec()),
            placement: String::new(),
            observations: Vec::new().into(),
            left_out: None,
        };
        MeasuredSeries::without_images("run", true, readings.iter().enumerate().map(stop).collect())
    }

    #[test]
    fn a_joint_that_is_not_read_any_more_is_told_from_one_that_does_not_move() {
        let frozen = series(&[[0.1, 1.0], [0.2, 2.0], [0.3, 3.0], [0.3, 4.0], [0.3, 5.0], [0.3, 6.0]]);
        let found = stands_still(&frozen, 0, 3).unwrap();
        assert_eq!((found.stops, found.between), (4, ["2".to_owned(), "5".to_owned()]));
        assert_eq!(stands_still(&frozen, 0, 4), None, "too few");
        assert_eq!(stands_still(&frozen, 1, 3), None, "it moves");
        let rail = [0.1, 0.1, 0.1, 0.2, 0.2, 0.2, 0.3].into_iter().enumerate().map(|(k, q)| [q, k as f64]);
        assert_eq!(stands_still(&series(&rail.collect::<Vec<_>>()), 0, 2), None, "a rail");
        assert_eq!(stands_still(&series(&[[0.3, 1.0], [0.3, 2.0], [0.3, 3.0], [0.3, 4.0]]), 0, 3), None, "never moved");
        let twice = [[0.1, 1.0], [0.3, 3.0], [0.3, 3.0], [0.3, 3.0], [0.3, 3.0]];
        assert_eq!(stands_still(&series(&twice), 0, 3), None, "at one stop nothing moves");
        assert_eq!(all_stand_still(&series(&twice), 3).unwrap().stops, 4);
        assert_eq!(all_stand_still(&frozen, 3), None);
    }
}
