//! Poses of a controller in the place of joint readings: what is found without a robot, and the mistakes that are named.

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::{Matrix6, Vector6};
use robotcal::assess::Limits;
use robotcal::calibration::{Calibration, Ends, Export, Inputs};
use robotcal::diagnose::{DoubtedSize, Finding, ToldBy};
use robotcal::geom::{Pose, log_so3};
use robotcal::identify::{Options, RobotModel, identify, verify_series};
use robotcal::model::inverse::{reading_limits, solve_from};
use robotcal::model::robot::Robot;
use robotcal::output::solution_json;
use robotcal::plan::plate_design::{PlateRequest, design};
use robotcal::problem::{MeasuredSeries, MeasuredStop, Shared};
use robotcal::simulate::truth::Truth;
use robotcal::simulate::{WorldRequest, series as simulated};
use robotcal::study::measured;
use robotcal::urdf::Chain;
use robotcal::{Code, Error};
use tempfile::TempDir;

use crate::robots::{kr6_urdf, repo};
use crate::said::assert_says;
use crate::support::small::Dice;

const SIGMA_M: f64 = 2e-4;
const SIGMA_RAD: f64 = 3e-4;

fn dataset() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/ur10e_observations")
}

fn truth() -> Truth {
    Truth::read(&dataset().join("truth.toml")).unwrap()
}

/// Poses of the flange in the base at the stops, as a controller with noise says them.
fn poses(truth: &Truth, seed: u64) -> Vec<(String, Pose)> {
    println!("seed {seed}");
    let mut dice = Dice::new(seed);
    let (camera, plate) = (truth.camera_pose.pose(), truth.plate_poses["placement_0"].pose());
    let mut noisy = |pose: Pose| {
        let noise = Vector6::from_fn(|k, _| dice.normal(if k < 3 { SIGMA_M } else { SIGMA_RAD }));
        pose.perturbed(&noise)
    };
    let of = |s: &robotcal::simulate::truth::TrueStop| plate * (camera * s.camera_from_plate.pose()).inverse();
    truth.stops.iter().map(|s| (s.image.clone(), noisy(of(s)))).collect()
}

/// A rotation as numbers of a table.
type Written = fn(&Pose) -> Vec<f64>;

fn quaternion(pose: &Pose) -> Vec<f64> {
    pose.quaternion_xyzw().to_vec()
}

fn rotation_vector(pose: &Pose) -> Vec<f64> {
    log_so3(&pose.rotation).as_slice().to_vec()
}

fn abc_deg(pose: &Pose) -> Vec<f64> {
    let [roll, pitch, yaw] = pose.rpy();
    [yaw, pitch, roll].map(f64::to_degrees).to_vec()
}

fn roll_pitch_yaw(pose: &Pose) -> Vec<f64> {
    pose.rpy().to_vec()
}

/// Angles about z, y', z'': from the direction of the third axis, then what is left about it.
fn zyz_deg(pose: &Pose) -> Vec<f64> {
    let r = &pose.rotation;
    let o = r[(1, 2)].atan2(r[(0, 2)]);
    let a = r[(0, 2)].hypot(r[(1, 2)]).atan2(r[(2, 2)]);
    let t = r[(2, 1)].atan2(-r[(2, 0)]);
    [o, a, t].map(f64::to_degrees).to_vec()
}

/// Angles about x, y', z'': those about fixed axes of the inverse, negated.
fn xyz_deg(pose: &Pose) -> Vec<f64> {
    pose.inverse().rpy().map(|angle| -angle.to_degrees()).to_vec()
}

/// The series with these poses instead of joint readings.
fn series(rotation: &str, columns: &str, poses: &[(String, Pose)], written: Written) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for file in ["plate.toml", "plate.csv", "observations.csv"] {
        fs::copy(dataset().join(file), folder.path().join(file)).unwrap();
    }
    let manifest = fs::read_to_string(dataset().join("series.toml")).unwrap();
    let manifest = format!("{manifest}\n[controller]\nrotation = \"{rotation}\"\n");
    fs::write(folder.path().join("series.toml"), manifest).unwrap();
    let mut text = format!("image,x_m,y_m,z_m,{columns}\n");
    for (image, pose) in poses {
        let numbers = pose.xyz().into_iter().chain(written(pose)).map(|v| format!("{v:.10}")).collect::<Vec<_>>();
        writeln!(text, "{image},{}", numbers.join(",")).unwrap();
    }
    fs::write(folder.path().join("controller.csv"), text).unwrap();
    folder
}

fn calibrated(folder: &TempDir) -> Result<Calibration, Error> {
    let inputs = Inputs::without_robot(&[folder.path().to_path_buf()])?;
    Calibration::of(inputs.observe(&Limits::default(), &|_, _| ())?, &Options::default())
}

/// A squared normalised error with six degrees of freedom stays below this in 999 of 1000 cases.
const CHI2_6: f64 = 22.5;

