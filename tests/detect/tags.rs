//! AprilGrids, grids of ArUco markers and single tags on rendered pictures.

use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use robotcal::Code;
use robotcal::detect::{Detection, Picture, detect, detect_series};
use robotcal::series::{Plate, parse_plate};

use crate::boards_scene::mirror;
use crate::circles_support::{Scene, View, behind_mosaic, pose, scene, standard_plate};
use crate::said::assert_says;

const APRILGRID: &str = "kind = \"aprilgrid\"\ncolumns = 6\nrows = 6\ntag_m = 0.04\nspacing = 0.3";
const ARUCO: &str =
    "kind = \"aruco-grid\"\ncolumns = 7\nrows = 5\nmarker_m = 0.04\ngap_m = 0.01\ndictionary = \"DICT_4X4_50\"";
const APRILTAG: &str = "kind = \"tag\"\ntag_m = 0.15\nfamily = \"36h11\"\nid = 17";
const MARKER: &str = "kind = \"tag\"\ntag_m = 0.15\ndictionary = \"DICT_5X5_100\"\nid = 3";

const SHORT: &str = "kind = \"tag\"\ntag_m = 0.15\ndictionary = \"DICT_4X4_50\"\nid = 3";

fn plate(text: &str) -> Plate {
    parse_plate(Path::new("plate.toml"), &format!("format = 1\n{text}\n"), "").unwrap()
}

fn view(rng: &mut ChaCha8Rng) -> View {
    let mut view = View {
        distance_m: rng.random_range(0.35..0.9),
        tilt_deg: rng.random_range(0.0..55.0),
        azimuth_deg: rng.random_range(0.0..360.0),
        roll_deg: rng.random_range(0.0..360.0),
        aim_m: [rng.random_range(-0.1..0.1), rng.random_range(-0.1..0.1)],
        ..View::default()
    };
    view.conditions.psf_sigma_px = rng.random_range(0.5..1.2);
    view
}

fn views() -> u64 {
    std::env::var("VIEWS").ok().and_then(|v| v.parse().ok()).unwrap_or(6)
}

#[derive(Debug, Default)]
struct Tally {
    visible: usize,
    found: usize,
    wrong: usize,
    rms: f64,
    normalised: f64,
    bias: [f64; 2],
    /// Mean displacement away from the middle of the tag, px per axis.
    outward: f64,
}

/// As a camera that is exposed so that the paper is at this multiple of full scale sees a plate.
fn run(text: &str, paper: f64) -> Tally {
    run_views(text, paper, view)
}

fn run_views(text: &str, paper: f64, view: impl Fn(&mut ChaCha8Rng) -> View) -> Tally {
    run_recorded(text, paper, view, |picture| picture)
}

/// As [`run_views`], of what a camera makes of the light.
fn run_recorded(
    text: &str,
    paper: f64,
    view: impl Fn(&mut ChaCha8Rng) -> View,
    record: impl Fn(Picture) -> Picture,
) -> Tally {
    let plate = plate(text);
    let mut tally = Tally::default();
    for seed in 0..views() {
        let mut view = view(&mut ChaCha8Rng::seed_from_u64(seed));
        view.conditions.exposure = paper / view.conditions.light_reflectance;
        let scene = Scene { plate: plate.clone(), camera_from_plate: pose(&view), ..scene(&view) };
        let image = |id: u32| {
            let m = &plate.markers[plate.index_of(id).unwrap()];
            scene.camera.project(&scene.camera_from_plate.transform(&m.position_m))
        };
        let inside = |id: &u32| image(*id).is_some_and(|p| scene.camera.contains(&p, 8.0));
        let whole = |tag: &u32| (4 * tag..4 * tag + 4).all(|id| inside(&id));
        let tags: Vec<u32> = plate.markers.iter().map(|m| m.id / 4).collect();
        let visible = 4 * tags.iter().step_by(4).filter(|t| whole(t)).count();
        tally.visible += visible;
        let Ok(detection) = detect(&record(scene.render(seed)), &plate) else {
            println!("seed {seed}: none of {visible}");
            continue;
        };
        for o in &detection.observations {
            let d = nalgebra::Vector2::from(o.uv) - image(o.marker).unwrap();
            if d.norm() > 2.0 {
                tally.wrong += 1;
                continue;
            }
            let c = o.covariance.unwrap();
            tally.found += 1;
            tally.rms += d.norm_squared();
            tally.normalised += d.x * d.x / c[0] + d.y * d.y / c[2];
            tally.bias[0] += d.x;
            tally.bias[1] += d.y;
            let middle = (0..4).filter_map(|k| image(o.marker / 4 * 4 + k)).sum::<nalgebra::Vector2<f64>>() / 4.0;
            tally.outward += d.dot(&(image(o.marker).unwrap() - middle).normalize()) / 2.0_f64.sqrt();
        }
    }
    let n = tally.found.max(1) as f64;
    tally.rms = (tally.rms / (2.0 * n)).sqrt();
    tally.normalised = (tally.normalised / (2.0 * n)).sqrt();
    tally.bias = tally.bias.map(|b| b / n);
    tally.outward /= n;
    println!("{} {tally:?}", text.lines().next().unwrap());
    tally
}

