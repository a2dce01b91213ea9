//! ChArUco boards and plain grids of dots on rendered pictures with known truth.

use std::path::{Path, PathBuf};

use crate::boards_scene::{Print, Scene, View, errors, mirror, rms, tiles};
use crate::said::assert_says;
use calib_targets_aruco::Dictionary;
use calib_targets_aruco::builtins::{
    DICT_4X4_50, DICT_5X5_50, DICT_APRILTAG_16h5, DICT_APRILTAG_25h9, DICT_APRILTAG_36h10, DICT_ARUCO_MIP_36h12,
};
use nalgebra::{Rotation3, Vector3};
use robotcal::Code;
use robotcal::detect::{Detection, Picture, detect, detect_series};
use robotcal::series::{Aruco, Edge, Plate, PlateKind, parse_plate};

const COLUMNS: u32 = 8;
const ROWS: u32 = 5;

fn charuco_plate(aruco: Option<(&str, f64)>) -> Plate {
    let aruco = aruco.map(|(name, ratio)| Aruco {
        dictionary: name.to_owned(),
        side_m: ratio * 0.01,
        legacy: false,
        first_id: 0,
    });
    Plate { aruco, ..Plate::lattice(PlateKind::Charuco, COLUMNS, ROWS, 0.01, 1e-4) }
}

fn charuco_scene(angle: f64) -> Scene {
    let view = View::new(COLUMNS, ROWS, [321.3, 239.6], 46.0, angle, [0.015, -0.01]);
    Scene {
        print: Print::Charuco { dictionary: DICT_4X4_50, ratio: 0.7, legacy: false },
        ..Scene::new(COLUMNS, ROWS, view)
    }
}

#[test]
fn charuco_corners_are_identified_in_every_orientation() {
    for step in 0..4 {
        let scene = charuco_scene(0.2 + 1.6 * f64::from(step));
        let detection = detect(&scene.render(0), &charuco_plate(Some(("DICT_4X4_50", 0.7)))).unwrap();
        assert_eq!(detection.observations.len(), 40, "{:?}", detection.dropped);
        assert!(detection.notices.is_empty());
        let error = rms(&errors(&detection, |id| scene.corner(id)));
        assert!(error < 0.006, "step {step}: {error}");
    }
}

/// Floors with more crossings than the board, turned otherwise than it.
#[test]
fn a_floor_of_tiles_hides_no_charuco_board() {
    for (sides, turn) in [([18.0, 18.0], 0.3), ([26.0, 33.0], 0.8), ([60.0, 60.0], 1.2)] {
        let scene = charuco_scene(0.4);
        let picture = scene.on_ground(scene.render(0), 0.4, tiles(sides, 0.4 + turn, [60.0, 150.0]));
        let detection = detect(&picture, &charuco_plate(Some(("DICT_4X4_50", 0.7)))).unwrap();
        assert_eq!(detection.observations.len(), 40, "{sides:?} {turn}");
        let error = rms(&errors(&detection, |id| scene.corner(id)));
        assert!(error < 0.006, "{sides:?} {turn}: {error}");
    }
}

#[test]
fn part_of_a_charuco_board_keeps_its_ids() {
    let view = View::new(COLUMNS, ROWS, [120.0, 100.0], 60.0, 0.1, [0.0, 0.0]);
    let scene = Scene { view, ..charuco_scene(0.0) };
    let detection = detect(&scene.render(0), &charuco_plate(Some(("DICT_4X4_50", 0.7)))).unwrap();
    assert!((15..40).contains(&detection.observations.len()), "{}", detection.observations.len());
    let error = rms(&errors(&detection, |id| scene.corner(id)));
    assert!(error < 0.006, "{error}");
}

/// The codes of a board whose first marker is not 0.
fn from(dictionary: Dictionary, first_id: usize) -> Dictionary {
    let (before, after) = dictionary.codes().split_at(first_id);
    let (size, bits) = (dictionary.marker_size(), dictionary.max_correction_bits());
    Dictionary::from_static_codes(dictionary.name(), size, bits, [after, before].concat().leak()).unwrap()
}

