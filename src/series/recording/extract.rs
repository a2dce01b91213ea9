//! Which pictures of a recording are taken: those of the standstills.

use std::path::Path;

use super::collect::{Collector, Group, Rows, StopReport, unlike};
use super::delay::Delay;
use super::file::for_each;
use super::lateness::{Lateness, OTHER_CLOCK, delayed, nanoseconds};
use super::messages::CameraInfo;
use super::motion::{Posture, Standstill, postures, standstills};
use super::moving::Moving;
use super::options::{Clock, Motion, RecordingOptions};
use super::scan::{JointReadings, Scan, or_urdf, scan};
use super::silence::{self, Gaps};
use super::two_publishers;
use super::unit;
use crate::error::{Code, Error, Notice, Result};
use crate::series::{AngleUnit, InputFile, Stops};

/// Of a long standstill so many pictures are looked at.
const MOST_PICTURES: usize = 9;
/// The ends of a standstill are left out where it is long enough, ns: stamps of image and joints may differ a little.
const MARGIN_NS: i64 = 50_000_000;
/// A robot that seems to stand for less than this need not have stopped, ns: what is seen of a standstill is shorter than it by the time
/// over which speed is taken.
const LEAST_SEEN_NS: i64 = 20_000_000;

/// The stops of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Extracted {
    /// Stops with the paths of their pictures; readings as recorded: angles in [`Self::joint_unit`], lengths in m.
    pub stops: Stops,
    /// Unit of the angles.
    pub joint_unit: AngleUnit,
    /// They count as radians and look like degrees.
    pub is_unit_in_doubt: bool,
    /// How each stop was taken, in the same order.
    pub reports: Vec<StopReport>,
    /// Topic of the joint states; several where each joint has one of its own.
    pub joint_topic: String,
    /// Topic of the images.
    pub image_topic: String,
    /// How much longer images take from stamp to recording than joint states (median), s.
    pub image_delay_s: f64,
    /// How late the images are by what they show, where this is notable or images in motion are taken; it was taken off.
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
    let (image_topic, image_frame, mut times) = scan.image_topic(options)?;
    times.sort_unstable();
    times.dedup();
    let mut postures = postures(&samples, &joints);
    let joint_unit = unit::unit_of(&postures, &joints, options);
    let seems_degrees =
        (joint_unit == AngleUnit::Rad).then(|| unit::seem_degrees(recording, &postures, &joints, options)).flatten();
    let factors = unit::factors(joint_unit, &joints, options);
    scale(&mut postures, &factors);
    let still_speeds: Vec<f64> = factors.iter().map(|factor| options.still_speed / factor).collect();
    let joints_place = format!("{}, topic {}", recording.display(), topics.join(", "));
    two_publishers::require_one(&joints_place, &samples, &joints, &still_speeds, or_urdf(options))?;
    require_overlap(&scan, &postures, &times)?;
    let lateness = Lateness::of(&scan, (&image_topic, &topics), (&postures, &times), options)?;
    let (later_ns, open) = (lateness.later_ns(), lateness.open_ns());
    postures.iter_mut().for_each(|p| p.time_ns += later_ns);
    let begin_ns = samples.iter().map(|s| s.time_ns).min().unwrap_or_default();
    let later = (later_ns + open.min(0), later_ns + open.max(0));
    scan.notices.extend(silence::notices(recording, &samples, &joints, (&times, later)));
    scan.notices.extend(Gaps::of(&samples, &joints, &still_speeds).leave_out(recording, begin_ns, later, &mut times));
    let late = lateness.told.late();
    scan.notices.extend(late.map(|d| d.notice(recording)));
    let groups = groups(&mut scan, &postures, &times, options, (open, lateness.told.sigma_s())).map_err(|error| {
        let error = or_set_back(error, &scan.notices);
        why_never_still(error, (&postures, &joints), seems_degrees.as_ref(), options)
    })?;
    let is_unit_in_doubt = seems_degrees.is_some();
    scan.notices.extend(seems_degrees);
    std::fs::create_dir_all(images).map_err(|e| Error::io(images, &e))?;
    let collector = Collector::new(groups, images, options, (&postures, &factors));
    let (rows, unread) = collected(&scan, &image_topic, collector)?;
    let mut notices = std::mem::take(&mut scan.notices);
    notices.extend(unread);
    notices.extend(lateness.notices(recording));
    let (stops, reports): (Vec<_>, Vec<_>) = rows.into_values().unzip();
    notices.extend(unlike(recording, &reports));
    Ok(Extracted {
        stops: Stops { joints, stops, ..Stops::default() },
        joint_unit,
        is_unit_in_doubt,
        reports,
        image_delay_s: lateness.image_delay_s,
        late,
        camera_info: scan.camera_info(&image_topic, image_frame.as_deref(), options.image_frame.is_some()).cloned(),
        joint_topic: topics.join(", "),
        image_topic,
        notices,
        inputs: scan.inputs,
    })
}

