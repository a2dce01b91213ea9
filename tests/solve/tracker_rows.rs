//! Rows of a tracker that are not of their stops: shifted in part, written again, of another session, or left out at the start though they are
//! right; sockets that were moved; and known places that are misstated.

use nalgebra::Vector3;
use robotcal::Error;
use robotcal::diagnose::{Carried, Displaced, Finding, Subject, Weight};
use robotcal::error::Code;
use robotcal::geom::Pose;
use robotcal::identify::{Options, RobotModel, Solution, identify};
use robotcal::problem::{BodySeen, InstrumentKind, MeasuredSeries, SeenBody};

use crate::measured_worlds::{Kind, World, chain, readings, stop, truth};
use crate::support::small::Dice;

const KINDS: [(Kind, f64); 2] = [(Kind::Points, 0.0), (Kind::Poses, 5e-5)];

fn identified(world: &World, series: MeasuredSeries) -> Result<Solution, Error> {
    identify(world.chain.clone(), &[series], &Options { model: RobotModel::Rigid, ..Options::default() })
}

/// A series in which the rows of a part say what the next ones do, or the ones before.
fn shifted(world: &World, part: std::ops::Range<usize>, below: bool) -> MeasuredSeries {
    let mut series = world.series.clone();
    for k in part {
        series.bodies[k].seen = world.series.bodies[if below { k + 1 } else { k - 1 }].seen;
    }
    series
}

fn stops(of: &[usize]) -> Vec<Subject> {
    of.iter().map(|k| Subject::Stop(format!("{k:03}"))).collect()
}

fn found(solution: &Solution, code: Code) -> Option<&Finding> {
    solution.findings.iter().find(|f| f.code() == code)
}

fn left_out(solution: &Solution) -> Vec<usize> {
    let measured = solution.fit.problem.body_measurements.iter().enumerate();
    measured.filter(|(_, m)| m.rejected.is_some()).map(|(k, _)| k).collect()
}

/// More than can be left out: there is no start of a majority, or no result that stands on it.
#[test]
fn a_large_part_of_the_rows_that_is_shifted_is_refused_with_its_first_stop() {
    for (kind, sigma_rad) in KINDS {
        let world = World::new(71, kind, 60, (3e-5, sigma_rad), 2e-5);
        for (part, below) in [(20..41, true), (15..40, false), (30..59, true), (1..22, false)] {
            let (first, count) = (part.start, part.len() as f64);
            let said = identified(&world, shifted(&world, part, below)).map(|_| ()).unwrap_err();
            assert_eq!((said.code, said.place.as_str()), (Code::RowsShifted, format!("{first:03}").as_str()), "{said}");
            let rows = said.quantities.iter().find(|q| q.name == "images_shifted").unwrap().value;
            assert_eq!(rows, count, "{said}");
        }
    }
}

/// Of few stops no start leaves any out.
#[test]
fn a_part_of_few_rows_is_named_too() {
    let world = World::new(72, Kind::Points, 14, (3e-5, 0.0), 2e-5);
    let said = identified(&world, shifted(&world, 5..9, true)).map(|_| ()).unwrap_err();
    assert_eq!((said.code, said.place.as_str()), (Code::RowsShifted, "005"), "{said}");
}

#[test]
fn a_small_part_that_is_shifted_is_left_out_and_named_from_its_first_stop_to_its_last() {
    for (kind, sigma_rad) in KINDS {
        let world = World::new(73, kind, 60, (3e-5, sigma_rad), 2e-5);
        for below in [true, false] {
            let solution = identified(&world, shifted(&world, 20..30, below)).unwrap();
            let finding = found(&solution, Code::RowsShifted).unwrap();
            assert_eq!((finding.weight(), finding.subjects()), (Weight::Note, stops(&[20, 29])));
            assert_eq!(left_out(&solution), (20..30).collect::<Vec<usize>>());
            assert!(found(&solution, Code::MeasurementsRepeated).is_none(), "one row twice is where the shift ends");
        }
    }
}

