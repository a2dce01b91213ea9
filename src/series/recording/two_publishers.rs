//! Joint states of two publishers in one topic: readings that go to and fro as no joint does.

use std::ops::Range;

use super::motion::WINDOW_NS;
use super::samples::JointSample;
use crate::error::{Code, Error, Result};

/// Of two publishers, one sends no more than so many times between two messages of the other where readings are seen to leave and come back.
const MOST_AWAY: usize = 3;
/// A reading that is back after longer may have been moved there and back, ns.
const LONGEST_NS: i64 = 250_000_000;
/// It is back where no more than this share of the way is left.
const BACK: f64 = 0.1;
/// What goes to and fro by less than this share of all that the joint moves may be noise, whatever the unit.
const LEAST_OF_RANGE: f64 = 5e-4;
/// It is none where the joint stands and reads one of two positions, each to within this share of their distance.
const CLEAR: f64 = 0.2;
/// Two positions at one stamp that differ by less than this share of what a joint that stands may move are one, rounded.
const LEAST_OF_STILL: f64 = 0.02;
/// They are of two where they are told apart at one in so many of the stamps at which the joint stands.
const ONE_IN: usize = 10;
/// Or by less than so many of the smallest steps of its readings, but no more than so many times what a joint that stands may move.
const LEAST_STEPS: f64 = 5.0;
const MOST_STILL: f64 = 10.0;
/// Two that differ while the joint moves alone are one and its echo; so many times at least they differ while it stands.
const LEAST_STANDING: usize = 3;
/// A joint stands where it is for so long before and behind, ns, and for so many readings.
const STANDS_NS: u64 = 2 * WINDOW_NS as u64;
const STANDS_READINGS: usize = 2 * (MOST_AWAY + 1);
/// Fewer times, or more seldom than every so many ns: readings that failed.
const LEAST: usize = 10;
const SELDOM_NS: i64 = 10_000_000_000;
/// Readings of a joint that turns on jump by a full turn, rad or deg, to within this share.
const TURNS: [f64; 2] = [std::f64::consts::TAU, 360.0];
const TURN_SHARE: f64 = 0.01;

/// One joint at one time.
#[derive(Debug, Clone, Copy)]
struct Reading<'a> {
    time_ns: i64,
    position: f64,
    sample: &'a JointSample,
}

/// A reading that is left, and the one between it and its return.
type Pair<'a> = [Reading<'a>; 2];

/// Refuses joint states of two publishers: nobody knows which of them the robot follows. `still_speeds`: of each joint, in the units of its
/// readings; `or`: another way out, in words.
///
/// # Errors
/// As the name says, with what each of them shows.
pub(super) fn require_one(
    place: &str,
    samples: &[JointSample],
    joints: &[String],
    still_speeds: &[f64],
    or: &str,
) -> Result<()> {
    let mut most: Option<(&String, Vec<Pair>)> = None;
    for (joint, still_speed) in joints.iter().zip(still_speeds) {
        let readings = readings(samples, joint);
        let still = still_speed * 2e-9 * WINDOW_NS as f64;
        for Found { pairs, standing } in [to_and_fro(&readings, still), at_one_stamp(&readings, still)] {
            if is_often(&readings, pairs.len())
                && standing.len() >= LEAST_STANDING
                && most.as_ref().is_none_or(|(_, others)| standing.len() > others.len())
            {
                most = Some((joint, standing));
            }
        }
    }
    let Some((joint, pairs)) = most else { return Ok(()) };
    let begin_ns = samples.iter().map(|s| s.time_ns).min().unwrap_or_default();
    let remedy = "record one publisher: stop the other (ros2 topic info -v names both), or give it a topic of its own and choose with --joint-topic";
    Err(Error::new(Code::JointStatesOfTwo, place, described(joint, &pairs, begin_ns), format!("{remedy}{or}")))
}

/// The readings of a joint in the order of time.
fn readings<'a>(samples: &'a [JointSample], joint: &str) -> Vec<Reading<'a>> {
    let of = |sample: &'a JointSample| {
        let i = sample.names.iter().position(|name| name == joint)?;
        Some(Reading { time_ns: sample.time_ns, position: sample.positions[i], sample })
    };
    let mut readings: Vec<Reading> = samples.iter().filter_map(of).collect();
    readings.sort_by_key(|reading| reading.time_ns);
    readings
}

