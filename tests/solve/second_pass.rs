//! The second pass over a rendered series: markers across the border of the picture against the truth.

use std::path::Path;

use nalgebra::{Matrix2, Vector2, Vector3};
use robotcal::assess::Limits;
use robotcal::error::Code;
use robotcal::model::circle::centroid_uv;
use robotcal::series::{Edge, read_images};
use robotcal::simulate::truth::Truth;

fn copied(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let (path, to) = entry.map(|e| (e.path(), to.join(e.file_name()))).unwrap();
        if path.is_dir() { copied(&path, &to) } else { std::fs::copy(&path, &to).map(|_| ()).unwrap() }
    }
}

/// Two images that are the same must be seen as the same, or nobody can call one of them a duplicate.
#[test]
fn an_image_and_its_copy_show_the_same() {
    let folder = tempfile::tempdir().unwrap();
    copied(&Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/kr6_small"), folder.path());
    let image = |k: u32| folder.path().join(format!("images/img_{k:03}.png"));
    std::fs::copy(image(4), image(5)).unwrap();
    let seen = robotcal::identify::detect_stops(&read_images(folder.path()).unwrap(), &Limits::default(), |_| ())
        .unwrap()
        .images;
    let rescued = seen[4].detection.circles.iter().flat_map(|c| &c.found).filter(|f| f.measured.visible < 0.97).count();
    assert!(rescued > 0, "the second pass found nothing");
    assert_eq!(seen[4].detection.observations, seen[5].detection.observations);
}

/// Markers brighter than the ground are looked for in the negative, in the second pass as in the first.
#[test]
fn the_second_pass_finds_as_many_bright_markers_as_dark_ones() {
    let folder = tempfile::tempdir().unwrap();
    copied(&Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/kr6_small"), folder.path());
    let table = folder.path().join("joints.csv");
    let rows = std::fs::read_to_string(&table).unwrap();
    std::fs::write(&table, rows.lines().take(7).collect::<Vec<_>>().join("\n") + "\n").unwrap();
    let seen = || {
        let series = read_images(folder.path()).unwrap();
        robotcal::identify::detect_stops(&series, &Limits::default(), |_| ()).unwrap().images
    };
    let dark = seen();
    for image in &dark {
        let path = image.path.as_ref().unwrap();
        let mut picture = image::open(path).unwrap();
        picture.invert();
        picture.save(path).unwrap();
    }
    let rescued = |images: &[robotcal::identify::SeenImage]| {
        let circles = images.iter().filter_map(|i| i.detection.circles.as_ref());
        circles.flat_map(|c| &c.found).filter(|f| f.measured.visible < 0.97).count()
    };
    let bright = seen();
    println!("{} of dark and {} of bright markers", rescued(&dark), rescued(&bright));
    assert!(rescued(&dark) > 0 && rescued(&bright) == rescued(&dark));
    assert!(bright.iter().all(|i| i.detection.notices.iter().any(|n| n.code == Code::MarkersBright)));
}

/// Half of a squared normalised error of two coordinates is exponentially distributed, with the median ln 2; what is allowed
/// for a contour that is not all there is an upper bound.
#[test]
fn markers_across_the_border_are_found_and_their_covariance_is_true() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/kr6_small");
    let series = read_images(&folder).unwrap();
    let truth = Truth::read(&folder.join("truth.toml")).unwrap();
    let seen = robotcal::identify::detect_stops(&series, &Limits::default(), |_| ()).unwrap().images;
    let mut errors: Vec<(f64, f64)> = Vec::new();
    for (image, stop) in seen.iter().zip(&truth.stops) {
        assert_eq!(image.name, stop.image);
        let pose = stop.camera_from_plate.pose();
        let circles = image.detection.circles.as_ref().unwrap();
        let across = circles.found.iter().filter(|f| f.measured.visible < 0.97);
        for found in across {
            let index = series.plate.index_of(found.marker).unwrap();
            let marker = &series.plate.markers[index];
            let centre = marker.position_m + Vector3::from(truth.marker_errors_m[index]);
            let edges = std::iter::once(&found.measured.outer).chain(found.measured.inner.as_ref());
            for edge in edges {
                let outer = edge.edge == Edge::Outer;
                let radius = if outer { marker.outer_radius_m } else { marker.inner_radius_m };
                let off =
                    Vector2::from(edge.ellipse.centre) - centroid_uv(&truth.camera, &pose, &centre, radius).unwrap();
                let [uu, uv, vv] = edge.covariance;
                let information = Matrix2::new(uu, uv, uv, vv).try_inverse().unwrap();
                errors.push((off.dot(&(information * off)) / 2.0, off.norm()));
            }
        }
    }
    errors.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (count, median) = (errors.len(), errors[errors.len() / 2].0);
    let largest = errors.iter().map(|e| e.1).fold(0.0, f64::max);
    let outliers = errors.iter().filter(|e| e.0 > 8.0).count();
    println!(
        "{count} contours across the border, median {median:.2}, {outliers} beyond 4 sigma, largest {largest:.3} px"
    );
    assert!(count > 150, "{count}");
    assert!((0.3..0.9).contains(&median), "{median}");
    assert!(outliers * 30 < count && largest < 0.1, "{outliers} of {count}, {largest} px");
}
