//! Recordings of a simulated arm: images that are stamped and recorded late, and damage.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use image::GrayImage;
use mcap::records::MessageHeader;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use robotcal::error::Code;
use robotcal::series::{AngleUnit, Clock, Extracted, Motion, RecordingOptions, convert_recording, extract};
use tempfile::TempDir;

const START_S: f64 = 1_700_000_000.0;
const SIZE: (u32, u32) = (96, 72);
const STOPS: usize = 24;
/// Half a second of images and joints.
const CHUNK_BYTES: u64 = 64 << 10;
/// Counts of the sensor's noise, evenly spread to either side.
const NOISE: i32 = 2;

/// Stops of unequal length and moves of unequal speed between them.
struct Arm {
    /// When the arm comes to a stop and leaves it, s, and where it stands.
    stops: Vec<(f64, f64, [f64; 2])>,
}

impl Arm {
    fn new(random: &mut ChaCha8Rng) -> Self {
        let mut time = 0.0;
        let mut stop = || {
            let from = time;
            let to = from + random.random_range(0.6..1.0);
            time = to + random.random_range(0.4..0.9);
            (from, to, [random.random_range(-0.4..0.4), random.random_range(-0.4..0.4)])
        };
        Self { stops: (0..STOPS).map(|_| stop()).collect() }
    }

    fn end(&self) -> f64 {
        self.stops[STOPS - 1].1
    }

    fn joints(&self, t: f64) -> [f64; 2] {
        let next = self.stops.iter().position(|s| t <= s.1).unwrap_or(STOPS - 1);
        let (from, _, here) = self.stops[next];
        if t >= from || next == 0 {
            return here;
        }
        let (_, left, before) = self.stops[next - 1];
        let share = 0.5 - 0.5 * (std::f64::consts::PI * (t - left) / (from - left)).cos();
        [0, 1].map(|j| before[j] + share * (here[j] - before[j]))
    }
}

/// A sharp picture: dots of a plane that moves with the joints.
fn picture(q: [f64; 2], random: Option<&mut ChaCha8Rng>) -> GrayImage {
    let mut picture = GrayImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        let (u, v) = (f64::from(x) + 300.0 * q[0], f64::from(y) + 300.0 * q[1]);
        let cell = ((u / 12.0).floor() as i64 * 7919 + (v / 12.0).floor() as i64 * 104_729).rem_euclid(97);
        image::Luma([60 + cell as u8])
    });
    if let Some(random) = random {
        picture.iter_mut().for_each(|v| *v = v.saturating_add_signed(random.random_range(-NOISE..=NOISE) as i8));
    }
    picture
}

/// A CDR message with its header.
struct Cdr(Vec<u8>);

impl Cdr {
    fn new(time_ns: u64) -> Self {
        let cdr = Self(vec![0, 1, 0, 0]);
        cdr.number((time_ns / 1_000_000_000) as u32).number((time_ns % 1_000_000_000) as u32).text("")
    }

    fn put(mut self, align: usize, bytes: &[u8]) -> Self {
        self.0.resize(4 + (self.0.len() - 4).next_multiple_of(align), 0);
        self.0.extend(bytes);
        self
    }

    fn number(self, value: u32) -> Self {
        self.put(4, &value.to_le_bytes())
    }

    fn text(self, text: &str) -> Self {
        self.number(text.len() as u32 + 1).put(1, text.as_bytes()).put(1, &[0])
    }

    fn joint_state(self, q: [f64; 2]) -> Vec<u8> {
        let names = self.number(2).text("joint_1").text("joint_2").number(2);
        q.iter().fold(names, |cdr, q| cdr.put(8, &q.to_le_bytes())).number(0).number(0).0
    }

    fn image(self, picture: &GrayImage) -> Vec<u8> {
        let (width, height) = picture.dimensions();
        let head = self.number(height).number(width).text("mono8").put(1, &[0]).number(width);
        head.number(width * height).put(1, picture.as_raw()).0
    }
}

/// When images and joints are taken and stamped.
#[derive(Clone, Copy)]
struct Times {
    /// From image to image, s.
    step_s: f64,
    /// Images are stamped and recorded so much after what they show, s.
    delay_s: f64,
    /// The clock that stamps the joints is so much behind that of images and recording, s.
    behind_s: f64,
    joints: Joints,
}

