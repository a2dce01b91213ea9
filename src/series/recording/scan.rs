//! First pass over a recording: joint samples, stamps of the images, what else there is.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::cdr::Decoded;
use super::file::for_each;
use super::image_frames::{ByFrame, Infos};
use super::message::Message;
use super::messages::{self, CameraInfo, JointState};
use super::options::{Clock, RecordingOptions};
use super::order::{Written, set_back, twice};
use super::recording_files::{Parts, parts_of};
use super::samples::{JointSample, shared};
use crate::error::{Code, Error, Notice, Result, plain_name};
use crate::linalg::median_by;
use crate::series::InputFile;
use crate::series::joint_names::remedy_of_names;

/// The joint states of a robot.
pub(super) struct JointReadings {
    /// Where they were recorded.
    pub topics: Vec<String>,
    pub samples: Vec<JointSample>,
    /// The joints to read.
    pub joints: Vec<String>,
}

/// Type and number of messages of a topic.
#[derive(Debug, Clone, Default)]
struct Topic {
    schema: String,
    encoding: String,
    messages: usize,
    /// Messages that could not be read, and why the first could not.
    malformed: usize,
    reason: String,
    unstamped: bool,
    /// Times of recording, with the time from the stamp to there, ns.
    delays_ns: Vec<(i64, i64)>,
    written: Written,
}

/// The encoding of ROS 2.
const CDR: &str = "cdr";

impl Topic {
    /// A message of one of these types, whoever named it: `sensor_msgs/msg/Image`, `sensor_msgs/Image`, `foxglove.Image`.
    fn is_of(&self, types: &[&str]) -> bool {
        self.schema.rsplit(['/', '.']).next().is_some_and(|own| types.contains(&own))
    }
}

/// What a topic is looked for.
struct Wanted {
    what: &'static str,
    flag: &'static str,
    /// Types by which it goes in other encodings.
    types: &'static [&'static str],
}

const JOINTS: Wanted = Wanted { what: "joint states", flag: "--joint-topic", types: &["JointState", "JointStates"] };
const IMAGES: Wanted =
    Wanted { what: "images", flag: "--image-topic", types: &["Image", "RawImage", "CompressedImage"] };

/// The joints of the robot choose, where none are asked for yet.
pub(super) fn or_urdf(options: &RecordingOptions) -> &'static str {
    if options.joints.is_empty() { ", or give --urdf: the joints of the robot choose" } else { "" }
}

/// Everything of the first pass.
#[derive(Debug, Default)]
pub(super) struct Scan {
    pub recording: PathBuf,
    pub files: Vec<PathBuf>,
    topics: BTreeMap<String, Topic>,
    joints: BTreeMap<String, Vec<JointSample>>,
    images: BTreeMap<String, ByFrame>,
    infos: BTreeMap<String, Infos>,
    /// Memory of the joint samples, bytes.
    held: usize,
    pub notices: Vec<Notice>,
    pub inputs: Vec<InputFile>,
}

/// Reads a recording once.
pub(super) fn scan(recording: &Path, clock: Clock) -> Result<Scan> {
    let Parts { files, notices } = parts_of(recording)?;
    let mut scan = Scan { recording: recording.to_path_buf(), files, notices, ..Scan::default() };
    for path in scan.files.clone() {
        let damage = for_each(&path, |message| {
            scan.note(&message, clock);
            Ok(())
        })?;
        scan.notices.extend(damage);
        scan.inputs.push(InputFile::of_file(&path)?);
    }
    scan.leave_out_what_was_twice(clock);
    scan.judge()?;
    Ok(scan)
}

/// Memory of all joint samples of a recording, bytes: some hours at 500 Hz.
const MOST_HELD: usize = 512 << 20;

/// Latest time of recording, ns (in the year 2096): later ones are damaged, and differences of times stay numbers.
const LATEST_NS: u64 = 4_000_000_000_000_000_000;

fn log_time_ns(message: &Message<'_>) -> i64 {
    message.log_time_ns.min(LATEST_NS) as i64
}

