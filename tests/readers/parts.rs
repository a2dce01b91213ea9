//! Recordings in several files, and files whose messages do not stand in the order of time.

use std::fs;
use std::path::{Path, PathBuf};

use crate::mcap::{STOPS, posture, read, recording, refusal, three};
use crate::said::assert_says;
use robotcal::Code;
use robotcal::series::{Clock, Extracted, RecordingOptions};
use tempfile::TempDir;

type Messages<'a> = Vec<mcap::Message<'a>>;

fn messages(whole: &[u8]) -> Messages<'_> {
    mcap::MessageStream::new(whole).unwrap().map(Result::unwrap).collect()
}

fn write(path: &Path, messages: &[mcap::Message<'_>]) {
    let mut writer = mcap::Writer::new(fs::File::create(path).unwrap()).unwrap();
    messages.iter().for_each(|message| writer.write(message).unwrap());
    writer.finish().unwrap();
}

fn metadata(names: &[&str]) -> String {
    let rows: String = names.iter().map(|name| format!("  - {name}\n")).collect();
    format!(
        "rosbag2_bagfile_information:\n  version: 9\n  files: []\n  relative_file_paths:\n{rows}  message_count: 1\n"
    )
}

/// A rosbag2 folder whose parts are `names`, in the order of time, with a metadata.yaml that lists `listed`.
fn parts(names: &[&str], listed: &[&str]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let whole = fs::read(recording("lz4.mcap")).unwrap();
    let all = messages(&whole);
    for (name, part) in names.iter().zip(all.chunks(all.len().div_ceil(names.len()))) {
        write(&folder.path().join(name), part);
    }
    if !listed.is_empty() {
        fs::write(folder.path().join("metadata.yaml"), metadata(listed)).unwrap();
    }
    folder
}

#[track_caller]
fn assert_whole(extracted: &Extracted) {
    let (_whole, wanted) = read(&recording("lz4.mcap"), &three());
    assert_eq!(extracted.reports, wanted.reports);
    assert_eq!(extracted.stops.stops.len(), STOPS);
    for (k, stop) in extracted.stops.stops.iter().enumerate() {
        let readings = stop.raw_readings.as_ref().unwrap();
        assert!(readings.iter().zip(posture(k)).all(|(q, wanted)| (q - wanted).abs() < 1e-12), "stop {k}");
    }
    let told = |code| extracted.notices.iter().any(|n| n.code == code);
    assert!(!told(Code::ClockSetBack) && !told(Code::RecordingDamaged), "{:?}", extracted.notices);
}

#[test]
fn the_parts_of_a_recording_are_read_as_its_metadata_lists_them() {
    for names in [["b_0.mcap", "b_2.mcap", "b_1.mcap"], ["b_2.mcap", "b_1.mcap", "b_0.mcap"]] {
        let folder = parts(&names, &names);
        let (_images, extracted) = read(folder.path(), &three());
        assert_whole(&extracted);
        let read: Vec<PathBuf> = extracted.inputs.iter().map(|i| i.path.clone()).collect();
        assert_eq!(read, names.map(|name| folder.path().join(name)));
        // Without metadata.yaml the times tell.
        fs::remove_file(folder.path().join("metadata.yaml")).unwrap();
        assert_whole(&read_again(folder.path()));
    }
    // Early versions write the folder before the name; a single file may have been renamed since.
    let folder = parts(&["b_0.mcap", "b_1.mcap"], &["bag/b_0.mcap", "bag/b_1.mcap"]);
    assert_whole(&read_again(folder.path()));
    assert_whole(&read_again(parts(&["mine.mcap"], &["b_0.mcap"]).path()));
}

fn read_again(path: &Path) -> Extracted {
    read(path, &three()).1
}

#[test]
fn a_part_that_is_missing_is_named() {
    let names = ["b_0.mcap", "b_1.mcap", "b_2.mcap"];
    let folder = parts(&names, &names);
    fs::remove_file(folder.path().join("b_1.mcap")).unwrap();
    let (_images, extracted) = read(folder.path(), &three());
    assert!((1..STOPS).contains(&extracted.stops.stops.len()), "{}", extracted.stops.stops.len());
    let damaged: Vec<_> = extracted.notices.iter().filter(|n| n.code == Code::RecordingDamaged).collect();
    assert_eq!(damaged.len(), 1, "{:?}", extracted.notices);
    assert_says(damaged[0], Code::RecordingDamaged, &["b_1.mcap"]);
    // And one that is not of the recording, or not known to be.
    let folder = parts(&names, &names[..2]);
    let (_images, extracted) = read(folder.path(), &three());
    assert_eq!(extracted.inputs.len(), 2);
    assert_says(
        extracted.notices.iter().find(|n| n.code == Code::RecordingDamaged).unwrap(),
        Code::RecordingDamaged,
        &["b_2.mcap"],
    );
    for name in names {
        fs::remove_file(folder.path().join(name)).unwrap();
    }
    assert_eq!(refusal(folder.path(), &three()).code, Code::RecordingFormat);
}

/// The stops of a part that is compressed as a whole must not be lost in silence.
#[test]
fn a_part_that_is_compressed_is_refused_until_it_is_expanded() {
    let names = ["b_0.mcap", "b_1.mcap"];
    for listed in [&[][..], &["b_0.mcap", "b_1.mcap.zstd"]] {
        let folder = parts(&names, listed);
        let [plain, packed] = ["b_1.mcap", "b_1.mcap.zstd"].map(|name| folder.path().join(name));
        fs::write(&packed, [0x28, 0xb5, 0x2f, 0xfd, 0, 0, 0, 0]).unwrap();
        assert_whole(&read_again(folder.path()));
        fs::remove_file(&plain).unwrap();
        assert_says(&refusal(folder.path(), &three()), Code::RecordingFormat, &["b_1.mcap.zstd", "unzstd"]);
    }
}

/// Reversed, mixed, or written block by block from behind: the times of the messages say what was when.
#[test]
fn messages_in_any_order_give_the_same_stops() {
    use rand::SeedableRng;
    use rand::seq::SliceRandom;
    let seed = 20_250_301;
    println!("seed {seed}");
    let whole = fs::read(recording("lz4.mcap")).unwrap();
    let (mut back, mut mixed, mut blocks) = (messages(&whole), messages(&whole), messages(&whole));
    back.reverse();
    mixed.shuffle(&mut rand_chacha::ChaCha8Rng::seed_from_u64(seed));
    blocks.chunks_mut(100).for_each(<[_]>::reverse);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let by_log = RecordingOptions { clock: Clock::Log, ..three() };
    let (_images, wanted) = read(&recording("lz4.mcap"), &by_log);
    for messages in [back, mixed, blocks] {
        write(&path, &messages);
        assert_whole(&read_again(&path));
        let (_images, extracted) = read(&path, &by_log);
        assert_eq!(extracted.reports, wanted.reports);
    }
}
