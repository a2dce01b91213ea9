//! Planned poses checked by code of their own: limits, visibility, collisions; and the command as a user calls it.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::robots::{kr6_and_positioner, positioner};
use crate::said::assert_says;
use nalgebra::{DMatrix, Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};
use robotcal::geom::{OrientedBox, Pose};
use robotcal::identify::RobotModel;
use robotcal::model::camera::{Camera, Lens};
use robotcal::output::plan_start::from_solution;
use robotcal::output::restore::{chain as chain_of, robot_description};
use robotcal::output::solution_json::{self, ImageRecord, PlacedRecord, SeriesRecord, SolutionRecord};
use robotcal::plan::candidates::CandidateOptions;
use robotcal::plan::criterion::Criterion;
use robotcal::plan::information::stop_information;
use robotcal::plan::scene::{Capsule, Scene, SceneOptions};
use robotcal::plan::setting::{Beside, PlannedStop, Setting};
use robotcal::plan::visibility::seen_markers;
use robotcal::plan::{Budget, Choice, Demand, Plan, PlanRequest, choose, compare_places, forecast, plan};
use robotcal::problem::Image;
use robotcal::series::{CameraMount, Plate, PlateKind};
use robotcal::urdf::{Chain, JointKind};
use robotcal::{Code, ErrorKind};

fn urdf(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("robots/{name}/{name}.urdf"))
}

fn chain(name: &str) -> Chain {
    robotcal::urdf::read(&urdf(name)).unwrap().chain(None, None).unwrap()
}

fn request(name: &str, count: usize) -> PlanRequest {
    let robot = RobotModel::Rigid.robot(chain(name));
    let arm = robot.chain.arm_length_m();
    let joints = robot.chain.readings.len();
    PlanRequest {
        setting: Setting {
            camera: Camera::pinhole(Lens::Brown, 1280, 1024, 1100.0),
            mount: CameraMount::Hand,
            mounting: Pose::from_xyz_rpy([0.02, -0.03, 0.09], [0.05, 0.0, 0.4]),
            placements: vec![
                ("a".into(), Pose::from_xyz_rpy([0.5 * arm, 0.0, 0.0], [0.0, 0.0, 0.2])),
                ("b".into(), Pose::from_xyz_rpy([0.2 * arm, 0.45 * arm, 0.05], [0.3, 0.0, 0.0])),
            ],
            plate: Plate::lattice(PlateKind::Points, 10, 7, 0.03, 1e-5),
            pixel_sigma_px: 0.05,
            joint_sigma: vec![3e-5; joints],
            beside: Beside::default(),
            robot,
        },
        taken: Vec::new(),
        count,
        demand: Demand::Workspace,
        budget: Budget { most_per_placement: Some(count * 2 / 3), ..Budget::default() },
        candidates: CandidateOptions { count: 160, ..CandidateOptions::default() },
        rounds: 4,
        scene: SceneOptions::default(),
    }
}

/// A camera on a stand that looks back at the robot, the plate on the flange in two ways.
fn fixed_request(name: &str, count: usize) -> PlanRequest {
    let mut request = request(name, count);
    let arm = request.setting.robot.chain.arm_length_m();
    request.setting.mount = CameraMount::Fixed;
    request.setting.mounting = Pose::from_xyz_rpy([0.9 * arm, 0.05, 0.45 * arm], [-1.7, 0.05, 1.5]);
    request.setting.placements = vec![
        ("flat".into(), Pose::from_xyz_rpy([0.01, 0.02, 0.05], [0.02, -0.03, 0.3])),
        ("tilted".into(), Pose::from_xyz_rpy([0.0, 0.05, 0.12], [0.5, 0.0, 1.0])),
    ];
    request
}

fn isometry(pose: &Pose) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(pose.rotation));
    Isometry3::from_parts(Translation3::from(pose.translation), rotation)
}

/// Frames behind all joints, by quaternions and joint by joint.
fn frames(chain: &Chain, q: &[f64]) -> Vec<Isometry3<f64>> {
    let mut here = Isometry3::identity();
    let step = |joint: &robotcal::urdf::Joint| {
        let value = joint.drive.map_or(0.0, |d| d.multiplier * q[d.reading] + d.offset);
        here *= isometry(&joint.origin);
        match joint.kind {
            JointKind::Revolute => here *= UnitQuaternion::from_scaled_axis(joint.axis * value),
            JointKind::Prismatic => here *= Translation3::from(joint.axis * value),
            JointKind::Fixed => {}
        }
        here
    };
    chain.joints.iter().map(step).collect()
}

/// Points along a capsule's axis in the base frame.
fn beads(c: &Capsule, frames: &[Isometry3<f64>]) -> Vec<Vector3<f64>> {
    (0..=40)
        .map(|k| {
            let x = c.ends_m[0] + (c.ends_m[1] - c.ends_m[0]) * (f64::from(k) / 40.0);
            c.joint.map_or(x, |j| frames[j] * nalgebra::Point3::from(x) - nalgebra::Point3::origin())
        })
        .collect()
}

/// Checks every stop of a plan with kinematics, projection and distances of its own.
fn check_stops(name: &str, request: &PlanRequest, plan: &Plan) {
    let setting = &request.setting;
    let chain = &setting.robot.chain;
    let capsules = Scene::new(setting, &request.scene).capsules().to_vec();
    let mut per_place = [0; 2];
    let mut seen_stops = std::collections::BTreeSet::new();
    for leg in &plan.legs {
        assert!(seen_stops.insert(leg.stop), "a stop is visited twice");
        let stop = &plan.pool[leg.stop];
        per_place[stop.placement] += 1;
        for (joint, drive) in chain.joints.iter().filter_map(|j| j.drive.map(|d| (j, d))) {
            let value = drive.multiplier * stop.readings[drive.reading] + drive.offset;
            let (low, high) = joint.limits.unwrap_or((-10.0, 10.0));
            assert!((low..=high).contains(&value), "{name} {}: {value}", joint.name);
        }
        let frames = frames(chain, &stop.readings);
        let tip = *frames.last().unwrap();
        let [mounting, placed] = [&setting.mounting, &setting.placements[stop.placement].1].map(isometry);
        let (camera, plate) = match setting.mount {
            CameraMount::Hand => (tip * mounting, placed),
            CameraMount::Fixed => (mounting, tip * placed),
        };
        check_sight(name, request, &(camera.inverse() * plate));
        check_collisions(name, request, &capsules, &frames, &plate);
    }
    assert!(per_place.iter().all(|n| *n <= 20), "{per_place:?}");
}

