//! Rendered pictures against the geometry that was put in.

use nalgebra::{Vector2, Vector3, Vector6};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robotcal::detect::Picture;
use robotcal::geom::{Pose, exp_so3};
use robotcal::model::camera::{Camera, Lens};
use robotcal::model::circle;
use robotcal::plan::plate_design::{PlateRequest, design};
use robotcal::series::{Marker, Plate, PlateKind};
use robotcal::simulate::conditions::ImagingConditions;
use robotcal::simulate::raster::PixelRect;
use robotcal::simulate::render::{render, render_window};

fn wide_camera() -> Camera {
    // 75 degrees across 1280 px.
    let mut camera = Camera::pinhole(Lens::Brown, 1280, 1024, 640.0 / 37.5_f64.to_radians().tan());
    camera.parameters[4..].copy_from_slice(&[-0.12, 0.02, 5e-4, -3e-4, 0.0]);
    camera
}

fn one_marker(outer: f64, inner: f64, at: [f64; 2]) -> Plate {
    let mut plate = Plate::lattice(PlateKind::CodedCircles, 1, 1, 0.018, 1e-4);
    plate.markers[0] = Marker {
        position_m: Vector3::new(at[0], at[1], 0.0),
        outer_radius_m: outer,
        inner_radius_m: inner,
        ..plate.markers[0]
    };
    plate
}

/// Area and centroid of an imaged circle by a polygon of many corners.
fn area_and_centroid(camera: &Camera, pose: &Pose, centre: &Vector3<f64>, radius: f64) -> (f64, Vector2<f64>) {
    let n = 4000;
    let corner = |k: usize| {
        let (s, c) = (std::f64::consts::TAU * k as f64 / n as f64).sin_cos();
        camera.project(&pose.transform(&(centre + Vector3::new(c, s, 0.0) * radius))).unwrap()
    };
    let (mut area, mut moment, origin) = (0.0, Vector2::zeros(), corner(0));
    for k in 0..n {
        let (a, b) = (corner(k) - origin, corner(k + 1) - origin);
        let cross = a.perp(&b);
        area += cross / 2.0;
        moment += (a + b) * cross / 6.0;
    }
    (area.abs(), origin + moment / area)
}

/// First moment of what is darker than the ground.
fn dark_centroid(picture: &Picture, window: &PixelRect, conditions: &ImagingConditions) -> (f64, Vector2<f64>) {
    let ground = conditions.exposure * conditions.light_reflectance * conditions.full_scale();
    let (mut mass, mut moment) = (0.0, Vector2::zeros());
    for y in 0..picture.height {
        for x in 0..picture.width {
            let dark = ground - f64::from(picture.at(x, y));
            mass += dark;
            moment += Vector2::new(x as f64, y as f64) * dark;
        }
    }
    (mass, moment / mass + Vector2::new(f64::from(window.x), f64::from(window.y)))
}

#[test]
fn noise_free_markers_lie_where_the_model_says() {
    let camera = wide_camera();
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut worst: f64 = 0.0;
    for (k, tilt_deg) in [0.0, 25.0, 45.0, 60.0].into_iter().enumerate() {
        for (uv, distance, sigma) in [
            ([640.0, 512.0], 0.3, 0.6),
            ([90.0, 80.0], 0.25, 0.8),
            ([1200.0, 700.0], 0.14, 1.2),
            ([700.0, 950.0], 0.45, 0.0),
        ] {
            let tilt = exp_so3(&Vector3::new(std::f64::consts::PI - f64::to_radians(tilt_deg), 0.0, 0.0));
            let turn = exp_so3(&Vector3::new(0.0, 0.0, 0.4 * k as f64));
            let ray = camera.ray(&Vector2::from(uv)).unwrap();
            // The tilt is that against the line of sight.
            let swing = nalgebra::Rotation3::rotation_between(&Vector3::z(), &ray).unwrap();
            let pose = Pose::new(swing.matrix() * turn * tilt, ray * distance);
            for (outer, inner) in [(0.0054, 0.0), (0.0036, 0.0), (0.0054, 0.0027), (0.0036, 0.0018)] {
                let plate = one_marker(outer, inner, [0.0, 0.0]);
                let centre = plate.markers[0].position_m;
                let (area, middle) = area_and_centroid(&camera, &pose, &centre, outer);
                let predicted = circle::centroid(&camera, &pose, &centre, outer).unwrap().uv;
                assert!((predicted - middle).norm() < 1e-5);
                let (hole, hole_middle) =
                    if inner > 0.0 { area_and_centroid(&camera, &pose, &centre, inner) } else { (0.0, middle) };
                let expected = (middle * area - hole_middle * hole) / (area - hole);
                let half = (area.sqrt() * 1.5) as i32 + 12;
                let window = PixelRect {
                    x: middle.x as i32 - half,
                    y: middle.y as i32 - half,
                    width: 2 * half as usize,
                    height: 2 * half as usize,
                };
                let conditions = ImagingConditions::ideal(sigma);
                let picture = render_window(&plate, &camera, &pose, &conditions, &window, &mut rng);
                let (_, found) = dark_centroid(&picture, &window, &conditions);
                let error = (found - expected).norm();
                worst = worst.max(error);
                assert!(error < 0.002, "tilt {tilt_deg} at {uv:?} radii {outer} {inner}: off by {error:.5} px");
            }
        }
    }
    println!("worst centroid error {worst:.6} px");
}