#[test]
fn hand_eye_transform_and_noise_are_found_without_a_robot() {
    let truth = truth();
    let folder = series("rotvec_rad", "rx,ry,rz", &poses(&truth, 5), rotation_vector);
    let calibration = calibrated(&folder).unwrap();
    let fit = &calibration.solution().fit;
    let error = (truth.camera_pose.pose().inverse() * fit.state.mountings[0]).log();
    let at = fit.problem.layout.mountings[0].clone();
    let covariance = fit.covariance.reduced.view((at.start, at.start), (6, 6)).into_owned();
    let covariance = Matrix6::from_column_slice(covariance.as_slice());
    let normalised = error.dot(&(covariance.try_inverse().unwrap() * error));
    assert!(normalised < CHI2_6, "{normalised}, {error:?}");
    // Of 50 poses: the standard deviation of an estimated standard deviation is a tenth.
    for (k, sigma) in fit.problem.joint_sigma(0).into_iter().enumerate() {
        let stated = if k < 3 { SIGMA_M } else { SIGMA_RAD };
        assert!((0.6..1.5).contains(&(sigma / stated)), "coordinate {k}: {sigma} for {stated}");
    }
    let files = calibration.files(&Export::default()).unwrap();
    for name in ["camera.yaml", "hand_camera.yaml", "plate_pose.yaml", "solution.json"] {
        assert!(files.contains_key(name), "{name} is missing");
    }
    // Between the poses of the stops the model in the controller errs in another way: the promise is of these alone.
    let report = String::from_utf8(files["report.html"].clone()).unwrap();
    let promise = report.split("<h2>Accuracy of the flange</h2>").nth(1).unwrap().split("<h2>").next().unwrap();
    let [record, of_robot] =
        [files["solution.json"].clone(), fs::read(repo("reports/kr6_small/solution.json")).unwrap()]
            .map(|bytes| solution_json::read(&bytes).unwrap());
    assert_ne!(record.flange_holds(), of_robot.flange_holds());
    assert!(promise.contains(record.flange_holds()) && !promise.contains(of_robot.flange_holds()), "{promise}");
    for part in ["urdf", "kinematics", "mdh", "mastering", "compensation"] {
        assert!(files.keys().all(|name| !name.contains(part)), "{part} of no robot");
    }
}

/// Poses by a model that is off by a millimetre and more: there is no rail, and their errors are those of that model.
#[test]
fn errors_of_the_model_in_the_controller_are_no_noise_of_a_rail() {
    let mut all = poses(&truth(), 5);
    let mut dice = Dice::new(9);
    all.iter_mut().for_each(|(_, pose)| {
        *pose = pose.perturbed(&Vector6::from_fn(|k, _| dice.normal(if k < 3 { 1.6e-3 } else { 1e-3 })))
    });
    let folder = series("rotvec_rad", "rx,ry,rz", &all, rotation_vector);
    let calibration = calibrated(&folder).unwrap();
    let found = calibration.solution().findings.iter().find_map(|f| match f {
        Finding::JointNoiseLarge(noise) => Some(noise),
        _ => None,
    });
    assert!(found.unwrap().readings_are_poses, "{found:?}");
}

/// Positions 2 % too long: without a robot there are no links that could say so.
#[test]
fn the_size_of_a_plate_is_told_by_the_positions_of_the_controller() {
    let mut all = poses(&truth(), 5);
    all.iter_mut().for_each(|(_, pose)| pose.translation *= 1.02);
    let calibration = calibrated(&series("rotvec_rad", "rx,ry,rz", &all, rotation_vector)).unwrap();
    let doubted = calibration.solution().findings.iter().find_map(|f| match f {
        Finding::DoubtedSize(DoubtedSize::Contradicted { off, told_by, .. }) => Some((*off, *told_by)),
        _ => None,
    });
    // 50 positions of 0.2 mm over decimetres tell the size to less than 1e-3.
    let (off, told_by) = doubted.unwrap();
    assert!((off - 0.02).abs() < 3e-3 && told_by == ToldBy::Poses, "{off} {told_by:?}");
}

/// The poses are what they are: that nothing is gained over them is no fault.
#[test]
fn poses_without_a_robot_need_no_gain() {
    for seed in 1..4 {
        let folder = series("rotvec_rad", "rx,ry,rz", &poses(&truth(), seed), rotation_vector);
        let calibration = calibrated(&folder).unwrap();
        let solution = calibration.solution();
        assert!(solution.findings.iter().all(|f| f.code() != Code::NoGain), "seed {seed}");
    }
}