/// Centres of markers inside the image (a contour stays 3 px away from its border), from the front, inside the range of views, not too oblique.
fn check_sight(name: &str, request: &PlanRequest, camera_from_plate: &Isometry3<f64>) {
    let eye = camera_from_plate.inverse().translation.vector;
    // The point looked at lies in the plane of the plate.
    let views = &request.candidates.views;
    assert!(eye.z > views.near_m * views.tilt_rad.cos() - 1e-9, "{name}: too near or behind the plate: {eye}");
    let shown: Vec<Vector3<f64>> = (request.setting.plate.markers.iter())
        .map(|m| (m.position_m, (camera_from_plate * nalgebra::Point3::from(m.position_m)).coords))
        .filter(|(_, x)| {
            let (u, v) = (1100.0 * x.x / x.z + 639.5, 1100.0 * x.y / x.z + 511.5);
            x.z > 0.0 && (3.0..=1276.0).contains(&u) && (3.0..=1020.0).contains(&v)
        })
        .map(|(marker, _)| marker)
        .collect();
    assert!(shown.len() >= request.candidates.sight.least_markers, "{name}: {} markers", shown.len());
    for marker in shown {
        let sight = eye - marker;
        let incidence = (sight.z / sight.norm()).acos();
        assert!(incidence <= request.candidates.sight.incidence_rad + 1e-9, "{name}: {incidence} rad oblique");
    }
    // The point looked at lies on the plate: the distance from its middle differs by half a plate at most.
    let half = 0.5 * (0.27_f64.hypot(0.18));
    let range = views.near_m - half..=views.far_m + half;
    assert!(range.contains(&eye.norm()), "{name}: {} m away", eye.norm());
}

/// Beads on all capsules; links with little between them are neighbours in a wrist.
fn check_collisions(
    name: &str,
    request: &PlanRequest,
    capsules: &[Capsule],
    frames: &[Isometry3<f64>],
    plate: &Isometry3<f64>,
) {
    let strings: Vec<Vec<Vector3<f64>>> = capsules.iter().map(|c| beads(c, frames)).collect();
    let between = |a: usize, b: usize| -> f64 {
        let (low, high) = (capsules[a].order.min(capsules[b].order), capsules[a].order.max(capsules[b].order));
        let inner = capsules.iter().filter(|c| low < c.order && c.order < high);
        inner.map(|c| (c.ends_m[1] - c.ends_m[0]).norm()).sum()
    };
    // A plate in the hand touches the two links that carry it.
    let last = capsules.iter().map(|c| c.order).max().unwrap();
    let carriers = if request.setting.mount == CameraMount::Fixed { 2 } else { 0 };
    for a in 0..capsules.len() {
        for b in 0..a {
            let radii = capsules[a].radius_m + capsules[b].radius_m;
            if between(a, b) <= radii + 0.011 {
                continue;
            }
            let all = strings[a].iter().flat_map(|x| strings[b].iter().map(move |y| (x - y).norm()));
            let nearest = all.fold(f64::INFINITY, f64::min);
            assert!(nearest > radii, "{name}: {} and {}: {nearest}", capsules[a].name, capsules[b].name);
        }
        if capsules[a].order <= 1 {
            continue;
        }
        for x in &strings[a] {
            assert!(x.z - capsules[a].radius_m > -0.3, "{name}: {} below every table", capsules[a].name);
            if request.setting.mount == CameraMount::Fixed {
                let distance = (x - request.setting.mounting.translation).norm();
                assert!(distance > capsules[a].radius_m, "{name}: {} in the camera", capsules[a].name);
            }
            let local = plate.inverse() * nalgebra::Point3::from(*x);
            // A slab of 12 mm below the markers, with half a pitch around them.
            let under = (-0.012 - local.z).max(local.z);
            let outside = Vector3::new(local.x.abs() - 0.15, local.y.abs() - 0.105, under).map(|d| d.max(0.0));
            let carries = capsules[a].order + carriers > last;
            let free = outside.norm() > capsules[a].radius_m;
            assert!(carries || free, "{name}: {} in the plate", capsules[a].name);
        }
    }
}

#[test]
fn every_planned_pose_is_inside_limits_sees_enough_and_touches_nothing() {
    let in_hand = ["kuka_kr6_r900", "ur10e", "lbr_iiwa_14"].map(|name| (name, request(name, 30)));
    let fixed = ["kuka_kr6_r900", "lbr_iiwa_14"].map(|name| (name, fixed_request(name, 30)));
    for (name, request) in in_hand.into_iter().chain(fixed) {
        let plan = plan(&request).unwrap();
        assert_eq!(plan.legs.len(), 30);
        println!("{name}: {} candidates, certified {:?}, {:?}", plan.pool.len(), plan.efficiency, plan.values);
        assert!(plan.efficiency[0] > 0.95 && plan.efficiency[1] > 0.90);
        let searched = plan.legs.iter().filter(|l| l.stop >= plan.drawn).count();
        assert!(searched > 0, "no pose that was searched near the best is in the plan");
        check_stops(name, &request, &plan);
        let forecast = forecast(&request, &plan).unwrap();
        assert!(forecast.flange_m < 0.05 * forecast.before_m, "{} {}", forecast.flange_m, forecast.before_m);
        assert!(
            forecast.curve.windows(2).all(|w| w[1].planned_m <= w[0].planned_m * 1.0001),
            "more images cannot hurt"
        );
        // Its one place by itself is the same, but for what the search found.
        let alone_m = compare_places(&request, &plan).unwrap()[0].flange_m.unwrap();
        println!("{name}: {alone_m} {}", forecast.flange_m);
        assert!((0.99..1.2).contains(&(alone_m / forecast.flange_m)), "{name}: {alone_m} {}", forecast.flange_m);
    }
}

