//! `robotcal verify --series`: the same stops by joint readings and by the poses that the controller computes of them.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use robotcal::Code;

use crate::program::robotcal;
use crate::robots::kr6_urdf;
use crate::support::by_poses::with_poses;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The series of the shipped report with what it observed in the place of images.
fn observed(into: &Path) -> PathBuf {
    let (of, folder) = (root().join("datasets/kr6_small"), into.join("joints"));
    std::fs::create_dir(&folder).unwrap();
    for name in ["joints.csv", "plate.csv", "plate.toml"] {
        std::fs::copy(of.join(name), folder.join(name)).unwrap();
    }
    let settings = std::fs::read_to_string(of.join("series.toml")).unwrap();
    let size = image::image_dimensions(of.join("images/img_000.png")).unwrap();
    let camera = format!("{settings}[camera]\nwidth_px = {}\nheight_px = {}\n", size.0, size.1);
    std::fs::write(folder.join("series.toml"), camera).unwrap();
    let all = std::fs::read_to_string(root().join("reports/kr6_small/observations.csv")).unwrap();
    let mut table = String::from("image,marker,u,v,edge,cov_uu,cov_uv,cov_vv\n");
    for line in all.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        writeln!(table, "{}", cells[..8].join(",")).unwrap();
    }
    std::fs::write(folder.join("observations.csv"), table).unwrap();
    folder
}

#[test]
fn poses_of_a_controller_judge_a_model_as_the_readings_do() {
    let urdf = kr6_urdf();
    let report = root().join("reports/kr6_small");
    let folder = tempfile::tempdir().unwrap();
    let joints = observed(folder.path());
    let poses = folder.path().join("poses");
    std::fs::create_dir(&poses).unwrap();
    for entry in std::fs::read_dir(&joints).unwrap().map(Result::unwrap) {
        std::fs::copy(entry.path(), poses.join(entry.file_name())).unwrap();
    }
    with_poses(&poses, &urdf, true);
    let judged = |series: &Path, nominal: Option<&Path>| -> Output {
        let mut command = Command::cargo_bin("robotcal").unwrap();
        command.arg("verify").arg("--urdf").arg(report.join("kuka_kr6_r900.calibrated.urdf"));
        command.arg("--compensation").arg(report.join("compensation.toml")).arg("--series").arg(series);
        if let Some(file) = nominal {
            command.arg("--nominal").arg(file);
        }
        command.output().unwrap()
    };
    let of_readings = judged(&joints, Some(&urdf));
    let text = String::from_utf8_lossy(&of_readings.stdout);
    println!("{text}");
    assert!(of_readings.status.success(), "{}", String::from_utf8_lossy(&of_readings.stderr));
    assert_eq!(String::from_utf8_lossy(&judged(&poses, Some(&urdf)).stdout), text);
    // The model in the controller is needed then, and a robot of other joints is not it.
    assert_eq!(judged(&joints, None).status.code(), Some(0));
    let codes = [None, Some(root().join("robots/ur10e/ur10e.urdf"))].map(|nominal| {
        let found = judged(&poses, nominal.as_deref());
        println!("{}", String::from_utf8_lossy(&found.stderr));
        found.status.code()
    });
    assert_eq!(codes, [Some(2); 2]);
}

/// Exit code, the codes of what is said, and the error of the model, mm RMS.
fn verdict(urdf: &Path, series: &Path, flags: &[&str]) -> (Option<i32>, Vec<Code>, f64) {
    let [urdf, series] = [urdf, series].map(|p| p.to_str().unwrap());
    let output = robotcal(&[&["verify", "--urdf", urdf, "--series", series], flags].concat());
    let text = String::from_utf8(output.stdout).unwrap();
    let model = text.lines().find(|line| line.starts_with("model"));
    let mm = model.and_then(|line| line.rsplit_once(": ")?.1.split(' ').next()?.parse().ok());
    (output.status.code(), codes(&text), mm.unwrap_or(f64::NAN))
}