/// How joints are written.
#[derive(Clone, Copy)]
struct Joints {
    /// A radian in the unit of the readings.
    radian: f64,
    /// Noise to either side, rad.
    noise_rad: f64,
    /// Begin and end of the time in which the second joint cannot be read, s.
    unread: [f64; 2],
}

const RADIANS: Joints = Joints { radian: 1.0, noise_rad: 0.0, unread: [0.0; 2] };

/// Joints at 125 Hz, and images.
fn write(path: &Path, arm: &Arm, Times { step_s, delay_s, behind_s, joints }: Times, random: &mut ChaCha8Rng) {
    let mut messages: BTreeMap<(u64, u16), Vec<u8>> = BTreeMap::new();
    let ns = |t: f64| ((START_S + t) * 1e9) as u64;
    for k in 0..(arm.end() / 0.008) as u32 {
        let t = f64::from(k) * 0.008;
        let noise = joints.noise_rad * f64::from(k * 7919 % 3) - joints.noise_rad;
        let mut q = arm.joints(t).map(|q| joints.radian * (q + noise));
        if (joints.unread[0]..joints.unread[1]).contains(&t) {
            q[1] = f64::NAN;
        }
        messages.insert((ns(t), 0), Cdr::new(ns(t - behind_s)).joint_state(q));
    }
    for k in 0..(arm.end() / step_s) as u32 {
        // Cameras are not punctual.
        let t = f64::from(k) * step_s + random.random_range(0.0..0.2) * step_s;
        let shown = picture(arm.joints(t - delay_s), Some(random));
        messages.insert((ns(t), 1), Cdr::new(ns(t)).image(&shown));
    }
    let options = mcap::WriteOptions::new().profile("ros2").chunk_size(Some(CHUNK_BYTES));
    let mut writer = options.create(File::create(path).unwrap()).unwrap();
    let topics = [("sensor_msgs/msg/JointState", "/joint_states"), ("sensor_msgs/msg/Image", "/camera/image_raw")];
    let channels = topics.map(|(schema, topic)| {
        let schema = writer.add_schema(schema, "ros2msg", b"").unwrap();
        writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap()
    });
    for ((time, channel), data) in &messages {
        let channel_id = channels[usize::from(*channel)];
        let header = MessageHeader { channel_id, sequence: 0, log_time: *time, publish_time: *time };
        writer.write_to_known_channel(&header, data).unwrap();
    }
    writer.finish().unwrap();
}

struct Recorded {
    folder: TempDir,
    arm: Arm,
    path: PathBuf,
}

impl Recorded {
    fn new(seed: u64, step_s: f64, delay_s: f64) -> Self {
        Self::at(seed, Times { step_s, delay_s, behind_s: 0.0, joints: RADIANS })
    }

    fn at(seed: u64, times: Times) -> Self {
        println!("seed {seed}");
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (folder, arm) = (tempfile::tempdir().unwrap(), Arm::new(&mut random));
        let path = folder.path().join("run.mcap");
        write(&path, &arm, times, &mut random);
        Self { folder, arm, path }
    }

    fn extract(&self, options: &RecordingOptions) -> Extracted {
        extract(&self.path, &self.folder.path().join("images"), options).unwrap()
    }

    /// Stops whose picture shows something else than the scene at its joints.
    fn wrong(&self, extracted: &Extracted, most_counts: f64) -> usize {
        let is_wrong = |stop: &&robotcal::series::SeriesStop| {
            let q = stop.raw_readings.as_ref().unwrap();
            let (got, wanted) =
                (image::open(stop.path.as_ref().unwrap()).unwrap().into_luma8(), picture([q[0], q[1]], None));
            let sum: u32 = got.iter().zip(wanted.iter()).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
            f64::from(sum) / f64::from(SIZE.0 * SIZE.1) > most_counts
        };
        extracted.stops.stops.iter().filter(is_wrong).count()
    }
}

fn as_stamped() -> RecordingOptions {
    RecordingOptions { image_delay_s: Some(0.0), ..RecordingOptions::default() }
}

