//! `robotcal detect` as a user calls it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::program::{robotcal, text};
use crate::said::{Said, assert_says};
use image::{DynamicImage, GrayImage, Luma};
use robotcal::Code;
use robotcal::assess::Limits;
use robotcal::detect::{detect, detect_series, load};
use robotcal::identify::{SeenImage, detect_stops};
use robotcal::series::{Observation, Source, read, read_images};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn name(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A series with some of the shipped images, and the joints of these alone.
fn small_series(folder: &Path, images: &[&str]) -> PathBuf {
    let (from, to) = (root().join("datasets/kr6_small"), folder.join("run1"));
    std::fs::create_dir_all(to.join("images")).unwrap();
    for file in ["series.toml", "plate.toml", "plate.csv"] {
        std::fs::copy(from.join(file), to.join(file)).unwrap();
    }
    let joints = std::fs::read_to_string(from.join("joints.csv")).unwrap();
    let wanted = |line: &&str| line.starts_with("image,") || images.iter().any(|i| line.starts_with(i));
    let rows: Vec<&str> = joints.lines().filter(wanted).collect();
    std::fs::write(to.join("joints.csv"), rows.join("\n") + "\n").unwrap();
    for image in images {
        std::fs::copy(from.join("images").join(image), to.join("images").join(image)).unwrap();
    }
    to
}

#[test]
fn the_result_is_a_series_with_the_observations_of_the_detector() {
    let folder = tempfile::tempdir().unwrap();
    let run1 = small_series(folder.path(), &["img_002.png", "img_023.png"]);
    let out = folder.path().join("seen");
    let output = robotcal(&["detect", "--series", name(&run1), "--overlay", "--out", name(&out)]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output));
    // A close and wide view with a symmetric blur: nobody is to look for coma.
    assert!(!text(&output).contains("[blur_asymmetric]"), "{}", text(&output));
    let (given, made) = (read(&run1).unwrap(), read(&out).unwrap());
    let Source::Observations(observed) = &made.source else { panic!("no observations") };
    assert_eq!(observed.len(), 2);
    for image in observed {
        let picture = load(&run1.join("images").join(&image.image), None).unwrap();
        let direct = detect(&picture, &given.plate).unwrap();
        assert_eq!(image.observations, direct.observations, "bit by bit, covariances too");
        assert!(image.observations.iter().all(|o: &Observation| o.covariance.is_some()));
        let overlay = image::open(out.join("overlay").join(&image.image)).unwrap();
        assert!(overlay.width() as usize >= picture.width && overlay.height() as usize > picture.height);
    }
    let raw = |s: &robotcal::series::Series| {
        s.stops.stops.iter().map(|s| (s.image.clone(), s.raw_readings.clone())).collect::<Vec<_>>()
    };
    assert_eq!(raw(&given), raw(&made));
    assert_eq!(given.plate.markers, made.plate.markers);
    assert_eq!((made.camera_name(), made.mounting()), ("run1", "run1"));
    assert_eq!(made.manifest.camera().width_px, Some(1280));
    // The table and the list of what was dropped say the same.
    let dropped = std::fs::read_to_string(out.join("dropped.csv")).unwrap();
    let reasons: BTreeSet<&str> = dropped.lines().skip(1).filter_map(|l| l.split(',').nth(3)).collect();
    assert!(!reasons.is_empty());
    for reason in reasons {
        let count = dropped.lines().filter(|l| l.contains(&format!(",{reason},"))).count();
        assert!(text(&output).contains(&format!("{count} {reason}")), "{reason}: {}", text(&output));
    }
}

