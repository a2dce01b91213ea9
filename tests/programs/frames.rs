//! Tool and work object from touches: closed form, covariance, outliers, what cannot be told, and programs that use them.

use std::path::{Path, PathBuf};
use std::process::Command;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robotcal::assess::Limits;
use robotcal::diagnose::{Finding, Weight};
use robotcal::error::Code;
use robotcal::frames::{Given, KnownRobot, TouchPlace, Touches, fit};
use robotcal::geom::Pose;
use robotcal::identify::{mirror_image, touch_mistake};
use robotcal::model::inverse::{reading_limits, solve_from};
use robotcal::model::robot::{Posture, Robot};
use robotcal::output::frame_findings::frame_findings;
use robotcal::output::frames_record::{self, ToolKind};
use robotcal::output::restore::{found_model, robot_description};
use robotcal::output::solution_json;
use robotcal::output::work_findings::from_below;
use robotcal::simulate::truth::Truth;

use crate::programs_support::touching::{Toucher, ranges, spread, write};
use crate::programs_support::{Run, findings};
use crate::robots::{KR6, kr6_and_positioner, positioner, repo};
use crate::said::assert_says;

const TOOL: [f64; 3] = [0.012, -0.02, 0.11];

/// The robot of reports/kr6_small, as found and as it is.
struct World {
    robot: KnownRobot,
    truth: Robot,
}

fn world() -> World {
    let record = solution_json::read(&std::fs::read(repo("reports/kr6_small/solution.json")).unwrap()).unwrap();
    let found = found_model(&record).unwrap();
    let truth = Truth::read(&repo("datasets/kr6_small/truth.toml")).unwrap();
    World { truth: truth.robot(&found.robot.chain).unwrap(), robot: found.known_robot(None).unwrap() }
}

fn work() -> Pose {
    Pose::from_xyz_rpy([0.45, -0.1, 0.2], [0.02, -0.03, 0.7])
}

fn rng(seed: u64) -> ChaCha8Rng {
    println!("seed {seed}");
    ChaCha8Rng::seed_from_u64(seed)
}

/// A robot that is as it was found, and touches without any noise.
fn exact<'a>(robot: &'a Robot) -> Toucher<'a> {
    Toucher { truth: robot, work: work(), tool: TOOL.into(), sigma_m: 0.0, joint_sigma: 0.0 }
}

/// Touches of one unknown point: postures that bring the tool there, the tip turned every way.
fn one_point(robot: &Robot, start: &[f64], count: usize, rng: &mut ChaCha8Rng) -> Touches {
    let limits = reading_limits(&robot.chain);
    let tool = Pose::new(Matrix3::identity(), TOOL.into());
    let first = robot.base_from_tip(start) * tool;
    let mut found: Vec<Vec<f64>> = Vec::new();
    while found.len() < count {
        let turn = spread(&[(-0.6, 0.6); 3], 1, rng).remove(0);
        let wanted = first * Pose::from_xyz_rpy([0.0; 3], [turn[0], turn[1], turn[2]]) * tool.inverse();
        found.extend(solve_from(robot, &limits, &wanted, start));
    }
    let toucher = exact(robot);
    let mut touches = toucher.places(&found, "unused", rng);
    touches.frame = None;
    touches.contacts = vec!["pin".into()];
    touches.all.iter_mut().for_each(|t| t.seen = TouchPlace::Unknown(0));
    touches
}

const START: [f64; 6] = [0.2, -1.2, 1.5, 0.3, 0.8, 0.1];

#[test]
fn a_tool_without_noise_is_that_of_the_closed_form() {
    let World { robot, .. } = world();
    let mut rng = rng(1);
    let touches = one_point(robot.exported(), &START, 6, &mut rng);
    let found = fit(&robot, &touches, &Given::default(), &Limits::default()).unwrap();
    // R_j t - w = -p_j, by a solver of its own.
    let (mut a, mut b) = (DMatrix::zeros(18, 6), DVector::zeros(18));
    for (k, p) in touches.postures.iter().enumerate() {
        let tip = robot.exported().base_from_tip(&p.readings);
        a.view_mut((3 * k, 0), (3, 3)).copy_from(&tip.rotation);
        a.view_mut((3 * k, 3), (3, 3)).copy_from(&-Matrix3::identity());
        b.rows_mut(3 * k, 3).copy_from(&-tip.translation);
    }
    let closed = a.svd(true, true).solve(&b, 1e-14).unwrap();
    let tool = found.tools[0].translation;
    let apart = (tool - Vector3::new(closed[0], closed[1], closed[2])).norm();
    assert!(apart < 1e-9, "{apart:.1e} m from the closed form");
    assert!((tool - Vector3::from(TOOL)).norm() < 1e-9);
    assert!(found.work.is_none() && found.rms_m < 1e-9);
}

#[test]
fn tool_and_work_object_without_noise_are_exact() {
    let World { robot, .. } = world();
    let mut rng = rng(2);
    let q = spread(&ranges(&robot.stops), 12, &mut rng);
    let touches = exact(robot.exported()).places(&q, "fixture", &mut rng);
    let found = fit(&robot, &touches, &Given::default(), &Limits::default()).unwrap();
    let (rad, m) = found.work.unwrap().distance(&work());
    let tool = (found.tools[0].translation - Vector3::from(TOOL)).norm();
    assert!(rad < 1e-9 && m < 1e-9 && tool < 1e-9, "{rad:.1e} rad, {m:.1e} m, {tool:.1e} m");
}

#[test]
fn a_wrong_touch_is_left_out_by_name_and_moves_nothing() {
    let World { robot, truth } = world();
    let mut rng = rng(3);
    let toucher = Toucher { truth: &truth, work: work(), tool: TOOL.into(), sigma_m: 5e-5, joint_sigma: 2e-5 };
    let q = spread(&ranges(&robot.stops), 12, &mut rng);
    let mut touches = toucher.places(&q, "fixture", &mut rng);
    let clean = fit(&robot, &touches, &Given::default(), &Limits::default()).unwrap();
    assert!(clean.judged.iter().all(|j| !j.left_out));
    let TouchPlace::Point(place) = touches.all[7].seen else { unreachable!() };
    touches.all[7].seen = TouchPlace::Point(place + Vector3::new(0.0, 2e-3, 0.0));
    let found = fit(&robot, &touches, &Given::default(), &Limits::default()).unwrap();
    let left: Vec<usize> = (0..12).filter(|&k| found.judged[k].left_out).collect();
    assert_eq!(left, [7]);
    let moved = (found.tools[0].translation - clean.tools[0].translation).norm();
    assert!(moved < 1e-4, "{moved} m");
}

