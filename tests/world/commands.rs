//! `robotcal plate` and `robotcal simulate` as a user calls them.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use crate::program::{robotcal, text};
use crate::robots::{KR6, kr6_urdf};
use crate::said::assert_says;
use robotcal::Code;
use robotcal::series::{Plate, read_plate};

fn plate(folder: &Path, args: &[&str]) -> (Output, Option<Plate>) {
    let out = folder.join("plate");
    let output = robotcal(&[&["plate", "--out", out.to_str().unwrap()], args].concat());
    (output, read_plate(&out.join("plate.toml"), &mut Vec::new()).ok())
}

#[test]
fn a_plate_for_a_sheet_and_a_camera_is_written_in_all_formats() {
    let folder = tempfile::tempdir().unwrap();
    let flags = ["--sheet", "A4", "--markers", "100", "--focal-px", "1200", "--distance-m", "0.15x0.4"];
    let (output, made) = plate(folder.path(), &flags);
    assert!(output.status.success(), "{}", text(&output));
    let made = made.unwrap();
    assert!((90..=110).contains(&made.markers.len()));
    assert!(text(&output).contains("297 x 210 mm"), "{}", text(&output));
    for (file, start) in [("plate.pdf", "%PDF"), ("plate.svg", "<svg"), ("plate.png", "\u{fffd}PNG")] {
        let bytes = std::fs::read(folder.path().join("plate").join(file)).unwrap();
        assert!(String::from_utf8_lossy(&bytes[..4]).starts_with(start), "{file}");
    }
}

#[test]
fn a_plate_that_the_camera_cannot_resolve_is_refused_and_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let flags = ["--pitch-mm", "5", "--focal-px", "800", "--distance-m", "0.3x1.0"];
    let (output, made) = plate(folder.path(), &flags);
    assert_eq!(output.status.code(), Some(2));
    assert!(made.is_none() && text(&output).starts_with("error[plate_impossible]: "), "{}", text(&output));
}

#[test]
fn wrong_wishes_of_a_simulation_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("series");
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/ur10e/ur10e.urdf");
    let common = ["simulate", "--urdf", urdf.to_str().unwrap(), "--out", out.to_str().unwrap(), "--observations"];
    let far = ["--near-m", "3", "--far-m", "4"];
    for (flags, exit, code, named) in [
        (&["--fault", "moved-plat"][..], 2, Code::FaultUnknown, "\"moved-plate\""),
        (&["--fault", "no-markers"][..], 2, Code::OptionConflict, "--observations"),
        (&["--tip", "tool9"][..], 2, Code::LinkUnknown, "tool9"),
        (&["--bits", "9"][..], 2, Code::OptionRange, "--bits"),
        (&["--tilt-deg", "89"][..], 2, Code::OptionRange, "85"),
        (&["--pixel-noise-px", "nan"][..], 2, Code::OptionRange, "noise"),
        (&["--joint-noise-mrad=-1"][..], 2, Code::OptionRange, "noise"),
        (&["--images", "0"][..], 2, Code::OptionRange, "stop"),
        (&far[..], 3, Code::SimulationOutOfReach, "robot ur10e"),
    ] {
        let output = robotcal(&[&common[..], flags].concat());
        assert_eq!(output.status.code(), Some(exit), "{flags:?}: {}", text(&output));
        let said = text(&output);
        assert!(said.starts_with(&format!("error[{code}]: ")) && said.contains(named), "{flags:?}: {said}");
        assert!(!out.exists(), "{flags:?}");
    }
}

#[test]
fn harmonics_of_a_robot_model_without_gears_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("result");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let [urdf, series] = ["robots/kuka_kr6_r900/kuka_kr6_r900.urdf", "datasets/kr6_small"].map(|path| root.join(path));
    for model in ["rigid", "sag"] {
        let given = ["identify", "--urdf", urdf.to_str().unwrap(), "--series", series.to_str().unwrap()];
        let asked = ["--robot-model", model, "--harmonics", "4", "--out", out.to_str().unwrap()];
        let output = robotcal(&[&given[..], &asked].concat());
        assert_eq!(output.status.code(), Some(2), "{}", text(&output));
        assert_says(&text(&output), Code::OptionConflict, &["--harmonics", model]);
    }
    assert!(!out.exists());
}

/// Rods keep the flange of a palletiser level: nearer views are no help.
#[test]
fn an_arm_that_tilts_nothing_is_told_what_measures_it() {
    let folder = tempfile::tempdir().unwrap();
    let joint = |name: &str, [parent, child]: [&str; 2], xyz: &str, inner: &str| {
        format!(
            "<link name=\"{child}\"/><joint name=\"{name}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <origin xyz=\"{xyz}\"/>{inner}<limit lower=\"-1.5\" upper=\"1.5\" effort=\"0\" velocity=\"0\"/></joint>"
        )
    };
    let (z, y) = ("<axis xyz=\"0 0 1\"/>", "<axis xyz=\"0 1 0\"/>");
    let follows = |of: &str| format!("{y}<mimic joint=\"{of}\" multiplier=\"-1\"/>");
    let urdf = folder.path().join("palletiser.urdf");
    let joints = [
        joint("j1", ["base", "a"], "0 0 0.4", z),
        joint("j2", ["a", "b"], "0.1 0 0", y),
        joint("j3", ["b", "c"], "0 0 0.6", y),
        joint("rod2", ["c", "d"], "0.6 0 0", &follows("j2")),
        joint("rod3", ["d", "e"], "0 0 0", &follows("j3")),
        joint("j4", ["e", "f"], "0.1 0 -0.1", z),
    ];
    std::fs::write(&urdf, format!("<robot name=\"p\"><link name=\"base\"/>{}</robot>", joints.concat())).unwrap();
    let out = folder.path().join("series");
    let output =
        robotcal(&["simulate", "--urdf", urdf.to_str().unwrap(), "--out", out.to_str().unwrap(), "--observations"]);
    assert_eq!(output.status.code(), Some(3), "{}", text(&output));
    let said = text(&output);
    let code = Code::SimulationOutOfReach;
    assert!(said.contains(&format!("error[{code}]: ")) && said.contains("contacts.csv"), "{said}");
}

