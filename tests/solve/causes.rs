//! Faults that make the joint noise large, or leave images out, are named by their own cause with the number that was put in.

use nalgebra::Vector6;
use robotcal::diagnose::{Carried, Displacement, Finding, ReadingRatio};
use robotcal::geom::Pose;
use robotcal::identify::{Options, Solution, identify};
use robotcal::plan::plate_design::{PlateRequest, design};
use robotcal::problem::MeasuredSeries;
use robotcal::series::{CameraMount, Plate, PlateKind};
use robotcal::simulate::{SimulatedSeries, WorldRequest, series};
use robotcal::study::measured;
use robotcal::urdf::Chain;
use robotcal::{Code, Error};
use std::path::Path;
use std::sync::LazyLock;

use crate::cameras;
use crate::support::displaced::change;

const KUKA: &str = "robots/kuka_kr6_r900/kuka_kr6_r900.urdf";
const UR: &str = "robots/ur10e/ur10e.urdf";

fn chain(urdf: &str) -> Chain {
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join(urdf);
    robotcal::urdf::read(&urdf).unwrap().chain(None, None).unwrap()
}

fn corners() -> Plate {
    Plate::lattice(PlateKind::Points, 12, 9, 0.025, 0.1e-3)
}

fn circles() -> Plate {
    static PLATE: LazyLock<Plate> = LazyLock::new(|| design(&PlateRequest::default()).unwrap().plate);
    PLATE.clone()
}

fn seen(urdf: &str, plate: Plate, seed: u64) -> (Chain, SimulatedSeries) {
    let chain = chain(urdf);
    let request = WorldRequest { images: 30, seed, ..WorldRequest::typical(chain.clone(), plate) };
    let made = series(&request).unwrap();
    (chain, made)
}

fn solved(chain: &Chain, series: MeasuredSeries) -> Solution {
    identify(chain.clone(), &[series], &Options::default()).unwrap()
}

fn with_readings(mut series: MeasuredSeries, change: impl Fn(&mut Vec<f64>)) -> MeasuredSeries {
    series.stops.iter_mut().filter_map(|s| s.readings.as_mut()).for_each(change);
    series
}

fn codes(solution: &Solution) -> Vec<Code> {
    solution.findings.iter().filter(|f| f.fails()).map(Finding::code).collect()
}

fn ratio(solution: &Solution) -> &ReadingRatio {
    let found = solution.findings.iter().find_map(|f| match f {
        Finding::ReadingRatio(found) => Some(found),
        _ => None,
    });
    found.unwrap_or_else(|| panic!("{:?}", solution.findings))
}

fn is_within(found: (f64, f64), truth: f64) -> bool {
    (found.0 - truth).abs() < 3.0 * found.1
}

#[test]
fn a_joint_that_moves_by_another_ratio_is_named_with_it() {
    for (urdf, plate, seed, joint, factor) in [
        (UR, corners(), 1, 1, 1.015),
        (UR, circles(), 2, 4, 1.02),
        (KUKA, corners(), 3, 2, 0.98),
        (KUKA, circles(), 4, 5, 1.01),
    ] {
        let (chain, made) = seen(urdf, plate, seed);
        let solution = solved(&chain, with_readings(measured(&made, &chain), |q| q[joint] *= factor));
        let found = ratio(&solution);
        assert_eq!((found.joint.as_str(), &found.with), (chain.readings[joint].as_str(), &None), "{found:?}");
        assert!(is_within(found.ratio, 1.0 / factor) && found.ratio.1 < 3e-3, "{found:?}, put in {}", 1.0 / factor);
        let said = codes(&solution);
        assert!(said.contains(&Code::JointRatioWrong) && !said.contains(&Code::LooseMounting), "{said:?}");
    }
}

#[test]
fn a_wrist_whose_joints_move_each_other_is_named_with_the_part() {
    for (urdf, plate, seed) in [(UR, circles(), 5), (KUKA, corners(), 6)] {
        let (chain, made) = seen(urdf, plate, seed);
        let solution = solved(&chain, with_readings(measured(&made, &chain), |q| q[5] -= 0.02 * q[4]));
        let found = ratio(&solution);
        assert_eq!(
            (found.joint.as_str(), found.with.as_deref()),
            (chain.readings[5].as_str(), Some(chain.readings[4].as_str()))
        );
        assert!(is_within(found.ratio, 0.02), "{found:?}");
        assert!(codes(&solution).contains(&Code::JointInfluenced));
    }
}

fn refused(chain: Chain, series: MeasuredSeries) -> Error {
    identify(chain, &[series], &Options::default()).map(|_| ()).unwrap_err()
}

#[test]
fn a_joint_in_a_wrong_unit_or_with_a_large_part_of_another_is_refused_by_name() {
    for (urdf, plate, seed, joint, factor) in [(UR, corners(), 7, 2, 400.0 / 360.0), (KUKA, circles(), 8, 3, 2.0)] {
        let (chain, made) = seen(urdf, plate, seed);
        let said = refused(chain.clone(), with_readings(measured(&made, &chain), |q| q[joint] *= factor));
        assert_eq!((said.code, said.place.as_str()), (Code::JointRatioWrong, chain.readings[joint].as_str()), "{said}");
        let found = said.quantities.iter().find(|q| q.name == "ratio").unwrap();
        assert!(is_within((found.value, found.sigma.unwrap()), 1.0 / factor), "{found:?}");
    }
    let (chain, made) = seen(UR, corners(), 9);
    let said = refused(chain.clone(), with_readings(measured(&made, &chain), |q| q[5] -= 0.3 * q[3]));
    assert_eq!((said.code, said.place.as_str()), (Code::JointInfluenced, chain.readings[5].as_str()), "{said}");
}