/// Time of a message by the chosen clock, ns; a stamp of zero means that none was set.
pub(super) fn time_ns(stamp_ns: i64, message: &Message<'_>, clock: Clock) -> i64 {
    match clock {
        Clock::Stamp if stamp_ns != 0 => stamp_ns,
        _ => log_time_ns(message),
    }
}

impl Scan {
    fn note(&mut self, message: &Message<'_>, clock: Clock) {
        let topic = self.topics.entry(message.topic.to_string()).or_default();
        topic.schema = message.schema.to_string();
        topic.encoding = message.encoding.to_string();
        topic.messages += 1;
        if message.encoding != CDR {
            return;
        }
        if let Err(reason) = self.decode(message, clock)
            && let Some(topic) = self.topics.get_mut(message.topic)
        {
            topic.malformed += 1;
            if topic.reason.is_empty() {
                topic.reason = reason;
            }
        }
    }

    fn decode(&mut self, message: &Message<'_>, clock: Clock) -> Decoded<()> {
        match message.schema {
            messages::JOINT_STATE => {
                let state = JointState::read(message.data)?;
                let unread = state.not_finite();
                let state = state.finite();
                let time_ns = self.stamped(message, state.stamp_ns, clock);
                if state.positions.is_empty() {
                    return if unread.is_empty() { Ok(()) } else { self.unread(message.topic, time_ns, unread) };
                }
                let samples = self.joints.entry(message.topic.to_string()).or_default();
                let names = shared(samples, |last| &last.names, state.names, &mut self.held);
                let marks = shared(samples, |last| &last.marks, state.marks, &mut self.held);
                let unread = shared(samples, |last| &last.unread, unread, &mut self.held);
                self.held += size_of::<JointSample>() + size_of_val(&state.positions[..]);
                if self.held > MOST_HELD {
                    return Ok(());
                }
                samples.push(JointSample { time_ns, names, positions: state.positions, unread, marks });
            }
            messages::IMAGE | messages::COMPRESSED_IMAGE => {
                let (stamp_ns, frame) = messages::header_of(message.data)?;
                let time_ns = self.stamped(message, stamp_ns, clock);
                self.images.entry(message.topic.to_string()).or_default().note(frame, time_ns);
            }
            messages::CAMERA_INFO => self.infos.entry(message.topic.to_string()).or_default().note(message.data)?,
            _ => {}
        }
        Ok(())
    }

    /// Notes that a topic whose joints were read before was written without one of them.
    fn unread(&mut self, topic: &str, time_ns: i64, joints: Vec<String>) -> Decoded<()> {
        if let Some(samples) = self.joints.get_mut(topic) {
            let unread = shared(samples, |last| &last.unread, joints, &mut self.held);
            self.held += size_of::<JointSample>();
            if self.held <= MOST_HELD {
                let (names, positions, marks) = (Rc::default(), Vec::new(), Rc::default());
                samples.push(JointSample { time_ns, names, positions, unread, marks });
            }
        }
        Err("has no position that is finite".into())
    }

    fn stamped(&mut self, message: &Message<'_>, stamp_ns: i64, clock: Clock) -> i64 {
        let (time_ns, log_ns) = (time_ns(stamp_ns, message, clock), log_time_ns(message));
        if let Some(topic) = self.topics.get_mut(message.topic) {
            match stamp_ns {
                0 => topic.unstamped = true,
                _ => topic.delays_ns.push((log_ns, log_ns - stamp_ns)),
            }
            topic.written.note(log_ns);
        }
        time_ns
    }

