//! Chessboard corners on rendered boards with known truth.

use crate::boards_scene::{Scene, View, errors, mirror, rms, tiles};
use crate::said::assert_says;
use robotcal::Code;
use robotcal::detect::{Detection, FlatField, Picture, detect, detect_series};
use robotcal::series::{Plate, PlateKind};

fn plate(columns: u32, rows: u32) -> Plate {
    Plate::lattice(PlateKind::Chessboard, columns, rows, 0.01, 1e-4)
}

fn found(scene: &Scene, seed: u64) -> Detection {
    match detect(&scene.render(seed), &plate(scene.columns, scene.rows)) {
        Ok(detection) => detection,
        Err(error) => panic!("seed {seed}: {error}"),
    }
}

fn tilted(columns: u32, rows: u32, angle: f64) -> Scene {
    Scene::new(columns, rows, View::new(columns, rows, [321.3, 239.6], 33.0, angle, [0.02, -0.015]))
}

#[test]
fn corners_without_noise_are_exact_in_every_orientation() {
    // Rounding to whole counts is noise of 0.29 counts; the renderer's samples add up to 0.003 px.
    for step in 0..12 {
        let scene = tilted(9, 6, f64::from(step) * std::f64::consts::TAU / 12.0);
        let detection = found(&scene, 0);
        let errors = errors(&detection, |id| scene.corner(id));
        assert_eq!(detection.observations.len(), 54, "step {step}: {:?}", detection.dropped);
        assert!(detection.notices.is_empty(), "{:?}", detection.notices);
        assert!(rms(&errors) < 0.004, "step {step}: {}", rms(&errors));
    }
}

#[test]
fn the_stated_covariance_covers_the_noise() {
    // Systematic share of the stated covariance: 0.015 px per axis; rendered boards have none, so it is taken off.
    let systematic = 0.015_f64.powi(2);
    let mut normalised = Vec::new();
    for seed in 0..12 {
        let scene = Scene { noise: 8.0, ..tilted(9, 6, 0.5 * seed as f64) };
        let detection = found(&scene, seed);
        for (o, e) in detection.observations.iter().zip(errors(&detection, |id| scene.corner(id))) {
            let [uu, uv, vv] = o.covariance.expect("a covariance");
            let (uu, vv) = (uu - systematic, vv - systematic);
            normalised.push((e[0] * e[0] * vv - 2.0 * e[0] * e[1] * uv + e[1] * e[1] * uu) / (uu * vv - uv * uv) / 2.0);
        }
    }
    let mean = normalised.iter().sum::<f64>() / normalised.len() as f64;
    // 1 +- 3 / sqrt(12 * 54) by chance, and a few percent for the linearisation.
    assert!((0.85..1.15).contains(&mean), "{mean} over {}", normalised.len());
}

/// As drawn, without a lens: some corners lie where all around is symmetric, and a fit that begins there has nowhere to move.
#[test]
fn corners_in_the_middle_of_a_pixel_of_a_drawing_are_found() {
    let (columns, rows, side, middle) = (9, 7, 40.25, [320.0, 240.0]);
    // Means over a pixel of what is inside, and of the two colours in turn.
    let along = |at: f64, first: f64, count: f64| {
        let steps = (0..8).map(|k| (at + (f64::from(k) + 0.5) / 8.0 - 0.5 - first) / side + 1.0);
        let inside = steps.filter(|t| (0.0..count + 1.0).contains(t));
        inside.fold([0.0_f64, 0.0], |[m, s], t| [m + 0.125, s + if t.rem_euclid(2.0) < 1.0 { 0.125 } else { -0.125 }])
    };
    let first = [middle[0] - 4.0 * side, middle[1] - 3.0 * side];
    let pixel = |k: usize| {
        let [mx, sx] = along((k % 640) as f64, first[0], f64::from(columns));
        let [my, sy] = along((k / 640) as f64, first[1], f64::from(rows));
        (255.0 - 127.5 * (mx * my + sx * sy)).round() as f32
    };
    let picture = Picture { width: 640, height: 480, pixels: (0..640 * 480).map(pixel).collect(), full_scale: 255.0 };
    let detection = detect(&picture, &plate(columns, rows)).expect("a board");
    assert_eq!(detection.observations.len(), 63, "{:?}", detection.dropped);
    for o in &detection.observations {
        let [c, r] = [o.marker % columns, o.marker / columns].map(f64::from);
        let [x, y] = [first[0] + c * side - o.uv[0], first[1] + r * side - o.uv[1]];
        // Two of the 0.015 px per axis that are stated beyond noise: edges without a lens are no Gaussian.
        assert!(x.hypot(y) < 0.042, "{}: {x} {y}", o.marker);
    }
}