fn scale(postures: &mut [Posture], factors: &[f64]) {
    for posture in postures {
        posture.positions.iter_mut().zip(factors).for_each(|(q, factor)| *q *= factor);
    }
}

/// Why a robot never stands still, where that is the error and something tells.
fn why_never_still(
    error: Error,
    (postures, joints): (&[Posture], &[String]),
    seems_degrees: Option<&Notice>,
    options: &RecordingOptions,
) -> Error {
    if error.code != Code::RobotNeverStill {
        return error;
    }
    // Degrees are as many times too fast as radians.
    if let Some(Notice { code, place, what, remedy }) = seems_degrees {
        return Error::new(*code, place, what, remedy);
    }
    others_move(&error.place, postures, joints, options).unwrap_or(error)
}

/// Takes the pictures out of the recording: stops with their reports by their places, and what is said of images that cannot be read.
///
/// # Errors
/// No image that can be read; a picture that cannot be written.
fn collected(scan: &Scan, topic: &str, mut collector: Collector<'_>) -> Result<(Rows, Option<Notice>)> {
    for file in &scan.files {
        // Damage was told of by the first pass.
        for_each(file, |message| if message.topic == topic { collector.take(&message) } else { Ok(()) })?;
    }
    let taken = collector.finish()?;
    let place = format!("{}, topic {topic}", scan.recording.display());
    if taken.rows.is_empty() {
        let what = taken
            .malformed
            .map_or("no image can be read".into(), |(_, reason)| format!("no image can be read: one {reason}"));
        let remedy = "record as mono8, mono16, rgb8, bayer or compressed (jpeg, png)";
        return Err(Error::new(Code::MessagesUnreadable, place, what, remedy));
    }
    let unread = taken.malformed.map(|(count, reason)| {
        let what = format!("{count} images cannot be read: one {reason}");
        Notice::new(Code::MessagesUnreadable, place, what, "they are left out")
    });
    Ok((taken.rows, unread))
}

/// Times that do not fit to each other after a clock was set back: stamps are right by no delay.
fn or_set_back(error: Error, notices: &[Notice]) -> Error {
    match notices.iter().find(|n| n.code == Code::ClockSetBack && error.code == Code::ClocksApart) {
        Some(set) => {
            let what = format!("{}; {}", error.what, set.what);
            Error::new(error.code, error.place, what, "take the times of recording (--clock log)")
        }
        None => error,
    }
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
    let remedy = "synchronise the clocks, or use the times of recording (--clock log)";
    Err(or_set_back(Error::new(Code::ClocksApart, place, what, remedy), &scan.notices))
}

/// Images of the standstills; where it is `open` whether they are late by so many ns, those of both. `sigma_s`: as [`KnownDelay::sigma_s`].
fn groups(
    scan: &mut Scan,
    postures: &[Posture],
    times: &[i64],
    options: &RecordingOptions,
    (open, sigma_s): (i64, Option<f64>),
) -> Result<Vec<Group>> {
    let still = standstills(postures, options.still_speed, nanoseconds(options.least_still_s));
    let Inside { mut groups, used, standing } = Inside::of(&still, times, open);
    let empty = still.len() - groups.len();
    let place = scan.recording.display().to_string();
    if let Motion::Accept { interval_s } = options.motion {
        if open != 0 {
            let why = "where the robot was at an image in motion is not known";
            return Err(clocks_apart(&place, open, &format!(": {why}")));
        }
        let moving = Moving::of(&place, (postures, &still), times, interval_s, sigma_s)?;
        let notice = moving.notice(&place, sigma_s);
        groups.extend(moving.taken.iter().map(|time| vec![*time]));
        if let Some(Notice { code, place, what, remedy }) = notice.clone().filter(|_| groups.is_empty()) {
            return Err(Error::new(code, place, what, remedy));
        }
        scan.notices.extend(notice);
        groups.sort();
    } else if !groups.is_empty() && standing.is_missed(used, times.len()) {
        return Err(missed(&place, used, times.len(), options));
    } else if used < times.len() && !groups.is_empty() {
        scan.notices.push(outside_standstills(&place, times.len() - used, times.len()));
    }
    if empty > 0 {
        scan.notices.push(without_image(&place, empty, still.len()));
    }
    let short = short(postures, times, options);
    if options.motion == Motion::Refuse && short > groups.len() && !groups.is_empty() {
        scan.notices.push(too_short(&place, short, options));
    }
    if groups.is_empty() && open != 0 && !still.is_empty() {
        let stops = still.len();
        let why = "nobody knows which image is of which stop";
        let then = format!(", and the robot stands for less at each of the {stops} stops: {why}");
        return Err(clocks_apart(&place, open, &then));
    }
    if groups.is_empty() {
        return Err(no_stop(&place, postures, [still.len(), short], options));
    }
    Ok(groups)
}