/// A board of 27 markers that begins at 40 needs 67, of the 50 that there are.
#[test]
fn a_dictionary_that_is_too_short_for_the_first_marker_is_refused() {
    let aruco = Aruco { dictionary: "DICT_4X4_50".to_owned(), side_m: 0.007, legacy: false, first_id: 40 };
    let plate = Plate { aruco: Some(aruco), ..charuco_plate(None) };
    let error = detect(&charuco_scene(0.1).render(0), &plate).expect_err("too short");
    assert_says(&error, Code::PlateNotDetectable, &["50", "67", "first_id"]);
}

/// Boards with an even number of rows of squares as OpenCV drew them before 4.6, and as others still do.
#[test]
fn a_board_of_the_layout_before_opencv_4_6_keeps_its_ids() {
    let part = View::new(COLUMNS, ROWS, [120.0, 100.0], 60.0, 0.1, [0.0, 0.0]);
    // An odd number of columns, and an even one, which takes other markers for each row.
    let shapes = [(8, None, 40), (7, None, 35), (8, Some(part), 15)];
    for (first_id, (columns, view, least)) in [0, 13].into_iter().flat_map(|first| shapes.map(|shape| (first, shape))) {
        let whole = View::new(columns, ROWS, [321.3, 239.6], 46.0, 0.2, [0.015, -0.01]);
        let new = Scene::new(columns, ROWS, view.unwrap_or(whole));
        let dictionary = from(DICT_4X4_50, first_id as usize);
        let print = |legacy: bool| Print::Charuco { dictionary, ratio: 0.7, legacy };
        let pictures = [false, true].map(|legacy| Scene { print: print(legacy), ..new.clone() }.render(0));
        let aruco = |legacy| Some(Aruco { dictionary: "DICT_4X4_50".to_owned(), side_m: 0.007, legacy, first_id });
        let plate = |aruco| Plate { aruco, ..Plate::lattice(PlateKind::Charuco, columns, ROWS, 0.01, 1e-4) };
        for legacy in [false, true] {
            let detection = detect(&pictures[usize::from(legacy)], &plate(aruco(legacy))).unwrap();
            assert!(detection.observations.len() >= least, "{columns} {legacy}: {:?}", detection.dropped);
            let error = rms(&errors(&detection, |id| new.corner(id)));
            assert!(error < 0.006, "{columns} {legacy}: {error}");
            let other = detect(&pictures[usize::from(legacy)], &plate(aruco(!legacy))).expect_err("the other layout");
            // The markers of a small part fit into both, moved by a column; then a line of corners is missing that should be in view.
            let in_part = view.is_some() && other.code == Code::PlateLineHidden;
            assert!(in_part || other.code == Code::PlateNotDetectable, "{columns} {legacy}: {other}");
        }
        if view.is_some() || first_id > 0 {
            continue;
        }
        let guessed = detect(&pictures[1], &plate(None)).unwrap();
        assert!(rms(&errors(&guessed, |id| new.corner(id))) < 0.006, "{columns}");
        assert_says(&guessed.notices[0], Code::DictionaryGuessed, &["4.6"]);
    }
}