fn is_often(readings: &[Reading], count: usize) -> bool {
    let (Some(first), Some(last)) = (readings.first(), readings.last()) else { return false };
    let lasted_ns = last.time_ns.saturating_sub(first.time_ns);
    count >= LEAST && (count as f64) * SELDOM_NS as f64 >= lasted_ns as f64
}

/// Readings that are left and come back at once: all, and those among them where the joint stands.
#[derive(Debug, Default)]
struct Found<'a> {
    pairs: Vec<Pair<'a>>,
    standing: Vec<Pair<'a>>,
}

/// Readings that are left by more than one that stands may move (`still`), and come back at once.
fn to_and_fro<'a>(readings: &[Reading<'a>], still: f64) -> Found<'a> {
    let steps = readings.windows(2).map(|w| (w[1].position - w[0].position).abs());
    let smallest = steps.filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min);
    let (low, high) = range(readings.iter());
    let beyond_noise = still.max(LEAST_OF_RANGE * (high - low)).max((LEAST_STEPS * smallest).min(MOST_STILL * still));
    // Steps of either publisher by itself are those between readings that are not neighbours.
    let apart = |by: usize| readings.iter().zip(readings.iter().skip(by)).map(|(a, b)| (b.position - a.position).abs());
    let digit = (1..=MOST_AWAY + 1).flat_map(apart).filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min);
    let least = still.max(LEAST_STEPS * digit).min(beyond_noise);
    let bound = |from: usize, steps: usize| match is_back(readings, from, steps, beyond_noise) {
        true => Some(beyond_noise),
        false => (is_back(readings, from, steps, least) && is_clear(readings, from)).then_some(least),
    };
    let mut found = Found::default();
    let mut from = 0;
    while from < readings.len() {
        match (2..=MOST_AWAY + 1).find_map(|steps| Some((steps, bound(from, steps)?))) {
            Some((steps, bound)) => {
                let pair = [readings[from], readings[from + 1]];
                let pair = found.pairs.last().map_or(pair, |before| oriented(pair, before));
                found.pairs.push(pair);
                if stands(readings, from, bound) || stands(readings, from + 1, bound) {
                    found.standing.push(pair);
                }
                from += steps;
            }
            None => from += 1,
        }
    }
    found
}

/// The readings for a while before and behind one, so many at least to either side where there are.
fn around(readings: &[Reading], at: usize, least: usize) -> Range<usize> {
    let time_ns = readings[at].time_ns;
    let is_near = |reading: &&Reading| reading.time_ns.abs_diff(time_ns) <= STANDS_NS;
    let before = readings[..at].iter().rev().take_while(is_near).count().max(least.min(at));
    let behind = &readings[at + 1..];
    let behind = behind.iter().take_while(is_near).count().max(least.min(behind.len()));
    at - before..at + 1 + behind
}

/// Whether a reading was there for a while before, and is for a while behind.
fn stands(readings: &[Reading], at: usize, least: f64) -> bool {
    let (near, position) = (around(readings, at, STANDS_READINGS), readings[at].position);
    let is_other = |reading: &Reading| (reading.position - position).abs() >= least;
    let goes_on = |beside: &[Reading]| {
        let mut runs = beside.chunk_by(|a, b| is_other(a) == is_other(b));
        runs.all(|run| run.len() <= MOST_AWAY || !is_other(&run[0]))
    };
    goes_on(&readings[near.start..at]) && goes_on(&readings[at + 1..near.end])
}

/// Whether all that is read for a while about a reading is what it reads, or what the next one does.
fn is_clear(readings: &[Reading], from: usize) -> bool {
    let [left, away] = [from, from + 1].map(|k| readings[k].position);
    let bound = CLEAR * (away - left).abs();
    let is_one = |reading: &Reading| [left, away].iter().any(|own| (reading.position - own).abs() <= bound);
    readings[around(readings, from, STANDS_READINGS)].iter().all(is_one)
}

