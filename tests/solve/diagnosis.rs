//! Series that belong to another robot, or whose camera stands elsewhere than series.toml says, are refused by name.

use crate::robots::kr6;
use crate::said::assert_says;
use robotcal::assess::WorkspacePoint;
use robotcal::diagnose::Finding;
use robotcal::geom::Pose;
use robotcal::identify::{JointNoise, Options, RobotModel, identify};
use robotcal::problem::{BodySeen, ImageRejection, InstrumentKind, MeasuredSeries, MeasuredStop, SeenBody};
use robotcal::series::{CameraMount, Plate, PlateKind};
use robotcal::simulate::{RobotErrors, WorldRequest, series};
use robotcal::study::measured;
use robotcal::urdf::Chain;
use robotcal::{Code, Error};

fn request(chain: &Chain) -> WorldRequest {
    let mut plate = Plate::lattice(PlateKind::Points, 8, 6, 0.038, 0.1e-3);
    plate.markers.iter_mut().for_each(|m| m.outer_radius_m = 0.01);
    WorldRequest { images: 16, least_markers: 12, seed: 5, ..WorldRequest::typical(chain.clone(), plate) }
}

fn seen(chain: &Chain) -> MeasuredSeries {
    measured(&series(&request(chain)).unwrap(), chain)
}

/// A number of what was found.
fn number(said: &Error, name: &str) -> f64 {
    said.quantities.iter().find(|q| q.name == name).unwrap().value
}

fn diagnosis(chain: Chain, series: MeasuredSeries) -> Error {
    let error = identify(chain, &[series], &Options::default()).map(|_| ()).unwrap_err();
    assert_eq!(error.exit_code(), 3, "{error}");
    error
}

#[test]
fn a_larger_robot_of_the_same_build_is_named() {
    let right = kr6();
    let series = seen(&right);
    let mut larger = right;
    // The forearm of the long version of the arm.
    let elbow = larger.joints.iter().position(|j| j.name == "joint_a5").unwrap();
    larger.joints[elbow].origin.translation *= 1.6;
    let said = diagnosis(larger, series);
    assert_eq!(said.code, Code::LinkLengthsWrong, "{said}");
    let (angle, distance) = (number(&said, "angle"), number(&said, "distance"));
    assert!(angle < 0.01 && (0.03..0.4).contains(&distance), "{angle} rad, {distance} m");
}

#[test]
fn stops_that_were_taken_again_and_again_are_counted_once() {
    let chain = kr6();
    let good = seen(&chain);
    let again = |different: usize| {
        let stop = |row: usize| {
            let mut stop = good.stops[row % different].clone();
            stop.observations.iter_mut().for_each(|o| o.uv[0] += 1e-3 * row as f64);
            MeasuredStop { row, image: format!("again_{row:03}.png"), ..stop }
        };
        let series = MeasuredSeries { stops: (0..24).map(stop).collect(), ..good.clone() };
        identify(chain.clone(), &[series], &Options::default())
    };
    assert_eq!(again(4).map(|_| ()).unwrap_err().code, Code::ImagesTooFew);
    let few = again(8).unwrap();
    let found = few.findings.iter().find(|f| f.code() == Code::FewImages).unwrap();
    let count = |name: &str| found.quantities().into_iter().find(|q| q.name == name).unwrap().value;
    assert_eq!([count("images"), count("different")], [24.0, 8.0]);
}

/// They turn nothing, and look like other link lengths.
#[test]
fn zeros_of_parallel_joints_that_cancel_are_found() {
    let chain = kr6();
    let world = WorldRequest { images: 24, ..request(&chain) };
    let mut series = measured(&series(&world).unwrap(), &chain);
    let off = 15f64.to_radians();
    series.stops.iter_mut().filter_map(|s| s.readings.as_mut()).for_each(|q| (q[1], q[2]) = (q[1] + off, q[2] - off));
    let solution = identify(chain, &[series], &Options::default()).unwrap();
    for (name, lacks) in [("joint_a2", -off), ("joint_a3", off)] {
        let found = solution.findings.iter().find_map(|f| match f {
            Finding::ZeroOff(zero) if zero.joint == name => Some(zero),
            _ => None,
        });
        let found = found.unwrap_or_else(|| panic!("{name}: {:?}", solution.findings));
        assert!(!found.is_reversed && (found.offset - lacks).abs() < 0.03, "{found:?}");
    }
}