#[test]
fn images_that_show_nothing_or_a_mirrored_plate_are_named_and_the_others_kept() {
    let folder = tempfile::tempdir().unwrap();
    let run1 = small_series(folder.path(), &["img_002.png", "img_005.png", "img_013.png"]);
    let mirrored = run1.join("images/img_005.png");
    image::open(&mirrored).unwrap().fliph().save(&mirrored).unwrap();
    image::GrayImage::from_pixel(1280, 1024, image::Luma([90])).save(run1.join("images/img_013.png")).unwrap();
    let out = folder.path().join("seen");
    let run = || robotcal(&["detect", "--series", name(&run1), "--overlay", "--out", name(&out)]);
    let output = run();
    assert_eq!(output.status.code(), Some(1), "{}", text(&output));
    let said = text(&output);
    let record: serde_json::Value =
        serde_json::from_slice(&std::fs::read(out.join("detection.json")).unwrap()).unwrap();
    let code = |k: usize| serde_json::from_value(record["images"][k]["failure"]["code"].clone()).unwrap();
    let codes: [Option<Code>; 3] = [0, 1, 2].map(code);
    assert_eq!(codes, [None, Some(Code::PlateMirrored), Some(Code::PlateNotFound)], "{said}");
    let Source::Observations(observed) = read(&out).unwrap().source else { panic!("no observations") };
    assert_eq!(observed.iter().map(|i| i.image.as_str()).collect::<Vec<_>>(), ["img_002.png"]);
    assert!(out.join("overlay/img_005.png").is_file(), "what was seen in a refused image is drawn");
    // A second run takes the place of the first; what lies there besides is kept.
    std::fs::write(out.join("notes.txt"), "mine").unwrap();
    assert_eq!(run().status.code(), Some(1));
    assert!(out.join("notes.txt").is_file());
    // Nothing usable at all is an error, and the pictures still say why.
    std::fs::remove_file(run1.join("images/img_002.png")).unwrap();
    let output = run();
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert_says(&text(&output), Code::PlateNowhere, &["img_002.png"]);
    assert!(out.join("overlay/img_005.png").is_file());
}

/// A link to nothing and a folder among the images cost no other image.
#[test]
fn what_is_no_file_among_the_images_is_left_out_alone() {
    let folder = tempfile::tempdir().unwrap();
    let images = ["img_000.png", "img_001.png", "img_002.png", "img_023.png"];
    let run1 = small_series(folder.path(), &images);
    for image in &images[..2] {
        std::fs::remove_file(run1.join("images").join(image)).unwrap();
    }
    std::os::unix::fs::symlink("nowhere.png", run1.join("images").join(images[0])).unwrap();
    std::fs::create_dir(run1.join("images").join(images[1])).unwrap();
    let out = folder.path().join("seen");
    let output = robotcal(&["detect", "--series", name(&run1), "--overlay", "--out", name(&out)]);
    assert_eq!(output.status.code(), Some(1), "{}", text(&output));
    let Source::Observations(observed) = read(&out).unwrap().source else { panic!("no observations") };
    assert_eq!(observed.iter().map(|i| i.image.as_str()).collect::<Vec<_>>(), images[2..]);
    // And half a picture.
    let half = run1.join("images").join(images[2]);
    let bytes = std::fs::read(&half).unwrap();
    std::fs::write(&half, &bytes[..bytes.len() / 2]).unwrap();
    let doctor = robotcal(&["doctor", name(&run1)]);
    assert_eq!(doctor.status.code(), Some(0), "{}", text(&doctor));
    let printed = String::from_utf8_lossy(&doctor.stdout);
    let codes = [Code::FileMissing, Code::FileNotRegular, Code::ImageTruncated];
    for (name, code) in images.iter().zip(codes) {
        let is_named = printed.split("\nnote ").any(|n| n.contains(name) && n.contains(code.name()));
        assert!(is_named, "{name} {code}: {printed}");
    }
}