    /// Leaves out what was recorded in times that were there twice: nobody knows which picture belongs to which joints.
    fn leave_out_what_was_twice(&mut self, clock: Clock) {
        if self.topics.values().any(|topic| topic.written.in_no_order()) {
            // The file says nothing of the order in which its messages came.
            return;
        }
        let of_joints = self.joints.values().flat_map(|samples| twice(samples.iter().map(|s| s.time_ns)));
        let of_images = self.images.values().flat_map(ByFrame::times).flat_map(|times| twice(times.iter().copied()));
        let by_stamps = self.joints.keys().filter(|_| clock == Clock::Stamp).filter_map(|name| self.topics.get(name));
        let of_stamps = by_stamps.flat_map(|topic| set_back(&topic.delays_ns));
        let twice: Vec<Range<i64>> = of_joints.chain(of_images).chain(of_stamps).collect();
        let Some(longest) = twice.iter().map(|t| t.end - t.start).max() else { return };
        let once = |time: i64| !twice.iter().any(|t| (t.start..=t.end).contains(&time));
        self.joints.values_mut().for_each(|samples| samples.retain(|s| once(s.time_ns)));
        self.images.values_mut().for_each(|frames| frames.retain(|t| once(*t)));
        let what =
            format!("its times go back by {:.1} s: a clock was set while it was recorded", longest as f64 * 1e-9);
        let left_out = "what was recorded in the times that are there twice is left out";
        let remedy = match clock {
            Clock::Stamp => "take the times of recording (--clock log), or record again with a clock that runs on",
            Clock::Log => "record again with a clock that runs on",
        };
        let remedy = format!("{left_out}; {remedy}");
        self.notices.push(Notice::new(Code::ClockSetBack, self.recording.display(), what, remedy));
    }

    /// What the whole pass showed: malformed or unstamped topics; recordings of ROS 1.
    fn judge(&mut self) -> Result<()> {
        let shown = self.recording.display().to_string();
        if let Some((name, topic)) = self.topics.iter().find(|(_, t)| t.encoding == "ros1") {
            let what = format!("holds ROS 1 messages ({name}: {})", topic.schema);
            let remedy = "convert the .bag that it was made of: pip install rosbags; rosbags-convert --src run1.bag --dst run1 --dst-storage \
                          mcap (it reads no ROS 1 messages within MCAP)";
            return Err(Error::new(Code::RecordingFormat, shown, what, remedy));
        }
        if self.held > MOST_HELD {
            let what = format!("holds more joint states than {} MiB of memory", MOST_HELD >> 20);
            return Err(Error::new(
                Code::FileTooLarge,
                shown,
                what,
                "cut it into parts: ros2 bag convert with max_bagfile_size",
            ));
        }
        for (name, topic) in &self.topics {
            let place = format!("{shown}, topic {name}");
            if topic.malformed > 0 {
                let what =
                    format!("{} of {} messages cannot be read: one {}", topic.malformed, topic.messages, topic.reason);
                self.notices.push(Notice::new(Code::MessagesUnreadable, &place, what, "they are left out"));
            }
            if topic.unstamped {
                let what = "messages without a stamp: the time of recording stands for it";
                self.notices.push(Notice::new(
                    Code::MessagesUnstamped,
                    &place,
                    what,
                    "let the driver stamp its messages",
                ));
            }
        }
        Ok(())
    }

    fn with_schema<'a>(&'a self, schemas: &'a [&str]) -> impl Iterator<Item = &'a str> {
        let is_one = |topic: &Topic| topic.encoding == CDR && schemas.contains(&topic.schema.as_str());
        self.topics.iter().filter(move |(_, t)| is_one(t)).map(|(name, _)| name.as_str())
    }

