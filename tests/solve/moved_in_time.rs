//! A plate or a camera that moves by a millimetre during a series is named with the image from which on it stands elsewhere,
//! one that creeps is said to creep; series in which nothing moved are not accused.

use nalgebra::Vector6;
use robotcal::Code;
use robotcal::assess::Limits;
use robotcal::diagnose::{BodyMoved, Carried, Displaced, Displacement, Finding, Quantity, Weight, agreement};
use robotcal::geom::Pose;
use robotcal::identify::{Options, RobotModel, Solution, identify};
use robotcal::init::{HandEye, SeenStop};
use robotcal::model::camera::Lens;
use robotcal::plan::plate_design::{PlateRequest, design};
use robotcal::problem::{ImageRejection, LensChoice, MeasuredSeries, Problem};
use robotcal::series::{CameraMount, Plate, PlateKind};
use robotcal::simulate::{RobotErrors, SimulatedSeries, WorldRequest, lens_camera, series};
use robotcal::study::measured;
use std::path::Path;

use crate::robots::kr6;
use crate::support::displaced::change;
use crate::support::small::{Dice, Request, problem};

const RADIUS_M: f64 = 0.01;

fn seen(mount: CameraMount, images: usize, seed: u64) -> SimulatedSeries {
    seen_of(0.03e-3, mount, images, seed)
}

/// Of a plate whose markers are off by so much, m.
fn seen_of(marker_noise_m: f64, mount: CameraMount, images: usize, seed: u64) -> SimulatedSeries {
    let mut plate = Plate::lattice(PlateKind::Points, 8, 6, 0.038, marker_noise_m);
    plate.markers.iter_mut().for_each(|m| m.outer_radius_m = RADIUS_M);
    let request = WorldRequest { mount, images, least_markers: 12, seed, ..WorldRequest::typical(kr6(), plate) };
    series(&request).unwrap()
}

fn solved(series: &SimulatedSeries) -> Solution {
    let chain = kr6();
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    identify(chain.clone(), &[measured(series, &chain)], &options).unwrap()
}

fn by(x: f64, y: f64, z: f64) -> Pose {
    Pose::exp(&Vector6::new(x, y, z, 0.0, 0.0, 0.0))
}

/// The only failed gate that names a displacement.
fn told(solution: &Solution) -> &Displaced {
    let displaced = solution.findings.iter().filter_map(|f| match f {
        Finding::Displaced(d) if f.fails() => Some(d),
        _ => None,
    });
    let all: Vec<&Displaced> = displaced.collect();
    assert_eq!(all.len(), 1, "{:?}", solution.findings);
    all[0]
}

/// From `first` on a body stands a millimetre elsewhere.
fn assert_moved_by_a_millimetre(found: &Displaced, body: Carried, first: &str) {
    assert_eq!((found.body, found.displacement), (body, Displacement::FromThenOn), "{found:?}");
    assert_eq!(found.images[0], first, "{found:?}");
    // A tenth is five times what 12 images with 0.02 mrad of joint noise at 1 m leave unknown.
    assert!((found.distance_m.0 - 1e-3).abs() < 1e-4, "{found:?}");
}

#[test]
fn a_plate_moved_by_a_millimetre_half_way_is_named() {
    let mut series = seen(CameraMount::Hand, 24, 3);
    change(&mut series, 12..24, |pose| pose * by(0.8e-3, -0.6e-3, 0.0));
    let solution = solved(&series);
    assert_moved_by_a_millimetre(told(&solution), Carried::Plate, &series.stops.stops[12].image);
}

#[test]
fn the_remedy_for_a_moved_plate_makes_the_result_good() {
    let mut series = seen(CameraMount::Hand, 24, 3);
    change(&mut series, 12..24, |pose| pose * by(0.8e-3, -0.6e-3, 0.0));
    series.stops.stops[12..].iter_mut().for_each(|s| s.placement = "moved".into());
    let solution = solved(&series);
    assert!(solution.failed_gates().is_empty(), "{:?}", solution.findings);
}