/// Images are late by so many ns, or not: what follows from that.
fn clocks_apart(place: &str, open: i64, then: &str) -> Error {
    let what = format!("{}{then}", delayed(-1e-9 * open as f64));
    Error::new(Code::ClocksApart, place, what, OTHER_CLOCK)
}

fn outside_standstills(place: &str, outside: usize, images: usize) -> Notice {
    let what = format!("{outside} of {images} images were taken outside the standstills and are not used");
    Notice::new(Code::ImagesInMotion, place, what, "")
}

fn without_image(place: &str, empty: usize, standstills: usize) -> Notice {
    let what = format!("{empty} of {standstills} standstills have no image");
    let remedy = "wait longer at each stop, or check the stamps of the images";
    Notice::new(Code::StandstillWithoutImage, place, what, remedy)
}

/// Images within standstills.
#[derive(Debug, Default)]
struct Inside {
    /// Of each standstill that has any.
    groups: Vec<Group>,
    /// How many images there are in all standstills.
    used: usize,
    standing: Standing,
}

impl Inside {
    fn of(still: &[Standstill], times: &[i64], open: i64) -> Self {
        let mut all = Self::default();
        for standstill in still {
            let Standstill { from_ns, to_ns } = shrunk(*standstill);
            let (from_ns, to_ns) = (from_ns + open.max(0), to_ns + open.min(0));
            let first = times.partition_point(|t| *t < from_ns);
            let inside = &times[first..times.partition_point(|t| *t <= to_ns).max(first)];
            all.used += inside.len();
            all.standing.add([from_ns, to_ns], times);
            if !inside.is_empty() {
                all.groups.push(spread(inside));
            }
        }
        all
    }
}

/// Standstills of the time in which images were taken.
#[derive(Debug, Default)]
struct Standing {
    count: usize,
    without_image: usize,
    /// Their share of that time.
    share: f64,
}

impl Standing {
    fn add(&mut self, [from_ns, to_ns]: [i64; 2], times: &[i64]) {
        let (Some(first), Some(last)) = (times.first(), times.last()) else { return };
        let lasts_ns = to_ns.min(*last) - from_ns.max(*first);
        if lasts_ns > 0 {
            self.count += 1;
            self.without_image += usize::from(!times.iter().any(|t| (from_ns..=to_ns).contains(t)));
            self.share += lasts_ns as f64 / (last - first) as f64;
        }
    }

    /// Whether images miss the standstills as they do not by chance.
    fn is_missed(&self, used: usize, images: usize) -> bool {
        2 * self.without_image > self.count && ((CHANCE * used) as f64) < self.share * images as f64
    }
}

/// Images in the standstills are fewer than one in so many of those that chance would put there.
const CHANCE: usize = 4;

/// Images were taken at the stops and bear other times.
fn missed(place: &str, used: usize, images: usize, options: &RecordingOptions) -> Error {
    let what = format!(
        "{} of {images} images were taken outside the standstills, more than by chance: their times are not those of the joint states",
        images - used
    );
    let other_clock = (options.clock != Clock::Log).then_some("take the times of recording (--clock log)");
    let delay = options.image_delay_s.is_none().then_some("state how late the images are (--image-delay SECONDS)");
    let ways: Vec<&str> = [delay, other_clock].into_iter().flatten().collect();
    let ways = if ways.is_empty() { "correct --image-delay".to_owned() } else { ways.join(", or ") };
    let remedy = format!(
        "{ways}; where they were taken in motion on purpose: --in-motion SECONDS takes images while the robot moves, too, so far apart"
    );
    Error::new(Code::ImagesInMotion, place, what, remedy)
}

