//! Which pictures of a recording are taken: those of the standstills.

use std::path::Path;

use super::collect::{Collector, Group, StopReport};
use super::delay::{self, Delay, Frames};
use super::file::for_each;
use super::messages::CameraInfo;
use super::motion::{Posture, Standstill, interpolate, postures, standstills};
use super::options::{Motion, RecordingOptions};
use super::scan::{JointReadings, Scan, scan};
use super::silence;
use crate::error::{Code, Error, Notice, Result};
use crate::series::{InputFile, Stops};

/// Of a long standstill so many pictures are looked at.
const MOST_PICTURES: usize = 9;
/// The ends of a standstill are left out where it is long enough, ns: stamps of image and joints may differ a little.
const MARGIN_NS: i64 = 50_000_000;
/// Delays of images and joints that differ by more deserve a look, s.
const NOTABLE_DELAY_S: f64 = 0.05;

/// The stops of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Extracted {
    /// Stops with the paths of their pictures; readings in rad and m.
    pub stops: Stops,
    /// How each stop was taken, in the same order.
    pub reports: Vec<StopReport>,
    /// Topic of the joint states; several where each joint has one of its own.
    pub joint_topic: String,
    /// Topic of the images.
    pub image_topic: String,
    /// How much longer images take from stamp to recording than joint states (median), s.
    pub image_delay_s: f64,
    /// How late the images are by what they show, where this is notable; it was taken off.
    pub late: Option<Delay>,
    /// The camera as the recording describes it.
    pub camera_info: Option<CameraInfo>,
    /// What was seen while reading that the user should know.
    pub notices: Vec<Notice>,
    /// The files of the recording.
    pub inputs: Vec<InputFile>,
}

/// Takes the stops out of a recording (an `.mcap` file or a rosbag2 folder) and writes their pictures to `images`.
///
/// # Errors
/// Other kinds of recordings (with the command that converts them); topics or joints that are missing or not unique;
/// images and joints that were never taken at the same time; a robot that never stands still.
pub fn extract(recording: &Path, images: &Path, options: &RecordingOptions) -> Result<Extracted> {
    let mut scan = scan(recording, options.clock)?;
    let JointReadings { topics, samples, joints } = scan.joint_readings(options)?;
    let (image_topic, mut times) = scan.image_topic(options)?;
    times.sort_unstable();
    times.dedup();
    let mut postures = postures(&samples, &joints);
    require_overlap(&scan, &postures, &times)?;
    scan.notices.extend(silence::notices(recording, &samples, &joints, &times));
    let late = late(&scan, &image_topic, &postures, &times, options)?;
    if let Some(delay_s) = options.image_delay_s.or(late.map(|d| d.delay_s)) {
        // In the time of the images, the joints were there so much later.
        postures.iter_mut().for_each(|p| p.time_ns += (delay_s * 1e9).round() as i64);
    }
    scan.notices.extend(late.map(|d| d.notice(recording)));
    let groups = groups(&mut scan, &postures, &times, options)?;
    std::fs::create_dir_all(images).map_err(|e| Error::io(images, &e))?;
    let mut collector = Collector::new(groups, images, options, &postures);
    for file in scan.files.clone() {
        // Damage was told of by the first pass.
        for_each(&file, |message| if message.topic == image_topic { collector.take(&message) } else { Ok(()) })?;
    }
    let taken = collector.finish()?;
    if taken.rows.is_empty() {
        let place = format!("{}, topic {image_topic}", recording.display());
        let what = taken
            .malformed
            .map_or("no image can be read".into(), |(_, reason)| format!("no image can be read: one {reason}"));
        return Err(Error::new(
            Code::MessagesUnreadable,
            place,
            what,
            "record as mono8, mono16, rgb8, bayer or compressed (jpeg, png)",
        ));
    }
    let mut notices = std::mem::take(&mut scan.notices);
    if let Some((count, reason)) = taken.malformed {
        let place = format!("{}, topic {image_topic}", recording.display());
        notices.push(Notice::new(
            Code::MessagesUnreadable,
            place,
            format!("{count} images cannot be read: one {reason}"),
            "they are left out",
        ));
    }
    let image_delay_s = scan.delay_s(std::slice::from_ref(&image_topic)) - scan.delay_s(&topics);
    let growth_s = scan.delay_growth_s(&image_topic) - scan.delay_growth_s(&topics[0]);
    if growth_s.abs() > NOTABLE_DELAY_S {
        let sign = if growth_s < 0.0 { "earlier" } else { "later" };
        let what = format!(
            "images arrive {:.3} s {sign} after their stamp at the end than at the beginning, joint states do not: the clocks of camera and robot run apart",
            growth_s.abs()
        );
        let remedy = "use the times of recording (--clock log), or let one clock stamp both";
        notices.push(Notice::new(Code::ClocksApart, recording.display(), what, remedy));
    } else if image_delay_s.abs() > NOTABLE_DELAY_S {
        let sign = if image_delay_s < 0.0 { "earlier" } else { "later" };
        let what = format!("images arrive {:.3} s {sign} after their stamp than joint states", image_delay_s.abs());
        let remedy =
            "check that camera and robot stamp by the same clock; a robot that stands for longer is not affected";
        notices.push(Notice::new(Code::ImagesDelayed, recording.display(), what, remedy));
    }
    let (stops, reports) = taken.rows.into_values().unzip();
    Ok(Extracted {
        stops: Stops { joints, stops, ..Stops::default() },
        reports,
        image_delay_s,
        late,
        camera_info: scan.camera_info(&image_topic).cloned(),
        joint_topic: topics.join(", "),
        image_topic,
        notices,
        inputs: scan.inputs,
    })
}