    /// The topic asked for, or the only one among the candidates.
    fn choose<'a>(&self, asked: Option<&'a str>, candidates: &[&'a str], wanted: &Wanted) -> Result<&'a str> {
        let place = || self.recording.display();
        let Wanted { what, flag, .. } = wanted;
        let all = || {
            let rows = self.topics.iter().map(|(name, t)| format!("{name} ({}, {})", t.schema, t.messages));
            rows.collect::<Vec<_>>().join("; ")
        };
        let is_there = asked.map_or(!candidates.is_empty(), |asked| candidates.contains(&asked));
        if !is_there && let Some(error) = self.in_other_encoding(asked, wanted) {
            return Err(error);
        }
        match (asked, candidates) {
            (Some(asked), _) if candidates.contains(&asked) => Ok(asked),
            (None, [one]) => Ok(one),
            (Some(asked), _) => {
                let said = format!("topic {asked} has no {what}; its topics are: {}", all());
                Err(Error::new(Code::TopicMissing, place(), said, format!("name another {flag}")))
            }
            (None, []) if self.topics.is_empty() && self.damage().is_some() => {
                let damage = self.damage().unwrap_or_default();
                let remedy = "copy it again; where the original is no better, record again";
                Err(Error::new(Code::RecordingDamaged, place(), format!("no message can be read: {damage}"), remedy))
            }
            (None, []) => {
                let damage: String = self.notices.iter().map(|n| format!(" ({})", n.what)).collect();
                let said = format!("has no {what}{damage}; its topics are: {}", all());
                Err(Error::new(Code::TopicMissing, place(), said, self.to_record(wanted)))
            }
            (None, several) => {
                let said = format!("has several topics with {what}: {}", several.join(", "));
                Err(Error::new(Code::TopicAmbiguous, place(), said, format!("name one with {flag}")))
            }
        }
    }

    /// What is said of damage, where there is some.
    fn damage(&self) -> Option<&str> {
        self.notices.iter().find(|n| n.code == Code::RecordingDamaged).map(|n| n.what.as_str())
    }

    /// What is wanted is there, in an encoding that is not read.
    fn in_other_encoding(&self, asked: Option<&str>, wanted: &Wanted) -> Option<Error> {
        let is_one = |name: &str, topic: &Topic| {
            asked.is_none_or(|asked| asked == name) && topic.encoding != CDR && topic.is_of(wanted.types)
        };
        let (name, topic) = self.topics.iter().find(|(name, topic)| is_one(name, topic))?;
        let what = format!(
            "its {} messages {} are in {}; what is read is CDR, in which ROS 2 records",
            topic.messages,
            topic.schema,
            topic.encoding.escape_debug()
        );
        let remedy =
            "record with ROS 2 (ros2 bag record -s mcap -a), or write the messages anew as sensor_msgs of ROS 2 in CDR";
        let place = format!("{}, topic {name}", self.recording.display());
        Some(Error::new(Code::MessagesUnreadable, place, what, remedy))
    }

    /// What to do where nothing of what is wanted was recorded.
    fn to_record(&self, wanted: &Wanted) -> String {
        let mut remedy = "record them as well (ros2 bag record -s mcap -a)".to_owned();
        if wanted.what == JOINTS.what && self.topics.values().any(|topic| topic.is_of(&["TFMessage"])) {
            remedy += "; where its frames have the poses of the flange, write these into controller.csv of a series folder, beside the images";
        }
        remedy
    }

    /// Joints of which a topic has positions.
    fn joints_of(&self, topic: &str) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for name in self.joints.get(topic).into_iter().flatten().flat_map(|sample| sample.names.iter()) {
            if !names.contains(name) {
                names.push(name.clone());
            }
        }
        names
    }

    /// The topics that have the joints: one with all of them, or several where each joint has one of its own.
    fn joint_topics(&self, options: &RecordingOptions) -> Result<Vec<String>> {
        let mut candidates: Vec<&str> = self.with_schema(&[messages::JOINT_STATE]).collect();
        let asked = options.joint_topic.as_deref();
        if candidates.len() > 1 && asked.is_none() {
            let joints: BTreeMap<&str, Vec<String>> = candidates.iter().map(|t| (*t, self.joints_of(t))).collect();
            let has = |topic: &str, joint: &String| joints[topic].contains(joint);
            let has_all = |topic: &&str| options.joints.iter().all(|joint| has(topic, joint));
            if candidates.iter().any(has_all) {
                candidates.retain(has_all);
            } else if options.joints.iter().all(|joint| joints.keys().filter(|t| has(t, joint)).count() == 1) {
                candidates.retain(|topic| options.joints.iter().any(|joint| has(topic, joint)));
                return Ok(candidates.into_iter().map(str::to_owned).collect());
            }
        }
        let chosen = self.choose(asked, &candidates, &JOINTS).map_err(|e| match e.code {
            Code::TopicAmbiguous => Error { remedy: format!("{}{}", e.remedy, or_urdf(options)), ..e },
            _ => e,
        })?;
        Ok(vec![chosen.to_owned()])
    }

