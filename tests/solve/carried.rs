//! Cells in which more than an arm moves: a positioner that carries the plate, a rail that carries the arm, a second arm.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::path::Path;

use robotcal::Code;
use robotcal::assess::{View, predict_pose};
use robotcal::diagnose::{Finding, Subject};
use robotcal::geom::Pose;
use robotcal::identify::{Options, RobotModel, Solution, identify};
use robotcal::problem::{BodySeen, MeasuredSeries};
use robotcal::series::CameraMount;
use robotcal::simulate::SimulatedSeries;
use robotcal::study::measured;
use robotcal::urdf::{BASE_FROM_BASE, Chain, RobotDescription, patch_origins};

use crate::coverage::world;
use crate::measured_worlds::{Kind, World, readings, truth};
use crate::robots::{kr6_urdf, positioner};
use crate::said::assert_says;
use crate::support::small::Dice;

/// A positioner before the arm.
fn on_a_positioner() -> RobotDescription {
    with(&positioner(0.75, 0.8))
}

const RAIL: &str = r#"
  <link name="hall"/>
  <joint name="rail" type="prismatic"><parent link="hall"/><child link="base_link"/><origin xyz="0 0 0.1" rpy="0 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-0.8" upper="0.8" effort="0" velocity="1"/></joint>
"#;

fn arm() -> RobotDescription {
    let urdf = kr6_urdf();
    robotcal::urdf::read(&urdf).unwrap()
}

fn with(elements: &str) -> RobotDescription {
    let own = arm();
    let end = own.text.rfind("</robot>").unwrap();
    let text = format!("{}{elements}{}", &own.text[..end], &own.text[end..]);
    RobotDescription::from_text(&own.path, text).unwrap()
}

/// A cell as it is nominally, and as it is known.
struct Cell {
    name: &'static str,
    actual: Chain,
    known: Chain,
}

fn cells() -> [Cell; 3] {
    let same = |name, chain: Chain| Cell { name, actual: chain.clone(), known: chain };
    let (two, prefix) = arm().with_second(None, &arm()).unwrap();
    let ends = (format!("{prefix}link_6"), "link_6");
    let between = Pose::from_xyz_rpy([1.25, 0.08, 0.03], [0.02, -0.01, PI - 0.14]);
    let placed = patch_origins(&two.text, &BTreeMap::from([(BASE_FROM_BASE.to_owned(), between)])).unwrap();
    let placed = RobotDescription::from_text(&two.path, placed).unwrap();
    let chain = |robot: &RobotDescription| robot.chain(Some(&ends.0), Some(ends.1)).unwrap();
    [
        same("positioner", on_a_positioner().chain(Some("table"), Some("link_6")).unwrap()),
        same("rail", with(RAIL).chain(None, Some("link_6")).unwrap()),
        Cell { name: "two arms", actual: chain(&placed), known: chain(&two) },
    ]
}

/// Sums of squared errors of the predicted position of the camera in the plate frame, m^2: actual, stated, and how many.
fn squares(solution: &Solution, world: &SimulatedSeries, actual: &Chain) -> [f64; 3] {
    let truth = world.truth.robot(actual).unwrap();
    let (camera, plate) = (world.truth.camera_pose.pose(), world.truth.plate_poses.values().next().unwrap().pose());
    let view = View::first(&solution.fit.problem).unwrap();
    let mut sums = [0.0; 3];
    for h in &world.truth.held_out {
        let p = predict_pose(&solution.fit, view, &h.readings).unwrap();
        let tip = truth.base_from_tip(&h.readings);
        let found = CameraMount::Hand.camera_from_plate(&camera, &tip, &plate).inverse();
        let off = (p.plate_from_camera.inverse() * found).log();
        sums[0] += off.fixed_rows::<3>(0).norm_squared();
        sums[1] += (0..3).map(|k| p.model[(k, k)]).sum::<f64>();
        sums[2] += 1.0;
    }
    sums
}

/// RMS error of a cell over worlds, actual and stated, m.
fn errors_m(cell: &Cell, seeds: std::ops::RangeInclusive<u64>) -> [f64; 2] {
    let mut sums = [0.0; 3];
    for seed in seeds {
        let world = world(&cell.actual, seed);
        let solution = identify(cell.known.clone(), &[measured(&world, &cell.known)], &Options::default()).unwrap();
        let own = squares(&solution, &world, &cell.actual);
        println!(
            "{} seed {seed}: {:.4} mm, stated {:.4}",
            cell.name,
            1e3 * (own[0] / own[2]).sqrt(),
            1e3 * (own[1] / own[2]).sqrt()
        );
        (0..3).for_each(|k| sums[k] += own[k]);
    }
    [(sums[0] / sums[2]).sqrt(), (sums[1] / sums[2]).sqrt()]
}