#[test]
fn every_convention_of_rotation_says_the_same() {
    let poses = poses(&truth(), 6);
    let all: [(&str, &str, Written); 7] = [
        ("quaternion", "qx,qy,qz,qw", quaternion),
        ("rotvec_rad", "rx,ry,rz", rotation_vector),
        ("abc_deg", "a,b,c", abc_deg),
        ("rpy_rad", "roll,pitch,yaw", roll_pitch_yaw),
        ("wpr_deg", "w,p,r", |p| p.rpy().map(f64::to_degrees).to_vec()),
        ("zyz_deg", "o,a,t", zyz_deg),
        ("xyz_deg", "rx,ry,rz", xyz_deg),
    ];
    for (rotation, columns, written) in all {
        let folder = series(rotation, columns, &poses, written);
        let read = robotcal::series::read(folder.path()).unwrap().controller.unwrap();
        for (read, (image, pose)) in read.base_from_flange.iter().zip(&poses) {
            let (angle, distance) = read.unwrap().distance(pose);
            assert!(angle < 1e-8 && distance < 1e-9, "{rotation}, {image}: {angle} rad, {distance} m");
        }
    }
}

#[test]
fn mistakes_in_poses_are_named() {
    // A few stops are enough to tell, and every hypothesis costs time.
    let poses: Vec<_> = poses(&truth(), 7).into_iter().take(14).collect();
    let inverted: Vec<_> = poses.iter().map(|(i, p)| (i.clone(), p.inverse())).collect();
    let turned_back = |(i, p): &(String, Pose)| (i.clone(), Pose::new(p.rotation.transpose(), p.translation));
    let turned_back: Vec<_> = poses.iter().map(turned_back).collect();
    let far: Vec<_> = poses.iter().map(|(i, p)| (i.clone(), Pose::new(p.rotation, p.translation * 1e3))).collect();
    let first = |p: &Pose| {
        let [x, y, z, w] = p.quaternion_xyzw();
        vec![w, x, y, z]
    };
    let inches: Vec<_> =
        poses.iter().map(|(i, p)| (i.clone(), Pose::new(p.rotation, p.translation / 0.0254))).collect();
    let cases: [(TempDir, Code, &str); 9] = [
        (series("zyz_deg", "o,a,t", &poses, xyz_deg), Code::RotationConvention, "xyz_deg"),
        (series("quaternion", "qx,qy,qz,qw", &poses, first), Code::RotationConvention, "qw"),
        (series("rpy_rad", "roll,pitch,yaw", &poses, rotation_vector), Code::RotationConvention, "rotvec_rad"),
        (series("wpr_deg", "w,p,r", &poses, abc_deg), Code::RotationConvention, "abc_deg"),
        (series("abc_deg", "a,b,c", &poses, zyz_deg), Code::RotationConvention, "zyz_deg"),
        (series("quaternion", "qx,qy,qz,qw", &inverted, quaternion), Code::PosesInverted, "every pose"),
        (series("quaternion", "qx,qy,qz,qw", &turned_back, quaternion), Code::PosesInverted, "rotations alone"),
        (series("quaternion", "qx,qy,qz,qw", &far, quaternion), Code::MillimetresAsMetres, "1000"),
        (series("quaternion", "qx,qy,qz,qw", &inches, quaternion), Code::PlatePitchWrong, "inches"),
    ];
    for (folder, code, part) in cases {
        let error = calibrated(&folder).unwrap_err();
        assert_eq!(error.code, code, "{error}");
        // words: the convention stands in the sentence and nowhere else.
        assert!(error.to_string().contains(part), "{part} is not in {error}");
    }
    for (rotation, columns, written) in [
        ("wpr_deg", "w,p,r", roll_pitch_yaw as Written),
        ("abc_deg", "a,b,c", |p| abc_deg(p).iter().map(|v| v.to_radians()).collect()),
    ] {
        let error = calibrated(&series(rotation, columns, &poses, written)).unwrap_err();
        assert_eq!(error.code, Code::JointUnitWrong, "{error}");
    }
}

#[test]
fn poses_that_contradict_are_told_apart_from_joint_readings() {
    let poses: Vec<_> = poses(&truth(), 7).into_iter().take(14).collect();
    let images = poses.iter().map(|(image, _)| image.clone());
    let of_others: Vec<_> = images.zip(poses.iter().rev().map(|(_, pose)| *pose)).collect();
    let error = calibrated(&series("quaternion", "qx,qy,qz,qw", &of_others, quaternion)).unwrap_err();
    assert_eq!(error.code, Code::ReadingsContradict, "{error}");
    assert!(error.remedy.contains("controller.csv") && !error.remedy.contains("joints.csv"), "{error}");
}

fn urdf() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/ur10e/ur10e.urdf")
}

/// The nominal robot of the dataset, the readings of its stops, and the poses that it has there.
fn by_joints() -> (Robot, Vec<Vec<f64>>, Vec<(String, Pose)>) {
    let joints = robotcal::series::read(&dataset()).unwrap();
    let robot = Robot::nominal(Inputs::read(&urdf(), &[dataset()], Ends::default()).unwrap().chain);
    let readings: Vec<Vec<f64>> = joints.readings_for(&robot.chain).unwrap().into_iter().flatten().collect();
    assert_eq!(readings.len(), joints.stops.stops.len());
    let poses = (joints.stops.stops.iter().zip(&readings)).map(|(s, q)| (s.image.clone(), robot.base_from_tip(q)));
    let poses = poses.collect();
    (robot, readings, poses)
}