/// The fit would take up the smaller ones by the origins of two joints, and name these.
#[test]
fn the_zero_of_one_joint_is_found_from_the_size_on_that_is_no_matter_of_the_fit() {
    let chain = kr6();
    let world = series(&WorldRequest { images: 30, ..request(&chain) }).unwrap();
    for (reading, degrees) in [(1, 8.0), (2, 8.0), (1, -10.0), (2, 30.0), (4, 6.0)] {
        let (mut series, off) = (measured(&world, &chain), f64::to_radians(degrees));
        series.stops.iter_mut().filter_map(|s| s.readings.as_mut()).for_each(|q| q[reading] += off);
        let options = Options { model: RobotModel::Rigid, ..Options::default() };
        let solution = identify(chain.clone(), &[series], &options).unwrap();
        let zeros = solution.findings.iter().filter_map(|f| if let Finding::ZeroOff(z) = f { Some(z) } else { None });
        let zeros: Vec<(&str, f64)> = zeros.map(|zero| (zero.joint.as_str(), zero.offset)).collect();
        println!("{degrees} deg of {}: {zeros:?}", chain.readings[reading]);
        assert_eq!(zeros.len(), 1, "{zeros:?}");
        assert!(zeros[0].0 == chain.readings[reading] && (zeros[0].1 + off).abs() < 0.03, "{zeros:?}");
    }
}

#[test]
fn the_size_of_a_plate_that_does_not_fit_is_told() {
    let chain = kr6();
    for factor in [0.9, 1.15] {
        let mut series = seen(&chain);
        series.plate.pitch_m *= factor;
        series.plate.markers.iter_mut().for_each(|m| m.position_m = m.position_m.map(|x| factor * x));
        let true_pitch_m = series.plate.pitch_m / factor;
        let said = diagnosis(chain.clone(), series);
        assert_eq!(said.code, Code::PlatePitchWrong, "{said}");
        let (size, pitch_m) = (number(&said, "plate_size"), number(&said, "pitch"));
        assert!((size * factor - 1.0).abs() < 0.02, "{size} times as large as stated, stated {factor} of the truth");
        assert!((pitch_m / true_pitch_m - 1.0).abs() < 0.02, "{pitch_m} m, put in {true_pitch_m} m");
    }
}

/// The row whose readings an image has.
type RowOf<'a> = &'a dyn Fn(usize) -> usize;

/// Of 24 images, with the readings that `of` gives to each by its place.
fn said_of_rows(chain: &Chain, of: impl Fn(usize) -> usize) -> (Error, Vec<String>) {
    let world = WorldRequest { images: 24, ..request(chain) };
    let mut series = measured(&series(&world).unwrap(), chain);
    let given: Vec<_> = series.stops.iter().map(|s| s.readings.clone()).collect();
    let names = series.stops.iter().map(|s| s.image.clone()).collect();
    (0..24).for_each(|k| series.stops[k].readings.clone_from(&given[of(k) % 24]));
    (diagnosis(chain.clone(), series), names)
}

#[test]
fn rows_that_are_shifted_from_an_image_on_are_told_from_a_shift_of_all() {
    let chain = kr6();
    // A row was lost, a row was written twice, and one half was turned by a row.
    let lost = |k: usize| if k < 8 { k } else { k + 1 };
    let twice = |k: usize| if k < 5 { k } else { k - 1 };
    let turned = |k: usize| if k < 11 { k } else { 11 + (k + 1) % 13 };
    let cases: [(RowOf, usize, f64); 3] = [(&lost, 9, 15.0), (&twice, 5, 18.0), (&turned, 11, 12.0)];
    for (of, first, images) in cases {
        let (said, names) = said_of_rows(&chain, of);
        assert_eq!((said.code, &said.place), (Code::RowsShifted, &names[first]), "{said}");
        assert_eq!(number(&said, "images_shifted"), images, "{said}");
        assert!(number(&said, "misfit_undone") < 0.01 && said.remedy.contains(&names[first]), "{said}");
    }
    for all in [1, 23] {
        let (said, _) = said_of_rows(&chain, |k| k + all);
        assert_eq!(said.code, Code::RowsShifted, "{said}");
        assert!(said.quantities.iter().all(|q| q.name != "images_shifted"), "{said}");
    }
}