#[test]
fn robots_that_carry_both_ends_are_identified_as_well_as_is_stated() {
    for cell in &cells() {
        let [actual, stated] = errors_m(cell, 1..=2);
        println!(
            "{}: actual {:.4} mm, stated {:.4}, ratio {:.3}",
            cell.name,
            1e3 * actual,
            1e3 * stated,
            actual / stated
        );
        assert!((0.5..2.0).contains(&(actual / stated)), "{}: {actual} {stated}", cell.name);
    }
}

#[test]
#[ignore = "minutes; its figures stand in the guide, Positioners, rails and second arms"]
fn study_of_cells_against_their_bound() {
    let worlds = std::env::var("WORLDS").map_or(20, |w| w.parse().unwrap());
    for cell in &cells() {
        let [actual, stated] = errors_m(cell, 1..=worlds);
        println!("| {} | {:.4} | {:.4} | {:.3} |", cell.name, 1e3 * actual, 1e3 * stated, actual / stated);
    }
}

#[test]
fn the_urdf_of_a_carried_base_has_every_origin_where_it_belongs() {
    let cell = &cells()[0];
    let world = world(&cell.actual, 3);
    let solution = identify(cell.known.clone(), &[measured(&world, &cell.known)], &Options::default()).unwrap();
    let robot = &solution.fit.state.robot;
    let origins: BTreeMap<String, Pose> = robot.urdf_origins().into_iter().map(|(n, o)| (n.to_owned(), o)).collect();
    let text = patch_origins(&on_a_positioner().text, &origins).unwrap();
    let written = RobotDescription::from_text(Path::new("written.urdf"), text).unwrap();
    let read = robotcal::model::robot::Robot {
        terms: robot.as_exported().terms,
        ..robotcal::model::robot::Robot::nominal(written.chain(Some("table"), Some("link_6")).unwrap())
    };
    let stated = robot.without_local_errors();
    for h in &world.truth.held_out {
        let (angle, distance) = stated.base_from_tip(&h.readings).distance(&read.base_from_tip(&h.readings));
        assert!(angle < 1e-9 && distance < 1e-9, "{angle} {distance}");
    }
}

/// Positioner, rail or second arm may have been recorded apart from the first arm: where they stand in the chain, the rows of theirs alone
/// are shifted. The bases of two arms, found from wrong readings, are found anew for every mistake that is tried.
#[test]
fn mistakes_in_what_stands_beside_the_arm_are_named() {
    let named = |(cell, made): (&Cell, &MeasuredSeries), change: &dyn Fn(&mut Vec<Vec<f64>>)| {
        let mut series = made.clone();
        let mut readings: Vec<Vec<f64>> = series.stops.iter().filter_map(|s| s.readings.clone()).collect();
        change(&mut readings);
        series.stops.iter_mut().zip(readings).for_each(|(stop, q)| stop.readings = Some(q));
        identify(cell.known.clone(), &[series], &Options::default()).unwrap_err()
    };
    for cell in &cells() {
        let made = (cell, &measured(&world(&cell.actual, 4), &cell.known));
        let n = cell.known.readings.len();
        let beside = if cell.name == "rail" { 0..1 } else { 0..n - 6 };
        let names: Vec<&str> = cell.known.readings[beside.clone()].iter().map(String::as_str).collect();
        let shifted = named(made, &|rows| {
            let given = rows.clone();
            for (k, q) in rows.iter_mut().enumerate() {
                q[beside.clone()].copy_from_slice(&given[(k + 1) % given.len()][beside.clone()]);
            }
        });
        assert_says(&shifted, Code::RowsShifted, &names);
        let sign = named(made, &|rows| rows.iter_mut().for_each(|q| q[n - 2] = -q[n - 2]));
        assert_says(&sign, Code::JointSignWrong, &[cell.known.readings[n - 2].as_str()]);
        if cell.name == "rail" {
            for unit_m in [1e-3, 1e-2, 0.0254] {
                let unit = named(made, &|rows| rows.iter_mut().for_each(|q| q[0] /= unit_m));
                assert_eq!((unit.code, unit.place.as_str()), (Code::JointUnitWrong, names[0]), "{unit_m}: {unit}");
            }
            let constant = named(made, &|rows| rows.iter_mut().for_each(|q| q[0] = 0.0));
            assert_says(&constant, Code::LinkLengthsWrong, &names);
        }
    }
}

