//! A plate that is not of the size that its file states: the robot would take the error over, so that it must be named.

use crate::robots::kr6;
use nalgebra::Vector3;
use robotcal::Code;
use robotcal::assess::Limits;
use robotcal::diagnose::{DoubtedSize, Finding, Subject, Weight};
use robotcal::identify::{Estimator, Options, RobotModel, Solution, identify, stand_alone};
use robotcal::model::plate_modes::DOT_GAIN;
use robotcal::problem::{MeasuredSeries, SCALE};
use robotcal::series::{Plate, PlateKind, ScaleBar};
use robotcal::simulate::{WorldRequest, series};
use robotcal::study::measured;
use robotcal::urdf::Chain;

fn request(chain: &Chain) -> WorldRequest {
    let mut plate = Plate::lattice(PlateKind::Points, 8, 6, 0.038, 0.1e-3);
    plate.markers.iter_mut().for_each(|m| m.outer_radius_m = 0.01);
    WorldRequest { images: 24, least_markers: 12, seed: 9, ..WorldRequest::typical(chain.clone(), plate) }
}

fn seen(chain: &Chain, request: &WorldRequest) -> (MeasuredSeries, Vec<[f64; 3]>) {
    let world = series(request).unwrap();
    (measured(&world, chain), world.truth.marker_errors_m)
}

/// A series whose file states a plate larger by these factors along x and y, with a distance measured on the plate as it is.
fn stated_series(x: f64, y: f64, bar: Option<(u32, u32)>) -> MeasuredSeries {
    stated_in(&request(&kr6()), x, y, bar)
}

/// The same of a world.
fn stated_in(request: &WorldRequest, x: f64, y: f64, bar: Option<(u32, u32)>) -> MeasuredSeries {
    let (mut series, errors) = seen(&kr6(), request);
    series.plate.scale = bar.map(|(from, to)| {
        let index = |id| series.plate.index_of(id).unwrap();
        let of = |id| series.plate.markers[index(id)].position_m + Vector3::from(errors[index(id)]);
        ScaleBar { from, to, distance_m: (of(from) - of(to)).norm(), sigma_m: 2e-5 }
    });
    for m in &mut series.plate.markers {
        (m.position_m.x, m.position_m.y) = (x * m.position_m.x, y * m.position_m.y);
    }
    series
}

/// The solution of it.
fn stated(x: f64, y: f64, bar: Option<(u32, u32)>) -> Solution {
    identify(kr6(), &[stated_series(x, y, bar)], &Options::default()).unwrap()
}

/// What is doubted of the plate, and by how much it is larger than its file says.
fn doubts(solution: &Solution) -> Vec<(Code, f64)> {
    let doubted = solution.findings.iter().filter(|f| matches!(f, Finding::DoubtedSize(_)));
    doubted.map(|f| (f.code(), f.quantities()[0].value)).collect()
}

/// By how much the way from one marker to another is longer than stated.
fn stretch(solution: &Solution, from: usize, to: usize) -> f64 {
    let (found, stated) = (&solution.fit.state.plates[0], &solution.fit.problem.plates[0].markers);
    let stated = (stated[from].position_m - stated[to].position_m).norm();
    (found.position(from) - found.position(to)).norm() / stated - 1.0
}

/// A marker that is named as far off tells nothing of the size: the plate is as large as without it.
#[test]
fn a_marker_that_is_named_as_off_does_not_pull_the_size_of_the_plate() {
    let as_stated = stated_series(1.0, 1.0, None);
    let mut moved = as_stated.clone();
    let (corner, far) = (0, as_stated.plate.markers.len() - 1);
    let outwards = moved.plate.markers[corner].position_m.normalize();
    // The others were printed right; this one lies 3 mm nearer to the middle than its file says.
    moved.plate.markers[corner].position_m += 3e-3 * outwards;
    let [before, after] = [as_stated, moved].map(|series| identify(kr6(), &[series], &Options::default()).unwrap());
    let named = after.findings.iter().filter(|f| f.code() == Code::MarkerOff).count();
    let distance_m = |s: &Solution| {
        let found = &s.fit.state.plates[0];
        (found.position(corner + 1) - found.position(far)).norm()
    };
    let pulled_m = distance_m(&after) - distance_m(&before);
    println!("pulled by {:.4} mm", 1e3 * pulled_m);
    assert_eq!(named, 1, "{:?}", after.findings);
    assert!(pulled_m.abs() < 2e-5, "{pulled_m}");
    assert_eq!(doubts(&after), []);
}

