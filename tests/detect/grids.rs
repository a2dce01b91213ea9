//! Grids of dots on rendered pictures: clipped paper, sharpening, noise, JPEG, distortion; without radii and without a table.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use image::codecs::jpeg::JpegEncoder;
use image::{GrayImage, Luma};
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use robotcal::Code;
use robotcal::detect::{Detection, Picture, SeriesImage, detect, detect_series};
use robotcal::series::{Edge, Observation, Plate, parse_plate};
use robotcal::simulate::conditions::Glare;

use crate::circles_support::{Scene, View, pose, scene};
use crate::said::assert_says;

const PITCH_M: f64 = 0.02;

fn grid(more: &str) -> Plate {
    let text = format!("format = 1\nkind = \"circle-grid\"\npitch_m = {PITCH_M}\n{more}\n");
    parse_plate(Path::new("plate.toml"), &text, "").unwrap()
}

/// The plate with all that is printed: usual dots, larger ones, and rings.
fn printed(plate: &Plate, large: &[u32], ringed: &[u32]) -> Plate {
    let mut plate = plate.clone();
    for m in &mut plate.markers {
        m.outer_radius_m = if large.contains(&m.id) { 0.4 } else { 0.24 } * PITCH_M;
        m.inner_radius_m = if ringed.contains(&m.id) { 0.5 * m.outer_radius_m } else { 0.0 };
    }
    plate
}

/// What happens to a picture between sensor and file.
#[derive(Debug, Clone, Copy)]
enum Spoiling {
    None,
    /// Unsharp mask of this amount and sigma.
    Sharpened(f64, f64),
    Jpeg(u8),
    /// Exposed so that the paper is at this multiple of full scale.
    Clipped(f64),
    ClippedAndSharpened,
    /// Barrel distortion.
    Distorted,
}

fn view(rng: &mut ChaCha8Rng, spoiling: Spoiling) -> View {
    let mut view = View {
        distance_m: rng.random_range(0.35..0.6),
        tilt_deg: rng.random_range(0.0..40.0),
        azimuth_deg: rng.random_range(0.0..360.0),
        roll_deg: rng.random_range(-40.0..40.0),
        aim_m: [rng.random_range(-0.01..0.01), rng.random_range(-0.01..0.01)],
        ..View::default()
    };
    match spoiling {
        Spoiling::Clipped(times) => view.conditions.exposure = times / view.conditions.light_reflectance,
        Spoiling::ClippedAndSharpened => view.conditions.exposure = 1.1 / view.conditions.light_reflectance,
        Spoiling::Distorted => view.distortion = [-0.3, 0.1, 0.0, 0.0, 0.0],
        _ => {}
    }
    view
}

fn spoil(picture: Picture, spoiling: Spoiling) -> Picture {
    match spoiling {
        Spoiling::Sharpened(amount, sigma) => sharpen(picture, amount, sigma),
        Spoiling::ClippedAndSharpened => sharpen(picture, 1.0, 1.0),
        Spoiling::Jpeg(quality) => jpeg(&picture, quality),
        _ => picture,
    }
}

/// The picture after a Gaussian of this sigma, px.
pub fn blurred(picture: &Picture, sigma: f64) -> Picture {
    let size = (picture.width as u32, picture.height as u32);
    let image = image::ImageBuffer::<Luma<f32>, _>::from_raw(size.0, size.1, picture.pixels.clone()).unwrap();
    let pixels = image::imageops::blur(&image, sigma as f32).into_raw();
    Picture { pixels, ..*picture }
}

pub fn sharpen(picture: Picture, amount: f64, sigma: f64) -> Picture {
    let blurred = blurred(&picture, sigma);
    let pairs = picture.pixels.iter().zip(&blurred.pixels);
    let pixels = pairs.map(|(v, b)| (v + amount as f32 * (v - b)).round().clamp(0.0, 255.0)).collect();
    Picture { pixels, ..picture }
}

pub fn jpeg(picture: &Picture, quality: u8) -> Picture {
    let bytes = picture.pixels.iter().map(|v| *v as u8).collect();
    let image = GrayImage::from_raw(picture.width as u32, picture.height as u32, bytes).unwrap();
    let mut file = Cursor::new(Vec::new());
    image.write_with_encoder(JpegEncoder::new_with_quality(&mut file, quality)).unwrap();
    let read = image::load_from_memory(&file.into_inner()).unwrap().into_luma8();
    Picture { pixels: read.as_raw().iter().map(|v| f32::from(*v)).collect(), ..*picture }
}