/// A guard beside the plate, higher than the camera looks from: no line of sight to a marker that is planned for goes through it.
#[test]
fn nothing_stands_between_the_camera_and_the_markers_of_a_planned_pose() {
    let mut request = request("kuka_kr6_r900", 12);
    request.setting.placements.truncate(1);
    let (name, plate) = request.setting.placements[0].clone();
    let guard = Pose::from_xyz_rpy([0.22, 0.0, 0.15], [0.0; 3]);
    let guard = OrientedBox { pose: plate * guard, half_m: Vector3::new(0.03, 0.2, 0.15) };
    let through = |plan: &Plan, request: &PlanRequest| {
        let mut hidden = 0;
        for leg in &plan.legs {
            let candidate = &plan.pool[leg.stop];
            let eye = plate.transform(&candidate.camera_from_plate.inverse().translation);
            let markers = candidate.seen.iter().map(|k| plate.transform(&request.setting.plate.markers[*k].position_m));
            hidden += markers.filter(|m| guard.distance_to_segment_m(&eye, m) < 1e-6).count();
        }
        hidden
    };
    request.budget.most_per_placement = None;
    let open = plan(&request).unwrap();
    request.scene.boxes = vec![guard];
    let guarded = plan(&request).unwrap();
    println!("{name}: {} lines of sight, {} with the guard", through(&open, &request), through(&guarded, &request));
    assert!(through(&open, &request) > 0);
    assert_eq!(through(&guarded, &request), 0);
    assert!(guarded.legs.iter().all(|leg| guarded.pool[leg.stop].seen.len() >= request.candidates.sight.least_markers));
    // What the plate lies on, or a little in, hides nothing.
    for top in [0.0, 0.005] {
        let bench = Pose::from_xyz_rpy([0.0, 0.0, top - 0.05], [0.0; 3]);
        request.scene.boxes = vec![OrientedBox { pose: plate * bench, half_m: Vector3::new(0.3, 0.3, 0.05) }];
        let setting = &request.setting;
        for candidate in &plan(&request).unwrap().pool {
            let all = seen_markers(&setting.plate, &setting.camera, &candidate.camera_from_plate);
            assert_eq!(candidate.seen, all, "{top}");
        }
    }
    // A lid over the plate hides it from everywhere.
    let lid = Pose::from_xyz_rpy([0.0, 0.0, 0.05], [0.0; 3]);
    request.scene.boxes = vec![OrientedBox { pose: plate * lid, half_m: Vector3::new(0.3, 0.3, 0.005) }];
    let refused = plan(&request).map(|_| ()).unwrap_err();
    let [colliding, hidden] = [0, 1].map(|k| refused.quantities[k].value);
    assert_eq!(
        (refused.code, hidden > colliding),
        (Code::PlanViewless, true),
        "{colliding} collide, {hidden} are hidden"
    );
}

/// A plate from 0.15 m to far behind its middle: no lens is sharp there, unless it is said to be.
#[test]
fn views_that_no_lens_holds_sharp_are_named_where_nothing_is_said_of_it() {
    let mut request = PlanRequest { rounds: 0, ..request("kuka_kr6_r900", 8) };
    let [unsaid, said] = [f64::INFINITY, 9.0].map(|far_m| {
        request.candidates.sight.focus_m = (0.0, far_m);
        let plan = plan(&request).unwrap();
        (plan.chosen.clone(), forecast(&request, &plan).unwrap().words)
    });
    assert_eq!(unsaid.0, said.0);
    assert_eq!(unsaid.1.len(), said.1.len() + 1, "{:?} {:?}", unsaid.1, said.1);
    assert!(unsaid.1.starts_with(&said.1));
}

#[test]
fn rounds_of_search_only_improve_and_are_the_same_with_any_number_of_threads() {
    let mut request = request("ur10e", 12);
    request.budget = Budget::default();
    let drawn = choose(&PlanRequest { rounds: 0, ..request.clone() }).unwrap();
    request.rounds = 5;
    let [one, two] = [1, 2].map(|threads| {
        let threads = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        threads.install(|| choose(&request).unwrap())
    });
    assert_eq!(one.pool, two.pool);
    assert_eq!((&one.weights, &one.chosen), (&two.weights, &two.chosen));
    assert_eq!(one.pool[..one.drawn], drawn.pool[..]);
    assert!(one.values.len() > 2 && one.values[0] == drawn.values[0], "{:?}", one.values);
    // Prices are known to the share at which a round is content.
    assert!(one.values.windows(2).all(|w| w[1] <= w[0] * 1.002), "{:?}", one.values);
    // The bound that was certified for the drawn candidates alone is beaten by whole images: the search found what they lack.
    let value = |c: &Choice| c.chosen.iter().fold(c.known.clone(), |m, &k| m + &c.information[k]);
    let variance = |c: &Choice| c.identified.criterion(&Criterion::weighted(&c.weight)).value(&value(c)).unwrap();
    let (before, after) = (variance(&drawn), variance(&two));
    println!("{before:.3e} {after:.3e}");
    assert!(after < before * drawn.efficiency[1], "{before} {after}");
    // Whole images are made better past the choice among the candidates of the search.
    assert!(one.chosen.iter().any(|&k| k >= one.drawn), "{:?}", one.chosen);
    assert!(one.efficiency[0] > 0.999 && one.efficiency[1] <= 1.0, "{:?}", one.efficiency);
}

/// Plate of few points, written as a user would.
fn plate_file(folder: &Path) -> PathBuf {
    let path = folder.join("plate.toml");
    let text = "format = 1\nkind = \"chessboard\"\ncolumns = 10\nrows = 7\npitch_m = 0.03\ntolerance_m = 0.00005\n";
    std::fs::write(&path, text).unwrap();
    path
}