/// A JPEG without a mark of its end may have all of its rows; one that ends before them is left out, and it alone.
#[test]
fn doctor_tells_a_jpeg_that_was_cut_off_from_one_without_a_mark_of_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let images = ["img_000.png", "img_001.png", "img_002.png"];
    let run1 = small_series(folder.path(), &images);
    let joints = std::fs::read_to_string(run1.join("joints.csv")).unwrap();
    std::fs::write(run1.join("joints.csv"), joints.replace(".png", ".jpg")).unwrap();
    let noisy = GrayImage::from_fn(400, 300, |x, y| Luma([(x * 7919 + y * 104_729 + x * y * 31) as u8]));
    let whole = run1.join("images/img_000.jpg");
    DynamicImage::ImageLuma8(noisy).save(&whole).unwrap();
    let bytes = std::fs::read(&whole).unwrap();
    std::fs::write(run1.join("images/img_001.jpg"), &bytes[..bytes.len() - 2]).unwrap();
    std::fs::write(run1.join("images/img_002.jpg"), &bytes[..bytes.len() / 2]).unwrap();
    images.iter().for_each(|image| std::fs::remove_file(run1.join("images").join(image)).unwrap());
    let doctor = robotcal(&["doctor", name(&run1)]);
    assert_eq!(doctor.status.code(), Some(0), "{}", text(&doctor));
    let printed = String::from_utf8_lossy(&doctor.stdout);
    let cut_off: Vec<&str> = printed.split("\nnote ").filter(|n| n.contains(Code::ImageTruncated.name())).collect();
    assert!(cut_off.len() == 1 && cut_off[0].contains("img_002.jpg"), "{printed}");
    assert!(!printed.contains("img_000.jpg") && !printed.contains("img_001.jpg"), "{printed}");
}

/// What EXIF data ask of viewers is the same for all images of a camera.
#[test]
fn images_that_viewers_turn_are_told_of_once() {
    let folder = tempfile::tempdir().unwrap();
    let images = ["img_000.png", "img_001.png", "img_002.png"];
    let run1 = small_series(folder.path(), &images);
    let joints = std::fs::read_to_string(run1.join("joints.csv")).unwrap();
    std::fs::write(run1.join("joints.csv"), joints.replace(".png", ".jpg")).unwrap();
    for name in images {
        let path = run1.join("images").join(name);
        let mut jpeg = std::io::Cursor::new(Vec::new());
        image::open(&path).unwrap().to_luma8().write_to(&mut jpeg, image::ImageFormat::Jpeg).unwrap();
        let mut bytes = jpeg.into_inner();
        // Half a turn.
        let tag = [0x12, 0x01, 3, 0, 1, 0, 0, 0, 3, 0, 0, 0];
        let exif = [b"Exif\0\0II*\0\x08\0\0\0\x01\0".as_slice(), &tag, &[0; 4]].concat();
        bytes.splice(2..2, [0xff, 0xe1, 0, exif.len() as u8 + 2].into_iter().chain(exif));
        std::fs::write(path.with_extension("jpg"), bytes).unwrap();
        std::fs::remove_file(path).unwrap();
    }
    let doctor = robotcal(&["doctor", name(&run1)]);
    let printed = String::from_utf8_lossy(&doctor.stdout);
    assert_eq!(printed.matches(Code::ImageTurned.name()).count(), 1, "{printed}");
    let seen = detect_stops(&read_images(&run1).unwrap(), &Limits::default(), |_| ()).unwrap().images;
    let said = seen.iter().flat_map(SeenImage::notices).filter(|n| n.code == Code::ImageTurned);
    assert_eq!(said.count(), 1);
}