fn root(path: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path).to_str().unwrap().to_owned()
}

/// As [`robotcal`], with stdout somewhere else.
fn robotcal_into(stdout: impl Into<Stdio>, args: &[&str]) -> Output {
    let child = Command::new(env!("CARGO_BIN_EXE_robotcal")).args(args).stdout(stdout).stderr(Stdio::piped()).spawn();
    child.unwrap().wait_with_output().unwrap()
}

#[test]
fn a_reader_that_has_seen_enough_ends_the_output_and_nothing_else() {
    let solution = root("reports/kr6_small/solution.json");
    for args in [
        &["show", &solution][..],
        &["show", "--parameters", &solution, &solution],
        &["simulate", "--fault", "list", "--urdf", "-", "--out", "-"],
    ] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let output = robotcal_into(writer, args);
        assert_eq!((output.status.code(), text(&output).as_str()), (Some(0), ""), "{args:?}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn output_that_cannot_be_written_is_an_error() {
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let output = robotcal_into(full, &["show", &root("reports/kr6_small/solution.json")]);
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert!(text(&output).starts_with("error[output_failed]: "), "{}", text(&output));
}

#[test]
fn the_verdict_stands_first_and_the_flange_after_it() {
    let output = robotcal(&["show", &root("reports/kr6_small/solution.json")]);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    // words: what stands first on the terminal is what is tested.
    assert!(said.starts_with("verdict   good\n"), "{said}");
    assert_eq!(said.lines().filter(|l| l.starts_with("verdict")).count(), 1);
}

#[test]
fn as_json_the_solution_and_nothing_else_is_printed() {
    let solution = root("reports/kr6_small/solution.json");
    let output = robotcal(&["show", "--json", &solution]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output));
    let [printed, file] = [output.stdout, std::fs::read(&solution).unwrap()]
        .map(|bytes| serde_json::from_slice::<serde_json::Value>(&bytes).unwrap());
    assert_eq!(printed["images"], file["images"]);
    assert_eq!(printed["flange"]["model_m"], file["flange"]["model_m"]);
}

/// Every drawing of the report is a file of its own that a reader of XML opens, with the chapter in its name and a size.
#[test]
fn the_figures_of_the_report_are_drawings_by_themselves() {
    let solution = root("reports/kr6_small/solution.json");
    let folder = tempfile::tempdir().unwrap();
    let [figures, report] = ["figures", "report.html"].map(|name| folder.path().join(name).display().to_string());
    let output = robotcal(&["show", "--figures", &figures, "--report", &report, &solution]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output));
    let page = std::fs::read_to_string(&report).unwrap();
    let mut drawings = 0;
    let all = std::fs::read_dir(&figures).unwrap().map(|entry| entry.unwrap().path());
    for path in all.filter(|path| path.file_name().unwrap() != ".robotcal-written.json") {
        let svg = std::fs::read_to_string(&path).unwrap();
        let document = roxmltree::Document::parse(&svg).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        assert_eq!(document.root_element().tag_name().name(), "svg");
        assert!(document.root_element().has_attribute("viewBox"), "{}", path.display());
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let chapter = name.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end_matches('-');
        assert!(page.contains(&format!("id=\"{chapter}\"")), "{name}");
        let said = document.root_element().attribute("aria-label").unwrap();
        assert!(page.contains(&format!("aria-label=\"{said}\"")), "{name}: {said}");
        drawings += 1;
    }
    assert!(drawings > 10, "{drawings}");
}

#[test]
fn a_folder_of_results_stands_for_its_solution() {
    let [of_folder, of_file] =
        ["reports/kr6_small", "reports/kr6_small/solution.json"].map(|path| robotcal(&["show", "--json", &root(path)]));
    assert_eq!(of_folder.status.code(), Some(0), "{}", text(&of_folder));
    assert_eq!(of_folder.stdout, of_file.stdout);
    let short = robotcal(&["show", &root("reports/kr6_small")]);
    let report = Path::new(&root("reports/kr6_small")).join("report.html");
    assert!(text(&short).contains(report.to_str().unwrap()), "{}", text(&short));
}

#[test]
fn a_solution_that_somebody_changed_is_told() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["solution.json", ".robotcal-written.json"] {
        std::fs::copy(root(&format!("reports/kr6_small/{name}")), folder.path().join(name)).unwrap();
    }
    let solution = folder.path().join("solution.json");
    let shown = || text(&robotcal(&["show", solution.to_str().unwrap()]));
    let code = Code::SolutionDamaged.to_string();
    assert!(!shown().contains(&code), "{}", shown());
    let written = std::fs::read_to_string(&solution).unwrap();
    std::fs::write(&solution, written.replacen('0', "1", 1)).unwrap();
    assert!(shown().contains(&code), "{}", shown());
}

#[test]
fn what_is_no_series_is_said_to_be_none() {
    let urdf = root(KR6);
    for [robot, series] in [[&root("datasets/kr6_small"), &urdf], [&urdf, &root("datasets")]] {
        let output = robotcal(&["identify", "--urdf", robot, "--series", series]);
        assert_eq!(output.status.code(), Some(2));
        assert_says(&text(&output), Code::SeriesMissing, &[series]);
    }
}