/// What came of many views.
#[derive(Debug, Default)]
struct Tally {
    dots: usize,
    found: usize,
    wrong: usize,
    mean: [f64; 2],
    square: f64,
    normalised: f64,
}

impl Tally {
    /// Takes up one picture; `turned` is the other id that a dot may have.
    fn add(&mut self, scene: &Scene, detection: &Detection, turned: &impl Fn(u32) -> u32) {
        self.dots += scene.plate.markers.len();
        let off = |id: u32, uv: [f64; 2]| {
            let truth = scene.centroid(scene.plate.index_of(id).unwrap(), Edge::Outer).unwrap();
            [uv[0] - truth.x, uv[1] - truth.y]
        };
        let outer: Vec<_> = detection.observations.iter().filter(|o| o.edge == Edge::Outer).collect();
        let far = |id: u32, uv: [f64; 2]| {
            let d = off(id, uv);
            d[0].hypot(d[1]) > 2.0
        };
        let upside_down = outer.first().is_some_and(|o| far(o.marker, o.uv));
        for o in outer {
            let id = if upside_down { turned(o.marker) } else { o.marker };
            if far(id, o.uv) {
                self.wrong += 1;
                continue;
            }
            let (d, c) = (off(id, o.uv), o.covariance.unwrap());
            self.found += 1;
            self.square += d[0] * d[0] + d[1] * d[1];
            self.normalised += d[0] * d[0] / c[0] + d[1] * d[1] / c[2];
            (0..2).for_each(|a| self.mean[a] += d[a]);
        }
    }

    fn report(&mut self, what: &str) {
        let n = self.found as f64;
        self.mean = self.mean.map(|m| m / n);
        let rms = (self.square / (2.0 * n)).sqrt();
        let normalised = (self.normalised / (2.0 * n)).sqrt();
        println!(
            "{what}: {} of {} dots, {} wrong, bias ({:.4}, {:.4}) px, rms {rms:.4} px, normalised error {normalised:.2}",
            self.found, self.dots, self.wrong, self.mean[0], self.mean[1]
        );
        (self.square, self.normalised) = (rms, normalised);
    }
}

fn run(stated: &Plate, print: &Plate, spoiling: Spoiling, views: u64, turned: impl Fn(u32) -> u32) -> Tally {
    let mut tally = Tally::default();
    for seed in 0..views {
        let view = view(&mut ChaCha8Rng::seed_from_u64(seed), spoiling);
        let scene = Scene { plate: print.clone(), camera_from_plate: pose(&view), ..scene(&view) };
        let picture = spoil(scene.render(seed), spoiling);
        match detect(&picture, stated) {
            Ok(detection) => tally.add(&scene, &detection, &turned),
            Err(error) => {
                println!("{spoiling:?} {seed}: {error}");
                tally.dots += print.markers.len();
            }
        }
    }
    tally.report(&format!("{spoiling:?}"));
    tally
}

/// Views of each kind; `VIEWS` asks for more.
fn views() -> u64 {
    std::env::var("VIEWS").ok().and_then(|v| v.parse().ok()).unwrap_or(3)
}

/// Normalised errors of spoilt pictures are below 1: what the model lacks of sharpened and clipped edges counts as noise.
#[test]
fn a_grid_with_one_larger_dot_is_found_however_the_picture_was_spoilt() {
    let stated = grid("columns = 10\nrows = 10");
    let print = printed(&stated, &[0], &[]);
    for (spoiling, normalised) in [
        (Spoiling::None, 0.85..1.15),
        (Spoiling::Distorted, 0.85..1.15),
        (Spoiling::Sharpened(1.0, 1.0), 0.3..1.15),
        (Spoiling::Jpeg(70), 0.6..1.3),
        (Spoiling::Clipped(1.2), 0.3..1.15),
        (Spoiling::ClippedAndSharpened, 0.3..1.15),
    ] {
        let tally = run(&stated, &print, spoiling, views(), |id| id);
        assert_eq!((tally.found, tally.wrong), (tally.dots, 0), "{spoiling:?}");
        assert!(tally.mean.iter().all(|m| m.abs() < 0.01), "{spoiling:?} {:?}", tally.mean);
        assert!(normalised.contains(&tally.normalised), "{spoiling:?} {}", tally.normalised);
    }
}