#[test]
fn late_images_are_told_by_their_motion_and_put_right() {
    for (seed, step_s, delay_s, wrong) in
        [(1, 0.1, 0.25, 3), (2, 0.05, 0.25, 12), (3, 0.033, 0.11, 1), (4, 0.1, -0.18, 1), (5, 0.066, 1.3, 12)]
    {
        let recorded = Recorded::new(seed, step_s, delay_s);
        let misled = recorded.extract(&as_stamped());
        let extracted = recorded.extract(&RecordingOptions::default());
        let late = extracted.late.unwrap();
        println!("{delay_s}: {late:?}, {} of {} wrong", recorded.wrong(&misled, 3.0), misled.stops.stops.len());
        // Times are known to a millisecond, and moves begin slowly.
        assert!((late.delay_s - delay_s).abs() < (4.0 * late.sigma_s).max(0.004), "{late:?} {delay_s}");
        assert!(late.sigma_s < 0.005, "{late:?}");
        // Noise of 2 counts is 1.2 on the mean.
        assert!(misled.late.is_none() && recorded.wrong(&misled, 3.0) >= wrong);
        assert_eq!(recorded.wrong(&extracted, 3.0), 0);
        assert!(extracted.stops.stops.len() >= STOPS - 2);
        for stop in &extracted.stops.stops {
            let q = stop.raw_readings.as_ref().unwrap();
            assert!(recorded.arm.stops.iter().any(|s| (q[0] - s.2[0]).abs() + (q[1] - s.2[1]).abs() < 1e-3));
        }
    }
}

#[test]
fn punctual_images_are_left_alone() {
    for (seed, step_s) in [(11, 0.1), (12, 0.05), (13, 0.033)] {
        let recorded = Recorded::new(seed, step_s, 0.0);
        let (extracted, stamped) = (recorded.extract(&RecordingOptions::default()), recorded.extract(&as_stamped()));
        assert_eq!(extracted.late, None);
        assert_eq!((&extracted.stops, &extracted.reports), (&stamped.stops, &stamped.reports));
        assert_eq!(extracted.notices, stamped.notices);
        assert_eq!(recorded.wrong(&extracted, 3.0), 0);
    }
}

#[test]
fn a_given_delay_is_taken_as_it_is() {
    let recorded = Recorded::new(21, 0.1, 0.25);
    let given = recorded.extract(&RecordingOptions { image_delay_s: Some(0.25), ..RecordingOptions::default() });
    assert_eq!((given.late, recorded.wrong(&given, 3.0)), (None, 0));
}

/// Stamps of two clocks seconds apart, which arrive at the same time: arrival says where to look for the motion.
#[test]
fn stamps_of_two_clocks_are_told_by_arrival_and_motion() {
    for (seed, behind_s) in [(51, 3.0), (52, -3.0), (53, 5.0)] {
        let recorded = Recorded::at(seed, Times { step_s: 0.066, delay_s: 0.0, behind_s, joints: RADIANS });
        let extracted = recorded.extract(&RecordingOptions::default());
        let late = extracted.late.unwrap();
        assert!((late.delay_s - behind_s).abs() < (4.0 * late.sigma_s).max(0.004), "{late:?} {behind_s}");
        assert_eq!(recorded.wrong(&extracted, 3.0), 0);
        assert!(extracted.stops.stops.len() > STOPS - 12, "{}", extracted.stops.stops.len());
    }
}

/// Images too far apart show no motion. Stamps or arrival: of a stop that is longer than their difference, images of both are taken; where none is,
/// nobody knows.
#[test]
fn of_stamps_that_arrival_contradicts_no_image_is_of_another_stop() {
    let seldom = |seed, behind_s| Recorded::at(seed, Times { step_s: 0.3, delay_s: 0.0, behind_s, joints: RADIANS });
    let little = seldom(61, 0.3);
    let extracted = little.extract(&RecordingOptions::default());
    let codes: Vec<Code> = extracted.notices.iter().map(|n| n.code).collect();
    assert!(extracted.late.is_none() && codes.contains(&Code::ImagesDelayed), "{codes:?}");
    assert!(little.wrong(&little.extract(&as_stamped()), 3.0) > 0);
    assert_eq!(little.wrong(&extracted, 3.0), 0);
    assert!(extracted.stops.stops.len() > STOPS / 2);
    let much = seldom(62, 3.0);
    let error = extract(&much.path, &much.folder.path().join("images"), &RecordingOptions::default()).unwrap_err();
    assert_eq!(error.code, Code::ClocksApart);
    let by_arrival = much.extract(&RecordingOptions { clock: Clock::Log, ..RecordingOptions::default() });
    assert_eq!(much.wrong(&by_arrival, 3.0), 0);
}