/// Boards that need most or all of their dictionary, in both layouts, of odd and even numbers of squares; with odd rows both are the same.
#[test]
fn a_board_that_uses_up_its_dictionary_is_found_in_either_layout() {
    for (dictionary, columns, rows, square) in [
        (DICT_APRILTAG_16h5, 8, 5, 46.0),
        (DICT_APRILTAG_16h5, 9, 5, 46.0),
        (DICT_APRILTAG_25h9, 10, 5, 46.0),
        (DICT_4X4_50, 11, 7, 44.0),
        (DICT_4X4_50, 9, 9, 40.0),
        (DICT_5X5_50, 11, 7, 44.0),
        (DICT_4X4_50, 8, 4, 46.0),
        (DICT_4X4_50, 7, 4, 46.0),
    ] {
        let view = View::new(columns, rows, [321.3, 239.6], square, 0.05, [0.005, -0.003]);
        let plate = |legacy| Plate {
            aruco: Some(Aruco { dictionary: dictionary.name().to_owned(), side_m: 0.007, legacy, first_id: 0 }),
            ..Plate::lattice(PlateKind::Charuco, columns, rows, 0.01, 1e-4)
        };
        for legacy in [false, true] {
            let has_layouts = rows % 2 == 1;
            let print = Print::Charuco { dictionary, ratio: 0.7, legacy: legacy && has_layouts };
            let scene = Scene { print, ..Scene::new(columns, rows, view) };
            let picture = scene.render(0);
            let what = format!("{} {columns} x {rows}, legacy {legacy}", dictionary.name());
            let found = detect(&picture, &plate(legacy)).unwrap_or_else(|e| panic!("{what}: {e}"));
            assert_eq!(found.observations.len() as u32, columns * rows, "{what}: {:?}", found.dropped);
            let error = rms(&errors(&found, |id| scene.corner(id)));
            assert!(error < 0.006, "{what}: {error}");
            if has_layouts {
                let other = detect(&picture, &plate(!legacy)).expect_err(&what);
                assert_says(&other, Code::PlateNotDetectable, &["4.6"]);
            }
        }
    }
}

/// A view that no outer line reaches fits into both layouts, a column apart: another image tells that the stated one is wrong.
#[test]
fn no_image_keeps_ids_of_a_layout_that_another_image_contradicts() {
    let of = |view, legacy| {
        let print = Print::Charuco { dictionary: DICT_4X4_50, ratio: 0.7, legacy };
        Scene { print, ..Scene::new(COLUMNS, ROWS, view) }
    };
    let whole = View::new(COLUMNS, ROWS, [321.3, 239.6], 46.0, 0.2, [0.015, -0.01]);
    let part = View::new(COLUMNS, ROWS, [321.3, 239.6], 122.0, 0.02, [0.003, -0.002]);
    let paths = ["whole.png", "part.png"].map(PathBuf::from);
    for legacy in [false, true] {
        let pictures = [of(whole, legacy), of(part, legacy)].map(|scene| scene.render(0));
        let seen = |aruco: Option<bool>| {
            let aruco =
                aruco.map(|legacy| Aruco { dictionary: "DICT_4X4_50".to_owned(), side_m: 0.007, legacy, first_id: 0 });
            let plate = Plate { aruco, ..charuco_plate(None) };
            let picture = |path: &Path| Ok(pictures[usize::from(path == paths[1])].clone());
            detect_series(&paths, &plate, picture, |_| {}).into_iter().map(|image| image.detection).collect::<Vec<_>>()
        };
        let right = seen(Some(legacy));
        for (image, view) in right.iter().zip([whole, part]) {
            assert!(image.observations.len() >= 8, "{:?}", image.failure);
            let error = rms(&errors(image, |id| of(view, legacy).corner(id)));
            assert!(error < 0.01, "{error}");
        }
        let codes = |of: &[Detection]| of.iter().map(|i| i.failure.as_ref().map(|f| f.code)).collect::<Vec<_>>();
        assert_eq!(codes(&seen(Some(!legacy))), [Some(Code::PlateNotDetectable); 2], "legacy {legacy}");
        assert_eq!(codes(&seen(None)), [None, Some(Code::PlateIncomplete)], "legacy {legacy}, unstated");
    }
}