#[test]
fn joints_that_were_not_read_any_more_are_named_in_a_short_series() {
    let chain = kr6();
    let frozen = |joints: std::ops::Range<usize>| {
        let mut series = seen(&chain);
        series.stops.truncate(9);
        let last = series.stops[3].readings.clone().unwrap();
        for q in series.stops[4..].iter_mut().filter_map(|s| s.readings.as_mut()) {
            q[joints.clone()].copy_from_slice(&last[joints.clone()]);
        }
        let said = diagnosis(chain.clone(), series);
        (said.code, said.place)
    };
    assert_eq!(frozen(2..3), (Code::JointReadingsWrong, "joint_a3".to_owned()));
    assert_eq!(frozen(0..6), (Code::JointReadingsWrong, "joint readings".to_owned()));
}

#[test]
fn a_joint_that_reads_the_same_at_all_stops_is_named() {
    let chain = kr6();
    for joint in [0, 1] {
        let mut series = seen(&chain);
        let first = series.stops[0].readings.as_ref().unwrap()[joint];
        series.stops.iter_mut().filter_map(|s| s.readings.as_mut()).for_each(|q| q[joint] = first);
        let said = diagnosis(chain.clone(), series);
        let name = &chain.readings[joint];
        assert_eq!((said.code, &said.place), (Code::ReadingsContradict, name), "{said}");
        assert!(number(&said, "stops") > 15.5 && said.remedy.contains(name), "{said}");
    }
}

#[test]
fn an_exchanged_camera_mount_is_named() {
    let chain = kr6();
    let mut series = seen(&chain);
    series.mount = CameraMount::Fixed;
    let said = diagnosis(chain, series);
    assert_eq!(said.code, Code::CameraMountWrong, "{said}");
    assert!(said.remedy.contains("\"hand\""), "{said}");
}

/// A detector that does not know that the pictures are mirrored gives ids from the other side of a plate that looks the same from there.
#[test]
fn mirrored_and_transposed_images_are_named() {
    let chain = kr6();
    for is_transposed in [false, true] {
        let mut series = seen(&chain);
        let (width_px, columns) = (f64::from(series.width_px), series.plate.columns);
        for stop in &mut series.stops {
            for o in stop.observations.iter_mut() {
                o.uv = if is_transposed { [o.uv[1], o.uv[0]] } else { [width_px - 1.0 - o.uv[0], o.uv[1]] };
                o.marker = o.marker / columns * columns + columns - 1 - o.marker % columns;
            }
            stop.observations.sort_by_key(|o| (o.marker, o.edge));
        }
        if is_transposed {
            (series.width_px, series.height_px) = (series.height_px, series.width_px);
        }
        let said = diagnosis(chain.clone(), series);
        assert_says(&said, Code::ImagesMirrored, &["joint_a1", "joint_a4", "joint_a6"]);
        assert!(number(&said, "misfit_undone") < 0.01, "{said}");
    }
}

