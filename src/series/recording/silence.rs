//! Times in which joints are not known because their publisher fell silent.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;
use std::rc::Rc;

use super::motion::{LONGEST_GAP_NS, WINDOW_NS};
use super::samples::JointSample;
use crate::error::{Code, Notice};

/// From one time to another, ns.
type Span = (i64, i64);

/// Joints without a sample for too long to know where they were, between the first sample of any joint and the last one.
fn silences<'a>(samples: &[JointSample], joints: &'a [String]) -> BTreeMap<Span, Vec<&'a str>> {
    let times = samples.iter().map(|s| s.time_ns);
    let mut silent: BTreeMap<Span, Vec<&str>> = BTreeMap::new();
    let Some((first, last)) = times.clone().min().zip(times.max()) else { return silent };
    let mut by_names: BTreeMap<&[String], Vec<i64>> = BTreeMap::new();
    for of_one_topic in samples.chunk_by(|a, b| Rc::ptr_eq(&a.names, &b.names)) {
        by_names.entry(&of_one_topic[0].names).or_default().extend(of_one_topic.iter().map(|s| s.time_ns));
    }
    for joint in joints {
        let own = by_names.iter().filter(|(names, _)| names.contains(joint)).flat_map(|(_, times)| times);
        let mut told: Vec<i64> = own.copied().chain([first, last]).collect();
        told.sort_unstable();
        let gaps = told.windows(2).filter(|w| w[1].saturating_sub(w[0]) > LONGEST_GAP_NS);
        gaps.for_each(|w| silent.entry((w[0], w[1])).or_default().push(joint));
    }
    silent
}

/// Says which joints fell silent while so many of the images were taken, where joints are later by `later_ns` (at least, at most) in the time
/// of the images.
pub(super) fn notices(
    recording: &Path,
    samples: &[JointSample],
    joints: &[String],
    (images, later_ns): (&[i64], Span),
) -> Vec<Notice> {
    let begin = samples.iter().map(|s| s.time_ns).min().unwrap_or_default();
    let seconds = |ns: i64| ns.saturating_sub(begin) as f64 * 1e-9;
    let mut lost: BTreeMap<Vec<&str>, Vec<(Span, usize)>> = BTreeMap::new();
    for ((from, to), silent) in silences(samples, joints) {
        let count = images.iter().filter(|t| (from + later_ns.0..to + later_ns.1).contains(t)).count();
        if count > 0 {
            lost.entry(silent).or_default().push(((from, to), count));
        }
    }
    let notice = |(silent, lost): (Vec<&str>, Vec<(Span, usize)>)| {
        let span = |((from, to), _): &(Span, usize)| format!("from {:.1} s to {:.1} s", seconds(*from), seconds(*to));
        let times: Vec<String> = lost.iter().take(SHOWN).map(span).collect();
        let what = format!(
            "no readings of {} {}{} after the first joint state: {} images of {} are not used",
            silent.join(", "),
            times.join(", "),
            if lost.len() > SHOWN { ", .." } else { "" },
            lost.iter().map(|(_, count)| count).sum::<usize>(),
            if lost.len() > 1 { "these times" } else { "that time" }
        );
        let remedy = "find out why the publisher fell silent, and record those stops again";
        Notice::new(Code::JointSilent, recording.display(), what, remedy)
    };
    let mut in_time: Vec<_> = lost.into_iter().collect();
    in_time.sort_by_key(|(_, lost)| lost.first().map(|(span, _)| *span));
    in_time.into_iter().map(notice).collect()
}

/// A joint is missing where so many of its usual steps have no sample.
const MISSING_STEPS: i64 = 3;

/// Times in which a joint has no readings though others have: drivers write NaN for joints that they could not read.
#[derive(Debug, Default)]
pub(super) struct Gaps<'a>(BTreeMap<&'a str, Vec<Span>>);

/// The readings of one joint, in the order of time.
struct Own<'a> {
    readings: Vec<(i64, f64)>,
    /// Times at which its publisher told others and not it.
    untold: Vec<i64>,
    /// Times of all samples.
    all: &'a [i64],
    /// Slower than this it stands, in units of its readings.
    still_speed: f64,
}