#[test]
fn plain_asymmetric_and_ringed_grids_need_no_radius() {
    let plain = grid("columns = 9\nrows = 6");
    let asymmetric = grid("columns = 4\nrows = 11\nasymmetric = true");
    let ringed = grid("columns = 9\nrows = 7\nlarge = [[4, 3], [5, 3], [4, 2]]");
    let found = grid("columns = 9\nrows = 7");
    for (stated, large, rings, turned) in [
        (&plain, vec![], vec![], 53),
        (&asymmetric, vec![], vec![], 0),
        (&ringed, vec![31, 32, 22], vec![22], 0),
        (&found, vec![0, 8], vec![0, 8], 0),
    ] {
        let turned = |id: u32| if turned > 0 { turned - id } else { id };
        let tally = run(stated, &printed(stated, &large, &rings), Spoiling::None, views(), turned);
        assert_eq!((tally.found, tally.wrong), (tally.dots, 0), "{large:?}");
        assert!((0.85..1.15).contains(&tally.normalised), "{large:?} {}", tally.normalised);
    }
}

/// Dots whose neighbours are more than nine radii away, down to ten pixels across; where the radius is stated, and where it is not.
#[test]
fn small_dots_far_apart_are_found() {
    for (keys, radius_m, turned) in [
        ("columns = 9\nrows = 7", 0.0021, 62),
        ("columns = 9\nrows = 7", 0.0014, 62),
        ("columns = 4\nrows = 11\nasymmetric = true", 0.0025, 0),
        ("columns = 4\nrows = 11\nasymmetric = true", 0.003, 0),
    ] {
        for stated in [grid(keys), grid(&format!("{keys}\nradius_m = {radius_m}"))] {
            let mut print = stated.clone();
            print.markers.iter_mut().for_each(|m| m.outer_radius_m = radius_m);
            let turned = |id: u32| if turned > 0 { turned - id } else { id };
            let tally = run(&stated, &print, Spoiling::None, views(), turned);
            assert_eq!((tally.found, tally.wrong), (tally.dots, 0), "{keys} {radius_m}");
            assert!((0.85..1.15).contains(&tally.normalised), "{keys} {radius_m} {}", tally.normalised);
        }
    }
}

/// The edge of a shadow makes dots beside it look larger: it turns no grid of equal dots, whether their radius is stated or not.
#[test]
fn the_edge_of_a_shadow_turns_no_grid_of_equal_dots() {
    for keys in ["radius_m = 0.0048", ""] {
        let stated = grid(&format!("columns = 11\nrows = 8\n{keys}"));
        let view = View { distance_m: 0.36, tilt_deg: 20.0, azimuth_deg: 50.0, roll_deg: 8.0, ..View::default() };
        let scene = Scene { plate: printed(&stated, &[], &[]), camera_from_plate: pose(&view), ..scene(&view) };
        let lit = scene.render(1);
        let (mut tally, mut seen) = (Tally::default(), 0);
        for begin_px in (350..1250).step_by(90) {
            let shade = |(k, v): (usize, &f32)| {
                let (x, y) = ((k % lit.width) as f64, (k / lit.width) as f64);
                let depth = ((0.8 * x + 0.5 * y - f64::from(begin_px)) / 2.0).clamp(0.0, 1.0);
                (f64::from(*v) * (1.0 - 0.65 * depth)).round() as f32
            };
            let picture = Picture { pixels: lit.pixels.iter().enumerate().map(shade).collect(), ..lit.clone() };
            // Too many dots may be lost beside the edge.
            let Ok(detection) = detect(&picture, &stated) else { continue };
            tally.add(&scene, &detection, &|id| id);
            let codes: Vec<Code> = detection.notices.iter().map(|n| n.code).collect();
            assert!(codes.contains(&Code::PlateSymmetric), "{keys} {begin_px}: {codes:?}");
            seen += 1;
        }
        tally.report(keys);
        assert!(seen >= 3 && tally.wrong == 0 && tally.found > 0, "{keys}: {seen} {tally:?}");
    }
}

