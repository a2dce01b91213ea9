//! What differs between two series of one robot, or within one of them, is named: the zero of a joint, the camera on its mount, the plate.

use robotcal::diagnose::{Carried, Displaced, Displacement, Finding, ZeroMoved};
use robotcal::geom::Pose;
use robotcal::identify::{Options, RobotModel, Solution, identify};
use robotcal::problem::MeasuredSeries;
use robotcal::series::{CameraMount, Plate, PlateKind};
use robotcal::simulate::{SimulatedSeries, WorldRequest, series};
use robotcal::study::measured;

use crate::robots::kr6;
use crate::support::displaced::change;

const STOPS: usize = 48;

/// The plate stands in one place for the first half, in another for the second.
fn seen(seed: u64) -> SimulatedSeries {
    let plate = Plate::lattice(PlateKind::Points, 8, 6, 0.038, 0.03e-3);
    let request = WorldRequest {
        mount: CameraMount::Hand,
        images: STOPS,
        placements: 2,
        least_markers: 12,
        seed,
        ..WorldRequest::typical(kr6(), plate)
    };
    series(&request).unwrap()
}

/// As two series with one camera, each with its place of the plate; `shifted` changes the readings of the second.
fn halves(made: &SimulatedSeries, shifted: impl Fn(usize, &mut Vec<f64>)) -> [MeasuredSeries; 2] {
    let whole = measured(made, &kr6());
    let first = whole.stops[0].placement.clone();
    let half = |name: &str, is_first: bool| {
        let mut own = MeasuredSeries { name: name.into(), ..whole.clone() };
        own.stops.retain(|stop| (stop.placement == first) == is_first);
        own.stops.iter_mut().enumerate().for_each(|(row, stop)| stop.row = row);
        own
    };
    let [first, mut second] = [half("monday", true), half("friday", false)];
    assert!(first.stops.len() >= STOPS / 3 && second.stops.len() >= STOPS / 3);
    let readings = second.stops.iter_mut().filter_map(|stop| stop.readings.as_mut());
    readings.enumerate().for_each(|(k, q)| shifted(k, q));
    [first, second]
}

fn solved(series: &[MeasuredSeries]) -> Solution {
    identify(kr6(), series, &Options { model: RobotModel::Rigid, ..Options::default() }).unwrap()
}

fn zeros(solution: &Solution) -> Vec<ZeroMoved> {
    let zero = |f: &'_ Finding| if let Finding::ZeroMoved(found) = f { Some(found.clone()) } else { None };
    solution.findings.iter().filter_map(zero).collect()
}

fn displaced(solution: &Solution) -> Vec<Displaced> {
    let body = |f: &'_ Finding| if let Finding::Displaced(found) = f { Some(found.clone()) } else { None };
    solution.findings.iter().filter_map(body).collect()
}

#[test]
fn two_series_of_one_robot_are_not_accused() {
    for seed in [21, 22] {
        let solution = solved(&halves(&seen(seed), |_, _| ()));
        let gates = solution.failed_gates();
        assert!(zeros(&solution).is_empty() && displaced(&solution).is_empty() && gates.is_empty(), "{gates:?}");
    }
}

/// The plate to which the errors of the flange are stated is not that of the series that happens to be named first.
#[test]
fn the_stated_accuracy_does_not_hang_on_the_order_of_the_series() {
    let [monday, friday] = halves(&seen(24), |_, _| ());
    let stated = |series: &[MeasuredSeries]| {
        let flange = solved(series).uncertainty.flange.unwrap();
        [flange.nominal_m, flange.urdf_m, flange.model_m]
    };
    let [one, other] = [stated(&[monday.clone(), friday.clone()]), stated(&[friday, monday])];
    // What is left is where the solve stops.
    assert!(one.iter().zip(&other).all(|(a, b)| (a / b - 1.0).abs() < 1e-4), "{one:?} {other:?}");
}

#[test]
fn a_joint_mastered_anew_between_two_series_is_named() {
    let solution = solved(&halves(&seen(23), |_, q| q[2] += 3e-3));
    let [found] = &zeros(&solution)[..] else { panic!("{:?}", solution.findings) };
    assert_eq!((found.joint.as_str(), found.displacement), ("joint_a3", Displacement::InAll), "{found:?}");
    // True positions are readings and offset: the second series lacks what was added, the first has it too much.
    let expected = if found.series == "friday" { -3e-3 } else { 3e-3 };
    assert!((found.offset.0 - expected).abs() < 0.3e-3, "{found:?}");
    assert!(!solution.failed_gates().is_empty());
}