#[test]
fn single_images_need_a_plate_and_no_series() {
    let folder = tempfile::tempdir().unwrap();
    let small = root().join("datasets/kr6_small");
    let (plate, picture) = (small.join("plate.toml"), small.join("images/img_023.png"));
    let out = folder.path().join("seen");
    let output = robotcal(&["detect", "--plate", name(&plate), name(&picture), "--out", name(&out)]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output));
    assert!(out.join("observations.csv").is_file() && !out.join("series.toml").exists());
    for (args, code, named) in [
        (vec!["detect", name(&picture)], None, "--plate"),
        (vec!["detect"], None, "--series"),
        (
            vec!["detect", "--plate", name(&plate), name(&picture), name(&picture)],
            Some(Code::ImageTwice),
            "img_023.png",
        ),
        // By the path of the first of the two.
        (vec!["detect", "--plate", name(&plate), "a/x.png", "b/y.png", "c/x.png"], Some(Code::ImageTwice), "a/x.png"),
        (vec!["detect", "--plate", name(&plate), "nowhere.png"], Some(Code::PlateNowhere), "nowhere.png"),
        (vec!["detect", "--series", "nowhere"], Some(Code::FileMissing), "nowhere"),
        (vec!["detect", "--series", name(&small), "--out", name(&small)], Some(Code::OutputForeign), "kr6_small"),
        (vec!["detect", "--study", "--views", "0"], Some(Code::OptionRange), "--views"),
        (vec!["compare", "--urdf", "nowhere", "--monte-carlo", "--seeds", "0"], Some(Code::OptionRange), "--seeds"),
        (vec!["compare", "--urdf", "nowhere", "--study", "--seeds", "1"], Some(Code::OptionRange), "--seeds"),
    ] {
        let args: Vec<&str> = if args.contains(&"--out") {
            args
        } else {
            let wrong = folder.path().join("wrong");
            let wrong: &'static str = Box::leak(name(&wrong).to_owned().into_boxed_str());
            [args, vec!["--out", wrong]].concat()
        };
        let output = robotcal(&args);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {}", text(&output));
        // What clap says of its own flags has no code.
        let said = text(&output);
        assert!(said.code() == code && said.contains(named), "{args:?}: {said}");
    }
}

#[test]
fn a_small_study_of_identity_finds_no_wrong_id() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("reports");
    let args = ["detect", "--study", "--part", "identity", "--views", "40", "--seed", "1", "--out", name(&out)];
    let said = text(&robotcal(&args));
    let claims = said.lines().filter_map(|l| match l.split_once(": ")? {
        ("holds", claim) => Some((true, claim)),
        ("FAILS", claim) => Some((false, claim)),
        _ => None,
    });
    let claims: Vec<(bool, &str)> = claims.collect();
    // Wrong ids, markers that are found, mirror images, and plates with another code.
    assert_eq!(claims.len(), 4, "{said}");
    assert!([0, 2, 3].iter().all(|&k| claims[k].0), "{said}");
    let found = claims[1].1.rsplit(": ").next().unwrap();
    let share: f64 = found.split(' ').next().unwrap().parse().unwrap();
    // The limit of 99 % is for thousands of views; one view of 40 with a few markers alone between cables is worth half a percent.
    assert!(share > 98.0, "{said}");
    let report = std::fs::read_to_string(out.join("image-stage.md")).unwrap();
    assert!(report.contains("image-stage-identity.svg"), "{report}");
    assert!(out.join("image-stage-identity.svg").is_file());
}

/// What `detect` needs for single images.
fn plate_and_image() -> (PathBuf, PathBuf) {
    let dataset = root().join("datasets/kr6_small");
    (dataset.join("plate.toml"), dataset.join("images/img_002.png"))
}

#[test]
fn files_of_the_user_among_the_pictures_stay_and_stale_pictures_go() {
    let folder = tempfile::tempdir().unwrap();
    let (plate, image) = plate_and_image();
    let (first, second) = (folder.path().join("first.png"), folder.path().join("second.png"));
    for copy in [&first, &second] {
        std::fs::copy(&image, copy).unwrap();
    }
    let out = folder.path().join("seen");
    let run = |image: &Path| {
        let output = robotcal(&["detect", "--plate", name(&plate), name(image), "--overlay", "--out", name(&out)]);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output));
    };
    run(&first);
    std::fs::write(out.join("overlay/mine.txt"), "mine").unwrap();
    std::fs::write(out.join("notes.txt"), "mine").unwrap();
    run(&second);
    assert_eq!(std::fs::read(out.join("overlay/mine.txt")).unwrap(), b"mine");
    assert_eq!(std::fs::read(out.join("notes.txt")).unwrap(), b"mine");
    let there = |n: &str| out.join("overlay").join(n).exists();
    assert!(there("second.png") && !there("first.png"));
}