#[test]
fn postures_of_poses_identify_the_robot_of_a_urdf() {
    let (robot, _, poses) = by_joints();
    let chain = robot.chain.clone();
    let folder = series("quaternion", "qx,qy,qz,qw", &poses, quaternion);
    let read = robotcal::series::read(folder.path()).unwrap();
    let found = robotcal::identify::readings_of(&read, &chain).unwrap();
    for (q, (image, pose)) in found.iter().zip(&poses) {
        let (angle, distance) = robot.base_from_tip(q.as_ref().unwrap()).distance(pose);
        assert!(angle < 1e-8 && distance < 1e-8, "{image}: {angle} rad, {distance} m");
    }
    let beyond = [(poses[0].0.clone(), Pose::new(poses[0].1.rotation, poses[0].1.translation * 9.0))];
    let folder = series("quaternion", "qx,qy,qz,qw", &[&beyond[..], &poses[1..]].concat(), quaternion);
    let error = robotcal::identify::readings_of(&robotcal::series::read(folder.path()).unwrap(), &chain).unwrap_err();
    assert_eq!(error.code, Code::PoseOutOfReach);
    assert!(error.place.contains("controller.csv:2") && error.place.contains("img_000.png"), "{error}");
}

#[test]
fn stated_angles_of_the_first_stop_fix_its_posture() {
    let (robot, readings, poses) = by_joints();
    let read = |first: usize, angles_deg: Option<&[f64]>| {
        let folder = series("quaternion", "qx,qy,qz,qw", &poses[first..], quaternion);
        let path = folder.path().join("series.toml");
        let stated = angles_deg.map(|a| format!("first_stop_deg = {a:?}\n")).unwrap_or_default();
        fs::write(&path, fs::read_to_string(&path).unwrap() + &stated).unwrap();
        robotcal::identify::readings_of(&robotcal::series::read(folder.path())?, &robot.chain)
    };
    let is_right = |found: &[Option<Vec<f64>>], first: usize| {
        posture_difference(found[0].as_ref().unwrap(), &readings[first]) < 1e-6
    };
    let tens =
        |first: usize| -> Vec<f64> { readings[first].iter().map(|q| 10.0 * (q.to_degrees() / 10.0).round()).collect() };
    let stops = 40..poses.len();
    let unstated = stops.clone().filter(|&k| is_right(&read(k, None).unwrap(), k)).count();
    assert!(unstated < stops.len(), "{unstated}");
    for k in stops {
        assert!(is_right(&read(k, Some(&tens(k))).unwrap(), k), "stop {k}");
    }
    let all = tens(40);
    let elsewhere: Vec<f64> = all.iter().map(|a| a + 40.0).collect();
    assert_eq!(read(40, Some(&all[..5])).unwrap_err().code, Code::SettingRange);
    assert_eq!(read(40, Some(&elsewhere)).unwrap_err().code, Code::SettingConflict);
}

#[test]
fn mistakes_in_the_poses_are_not_blamed_on_right_angles_of_the_first_stop() {
    let (robot, readings, poses) = by_joints();
    let tens: Vec<f64> = readings[40].iter().map(|q| 10.0 * (q.to_degrees() / 10.0).round()).collect();
    let moved =
        |by: &dyn Fn(&Pose) -> Pose| -> Vec<_> { poses[40..].iter().map(|(i, p)| (i.clone(), by(p))).collect() };
    let inches = moved(&|p| Pose::new(p.rotation, p.translation / 0.0254));
    let of_frame = Pose::exp(&Vector6::new(1.5, -0.8, 0.2, 0.0, 0.0, 1.2));
    let in_frame = moved(&|p| of_frame * *p);
    let wpr = |p: &Pose| p.rpy().map(f64::to_degrees).to_vec();
    let cases: [(TempDir, Code, &str); 4] = [
        (series("quaternion", "qx,qy,qz,qw", &inches, quaternion), Code::MeasuredUnit, "controller.csv:2"),
        (series("abc_deg", "a,b,c", &poses[40..], wpr), Code::RotationConvention, "controller.csv:2"),
        (series("abc_deg", "a,b,c", &inches, wpr), Code::MeasuredUnit, "controller.csv:2"),
        (series("quaternion", "qx,qy,qz,qw", &in_frame, quaternion), Code::SettingConflict, "first_stop_deg"),
    ];
    for (folder, code, place) in cases {
        let path = folder.path().join("series.toml");
        fs::write(&path, fs::read_to_string(&path).unwrap() + &format!("first_stop_deg = {tens:?}\n")).unwrap();
        let read = robotcal::series::read(folder.path()).unwrap();
        let error = robotcal::identify::readings_of(&read, &robot.chain).unwrap_err();
        assert_eq!(error.code, code, "{error}");
        assert!(error.place.contains(place), "{error}");
        if code == Code::SettingConflict {
            let distance = error.quantities.iter().find(|q| q.name == "distance").unwrap().value;
            assert!((0.2..4.0).contains(&distance), "{error}");
        }
    }
}