#[test]
fn mistakes_in_single_columns_are_named() {
    let chain = kr6();
    let with = |change: &dyn Fn(&mut Vec<f64>)| {
        let mut series = seen(&chain);
        series.stops.iter_mut().filter_map(|s| s.readings.as_mut()).for_each(change);
        let said = diagnosis(chain.clone(), series);
        // What is left is the deviation of the robot from nominal.
        let (misfit, left) = (number(&said, "misfit"), number(&said, "misfit_undone"));
        assert!(left < 0.01 && misfit > 5.0 * left, "{misfit} and {left}: {said}");
        said
    };
    let said = with(&|q| q[4] = q[4].to_radians());
    assert_eq!((said.code, said.place.as_str()), (Code::JointUnitWrong, "joint_a5"), "{said}");
    let said = with(&|q| (q[3], q[5]) = (-q[3], -q[5]));
    assert_eq!((said.code, said.place.as_str()), (Code::JointSignWrong, "joint_a4, joint_a6"), "{said}");
    // Counted from the ground, as some controllers do.
    for sign in [1.0, -1.0] {
        let said = with(&|q| q[2] += sign * q[1]);
        assert_eq!((said.code, said.place.as_str()), (Code::JointCoupled, "joint_a3"), "{said}");
    }
    // Zeros of another convention.
    for (joint, name) in [(1, "joint_a2"), (2, "joint_a3"), (3, "joint_a4"), (4, "joint_a5")] {
        for lacking in [-90.0_f64, 90.0] {
            let said = with(&|q| q[joint] -= lacking.to_radians());
            assert_eq!((said.code, said.place.as_str()), (Code::ZeroOff, name), "{said}");
            assert!((number(&said, "offset") - lacking.to_radians()).abs() < 1e-9, "{said}");
        }
    }
    // In a wrist a zero half a turn off is the sign of the joint behind it, and the other way round: both are named.
    for change in [|q: &mut Vec<f64>| q[3] += std::f64::consts::PI, |q: &mut Vec<f64>| q[4] = -q[4]] {
        let said = with(&change);
        assert_eq!((said.code, said.place.as_str()), (Code::JointSignWrong, "joint_a5"), "{said}");
        assert!(said.remedy.contains("joint_a4"), "{said}");
    }
    let said = with(&|q| (q[3], q[4], q[5]) = (q[4], q[5], q[3]));
    assert_eq!((said.code, said.place.as_str()), (Code::JointOrderWrong, "joint_a4, joint_a6, joint_a5"), "{said}");
    let said = with(&|q| q.reverse());
    assert_eq!(said.code, Code::JointOrderWrong, "{said}");
    assert!(said.remedy.contains("joint_a6, joint_a5, joint_a4"), "{said}");
}

#[test]
fn images_that_fit_the_robot_found_are_not_left_out_for_missing_the_nominal_one() {
    let chain = kr6();
    let mut series = seen(&chain);
    // Mastering off by five degrees: some images miss the nominal robot by far more than others.
    series.stops.iter_mut().filter_map(|s| s.readings.as_mut()).for_each(|q| q[1] += 5f64.to_radians());
    let solution = identify(chain, &[series], &Options::default()).unwrap();
    let left_out: Vec<_> = solution.fit.problem.images.iter().filter_map(|i| i.rejected.as_ref()).collect();
    assert!(left_out.is_empty(), "{left_out:?}");
    let off = |f: &Finding| matches!(f, Finding::ZeroOff(zero) if zero.joint == "joint_a2");
    assert!(solution.findings.iter().any(off), "{:?}", solution.findings);
}

/// Images that are left out, and circles of rows that are named, where the readings of some rows stand in others.
fn left_out_and_named(joint_noise_rad: f64, moved: &[(usize, usize)]) -> (Vec<usize>, Vec<Vec<usize>>) {
    let chain = kr6();
    let world = WorldRequest { images: 24, joint_noise_rad, ..request(&chain) };
    let mut series = measured(&series(&world).unwrap(), &chain);
    let given: Vec<_> = series.stops.iter().map(|s| s.readings.clone()).collect();
    for &(to, from) in moved {
        series.stops[to].readings.clone_from(&given[from]);
    }
    let solution = identify(chain, &[series], &Options::default()).unwrap();
    let images = &solution.fit.problem.images;
    let row = |name: &String| images.iter().position(|i| i.name == *name).unwrap();
    let circles = solution.findings.iter().filter_map(|f| match f {
        Finding::ExchangedReadings(found) => Some(found.circle.iter().map(row).collect()),
        _ => None,
    });
    ((0..24).filter(|&i| images[i].rejected.is_some()).collect(), circles.collect())
}

