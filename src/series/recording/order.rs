//! The times of messages in the order of the file: forward, with parts out of their place, in no order, or there twice.

use std::ops::Range;

/// By how much times may go back without a clock that was set, ns: pictures that are compressed side by side come out of order.
const SET_BACK_NS: i64 = 500_000_000;

/// Between parts of a recording times are further apart than so many times their usual step.
const STEPS_APART: i64 = 4;

/// A part of a recording has at least so many messages of a topic; shorter runs are of publishers whose clocks differ.
const LEAST_OF_A_PART: usize = 4;

/// Nobody sets a clock more often within a recording.
const MOST_SET: usize = 8;

/// Of messages as they came, fewer than one in so many are recorded before the one that stands before it.
const ONE_IN: usize = 3;

/// How the messages of a topic stand in the file, by their times of recording.
#[derive(Debug, Clone, Default)]
pub(super) struct Written {
    last_ns: Option<i64>,
    steps: usize,
    back: usize,
}

impl Written {
    pub fn note(&mut self, log_ns: i64) {
        if let Some(last_ns) = self.last_ns.replace(log_ns) {
            self.steps += 1;
            self.back += usize::from(log_ns < last_ns);
        }
    }

    /// True where the messages do not stand as they came, but reversed or mixed, as a whole or block by block.
    pub fn in_no_order(&self) -> bool {
        self.back > MOST_SET && ONE_IN * self.back > self.steps
    }
}

/// Times that are there twice; files and parts of files that were put in another order have none.
pub(super) fn twice(times: impl Iterator<Item = i64> + Clone) -> Vec<Range<i64>> {
    let mut runs = runs(times.clone());
    if times.clone().count() < LEAST_OF_A_PART * runs.len() {
        return back(times);
    }
    runs.sort_by_key(|run| (run.start, run.end));
    let mut latest = i64::MIN;
    let mut twice = Vec::new();
    for run in runs {
        if run.start < latest {
            twice.push(run.start..run.end.min(latest));
        }
        latest = latest.max(run.end);
    }
    twice
}

/// From every time that lies behind the latest one to that.
fn back(times: impl Iterator<Item = i64>) -> Vec<Range<i64>> {
    let mut latest = i64::MIN;
    let mut back = Vec::new();
    for time in times {
        if time < latest.saturating_sub(SET_BACK_NS) {
            back.push(time..latest);
        }
        latest = latest.max(time);
    }
    back
}

/// Stretches that go forward without a gap.
fn runs(times: impl Iterator<Item = i64> + Clone) -> Vec<Range<i64>> {
    let steps = times.clone().zip(times.clone().skip(1)).map(|(one, next)| next.saturating_sub(one));
    let mut forward: Vec<i64> = steps.filter(|step| *step > 0).collect();
    forward.sort_unstable();
    let usual = forward.get(forward.len() / 2).copied().unwrap_or_default();
    let gap = usual.saturating_mul(STEPS_APART).max(SET_BACK_NS);
    let mut runs: Vec<Range<i64>> = Vec::new();
    for time in times {
        let goes_on = |run: &Range<i64>| time >= run.end - SET_BACK_NS && time <= run.end.saturating_add(gap);
        match runs.last_mut().filter(|run| goes_on(run)) {
            Some(run) => *run = run.start.min(time)..run.end.max(time),
            None => runs.push(time..time),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tenths(range: Range<i64>) -> Vec<i64> {
        range.map(|k| k * 100_000_000).collect()
    }

    fn reversed(range: Range<i64>) -> Vec<i64> {
        tenths(range).into_iter().rev().collect()
    }

    #[test]
    fn only_times_that_come_again_are_there_twice() {
        let of = |parts: &[Vec<i64>]| twice(parts.concat().into_iter());
        let back = |from: i64, to: i64| vec![Range { start: from * 100_000_000, end: to * 100_000_000 }];
        assert_eq!(of(&[tenths(0..50), tenths(47..90)]), []);
        assert_eq!(of(&[tenths(0..50), tenths(30..90)]), back(30, 49));
        assert_eq!(of(&[tenths(0..30), tenths(60..90), tenths(30..60)]), []);
        assert_eq!(of(&[tenths(60..90), tenths(30..60), tenths(0..30)]), []);
        assert_eq!(of(&[tenths(0..3), tenths(20..22)]), []);
        // A picture every two seconds.
        let sparse = [0, 20, 40, 60, 50, 70, 90].map(|tenth| tenth * 100_000_000);
        assert_eq!(of(&[sparse.to_vec()]), back(50, 60));
        // Two publishers, one of them two seconds late.
        assert_eq!(of(&[vec![2, 0, 3, 1, 4, 2].into_iter().map(|s| s * 1_000_000_000).collect()]).len(), 3);
    }

    #[test]
    fn messages_that_do_not_stand_as_they_came_are_in_no_order() {
        let of = |parts: &[Vec<i64>]| {
            let mut written = Written::default();
            parts.concat().into_iter().for_each(|time| written.note(time));
            written.in_no_order()
        };
        assert!(of(&[reversed(0..90)]));
        assert!(of(&[reversed(0..10), reversed(10..20), reversed(20..30)]));
        assert!(!of(&[tenths(0..50), tenths(30..90)]));
        assert!(!of(&[tenths(60..90), tenths(30..60), tenths(0..30)]));
    }
}