/// Angles about y, x', z'', in which no controller of these writes them.
fn yxz_deg(pose: &Pose) -> Vec<f64> {
    let r = &pose.rotation;
    [r[(0, 2)].atan2(r[(2, 2)]), (-r[(1, 2)]).asin(), r[(1, 0)].atan2(r[(1, 1)])].map(f64::to_degrees).to_vec()
}

/// Images fit poses in a user frame as they are, whatever the robot reaches: nothing is wrong with rotation, unit or direction.
#[test]
fn images_tell_a_user_frame_from_mistakes_in_the_poses() {
    let (_, readings, poses) = by_joints();
    let tens: Vec<f64> = readings[30].iter().map(|q| 10.0 * (q.to_degrees() / 10.0).round()).collect();
    let moved =
        |by: &dyn Fn(&Pose) -> Pose| -> Vec<_> { poses[30..].iter().map(|(i, p)| (i.clone(), by(p))).collect() };
    let of_frame = Pose::exp(&Vector6::new(1.5, -0.8, 0.2, 0.0, 0.0, 1.2));
    let in_frame = moved(&|p| of_frame * *p);
    let wpr = |p: &Pose| p.rpy().map(f64::to_degrees).to_vec();
    let right = &poses[30..];
    let exchanged = moved(&|p| Pose::new(p.rotation, nalgebra::Vector3::new(p.xyz()[1], p.xyz()[0], p.xyz()[2])));
    let shifted: Vec<_> = right.iter().zip(&right[1..]).map(|((i, _), (_, below))| (i.clone(), *below)).collect();
    let refused = |folder: &TempDir, is_stated: bool| {
        if is_stated {
            let path = folder.path().join("series.toml");
            fs::write(&path, fs::read_to_string(&path).unwrap() + &format!("first_stop_deg = {tens:?}\n")).unwrap();
        }
        let inputs = Inputs::read(&urdf(), &[folder.path().to_path_buf()], Ends::default()).unwrap();
        inputs.observe(&Limits::default(), &|_, _| ()).map(|_| ()).unwrap_err()
    };
    let unreached = refused(&series("quaternion", "qx,qy,qz,qw", &in_frame, quaternion), false);
    let quantity = |name: &str| unreached.quantities.iter().find(|q| q.name == name).unwrap().value;
    assert_eq!(unreached.code, Code::PoseOutOfReach, "{unreached}");
    assert!(quantity("reached") < quantity("tried"), "{unreached}");
    let cases: [(TempDir, Code); 6] = [
        (series("quaternion", "qx,qy,qz,qw", &in_frame, quaternion), Code::SettingConflict),
        (series("quaternion", "qx,qy,qz,qw", &exchanged, quaternion), Code::AxesMirrored),
        (series("quaternion", "qx,qy,qz,qw", &shifted, quaternion), Code::RowsShifted),
        (series("abc_deg", "a,b,c", right, wpr), Code::RotationConvention),
        (series("zyz_deg", "o,a,t", right, xyz_deg), Code::RotationConvention),
        // Of a kind that is not known none is named.
        (series("abc_deg", "a,b,c", right, yxz_deg), Code::SettingConflict),
    ];
    for (folder, code) in &cases {
        let error = refused(folder, true);
        assert_eq!(error.code, *code, "{error}");
    }
}

#[test]
fn rows_of_a_controller_that_are_shifted_are_those_of_its_table() {
    let mut poses: Vec<_> = poses(&truth(), 7).into_iter().take(14).collect();
    let images: Vec<String> = poses.iter().map(|(image, _)| image.clone()).collect();
    poses.rotate_left(1);
    poses.iter_mut().zip(images).for_each(|((image, _), own)| *image = own);
    let error = calibrated(&series("quaternion", "qx,qy,qz,qw", &poses, quaternion)).unwrap_err();
    assert_says(&error, Code::RowsShifted, &["controller.csv"]);
}

