//! Image files, flat-field correction and whole series: what is read, and what is said about files that cannot be.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::said::assert_says;
use image::{DynamicImage, GrayImage, ImageBuffer, Luma, Rgb};
use robotcal::Code;
use robotcal::Error;
use robotcal::detect::{FlatField, Picture, detect_series, load, load_bytes};
use robotcal::series::{Plate, PlateKind};

use crate::boards_scene::{Scene, View};

fn ramp(x: u32, y: u32) -> u16 {
    (x * 700 + y * 90) as u16
}

fn refused(path: &Path, bits: Option<u32>) -> Error {
    let error = load(path, bits).expect_err("refused");
    assert!(error.place.contains(&*path.file_name().unwrap().to_string_lossy()), "{error}");
    assert!(!error.remedy.is_empty());
    error
}

#[test]
fn every_format_keeps_its_depth() {
    let folder = tempfile::tempdir().unwrap();
    let deep: ImageBuffer<Luma<u16>, Vec<u16>> = ImageBuffer::from_fn(40, 30, |x, y| Luma([ramp(x, y)]));
    let flat = GrayImage::from_fn(40, 30, |x, y| Luma([(ramp(x, y) >> 8) as u8]));
    for extension in ["png", "tif", "pgm"] {
        let path = folder.path().join(format!("deep.{extension}"));
        DynamicImage::ImageLuma16(deep.clone()).save(&path).unwrap();
        let picture = load(&path, None).unwrap();
        assert_eq!((picture.width, picture.height, picture.full_scale), (40, 30, 65535.0), "{extension}");
        assert_eq!(picture.at(39, 29), f32::from(ramp(39, 29)), "{extension}");
    }
    for extension in ["png", "tif", "pgm", "bmp", "jpg"] {
        let path = folder.path().join(format!("flat.{extension}"));
        DynamicImage::ImageLuma8(flat.clone()).save(&path).unwrap();
        let picture = load(&path, None).unwrap();
        assert_eq!(picture.full_scale, 255.0);
        // JPEG is lossy; its quantisation at the encoder's default quality is a few counts.
        let tolerance = if extension == "jpg" { 8.0 } else { 0.0 };
        assert!((picture.at(20, 10) - f32::from(ramp(20, 10) >> 8)).abs() <= tolerance, "{extension}");
    }
}

/// A chessboard of 24 x 24 px in six scans, two hexadecimal digits a byte.
const PROGRESSIVE: &str = "\
    ffd8ffe000104a46494600010100000100010000ffdb0043000d090a0b0a080d0b0a0b0e0e0d0f13201513121213271c1e17202e293130\
    2e292d2c333a4a3e333646372c2d405741464c4e525352323e5a615a50604a51524fffc2000b080018001801011100ffc4001600010101\
    00000000000000000000000000030004ffda0008010100000001cccc34c23fffc4001b1001000203010100000000000000000000030002\
    0413142434ffda000801010001050222b8a647a612d04f7f4cf8a68e98a5413c7f4c55b8a7ffc4001f1000010304030100000000000000\
    000000010003120211133122415281ffda0008010100063f020e382d48d954e1e51da0db86d50d85863197775ee7f1669465d59171b16a\
    868aab3728e916db36a4682fffc400211000010303040300000000000000000000210001114161715181c1d131f0f1ffda000801010001\
    3f2133be467b516e26889ce119df03bde8bb00883c2f47847d5d80440e109df23bdaab613444e3084ef819ef55ffda0008010100000010\
    ff00ff00ffc4001d1001000105010101000000000000000000011100314151f021b1d1ffda0008010100013f10d75f09223c4b74ae5d84\
    61375b55ae3e12547a12c95dbd308270be6bb7eb99f8aede9949395b35ae3e12517892cb5cbb19c26cbeab5d7c2482f42dd6bfffd9\
";

/// A copy that was cut short is decoded without its finest structure.
#[test]
fn a_progressive_jpeg_without_its_last_scans_is_refused() {
    let digits: Vec<char> = PROGRESSIVE.chars().collect();
    let byte = |two: &[char]| u8::from_str_radix(&two.iter().collect::<String>(), 16).unwrap();
    let whole: Vec<u8> = digits.chunks(2).map(byte).collect();
    let loaded = |bytes: &[u8]| load_bytes("cut.jpg".as_ref(), bytes, None);
    let picture = loaded(&whole).unwrap();
    assert!(picture.at(2, 2) < 60.0 && picture.at(8, 2) > 180.0);
    for length in [whole.len() - 2, 400, 300] {
        assert_eq!(loaded(&whole[..length]).unwrap_err().code, Code::ImageTruncated, "{length}");
    }
}