/// The grid upside down, lit so that the light halves over the picture from left to right.
fn upside_down(stated: &Plate, large: &[u32]) -> (Scene, Picture) {
    let view = View { distance_m: 0.36, tilt_deg: 10.0, azimuth_deg: 50.0, roll_deg: 172.0, ..View::default() };
    let scene = Scene { plate: printed(stated, large, &[]), camera_from_plate: pose(&view), ..scene(&view) };
    let lit = scene.render(1);
    let columns = || (0..scene.plate.markers.len()).filter_map(|m| Some(scene.centroid(m, Edge::Outer)?.x));
    let (from, to) = (columns().fold(f64::INFINITY, f64::min), columns().fold(f64::NEG_INFINITY, f64::max));
    let shade = |(k, v): (usize, &f32)| {
        let share = (((k % lit.width) as f64 - from) / (to - from)).clamp(0.0, 1.0);
        (f64::from(*v) * (1.0 - 0.5 * share)).round() as f32
    };
    let picture = Picture { pixels: lit.pixels.iter().enumerate().map(shade).collect(), ..lit.clone() };
    (scene, picture)
}

/// Light that changes evenly is no edge of a shadow: the larger dots, which stand where it is weakest, turn the grid.
#[test]
fn larger_dots_turn_a_grid_on_which_the_light_falls_off() {
    for large in [&[0][..], &[12, 13]] {
        let stated = grid("columns = 11\nrows = 8");
        let (scene, picture) = upside_down(&stated, large);
        let detection = detect(&picture, &stated).unwrap();
        let mut tally = Tally::default();
        tally.add(&scene, &detection, &|id| id);
        assert_eq!((tally.found, tally.wrong), (tally.dots, 0), "{large:?}");
        assert_eq!(detection.circles.as_ref().unwrap().sizes.large, large);
        assert!(!detection.notices.iter().any(|n| n.code == Code::PlateSymmetric), "{:?}", detection.notices);
    }
}

/// The radius of all dots is stated, and two are larger: they are not passed over.
#[test]
fn larger_dots_that_are_not_stated_are_named() {
    let stated = grid("columns = 11\nrows = 8\nradius_m = 0.0048");
    for (large, codes) in
        [(&[12, 13][..], vec![Code::PlateSymmetric, Code::PlateContradicted]), (&[], vec![Code::PlateSymmetric])]
    {
        let detection = detect(&upside_down(&stated, large).1, &stated).unwrap();
        assert_eq!(detection.observations.len(), 88);
        let of_turn = |code: &Code| [Code::PlateSymmetric, Code::PlateContradicted].contains(code);
        assert_eq!(detection.notices.iter().map(|n| n.code).filter(of_turn).collect::<Vec<_>>(), codes);
    }
}

/// Bright dots on dark ground, as on glass in reflected light: measured where the dark ones are, and said.
#[test]
fn bright_dots_are_measured_in_the_negative() {
    let stated = grid("columns = 9\nrows = 7\nlarge = [[4, 3], [5, 3], [4, 2]]");
    let view = view(&mut ChaCha8Rng::seed_from_u64(3), Spoiling::None);
    let plate = printed(&stated, &[31, 32, 22], &[]);
    let picture = Scene { plate, camera_from_plate: pose(&view), ..scene(&view) }.render(1);
    let paths = [Path::new("1.png").to_path_buf()];
    let seen = |picture: &Picture| detect_series(&paths, &stated, |_| Ok(picture.clone()), |_| {}).remove(0).detection;
    let (dark, bright) = (seen(&picture), seen(&picture.clone().negative()));
    assert_eq!((dark.observations.len(), bright.observations.len()), (63, 63));
    for (a, b) in dark.observations.iter().zip(&bright.observations) {
        assert!(a.marker == b.marker && (0..2).all(|k| (a.uv[k] - b.uv[k]).abs() < 1e-3), "{a:?} {b:?}");
    }
    let codes = |of: &Detection| of.notices.iter().map(|n| n.code).collect::<Vec<_>>();
    assert_eq!((codes(&dark), codes(&bright)), (vec![], vec![Code::MarkersBright]));
}