#[test]
fn a_camera_bumped_by_a_millimetre_is_named() {
    let mut series = seen(CameraMount::Hand, 24, 4);
    change(&mut series, 15..24, |pose| by(1e-3, 0.0, 0.0) * pose);
    assert_moved_by_a_millimetre(told(&solved(&series)), Carried::CameraInHand, &series.stops.stops[15].image);
}

/// By too little for single images to tell it, and as far as a camera that moves along its axis by a third of a millimetre.
#[test]
fn a_change_of_focus_is_no_moved_camera() {
    let mut series = seen(CameraMount::Hand, 24, 4);
    let [cx, cy] = [2, 3].map(|k| series.truth.camera.parameters[k]);
    let longer = 0.8e-3;
    for image in &mut series.observations[12..] {
        for o in &mut image.observations {
            o.uv = [o.uv[0] + longer * (o.uv[0] - cx), o.uv[1] + longer * (o.uv[1] - cy)];
        }
    }
    let solution = solved(&series);
    let found: Vec<&Finding> = solution.findings.iter().filter(|f| f.code() == Code::FocusChanged).collect();
    let [Finding::FocusChange(found)] = found[..] else { panic!("{:?}", solution.findings) };
    assert_eq!(found.image, series.stops.stops[12].image, "{found:?}");
    assert!((found.change - longer).abs() < 0.3 * longer, "{found:?}");
    let displaced = |f: &Finding| matches!(f, Finding::Displaced(_)) && f.fails();
    assert!(!solution.findings.iter().any(displaced), "{:?}", solution.findings);
}

#[test]
fn a_camera_turned_once_is_not_called_loose() {
    let mut series = seen(CameraMount::Hand, 24, 5);
    let turned = Pose::exp(&Vector6::new(0.0, 0.0, 0.0, 3e-3, 0.0, 0.0));
    change(&mut series, 10..24, |pose| turned * pose);
    let solution = solved(&series);
    let found = told(&solution);
    assert_eq!((found.body, found.displacement), (Carried::CameraInHand, Displacement::FromThenOn), "{found:?}");
    assert_eq!(found.images[0], series.stops.stops[10].image, "{found:?}");
    assert!(!solution.findings.iter().any(|f| f.code() == Code::LooseMounting), "{:?}", solution.findings);
}

/// What holds a camera in the hand is its mount; a fixed one stands, and the plate on the tip may tip over as well.
#[test]
fn what_is_loose_is_named_by_where_the_camera_is() {
    for (mount, held_by) in [(CameraMount::Hand, "camera mount "), (CameraMount::Fixed, "camera stand ")] {
        let mut series = seen(mount, 24, 5);
        let turned = Pose::exp(&Vector6::new(0.0, 0.0, 0.0, 3e-3, 0.0, 0.0));
        for k in [0, 1, 4, 6, 9, 10, 13, 15, 18, 20, 23] {
            change(&mut series, k..k + 1, |pose| turned * pose);
        }
        let solution = solved(&series);
        let loose = solution.findings.iter().find_map(|f| match f {
            Finding::LooseMounting(loose) => Some((loose, f.notice().place)),
            _ => None,
        });
        let (loose, place) = loose.unwrap_or_else(|| panic!("{mount:?}: {:?}", solution.findings));
        assert!(loose.mount == mount && place.starts_with(held_by), "{place}: {loose:?}");
    }
}

#[test]
fn a_camera_that_its_weight_shifts_is_named() {
    let mut series = seen(CameraMount::Hand, 24, 7);
    let plate = series.truth.plate_poses[&series.stops.stops[0].placement].pose();
    let up = |pose: Pose| (plate * pose.inverse()).rotation[(2, 0)];
    change(&mut series, 0..24, |pose| if up(pose) > 0.0 { by(1e-3, 0.0, 0.0) * pose } else { pose });
    let solution = solved(&series);
    let found = told(&solution);
    assert_eq!((found.body, found.displacement), (Carried::CameraInHand, Displacement::AxisUp(0)), "{found:?}");
    assert!((found.distance_m.0 - 1e-3).abs() < 1e-4, "{found:?}");
}