fn run(arguments: &[&str]) -> (i32, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_robotcal")).args(arguments).output().unwrap();
    let text = |b: &[u8]| String::from_utf8_lossy(b).into_owned();
    (output.status.code().unwrap(), text(&output.stdout), text(&output.stderr))
}

#[test]
fn a_plan_is_a_series_without_images_with_programs_and_a_page() {
    let folder = tempfile::tempdir().unwrap();
    let plate = plate_file(folder.path());
    let (urdf, out) = (urdf("ur10e"), folder.path().join("plan"));
    let base = ["plan", "--urdf", urdf.to_str().unwrap(), "--plate", plate.to_str().unwrap()];
    let place = ["--plate-pose", "0.6,0,0,0,0,10", "--candidates", "120", "--count", "8"];
    let arguments = [&base[..], &place, &["--out", out.to_str().unwrap()]].concat();
    let (code, _, error) = run(&arguments);
    assert_eq!(code, 0, "{error}");
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    assert_eq!(read("joints.csv").lines().count(), 9);
    assert_eq!(read("robotcal_plan.src").matches("; TRIGGER").count(), 8);
    assert!(read("robotcal_plan.src").matches("PTP XP").count() >= 8);
    assert_eq!(
        read("robotcal_plan.dat").matches("E6AXIS").count(),
        read("robotcal_plan.src").matches("PTP XP").count()
    );
    assert_eq!(read("robotcal_plan.mod").matches("PulseDO").count(), 8);
    assert_eq!(read("robotcal_plan.script").matches("set_digital_out(0, True)").count(), 8);
    assert_eq!(read("robotcal_plan.trajectory.yaml").matches("image:").count(), 8);
    let page = read("plan.html");
    assert!(page.starts_with("<!DOCTYPE html>") && page.matches("<svg").count() >= 5 && !page.contains("NaN"), "page");
    // The last readings of the script are those of joints.csv.
    let stops = read("joints.csv");
    let last: Vec<f64> = stops.lines().last().unwrap().split(',').skip(1).map(|c| c.parse().unwrap()).collect();
    let script = read("robotcal_plan.script");
    let inner = script.rsplit_once("movej([").unwrap().1.split(']').next().unwrap();
    for (degrees, radians) in last.iter().zip(inner.split(',')) {
        assert!((degrees.to_radians() - radians.trim().parse::<f64>().unwrap()).abs() < 2e-6);
    }
    // A second run replaces the first and gives the same stops.
    assert_eq!(run(&arguments).0, 0);
    assert_eq!(read("joints.csv"), stops);
}

/// The place of the plate is chosen about the robot, not about its base, and measured from there.
#[test]
fn a_robot_that_stands_aside_of_its_base_is_planned_for_where_it_stands() {
    let folder = tempfile::tempdir().unwrap();
    let plate = plate_file(folder.path());
    let (aside, out) = (folder.path().join("aside.urdf"), folder.path().join("plan"));
    let stand = "<link name=\"world\"/><joint name=\"stand\" type=\"fixed\"><parent link=\"world\"/><child link=\"base_link\"/>\
                 <origin xyz=\"1 2 0.5\"/></joint><link name=\"base_link\"/>";
    let text = std::fs::read_to_string(urdf("kuka_kr6_r900")).unwrap();
    std::fs::write(&aside, text.replacen("<link name=\"base_link\"/>", stand, 1)).unwrap();
    let base = ["plan", "--urdf", aside.to_str().unwrap(), "--base", "world", "--plate", plate.to_str().unwrap()];
    let base = [&base[..], &["--count", "12", "--candidates", "160", "--out", out.to_str().unwrap()]].concat();
    let (code, _, error) = run(&[&base[..], &["--plate-pose", "1,2,3.5,0,0,0"]].concat());
    assert_eq!(code, 3, "{error}");
    assert_says(&error, Code::PlanOutOfReach, &["3.00 m", "--plate-pose"]);
    let (code, _, error) = run(&base);
    assert_eq!(code, 0, "{error}");
}

#[test]
fn impossible_wishes_say_why_and_what_to_change() {
    let folder = tempfile::tempdir().unwrap();
    let plate = plate_file(folder.path());
    let (urdf, out) = (urdf("kuka_kr6_r900"), folder.path().join("plan"));
    let base = ["plan", "--urdf", urdf.to_str().unwrap(), "--plate", plate.to_str().unwrap(), "--candidates", "60"];
    let base = [&base[..], &["--count", "8", "--out", out.to_str().unwrap()]].concat();
    let cases: [(&[&str], Code, &[&str]); 9] = [
        (&["--plate-pose", "3,0,0,0,0,0"], Code::PlanOutOfReach, &["3.00 m", "--plate-pose"]),
        (&["--markers", "500", "--plate-pose", "0.5,0,0,0,0,0"], Code::PlanContradiction, &["500", "70", "--markers"]),
        (
            &["--markers", "70", "--distance-m", "0.1x0.11", "--plate-pose", "0.5,0,0,0,0,0"],
            Code::PlanViewless,
            &["70", "--distance-m", "--markers"],
        ),
        (
            &["--mount", "fixed", "--hand-camera", "3,0,0.5,-90,0,90"],
            Code::PlanOutOfReach,
            &["3.04 m", "--hand-camera"],
        ),
        (&["--focus-m", "3x4", "--plate-pose", "0.5,0,0,0,0,0"], Code::PlanViewless, &["--focus-m"]),
        (&["--box", "0.5,0,0.4,3,3,1", "--plate-pose", "0.5,0,0,0,0,0"], Code::PlanCollides, &["--box"]),
        (&["--parameters", "joint_a9", "--plate-pose", "0.5,0,0,0,0,0"], Code::ParameterUnknown, &["joint_a9"]),
        (
            &["--parameters", "joint_a1.offset", "--plate-pose", "0.5,0,0,0,0,0"],
            Code::PlanUndetermined,
            &["joint_a1.offset"],
        ),
        (&["--per-placement", "3", "--plate-pose", "0.5,0,0,0,0,0"], Code::PlanContradiction, &["--per-placement"]),
    ];
    for (more, expected, names) in cases {
        let (code, _, error) = run(&[&base[..], more].concat());
        assert_eq!(code == 3, expected.kind() == ErrorKind::Unsolved, "{more:?}: {error}");
        assert_says(&error, expected, names);
        assert!(!out.exists(), "a failed plan leaves nothing behind");
    }
    // A joint with hardly any range.
    let text = std::fs::read_to_string(&urdf).unwrap();
    let mut narrowed = String::new();
    let mut in_third = false;
    for line in text.lines() {
        in_third = (in_third || line.contains("name=\"joint_a2\"")) && !line.contains("</joint>");
        let limit = in_third && line.contains("<limit");
        narrowed += if limit { "<limit lower=\"-1.55\" upper=\"-1.50\" velocity=\"1\" effort=\"1\"/>" } else { line };
        narrowed += "\n";
    }
    let path = folder.path().join("narrow.urdf");
    std::fs::write(&path, narrowed).unwrap();
    let mut arguments = base.clone();
    arguments[2] = path.to_str().unwrap();
    let more = ["--plate-pose", "0.45,0,0,0,0,0", "--robot-model", "gear", "--parameters", "joint_a2.gear"];
    let (code, _, error) = run(&[&arguments[..], &more].concat());
    assert_eq!(code, 3, "{error}");
    assert_says(&error, Code::PlanUndetermined, &["joint_a2.gear"]);
    // By its name in full and in short it is the same parameter.
    for name in ["robot/joint_a2.offset", "joint_a2.offset"] {
        let (code, _, error) = run(&[&base[..], &["--plate-pose", "0.45,0,0,0,0,0", "--parameters", name]].concat());
        assert_eq!(code, 0, "{name}: {error}");
    }
}