/// What a controller shows with a tool or a user frame set. A robot that is as in its model would hide any of them in the hand-eye transform or
/// the target pose.
#[test]
fn poses_of_a_tool_or_in_a_frame_are_told_from_those_of_the_flange_in_the_base() {
    let urdf = kr6_urdf();
    let chain = robotcal::urdf::read(&urdf).unwrap().chain(Some("base_link"), Some("link_6")).unwrap();
    let plate = design(&PlateRequest { markers: Some(60), ..PlateRequest::default() }).unwrap().plate;
    let made = simulated(&WorldRequest { images: 40, seed: 5, ..WorldRequest::typical(chain.clone(), plate) }).unwrap();
    let robot = Robot::nominal(chain.clone());
    let limits = reading_limits(&chain);
    // The axis of the flange is x of link_6.
    let cases =
        [(None, [0.0; 3]), (Some(Code::PosesOfTool), [0.1, 0.0, 0.0]), (Some(Code::PosesInFrame), [0.0, 0.0, 0.04])];
    for (code, place) in cases {
        let by = Pose::from_xyz_rpy(place, [0.0; 3]);
        let mut seen = measured(&made, &chain);
        seen.stops.retain_mut(|stop| {
            let flange = robot.base_from_tip(stop.readings.as_ref().unwrap());
            let shown = match code {
                None => flange,
                Some(Code::PosesOfTool) => flange * by,
                _ => by.inverse() * flange,
            };
            stop.readings = solve_from(&robot, &limits, &shown, stop.readings.as_ref().unwrap());
            stop.readings.is_some()
        });
        let computed: Vec<Vec<f64>> = seen.stops.iter().map(|stop| stop.readings.clone().unwrap()).collect();
        assert!(computed.len() > 30);
        // Of all stops but one the angles are stated.
        seen.postures = vec![Vec::new(); computed.len()];
        seen.postures[1].push(turned_over(&computed[1]));
        let options = Options { model: RobotModel::Rigid, ..Options::default() };
        let solution = identify(chain.clone(), &[seen], &options).unwrap();
        let told = solution.findings.iter().find(|f| matches!(f, Finding::ToolInPoses(_)));
        println!("{told:?}");
        assert_eq!(told.map(Finding::code), code);
        for (quantity, true_m) in told.iter().flat_map(|f| f.quantities()).take(3).zip(place) {
            let sigma = quantity.sigma.unwrap();
            assert!(sigma < 0.02 && (quantity.value - true_m).abs() < 4.0 * sigma, "{quantity:?}");
        }
    }
}

/// A tool as long as a hand and turned: what the postures are told to be without it is not what they were.
#[test]
fn a_tool_is_told_whatever_postures_were_taken() {
    let (_, readings, poses) = by_joints();
    let tool = Pose::from_xyz_rpy([0.02, 0.05, 0.15], [0.3, 0.1, 0.5]);
    let of_tool: Vec<(String, Pose)> = poses.into_iter().map(|(image, flange)| (image, flange * tool)).collect();
    let folder = series("quaternion", "qx,qy,qz,qw", &of_tool, quaternion);
    let inputs = Inputs::read(&urdf(), &[folder.path().to_path_buf()], Ends::default()).unwrap();
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    let calibration = Calibration::of(inputs.observe(&options.limits, &|_, _| ()).unwrap(), &options).unwrap();
    let solution = calibration.solution();
    let told = solution.findings.iter().find(|f| matches!(f, Finding::ToolInPoses(_))).unwrap();
    assert_eq!(told.code(), Code::PosesOfTool, "{told:?}");
    let off = told.quantities().iter().take(3).zip(tool.xyz()).map(|(q, m)| (q.value - m).powi(2)).sum::<f64>().sqrt();
    // The turn about the axis of the flange is not told, and takes the place across it along.
    println!("{} stops, {told:?}", readings.len());
    assert!(off < 0.06, "{told:?}");
    assert!(solution.findings.iter().all(|f| f.code() != Code::PosturesByImages), "{:?}", solution.findings);
}

/// The same pose with the wrist turned over.
fn turned_over(q: &[f64]) -> Vec<f64> {
    [q[0], q[1], q[2], q[3] - PI * q[3].signum(), -q[4], q[5] - PI * q[5].signum()].to_vec()
}

#[test]
fn poses_do_not_tell_the_readings_of_seven_joints() {
    let (_, _, poses) = by_joints();
    let folder = series("quaternion", "qx,qy,qz,qw", &poses, quaternion);
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/lbr_iiwa_14/lbr_iiwa_14.urdf");
    let chain = robotcal::urdf::read(&urdf).unwrap().chain(None, None).unwrap();
    let error = robotcal::identify::readings_of(&robotcal::series::read(folder.path()).unwrap(), &chain).unwrap_err();
    assert_eq!(error.code, Code::JointMissing);
}

/// Largest difference of two postures but for full turns, rad.
fn posture_difference(a: &[f64], b: &[f64]) -> f64 {
    let turned = |(a, b): (&f64, &f64)| ((a - b) - TAU * ((a - b) / TAU).round()).abs();
    a.iter().zip(b).map(turned).fold(0.0, f64::max)
}

/// Stops in the posture of their readings, where that nearest to the stop before is taken, and as the calibration tells it.
fn nearest_and_told(folder: &Path, chain: &Chain, readings: &[Vec<f64>]) -> ([usize; 2], Calibration) {
    let right = |found: Vec<&[f64]>| {
        found.into_iter().zip(readings).filter(|(found, read)| posture_difference(found, read) < 1e-3).count()
    };
    let nearest = robotcal::identify::readings_of(&robotcal::series::read(folder).unwrap(), chain).unwrap();
    let nearest = right(nearest.iter().flatten().map(Vec::as_slice).collect());
    let inputs = Inputs::read(&urdf(), &[folder.to_path_buf()], Ends::default()).unwrap();
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    let calibration = Calibration::of(inputs.observe(&options.limits, &|_, _| ()).unwrap(), &options).unwrap();
    let told = &calibration.solution().series[0].stops;
    let told = right(told.iter().filter_map(|s| s.readings.as_deref()).collect());
    ([nearest, told], calibration)
}