/// What touches cannot tell is refused with its reason.
#[test]
fn touches_that_tell_nothing_are_refused_by_their_reason() {
    let World { robot, .. } = world();
    let mut rng = rng(4);
    let q = spread(&ranges(&robot.stops), 12, &mut rng);
    let good = exact(robot.exported()).places(&q, "fixture", &mut rng);
    let code = |touches: &Touches| fit(&robot, touches, &Given::default(), &Limits::default()).unwrap_err().code;
    let with = |change: &dyn Fn(usize, Vector3<f64>) -> Vector3<f64>| {
        let mut touches = good.clone();
        for (k, t) in touches.all.iter_mut().enumerate() {
            if let TouchPlace::Point(p) = &mut t.seen {
                *p = change(k, *p);
            }
        }
        touches
    };
    assert_eq!(code(&with(&|_, p| 1e3 * p)), Code::TouchUnit);
    assert_eq!(code(&with(&|k, _| Vector3::new(0.1 * k as f64, 0.0, 0.0))), Code::TouchesOnLine);
    let mut few = good.clone();
    few.all.truncate(3);
    assert_eq!(code(&few), Code::TouchesFew);
    let mut coarse = good.clone();
    coarse.all[2].sigma_m = 0.05;
    assert_eq!(code(&coarse), Code::TouchUnit);
    // Joint 1 alone turns: the tip has one axis in all touches.
    let mut one_axis = one_point(robot.exported(), &START, 5, &mut rng);
    for (k, p) in one_axis.postures.iter_mut().enumerate() {
        p.readings = START.to_vec();
        p.readings[5] += 0.5 * k as f64;
    }
    assert_eq!(code(&one_axis), Code::TouchesNotTurned);
    one_axis.postures.iter_mut().for_each(|p| p.readings = START.to_vec());
    assert_eq!(code(&one_axis), Code::TouchesNotTurned);
}

fn robotcal(args: &[&str], out: &Path) -> Run {
    let output = Command::new(env!("CARGO_BIN_EXE_robotcal")).args(args).arg("--out").arg(out).output().unwrap();
    Run { output, out: out.to_path_buf(), programs: Vec::new() }
}

struct Files {
    folder: tempfile::TempDir,
    touches: PathBuf,
    world: World,
}

/// Touches of the true robot in a folder of their own.
fn files(frame: &str, work: Pose, seed: u64) -> Files {
    let world = world();
    let mut rng = rng(seed);
    let toucher = Toucher { truth: &world.truth, work, tool: TOOL.into(), sigma_m: 5e-5, joint_sigma: 2e-5 };
    let q = spread(&ranges(&world.robot.stops), 20, &mut rng);
    let touches = toucher.places(&q, frame, &mut rng);
    let folder = tempfile::tempdir().unwrap();
    let head = format!("base = \"base_link\"\ntip = \"tool0\"\n[contact]\nsigma_m = 0.00005\nframe = \"{frame}\"\n");
    let joints = world.truth.chain.readings.clone();
    let touches = write(&folder.path().join("touches"), &joints, &touches, &head);
    Files { folder, touches, world }
}

const SOLUTION: &str = "reports/kr6_small/solution.json";

#[test]
fn a_program_with_measured_frames_brings_the_tool_where_it_was_meant() {
    let Files { folder, touches, world } = files("base_link", Pose::identity(), 5);
    let solution = repo(SOLUTION);
    let [solution, touches] = [&solution, &touches].map(|p| p.to_str().unwrap().to_owned());
    let frames = folder.path().join("frames");
    let run = robotcal(&["frames", "--from", &solution, "--touches", &touches], &frames).expect(0);
    println!("{}", run.said());
    let nominal = Robot::nominal(world.truth.chain.clone());
    let q = spread(&ranges(&world.robot.stops), 40, &mut rng(6));
    let mut table = world.truth.chain.readings.join(",") + "\n";
    q.iter().for_each(|q| table += &(q.iter().map(|v| format!("{v:.12}")).collect::<Vec<_>>().join(",") + "\n"));
    let program = folder.path().join("t.csv");
    std::fs::write(&program, table).unwrap();
    let path = |p: &str| repo(p).to_str().unwrap().to_owned();
    let (urdf, kr6) = (path("reports/kr6_small/kuka_kr6_r900.calibrated.urdf"), path(KR6));
    let compensation = path("reports/kr6_small/compensation.toml");
    let tool = format!("--tool={},{},{},0,0,0,1", TOOL[0], TOOL[1], TOOL[2]);
    let frames = frames.join("frames.json");
    let call = |more: &[&str]| {
        let mut args = vec!["compensate", program.to_str().unwrap(), "--nominal", &kr6, "--urdf", &urdf];
        args.extend(["--compensation", &compensation, "--joint-unit", "rad", "--unordered"]);
        args.extend(["--base", "base_link", "--tip", "tool0"]);
        args.extend(more);
        robotcal(&args, &folder.path().join("out"))
    };
    let error = |run: &Run| {
        let text = run.text("t.csv");
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let rows: Vec<Vec<f64>> =
            reader.records().map(|r| r.unwrap().iter().map(|c| c.parse().unwrap()).collect()).collect();
        let told = run.told();
        let is_left = |k: usize| told.left.iter().any(|(line, _, _)| *line == k + 2);
        let of = |(_, (meant, row)): (usize, (&Vec<f64>, &Vec<f64>))| {
            let at = |robot: &Robot, q: &[f64]| robot.base_from_tip(q).transform(&Vector3::from(TOOL));
            (at(&world.truth, row) - at(&nominal, meant)).norm_squared()
        };
        assert!(told.left.len() <= 10, "{:?}", told.left);
        let done: Vec<f64> = q.iter().zip(&rows).enumerate().filter(|(k, _)| !is_left(*k)).map(of).collect();
        (done.iter().sum::<f64>() / done.len() as f64).sqrt()
    };
    // Nobody said where base and tool are: it is stated, and the program is not called corrected.
    let untold = call(&[]).expect(1);
    assert_eq!(findings(&untold)["frames_unknown"].0, "gate");
    let nominal_frames = call(&["--frames", "nominal"]);
    // The next call writes to the same folder.
    let with_nominal = error(&nominal_frames);
    let measured = call(&["--frames", frames.to_str().unwrap(), &tool]);
    println!("{}", measured.said());
    let with_measured = error(&measured);
    println!("nominal frames: {:.3} mm, measured frames: {:.3} mm", 1e3 * with_nominal, 1e3 * with_measured);
    assert!(with_measured < 1e-4 && with_nominal > 1e-3);
    // Without the compensation it is another robot than that of the frames.
    let mut args = vec!["compensate", program.to_str().unwrap(), "--nominal", &kr6, "--urdf", &kr6];
    args.extend(["--joint-unit", "rad", "--base", "base_link", "--tip", "tool0", "--frames", frames.to_str().unwrap()]);
    let other = robotcal(&args, &folder.path().join("other")).expect(2);
    assert_says(&other.said(), Code::SolutionDiffers, &["kuka_kr6_r900.urdf"]);
}