#[test]
fn further_poses_are_planned_from_a_result_with_its_noise() {
    let folder = tempfile::tempdir().unwrap();
    let solution = Path::new(env!("CARGO_MANIFEST_DIR")).join("reports/kr6_small/solution.json");
    let (urdf, out) = (urdf("kuka_kr6_r900"), folder.path().join("more"));
    let base = ["plan", "--urdf", urdf.to_str().unwrap(), "--from", solution.to_str().unwrap(), "--count", "3"];
    let base = [&base[..], &["--candidates", "80", "--rounds", "2", "--out", out.to_str().unwrap()]].concat();
    let (code, said, error) = run(&base);
    assert_eq!(code, 0, "{error}");
    let record: serde_json::Value = serde_json::from_slice(&std::fs::read(&solution).unwrap()).unwrap();
    let noise: Vec<f64> =
        record["cameras"][0]["joint_noise"].as_array().unwrap().iter().map(|s| 1e3 * s.as_f64().unwrap()).collect();
    let (low, high) = noise.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), s| (l.min(*s), h.max(*s)));
    assert!(said.contains(&format!("{low:.4} to {high:.4} ")), "{said}");
    // Which pose, by how many mm, for which parameter; the greatest gain first, and all together gain more than the best alone.
    let gains: Vec<&str> = said.lines().filter(|l| l.starts_with("helps")).collect();
    assert_eq!(gains.len(), 3, "{said}");
    let number = |text: &str, before: &str, after: &str| -> f64 {
        text.split_once(before).unwrap().1.split_once(after).unwrap().0.trim().parse().unwrap()
    };
    let alone: Vec<f64> = gains.iter().map(|g| number(g, "mm, ", " mm better")).collect();
    assert!(alone.windows(2).all(|w| w[0] >= w[1]) && alone[2] > 0.0, "{alone:?}");
    assert!(gains.iter().all(|g| g.contains(" joint_a")), "{gains:?}");
    // The terminal has micrometres, and the size of the plate leaves less than one to gain.
    let plan: serde_json::Value = serde_json::from_slice(&std::fs::read(out.join("plan.json")).unwrap()).unwrap();
    let [before, expected] = ["flange_before_m", "flange_m"].map(|name| 1e3 * plan[name].as_f64().unwrap());
    assert!(before - expected > alone[0], "{before} {expected} {alone:?}");
    // Noise given by hand would be ignored: it is refused.
    let (code, _, error) = run(&[&base[..], &["--joint-noise-mrad", "0.5"]].concat());
    // Refused by the parser of the command line, which knows no codes.
    assert!(code == 2 && error.contains("--joint-noise-mrad") && error.contains("--from"), "{code}: {error}");
}