/// What stands in brackets behind notes and gates.
pub fn codes(text: &str) -> Vec<Code> {
    let name = |line: &str| Some(line.strip_suffix(']')?.rsplit_once('[')?.1.to_owned());
    let of = |name: String| Code::ALL.iter().copied().find(|code| code.name() == name);
    text.lines().filter_map(name).filter_map(of).collect()
}

/// A series of 20 stops of a robot with these errors beside its URDF.
fn simulated(urdf: &Path, out: &Path, errors: &str, flags: &[&str]) -> PathBuf {
    let [urdf, folder] = [urdf, out].map(|p| p.to_str().unwrap());
    let of = ["simulate", "--urdf", urdf, "--out", folder, "--observations", "--images", "20", "--errors", errors];
    assert!(robotcal(&[&of, flags].concat()).status.success());
    out.to_path_buf()
}

/// The zero of a joint is another: everything was seen where the readings of the controller are not.
fn with_other_zero(series: &Path, joint: &str, deg: f64) {
    let path = series.join("joints.csv");
    let text = std::fs::read_to_string(&path).unwrap();
    let (head, rows) = text.split_once('\n').unwrap();
    let column = head.split(',').position(|name| name == joint).unwrap();
    let shifted = |row: &str| {
        let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
        cells[column] = (cells[column].parse::<f64>().unwrap() + deg).to_string();
        cells.join(",")
    };
    let rows: Vec<String> = rows.lines().map(shifted).collect();
    std::fs::write(path, format!("{head}\n{}\n", rows.join("\n"))).unwrap();
}

/// A robot that changed since it was identified, or a series that is at fault, is not a good model for being better than the nominal one.
#[test]
fn a_model_that_misses_more_than_its_solution_states_is_not_trusted() {
    let nominal = kr6_urdf();
    let urdf = root().join("reports/kr6_small/kuka_kr6_r900.calibrated.urdf");
    let compared = ["--nominal", nominal.to_str().unwrap()];
    let folder = tempfile::tempdir().unwrap();
    let same = simulated(&urdf, &folder.path().join("same"), "none", &[]);
    let changed = simulated(&urdf, &folder.path().join("changed"), "none", &["--seed", "2"]);
    with_other_zero(&changed, "joint_a3", 2e-3f64.to_degrees());
    let moved = simulated(&urdf, &folder.path().join("moved"), "none", &["--fault", "moved-plate"]);
    for flags in [&compared[..], &[]] {
        let (exit, said, mm) = verdict(&urdf, &same, flags);
        assert_eq!((exit, said), (Some(0), vec![]));
        assert!(mm < 0.1, "{mm}");
        let (exit, said, mm) = verdict(&urdf, &changed, flags);
        assert_eq!(exit, Some(1));
        assert!(said.contains(&Code::StatedExceeded) && mm > 0.5, "{said:?} {mm}");
        let (exit, said, _) = verdict(&urdf, &moved, flags);
        assert_eq!(exit, Some(1));
        assert!(said.contains(&Code::StatedExceeded) && said.contains(&Code::PlateDisplaced), "{said:?}");
    }
    // Of another robot no solution says anything, and nothing is compared.
    let other = simulated(&nominal, &folder.path().join("other"), "rigid", &[]);
    let (exit, said, mm) = verdict(&nominal, &other, &[]);
    assert_eq!((exit, said), (Some(1), vec![Code::NotCorrected]));
    assert!(mm > 1.0, "{mm}");
}