#[test]
fn a_dictionary_is_known_in_letters_of_either_case_and_an_unknown_one_has_its_line() {
    let read = |name: &str| {
        let text = format!(
            "format = 1\nkind = \"charuco\"\ncolumns = 8\nrows = 5\npitch_m = 0.01\nmarker_m = 0.007\n{name}\n"
        );
        parse_plate(Path::new("plate.toml"), &text, "")
    };
    let print = Print::Charuco { dictionary: DICT_APRILTAG_36h10, ratio: 0.7, legacy: false };
    let picture = Scene { print, ..charuco_scene(0.1) }.render(0);
    for name in ["DICT_APRILTAG_36H10", "DICT_APRILTAG_36h10", "apriltag_36h10"] {
        let plate = read(&format!("dictionary = \"{name}\"")).unwrap();
        assert_eq!(detect(&picture, &plate).unwrap().observations.len(), 40, "{name}");
    }
    let error = read("dictionary = \"DICT_APRILTG_36h10\"").expect_err("no such dictionary");
    assert_says(&error, Code::DictionaryUnknown, &["DICT_APRILTAG_36h10"]);
    assert_eq!(error.place, "plate.toml:7");
}

#[test]
fn an_unstated_dictionary_is_found_and_a_wrong_one_or_a_mirror_refused() {
    let picture = charuco_scene(0.1).render(0);
    let detection = detect(&picture, &charuco_plate(None)).unwrap();
    assert_eq!(detection.observations.len(), 40);
    assert_says(&detection.notices[0], Code::DictionaryGuessed, &["4X4", "squares"]);
    let wrong = detect(&picture, &charuco_plate(Some(("DICT_6X6_250", 0.7)))).expect_err("another dictionary");
    assert_says(&wrong, Code::PlateNotFound, &["DICT_6X6_250", "DICT_4X4_1000"]);
    let unknown = detect(&picture, &charuco_plate(Some(("DICT_9X9", 0.7)))).expect_err("no such dictionary");
    assert_says(&unknown, Code::DictionaryUnknown, &["DICT_9X9"]);
    let mirrored = detect(&mirror(&picture), &charuco_plate(Some(("DICT_4X4_50", 0.7)))).expect_err("mirrored");
    assert_eq!(mirrored.code, Code::PlateMirrored, "{mirrored}");
}

#[test]
fn a_board_of_another_size_or_with_other_markers_is_named() {
    let picture = charuco_scene(0.1).render(0);
    // Squares counted instead of corners; columns and rows exchanged; a column too few.
    for (columns, rows) in [(COLUMNS + 1, ROWS + 1), (ROWS, COLUMNS), (COLUMNS - 1, ROWS)] {
        let plate = Plate { columns, rows, ..charuco_plate(Some(("DICT_4X4_50", 0.7))) };
        let other = detect(&picture, &plate).expect_err("another size");
        assert_says(&other, Code::PlateNotFound, &[" 8 "]);
    }
    // Stated and searched for: the board goes on below.
    for dictionary in [Some(("DICT_4X4_50", 0.7)), None] {
        let plate = Plate { rows: ROWS - 1, ..charuco_plate(dictionary) };
        let other = detect(&picture, &plate).expect_err("a row too few");
        assert_says(&other, Code::PlateContradicted, &[" 4 "]);
    }
    // Theirs is 0.7.
    let side = detect(&picture, &charuco_plate(Some(("DICT_4X4_50", 0.45)))).expect_err("smaller markers");
    assert_says(&side, Code::PlateNotFound, &["DICT_4X4_50", "0.69"]);
    let empty = Picture { pixels: vec![0.5; picture.pixels.len()], ..picture.clone() };
    let nothing = detect(&empty, &charuco_plate(Some(("DICT_4X4_50", 0.7)))).expect_err("nothing to see");
    assert_says(&nothing, Code::PlateNotFound, &["DICT_4X4_50"]);
}