/// Floors with more crossings than the board, turned otherwise than it: none of its corners was found.
#[test]
fn a_floor_of_tiles_hides_no_board() {
    let floors = [[12.0, 15.0], [18.0, 18.0], [26.0, 33.0], [60.0, 60.0]];
    for (k, sides) in floors.into_iter().enumerate() {
        for turn in [0.3, 0.8, 1.2] {
            let scene = tilted(9, 6, 1.7 * k as f64);
            let picture = scene.on_ground(scene.render(0), 0.8, tiles(sides, 1.7 * k as f64 + turn, [60.0, 150.0]));
            let detection = detect(&picture, &plate(9, 6)).unwrap_or_else(|error| panic!("{sides:?} {turn}: {error}"));
            assert_eq!(detection.observations.len(), 54, "{sides:?} {turn}");
            let error = rms(&errors(&detection, |id| scene.corner(id)));
            assert!(error < 0.004, "{sides:?} {turn}: {error}");
            // Tiles without a board are no board.
            let floor = scene.on_ground(scene.render(0), -10.0, tiles(sides, turn, [60.0, 150.0]));
            assert!(detect(&floor, &plate(9, 6)).is_err(), "{sides:?} {turn}");
        }
    }
}

#[test]
fn uneven_light_does_not_move_corners() {
    let even = tilted(9, 6, 0.3);
    let flat = found(&even, 0);
    for (slope, most) in [(0.0003, 0.002), (0.001, 0.004)] {
        let scene = Scene { slope: [slope, -0.5 * slope], ..even.clone() };
        let uneven = found(&scene, 0);
        let shifts: Vec<_> = uneven
            .observations
            .iter()
            .zip(&flat.observations)
            .map(|(a, b)| [a.uv[0] - b.uv[0], a.uv[1] - b.uv[1]])
            .collect();
        println!("slope {slope}: {}", rms(&shifts));
        assert!(rms(&shifts) < most, "slope {slope}: {}", rms(&shifts));
    }
}

#[test]
fn over_exposed_squares_do_not_move_corners() {
    let scene = Scene { light: 330.0, ..tilted(9, 6, 0.3) };
    let errors = errors(&found(&scene, 0), |id| scene.corner(id));
    assert!(rms(&errors) < 0.006, "{}", rms(&errors));
}

/// In black and white alone edges jump from pixel to pixel: the fit sees a sharp picture and states a third of the errors.
#[test]
fn corners_of_one_bit_are_as_uncertain_as_their_rounding() {
    let (mut sum, mut count) = (0.0, 0);
    for step in 0..6 {
        let scene = tilted(9, 6, 0.4 + f64::from(step));
        let mut picture = scene.render(0);
        picture.pixels.iter_mut().for_each(|v| *v = if *v < 110.0 { 0.0 } else { 255.0 });
        // One stray level, and specks beside the board: still one bit, and nothing hot or dead.
        picture.pixels[5] = 128.0;
        (0..20).for_each(|k| picture.pixels[640 * (20 + 20 * k) + 10] = 0.0);
        (0..20).for_each(|k| picture.pixels[640 * (20 + 20 * k) + 30] = 0.0);
        let detection = detect(&picture, &plate(9, 6)).unwrap();
        assert!(detection.observations.len() >= 50, "step {step}: {:?}", detection.dropped);
        assert!(detection.notices.iter().any(|n| n.code == Code::FewGreyLevels), "{:?}", detection.notices);
        assert!(detection.notices.iter().all(|n| n.code != Code::HotPixels), "{:?}", detection.notices);
        for (o, e) in detection.observations.iter().zip(errors(&detection, |id| scene.corner(id))) {
            // Eight pixels of an edge, uniform in each: 0.10 px.
            let [uu, _, vv] = o.covariance.unwrap();
            assert!(uu > 0.0104 && vv > 0.0104, "{uu} {vv}");
            sum += e[0] * e[0] / uu + e[1] * e[1] / vv;
            count += 2;
        }
    }
    assert!(sum / f64::from(count) < 1.0, "{sum} over {count}");
}