/// Few stops with one error each, which no joint noise explains: a division by tilt takes more than half of it by chance.
#[test]
fn errors_that_follow_the_posture_of_few_stops_are_no_loose_camera() {
    for seed in 0..12 {
        let mut series = seen(CameraMount::Hand, 12, seed);
        let mut dice = Dice::new(seed);
        (0..12).for_each(|k| {
            let by_posture = dice.normal(0.3e-3);
            change(&mut series, k..k + 1, |pose| by(by_posture, 0.0, 0.0) * pose);
        });
        let solution = solved(&series);
        let loose = |f: &Finding| f.fails() && f.code() == Code::CameraLoose;
        assert!(!solution.findings.iter().any(loose), "seed {seed}: {:?}", solution.findings);
    }
}

#[test]
fn a_plate_that_slips_in_the_hand_is_named() {
    let mut series = seen(CameraMount::Fixed, 24, 6);
    change(&mut series, 8..24, |pose| pose * by(0.0, 1e-3, 0.0));
    assert_moved_by_a_millimetre(told(&solved(&series)), Carried::PlateInHand, &series.stops.stops[8].image);
}

#[test]
fn a_plate_and_a_camera_that_creep_are_not_called_moved_once() {
    let far = |k: usize| 0.3e-3 * k as f64 / 23.0;
    let mut plate = seen(CameraMount::Hand, 24, 8);
    (0..24).for_each(|k| change(&mut plate, k..k + 1, |pose| pose * by(0.8 * far(k), -0.6 * far(k), 0.0)));
    let mut camera = seen(CameraMount::Hand, 24, 9);
    (0..24).for_each(|k| change(&mut camera, k..k + 1, |pose| by(0.0, 0.0, far(k)) * pose));
    for (series, body, code) in
        [(plate, Carried::Plate, Code::PlateDrifts), (camera, Carried::CameraInHand, Code::CameraDrifts)]
    {
        let solution = solved(&series);
        let found = told(&solution);
        assert_eq!((found.body, found.displacement), (body, Displacement::AllThrough), "{found:?}");
        assert!(solution.findings.iter().any(|f| f.code() == code), "{:?}", solution.findings);
        assert!((found.distance_m.0 - 0.3e-3).abs() < 5.0 * found.distance_m.1, "{found:?}");
        assert!(found.distance_m.1 < 0.1e-3, "{found:?}");
    }
}

/// Half a milliradian over the series: a step in the middle of it explains three quarters, and either half would still creep.
#[test]
fn a_zero_that_creeps_is_not_called_mastered_anew() {
    const MOST_RAD: f64 = 0.5e-3;
    for (seed, joint) in [(11, 1), (12, 3)] {
        let chain = kr6();
        let mut series = measured(&seen(CameraMount::Hand, 30, seed), &chain);
        for (k, stop) in series.stops.iter_mut().enumerate() {
            stop.readings.as_mut().unwrap()[joint] -= MOST_RAD * k as f64 / 29.0;
        }
        let options = Options { model: RobotModel::Rigid, ..Options::default() };
        let solution = identify(chain.clone(), &[series], &options).unwrap();
        let zeros = solution.findings.iter().filter_map(|f| if let Finding::ZeroMoved(z) = f { Some(z) } else { None });
        let [found] = zeros.collect::<Vec<_>>()[..] else { panic!("{:?}", solution.findings) };
        assert_eq!((&found.joint, found.displacement), (&chain.readings[joint], Displacement::AllThrough), "{found:?}");
        assert!((found.offset.0 - MOST_RAD).abs() < 5.0 * found.offset.1 && found.offset.1 < 0.2e-3, "{found:?}");
    }
}