/// Two readings at one stamp, the lower first, where the joint stands at both and they differ by more than each of them scatters.
fn at_one_stamp<'a>(readings: &[Reading<'a>], still: f64) -> Found<'a> {
    let two = |at_stamp: &[Reading<'a>]| match *at_stamp {
        [a, b] => Some(if a.position <= b.position { [a, b] } else { [b, a] }),
        _ => None,
    };
    let pairs: Vec<Pair> = readings.chunk_by(|a, b| a.time_ns == b.time_ns).filter_map(two).collect();
    let lower: Vec<Reading> = pairs.iter().map(|pair| pair[0]).collect();
    let stays = |at: usize, bound: f64| {
        let near = &pairs[around(&lower, at, MOST_AWAY + 1)];
        near.iter().all(|pair| (0..2).all(|k| (pair[k].position - pairs[at][k].position).abs() <= bound))
    };
    let way = |at: usize| pairs[at][1].position - pairs[at][0].position;
    let standing: Vec<usize> = (0..pairs.len()).filter(|&at| stays(at, still)).collect();
    let is_apart = |at: &usize| way(*at) >= LEAST_OF_STILL * still && stays(*at, CLEAR * way(*at));
    let apart: Vec<Pair> = standing.iter().copied().filter(is_apart).map(|at| pairs[at]).collect();
    let apart = if ONE_IN * apart.len() >= standing.len() { apart } else { Vec::new() };
    Found { pairs: apart.clone(), standing: apart }
}

/// Whether a reading that was there before is left at once, and back after so many steps. A joint that turns back comes from further away.
fn is_back(readings: &[Reading], from: usize, steps: usize, least: f64) -> bool {
    let (left, Some(back)) = (&readings[from], readings.get(from + steps)) else { return false };
    let far = |reading: &Reading| (reading.position - left.position).abs();
    let away = &readings[from + 1..from + steps];
    let way = away.iter().map(far).fold(f64::INFINITY, f64::min);
    let before = &readings[from.saturating_sub(MOST_AWAY + 1)..from];
    let is_turn = |way: f64| TURNS.iter().any(|turn| (way - turn).abs() < TURN_SHARE * turn);
    way >= least
        && far(back) <= BACK * way
        && before.iter().any(|reading| far(reading) <= BACK * way)
        && back.time_ns.saturating_sub(left.time_ns) <= LONGEST_NS
        && !away.iter().map(far).any(is_turn)
}

/// The pair in the order of the one before it: one of them goes on, or both are as far apart as they were.
fn oriented<'a>(pair: Pair<'a>, before: &Pair) -> Pair<'a> {
    let [one, other] = pair.map(|reading| reading.position);
    let [was_one, was_other] = before.map(|reading| reading.position);
    let apart = |one: f64, other: f64| {
        let differences = [one - was_one, other - was_other, other - one - (was_other - was_one)];
        differences.into_iter().map(f64::abs).fold(f64::INFINITY, f64::min)
    };
    if apart(other, one) < apart(one, other) { [pair[1], pair[0]] } else { pair }
}

fn range<'a, 'b: 'a>(readings: impl Iterator<Item = &'a Reading<'b>>) -> (f64, f64) {
    readings.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), r| (low.min(r.position), high.max(r.position)))
}

/// What the two show, and what in their messages tells them apart.
fn described(joint: &str, pairs: &[Pair], begin_ns: i64) -> String {
    let ranges = [0, 1].map(|k| range(pairs.iter().map(|pair| &pair[k])));
    let names = names(pairs);
    let shown = [0, 1].map(|k| format!("{} reads {:.4} to {:.4}", names[k], ranges[k].0, ranges[k].1));
    let [left, away] = pairs[0];
    format!(
        "holds joint states of two publishers: {joint} goes to and fro {} times where it stands, at first {:.2} s after the first joint state between {:.4} and \
         {:.4}; {}, {}",
        pairs.len(),
        left.time_ns.saturating_sub(begin_ns) as f64 * 1e-9,
        left.position,
        away.position,
        shown[0],
        shown[1]
    )
}