/// A result that failed its checks is passed on with that, whatever the touches and the program say.
#[test]
fn what_comes_from_a_solution_that_failed_is_not_to_be_trusted() {
    let Files { folder, touches, .. } = files("base_link", Pose::identity(), 5);
    let copied = folder.path().join("failed");
    std::fs::create_dir(&copied).unwrap();
    for name in ["kuka_kr6_r900.calibrated.urdf", "compensation.toml"] {
        std::fs::copy(repo("reports/kr6_small").join(name), copied.join(name)).unwrap();
    }
    let mut record: serde_json::Value = serde_json::from_slice(&std::fs::read(repo(SOLUTION)).unwrap()).unwrap();
    let finding =
        serde_json::json!({"code": "plate_moved", "weight": "gate", "subject": [], "quantities": [], "text": ""});
    record["failed_gates"] = serde_json::json!(["the plate moved"]);
    record["findings"].as_array_mut().unwrap().push(finding);
    let solution = copied.join("solution.json");
    std::fs::write(&solution, serde_json::to_vec(&record).unwrap()).unwrap();
    let path = |p: &Path| p.to_str().unwrap().to_owned();
    let (kr6, urdf) = (path(&repo(KR6)), path(&copied.join("kuka_kr6_r900.calibrated.urdf")));
    let frames = folder.path().join("frames");
    let run = robotcal(&["frames", "--from", &path(&solution), "--touches", &path(&touches)], &frames).expect(1);
    let said: serde_json::Value = serde_json::from_slice(&std::fs::read(frames.join("frames.json")).unwrap()).unwrap();
    let codes: Vec<_> = said["findings"].as_array().unwrap().iter().map(|f| &f["code"]).collect();
    assert_eq!(codes, ["solution_untrusted"], "{}", run.said());
    let program = folder.path().join("t.csv");
    std::fs::write(&program, format!("{}\n0,-1.2,1.4,0,0.6,0\n", world().truth.chain.readings.join(","))).unwrap();
    let compensation = path(&copied.join("compensation.toml"));
    let mut args = vec!["compensate", program.to_str().unwrap(), "--nominal", &kr6, "--urdf", &urdf];
    args.extend(["--compensation", &compensation, "--joint-unit", "rad", "--base", "base_link", "--tip", "tool0"]);
    args.extend(["--frames", "nominal"]);
    let run = robotcal(&args, &folder.path().join("out")).expect(1);
    assert_eq!(findings(&run)["solution_untrusted"].0, "gate", "{}", run.said());
}

/// Places of a fixture under the name of the base would move the whole program by where the fixture stands.
#[test]
fn places_of_another_frame_than_the_base_are_told() {
    let Files { folder, touches, .. } = files("base_link", Pose::from_xyz_rpy([0.09, 0.0, -0.06], [0.0; 3]), 5);
    let [solution, touches] = [&repo(SOLUTION), &touches].map(|p| p.to_str().unwrap().to_owned());
    let frames = folder.path().join("frames");
    let run = robotcal(&["frames", "--from", &solution, "--touches", &touches], &frames).expect(1);
    let record: serde_json::Value =
        serde_json::from_slice(&std::fs::read(frames.join("frames.json")).unwrap()).unwrap();
    let found = &record["findings"][0];
    assert_eq!(
        (found["code"].as_str(), found["weight"].as_str()),
        (Some("frames_differ"), Some("gate")),
        "{}",
        run.said()
    );
    let distance_mm = found["quantities"]["distance_mm"].as_f64().unwrap();
    assert!((distance_mm - 108.2).abs() < 2.0, "{distance_mm}");
    let program = folder.path().join("t.csv");
    let world = world();
    let row: Vec<String> = START.iter().map(f64::to_string).collect();
    std::fs::write(&program, format!("{}\n{}\n", world.truth.chain.readings.join(","), row.join(","))).unwrap();
    let path = |p: &str| repo(p).to_str().unwrap().to_owned();
    let [nominal, urdf, compensation] =
        [KR6, "reports/kr6_small/kuka_kr6_r900.calibrated.urdf", "reports/kr6_small/compensation.toml"].map(path);
    let tool = format!("--tool={},{},{},0,0,0,1", TOOL[0], TOOL[1], TOOL[2]);
    let file = frames.join("frames.json");
    let mut args = vec!["compensate", program.to_str().unwrap(), "--nominal", &nominal, "--urdf", &urdf];
    args.extend(["--compensation", &compensation, "--joint-unit", "rad", "--base", "base_link", "--tip", "tool0"]);
    args.extend(["--frames", file.to_str().unwrap(), &tool]);
    let done = robotcal(&args, &folder.path().join("out")).expect(1);
    let left: Vec<String> = done.told().left.iter().map(|(_, _, reason)| reason.clone()).collect();
    assert_eq!(left, ["frame_unknown"]);
}

/// Three numbers say where a tool is, not how it is turned.
#[test]
fn a_tool_that_is_given_by_its_point_has_no_orientation() {
    let Files { folder, touches, .. } = files("fixture", work(), 9);
    let [solution, touches] = [&repo(SOLUTION), &touches].map(|p| p.to_str().unwrap().to_owned());
    let kind = |tool: &str| {
        let flag = format!("--tool={tool}");
        let run = robotcal(&["frames", "--from", &solution, "--touches", &touches, &flag], &folder.path().join("out"));
        let record = frames_record::read(&run.expect(0).file("frames.json")).unwrap();
        record.tool.unwrap().measured
    };
    let point = TOOL.map(|v| v.to_string()).join(",");
    assert_eq!(kind(&point), ToolKind::GivenPoint);
    assert_eq!(kind(&format!("{point},0,0,90")), ToolKind::Given);
}

/// By mirrored coordinates a plane looks the other way: nothing but the side of the tool tells.
#[test]
fn places_of_a_plane_that_were_touched_from_below_are_told() {
    let World { robot, .. } = world();
    let mut rng = rng(6);
    let tool = Pose::new(Matrix3::identity(), TOOL.into());
    let work = work();
    let limits = reading_limits(&robot.exported().chain);
    let down = Pose::from_xyz_rpy([0.0; 3], [std::f64::consts::PI, 0.0, 0.0]);
    let place = |at: &[f64]| {
        let tip = work * Pose::new(Matrix3::identity(), Vector3::new(at[0], at[1], 0.0)) * down * tool.inverse();
        solve_from(robot.exported(), &limits, &tip, &START).unwrap()
    };
    let readings: Vec<Vec<f64>> = spread(&[(-0.1, 0.1); 2], 8, &mut rng).iter().map(|at| place(at)).collect();
    let touches = exact(robot.exported()).places(&readings, "fixture", &mut rng);
    for mirrored in [false, true] {
        let mut touches = touches.clone();
        for touch in touches.all.iter_mut().filter(|_| mirrored) {
            let TouchPlace::Point(place) = &mut touch.seen else { panic!("a place") };
            place.y = -place.y;
        }
        let given = Given { tool: Some(tool), ..Given::default() };
        let found = fit(&robot, &touches, &given, &Limits::default()).unwrap();
        let told = from_below(robot.exported(), (&found, &touches), &Limits::default(), "touches");
        let code = told.map(|finding| (finding.code, finding.weight));
        assert_eq!(code, mirrored.then_some((Code::TouchedFromBelow, Weight::Note)));
    }
}

/// Touches that are given again would make tool and work object look `sqrt(2)` times as well known as they are.
#[test]
fn touches_count_once_however_often_they_are_given() {
    let Files { folder, touches, .. } = files("fixture", work(), 8);
    let (solution, frames) = (repo(SOLUTION), folder.path().join("frames"));
    let copy = folder.path().join("copy");
    std::fs::create_dir(&copy).unwrap();
    for entry in std::fs::read_dir(&touches).unwrap() {
        let file = entry.unwrap().path();
        std::fs::copy(&file, copy.join(file.file_name().unwrap())).unwrap();
    }
    let [from, touches, copy] = [&solution, &touches, &copy].map(|p| p.to_str().unwrap());
    let run = robotcal(&["frames", "--from", from, "--touches", touches, copy], &frames).expect(2);
    assert!(run.said().contains(&Code::SeriesRepeated.to_string()));
    assert!(!frames.join(frames_record::FILE_NAME).exists());
}