#[cfg(target_os = "linux")]
#[test]
fn a_hostile_name_of_an_image_gives_a_harmless_name_of_its_picture() {
    let folder = tempfile::tempdir().unwrap();
    let (plate, image) = plate_and_image();
    let strange = folder.path().join("a\u{1b}[31m:b .png");
    std::fs::copy(&image, &strange).unwrap();
    let out = folder.path().join("seen");
    let output = robotcal(&["detect", "--plate", name(&plate), name(&strange), "--overlay", "--out", name(&out)]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output));
    let pictures: Vec<_> = std::fs::read_dir(out.join("overlay")).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(pictures, ["a__31m_b_.png"]);
}

#[test]
fn an_image_that_changes_while_it_is_looked_at_is_named() {
    use std::io::Write;
    use std::sync::atomic::{AtomicBool, Ordering};
    let folder = tempfile::tempdir().unwrap();
    let (plate, image) = plate_and_image();
    let growing = folder.path().join("growing.png");
    std::fs::copy(&image, &growing).unwrap();
    let out = folder.path().join("seen");
    let done = AtomicBool::new(false);
    let output = std::thread::scope(|scope| {
        scope.spawn(|| {
            // A picture with something behind its end can be read at every moment.
            let mut file = std::fs::OpenOptions::new().append(true).open(&growing).unwrap();
            while !done.load(Ordering::Relaxed) {
                file.write_all(&[0; 16]).unwrap();
                std::thread::sleep(std::time::Duration::from_micros(200));
            }
        });
        let output = robotcal(&["detect", "--plate", name(&plate), name(&growing), "--out", name(&out)]);
        done.store(true, Ordering::Relaxed);
        output
    });
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert_says(&text(&output), Code::SeriesChanged, &["growing.png"]);
    assert!(!out.exists());
}

/// Where all images fail alike, the advice is that of the detector: which keys of plate.toml to correct.
#[test]
fn a_plate_file_of_another_board_is_named_with_its_remedy() {
    let folder = tempfile::tempdir().unwrap();
    for (kind, shape, more, names) in [
        ("aprilgrid", "6x5", &["--tag-mm", "30"][..], ["first_id", "5"]),
        ("chessboard", "9x6", &["--pitch-mm", "20"], ["9 x 6", "not 10 x 6"]),
        ("circle-grid", "9x6", &["--pitch-mm", "20"], ["9 x 6", "not 10 x 6"]),
    ] {
        let [board, other, seen] =
            ["board", "board/other.toml", "seen"].map(|f| folder.path().join(format!("{kind}-{f}")));
        let command = ["plate", "--kind", kind, "--shape", shape, "--out", name(&board)];
        let drawn = robotcal(&[&command, more].concat());
        assert_eq!(drawn.status.code(), Some(0), "{}", text(&drawn));
        let plate = std::fs::read_to_string(board.join("plate.toml")).unwrap();
        let plate = plate.replace("columns = 6", "columns = 5").replace("columns = 9", "columns = 10");
        let plate = plate.replace("markers = \"plate.csv\"\n", "");
        std::fs::write(&other, plate).unwrap();
        let picture = board.join("plate.png");
        let args = ["detect", name(&picture), "--plate", name(&other), "--out", name(&seen)];
        let output = robotcal(&args);
        assert_eq!(output.status.code(), Some(2), "{}", text(&output));
        assert_says(&text(&output), Code::PlateNowhere, &["columns", "rows", names[0], names[1]]);
    }
}

/// Draws a plate of a kind; returns its folder.
fn drawn(folder: &Path, board: &str, args: &[&str]) -> PathBuf {
    let board = folder.join(board);
    let output = robotcal(&[&["plate", "--out", name(&board), "--kind"], args].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output));
    board
}