/// Standstills that are shorter than what counts as one, with images.
fn short(postures: &[Posture], times: &[i64], options: &RecordingOptions) -> usize {
    let least_ns = nanoseconds(options.least_still_s);
    let all = standstills(postures, options.still_speed, LEAST_SEEN_NS.min(least_ns));
    let has_image = |s: &&Standstill| times.iter().any(|t| (s.from_ns - MARGIN_NS..=s.to_ns + MARGIN_NS).contains(t));
    all.iter().filter(|s| s.to_ns - s.from_ns < least_ns).filter(has_image).count()
}

/// The robot stopped, and not for long enough.
fn too_short(place: &str, count: usize, options: &RecordingOptions) -> Notice {
    let least_s = options.least_still_s;
    let what = format!(
        "the robot stands for less than {least_s} s at {count} places where images were taken: this counts as no stop"
    );
    Notice::new(Code::RobotNeverStill, place, what, "let the robot stand for longer at each stop")
}

/// Why there is no stop at all.
fn no_stop(place: &str, postures: &[Posture], [standstills, short]: [usize; 2], options: &RecordingOptions) -> Error {
    if standstills > 0 && short > 0 {
        let Notice { code, place, what, remedy } = too_short(place, short, options);
        return Error::new(code, place, what, remedy);
    }
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
    let less = if short > 0 { format!("; for less it does at {short} places with images") } else { String::new() };
    let what = format!(
        "the robot never stands still for {} s (joints slower than {} rad/s; a joint state comes every {step_s:.3} s){less}",
        options.least_still_s, options.still_speed
    );
    let remedy = if 2.0 * step_s > options.least_still_s {
        "record joint states more often, ten times a second or more: so few of them do not tell when the robot stands"
    } else {
        "stop the robot for each image; images in motion are taken only on demand (--in-motion SECONDS)"
    };
    Error::new(Code::RobotNeverStill, place, what, remedy)
}

