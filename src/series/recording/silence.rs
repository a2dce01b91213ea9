//! Times in which joints are not known because their publisher fell silent.

use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;

use super::motion::{LONGEST_GAP_NS, WINDOW_NS};
use super::scan::JointSample;
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

/// Says which joints fell silent while so many of the images were taken.
pub(super) fn notices(recording: &Path, samples: &[JointSample], joints: &[String], images: &[i64]) -> Vec<Notice> {
    let begin = samples.iter().map(|s| s.time_ns).min().unwrap_or_default();
    let seconds = |ns: i64| ns.saturating_sub(begin) as f64 * 1e-9;
    let lost = silences(samples, joints).into_iter().filter_map(|((from, to), silent)| {
        let lost = images.iter().filter(|t| (from..to).contains(t)).count();
        let what = format!(
            "no readings of {} from {:.1} s to {:.1} s after the first joint state: {lost} images of that time are not used",
            silent.join(", "),
            seconds(from),
            seconds(to)
        );
        let remedy = "find out why the publisher fell silent, and record those stops again";
        (lost > 0).then(|| Notice::new(Code::JointSilent, recording.display(), what, remedy))
    });
    lost.collect()
}

/// A joint is missing where so many of its usual steps have no sample.
const MISSING_STEPS: i64 = 3;

/// Times in which a joint has no readings though others have: drivers write NaN for joints that they could not read.
#[derive(Debug, Default)]
pub(super) struct Gaps<'a>(BTreeMap<&'a str, Vec<Span>>);

impl<'a> Gaps<'a> {
    pub fn of(samples: &[JointSample], joints: &'a [String]) -> Self {
        let mut all: Vec<i64> = samples.iter().map(|s| s.time_ns).collect();
        all.sort_unstable();
        let of_joint = |joint: &'a String| {
            let mut own: Vec<i64> = samples.iter().filter(|s| s.names.contains(joint)).map(|s| s.time_ns).collect();
            own.sort_unstable();
            let mut steps: Vec<i64> = own.windows(2).map(|w| w[1] - w[0]).collect();
            steps.sort_unstable();
            let least = steps.get(steps.len() / 2).map_or(i64::MAX, |usual| WINDOW_NS.max(MISSING_STEPS * usual));
            let is_gap = |w: &&[i64]| {
                let span = w[1] - w[0];
                // Not those that all joints have.
                let middle = w[0] + span / 4..w[1] - span / 4;
                let next = all.partition_point(|t| *t < middle.start);
                (least + 1..=LONGEST_GAP_NS).contains(&span) && all.get(next).is_some_and(|t| middle.contains(t))
            };
            let gaps: Vec<Span> = own.windows(2).filter(is_gap).map(|w| (w[0], w[1])).collect();
            (!gaps.is_empty()).then_some((joint.as_str(), gaps))
        };
        Self(joints.iter().filter_map(of_joint).collect())
    }

    /// Leaves out the images of these times, where joints are later by `later_ns` in the time of the images, and says so.
    pub fn leave_out(&self, recording: &Path, begin_ns: i64, later_ns: i64, images: &mut Vec<i64>) -> Vec<Notice> {
        let all = images.clone();
        let is_in = |t: i64, (from, to): &Span| (from + later_ns + 1..to + later_ns).contains(&t);
        images.retain(|t| !self.0.values().flatten().any(|gap| is_in(*t, gap)));
        let told = self.0.iter().filter_map(|(joint, gaps)| {
            let lost = |gap: &&Span| all.iter().any(|t| is_in(*t, gap));
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

    #[test]
    fn joints_that_fall_silent_are_named_with_the_images_that_are_lost() {
        let sample = |joint: &str, tenth: i64| JointSample {
            time_ns: tenth * SECOND / 10,
            names: Rc::new(vec![joint.to_owned()]),
            positions: vec![0.0],
        };
        // "b" pauses for half a second, then ends after four seconds of ten.
        let of_b = (0..40).filter(|tenth| !(20..24).contains(tenth));
        let samples: Vec<_> = (0..100).map(|t| sample("a", t)).chain(of_b.map(|t| sample("b", t))).collect();
        let joints = ["a".to_owned(), "b".to_owned()];
        let silent = silences(&samples, &joints);
        assert_eq!(silent, BTreeMap::from([((39 * SECOND / 10, 99 * SECOND / 10), vec!["b"])]));
        let images: Vec<i64> = (0..12).map(|s| s * SECOND).collect();
        let told = notices(Path::new("run.mcap"), &samples, &joints, &images);
        assert_eq!(told.iter().map(|n| n.code).collect::<Vec<_>>(), [Code::JointSilent]);
        assert!(told[0].what.contains("6 images"), "{told:?}");
        assert_eq!(notices(Path::new("run.mcap"), &samples, &joints, &images[..4]), []);
    }
    /// "b" is not read for a third of a second while an image is taken; half a second later nothing is recorded at all.
    #[test]
    fn images_in_the_gap_of_one_joint_are_left_out_and_others_stay() {
        let names = |joints: &[&str]| Rc::new(joints.iter().map(|&j| j.to_owned()).collect::<Vec<_>>());
        let (both, a) = (names(&["a", "b"]), names(&["a"]));
        let at = |hundredth: i64| {
            let names = if (101..134).contains(&hundredth) { &a } else { &both };
            let positions = vec![0.0; names.len()];
            JointSample { time_ns: hundredth * SECOND / 100, names: Rc::clone(names), positions }
        };
        let samples: Vec<_> = (0..300).filter(|k| !(181..220).contains(k)).map(at).collect();
        let joints = ["a".to_owned(), "b".to_owned()];
        let gaps = Gaps::of(&samples, &joints);
        assert_eq!(gaps.0, BTreeMap::from([("b", vec![(SECOND, 134 * SECOND / 100)])]));
        let mut images: Vec<i64> = [90, 110, 120, 140, 200].iter().map(|k| k * SECOND / 100).collect();
        let told = gaps.leave_out(Path::new("run.mcap"), 0, 0, &mut images);
        assert_eq!(images, [90, 140, 200].map(|k| k * SECOND / 100));
        assert_eq!(told.iter().map(|n| n.code).collect::<Vec<_>>(), [Code::JointSilent]);
        let mut later: Vec<i64> = vec![140 * SECOND / 100];
        assert_eq!(gaps.leave_out(Path::new("run.mcap"), 0, SECOND / 5, &mut later).len(), 1);
        assert_eq!(later, [] as [i64; 0]);
    }
}