/// Images of every camera that shows the plate count, in the hand or not; those of another plate do not.
#[test]
fn images_of_all_cameras_that_show_the_plate_are_counted() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("reports/kr6_small/solution.json");
    let mut record = solution_json::read(&std::fs::read(path).unwrap()).unwrap();
    record.placements.push(PlacedRecord { name: "carried".into(), ..record.placements[0].clone() });
    record.mountings.push(record.mountings[0].clone());
    record.cameras.push(record.cameras[0].clone());
    for image in record.images.iter_mut().skip(12) {
        (image.camera, image.camera_mount, image.placement, image.mounting) = (1, CameraMount::Fixed, 1, 1);
    }
    let start = |record: &SolutionRecord| {
        let own = chain_of(record, &robot_description(record).unwrap(), &record.robot.base, &record.robot.tip).unwrap();
        from_solution(record, own, RobotModel::Rigid).unwrap()
    };
    let (mut setting, stops) = start(&record);
    assert_eq!((stops.len(), setting.beside.cameras.len(), setting.beside.placements.len()), (24, 1, 1));
    let new = [("new".to_owned(), setting.placements[0].1)];
    let stops = setting.with_further_placements(new.to_vec(), stops);
    let of_second = stops[12..].iter().flat_map(|s| &s.images);
    assert!(of_second.clone().all(|i| (i.camera, i.mounting, i.placement, i.mount) == (1, 1, 2, CameraMount::Fixed)));
    let planned = setting.adjustment();
    assert_eq!(planned.state.placements[2].translation, setting.beside.placements[0].1.translation);
    // Every joint is better known by both cameras than by either.
    let twists = planned.problem.layout.twists.clone();
    let known = |stops: &[PlannedStop]| {
        let all = stops.iter().filter_map(|stop| stop_information(&planned, stop));
        let n = twists.end;
        let all = all.fold(DMatrix::<f64>::zeros(n, n), |sum, one| sum + one.view((0, 0), (n, n)));
        twists.clone().map(|k| all[(k, k)]).collect::<Vec<f64>>()
    };
    let [first, second, both] = [&stops[..12], &stops[12..], &stops[..]].map(known);
    assert!((0..both.len()).all(|k| both[k] >= first[k].max(second[k])) && both.iter().sum::<f64>() > 0.0);
    // Two cameras at one stop see through the same joint noise: of one place they say less of the robot than at two stops.
    let mut together = record.clone();
    let other = SeriesRecord { name: "second".into(), ..together.series[0].clone() };
    together.series.push(other);
    together.series.iter_mut().for_each(|s| s.run = Some("run".into()));
    together.images.truncate(12);
    together.images.iter_mut().enumerate().for_each(|(k, image)| image.row = Some(k));
    let second = |i: &ImageRecord| ImageRecord { camera: 1, series: "second".into(), ..i.clone() };
    together.images.extend(together.images.clone().iter().map(second));
    let (_, at_once) = start(&together);
    assert_eq!(at_once.iter().map(|s| s.images.len()).collect::<Vec<_>>(), vec![2; 12]);
    let apart = |stop: &PlannedStop| {
        let of = |image: &Image| PlannedStop { posture: stop.posture.clone(), images: vec![image.clone()] };
        stop.images.iter().map(of).collect::<Vec<_>>()
    };
    let apart: Vec<PlannedStop> = at_once.iter().flat_map(apart).collect();
    assert!(known(&at_once).iter().sum::<f64>() < known(&apart).iter().sum::<f64>());
    record.plates.push(record.plates[0].clone());
    record.images.iter_mut().skip(12).for_each(|i| i.plate = 1);
    assert_eq!(start(&record).1.len(), 12);
}

/// The first numbers of a line in braces or brackets.
fn values(line: &str, open: char) -> Vec<f64> {
    let cells = line.split(open).nth(1).unwrap();
    let number = |cell: &str| cell.trim_matches(|c: char| c.is_ascii_alphabetic() || "[]{};".contains(c)).to_owned();
    let cell = |cell: &str| number(cell.split_whitespace().last().unwrap()).parse().unwrap();
    cells.trim_end_matches(['}', ']', ';']).split(',').filter(|c| !c.trim().is_empty()).map(cell).collect()
}

/// A rail stands before the arm in the chain, and behind its axes in the languages of the makers.
#[test]
fn a_rail_is_an_external_axis_of_the_planned_programs() {
    let mut request = request("ur10e", 4);
    let chosen = plan(&request).unwrap();
    request.setting.robot.chain.reading_kinds[0] = JointKind::Prismatic;
    let files = robotcal::output::plan_programs::programs(&request, &chosen);
    let text = |name: &str| String::from_utf8(files[&format!("robotcal_plan.{name}")].clone()).unwrap();
    let first = &chosen.pool[chosen.legs[0].stop].readings;
    let shown: Vec<f64> = first.iter().map(|q| q.to_degrees()).collect();
    let rail_mm = 1e3 * first[0];
    let near = |found: &[f64], wanted: &[f64]| {
        assert_eq!(found.len(), wanted.len(), "{found:?} {wanted:?}");
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-4), "{found:?} {wanted:?}");
    };
    let stop = chosen.legs[0].via.len();
    let data = text("dat");
    let line = data.lines().filter(|l| l.starts_with("DECL E6AXIS")).nth(stop).unwrap();
    let axes: Vec<&str> = line.split(['{', '}', ',']).filter_map(|cell| cell.split_once(' ')).map(|c| c.0).collect();
    assert_eq!(axes[1..], ["A1", "A2", "A3", "A4", "A5", "E1"], "{line}");
    near(&values(line, '{'), &[&shown[1..], &[rail_mm]].concat());
    let module = text("mod");
    let line = module.lines().filter(|l| l.contains("CONST jointtarget")).nth(stop).unwrap();
    let [arm, external] = [2, 3].map(|k| line.split('[').nth(k).unwrap());
    near(&values(&format!("[{arm}"), '['), &[&shown[1..], &[0.0]].concat());
    near(&values(&format!("[{external}"), '['), &[rail_mm, 9e9, 9e9, 9e9, 9e9, 9e9]);
    assert!(!files.contains_key("robotcal_plan.script"));
}

/// Joints between the plate and the link above both are those of a positioner: an arm of five axes behind one of them has no A6.
#[test]
fn a_positioner_is_an_external_axis_of_the_planned_programs() {
    let mut request = request("ur10e", 4);
    let chosen = plan(&request).unwrap();
    request.setting.robot.chain.joints[0].upwards = true;
    let files = robotcal::output::plan_programs::programs(&request, &chosen);
    let data = String::from_utf8(files["robotcal_plan.dat"].clone()).unwrap();
    let line = data.lines().find(|l| l.starts_with("DECL E6AXIS")).unwrap();
    let axes: Vec<&str> = line.split(['{', '}', ',']).filter_map(|cell| cell.split_once(' ')).map(|c| c.0).collect();
    assert_eq!(axes[1..], ["A1", "A2", "A3", "A4", "A5", "E1"], "{line}");
    assert!(!files.contains_key("robotcal_plan.script"));
}