/// 0.015 px for print and lens are in the covariance and not in the picture: the normalised error is below 1.
#[test]
fn every_kind_of_tags_is_found_and_measured() {
    for text in [APRILGRID, ARUCO, APRILTAG, MARKER, SHORT] {
        let tally = run(text, 0.72);
        assert_eq!(tally.wrong, 0, "{text}");
        assert!(tally.found as f64 >= 0.97 * tally.visible as f64, "{text}: {tally:?}");
        assert!(tally.bias.iter().all(|b| b.abs() < 0.02) && tally.normalised < 1.2, "{text}: {tally:?}");
    }
}

/// A tilted tag is narrow: what lies beyond its border, as wide as two or three blurs, must not count as the border.
#[test]
fn blurred_and_tilted_tags_are_as_uncertain_as_stated() {
    let tally = run_views(APRILGRID, 0.72, |rng| {
        let mut view =
            View { distance_m: rng.random_range(0.4..0.55), tilt_deg: rng.random_range(50.0..60.0), ..view(rng) };
        view.conditions.psf_sigma_px = rng.random_range(1.6..2.4);
        view
    });
    assert_eq!(tally.wrong, 0);
    assert!(tally.found > 300 && tally.normalised < 1.5, "{tally:?}");
}

/// Corners of tags that are seen slantwise are as sharp as 20 degrees: near them the next side lies in the ink beside a side.
#[test]
fn tags_seen_slantwise_are_as_uncertain_as_stated() {
    let tally = run_views(ARUCO, 0.72, |rng| View {
        distance_m: rng.random_range(0.3..0.4),
        tilt_deg: rng.random_range(64.0..72.0),
        aim_m: [0.0; 2],
        ..view(rng)
    });
    assert_eq!(tally.wrong, 0);
    assert!(tally.found as f64 >= 0.85 * tally.visible as f64 && tally.normalised < 1.5, "{tally:?}");
}

/// Paper that is clipped makes the tags smaller and the squares between them, too: where they meet, nothing moves.
#[test]
fn clipped_paper_moves_no_corner_of_an_aprilgrid() {
    let tally = run(APRILGRID, 1.3);
    assert_eq!(tally.wrong, 0);
    assert!(tally.found as f64 >= 0.95 * tally.visible as f64 && tally.rms < 0.03, "{tally:?}");
}

/// Beside clipped paper a side is known from the foot of its edge, whose shape the area of a pixel makes where the lens is sharp.
#[test]
fn sharp_and_soft_sides_beside_clipped_paper_are_as_uncertain_as_stated() {
    for blur_px in [0.22, 0.6, 1.0] {
        let tally = run_views(ARUCO, 1.8, |rng| {
            let distance_m = rng.random_range(0.5..0.8);
            let mut view = View { distance_m, tilt_deg: rng.random_range(0.0..30.0), aim_m: [0.0; 2], ..view(rng) };
            view.conditions.psf_sigma_px = blur_px;
            view
        });
        assert_eq!(tally.wrong, 0, "{blur_px}");
        assert!(tally.found as f64 >= 0.9 * tally.visible as f64, "{blur_px}: {tally:?}");
        assert!(tally.normalised.powi(2) < 1.5, "{blur_px}: {tally:?}");
    }
}

