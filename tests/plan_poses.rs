//! Planned poses checked by code of their own: limits, visibility, collisions; and the command as a user calls it.

use std::path::{Path, PathBuf};
use std::process::Command;

use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};
use robotcal::geom::Pose;
use robotcal::model::camera::{Camera, Lens};
use robotcal::plan::candidates::CandidateOptions;
use robotcal::plan::scene::{Capsule, Scene, SceneOptions, arm_length_m};
use robotcal::plan::setting::Setting;
use robotcal::recipe::{Budget, PlanRequest, RobotModel, Wish, forecast, plan};
use robotcal::series::{CameraMount, Plate, PlateKind};
use robotcal::urdf::{Chain, JointKind};

fn urdf(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("robots/{name}/{name}.urdf"))
}

fn chain(name: &str) -> Chain {
    robotcal::urdf::read(&urdf(name)).unwrap().chain(None, None).unwrap()
}

fn request(name: &str, count: usize) -> PlanRequest {
    let robot = RobotModel::Rigid.robot(chain(name));
    let arm = arm_length_m(&robot);
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
            robot,
        },
        taken: Vec::new(),
        count,
        wish: Wish::Workspace,
        budget: Budget { most_per_placement: Some(count * 2 / 3), ..Budget::default() },
        candidates: CandidateOptions { count: 160, ..CandidateOptions::default() },
        rounds: 4,
        scene: SceneOptions::default(),
    }
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

#[test]
fn every_planned_pose_is_inside_limits_sees_enough_and_touches_nothing() {
    for name in ["kuka_kr6_r900", "ur10e", "lbr_iiwa_14"] {
        let request = request(name, 30);
        let setting = &request.setting;
        let plan = plan(&request).unwrap();
        assert_eq!(plan.legs.len(), 30);
        println!("{name}: {} candidates, certified {:?}", plan.pool.len(), plan.efficiency);
        assert!(plan.efficiency[0] > 0.95 && plan.efficiency[1] > 0.90);
        let capsules = Scene::new(setting, &request.scene).capsules().to_vec();
        let mut per_place = [0; 2];
        let mut seen_stops = std::collections::BTreeSet::new();
        for leg in &plan.legs {
            assert!(seen_stops.insert(leg.stop), "a stop is visited twice");
            let stop = &plan.pool[leg.stop];
            per_place[stop.placement] += 1;
            let chain = &setting.robot.chain;
            for (joint, drive) in chain.joints.iter().filter_map(|j| j.drive.map(|d| (j, d))) {
                let value = drive.multiplier * stop.readings[drive.reading] + drive.offset;
                let (low, high) = joint.limits.unwrap_or((-10.0, 10.0));
                assert!((low..=high).contains(&value), "{name} {}: {value}", joint.name);
            }
            let frames = frames(chain, &stop.readings);
            let plate = isometry(&setting.placements[stop.placement].1);
            let camera = frames.last().unwrap() * isometry(&setting.mounting);
            // Visibility: centres of markers inside the image, from the front, not too oblique.
            let eye = plate.inverse() * camera.translation.vector;
            let eye = eye + plate.inverse().translation.vector;
            assert!(eye.z > 0.1, "behind the plate or on it: {eye}");
            let camera_from_plate = camera.inverse() * plate;
            let inside = |m: &&robotcal::series::Marker| {
                let x = camera_from_plate * nalgebra::Point3::from(m.position_m);
                let (u, v) = (1100.0 * x.x / x.z + 639.5, 1100.0 * x.y / x.z + 511.5);
                x.z > 0.0 && (0.0..=1279.0).contains(&u) && (0.0..=1023.0).contains(&v)
            };
            let seen = setting.plate.markers.iter().filter(inside).count();
            assert!(seen >= request.candidates.sight.least_markers, "{name}: {seen} markers");
            assert!(eye.z / eye.norm() > 0.3, "{name}: too oblique");
            // Collisions: beads on all capsules; the two next links up and down are neighbours in a wrist.
            let strings: Vec<Vec<Vector3<f64>>> = capsules.iter().map(|c| beads(c, &frames)).collect();
            let between = |a: usize, b: usize| -> f64 {
                let (low, high) = (capsules[a].order.min(capsules[b].order), capsules[a].order.max(capsules[b].order));
                let inner = capsules.iter().filter(|c| low < c.order && c.order < high);
                inner.map(|c| (c.ends_m[1] - c.ends_m[0]).norm()).sum()
            };
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
                if capsules[a].order > 1 {
                    for x in &strings[a] {
                        assert!(x.z - capsules[a].radius_m > -0.3, "{name}: {} below every table", capsules[a].name);
                        let local = plate.inverse() * nalgebra::Point3::from(*x);
                        let beside = local.x.abs() > 0.15 || local.y.abs() > 0.105;
                        let above = local.z > capsules[a].radius_m;
                        assert!(beside || above || local.z < -0.1, "{name}: {} in the plate", capsules[a].name);
                    }
                }
            }
        }
        assert!(per_place.iter().all(|n| *n <= 20), "{per_place:?}");
        let forecast = forecast(&request, &plan).unwrap();
        assert!(forecast.flange_m < 0.05 * forecast.before_m, "{} {}", forecast.flange_m, forecast.before_m);
        assert!(
            forecast.curve.windows(2).all(|w| w[1].planned_m <= w[0].planned_m * 1.0001),
            "more images cannot hurt"
        );
    }
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
    let (code, said, error) = run(&arguments);
    assert_eq!(code, 0, "{error}");
    assert!(said.contains("certified") && said.contains("flange"), "{said}");
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

#[test]
fn impossible_wishes_say_why_and_what_to_change() {
    let folder = tempfile::tempdir().unwrap();
    let plate = plate_file(folder.path());
    let (urdf, out) = (urdf("kuka_kr6_r900"), folder.path().join("plan"));
    let base = ["plan", "--urdf", urdf.to_str().unwrap(), "--plate", plate.to_str().unwrap(), "--candidates", "60"];
    let base = [&base[..], &["--count", "8", "--out", out.to_str().unwrap()]].concat();
    let cases: [(&[&str], i32, &[&str]); 7] = [
        (&["--plate-pose", "3,0,0,0,0,0"], 3, &["in reach", "3.00 m", "--plate-pose"]),
        (&["--markers", "500", "--plate-pose", "0.5,0,0,0,0,0"], 3, &["500 sharp markers", "most seen", "--markers"]),
        (&["--focus-m", "3x4", "--plate-pose", "0.5,0,0,0,0,0"], 3, &["sharp", "--focus-m"]),
        (&["--box", "0.5,0,0.4,3,3,1", "--plate-pose", "0.5,0,0,0,0,0"], 3, &["collide", "--box"]),
        (&["--parameters", "joint_a9", "--plate-pose", "0.5,0,0,0,0,0"], 2, &["joint_a9", "did you mean"]),
        (&["--parameters", "joint_a1.offset", "--plate-pose", "0.5,0,0,0,0,0"], 3, &["would stay unknown", "plate"]),
        (&["--per-placement", "3", "--plate-pose", "0.5,0,0,0,0,0"], 2, &["per placement", "--per-placement"]),
    ];
    for (more, expected, words) in cases {
        let (code, _, error) = run(&[&base[..], more].concat());
        assert_eq!(code, expected, "{more:?}: {error}");
        words.iter().for_each(|w| assert!(error.contains(w), "{more:?} lacks \"{w}\": {error}"));
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
    assert!(error.contains("joint_a2.gear") && error.contains("degrees only") && error.contains("widen"), "{error}");
}