/// The stops of the dataset are in all postures, the nearest of which is right by chance.
#[test]
fn the_images_tell_in_which_posture_a_pose_was_reached() {
    let (robot, readings, poses) = by_joints();
    let chain = robot.chain;
    let folder = series("quaternion", "qx,qy,qz,qw", &poses, quaternion);
    let ([nearest, told], calibration) = nearest_and_told(folder.path(), &chain, &readings);
    let solution = calibration.solution();
    println!("nearest {nearest}, told {told} of {}", readings.len());
    assert!(nearest < readings.len() / 2 && told + 1 >= readings.len(), "{nearest}, {told}");
    assert!(solution.findings.iter().any(|f| f.code() == Code::PosturesByImages));
    the_same_is_open_in_its_file(&calibration);
}

/// Solved again from its solution.json.
fn the_same_is_open_in_its_file(calibration: &Calibration) {
    let files = calibration.files(&Export::default()).unwrap();
    let record = solution_json::read(&files["solution.json"]).unwrap();
    let restored = robotcal::output::restore::measured_series(&record).unwrap();
    assert_eq!(restored[0].postures, calibration.solution().series[0].postures);
    assert!(restored[0].readings_are_computed());
}

/// A series of these poses of the controller without images, and what a tracker with this noise saw of the real robot at these readings.
fn tracked(poses: &[(String, Pose)], readings: &[Vec<f64>], as_poses: bool) -> TempDir {
    let folder = series("quaternion", "qx,qy,qz,qw", poses, quaternion);
    for file in ["plate.toml", "plate.csv", "observations.csv"] {
        fs::remove_file(folder.path().join(file)).unwrap();
    }
    let manifest = "format = 1\nbase = \"base_link\"\ntip = \"tool0\"\n[controller]\nrotation = \"quaternion\"\n";
    fs::write(folder.path().join("series.toml"), manifest).unwrap();
    let truth = truth();
    let robot = truth.robot(&Inputs::read(&urdf(), &[dataset()], Ends::default()).unwrap().chain).unwrap();
    let tracker = Pose::exp(&Vector6::new(2.5, 0.4, -0.3, 0.2, -0.1, 1.9)).inverse();
    let target = Pose::exp(&Vector6::new(0.06, -0.03, 0.12, 0.4, 0.3, -0.2));
    let mut dice = Dice::new(23);
    let turned = if as_poses { ",qx,qy,qz,qw,sigma_m,sigma_rad" } else { ",sigma_m" };
    let mut table = format!("stop,target,x_m,y_m,z_m{turned}\n");
    for ((name, _), q) in poses.iter().zip(readings) {
        let noise = Vector6::from_fn(|k, _| dice.normal(if k < 3 { TRACKER_M } else { TRACKER_RAD }));
        let seen = (tracker * robot.base_from_tip(q) * target).perturbed(&noise);
        let turned = if as_poses { quaternion(&seen) } else { Vec::new() };
        let sigmas = if as_poses { vec![TRACKER_M, TRACKER_RAD] } else { vec![TRACKER_M] };
        let cells: Vec<String> =
            seen.xyz().into_iter().chain(turned).chain(sigmas).map(|v| format!("{v:.9}")).collect();
        writeln!(table, "{name},target,{}", cells.join(",")).unwrap();
    }
    fs::write(folder.path().join(if as_poses { "poses.csv" } else { "points.csv" }), table).unwrap();
    folder
}

const TRACKER_M: f64 = 3e-5;
const TRACKER_RAD: f64 = 1e-4;

/// Where no image sees a stop, what a tracker measured there tells its posture as images do.
#[test]
fn a_tracker_tells_in_which_posture_a_pose_was_reached() {
    let (robot, readings, poses) = by_joints();
    let chain = robot.chain;
    for as_poses in [true, false] {
        let folder = tracked(&poses, &readings, as_poses);
        let ([nearest, told], calibration) = nearest_and_told(folder.path(), &chain, &readings);
        let solution = calibration.solution();
        let all = readings.len();
        println!("poses {as_poses}: nearest {nearest}, told {told} of {all}");
        assert!(nearest < all / 2 && told + 2 >= all, "{nearest}, {told}");
        let said = solution.findings.iter().find_map(|f| match f {
            Finding::ComputedPostures(said) => Some(said),
            _ => None,
        });
        let said = said.unwrap();
        assert_eq!((said.stops, said.others.len(), said.is_open), (all, told - nearest, false), "{said:?}");
        the_same_is_open_in_its_file(&calibration);
    }
}