#[test]
fn single_rows_of_other_stops_are_no_shift() {
    for (kind, sigma_rad) in KINDS {
        let world = World::new(74, kind, 60, (3e-5, sigma_rad), 2e-5);
        let mut series = world.series.clone();
        for (k, of) in [(5, 40), (6, 41), (7, 9), (30, 31), (50, 2)] {
            series.bodies[k].seen = world.series.bodies[of].seen;
        }
        let solution = identified(&world, series).unwrap();
        assert!(found(&solution, Code::RowsShifted).is_none());
        assert_eq!(left_out(&solution), [5, 6, 7, 30, 50]);
    }
}

/// Two targets on the tip, at some stops in the rows of each other.
fn exchanged(world: &World, at: &[usize]) -> MeasuredSeries {
    let mut series = world.series.clone();
    series.bodies.clear();
    for body in &world.series.bodies {
        let BodySeen::Pose(pose) = body.seen else { panic!("{:?}", body.seen) };
        let mut points = [Vector3::zeros(), Vector3::new(0.08, -0.05, 0.02)].map(|place| pose.transform(&place));
        if at.contains(&body.stop) {
            points.reverse();
        }
        let rows = points.into_iter().enumerate();
        series.bodies.extend(rows.map(|(k, at)| SeenBody {
            body: format!("target {k}"),
            seen: BodySeen::Point(at),
            ..body.clone()
        }));
    }
    series
}

#[test]
fn targets_in_the_rows_of_each_other_are_named_with_their_stops() {
    let world = World::new(76, Kind::Poses, 60, (3e-5, 0.0), 2e-5);
    for at in [&[7, 21, 22, 40][..], &[33], &[]] {
        let solution = identified(&world, exchanged(&world, at)).unwrap();
        let named = found(&solution, Code::TargetsExchanged);
        assert_eq!(named.map_or_else(Vec::new, Finding::subjects), stops(at), "{:?}", solution.findings);
        assert_eq!(left_out(&solution).len(), 2 * at.len());
        let explained = solution.findings.iter().find_map(|finding| match finding {
            Finding::MeasurementsLeftOut(found) => Some(found.explained_by.iter().map(|(code, _)| *code).collect()),
            _ => None,
        });
        let why = (!at.is_empty()).then(|| vec![Code::TargetsExchanged]);
        assert_eq!(explained, why);
    }
}

#[test]
fn what_a_stuck_tracker_wrote_again_is_left_out_and_named() {
    for (kind, sigma_rad) in KINDS {
        let world = World::new(75, kind, 50, (3e-5, sigma_rad), 2e-5);
        for (last, end) in [(20, 24), (30, 50)] {
            let mut series = world.series.clone();
            series.bodies[last + 1..end].iter_mut().for_each(|seen| seen.seen = world.series.bodies[last].seen);
            let solution = identified(&world, series).unwrap();
            let of: Vec<usize> = (last + 1..end).collect();
            assert_eq!(found(&solution, Code::MeasurementsRepeated).unwrap().subjects(), stops(&of));
            assert_eq!(left_out(&solution), of);
            assert!(found(&solution, Code::MeasurementsLeftOut).is_none());
        }
    }
}

/// A stop that is taken twice.
#[test]
fn a_target_that_stays_where_it_is_was_not_written_again() {
    let world = World::new(76, Kind::Points, 40, (3e-5, 0.0), 2e-5);
    let mut series = world.series.clone();
    series.stops[11].readings = series.stops[10].readings.clone();
    series.bodies[11].seen = series.bodies[10].seen;
    let solution = identified(&world, series).unwrap();
    assert_eq!(left_out(&solution), [0; 0]);
}