    /// The joint states, with the joints to read (all that there are when none are asked for).
    pub fn joint_readings(&mut self, options: &RecordingOptions) -> Result<JointReadings> {
        let topics = self.joint_topics(options)?;
        let names: Vec<String> = topics.iter().flat_map(|topic| self.joints_of(topic)).collect();
        let place = format!("{}, topic {}", self.recording.display(), topics.join(", "));
        names.iter().try_for_each(|n| plain_name("joint", n, &place).map(|_| ()))?;
        let missing: Vec<&str> = options.joints.iter().filter(|j| !names.contains(j)).map(String::as_str).collect();
        if names.is_empty() {
            return Err(self.unreadable(&topics[0], &JOINTS));
        }
        if !missing.is_empty() {
            let what = format!("has no positions of {}; its joints are: {}", missing.join(", "), names.join(", "));
            let remedy = remedy_of_names(&missing, &names, None)
                .unwrap_or_else(|| "compare with the joint names in the URDF, or choose another tip".to_owned());
            return Err(Error::new(Code::JointMissing, place, what, remedy));
        }
        let joints = if options.joints.is_empty() { names.clone() } else { options.joints.clone() };
        let extra: Vec<&str> = names.iter().filter(|n| !joints.contains(n)).map(String::as_str).collect();
        if !extra.is_empty() {
            let what = format!("joints that the chain does not need: {}", extra.join(", "));
            self.notices.push(Notice::new(Code::JointUnused, place, what, "they are ignored"));
        }
        let samples = topics.iter().flat_map(|topic| self.joints.remove(topic).unwrap_or_default()).collect();
        Ok(JointReadings { topics, samples, joints })
    }

    /// The topic of the images, their frame where they have one in common, and their times, ns.
    pub fn image_topic(&mut self, options: &RecordingOptions) -> Result<(String, Option<String>, Vec<i64>)> {
        let asked = options.image_topic.as_deref();
        let mut candidates: Vec<&str> = self.with_schema(&[messages::IMAGE, messages::COMPRESSED_IMAGE]).collect();
        if asked.is_none() {
            candidates.retain(|c| !c.ends_with("/compressedDepth"));
            let raw = candidates.clone();
            // The same images twice: the raw ones are better.
            candidates.retain(|c| c.strip_suffix("/compressed").is_none_or(|base| !raw.contains(&base)));
        }
        let topic = self.choose(asked, &candidates, &IMAGES)?.to_string();
        let place = format!("{}, topic {topic}", self.recording.display());
        let frames = self.images.remove(&topic).unwrap_or_default();
        let (frame, times) = frames.chosen(options.image_frame.as_deref(), &place)?;
        if times.is_empty() {
            return Err(self.unreadable(&topic, &IMAGES));
        }
        Ok((topic, frame, times))
    }

    /// A topic without one message of use.
    fn unreadable(&self, topic: &str, wanted: &Wanted) -> Error {
        let reason = self.topics.get(topic).map_or("", |t| t.reason.as_str());
        let place = format!("{}, topic {topic}", self.recording.display());
        let (reason, remedy) = match reason {
            "" if wanted.what != JOINTS.what || self.notices.iter().any(|n| n.code == Code::ClockSetBack) => {
                (String::new(), "record it again")
            }
            "" => (
                ": they hold no positions".into(),
                "name a topic with positions (--joint-topic), or let the driver send them",
            ),
            _ => (format!(": one {reason}"), "record it again"),
        };
        Error::new(Code::MessagesUnreadable, place, format!("none of its {} can be used{reason}", wanted.what), remedy)
    }

    /// The camera info beside an image topic, or the only one: that of the frame of the images where it is of several.
    pub fn camera_info(&self, image_topic: &str, frame: Option<&str>, is_asked_for: bool) -> Option<&CameraInfo> {
        let base = image_topic.strip_suffix("/compressed").unwrap_or(image_topic);
        let beside = base.rsplit_once('/').map(|(namespace, _)| format!("{namespace}/camera_info"));
        let infos = match beside.and_then(|topic| self.infos.get(&topic)) {
            None if self.infos.len() == 1 => self.infos.values().next(),
            infos => infos,
        };
        infos?.of(frame, is_asked_for)
    }

    /// Median time from stamp to recording over some topics, s.
    pub fn delay_s(&self, topics: &[String]) -> f64 {
        let all = topics.iter().filter_map(|topic| self.topics.get(topic));
        median_s(all.flat_map(|topic| topic.delays_ns.iter().map(|(_, delay)| *delay)))
    }