#[test]
fn rows_that_were_exchanged_are_named_with_one_another() {
    // Of a robot that repeats badly.
    assert_eq!(left_out_and_named(2e-3, &[(3, 8), (8, 3)]), (vec![3, 8], vec![vec![3, 8]]));
    assert_eq!(left_out_and_named(2e-5, &[(2, 7), (7, 11), (11, 2)]), (vec![2, 7, 11], vec![vec![2, 11, 7]]));
    // Readings that are nobody's.
    assert_eq!(left_out_and_named(2e-5, &[(2, 7)]), (vec![2], vec![]));
}

/// 24 images beside which a tracker saw the tip, with the images that `of` gives to each stop by its place.
fn beside_a_tracker(of: impl Fn(usize) -> usize) -> Result<Vec<Finding>, Error> {
    let chain = kr6();
    let world = WorldRequest { images: 24, ..request(&chain) };
    let mut series = measured(&series(&world).unwrap(), &chain);
    let robot = identify(chain.clone(), std::slice::from_ref(&series), &Options::default()).unwrap().exported_robot();
    let tracker_from_base = Pose::from_xyz_rpy([1.5, -0.8, 0.4], [0.3, -0.2, 1.1]);
    let tip_from_target = Pose::from_xyz_rpy([0.05, 0.02, 0.08], [0.2, 0.4, -0.1]);
    let target = |(k, stop): (usize, &MeasuredStop)| SeenBody {
        stop: k,
        instrument: "tracker".into(),
        kind: InstrumentKind::Tracker,
        body: "target".into(),
        seen: BodySeen::Pose(
            tracker_from_base * robot.base_from_tip(stop.readings.as_ref().unwrap()) * tip_from_target,
        ),
        sigma_m: 1e-4,
        sigma_rad: 2e-4,
    };
    series.bodies = series.stops.iter().enumerate().map(target).collect();
    let seen: Vec<_> = series.stops.iter().map(|s| s.observations.clone()).collect();
    series.stops.iter_mut().enumerate().for_each(|(k, stop)| stop.observations = seen[of(k) % 24].clone());
    identify(chain, &[series], &Options::default()).map(|solution| solution.findings)
}

#[test]
fn images_are_blamed_for_their_rows_where_a_tracker_fits_the_readings() {
    let exchanged = |k| match k {
        3 => 8,
        8 => 3,
        k => k,
    };
    let findings = beside_a_tracker(exchanged).unwrap();
    let found: Vec<_> = (findings.iter())
        .filter_map(|f| if let Finding::ExchangedReadings(f) = f { Some((f.circle.len(), f.others_fit)) } else { None })
        .collect();
    assert_eq!(found, [(2, true)], "{findings:?}");
    let said = beside_a_tracker(|k| k + 1).map(|_| ()).unwrap_err();
    assert_eq!(said.code, Code::RowsShifted, "{said}");
    assert!(said.remedy.contains("observations.csv"), "{}", said.remedy);
}

#[test]
fn what_cost_half_of_the_images_is_said_beside_their_number() {
    let chain = kr6();
    let world = WorldRequest { images: 24, ..request(&chain) };
    let mut series = measured(&series(&world).unwrap(), &chain);
    for stop in series.stops.iter_mut().step_by(2) {
        stop.observations.clear();
        let what = "is 640 x 512 px, but 12 images are 1280 x 1024 px".to_owned();
        stop.left_out = Some(ImageRejection::Unusable { why: Code::ImageSizeDiffers, what });
    }
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    let solution = identify(chain, &[series], &options).unwrap();
    let found = solution.findings.iter().find(|f| f.code() == Code::FewImages).unwrap();
    let values: Vec<f64> = found.quantities().iter().map(|q| q.value).collect();
    assert_eq!(values, [12.0, 12.0, 12.0], "{found:?}");
    assert!(found.remedy().contains(Code::ImageSizeDiffers.name()), "{found}");
}