/// The nominal robot misses the one stop on the far side by far more than the others: its second axis leans.
#[test]
fn points_that_only_the_nominal_robot_misses_come_back() {
    for seed in 81..87 {
        let mut dice = Dice::new(seed);
        let mut truth = truth(&mut dice, &chain());
        truth.twists[1][3] += 0.05;
        let mut k = 0;
        let world = World::taken(dice, truth, Kind::Points, 60, (3e-5, 0.0), 2e-4, |dice| {
            let mut q = readings(dice);
            q[0] = if k == 30 { 2.9 } else { q[0] / 6.0 };
            k += 1;
            let errors = q.iter().map(|_| dice.normal(2e-4)).collect();
            (q, errors)
        });
        let solution = identified(&world, world.series.clone()).unwrap();
        assert_eq!(left_out(&solution), [0; 0], "seed {seed}");
    }
}

/// Joint readings of one session, and the measurements of another.
#[test]
fn rows_of_two_sessions_are_refused() {
    for (kind, sigma_rad) in KINDS {
        let [world, other] = [91, 92].map(|seed| World::new(seed, kind, 40, (3e-5, sigma_rad), 2e-5));
        let series = MeasuredSeries { stops: other.series.stops, ..world.series.clone() };
        let said = identified(&world, series).map(|_| ()).unwrap_err();
        assert_eq!(said.code, Code::ReadingsContradict, "{said}");
        let value = |name: &str| said.quantities.iter().find(|q| q.name == name).unwrap().value;
        assert!(value("misfit") > 0.5 * value("apart"), "{said}");
    }
}

#[test]
fn stops_of_one_name_in_two_series_are_told_apart() {
    let world = World::new(93, Kind::Points, 60, (3e-5, 0.0), 2e-5);
    let mut one = world.series.clone();
    let mut two = MeasuredSeries { name: "second".into(), ..world.series.clone() };
    two.stops = one.stops.split_off(30).into_iter().enumerate().map(|(k, s)| stop(k, s.readings.unwrap())).collect();
    two.bodies = one.bodies.split_off(30);
    two.bodies.iter_mut().for_each(|seen| seen.stop -= 30);
    for series in [&mut one, &mut two] {
        if let BodySeen::Point(at) = &mut series.bodies[7].seen {
            at.x += 0.1;
        }
    }
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    let solution = identify(world.chain.clone(), &[one, two], &options).unwrap();
    let named = ["run 007", "second 007"].map(|name| Subject::Stop(name.into()));
    assert_eq!(found(&solution, Code::MeasurementsLeftOut).unwrap().subjects(), named);
}

/// Any change of the readings fits what is measured at two stops again and again.
#[test]
fn two_stops_that_are_measured_again_and_again_name_no_mistake() {
    let mistakes = [
        Code::JointUnitWrong,
        Code::JointOrderWrong,
        Code::JointSignWrong,
        Code::ZeroOff,
        Code::RowsShifted,
        Code::AxesMirrored,
    ];
    for seed in 1..5 {
        let mut dice = Dice::new(seed);
        let truth = truth(&mut dice, &chain());
        let two = [readings(&mut dice), readings(&mut dice)];
        let mut k = 0;
        let world = World::taken(dice, truth, Kind::Points, 20, (5e-5, 0.0), 2e-5, |dice| {
            k += 1;
            (two[k % 2].clone(), (0..6).map(|_| dice.normal(2e-5)).collect())
        });
        match identified(&world, world.series.clone()) {
            Err(refusal) => assert!(!mistakes.contains(&refusal.code), "{seed}: {refusal}"),
            Ok(solution) => assert!(found(&solution, Code::FewImages).is_some(), "{seed}: {:?}", solution.findings),
        }
    }
}

/// A ball in so many sockets by turns, of which these are elsewhere from a stop on.
fn by_turns(seed: u64, sockets: usize, moved: &[usize], from: usize, shift: Vector3<f64>) -> World {
    touched((seed, sockets), |k| k % sockets, moved, from, shift)
}