#[test]
fn doctor_names_all_that_is_missing_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run1");
    std::fs::create_dir(&run).unwrap();
    let output = robotcal(&["doctor", run.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2));
    assert_says(&text(&output), Code::FileMissing, &["series.toml", "plate.toml", "joints.csv", "images"]);
    let urdf = root(KR6);
    let complete = robotcal(&["doctor", &root("datasets/kr6_small"), "--urdf", &urdf]);
    assert_eq!(complete.status.code(), Some(0), "{}", text(&complete));
    let unknown = robotcal(&["doctor", &root("datasets/bad/unknown-joint"), "--urdf", &urdf]);
    assert_says(&text(&unknown), Code::JointMissing, &["joint_a3", "joint_x"]);
}

#[test]
fn doctor_takes_a_folder_of_a_recording_without_metadata_as_one() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    std::fs::create_dir(&bag).unwrap();
    std::fs::copy(root("tests/recordings/lz4.mcap"), bag.join("bag_0.mcap")).unwrap();
    let unstated = robotcal(&["doctor", bag.to_str().unwrap()]);
    assert_eq!(unstated.status.code(), Some(2));
    assert_says(&text(&unstated), Code::SeriesMissing, &["bag.toml"]);
    std::fs::write(folder.path().join("bag.toml"), "format = 1\ncamera_mount = \"hand\"\nplate = \"plate.toml\"\n")
        .unwrap();
    std::fs::write(
        folder.path().join("plate.toml"),
        "format = 1\nkind = \"chessboard\"\ncolumns = 3\nrows = 2\npitch_m = 0.02\ntolerance_m = 0.0001\n",
    )
    .unwrap();
    let stated = robotcal(&["doctor", bag.to_str().unwrap()]);
    assert_eq!(stated.status.code(), Some(0), "{}", text(&stated));
    // It takes the stops out as identify does, with the same flags.
    let other = robotcal(&["doctor", bag.to_str().unwrap(), "--image-topic", "/camera/other"]);
    assert_eq!(other.status.code(), Some(2));
    assert_says(&text(&other), Code::TopicMissing, &["/camera/other"]);
    let by_log = robotcal(&["doctor", bag.to_str().unwrap(), "--clock", "log"]);
    assert_eq!(by_log.status.code(), Some(0), "{}", text(&by_log));
    assert!(text(&by_log).contains("--clock"), "{}", text(&by_log));
}

/// Observations do not tell how large the images were.
#[test]
fn doctor_misses_the_size_of_images_that_are_not_there_and_quotes_names_with_blanks() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("my run");
    std::fs::create_dir(&run).unwrap();
    for name in ["joints.csv", "observations.csv", "plate.csv", "plate.toml"] {
        std::fs::copy(root(&format!("datasets/ur10e_observations/{name}")), run.join(name)).unwrap();
    }
    let manifest = std::fs::read_to_string(Path::new(&root("datasets/ur10e_observations/series.toml"))).unwrap();
    let without: String = manifest.lines().filter(|l| !l.contains("_px")).map(|l| format!("{l}\n")).collect();
    std::fs::write(run.join("series.toml"), without).unwrap();
    let unstated = robotcal(&["doctor", run.to_str().unwrap()]);
    assert_eq!(unstated.status.code(), Some(2));
    assert_says(&text(&unstated), Code::SettingMissing, &["width_px", "height_px"]);
    std::fs::write(run.join("series.toml"), manifest).unwrap();
    let stated = robotcal(&["doctor", run.to_str().unwrap()]);
    assert_eq!(stated.status.code(), Some(0), "{}", text(&stated));
    assert!(text(&stated).contains(&format!("\"{}\"", run.display())), "{}", text(&stated));
}

#[test]
fn doctor_says_that_a_bag_of_ros_1_must_be_converted() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("run1.bag");
    std::fs::write(&bag, "#ROSBAG V2.0\nrest").unwrap();
    let output = robotcal(&["doctor", bag.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert_says(&text(&output), Code::RecordingFormat, &["run1.bag", "rosbags-convert"]);
}

#[test]
fn camera_files_of_other_programs_that_are_not_read_are_named_as_such() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("camera.yml");
    for (name, bytes) in [
        ("stereo.mat", &b"MATLAB 5.0 MAT-file, Platform: GLNXA64\0\xff\xfe"[..]),
        ("stereo.yaml", &b"MATLAB 7.3 MAT-file, Platform: GLNXA64\0\xff\xfe"[..]),
        ("calib.json", b"{\"Calibration\": {\"cameras\": []}}"),
    ] {
        let file = folder.path().join(name);
        std::fs::write(&file, bytes).unwrap();
        let output = robotcal(&["convert", file.to_str().unwrap(), out.to_str().unwrap(), "--as", "opencv"]);
        assert_eq!(output.status.code(), Some(2), "{}", text(&output));
        assert_says(&text(&output), Code::SettingSyntax, &[name]);
    }
    let typo = folder.path().join("typo.mat");
    let output = robotcal(&["convert", typo.to_str().unwrap(), out.to_str().unwrap(), "--as", "opencv"]);
    assert_says(&text(&output), Code::FileMissing, &["typo.mat"]);
}

#[test]
fn a_report_may_be_named_without_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let solution = root("reports/kr6_small/solution.json");
    let output = Command::new(env!("CARGO_BIN_EXE_robotcal"))
        .args(["show", &solution, "--report", "new.html"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(folder.path().join("new.html").is_file(), "{}", text(&output));
}

#[test]
fn a_sheet_is_turned_where_the_board_fits_only_so() {
    let folder = tempfile::tempdir().unwrap();
    for shape in ["6x9", "9x6"] {
        let flags = ["--kind", "chessboard", "--sheet", "A4", "--shape", shape, "--pitch-mm", "20"];
        let (output, made) = plate(folder.path(), &flags);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output));
        assert_eq!(made.unwrap().markers.len(), 54);
        let drawing = std::fs::read_to_string(folder.path().join("plate/plate.svg")).unwrap();
        let [width, height] = if shape == "6x9" { [210, 297] } else { [297, 210] };
        assert!(drawing.contains(&format!("width=\"{width}mm\" height=\"{height}mm\"")), "{}", &drawing[..200]);
        std::fs::remove_dir_all(folder.path().join("plate")).unwrap();
    }
    let (output, _) =
        plate(folder.path(), &["--kind", "chessboard", "--id", "3", "--shape", "6x9", "--pitch-mm", "20"]);
    assert_eq!(output.status.code(), Some(2));
    assert_says(&text(&output), Code::OptionConflict, &["--id"]);
}