/// The dot that tells the turn is hidden in one image: what is read there may be turned, and is not used.
#[test]
fn an_image_without_the_larger_dot_that_the_others_show_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let stated = grid("columns = 8\nrows = 6");
    let mut paths = Vec::new();
    let mut pictures = BTreeMap::new();
    for (seed, large) in [(0, &[5][..]), (1, &[5]), (2, &[]), (3, &[5])] {
        let view = view(&mut ChaCha8Rng::seed_from_u64(seed), Spoiling::None);
        let scene = Scene { plate: printed(&stated, large, &[]), camera_from_plate: pose(&view), ..scene(&view) };
        paths.push(folder.path().join(format!("{seed}.png")));
        pictures.insert(paths[paths.len() - 1].clone(), scene.render(seed));
    }
    let seen = detect_series(&paths, &stated, |path| Ok(pictures[path].clone()), |_| {});
    let failures: Vec<Option<Code>> = seen.iter().map(|i| i.detection.failure.as_ref().map(|f| f.code)).collect();
    assert_eq!(failures, [None, None, Some(Code::PlateTurnOpen), None]);
    assert_eq!(seen.iter().map(|i| i.detection.turn_open.len()).collect::<Vec<_>>(), [0, 0, 48, 0]);
    let sizes = &seen[0].detection.circles.as_ref().unwrap().sizes;
    assert_eq!(sizes.large.len(), 1);
    for (id, [outer, _]) in &sizes.radii_m {
        let printed = if sizes.large.contains(id) { 0.4 } else { 0.24 } * PITCH_M;
        assert!((outer / printed - 1.0).abs() < 0.06, "{id}: {outer} m for {printed}");
    }
}

/// Most images do not show the corner with the larger dot: they say nothing against those that do.
#[test]
fn images_that_cannot_show_the_larger_dot_do_not_outvote_those_that_do() {
    let stated = grid("columns = 8\nrows = 6");
    let paths: Vec<_> = (0..5).map(|seed| Path::new(&format!("{seed}.png")).to_path_buf()).collect();
    let picture = |seed: u64| {
        let mut plate = printed(&stated, &[0], &[]);
        plate.markers[0].outer_radius_m *= if seed < 2 { 1.0 } else { 0.0 };
        let view = view(&mut ChaCha8Rng::seed_from_u64(seed), Spoiling::None);
        Scene { plate, camera_from_plate: pose(&view), ..scene(&view) }.render(seed)
    };
    let number = |path: &Path| path.file_stem().unwrap().to_str().unwrap().parse().unwrap();
    let seen = detect_series(&paths, &stated, |path| Ok(picture(number(path))), |_| {});
    let counts: Vec<usize> = seen.iter().map(|i| i.detection.observations.len()).collect();
    assert_eq!(counts, [48, 48, 0, 0, 0]);
    let (seen, open) = seen.split_at(2);
    assert!(seen.iter().all(|i| i.detection.turn_open.is_empty()));
    for SeriesImage { detection, .. } in open {
        assert_eq!(detection.failure.as_ref().map(|f| f.code), Some(Code::PlateTurnOpen));
        assert_eq!(detection.turn_open.len(), 47);
    }
}

/// The same where the plate file states the larger dot: something hides it and its neighbours, and what is seen of the others is right up to a turn.
#[test]
fn an_image_that_hides_a_stated_larger_dot_is_right_up_to_a_turn() {
    let stated = grid("columns = 8\nrows = 6\nlarge = [[0, 0]]");
    let paths: Vec<_> = (0..3).map(|seed| Path::new(&format!("{seed}.png")).to_path_buf()).collect();
    let scene = |seed: u64| {
        let mut plate = printed(&stated, &[0], &[]);
        if seed == 2 {
            plate.markers[0].outer_radius_m = 0.24 * PITCH_M;
        }
        let view = view(&mut ChaCha8Rng::seed_from_u64(seed), Spoiling::None);
        Scene { plate, camera_from_plate: pose(&view), ..scene(&view) }
    };
    let number = |path: &Path| path.file_stem().unwrap().to_str().unwrap().parse().unwrap();
    let seen = detect_series(&paths, &stated, |path| Ok(scene(number(path)).render(number(path))), |_| {});
    assert_eq!(seen.iter().map(|i| i.detection.observations.len()).collect::<Vec<_>>(), [48, 48, 0]);
    let turn = stated.turns_of_places().remove(0);
    let shown = scene(2);
    let is_off = |id: &dyn Fn(u32) -> u32| {
        let off = |o: &Observation| {
            (shown.centroid(id(o.marker) as usize, Edge::Outer).unwrap() - Vector2::from(o.uv)).norm()
        };
        seen[2].detection.turn_open.iter().map(off).fold(0.0, f64::max)
    };
    assert_eq!(seen[2].detection.turn_open.len(), 48);
    assert!(is_off(&|id| id).min(is_off(&|id| turn.id(id))) < 0.5);
}

