//! Corners of rendered pictures from sharpened to defocused, against truth, the bound of Cramer and Rao, and the stated covariance.

use crate::boards_scene::{Scene, View, errors};
use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder};
use robotcal::detect::{Detection, Picture, detect, load_bytes};
use robotcal::series::{Plate, PlateKind};

const COLUMNS: u32 = 9;
const ROWS: u32 = 6;
const CORNERS: usize = (COLUMNS * ROWS) as usize;
/// Half the step between the squares, counts.
const CONTRAST: f64 = 50.0;

/// How the board of a picture is turned, rad.
fn turn(seed: u64) -> f64 {
    0.3 + 0.37 * seed as f64
}

fn scene(square: f64, blur: f64, noise: f64, seed: u64) -> Scene {
    let side = (square * 12.0 + 50.0) as usize;
    let centre = [side as f64 / 2.0 + 0.3, side as f64 / 2.0 - 0.2];
    let tilt = [0.01 * square / 33.0, -0.008 * square / 33.0];
    let view = View::new(COLUMNS, ROWS, centre, square, turn(seed), tilt);
    let levels = Scene {
        size: (side, side),
        dark: 110.0 - CONTRAST,
        light: 110.0 + CONTRAST,
        ..Scene::new(COLUMNS, ROWS, view)
    };
    Scene { blur, noise, ..levels }
}

fn found(picture: &Picture) -> Detection {
    let plate = Plate::lattice(PlateKind::Chessboard, COLUMNS, ROWS, 0.01, 1e-4);
    detect(picture, &plate).unwrap_or_else(|error| panic!("{error}"))
}

/// Unsharp mask: the picture plus `amount` times what a Gaussian of `sigma` px takes away, in whole counts.
fn sharpened(picture: &Picture, amount: f64, sigma: f64) -> Picture {
    let reach = (4.0 * sigma).ceil() as isize;
    let weight = |k: isize| (-0.5 * (k as f64 / sigma).powi(2)).exp();
    let total: f64 = (-reach..=reach).map(weight).sum();
    let blurred = |source: &[f64], dx: usize, dy: usize| -> Vec<f64> {
        let at = |k: usize, offset: isize| {
            let clamp = |c: usize, step: usize, size: usize| {
                (c as isize + step as isize * offset).clamp(0, size as isize - 1) as usize
            };
            let (x, y) = (clamp(k % picture.width, dx, picture.width), clamp(k / picture.width, dy, picture.height));
            source[y * picture.width + x]
        };
        (0..source.len()).map(|k| (-reach..=reach).map(|o| weight(o) / total * at(k, o)).sum()).collect()
    };
    let raw: Vec<f64> = picture.pixels.iter().map(|&p| f64::from(p)).collect();
    let smooth = blurred(&blurred(&raw, 1, 0), 0, 1);
    let sharp = |(raw, smooth): (&f64, &f64)| (raw + amount * (raw - smooth)).round().clamp(0.0, 255.0) as f32;
    Picture { pixels: raw.iter().zip(&smooth).map(sharp).collect(), ..picture.clone() }
}

pub fn compressed(picture: &Picture, quality: u8) -> Picture {
    let bytes: Vec<u8> = picture.pixels.iter().map(|&p| p as u8).collect();
    let mut file = Vec::new();
    let size = (picture.width as u32, picture.height as u32);
    JpegEncoder::new_with_quality(&mut file, quality)
        .write_image(&bytes, size.0, size.1, ExtendedColorType::L8)
        .expect("a JPEG");
    load_bytes("rendered.jpg".as_ref(), &file, None).expect("a picture")
}

#[test]
fn sharpening_neither_loses_nor_moves_corners() {
    for square in [10.0, 20.0, 33.0] {
        for blur in [0.3, 0.6, 1.0] {
            for (amount, sigma) in [(1.0, 0.7), (1.5, 1.5)] {
                let scene = scene(square, blur, 0.0, 0);
                let detection = found(&sharpened(&scene.render(0), amount, sigma));
                let case = format!("squares of {square} px, blur {blur} px, sharpened {amount} at {sigma} px");
                assert_eq!(detection.observations.len(), CORNERS, "{case}: {:?}", detection.dropped);
                let largest =
                    errors(&detection, |id| scene.corner(id)).iter().map(|e| e[0].hypot(e[1])).fold(0.0, f64::max);
                println!("{case}: {largest:.4} px");
                assert!(largest < 0.02, "{case}: {largest}");
            }
        }
    }
}