/// A copy that was cut short is decoded with its lower half grey.
#[test]
fn a_jpeg_that_ends_early_is_refused_and_one_without_a_mark_of_the_end_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.jpg");
    let noisy = GrayImage::from_fn(160, 120, |x, y| Luma([(x * 7919 + y * 104_729 + x * y * 31) as u8]));
    DynamicImage::ImageLuma8(noisy).save(&path).unwrap();
    let whole = std::fs::read(&path).unwrap();
    let loaded = |bytes: &[u8]| load_bytes("cut.jpg".as_ref(), bytes, None);
    assert_eq!(loaded(&whole[..whole.len() / 2]).unwrap_err().code, Code::ImageTruncated);
    let unmarked = &whole[..whole.len() - 2];
    let appended = [&whole[..], b"appended by the camera"].concat();
    assert_eq!(loaded(unmarked).unwrap(), loaded(&whole).unwrap());
    assert_eq!(loaded(&appended).unwrap(), loaded(&whole).unwrap());
}

#[test]
fn colour_becomes_luma_in_full_depth() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("colour.png");
    let colour: ImageBuffer<Rgb<u16>, Vec<u16>> =
        ImageBuffer::from_fn(8, 8, |x, _| Rgb([1000 + x as u16, 2001, 30003]));
    DynamicImage::ImageRgb16(colour).save(&path).unwrap();
    let picture = load(&path, None).unwrap();
    let expected = 0.2126 * 1003.0 + 0.7152 * 2001.0 + 0.0722 * 30003.0;
    assert!((picture.at(3, 0) - expected).abs() < 0.01, "{} {expected}", picture.at(3, 0));
    assert_eq!(picture.full_scale, 65535.0);
}

#[test]
fn bits_in_the_low_end_set_the_saturation() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("twelve.png");
    let image: ImageBuffer<Luma<u16>, Vec<u16>> =
        ImageBuffer::from_fn(8, 8, |x, _| Luma([if x == 3 { 4095 } else { 7 }]));
    DynamicImage::ImageLuma16(image).save(&path).unwrap();
    assert_eq!(load(&path, Some(12)).unwrap().full_scale, 4095.0);
    assert_says(&refused(&path, Some(10)), Code::ImageDepth, &["4095"]);
    assert_says(&refused(&path, Some(40)), Code::ImageDepth, &["40"]);
}

/// As programs write the mean of several images.
#[test]
fn floating_point_is_read_as_fractions_or_as_counts() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mean.tif");
    for (brightest, full_scale, at_half) in
        [(0.9, 65535.0, 29490.75), (200.5, 255.0, 100.25), (4000.0, 65535.0, 2000.0)]
    {
        let mean = ImageBuffer::from_fn(8, 8, |x, _| Rgb([if x < 4 { 0.5 } else { 1.0 } * brightest; 3]));
        DynamicImage::ImageRgb32F(mean).save(&path).unwrap();
        let picture = load(&path, None).unwrap();
        assert_eq!(picture.full_scale, full_scale, "{brightest}");
        assert!((picture.at(0, 0) - at_half).abs() < 0.01, "{brightest}: {}", picture.at(0, 0));
    }
    // A tif of 64-bit addresses.
    std::fs::write(&path, b"II\x2b\0\x08\0\0\0\x10\0\0\0\0\0\0\0").unwrap();
    assert_says(&refused(&path, None), Code::ImageUnreadable, &["BigTIFF"]);
}

#[test]
fn broken_files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let whole = at("whole.png");
    DynamicImage::ImageLuma8(GrayImage::from_fn(200, 100, |x, y| Luma([(x * y) as u8]))).save(&whole).unwrap();
    let bytes = std::fs::read(&whole).unwrap();
    assert_eq!(refused(&at("missing.png"), None).code, Code::FileMissing);
    for (name, code, content) in [
        ("empty.png", Code::ImageTruncated, Vec::new()),
        ("truncated.png", Code::ImageTruncated, bytes[..bytes.len() / 2].to_vec()),
        ("header.png", Code::ImageTruncated, bytes[..20].to_vec()),
        ("text.png", Code::ImageUnreadable, b"image,joint_1\n".to_vec()),
        ("huge.pgm", Code::ImageSizeImpossible, b"P5 4000000000 4000000000 255\n0".to_vec()),
        ("wide.pgm", Code::ImageSizeImpossible, b"P5 60000 2 255\n0".to_vec()),
        ("large.pgm", Code::ImageSizeImpossible, b"P5 32000 32000 65535\n0".to_vec()),
        ("single.pgm", Code::ImageSizeImpossible, b"P5 1 1 255\n0".to_vec()),
    ] {
        std::fs::write(at(name), content).unwrap();
        assert_eq!(refused(&at(name), None).code, code, "{name}");
    }
    let error = load(folder.path(), None).expect_err("a folder");
    assert_eq!(error.code, Code::FileNotRegular, "{error}");
}