#[test]
fn a_zero_that_moved_leaves_no_plate_in_two_places() {
    for seed in 21..25 {
        let mut series = measured(&seen(CameraMount::Hand, 40, seed), &kr6());
        series.stops[22..].iter_mut().filter_map(|s| s.readings.as_mut()).for_each(|q| q[2] -= 1e-3);
        let options = Options { model: RobotModel::Rigid, ..Options::default() };
        let solution = identify(kr6(), &[series], &options).unwrap();
        let gates = solution.findings.iter().filter(|f| f.weight() == Weight::Gate);
        let gates: Vec<Code> = gates.map(Finding::code).collect();
        println!("{seed}: {gates:?}");
        assert!(gates.contains(&Code::ZeroMoved) && !gates.contains(&Code::PlateDisplaced), "{gates:?}");
    }
}

/// Observations that state a noise of a pixel leave a pixel and more: no camera that does not fit.
#[test]
fn stated_noise_is_no_misfit_of_the_camera() {
    let plate = Plate::lattice(PlateKind::Points, 8, 6, 0.038, 0.03e-3);
    let request = WorldRequest {
        images: 24,
        least_markers: 12,
        seed: 13,
        pixel_sigma_px: 1.0,
        ..WorldRequest::typical(kr6(), plate)
    };
    let solution = solved(&series(&request).unwrap());
    let misfit = solution.findings.iter().find(|f| f.code() == Code::CameraModelMisfit);
    assert!(solution.free_poses.rms_px > 1.0 && misfit.is_none(), "{:?}", solution.findings);
}

#[test]
fn what_creeps_by_little_is_a_doubt() {
    let far = |k: usize| 0.1e-3 * k as f64 / 23.0;
    let mut series = seen(CameraMount::Hand, 24, 8);
    (0..24).for_each(|k| change(&mut series, k..k + 1, |pose| pose * by(0.8 * far(k), -0.6 * far(k), 0.0)));
    let solution = solved(&series);
    assert!(solution.failed_gates().is_empty(), "{:?}", solution.findings);
    let found = solution.findings.iter().find_map(|f| if let Finding::Displaced(d) = f { Some(d) } else { None });
    let found = found.unwrap();
    assert_eq!((found.body, found.displacement), (Carried::Plate, Displacement::AllThrough), "{found:?}");
    assert!(!found.explains_most && (found.distance_m.0 - 0.1e-3).abs() < 3.0 * found.distance_m.1, "{found:?}");
}

#[test]
fn series_in_which_nothing_moved_are_not_accused() {
    for (mount, images, seed) in [
        (CameraMount::Hand, 12, 11),
        (CameraMount::Hand, 16, 12),
        (CameraMount::Hand, 24, 13),
        (CameraMount::Hand, 24, 14),
        (CameraMount::Fixed, 16, 15),
        (CameraMount::Fixed, 24, 16),
    ] {
        let solution = solved(&seen(mount, images, seed));
        let accused = solution.findings.iter().any(|f| matches!(f, Finding::Displaced(_)));
        assert!(!accused, "{mount:?} {images} images, seed {seed}: {:?}", solution.findings);
    }
}

/// Twenty stops and 125 parameters of a robot: hardly a square of joint noise is left, and a step takes more off the priors than off those.
#[test]
fn few_stops_of_a_robot_of_many_parameters_are_not_accused() {
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/lbr_iiwa_14/lbr_iiwa_14.urdf");
    let chain = robotcal::urdf::read(&urdf).unwrap().chain(None, None).unwrap();
    let plate = design(&PlateRequest::default()).unwrap().plate;
    let request = WorldRequest {
        camera: lens_camera(Lens::Parallax, 1280, 1024, 85_f64.to_radians()),
        images: 20,
        errors: RobotErrors::full(),
        pixel_sigma_px: 0.2,
        marker_sigma_m: 0.1e-3,
        held_out: 60,
        seed: 33,
        ..WorldRequest::typical(chain.clone(), plate)
    };
    let made = series(&request).unwrap();
    let seen = MeasuredSeries { lens: Lens::Parallax, lens_choice: LensChoice::Settled, ..measured(&made, &chain) };
    let options = Options { model: RobotModel::Full, ..Options::default() };
    let solution = identify(chain, &[seen], &options).unwrap();
    let accused: Vec<&Finding> =
        solution.findings.iter().filter(|f| matches!(f, Finding::Displaced(_)) || f.fails()).collect();
    assert!(accused.is_empty(), "{accused:?}");
}