/// A grid of dots of 0.25 steps radius; `large` have 0.36.
fn dots(kind: &str, large: &[u32]) -> (Plate, Scene) {
    let (columns, rows): (u32, u32) = if kind == "asymmetric" { (4, 11) } else { (9, 6) };
    let step = 0.01;
    let mut plate = Plate::lattice(PlateKind::CircleGrid, columns, rows, step, 1e-4);
    for m in &mut plate.markers {
        if kind == "asymmetric" {
            // As OpenCV numbers them: every other row is shifted by one unit, the dots of a row are two units apart.
            let (c, r) = (m.id % columns, m.id / columns);
            let x = f64::from(2 * c + r % 2) - f64::from(2 * columns - 1) / 2.0;
            m.position_m = Vector3::new(x * step, (f64::from(rows - 1) / 2.0 - f64::from(r)) * step, 0.0);
        }
        let radius = if large.contains(&m.id) { 0.36 } else { 0.25 };
        m.outer_radius_m = radius * if kind == "asymmetric" { step * 2f64.sqrt() } else { step };
    }
    let places = plate.markers.iter().map(|m| [m.position_m.x / step, -m.position_m.y / step, m.outer_radius_m / step]);
    let print = Print::Dots(places.collect());
    let pixels = if kind == "asymmetric" { 34.0 } else { 44.0 };
    let view = View::new(1, 1, [320.7, 240.4], pixels, 0.0, [0.012, -0.008]);
    (plate, Scene { print, ..Scene::new(columns, rows, view) })
}

/// Centroid of the image of a circle under the view: mean over its area by rings, right to 1e-4 px.
fn centroid(scene: &Scene, dot: [f64; 3]) -> [f64; 2] {
    let outline: Vec<[f64; 2]> = (0..720)
        .map(|k| {
            let a = f64::from(k) * std::f64::consts::TAU / 720.0;
            scene.view.pixel([dot[0] + dot[2] * a.cos(), dot[1] + dot[2] * a.sin()])
        })
        .collect();
    let (mut area, mut sum) = (0.0, [0.0; 2]);
    for k in 0..outline.len() {
        let (p, q) = (outline[k], outline[(k + 1) % outline.len()]);
        let cross = p[0] * q[1] - p[1] * q[0];
        area += cross / 2.0;
        for a in 0..2 {
            sum[a] += (p[a] + q[a]) * cross / 6.0;
        }
    }
    sum.map(|s| s / area)
}

#[test]
fn plain_grids_are_identified() {
    for (kind, large, angles, symmetric) in [
        ("symmetric", vec![], vec![0.0, 0.4, -0.9], true),
        ("symmetric", vec![12], vec![0.0, 1.7, 3.3, 4.8], false),
        ("asymmetric", vec![], vec![0.0, 1.7, 3.3, 4.8], false),
    ] {
        for angle in angles {
            let (plate, scene) = dots(kind, &large);
            let view =
                View::new(1, 1, [320.7, 240.4], if kind == "asymmetric" { 34.0 } else { 44.0 }, angle, [0.012, -0.008]);
            let scene = Scene { view, ..scene };
            let detection = detect(&scene.render(0), &plate).unwrap_or_else(|e| panic!("{kind} {angle}: {e}"));
            let outer: Vec<_> = detection.observations.iter().filter(|o| o.edge == Edge::Outer).collect();
            assert_eq!(outer.len(), plate.markers.len(), "{kind} {large:?} {angle}: {:?}", detection.dropped);
            assert_eq!(!detection.notices.is_empty(), symmetric, "{kind} {angle}: {:?}", detection.notices);
            let Print::Dots(dots) = &scene.print else { panic!("dots") };
            let error = rms(&errors(&detection, |id| centroid(&scene, dots[id as usize])));
            assert!(error < 0.01, "{kind} {large:?} {angle}: {error}");
        }
    }
}

#[test]
fn a_mirrored_or_incomplete_grid_is_refused() {
    let (plate, scene) = dots("symmetric", &[12]);
    let error = detect(&mirror(&scene.render(0)), &plate).expect_err("mirrored");
    assert_eq!(error.code, Code::PlateMirrored, "{error}");
    let (plate, scene) = dots("symmetric", &[]);
    let view = View::new(1, 1, [110.0, 240.4], 44.0, 0.0, [0.0, 0.0]);
    assert!(detect(&Scene { view, ..scene }.render(0), &plate).is_err());
}