/// Each bad input is refused with its file and place.
#[test]
fn bad_touches_are_refused_by_file_and_place() {
    let solution = repo(SOLUTION);
    let call = |change: &dyn Fn(&Path)| {
        let Files { folder, touches, .. } = files("fixture", work(), 8);
        change(&touches);
        let args = ["frames", "--from", solution.to_str().unwrap(), "--touches", touches.to_str().unwrap()];
        robotcal(&args, &folder.path().join("frames"))
    };
    let edit = |file: &'static str, from: &'static str, to: &'static str| {
        move |folder: &Path| {
            let path = folder.join(file);
            let text = std::fs::read_to_string(&path).unwrap();
            let changed = text.replacen(from, to, 1);
            assert_ne!(changed, text);
            std::fs::write(path, changed).unwrap();
        }
    };
    let refused = |run: Run, exit: i32, code: Code, names: &[&str]| assert_says(&run.expect(exit).said(), code, names);
    refused(call(&edit("contacts.csv", "t03,", "t33,")), 2, Code::StopUnknown, &["contacts.csv:5", "t33"]);
    refused(
        call(&edit("series.toml", "tip = \"tool0\"", "tip = \"link_5\"")),
        2,
        Code::SolutionDiffers,
        &["series.toml", "link_5", "tool0"],
    );
    let other_base = |folder: &Path| {
        let path = folder.join("series.toml");
        let text = std::fs::read_to_string(&path).unwrap();
        let plain: String =
            text.lines().filter(|line| !line.starts_with("base =")).map(|line| format!("{line}\n")).collect();
        std::fs::write(path, plain.replacen("tip =", "base = \"link_1\"\ntip =", 1)).unwrap();
    };
    refused(call(&other_base), 2, Code::SolutionDiffers, &["series.toml", "link_1", "base_link"]);
    refused(
        call(&edit("series.toml", "sigma_m = 0.00005", "sigma_m = 0.05")),
        2,
        Code::SettingRange,
        &["contact.sigma_m"],
    );
    refused(
        call(&edit("contacts.csv", "x_m,y_m,z_m", "x_mm,y_mm,z_mm")),
        2,
        Code::CsvColumnUnknown,
        &["contacts.csv", "x_mm"],
    );
    let millimetres = |folder: &Path| {
        let path = folder.join("contacts.csv");
        let text = std::fs::read_to_string(&path).unwrap();
        let scaled = |line: &str| {
            let cells: Vec<&str> = line.split(',').collect();
            let mm: Vec<String> = cells[2..].iter().map(|c| (1e3 * c.parse::<f64>().unwrap()).to_string()).collect();
            format!("{},{},{}\n", cells[0], cells[1], mm.join(","))
        };
        let rows: String = text.lines().skip(1).map(scaled).collect();
        std::fs::write(path, format!("stop,contact,x_m,y_m,z_m\n{rows}")).unwrap();
    };
    refused(call(&millimetres), 2, Code::TouchUnit, &["touches"]);
    let few = |folder: &Path| {
        let path = folder.join("contacts.csv");
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(path, text.lines().take(4).map(|l| format!("{l}\n")).collect::<String>()).unwrap();
    };
    refused(call(&few), 2, Code::TouchesFew, &["touches"]);
    refused(
        call(&|folder| std::fs::remove_file(folder.join("contacts.csv")).unwrap()),
        2,
        Code::FileMissing,
        &["touches", "contacts.csv"],
    );
}

/// A work object that stands still does not go with the table of a positioner, in which the solution is: no tip is loose.
#[test]
fn places_that_do_not_go_with_a_carried_base_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (cell, series, result) = (kr6_and_positioner(folder.path()), at("series"), at("result"));
    let ends = ["--urdf", cell.to_str().unwrap(), "--base", "table", "--tip", "link_6"];
    let simulated = ["simulate", "--images", "30", "--observations", "--held-out", "0"];
    robotcal(&[&simulated[..], &ends].concat(), Path::new(&series)).expect(0);
    robotcal(&[&["identify", "--series", &series, "--robot-model", "rigid"][..], &ends].concat(), Path::new(&result));
    let record = solution_json::read(&std::fs::read(at("result/solution.json")).unwrap()).unwrap();
    let found = found_model(&record).unwrap();
    let robot = found.known_robot(None).unwrap();
    let readings = &robot.exported().chain.readings;
    let carrying: Vec<usize> =
        (0..readings.len()).filter(|&k| ["tilt", "turn"].contains(&readings[k].as_str())).collect();
    assert_eq!(carrying.len(), 2, "{readings:?}");
    let mut rng = rng(12);
    let q = spread(&ranges(&robot.stops), 20, &mut rng);
    let mut held = q.clone();
    held.iter_mut().for_each(|row| carrying.iter().for_each(|&k| row[k] = q[0][k]));
    let truth = robot.exported().clone();
    let toucher = Toucher { truth: &truth, work: work(), tool: TOOL.into(), sigma_m: 5e-5, joint_sigma: 2e-5 };
    let limits = Limits::default();
    let told = |moved: &[Vec<f64>], rng: &mut ChaCha8Rng| {
        let mut touches = toucher.places(&held, "fixture", rng);
        touches.postures = moved.iter().map(|q| Posture::at(q)).collect();
        let given = Given { tool: None, plate: None };
        let fitted = fit(&robot, &touches, &given, &limits).unwrap();
        touch_mistake(&robot, &touches, &given, (&fitted, &limits))
    };
    assert!(told(&held, &mut rng).is_none());
    let mistake = told(&q, &mut rng).unwrap();
    // Points of 0.05 mm, and as much again of the joint noise at a metre.
    assert!(mistake.misfit > 1e-2 && mistake.misfit_undone.unwrap() < 3e-4, "{mistake:?}");
    assert_says(&Finding::from(mistake).notice(), Code::WorkNotCarried, &["tilt", "turn"]);
}