#[test]
fn an_illumination_gradient_moves_the_blurred_marker_by_gradient_times_variance() {
    // The light falls on the scene before the blur: f (1 + g x) blurred is f blurred, shifted by g s^2, times (1 + g x).
    let camera = Camera::pinhole(Lens::Brown, 200, 200, 1000.0);
    let pose = Pose::new(nalgebra::Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)), Vector3::new(0.0, 0.0, 0.5));
    let (gradient, sigma) = (0.005, 1.2);
    let conditions =
        ImagingConditions { exposure: 0.6, gradient_per_px: [gradient, 0.0], ..ImagingConditions::ideal(sigma) };
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let window = PixelRect { x: 80, y: 80, width: 40, height: 40 };
    let mut picture = render_window(&one_marker(0.005, 0.0, [0.0; 2]), &camera, &pose, &conditions, &window, &mut rng);
    for (k, value) in picture.pixels.iter_mut().enumerate() {
        *value /= (1.0 + gradient * (80.0 + (k % 40) as f64 - 99.5)) as f32;
    }
    let (_, found) = dark_centroid(&picture, &window, &conditions);
    let shift = gradient * (sigma * sigma + 1.0 / 12.0);
    // Counts of a column are rounded alike: 0.29 sqrt(40) 40 rows x 12 px over a mass of 1e7 counts is 1e-4 px.
    assert!((found.x - 99.5 + shift).abs() < 4e-4 && (found.y - 99.5).abs() < 4e-4, "{found} {shift}");
}

#[test]
fn a_window_is_a_piece_of_the_whole_and_seeds_repeat() {
    let plate = design(&PlateRequest { shape: Some((9, 7)), ..PlateRequest::default() }).unwrap().plate;
    let camera = wide_camera();
    let tilt = Pose::exp(&Vector6::new(0.0, 0.0, 0.0, 2.7, 0.1, 0.2));
    let pose = Pose::new(tilt.rotation, Vector3::new(0.01, 0.02, 0.2));
    let quiet = ImagingConditions {
        full_well_e: f64::INFINITY,
        vignetting: 0.2,
        gradient_per_px: [2e-4, 1e-4],
        bits: 12,
        ..ImagingConditions::default()
    };
    let picture = |c: &ImagingConditions, seed| render(&plate, &camera, &pose, c, &mut ChaCha8Rng::seed_from_u64(seed));
    let whole = picture(&quiet, 1);
    let window = PixelRect { x: 301, y: 203, width: 150, height: 90 };
    let part = render_window(&plate, &camera, &pose, &quiet, &window, &mut ChaCha8Rng::seed_from_u64(1));
    for y in 0..window.height {
        for x in 0..window.width {
            // f32 sums in another order may round to the neighbouring count.
            let (a, b) = (part.at(x, y), whole.at(x + 301, y + 203));
            assert!((a - b).abs() <= 1.0, "({x}, {y}): {a} {b}");
        }
    }
    let noisy = ImagingConditions::default();
    assert_eq!(picture(&noisy, 3).pixels, picture(&noisy, 3).pixels);
    assert_ne!(picture(&noisy, 3).pixels, picture(&noisy, 4).pixels);
}

