//! Reading and writing series folders: what is accepted, what is refused, and with which code.

use std::fs;
use std::path::{Path, PathBuf};

use robotcal::series::{
    AngleUnit, CameraMount, Edge, ImageObservations, Manifest, Observation, PlateKind, Series, SeriesStop, Source,
    StopOrder, Stops, observations_csv, read, read_images, series_of_images,
};
use robotcal::urdf::{Chain, RobotDescription};
use robotcal::{Code, Error};
use tempfile::TempDir;

use crate::said::assert_says;

const MANIFEST: &str = "format = 1\njoint_unit = \"rad\"\ncamera_mount = \"hand\"\nplate = \"plate.toml\"\n";
const PLATE: &str = "format = 1\nkind = \"chessboard\"\ncolumns = 3\nrows = 2\npitch_m = 0.02\ntolerance_m = 0.0001\n";
const JOINTS: &str = "image,j1,j2,x\na.png,0.1,1.25,0.5\nb.png,-0.7,1.5,0.25\noff.png,,,\n";

/// A series folder made of these files; empty files stand for images.
fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::Builder::new().prefix("run").tempdir().unwrap();
    for (name, text) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    folder
}

/// A good series with some files replaced or added.
fn series_with(changes: &[(&str, &str)]) -> TempDir {
    let good = [("series.toml", MANIFEST), ("plate.toml", PLATE), ("joints.csv", JOINTS)];
    let images = ["images/a.png", "images/b.png", "images/off.png"].map(|i| (i, ""));
    folder(&[&good[..], &images[..], changes].concat())
}

fn refusal(changes: &[(&str, &str)]) -> Error {
    let folder = series_with(changes);
    let error = read(folder.path()).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    error
}

fn chain() -> Chain {
    let joint = |name: &str, kind: &str, parent: &str, child: &str, lower: f64, upper: f64| {
        format!(
            "<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/><axis xyz='0 0 1'/>\
             <limit lower='{lower}' upper='{upper}' effort='0' velocity='0'/></joint>"
        )
    };
    let text = format!(
        "<robot name='r'><link name='a'/><link name='b'/><link name='c'/><link name='d'/>{}{}{}</robot>",
        joint("x", "prismatic", "a", "b", 0.0, 2.0),
        joint("j1", "revolute", "b", "c", -3.0, 3.0),
        joint("j2", "revolute", "c", "d", -2.0, 2.0),
    );
    RobotDescription::from_text(Path::new("r.urdf"), text).unwrap().chain(None, None).unwrap()
}