/// Joints that the solution does not pass may carry what is touched: where they moved, or may have moved unseen, they are named.
#[test]
fn joints_beside_the_chain_that_moved_between_touches_are_named() {
    let world = world();
    let folder = tempfile::tempdir().unwrap();
    let mut record = solution_json::read(&std::fs::read(repo(SOLUTION)).unwrap()).unwrap();
    let end = record.urdf.text.rfind("</robot>").unwrap();
    record.urdf.text.insert_str(end, &positioner(0.55, 0.5));
    let solution = folder.path().join("solution.json");
    std::fs::write(&solution, solution_json::to_bytes(&record).unwrap()).unwrap();
    let table = Robot::nominal(robot_description(&record).unwrap().chain(Some("base_link"), Some("table")).unwrap());
    let mut rng = rng(13);
    let q = spread(&ranges(&world.robot.stops), 20, &mut rng);
    let turns = spread(&[(-0.05, 0.05), (-0.05, 0.05)], 20, &mut rng);
    let on_table = table.base_from_tip(&[0.0, 0.0]).inverse() * work();
    let toucher = |turn: &[f64]| Toucher {
        truth: &world.truth,
        work: table.base_from_tip(turn) * on_table,
        tool: TOOL.into(),
        sigma_m: 5e-5,
        joint_sigma: 2e-5,
    };
    let mut touches = toucher(&[0.0, 0.0]).places(&q, "fixture", &mut rng);
    for (k, turn) in turns.iter().enumerate() {
        touches.all[k].seen = TouchPlace::Point(toucher(turn).touched(&q[k], &mut rng));
    }
    let head = "base = \"base_link\"\ntip = \"tool0\"\n[contact]\nsigma_m = 0.00005\nframe = \"fixture\"\n";
    let mut joints = world.truth.chain.readings.clone();
    let found = |touches: &Touches, joints: &[String], name: &str| {
        let series = write(&folder.path().join(name), joints, touches, head);
        let args = ["frames", "--from", solution.to_str().unwrap(), "--touches", series.to_str().unwrap()];
        let run = robotcal(&args, &folder.path().join(format!("{name}_frames"))).expect(1);
        let record = frames_record::read(&run.file("frames.json")).unwrap();
        let scatter = record.findings.into_iter().find(|f| f.code == Code::TouchesScatter);
        scatter.unwrap_or_else(|| panic!("{}", run.said()))
    };
    let untold = found(&touches, &joints, "untold");
    assert_eq!((untold.quantities["joints_moved"], untold.quantities["joints_untold"]), (0.0, 2.0));
    joints.extend(table.chain.readings.clone());
    touches.postures.iter_mut().zip(&turns).for_each(|(posture, turn)| posture.readings.extend(turn));
    let moved = found(&touches, &joints, "told");
    assert_eq!((moved.quantities["joints_moved"], moved.quantities["joints_untold"]), (2.0, 0.0));
}

/// What is written for controllers is read back by the readers of their programs, the URDF by that of robots.
#[test]
fn frames_are_written_as_controllers_read_them() {
    use robotcal::programs::{self, Language, ProgramSetting, TargetKind, TextFile};
    let Files { folder, touches, world } = files("fixture", work(), 9);
    let out = folder.path().join("frames");
    let solution = repo(SOLUTION);
    let args = [
        "frames",
        "--from",
        solution.to_str().unwrap(),
        "--touches",
        touches.to_str().unwrap(),
        "--tool-rpy-deg",
        "10,-20,30",
    ];
    let run = robotcal(&args, &out).expect(0);
    let record = robotcal::output::frames_record::read(&run.file("frames.json")).unwrap();
    let (tool, work) = (Pose::from(&record.tool.as_ref().unwrap().pose), record.base_from_work());
    assert!((tool.rpy()[2].to_degrees() - 30.0).abs() < 1e-9);
    let chain = &world.truth.chain;
    let setting = ProgramSetting {
        chain,
        axes: &[0, 1, 2, 3, 4, 5],
        rad_per_unit: None,
        base: Pose::identity(),
        tool: None,
        work: None,
        axes_apart: false,
    };
    let moves = [
        (Language::Krl, "src", "END\n", "LIN {X 1,Y 2,Z 3,A 4,B 5,C 6}\nEND\n"),
        (
            Language::Rapid,
            "mod",
            "ENDMODULE",
            "PROC main()\nMoveL [[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v10,fine,tool_tcp\\WObj:=wobj_fixture;\nENDPROC\nENDMODULE",
        ),
        (
            Language::UrScript,
            "script",
            "end\n",
            "movel(pose_trans(plane_fixture,p[0,0,0,0,0,0]))\nmovel(p[0.1,0.2,0.3,0,0,0])\nend\n",
        ),
    ];
    for (language, kind, end, ending) in moves {
        let text = run.text(&format!("robotcal_frames.{kind}"));
        println!("{text}");
        let at = text.rfind(end).unwrap();
        let bytes = format!("{}{ending}", &text[..at]).into_bytes();
        let program = programs::read(language, vec![TextFile { name: format!("t.{kind}"), bytes }], &setting).unwrap();
        let TargetKind::Pose(pose) = &program.targets.last().unwrap().kind else { panic!("{language:?}: no pose") };
        let apart = |a: &Pose, b: &Pose| {
            let (rad, m) = a.distance(b);
            assert!(m < 1e-6 && rad < 1e-7, "{language:?}: {m:.1e} m, {rad:.1e} rad");
        };
        apart(&pose.flange_from_tool, &tool);
        if language != Language::UrScript {
            apart(&pose.base_from_work, &work);
        }
    }
    let file = out.join("kuka_kr6_r900.frames.urdf");
    let read = robotcal::urdf::read(&file).unwrap();
    for (link, from, expected) in [("tcp", "tool0", tool), ("fixture", "base_link", work)] {
        let at = |tip: &str| Robot::nominal(read.chain(Some("base_link"), Some(tip)).unwrap()).base_from_tip(&[0.3; 6]);
        let pose = match from {
            "tool0" => at("tool0").inverse() * at(link),
            _ => read.fixed_base(link, "tool0").unwrap().1,
        };
        let (rad, m) = pose.distance(&expected);
        assert!(rad < 1e-12 && m < 1e-12, "{link}: {rad:.1e} rad, {m:.1e} m");
    }
    // Every other byte is that of the corrected URDF.
    let (urdf, calibrated) = (
        std::fs::read_to_string(file).unwrap(),
        std::fs::read_to_string(repo("reports/kr6_small/kuka_kr6_r900.calibrated.urdf")).unwrap(),
    );
    let start = urdf.find("  <link name=\"tcp\"/>").unwrap();
    let end = start + urdf[start..].rfind("</joint>\n").unwrap() + "</joint>\n".len();
    assert_eq!(format!("{}{}", &urdf[..start], &urdf[end..]), calibrated);
}

