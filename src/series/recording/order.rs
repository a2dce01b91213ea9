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

/// Stamps of one publisher that are there twice because its clock was set back by more than a few steps: its messages come one after the
/// other, before and behind, and their stamps are those of before once more. Of each: time of recording, and from the stamp to there, ns.
pub(super) fn set_back(messages: &[(i64, i64)]) -> Vec<Range<i64>> {
    let stamps: Vec<i64> = messages.iter().map(|(log_ns, delay_ns)| log_ns - delay_ns).collect();
    let mut steps: Vec<i64> = stamps.windows(2).map(|w| w[1] - w[0]).filter(|step| *step > 0).collect();
    steps.sort_unstable();
    let longest = steps.get(steps.len() * 9 / 10).map_or(i64::MAX, |step| step.saturating_mul(STEPS_APART));
    let goes_on =
        |part: &[i64]| part.len() == LEAST_OF_A_PART && part.windows(2).all(|w| (0..=longest).contains(&(w[1] - w[0])));
    let is_back = |k: &usize| {
        let back = stamps[*k] < stamps[k - 1].saturating_sub(longest) && messages[*k].0 >= messages[k - 1].0;
        back && goes_on(&stamps[k.saturating_sub(LEAST_OF_A_PART)..*k])
            && goes_on(&stamps[*k..(k + LEAST_OF_A_PART).min(stamps.len())])
    };
    let set: Vec<usize> = (1..stamps.len()).filter(is_back).take(MOST_SET + 1).collect();
    if set.len() > MOST_SET {
        return Vec::new();
    }
    let twice = set.into_iter().map(|k| (k, stamps[k]..stamps[k - 1]));
    let are_there = |(k, stretch): &(usize, Range<i64>)| {
        [&stamps[..*k], &stamps[*k..]].into_iter().all(|part| is_dense(part, stretch, longest))
    };
    twice.filter(are_there).map(|(_, stretch)| stretch).collect()
}

/// Whether there are times all over a stretch.
fn is_dense(times: &[i64], stretch: &Range<i64>, longest: i64) -> bool {
    let mut inside: Vec<i64> = times.iter().copied().filter(|time| stretch.contains(time)).collect();
    inside.extend([stretch.start, stretch.end]);
    inside.sort_unstable();
    inside.windows(2).all(|w| w[1] - w[0] <= longest)
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

    /// Steps of 10 ms; recorded as they came, 1 ms after what they say or by another clock.
    #[test]
    fn a_clock_that_is_set_back_by_less_than_half_a_second_is_told_by_its_messages() {
        let hundredths = |range: Range<i64>| range.map(|k| k * 10_000_000).collect::<Vec<i64>>();
        let of = |parts: &[Vec<i64>]| {
            let came = parts.concat().into_iter().enumerate();
            set_back(&came.map(|(k, stamp)| (k as i64 * 10_000_000, k as i64 * 10_000_000 - stamp)).collect::<Vec<_>>())
        };
        let back = |from: i64, to: i64| vec![Range { start: from * 10_000_000, end: to * 10_000_000 }];
        assert_eq!(of(&[hundredths(0..500), hundredths(470..900)]), back(470, 499));
        assert_eq!(of(&[hundredths(0..500), hundredths(494..900)]), back(494, 499));
        assert_eq!(of(&[hundredths(0..500), hundredths(300..900)]), back(300, 499));
        // By a few steps, as messages that overtake each other; one that comes late; a part out of its place.
        assert_eq!(of(&[hundredths(0..500), hundredths(497..900)]), []);
        assert_eq!(of(&[hundredths(0..500), hundredths(480..481), hundredths(500..900)]), []);
        assert_eq!(of(&[hundredths(0..400), hundredths(440..480), hundredths(400..440), hundredths(480..900)]), []);
        // Two publishers by two clocks; a recorder whose clock was set as well.
        let two: Vec<i64> = (0..500).flat_map(|k| [k * 10_000_000, k * 10_000_000 - 305_000_000]).collect();
        assert_eq!(of(&[two]), []);
        let stamps = [hundredths(0..500), hundredths(470..900)].concat();
        assert_eq!(set_back(&stamps.into_iter().map(|stamp| (stamp, 0)).collect::<Vec<_>>()), []);
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