/// The two by the marks of their messages that always differ; without any they are just two.
fn names(pairs: &[Pair]) -> [String; 2] {
    let marks = |reading: &Reading| {
        let joints = format!("joints {}", reading.sample.names.join(" "));
        reading.sample.marks.iter().cloned().chain([joints]).collect::<Vec<_>>()
    };
    let of_first = pairs[0].each_ref().map(marks);
    let is_constant = |mark: usize| {
        pairs.iter().all(|pair| {
            let own = pair.each_ref().map(marks);
            (0..2).all(|k| own[k].get(mark) == of_first[k].get(mark))
        })
    };
    let differ = |mark: &usize| of_first[0].get(*mark) != of_first[1].get(*mark) && is_constant(*mark);
    let telling: Vec<usize> = (0..of_first[0].len()).filter(differ).collect();
    let named = |k: usize, plain: &str| {
        let own: Vec<&str> = telling.iter().filter_map(|mark| of_first[k].get(*mark)).map(String::as_str).collect();
        if own.is_empty() { plain.to_owned() } else { format!("{plain} ({})", own.join(", ")) }
    };
    [named(0, "the one"), named(1, "the other")]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::rc::Rc;

    const MS: i64 = 1_000_000;

    /// A joint that moves 0.4 rad in every third second, as recorded every 10 ms.
    fn position(time_ns: i64) -> f64 {
        let seconds = time_ns as f64 * 1e-9;
        0.3 + 0.4 * ((seconds / 3.0).floor() + (seconds % 3.0 - 2.0).max(0.0))
    }

    fn sample(time_ns: i64, position: f64, frame: &str) -> JointSample {
        JointSample {
            time_ns,
            names: Rc::new(vec!["a".to_owned()]),
            positions: vec![position],
            unread: Rc::default(),
            marks: Rc::new(vec![frame.to_owned()]),
        }
    }

    /// The robot, and another publisher every so many ms.
    fn recorded(every_ms: i64, other: impl Fn(i64) -> f64) -> Vec<JointSample> {
        let own = (0..2000).map(|k| sample(k * 10 * MS, position(k * 10 * MS), "arm"));
        let others = (0..20_000 / every_ms).map(|k| (k * every_ms + 5) * MS).map(|t| sample(t, other(t), "gui"));
        own.chain(others).collect()
    }

    fn refused(samples: &[JointSample]) -> Option<Error> {
        require_one("run.mcap", samples, &["a".to_owned()], &[5e-3], "").err()
    }

    #[test]
    fn two_publishers_are_named_with_what_each_of_them_shows() {
        for every_ms in [10, 20, 33, 100, 1000] {
            let error = refused(&recorded(every_ms, |_| 0.0)).unwrap();
            assert_eq!(error.code, Code::JointStatesOfTwo, "{every_ms}");
            assert!(["gui", "arm"].iter().all(|frame| error.what.contains(frame)), "{error}");
            // Once a second, beside a joint that moves a third of the time, is less than `LEAST` times in 20 s.
            let is_told = refused(&recorded(every_ms, |t| position(t) + 0.01)).is_some();
            assert_eq!(is_told, every_ms < 1000, "{every_ms}");
        }
    }

    /// A joint that never moves has no other step than that from the one to the other; what the other sends may move all the time.
    #[test]
    fn two_publishers_of_a_joint_that_stands_are_told_apart() {
        let alternating = |other: &dyn Fn(i64) -> f64| {
            (0..2000).map(|k| sample(k * 10 * MS, if k % 2 == 0 { 0.5 } else { other(k) }, "arm")).collect::<Vec<_>>()
        };
        let stands = alternating(&|_| 0.0);
        let moves = alternating(&|k| 0.3 * (k as f64 * 0.01).sin());
        for samples in [stands, moves] {
            assert_eq!(refused(&samples).map(|error| error.code), Some(Code::JointStatesOfTwo));
        }
    }

    /// A relay: both agree wherever the joint stands.
    #[test]
    fn one_that_sends_what_another_sent_before_is_an_echo() {
        for (every_ms, late_ms) in [(4, 50), (10, 50), (20, 50), (4, 90)] {
            let own = (0..20_000 / every_ms).map(|k| k * every_ms * MS).map(|t| sample(t, position(t), "arm"));
            let late = |t: i64| position((t - late_ms * MS).max(0));
            let others = (0..20_000 / every_ms).map(|k| (k * every_ms + every_ms / 2) * MS);
            let all: Vec<JointSample> = own.chain(others.map(|t| sample(t, late(t), "relay"))).collect();
            assert!(refused(&all).is_none(), "every {every_ms} ms, {late_ms} ms late");
        }
    }

    /// What is commanded beside what is reached, closer than a share of the range of the joint: of one stamp, and a little later.
    #[test]
    fn two_publishers_that_nearly_agree_are_told_where_the_joint_stands() {
        let noise = |k: i64| 2e-5 * ((k * 7919) % 11 - 5) as f64 / 5.0;
        let both = |every_ms: i64, late_ms: i64, apart: f64| {
            let own = (0..20_000 / every_ms).map(|k| (k, k * every_ms * MS));
            let two = |(k, t): (i64, i64)| {
                let (own, other) = (20.0 * position(t), 20.0 * position(t + late_ms * MS) + apart);
                [sample(t, own + noise(k), "arm"), sample(t + late_ms * MS, other + noise(k + 3), "arm")]
            };
            own.flat_map(two).collect::<Vec<_>>()
        };
        let code = |samples: &[JointSample]| refused(samples).map(|error| error.code);
        for (every_ms, late_ms, apart) in
            [(20, 0, 1.8e-3), (20, 0, -3e-4), (100, 0, 1e-3), (4, 0, 1e-3), (20, 6, 1.8e-3)]
        {
            let samples = both(every_ms, late_ms, apart);
            assert_eq!(code(&samples), Some(Code::JointStatesOfTwo), "{every_ms} {late_ms} {apart}");
        }
        // The same again, with other digits, and with the noise of a reading of its own; two readings of one publisher at every stamp.
        for apart in [0.0, 1e-7] {
            assert_eq!(code(&both(20, 0, apart)), None, "{apart}");
        }
        for digit in [1e-3, 1e-5] {
            let at = |k: i64| position(k / 2 * 20 * MS) + digit * ((k * k * 7919 / 13) % 3) as f64;
            let coarse = (0..2000).map(|k| sample(k / 2 * 20 * MS, at(k), "arm")).collect::<Vec<_>>();
            assert_eq!(code(&coarse), None, "{digit}");
        }
    }

    #[test]
    fn what_one_publisher_sends_is_none_of_two() {
        let own = recorded(10, position);
        assert!(refused(&own).is_none(), "the same robot twice");
        // The last digit, in rad and in degrees; a joint that waits at the end of a turn; some readings that failed.
        let flickers = |digit: f64, factor: f64| {
            let at = |k: i64| factor * position(k * 10 * MS) + if (k * 7919) % 5 == 0 { digit } else { 0.0 };
            (0..2000).map(|k| sample(k * 10 * MS, at(k), "arm")).collect::<Vec<_>>()
        };
        assert!(refused(&flickers(1e-4, 1.0)).is_none());
        assert!(refused(&flickers(0.01, 1f64.to_degrees())).is_none());
        assert!(refused(&flickers(-std::f64::consts::TAU, 1.0)).is_none());
        // A coarse digit, beyond what a joint that stands may move and the share of its range.
        let at = |k: i64| 2e-3 * ((position(k * 10 * MS) / 2e-3).round() + f64::from((k * 7919) % 5 == 0));
        let coarse: Vec<JointSample> = (0..2000).map(|k| sample(k * 10 * MS, at(k), "arm")).collect();
        assert!(refused(&coarse).is_none());
        let mut failed = own.clone();
        (0..9).for_each(|k| failed[100 + 200 * k].positions[0] = 57.0);
        assert!(refused(&failed).is_none());
        // A joint that turns back again and again.
        let shakes = (0..2000).map(|k| sample(k * 10 * MS, 0.1 * (k as f64 * 0.6).sin(), "arm")).collect::<Vec<_>>();
        assert!(refused(&shakes).is_none());
    }
}