#[test]
fn noise_and_contrast_are_those_asked_for() {
    let camera = Camera::pinhole(Lens::Brown, 300, 300, 1000.0);
    let pose = Pose::new(nalgebra::Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)), Vector3::new(0.0, 0.0, 0.5));
    let conditions = ImagingConditions { bits: 12, ..ImagingConditions::ideal(0.8) }.with_contrast_to_noise(40.0);
    let plate = one_marker(0.03, 0.0, [0.0; 2]);
    let picture = render(&plate, &camera, &pose, &conditions, &mut ChaCha8Rng::seed_from_u64(9));
    let statistics = |x0: usize, y0: usize| {
        let values: Vec<f64> = (0..3600).map(|k| f64::from(picture.at(x0 + k % 60, y0 + k / 60))).collect();
        let mean = values.iter().sum::<f64>() / 3600.0;
        (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 3599.0).sqrt())
    };
    let ((light, noise), (dark, _)) = (statistics(5, 5), statistics(120, 120));
    let ratio = (light - dark) / noise;
    // The sample sigma of 3600 pixels is right to 1.2 % (1 sigma).
    assert!((ratio / 40.0 - 1.0).abs() < 0.05, "{ratio}");
    assert!((light / 4095.0 - conditions.exposure * conditions.light_reflectance).abs() < 2e-3);
}

#[test]
fn a_chessboard_has_its_corners_where_the_model_says() {
    let plate = Plate::lattice(PlateKind::Chessboard, 7, 5, 0.02, 1e-4);
    let camera = wide_camera();
    let tilt = Pose::exp(&Vector6::new(0.0, 0.0, 0.0, 2.8, 0.0, 0.1));
    let pose = Pose::new(tilt.rotation, Vector3::new(0.0, 0.0, 0.2));
    let conditions = ImagingConditions::ideal(0.0);
    let picture = render(&plate, &camera, &pose, &conditions, &mut ChaCha8Rng::seed_from_u64(1));
    for marker in &plate.markers {
        let at = |dx: f64, dy: f64| {
            let x = marker.position_m + Vector3::new(dx, dy, 0.0) * 0.002;
            let uv = camera.project(&pose.transform(&x)).unwrap();
            picture.at(uv.x.round() as usize, uv.y.round() as usize) / picture.full_scale
        };
        // First square dark at the top-left, so the four quadrants around corner (0, 0) are dark, light, light, dark.
        let dark_first = (marker.id / 7 + marker.id % 7) % 2 == 0;
        let (tl, tr, bl, br) = (at(-1.0, 1.0), at(1.0, 1.0), at(-1.0, -1.0), at(1.0, -1.0));
        let (dark, light) = if dark_first { ([tl, br], [tr, bl]) } else { ([tr, bl], [tl, br]) };
        assert!(dark.iter().all(|v| *v < 0.2) && light.iter().all(|v| *v > 0.6), "corner {}", marker.id);
    }
}

/// Central moments of what is darker than the ground: variance along u and v, and skewness along u, px.
fn spread(conditions: &ImagingConditions) -> (f64, f64, f64) {
    let camera = Camera::pinhole(Lens::Brown, 400, 300, 1000.0);
    // In the right half of the image, where coma points to the right.
    let pose =
        Pose::new(nalgebra::Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)), Vector3::new(0.06, 0.0, 0.5));
    let window = PixelRect { x: 289, y: 119, width: 61, height: 61 };
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let picture = render_window(&one_marker(0.004, 0.0, [0.0; 2]), &camera, &pose, conditions, &window, &mut rng);
    let (mass, middle) = dark_centroid(&picture, &window, conditions);
    // Coma and motion are centred on their mean.
    assert!((middle - Vector2::new(199.5 + 120.0, 149.5)).norm() < 3e-3, "{middle}");
    let ground = conditions.exposure * conditions.light_reflectance * conditions.full_scale();
    let mut moments = (0.0, 0.0, 0.0);
    for y in 0..61 {
        for x in 0..61 {
            let dark = (ground - f64::from(picture.at(x, y))) / mass;
            let (du, dv) = (289.0 + x as f64 - middle.x, 119.0 + y as f64 - middle.y);
            moments.0 += dark * du * du;
            moments.1 += dark * dv * dv;
            moments.2 += dark * du * du * du;
        }
    }
    moments
}

#[test]
fn blur_defocus_motion_and_coma_spread_the_light_as_they_say() {
    // A disc of 8 px radius has a variance of r^2 / 4; pixels and blurs add theirs.
    let disc = 16.0 + 1.0 / 12.0;
    let base = ImagingConditions::ideal(0.7);
    let near = |value: f64, expected: f64| (value - expected).abs() < 0.02;
    let (u, v, _) = spread(&base);
    assert!(near(u, disc + 0.49) && near(v, disc + 0.49), "{u} {v}");
    // Defocus of 2 px m times |1 / 0.5 - 1 / 0.8| per metre is 1.5 px.
    let (u, v, _) = spread(&ImagingConditions { focus_m: Some(0.8), defocus_px_m: 2.0, ..base.clone() });
    assert!(near(u, disc + 0.49 + 2.25) && near(v, disc + 0.49 + 2.25), "{u} {v}");
    // 3 mm of motion along x at 0.5 m and 1000 px is an even smear of 6 px: 36 / 12 less the steps of the 12 instants.
    let (u, v, _) = spread(&ImagingConditions { motion: [0.003, 0.0, 0.0, 0.0, 0.0, 0.0], ..base.clone() });
    assert!((u - disc - 0.49 - 3.0).abs() < 0.05 && near(v, disc + 0.49), "{u} {v}");
    // A tail of 3 px at the corner is 1.44 px here: skewed to the right, at the same centroid.
    let (_, _, skew) = spread(&ImagingConditions { coma_px: 3.0, ..base.clone() });
    let (_, _, even) = spread(&base);
    assert!(even.abs() < 0.02 && skew > 0.1, "{even} {skew}");
}