/// The commonest mix-up: the plate file of another kind of plate.
#[test]
fn a_plate_of_another_kind_is_named_by_what_is_seen() {
    let folder = tempfile::tempdir().unwrap();
    let chessboard = drawn(folder.path(), "chessboard", &["chessboard", "--shape", "9x6", "--pitch-mm", "20"]);
    let print = ["--tag-mm", "22", "--dictionary", "DICT_5X5_1000"];
    let charuco =
        drawn(folder.path(), "charuco", &[&["charuco", "--shape", "7x5", "--pitch-mm", "30"], &print[..]].concat());
    let tags =
        drawn(folder.path(), "aruco-grid", &[&["aruco-grid", "--shape", "6x4", "--gap-mm", "6"], &print[..]].concat());
    let written = |file: &str, lines: &str| {
        let path = folder.path().join(file);
        std::fs::write(&path, format!("format = 1\npitch_m = 0.03\ntolerance_m = 0.0001\n{lines}")).unwrap();
        path
    };
    let dots = written("dots.toml", "kind = \"circle-grid\"\ncolumns = 9\nrows = 6\nradius_m = 0.005\n");
    let squares = written("squares.toml", "kind = \"chessboard\"\ncolumns = 7\nrows = 5\n");
    let circles = root().join("datasets/kr6_small/plate.toml");
    for (picture, plate, names) in [
        (&chessboard, &circles, ["\"chessboard\"", "9 x 6"]),
        (&chessboard, &dots, ["\"chessboard\"", "9 x 6"]),
        (&charuco, &squares, ["\"charuco\"", "DICT_5X5_1000"]),
        (&tags, &squares, ["\"aruco-grid\"", "24"]),
        (&tags, &circles, ["\"aruco-grid\"", "24"]),
    ] {
        let picture = picture.join("plate.png");
        let out = folder.path().join("seen");
        let output = robotcal(&["detect", name(&picture), "--plate", name(plate), "--out", name(&out)]);
        assert_eq!(output.status.code(), Some(2), "{}", text(&output));
        assert_says(&text(&output), Code::PlateNowhere, &names);
    }
}

/// Several boards share a dictionary: the first marker of one of them is not 0.
#[test]
fn a_charuco_board_may_begin_at_any_marker() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["charuco", "--shape", "7x5", "--pitch-mm", "30", "--tag-mm", "22", "--dictionary", "DICT_5X5_1000"];
    let board = drawn(folder.path(), "board", &[&args[..], &["--id", "500"]].concat());
    let stated = std::fs::read_to_string(board.join("plate.toml")).unwrap();
    assert!(stated.contains("first_id = 500"), "{stated}");
    let other = board.join("other.toml");
    std::fs::write(&other, stated.replace("first_id = 500", "first_id = 0")).unwrap();
    let picture = load(&board.join("plate.png"), None).unwrap();
    let seen = |plate: &Path| detect(&picture, &robotcal::series::read_plate(plate, &mut Vec::new()).unwrap());
    assert_eq!(seen(&board.join("plate.toml")).unwrap().observations.len(), 35);
    let error = seen(&other).unwrap_err();
    assert_says(&error, Code::PlateNotFound, &["0 to 23", "first_id"]);
}

