//! Recordings by independent writers (tests/make_recordings.py), whole, damaged and of the wrong kind.

use std::fs;
use std::path::{Path, PathBuf};

use crate::said::assert_says;
use image::DynamicImage;
use robotcal::series::{Clock, Extracted, Motion, Picking, RecordingOptions, extract};
use robotcal::{Code, Error};
use tempfile::TempDir;

pub const STOPS: usize = 5;
const START_NS: i64 = 1_700_000_000_000_000_000;
const SIZE: (u32, u32) = (32, 24);

pub fn recording(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/recordings")).join(name)
}

fn options(joints: &[&str]) -> RecordingOptions {
    RecordingOptions { joints: joints.iter().map(|j| j.to_string()).collect(), ..RecordingOptions::default() }
}

pub fn three() -> RecordingOptions {
    options(&["joint_1", "joint_2", "joint_3"])
}

pub fn read(path: &Path, options: &RecordingOptions) -> (TempDir, Extracted) {
    let folder = tempfile::tempdir().unwrap();
    let extracted = extract(path, &folder.path().join("images"), options).unwrap_or_else(|e| panic!("{e}"));
    (folder, extracted)
}

pub fn refusal(path: &Path, options: &RecordingOptions) -> Error {
    let folder = tempfile::tempdir().unwrap();
    let error = extract(path, folder.path(), options).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left behind");
    error
}

/// The formulas of make_recordings.py.
pub fn posture(stop: usize) -> [f64; 3] {
    let k = stop as f64;
    [0.1 * k, 0.5 - 0.2 * k, if stop.is_multiple_of(2) { 0.25 } else { -0.25 }]
}

fn count(stop: usize, shot: usize, x: u32, y: u32) -> u32 {
    let pattern = (7 * x + 13 * y + 29 * stop as u32 + x * y) % 201;
    if shot == 4 { pattern } else { 50 + pattern / 2 }
}

fn stamp_ns(stop: usize, shot: usize) -> i64 {
    START_NS + (15 * stop + shot) as i64 * 100_000_000 + 5_000_000
}

fn pictures(extracted: &Extracted) -> Vec<DynamicImage> {
    extracted.stops.stops.iter().map(|s| image::open(s.path.as_ref().unwrap()).unwrap()).collect()
}

#[track_caller]
fn assert_stops(extracted: &Extracted, shot: usize) {
    assert_eq!(extracted.stops.stops.len(), STOPS);
    for (k, stop) in extracted.stops.stops.iter().enumerate() {
        let ns = stamp_ns(k, shot);
        assert!(
            stop.image.starts_with(&format!("{}.{:09}.", ns / 1_000_000_000, ns % 1_000_000_000)),
            "{}",
            stop.image
        );
        // A stamp of 1.7e9 s has 0.24 us of resolution in a double.
        assert!((stop.time_s.unwrap() - ns as f64 * 1e-9).abs() < 1e-6);
        for (q, wanted) in stop.raw_readings.as_ref().unwrap().iter().zip(posture(k)) {
            assert!((q - wanted).abs() < 1e-12, "stop {k}: {q} {wanted}");
        }
        assert!(extracted.reports[k].speed < 1e-9 && extracted.reports[k].nearest_sample_s < 0.0051);
    }
}