/// A series is refused, or its result fails a gate, with this code and these names of joints and images.
/// Its numbers.
fn assert_named(series: &MeasuredSeries, code: Code, names: &[&str]) -> Vec<Quantity> {
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    let (said, quantities) = match identify(kr6(), std::slice::from_ref(series), &options) {
        Err(refusal) => {
            assert_eq!(refusal.code, code, "{refusal}");
            (refusal.to_string(), refusal.quantities)
        }
        Ok(solution) => {
            let found = solution.findings.iter().find(|f| f.code() == code && f.fails());
            let found = found.unwrap_or_else(|| panic!("{:?}", solution.findings));
            (format!("{:?}: {}", found.subjects(), found.seen()), found.quantities())
        }
    };
    names.iter().for_each(|name| assert!(said.contains(name), "{name}: {said}"));
    quantities
}

/// Something large happens after half of the images, after which no start fits most of them, or after three quarters, after which the others are
/// left out.
#[test]
fn what_breaks_a_series_is_named() {
    let made = seen(CameraMount::Hand, 24, 3);
    let good = measured(&made, &kr6());
    for from in [12, 18] {
        let first = good.stops[from].image.as_str();
        let joint = |change: &dyn Fn(&mut Vec<f64>)| {
            let mut series = good.clone();
            series.stops[from..].iter_mut().filter_map(|s| s.readings.as_mut()).for_each(change);
            series
        };
        assert_named(&joint(&|q| q[2] += 0.3), Code::ZeroMoved, &["joint_a3", first]);
        assert_named(&joint(&|q| q[5] -= 1.5), Code::ZeroMoved, &["joint_a6", first]);
        let moved = |by: &dyn Fn(Pose) -> Pose| {
            let mut series = made.clone();
            change(&mut series, from..24, by);
            measured(&series, &kr6())
        };
        let pushed = Pose::exp(&Vector6::new(0.03, 0.02, 0.0, 0.0, 0.0, 0.5));
        assert_named(&moved(&|pose| pose * pushed), Code::PlateMoved, &[first]);
        assert_named(&moved(&|pose| pushed * pose), Code::CameraMoved, &[first]);
        // Hardly turned: directions fit, and distances do not, as with other links.
        let slid = Pose::exp(&Vector6::new(0.06, 0.03, 0.0, 0.0, 0.0, 5e-3));
        assert_named(&moved(&|pose| pose * slid), Code::PlateMoved, &[first]);
    }
    for from in [7, 18] {
        let mut series = good.clone();
        let stuck = series.stops[from - 1].readings.as_ref().unwrap()[1];
        series.stops[from..].iter_mut().filter_map(|s| s.readings.as_mut()).for_each(|q| q[1] = stuck);
        assert_named(&series, Code::JointReadingsWrong, &["joint_a2", &good.stops[23].image]);
    }
}