#[test]
fn a_zero_that_slips_during_a_series_is_named_with_its_stop() {
    let series = halves(&seen(24), |k, q| q[4] += if k >= 9 { 1e-3 } else { 0.0 });
    let solution = solved(&series);
    let [found] = &zeros(&solution)[..] else { panic!("{:?}", solution.findings) };
    assert_eq!((found.joint.as_str(), found.series.as_str()), ("joint_a5", "friday"), "{found:?}");
    assert_eq!(found.displacement, Displacement::FromThenOn);
    assert_eq!(found.stops[0], series[1].stops[9].image, "{found:?}");
    assert!((found.offset.0 + 1e-3).abs() < 0.1e-3, "{found:?}");
}

/// The squares of the other series are none that it could explain.
#[test]
fn a_plate_that_slips_during_one_of_two_series_is_named() {
    let mut made = seen(25);
    let first = made.stops.stops[0].placement.clone();
    let second: Vec<usize> = (0..STOPS).filter(|k| made.stops.stops[*k].placement != first).collect();
    let slips = Pose::from_xyz_rpy([0.8e-3, -0.6e-3, 0.0], [0.0; 3]);
    second[10..].iter().for_each(|&k| change(&mut made, k..k + 1, |pose| pose * slips));
    let solution = solved(&halves(&made, |_, _| ()));
    let [found] = &displaced(&solution)[..] else { panic!("{:?}", solution.findings) };
    assert_eq!((found.body, found.displacement), (Carried::Plate, Displacement::FromThenOn), "{found:?}");
    assert_eq!((found.series.as_str(), &found.images[0]), ("friday", &made.stops.stops[second[10]].image), "{found:?}");
    assert!((found.distance_m.0 - 1e-3).abs() < 1e-4, "{found:?}");
}

#[test]
fn a_camera_that_was_moved_on_its_mount_between_two_series_is_named() {
    let mut made = seen(26);
    let first = made.stops.stops[0].placement.clone();
    let second: Vec<usize> = (0..STOPS).filter(|k| made.stops.stops[*k].placement != first).collect();
    let moved = Pose::from_xyz_rpy([1e-3, 0.0, 0.5e-3], [0.0, 2e-3, 0.0]);
    second.iter().for_each(|&k| change(&mut made, k..k + 1, |pose| moved * pose));
    let solution = solved(&halves(&made, |_, _| ()));
    let [found] = &displaced(&solution)[..] else { panic!("{:?}", solution.findings) };
    assert_eq!((found.body, found.displacement), (Carried::CameraInHand, Displacement::InAll), "{found:?}");
    assert!((found.angle_rad.unwrap().0 - 2e-3).abs() < 0.2e-3, "{found:?}");
    let mut apart = halves(&made, |_, _| ());
    apart[1].mounting = "mounted anew".into();
    let solution = solved(&apart);
    assert!(solution.failed_gates().is_empty(), "the remedy does not help: {:?}", solution.findings);
}

/// Each is told of its own camera.
#[test]
fn a_focus_that_changes_on_one_camera_hides_no_move_of_another() {
    let mut made = seen(27);
    let first = made.stops.stops[0].placement.clone();
    let rows = |is_first: bool| -> Vec<usize> {
        (0..STOPS).filter(|k| (made.stops.stops[*k].placement == first) == is_first).collect()
    };
    let [refocused, moved] = [rows(true), rows(false)].map(|rows| rows[10..].to_vec());
    let ([cx, cy], longer) = ([2, 3].map(|k| made.truth.camera.parameters[k]), 4e-3);
    for &k in &refocused {
        for o in &mut made.observations[k].observations {
            o.uv = [o.uv[0] + longer * (o.uv[0] - cx), o.uv[1] + longer * (o.uv[1] - cy)];
        }
    }
    let bumped = Pose::from_xyz_rpy([1e-3, 0.0, 0.0], [0.0; 3]);
    moved.iter().for_each(|&k| change(&mut made, k..k + 1, |pose| bumped * pose));
    let mut series = halves(&made, |_, _| ());
    (series[1].camera, series[1].mounting) = ("other".into(), "other".into());
    let solution = solved(&series);
    let focus =
        solution.findings.iter().filter_map(|f| if let Finding::FocusChange(own) = f { Some(own) } else { None });
    let cameras: Vec<&str> = focus.map(|own| own.camera.as_str()).collect();
    assert_eq!(cameras, [series[0].camera.as_str()], "{:?}", solution.findings);
    let [found] = &displaced(&solution)[..] else { panic!("{:?}", solution.findings) };
    assert_eq!((found.body, found.mounting.as_str()), (Carried::CameraInHand, "other"), "{found:?}");
    assert_eq!(found.images[0], made.stops.stops[moved[0]].image, "{found:?}");
}