/// Images in motion need the delay most: joints and picture differ by the way of a quarter of a second.
#[test]
fn images_in_motion_get_the_joints_of_their_moment() {
    let recorded = Recorded::new(31, 0.05, 0.25);
    let options = RecordingOptions { motion: Motion::Accept { interval_s: 0.2 }, ..RecordingOptions::default() };
    let extracted = recorded.extract(&options);
    let stamped = recorded.extract(&RecordingOptions { image_delay_s: Some(0.0), ..options });
    // A few milliseconds are a few pixels at the highest speed.
    let wrong = recorded.wrong(&extracted, 12.0);
    assert!(extracted.stops.stops.len() > 2 * STOPS && 5 * wrong < recorded.wrong(&stamped, 12.0), "{wrong}");
}

/// A delay below half the time from image to image is nothing to a robot that stands; in motion it is taken off, and of readings that are
/// still uncertain by more than 5 mrad nothing is made.
#[test]
fn short_delays_count_in_motion() {
    let motion = Motion::Accept { interval_s: 0.2 };
    for (seed, step_s, delay_s) in [(32, 0.1, 0.04), (33, 0.05, 0.02)] {
        let recorded = Recorded::new(seed, step_s, delay_s);
        let extracted = recorded.extract(&RecordingOptions { motion, ..RecordingOptions::default() });
        let late = extracted.late.unwrap();
        println!("{late:?}");
        assert!((late.delay_s - delay_s).abs() < (4.0 * late.sigma_s).max(0.004), "{late:?} {delay_s}");
        let in_motion = extracted.reports.iter().filter(|r| r.speed > 0.1).count();
        assert!(in_motion > STOPS / 2, "{in_motion}");
        assert!(extracted.reports.iter().all(|r| r.speed * late.sigma_s <= 5e-3 + 1e-12), "{late:?}");
        // Stamps name the images: what the arm did at what they show.
        for stop in &extracted.stops.stops {
            let shown = recorded.arm.joints(stop.time_s.unwrap() - START_S - delay_s);
            let off =
                stop.raw_readings.iter().flatten().zip(shown).map(|(q, wanted)| (q - wanted).abs()).fold(0.0, f64::max);
            // The fastest motion is of 0.8 rad in 0.4 s, by a cosine: 3.1 rad/s.
            assert!(off < 3.2 * (4.0 * late.sigma_s).max(0.004), "{}: {off}", stop.image);
        }
        let standing = recorded.extract(&RecordingOptions::default());
        assert!(standing.late.is_none_or(|late| late.delay_s > 0.5 * step_s), "{:?}", standing.late);
    }
}

/// Images three a second do not tell their delay: none is taken in motion, unless the delay is stated.
#[test]
fn nothing_is_taken_in_motion_while_the_delay_is_not_known() {
    let motion = Motion::Accept { interval_s: 0.3 };
    let recorded = Recorded::new(34, 0.3, 0.02);
    let options = RecordingOptions { motion, ..RecordingOptions::default() };
    let error = extract(&recorded.path, &recorded.folder.path().join("images"), &options).unwrap_err();
    assert_eq!((error.code, error.exit_code()), (Code::ImageDelayUnchecked, 2), "{error}");
    let stated = recorded.extract(&RecordingOptions { image_delay_s: Some(0.02), ..options });
    assert!(stated.reports.iter().filter(|r| r.speed > 0.1).count() > STOPS / 2);
}