/// Four of 48 markers, a piece of its edge that was glued on 4 mm off: they pull others beyond their tolerance as long as they are held.
#[test]
fn markers_that_are_pulled_by_others_are_not_off() {
    let mut series = stated_series(1.0, 1.0, None);
    let moved: Vec<u32> = [15, 23, 31, 39].map(|k| series.plate.markers[k].id).into();
    series.plate.markers.iter_mut().filter(|m| moved.contains(&m.id)).for_each(|m| m.position_m.x += 4e-3);
    let found = identify(kr6(), &[series], &Options::default()).unwrap();
    let named: Vec<u32> = (found.findings.iter())
        .filter_map(|f| match f {
            Finding::MarkerOff(off) => Some(off.marker),
            _ => None,
        })
        .collect();
    assert_eq!(named, moved);
    assert_eq!(doubts(&found), []);
    assert_eq!(found.fit.problem.moved_markers.len(), moved.len());
}

#[test]
fn a_plate_as_stated_is_not_doubted() {
    assert_eq!(stated(1.0, 1.0, None).failed_gates(), Vec::<String>::new());
}

#[test]
fn a_plate_one_or_two_percent_off_is_doubted_and_a_measured_distance_mends_it() {
    for factor in [1.02, 1.01, 0.99, 0.98] {
        let wrong = stated(factor, factor, None);
        let said = doubts(&wrong);
        assert!(matches!(said[..], [(Code::PlateSizeContradicted, _)]), "{said:?}");
        // The links are found to a few parts in a thousand.
        assert!((said[0].1 - (1.0 / factor - 1.0)).abs() < 5e-3, "{said:?}");
        let measured = stated(factor, factor, Some((0, 7)));
        assert_eq!(measured.failed_gates(), Vec::<String>::new());
        let off = stretch(&measured, 0, 47) - (1.0 / factor - 1.0);
        assert!(off.abs() < 3e-4, "{off}");
    }
}

#[test]
fn a_plate_that_a_printer_stretched_is_doubted_and_a_measured_distance_mends_it_in_any_direction() {
    let wrong = stated(1.004, 1.0, None);
    let said = doubts(&wrong);
    // The stretch is 0.4 %.
    assert!(said.iter().any(|(code, off)| *code == Code::PlateUneven && (1e-3..1e-2).contains(&off.abs())), "{said:?}");
    for bar in [(0, 7), (0, 40), (0, 47)] {
        let measured = stated(1.004, 1.0, Some(bar));
        assert_eq!(measured.failed_gates(), Vec::<String>::new());
        assert!((stretch(&measured, 0, 7) - (1.0 / 1.004 - 1.0)).abs() < 3e-4, "{bar:?}: {}", stretch(&measured, 0, 7));
        assert!(stretch(&measured, 0, 40).abs() < 3e-4, "{bar:?}: {}", stretch(&measured, 0, 40));
    }
}

#[test]
fn a_stretch_is_told_along_its_axis_and_stated_errors_are_without_it() {
    for (x, y) in [(1.003, 1.0), (1.0, 1.003)] {
        let wrong = stated(x, y, None);
        let along = wrong.findings.iter().find_map(|f| match f {
            Finding::DoubtedSize(DoubtedSize::Uneven { along, .. }) => *along,
            _ => None,
        });
        let along = along.unwrap_or_else(|| panic!("{:?}", wrong.findings));
        for ((found, sigma), factor) in along.into_iter().zip([x, y]) {
            let put_in = 1.0 / factor - 1.0;
            assert!((found - put_in).abs() < 3.0 * sigma && sigma < 1.5e-3, "{found} +- {sigma}, put in {put_in}");
        }
        let doubt = wrong.uncertainty.flange.unwrap().without_size_doubt.unwrap();
        assert!((2e-3..6e-3).contains(&doubt), "{doubt}");
    }
    assert_eq!(stated(1.0, 1.0, None).uncertainty.flange.unwrap().without_size_doubt, None);
}

/// What it is beside its size takes no part in the fit that asks the links for it.
#[test]
fn a_print_that_is_stretched_and_too_small_is_told_along_both_axes() {
    for (x, y) in [(1.0 / 0.98, 1.0 / 0.96), (1.0 / 0.99, 1.0 / 0.97), (1.0 / 1.03, 1.0 / 1.01)] {
        let wrong = stated(x, y, None);
        let along = wrong.findings.iter().find_map(|f| match f {
            Finding::DoubtedSize(DoubtedSize::Uneven { along, .. }) => *along,
            _ => None,
        });
        let along = along.unwrap_or_else(|| panic!("{:?}", wrong.findings));
        println!("{x} {y}: {along:?}");
        for ((found, sigma), factor) in along.into_iter().zip([x, y]) {
            let put_in = 1.0 / factor - 1.0;
            assert!((found - put_in).abs() < 3.0 * sigma && sigma < 3e-3, "{found} +- {sigma}, put in {put_in}");
        }
        // The tolerance of the markers leaves 0.28e-3 of it.
        let apart = along[0].0 - along[1].0;
        assert!((apart - (1.0 / x - 1.0 / y)).abs() < 0.9e-3, "{apart}");
    }
}