/// Modules of three to five pixels: their edges tell no growth, and the outline alone does not tell it from an encoding of the light.
#[test]
fn small_tags_in_encoded_light_are_as_uncertain_as_stated() {
    let dictionaries = ["DICT_5X5_100", "DICT_6X6_250", "DICT_APRILTAG_36h11"];
    for (text, power) in dictionaries
        .iter()
        .flat_map(|name| [(ARUCO.replace("DICT_4X4_50", name), true), (ARUCO.replace("DICT_4X4_50", name), false)])
    {
        let small = |rng: &mut ChaCha8Rng| {
            let distance_m = 0.04 * 1100.0 / rng.random_range(25.0..30.0);
            let mut view = View { distance_m, tilt_deg: rng.random_range(0.0..15.0), aim_m: [0.0; 2], ..view(rng) };
            view.conditions.psf_sigma_px = rng.random_range(0.4..0.8);
            view
        };
        let tally = run_recorded(&text, 0.72, small, |picture| if power { encoded(picture) } else { picture });
        assert_eq!(tally.wrong, 0, "{text}");
        assert!(tally.found as f64 >= 0.7 * tally.visible as f64, "{text}: {tally:?}");
        assert!(tally.normalised < 1.3, "{text}: {tally:?}");
    }
}

/// A lens that bends sides of 350 px and more by up to 10 px: the line between two corners is no place to look for the whole side.
#[test]
fn sides_that_the_lens_bends_far_are_measured_to_their_ends() {
    let near = |rng: &mut ChaCha8Rng| View {
        focal_px: 760.0,
        distortion: [-0.3, 0.09, 0.0, 2e-3, -1.5e-3],
        distance_m: rng.random_range(0.24..0.28),
        tilt_deg: rng.random_range(0.0..20.0),
        aim_m: [rng.random_range(-0.02..0.02), rng.random_range(-0.02..0.02)],
        ..view(rng)
    };
    for text in [APRILTAG, MARKER] {
        let tally = run_views(text, 0.72, near);
        assert_eq!(tally.wrong, 0, "{text}");
        assert!(tally.found >= 18 && tally.rms < 0.05, "{text}: {tally:?}");
        assert!((0.5..2.0).contains(&tally.normalised.powi(2)), "{text}: {tally:?}");
    }
}

/// Grey values as most files of cameras have them: the light to the power of 1 / 2.2.
fn encoded(mut picture: Picture) -> Picture {
    let full = picture.full_scale;
    picture.pixels.iter_mut().for_each(|v| *v = (full * (v.max(0.0) / full).powf(1.0 / 2.2)).round());
    picture
}

/// From near enough that a module has nine pixels and more.
fn near(rng: &mut ChaCha8Rng) -> View {
    View { distance_m: rng.random_range(0.35..0.55), tilt_deg: rng.random_range(0.0..35.0), ..view(rng) }
}

/// Half of the encoded step is less than half of the light, and displaces each side by 0.45 blurs into the ink: 0.3 px and more, fifteen
/// sigmas. What is left is the noise of some twenty edges of the code, 0.02 px each.
#[test]
fn an_encoding_of_the_light_moves_no_corner() {
    for text in [APRILGRID, ARUCO, APRILTAG, MARKER, SHORT] {
        let tally = run_recorded(text, 0.72, near, encoded);
        assert_eq!(tally.wrong, 0, "{text}");
        assert!(tally.found as f64 >= 0.95 * tally.visible as f64, "{text}: {tally:?}");
        assert!(tally.outward.abs() < 0.02 && tally.rms < 0.04 && tally.normalised < 1.4, "{text}: {tally:?}");
    }
}

/// With a blur of two pixels each side is displaced by one: the gaps look a tenth too wide, and are not contradicted.
#[test]
fn blurred_tags_in_encoded_light_are_those_of_the_plate() {
    let tally = run_recorded(
        ARUCO,
        0.72,
        |rng| {
            let mut view = View { tilt_deg: 15.0, ..near(rng) };
            view.conditions.psf_sigma_px = 2.0;
            view
        },
        encoded,
    );
    assert_eq!(tally.wrong, 0);
    assert!(tally.found as f64 >= 0.8 * tally.visible as f64, "{tally:?}");
    assert!(tally.outward.abs() < 0.1, "{tally:?}");
}

#[test]
fn other_plates_and_mirrors_are_no_tags() {
    let look = View { distance_m: 0.7, tilt_deg: 20.0, ..View::default() };
    let shown = |plate: Plate| Scene { plate, camera_from_plate: pose(&look), ..scene(&look) }.render(1);
    let other = ARUCO.replace("4X4_50", "6X6_50");
    for picture in [shown(standard_plate()), shown(plate(&other))] {
        for text in [APRILGRID, ARUCO, APRILTAG, MARKER] {
            let error = detect(&picture, &plate(text)).expect_err(text);
            assert_eq!(error.code, Code::PlateNotFound, "{error}");
        }
    }
    let error = detect(&mirror(&shown(plate(APRILGRID))), &plate(APRILGRID)).expect_err("mirrored");
    assert_eq!(error.code, Code::PlateMirrored, "{error}");
}