#[test]
fn a_rosbag2_folder_gives_the_sharpest_picture_of_every_standstill() {
    let (_folder, extracted) = read(&recording("mono8"), &three());
    assert_stops(&extracted, 4);
    let (_zipped, same) = read(&recording("zipped_messages"), &three());
    assert_stops(&same, 4);
    assert_eq!(pictures(&same), pictures(&extracted), "every message may be packed by itself");
    for (k, picture) in pictures(&extracted).iter().enumerate() {
        let grey = picture.as_luma8().unwrap();
        assert_eq!(grey.dimensions(), SIZE);
        assert!(grey.enumerate_pixels().all(|(x, y, p)| u32::from(p.0[0]) == count(k, 4, x, y)), "stop {k}");
    }
    assert_eq!(extracted.stops.joints, ["joint_1", "joint_2", "joint_3"]);
    assert_eq!(
        (extracted.joint_topic.as_str(), extracted.image_topic.as_str()),
        ("/joint_states", "/camera/image_raw")
    );
    // Images are recorded 30 ms after their stamp, joints 1 ms.
    assert!((extracted.image_delay_s - 0.029).abs() < 1e-9);
    let noticed = |code| extracted.notices.iter().find(|n| n.code == code).unwrap();
    assert_says(noticed(Code::JointUnused), Code::JointUnused, &["gripper"]);
    assert_says(noticed(Code::ImagesInMotion), Code::ImagesInMotion, &["29 of 70"]);
    assert_eq!(extracted.inputs.len(), 1);
    assert_eq!(extracted.inputs[0].sha256.len(), 64);
}

#[test]
fn big_endian_sixteen_bit_mosaics_keep_their_depth() {
    let (_folder, extracted) = read(&recording("bayer16_big_endian"), &three());
    assert_stops(&extracted, 4);
    for (k, picture) in pictures(&extracted).iter().enumerate() {
        let colour = picture.as_rgb16().unwrap();
        assert_eq!(colour.dimensions(), SIZE);
        for (x, y, pixel) in colour.enumerate_pixels() {
            // Red, green and blue of the pattern are 200, 100 and 50 times the counts, where they stand.
            let (channel, gain) = match (y % 2, x % 2) {
                (0, 0) => (0, 200),
                (1, 1) => (2, 50),
                _ => (1, 100),
            };
            assert_eq!(u32::from(pixel.0[channel]), gain * count(k, 4, x, y), "stop {k} at {x}, {y}");
        }
    }
}

#[test]
fn compressed_images_are_kept_as_they_are_and_the_camera_info_is_read() {
    let (_folder, extracted) = read(&recording("lz4.mcap"), &options(&[]));
    assert_stops(&extracted, 4);
    let (_other, same) = read(&recording("zstd.mcap"), &options(&[]));
    assert_eq!((&same.reports, &same.stops.joints), (&extracted.reports, &extracted.stops.joints));
    assert_eq!(pictures(&same), pictures(&extracted), "chunk compression does not matter");
    assert_eq!(extracted.stops.joints, ["joint_1", "joint_2", "joint_3"], "all joints when none are asked for");
    let names: Vec<_> = extracted.stops.stops.iter().map(|s| s.image.rsplit_once('.').unwrap().1).collect();
    assert_eq!(names, ["png", "png", "png", "png", "jpg"]);
    for (k, picture) in pictures(&extracted)[..4].iter().enumerate() {
        let grey = picture.as_luma8().unwrap();
        assert!(grey.enumerate_pixels().all(|(x, y, p)| u32::from(p.0[0]) == count(k, 4, x, y)), "stop {k}");
    }
    let info = extracted.camera_info.unwrap();
    assert_eq!((info.width_px, info.height_px, info.distortion_model.as_str()), (32, 24, "plumb_bob"));
    assert_eq!(info.intrinsics, Some([40.0, 41.0, 15.5, 11.5]));
    assert_eq!(info.distortion, [-0.1, 0.05, 0.0, 0.0, 0.0]);
}