/// A threshold below the middle joins light squares over the crossings, where all is then white: that is no over-exposure.
#[test]
fn a_threshold_between_dark_and_light_costs_no_corner() {
    for threshold in [70.0, 110.0, 150.0] {
        let scene = tilted(9, 6, 0.9);
        let mut picture = scene.render(0);
        picture.pixels.iter_mut().for_each(|v| *v = if *v < threshold { 0.0 } else { 255.0 });
        let detection = detect(&picture, &plate(9, 6)).unwrap_or_else(|error| panic!("{threshold}: {error}"));
        assert_eq!(detection.observations.len(), 54, "{threshold}: {:?}", detection.dropped);
        let error = rms(&errors(&detection, |id| scene.corner(id)));
        assert!(error < 0.2, "{threshold}: {error}");
    }
}

/// Levels so few are no measure of the light, of which dark and white images tell.
#[test]
fn dark_and_white_images_that_are_not_applied_are_told_of() {
    let mut picture = tilted(9, 6, 0.4).render(0);
    let told = |picture: &Picture| {
        let dark = Picture { pixels: vec![1.0; picture.pixels.len()], ..picture.clone() };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("dark.png");
        let bytes = dark.pixels.iter().map(|v| *v as u8).collect();
        image::GrayImage::from_raw(640, 480, bytes).unwrap().save(&path).unwrap();
        let field = FlatField::from_images(&[path], &[], None).unwrap().unwrap();
        let seen = detect_series(&["1.png".into()], &plate(9, 6), |_| field.apply(picture.clone()), |_| {}).remove(0);
        assert!(seen.detection.observations.len() >= 50, "{:?}", seen.detection.failure);
        seen.detection.notices.iter().any(|n| n.code == Code::FlatFieldLeftOut)
    };
    let of_many_levels = told(&picture);
    picture.pixels.iter_mut().for_each(|v| *v = if *v < 110.0 { 0.0 } else { 255.0 });
    assert_eq!((of_many_levels, told(&picture)), (false, true));
}

/// One pixel in a thousand at full scale.
#[test]
fn hot_pixels_cost_no_corner_and_are_said() {
    let scene = tilted(9, 6, 0.3);
    let mut picture = scene.render(0);
    picture.pixels.iter_mut().step_by(1009).for_each(|v| *v = 255.0);
    let detection = detect(&picture, &plate(9, 6)).unwrap();
    assert_eq!(detection.observations.len(), 54, "{:?}", detection.dropped);
    assert!(matches!(&detection.notices[..], [n] if n.code == Code::HotPixels), "{:?}", detection.notices);
    assert!(rms(&errors(&detection, |id| scene.corner(id))) < 0.02);
}

#[test]
fn sixteen_bits_are_used_in_full() {
    // The whole contrast is 25 of 65535 counts of 16 bit above a tenth of full scale; in 8 bits it would be gone.
    let scene = Scene { dark: 100.0, light: 420.0, full_scale: 65535.0, ..tilted(9, 6, 0.2) };
    let detection = found(&scene, 0);
    assert_eq!(detection.observations.len(), 54);
    assert!(rms(&errors(&detection, |id| scene.corner(id))) < 0.004);
}

#[test]
fn a_board_cut_by_the_edge_of_the_image_keeps_its_ids() {
    for (centre, least) in [([60.0, 240.0], 25), ([590.0, 240.0], 25), ([321.0, 20.0], 20), ([330.0, 470.0], 20)] {
        for angle in [0.05, 3.1] {
            let scene = Scene::new(9, 6, View::new(9, 6, centre, 33.0, angle, [0.01, 0.01]));
            let detection = found(&scene, 0);
            assert!(detection.observations.len() >= least, "{centre:?}: {}", detection.observations.len());
            assert!(detection.observations.len() < 54);
            assert!(
                rms(&errors(&detection, |id| scene.corner(id))) < 0.006,
                "{centre:?} {angle}: {}",
                rms(&errors(&detection, |id| scene.corner(id)))
            );
        }
    }
}

#[test]
fn a_board_beyond_two_opposite_edges_is_refused() {
    let scene = Scene::new(15, 6, View::new(15, 6, [320.0, 240.0], 60.0, 0.02, [0.0, 0.0]));
    let error = detect(&scene.render(0), &plate(15, 6)).expect_err("the place on the board is unknown");
    assert_eq!(error.code, Code::PlateIncomplete, "{error}");
}