/// A ball in so many sockets, each stop in one of them, of which those that moved are elsewhere from a stop on.
fn touched(
    (seed, sockets): (u64, usize),
    socket_at: impl Fn(usize) -> usize,
    moved: &[usize],
    from: usize,
    shift: Vector3<f64>,
) -> World {
    let mut world = World::sockets(seed, sockets, 2, 5e-5, 2e-5);
    let places: Vec<Vector3<f64>> = (0..sockets).map(|k| world.ball_at(&world.series.bodies[2 * k])).collect();
    let touched = (0..60).map(|k| {
        let socket = socket_at(k);
        let is_elsewhere = k >= from && moved.contains(&socket);
        let shift = if is_elsewhere { shift } else { Vector3::zeros() };
        (format!("socket {socket}"), places[socket] + shift)
    });
    world.put(&mut Dice::new(seed + 1000), touched);
    // The places that the distances are between are off by the noise of one stop.
    world.series.lengths.iter_mut().for_each(|length| length.sigma_m = 2e-4);
    world
}

fn displaced(solution: &Solution) -> Vec<&Displaced> {
    let found = solution.findings.iter();
    found
        .filter_map(|finding| if let Finding::Displaced(displaced) = finding { Some(displaced) } else { None })
        .collect()
}

#[test]
fn sockets_that_were_pushed_together_are_named_as_their_fixture() {
    let shift = Vector3::new(1e-3, -1.5e-3, 0.8e-3);
    for seed in [94, 95] {
        let solution = by_turns(seed, 3, &[0, 1, 2], 21, shift).solve(RobotModel::Rigid);
        let [said] = displaced(&solution)[..] else { panic!("seed {seed}: {:?}", solution.findings) };
        assert_eq!((said.body, said.images[0].as_str()), (Carried::Fixture, "021"));
        assert_eq!(said.places, ["socket 0", "socket 1", "socket 2"]);
        assert!((said.distance_m.0 - shift.norm()).abs() < 5e-4, "{said:?}");
        assert_eq!(Finding::from(said.clone()).code(), Code::WorkDisplaced);
        assert!(displaced(&by_turns(seed, 3, &[], 0, shift).solve(RobotModel::Rigid)).is_empty());
    }
}

/// Three sockets that were pushed together, and two that were touched behind that alone: nothing tells of those.
#[test]
fn of_sockets_that_were_pushed_together_those_are_named_that_tell_it() {
    let shift = Vector3::new(1e-3, -1.5e-3, 0.8e-3);
    for seed in [94, 95] {
        let world = touched((seed, 5), |k| if k < 42 { k % 3 } else { 3 + k % 2 }, &[0, 1, 2], 21, shift);
        let solution = world.solve(RobotModel::Rigid);
        let said = displaced(&solution)[0];
        assert_eq!((said.body, said.images[0].as_str()), (Carried::FixtureOfSome, "021"), "seed {seed}");
        assert_eq!(said.places, ["socket 0", "socket 1", "socket 2"]);
    }
}

/// The twist of all that fits best is none: the others stood still.
#[test]
fn single_sockets_that_were_pushed_are_named_and_not_those_that_stood_still() {
    let shift = Vector3::new(1e-3, -1.5e-3, 0.8e-3);
    for (seed, moved) in [(96, &[1][..]), (97, &[0]), (98, &[1, 2])] {
        let solution = by_turns(seed, 4, moved, 30, shift).solve(RobotModel::Rigid);
        let mut places = Vec::new();
        for said in displaced(&solution) {
            assert_eq!((said.body, said.weight), (Carried::Socket, Weight::Gate), "{said:?}");
            assert!((said.distance_m.0 - shift.norm()).abs() < 5e-4, "{said:?}");
            let first = (30..).find(|k| said.places[0].ends_with(&(k % 4).to_string())).unwrap();
            assert_eq!(said.images[0], format!("{first:03}"));
            places.extend(said.places.clone());
        }
        places.sort();
        let names: Vec<String> = moved.iter().map(|socket| format!("socket {socket}")).collect();
        assert_eq!(places, names, "seed {seed}: {:?}", solution.findings);
    }
}