#[test]
fn alone_the_program_says_how_to_start() {
    let output = robotcal(&[]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output));
    let commands = text(&output).lines().filter(|l| l.starts_with("  robotcal ")).count();
    assert_eq!(commands, 3, "{}", text(&output));
}

#[test]
fn the_folder_of_predicted_flanges_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path().join("points.csv");
    std::fs::write(&at, "joint_a1,joint_a2,joint_a3,joint_a4,joint_a5,joint_a6\n10,-80,110,5,50,20\n").unwrap();
    let out = folder.path().join("new/deeper");
    let solution = root("reports/kr6_small/solution.json");
    let args = ["show", &solution, "--at", at.to_str().unwrap(), "--at-unit", "deg", "--out", out.to_str().unwrap()];
    let output = robotcal(&args);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output));
    let table = std::fs::read_to_string(out.join("at.csv")).unwrap();
    assert_eq!(table.lines().filter(|l| !l.starts_with('#')).count(), 2);
    let last = |line: usize| table.lines().nth(line).unwrap().rsplit(',').next().unwrap().to_owned();
    assert_eq!([0, 1].map(last), ["relative_to", "plate/placement_0"]);
    let as_radians = robotcal(&["show", &solution, "--at", at.to_str().unwrap(), "--at-unit", "rad"]);
    assert_eq!(as_radians.status.code(), Some(2));
    assert!(text(&as_radians).contains(Code::DegreesAsRadians.name()), "{}", text(&as_radians));
}

#[test]
fn a_table_of_joint_vectors_is_read_as_every_other_table() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path().join("points.csv");
    let (names, row) = ("joint_a1,joint_a2,joint_a3,joint_a4,joint_a5,joint_a6", "10,-80,110,5,50,20");
    let semicolons = format!("{names}\n{row}\n").replace(',', ";");
    for (table, code, line) in [
        (semicolons, Code::CsvSeparator, 1),
        (format!("{names},joint_a6\n{row},25\n"), Code::CsvColumnTwice, 1),
        (format!("{names}\n# taught by hand\n{row}\n"), Code::CsvSyntax, 2),
        (format!("{names}\n{row},30\n"), Code::CsvCellCount, 2),
        (format!("{names}\n"), Code::FileEmpty, 1),
        (format!(",{names}\n7,{row}\n"), Code::CsvColumnUnknown, 1),
        (format!("{names},\n{row},0\n"), Code::CsvColumnUnknown, 1),
    ] {
        std::fs::write(&at, table).unwrap();
        let place = format!("{}:{line}", at.display());
        let args = ["show", &root("reports/kr6_small/solution.json"), "--at", at.to_str().unwrap(), "--at-unit", "deg"];
        let output = robotcal(&args);
        assert_eq!(output.status.code(), Some(2), "{}", text(&output));
        assert_says(&text(&output), code, &[&place]);
    }
    // Row numbers, as pandas writes them, are no joint.
    let said = [format!("{names}\n{row}\n{row}\n"), format!(",{names}\n0,{row}\n1,{row}\n")].map(|table| {
        std::fs::write(&at, table).unwrap();
        let [at, out] = [&at, &folder.path().join("out")].map(|p| p.to_str().unwrap().to_owned());
        let solution = root("reports/kr6_small/solution.json");
        let output = robotcal(&["show", &solution, "--at", &at, "--at-unit", "deg", "--out", &out]);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output));
        std::fs::read_to_string(Path::new(&out).join("at.csv")).unwrap()
    });
    assert_eq!(said[0], said[1]);
}

#[test]
fn a_dry_run_says_all_that_it_counts() {
    let (urdf, run) = (root(KR6), root("datasets/bad/too-few-images"));
    let output = robotcal(&["identify", "--dry-run", "--robot-model", "full", "--urdf", &urdf, "--series", &run]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let numbers: Vec<usize> =
        said.lines().find(|l| l.starts_with("known")).unwrap().split(' ').filter_map(|w| w.parse().ok()).collect();
    let unknown = said.lines().filter(|l| l.starts_with("unknown")).count();
    assert!(unknown > 12, "{said}");
    assert_eq!(unknown, numbers[1] - numbers[0], "{said}");
}

#[test]
fn all_flags_that_a_board_lacks_are_named_at_once() {
    let folder = tempfile::tempdir().unwrap();
    for (kind, flags) in [
        ("charuco", ["--shape", "--pitch-mm", "--tag-mm", "--dictionary"].as_slice()),
        ("aruco-grid", &["--shape", "--tag-mm", "--gap-mm", "--dictionary"]),
        ("circle-grid", &["--shape", "--pitch-mm"]),
        ("tag", &["--tag-mm", "--dictionary"]),
    ] {
        let (output, plate) = plate(folder.path(), &["--kind", kind]);
        assert!(plate.is_none());
        assert_says(&text(&output), Code::OptionMissing, flags);
    }
}

#[test]
fn boards_that_cannot_be_drawn_are_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = root(KR6);
    let common = "format = 1\ncolumns = 9\nrows = 6\npitch_m = 0.03\ntolerance_m = 0.0001\n";
    for kind in ["charuco", "circle-grid"] {
        let plate = folder.path().join(format!("{kind}.toml"));
        std::fs::write(&plate, format!("{common}kind = \"{kind}\"\n")).unwrap();
        let out = folder.path().join(kind);
        let args = [
            "simulate",
            "--urdf",
            &urdf,
            "--plate",
            plate.to_str().unwrap(),
            "--images",
            "6",
            "--out",
            out.to_str().unwrap(),
        ];
        let output = robotcal(&args);
        assert_eq!(output.status.code(), Some(2), "{kind}: {}", text(&output));
        assert!(text(&output).contains("plate.toml") && !out.exists(), "{kind}: {}", text(&output));
        // Observations need no print.
        let output = robotcal(&[&args[..], &["--observations"]].concat());
        assert_eq!(output.status.code(), Some(0), "{kind}: {}", text(&output));
    }
}