#[test]
fn compressed_pictures_keep_their_corners() {
    for blur in [0.3, 1.0] {
        let scene = scene(33.0, blur, 2.0, 1);
        let detection = found(&compressed(&sharpened(&scene.render(1), 1.0, 0.7), 70));
        assert_eq!(detection.observations.len(), CORNERS, "blur {blur}: {:?}", detection.dropped);
        let errors = errors(&detection, |id| scene.corner(id));
        let rms = (errors.iter().map(|e| e[0] * e[0] + e[1] * e[1]).sum::<f64>() / (2 * CORNERS) as f64).sqrt();
        println!("blur {blur} px: {rms:.4} px");
        assert!(rms < 0.03, "blur {blur}: {rms}");
    }
}

/// Reach of the window of a corner along its edges, px, and its largest radius.
fn window(square: f64) -> [f64; 2] {
    [(0.4 * square).clamp(3.3, 16.0), 16.0]
}

/// Least sigma of a corner of squares of this side by the pixels of its window, px per axis, with all else known: what the picture changes with
/// the place of one edge. The integral over the window is the mean, over the places of a corner in its pixel, of the sum over pixels; for edges of
/// less than half a pixel that sum is a third more where an edge runs along the middle of a row than on average. Rounding to whole counts adds
/// 1/12 to the variance.
fn bound(square: f64, blur: f64, noise: f64) -> f64 {
    const STEP: f64 = 0.125;
    let blur = blur.hypot((1.0_f64 / 12.0).sqrt());
    let [reach, radius] = window(square);
    // erf of the other edge, by the trapezium rule.
    let gauss = |t: f64| (-0.5 * (t / blur).powi(2)).exp() / (blur * std::f64::consts::TAU.sqrt());
    let erf = |t: f64| (0..200).map(|k| gauss((f64::from(k) + 0.5) / 200.0 * t)).sum::<f64>() * t / 100.0;
    let n = (reach / STEP) as i32;
    let gauss_of: Vec<f64> = (-n..=n).map(|k| gauss(f64::from(k) * STEP)).collect();
    let erf_of: Vec<f64> = (-n..=n).map(|k| erf(f64::from(k) * STEP)).collect();
    let near = |k: usize, l: usize| (k as f64 - f64::from(n)).hypot(l as f64 - f64::from(n)) * STEP <= radius;
    let places = (0..gauss_of.len()).flat_map(|k| (0..erf_of.len()).map(move |l| (k, l)));
    let slope = |(k, l): (usize, usize)| CONTRAST * 2.0 * gauss_of[k] * erf_of[l] * STEP;
    let information: f64 = places.filter(|&(k, l)| near(k, l)).map(|place| slope(place).powi(2)).sum();
    noise.hypot((1.0_f64 / 12.0).sqrt()) / information.sqrt()
}

/// The same from rendered pictures alone: by how much each pixel of the windows changes where the board is moved.
fn bound_of_pictures(square: f64, blur: f64, noise: f64, seeds: u64) -> f64 {
    const MOVED_PX: f64 = 0.02;
    const COUNTS: f64 = 1e6;
    let [reach, radius] = window(square);
    let (mut variance, mut count) = (0.0, 0.0);
    for seed in 0..seeds {
        let scene = Scene { dark: 0.0, light: COUNTS, full_scale: COUNTS, ..scene(square, blur, 0.0, seed) };
        let moved = |[x, y]: [f64; 2]| {
            let [a, b, c] = scene.view.0;
            let row = |row: [f64; 3], by: f64| [row[0] + by * c[0], row[1] + by * c[1], row[2] + by * c[2]];
            Scene { view: View([row(a, x), row(b, y), c]), ..scene.clone() }.render(0)
        };
        let pairs = [[MOVED_PX, 0.0], [0.0, MOVED_PX]].map(|by| [moved(by), moved(by.map(|c| -c))]);
        let slope = |axis: usize, k: usize| {
            let [after, before] = &pairs[axis];
            f64::from(after.pixels[k] - before.pixels[k]) / (2.0 * MOVED_PX) * 2.0 * CONTRAST / COUNTS
        };
        for marker in 0..CORNERS as u32 {
            let at = scene.corner(marker);
            let (sin, cos) = turn(seed).sin_cos();
            let mut information = [0.0; 3];
            for k in 0..scene.size.0 * scene.size.1 {
                let (x, y) = ((k % scene.size.0) as f64 - at[0], (k / scene.size.0) as f64 - at[1]);
                let (p, q) = (x * cos + y * sin, y * cos - x * sin);
                if p.abs().max(q.abs()) <= reach && x.hypot(y) <= radius {
                    let [u, v] = [slope(0, k), slope(1, k)];
                    information = [information[0] + u * u, information[1] + u * v, information[2] + v * v];
                }
            }
            let [uu, uv, vv] = information;
            variance += (noise * noise + 1.0 / 12.0) * 0.5 * (uu + vv) / (uu * vv - uv * uv);
            count += 1.0;
        }
    }
    f64::sqrt(variance / count)
}