fn save(path: &Path, picture: &Picture) {
    let image: ImageBuffer<Luma<u16>, Vec<u16>> =
        ImageBuffer::from_fn(picture.width as u32, picture.height as u32, |x, y| {
            Luma([picture.at(x as usize, y as usize).round() as u16])
        });
    DynamicImage::ImageLuma16(image).save(path).unwrap();
}

#[test]
fn flat_field_takes_out_dark_counts_and_vignetting() {
    let folder = tempfile::tempdir().unwrap();
    let (width, height) = (60, 40);
    let make = |f: &dyn Fn(usize, usize) -> f32| Picture {
        width,
        height,
        pixels: (0..width * height).map(|k| f(k % width, k / width)).collect(),
        full_scale: 65535.0,
    };
    let dark = |x: usize, y: usize| 500.0 + ((x * 7 + y * 13) % 50) as f32;
    let gain = |x: usize, _y: usize| 1.0 - 0.01 * x as f32;
    let scene = |x: usize, y: usize| 20_000.0 + 100.0 * ((x + y) % 17) as f32;
    let mut paths: Vec<Vec<PathBuf>> = Vec::new();
    for (name, level) in [("dark", 0.0), ("white", 50_000.0)] {
        // Two images each, above and below the mean.
        let two = [-20.0, 20.0].map(|offset| {
            let path = folder.path().join(format!("{name}{offset}.png"));
            save(&path, &make(&|x, y| (dark(x, y) + offset + level * gain(x, y)).round()));
            path
        });
        paths.push(two.to_vec());
    }
    let field = FlatField::from_images(&paths[0], &paths[1], None).unwrap().unwrap();
    let mut raw = make(&|x, y| (dark(x, y) + scene(x, y) * gain(x, y)).round());
    raw.pixels[61] = 65535.0;
    let corrected = field.apply(raw).unwrap().picture;
    assert_eq!(corrected.pixels[61], 65535.0, "a saturated pixel stays saturated");
    for y in 0..height {
        for x in 0..width {
            let error = corrected.at(x, y) - scene(x, y);
            // Rounding of raw, dark and white by at most 1.5 counts in all, at a gain of 0.41 or more; a thousandth
            // of the pixels may be brighter than the reference.
            assert!((x, y) == (1, 1) || error.abs() < 4.0, "{x} {y}: {error}");
        }
    }
    let two_levels = make(&|x, _| 20_000.0 * (1 + x / 7 % 2) as f32);
    let left = field.apply(two_levels.clone()).unwrap();
    assert!(left.is_uncorrected && left.picture == two_levels, "levels are no measure of the light");
    assert!(FlatField::from_images(&[], &[], None).unwrap().is_none());
    let small = Picture { width: 10, height: 10, pixels: vec![0.0; 100], full_scale: 65535.0 };
    assert_says(&field.apply(small).expect_err("another size"), Code::ImageSizeDiffers, &["60 x 40"]);
    let error = FlatField::from_images(&paths[1], &paths[0], None).expect_err("swapped");
    assert_eq!(error.code, Code::FlatFieldUseless, "{error}");
}

#[test]
fn one_bad_image_does_not_fail_the_series() {
    let folder = tempfile::tempdir().unwrap();
    let plate = Plate::lattice(PlateKind::Chessboard, 6, 5, 0.01, 1e-4);
    let scene = |size| Scene { size, ..Scene::new(6, 5, View::new(6, 5, [150.0, 120.0], 26.0, 0.1, [0.01, 0.0])) };
    let mut paths = Vec::new();
    for (name, size) in [("a.png", (300, 240)), ("odd.png", (320, 240)), ("c.png", (300, 240)), ("d.png", (300, 240))] {
        let path = folder.path().join(name);
        save(&path, &Picture { full_scale: 65535.0, ..scene(size).render(0) });
        paths.push(path);
    }
    std::fs::write(folder.path().join("broken.png"), b"").unwrap();
    paths.insert(2, folder.path().join("broken.png"));
    let seen = AtomicUsize::new(0);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let count = |_: &Path| {
            seen.fetch_add(1, Ordering::Relaxed);
        };
        pool.install(|| detect_series(&paths, &plate, |path| load(path, Some(8)), count))
    };
    let (one, two) = (run(1), run(2));
    assert_eq!(one, two, "the same bits with one thread and with two");
    assert_eq!(seen.load(Ordering::Relaxed), 10);
    assert_eq!(one[0].detection.observations.len(), 30);
    assert_eq!(one[0], one[3]);
    for (index, name, code) in [(1, "odd.png", Code::ImageSizeDiffers), (2, "broken.png", Code::ImageTruncated)] {
        let error = one[index].detection.failure.as_ref().expect(name);
        assert_says(error, code, &[name]);
    }
}