#[test]
fn a_covered_part_is_left_out_and_the_rest_keeps_its_ids() {
    let scene = tilted(9, 6, 0.1);
    let mut picture = scene.render(0);
    // A cable across the board.
    for y in 0..picture.height {
        for x in 300..330 {
            picture.pixels[y * picture.width + x] = 60.0;
        }
    }
    let detection = detect(&picture, &plate(9, 6)).expect("a board");
    assert!((40..54).contains(&detection.observations.len()), "{}", detection.observations.len());
    assert!(
        rms(&errors(&detection, |id| scene.corner(id))) < 0.01,
        "{}",
        rms(&errors(&detection, |id| scene.corner(id)))
    );
}

#[test]
fn boards_that_look_the_same_after_half_a_turn_may_begin_with_either_colour() {
    // Mirrored, 10 x 8 squares begin with a light one: such boards are printed as well. The inverse of 9 x 7 squares has light corners.
    for (columns, rows) in [(9, 7), (8, 6)] {
        let scene = tilted(columns, rows, 0.1);
        let picture = scene.render(0);
        let turned = if columns == 9 { mirror(&picture) } else { inverse(&picture) };
        let board = plate(columns, rows);
        let (dark, light) =
            (detect(&picture, &board).expect("dark first"), detect(&turned, &board).expect("light first"));
        let count = (columns * rows) as usize;
        assert_eq!([dark.observations.len(), light.observations.len()], [count, count], "{columns} x {rows}");
    }
}

fn inverse(picture: &Picture) -> Picture {
    Picture { pixels: picture.pixels.iter().map(|p| 220.0 - p).collect(), ..picture.clone() }
}

#[test]
fn a_board_that_is_its_own_half_turn_is_upright_with_a_notice() {
    for (columns, rows) in [(9, 7), (8, 6)] {
        let scene = tilted(columns, rows, 0.4);
        let detection = found(&scene, 0);
        assert!(matches!(&detection.notices[..], [n] if n.code == Code::PlateSymmetric), "{:?}", detection.notices);
        assert!(rms(&errors(&detection, |id| scene.corner(id))) < 0.004);
    }
}

/// The sizes that a board may be taken for, in its own order.
fn other_sizes([columns, rows]: [u32; 2]) -> [[u32; 2]; 7] {
    [
        [columns - 1, rows],
        [columns + 1, rows],
        [columns, rows - 1],
        [columns, rows + 1],
        [columns + 1, rows + 1],
        [columns - 1, rows - 1],
        [columns + 2, rows + 3],
    ]
}

#[test]
fn a_board_of_another_size_is_named_by_what_is_seen() {
    let sizes = [[9, 6], [9, 7], [7, 7], [8, 6], [5, 3]];
    for (size, turn) in sizes.into_iter().zip(0..) {
        let picture = tilted(size[0], size[1], 0.1 + 1.7 * f64::from(turn)).render(0);
        for [columns, rows] in other_sizes(size).into_iter().flat_map(|[a, b]| [[a, b], [b, a]]) {
            let error = detect(&picture, &plate(columns, rows)).expect_err("another size");
            assert_says(&error, Code::PlateContradicted, &["columns", "rows", &format!("{columns} x {rows}")]);
            let mut seen = [[size[0], size[1]], [size[1], size[0]]].into_iter();
            let named = seen.any(|[a, b]| error.what.contains(&format!("{a} x {b}")));
            assert!(named, "{size:?} for {columns} x {rows}: {error}");
        }
        let turned = detect(&picture, &plate(size[1], size[0])).expect("the same board after a quarter turn");
        assert_eq!(turned.observations.len(), (size[0] * size[1]) as usize);
    }
    let picture = tilted(9, 6, 0.1).render(0);
    let empty = Picture { pixels: vec![80.0; picture.pixels.len()], ..picture };
    let error = detect(&empty, &plate(9, 6)).expect_err("nothing there");
    assert_eq!(error.code, Code::PlateNotFound, "{error}");
}

/// Both ends of the rows are in view, and neither end of the columns.
#[test]
fn a_number_that_is_seen_is_named_where_the_other_is_not() {
    let scene = Scene::new(6, 15, View::new(6, 15, [320.0, 240.0], 55.0, 0.02, [0.0, 0.0]));
    let error = detect(&scene.render(0), &plate(7, 15)).expect_err("another size");
    assert_says(&error, Code::PlateContradicted, &["6", "7 x 15"]);
    let error = detect(&scene.render(0), &plate(6, 15)).expect_err("the place on the board is unknown");
    assert_eq!(error.code, Code::PlateIncomplete, "{error}");
}