/// Three wrong bytes in one chunk cost the stops that were taken in it, and no others.
#[test]
fn damage_costs_the_stops_of_its_own_chunk_alone() {
    let recorded = Recorded::new(41, 0.1, 0.0);
    let whole = std::fs::read(&recorded.path).unwrap();
    let chunks = mcap::Summary::read(&whole).unwrap().unwrap().chunk_indexes;
    assert!(chunks.len() > 20, "{}", chunks.len());
    let all = recorded.extract(&RecordingOptions::default()).stops.stops.len();
    assert_eq!(all, STOPS);
    let mut least = all;
    for chunk in &chunks {
        let mut wrong = whole.clone();
        let middle = (chunk.chunk_start_offset + chunk.chunk_length / 2) as usize;
        wrong[middle..middle + 3].iter_mut().for_each(|b| *b ^= 0x55);
        std::fs::write(&recorded.path, &wrong).unwrap();
        let seconds = |ns: u64| ns as f64 * 1e-9 - START_S;
        let (from, to) = (seconds(chunk.message_start_time), seconds(chunk.message_end_time));
        let hit = recorded.arm.stops.iter().filter(|s| s.0 <= to && from <= s.1).count();
        let kept = recorded.extract(&RecordingOptions::default()).stops.stops.len();
        assert!(kept >= all - hit && hit <= 2, "{kept} of {all} stops, {hit} in the chunk");
        least = least.min(kept);
    }
    println!("at least {least} of {all} stops in {} damaged recordings", chunks.len());
    assert!(least >= STOPS - 2);
}

fn with_joints(joints: Joints) -> Recorded {
    Recorded::at(61, Times { step_s: 0.066, delay_s: 0.0, behind_s: 0.0, joints })
}

/// Speeds are those of radians, whatever the unit; where none is stated, degrees are named.
#[test]
fn a_robot_that_reads_degrees_stands_still_as_one_that_reads_radians() {
    let noisy = |radian| with_joints(Joints { radian, noise_rad: 1e-4, ..RADIANS });
    let (degrees, radians) = (noisy(1f64.to_degrees()), noisy(1.0));
    let stated = RecordingOptions { joint_unit: Some(AngleUnit::Deg), ..as_stamped() };
    let (got, wanted) = (degrees.extract(&stated), radians.extract(&as_stamped()));
    assert_eq!((got.joint_unit, wanted.joint_unit), (AngleUnit::Deg, AngleUnit::Rad));
    assert!(!got.is_unit_in_doubt && !wanted.is_unit_in_doubt);
    assert_eq!(got.stops.stops.len(), wanted.stops.stops.len());
    for (a, b) in got.stops.stops.iter().zip(&wanted.stops.stops) {
        assert_eq!(a.image, b.image);
        for (a, b) in a.raw_readings.iter().flatten().zip(b.raw_readings.iter().flatten()) {
            assert!((a - b.to_degrees()).abs() < 1e-9, "{a} deg {b} rad");
        }
    }
    let images = degrees.folder.path().join("none");
    let error = extract(&degrees.path, &images, &as_stamped()).unwrap_err();
    assert_eq!(error.code, Code::DegreesAsRadians, "{error}");
}

/// Noise-free degrees are slow enough where the robot stands: what is made of them states no unit.
#[test]
fn degrees_of_which_nobody_says_so_are_not_written_as_radians() {
    let degrees = with_joints(Joints { radian: 1f64.to_degrees(), ..RADIANS });
    let folder = degrees.folder.path().join("converted");
    let extracted = convert_recording(&degrees.path, &folder, &as_stamped()).unwrap();
    assert!(extracted.notices.iter().any(|n| n.code == Code::DegreesAsRadians), "{:?}", extracted.notices);
    assert!(!std::fs::read_to_string(folder.join("series.toml")).unwrap().contains("joint_unit"));
}

/// The second joint is not read while the robot comes to a stop: what it read before is not what it reads there.
#[test]
fn images_are_not_used_while_a_joint_is_not_read() {
    let (from, ..) = with_joints(RADIANS).arm.stops[6];
    let recorded = with_joints(Joints { unread: [from - 0.15, from + 0.3], ..RADIANS });
    let extracted = recorded.extract(&as_stamped());
    assert!(extracted.notices.iter().any(|n| n.code == Code::JointSilent), "{:?}", extracted.notices);
    for (stop, report) in extracted.stops.stops.iter().zip(&extracted.reports) {
        let (q, t) = (stop.raw_readings.as_ref().unwrap(), stop.time_s.unwrap() - START_S);
        let off = recorded.arm.joints(t)[1] - q[1];
        assert!(off.abs() < 1e-3 && report.nearest_sample_s < 0.02, "{}: {off} rad", stop.image);
        assert!(!(from - 0.14..from + 0.28).contains(&t), "{}", stop.image);
    }
}