/// A robot whose links are all too long or too short sees the plate as large as that, and misses no image: the size that the plate has tells.
#[test]
fn a_model_of_another_size_than_the_plate_is_not_trusted() {
    let urdf = root().join("reports/kr6_small/kuka_kr6_r900.calibrated.urdf");
    let nominal = kr6_urdf();
    let folder = tempfile::tempdir().unwrap();
    let series = simulated(&urdf, &folder.path().join("same"), "none", &[]);
    let plate = series.join("plate.csv");
    let table = std::fs::read_to_string(&plate).unwrap();
    let (head, rows) = table.split_once('\n').unwrap();
    for (size, is_trusted) in [(1.0001, true), (1.002, false), (0.998, false)] {
        let scaled = |row: &str| {
            let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
            cells[1..3].iter_mut().for_each(|cell| *cell = (size * cell.parse::<f64>().unwrap()).to_string());
            cells.join(",")
        };
        let rows: Vec<String> = rows.lines().map(scaled).collect();
        std::fs::write(&plate, format!("{head}\n{}\n", rows.join("\n"))).unwrap();
        for flags in [&["--nominal", nominal.to_str().unwrap()][..], &[]] {
            let (exit, said, mm) = verdict(&urdf, &series, flags);
            println!("{size}: {exit:?} {said:?} {mm} mm");
            assert_eq!(said.contains(&Code::PlateSizeContradicted), !is_trusted, "{size}: {said:?}");
            assert_eq!(exit, Some(i32::from(!is_trusted)), "{size}: {said:?}");
        }
    }
}

/// What a robot misses is what it misses with its own zeros: those that would fit are said, and are not its merit. A robot that others are compared
/// with is not judged.
#[test]
fn a_model_is_judged_with_the_zeros_that_it_has() {
    let nominal = kr6_urdf();
    let urdf = root().join("reports/kr6_small/kuka_kr6_r900.calibrated.urdf");
    let folder = tempfile::tempdir().unwrap();
    let same = simulated(&urdf, &folder.path().join("same"), "none", &[]);
    // Where its third joint is at zero, another one turns the links behind it.
    let text = std::fs::read_to_string(&nominal).unwrap();
    let own = "<origin xyz=\"0.455 0 0\" rpy=\"0 0 0\"/>";
    assert_eq!(text.matches(own).count(), 1);
    let turned = folder.path().join("turned.urdf");
    std::fs::write(&turned, text.replace(own, "<origin xyz=\"0.455 0 0\" rpy=\"0 0.35 0\"/>")).unwrap();
    let (exit, said, mm) = verdict(&urdf, &same, &["--nominal", turned.to_str().unwrap()]);
    assert_eq!((exit, said), (Some(0), vec![]));
    assert!(mm < 0.1, "{mm}");
    let shifted = simulated(&urdf, &folder.path().join("shifted"), "none", &[]);
    with_other_zero(&shifted, "joint_a2", 25.0);
    with_other_zero(&shifted, "joint_a3", -12.0);
    for flags in [&["--nominal", nominal.to_str().unwrap()][..], &[]] {
        let (exit, said, mm) = verdict(&urdf, &shifted, flags);
        assert_eq!((exit, said), (Some(1), vec![Code::ZeroOff; 2]));
        assert!(mm.is_nan(), "{mm}");
    }
    // Nor is it refused for want of a figure: by less than keeps camera and plate from being fitted it misses by that.
    let little = simulated(&urdf, &folder.path().join("little"), "none", &[]);
    with_other_zero(&little, "joint_a4", 3.0);
    let (exit, said, mm) = verdict(&urdf, &little, &[]);
    assert_eq!(exit, Some(1));
    assert!(said.contains(&Code::StatedExceeded) && mm > 1.0, "{said:?} {mm}");
}

/// The same stops of the same robot, measured again.
fn measured_again(series: &Path, into: &Path) -> PathBuf {
    observations_rewritten(series, into, 1e-3)
}

/// A series with `u` of its observations moved to and fro by so much, px, and with other bytes in each of its files of measurements.
fn observations_rewritten(series: &Path, into: &Path, by_px: f64) -> PathBuf {
    std::fs::create_dir(into).unwrap();
    for entry in std::fs::read_dir(series).unwrap().map(Result::unwrap) {
        std::fs::copy(entry.path(), into.join(entry.file_name())).unwrap();
    }
    let observations = std::fs::read_to_string(into.join("observations.csv")).unwrap();
    let (head, rows) = observations.split_once('\n').unwrap();
    let column = head.split(',').position(|name| name == "u").unwrap();
    let seen_again = |(k, row): (usize, &str)| {
        let mut fields: Vec<String> = row.split(',').map(str::to_owned).collect();
        let u: f64 = fields[column].parse().unwrap();
        fields[column] = (u + if k % 2 == 0 { by_px } else { -by_px }).to_string();
        fields.join(",") + "\n"
    };
    let rows: String = rows.lines().enumerate().map(seen_again).collect();
    std::fs::write(into.join("observations.csv"), format!("{head}\r\n{rows}")).unwrap();
    into.to_path_buf()
}

