//! PuzzleBoards: which part of the pattern, drawings, mirrors and other boards.

use std::path::Path;

use calib_targets_puzzleboard::code_maps::{horizontal_edge_bit, vertical_edge_bit};
use robotcal::Code;
use robotcal::detect::{Picture, detect, detect_series};
use robotcal::series::{Plate, parse_plate, plate_toml};

use crate::circles_support::{Scene, View, pose, scene};
use crate::said::assert_says;

fn plate(more: &str) -> Plate {
    let text = format!("format = 1\nkind = \"puzzleboard\"\ncolumns = 9\nrows = 8\npitch_m = 0.025\n{more}\n");
    parse_plate(Path::new("plate.toml"), &text, "").unwrap()
}

fn shown(plate: &Plate, view: &View) -> (Scene, Picture) {
    let scene = Scene { plate: plate.clone(), camera_from_plate: pose(view), ..scene(view) };
    let picture = scene.render(1);
    (scene, picture)
}

/// Errors of all corners, px.
fn errors(scene: &Scene, picture: &Picture) -> Vec<f64> {
    let detection = detect(picture, &scene.plate).unwrap();
    let error = |o: &robotcal::series::Observation| {
        let m = &scene.plate.markers[scene.plate.index_of(o.marker).unwrap()];
        let truth = scene.camera.project(&scene.camera_from_plate.transform(&m.position_m)).unwrap();
        (nalgebra::Vector2::from(o.uv) - truth).norm()
    };
    detection.observations.iter().map(error).collect()
}

#[test]
fn every_part_of_the_pattern_is_found_and_measured_in_every_turn() {
    for (k, origin) in [[0, 0], [1, 0], [5, 200], [490, 491]].into_iter().enumerate() {
        let plate = plate(&format!("origin_row = {}\norigin_col = {}", origin[0], origin[1]));
        let roll_deg = 20.0 + 90.0 * k as f64;
        let view = View { distance_m: 0.6, tilt_deg: 25.0, azimuth_deg: 40.0, roll_deg, ..View::default() };
        let (scene, picture) = shown(&plate, &view);
        let errors = errors(&scene, &picture);
        let largest = errors.iter().copied().fold(0.0, f64::max);
        println!("{origin:?}: {} corners, largest error {largest:.4} px", errors.len());
        assert_eq!(errors.len(), 72, "{origin:?}");
        assert!(largest < 0.1, "{origin:?}: {largest}");
    }
}

/// Drawn here by the convention that the makers of the pattern and of its printers share: white for a bit that is set, dots with a
/// radius of a sixth of a square, the dot below square (r, c) by the horizontal map, the one right of it by the vertical one.
#[test]
fn a_board_drawn_as_its_makers_do_is_read() {
    let (plate, side) = (plate("origin_row = 7\norigin_col = 30"), 24.0);
    let (columns, rows) = (10, 9);
    let shade = |x: f64, y: f64| {
        let (c, r) = ((x / side).floor() as i32, (y / side).floor() as i32);
        if !(0..columns).contains(&c) || !(0..rows).contains(&r) {
            return 200.0;
        }
        let (fx, fy) = (x / side - f64::from(c), y / side - f64::from(r));
        let near = |cx: f64, cy: f64| (fx - cx).hypot(fy - cy) < 1.0 / 6.0;
        let dots = [
            (near(0.5, 1.0), r + 1 < rows, horizontal_edge_bit(7 + r, 30 + c)),
            (near(0.5, 0.0), r > 0, horizontal_edge_bit(7 + r - 1, 30 + c)),
            (near(1.0, 0.5), c + 1 < columns, vertical_edge_bit(7 + r, 30 + c)),
            (near(0.0, 0.5), c > 0, vertical_edge_bit(7 + r, 30 + c - 1)),
        ];
        let dot = dots.iter().find(|(here, inside, _)| *here && *inside).map(|(.., bit)| *bit == 1);
        if dot.unwrap_or((r + c + 7 + 30) % 2 == 1) { 200.0 } else { 30.0 }
    };
    let (width, height) = (320, 330);
    let (sin, cos) = 0.1_f64.sin_cos();
    // Means over a pixel and its neighbours: some blur.
    let pixel = |k: usize| {
        let (x, y) = ((k % width) as f64 - 50.3, (k / width) as f64 - 40.6);
        let samples = (0..100).map(|s| [x + 0.2 * f64::from(s % 10) - 0.9, y + 0.2 * f64::from(s / 10) - 0.9]);
        let samples = samples.map(|[x, y]| shade(cos * x + sin * y, cos * y - sin * x));
        (samples.sum::<f64>() / 100.0).round() as f32
    };
    let picture = Picture { width, height, pixels: (0..width * height).map(pixel).collect(), full_scale: 255.0 };
    let detection = detect(&picture, &plate).unwrap();
    assert_eq!(detection.observations.len(), 72, "{:?}", detection.dropped);
    for o in &detection.observations {
        let at = [o.marker % 9, o.marker / 9].map(|k| f64::from(k + 1) * side);
        let off = (o.uv[0] - 50.3 - cos * at[0] + sin * at[1]).hypot(o.uv[1] - 40.6 - sin * at[0] - cos * at[1]);
        assert!(off < 0.1, "corner {}: {off}", o.marker);
    }
}