/// The second arm carries the plate: a camera that stands still is no cause there.
#[test]
fn two_arms_in_each_others_place_are_named() {
    let [_, _, cell] = cells();
    let made = measured(&world(&cell.actual, 4), &cell.known);
    let said = |change: &dyn Fn(&mut MeasuredSeries)| {
        let mut series = made.clone();
        change(&mut series);
        identify(cell.known.clone(), &[series], &Options::default()).unwrap_err()
    };
    let exchanged = |series: &mut MeasuredSeries| {
        series.stops.iter_mut().filter_map(|s| s.readings.as_mut()).for_each(|q| q.reverse());
    };
    let names: Vec<&str> = cell.known.readings.iter().map(String::as_str).collect();
    assert_says(&said(&exchanged), Code::JointOrderWrong, &names);
    // Of two arms of a kind the columns are exchanged as well as what they carry.
    assert_says(&said(&|series| series.mount = CameraMount::Fixed), Code::JointOrderWrong, &names);
}

/// Tracked poses of an arm on a rail; the errors of its readings have these sigmas, rad and m.
fn on_rail(chain: &Chain, (rail, seed): (usize, u64), sigma: impl Fn(usize) -> f64) -> World {
    let mut dice = Dice::new(seed);
    let truth = truth(&mut dice, chain);
    World::taken(dice, truth, Kind::Poses, 40, (5e-5, 1e-4), 2e-5, |dice| {
        let mut q = readings(dice);
        q.insert(rail, dice.between(-0.8, 0.8));
        let errors = (0..q.len()).map(|k| dice.normal(sigma(k))).collect();
        (q, errors)
    })
}

/// The gear of a rail is as wrong as a tracker may be: links alone tell which of them it is.
#[test]
fn a_rail_that_moves_by_less_than_it_reads_is_no_fault_of_the_tracker() {
    let chain = with(RAIL).chain(None, Some("link_6")).unwrap();
    let rail = chain.readings.iter().position(|name| name == "rail").unwrap();
    let mut world = on_rail(&chain, (rail, 61), |_| 2e-5);
    world.series.stops.iter_mut().filter_map(|s| s.readings.as_mut()).for_each(|q| q[rail] *= 1.002);
    let doubted = |series: MeasuredSeries| {
        let options = Options { model: RobotModel::Gear, ..Options::default() };
        let solution = identify(chain.clone(), &[series], &options).unwrap();
        solution.findings.iter().any(|f| f.fails() && f.code() == Code::LengthsContradicted)
    };
    assert!(!doubted(world.series.clone()));
    let mut off = world.series.clone();
    for body in &mut off.bodies {
        if let BodySeen::Pose(pose) = &mut body.seen {
            pose.translation *= 1.02;
        }
    }
    assert!(doubted(off));
}

/// What is stated of the noise of a reading has the unit of its joint, m on a rail.
#[test]
fn the_noise_of_a_rail_is_a_length() {
    let chain = with(RAIL).chain(None, Some("link_6")).unwrap();
    let rail = chain.readings.iter().position(|name| name == "rail").unwrap();
    let sigma = 4e-3;
    for (noisy, unit) in [(rail, "m"), (rail + 1, "rad")] {
        let world = on_rail(&chain, (rail, 62), |k| if k == noisy { sigma } else { 2e-5 });
        let solution = world.solve_with(&Options::default());
        let of_noise = solution.findings.iter().filter(|f| f.code() == Code::JointNoiseLarge);
        let of_noise: Vec<&Finding> = of_noise.collect();
        assert_eq!(of_noise.len(), 1, "{:?}", solution.findings);
        let found = of_noise[0];
        let noise = &found.quantities()[0];
        println!("{}: {} {}", chain.readings[noisy], noise.value, noise.unit);
        assert!(found.fails() && found.subjects().contains(&Subject::Joint(chain.readings[noisy].clone())));
        assert_eq!(noise.unit, unit);
        assert!((0.6 * sigma..1.6 * sigma).contains(&noise.value), "{}", noise.value);
    }
}