/// A plan is a series: with the joint values that it proposed it gives back tool and work object that it was made for, and is no measurement.
#[test]
fn planned_touches_are_a_series_that_frames_reads() {
    let folder = tempfile::tempdir().unwrap();
    let points = folder.path().join("fixture.csv");
    let grid = (0..9).map(|k| {
        format!("p{k},{},{},{}\n", 0.1 * f64::from(k % 3), 0.1 * f64::from(k / 3), 0.02 * f64::from((k * 5) % 3))
    });
    std::fs::write(&points, format!("name,x_m,y_m,z_m\n{}", grid.collect::<String>())).unwrap();
    let (solution, out) = (repo(SOLUTION), folder.path().join("touches"));
    let [solution, points] = [&solution, &points].map(|p| p.to_str().unwrap().to_owned());
    let plan = [
        "plan",
        "--from",
        &solution,
        "--touch",
        &points,
        "--touch-work",
        "0.4,-0.1,0.1,0,0,20",
        "--touch-tool",
        "0.01,0,0.1",
    ];
    let run = robotcal(&[&plan[..], &["--touch-frame", "fixture", "--count", "8"]].concat(), &out).expect(0);
    println!("{}", run.said());
    let frames = folder.path().join("frames");
    let run = robotcal(&["frames", "--from", &solution, "--touches", out.to_str().unwrap()], &frames).expect(1);
    println!("{}", run.said());
    let record = robotcal::output::frames_record::read(&run.file("frames.json")).unwrap();
    let (rad, m) =
        record.base_from_work().distance(&Pose::from_xyz_rpy([0.4, -0.1, 0.1], [0.0, 0.0, 20f64.to_radians()]));
    // Joint values have four decimals of a degree.
    assert!(rad < 2e-5 && m < 2e-5, "{rad:.1e} rad, {m:.1e} m");
    assert!((record.tool.unwrap().pose.xyz_m[2] - 0.1).abs() < 2e-5);
    let [exact] = &record.findings[..] else { panic!("{:?}", record.findings) };
    assert_eq!((exact.code, exact.weight), (Code::TouchesExact, Weight::Gate));
    assert!(record.rms_m < 2e-6 && exact.quantities["size"] < 0.05, "{exact:?}");
    // What was measured since is not planned over.
    let table = out.join("joints.csv");
    let as_planned = std::fs::read_to_string(&table).unwrap();
    std::fs::write(&table, as_planned.replacen("touch_01,", "touch_01,1", 1)).unwrap();
    assert_says(&robotcal(&plan, &out).expect(2).said(), Code::OutputForeign, &["joints.csv"]);
    std::fs::write(&table, as_planned).unwrap();
    // Points in mm, and points that no posture touches.
    std::fs::write(&points, "name,x_m,y_m,z_m\na,0,0,0\nb,100,0,0\nc,0,100,0\n").unwrap();
    assert_says(&robotcal(&plan, &out).expect(2).said(), Code::TouchUnit, &["fixture.csv:3"]);
    std::fs::write(&points, "name;x_m;y_m;z_m\na;0;0;0\nb;1;0;0\nc;0;1;0\n").unwrap();
    assert_says(&robotcal(&plan, &out).expect(2).said(), Code::CsvSeparator, &["fixture.csv:1"]);
    std::fs::write(&points, "name,x_m,y_m,z_m,z_m\na,0,0,0,1\nb,1,0,0,1\nc,0,1,0,1\n").unwrap();
    assert_says(&robotcal(&plan, &out).expect(2).said(), Code::CsvColumnTwice, &["fixture.csv:1"]);
    std::fs::write(&points, "name,x_m,y_m,z_m\na,0,0,0\nb,5,0,0\nc,0,5,0\n").unwrap();
    assert_says(&robotcal(&plan, &out).expect(3).said(), Code::PlanOutOfReach, &["b", "c"]);
}

/// With backlash a plan and `frames` take every joint from the same side: what nobody jogged fits as exactly as of a rigid robot (it missed by
/// 0.1 mm and looked like touches), and rows of a plan are known by their joint values.
#[test]
fn planned_joints_of_a_robot_with_backlash_are_no_touches() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let [kr6, series, report, points, touches] =
        [repo(KR6).to_str().unwrap().to_owned(), at("series"), at("report"), at("fixture.csv"), at("touches")];
    let run = |args: &[&str], out: &str| robotcal(args, Path::new(out));
    let simulate = ["simulate", "--urdf", &kr6, "--errors", "full", "--images", "30", "--seed", "5", "--observations"];
    run(&simulate, &series).expect(0);
    run(&["identify", "--urdf", &kr6, "--series", &series, "--robot-model", "full"], &report).expect(0);
    std::fs::write(&points, "name,x_m,y_m,z_m\np1,0,0,0\np2,0.15,0,0\np3,0.15,0.1,0\np4,0,0.1,0.03\n").unwrap();
    let solution = at("report/solution.json");
    let place = ["--touch-work", "0.5,0.1,0.1", "--touch-tool", "0,0,0.12", "--count", "12"];
    run(&[&["plan", "--from", &solution, "--touch", &points][..], &place].concat(), &touches).expect(0);
    let exact = || {
        let run = run(&["frames", "--from", &solution, "--touches", &touches], &at("frames")).expect(1);
        let record = frames_record::read(&run.file("frames.json")).unwrap();
        let found = record.findings.into_iter().find(|f| f.code == Code::TouchesExact).unwrap();
        assert_eq!(found.weight, Weight::Gate);
        println!("{:?}", found.quantities);
        found.quantities
    };
    let as_planned = exact();
    assert_eq!((as_planned["as_planned"], as_planned["freedom"]), (12.0, 27.0));
    assert!(as_planned["size"] < 0.05, "{as_planned:?}");
    // Nine of twelve were jogged to, 0.05 mrad a joint beside the plan.
    let table = Path::new(&touches).join("joints.csv");
    let rows = std::fs::read_to_string(&table).unwrap();
    let mut noise = rng(1);
    let jogged = rows.lines().enumerate().map(|(k, row)| {
        let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
        if (1..10).contains(&k) {
            for cell in &mut cells[1..] {
                let beside = spread(&[(-0.005, 0.005)], 1, &mut noise)[0][0];
                *cell = format!("{:.4}", cell.parse::<f64>().unwrap() + beside);
            }
        }
        cells.join(",") + "\n"
    });
    let jogged: String = jogged.collect();
    std::fs::write(&table, jogged).unwrap();
    let some = exact();
    assert_eq!(some["as_planned"], 3.0);
    assert!(some["size"] > 0.1, "{some:?}");
    // Without its record the plan is known by how exactly it fits.
    std::fs::write(&table, rows).unwrap();
    std::fs::remove_file(Path::new(&touches).join("plan.json")).unwrap();
    let unrecorded = exact();
    assert_eq!(unrecorded["as_planned"], 0.0);
    assert!(unrecorded["size"] < 0.05, "{unrecorded:?}");
}