/// A row that was written twice behind most of the others, or lost: the images behind it are left out, and fit the readings of the next row.
#[test]
fn rows_that_are_shifted_in_the_smaller_part_are_named() {
    let (chain, made) = seen(KUKA, circles(), 8);
    for below in [true, false] {
        let mut series = measured(&made, &chain);
        let right: Vec<Option<Vec<f64>>> = series.stops.iter().map(|stop| stop.readings.clone()).collect();
        let names: Vec<String> = series.stops.iter().map(|stop| stop.image.clone()).collect();
        let n = right.len();
        let from = n - 8;
        for k in from..n - 1 {
            series.stops[k].readings.clone_from(&right[if below { k - 1 } else { k + 1 }]);
        }
        let solution = identify(chain.clone(), &[series], &Options::default()).unwrap();
        let found =
            solution.findings.iter().find_map(|f| if let Finding::ShiftedReadings(s) = f { Some(s) } else { None });
        let found = found.unwrap_or_else(|| panic!("{:?}", codes(&solution)));
        println!("{found:?}");
        assert!(found.below == below && found.images.contains(&names[from + 2]), "{found:?}");
        assert!(found.images.len() >= 5 && !found.images.contains(&names[from - 2]), "{found:?}");
    }
}

#[test]
fn pictures_of_two_cameras_that_are_exchanged_are_named_with_their_stops() {
    for (mounts, seed) in [([CameraMount::Hand; 2], 1), ([CameraMount::Fixed; 2], 2)] {
        let mut seen = cameras::seen(&mounts, 30, seed);
        let [one, other] = seen.series.as_mut_slice() else { panic!() };
        let mut exchanged = Vec::new();
        for stop in &mut one.stops {
            let Some(twin) = other.stops.iter_mut().find(|s| s.row == stop.row) else { continue };
            if (10..15).contains(&stop.row) {
                std::mem::swap(&mut stop.observations, &mut twin.observations);
                exchanged.push([stop.image.clone(), twin.image.clone()]);
            }
        }
        assert!(exchanged.len() >= 3);
        let solution = cameras::solved(&seen);
        let found = solution.findings.iter().find_map(|f| match f {
            Finding::ExchangedPictures(found) => Some(found),
            _ => None,
        });
        let found = found.unwrap_or_else(|| panic!("{:?}", solution.findings));
        assert_eq!(found.images, exchanged);
        assert!(solution.findings.iter().all(|f| f.code() != Code::CameraMoved), "{:?}", solution.findings);
    }
}

#[test]
fn a_plate_with_two_places_by_turns_is_named_with_its_images() {
    let by = Pose::exp(&Vector6::new(4e-3, -3e-3, 0.0, 0.0, 0.0, 0.0));
    for (urdf, plate, seed, every) in [(UR, corners(), 11, 2), (KUKA, circles(), 12, 3)] {
        let (chain, mut made) = seen(urdf, plate, seed);
        let moved: Vec<usize> = (0..30).filter(|k| k % every == 1).collect();
        moved.iter().for_each(|&k| change(&mut made, k..k + 1, |pose| pose * by));
        let solution = solved(&chain, measured(&made, &chain));
        let found = solution.findings.iter().find_map(|f| match f {
            Finding::Displaced(found) if f.fails() => Some(found),
            _ => None,
        });
        let found = found.unwrap_or_else(|| panic!("{:?}", solution.findings));
        assert_eq!((found.body, found.displacement), (Carried::Plate, Displacement::ByTurns), "{found:?}");
        assert!((found.distance_m.0 - 5e-3).abs() < 3.0 * found.distance_m.1.max(2e-5), "{found:?}");
        let names: Vec<&String> = made.stops.stops.iter().map(|s| &s.image).collect();
        // Half and half: either is the other place.
        let is_moved = |name: &&String| moved.contains(&names.iter().position(|n| n == name).unwrap());
        let hit = found.images.iter().filter(is_moved).count();
        assert!(hit == moved.len() || (every == 2 && hit == 0), "{found:?}");
        assert!(!codes(&solution).contains(&Code::LooseMounting));
    }
}

#[test]
fn pictures_that_are_cut_out_elsewhere_are_named_with_the_shift() {
    for (urdf, plate, seed) in [(UR, corners(), 13), (KUKA, circles(), 14)] {
        let (chain, mut made) = seen(urdf, plate, seed);
        for seen in made.observations.iter_mut().skip(15) {
            seen.observations.iter_mut().for_each(|o| o.uv[0] += 3.0);
        }
        let solution = solved(&chain, measured(&made, &chain));
        let found = solution.findings.iter().find_map(|f| match f {
            Finding::ImagesShifted(found) => Some(found),
            _ => None,
        });
        let found = found.unwrap_or_else(|| panic!("{:?}", solution.findings));
        let [u, v] = found.shift_px;
        // The fit has taken a part of it.
        assert!((1.0..3.1).contains(&u) && v.abs() < 0.1 * u.abs(), "{found:?}");
        let shifted: Vec<&String> = made.stops.stops.iter().skip(15).map(|stop| &stop.image).collect();
        assert_eq!(found.images.iter().collect::<Vec<_>>(), shifted);
        let named = codes(&solution);
        let misread = [Code::LooseMounting, Code::CameraDisplaced, Code::CameraDrifts, Code::FocusChanged];
        assert!(!misread.iter().any(|code| named.contains(code)), "{named:?}");
    }
}