#[test]
fn the_bound_is_that_of_the_pixels() {
    for (square, blur) in [(6.0, 0.6), (10.0, 0.3), (20.0, 0.3), (20.0, 0.45), (20.0, 1.0)] {
        let (told, seen) = (bound(square, blur, 1.0), bound_of_pictures(square, blur, 1.0, 3));
        println!("squares of {square} px, blur {blur} px: {told:.5} px, by pictures {seen:.5} px");
        assert!((told / seen - 1.0).abs() < 0.05, "{square} {blur}: {told} {seen}");
    }
}

/// Rounding costs as much as noise of variance 1/12: what a rounded pixel says of its mean, over all places of the mean between two counts.
#[test]
fn rounding_adds_a_twelfth_to_the_variance() {
    for noise in [1.0, 3.0] {
        let gauss = |t: f64| (-0.5 * t * t / (noise * noise)).exp() / (noise * std::f64::consts::TAU.sqrt());
        // Mean of a function over a count.
        let mean = |from: f64, of: &dyn Fn(f64) -> f64| {
            (0..50).map(|k| of(from + (f64::from(k) + 0.5) / 50.0)).sum::<f64>() / 50.0
        };
        let information = |place: f64| -> f64 {
            let one = |count: i32| {
                let from = f64::from(count) - 0.5 - place;
                (gauss(from + 1.0) - gauss(from)).powi(2) / mean(from, &gauss)
            };
            (-20..=20).map(one).sum()
        };
        let variance = 1.0 / mean(0.0, &information);
        assert!((variance - noise * noise - 1.0 / 12.0).abs() < 1e-3, "{noise}: {variance}");
    }
}

/// What a camera does to its picture.
type Spoilt = fn(&Picture) -> Picture;

/// Rms error, px; that over the bound; root of the mean normalised square.
fn with_noise(square: f64, blur: f64, noise: f64, seeds: u64) -> [f64; 3] {
    with_spoilt_noise(square, blur, noise, seeds, Picture::clone)
}

/// The same of pictures that the camera has spoilt.
fn with_spoilt_noise(square: f64, blur: f64, noise: f64, seeds: u64, spoilt: Spoilt) -> [f64; 3] {
    // Taken off the stated covariance: what real boards have beyond the noise.
    let systematic = 0.015_f64.powi(2);
    let (mut squares, mut normalised, mut count) = (0.0, 0.0, 0.0);
    for seed in 0..seeds {
        let scene = scene(square, blur, noise, seed);
        let detection = found(&spoilt(&scene.render(seed)));
        assert_eq!(detection.observations.len(), CORNERS, "{square} {blur}: {:?}", detection.dropped);
        for (o, e) in detection.observations.iter().zip(errors(&detection, |id| scene.corner(id))) {
            let [uu, uv, vv] = o.covariance.expect("a covariance");
            let (uu, vv) = (uu - systematic, vv - systematic);
            squares += (e[0] * e[0] + e[1] * e[1]) / 2.0;
            normalised += (e[0] * e[0] * vv - 2.0 * e[0] * e[1] * uv + e[1] * e[1] * uu) / (uu * vv - uv * uv) / 2.0;
            count += 1.0;
        }
    }
    let rms = f64::sqrt(squares / count);
    [rms, rms / bound(square, blur, noise), f64::sqrt(normalised / count)]
}

#[test]
fn noise_costs_little_more_than_it_must_and_is_stated() {
    let cases = [(6.0, 0.6), (10.0, 0.6), (20.0, 0.3), (20.0, 1.0), (33.0, 0.6), (33.0, 2.0)];
    for (square, blur) in cases {
        let [rms, ratio, normalised] = with_noise(square, blur, 3.0, 5);
        println!(
            "squares of {square} px, blur {blur} px: {rms:.4} px, {ratio:.2} of the bound, normalised {normalised:.2}"
        );
        assert!(ratio < 1.3, "{square} {blur}: {ratio} of the bound");
        // 1 +- 0.05 (0.9 to 1.1 squared), and 3 / sqrt(2 * 5 * 2 * 54) by chance.
        assert!((normalised - 1.0).abs() < 0.05 + 0.09, "{square} {blur}: {normalised}");
    }
}