/// Nobody may drive a program through a table that the plan knows to stand in the way.
#[test]
fn the_planned_programs_stop_where_no_straight_way_is_free() {
    let request = request("ur10e", 4);
    let mut chosen = plan(&request).unwrap();
    chosen.legs.iter_mut().for_each(|leg| leg.is_free = true);
    let stops = |plan: &Plan, name: &str, word: &str| {
        let files = robotcal::output::plan_programs::programs(&request, plan);
        let text = String::from_utf8(files[&format!("robotcal_plan.{name}")].clone()).unwrap();
        let halts = text.lines().enumerate().filter(|(_, line)| line.contains(word));
        halts.map(|(k, _)| text.lines().nth(k + 1).unwrap_or_default().to_owned()).collect::<Vec<_>>()
    };
    let words = [("src", "HALT", "PTP XP"), ("mod", "Stop;", "    MoveAbsJ p"), ("script", "popup(", "  movej([")];
    let free = words.map(|(name, word, _)| stops(&chosen, name, word).len());
    let pauses = stops(&chosen, "trajectory.yaml", "teach:").len();
    chosen.legs[2].is_free = false;
    chosen.legs[2].via.clear();
    for ((name, word, motion), free) in words.into_iter().zip(free) {
        let halts = stops(&chosen, name, word);
        assert_eq!(halts.len(), free + 1, "{name}");
        assert!(halts.iter().any(|next| next.starts_with(motion)), "{name}: {halts:?}");
    }
    assert_eq!((pauses, stops(&chosen, "trajectory.yaml", "teach:").len()), (0, 1));
}

/// Between two places of the plate stands a wall: the way past it has to be taught.
#[test]
fn the_way_from_one_place_of_the_plate_to_the_next_is_looked_at() {
    let folder = tempfile::tempdir().unwrap();
    let plate = Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/kr6_small/plate.toml");
    let (urdf, out) = (urdf("ur10e"), folder.path().join("plan"));
    let files = ["--urdf", urdf.to_str().unwrap(), "--plate", plate.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let few = ["plan", "--count", "6", "--candidates", "60", "--rounds", "0", "--per-placement", "4"];
    let places = ["--plate-pose", "0.5,0.45,0,0,0,0", "--plate-pose", "0.5,-0.45,0,0,0,0"];
    let wall = ["--box", "0.75,0,0.5,0.9,0.04,1.2"];
    let (code, _, error) = run(&[&few[..], &files, &places, &wall].concat());
    assert_eq!(code, 0, "{error}");
    let plan: serde_json::Value = serde_json::from_slice(&std::fs::read(out.join("plan.json")).unwrap()).unwrap();
    let stops = plan["stops"].as_array().unwrap();
    let moves = stops.windows(2).filter(|pair| pair[0]["placement"] != pair[1]["placement"]);
    assert_eq!(moves.map(|pair| pair[1]["way_is_free"].as_bool()).collect::<Vec<_>>(), [Some(false)]);
}

/// A name means what it means for `identify --free`: a parameter, a block, or what fits its stars.
#[test]
fn parameters_are_named_in_planning_as_in_identify() {
    let asked = |name: &str| {
        let request = PlanRequest {
            demand: Demand::Named(vec![name.to_owned()]),
            candidates: CandidateOptions { count: 30, ..CandidateOptions::default() },
            budget: Budget::default(),
            rounds: 0,
            ..request("ur10e", 4)
        };
        choose(&request).map(|choice| choice.chosen.len()).map_err(|error| error.code)
    };
    for name in ["elbow_joint", "robot/elbow_joint/origin.rx", "*.rx"] {
        assert_eq!(asked(name), Ok(4), "{name}");
    }
    for name in ["elbow", "elbow_joint/origin.r", "camera", "*.focal"] {
        assert_eq!(asked(name), Err(Code::ParameterUnknown), "{name}");
    }
}

#[test]
fn names_cannot_become_statements_of_the_planned_programs() {
    let mut request = request("ur10e", 4);
    let hostile = "b\", blocking=False)\n  movej([0,0,0,0,0,0])\nPTP {A1 0}\nMoveAbsJ [[0],[0]],v1,z1,tool0; \\ \u{e9}";
    let chosen = plan(&request).unwrap();
    request.setting.placements[0].0 = hostile.into();
    request.setting.placements[1].0 = hostile.into();
    request.setting.robot.chain.readings[1] = hostile.into();
    let files = robotcal::output::plan_programs::programs(&request, &chosen);
    let text = |name: &str| String::from_utf8(files[&format!("robotcal_plan.{name}")].clone()).unwrap();
    let visits = text("dat").matches("E6AXIS").count();
    assert_eq!(text("src").lines().filter(|l| l.starts_with("PTP ")).count(), visits);
    assert_eq!(text("mod").matches("    MoveAbsJ ").count(), visits);
    assert_eq!(text("script").lines().filter(|l| l.starts_with("  movej(")).count(), visits);
    assert!(text("script").lines().filter(|l| l.contains("popup(")).count() >= 1);
    for name in ["src", "dat", "mod", "script"] {
        for line in text(name).lines() {
            assert!(line.is_ascii() && line.matches('"').count() % 2 == 0 && line.len() < 300, "{name}: {line}");
        }
    }
    for line in text("mod").lines().filter(|l| l.contains("TPWrite")) {
        let literal = line.split('"').nth(1).unwrap();
        assert!(line.matches('"').count() == 2 && literal.len() <= 80 && !literal.contains('\\'), "{line}");
    }
}

/// A solution has base and tip: further poses are planned between them, of the URDF in it as well as of one that is given.
#[test]
fn further_poses_of_a_cell_are_planned_between_the_links_of_the_result() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (cell, series, result) = (kr6_and_positioner(folder.path()), at("series"), at("result"));
    let cell = cell.to_str().unwrap();
    let ends = ["--urdf", cell, "--base", "table", "--tip", "link_6"];
    let made = ["simulate", "--images", "30", "--observations", "--held-out", "0", "--out", &series];
    let (code, _, error) = run(&[&made[..], &ends].concat());
    assert_eq!(code, 0, "{error}");
    let (code, _, error) =
        run(&[&["identify", "--series", &series, "--robot-model", "rigid", "--out", &result][..], &ends].concat());
    assert!(code <= 1, "{error}");
    let from = format!("{result}/solution.json");
    let plan = |name: &str, more: &[&str]| {
        let base = ["plan", "--from", &from, "--count", "2", "--candidates", "20", "--rounds", "0", "--out"];
        let (code, _, error) = run(&[&base[..], &[&at(name)], more].concat());
        assert_eq!(code, 0, "{error}");
        std::fs::read_to_string(folder.path().join(name).join("joints.csv")).unwrap()
    };
    let stated = plan("stated", &ends);
    assert!(stated.lines().next().unwrap().ends_with("joint_a6") && stated.contains("turn,tilt"), "{stated}");
    assert_eq!(plan("given", &["--urdf", cell]), stated);
    assert_eq!(plan("own", &[]), stated);
    // The URDF of the arm alone has no table.
    let arm = urdf("kuka_kr6_r900");
    assert_eq!(plan("arm", &["--urdf", arm.to_str().unwrap()]), stated);
}