    /// By how much more the time from stamp to recording is over the last quarter of the messages of a topic than over the first, s.
    pub fn delay_growth_s(&self, topic: &str) -> f64 {
        let mut delays = self.topics.get(topic).map_or(Vec::new(), |topic| topic.delays_ns.clone());
        delays.sort_by_key(|(log_ns, _)| *log_ns);
        let of = |some: &[(i64, i64)]| median_s(some.iter().map(|(_, delay)| *delay));
        let quarter = delays.len() / 4;
        of(&delays[delays.len() - quarter..]) - of(&delays[..quarter])
    }
}

/// Median of times in ns, s; 0 where there are none.
fn median_s(times_ns: impl Iterator<Item = i64>) -> f64 {
    median_by(times_ns, i64::cmp).map_or(0.0, |ns| ns as f64 * 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `sensor_msgs/JointState` at one second.
    fn joint_state(joints: &[(&str, f64)]) -> Vec<u8> {
        let mut body = vec![1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0];
        let number = |body: &mut Vec<u8>, value: usize| {
            body.resize(body.len().next_multiple_of(4), 0);
            body.extend((value as u32).to_le_bytes());
        };
        number(&mut body, joints.len());
        for (name, _) in joints {
            number(&mut body, name.len() + 1);
            body.extend(name.bytes());
            body.push(0);
        }
        number(&mut body, joints.len());
        body.resize(body.len().next_multiple_of(8), 0);
        joints.iter().for_each(|(_, q)| body.extend(q.to_le_bytes()));
        [vec![0, 1, 0, 0], body].concat()
    }

    /// Drivers of grippers and of passive joints write NaN for what they do not measure.
    #[test]
    fn joints_without_a_position_cost_no_others() {
        let mut scan = Scan::default();
        for (data, topic) in [
            (joint_state(&[("gripper", f64::NAN), ("a", 0.5), ("b", -0.25)]), "/joints"),
            (joint_state(&[("gripper", f64::NAN)]), "/gripper"),
            (joint_state(&[("a", f64::NAN), ("b", f64::NAN)]), "/joints"),
        ] {
            let schema = messages::JOINT_STATE;
            scan.note(&Message { topic, schema, encoding: "cdr", log_time_ns: 1, data: &data }, Clock::Stamp);
        }
        let sample = &scan.joints["/joints"][0];
        assert_eq!(
            (sample.names.as_slice(), sample.positions.as_slice()),
            (&["a".to_owned(), "b".to_owned()][..], &[0.5, -0.25][..])
        );
        let (unread, nothing) = (&scan.joints["/joints"][1].unread, &scan.joints["/joints"][1].names);
        assert_eq!((unread.as_slice(), nothing.len()), (&["a".to_owned(), "b".to_owned()][..], 0));
        assert_eq!(scan.topics["/joints"].malformed, 1);
        assert_eq!((scan.topics["/gripper"].malformed, scan.joints.contains_key("/gripper")), (1, false));
    }

    #[test]
    fn joint_states_without_positions_are_not_to_be_recorded_again() {
        let of = |data: &[u8]| {
            let mut scan = Scan::default();
            let schema = messages::JOINT_STATE;
            scan.note(&Message { topic: "/a", schema, encoding: "cdr", log_time_ns: 1, data }, Clock::Stamp);
            scan.joint_readings(&RecordingOptions::default()).err().map(|e| (e.code, e.remedy))
        };
        // One name; no position behind it, and a number of positions that is cut off.
        let data = joint_state(&[("a", 0.5)]);
        let (without, cut) = (of(&[&data[..32], &[0; 4]].concat()).unwrap(), of(&data[..34]).unwrap());
        assert_eq!((without.0, cut.0), (Code::MessagesUnreadable, Code::MessagesUnreadable));
        assert_ne!(without.1, cut.1);
    }

    /// A rail and the arm on it often have a topic each.
    #[test]
    fn joints_of_several_topics_are_put_together_where_each_has_its_own() {
        let mut scan = Scan::default();
        let note = |scan: &mut Scan, topic: &str, joints: &[(&str, f64)]| {
            let (data, schema) = (joint_state(joints), messages::JOINT_STATE);
            scan.note(&Message { topic, schema, encoding: "cdr", log_time_ns: 1, data: &data }, Clock::Stamp);
        };
        note(&mut scan, "/arm", &[("a", 0.5), ("b", -0.25)]);
        note(&mut scan, "/gripper", &[("finger", 0.01)]);
        note(&mut scan, "/rail", &[("x", 2.0)]);
        let wanted = |joints: &[&str]| RecordingOptions {
            joints: joints.iter().map(|&joint| joint.to_owned()).collect(),
            ..RecordingOptions::default()
        };
        assert_eq!(scan.joint_topics(&wanted(&["x", "a", "b"])).unwrap(), ["/arm", "/rail"]);
        assert_eq!(scan.joint_topics(&wanted(&["b", "a"])).unwrap(), ["/arm"]);
        let code = |scan: &Scan, joints: &[&str]| scan.joint_topics(&wanted(joints)).unwrap_err().code;
        assert_eq!(code(&scan, &["x", "a", "c"]), Code::TopicAmbiguous);
        note(&mut scan, "/copy", &[("a", 0.4)]);
        assert_eq!(code(&scan, &["x", "a", "b"]), Code::TopicAmbiguous);
        let readings = scan.joint_readings(&wanted(&["x", "b"])).unwrap();
        assert_eq!((readings.samples.len(), readings.joints), (2, vec!["x".to_owned(), "b".to_owned()]));
    }

    /// Other recorders write joint states in JSON or protobuf: they are there, and cannot be read.
    #[test]
    fn topics_in_another_encoding_are_named_with_it() {
        let code = |scan: &mut Scan, asked: Option<&str>| {
            let options = RecordingOptions { joint_topic: asked.map(str::to_owned), ..RecordingOptions::default() };
            scan.joint_readings(&options).map(|readings| readings.topics).map_err(|e| (e.code, e.what.contains("json")))
        };
        for schema in ["sensor_msgs/JointState", messages::JOINT_STATE, "foxglove.JointStates"] {
            let mut scan = Scan::default();
            let json = Message { topic: "/json", schema, encoding: "json", log_time_ns: 1, data: b"{}" };
            scan.note(&json, Clock::Stamp);
            assert_eq!(code(&mut scan, None), Err((Code::MessagesUnreadable, true)), "{schema}");
            let data = joint_state(&[("a", 0.5)]);
            let cdr =
                Message { topic: "/cdr", schema: messages::JOINT_STATE, encoding: CDR, log_time_ns: 1, data: &data };
            scan.note(&cdr, Clock::Stamp);
            assert_eq!(code(&mut scan, Some("/json")), Err((Code::MessagesUnreadable, true)), "{schema}");
            assert_eq!(code(&mut scan, None), Ok(vec!["/cdr".to_owned()]));
        }
    }

    #[test]
    fn the_delay_is_that_of_messages_with_a_stamp_and_may_grow() {
        let mut scan = Scan::default();
        let mut note = |topic: &str, stamped: bool, delay_s: f64| {
            let mut data = joint_state(&[("a", 0.5)]);
            if !stamped {
                data[4] = 0;
            }
            let log_time_ns = 1_000_000_000 + (1e9 * delay_s) as u64;
            let schema = messages::JOINT_STATE;
            scan.note(&Message { topic, schema, encoding: "cdr", log_time_ns, data: &data }, Clock::Stamp);
        };
        [0.1, 0.2, 0.3, 0.4].into_iter().for_each(|delay_s| note("/grows", true, delay_s));
        [true, false, false, false].into_iter().for_each(|stamped| note("/once", stamped, 0.02));
        note("/never", false, 0.0);
        let delay = |topic: &str| scan.delay_s(&[topic.to_owned()]);
        assert!((delay("/grows") - 0.3).abs() < 1e-9 && (delay("/once") - 0.02).abs() < 1e-9);
        assert_eq!(delay("/never"), 0.0);
        assert!((scan.delay_growth_s("/grows") - 0.3).abs() < 1e-9);
        assert_eq!(scan.delay_growth_s("/once"), 0.0);
    }
}
