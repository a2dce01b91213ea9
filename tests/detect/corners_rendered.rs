//! Corners of rendered pictures from sharpened to defocused, against truth, the bound of Cramer and Rao, and the stated covariance.

#![allow(missing_docs, clippy::expect_used, clippy::panic)]

use crate::boards_scene::{Scene, View};
use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder};
use robotcal::detect::{Detection, Picture, detect, load_bytes};
use robotcal::series::{Plate, PlateKind};

const COLUMNS: u32 = 9;
const ROWS: u32 = 6;
const CORNERS: usize = (COLUMNS * ROWS) as usize;
/// Half the step between the squares, counts.
const CONTRAST: f64 = 50.0;

fn scene(square: f64, blur: f64, noise: f64, seed: u64) -> Scene {
    let side = (square * 12.0 + 50.0) as usize;
    let centre = [side as f64 / 2.0 + 0.3, side as f64 / 2.0 - 0.2];
    let tilt = [0.01 * square / 33.0, -0.008 * square / 33.0];
    let view = View::new(COLUMNS, ROWS, centre, square, 0.3 + 0.37 * seed as f64, tilt);
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

fn errors(scene: &Scene, detection: &Detection) -> Vec<[f64; 2]> {
    let error = |o: &robotcal::series::Observation| {
        let truth = scene.corner(o.marker);
        [o.uv[0] - truth[0], o.uv[1] - truth[1]]
    };
    detection.observations.iter().map(error).collect()
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
                let largest = errors(&scene, &detection).iter().map(|e| e[0].hypot(e[1])).fold(0.0, f64::max);
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
        let errors = errors(&scene, &detection);
        let rms = (errors.iter().map(|e| e[0] * e[0] + e[1] * e[1]).sum::<f64>() / (2 * CORNERS) as f64).sqrt();
        println!("blur {blur} px: {rms:.4} px");
        assert!(rms < 0.03, "blur {blur}: {rms}");
    }
}

/// Least sigma of a corner of squares of this side, px per axis: pixels of the window where the picture changes with the place of one edge.
fn bound(square: f64, blur: f64, noise: f64) -> f64 {
    let blur = blur.hypot((1.0_f64 / 12.0).sqrt());
    let reach = (0.4 * square).clamp(3.3, 16.0);
    // erf of the other edge, by the trapezium rule.
    let gauss = |t: f64| (-0.5 * (t / blur).powi(2)).exp() / (blur * std::f64::consts::TAU.sqrt());
    let erf = |t: f64| (0..200).map(|k| gauss((f64::from(k) + 0.5) / 200.0 * t)).sum::<f64>() * t / 100.0;
    let n = reach.floor() as i32;
    let pixels = (-n..=n).flat_map(|y| (-n..=n).map(move |x| (f64::from(x), f64::from(y))));
    let near = pixels.filter(|(x, y)| x.hypot(*y) <= reach.min(16.0));
    let information: f64 = near.map(|(x, y)| (CONTRAST * 2.0 * gauss(x) * erf(y)).powi(2)).sum();
    noise / information.sqrt()
}

/// Rms error, px; that over the bound; root of the mean normalised square.
fn with_noise(square: f64, blur: f64, noise: f64, seeds: u64) -> [f64; 3] {
    // Taken off the stated covariance: what real boards have beyond the noise.
    let systematic = 0.015_f64.powi(2);
    let (mut squares, mut normalised, mut count) = (0.0, 0.0, 0.0);
    for seed in 0..seeds {
        let scene = scene(square, blur, noise, seed);
        let detection = found(&scene.render(seed));
        assert_eq!(detection.observations.len(), CORNERS, "{square} {blur}: {:?}", detection.dropped);
        for (o, e) in detection.observations.iter().zip(errors(&scene, &detection)) {
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

/// SEEDS: pictures a line.
#[test]
#[ignore = "minutes"]
fn study_of_noise() {
    let seeds = std::env::var("SEEDS").ok().and_then(|s| s.parse().ok()).unwrap_or(20);
    println!("| square px | blur px | noise | rms px | of the bound | normalised square |\n|---|---|---|---|---|---|");
    for square in [6.0, 10.0, 20.0, 33.0, 60.0] {
        for blur in [0.3, 0.45, 0.6, 1.0, 2.0] {
            // The blur of a picture in which squares are told apart.
            if blur > square / 6.0 {
                continue;
            }
            for noise in [1.0, 3.0] {
                let [rms, ratio, normalised] = with_noise(square, blur, noise, seeds);
                println!("| {square} | {blur} | {noise} | {rms:.4} | {ratio:.2} | {:.2} |", normalised.powi(2));
            }
        }
    }
}