#[test]
fn joints_that_never_moved_do_not_make_the_others_uncertain() {
    let chain = kr6();
    let from = seen(&chain).stops[0].readings.clone().unwrap();
    // The wrist turns about a stop of the usual world; the arm stands still.
    let turned = |k: usize| {
        let angle = |joint: usize, size: f64| from[joint] + size * (1.7 * (k * (joint + 1)) as f64).sin();
        vec![from[0], from[1], from[2], angle(3, 0.8), angle(4, 0.4), angle(5, 2.0)]
    };
    let postures = Some((0..30).map(turned).collect());
    let world = series(&WorldRequest { images: 30, postures, ..request(&chain) }).unwrap();
    let sigmas = |joint_noise: JointNoise| {
        let options = Options { joint_noise, ..Options::default() };
        let solution = identify(chain.clone(), &[measured(&world, &chain)], &options).unwrap();
        let inside = |w: &&WorkspacePoint| w.covered;
        let mut inside: Vec<f64> = solution.uncertainty.workspace.iter().filter(inside).map(|w| w.sigma_m).collect();
        inside.sort_by(f64::total_cmp);
        let outside =
            solution.uncertainty.workspace.iter().filter(|w| !w.covered).map(|w| w.sigma_m).fold(0.0, f64::max);
        (inside[inside.len() / 2], outside)
    };
    let (known, estimated) = (sigmas(JointNoise::Known(2e-5)), sigmas(JointNoise::Estimated));
    assert!(estimated.0 < 2.0 * known.0 && estimated.0 < 1e-3, "{} m, with known noise {} m", estimated.0, known.0);
    assert!(estimated.1 > 10.0 * estimated.0, "{} m where the arm never was", estimated.1);
}

#[test]
fn views_straight_at_the_plate_do_not_determine_the_camera_and_some_tilted_ones_do() {
    let chain = kr6();
    let mut straight = request(&chain);
    (straight.views.tilt_rad, straight.views.aside_rad, straight.views.near_m) = (0.0, 0.0, 0.3);
    straight.pixel_sigma_px = 0.05;
    let world = series(&straight).unwrap();
    let error = identify(chain.clone(), &[measured(&world, &chain)], &Options::default()).map(|_| ()).unwrap_err();
    assert_eq!((error.exit_code(), error.code), (3, Code::ViewsFrontal), "{error}");
    // The wrist nods at every other of these stops: 0.35 rad, some 20 degrees.
    let readings = measured(&world, &chain).stops.into_iter().map(|s| s.readings.unwrap()).enumerate();
    let nodding = readings.map(|(k, mut q)| {
        q[4] += [0.0, 0.35, 0.0, -0.35][k % 4];
        q
    });
    let world = series(&WorldRequest { postures: Some(nodding.collect()), ..straight.clone() }).unwrap();
    let solution = identify(chain.clone(), &[measured(&world, &chain)], &Options::default()).unwrap();
    let column = solution.fit.problem.layout.cameras[0].start;
    let (found, true_focal) = (solution.fit.state.cameras[0].parameters[0], world.truth.camera.parameters[0]);
    let sigma = solution.fit.covariance.sigma(column);
    assert!((found - true_focal).abs() < 4.0 * sigma && sigma < 1e-3 * true_focal, "{found} +- {sigma}: {true_focal}");
}

/// Ids that are read along the wrong side of the plate look like a mirror, and fit a plane with the two counts exchanged.
#[test]
fn columns_and_rows_of_a_plate_that_were_exchanged_are_named() {
    let chain = kr6();
    let request = WorldRequest { plate: Plate::lattice(PlateKind::Points, 11, 8, 0.025, 0.05e-3), ..request(&chain) };
    let mut series = measured(&series(&request).unwrap(), &chain);
    series.plate = Plate::lattice(PlateKind::Points, 8, 11, 0.025, 0.05e-3);
    let said = identify(chain, &[series], &Options::default()).map(|_| ()).unwrap_err();
    assert_eq!((number(&said, "columns"), number(&said, "rows")), (11.0, 8.0), "{said}");
}