/// Why there is no stop where some joints never stand, and the others do: joints of another robot, where none are asked for.
fn others_move(place: &str, postures: &[Posture], joints: &[String], options: &RecordingOptions) -> Option<Error> {
    if !options.joints.is_empty() {
        return None;
    }
    let stops_of = |chosen: &[usize]| {
        let of = |p: &Posture| Posture { positions: chosen.iter().map(|&k| p.positions[k]).collect(), ..p.clone() };
        let own: Vec<Posture> = postures.iter().map(of).collect();
        standstills(&own, options.still_speed, nanoseconds(options.least_still_s)).len()
    };
    let (standing, moving): (Vec<usize>, Vec<usize>) = (0..joints.len()).partition(|&k| stops_of(&[k]) > 0);
    let stops = if standing.is_empty() { 0 } else { stops_of(&standing) };
    if stops == 0 || moving.is_empty() {
        return None;
    }
    let named: Vec<&str> = moving.iter().map(|&k| joints[k].as_str()).collect();
    let what = format!("{} never stand still; the other joints do {stops} times", named.join(", "));
    let remedy = "where they are those of another robot, take the joints of the URDF: --urdf robot.urdf with identify or convert (detect and poses take the series folder that convert makes)";
    Some(Error::new(Code::RobotNeverStill, place, what, remedy))
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Joints every 10 ms and images every 50 ms of a robot that stands and moves for so many hundredths of a second.
    fn recorded(stands_and_moves: &[(i64, bool)]) -> (Vec<Posture>, Vec<i64>) {
        let (mut postures, mut position) = (Vec::new(), 0.0);
        for (hundredths, moves) in stands_and_moves {
            for _ in 0..*hundredths {
                let time_ns = postures.len() as i64 * 10_000_000;
                postures.push(Posture { time_ns, positions: vec![position], oldest_ns: 0 });
                position += if *moves { 0.01 } else { 0.0 };
            }
        }
        let times = postures.iter().step_by(5).map(|p| p.time_ns).collect();
        (postures, times)
    }

    #[test]
    fn joints_of_another_robot_that_never_stand_are_named_unless_joints_are_asked_for() {
        let (mut postures, _) = recorded(&[(100, false), (80, true), (100, false), (80, true), (100, false)]);
        for (k, posture) in postures.iter_mut().enumerate() {
            posture.positions.push(0.3 * (0.01 * k as f64).sin());
        }
        let joints = ["left/joint_1", "right/joint_1"].map(String::from);
        let options = RecordingOptions::default();
        let error = others_move("run", &postures, &joints, &options).unwrap();
        assert_eq!(error.code, Code::RobotNeverStill);
        assert!(error.what.contains("right/joint_1") && !error.what.contains("left"), "{error}");
        assert!(error.what.contains("3 times") && error.remedy.contains("--urdf"), "{error}");
        let asked = RecordingOptions { joints: joints.to_vec(), ..options.clone() };
        assert_eq!(others_move("run", &postures, &joints, &asked), None);
        postures.iter_mut().for_each(|p| p.positions = vec![p.positions[1]]);
        assert_eq!(others_move("run", &postures, &joints[1..], &options), None);
    }

    #[test]
    fn standstills_that_are_too_short_are_counted() {
        let short = [(80, true), (20, false), (80, true), (20, false), (80, true), (20, false), (80, true)];
        let options = RecordingOptions::default();
        let (postures, times) = recorded(&[&[(100, false)][..], &short].concat());
        let mut scan = Scan::default();
        assert_eq!(groups(&mut scan, &postures, &times, &options, (0, None)).unwrap().len(), 1);
        let told = scan.notices.iter().find(|n| n.code == Code::RobotNeverStill).unwrap();
        assert!(told.what.contains("3 places"), "{told:?}");
        let (postures, times) = recorded(&short);
        let error = groups(&mut Scan::default(), &postures, &times, &options, (0, None)).unwrap_err();
        assert_eq!((error.code, error.what.contains("3 places")), (Code::RobotNeverStill, true), "{error}");
    }

    /// An image at every stop, whose times are late; and a camera that is slow.
    #[test]
    fn images_that_miss_the_stops_are_refused_and_slow_ones_are_not() {
        let drive = [(100, false), (80, true)].repeat(20);
        let (postures, times) = recorded(&drive);
        let options = RecordingOptions::default();
        let late: Vec<i64> = (0..20).map(|k| (k * 180 + if k == 7 { 50 } else { 140 }) * 10_000_000).collect();
        let error = groups(&mut Scan::default(), &postures, &late, &options, (0, None)).unwrap_err();
        assert_eq!(error.code, Code::ImagesInMotion, "{error}");
        // Every 5 s, without regard to the stops, which have one in about two or three.
        let slow: Vec<i64> = times.iter().copied().step_by(100).collect();
        let taken = groups(&mut Scan::default(), &postures, &slow, &options, (0, None)).unwrap().len();
        assert!((2..10).contains(&taken), "{taken}");
        // Only the last stops have images, at a high rate.
        let last = &times[times.len() * 4 / 5..];
        assert_eq!(groups(&mut Scan::default(), &postures, last, &options, (0, None)).unwrap().len(), 4);
    }

    #[test]
    fn a_clock_that_was_set_back_is_the_cause_of_times_that_do_not_fit() {
        let apart = || Error::new(Code::ClocksApart, "run", "apart", OTHER_CLOCK);
        let set = Notice::new(Code::ClockSetBack, "run", "back", "");
        let error = or_set_back(apart(), std::slice::from_ref(&set));
        assert_eq!((error.code, error.remedy == OTHER_CLOCK), (Code::ClocksApart, false));
        assert_eq!(or_set_back(apart(), &[]), apart());
        let (postures, times) = recorded(&[(100, false), (80, true)].repeat(4));
        let later: Vec<i64> = times.iter().map(|t| t + 3_600_000_000_000).collect();
        let refused = |notices: Vec<Notice>| {
            let mut scan = Scan::default();
            scan.notices.extend(notices);
            require_overlap(&scan, &postures, &later).unwrap_err()
        };
        let [told, untold] = [vec![set], Vec::new()].map(refused);
        assert_eq!([told.code, untold.code], [Code::ClocksApart; 2]);
        assert!(told.what.ends_with("; back") && told.remedy != untold.remedy, "{told:?}");
    }
}