/// SEEDS: pictures a line of a study.
fn seeds_asked() -> u64 {
    std::env::var("SEEDS").ok().and_then(|s| s.parse().ok()).unwrap_or(20)
}

#[test]
#[ignore = "minutes"]
fn study_of_noise() {
    let seeds = seeds_asked();
    println!("| square px | blur px | noise | rms px | of the bound | normalised error |\n|---|---|---|---|---|---|");
    for square in [6.0, 10.0, 20.0, 33.0, 60.0] {
        for blur in [0.3, 0.45, 0.6, 1.0, 2.0] {
            // The blur of a picture in which squares are told apart.
            if blur > square / 6.0 {
                continue;
            }
            for noise in [1.0, 3.0] {
                let [rms, ratio, normalised] = with_noise(square, blur, noise, seeds);
                println!("| {square} | {blur} | {noise} | {rms:.4} | {ratio:.2} | {normalised:.2} |");
            }
        }
    }
}

/// Noise of cameras that sharpen or compress: neighbouring pixels have it in common.
const SPOILT: [(&str, Spoilt); 4] = [
    ("sharpened 1.0 at 0.7 px", |p| sharpened(p, 1.0, 0.7)),
    ("sharpened 1.5 at 1.5 px", |p| sharpened(p, 1.5, 1.5)),
    ("JPEG 70", |p| compressed(p, 70)),
    ("sharpened 1.0 at 0.7 px, JPEG 70", |p| compressed(&sharpened(p, 1.0, 0.7), 70)),
];

/// Sharpening takes from the noise what neighbouring pixels have in common: taken as white, it makes the stated sigmas a fifth to a third too
/// large here.
#[test]
fn noise_that_was_sharpened_is_stated_as_it_is() {
    for (square, blur, (name, spoilt)) in [(6.0, 0.6, SPOILT[0]), (20.0, 1.0, SPOILT[0]), (10.0, 1.0, SPOILT[1])] {
        let [rms, _, normalised] = with_spoilt_noise(square, blur, 3.0, 5, spoilt);
        println!("squares of {square} px, blur {blur} px, {name}: {rms:.4} px, normalised {normalised:.2}");
        assert!((normalised - 1.0).abs() < 0.05 + 0.09, "{square} {blur} {name}: {normalised}");
    }
}

#[test]
#[ignore = "minutes"]
fn study_of_correlated_noise() {
    let seeds = seeds_asked();
    println!("| picture | square px | blur px | noise | rms px | normalised error |\n|---|---|---|---|---|---|");
    for (name, spoilt) in SPOILT {
        for square in [6.0, 10.0, 20.0, 33.0, 60.0] {
            for blur in [0.3, 0.6, 1.0].into_iter().filter(|blur| *blur <= square / 6.0) {
                for noise in [1.0, 3.0] {
                    let [rms, _, normalised] = with_spoilt_noise(square, blur, noise, seeds, spoilt);
                    println!("| {name} | {square} | {blur} | {noise} | {rms:.4} | {normalised:.2} |");
                }
            }
        }
    }
}

/// Without noise, by the angle between the edges and the rows of pixels: what the model of an edge lacks.
#[test]
#[ignore = "a minute"]
fn study_of_boards_along_the_rows() {
    println!("| turn deg | blur 0.3 px: rms px | 0.45 px | 0.6 px |\n|---|---|---|---|");
    for degrees in [0.0_f64, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0] {
        let rms = [0.3, 0.45, 0.6].map(|blur| {
            let (mut squares, mut count) = (0.0, 0.0);
            for place in 0..10 {
                let centre = [226.3 + 0.1 * f64::from(place), 225.7 + 0.37 * f64::from(place)];
                let view = View::new(COLUMNS, ROWS, centre, 33.07, degrees.to_radians(), [0.0; 2]);
                let scene = Scene { view, ..scene(33.0, blur, 0.0, 0) };
                for e in errors(&found(&scene.render(0)), |id| scene.corner(id)) {
                    squares += (e[0] * e[0] + e[1] * e[1]) / 2.0;
                    count += 1.0;
                }
            }
            f64::sqrt(squares / count)
        });
        println!("| {degrees} | {:.4} | {:.4} | {:.4} |", rms[0], rms[1], rms[2]);
    }
}