/// Where joints carry the base, distances are those from the foot of the arm, which stands 0.55 m behind and 0.38 m below the table.
#[test]
fn what_is_out_of_reach_of_a_carried_base_is_measured_from_the_foot_of_the_arm() {
    let folder = tempfile::tempdir().unwrap();
    let (plate, cell) = (plate_file(folder.path()), kr6_and_positioner(folder.path()));
    let out = folder.path().join("plan");
    let base = [
        "plan",
        "--urdf",
        cell.to_str().unwrap(),
        "--base",
        "table",
        "--tip",
        "tool0",
        "--plate",
        plate.to_str().unwrap(),
    ];
    let base = [&base[..], &["--candidates", "60", "--count", "4", "--out", out.to_str().unwrap()]].concat();
    // The foot in the table: the way back up the positioner, at zero of both joints.
    let foot = Pose::from_xyz_rpy([0.55, 0.0, 0.3], [0.0, 0.0, 0.3]) * Pose::from_xyz_rpy([0.02, 0.01, 0.08], [0.0; 3]);
    let foot = foot.inverse().translation;
    let away = [foot.x, foot.y + 4.0, foot.z].map(|v| format!("{v:.5}"));
    let place = [format!("{:.2}, {:.2}, {:.2} m", foot.x, foot.y, foot.z), "4.00 m".into(), "\"table\"".into()];
    let pose = format!("{},0,0,0", away.join(","));
    let cases: [(&[&str], &str); 2] =
        [(&["--plate-pose", &pose], "--plate-pose"), (&["--mount", "fixed", "--hand-camera", &pose], "--hand-camera")];
    for (more, flag) in cases {
        let (code, _, error) = run(&[&base[..], more].concat());
        assert_eq!(code, 3, "{error}");
        assert_says(&error, Code::PlanOutOfReach, &[&place[0], &place[1], &place[2], flag]);
    }
}

/// The plate lies on a table that a positioner turns: what carries it is in nobody's way, and the floor stands still.
#[test]
fn poses_are_planned_of_a_plate_on_a_positioner() {
    let arm = robotcal::urdf::read(&urdf("kuka_kr6_r900")).unwrap();
    let end = arm.text.rfind("</robot>").unwrap();
    let text = format!("{}{}{}", &arm.text[..end], positioner(0.55, 0.5), &arm.text[end..]);
    let cell = robotcal::urdf::RobotDescription::from_text(&arm.path, text).unwrap();
    let mut request = request("kuka_kr6_r900", 6);
    let alone = request.setting.clone();
    request.setting.robot = RobotModel::Rigid.robot(cell.chain(Some("table"), Some("tool0")).unwrap());
    request.setting.placements = vec![("table".into(), Pose::from_xyz_rpy([0.0, 0.0, 0.02], [0.0; 3]))];
    request.setting.joint_sigma = vec![3e-5; 8];
    request.budget = Budget::default();
    let planned = plan(&request).unwrap();
    assert_eq!(planned.legs.len(), 6);
    let (tip, setting) = (request.setting.robot.chain.joints.len() - 1, &request.setting);
    for leg in &planned.legs {
        let tip = frames(&setting.robot.chain, &planned.pool[leg.stop].readings)[tip];
        let [mounting, placed] = [&setting.mounting, &setting.placements[0].1].map(isometry);
        check_sight("positioner", &request, &((tip * mounting).inverse() * placed));
    }
    // An arm that comes too near to the floor does so however the table is turned.
    let far = vec![("away".into(), Pose::from_xyz_rpy([0.0, 0.0, 10.0], [0.0; 3]))];
    let alone = Setting { placements: far, ..alone };
    let above = |setting: &Setting, z: f64| {
        Scene::new(setting, &SceneOptions { table_z_m: Some(z), ..SceneOptions::default() })
    };
    let [by_arm, by_cell, without] = [above(&alone, -0.1), above(setting, -0.1), above(setting, -10.0)];
    // A box where the plate lies, and nowhere else.
    let at_plate = OrientedBox { pose: Pose::from_xyz_rpy([0.57, 0.01, 0.4], [0.0; 3]), half_m: Vector3::repeat(0.01) };
    let boxed = Scene::new(setting, &SceneOptions { boxes: vec![at_plate], ..SceneOptions::default() });
    let (mut free, mut hits) = (0, 0);
    for k in 0..400 {
        let turned = |joint: usize, most: f64| most * (1.7 * f64::from(k) + 2.3 * joint as f64).sin();
        let own: Vec<f64> = (0..6).map(|joint| turned(joint, if joint == 1 { 0.8 } else { 1.2 })).collect();
        let whole = [&[turned(7, 3.0), turned(6, 0.5)], own.as_slice()].concat();
        if without.collision(&whole, 0).is_none() {
            let [arm, cell] = [by_arm.collision(&own, 0), by_cell.collision(&whole, 0)];
            assert_eq!(arm, cell, "{k}");
            assert!(boxed.collision(&whole, 0).is_some(), "{k}");
            free += usize::from(arm.is_none());
            hits += usize::from(arm.is_some());
        }
    }
    assert!(free > 20 && hits > 20, "{free} {hits}");
}