/// The offsets of the result are entered in the controller: its readings are those before or after.
#[test]
fn readings_to_a_mastered_robot_are_taken_one_way_for_all_folders() {
    let nominal = kr6_urdf();
    let folder = tempfile::tempdir().unwrap();
    let series = simulated(&nominal, &folder.path().join("series"), "rigid", &[]);
    let out = folder.path().join("result");
    let [urdf, of, into] = [&nominal, &series, &out].map(|p| p.to_str().unwrap());
    // Far off, so that it is determined, and within the limits of the joint.
    with_other_zero(&series, "joint_a3", -1.0);
    let model = ["--robot-model", "rigid", "--offsets", "mastering", "--out", into];
    robotcal(&[&["identify", "--urdf", urdf, "--series", of], &model[..]].concat());
    let corrected = out.join("kuka_kr6_r900.calibrated.urdf");
    let again = measured_again(&series, &folder.path().join("again"));
    let also = again.to_str().unwrap();
    // Others than those of the result are taken with the offsets entered: where nobody entered them, that is what is said.
    let (exit, said, _) = verdict(&corrected, &again, &[]);
    assert_eq!(exit, Some(1));
    assert!(said.contains(&Code::ReadingsOfOtherZeros) && !said.contains(&Code::ZeroMoved), "{said:?}");
    let judged = |flags: &[&str]| verdict(&corrected, &series, &[flags, &["--nominal", urdf]].concat());
    let (_, _, own) = judged(&[]);
    let (_, _, entered) = judged(&["--readings", "after"]);
    assert!(entered > 2.0 * own, "{own} {entered}");
    // One was an input of the result and the other was not.
    assert_eq!(judged(&[also]).0, Some(2));
    let (exit, _, both) = judged(&[also, "--readings", "before"]);
    assert_eq!(exit, Some(0));
    assert!((both - own).abs() < 0.1 * own, "{own} {both}");
    // Poses of the controller are readings, too; some images are told apart, and the others differ.
    let poses = measured_again(&series, &folder.path().join("poses"));
    with_poses(&poses, &nominal, true);
    let (_, _, by_poses) = verdict(&corrected, &poses, &["--nominal", urdf, "--readings", "before"]);
    assert!(by_poses < 2.0 * own, "{own} {by_poses}");
    // Where the URDF holds all offsets, the flag means nothing.
    let report = root().join("reports/kr6_small/kuka_kr6_r900.calibrated.urdf");
    assert_eq!(verdict(&report, &series, &["--readings", "after"]).0, Some(2));
    let other = verdict(&report, &series, &[]).0;
    assert!(other != Some(2), "{other:?}");
    // Nor where the plate of the solution is the work object and nothing was touched.
    let [solution, frames] = ["result/solution.json", "frames"].map(|p| folder.path().join(p).display().to_string());
    let plate = ["frames", "--from", &solution, "--plate", "--out", &frames];
    assert_ne!(robotcal(&plate).status.code(), Some(2));
    assert_eq!(robotcal(&[&plate[..], &["--readings", "after"]].concat()).status.code(), Some(2));
}