/// The delay of the images by what they show, unless it is given.
fn late(
    scan: &Scan,
    topic: &str,
    postures: &[Posture],
    times: &[i64],
    options: &RecordingOptions,
) -> Result<Option<Delay>> {
    if options.image_delay_s.is_some() {
        return Ok(None);
    }
    let still = standstills(postures, options.still_speed, (options.least_still_s * 1e9) as i64);
    let Some(mut frames) = Frames::about_motions(times, &still) else { return Ok(None) };
    for file in &scan.files {
        for_each(file, |message| {
            if message.topic == topic {
                frames.take(&message, options.clock);
            }
            Ok(())
        })?;
    }
    Ok(delay::measured(&frames.pairs(), postures))
}

fn require_overlap(scan: &Scan, postures: &[Posture], times: &[i64]) -> Result<()> {
    let place = scan.recording.display();
    let (Some(first), Some(last)) = (postures.first(), postures.last()) else {
        let what = "its joint states never tell all joints";
        return Err(Error::new(Code::JointMissing, place, what, "record all publishers of the joint states"));
    };
    let (Some(&from), Some(&to)) = (times.first(), times.last()) else { return Ok(()) };
    if from <= last.time_ns && first.time_ns <= to {
        return Ok(());
    }
    let seconds = |ns: i64| ns as f64 * 1e-9;
    let what = format!(
        "its images are stamped {:.1} s to {:.1} s, its joint states {:.1} s to {:.1} s: never at the same time",
        seconds(from),
        seconds(to),
        seconds(first.time_ns),
        seconds(last.time_ns)
    );
    Err(Error::new(
        Code::ClocksApart,
        place,
        what,
        "synchronise the clocks, or use the times of recording (--clock log)",
    ))
}

fn groups(scan: &mut Scan, postures: &[Posture], times: &[i64], options: &RecordingOptions) -> Result<Vec<Group>> {
    let still = standstills(postures, options.still_speed, (options.least_still_s * 1e9) as i64);
    let mut groups: Vec<Group> = Vec::new();
    let mut empty = 0;
    let mut used = 0;
    for standstill in &still {
        let Standstill { from_ns, to_ns } = shrunk(*standstill);
        let inside = &times[times.partition_point(|t| *t < from_ns)..times.partition_point(|t| *t <= to_ns)];
        used += inside.len();
        match inside {
            [] => empty += 1,
            _ => groups.push(spread(inside)),
        }
    }
    let place = scan.recording.display().to_string();
    if let Motion::Accept { interval_s } = options.motion {
        let outside =
            |t: &i64| still.iter().all(|s| !(s.from_ns..=s.to_ns).contains(t)) && interpolate(postures, *t).is_some();
        let mut last = i64::MIN;
        for time in times.iter().copied().filter(outside) {
            if time.saturating_sub(last) >= (interval_s * 1e9) as i64 {
                groups.push(vec![time]);
                last = time;
            }
        }
        groups.sort();
    } else if used < times.len() && !groups.is_empty() {
        let what = format!(
            "{} of {} images were taken outside the standstills and are not used",
            times.len() - used,
            times.len()
        );
        scan.notices.push(Notice::new(Code::ImagesInMotion, &place, what, ""));
    }
    if empty > 0 {
        let what = format!("{empty} of {} standstills have no image", still.len());
        scan.notices.push(Notice::new(
            Code::StandstillWithoutImage,
            &place,
            what,
            "wait longer at each stop, or check the stamps of the images",
        ));
    }
    if groups.is_empty() {
        return Err(no_stop(&place, postures, still.len(), options));
    }
    Ok(groups)
}

/// Why there is no stop at all.
fn no_stop(place: &str, postures: &[Posture], standstills: usize, options: &RecordingOptions) -> Error {
    if standstills > 0 {
        let what = format!("none of its images was taken in one of the {standstills} standstills of the robot");
        return Error::new(
            Code::ImagesInMotion,
            place,
            what,
            "check the stamps of images and joint states (--clock log)",
        );
    }
    let mut steps: Vec<i64> = postures.windows(2).map(|w| w[1].time_ns - w[0].time_ns).collect();
    steps.sort_unstable();
    let step_s = steps.get(steps.len() / 2).map_or(f64::INFINITY, |ns| *ns as f64 * 1e-9);
    let what = format!(
        "the robot never stands still for {} s (joints slower than {} rad/s; a joint state comes every {step_s:.3} s)",
        options.least_still_s, options.still_speed
    );
    let remedy = "stop the robot for each image; images in motion are taken only on demand (--in-motion SECONDS)";
    Error::new(Code::RobotNeverStill, place, what, remedy)
}

fn shrunk(standstill: Standstill) -> Standstill {
    let Standstill { from_ns, to_ns } = standstill;
    if to_ns - from_ns < 8 * MARGIN_NS {
        return standstill;
    }
    Standstill { from_ns: from_ns + MARGIN_NS, to_ns: to_ns - MARGIN_NS }
}

/// At most [`MOST_PICTURES`], evenly spread.
fn spread(times: &[i64]) -> Group {
    let count = times.len().min(MOST_PICTURES);
    (0..count).map(|k| times[k * times.len() / count + times.len() / count / 2]).collect()
}