impl<'a> Own<'a> {
    fn of(samples: &[JointSample], all: &'a [i64], joint: &String, still_speed: f64) -> Self {
        let reading = |s: &JointSample| {
            let at = s.names.iter().position(|name| name == joint)?;
            Some((s.time_ns, s.positions[at]))
        };
        let mut readings: Vec<(i64, f64)> = samples.iter().filter_map(reading).collect();
        readings.sort_by_key(|(time_ns, _)| *time_ns);
        let beside: BTreeSet<&String> =
            samples.iter().filter(|s| s.names.contains(joint)).flat_map(|s| s.names.iter()).collect();
        let lacks = |s: &&JointSample| {
            !s.names.contains(joint) && (s.unread.contains(joint) || s.names.iter().any(|name| beside.contains(name)))
        };
        let mut untold: Vec<i64> = samples.iter().filter(lacks).map(|s| s.time_ns).collect();
        untold.sort_unstable();
        Self { readings, untold, all, still_speed }
    }

    fn gaps(&self) -> Vec<Span> {
        let mut steps: Vec<i64> = self.readings.windows(2).map(|w| w[1].0 - w[0].0).collect();
        steps.sort_unstable();
        let least = steps.get(steps.len() / 2).map_or(WINDOW_NS, |usual| WINDOW_NS.max(MISSING_STEPS * usual));
        let between = self.readings.windows(2).map(|w| (w[0].0, w[1].0, self.moved(w[0], w[1])));
        // Nobody knows where it went in the end; a publisher that sends less while nothing moves may be silent as long as before.
        let longest = steps.last().copied().unwrap_or(0);
        let end = self.readings.last().zip(self.all.last());
        let end = end.map(|((from, _), to)| (*from, *to + 1, to - from > longest));
        let is_gap = |&(from, to, moved): &(i64, i64, bool)| {
            let (span, inside) = (to - from, from + 1..to);
            // Not those that all joints have.
            let middle = from + span / 4..to - span / 4;
            span > least
                && (has(&self.untold, &inside)
                    || (span > LONGEST_GAP_NS && has(self.all, &inside))
                    || (moved && has(self.all, &middle)))
        };
        between.chain(end).filter(is_gap).map(|(from, to, _)| (from, to)).collect()
    }

    fn moved(&self, (from, before): (i64, f64), (to, after): (i64, f64)) -> bool {
        (after - before).abs() > self.still_speed * (to - from) as f64 * 1e-9
    }
}

/// One of the times, which are in order, is in the range.
fn has(times: &[i64], range: &Range<i64>) -> bool {
    times.get(times.partition_point(|t| *t < range.start)).is_some_and(|t| range.contains(t))
}

impl<'a> Gaps<'a> {
    /// A joint whose publisher sends less often while it stands has none; `still_speeds`: of each joint, in the units of its readings.
    pub fn of(samples: &[JointSample], joints: &'a [String], still_speeds: &[f64]) -> Self {
        let mut all: Vec<i64> = samples.iter().map(|s| s.time_ns).collect();
        all.sort_unstable();
        let of_joint = |(joint, still_speed): (&'a String, &f64)| {
            let gaps = Own::of(samples, &all, joint, *still_speed).gaps();
            (!gaps.is_empty()).then_some((joint.as_str(), gaps))
        };
        Self(joints.iter().zip(still_speeds).filter_map(of_joint).collect())
    }

    /// Leaves out the images of these times, where joints are later by `later_ns` (at least, at most) in the time of the images, and says
    /// so of those that are not told by [`notices`].
    pub fn leave_out(&self, recording: &Path, begin_ns: i64, later_ns: Span, images: &mut Vec<i64>) -> Vec<Notice> {
        let all = images.clone();
        let is_in = |t: i64, (from, to): &Span| (from + later_ns.0 + 1..to + later_ns.1).contains(&t);
        images.retain(|t| !self.0.values().flatten().any(|gap| is_in(*t, gap)));
        let told = self.0.iter().filter_map(|(joint, gaps)| {
            let lost = |gap: &&Span| gap.1 - gap.0 <= LONGEST_GAP_NS && all.iter().any(|t| is_in(*t, gap));
            let with_images: Vec<&Span> = gaps.iter().filter(lost).collect();
            let count = all.iter().filter(|t| with_images.iter().any(|gap| is_in(**t, gap))).count();
            let seconds = |ns: i64| ns.saturating_sub(begin_ns) as f64 * 1e-9;
            let times: Vec<String> =
                with_images.iter().take(SHOWN).map(|(a, b)| format!("{:.2} s to {:.2} s", seconds(*a), seconds(*b))).collect();
            let more = if with_images.len() > SHOWN { ", .." } else { "" };
            let what = format!(
                "no readings of {joint} for a part of the time, {}{more} after the first joint state: {count} images of these times are not used",
                times.join(", ")
            );
            let remedy = "find out why it was not read (NaN), and record stops again that are lost by it";
            (count > 0).then(|| Notice::new(Code::JointSilent, recording.display(), what, remedy))
        });
        told.collect()
    }
}