/// Two equal boards in view: every fourth image shows the other one, and nothing was moved.
#[test]
fn a_place_that_comes_and_goes_is_no_move() {
    let pushed = Pose::exp(&Vector6::new(0.05, 0.02, 0.0, 0.0, 0.0, 0.3));
    let told = |elsewhere: &dyn Fn(usize) -> bool| {
        let mut series = seen(CameraMount::Hand, 36, 3);
        (0..36).filter(|k| elsewhere(*k)).for_each(|k| change(&mut series, k..k + 1, |pose| pose * pushed));
        let solution = solved(&series);
        let moved = solution.findings.iter().find_map(|f| match f {
            Finding::BodyMoved(moved) => Some((f.code(), moved.images.len(), moved.by_turns)),
            _ => None,
        });
        moved.unwrap_or_else(|| panic!("{:?}", solution.findings))
    };
    assert_eq!(told(&|k| k % 4 == 1), (Code::PlateMoved, 9, true));
    assert_eq!(told(&|k| k >= 27), (Code::PlateMoved, 9, false));
}

/// Images that fit and stand between those of another place tell of turns. What was left out tells nothing, nor do images of another placement.
#[test]
fn turns_are_told_by_images_that_fit_between() {
    let request = Request { images: 24, placements: 2, ..Request::default() };
    let (mut made, state) = problem(&mut Dice::new(9), &request);
    let others = HandEye { camera: state.mountings[0], plate: state.placements[0] };
    let elsewhere = others.plate * Pose::exp(&Vector6::new(0.05, 0.02, 0.0, 0.0, 0.0, 0.3));
    let by_turns = |made: &Problem, images: &[usize]| {
        let stop = |i: &usize| {
            let readings = made.posture(*i).unwrap().readings.clone();
            let (mount, tip) = (CameraMount::Hand, state.robot.base_from_tip(&readings));
            SeenStop { camera_from_plate: mount.camera_from_plate(&others.camera, &tip, &elsewhere), readings, mount }
        };
        let seen: Vec<SeenStop> = images.iter().map(stop).collect();
        let limits = Limits::default();
        let found = agreement(&state.robot, &others, &seen, &limits).unwrap();
        assert_eq!(found.members, (0..images.len()).collect::<Vec<usize>>());
        BodyMoved::of(made, images, found, &limits).unwrap().by_turns
    };
    // Every second image is of the first placement.
    assert!(by_turns(&made, &[0, 4, 8, 12]));
    assert!(!by_turns(&made, &[0, 2, 4, 6]));
    assert!(!by_turns(&made, &[16, 18, 20, 22]));
    made.images[6].rejected = Some(ImageRejection::Excluded);
    assert!(!by_turns(&made, &[0, 4, 8, 12]));
    assert!(by_turns(&made, &[0, 4, 8, 12, 16]));
}

/// Pictures of the camera turned by half a turn about the point that its axis meets.
#[test]
fn images_that_are_turned_are_no_moved_camera() {
    let made = seen(CameraMount::Hand, 24, 3);
    let [cx, cy] = [2, 3].map(|k| made.truth.camera.parameters[k]);
    for from in [12, 18] {
        let mut turned = made.clone();
        for image in &mut turned.observations[from..] {
            image.observations.iter_mut().for_each(|o| o.uv = [2.0 * cx - o.uv[0], 2.0 * cy - o.uv[1]]);
        }
        let series = measured(&turned, &kr6());
        let told = assert_named(&series, Code::ImagesTurned, &[series.stops[from].image.as_str()]);
        let turn = told.iter().find(|q| q.name == "turn").unwrap().value;
        assert!((turn - std::f64::consts::PI).abs() < 1e-9, "{told:?}");
    }
}

/// Every third picture is turned: the list is of these, as the others stand between the first and the last of them.
#[test]
fn images_that_are_turned_among_others_are_listed_one_by_one() {
    let mut made = seen(CameraMount::Hand, 24, 3);
    let [cx, cy] = [2, 3].map(|k| made.truth.camera.parameters[k]);
    for image in made.observations.iter_mut().step_by(3) {
        image.observations.iter_mut().for_each(|o| o.uv = [2.0 * cx - o.uv[0], 2.0 * cy - o.uv[1]]);
    }
    let series = measured(&made, &kr6());
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    let said = match identify(kr6(), std::slice::from_ref(&series), &options) {
        Err(refusal) => {
            assert_eq!(refusal.code, Code::ImagesTurned, "{refusal}");
            refusal.what
        }
        Ok(solution) => {
            let found = solution.findings.iter().find(|f| f.code() == Code::ImagesTurned);
            found.unwrap_or_else(|| panic!("{:?}", solution.findings)).seen()
        }
    };
    for (k, stop) in series.stops.iter().enumerate() {
        assert_eq!(said.contains(&stop.image), k % 3 == 0, "{}: {said}", stop.image);
    }
}