#[test]
fn averaging_takes_all_pictures_of_a_standstill_and_tells_the_noise() {
    let options = RecordingOptions { picking: Picking::Average, ..three() };
    let (_folder, extracted) = read(&recording("mono8"), &options);
    assert_eq!(extracted.stops.stops.len(), STOPS);
    for (k, picture) in pictures(&extracted).iter().enumerate() {
        let n = extracted.reports[k].pictures as u32;
        assert!((8..=9).contains(&n), "{n}");
        for (x, y, p) in picture.as_luma16().unwrap().enumerate_pixels() {
            let mean = 257 * ((n - 1) * count(k, 0, x, y) + count(k, 4, x, y));
            assert!((u32::from(p.0[0]) * n).abs_diff(mean) <= n, "stop {k} at {x}, {y}");
        }
        // One of n pictures differs by d: its variance over the pictures is d^2 / n.
        let all = || (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y)));
        let d2: f64 = all().map(|(x, y)| (f64::from(count(k, 0, x, y)) - f64::from(count(k, 4, x, y))).powi(2)).sum();
        let noise = (d2 / f64::from(SIZE.0 * SIZE.1) / f64::from(n)).sqrt();
        let got = extracted.reports[k].noise_counts.unwrap();
        assert!((got / noise - 1.0).abs() < 1e-9, "{got} {noise}");
    }
}

#[test]
fn the_clock_of_recording_can_be_used_instead_of_stamps() {
    let options = RecordingOptions { clock: Clock::Log, ..three() };
    let (_folder, extracted) = read(&recording("mono8"), &options);
    assert_eq!(extracted.stops.stops.len(), STOPS);
    for (k, stop) in extracted.stops.stops.iter().enumerate() {
        let ns = stamp_ns(k, 4) + 30_000_000;
        assert!((stop.time_s.unwrap() - ns as f64 * 1e-9).abs() < 1e-6);
    }
}

/// From the middle on by two seconds: a picture of the one time must not get the joints of the other.
#[test]
fn what_was_recorded_in_times_that_are_there_twice_is_left_out() {
    let whole = fs::read(recording("lz4.mcap")).unwrap();
    let messages: Vec<_> = mcap::MessageStream::new(&whole).unwrap().map(Result::unwrap).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("set_back.mcap");
    let mut writer = mcap::Writer::new(fs::File::create(&path).unwrap()).unwrap();
    let half = messages.len() / 2;
    for (k, mut message) in messages.into_iter().enumerate() {
        message.log_time -= if k < half { 0 } else { 2_000_000_000 };
        writer.write(&message).unwrap();
    }
    writer.finish().unwrap();
    let (_images, extracted) = read(&path, &RecordingOptions { clock: Clock::Log, ..three() });
    assert!(extracted.notices.iter().any(|n| n.code == Code::ClockSetBack), "{:?}", extracted.notices);
    let stops = &extracted.stops.stops;
    assert!((1..STOPS).contains(&stops.len()), "{} stops", stops.len());
    for (stop, picture) in stops.iter().zip(pictures(&extracted)) {
        let readings = stop.raw_readings.as_ref().unwrap();
        let is_of = |k: &usize| readings.iter().zip(posture(*k)).all(|(q, wanted)| (q - wanted).abs() < 1e-12);
        let k = (0..STOPS).find(is_of).unwrap_or_else(|| panic!("{readings:?} are of no stop"));
        let grey = picture.to_luma8();
        // The last one is a JPEG.
        let misses = |(stop, shot): &(usize, usize)| -> u32 {
            grey.enumerate_pixels().map(|(x, y, p)| u32::from(p[0]).abs_diff(count(*stop, *shot, x, y))).sum()
        };
        let shown = (0..STOPS).flat_map(|stop| [0, 4].map(|shot| (stop, shot))).min_by_key(misses);
        assert_eq!(shown.map(|(stop, _)| stop), Some(k), "{}", stop.image);
    }
}