/// Which tags are seen, in which rows, and how far apart: with the keys of plate.toml that are to be corrected.
#[test]
fn a_grid_with_other_rows_numbers_or_gaps_is_named() {
    let look = View { distance_m: 0.7, tilt_deg: 20.0, roll_deg: 30.0, ..View::default() };
    let shown = |text: &str| Scene { plate: plate(text), camera_from_plate: pose(&look), ..scene(&look) }.render(1);
    let layouts = [
        ("columns", &["columns", "0 to "][..]),
        ("exchanged", &["columns", "rows"]),
        ("rows", &["rows"]),
        ("first_id", &["first_id"]),
        ("row_later", &["first_id"]),
    ];
    for (text, columns, rows) in [(APRILGRID, 6, 6), (ARUCO, 7, 5)] {
        let (picture, last) = (shown(text), columns * rows - 1);
        let size = |c: i32, r: i32, more: &str| {
            let old = format!("columns = {columns}\nrows = {rows}");
            format!("{}{more}", text.replace(&old, &format!("columns = {c}\nrows = {r}")))
        };
        for (what, keys) in layouts {
            let stated = match what {
                "columns" => size(columns - 1, rows, ""),
                "exchanged" => size(rows + 1, columns - 1, ""),
                "rows" => size(columns, rows - 1, ""),
                "first_id" => size(columns, rows, "\nfirst_id = 1"),
                _ => size(columns, rows, &format!("\nfirst_id = {columns}")),
            };
            let error = detect(&picture, &plate(&stated)).expect_err(what);
            let seen = [format!("tags 0 to {last} "), format!("{rows} rows of {columns}")];
            let words: Vec<&str> = seen.iter().map(String::as_str).chain(keys.iter().copied()).collect();
            assert_says(&error, Code::PlateContradicted, &words);
        }
    }
    // Kalibr's ratio in metres, inverted, from middle to middle, and of another board; gaps that are pitches; another marker.
    for (text, old, wrong, gap) in [
        (APRILGRID, "spacing = 0.3", "spacing = 0.012", " 0.3 "),
        (APRILGRID, "spacing = 0.3", "spacing = 3.33", " 0.3 "),
        (APRILGRID, "spacing = 0.3", "spacing = 1.3", " 0.3 "),
        (APRILGRID, "spacing = 0.3", "spacing = 0.25", " 0.30 "),
        (ARUCO, "gap_m = 0.01", "gap_m = 0.05", " 0.3 "),
        (ARUCO, "gap_m = 0.01", "gap_m = 0.012", " 0.25 "),
        (ARUCO, "marker_m = 0.04", "marker_m = 0.05", " 0.25 "),
    ] {
        let error = detect(&shown(text), &plate(&text.replace(old, wrong))).expect_err(wrong);
        assert_says(&error, Code::PlateContradicted, &[gap]);
    }
}

#[test]
fn tags_of_another_dictionary_number_or_kind_are_named() {
    let look = View { distance_m: 0.7, tilt_deg: 20.0, roll_deg: 30.0, ..View::default() };
    let shown = |text: &str| Scene { plate: plate(text), camera_from_plate: pose(&look), ..scene(&look) }.render(1);
    let as_aruco = APRILGRID.replace("aprilgrid", "aruco-grid").replace("tag_m", "marker_m");
    let as_aruco = as_aruco.replace("spacing = 0.3", "gap_m = 0.012\ndictionary = \"DICT_APRILTAG_36h11\"");
    let charuco = "kind = \"charuco\"\ncolumns = 8\nrows = 6\npitch_m = 0.04\naruco = { dictionary = \"DICT_4X4_50\", side_m = 0.03 }";
    for (seen, stated, code, words) in [
        (
            APRILGRID,
            &*format!("{APRILGRID}\nfamily = \"36h10\""),
            Code::PlateNotFound,
            &["36 tags from 0 to 35", "36h11", "family"][..],
        ),
        (
            ARUCO,
            &ARUCO.replace("4X4_50", "6X6_50"),
            Code::PlateNotFound,
            &["35 tags from 0 to 34", "4X4", "dictionary"],
        ),
        (APRILTAG, &APRILTAG.replace("17", "18"), Code::PlateNotFound, &["tag 18", "tag 17", "id"]),
        (MARKER, &MARKER.replace("5X5_100", "7X7_50"), Code::PlateNotFound, &["tag 3 ", "5X5"]),
        (APRILGRID, &as_aruco, Code::PlateNotFound, &["border of 2 modules", "kind"]),
        (charuco, ARUCO, Code::PlateContradicted, &["kind = \"charuco\""]),
        (ARUCO, charuco, Code::PlateNotFound, &["kind = \"aruco-grid\""]),
    ] {
        let error = detect(&shown(seen), &plate(stated)).expect_err(stated);
        assert_says(&error, code, words);
    }
}