/// "Fit to page": with the stated size the robot takes up what it can, and what it cannot looks like joint noise; with the size that the links tell
/// both are in order. What is not in order then is said.
#[test]
fn what_a_wrong_print_makes_of_a_robot_is_not_said_beside_it() {
    let limits = Limits::default();
    for (x, y) in [(1.0 / 0.98, 1.0 / 0.96), (1.0 / 0.99, 1.0 / 0.97)] {
        for (joint_noise_rad, is_noisy) in [(2e-5, false), (1.2e-3, true)] {
            let request = WorldRequest { joint_noise_rad, ..request(&kr6()) };
            let solution = identify(kr6(), &[stated_in(&request, x, y, None)], &Options::default()).unwrap();
            let codes: Vec<Code> = solution.findings.iter().map(Finding::code).collect();
            let (problem, state) = (&solution.fit.problem, &solution.fit.state);
            let noise = problem.joint_sigma(0).into_iter().fold(0.0, f64::max);
            let values = state.values(&problem.layout);
            let off = |c: usize| (values[c] - problem.layout.columns[c].prior_mean).abs() / problem.stated_sigma(c);
            let farthest = problem.layout.robot().map(off).fold(0.0, f64::max);
            println!("{x} {y} {joint_noise_rad}: noise {noise}, farthest {farthest}, {codes:?}");
            assert!(codes.contains(&Code::PlateUneven) && codes.contains(&Code::PlateSizeContradicted), "{codes:?}");
            assert!(noise > limits.unusual_joint_noise || farthest > limits.sigmas_beyond_tolerance, "in order anyhow");
            assert_eq!(codes.contains(&Code::JointNoiseLarge), is_noisy, "{codes:?}");
            assert!(is_noisy || !codes.contains(&Code::ParameterOff), "{codes:?}");
        }
    }
}

/// Two prints by one file, of which one is 3 % longer along x: it is named, and not the plate that the two would be.
#[test]
fn of_two_prints_that_are_taken_for_one_plate_the_stretched_one_is_named() {
    let mut as_printed = request(&kr6());
    as_printed.plate.markers.iter_mut().for_each(|m| m.position_m.x /= 1.03);
    let long = MeasuredSeries { name: "long".into(), ..stated_series(1.0 / 1.03, 1.0, None) };
    let good = seen(&kr6(), &WorldRequest { seed: 10, ..as_printed }).0;
    let good = MeasuredSeries { name: "good".into(), plate: long.plate.clone(), ..good };
    let found = stand_alone(&[good, long], &Limits::default()).unwrap();
    assert_eq!(found.fit.problem.plates.len(), 1);
    let doubts: Vec<&Finding> = found.findings.iter().filter(|f| matches!(f, Finding::DoubtedSize(_))).collect();
    let [said] = doubts[..] else { panic!("{:?}", found.findings) };
    assert!((said.quantities()[0].value - 0.03).abs() < 2e-3, "{said}");
    assert_eq!(said.subjects(), [Subject::Body("plate of series long".into())]);
}

/// The shape of a plate shows in images alone, its size does not.
#[test]
fn poses_alone_doubt_a_stretched_plate_and_no_other() {
    let off = |x, y, bar| {
        let found = stand_alone(&[stated_series(x, y, bar)], &Limits::default()).unwrap();
        let doubts = found.findings.iter().filter(|f| matches!(f, Finding::DoubtedSize(_)));
        doubts.map(|f| (f.code(), f.weight(), f.quantities()[0].value)).collect::<Vec<_>>()
    };
    for (x, y) in [(1.01, 1.0), (1.0, 1.01), (1.03, 1.0), (1.0, 1.03)] {
        let [(code, weight, found)] = off(x, y, None)[..] else { panic!("{x} {y}") };
        assert_eq!((code, weight), (Code::PlateUneven, Weight::Gate));
        // Of 8 x 6 markers, whose squares along x and y are as 63 to 35; their tolerance leaves 0.28e-3.
        let size = (63.0 / x + 35.0 / y) / 98.0;
        assert!((found - (1.0 / x - 1.0 / y) / size).abs() < 1e-3, "{x} {y}: {found}");
    }
    assert_eq!(off(1.0, 1.0, None), []);
    assert_eq!(off(1.01, 1.01, None), []);
    assert_eq!(off(1.01, 1.0, Some((0, 47))), []);
}