#[test]
fn a_folder_is_read_with_its_defaults() {
    let folder = series_with(&[]);
    let series = read(folder.path()).unwrap();
    let name = folder.path().file_name().unwrap().to_str().unwrap();
    assert_eq!([series.name.as_str(), series.camera_name(), series.mounting()], [name; 3]);
    assert_eq!(series.manifest.mount(), CameraMount::Hand);
    assert_eq!(series.manifest.robot.order, StopOrder::Visited);
    assert_eq!(series.stops.joints, ["j1", "j2", "x"]);
    assert_eq!(series.stops.stops[1].raw_readings, Some(vec![-0.7, 1.5, 0.25]));
    assert_eq!(series.stops.stops[2].raw_readings, None, "an image off the robot");
    assert_eq!(series.stops.stops[2].placement, "placement_0");
    assert_eq!(series.plate.kind, PlateKind::Chessboard);
    assert!(series.notices.is_empty(), "{:?}", series.notices);
    let hashed: Vec<_> = series.inputs.iter().map(|i| i.path.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(hashed, ["series.toml", "plate.toml", "joints.csv"]);
    // sha256sum of an empty file
    let empty = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
    assert!(series.image_hashes().unwrap().iter().all(|i| i.sha256 == empty));
}

#[test]
fn byte_order_marks_crlf_blanks_and_quotes_do_not_matter() {
    let joints = format!("\u{feff}{}", JOINTS.replace('\n', "  \r\n\r\n").replace("a.png", "\"a.png\""));
    let manifest = format!("\u{feff}{}", MANIFEST.replace('\n', "\r\n"));
    let odd = read(series_with(&[("joints.csv", &joints), ("series.toml", &manifest)]).path()).unwrap();
    let plain = read(series_with(&[]).path()).unwrap();
    let values =
        |s: &Series| s.stops.stops.iter().map(|s| (s.image.clone(), s.raw_readings.clone())).collect::<Vec<_>>();
    assert_eq!(values(&odd), values(&plain));
    assert_eq!(odd.stops.stops.iter().map(|s| s.line).collect::<Vec<_>>(), [3, 5, 7]);
    assert_eq!(plain.stops.stops.iter().map(|s| s.line).collect::<Vec<_>>(), [2, 3, 4]);
}

/// Spreadsheets keep rows of which the cells were emptied.
#[test]
fn rows_of_empty_cells_are_no_stops() {
    let joints = format!("{}\n,,,\n   \n , ,\n", JOINTS.trim_end().replacen("\nb.png", "\n,,,\nb.png", 1));
    let (odd, plain) = (read(series_with(&[("joints.csv", &joints)]).path()), read(series_with(&[]).path()));
    let names =
        |s: &Series| s.stops.stops.iter().map(|s| (s.image.clone(), s.raw_readings.clone())).collect::<Vec<_>>();
    let (odd, plain) = (odd.unwrap(), plain.unwrap());
    assert_eq!(names(&odd), names(&plain));
    assert_eq!(odd.stops.stops.iter().map(|s| s.line).collect::<Vec<_>>(), [2, 4, 5]);
}

#[test]
fn a_bad_manifest_names_line_and_key() {
    let with = |line: &str| refusal(&[("series.toml", &format!("{MANIFEST}{line}\n"))]);
    assert_says(&with("tipp = \"flange\""), Code::SettingSyntax, &["series.toml:5", "`tipp`", "\"tip\""]);
    assert_says(&with("[camera]\nfocal_mm = 8"), Code::SettingSyntax, &["series.toml:6", "`focal_mm`"]);
    assert_says(&with("[camera]\nfocal_px = \"8\""), Code::SettingSyntax, &["series.toml:6"]);
    assert_says(&with("[camera]\nfocal_px = -1"), Code::SettingRange, &["focal_px = -1"]);
    assert_says(&with("[camera]\nwidth_px = 100"), Code::SettingConflict, &["height_px"]);
    assert_says(&with("[robot]\norder = \"random\""), Code::SettingSyntax, &["series.toml:6", "`random`", "`unknown`"]);
    let replaced = |from: &str, to: &str| refusal(&[("series.toml", &MANIFEST.replace(from, to))]);
    assert_says(
        &replaced("joint_unit = \"rad\"\n", ""),
        Code::JointUnitMissing,
        &["series.toml", "joint_unit = \"deg\""],
    );
    assert_says(&replaced("\"rad\"", "\"degree\""), Code::SettingSyntax, &["series.toml:2", "`degree`", "`deg`"]);
    assert_says(&replaced("format = 1", "format = 2"), Code::SettingVersion, &["format = 2", "format = 1"]);
    assert_says(&replaced("camera_mount = \"hand\"\n", ""), Code::SettingMissing, &["series.toml", "camera_mount"]);
    assert_says(&replaced("plate = \"plate.toml\"\n", ""), Code::SettingMissing, &["series.toml", "plate.toml"]);
    assert_says(&replaced("plate.toml", "plat.toml"), Code::FileMissing, &["plat.toml"]);
    assert_says(&read(Path::new("no/such/folder")).unwrap_err(), Code::FileMissing, &["no/such/folder"]);
    // Paths of Windows, of which some are escapes that there are.
    for (path, code) in [
        (r"C:\plates\plate.toml", Code::SettingSyntax),
        (r"C:\users\plate.toml", Code::SettingSyntax),
        (r"C:\new\table.toml", Code::NameUnprintable),
    ] {
        assert_says(&replaced("plate.toml", path), code, &["series.toml:4", "backslash"]);
    }
    let misspelt = replaced("plate = \"plate.toml\"", r"plte = 'C:\plates\plate.toml'");
    assert_says(&misspelt, Code::SettingSyntax, &["series.toml:4", "\"plate\""]);
    #[cfg(not(windows))]
    assert_says(&replaced("\"plate.toml\"", r"'sub\plate.toml'"), Code::FileMissing, &[r"sub\plate.toml", "backslash"]);
}

#[test]
fn a_bad_joint_table_names_line_and_column() {
    let with = |text: &str| refusal(&[("joints.csv", text)]);
    assert_says(&with(&JOINTS.replace("1.5", "")), Code::CsvCellEmpty, &["joints.csv:3", "column j2"]);
    assert_says(&with(&JOINTS.replace("1.5", "x1")), Code::CsvNumber, &["joints.csv:3", "column j2", "\"x1\""]);
    // Signs of word processors and units, in one cell and throughout a column.
    assert_says(&with(&JOINTS.replace("1.5", "\u{2212}1.5")), Code::CsvNumber, &["joints.csv:3", "j2", "U+2212"]);
    for (cells, sign) in [(["\u{2212}1.25", "\u{2212}1.5"], "U+2212"), (["1.25\u{b0}", "1.5\u{b0}"], "\u{b0}")] {
        let [one, other] = cells;
        let throughout = format!("image,j1,j2,x\na.png,0.1,{one},0.5\nb.png,0.2,{other},0.5\n");
        assert_says(&with(&throughout), Code::CsvNumber, &["joints.csv:2", "column j2", sign]);
    }
    // Numbers as spreadsheets show them; throughout a column, too, where they are no remark.
    for (cells, sign) in [(["1'250.5", "1'500"], "(')"), (["\"1,250.5\"", "\"1,500.5\""], "(,)")] {
        let [one, other] = cells;
        let throughout = format!("image,j1,j2,x\na.png,0.1,{one},0.5\nb.png,0.2,{other},0.5\n");
        assert_says(&with(&throughout), Code::CsvNumber, &["joints.csv:2", "column j2", sign]);
    }
    assert_says(&with(&JOINTS.replace("1.5", "1. Mai")), Code::CsvNumber, &["joints.csv:3", "column j2", "date"]);
    assert_says(&with(&JOINTS.replace("1.5", "nan")), Code::CsvNumber, &["joints.csv:3", "nan"]);
    assert_says(&with(&JOINTS.replace("1.5", "\"1,5\"")), Code::CsvNumber, &["joints.csv:3", "\"1,5\""]);
    assert_says(&with(&JOINTS.replace("1.5", "1,5")), Code::CsvCellCount, &["joints.csv:3", "5 ", " 4 "]);
    assert_says(&with(&JOINTS.replace("b.png", "a.png")), Code::CsvRowTwice, &["joints.csv:3", "\"a.png\"", "line 2"]);
    assert_says(&with(&JOINTS.replace("b.png", "images/b.png")), Code::CsvName, &["joints.csv:3", "images/b.png"]);
    assert_says(
        &with(&JOINTS.replace("image", "picture")),
        Code::CsvColumnMissing,
        &["joints.csv:1", "\"image\"", "picture, j1"],
    );
    assert_says(&with(&JOINTS.replace("j2", "j1")), Code::CsvColumnTwice, &["joints.csv:1", "j1"]);
    assert_says(&with("image,j1\n"), Code::FileEmpty, &["joints.csv"]);
    assert_says(&with(""), Code::FileEmpty, &["joints.csv"]);
    let german = "image;j1;j2;x\na.png;0,1;1,25;0,5\n";
    assert_says(&with(german), Code::CsvSeparator, &["joints.csv:1", "semicolons"]);
    assert_says(&with(&german.replace(';', "\t")), Code::CsvSeparator, &["joints.csv:1", "tabs"]);
    // As the recorder of Universal Robots writes it.
    assert_says(&with(&german.replace(';', " ").replace(',', ".")), Code::CsvSeparator, &["joints.csv:1", "blanks"]);
    let mixed = "image,j1,j2,x\na.png;0,1;1,25;0,5\n";
    assert_says(&with(mixed), Code::CsvSeparator, &["joints.csv:2"]);
    assert_says(&with(&mixed.replace(",5", "")), Code::CsvSeparator, &["joints.csv:2"]);
    for line in ["sep=,", "\u{feff}SEP=;"] {
        assert_says(&with(&format!("{line}\n{JOINTS}")), Code::CsvSeparator, &["joints.csv:1"]);
    }
    let remarked = "image,j1,j2,x,operator\na.png,0.1,1.25,0.5,Ann\nb.png,0.2,1.5,0.5,Bob\n";
    assert_says(&with(remarked), Code::CsvNumber, &["joints.csv:1", "\"operator\""]);
    let folder = series_with(&[]);
    fs::write(folder.path().join("joints.csv"), [0xff, 0xfe, b'i', 0]).unwrap();
    assert_says(&read(folder.path()).unwrap_err(), Code::TextEncoding, &["UTF-16", "UTF-8"]);
    for bytes in [u16::to_le_bytes as fn(u16) -> [u8; 2], u16::to_be_bytes] {
        fs::write(folder.path().join("joints.csv"), JOINTS.encode_utf16().flat_map(bytes).collect::<Vec<u8>>())
            .unwrap();
        assert_says(&read(folder.path()).unwrap_err(), Code::TextEncoding, &["joints.csv", "UTF-16", "UTF-8"]);
    }
    fs::write(folder.path().join("joints.csv"), b"image,j1\na.png,1\n\xfcber.png,2\n").unwrap();
    assert_says(&read(folder.path()).unwrap_err(), Code::TextEncoding, &["joints.csv:3", "UTF-8"]);
}

#[test]
fn placements_are_all_named_or_none() {
    let named = "image,j1,j2,x,placement,time_s\na.png,0.1,1,0,left,10.5\nb.png,0.2,1,0,right,\n";
    let series = read(series_with(&[("joints.csv", named)]).path()).unwrap();
    let got: Vec<_> = series.stops.stops.iter().map(|s| (s.placement.as_str(), s.time_s)).collect();
    assert_eq!(got, [("left", Some(10.5)), ("right", None)]);
    let message = refusal(&[("joints.csv", &named.replace("right", ""))]);
    assert_says(&message, Code::CsvCellEmpty, &["joints.csv:3", "placement"]);
    let empty = named.replace("right", "").replace("left", "");
    assert_eq!(read(series_with(&[("joints.csv", &empty)]).path()).unwrap().stops.stops[0].placement, "placement_0");
}

#[test]
fn stops_were_visited_in_the_order_of_their_times() {
    let timed = "image,j1,j2,x,time_s\na.png,0.1,1,0,12.5\nb.png,0.2,1,0,3\n";
    let visited = |text: &str| {
        let series = read(series_with(&[("joints.csv", text)]).path()).unwrap();
        let stops: Vec<_> = series.stops.stops.iter().map(|s| (s.image.clone(), s.line)).collect();
        (stops, series.notices.iter().any(|n| n.code == Code::RowsByTime))
    };
    let [a, b] = [("a.png".to_owned(), 2), ("b.png".to_owned(), 3)];
    let (as_written, by_time) = (vec![a.clone(), b.clone()], vec![b, a]);
    assert_eq!(visited(timed), (by_time, true));
    assert_eq!(visited(&timed.replace("12.5", "2.5")), (as_written.clone(), false));
    // A clock that began anew: two runs of four stops each, one after the other.
    let runs: String =
        (0..8).map(|k| format!("{k}.png,0.{k},1,0,{}\n", if k < 4 { k as f64 } else { k as f64 - 3.5 })).collect();
    let text = format!("image,j1,j2,x,time_s\n{runs}");
    let images: Vec<String> = (0..8).map(|k| format!("images/{k}.png")).collect();
    let files: Vec<(&str, &str)> =
        images.iter().map(|image| (image.as_str(), "")).chain([("joints.csv", text.as_str())]).collect();
    let series = read(series_with(&files).path()).unwrap();
    assert!(series.stops.stops.iter().is_sorted_by_key(|s| s.line));
    let codes: Vec<Code> = series.notices.iter().map(|n| n.code).collect();
    assert!(codes.contains(&Code::ClockSetBack) && !codes.contains(&Code::RowsByTime), "{codes:?}");
    // Where a time is missing, or all are the same, nothing is told.
    assert_eq!(visited(&timed.replace("12.5", "")), (as_written.clone(), false));
    assert_eq!(visited(&timed.replace("12.5", "3")), (as_written, false));
}

#[test]
fn images_and_rows_are_held_against_each_other() {
    let folder = series_with(&[("images/extra.png", ""), ("images/notes.txt", ""), ("dark/1.png", "")]);
    fs::remove_file(folder.path().join("images/b.png")).unwrap();
    let series = read(folder.path()).unwrap();
    assert_eq!(series.stops.stops.len(), 3, "a stop without its image was visited all the same");
    assert_eq!(series.stops.stops[1].path, None);
    assert_eq!(series.notices.len(), 2, "{:?}", series.notices);
    assert_says(&series.notices[0], Code::ImageNotThere, &["joints.csv:3", "\"b.png\""]);
    assert_says(&series.notices[1], Code::ImageUnlisted, &["extra.png"]);
    let Source::Images { dark, white, .. } = &series.source else { panic!("{:?}", series.source) };
    assert_eq!((dark.len(), white.len()), (1, 0));
    let message = refusal(&[("joints.csv", &JOINTS.replace(".png", ".PNG"))]);
    assert_says(&message, Code::ImageNotThere, &["joints.csv:2", "a.PNG", "3 of 3", "\"a.png\""]);
    let message = refusal(&[("joints.csv", &JOINTS.replace(".png", ""))]);
    assert_says(&message, Code::ImageNotThere, &["\"a.png\""]);
}

#[test]
fn single_images_of_one_name_are_told_by_the_path_of_the_earlier() {
    let folder = folder(&[("plate.toml", PLATE)]);
    let images = ["a/x.png", "b/y.png", "c/x.png"].map(PathBuf::from);
    let error = series_of_images(&images, &folder.path().join("plate.toml")).unwrap_err();
    assert_says(&error, Code::ImageTwice, &["c/x.png", "a/x.png"]);
}

/// A file that is there and whose format is not read is not missing.
#[test]
fn images_of_other_formats_are_not_taken_for_missing_ones() {
    fn of(joints: &str) -> [(&str, &str); 3] {
        [("images/a.webp", ""), ("images/b.webp", ""), ("joints.csv", joints)]
    }
    let message = refusal(&of(&JOINTS.replace("a.png", "a.webp").replace("b.png", "b.webp")));
    assert_says(&message, Code::ImageUnreadable, &["joints.csv:2", "a.webp", "2 of 3"]);
    // One of them is left out when it is looked at, and says itself why.
    let series = read(series_with(&of(&JOINTS.replace("a.png", "a.webp"))).path()).unwrap();
    assert!(series.stops.stops[0].path.as_ref().unwrap().ends_with("images/a.webp"));
    assert!(series.notices.iter().all(|n| n.code == Code::ImageUnlisted), "{:?}", series.notices);
    // Named by its stop, without the end of its name.
    let message = refusal(&[("images/c.webp", ""), ("joints.csv", "image,j1,j2,x\nc,0.1,1.25,0.5\n")]);
    assert_says(&message, Code::ImageNotThere, &["joints.csv:2", "\"c.webp\""]);
}

#[test]
fn remarks_in_a_table_are_named() {
    for (joints, line) in [(format!("# mine\n{JOINTS}"), "joints.csv:1"), (format!("{JOINTS}# end\n"), "joints.csv:5")]
    {
        assert_says(&refusal(&[("joints.csv", &joints)]), Code::CsvSyntax, &[line]);
    }
}

#[test]
fn readings_are_matched_by_name_in_si() {
    let chain = chain();
    let degrees = MANIFEST.replace("rad", "deg");
    let joints = "image,j2,x,spare,j1\na.png,90,0.5,7,-45\nb.png,,,,\n";
    let images = [("images/a.png", ""), ("images/b.png", "")];
    let files = [("series.toml", degrees.as_str()), ("joints.csv", joints), images[0], images[1]];
    let series = read(series_with(&files).path()).unwrap();
    let readings = series.readings_for(&chain).unwrap();
    let turn = std::f64::consts::FRAC_PI_2;
    assert_eq!(chain.readings, ["x", "j1", "j2"]);
    let row = readings[0].as_ref().unwrap();
    assert_eq!(row[0], 0.5, "prismatic joints are metres whatever the unit");
    assert!((row[1] + turn / 2.0).abs() < 1e-15 && (row[2] - turn).abs() < 1e-15);
    assert_eq!(readings[1], None);
    let notices = series.reading_notices(&chain);
    assert_eq!(notices.len(), 1);
    assert_says(&notices[0], Code::JointUnused, &["spare"]);
    // A rail that the URDF does not have, and a counter.
    for (beside, code) in [([300, 0], Code::JointUnusedMoves), ([1, 2], Code::JointUnused)] {
        let [first, second] = beside;
        let joints = format!("image,j2,x,beside,j1\na.png,90,0.5,{first},-45\nb.png,80,0.5,{second},-45\n");
        let files = [("series.toml", degrees.as_str()), ("joints.csv", joints.as_str()), images[0], images[1]];
        let notices = read(series_with(&files).path()).unwrap().reading_notices(&chain);
        let codes: Vec<Code> = notices.iter().map(|n| n.code).collect();
        assert_eq!(codes, [code], "{notices:?}");
        assert_says(&notices[0], code, &["beside"]);
    }
    // A joint that moves something beside the chain is another matter than a name that nobody has.
    let with_branch = Chain { beside: vec!["spare".into()], ..chain.clone() };
    let misspelt = joints.replace("spare,", "spare,j_2,").replace("0.5,7,", "0.5,7,8,").replace("b.png,", "b.png,,");
    let series_of_both = read(series_with(&[("series.toml", &degrees), ("joints.csv", &misspelt)]).path()).unwrap();
    let notices = series_of_both.reading_notices(&with_branch);
    assert_eq!(notices.iter().map(|n| n.code).collect::<Vec<_>>(), [Code::JointUnused; 2], "{notices:?}");

    let renamed = joints.replace("j1", "joint1");
    let series = read(series_with(&[("series.toml", &degrees), ("joints.csv", &renamed)]).path()).unwrap();
    let error = series.readings_for(&chain).unwrap_err();
    assert_says(&error, Code::JointMissing, &["joints.csv", "j1", "j2, x, spare, joint1"]);
    for (unit, other) in [("deg", "rad"), ("rad", "deg")] {
        let of_unit = joints.replace("j1", &format!("j1 [{unit}]"));
        let series = read(series_with(&[("series.toml", &degrees), ("joints.csv", &of_unit)]).path()).unwrap();
        let error = series.readings_for(&chain).unwrap_err();
        assert_says(&error, Code::JointMissing, &["joints.csv", &format!("\"j1 [{unit}]\" to \"j1\"")]);
        // words: what would state the other unit, where the column contradicts the stated one.
        assert_eq!(error.remedy.contains("joint_unit = \"rad\""), other == "deg", "{}", error.remedy);
    }
}

#[test]
fn values_beyond_limits_are_noticed_by_name() {
    let joints = JOINTS.replace("1.25", "2.25");
    let series = read(series_with(&[("joints.csv", &joints)]).path()).unwrap();
    assert!(series.readings_for(&chain()).is_ok());
    let notices = series.reading_notices(&chain());
    assert_eq!(notices.len(), 1, "{notices:?}");
    assert_says(&notices[0], Code::JointBeyondLimits, &["joints.csv:2", "a.png", "j2", "2.25", "-2 to 2", "1 of 3"]);
}

/// A copied column leaves a readable table whose robot nobody has.
#[test]
fn joints_that_read_the_same_at_every_stop_are_named() {
    let codes = |last: &str| {
        let joints = format!("image,j1,j2,x\na.png,0.1,0.1,0.5\nb.png,-0.7,-0.7,0.25\noff.png,0.3,{last},0.5\n");
        let notices = read(series_with(&[("joints.csv", &joints)]).path()).unwrap().reading_notices(&chain());
        notices.iter().map(|n| n.code).collect::<Vec<_>>()
    };
    assert_eq!(codes("0.3"), [Code::JointColumnsEqual]);
    assert_eq!(codes("0.30001"), []);
}

/// Readings of three joints x, j1, j2 of `chain` from a table of that order.
fn with_readings(unit: AngleUnit, rows: &[[f64; 3]]) -> Result<(), Error> {
    let mut series = read(series_with(&[]).path()).unwrap();
    series.manifest.joint_unit = Some(unit);
    series.stops.joints = ["x", "j1", "j2"].map(String::from).into();
    let stop = series.stops.stops[0].clone();
    series.stops.stops =
        rows.iter().map(|row| SeriesStop { raw_readings: Some(row.to_vec()), ..stop.clone() }).collect();
    series.readings_for(&chain()).map(|_| ())
}

#[test]
fn an_impossible_unit_is_refused_and_a_possible_one_is_not() {
    use AngleUnit::{Deg, Rad};
    let degrees: Vec<[f64; 3]> = (0..6).map(|i| [0.5, -100.0 + 30.0 * f64::from(i), 40.0]).collect();
    let radians: Vec<[f64; 3]> = degrees.iter().map(|[x, a, b]| [*x, a.to_radians(), b.to_radians()]).collect();
    assert_eq!(with_readings(Deg, &degrees), Ok(()));
    assert_eq!(with_readings(Rad, &radians), Ok(()));
    assert_says(&with_readings(Rad, &degrees).unwrap_err(), Code::DegreesAsRadians, &["joints.csv", "j1", "-100"]);
    assert_says(&with_readings(Deg, &radians).unwrap_err(), Code::RadiansAsDegrees, &["joints.csv", "j1"]);
    // Encoder counts; of one joint alone that is wound up nothing is said.
    let counts: Vec<[f64; 3]> = degrees.iter().map(|[x, a, b]| [*x, 1e3 * (a + 300.0), 1e3 * (b + 300.0)]).collect();
    for unit in [Deg, Rad] {
        assert_says(&with_readings(unit, &counts).unwrap_err(), Code::CountsAsAngles, &["joints.csv", unit.name()]);
    }
    let wound: Vec<[f64; 3]> = degrees.iter().map(|[x, a, b]| [*x, 1e3 * (a + 300.0), *b]).collect();
    assert_eq!(with_readings(Deg, &wound), Ok(()));
    // A whole turn where the description allows half a one, on every stop.
    let turned: Vec<[f64; 3]> = radians.iter().map(|[x, a, b]| [*x, a - 4.2, *b]).collect();
    assert!(turned.iter().all(|q| q[1] < -3.0));
    assert_eq!(with_readings(Rad, &turned), Ok(()));
    // One row beyond its limits is a notice, not a wrong unit.
    let mut one = radians.clone();
    one[0][1] = 3.4;
    assert_eq!(with_readings(Rad, &one), Ok(()));
    // Few stops near zero in degrees prove nothing.
    assert_eq!(with_readings(Deg, &[[0.5, 1.0, 2.0], [0.5, 1.5, -2.0]]), Ok(()));
    // A robot that moves little about a pose far from zero is in degrees for sure.
    let near: Vec<[f64; 3]> = (0..6).map(|i| [0.5, 45.0 + 0.1 * f64::from(i), 1.0]).collect();
    assert_eq!(with_readings(Deg, &near), Ok(()));
    let millimetres: Vec<[f64; 3]> = radians.iter().map(|[x, a, b]| [x * 1000.0, *a, *b]).collect();
    assert_says(
        &with_readings(Rad, &millimetres).unwrap_err(),
        Code::MillimetresAsMetres,
        &["x reads 500", "0.001 (mm)"],
    );
    // Counted the other way it is metres as well.
    let negated: Vec<[f64; 3]> = radians.iter().map(|[x, a, b]| [-4.0 * x, *a, *b]).collect();
    assert_eq!(with_readings(Rad, &negated), Ok(()));
    // A slide that reads what a turning joint may, beside one that reads what the slide may.
    let exchanged: Vec<[f64; 3]> = degrees.iter().map(|[x, a, b]| [*b, *a, *x]).collect();
    assert_says(&with_readings(Deg, &exchanged).unwrap_err(), Code::JointOrderWrong, &["x", "j2"]);
    // Neither the factor of mm nor another alone is named where several keep the limits.
    for (unit, factor) in [("cm", 100.0), ("inch", 1.0 / 0.0254)] {
        let read: Vec<[f64; 3]> = radians.iter().map(|[x, a, b]| [x * factor, *a, *b]).collect();
        let refused = with_readings(Rad, &read).unwrap_err();
        assert_eq!(refused.code, Code::MillimetresAsMetres);
        assert!(refused.remedy.contains(&format!("({unit})")), "{}", refused.remedy);
    }
}

/// A copy over another system may write an accent as a character of its own: to a person the two names are one.
#[test]
fn a_name_with_an_accent_is_that_of_its_file_however_both_are_written() {
    let (composed, decomposed) = ("k\u{e4}fig.png", "ka\u{308}fig.png");
    for (row, file) in [(composed, decomposed), (decomposed, composed), (composed, composed)] {
        let renamed = JOINTS.replace("b.png", row);
        let folder = series_with(&[("joints.csv", &renamed), (&format!("images/{file}"), "")]);
        fs::remove_file(folder.path().join("images/b.png")).unwrap();
        let series = read(folder.path()).unwrap();
        assert!(series.notices.is_empty(), "{:?}", series.notices);
        assert_eq!(series.stops.stops[1].path.as_ref().unwrap().file_name().unwrap(), file);
    }
}

/// Tables of one folder may have been written by different systems, too.
#[test]
fn a_name_with_an_accent_is_the_same_in_all_tables() {
    let (composed, decomposed) = ("k\u{e4}fig.png", "ka\u{308}fig.png");
    let observed = |name: &str| format!("image,marker,u,v\na.png,1,1,2\n{name},1,1,2\noff.png,0,3,4\n");
    let touched = |name: &str| format!("stop,contact,x_m,y_m,z_m\n{name},p,,,\n");
    for (row, other) in [(composed, decomposed), (decomposed, composed), (decomposed, decomposed)] {
        let joints = JOINTS.replace("b.png", row);
        let tables =
            [("joints.csv", &*joints), ("observations.csv", &observed(other)), ("contacts.csv", &touched(other))];
        let series = read(series_with(&tables).path()).unwrap();
        assert!(series.notices.is_empty(), "{:?}", series.notices);
        let Source::Observations(images) = &series.source else { panic!("{:?}", series.source) };
        let names: Vec<_> = images.iter().map(|i| i.image.as_str()).collect();
        assert_eq!(names, ["a.png", composed, "off.png"]);
    }
}

#[test]
fn observations_replace_images_and_are_checked_by_line() {
    let header = "image,marker,u,v,edge,cov_uu,cov_uv,cov_vv,du,dv,reason\n";
    let good = format!(
        "{header}b.png,3,10.5,20.25,outer,0.01,0.001,0.02,0.1,0.2,\nb.png,1,1,2,,,,,,,\nb.png,2,1,2,,,,,9,9,outlier\n\
         gone.png,1,1,2,,,,,,,\noff.png,0,3,4,,,,,,,\n"
    );
    let series = read(series_with(&[("observations.csv", &good)]).path()).unwrap();
    let Source::Observations(images) = &series.source else { panic!("{:?}", series.source) };
    let names: Vec<_> = images.iter().map(|i| i.image.as_str()).collect();
    assert_eq!(names, ["b.png", "off.png"], "in the order of the stops");
    assert_eq!(images[0].observations.iter().map(|o| o.marker).collect::<Vec<_>>(), [1, 3], "a reason leaves out");
    assert_eq!(images[0].observations[1].covariance, Some([0.01, 0.001, 0.02]));
    assert_eq!(images[0].observations[1].uv, [10.5, 20.25]);
    assert_eq!(series.notices.len(), 2);
    assert_says(&series.notices[0], Code::ImageUnlisted, &["gone.png"]);
    assert_says(&series.notices[1], Code::ObservationsMissing, &["a.png"]);
    let images = read_images(series_with(&[("observations.csv", &good)]).path()).unwrap();
    assert!(matches!(images.source, Source::Images { .. }));

    let sized = format!("{MANIFEST}[camera]\nwidth_px = 100\nheight_px = 80\n");
    let with = |rows: &str| refusal(&[("series.toml", &sized), ("observations.csv", &format!("{header}{rows}\n"))]);
    assert_says(&with("a.png,6,1,2,,,,,,,"), Code::MarkerUnknown, &["observations.csv:2", "\"6\"", "0 to 5"]);
    assert_says(&with("a.png,-1,1,2,,,,,,,"), Code::CsvNumber, &["observations.csv:2", "\"-1\""]);
    assert_says(&with("a.png,1,x,2,,,,,,,"), Code::CsvNumber, &["observations.csv:2", "column u", "\"x\""]);
    assert_says(&with("a.png,1,1,80,,,,,,,"), Code::CsvRange, &["observations.csv:2", "column v", "100 x 80"]);
    // Every point is in the image where u is taken for v.
    let exchanged = with("a.png,1,60,99,,,,,,,\nb.png,1,70,10,,,,,,,");
    assert_says(&exchanged, Code::CsvRange, &["observations.csv:2", "u and v"]);
    let neither = with("a.png,1,60,99,,,,,,,\nb.png,1,90,10,,,,,,,");
    assert_says(&neither, Code::CsvRange, &["observations.csv:2", "width_px"]);
    assert_says(&with("a.png,1,1,2,middle,,,,,,"), Code::CsvName, &["observations.csv:2", "middle"]);
    assert_says(&with("a.png,1,1,2,inner,,,,,,"), Code::CsvName, &["observations.csv:2", "inner"]);
    assert_says(&with("a.png,1,1,2,,1,2,1,,,"), Code::CsvRange, &["observations.csv:2", "cov_uu"]);
    assert_says(&with("a.png,1,1,2,,1,,1,,,"), Code::CsvNumber, &["observations.csv:2", "cov_uv"]);
    assert_says(&with("a.png,1,1,2,,,,,,,\na.png,1,1,3,,,,,,,"), Code::CsvRowTwice, &["observations.csv:3", "line 2"]);
    assert_says(&with("c.png,1,1,2,,,,,,,"), Code::ObservationsMissing, &["observations.csv"]);
    for name in ["A.PNG", "a", "a.tif"] {
        let pair = format!("\"{name}\" is \"a.png\"");
        assert_says(&with(&format!("{name},1,1,2,,,,,,,")), Code::ObservationsMissing, &["observations.csv", &pair]);
        let beside = good.replace("gone.png", name);
        let series = read(series_with(&[("observations.csv", &beside)]).path()).unwrap();
        assert_says(&series.notices[0], Code::ImageUnlisted, &[&pair]);
    }
    let misspelt = refusal(&[("observations.csv", "image,marker,u,v,egde\na.png,1,1,2,inner\n")]);
    assert_says(&misspelt, Code::CsvColumnUnknown, &["observations.csv:1", "egde", "\"edge\""]);
}

#[test]
fn what_is_written_reads_back_the_same() {
    let text = format!(
        "{MANIFEST}base = \"a\"\nmcap = \"run.mcap\"\n[camera]\nname = \"front\"\nmodel = \"brown\"\nfocal_px = 2250.125\nwidth_px = 640\n\
         height_px = 480\nbits = 12\n[observations]\npoint = \"centre\"\n[robot]\nrepeatability_m = 3e-5\norder = \"unknown\"\n"
    );
    let series = read(series_with(&[("series.toml", &text)]).path()).unwrap();
    assert!(matches!(&series.source, Source::Recording(path) if path.ends_with("run.mcap")));
    let again = series.manifest.to_toml().unwrap();
    assert_eq!(read(series_with(&[("series.toml", &again)]).path()).unwrap().manifest, series.manifest);
    let short: Manifest = Manifest { mcap: None, ..read(series_with(&[]).path()).unwrap().manifest };
    assert_eq!(short.to_toml().unwrap(), MANIFEST);

    let stop = |image: &str, line, raw: Option<Vec<f64>>, placement: &str, time_s| SeriesStop {
        image: image.into(),
        path: None,
        raw_readings: raw,
        placement: placement.into(),
        time_s,
        line,
        ..SeriesStop::default()
    };
    let stops = Stops {
        joints: vec!["j 1".into(), "arm,2".into()],
        stops: vec![
            stop("a \"1\".png", 2, Some(vec![0.1 + 0.2, -1e-17]), "left", Some(1732.000000001)),
            stop("b.png", 3, None, "right side, far", None),
        ],
        ..Stops::default()
    };
    let observations = vec![ImageObservations {
        image: "a \"1\".png".into(),
        observations: vec![
            Observation { marker: 0, edge: Edge::Outer, uv: [1.0 / 3.0, 2e-9], covariance: None },
            Observation { marker: 4, edge: Edge::Outer, uv: [5.0, 6.0], covariance: Some([0.1, -0.01, 0.3]) },
        ],
    }];
    let files = [("joints.csv", stops.to_csv()), ("observations.csv", observations_csv(&observations))];
    let read = read(series_with(&files.each_ref().map(|(n, t)| (*n, t.as_str()))).path()).unwrap();
    assert_eq!(read.stops, stops);
    assert_eq!(read.source, Source::Observations(observations));
}

#[test]
fn names_with_control_characters_are_refused_wherever_they_are_read() {
    let manifest = |line: &str| format!("{MANIFEST}[camera]\n{line}\n");
    let header = JOINTS.replace("j2", "j\u{1b}[2J2");
    let quoted = JOINTS.replace("j2", "\"j\n; HALT\"");
    let stop = JOINTS.replace("b.png", "\"b\n.png\"");
    let placed = "image,j1,j2,x,placement\na.png,0,0,0,\"p\u{7}\"\nb.png,0,0,0,q\noff.png,,,,q\n";
    let cases: [(&str, String, &str); 7] = [
        ("series.toml", manifest("name = \"left\\u001b[2J\""), "series.toml:6"),
        ("series.toml", manifest("mounting = \"a\\nb\""), "series.toml:6"),
        ("joints.csv", header, "joints.csv:1"),
        ("joints.csv", quoted, "joints.csv:1"),
        ("joints.csv", stop, "joints.csv:3"),
        ("joints.csv", placed.into(), "joints.csv:2"),
        ("images/c\u{1b}[2J.png", String::new(), "images"),
    ];
    for (name, text, place) in cases {
        let folder = series_with(&[(name, &text)]);
        let error = read(folder.path()).unwrap_err();
        assert_eq!(error.code, Code::NameUnprintable);
        assert!(error.place.ends_with(place), "{name}: {}", error.place);
        assert!(!error.to_string().contains(|c: char| c.is_control() && c != '\n'), "{error:?}");
        assert!(!error.what.contains('\n'), "{error:?}");
    }
}