#[test]
fn bright_tags_are_read_in_the_negative() {
    let look = View { distance_m: 0.7, tilt_deg: 20.0, roll_deg: 30.0, ..View::default() };
    for (stated, corners) in [(ARUCO, 140), (APRILGRID, 144)] {
        let stated = plate(stated);
        let picture = Scene { plate: stated.clone(), camera_from_plate: pose(&look), ..scene(&look) }.render(1);
        let image = detect_series(&["1.png".into()], &stated, |_| Ok(picture.clone().negative()), |_| {}).remove(0);
        let right = detect(&picture, &stated).unwrap().observations;
        assert_eq!((right.len(), image.detection.observations.len()), (corners, corners));
        for (a, b) in right.iter().zip(&image.detection.observations) {
            assert!(a.marker == b.marker && (0..2).all(|k| (a.uv[k] - b.uv[k]).abs() < 1e-2), "{a:?} {b:?}");
        }
        assert!(image.detection.notices.iter().any(|n| n.code == Code::MarkersBright));
    }
}

/// The numbers tell the places: more rows than there are put the frame of the plate elsewhere, and no corner.
#[test]
fn a_row_that_no_image_shows_is_said() {
    let look = View { distance_m: 0.7, tilt_deg: 20.0, roll_deg: 30.0, ..View::default() };
    let picture = Scene { plate: plate(ARUCO), camera_from_plate: pose(&look), ..scene(&look) }.render(1);
    let paths = ["1.png", "2.png"].map(PathBuf::from);
    for (rows, said) in [("rows = 5", 0), ("rows = 6", 1)] {
        let stated = plate(&ARUCO.replace("rows = 5", rows));
        let images = detect_series(&paths, &stated, |_| Ok(picture.clone()), |_| {});
        assert!(images.iter().all(|i| i.detection.observations.len() == 140));
        let notices: Vec<_> = images.iter().flat_map(|i| &i.detection.notices).collect();
        assert_eq!(notices.len(), said, "{notices:?}");
        notices.iter().for_each(|n| assert_says(*n, Code::PlateLineHidden, &["7 x 6 tags", "rows"]));
    }
}

/// Squared errors over the stated variances, mean per axis and its root, with the largest error, px; of an identified corner each.
fn accuracy(scene: &Scene, found: &Detection) -> (f64, f64) {
    let (mut sum, mut farthest) = (0.0, 0.0_f64);
    for o in &found.observations {
        let m = &scene.plate.markers[scene.plate.index_of(o.marker).unwrap()];
        let truth = scene.camera.project(&scene.camera_from_plate.transform(&m.position_m)).unwrap();
        let (d, c) = (nalgebra::Vector2::from(o.uv) - truth, o.covariance.unwrap());
        sum += d.x * d.x / c[0] + d.y * d.y / c[2];
        farthest = farthest.max(d.norm());
    }
    ((sum / (2 * found.observations.len().max(1)) as f64).sqrt(), farthest)
}

/// The mosaic of a colour sensor, and noise of 13 % of the step between ink and paper.
#[test]
fn tags_that_a_mosaic_or_noise_hides_are_found_in_a_smoothed_copy() {
    let look = View { distance_m: 0.6, tilt_deg: 20.0, roll_deg: 30.0, ..View::default() };
    for (text, corners) in [(APRILGRID, 144), (ARUCO, 140)] {
        let scene = Scene { plate: plate(text), camera_from_plate: pose(&look), ..scene(&look) };
        let (mosaic, mut noisy) = (behind_mosaic(scene.render(1)), scene.render(2));
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let grain = Normal::new(0.0_f32, 22.0).unwrap();
        noisy.pixels.iter_mut().for_each(|v| *v = (*v + 22.0 + grain.sample(&mut rng)).round().clamp(0.0, 255.0));
        for (what, picture) in [("mosaic", mosaic), ("noise", noisy)] {
            let found = detect(&picture, &scene.plate).unwrap_or_else(|e| panic!("{text} {what}: {e}"));
            let (normalised, farthest) = accuracy(&scene, &found);
            println!(
                "{what}: {} corners, normalised {normalised:.2}, farthest {farthest:.3} px",
                found.observations.len()
            );
            assert!(found.observations.len() as f64 >= 0.9 * f64::from(corners), "{text} {what}");
            assert!(normalised < 1.5 && farthest < 0.6, "{text} {what}: {normalised} {farthest}");
            assert!(found.notices.iter().any(|n| n.code == Code::MarkersSmoothed) || what == "noise");
        }
    }
}