/// The wrist alone turns: its links are short, and say next to nothing of the size of the plate.
#[test]
fn a_wrist_alone_doubts_no_plate() {
    let chain = kr6();
    let from = seen(&chain, &request(&chain)).0.stops[0].readings.clone().unwrap();
    for seed in 1..6 {
        let turned = |k: usize| {
            let angle = |joint: usize, size: f64| from[joint] + size * (1.7 * (k * (joint + 1)) as f64).sin();
            vec![from[0], from[1], from[2], angle(3, 0.8), angle(4, 0.4), angle(5, 2.0)]
        };
        let postures = Some((0..30).map(turned).collect());
        let world = series(&WorldRequest { images: 30, postures, seed, ..request(&chain) }).unwrap();
        let solution = identify(chain.clone(), &[measured(&world, &chain)], &Options::default()).unwrap();
        assert_eq!(doubts(&solution), [], "seed {seed}");
    }
}

/// Poses that count as independent know nothing of the size that they have in common.
#[test]
fn a_two_stage_result_states_what_is_not_known_of_the_size_of_the_plate() {
    let chain = kr6();
    let (mut series, _) = seen(&chain, &request(&chain));
    let sigma = |series: &MeasuredSeries, estimator| {
        let options = Options { estimator, ..Options::default() };
        let solution = identify(chain.clone(), std::slice::from_ref(series), &options).unwrap();
        solution.uncertainty.flange.unwrap().urdf_m
    };
    let between = |series: &MeasuredSeries| {
        let at = |id| series.plate.markers[series.plate.index_of(id).unwrap()].position_m;
        (at(0) - at(47)).norm()
    };

    let distance_m = between(&series);
    let bar = |relative: f64| Some(ScaleBar { from: 0, to: 47, distance_m, sigma_m: relative * distance_m });
    for estimator in [Estimator::Isotropic, Estimator::Blocks, Estimator::BlocksAndRepeatability] {
        series.plate.scale = bar(1e-5);
        let exact = sigma(&series, estimator);
        series.plate.scale = bar(2e-3);
        let [staged, joint] = [estimator, Estimator::Joint].map(|e| sigma(&series, e));
        println!("{}: size known {exact:.2e}, not known {staged:.2e}, joint {joint:.2e} m", estimator.title());
        assert!(staged > 2.0 * exact && (0.5..3.0).contains(&(staged / joint)), "{exact} {staged} {joint}");
    }
}

/// Ink spreads: circles are larger than stated, and tell nothing of the size of the plate.
#[test]
fn circles_of_other_radii_doubt_no_plate() {
    let chain = kr6();
    let solved = |gain_m: f64| {
        let (mut series, _) = seen(&chain, &request(&chain));
        series.plate.markers.iter_mut().for_each(|m| m.outer_radius_m -= gain_m);
        identify(chain.clone(), &[series], &Options::default()).unwrap()
    };
    let exact = solved(0.0);
    for gain_m in [-0.2e-3, 0.1e-3] {
        let found = solved(gain_m);
        assert_eq!(doubts(&found), [], "{gain_m}");
        let fit = &found.fit;
        let at = fit.problem.layout.shapes[0].start + DOT_GAIN;
        let off = fit.state.plates[0].modes[DOT_GAIN] - gain_m;
        println!("{gain_m}: off {off:e} +- {:e}", fit.covariance.sigma(at));
        assert!(off.abs() < 4.0 * fit.covariance.sigma(at), "{off:e}");
        let scale = |s: &Solution| s.fit.state.plates[0].modes[SCALE];
        assert!((scale(&found) - scale(&exact)).abs() < 2e-5, "{:e} {:e}", scale(&found), scale(&exact));
    }
}

/// By the links of one robot after another: of what a plate is off, within what is stated.
#[test]
fn what_links_say_of_the_size_of_a_plate_is_as_sure_as_stated() {
    let (mut sum, mut count) = (0.0, 0.0);
    for seed in 1..7 {
        let chain = kr6();
        let world = series(&WorldRequest { images: 40, seed, ..request(&chain) }).unwrap();
        let mut stated = measured(&world, &chain);
        stated.plate.markers.iter_mut().for_each(|m| {
            m.position_m *= 1.02;
            m.outer_radius_m *= 1.02;
        });
        let options = Options { model: RobotModel::Rigid, ..Options::default() };
        let solution = identify(chain, &[stated], &options).unwrap();
        let doubted = solution.findings.iter().find(|f| f.code() == Code::PlateSizeContradicted).unwrap();
        let size = &doubted.quantities()[0];
        let off = (size.value - (1.0 / 1.02 - 1.0)) / size.sigma.unwrap();
        println!("seed {seed}: {:e} +- {:e}, off by {off:.2}", size.value, size.sigma.unwrap());
        sum += off * off;
        count += 1.0;
    }
    assert!(sum < 22.5, "{sum} of {count}");
}