#[test]
fn too_few_targets_of_a_plan_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (_, made) = plate(folder.path(), &["--sheet", "A4", "--markers", "100"]);
    assert!(made.is_some());
    let targets = folder.path().join("targets.csv");
    let three = ["10,-80,110,5,50,20", "20,-70,100,15,40,30", "-10,-60,90,-5,60,10"].map(str::to_owned);
    let twelve = |row: fn(usize) -> String| (0..12).map(row).collect::<Vec<_>>();
    let (urdf, out) = (root(KR6), folder.path().join("plan"));
    let plate = folder.path().join("plate/plate.toml");
    let paths = [&plate, &targets, &out].map(|path| path.to_str().unwrap());
    // Of alike ones, frame and point take up all that is wrong with the robot. The first column may name images.
    for (rows, has_images) in [
        (three.to_vec(), true),
        (three.to_vec(), false),
        (three.iter().cycle().take(12).cloned().collect(), false),
        (twelve(|k| format!("10,-60,60,5,40,{}", 20 * k as i32 - 100)), true),
        (twelve(|k| format!("{},-60,60,5,40,{}", 10 + 20 * (k / 4), 10 + 30 * (k % 4))), false),
        (twelve(|k| format!("10.{k:04},-60,60,5,40,10")), false),
    ] {
        let joints = "joint_a1,joint_a2,joint_a3,joint_a4,joint_a5,joint_a6";
        let lines =
            rows.iter().enumerate().map(|(k, r)| if has_images { format!("t{k},{r}\n") } else { format!("{r}\n") });
        let head = if has_images { format!("image,{joints}\n") } else { format!("{joints}\n") };
        std::fs::write(&targets, head + &lines.collect::<String>()).unwrap();
        let output =
            robotcal(&["plan", "--urdf", &urdf, "--plate", paths[0], "--targets", paths[1], "--out", paths[2]]);
        assert_eq!(output.status.code(), Some(2), "{rows:?} {}", text(&output));
        assert!(text(&output).contains(Code::TargetsTooFew.name()) && !out.exists(), "{rows:?} {}", text(&output));
    }
}

#[test]
fn targets_of_a_plan_in_another_unit_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (_, made) = plate(folder.path(), &["--sheet", "A4", "--markers", "100"]);
    assert!(made.is_some());
    let (urdf, out) = (root(KR6), folder.path().join("plan"));
    let plate = folder.path().join("plate/plate.toml");
    let targets = folder.path().join("targets.csv");
    let paths = [&plate, &targets, &out].map(|path| path.to_str().unwrap());
    let of = |unit: f64, flags: &[&str]| {
        let row = |k: usize| {
            let deg = [k * 7 % 60, k * 11 % 40, k * 13 % 50, k * 17 % 90, k * 19 % 70, k * 23 % 80];
            let deg = [0, 1, 2, 3, 4, 5].map(|j| deg[j] as f64 + [-30.0, -100.0, 70.0, -45.0, 10.0, -40.0][j]);
            deg.map(|deg| format!("{:.6}", deg * unit)).join(",")
        };
        let rows: Vec<String> = (0..20).map(row).collect();
        let head = "joint_a1,joint_a2,joint_a3,joint_a4,joint_a5,joint_a6";
        std::fs::write(&targets, format!("{head}\n{}\n", rows.join("\n"))).unwrap();
        let given = ["plan", "--urdf", &urdf, "--plate", paths[0], "--targets", paths[1], "--out", paths[2]];
        robotcal(&[&given, flags].concat())
    };
    let (rad, budget) = (1f64.to_radians(), ["--count", "12", "--candidates", "60"]);
    for (unit, flags, code) in [
        (rad, &[][..], Code::RadiansAsDegrees),
        (rad, &["--targets-unit", "deg"], Code::RadiansAsDegrees),
        (1.0, &["--targets-unit", "rad"], Code::DegreesAsRadians),
    ] {
        let output = of(unit, flags);
        assert_eq!(output.status.code(), Some(2), "{}", text(&output));
        assert!(text(&output).contains(code.name()) && !out.exists(), "{}", text(&output));
    }
    let plan = |unit: f64, flags: &[&str]| {
        let output = of(unit, &[&budget, flags].concat());
        assert!(out.is_dir(), "{}", text(&output));
        let joints = std::fs::read(out.join("joints.csv")).unwrap();
        std::fs::remove_dir_all(&out).unwrap();
        joints
    };
    assert_eq!(plan(1.0, &[]), plan(rad, &["--targets-unit", "rad"]));
    // A unit of nothing.
    let alone = ["plan", "--urdf", &urdf, "--plate", paths[0], "--out", paths[2], "--targets-unit", "rad"];
    assert_eq!(robotcal(&alone).status.code(), Some(2));
}

