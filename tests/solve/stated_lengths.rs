//! Stated distances that contradict all else, and several targets on one bracket: simulated robots with known truth.

use nalgebra::Vector3;
use robotcal::diagnose::{Carried, ContradictedDistances, Displaced, Finding};
use robotcal::error::Code;
use robotcal::geom::Pose;
use robotcal::identify::{Options, Solution, identify};
use robotcal::model::robot::Robot;
use robotcal::problem::{BodySeen, MeasuredSeries, SeenBody, SeenLength};

use crate::measured_worlds::{Kind, World};
use crate::support::small::Dice;

const TARGETS: [[f64; 3]; 3] = [[0.05, 0.0, 0.1], [-0.05, 0.06, 0.1], [0.0, -0.05, 0.16]];

fn between(a: usize, b: usize) -> f64 {
    (Vector3::from(TARGETS[a]) - Vector3::from(TARGETS[b])).norm()
}

/// A tracker sees three targets on a bracket, which sits elsewhere by `moved` from a stop on.
fn three_targets(world: &World, from: usize, moved: &Pose) -> MeasuredSeries {
    let mut dice = Dice::new(77);
    let mut series = world.series.clone();
    let seen = std::mem::take(&mut series.bodies);
    for body in &seen {
        let BodySeen::Pose(bracket) = body.seen else { panic!("a pose") };
        let bracket = if body.stop < from { bracket } else { bracket * *moved };
        for (k, target) in TARGETS.iter().enumerate() {
            let noise = Vector3::from_fn(|_, _| dice.normal(3e-5));
            series.bodies.push(SeenBody {
                body: format!("t{k}"),
                seen: BodySeen::Point(bracket.transform(&Vector3::from(*target)) + noise),
                sigma_m: 3e-5,
                ..body.clone()
            });
        }
    }
    series
}

fn of_poses(seed: u64) -> World {
    World::new(seed, Kind::Poses, 40, (1e-9, 1e-9), 2e-5)
}

fn solved(world: &World, series: MeasuredSeries) -> Solution {
    identify(world.chain.clone(), &[series], &Options::default()).unwrap()
}

/// What is said of distances that are left out. Nothing else may be blamed.
fn contradicted(solution: &Solution) -> Vec<ContradictedDistances> {
    let failing = solution.findings.iter().filter(|f| f.fails());
    let of = |f: &Finding| match f {
        Finding::ContradictedDistances(found) => found.clone(),
        other => panic!("{other:?}"),
    };
    failing.map(of).collect()
}

fn assert_found(world: &World, solution: &Solution) {
    let nominal = world.error_mm(&Robot::nominal(world.chain.clone()));
    let found = world.error_mm(&solution.exported_robot());
    println!("{nominal:.3} -> {found:.3} mm");
    assert!(found < 0.25 * nominal, "{nominal} {found}");
}

#[test]
fn a_wrong_distance_between_targets_is_named_and_bends_no_robot() {
    let world = of_poses(51);
    let still = three_targets(&world, usize::MAX, &Pose::identity());
    for (factor, sigma_m, unit) in [
        (1.0, 2e-5, None),
        (1000.0, 0.02, Some("millimetres")),
        (1000.0, 2e-5, Some("millimetres")),
        (1.0 / 0.0254, 2e-5, Some("inches")),
        (100.0, 2e-3, Some("centimetres")),
        (2.0, 2e-5, None),
        (0.5, 2e-5, None),
        (1.02, 2e-5, None),
    ] {
        let mut series = still.clone();
        let names = ["t0".to_owned(), "t1".to_owned()];
        let distance_m = factor * between(0, 1);
        series.lengths.push(SeenLength { between: names.clone(), distance_m, sigma_m });
        let solution = solved(&world, series);
        let said = contradicted(&solution);
        assert_found(&world, &solution);
        if factor == 1.0 {
            assert_eq!(said, []);
            continue;
        }
        let [one] = &said[..] else { panic!("{factor}: {said:?}") };
        let [distance] = &one.distances[..] else { panic!("{one:?}") };
        assert_eq!((one.unit.map(|u| u.name), &distance.between), (unit, &names));
        assert!((one.off - (factor - 1.0)).abs() < 2e-3 * factor, "{one:?}");
        assert!((distance.fitted_m - between(0, 1)).abs() < 1e-4, "{distance:?}");
        assert_eq!(Finding::from(one.clone()).code(), Code::LengthsContradicted);
    }
}

#[test]
fn wrong_distances_between_sockets_are_named_and_the_others_take_part() {
    let world = World::sockets(52, 4, 25, 5e-5, 2e-5);
    let mut one = world.series.clone();
    one.lengths[1].distance_m *= 1.2;
    let solution = solved(&world, one);
    let said = contradicted(&solution);
    let [found] = &said[..] else { panic!("{said:?}") };
    assert_eq!(found.distances.len(), 1);
    assert_eq!(found.distances[0].between, world.series.lengths[1].between);
    assert_eq!(solution.fit.problem.used_lengths().map(|(k, _)| k).collect::<Vec<_>>(), [0, 2]);
    assert_found(&world, &solution);
    let mut all = world.series.clone();
    all.lengths.iter_mut().for_each(|l| l.distance_m *= 1e3);
    let said = contradicted(&solved(&world, all));
    let [found] = &said[..] else { panic!("{said:?}") };
    assert_eq!((found.distances.len(), found.unit.map(|u| u.name)), (3, Some("millimetres")));
}

#[test]
fn several_targets_that_slip_together_are_named_as_one() {
    let world = of_poses(53);
    let said = |moved: Pose| {
        let solution = solved(&world, three_targets(&world, 18, &moved));
        let displaced = |f| if let Finding::Displaced(found) = f { Some(found) } else { None };
        solution.findings.into_iter().filter(Finding::fails).filter_map(displaced).collect::<Vec<Displaced>>()
    };
    assert_eq!(said(Pose::identity()), []);
    for size in [1e-3, 2e-3] {
        let all = said(Pose::from_xyz_rpy([0.8 * size, -0.6 * size, 0.0], [0.0; 3]));
        let [found] = &all[..] else { panic!("{all:?}") };
        assert_eq!((found.body, found.images[0].as_str()), (Carried::Bracket, "018"));
        assert!((found.distance_m.0 - size).abs() < 0.1 * size, "{found:?}");
    }
}