/// A speck on one image of a grid of equal dots is no larger dot, whether the others show all dots or not.
#[test]
fn a_dot_that_is_larger_in_one_image_alone_refuses_that_image() {
    let stated = grid("columns = 8\nrows = 6");
    let paths: Vec<_> = (0..5).map(|seed| Path::new(&format!("{seed}.png")).to_path_buf()).collect();
    for covered in [None, Some(10)] {
        let picture = |seed: u64| {
            let mut plate = printed(&stated, if seed == 4 { &[20] } else { &[] }, &[]);
            if let Some(covered) = covered {
                plate.markers[covered].outer_radius_m = 0.0;
            }
            let view = view(&mut ChaCha8Rng::seed_from_u64(seed), Spoiling::None);
            Scene { plate, camera_from_plate: pose(&view), ..scene(&view) }.render(seed)
        };
        let number = |path: &Path| path.file_stem().unwrap().to_str().unwrap().parse().unwrap();
        let seen = detect_series(&paths, &stated, |path| Ok(picture(number(path))), |_| {});
        let counts: Vec<usize> = seen.iter().map(|i| i.detection.observations.len()).collect();
        let whole = 48 - usize::from(covered.is_some());
        assert_eq!(counts, [whole, whole, whole, whole, 0]);
    }
}

/// The larger dot is not where plate.toml says: the outline leaves the turn open, and nothing settles it.
#[test]
fn a_larger_dot_in_another_place_than_stated_is_named() {
    let view = view(&mut ChaCha8Rng::seed_from_u64(0), Spoiling::None);
    let board = grid("columns = 8\nrows = 6");
    let scene = Scene { plate: printed(&board, &[1], &[]), camera_from_plate: pose(&view), ..scene(&view) };
    let picture = scene.render(0);
    for stated in ["columns = 8\nrows = 6\nlarge = [[3, 3]]", "columns = 6\nrows = 8\nlarge = [[1, 0]]"] {
        let error = detect(&picture, &grid(stated)).expect_err(stated);
        assert_says(&error, Code::PlateContradicted, &["large"]);
    }
    let found = detect(&picture, &grid("columns = 8\nrows = 6\nlarge = [[1, 0]]")).unwrap();
    assert!(found.notices.is_empty(), "{:?}", found.notices);
}

/// A grid of these dots in the middle of the picture.
fn shown(printed: &Plate, seed: u64, nearer: f64) -> Picture {
    let mut view = view(&mut ChaCha8Rng::seed_from_u64(seed), Spoiling::None);
    view.distance_m *= nearer;
    Scene { plate: printed.clone(), camera_from_plate: pose(&view), ..scene(&view) }.render(seed)
}

/// Ink that the light of a lamp brightens over the whole board, on paper that is clipped: a tenth of the contrast and more from dot to dot of
/// the far sides, and hardly anything over one dot.
#[test]
fn a_sheen_on_clipped_paper_costs_no_dot() {
    let stated = grid("columns = 10\nrows = 10");
    let print = printed(&stated, &[0], &[]);
    let mut tally = Tally::default();
    for seed in 0..views() {
        let mut view = view(&mut ChaCha8Rng::seed_from_u64(seed), Spoiling::Clipped(1.2));
        view.conditions.glare = vec![Glare { at_px: [800.0, 650.0], radius_px: 250.0, strength: 0.3 }];
        let scene = Scene { plate: print.clone(), camera_from_plate: pose(&view), ..scene(&view) };
        tally.add(&scene, &detect(&scene.render(seed), &stated).unwrap(), &|id| id);
    }
    tally.report("sheen");
    assert_eq!((tally.found, tally.wrong), (tally.dots, 0));
    assert!((0.2..1.15).contains(&tally.normalised), "{}", tally.normalised);
}