/// Programs for a robot are written by the limits.
#[test]
fn limits_in_degrees_are_refused_where_a_robot_is_to_be_moved() {
    let folder = tempfile::tempdir().unwrap();
    let text_of = std::fs::read_to_string(root(KR6)).unwrap();
    let limit = text_of.match_indices("lower=\"").last().unwrap().0;
    let (before, behind) = text_of.split_at(limit);
    let degrees = behind.split_once("/>").unwrap().1;
    let urdf = folder.path().join("degrees.urdf");
    std::fs::write(&urdf, format!("{before}lower=\"-350\" upper=\"350\" effort=\"0\" velocity=\"1\"/>{degrees}"))
        .unwrap();
    let out = folder.path().join("plan");
    let plate = root("datasets/kr6_small/plate.toml");
    let paths = [&urdf, &out].map(|path| path.to_str().unwrap());
    let output = robotcal(&["plan", "--urdf", paths[0], "--plate", &plate, "--out", paths[1]]);
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert!(text(&output).contains(Code::UrdfAngleUnit.name()) && !out.exists(), "{}", text(&output));
}

/// What a library says while it looks for the board is no word to the user.
#[test]
fn a_board_that_is_not_there_takes_two_lines() {
    let folder = tempfile::tempdir().unwrap();
    let plate = folder.path().join("plate.toml");
    let board = "format = 1\nkind = \"charuco\"\ncolumns = 9\nrows = 6\npitch_m = 0.03\ntolerance_m = 0.0001\n";
    std::fs::write(&plate, board).unwrap();
    let (out, image) = (folder.path().join("seen"), root("datasets/kr6_small/images/img_001.png"));
    let output = robotcal(&["detect", "--plate", plate.to_str().unwrap(), "--out", out.to_str().unwrap(), &image]);
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert_eq!(String::from_utf8_lossy(&output.stderr).lines().count(), 2, "{}", text(&output));
}

/// A path may hold bytes that are no text; a name may not, and is refused before anything is read or made.
#[cfg(unix)]
#[test]
fn bytes_that_are_no_text_are_taken_in_paths_and_refused_in_names_at_once() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let [made, none] = [&b"plate\xff"[..], b"none"].map(|name| folder.path().join(OsStr::from_bytes(name)));
    let mut command = Command::new(env!("CARGO_BIN_EXE_robotcal"));
    assert_eq!(command.arg("plate").arg("--out").arg(&made).output().unwrap().status.code(), Some(0));
    assert!(made.join("plate.toml").is_file());

    let shipped = |path: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    let mut command = Command::new(env!("CARGO_BIN_EXE_robotcal"));
    command.arg("identify").arg("--urdf").arg(shipped(KR6));
    command.arg("--series").arg(folder.path().join("missing_series")).arg("--out").arg(&none);
    command.arg("--fix").arg(OsStr::from_bytes(b"joint_1\xff.offset"));
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    // The series is not even missed.
    assert!(!text(&output).contains("missing_series") && !none.exists(), "{}", text(&output));
}

/// The place of a recording is tried before the series is read: a series that does not exist is not even missed.
#[test]
fn a_recording_that_cannot_be_written_is_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    std::fs::write(at("file"), "mine").unwrap();
    std::fs::write(at("old.mcap"), "mine").unwrap();
    let urdf = kr6_urdf();
    for (to, named) in [("file/run.mcap", "file"), ("old.mcap", "old.mcap")] {
        let output = robotcal(&["convert", &at("missing_series"), &at(to), "--urdf", urdf.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(2));
        assert!(text(&output).contains(&at(named)) && !text(&output).contains("missing_series"), "{}", text(&output));
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    assert_eq!(std::fs::read(at("old.mcap")).unwrap(), b"mine");
}

#[test]
fn poses_need_no_robot_and_no_joint_values() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run1");
    std::fs::create_dir(&run).unwrap();
    for file in ["observations.csv", "plate.toml", "plate.csv"] {
        std::fs::copy(root(&format!("datasets/ur10e_observations/{file}")), run.join(file)).unwrap();
    }
    let manifest = std::fs::read_to_string(root("datasets/ur10e_observations/series.toml")).unwrap();
    let without: Vec<&str> = manifest.lines().filter(|l| !l.starts_with("joint_unit")).collect();
    std::fs::write(run.join("series.toml"), without.join("\n")).unwrap();
    let out = folder.path().join("poses");
    let [series, out] = [&run, &out].map(|path| path.to_str().unwrap());
    let output = robotcal(&["poses", "--series", series, "--out", out]);
    assert!(output.status.success(), "{}", text(&output));
    let poses = std::fs::read_to_string(Path::new(out).join("poses.csv")).unwrap();
    let images: BTreeSet<&str> = poses.lines().skip(1).filter_map(|l| l.split(',').next()).collect();
    let observed = std::fs::read_to_string(run.join("observations.csv")).unwrap();
    let expected: BTreeSet<&str> = observed.lines().skip(1).filter_map(|l| l.split(',').next()).collect();
    assert_eq!(images, expected);
    // An earlier result stays where there is nothing to look at.
    std::fs::remove_file(run.join("plate.toml")).unwrap();
    let output = robotcal(&["poses", "--series", series, "--out", out]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output).starts_with("error[file_missing]: "), "{}", text(&output));
    assert_eq!(std::fs::read_to_string(Path::new(out).join("poses.csv")).unwrap(), poses);
}

#[test]
fn a_series_of_two_placements_makes_no_recording() {
    let folder = tempfile::tempdir().unwrap();
    let series = folder.path().join("run");
    std::fs::create_dir_all(series.join("images")).unwrap();
    let dataset = Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/kr6_small");
    for name in ["series.toml", "plate.toml", "plate.csv", "images/img_000.png", "images/img_001.png"] {
        std::fs::copy(dataset.join(name), series.join(name)).unwrap();
    }
    let joints = std::fs::read_to_string(dataset.join("joints.csv")).unwrap();
    let rows: Vec<&str> = joints.lines().take(3).collect();
    let urdf = root(KR6);
    for (second, status) in [("a", 0), ("b", 2)] {
        let placed: String =
            rows.iter().zip(["placement", "a", second]).map(|(row, p)| format!("{row},{p}\n")).collect();
        std::fs::write(series.join("joints.csv"), placed).unwrap();
        let recording = folder.path().join(format!("{second}.mcap"));
        let [from, to] = [&series, &recording].map(|path| path.to_str().unwrap());
        let output = robotcal(&["convert", from, to, "--urdf", &urdf]);
        assert_eq!(output.status.code(), Some(status), "{}", text(&output));
        assert_eq!(recording.exists(), status == 0);
    }
}

