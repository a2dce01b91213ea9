//! When the robot stood still, and where its joints were at a given time.

use super::samples::JointSample;

/// All joints at one time.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Posture {
    pub time_ns: i64,
    /// rad or m.
    pub positions: Vec<f64>,
    /// How long before its time the position was read that is the oldest, ns.
    pub oldest_ns: i64,
}

/// A time without motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Standstill {
    pub from_ns: i64,
    pub to_ns: i64,
}

/// Speed is taken over this time to either side, so that the encoder's last digit is no motion, ns.
pub(super) const WINDOW_NS: i64 = 50_000_000;
/// Without a sample for this long nobody knows whether the robot moved, ns.
pub(super) const LONGEST_GAP_NS: i64 = 1_000_000_000;
/// Two standstills at the same posture that are interrupted for less than this are one, ns.
const INTERRUPTION_NS: i64 = 500_000_000;

/// Postures of the named joints from samples that may each hold some of them, in the order of time.
///
/// A joint keeps its last value until a sample has a new one, for as long as nothing else can have happened; nothing is given out while
/// some are not known.
pub(super) fn postures(samples: &[JointSample], joints: &[String]) -> Vec<Posture> {
    let mut order: Vec<&JointSample> = samples.iter().collect();
    order.sort_by_key(|s| s.time_ns);
    let mut last: Vec<Option<(f64, i64)>> = vec![None; joints.len()];
    let mut postures: Vec<Posture> = Vec::new();
    for sample in order {
        let mut new = false;
        for (slot, joint) in last.iter_mut().zip(joints) {
            if let Some(i) = sample.names.iter().position(|n| n == joint) {
                *slot = Some((sample.positions[i], sample.time_ns));
                new = true;
            }
        }
        let known = |slot: &Option<(f64, i64)>| {
            let (position, time_ns) = (*slot)?;
            (sample.time_ns.saturating_sub(time_ns) <= LONGEST_GAP_NS).then_some(position)
        };
        let read = last.iter().flatten().map(|(_, time_ns)| *time_ns).min();
        let oldest_ns = read.map_or(0, |time_ns| sample.time_ns.saturating_sub(time_ns));
        let Some(positions) = last.iter().map(known).collect::<Option<Vec<f64>>>().filter(|_| new) else { continue };
        match postures.last_mut() {
            Some(previous) if previous.time_ns == sample.time_ns => {
                (previous.positions, previous.oldest_ns) = (positions, oldest_ns);
            }
            _ => postures.push(Posture { time_ns: sample.time_ns, positions, oldest_ns }),
        }
    }
    postures
}

/// Largest joint speed about a sample, rad/s or m/s; infinite where samples are too far apart to tell.
fn speed(postures: &[Posture], i: usize) -> f64 {
    let at = postures[i].time_ns;
    let reach = |p: &Posture| (p.time_ns - at).abs() >= WINDOW_NS;
    let before = postures[..i].iter().rev().find(|p| reach(p)).or(postures.first());
    let after = postures[i..].iter().find(|p| reach(p)).or(postures.last());
    let (Some(before), Some(after)) = (before, after) else { return f64::INFINITY };
    let gap = postures[i.saturating_sub(1)..(i + 2).min(postures.len())]
        .windows(2)
        .map(|w| w[1].time_ns - w[0].time_ns)
        .max()
        .unwrap_or(i64::MAX);
    let time_ns = after.time_ns - before.time_ns;
    if time_ns < WINDOW_NS || gap > LONGEST_GAP_NS {
        return f64::INFINITY;
    }
    furthest(&before.positions, &after.positions) / (time_ns as f64 * 1e-9)
}

fn furthest(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

/// Times of at least `least_ns` in which no joint was faster than `still_speed` (rad/s or m/s).
pub(super) fn standstills(postures: &[Posture], still_speed: f64, least_ns: i64) -> Vec<Standstill> {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for i in 0..postures.len() {
        if speed(postures, i) > still_speed {
            continue;
        }
        match runs.last_mut() {
            Some((_, last)) if belongs(postures, *last, i, still_speed) => *last = i,
            _ => runs.push((i, i)),
        }
    }
    let span = |(first, last): (usize, usize)| (postures[first].time_ns, postures[last].time_ns);
    let times = runs.into_iter().map(span).filter(|(from, to)| to - from >= least_ns);
    times.map(|(from_ns, to_ns)| Standstill { from_ns, to_ns }).collect()
}

/// Whether a still sample continues the run that ended with sample `last`.
fn belongs(postures: &[Posture], last: usize, i: usize, still_speed: f64) -> bool {
    let same =
        furthest(&postures[last].positions, &postures[i].positions) <= still_speed * INTERRUPTION_NS as f64 * 1e-9;
    i == last + 1 || (same && postures[i].time_ns - postures[last].time_ns <= INTERRUPTION_NS)
}

/// Where the joints were at a time.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Interpolated {
    pub positions: Vec<f64>,
    /// Largest joint speed there, rad/s or m/s.
    pub speed: f64,
    /// From the nearest sample of the joint whose samples are furthest, ns.
    pub nearest_ns: i64,
}

/// How far the joint that moved most moved between two times, rad or m; `None` where a time has no posture.
pub(super) fn moved(postures: &[Posture], from_ns: i64, to_ns: i64) -> Option<f64> {
    let (from, to) = (between(postures, from_ns)?, between(postures, to_ns)?);
    let at = |(before, after, share): (usize, usize, f64), joint: usize| {
        let (a, b) = (postures[before].positions[joint], postures[after].positions[joint]);
        a + share * (b - a)
    };
    let joints = 0..postures[from.0].positions.len();
    Some(joints.map(|joint| (at(to, joint) - at(from, joint)).abs()).fold(0.0, f64::max))
}