/// A larger board in view hides the stated one no more.
#[test]
fn the_stated_chessboard_is_found_beside_a_larger_one() {
    let folder = tempfile::tempdir().unwrap();
    let of = |shape: &str| drawn(folder.path(), shape, &["chessboard", "--shape", shape, "--pitch-mm", "20"]);
    let (large, small) = (of("9x6"), of("5x4"));
    let [left, right] = [&large, &small].map(|board| image::open(board.join("plate.png")).unwrap().to_luma8());
    let (width, height) = (left.width() + right.width(), left.height().max(right.height()));
    let mut both = image::GrayImage::from_pixel(width, height, image::Luma([255]));
    image::imageops::replace(&mut both, &left, 0, 0);
    image::imageops::replace(&mut both, &right, i64::from(left.width()), 0);
    let picture = folder.path().join("both.png");
    both.save(&picture).unwrap();
    let count = |plate: &Path| {
        let plate = robotcal::series::read_plate(&plate.join("plate.toml"), &mut Vec::new()).unwrap();
        detect(&load(&picture, None).unwrap(), &plate).unwrap().observations.len()
    };
    assert_eq!((count(&large), count(&small)), (54, 20));
    // Of the large one no more corners than the small one has, with two of its ends: alone they could be those of the stated one.
    let plates = [&large, &small].map(|board| board.join("plate.toml"));
    let [of_large, stated] = plates.map(|path| robotcal::series::read_plate(&path, &mut Vec::new()).unwrap());
    let corners = detect(&load(&picture, None).unwrap(), &of_large).unwrap().observations;
    let [first, next] = [0, 10].map(|id| corners.iter().find(|corner| corner.marker == id).unwrap().uv);
    let seen = |paths: &[PathBuf]| detect_series(paths, &stated, |path| load(path, None), |_| {});
    let mut alone = 0;
    for [columns, rows] in [[5, 3], [4, 3], [5, 2], [4, 4]] {
        let cut = folder.path().join("cut.png");
        let mut part = image::GrayImage::from_pixel(width, height, image::Luma([255]));
        let from = [9 - columns, 6 - rows].map(|k| f64::from(k) - 0.5);
        let [x, y] = [0, 1].map(|axis| (first[axis] + from[axis] * (next[axis] - first[axis])) as i64);
        image::imageops::replace(&mut part, &left, -x, -y);
        part.save(&cut).unwrap();
        let found = seen(std::slice::from_ref(&cut))[0].detection.observations.len();
        alone += found;
        let of_both = seen(&[picture.clone(), cut]);
        let [whole, part] = [0, 1].map(|k| &of_both[k].detection);
        assert_eq!(whole.observations.len(), 20, "{:?}", whole.failure);
        assert!(part.observations.is_empty(), "{columns} x {rows}");
        if found > 0 {
            assert_says(part.failure.as_ref().unwrap(), Code::PlateIncomplete, &["cut.png", "both.png"]);
        }
    }
    assert!(alone > 0);
}

/// There is no plate.toml as yet when a flag is wrong.
#[test]
fn an_unknown_family_or_dictionary_of_a_drawing_is_named_by_its_flag() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("plate");
    for (flag, more) in [("--family", &["aprilgrid", "--shape", "6x5"][..]), ("--dictionary", &["tag"])] {
        let output =
            robotcal(&[&["plate", "--out", name(&out), "--tag-mm", "30", flag, "nonsense", "--kind"], more].concat());
        assert_eq!(output.status.code(), Some(2), "{}", text(&output));
        assert_says(&text(&output), Code::DictionaryUnknown, &[flag, "nonsense"]);
        assert!(!text(&output).contains("plate.toml:"), "{}", text(&output));
    }
}

/// A tag of 120 mm, and a ChArUco board of 8 x 5 squares of 28 mm, on A4; what is said ends with a line end and says where to write what is measured.
#[test]
fn a_board_with_a_code_needs_a_narrow_margin() {
    let folder = tempfile::tempdir().unwrap();
    let tag = ["tag", "--tag-mm", "120", "--dictionary", "DICT_4X4_50"];
    let charuco = ["charuco", "--shape", "8x5", "--pitch-mm", "28", "--tag-mm", "21", "--dictionary", "DICT_4X4_50"];
    for args in [&tag[..], &charuco] {
        let output = robotcal(
            &[&["plate", "--out", name(&folder.path().join(args[0])), "--sheet", "A4", "--kind"], args].concat(),
        );
        assert_eq!(output.status.code(), Some(0), "{}", text(&output));
        let said = String::from_utf8(output.stdout).unwrap();
        assert!(said.ends_with('\n') && said.contains("[scale]"), "{said:?}");
    }
}