/// The others are converted, and the exit code says that it is not all.
#[test]
fn images_that_cannot_be_decoded_are_left_out_of_a_recording_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let series = folder.path().join("run");
    std::fs::create_dir_all(series.join("images")).unwrap();
    let dataset = Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/kr6_small");
    let images = [0, 1, 2, 3, 4, 5].map(|k| format!("images/img_00{k}.png"));
    for name in ["series.toml", "plate.toml", "plate.csv"].into_iter().chain(images.iter().map(String::as_str)) {
        std::fs::copy(dataset.join(name), series.join(name)).unwrap();
    }
    let joints = std::fs::read_to_string(dataset.join("joints.csv")).unwrap();
    let rows: Vec<&str> = joints.lines().take(1 + images.len()).collect();
    std::fs::write(series.join("joints.csv"), rows.join("\n") + "\n").unwrap();
    let whole = std::fs::read(series.join(&images[1])).unwrap();
    let urdf = root(KR6);
    let convert = |from: &Path, to: &str| {
        let to = folder.path().join(to);
        let output = robotcal(&["convert", from.to_str().unwrap(), to.to_str().unwrap(), "--urdf", &urdf]);
        (output, to)
    };
    std::fs::write(series.join(&images[1]), &whole[..whole.len() / 2]).unwrap();
    std::fs::write(series.join(&images[3]), "no image").unwrap();
    let (output, recording) = convert(&series, "some.mcap");
    assert_eq!(output.status.code(), Some(1), "{}", text(&output));
    for (image, is_named) in images.iter().zip([false, true, false, true, false, false]) {
        assert_eq!(text(&output).contains(image.as_str()), is_named, "{}", text(&output));
    }
    assert!(text(&output).contains("[image_unreadable]"), "{}", text(&output));
    let (output, back) = convert(&recording, "back");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output));
    let converted = std::fs::read_to_string(back.join("joints.csv")).unwrap();
    assert_eq!(converted.lines().count(), 5, "{converted}");
    for image in &images {
        std::fs::write(series.join(image), "").unwrap();
    }
    let (output, recording) = convert(&series, "none.mcap");
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert!(!recording.exists());
}

/// A camera that is given needs no other views.
#[test]
fn one_image_and_a_held_camera_give_a_pose() {
    let folder = tempfile::tempdir().unwrap();
    let [plate, image] = ["plate.toml", "images/img_000.png"].map(|name| root(&format!("datasets/kr6_small/{name}")));
    let (camera, out) = (root("reports/kr6_small/camera.yaml"), folder.path().join("poses"));
    let given = ["--camera-file", &camera, "--hold-camera"];
    for (given, status) in [(&given[..], 0), (&[], 3)] {
        let output = robotcal(&[&["poses", "--plate", &plate, &image, "--out", out.to_str().unwrap()], given].concat());
        assert_eq!(output.status.code(), Some(status), "{}", text(&output));
    }
}

/// The scale hangs on both, and nothing else says that one of them is wrong.
#[test]
fn tags_of_another_size_beside_their_distance_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let [plate, series] = ["plate", "series"].map(|name| folder.path().join(name).to_str().unwrap().to_owned());
    let file = format!("{plate}/plate.toml");
    let drawn = robotcal(&[
        "plate",
        "--kind",
        "aprilgrid",
        "--shape",
        "6x5",
        "--tag-mm",
        "30",
        "--sheet",
        "A2",
        "--out",
        &plate,
    ]);
    assert!(drawn.status.success(), "{}", text(&drawn));
    let urdf = root(KR6);
    let seen = ["--plate", &file, "--observations", "--images", "12", "--held-out", "0", "--out", &series];
    let simulated = robotcal(&[&["simulate", "--urdf", &urdf][..], &seen].concat());
    assert!(simulated.status.success(), "{}", text(&simulated));
    let stated = std::fs::read_to_string(&file).unwrap();
    for (spacing, is_named) in [("0.3", false), ("0.305", true), ("0.295", true)] {
        let other = stated.replace("spacing = 0.3\n", &format!("spacing = {spacing}\n"));
        assert_eq!(other != stated, is_named);
        std::fs::write(format!("{series}/plate.toml"), other).unwrap();
        let out = folder.path().join(spacing);
        let output = robotcal(&["poses", "--series", &series, "--out", out.to_str().unwrap()]);
        assert!(output.status.success(), "{}", text(&output));
        let found = std::fs::read_to_string(out.join("poses.json")).unwrap();
        assert_eq!(found.contains(Code::TagsOff.name()), is_named, "{spacing}: {}", text(&output));
    }
}

/// What moves makes the noise larger than it is: it is named, and the true noise is not blamed.
#[test]
fn a_loose_camera_is_named_also_where_the_joint_noise_is_stated() {
    let repo = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (urdf, series) = (kr6_urdf(), repo.join("datasets/bad/loose-camera"));
    let folder = tempfile::tempdir().unwrap();
    let [urdf, series, out] =
        [&urdf, &series, &folder.path().join("out")].map(|path| path.to_str().unwrap().to_owned());
    let base = ["identify", "--urdf", &urdf, "--series", &series, "--out", &out];
    for noise in [&["--joint-noise", "0.00002"][..], &[]] {
        let output = robotcal(&[&base[..], noise].concat());
        assert_eq!(output.status.code(), Some(1), "{}", text(&output));
        let solution = std::fs::read(Path::new(&out).join("solution.json")).unwrap();
        let solution: serde_json::Value = serde_json::from_slice(&solution).unwrap();
        let codes: Vec<_> = solution["findings"].as_array().unwrap().iter().map(|f| &f["code"]).collect();
        assert!(codes.iter().any(|code| *code == "loose_mounting"), "{codes:?}");
        assert!(codes.iter().all(|code| *code != "joint_noise_contradicted"), "{codes:?}");
    }
}