/// Pictures that are cut by the border could be of a larger board; one that shows all of it says that they are not.
#[test]
fn a_series_of_another_size_is_refused_as_a_whole_and_one_that_does_not_tell_says_so() {
    let centres = [[60.0, 240.0], [321.0, 240.0], [590.0, 240.0]];
    let views = centres.map(|centre| Scene::new(9, 6, View::new(9, 6, centre, 33.0, 0.05, [0.01, 0.01])).render(0));
    let paths = ["left.png", "whole.png", "right.png"].map(std::path::PathBuf::from);
    let seen = |columns: u32, images: &[usize]| {
        let chosen: Vec<_> = images.iter().map(|&k| paths[k].clone()).collect();
        let picture = |path: &std::path::Path| Ok(views[paths.iter().position(|p| p == path).expect("one")].clone());
        detect_series(&chosen, &plate(columns, 6), picture, |_| {})
    };
    for columns in [8, 10] {
        for image in seen(columns, &[0, 1, 2]) {
            assert!(image.detection.observations.is_empty());
            assert_says(&image.detection.failure.expect("refused"), Code::PlateContradicted, &["9 x 6", ".png"]);
        }
    }
    let notices = |images: &[usize]| {
        let all = seen(9, images);
        assert!(all.iter().all(|i| i.detection.observations.len() >= 25));
        all.into_iter().flat_map(|i| i.detection.notices).map(|n| n.code).collect::<Vec<_>>()
    };
    assert_eq!(notices(&[0, 1, 2]), []);
    assert_eq!(notices(&[0, 2]), [Code::PlateLineHidden]);
}

#[test]
fn a_line_more_than_printed_is_missing_from_large_boards() {
    let scene =
        Scene { size: (900, 600), ..Scene::new(28, 17, View::new(28, 17, [450.0, 300.0], 27.0, 0.05, [0.003, 0.0])) };
    let picture = scene.render(0);
    assert_eq!(detect(&picture, &plate(28, 17)).expect("the board itself").observations.len(), 28 * 17);
    for (columns, rows) in [(29, 17), (28, 18)] {
        let error = detect(&picture, &plate(columns, rows)).expect_err("another size");
        assert_says(&error, Code::PlateContradicted, &["28 x 17", "columns", "rows"]);
    }
}

/// A plate of another kind is looked for in some of the images alone: that takes longer than the detection.
#[test]
fn few_images_are_looked_at_for_a_plate_of_another_kind() {
    let paths: Vec<_> = (0..20).map(|k| std::path::PathBuf::from(format!("{k}.png"))).collect();
    let empty = Picture { pixels: vec![80.0; 160 * 120], width: 160, height: 120, full_scale: 255.0 };
    let looked_at = std::sync::atomic::AtomicUsize::new(0);
    let picture = |_: &std::path::Path| {
        looked_at.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        Ok(empty.clone())
    };
    let seen = detect_series(&paths, &plate(9, 6), picture, |_| {});
    assert!(seen.iter().all(|i| i.detection.failure.as_ref().is_some_and(|f| f.code == Code::PlateNotFound)));
    let again = looked_at.into_inner() - paths.len();
    assert!((1..=10).contains(&again), "{again}");
}

/// All of the board and its left part on the border of the picture, of five columns or of three; in the last one a hand covers five columns up to a
/// line of the board, so that it looks like a board of 4 x 6.
fn partly_covered() -> Vec<(std::path::PathBuf, Picture)> {
    let at = |centre: f64| Scene::new(9, 6, View::new(9, 6, [centre, 240.0], 33.0, 0.0, [0.0, 0.0]));
    let views = [("whole.png", 321.0), ("wide.png", 60.0), ("narrow.png", -32.0)];
    let mut all: Vec<_> = views.map(|(name, centre)| (name.into(), at(centre).render(0))).into();
    let scene = at(321.0);
    let mut picture = scene.render(0);
    let edge = scene.corner(4)[0];
    for (k, value) in picture.pixels.iter_mut().enumerate() {
        if ((k % picture.width) as f64) < edge {
            *value = 70.0;
        }
    }
    all.push(("hand.png".into(), picture));
    all
}