/// Every kind of grid beside those with a line more or fewer, in both directions: none passes for another.
#[test]
fn a_grid_of_another_size_is_named_by_what_is_seen() {
    const LARGE: &str = "large = [[0, 0]]";
    for (columns, rows, more) in [
        (9, 6, ""),
        (8, 8, ""),
        (10, 10, "large = [[0, 0]]"),
        (5, 4, LARGE),
        (4, 11, "asymmetric = true"),
        (5, 8, "asymmetric = true"),
    ] {
        let keys = |columns: u32, rows: u32| format!("columns = {columns}\nrows = {rows}\n{more}");
        let printed = printed(&grid(&keys(columns, rows)), if more == LARGE { &[0] } else { &[] }, &[]);
        let picture = shown(&printed, 0, 1.0);
        assert_eq!(detect(&picture, &grid(&keys(columns, rows))).unwrap().observations.len(), printed.markers.len());
        let sizes = [
            (columns - 1, rows),
            (columns + 1, rows),
            (columns, rows - 1),
            (columns, rows + 1),
            (columns + 2, rows + 1),
        ];
        let exchanged = (more == "asymmetric = true" && (columns, rows) == (4, 11)).then_some((rows, columns));
        for (c, r) in sizes.into_iter().chain(exchanged) {
            let error = detect(&picture, &grid(&keys(c, r))).expect_err("another size");
            assert_says(&error, Code::PlateContradicted, &["columns", "rows", &format!("{c} x {r}")]);
            // 5 dots in 8 shifted rows look like 4 in 10.
            let seen = [(columns, rows), (rows, columns), (rows / 2, 2 * columns)];
            let named = seen.iter().any(|(a, b)| error.what.contains(&format!("{a} x {b}")));
            assert!(named, "{columns} x {rows} {more} for {c} x {r}: {error}");
        }
    }
}

#[test]
fn shifted_rows_are_named_and_columns_and_rows_exchanged_are_a_quarter_turn() {
    let symmetric = shown(&printed(&grid("columns = 9\nrows = 6"), &[], &[]), 1, 1.0);
    let shifted = shown(&printed(&grid("columns = 4\nrows = 11\nasymmetric = true"), &[], &[]), 1, 1.0);
    assert_eq!(detect(&symmetric, &grid("columns = 6\nrows = 9")).unwrap().observations.len(), 54);
    let error = detect(&symmetric, &grid("columns = 4\nrows = 11\nasymmetric = true")).expect_err("no row is shifted");
    assert_says(&error, Code::PlateContradicted, &["asymmetric", "9 x 6"]);
    let error = detect(&shifted, &grid("columns = 9\nrows = 6")).expect_err("every other row is shifted");
    assert_says(&error, Code::PlateContradicted, &["asymmetric", "4 x 11"]);
}

#[test]
fn a_grid_that_the_border_cuts_does_not_tell_its_size() {
    let picture = shown(&printed(&grid("columns = 20\nrows = 20"), &[], &[]), 2, 0.35);
    for stated in ["columns = 20\nrows = 20", "columns = 21\nrows = 20", "columns = 14\nrows = 10"] {
        let error = detect(&picture, &grid(stated)).expect_err(stated);
        assert_eq!(error.code, Code::PlateIncomplete, "{error}");
    }
}

#[test]
fn a_halo_of_strong_sharpening_loses_no_grid() {
    let stated = grid("columns = 4\nrows = 11\nasymmetric = true");
    for spoiling in [Spoiling::Sharpened(1.5, 1.5), Spoiling::Sharpened(1.0, 2.5)] {
        let tally = run(&stated, &printed(&stated, &[], &[]), spoiling, views(), |id| 43 - id);
        assert_eq!((tally.found, tally.wrong), (tally.dots, 0), "{spoiling:?}");
    }
}

/// A larger dot at the wrong corner looks like a mirror: both are said.
#[test]
fn a_larger_dot_stated_at_the_wrong_corner_is_no_certain_mirror() {
    let printed = printed(&grid("columns = 9\nrows = 7"), &[0], &[]);
    let error =
        detect(&shown(&printed, 1, 1.0), &grid("columns = 9\nrows = 7\nlarge = [[8, 0]]")).expect_err("elsewhere");
    assert_says(&error, Code::PlateMirrored, &["large"]);
}
