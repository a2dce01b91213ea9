//! Times in which joints are not known because their publisher fell silent.

use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;

use super::motion::LONGEST_GAP_NS;
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
}