/// A ball at eight places that are known in a frame of their own, touched one place after the other, as `stated` has them written.
fn known_places(seed: u64, stated: impl Fn(&str, Vector3<f64>) -> Vector3<f64>) -> World {
    let mut world = World::sockets(seed, 8, 6, 5e-5, 2e-5);
    let fixture = Pose::from_xyz_rpy([0.3, 0.2, -0.1], [0.1, 0.2, 0.3]);
    let all: Vec<Vector3<f64>> =
        world.series.bodies.iter().map(|seen| fixture.transform(&world.ball_at(seen))).collect();
    for (own, seen) in all.chunks(6).zip(world.series.bodies.chunks_mut(6)) {
        let place = stated(&seen[0].instrument, own.iter().sum::<Vector3<f64>>() / own.len() as f64);
        for seen in seen {
            (seen.seen, seen.kind) = (BodySeen::Point(place), InstrumentKind::Places);
            seen.instrument = "fixture".into();
        }
    }
    world.series.lengths.clear();
    world
}

/// Its touches come one after the other: from the last of them on the others seem to stand elsewhere.
#[test]
fn a_known_place_that_is_misstated_is_named_and_no_tracker() {
    for (seed, off) in [(59, [1e-3, 0.0, 0.0]), (60, [0.0, -2e-3, 0.0]), (61, [0.0, 3e-3, 4e-3]), (62, [0.0; 3])] {
        let off = Vector3::from(off);
        let world = known_places(seed, |name, place| if name == "socket 3" { place + off } else { place });
        let solution = world.solve(RobotModel::Rigid);
        assert!(displaced(&solution).is_empty(), "seed {seed}: {:?}", solution.findings);
        let found = solution.findings.iter();
        let said: Vec<_> =
            found.filter_map(|f| if let Finding::PlaceMisstated(place) = f { Some(place) } else { None }).collect();
        if off == Vector3::zeros() {
            assert!(said.is_empty(), "{said:?}");
            continue;
        }
        let [said] = said[..] else { panic!("seed {seed}: {:?}", solution.findings) };
        let found = Vector3::from(said.off_m.map(|(off, _)| off));
        assert!((found + off).norm() < 3e-4 && said.stops[0] == "018", "{said:?}");
        assert_eq!((said.weight, Finding::from(said.clone()).code()), (Weight::Gate, Code::PlaceContradicted));
    }
}

/// Few places lie nearly in a plane: a part of them fits its mirror image.
#[test]
fn known_places_in_left_handed_axes_are_no_moved_fixture() {
    let swapped = |_: &str, place: Vector3<f64>| Vector3::new(place.y, place.x, place.z);
    let negated = |_: &str, place: Vector3<f64>| Vector3::new(place.x, place.y, -place.z);
    for seed in [63, 64] {
        for world in [known_places(seed, swapped), known_places(seed, negated)] {
            let said = identified(&world, world.series.clone()).unwrap_err();
            assert_eq!(said.code, Code::AxesMirrored, "seed {seed}: {said}");
        }
    }
}

/// An arm that turns its wrist about one place fits the points in any unit, as these shrink with the point on the tip: what is left shrinks alike,
/// and tells nothing.
#[test]
fn points_about_the_wrist_are_in_no_other_unit() {
    for seed in [74, 75] {
        let mut dice = Dice::new(seed);
        let truth = truth(&mut dice, &chain());
        let world = World::taken(dice, truth, Kind::Points, 24, (2e-5, 0.0), 0.0, |dice| {
            let wrist = readings(dice).split_off(3);
            ([vec![0.1, -1.2, 1.4], wrist].concat(), vec![0.0; 6])
        });
        let refused = identified(&world, world.series.clone()).err().map(|refused| refused.code);
        assert_ne!(refused, Some(Code::MeasuredUnit), "seed {seed}");
    }
}