#[test]
fn occluders_cover_glare_saturates_and_vignetting_darkens_the_corner() {
    use robotcal::simulate::conditions::{Glare, Occluder};
    let camera = Camera::pinhole(Lens::Brown, 300, 200, 800.0);
    let pose = Pose::new(nalgebra::Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)), Vector3::new(0.0, 0.0, 0.2));
    let conditions = ImagingConditions {
        vignetting: 0.4,
        glare: vec![Glare { at_px: [220.0, 60.0], radius_px: 8.0, strength: 1.5 }],
        occluders: vec![Occluder {
            outline_px: vec![[40.0, 120.0], [90.0, 120.0], [90.0, 170.0], [40.0, 170.0]],
            reflectance: 0.3,
        }],
        ..ImagingConditions::ideal(0.8)
    };
    let picture =
        render(&one_marker(0.003, 0.0, [0.0; 2]), &camera, &pose, &conditions, &mut ChaCha8Rng::seed_from_u64(0));
    let at = |x: usize, y: usize| f64::from(picture.at(x, y)) / 65535.0;
    let fall_off =
        |x: f64, y: f64| 1.0 - 0.4 * ((x - 149.5).powi(2) + (y - 99.5).powi(2)) / (149.5 * 149.5 + 99.5 * 99.5);
    assert!((at(65, 145) - 0.85 * 0.3 * fall_off(65.0, 145.0)).abs() < 1e-4);
    assert!((at(0, 0) - 0.85 * 0.85 * 0.6).abs() < 1e-4);
    assert!((at(220, 60) - 1.0).abs() < 1e-9);
    assert!((at(149, 99) - 0.85 * 0.06 * fall_off(149.0, 99.0)).abs() < 1e-4);
}

#[test]
fn the_plate_ends_where_its_sheet_ends_even_when_it_reaches_behind_the_camera() {
    // A view along the plate at grazing incidence: near edge of the sheet behind the camera, far edge in the image.
    let plate = design(&PlateRequest::default()).unwrap().plate;
    let camera = wide_camera();
    let tilt = exp_so3(&Vector3::new(std::f64::consts::PI - 1.1, 0.0, 0.0));
    let pose = Pose::new(tilt, Vector3::new(0.0, 0.0, 0.15));
    let conditions = ImagingConditions { table_reflectance: 0.3, ..ImagingConditions::ideal(0.5) };
    let picture = render(&plate, &camera, &pose, &conditions, &mut ChaCha8Rng::seed_from_u64(0));
    let plate_from_camera = pose.inverse();
    let mut checked = [0; 2];
    for (x, y) in (10..1270).step_by(30).flat_map(|x| (10..1014).step_by(30).map(move |y| (x, y))) {
        let Some(ray) = camera.ray(&Vector2::new(f64::from(x), f64::from(y))) else { continue };
        let direction = plate_from_camera.rotation * ray;
        let t = -plate_from_camera.translation.z / direction.z;
        let hit = plate_from_camera.translation + direction * t;
        let beside = |v: f64, half: f64| (v.abs() - half).abs() < 0.02;
        if t > 3.0 || beside(hit.x, 0.297) || beside(hit.y, 0.21) {
            continue;
        }
        let on_sheet = t > 0.0 && hit.x.abs() < 0.297 && hit.y.abs() < 0.21;
        let in_field = hit.x.abs() < 0.26 && hit.y.abs() < 0.17;
        let value = f64::from(picture.at(x as usize, y as usize)) / 65535.0;
        if !(on_sheet && in_field) {
            let expected = 0.85 * if on_sheet { 0.85 } else { 0.3 };
            assert!((value - expected).abs() < 1e-3, "({x}, {y}): {value} {expected}");
            checked[usize::from(on_sheet)] += 1;
        }
    }
    assert!(checked.iter().all(|c| *c > 5), "{checked:?}");
}