/// Ids of other programs: down the columns, or on a board whose squares were counted. Neither is a mirror.
#[test]
fn other_numberings_of_a_grid_are_named() {
    let chain = kr6();
    let (columns, rows) = (11, 8);
    let lattice = |columns, rows| Plate::lattice(PlateKind::Points, columns, rows, 0.025, 0.05e-3);
    let seen = measured(&series(&WorldRequest { plate: lattice(columns, rows), ..request(&chain) }).unwrap(), &chain);
    let said =
        |series: MeasuredSeries| identify(chain.clone(), &[series], &Options::default()).map(|_| ()).unwrap_err();
    let mut down = seen.clone();
    for stop in &mut down.stops {
        stop.observations.iter_mut().for_each(|o| o.marker = o.marker % columns * rows + o.marker / columns);
        stop.observations.sort_by_key(|o| (o.marker, o.edge));
    }
    let refused = said(down);
    assert_eq!(refused.code, Code::PlateContradicted, "{refused}");
    assert!(refused.quantities.iter().all(|q| q.name != "columns"), "{refused}");
    let refused = said(MeasuredSeries { plate: lattice(columns + 1, rows + 1), ..seen });
    assert_eq!(refused.code, Code::PlateContradicted, "{refused}");
    assert_eq!((number(&refused, "columns"), number(&refused, "rows")), (11.0, 8.0), "{refused}");
}

/// The eleven stops whose first three joints are most alike, and behind them the stop that is furthest from these.
fn alike_and_one_afar(world: MeasuredSeries) -> MeasuredSeries {
    let apart = |a: &MeasuredStop, b: &MeasuredStop| {
        let (a, b) = (a.readings.as_ref().unwrap(), b.readings.as_ref().unwrap());
        a.iter().zip(b).take(3).map(|(p, q)| (p - q).abs()).fold(0.0, f64::max)
    };
    let by_distance = |from: &MeasuredStop| {
        let mut order: Vec<usize> = (0..world.stops.len()).collect();
        order.sort_by(|a, b| apart(from, &world.stops[*a]).total_cmp(&apart(from, &world.stops[*b])));
        order
    };
    let orders = world.stops.iter().map(|from| (from, by_distance(from)));
    let reach = |(from, order): &(&MeasuredStop, Vec<usize>)| apart(from, &world.stops[order[10]]);
    let (_, order) = orders.min_by(|a, b| reach(a).total_cmp(&reach(b))).unwrap();
    let kept = order[..11].iter().chain(order.last()).map(|&k| world.stops[k].clone()).collect();
    MeasuredSeries { stops: kept, ..world.clone() }
}

/// Stops in one posture tell little of where the robot is in another: an image there that misses by what the fit expects is none of other readings.
#[test]
fn the_only_image_in_another_posture_is_judged_by_what_is_known_there() {
    let mut chain = kr6();
    chain.joints.iter_mut().for_each(|joint| joint.origin.translation *= 3.0);
    let errors = RobotErrors { terms: RobotErrors::default().terms, ..RobotErrors::of_priors() };
    let wrong_pairs = |series: MeasuredSeries| {
        let solution = identify(chain.clone(), &[series], &Options::default()).unwrap();
        let images = solution.fit.problem.images.iter().filter(|image| image.rejected.is_some());
        images.map(|image| image.name.clone()).collect::<Vec<_>>()
    };
    for seed in [5, 6, 7, 8] {
        let request = WorldRequest { images: 300, errors, seed, ..request(&chain) };
        let series = alike_and_one_afar(measured(&series(&request).unwrap(), &chain));
        assert_eq!(wrong_pairs(series.clone()), [""; 0], "{seed}");
        let mut wrong = series;
        let afar = wrong.stops.last_mut().unwrap();
        afar.readings.as_mut().unwrap()[0] += 0.2;
        let name = afar.image.clone();
        assert_eq!(wrong_pairs(wrong), [name], "{seed}");
    }
}