/// A taught program on another robot: the common work object is named, and the tool comes to the same place of it.
#[test]
fn a_taught_program_is_moved_by_a_common_work_object() {
    // A little beside the place of the first: joint vectors are spread over the whole region.
    let other_work = work() * Pose::from_xyz_rpy([0.004, -0.003, 0.002], [0.004, -0.003, 0.005]);
    let (a, b, wrong) =
        (files("fixture", work(), 11), files("fixture", other_work, 12), files("table", other_work, 13));
    let solution = repo(SOLUTION);
    let frames = |files: &Files| {
        let args = ["frames", "--from", solution.to_str().unwrap(), "--touches", files.touches.to_str().unwrap()];
        robotcal(&args, &files.folder.path().join("frames"))
            .expect(0)
            .out
            .join("frames.json")
            .to_str()
            .unwrap()
            .to_owned()
    };
    let [of_a, of_b, of_wrong] = [&a, &b, &wrong].map(frames);
    let path = |p: &str| repo(p).to_str().unwrap().to_owned();
    let (urdf, compensation) =
        (path("reports/kr6_small/kuka_kr6_r900.calibrated.urdf"), path("reports/kr6_small/compensation.toml"));
    let q = spread(&ranges(&a.world.robot.stops), 30, &mut rng(14));
    let mut table = a.world.truth.chain.readings.join(",") + "\n";
    q.iter().for_each(|q| table += &(q.iter().map(|v| format!("{v:.12}")).collect::<Vec<_>>().join(",") + "\n"));
    let program = a.folder.path().join("taught.csv");
    std::fs::write(&program, table).unwrap();
    let call = |more: &[&str]| {
        let mut args =
            vec!["compensate", program.to_str().unwrap(), "--from", &urdf, "--to", &urdf, "--joint-unit", "rad"];
        args.extend(["--compensation", &compensation, "--from-compensation", &compensation, "--unordered"]);
        args.extend(["--base", "base_link", "--tip", "tool0"]);
        args.extend(more);
        robotcal(&args, &a.folder.path().join("out"))
    };
    let run = call(&["--from-frames", &of_a, "--frames", &of_b]);
    println!("{}", run.said());
    let text = run.text("taught.csv");
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let rows: Vec<Vec<f64>> =
        reader.records().map(|r| r.unwrap().iter().map(|c| c.parse().unwrap()).collect()).collect();
    let place = |work: &Pose, q: &[f64]| {
        work.inverse().transform(&a.world.truth.base_from_tip(q).transform(&Vector3::from(TOOL)))
    };
    let told = run.told();
    let is_left = |k: usize| told.left.iter().any(|(line, _, _)| *line == k + 2);
    let moved: Vec<f64> = (q.iter().zip(&rows).enumerate().filter(|(k, _)| !is_left(*k)))
        .map(|(_, (old, new))| (place(&other_work, new) - place(&work(), old)).norm_squared())
        .collect();
    let error = (moved.iter().sum::<f64>() / moved.len() as f64).sqrt();
    let stated = findings(&run)["expected_error"].1["rms_mm"].as_f64().unwrap();
    println!("{} of {} targets moved, off by {:.4} mm, stated {stated:.4} mm", moved.len(), q.len(), 1e3 * error);
    // Twenty touches of 0.05 mm for each robot, whose own errors are common to both.
    assert!(moved.len() >= 15 && error < 1e-4, "{} targets, {error} m", moved.len());
    assert_eq!(findings(&call(&[]).expect(1))["frames_unknown"].0, "gate");
    assert_says(&call(&["--frames", &of_b]).expect(2).said(), Code::OptionMissing, &["--from-frames"]);
    assert_says(&call(&["--from-frames", &of_a]).expect(2).said(), Code::OptionMissing, &["--frames"]);
    assert_says(
        &call(&["--from-frames", &of_a, "--frames", &of_wrong]).expect(2).said(),
        Code::FramesDiffer,
        &["fixture", "table"],
    );
}

/// One mistake in touches that tell enough: its name, where it is, and how large.
#[test]
fn usual_mistakes_in_touches_are_named() {
    let World { robot, truth } = world();
    let mut rng = rng(31);
    let toucher = Toucher { truth: &truth, work: work(), tool: TOOL.into(), sigma_m: 5e-5, joint_sigma: 2e-5 };
    let q = spread(&ranges(&robot.stops), 16, &mut rng);
    let good = toucher.places(&q, "fixture", &mut rng);
    let (given, limits) = (Given { tool: None, plate: None }, Limits::default());
    let named = |change: &dyn Fn(&mut Touches)| {
        let mut touches = good.clone();
        change(&mut touches);
        let found = fit(&robot, &touches, &given, &limits).unwrap();
        touch_mistake(&robot, &touches, &given, (&found, &limits)).map(Finding::from)
    };
    assert_eq!(named(&|_| ()), None, "good touches");
    let place = |seen: &mut TouchPlace, change: &dyn Fn(&mut Vector3<f64>)| {
        if let TouchPlace::Point(place) = seen {
            change(place);
        }
    };
    let places = |touches: &mut Touches, of: std::ops::Range<usize>, change: &dyn Fn(&mut Vector3<f64>)| {
        touches.all[of].iter_mut().for_each(|t| place(&mut t.seen, change));
    };
    let is = |found: Option<Finding>, code: Code, says: &str| {
        let found = found.unwrap_or_else(|| panic!("{code} is not named"));
        assert_eq!(found.code(), code, "{}", found.seen());
        // words: the stops and joints that are named.
        assert!(found.seen().contains(says), "{}", found.seen());
    };
    let rows = |touches: &mut Touches| touches.postures.rotate_right(1);
    is(named(&rows), Code::RowsShifted, "row below");
    let sign = |touches: &mut Touches| touches.postures.iter_mut().for_each(|p| p.readings[3] *= -1.0);
    is(named(&sign), Code::JointSignWrong, "joint_a4");
    // As found the arm is no mirror image of itself: its errors tell the joints from the axes.
    let mirrored = |touches: &mut Touches| {
        touches.postures.iter_mut().for_each(|p| [0, 3, 5].iter().for_each(|&k: &usize| p.readings[k] *= -1.0));
    };
    is(named(&mirrored), Code::JointSignWrong, "joint_a6");
    is(named(&|t| places(t, 0..16, &|p| p.y = -p.y)), Code::AxesMirrored, "left-handed");
    for (metres, name) in [(0.0254, "inches"), (0.3048, "feet")] {
        is(named(&|t| places(t, 0..16, &|p| *p /= metres)), Code::MeasuredUnit, name);
    }
    for (size, says) in [(1.003, "0.30"), (0.997, "closer together")] {
        is(named(&|t| places(t, 0..16, &|p| *p *= size)), Code::LengthsContradicted, says);
    }
    is(named(&|t| t.all[6].seen = t.all[0].seen), Code::PlaceContradicted, "t06");
    let two = |t: &mut Touches| [(6, 0), (11, 3)].iter().for_each(|(k, of)| t.all[*k].seen = t.all[*of].seen);
    for stop in ["t06", "t11"] {
        is(named(&two), Code::PlaceContradicted, stop);
    }
    is(named(&|t| places(t, 7..16, &|p| p.x += 1e-3)), Code::WorkDisplaced, "from t07 on");
    let bent = Toucher { tool: Vector3::from(TOOL) + Vector3::new(1e-3, 0.0, 0.0), ..toucher };
    let bent = bent.places(&q, "fixture", &mut ChaCha8Rng::seed_from_u64(32));
    is(named(&|t| t.all[9..].clone_from_slice(&bent.all[9..])), Code::TargetDisplaced, "from t09 on");
    let typed = |touches: &mut Touches| {
        // The same place thrice, and typed wrongly.
        let readings = touches.postures[0].readings.clone();
        for k in 1..3 {
            touches.postures[k].readings.clone_from(&readings);
            touches.all[k].seen = touches.all[0].seen;
        }
        places(touches, 0..3, &|p| p.y += 0.01);
    };
    is(named(&typed), Code::PlaceContradicted, "t00, t01, t02");
    let tool = Vector3::from(TOOL) + Vector3::new(0.0, 0.06, 0.0);
    let given = Given { tool: Some(Pose::new(Matrix3::identity(), tool)), plate: None };
    let found = fit(&robot, &good, &given, &limits).unwrap();
    let mistake = touch_mistake(&robot, &good, &given, (&found, &limits)).map(Finding::from);
    // 60 mm away, to what touches of 0.05 mm tell.
    is(mistake, Code::ToolContradicted, "59.9");
    // 10 mm, of which the robot takes up what its tip is not known by.
    let tool = Vector3::from(TOOL) + Vector3::new(0.0, 0.0, 0.01);
    let near = fit(&robot, &good, &Given { tool: Some(Pose::new(Matrix3::identity(), tool)), plate: None }, &limits);
    assert!(near.unwrap().robot_sigmas > limits.sigmas_beyond_tolerance);
    assert!(fit(&robot, &good, &Given { tool: None, plate: None }, &limits).unwrap().robot_sigmas < 4.0);
}