fn codes_of(images: &[(std::path::PathBuf, Picture)], chosen: &[usize]) -> Vec<(usize, Option<Code>)> {
    let paths: Vec<_> = chosen.iter().map(|&k| images[k].0.clone()).collect();
    let picture = |path: &std::path::Path| Ok(images.iter().find(|(p, _)| p == path).expect("one").1.clone());
    let seen = detect_series(&paths, &plate(9, 6), picture, |_| {});
    seen.iter().map(|i| (i.detection.observations.len(), i.detection.failure.as_ref().map(|f| f.code))).collect()
}

/// What a hand leaves looks like a smaller board: it is none of what another image shows more.
#[test]
fn a_hand_that_leaves_a_smaller_board_spares_images_that_show_more() {
    let images = partly_covered();
    let seen = codes_of(&images, &[0, 1, 2, 3]);
    assert_eq!(seen[0], (54, None));
    assert!(seen[1].0 >= 25 && seen[1].1.is_none(), "{seen:?}");
    assert_eq!(seen[2..], [(0, Some(Code::PlateIncomplete)), (0, Some(Code::PlateContradicted))]);
    let seen = codes_of(&images, &[1, 3]);
    assert!(seen[0].0 >= 25 && seen[0].1.is_none(), "{seen:?}");
    assert_eq!(seen[1], (0, Some(Code::PlateContradicted)));
}

/// What is seen in one image is said of others with its name.
#[test]
fn a_board_of_another_size_is_named_with_its_image_where_others_are_refused() {
    let images = partly_covered();
    let paths = [2, 3].map(|k: usize| images[k].0.clone());
    let picture = |path: &std::path::Path| Ok(images.iter().find(|(p, _)| p == path).expect("one").1.clone());
    let seen = detect_series(&paths, &plate(9, 6), picture, |_| {});
    let [part, hand] = [0, 1].map(|k| seen[k].detection.failure.as_ref().expect("refused"));
    assert_says(part, Code::PlateContradicted, &["hand.png", "4 x 6"]);
    assert!(hand.what.contains("4 x 6") && !hand.what.contains("hand.png"), "{hand}");
}

/// The border of the picture cuts off the first row and column of 10 x 7 corners: 9 x 6 are left, of which nobody sees that more follow.
#[test]
fn the_lines_that_are_left_of_a_larger_board_do_not_vouch_for_its_size() {
    let views = [
        View::new(10, 7, [262.0, 172.0], 60.0, 0.0, [0.0, 0.0]),
        View::new(10, 7, [321.3, 239.6], 33.0, 0.1, [0.02, -0.015]),
    ];
    let pictures = views.map(|view| Scene::new(10, 7, view).render(0));
    let paths = ["cut.png", "all.png"].map(std::path::PathBuf::from);
    let picture = |path: &std::path::Path| Ok(pictures[paths.iter().position(|p| p == path).expect("one")].clone());
    for image in detect_series(&paths, &plate(9, 6), picture, |_| {}) {
        assert!(image.detection.observations.is_empty());
        assert_eq!(image.detection.failure.expect("refused").code, Code::PlateContradicted);
    }
}

/// All lines of corners are seen where the border of the picture cuts the outer squares: a line that a sheet covers elsewhere is not missing.
#[test]
fn boards_whose_outer_squares_are_cut_vouch_for_a_covered_line() {
    let scene = |square: f64, angle: f64| Scene::new(9, 6, View::new(9, 6, [320.0, 240.0], square, angle, [0.0; 2]));
    let covered = scene(40.0, 0.02);
    let mut with_sheet = covered.render(0);
    let sheet_from = covered.corner(8)[0] - 20.0;
    for (k, pixel) in with_sheet.pixels.iter_mut().enumerate() {
        if (k % with_sheet.width) as f64 > sheet_from {
            *pixel = 120.0;
        }
    }
    let pictures = [scene(68.0, 0.0).render(0), scene(67.0, 0.01).render(1), with_sheet];
    let paths = ["one.png", "two.png", "covered.png"].map(std::path::PathBuf::from);
    let picture = |path: &std::path::Path| Ok(pictures[paths.iter().position(|p| p == path).expect("one")].clone());
    let found = detect_series(&paths, &plate(9, 6), picture, |_| {});
    let counts: Vec<usize> = found.iter().map(|image| image.detection.observations.len()).collect();
    assert!(counts[..2] == [54, 54] && (40..=48).contains(&counts[2]), "{counts:?} {:?}", found[2].detection.failure);
}
