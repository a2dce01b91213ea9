//! Files that were made to exhaust memory, time or the stack, and the corpus of every reader (fuzz/readers.rs).

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use image::{DynamicImage, GrayImage};
use rand::{RngExt, SeedableRng};
use robotcal::series::{Plate, PlateKind, RecordingOptions, extract, read, read_plate};
use robotcal::{detect, urdf};
use tempfile::TempDir;

/// Largest memory of this process so far, MiB.
fn peak_mib() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|l| l.starts_with("VmHWM:")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap() / 1024
}

/// No input of these tests holds more than 36 MB of pictures at a time; half of a gigabyte is the program's own limit in flight
/// with room for the test itself.
#[track_caller]
fn assert_small() {
    assert!(peak_mib() < 700, "{} MiB", peak_mib());
}

fn record(kind: u8, content: &[u8]) -> Vec<u8> {
    [&[kind][..], &(content.len() as u64).to_le_bytes(), content].concat()
}

fn string(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

fn chunk(size: u64, compression: &str, content: &[u8]) -> Vec<u8> {
    let head = [&[0; 16][..], &size.to_le_bytes(), &[0; 4], &string(compression)].concat();
    record(6, &[&head[..], &(content.len() as u64).to_le_bytes(), content].concat())
}

fn mcap_file(records: &[Vec<u8>]) -> Vec<u8> {
    let header = record(1, &[string("ros2"), string("x")].concat());
    [&[0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n'][..], &header, &records.concat(), &record(15, &[0; 4])].concat()
}

fn refused(folder: &TempDir, bytes: &[u8]) {
    let path = folder.path().join("run.mcap");
    fs::write(&path, bytes).unwrap();
    let error = extract(&path, &folder.path().join("images"), &RecordingOptions::default()).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    assert_small();
}

#[test]
fn recordings_that_promise_a_gigabyte_take_no_memory() {
    let folder = tempfile::tempdir().unwrap();
    let long = [&[5][..], &((1_u64 << 30) - 1).to_le_bytes(), &[7; 40]].concat();
    refused(&folder, &mcap_file(std::slice::from_ref(&long)));
    refused(&folder, &mcap_file(&[chunk((1 << 30) - 1, "", &long)]));
    for compression in ["", "zstd", "lz4"] {
        refused(&folder, &mcap_file(&[chunk((1 << 29) - 1, compression, &[0x28, 0xb5, 0x2f, 0xfd, 0, 0, 0])]));
    }
    let many = record(3, &[&1_u16.to_le_bytes()[..], &u32::MAX.to_le_bytes(), b"name"].concat());
    refused(&folder, &mcap_file(&[many]));
}

/// A header of a message and what follows it, aligned.
fn message(time_ns: u64, parts: &[(usize, Vec<u8>)]) -> Vec<u8> {
    let (seconds, rest) = ((time_ns / 1_000_000_000) as i32, (time_ns % 1_000_000_000) as u32);
    let mut bytes =
        [&[0, 1, 0, 0][..], &seconds.to_le_bytes(), &rest.to_le_bytes(), &1_u32.to_le_bytes(), &[0]].concat();
    for (align, part) in parts {
        bytes.resize(4 + (bytes.len() - 4).next_multiple_of(*align), 0);
        bytes.extend(part);
    }
    bytes
}

fn logged(channel: u16, time_ns: u64, data: &[u8]) -> Vec<u8> {
    let times = [time_ns.to_le_bytes(), time_ns.to_le_bytes()].concat();
    record(5, &[&channel.to_le_bytes()[..], &[0; 4], &times, data].concat())
}

/// Schemas and channels 1 (joint states) and 2 (compressed images).
fn channels() -> Vec<Vec<u8>> {
    let one = |id: u16, schema: &str, topic: &str| {
        let id = id.to_le_bytes();
        let schema = record(3, &[&id[..], &string(schema), &string("ros2msg"), &[0; 4]].concat());
        [schema, record(4, &[&id[..], &id, &string(topic), &string("cdr"), &[0; 4]].concat())].concat()
    };
    vec![one(1, "sensor_msgs/msg/JointState", "/joint_states"), one(2, "sensor_msgs/msg/CompressedImage", "/camera")]
}

fn joint_state(time_ns: u64, position: f64) -> Vec<u8> {
    let one = || 1_u32.to_le_bytes().to_vec();
    message(
        time_ns,
        &[
            (4, one()),
            (4, [&2_u32.to_le_bytes()[..], b"j\0"].concat()),
            (4, one()),
            (8, position.to_le_bytes().to_vec()),
            (4, vec![0; 8]),
        ],
    )
}

#[test]
fn nine_large_pictures_of_one_standstill_are_not_decoded_at_once() {
    const START: u64 = 1_000_000_000_000;
    let mut png = std::io::Cursor::new(Vec::new());
    DynamicImage::ImageLuma8(GrayImage::new(6000, 6000)).write_to(&mut png, image::ImageFormat::Png).unwrap();
    let mut records = channels();
    for k in 0..200_u64 {
        let time = START + k * 10_000_000;
        records.push(logged(1, time, &joint_state(time, 0.5)));
        if k % 20 == 10 {
            let data = [&(png.get_ref().len() as u32).to_le_bytes()[..], png.get_ref()].concat();
            let parts = [(4, [&4_u32.to_le_bytes()[..], b"png\0"].concat()), (4, data)];
            records.push(logged(2, time, &message(time, &parts)));
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    fs::write(&path, mcap_file(&records)).unwrap();
    let extracted = extract(&path, &folder.path().join("images"), &RecordingOptions::default()).unwrap();
    assert_eq!((extracted.stops.stops.len(), extracted.reports[0].pictures), (1, 9));
    assert_small();
}

#[test]
fn times_at_the_end_of_the_numbers_do_not_overflow() {
    let mut records = channels();
    for log_time in [0, u64::MAX, i64::MAX as u64] {
        let mut state = joint_state(0, 0.5);
        state[4..12].copy_from_slice(&[&i32::MIN.to_le_bytes()[..], &u32::MAX.to_le_bytes()].concat());
        records.push(logged(1, log_time, &state));
        records.push(logged(1, log_time, &joint_state(0, 0.5)));
    }
    refused(&tempfile::tempdir().unwrap(), &mcap_file(&records));
}

#[test]
fn a_picture_that_promises_gigabytes_is_refused_by_its_header() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bomb.pgm");
    fs::write(&path, b"P5 30000 30000 255\n").unwrap();
    let error = detect::load(&path, None).unwrap_err();
    assert_eq!(error.code, robotcal::Code::ImageSizeImpossible, "{error}");
    assert_small();
}

#[test]
fn a_pipe_a_device_and_a_folder_are_refused_unread() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    assert!(std::process::Command::new("mkfifo").arg(at("pipe")).status().unwrap().success());
    std::os::unix::fs::symlink("/dev/zero", at("zero")).unwrap();
    fs::create_dir(at("folder")).unwrap();
    for name in ["pipe", "zero", "folder"] {
        let path = at(name);
        let errors = [
            read_plate(&path, &mut Vec::new()).unwrap_err(),
            urdf::read(&path).unwrap_err(),
            detect::load(&path, None).unwrap_err(),
        ];
        for error in errors {
            assert_eq!(error.exit_code(), 2);
            assert!(error.place.ends_with(name), "{error}");
        }
    }
    let image = at("run.mcap");
    std::os::unix::fs::symlink("/dev/zero", &image).unwrap();
    assert_eq!(read(&image).unwrap_err().exit_code(), 2);
    assert_small();
}

#[test]
fn deeply_nested_elements_are_refused_before_they_are_followed() {
    let text =
        format!("<robot name='r'><link name='a'>{}{}</link></robot>", "<x>".repeat(20_000), "</x>".repeat(20_000));
    let error = urdf::RobotDescription::from_text(Path::new("deep.urdf"), text).unwrap_err();
    assert_eq!((error.exit_code(), error.place.as_str()), (2, "deep.urdf:1"));
    // Signs in comments, texts and values do not nest.
    let flat = format!(
        "<robot name='r'><!--{0}--><link name='a>'/><link name='b'/><joint name='j' type='revolute'><parent link='a>'/>\
         <child link='b'/><axis xyz='0 0 1'/></joint>{1}<![CDATA[{0}]]></robot>",
        "<x>".repeat(100),
        "<y/><z a='/>'></z>".repeat(100)
    );
    let robot = urdf::RobotDescription::from_text(Path::new("flat.urdf"), flat).unwrap();
    assert_eq!(robot.chain(None, None).unwrap().tip, "b");
}

/// A chain of ten thousand links and a comb of as many: before, the time grew with the square and the cube of their number.
#[test]
fn ten_thousand_links_are_read_in_linear_time() {
    const PARTS: usize = 4;
    let n = 10_000;
    let read = |n: usize, comb: bool| {
        let links: String = (0..n).map(|k| format!("<link name='l{k}'/>\n")).collect();
        let joint = |k: usize| {
            let parent = if comb && k.is_multiple_of(2) { k.saturating_sub(2) } else { k - 1 };
            format!(
                "<joint name='j{k}' type='continuous'><parent link='l{parent}'/><child link='l{k}'/><axis xyz='0 0 1'/></joint>\n"
            )
        };
        let joints: String = (1..n).map(joint).collect();
        let start = Instant::now();
        let robot =
            urdf::RobotDescription::from_text(Path::new("r.urdf"), format!("<robot name='r'>{links}{joints}</robot>"));
        let robot = robot.unwrap();
        assert_eq!(robot.chain(Some("l0"), Some("l2")).unwrap().tip, "l2");
        // Too many joints for an arm, or too many tips to choose from.
        assert_eq!(robot.chain(None, None).unwrap_err().exit_code(), 2);
        start.elapsed()
    };
    for comb in [false, true] {
        // As many links in parts take as long, and a quarter of the time of the whole where that grows with the square.
        let parts: Duration = (0..PARTS).map(|_| read(n / PARTS, comb)).sum();
        let whole = read(n, comb);
        assert!(whole < 3 * parts, "{whole:?} {parts:?}");
    }
    assert_small();
}

fn corpus(name: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus").join(name);
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut files: Vec<PathBuf> = entries.map(|e| e.unwrap().path()).collect();
    files.sort();
    files.into_iter().map(|p| (p.clone(), fs::read(p).unwrap())).collect()
}

/// Every small input through its reader, whole, cut and with wrong bytes.
#[test]
fn no_input_of_the_corpus_makes_a_reader_panic() {
    mutate(40);
}

/// The same at length: `cargo test --release --test readers -- --ignored --nocapture`, with `ROUNDS` for each input.
#[test]
#[ignore = "minutes to hours"]
fn no_mutation_of_the_corpus_makes_a_reader_panic() {
    mutate(std::env::var("ROUNDS").ok().and_then(|r| r.parse().ok()).unwrap_or(10_000));
}

fn mutate(rounds: usize) {
    let seed = 20_261_122;
    println!("seed {seed}");
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    for name in crate::readers::NAMES {
        let files = corpus(name);
        assert!(!files.is_empty(), "no input for {name}");
        let (start, mut runs) = (Instant::now(), 0);
        let words: Vec<&[u8]> = files.iter().flat_map(|(_, b)| b.split(|c| !c.is_ascii_alphanumeric())).collect();
        for (path, whole) in &files {
            println!("{}", path.display());
            crate::readers::read(name, whole);
            for _ in 0..rounds {
                let mut wrong = whole.clone();
                for _ in 0..random.random_range(1..4) {
                    let at = random.random_range(0..=wrong.len());
                    let to = random.random_range(at..=wrong.len().min(at + 40));
                    match random.random_range(0..6) {
                        0 => wrong.truncate(at),
                        1 => drop(wrong.drain(at..to)),
                        2 => drop(wrong.splice(at..to, words[random.random_range(0..words.len())].iter().copied())),
                        3 => drop(wrong.splice(at..at, wrong[at..to].to_vec())),
                        4 => wrong[at..to].iter_mut().take(1).for_each(|b| *b = random.random()),
                        _ => wrong[at..to].iter_mut().take(1).for_each(|b| *b ^= 1 << random.random_range(0..8)),
                    }
                }
                crate::readers::read(name, &wrong);
                runs += 1;
            }
        }
        println!("{name}: {runs} runs in {:.1} s", start.elapsed().as_secs_f64());
    }
}

/// Pictures that together would not fit into a gigabyte take turns, whatever the number of threads; their headers tell.
#[test]
fn large_pictures_of_a_folder_are_looked_at_one_by_one() {
    use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};
    let folder = tempfile::tempdir().unwrap();
    let images: Vec<PathBuf> = (0..6).map(|k| folder.path().join(format!("{k}.pgm"))).collect();
    images.iter().for_each(|path| fs::write(path, "P5 13700 13700 255\n").unwrap());
    let plate = Plate::lattice(PlateKind::CodedCircles, 5, 4, 0.01, 1e-4);
    let (now, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let picture = |path: &Path| {
        most.fetch_max(now.fetch_add(1, SeqCst) + 1, SeqCst);
        std::thread::sleep(Duration::from_millis(30));
        now.fetch_sub(1, SeqCst);
        let error = robotcal::Error::new(robotcal::Code::FileMissing, path.display(), "is not there", "nothing");
        Err::<detect::Picture, _>(error)
    };
    let threads = rayon::ThreadPoolBuilder::new().num_threads(4).build().unwrap();
    let found = threads.install(|| detect::detect_series(&images, &plate, picture, |_| ()));
    assert_eq!((found.len(), most.into_inner()), (6, 1));
    assert!(found.iter().all(|image| image.detection.failure.is_some()));
}