/// A pin that nobody measured, touched roughly: the errors of the arm, by which it is no mirror image of itself, are below the touches.
#[test]
fn rough_touches_of_an_unknown_point_do_not_tell_an_arm_from_its_mirror_image() {
    let World { robot, truth } = world();
    let (given, limits) = (Given { tool: None, plate: None }, Limits::default());
    let mut rng = rng(34);
    let ambiguous = |touches: &Touches| {
        let found = fit(&robot, touches, &given, &limits).unwrap();
        mirror_image(&robot, touches, &given, (&found, &limits))
    };
    let mut rough = one_point(robot.exported(), &START, 8, &mut rng);
    rough.all.iter_mut().for_each(|t| t.sigma_m = 3e-3);
    assert_eq!(ambiguous(&rough).unwrap(), ["joint_a1", "joint_a4", "joint_a6"]);
    let toucher = Toucher { truth: &truth, work: work(), tool: TOOL.into(), sigma_m: 5e-5, joint_sigma: 2e-5 };
    let places = toucher.places(&spread(&ranges(&robot.stops), 16, &mut rng), "fixture", &mut rng);
    assert_eq!(ambiguous(&places), None);
}

/// Touches of one place that are left out together: the place is wrong.
#[test]
fn a_place_whose_touches_are_all_left_out_is_doubted() {
    let World { robot, truth } = world();
    let toucher = Toucher { truth: &truth, work: work(), tool: TOOL.into(), sigma_m: 5e-5, joint_sigma: 2e-5 };
    let (given, limits) = (Given { tool: None, plate: None }, Limits::default());
    let mut rng = rng(33);
    let mut touches = toucher.places(&spread(&ranges(&robot.stops), 24, &mut rng), "fixture", &mut rng);
    // The same place twice, and typed wrongly.
    touches.postures[1].readings = touches.postures[0].readings.clone();
    touches.all[1].seen = touches.all[0].seen;
    let doubted = |touches: &Touches| {
        let found = fit(&robot, touches, &given, &limits).unwrap();
        let all = frame_findings((&found, None), touches, &limits, "touches");
        let of_place = all.into_iter().find(|f| f.code == Code::PlaceContradicted);
        of_place.map(|f| (f.weight, f.quantities["touches"], f.quantities["missed_mm"]))
    };
    assert_eq!(doubted(&touches), None);
    for touch in &mut touches.all[..2] {
        if let TouchPlace::Point(place) = &mut touch.seen {
            place.x += 3e-3;
        }
    }
    let (weight, count, missed_mm) = doubted(&touches).unwrap();
    assert_eq!((weight, count), (Weight::Note, 2.0));
    assert!((missed_mm - 3.0).abs() < 0.3, "{missed_mm}");
}

/// Four places and six unknowns: a place that is wrong can be another one as well.
#[test]
fn of_few_touches_the_wrong_one_is_among_those_that_are_named() {
    let World { robot, truth } = world();
    let toucher = Toucher { truth: &truth, work: work(), tool: TOOL.into(), sigma_m: 5e-5, joint_sigma: 2e-5 };
    let given = Given { tool: Some(Pose::new(Matrix3::identity(), TOOL.into())), plate: None };
    let limits = Limits::default();
    let mut named = 0;
    for seed in 41..53 {
        let mut rng = rng(seed);
        let q = spread(&ranges(&robot.stops), 4, &mut rng);
        let mut touches = toucher.places(&q, "fixture", &mut rng);
        if let TouchPlace::Point(place) = &mut touches.all[1].seen {
            place.z += 2e-3;
        }
        let found = fit(&robot, &touches, &given, &limits).unwrap();
        let mistake = touch_mistake(&robot, &touches, &given, (&found, &limits)).map(Finding::from);
        if let Some(finding) = mistake.filter(|f| f.code() == Code::PlaceContradicted) {
            assert_says(&finding.refusal(), Code::PlaceContradicted, &["t01"]);
            named += 1;
        }
    }
    assert!(named > 0);
}

/// The plate of a solution stands in the base as uncertainly as the base itself, and that is no error of the tool on the plate.
#[test]
fn touches_of_the_plate_are_judged_by_where_the_tool_is_on_it() {
    let truth = Truth::read(&repo("datasets/kr6_small/truth.toml")).unwrap();
    let Files { folder, touches, .. } = files("plate", truth.plate_poses["placement_0"].pose(), 14);
    let solution = repo(SOLUTION);
    let [from, touched] = [&solution, &touches].map(|p| p.to_str().unwrap());
    let run = robotcal(&["frames", "--from", from, "--plate", "--touches", touched], &folder.path().join("frames"));
    let record = robotcal::output::frames_record::read(&run.file("frames.json")).unwrap();
    println!("{}", run.said());
    assert_eq!(run.output.status.code(), Some(0));
    let covariance = record.work.unwrap().covariance;
    let in_the_base = (0..3).map(|k| covariance[7 * k].sqrt()).fold(0.0, f64::max);
    assert!(in_the_base > 1e-3, "{in_the_base}");
    assert!(record.expected.with_frames_m < 2e-4, "{:?}", record.expected);
}

/// A plate that was printed badly: touches of its markers are stated at the nominal places, and the solution knows where they are.
#[test]
fn touches_at_nominal_places_of_markers_are_taken_where_these_were_found() {
    let truth = Truth::read(&repo("datasets/kr6_small/truth.toml")).unwrap();
    let Files { folder, touches, .. } = files("plate", truth.plate_poses["placement_0"].pose(), 14);
    let mut solution: serde_json::Value = serde_json::from_slice(&std::fs::read(repo(SOLUTION)).unwrap()).unwrap();
    let mut reader = csv::Reader::from_path(touches.join("contacts.csv")).unwrap();
    let mut rng = rng(15);
    let mut stated = String::from("stop,contact,x_m,y_m,z_m\n");
    for (k, row) in reader.records().map(Result::unwrap).enumerate() {
        let found: Vec<f64> = (2..5).map(|c| row[c].parse().unwrap()).collect();
        let off = spread(&[(-0.4e-3, 0.4e-3); 3], 1, &mut rng).remove(0);
        let nominal: Vec<f64> =
            found.iter().zip(&off).map(|(place, off)| ((place + off) * 1e6).round() * 1e-6).collect();
        stated += &format!("{},{},{:.6},{:.6},{:.6}\n", &row[0], &row[1], nominal[0], nominal[1], nominal[2]);
        let plate = &mut solution["plates"][0];
        plate["nominal_m"][k] = nominal.into();
        plate["position_m"][k] = found.into();
    }
    let from = folder.path().join("solution.json");
    std::fs::write(&from, serde_json::to_vec(&solution).unwrap()).unwrap();
    std::fs::write(touches.join("contacts.csv"), stated).unwrap();
    let [from, touched] = [&from, &touches].map(|p| p.to_str().unwrap());
    let run = robotcal(&["frames", "--from", from, "--plate", "--touches", touched], &folder.path().join("frames"));
    println!("{}", run.said());
    assert_eq!(run.output.status.code(), Some(0));
    let record = robotcal::output::frames_record::read(&run.file("frames.json")).unwrap();
    assert!(record.sigma_factor < 2.0 && record.rms_m < 2e-4, "{}, {} m", record.sigma_factor, record.rms_m);
}
