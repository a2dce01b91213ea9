//! Chessboards of real robots, where the recordings are at hand.

use std::path::PathBuf;

use crate::robots::shared;
use robotcal::Code;
use robotcal::detect::{Detection, detect_series, load};
use robotcal::geom::PlaneMap;
use robotcal::series::{Plate, PlateKind};

const COLUMNS: u32 = 11;
const ROWS: u32 = 8;

/// Largest distance of a corner from the plane map of all: lens distortion of these cameras bends the board by a few pixels, a
/// wrong id is off by a square (15 px and more).
const BENT_PX: f64 = 6.0;

fn largest_misfit(detection: &Detection) -> f64 {
    let at = |id: u32| [f64::from(id % COLUMNS), f64::from(id / COLUMNS)];
    let pairs: Vec<_> = detection.observations.iter().map(|o| (at(o.marker), o.uv)).collect();
    let map = PlaneMap::fit(&pairs).expect("a plane map");
    let distance = |(board, uv): &([f64; 2], [f64; 2])| {
        let p = map.apply(*board).expect("in view");
        (p[0] - uv[0]).hypot(p[1] - uv[1])
    };
    pairs.iter().map(distance).fold(0.0, f64::max)
}

/// The images of a real series in order of their names.
fn images_of(series: &str) -> Vec<PathBuf> {
    let folder = shared("real").join(series).join("images");
    let mut images: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    images.sort();
    images
}

#[test]
#[ignore = "needs the real series"]
fn all_corners_of_the_real_boards_are_found_with_the_right_ids() {
    let plate = Plate::lattice(PlateKind::Chessboard, COLUMNS, ROWS, 0.01, 5e-5);
    for series in ["nachi-2025-01-17", "nachi-2025-02-04", "nachi-2025-02-19", "aubo-2024-12-16"] {
        let images = images_of(series);
        assert_eq!(images.len(), 24, "{series}");
        for (path, found) in images.iter().zip(detect_series(&images, &plate, |path| load(path, None), |_| ())) {
            let detection = found.detection;
            assert_eq!(detection.failure, None);
            let count = detection.observations.len();
            assert!(count >= 87, "{}: {count} corners, {:?}", path.display(), detection.dropped);
            let is_told = detection.notices.iter().all(|notice| notice.code == Code::HotPixels);
            assert!(is_told, "{}: {:?}", path.display(), detection.notices);
            let misfit = largest_misfit(&detection);
            assert!(misfit < BENT_PX, "{}: {misfit} px", path.display());
        }
    }
}

/// Webcams that sharpen and compress: squares from 11 px, edges steeper than a lens makes them.
#[test]
#[ignore = "needs the real series"]
fn boards_of_webcams_are_complete() {
    let plate = Plate::lattice(PlateKind::Chessboard, 9, 7, 0.02, 1e-4);
    for series in ["ur3a-cam1", "ur3a-cam2"] {
        let images = images_of(series);
        assert_eq!(images.len(), 40, "{series}");
        for (path, found) in images.iter().zip(detect_series(&images, &plate, |path| load(path, None), |_| ())) {
            let detection = found.detection;
            assert_eq!(detection.observations.len(), 63, "{}: {:?}", path.display(), detection.dropped);
        }
    }
}

/// A plate file with a line more or fewer than real boards have: no image is used, and the size that is seen is named.
#[test]
#[ignore = "needs the real series"]
fn another_size_than_that_of_a_real_board_is_named() {
    for (series, kind, [columns, rows]) in [
        ("nachi-2025-01-17", PlateKind::Chessboard, [COLUMNS, ROWS]),
        ("ur3a-cam1", PlateKind::Chessboard, [9, 7]),
        ("ric-10x10", PlateKind::CircleGrid, [10, 10]),
    ] {
        let mut images = images_of(series);
        images.truncate(6);
        let sizes = [[columns - 1, rows], [columns + 1, rows], [columns, rows - 1], [columns, rows + 1]];
        for [c, r] in sizes {
            let plate = Plate::lattice(kind, c, r, 0.02, 1e-4);
            let all = detect_series(&images, &plate, |path| load(path, None), |_| ());
            let failures: Vec<_> = all.into_iter().map(|i| i.detection.failure.expect("another size")).collect();
            let named = |f: &&robotcal::Error| {
                [[columns, rows], [rows, columns]].iter().any(|[a, b]| f.what.contains(&format!("{a} x {b}")))
            };
            println!("{series} {c} x {r}: {} of {} named", failures.iter().filter(named).count(), failures.len());
            assert!(2 * failures.iter().filter(named).count() > failures.len(), "{series} {c} x {r}: {failures:?}");
        }
    }
}