/// With as many markers in the first row as the stated number exceeds the true one, a board fits on itself, moved by a column and a row.
#[test]
fn a_wrong_first_marker_is_named_where_the_board_fits_moved() {
    for (columns, rows, stated) in [(6, 4, 3), (8, 6, 4), (4, 6, 2), (10, 7, 6), (7, 5, 4), (8, 5, 5), (8, 5, 4)] {
        let square = 560.0 / f64::from(columns + 3).max(1.4 * f64::from(rows + 3));
        let view = View::new(columns, rows, [321.3, 239.6], square, 0.1, [0.01, -0.006]);
        let print = Print::Charuco { dictionary: DICT_5X5_50, ratio: 0.72, legacy: false };
        let picture = Scene { print, ..Scene::new(columns, rows, view) }.render(0);
        let seen = |first_id: u32| {
            let aruco = Aruco { dictionary: "DICT_5X5_50".to_owned(), side_m: 0.0072, legacy: false, first_id };
            let plate = Plate { aruco: Some(aruco), ..Plate::lattice(PlateKind::Charuco, columns, rows, 0.01, 1e-4) };
            detect(&picture, &plate)
        };
        assert_eq!(seen(0).unwrap().observations.len() as u32, columns * rows, "{columns} x {rows}");
        let error = seen(stated).expect_err("another first marker");
        assert_says(&error, Code::PlateContradicted, &["first_id = 0"]);
    }
}

#[test]
fn two_equal_boards_are_said() {
    let (grid, dots) = dots("symmetric", &[12]);
    for (plate, scene) in [(charuco_plate(Some(("DICT_4X4_50", 0.7))), charuco_scene(0.1)), (grid, dots)] {
        let one = scene.render(0);
        let pixels = one.pixels.chunks_exact(one.width).flat_map(|row| [row, row].concat()).collect();
        let two = Picture { width: 2 * one.width, pixels, ..one };
        let found = detect(&two, &plate).unwrap();
        assert!(!found.observations.is_empty());
        assert!(found.notices.iter().any(|n| n.code == Code::PlateTwice), "{:?}", found.notices);
    }
}

/// Dictionaries that are rarely printed are found, too, and the side is the one that is seen.
#[test]
fn every_dictionary_is_found_where_none_is_stated() {
    let print = |dictionary| Print::Charuco { dictionary, ratio: 0.7, legacy: false };
    for (dictionary, name) in [(DICT_APRILTAG_16h5, "16h5"), (DICT_ARUCO_MIP_36h12, "MIP_36h12"), (DICT_4X4_50, "4X4")]
    {
        let picture = Scene { print: print(dictionary), ..charuco_scene(0.1) }.render(0);
        let found = detect(&picture, &charuco_plate(None)).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(found.observations.len(), 40, "{name}");
        let said = found.notices.iter().find(|n| n.code == Code::DictionaryGuessed).expect("said");
        assert!(
            said.what.contains(name) && (said.what.contains("0.70") || said.what.contains("0.69")),
            "{}",
            said.what
        );
    }
}

#[test]
fn markers_that_begin_before_the_stated_first_are_named_by_their_numbers() {
    let aruco = Aruco { dictionary: "DICT_4X4_50".to_owned(), side_m: 0.007, legacy: false, first_id: 10 };
    let plate = Plate { aruco: Some(aruco), ..charuco_plate(None) };
    let error = detect(&charuco_scene(0.1).render(0), &plate).expect_err("other numbers");
    assert_says(&error, Code::PlateNotFound, &["0 to 26", "10 to 36", "first_id"]);
}