#[test]
fn the_series_that_a_model_was_fitted_to_proves_nothing() {
    let nominal = kr6_urdf();
    let folder = tempfile::tempdir().unwrap();
    let series = simulated(&nominal, &folder.path().join("series"), "rigid", &[]);
    let out = folder.path().join("result");
    let [urdf, of, into] = [&nominal, &series, &out].map(|p| p.to_str().unwrap());
    assert!(
        robotcal(&["identify", "--urdf", urdf, "--series", of, "--robot-model", "rigid", "--out", into])
            .status
            .success()
    );
    let corrected = out.join("kuka_kr6_r900.calibrated.urdf");
    let own = verdict(&corrected, &series, &["--nominal", urdf]);
    assert_eq!((own.0, own.1), (Some(0), vec![Code::OwnMeasurement]));
    // In a file of other bytes.
    let rewritten = observations_rewritten(&series, &folder.path().join("rewritten"), 0.0);
    let own = verdict(&corrected, &rewritten, &["--nominal", urdf]);
    assert_eq!((own.0, own.1), (Some(0), vec![Code::OwnMeasurement]));
    let again = measured_again(&series, &folder.path().join("again"));
    let other = verdict(&corrected, &again, &["--nominal", urdf]);
    assert_eq!((other.0, other.1), (Some(0), vec![]));
}

/// Noise never puts a marker in the same place twice: a picture in another format is the same exposure.
#[test]
fn pictures_in_another_format_are_no_second_measurement() {
    let nominal = kr6_urdf();
    let folder = tempfile::tempdir().unwrap();
    let [png, bmp, first, last] = ["png", "bmp", "first", "last"].map(|name| folder.path().join(name));
    let [urdf, of] = [&nominal, &png].map(|p| p.to_str().unwrap());
    let simulated = ["simulate", "--urdf", urdf, "--out", of, "--images", "24", "--errors", "rigid"];
    assert!(robotcal(&simulated).status.success());
    let encoded = |into: &Path, stops: std::ops::Range<usize>, format: &str| {
        std::fs::create_dir_all(into.join("images")).unwrap();
        for name in ["series.toml", "plate.toml", "plate.csv"] {
            std::fs::copy(png.join(name), into.join(name)).unwrap();
        }
        let joints = std::fs::read_to_string(png.join("joints.csv")).unwrap();
        let (head, rows) = joints.split_once('\n').unwrap();
        let rows: Vec<&str> = rows.lines().skip(stops.start).take(stops.len()).collect();
        std::fs::write(into.join("joints.csv"), format!("{head}\n{}\n", rows.join("\n")).replace(".png", format))
            .unwrap();
        for row in &rows {
            let name = row.split(',').next().unwrap();
            let picture = image::open(png.join("images").join(name)).unwrap();
            picture.save(into.join("images").join(name.replace(".png", format))).unwrap();
        }
    };
    encoded(&bmp, 0..24, ".bmp");
    encoded(&first, 0..16, ".png");
    encoded(&last, 8..24, ".bmp");
    let [of_bmp, of_first, of_last] = [&bmp, &first, &last].map(|p| p.to_str().unwrap());
    let identify = |series: &[&str], out: &str| {
        let into = folder.path().join(out);
        let flags = ["identify", "--urdf", urdf, "--robot-model", "rigid", "--out", into.to_str().unwrap(), "--series"];
        (robotcal(&[&flags[..], series].concat()), into)
    };
    let twice = identify(&[of, of_bmp], "twice").0;
    let said = String::from_utf8_lossy(&twice.stderr).into_owned();
    assert_eq!(twice.status.code(), Some(2), "{said}");
    assert!(said.contains(&format!("error[{}]", Code::SeriesRepeated.name())), "{said}");
    // What both have counts once.
    let (_, both) = identify(&[of_first, of_last], "both");
    let solution: serde_json::Value =
        serde_json::from_slice(&std::fs::read(both.join("solution.json")).unwrap()).unwrap();
    assert_eq!([&solution["statistics"]["images"], &solution["statistics"]["images_used"]], [32, 24]);
    let (_, once) = identify(&[of], "once");
    let judged = verdict(&once.join("kuka_kr6_r900.calibrated.urdf"), &bmp, &["--nominal", urdf]);
    assert_eq!(judged.1, vec![Code::OwnMeasurement]);
}