/// By 0.3 s while the robot moves: both halves together read as two publishers.
#[test]
fn a_clock_that_is_set_back_by_a_little_is_no_second_publisher() {
    let whole = fs::read(recording("lz4.mcap")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("set_back.mcap");
    let mut writer = mcap::Writer::new(fs::File::create(&path).unwrap()).unwrap();
    for message in mcap::MessageStream::new(&whole).unwrap() {
        let mut message = message.unwrap();
        let schema = message.channel.schema.as_ref().map(|schema| schema.name.clone()).unwrap_or_default();
        if ["sensor_msgs/msg/JointState", "sensor_msgs/msg/CompressedImage"].contains(&schema.as_str()) {
            let data = message.data.to_mut();
            let [seconds, nanoseconds] = [4, 8].map(|k| u32::from_le_bytes(data[k..k + 4].try_into().unwrap()));
            let stamp = i64::from(seconds) * 1_000_000_000 + i64::from(nanoseconds);
            let stamp = stamp - if stamp < START_NS + 2_800_000_000 { 0 } else { 300_000_000 };
            data[4..8].copy_from_slice(&((stamp / 1_000_000_000) as u32).to_le_bytes());
            data[8..12].copy_from_slice(&((stamp % 1_000_000_000) as u32).to_le_bytes());
        }
        writer.write(&message).unwrap();
    }
    writer.finish().unwrap();
    let (_images, extracted) = read(&path, &three());
    let told = extracted.notices.iter().find(|n| n.code == Code::ClockSetBack).unwrap();
    assert_says(told, Code::ClockSetBack, &["0.3 s", "--clock log"]);
    // Nothing of a stop was recorded twice: at 2.8 s the robot is on its way.
    assert_eq!(extracted.stops.stops.len(), STOPS);
    for (k, stop) in extracted.stops.stops.iter().enumerate() {
        let off = stop.raw_readings.iter().flatten().zip(posture(k)).map(|(q, wanted)| (q - wanted).abs());
        assert!(off.fold(0.0, f64::max) < 1e-12, "stop {k}");
    }
}

#[test]
fn a_robot_that_never_stands_is_refused_unless_asked_for() {
    let restless = RecordingOptions { least_still_s: 5.0, ..three() };
    let message = refusal(&recording("mono8"), &restless);
    assert_says(&message, Code::RobotNeverStill, &["5 s", "0.010 s", "5 places"]);
    let motion = Motion::Accept { interval_s: 0.45 };
    let accepting = RecordingOptions { motion, image_delay_s: Some(0.0), ..restless };
    let (_folder, extracted) = read(&recording("mono8"), &accepting);
    // Images every 0.1 s over 7.0 s, at least 0.45 s apart: every fifth.
    assert_eq!(extracted.stops.stops.len(), 14);
    let moving = &extracted.stops.stops[2];
    assert!((moving.time_s.unwrap() - (START_NS as f64 * 1e-9 + 1.005)).abs() < 1e-6);
    // 5 ms into the half second from stop 0 to stop 1.
    let wanted = posture(0)[0] + 0.01 * (posture(1)[0] - posture(0)[0]);
    assert!((moving.raw_readings.as_ref().unwrap()[0] - wanted).abs() < 1e-12);
    assert!(extracted.reports[2].speed > 0.1, "{:?}", extracted.reports[2]);
}

#[test]
fn missing_joints_and_topics_are_listed() {
    let message = refusal(&recording("mono8"), &options(&["joint_1", "joint_7"]));
    assert_says(&message, Code::JointMissing, &["joint_7", "gripper, joint_1"]);
    let topic = |joint: Option<&str>, image: Option<&str>| RecordingOptions {
        joint_topic: joint.map(String::from),
        image_topic: image.map(String::from),
        ..three()
    };
    let message = refusal(&recording("mono8"), &topic(Some("/note"), None));
    assert_says(&message, Code::TopicMissing, &["/note", "/joint_states"]);
    let message = refusal(&recording("mono8"), &topic(None, Some("/camera/other")));
    assert_says(&message, Code::TopicMissing, &["/camera/image_raw (sensor_msgs/msg/Image, 70)"]);
    let (_folder, extracted) = read(&recording("mono8"), &topic(Some("/joint_states"), Some("/camera/image_raw")));
    assert_stops(&extracted, 4);
}

/// Two cameras with one clock in one topic: frame_id alone tells their images apart.
#[test]
fn images_of_several_cameras_in_one_topic_are_told_apart_by_their_frame() {
    let whole = fs::read(recording("mono8").join("mono8.mcap")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.mcap");
    let mut writer = mcap::Writer::new(fs::File::create(&path).unwrap()).unwrap();
    let mut own = String::new();
    for message in mcap::MessageStream::new(&whole).unwrap() {
        let mut message = message.unwrap();
        writer.write(&message).unwrap();
        if message.channel.schema.as_ref().is_some_and(|schema| schema.name == "sensor_msgs/msg/Image") {
            let data = message.data.to_mut();
            // Of the header: representation, stamp, length of the frame with its end, frame.
            let end = 16 + u32::from_le_bytes(data[12..16].try_into().unwrap()) as usize - 1;
            own = String::from_utf8(data[16..end].to_vec()).unwrap();
            data[end - 1] = b'2';
            let pixels = data.len() - (SIZE.0 * SIZE.1) as usize;
            data[pixels..].iter_mut().for_each(|v| *v = 255 - *v);
            writer.write(&message).unwrap();
        }
    }
    writer.finish().unwrap();
    let other = format!("{}2", &own[..own.len() - 1]);
    assert_says(&refusal(&path, &three()), Code::TopicAmbiguous, &[own.as_str(), other.as_str(), "--image-frame"]);
    let of = |frame: &str| RecordingOptions { image_frame: Some(frame.to_owned()), ..three() };
    assert_says(&refusal(&path, &of("none")), Code::TopicMissing, &[own.as_str(), other.as_str(), "--image-frame"]);
    for (frame, shown) in [(&own, false), (&other, true)] {
        let (_folder, extracted) = read(&path, &of(frame));
        assert_eq!(extracted.stops.stops.len(), STOPS);
        let (_alone, plain) = read(&recording("mono8"), &three());
        for (one, whole) in pictures(&extracted).iter().zip(pictures(&plain)) {
            let (one, whole) = (one.to_luma8(), whole.to_luma8());
            assert!(one.pixels().zip(whole.pixels()).all(|(a, b)| a.0[0] == if shown { 255 - b.0[0] } else { b.0[0] }));
        }
    }
}

#[test]
fn other_recordings_are_refused_with_the_command_that_converts_them() {
    for (name, code, named) in [
        ("old.bag", Code::RecordingFormat, "rosbags-convert --src"),
        ("nothing.mcap", Code::FileMissing, "nothing.mcap"),
        ("../make_recordings.py", Code::RecordingFormat, "make_recordings.py"),
    ] {
        assert_says(&refusal(&recording(name), &three()), code, &[named]);
    }
}

#[test]
fn a_cut_or_damaged_file_gives_what_stands_before_the_damage() {
    let whole = fs::read(recording("lz4.mcap")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.mcap");
    let mut last = STOPS;
    for share in [9, 7, 5] {
        fs::write(&path, &whole[..whole.len() * share / 10]).unwrap();
        let (_images, extracted) = read(&path, &three());
        let stops = extracted.stops.stops.len();
        assert!(stops <= last && stops >= 1, "{stops} stops of {share} tenths");
        assert!(extracted.notices.iter().any(|n| n.code == Code::RecordingDamaged), "{:?}", extracted.notices);
        last = stops;
        for (k, stop) in extracted.stops.stops.iter().enumerate() {
            let wanted = posture(k);
            assert!(stop.raw_readings.as_ref().unwrap().iter().zip(wanted).all(|(q, w)| (q - w).abs() < 1e-12));
        }
    }
    assert!(last < STOPS, "half a file does not have all stops");
    // Nothing at all before the damage.
    fs::write(&path, &whole[..40]).unwrap();
    let message = refusal(&path, &three());
    assert_says(&message, Code::RecordingDamaged, &["cut.mcap"]);
}

/// Three wrong bytes in one chunk: its own messages are lost, those of the chunks behind it are not.
#[test]
fn damage_costs_its_own_chunk_alone() {
    for name in ["lz4.mcap", "zstd.mcap"] {
        let whole = fs::read(recording(name)).unwrap();
        let summary = mcap::Summary::read(&whole).unwrap().unwrap();
        assert!(summary.chunk_indexes.len() > 4, "{name}");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("wrong.mcap");
        for chunk in &summary.chunk_indexes {
            for at in [chunk.chunk_length / 2, 2] {
                // In the middle of the chunk, or in its length.
                let mut wrong = whole.clone();
                let start = (chunk.chunk_start_offset + at) as usize;
                wrong[start..start + 3].iter_mut().for_each(|b| *b ^= 0x55);
                fs::write(&path, &wrong).unwrap();
                let (_images, extracted) = read(&path, &three());
                // A chunk of this recording spans less than two stops.
                assert!(extracted.stops.stops.len() >= STOPS - 2, "{name}: {} stops", extracted.stops.stops.len());
                assert!(extracted.notices.iter().any(|n| n.code == Code::RecordingDamaged), "{:?}", extracted.notices);
                for stop in &extracted.stops.stops {
                    let q = stop.raw_readings.as_ref().unwrap();
                    assert!((0..STOPS).any(|k| q.iter().zip(posture(k)).all(|(q, w)| (q - w).abs() < 1e-12)));
                }
            }
        }
    }
}

#[test]
fn a_recording_in_sqlite_is_read_as_one_in_mcap() {
    let (_mcap, wanted) = read(&recording("mono8"), &three());
    for path in ["sqlite", "sqlite/sqlite.db3"] {
        let (_folder, extracted) = read(&recording(path), &three());
        assert_stops(&extracted, 4);
        assert_eq!(extracted.reports, wanted.reports);
        assert_eq!(pictures(&extracted), pictures(&wanted));
        assert_eq!(extracted.image_delay_s, wanted.image_delay_s);
    }
}

/// Wrong bytes anywhere, in checked chunks and in a file without checksums: an answer or an error, never a panic.
#[test]
fn wrong_bytes_never_panic() {
    use rand::{RngExt, SeedableRng};
    let seed = 20_250_204;
    println!("seed {seed}");
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("wrong.mcap");
    for name in ["lz4.mcap", "mono8/mono8.mcap", "sqlite/sqlite.db3"] {
        let whole = fs::read(recording(name)).unwrap();
        for _ in 0..60 {
            let mut wrong = whole.clone();
            for _ in 0..random.random_range(1..4) {
                let at = random.random_range(0..wrong.len());
                wrong[at] ^= 1 << random.random_range(0..8);
            }
            fs::write(&path, &wrong).unwrap();
            match extract(&path, &folder.path().join("images"), &three()) {
                Ok(extracted) => assert!(extracted.stops.stops.len() <= 2 * STOPS),
                Err(error) => assert_eq!(error.exit_code(), 2),
            }
        }
    }
}

#[test]
fn topics_and_joints_with_control_characters_are_refused() {
    let whole = fs::read(recording("mono8/mono8.mcap")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for (plain, hidden) in [("/joint_states", "/joint\u{1b}[2Jtes"), ("joint_2", "joint\n2")] {
        let mut bytes = whole.clone();
        let places: Vec<usize> =
            (0..bytes.len() - plain.len()).filter(|&k| bytes[k..].starts_with(plain.as_bytes())).collect();
        assert!(!places.is_empty(), "{plain}");
        places.iter().for_each(|&k| bytes[k..k + plain.len()].copy_from_slice(hidden.as_bytes()));
        let path = folder.path().join("hidden.mcap");
        fs::write(&path, bytes).unwrap();
        let message = refusal(&path, &RecordingOptions::default());
        assert_eq!(message.code, Code::NameUnprintable, "{message}");
        assert!(!message.to_string().contains(hidden), "{message:?}");
    }
}