/// With the layout stated, the markers of the first column (of the last in OpenCV's layout before 4.6) are the only ones that do not fit into the other
/// layout, too, moved by a column: where they are seen, a line that something hides is no doubt.
#[test]
fn a_hidden_line_is_no_doubt_of_a_layout_that_markers_tell() {
    let view = View::new(COLUMNS, ROWS, [321.3, 239.6], 46.0, 0.03, [0.015, -0.01]);
    let covered = |legacy: bool, left: bool| {
        let print = Print::Charuco { dictionary: DICT_4X4_50, ratio: 0.7, legacy };
        let mut picture = Scene { print, ..Scene::new(COLUMNS, ROWS, view) }.render(0);
        let is_covered = |x: usize| if left { x < 172 } else { x > 470 };
        let all = picture.pixels.iter_mut().enumerate();
        all.filter(|(k, _)| is_covered(k % picture.width)).for_each(|(_, value)| *value = 90.0);
        picture
    };
    let plate = |legacy| Plate {
        aruco: Some(Aruco { dictionary: "DICT_4X4_50".to_owned(), side_m: 0.007, legacy, first_id: 0 }),
        ..charuco_plate(None)
    };
    for legacy in [false, true] {
        let detection = detect(&covered(legacy, legacy), &plate(legacy)).unwrap();
        let found = detection.observations.len();
        assert!((34..40).contains(&found), "{legacy}: {found} {:?}", detection.dropped);
        let error = rms(&errors(&detection, |id| Scene::new(COLUMNS, ROWS, view).corner(id)));
        assert!(error < 0.02, "{legacy}: {error}");
        // Of the other layout these markers may be.
        let other = detect(&covered(!legacy, !legacy), &plate(legacy)).expect_err("the other layout");
        assert_eq!(other.code, Code::PlateNotDetectable, "{legacy}: {other}");
        let moved = detect(&covered(!legacy, legacy), &plate(legacy)).expect_err("it fits, moved by a column");
        assert_eq!(moved.code, Code::PlateLineHidden, "{legacy}: {moved}");
    }
}

/// From 20 degrees above its plane, and less: no line of squares is found, or few.
#[test]
fn a_board_seen_slantwise_is_found_by_its_markers() {
    let size = (1280, 960);
    let (mut in_view, mut found) = (0, 0);
    for (azimuth, roll, tilt) in [(0.3, 0.4, 70.0), (1.9, -0.2, 72.0), (3.6, 0.5, 74.0), (5.0, 0.1, 70.0)] {
        let view = slantwise(f64::to_radians(tilt), azimuth, roll, size);
        let scene = Scene { size, view, noise: 2.5, ..charuco_scene(0.0) };
        let detection = detect(&scene.render(7), &charuco_plate(Some(("DICT_4X4_50", 0.7)))).unwrap();
        let is_in_view = |[x, y]: &[f64; 2]| (12.0..1268.0).contains(x) && (12.0..948.0).contains(y);
        in_view += (0..COLUMNS * ROWS).filter(|id| is_in_view(&scene.corner(*id))).count();
        found += detection.observations.len();
        let errors = errors(&detection, |id| scene.corner(id));
        assert!(errors.iter().all(|[u, v]| u.hypot(*v) < 2.0), "{azimuth}");
    }
    assert!(20 * found >= 19 * in_view, "{found} of {in_view}");
}

/// The board turned in its plane, then tilted away about an axis in the picture, ten squares before a camera.
fn slantwise(tilt: f64, azimuth: f64, roll: f64, size: (usize, usize)) -> View {
    let axis = Vector3::new(azimuth.cos(), azimuth.sin(), 0.0) * tilt;
    let turned = Rotation3::new(axis) * Rotation3::new(Vector3::z() * roll);
    let [x, y] = [0, 1].map(|k| turned * Vector3::ith(k, 1.0));
    let middle = [COLUMNS, ROWS].map(|n| f64::from(n - 1) / 2.0);
    let origin = Vector3::z() * 10.0 - x * middle[0] - y * middle[1];
    let pixel = |k: usize| {
        let row = |v: &Vector3<f64>| match k {
            0 => 1300.0 * v.x + 0.5 * size.0 as f64 * v.z,
            1 => 1300.0 * v.y + 0.5 * size.1 as f64 * v.z,
            _ => v.z,
        };
        [row(&x), row(&y), row(&origin)]
    };
    View([pixel(0), pixel(1), pixel(2)])
}