#[test]
fn mirrors_and_other_boards_are_named() {
    let view = View { distance_m: 0.6, tilt_deg: 15.0, ..View::default() };
    let board = plate("origin_row = 3");
    let (_, mut picture) = shown(&board, &view);
    let other = detect(&picture, &plate("origin_row = 100")).expect_err("another part");
    assert_eq!(other.code, Code::PlateContradicted, "{other}");
    assert_says(&other, Code::PlateContradicted, &["9 x 8", "origin_row = 3", "origin_col = 0"]);
    // A board that is larger than stated, and one that begins earlier.
    let seen = ["9 x 8", "origin_row = 3", "origin_col = 0"];
    let smaller = Plate { columns: 8, ..board.clone() };
    for stated in [smaller, plate("origin_row = 4"), plate("origin_row = 3\norigin_col = 1")] {
        let error = detect(&picture, &stated).expect_err("part of the board");
        assert_says(&error, Code::PlateContradicted, &seen);
    }
    picture.pixels.chunks_exact_mut(picture.width).for_each(<[f32]>::reverse);
    let mirrored = detect(&picture, &board).expect_err("mirrored");
    assert_eq!(mirrored.code, Code::PlateMirrored, "{mirrored}");
    let squares = "format = 1\nkind = \"chessboard\"\ncolumns = 9\nrows = 8\npitch_m = 0.025\n";
    let (_, squares) = shown(&parse_plate(Path::new("plate.toml"), squares, "").unwrap(), &view);
    let none = detect(&squares, &board).expect_err("no dots");
    assert_eq!(none.code, Code::PlateNotFound, "{none}");
}

#[test]
fn what_cannot_be_read_is_refused_and_what_is_written_reads_back() {
    let code = |text: &str| parse_plate(Path::new("plate.toml"), text, "").expect_err(text).code;
    let board = "format = 1\nkind = \"puzzleboard\"\ncolumns = 9\nrows = 8\npitch_m = 0.025\n";
    assert_eq!(code(&board.replace("rows = 8", "rows = 6")), Code::SettingRange);
    assert_eq!(code(&format!("{board}origin_row = 493\n")), Code::SettingRange);
    assert_eq!(code(&format!("{board}dot_diameter_rel = 0.9\n")), Code::SettingRange);
    assert_eq!(code(&format!("{}origin_col = 3\n", board.replace("puzzleboard", "chessboard"))), Code::SettingConflict);
    let plate = plate("origin_row = 9\norigin_col = 4\ndot_diameter_rel = 0.3");
    assert_eq!(parse_plate(Path::new("plate.toml"), &plate_toml(&plate, None).unwrap(), "").unwrap(), plate);
}

/// The dots tell which corner is which, so that a hand over an outer line costs the corners below it and no more.
#[test]
fn a_covered_line_leaves_the_other_corners() {
    let plate = plate("origin_row = 12\norigin_col = 31");
    let view = View { distance_m: 0.6, tilt_deg: 15.0, ..View::default() };
    let (scene, mut picture) = shown(&plate, &view);
    let all = detect(&picture, &plate).unwrap();
    let last = all.observations.iter().map(|o| o.uv[0]).fold(0.0, f64::max);
    let first = all.observations.iter().map(|o| o.uv[0]).fold(f64::MAX, f64::min);
    let begin = last - 0.19 * (last - first);
    let width = picture.width;
    for (k, value) in picture.pixels.iter_mut().enumerate().filter(|(k, _)| (k % width) as f64 > begin) {
        *value = 70.0 + (k / width % 7) as f32;
    }
    let image = detect_series(&["1.png".into()], &plate, |_| Ok(picture.clone()), |_| {}).remove(0);
    assert!(image.detection.failure.is_none(), "{:?}", image.detection.failure);
    let errors = errors(&scene, &picture);
    assert!((35..72).contains(&errors.len()), "{}", errors.len());
    assert!(errors.iter().all(|e| *e < 0.15), "{errors:?}");
    assert!(image.detection.notices.iter().any(|n| n.code == Code::PlateLineHidden));
}
