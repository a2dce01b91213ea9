//! The image stage alone.
//!
//! `cargo bench --bench detect` times the detector on rendered pictures of the standard plate. With `DETECT_IMAGES` set to
//! a folder, it measures every `*.png` there without asking for identities (median of `DETECT_REPEATS`, default 5) and writes
//! `image,u,v` and `image,ms` to `markers.csv` and `times.csv` in that folder instead.

use std::error::Error;
use std::fmt::Write;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use criterion::Criterion;
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robotcal::detect::circles::{Options, detect, measure};
use robotcal::detect::{Picture, load};
use robotcal::geom::{Pose, matrix_from_rpy};
use robotcal::model::camera::{Camera, Lens};
use robotcal::plan::plate_design::{PlateRequest, design};
use robotcal::series::Plate;
use robotcal::simulate::conditions::ImagingConditions;
use robotcal::simulate::render::render;

type Fallible<T> = Result<T, Box<dyn Error>>;

/// The plate from so near, tilted by 20 degrees, that 450 of its markers are found.
fn picture(plate: &Plate, width: u32, height: u32) -> Picture {
    let mut camera = Camera::pinhole(Lens::Brown, width, height, 0.86 * f64::from(width));
    camera.parameters[4] = -0.08;
    let rotation = matrix_from_rpy([0.35, 0.0, 0.0]) * matrix_from_rpy([std::f64::consts::PI, 0.0, 0.1]);
    let pose = Pose::new(rotation, Vector3::new(0.0, 0.0, 0.389));
    render(plate, &camera, &pose, &ImagingConditions::default(), &mut ChaCha8Rng::seed_from_u64(1))
}

fn time_rendered() -> Fallible<()> {
    let plate = design(&PlateRequest::default())?.plate;
    let mut criterion = Criterion::default().measurement_time(Duration::from_secs(5));
    for (width, height) in [(1280, 1024), (2560, 2048)] {
        let picture = picture(&plate, width, height);
        let found = detect(&picture, &plate, &Options::default())?.found.len();
        let name = format!("detect {width}x{height}, {found} markers");
        criterion.bench_function(&name, |b| b.iter(|| detect(black_box(&picture), &plate, &Options::default())));
    }
    Ok(())
}

fn time_folder(folder: &Path) -> Fallible<()> {
    let repeats = std::env::var("DETECT_REPEATS").ok().and_then(|r| r.parse().ok()).unwrap_or(5_usize).max(1);
    let mut images: Vec<PathBuf> = std::fs::read_dir(folder)?.map(|e| Ok(e?.path())).collect::<Fallible<_>>()?;
    images.retain(|p| p.extension().is_some_and(|e| e == "png"));
    images.sort();
    let (mut markers, mut times) = ("image,u,v\n".to_owned(), "image,ms\n".to_owned());
    for path in &images {
        let picture = load(path, None)?;
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let mut spent = Vec::with_capacity(repeats);
        for round in 0..repeats {
            let start = Instant::now();
            let (measured, _) = measure(black_box(&picture), &Options::default());
            spent.push(start.elapsed().as_secs_f64() * 1e3);
            for m in measured.iter().filter(|_| round == 0) {
                let [u, v] = m.outer.ellipse.centre;
                writeln!(markers, "{name},{u:.6},{v:.6}")?;
            }
        }
        spent.sort_by(f64::total_cmp);
        writeln!(times, "{name},{:.3}", spent[repeats / 2])?;
    }
    std::fs::write(folder.join("markers.csv"), markers)?;
    std::fs::write(folder.join("times.csv"), times)?;
    Ok(())
}

fn main() -> Fallible<()> {
    match std::env::var_os("DETECT_IMAGES") {
        Some(folder) => time_folder(Path::new(&folder)),
        None => time_rendered(),
    }
}
