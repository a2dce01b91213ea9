//! Series whose stops come from a recording, and recordings turned into series folders.

use std::fs;
use std::path::{Path, PathBuf};

use crate::recording_support::{annotations, undefined};
use crate::said::assert_says;
use robotcal::Code;
use robotcal::geom::Pose;
use robotcal::series::{
    AngleUnit, CameraInfo, Edge, FramePoses, ImageMarks, ImageObservations, MarkKind, MarkLayer, Observation,
    RecordingContent, RecordingOptions, Series, Source, convert_recording, extract, is_recording, read,
    read_without_robot, write_recording,
};
use robotcal::urdf::{Chain, RobotDescription};
use tempfile::TempDir;

const MANIFEST: &str = "format = 1\ncamera_mount = \"hand\"\nplate = \"board.toml\"\nbase = \"base\"\n";
const BOARD: &str = "format = 1\nkind = \"points\"\nmarkers = \"board.csv\"\ntolerance_m = 0.0001\n";
const MARKERS: &str = "id,x_m,y_m,z_m\n0,0,0,0\n1,0.1,0,0\n";

fn recording(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/recordings")).join(name)
}

/// A folder with a recording named run.mcap, and a manifest of that name beside it.
fn recorded(manifest_name: &str, manifest: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::copy(recording("lz4.mcap"), folder.path().join("run.mcap")).unwrap();
    for (name, text) in [(manifest_name, manifest), ("board.toml", BOARD), ("board.csv", MARKERS)] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

/// joint_3 comes first here, so that names and not columns decide.
fn chain() -> Chain {
    let joint = |name: &str, parent: &str, child: &str| {
        format!(
            "<joint name='{name}' type='revolute'><parent link='{parent}'/><child link='{child}'/>\
             <axis xyz='0 0 1'/><limit lower='-0.45' upper='3' effort='0' velocity='0'/></joint>"
        )
    };
    let text = format!(
        "<robot name='r'><link name='base'/><link name='b'/><link name='c'/><link name='d'/>{}{}{}</robot>",
        joint("joint_3", "base", "b"),
        joint("joint_1", "b", "c"),
        joint("joint_2", "c", "d"),
    );
    RobotDescription::from_text(Path::new("r.urdf"), text).unwrap().chain(None, None).unwrap()
}

fn with_stops(path: &Path, images: &Path) -> Series {
    let chain = chain();
    let options = RecordingOptions { joints: chain.readings.clone(), ..RecordingOptions::default() };
    read(path).unwrap().with_recording(images, &options).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn a_recording_and_the_folder_made_of_it_are_the_same_series() {
    let folder = recorded("run.toml", MANIFEST);
    let path = folder.path().join("run.mcap");
    let unread = read(&path).unwrap();
    assert_eq!((unread.name.as_str(), unread.manifest.base.as_deref()), ("run", Some("base")));
    assert!(matches!(&unread.source, Source::Recording(p) if *p == path));
    assert_eq!(unread.readings_for(&chain()).unwrap_err().code, Code::RecordingNotConverted);

    let direct = with_stops(&path, &folder.path().join("pictures"));
    let readings = direct.readings_for(&chain()).unwrap();
    assert_eq!(readings.len(), 5);
    // Stop 3 of make_recordings.py: joint_3, joint_1, joint_2.
    for (q, wanted) in readings[3].as_ref().unwrap().iter().zip([-0.25, 0.3, -0.1]) {
        assert!((q - wanted).abs() < 1e-12, "{readings:?}");
    }
    assert_eq!(direct.manifest.camera().focal_px, Some(40.5), "from the camera info");
    assert_eq!(direct.manifest.camera().width_px, Some(32));
    assert_eq!(direct.image_hashes().unwrap().len(), 5);
    assert!(direct.inputs.iter().any(|i| i.path == path));
    assert!(direct.reading_notices(&chain()).is_empty());

    let converted = folder.path().join("converted");
    let extracted = convert_recording(&path, &converted, &RecordingOptions::default()).unwrap();
    assert_eq!(extracted.reports.len(), 5);
    let series = read(&converted).unwrap_or_else(|e| panic!("{e}"));
    assert!(series.notices.is_empty(), "{:?}", series.notices);
    assert_eq!(series.plate, direct.plate);
    assert_eq!(series.readings_for(&chain()).unwrap(), readings);
    for (a, b) in series.stops.stops.iter().zip(&direct.stops.stops) {
        assert_eq!((&a.image, a.time_s), (&b.image, b.time_s));
        assert_eq!(fs::read(a.path.as_ref().unwrap()).unwrap(), fs::read(b.path.as_ref().unwrap()).unwrap());
    }
    assert_eq!(series.manifest.cameras, direct.manifest.cameras);

    let error = convert_recording(&path, &converted, &RecordingOptions::default()).unwrap_err();
    assert_eq!(error.code, Code::OutputExists, "{error}");
}

/// The manifest may be of the series in degrees that the recording was made of.
#[test]
fn joint_states_are_radians_though_the_manifest_beside_them_says_degrees() {
    let folder = recorded("run.toml", &format!("{MANIFEST}joint_unit = \"deg\"\n"));
    let path = folder.path().join("run.mcap");
    let direct = with_stops(&path, &folder.path().join("pictures"));
    assert_eq!(direct.joint_unit(), AngleUnit::Rad);
    assert!(direct.notices.iter().any(|n| n.code == Code::RadiansAsDegrees), "{:?}", direct.notices);
    let options = RecordingOptions { joints: chain().readings, ..RecordingOptions::default() };
    let converted = folder.path().join("series");
    let extracted = convert_recording(&path, &converted, &options).unwrap();
    assert!(extracted.notices.iter().any(|n| n.code == Code::RadiansAsDegrees), "{:?}", extracted.notices);
    assert_eq!(read(&converted).unwrap().joint_unit(), AngleUnit::Rad);
}

/// What a caller states counts where no manifest does, and is judged as what a manifest states.
#[test]
fn a_unit_that_the_caller_states_is_not_lost() {
    let stated = RecordingOptions { joint_unit: Some(AngleUnit::Deg), ..RecordingOptions::default() };
    for (unit, is_doubted) in [("", true), ("joint_unit = \"rad\"\n", false)] {
        let folder = recorded("run.toml", &format!("{MANIFEST}{unit}"));
        let path = folder.path().join("run.mcap");
        let direct = read(&path).unwrap().with_recording(&folder.path().join("pictures"), &stated).unwrap();
        let extracted = convert_recording(&path, &folder.path().join("series"), &stated).unwrap();
        for notices in [&direct.notices, &extracted.notices] {
            assert_eq!(notices.iter().any(|n| n.code == Code::RadiansAsDegrees), is_doubted, "{notices:?}");
        }
        assert_eq!(direct.joint_unit(), AngleUnit::Rad);
        assert_eq!(read(&folder.path().join("series")).unwrap().joint_unit(), AngleUnit::Rad);
    }
}

#[test]
fn a_manifest_may_name_its_recording() {
    let folder = recorded("series.toml", &format!("{MANIFEST}mcap = \"run.mcap\"\n"));
    let named = with_stops(folder.path(), &folder.path().join("a"));
    let given = with_stops(&folder.path().join("run.mcap"), &folder.path().join("b"));
    assert_eq!(named.stops.joints, given.stops.joints);
    assert_eq!(named.stops.stops.len(), 5);
    assert_eq!(given.name, "run");
}

#[test]
fn a_recording_without_a_manifest_says_what_to_write() {
    let folder = recorded("other.toml", MANIFEST);
    let path = folder.path().join("run.mcap");
    assert_says(&read(&path).unwrap_err(), Code::SeriesMissing, &["run.toml", "series.toml", "plate = "]);
    let converted = folder.path().join("converted");
    let extracted = convert_recording(&path, &converted, &RecordingOptions::default()).unwrap();
    assert!(extracted.notices.iter().any(|n| n.code == Code::RecordingManifest), "{:?}", extracted.notices);
    let manifest = fs::read_to_string(converted.join("series.toml")).unwrap();
    assert!(manifest.contains("joint_unit = \"rad\""));
    // Nobody said where the camera is: it must be asked for, not invented.
    assert!(!manifest.contains("camera_mount"), "{manifest}");
    fs::write(converted.join("plate.toml"), BOARD).unwrap();
    let error = read(&converted).unwrap_err();
    assert_says(&error, Code::SettingMissing, &["camera_mount"]);
    assert_says(&read(&recording("old.bag")).unwrap_err(), Code::RecordingFormat, &["rosbags-convert"]);
}

/// The manifest of a recording has the name of the recording.
#[test]
fn the_manifest_that_was_read_is_named() {
    let own = recorded("run.toml", MANIFEST);
    let path = own.path().join("run.mcap");
    assert_eq!(read(&path).unwrap().manifest_file(), own.path().join("run.toml"));
    assert_eq!(with_stops(&path, &own.path().join("pictures")).manifest_file(), own.path().join("run.toml"));
    let usual = recorded("series.toml", &format!("{MANIFEST}mcap = \"run.mcap\"\n"));
    for path in [usual.path(), &usual.path().join("run.mcap")] {
        assert_eq!(read(path).unwrap().manifest_file(), usual.path().join("series.toml"));
    }
    let mut degrees = with_stops(&path, &own.path().join("again"));
    for reading in degrees.stops.stops.iter_mut().filter_map(|stop| stop.raw_readings.as_mut()) {
        reading.iter_mut().for_each(|q| *q = 100.0);
    }
    assert_says(
        &degrees.readings_for(&chain()).unwrap_err(),
        Code::DegreesAsRadians,
        &["joint_unit = \"deg\"", "run.toml"],
    );
}

/// A recorder that crashes writes no metadata.yaml.
#[test]
fn a_folder_of_one_recording_is_a_recording_without_metadata_too() {
    let folder = recorded("bag.toml", MANIFEST);
    let bag = folder.path().join("bag");
    fs::create_dir(&bag).unwrap();
    fs::rename(folder.path().join("run.mcap"), bag.join("bag_0.mcap")).unwrap();
    for series in [read(&bag).unwrap(), read_without_robot(&bag).unwrap()] {
        assert!(matches!(&series.source, Source::Recording(path) if *path == bag), "{:?}", series.source);
    }
    assert_eq!(with_stops(&bag, &folder.path().join("pictures")).stops.stops.len(), 5);
    // Recordings of several names are several.
    fs::copy(bag.join("bag_0.mcap"), bag.join("run2.mcap")).unwrap();
    assert!(!is_recording(&bag));
    assert_says(&read(&bag).unwrap_err(), Code::SeriesMissing, &["bag_0.mcap"]);
    fs::remove_file(bag.join("run2.mcap")).unwrap();
    // So are those whose numbers do not follow each other: dates.
    for (other, is_part) in [("bag_1.mcap", true), ("bag_2.mcap", false), ("bag_20240116.mcap", false)] {
        fs::copy(bag.join("bag_0.mcap"), bag.join(other)).unwrap();
        assert_eq!(is_recording(&bag), is_part, "{other}");
        fs::remove_file(bag.join(other)).unwrap();
    }
    let days = folder.path().join("days");
    fs::create_dir(&days).unwrap();
    for day in ["rec_20240115.mcap", "rec_20240116.mcap"] {
        fs::copy(bag.join("bag_0.mcap"), days.join(day)).unwrap();
    }
    assert!(!is_recording(&days));
    // A recording with a manifest of its own is not read with that of the folder above.
    let own = bag.join("bag_0.toml");
    fs::write(&own, MANIFEST).unwrap();
    assert!(!is_recording(&bag));
    assert_says(&read(&bag).unwrap_err(), Code::SeriesMissing, &["bag_0.mcap"]);
    fs::remove_file(own).unwrap();
    // What holds a series beside a recording stays a series.
    for name in ["series.toml", "joints.csv", "images"] {
        assert!(is_recording(&bag));
        fs::write(bag.join(name), "").unwrap();
        assert!(!is_recording(&bag), "{name}");
        fs::remove_file(bag.join(name)).unwrap();
    }
}

#[test]
fn a_conversion_that_fails_leaves_nothing_behind() {
    let folder = recorded("run.toml", &MANIFEST.replace("board.toml", "lost.toml"));
    let before = fs::read_dir(folder.path()).unwrap().count();
    let error =
        convert_recording(&folder.path().join("run.mcap"), &folder.path().join("out"), &RecordingOptions::default());
    assert_says(&error.unwrap_err(), Code::FileMissing, &["lost.toml"]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), before);
}

/// Stops of the `lz4.mcap` recording as a folder, with one picture as 16-bit tif and one image off the robot.
fn folder_series(folder: &Path) -> Series {
    let recorded = recorded("run.toml", MANIFEST);
    let converted = folder.join("series");
    convert_recording(&recorded.path().join("run.mcap"), &converted, &RecordingOptions::default()).unwrap();
    let joints = fs::read_to_string(converted.join("joints.csv")).unwrap();
    let first = joints.lines().nth(1).unwrap().split(',').next().unwrap().to_string();
    let picture = image::open(converted.join("images").join(&first)).unwrap();
    picture.to_luma16().save(converted.join("images/deep.tif")).unwrap();
    fs::copy(converted.join("images").join(&first), converted.join("images/off.png")).unwrap();
    fs::write(converted.join("joints.csv"), joints.replace(&first, "deep.tif") + "off.png,,,,\n").unwrap();
    read(&converted).unwrap()
}

#[test]
fn a_folder_written_as_a_recording_reads_back_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let series = folder_series(folder.path());
    let chain = chain();
    let readings = series.readings_for(&chain).unwrap();
    let poses: Vec<_> =
        readings.iter().map(|r| r.as_ref().map(|_| Pose::from_xyz_rpy([1.0, 2.0, 3.0], [0.0; 3]))).collect();
    let frames = [FramePoses { parent: "base".into(), child: "d".into(), poses }];
    let camera = CameraInfo {
        width_px: 640,
        height_px: 480,
        distortion_model: "plumb_bob".into(),
        distortion: vec![-0.1, 0.01, 1e-4, 2e-4, 0.0],
        intrinsics: Some([501.0, 502.0, 319.0, 241.0]),
    };
    let marks = [ImageObservations {
        image: "deep.tif".into(),
        observations: vec![Observation { marker: 1, edge: Edge::Outer, uv: [3.0, 4.25], covariance: None }],
    }];
    let mut marks = marks.each_ref().map(ImageMarks::from);
    let residual = vec![[3.0, 4.25], [5.0, 6.0]];
    marks[0].layers.push(MarkLayer { kind: MarkKind::Lines, colour: [1.0, 0.0, 0.0], points: residual });
    let camera_info = Some(&camera);
    let shown = RecordingContent {
        joints: &chain.readings,
        readings: &readings,
        camera: camera_info,
        frames: &frames,
        marks: &marks,
    };
    let path = folder.path().join("again.mcap");
    let written = write_recording(&path, &series, shown).unwrap();
    assert_eq!((written.stops, written.unreadable.len()), (5, 0));
    assert_eq!(written.notices.len(), 1, "the image off the robot is told of: {:?}", written.notices);
    assert_eq!(write_recording(&path, &series, shown).unwrap_err().code, Code::OutputExists);

    let options = RecordingOptions { joints: chain.readings.clone(), ..RecordingOptions::default() };
    let again = extract(&path, &folder.path().join("pictures"), &options).unwrap();
    // Five images tell no delay.
    let codes: Vec<Code> = again.notices.iter().map(|n| n.code).collect();
    assert_eq!(codes, [Code::ImageDelayUnchecked], "{:?}", again.notices);
    assert_eq!(again.stops.stops.len(), 5);
    assert_eq!(again.camera_info.as_ref(), Some(&camera));
    for ((a, b), readings) in again.stops.stops.iter().zip(&series.stops.stops).zip(&readings) {
        assert_eq!(&a.raw_readings, readings);
        // Nanoseconds of a double of 1.7e9 s.
        assert!((a.time_s.unwrap() - b.time_s.unwrap()).abs() < 1e-6);
        let [one, other] = [a, b].map(|s| image::open(s.path.as_ref().unwrap()).unwrap());
        assert_eq!(one, other, "{} {}", a.image, b.image);
    }

    let bytes = fs::read(&path).unwrap();
    let mut counts = std::collections::BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        *counts.entry(message.channel.topic.clone()).or_insert(0) += 1;
        // One channel of another kind, and readers of ROS refuse the whole recording.
        assert_eq!(message.channel.message_encoding, "cdr");
        let schema = message.channel.schema.as_ref().unwrap();
        assert_eq!(schema.encoding, "ros2msg");
        let definition = std::str::from_utf8(&schema.data).unwrap();
        assert!(definition.lines().count() > 5, "{}", schema.name);
        assert_eq!(undefined(definition), [""; 0], "{}", schema.name);
        if message.channel.topic == "/camera/annotations" {
            let layers = annotations(&message.data);
            assert_eq!(layers[0].1[0], [3.5, 4.75]);
            assert_eq!(layers[1].0, 4, "a list of lines");
            assert_eq!(layers[1].1[1], [5.5, 6.5]);
        }
    }
    let expected = [
        ("/camera/annotations", 1),
        ("/camera/camera_info", 5),
        ("/camera/image/compressed", 5),
        ("/joint_states", 255),
        ("/tf", 5),
    ];
    assert_eq!(counts, expected.map(|(t, n)| (t.to_string(), n)).into());
}

/// A dot in the name of a rosbag2 folder begins no ending.
#[test]
fn a_folder_with_a_dot_in_its_name_has_the_manifest_of_its_whole_name() {
    let folder = recorded("run1.2.toml", MANIFEST);
    let bag = folder.path().join("run1.2");
    fs::create_dir(&bag).unwrap();
    for file in fs::read_dir(recording("mono8")).unwrap().map(|file| file.unwrap().path()) {
        fs::copy(&file, bag.join(file.file_name().unwrap())).unwrap();
    }
    let series = read(&bag).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(series.name, "run1.2");
    assert_eq!(series.manifest_file(), folder.path().join("run1.2.toml"));
    fs::rename(folder.path().join("run1.2.toml"), folder.path().join("run1.toml")).unwrap();
    assert_eq!(read(&bag).unwrap_err().code, Code::SeriesMissing);
}