#[test]
fn a_wrist_turned_over_at_all_stops_is_told_to_be_open() {
    let urdf = kr6_urdf();
    let chain = robotcal::urdf::read(&urdf).unwrap().chain(Some("base_link"), Some("link_6")).unwrap();
    let plate = design(&PlateRequest { markers: Some(60), ..PlateRequest::default() }).unwrap().plate;
    let made = simulated(&WorldRequest { images: 24, seed: 4, ..WorldRequest::typical(chain.clone(), plate) }).unwrap();
    let mut seen = measured(&made, &chain);
    let truth: Vec<Vec<f64>> = seen.stops.iter().map(|s| s.readings.clone().unwrap()).collect();
    let robot = Robot::nominal(chain.clone());
    for (k, (stop, q)) in seen.stops.iter_mut().zip(&truth).enumerate() {
        let other = turned_over(q);
        let (angle, distance) = robot.base_from_tip(q).distance(&robot.base_from_tip(&other));
        assert!(angle < 1e-6 && distance < 1e-6, "{angle}, {distance}");
        let [first, second] = if k % 3 == 1 { [other, q.clone()] } else { [q.clone(), other] };
        stop.readings = Some(first);
        seen.postures.push(vec![second]);
    }
    let seen = [seen];
    let solution = identify(chain.clone(), &seen, &Options::default()).unwrap();
    let told = solution.series[0].stops.iter().zip(&truth);
    let right = told.filter(|(s, q)| posture_difference(s.readings.as_ref().unwrap(), q) < 1e-3).count();
    assert_eq!(right, truth.len());
    let finding = solution.findings.iter().find(|f| f.code() == Code::PosturesByImages).unwrap();
    let Finding::ComputedPostures(found) = finding else { panic!("{finding}") };
    assert!(found.is_open && found.others.len() == 8 && found.stops == 24, "{finding}");
    assert!(finding.fails());
    // The angles of one stop tell the side of the wrist at all of them.
    let mut stated = seen[0].clone();
    stated.postures[0].clear();
    let by_one = identify(chain.clone(), &[stated], &Options::default()).unwrap();
    let side = by_one.findings.iter().find(|f| f.code() == Code::PosturesByImages).unwrap();
    assert!(matches!(side, Finding::ComputedPostures(found) if !found.is_open && found.others.len() == 8), "{side}");
    // What was read beside it, of older files without the other postures, goes with them.
    let unseen = |s: &MeasuredStop| MeasuredStop { observations: Shared::default(), ..s.clone() };
    let stops = seen[0].stops.iter().map(unseen).collect();
    let beside = MeasuredSeries::without_images("beside", seen[0].order_known, stops);
    let beside = MeasuredSeries { run: Some(seen[0].name.clone()), ..beside };
    let both = identify(chain, &[seen[0].clone(), beside], &Options::default()).unwrap();
    assert_eq!(both.series[1].stops[1].readings, both.series[0].stops[1].readings);
    // A robot that is judged by such poses is judged in the same postures.
    let mut by_readings = solution.series.clone();
    by_readings[0].postures.clear();
    let robot = solution.exported_robot();
    let judged = verify_series(&robot, &seen, &Limits::default()).unwrap().into_images();
    assert_eq!(judged, verify_series(&robot, &by_readings, &Limits::default()).unwrap().into_images());
    assert!(judged.len() >= 20, "{}", judged.len());
}

/// Twelve poses of three heights and orientations: a coordinate that is read again is another posture of the arm behind it, and each image is held out
/// by itself. (With all of a height held out together, the rest did not tell the camera, and an image behind it had no error at all.)
#[test]
#[ignore = "needs the real series"]
fn poses_that_share_coordinates_are_held_out_one_by_one() {
    let real = crate::robots::shared("real").join("ric-10x10");
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("images")).unwrap();
    for file in ["plate.toml", "series.toml"] {
        fs::copy(real.join(file), folder.path().join(file)).unwrap();
    }
    let text = fs::read_to_string(real.join("controller.csv")).unwrap();
    let kept: Vec<&str> =
        text.lines().enumerate().filter(|(row, _)| !matches!(row, 5 | 10 | 15)).map(|(_, l)| l).collect();
    fs::write(folder.path().join("controller.csv"), kept.join("\n")).unwrap();
    for image in kept[1..].iter().filter_map(|line| line.split(',').next()) {
        fs::copy(real.join("images").join(image), folder.path().join("images").join(image)).unwrap();
    }
    let calibration = calibrated(&folder).unwrap();
    let accuracy = &calibration.solution().accuracy;
    let held_out: Vec<[f64; 2]> = accuracy.per_image_mm.iter().flatten().copied().collect();
    assert_eq!((accuracy.folds, held_out.len()), (6, 12));
    assert!(held_out.iter().flatten().all(|mm| *mm < 30.0), "{held_out:?}");
}