/// Times that are named.
const SHOWN: usize = 10;

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: i64 = 1_000_000_000;
    const HUNDREDTH: i64 = SECOND / 100;
    const STILL: [f64; 2] = [5e-3; 2];

    #[test]
    fn joints_that_fall_silent_are_named_with_the_images_that_are_lost() {
        let sample = |joint: &str, tenth: i64| JointSample {
            time_ns: tenth * SECOND / 10,
            names: Rc::new(vec![joint.to_owned()]),
            positions: vec![0.0],
            unread: Rc::default(),
            marks: Rc::default(),
        };
        // "b" pauses for half a second, then ends after four seconds of ten.
        let of_b = (0..40).filter(|tenth| !(20..24).contains(tenth));
        let samples: Vec<_> = (0..100).map(|t| sample("a", t)).chain(of_b.map(|t| sample("b", t))).collect();
        let joints = ["a".to_owned(), "b".to_owned()];
        let silent = silences(&samples, &joints);
        assert_eq!(silent, BTreeMap::from([((39 * SECOND / 10, 99 * SECOND / 10), vec!["b"])]));
        let images: Vec<i64> = (0..12).map(|s| s * SECOND).collect();
        let told = notices(Path::new("run.mcap"), &samples, &joints, (&images, (0, 0)));
        assert_eq!(told.iter().map(|n| n.code).collect::<Vec<_>>(), [Code::JointSilent]);
        assert!(told[0].what.contains("6 images"), "{told:?}");
        assert_eq!(notices(Path::new("run.mcap"), &samples, &joints, (&images[..4], (0, 0))), []);
        // A second earlier in the time of the images.
        let earlier = (-SECOND, -SECOND);
        assert_eq!(notices(Path::new("run.mcap"), &samples, &joints, (&images[..4], earlier)).len(), 1);
        assert_eq!(notices(Path::new("run.mcap"), &samples, &joints, (&images[9..], earlier)), []);
    }

    #[test]
    fn joints_that_fall_silent_again_and_again_are_named_once() {
        let joints = ["a".to_owned(), "b".to_owned()];
        // Half a second of readings, two seconds of none, five times.
        let samples: Vec<JointSample> =
            (0..1300).filter(|k| k % 250 < 50).map(|k| sample(k, &[("a", 0.0), ("b", 0.0)], &[])).collect();
        let images: Vec<i64> = (0..1300).step_by(50).map(|k| k * HUNDREDTH).collect();
        let told = notices(Path::new("run.mcap"), &samples, &joints, (&images, (0, 0)));
        assert_eq!(told.iter().map(|n| n.code).collect::<Vec<_>>(), [Code::JointSilent], "{told:?}");
    }

    /// "b" is not read for a third of a second while an image is taken; half a second later nothing is recorded at all.
    #[test]
    fn images_in_the_gap_of_one_joint_are_left_out_and_others_stay() {
        let names = |joints: &[&str]| Rc::new(joints.iter().map(|&j| j.to_owned()).collect::<Vec<_>>());
        let (both, a) = (names(&["a", "b"]), names(&["a"]));
        let at = |hundredth: i64| {
            let names = if (101..134).contains(&hundredth) { &a } else { &both };
            let positions = vec![0.0; names.len()];
            let (time_ns, names) = (hundredth * SECOND / 100, Rc::clone(names));
            JointSample { time_ns, names, positions, unread: Rc::default(), marks: Rc::default() }
        };
        let samples: Vec<_> = (0..300).filter(|k| !(181..220).contains(k)).map(at).collect();
        let joints = ["a".to_owned(), "b".to_owned()];
        let gaps = Gaps::of(&samples, &joints, &STILL);
        assert_eq!(gaps.0, BTreeMap::from([("b", vec![(SECOND, 134 * SECOND / 100)])]));
        let mut images: Vec<i64> = [90, 110, 120, 140, 200].iter().map(|k| k * SECOND / 100).collect();
        let told = gaps.leave_out(Path::new("run.mcap"), 0, (0, 0), &mut images);
        assert_eq!(images, [90, 140, 200].map(|k| k * SECOND / 100));
        assert_eq!(told.iter().map(|n| n.code).collect::<Vec<_>>(), [Code::JointSilent]);
        let mut later: Vec<i64> = vec![140 * SECOND / 100];
        assert_eq!(gaps.leave_out(Path::new("run.mcap"), 0, (SECOND / 5, SECOND / 5), &mut later).len(), 1);
        assert_eq!(later, [] as [i64; 0]);
    }

    /// Joints at times in hundredths of a second, each with what is told of it.
    fn sample(hundredth: i64, told: &[(&str, f64)], unread: &[&str]) -> JointSample {
        let names = |joints: Vec<&str>| Rc::new(joints.into_iter().map(str::to_owned).collect::<Vec<_>>());
        JointSample {
            time_ns: hundredth * HUNDREDTH,
            names: names(told.iter().map(|(joint, _)| *joint).collect()),
            positions: told.iter().map(|(_, position)| *position).collect(),
            unread: names(unread.to_vec()),
            marks: Rc::default(),
        }
    }

    /// "b" is NaN for 1.2 s, and from 2.5 s to the end; alone on its topic or beside "a". None of it is a time with readings.
    #[test]
    fn long_silences_and_those_at_the_end_are_gaps_from_their_first_moment() {
        let joints = ["a".to_owned(), "b".to_owned()];
        let lacks = |k: i64| (101..220).contains(&k) || k >= 250;
        let beside = |k: i64| match lacks(k) {
            true => vec![sample(k, &[("a", 0.0)], &["b"])],
            false => vec![sample(k, &[("a", 0.0), ("b", 0.0)], &[])],
        };
        let alone = |k: i64| {
            let b = if lacks(k) { sample(k, &[], &["b"]) } else { sample(k, &[("b", 0.0)], &[]) };
            vec![sample(k, &[("a", 0.0)], &[]), b]
        };
        for samples in [(0..=300).flat_map(beside).collect::<Vec<_>>(), (0..=300).flat_map(alone).collect()] {
            let gaps = Gaps::of(&samples, &joints, &STILL);
            let expected = vec![(100 * HUNDREDTH, 220 * HUNDREDTH), (249 * HUNDREDTH, 300 * HUNDREDTH + 1)];
            assert_eq!(gaps.0, BTreeMap::from([("b", expected)]));
            let mut images: Vec<i64> = [90, 110, 180, 230, 260, 300].map(|k| k * HUNDREDTH).to_vec();
            let told = gaps.leave_out(Path::new("run.mcap"), 0, (0, 0), &mut images);
            assert_eq!((images, told.len()), ([90, 230].map(|k| k * HUNDREDTH).to_vec(), 1));
        }
    }

    /// Where it is open by which clock, images of either are left out.
    #[test]
    fn a_gap_lasts_by_both_clocks_where_it_is_open_which_is_right() {
        let gaps = Gaps(BTreeMap::from([("b", vec![(SECOND, 2 * SECOND)])]));
        let mut images: Vec<i64> = [70, 90, 150, 199, 210].map(|k| k * HUNDREDTH).to_vec();
        gaps.leave_out(Path::new("run.mcap"), 0, (-SECOND / 5, 0), &mut images);
        assert_eq!(images, [70, 210].map(|k| k * HUNDREDTH));
    }

    /// "b" is told 50 times a second while it moves and twice while it stands, up to the end; "a" 100 times.
    #[test]
    fn a_publisher_that_sends_less_while_nothing_moves_leaves_no_gap() {
        let joints = ["a".to_owned(), "b".to_owned()];
        let b = |k: i64| ((k % 2 == 0 && k <= 400) || k % 50 == 0).then_some(1e-3 * k.min(400) as f64);
        let recorded = |jump: f64| -> Vec<JointSample> {
            let at = |k: i64| {
                let b = b(k).map(|q| sample(k, &[("b", if k >= 600 { q + jump } else { q })], &[]));
                [Some(sample(k, &[("a", 0.0)], &[])), b]
            };
            (0..=830).flat_map(at).flatten().collect()
        };
        assert_eq!(Gaps::of(&recorded(0.0), &joints, &STILL).0, BTreeMap::new());
        let moved = BTreeMap::from([("b", vec![(550 * HUNDREDTH, 600 * HUNDREDTH)])]);
        assert_eq!(Gaps::of(&recorded(0.1), &joints, &STILL).0, moved);
    }
}
