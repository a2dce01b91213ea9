//! Columns and rows of a plate that stand in each other's place: its ids are read along the wrong side.

use nalgebra::{Vector2, Vector3};

use crate::error::{Error, Quantity};
use crate::init::Homography;
use crate::linalg::median;
use crate::problem::{Image, Problem};
use crate::series::Plate;

/// Says so beside what was seen of a camera, where its images fit a plane with the two exchanged far better than as the plate is described: with
/// less than `share` of the misfit.
pub(super) fn with_counts_exchanged(error: Error, problem: &Problem, camera: usize, share: f64) -> Error {
    let own = || problem.used().filter(|(_, image)| image.camera == camera).map(|(_, image)| image);
    let Some(plate) = own().next().map(|image| &problem.plates[image.plate]) else { return error };
    let Plate { columns, rows, .. } = *plate;
    if columns == rows || lattice(plate, (columns, rows)) != places(plate) {
        return error;
    }
    let exchanged = lattice(plate, (rows, columns));
    let ratio = |image: &Image| Some(misfit(image, &exchanged)? / misfit(image, &places(plate))?);
    if median(own().filter_map(ratio)).unwrap_or(f64::INFINITY) >= share {
        return error;
    }
    let what = format!("{}; with columns and rows of plate.toml exchanged they fit a plane", error.what);
    let remedy = format!("write columns = {rows} and rows = {columns} in plate.toml");
    let mut quantities = error.quantities.clone();
    quantities.extend([("columns", rows), ("rows", columns)].map(|(name, n)| Quantity::new(name, f64::from(n), "1")));
    Error { quantities, ..Error::new(error.code, error.place, what, remedy) }
}

fn places(plate: &Plate) -> Vec<Vector3<f64>> {
    plate.markers.iter().map(|marker| marker.position_m).collect()
}

fn lattice(plate: &Plate, (columns, rows): (u32, u32)) -> Vec<Vector3<f64>> {
    places(&Plate::lattice(plate.kind, columns, rows, plate.pitch_m, plate.tolerance_m))
}

/// RMS distance of the markers of an image from where a plane has them, px; `None` where no plane is determined.
fn misfit(image: &Image, places: &[Vector3<f64>]) -> Option<f64> {
    let seen = || image.used().filter_map(|o| Some((places.get(o.marker)?.xy(), o.uv)));
    let (plane_m, pixels): (Vec<Vector2<f64>>, Vec<Vector2<f64>>) = seen().unzip();
    let Homography(map) = Homography::fit(&plane_m, &pixels)?;
    let missed = seen().map(|(at, uv)| {
        let q = map * at.push(1.0);
        (q.xy() / q.z - uv).norm_squared()
    });
    Some((missed.sum::<f64>() / pixels.len() as f64).sqrt())
}
