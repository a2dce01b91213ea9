//! Boards close before a fisheye, whose neighbouring corners no map of a plane explains.

use calib_targets_aruco::builtins::DICT_4X4_50;
use robotcal::detect::detect;
use robotcal::series::{Aruco, Plate, PlateKind};

use crate::boards_scene::{Print, Scene, View, errors};

const COLUMNS: u32 = 8;
const ROWS: u32 = 6;
/// Pixels of the outer rim in which no corner is asked for.
const RIM_PX: f64 = 12.0;

fn scene(angle: f64, tilt: [f64; 2]) -> Scene {
    let view = View::new(COLUMNS, ROWS, [640.0, 480.0], 187.0, angle, tilt);
    Scene {
        print: Print::Charuco { dictionary: DICT_4X4_50, ratio: 0.75, legacy: false },
        size: (1280, 960),
        fisheye_px: Some(420.0),
        noise: 2.0,
        ..Scene::new(COLUMNS, ROWS, view)
    }
}

/// Markers were read through maps of more corners than their own, and corners sought on those of neighbours two squares away: of 48 in view 13
/// were found.
#[test]
fn a_charuco_board_close_to_a_fisheye_keeps_its_corners() {
    let aruco = Aruco { dictionary: "DICT_4X4_50".to_owned(), side_m: 0.0225, legacy: false, first_id: 0 };
    let plate = Plate { aruco: Some(aruco), ..Plate::lattice(PlateKind::Charuco, COLUMNS, ROWS, 0.03, 1e-4) };
    let (mut in_view, mut found, mut worst) = (0, 0, 0.0_f64);
    for (angle, tilt) in [(0.1, [0.0, 0.0]), (1.0, [0.06, -0.04]), (-0.4, [-0.08, 0.08]), (3.0, [0.1, 0.05])] {
        let scene = scene(angle, tilt);
        let is_in_view = |id: &u32| {
            let [x, y] = scene.corner(*id);
            x > RIM_PX && y > RIM_PX && x < 1280.0 - RIM_PX && y < 960.0 - RIM_PX
        };
        in_view += (0..COLUMNS * ROWS).filter(is_in_view).count();
        let detection = detect(&scene.render(0), &plate).unwrap();
        found += detection.observations.len();
        worst = errors(&detection, |id| scene.corner(id)).iter().map(|e| e[0].hypot(e[1])).fold(worst, f64::max);
    }
    println!("{found} of {in_view}, {worst:.3} px");
    assert!(worst < 0.2, "{worst} px");
    assert!(found as f64 > 0.8 * in_view as f64, "{found} of {in_view}");
}