/// Readings that err by 0.3 mrad, taken as exact: the fits without some of the images are no good, and images there are enough of.
#[test]
fn a_joint_noise_stated_too_small_is_to_be_left_out() {
    let repo = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (urdf, series) = (repo.join("robots/ur10e/ur10e.urdf"), repo.join("datasets/ur10e_observations"));
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let [urdf, series, out] = [&urdf, &series, &out].map(|path| path.to_str().unwrap());
    let output = robotcal(&["identify", "--urdf", urdf, "--series", series, "--out", out, "--joint-noise", "0", "-q"]);
    let said = text(&output);
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.starts_with("error[nothing_held_out]: ") && said.contains("--joint-noise"), "{said}");
}

/// `show` and `show --all` say the same of a result, and why.
#[test]
fn the_long_table_has_the_verdict_of_the_answer() {
    let folder = tempfile::tempdir().unwrap();
    let mut record: serde_json::Value =
        serde_json::from_slice(&std::fs::read(root("reports/kr6_small/solution.json")).unwrap()).unwrap();
    let doubts = ["urdf_mass_placeholder", "recording_damaged"];
    for count in 0..=doubts.len() {
        let notice = |code: &&str| serde_json::json!({"code": code, "place": "p", "what": *code, "remedy": "r"});
        record["notices"] = doubts[..count].iter().map(notice).collect();
        let path = folder.path().join("solution.json");
        std::fs::write(&path, serde_json::to_vec(&record).unwrap()).unwrap();
        let of = |args: &[&str]| {
            let output = robotcal(&[&["show", path.to_str().unwrap()], args].concat());
            assert_eq!(output.status.code(), Some(0), "{}", text(&output));
            String::from_utf8_lossy(&output.stdout).into_owned()
        };
        let (short, long) = (of(&[]), of(&["--all"]));
        assert_eq!(short.lines().next(), long.lines().next());
        let reasons = long.lines().skip(1).take_while(|l| l.trim_start().starts_with("- ")).count();
        assert_eq!(reasons, count, "{long}");
    }
}

/// What asks the result a question is read before the work that the result costs.
#[test]
fn a_table_of_readings_that_cannot_be_used_is_refused_before_the_fit() {
    let folder = tempfile::tempdir().unwrap();
    let (urdf, series) = (root("robots/ur10e/ur10e.urdf"), root("datasets/ur10e_observations"));
    let [missing, bad, out] = ["missing.csv", "bad.csv", "out"].map(|name| folder.path().join(name));
    std::fs::write(&bad, "a,b\n1,2\n").unwrap();
    for (table, code) in [(missing, Code::FileMissing), (bad, Code::CsvColumnMissing)] {
        let table = table.to_str().unwrap();
        let common = ["identify", "--urdf", &urdf, "--series", &series, "--out", out.to_str().unwrap()];
        let output = robotcal(&[&common[..], &["--at", table, "--at-unit", "deg"]].concat());
        assert_eq!(output.status.code(), Some(2), "{}", text(&output));
        assert_says(&text(&output), code, &[table]);
        assert!(!out.join("solution.json").exists(), "{}", text(&output));
    }
}

#[test]
fn more_threads_than_serve_any_purpose_are_not_started() {
    let output = robotcal(&["--threads", "5000", "show", &root("reports/kr6_small/solution.json")]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output));
}

/// Only images of a plate tell how it seems to be tilted.
#[test]
fn a_series_without_images_has_no_tilt_of_the_plate() {
    let bytes = std::fs::read(root("reports/kr6_small/solution.json")).unwrap();
    let mut record = robotcal::output::solution_json::read(&bytes).unwrap();
    // What is displaced stands behind the joints, after a semicolon.
    let parts = |printed: String| printed.lines().find(|l| l.starts_with("joints")).unwrap().split("; ").count();
    assert_eq!(parts(robotcal::cli::summary_of(&record)), 2);
    record.series[0].name = "tracker".into();
    assert_eq!(parts(robotcal::cli::summary_of(&record)), 1);
}

/// Wide lenses on clean data: one whose numerator and denominator nearly say the same comes to an end, and one that ROS has no model for is written.
#[test]
fn wide_lenses_without_noise_of_any_kind_are_no_lost_result() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let urdf = root(KR6);
    let made = |lens: &str, images: &str| {
        let common = ["simulate", "--urdf", &urdf, "--observations", "--field-deg", "75", "--seed", "4", "-q"];
        let output = robotcal(&[&common[..], &["--images", images, "--lens", lens, "--out", &path(lens)]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output));
        path(lens)
    };
    let (series, out) = (made("rational", "25"), path("found"));
    let output =
        robotcal(&["identify", "--urdf", &urdf, "--series", &series, "--camera", "rational", "--out", &out, "-q"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output));
    let record = robotcal::output::solution_json::read(&std::fs::read(path("found/solution.json")).unwrap()).unwrap();
    let parameters = &record.cameras[0].parameters;
    let k6 = parameters.iter().find(|(name, _)| name == "k6").unwrap().1;
    assert!((k6 - 0.012).abs() < 0.1, "far from its pole: {k6}");

    let (series, out) = (made("thin_prism", "50"), path("poses"));
    let output = robotcal(&["poses", "--series", &series, "--camera", "thin_prism", "--out", &out, "-q"]);
    assert!(matches!(output.status.code(), Some(0 | 1)), "{}", text(&output));
    assert!(folder.path().join("poses/poses.csv").is_file());
}