/// Linear interpolation between the samples around a time; `None` before the first, after the last, or in a gap.
pub(super) fn interpolate(postures: &[Posture], time_ns: i64) -> Option<Interpolated> {
    let (previous, next, share) = between(postures, time_ns)?;
    let (before, after) = (&postures[previous], &postures[next]);
    let positions = before.positions.iter().zip(&after.positions).map(|(a, b)| a + share * (b - a)).collect();
    let nearest = if share > 0.5 { next } else { previous };
    Some(Interpolated {
        positions,
        speed: speed(postures, nearest),
        nearest_ns: (time_ns - postures[nearest].time_ns).abs() + postures[nearest].oldest_ns,
    })
}

/// The samples before and after a time, and where it stands between them, 0 to 1.
fn between(postures: &[Posture], time_ns: i64) -> Option<(usize, usize, f64)> {
    let next = postures.partition_point(|p| p.time_ns < time_ns);
    let after = postures.get(next)?;
    let previous = if after.time_ns == time_ns { next } else { next.checked_sub(1)? };
    let before = &postures[previous];
    let span = after.time_ns - before.time_ns;
    if span > LONGEST_GAP_NS {
        return None;
    }
    Some((previous, next, if span == 0 { 0.0 } else { (time_ns - before.time_ns) as f64 / span as f64 }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::rc::Rc;

    const MS: i64 = 1_000_000;

    /// 100 Hz, encoder noise of 20 urad; joint 0 moves at 0.5 rad/s in 1 s..2 s and 4 s..5 s, creeps at 0.02 rad/s from 6 s on.
    fn recording() -> Vec<Posture> {
        let position = |t: f64| {
            let moved = (t - 1.0).clamp(0.0, 1.0) + (t - 4.0).clamp(0.0, 1.0);
            0.5 * moved + 0.02 * (t - 6.0).max(0.0)
        };
        (0..800)
            .map(|i| {
                let t = f64::from(i) * 0.01;
                let noise = 2e-5 * f64::from((i * 7919) % 3 - 1);
                let positions = vec![position(t) + noise, 1.0 - noise];
                Posture { time_ns: i64::from(i) * 10 * MS, positions, oldest_ns: 0 }
            })
            .collect()
    }

    #[test]
    fn standstills_are_found_between_motions() {
        let still = standstills(&recording(), 5e-3, 300 * MS);
        let seconds: Vec<_> = still.iter().map(|s| (s.from_ns / MS, s.to_ns / MS)).collect();
        assert_eq!(seconds.len(), 3, "{seconds:?}");
        // The window of 50 ms to either side and one sample blur the ends.
        for ((from, to), (start, end)) in seconds.iter().zip([(0, 1000), (2000, 4000), (5000, 6000)]) {
            assert!((from - start).abs() <= 60 && (to - end).abs() <= 60, "{seconds:?}");
        }
        assert!(standstills(&recording(), 5e-3, 1500 * MS).len() == 1);
    }

    #[test]
    fn a_gap_is_no_standstill() {
        let mut postures = recording();
        postures.retain(|p| !(2100 * MS..3900 * MS).contains(&p.time_ns));
        let still = standstills(&postures, 5e-3, 300 * MS);
        assert!(still.iter().all(|s| s.to_ns <= 2100 * MS || s.from_ns >= 3900 * MS), "{still:?}");
        assert_eq!(interpolate(&postures, 3000 * MS), None);
    }

    #[test]
    fn joints_are_interpolated_at_the_stamp() {
        let postures = recording();
        let moving = interpolate(&postures, 1505 * MS).unwrap();
        // Half way between samples of 20 urad noise.
        assert!((moving.positions[0] - 0.2525).abs() < 2e-5, "{moving:?}");
        assert!((moving.speed - 0.5).abs() < 1e-3 && moving.nearest_ns == 5 * MS, "{moving:?}");
        assert_eq!(interpolate(&postures, 1500 * MS).unwrap().positions, postures[150].positions);
        assert_eq!(interpolate(&postures, -1), None);
        assert_eq!(interpolate(&postures, 8000 * MS), None);
        assert_eq!(interpolate(&postures, 0).unwrap().positions, postures[0].positions);
    }

    #[test]
    fn joints_of_two_publishers_are_put_together() {
        let sample = |time_ns, name: &str, q| JointSample {
            time_ns,
            names: Rc::new(vec![name.to_string()]),
            positions: vec![q],
            unread: Rc::default(),
            marks: Rc::default(),
        };
        let samples = [sample(30, "a", 3.0), sample(10, "a", 1.0), sample(20, "b", 2.0), sample(40, "c", 4.0)];
        let joints = ["a".to_string(), "b".to_string()];
        let got: Vec<_> =
            postures(&samples, &joints).into_iter().map(|p| (p.time_ns, p.positions, p.oldest_ns)).collect();
        assert_eq!(got, [(20, vec![1.0, 2.0], 10), (30, vec![3.0, 2.0], 10)]);
        // One that falls silent may have moved.
        let silent =
            [samples.to_vec(), vec![sample(20 + LONGEST_GAP_NS, "a", 5.0), sample(21 + LONGEST_GAP_NS, "a", 5.0)]];
        assert_eq!(postures(&silent.concat(), &joints).len(), 3);
    }
}