/// One pixel in a thousand at full scale.
#[test]
fn hot_pixels_cost_no_tag() {
    let look = View { distance_m: 0.6, tilt_deg: 20.0, roll_deg: 30.0, ..View::default() };
    for (text, corners) in [(APRILGRID, 144), (ARUCO, 140)] {
        let scene = Scene { plate: plate(text), camera_from_plate: pose(&look), ..scene(&look) };
        let mut picture = scene.render(1);
        let full_scale = picture.full_scale;
        picture.pixels.iter_mut().step_by(1009).for_each(|v| *v = full_scale);
        let found = detect(&picture, &scene.plate).unwrap_or_else(|e| panic!("{text}: {e}"));
        let (normalised, farthest) = accuracy(&scene, &found);
        println!("{} corners, normalised {normalised:.2}, farthest {farthest:.3} px", found.observations.len());
        assert!(found.observations.len() as f64 >= 0.97 * f64::from(corners), "{text}");
        assert!(normalised < 1.5 && farthest < 0.6, "{text}: {normalised} {farthest}");
        assert!(found.notices.iter().any(|n| n.code == Code::HotPixels), "{text}");
    }
}

/// A border of one module, blurred by a quarter to half a module: the light of the code shines through it.
#[test]
fn blurred_tags_with_a_narrow_border_are_as_uncertain_as_stated() {
    let text = "kind = \"aruco-grid\"\ncolumns = 6\nrows = 6\nmarker_m = 0.04\ngap_m = 0.012\n\
                dictionary = \"DICT_APRILTAG_36h11\"";
    for share in [0.25, 0.3, 0.4] {
        let tally = run_views(text, 0.72, |rng| {
            let distance_m = rng.random_range(0.45..0.8);
            let mut view = View { distance_m, tilt_deg: rng.random_range(0.0..25.0), ..view(rng) };
            view.aim_m = [0.0; 2];
            // Beside the area of a pixel.
            let blur_px = share * view.focal_px * 0.005 / distance_m;
            view.conditions.psf_sigma_px = (blur_px * blur_px - 1.0 / 12.0).sqrt();
            view
        });
        assert_eq!(tally.wrong, 0, "{share}");
        assert!(tally.found as f64 >= 0.6 * tally.visible as f64 && tally.normalised < 1.3, "{share}: {tally:?}");
    }
}

/// Two equal boards side by side: which is the plate cannot be told; where one of them is cut, the whole one is taken, and that is said.
#[test]
fn two_equal_boards_in_view_are_named() {
    let look = View { distance_m: 0.9, tilt_deg: 10.0, roll_deg: 5.0, ..View::default() };
    let stated = plate(ARUCO);
    let one = Scene { plate: stated.clone(), camera_from_plate: pose(&look), ..scene(&look) }.render(1);
    let beside = |width: usize| {
        let rows = one.pixels.chunks_exact(one.width);
        let pixels = rows.flat_map(|row| [row, &row[..width]].concat()).collect();
        Picture { width: one.width + width, pixels, ..one }
    };
    let error = detect(&beside(one.width), &stated).expect_err("two boards");
    assert_eq!(error.code, Code::PlateTwice, "{error}");
    let found = detect(&beside(one.width / 2), &stated).unwrap();
    let alone = detect(&one, &stated).unwrap();
    assert!(alone.notices.is_empty() && alone.observations.len() == 140, "{:?}", alone.notices);
    assert!(found.notices.iter().any(|n| n.code == Code::PlateTwice), "{:?}", found.notices);
    assert_eq!(found.observations.len(), 140);
    for (a, b) in found.observations.iter().zip(&alone.observations) {
        assert!(a.marker == b.marker && (0..2).all(|k| (a.uv[k] - b.uv[k]).abs() < 0.05), "{a:?} {b:?}");
    }
}