/// A board that has a first corner, whose corners another program counts from the last one in some images: the plate stands where it does.
#[test]
fn ids_that_are_counted_from_the_other_end_are_no_moved_plate() {
    // So little that the images do not contradict each other already.
    let made = seen_of(1e-6, CameraMount::Hand, 30, 3);
    let mut series = measured(&made, &kr6());
    let last = series.plate.markers.len() as u32 - 1;
    assert_eq!(series.plate.markers.iter().map(|m| m.id).collect::<Vec<_>>(), (0..=last).collect::<Vec<_>>());
    for stop in series.stops.iter_mut().skip(2).step_by(5) {
        stop.observations.iter_mut().for_each(|o| o.marker = last - o.marker);
        stop.observations.sort_by_key(|o| (o.marker, o.edge));
    }
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    let solution = identify(kr6(), &[series], &options).unwrap();
    let found = solution.findings.iter().find(|f| f.code() == Code::IdsReversed);
    let found = found.unwrap_or_else(|| panic!("{:?}", solution.findings));
    assert_eq!(found.subjects().len(), 6, "{found}");
    assert!(found.quantities()[0].value < 5e-3, "{found}");
}

/// Whole degrees are a noise of 5 mrad: nothing moved.
#[test]
fn readings_in_whole_degrees_are_named_and_no_move() {
    let made = seen(CameraMount::Hand, 40, 3);
    let mut series = measured(&made, &kr6());
    for q in series.stops.iter_mut().filter_map(|s| s.readings.as_mut()).flatten() {
        *q = q.to_degrees().round().to_radians();
    }
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    let solution = identify(kr6(), &[series], &options).unwrap();
    let found = solution.findings.iter().find(|f| f.code() == Code::ReadingsRounded && f.fails());
    let found = found.unwrap_or_else(|| panic!("{:?}", solution.findings));
    let quantity = |name: &str| found.quantities().into_iter().find(|q| q.name == name).unwrap().value;
    assert!((quantity("step") - 1f64.to_radians()).abs() < 1e-12);
    assert!((quantity("joint_noise") / quantity("rounding_noise")).ln().abs() < 0.7, "{:?}", found.quantities());
    let moves = [Code::PlateMoved, Code::CameraMoved, Code::ZeroMoved, Code::JointNoiseLarge];
    let accused: Vec<&Finding> = solution.findings.iter().filter(|f| moves.contains(&f.code())).collect();
    assert!(accused.is_empty(), "{accused:?}");
    assert!(!solution.findings.iter().any(|f| matches!(f, Finding::Displaced(_))), "{:?}", solution.findings);
}

/// Names as programs sort them beside readings in the order of the stops, and the other way round.
#[test]
fn rows_in_the_other_order_of_their_names_are_named() {
    let mut good = measured(&seen(CameraMount::Hand, 24, 3), &kr6());
    good.stops.iter_mut().enumerate().for_each(|(k, stop)| stop.image = format!("{}.png", k + 1));
    let mut sorted: Vec<usize> = (0..24).collect();
    sorted.sort_by_key(|k| good.stops[*k].image.clone());
    for names_are_sorted in [true, false] {
        let mut series = good.clone();
        for (k, name) in sorted.iter().enumerate() {
            let (row, of) = if names_are_sorted { (*name, k) } else { (k, *name) };
            series.stops[row].readings = good.stops[of].readings.clone();
        }
        assert_named(&series, Code::RowsMisordered, &[]);
    }
}
