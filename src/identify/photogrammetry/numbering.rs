//! Markers of a grid that are numbered in another way than the plate file says: along its other side, or on a grid of other counts.

use nalgebra::{Vector2, Vector3};

use crate::error::{Code, Error, Quantity};
use crate::init::Homography;
use crate::linalg::median;
use crate::problem::{Image, Problem};
use crate::series::Plate;

/// A way to number the markers of a grid.
struct Numbering {
    /// Where the markers of the plate file are then.
    places: Vec<Vector3<f64>>,
    /// With what the images fit.
    with: String,
    remedy: String,
    /// Columns and rows, where they are others.
    counts: Option<(u32, u32)>,
    /// What was seen; none where that stays as it was.
    code: Option<Code>,
}

/// Says so beside what was seen of a camera, where its images fit a plane with another numbering far better than as the plate is described: with
/// less than `share` of the misfit.
pub(super) fn with_numbering(error: Error, problem: &Problem, camera: usize, share: f64) -> Error {
    let own = || problem.used().filter(|(_, image)| image.camera == camera).map(|(_, image)| image);
    let Some(plate) = own().next().map(|image| &problem.plates[image.plate]) else { return error };
    if lattice(plate, (plate.columns, plate.rows)) != places(plate) {
        return error;
    }
    let as_described = places(plate);
    let described: Vec<Option<f64>> = own().map(|image| Some(PlaneFit::of(image, &as_described)?.misfit_px)).collect();
    let left = |numbering: &Numbering| {
        // Counts exchanged and ids down the columns are the same plane from its two sides.
        let ratio = |(image, described): (&Image, &Option<f64>)| {
            let fit = PlaneFit::of(image, &numbering.places).filter(|fit| fit.is_front)?;
            Some(fit.misfit_px / (*described)?)
        };
        median(own().zip(&described).filter_map(ratio)).unwrap_or(f64::INFINITY)
    };
    let tried = numberings(plate).into_iter().map(|numbering| (left(&numbering), numbering));
    let best = tried.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(left, _)| *left < share);
    let Some((_, Numbering { with, remedy, counts, code, .. })) = best else { return error };
    let what = match code {
        Some(_) => format!("the markers do not lie in a plane as they are numbered; with {with} they do"),
        None => format!("{}; with {with} they fit a plane", error.what),
    };
    let mut quantities = error.quantities.clone();
    let counts = counts.into_iter().flat_map(|(columns, rows)| [("columns", columns), ("rows", rows)]);
    quantities.extend(counts.map(|(name, n)| Quantity::new(name, f64::from(n), "1")));
    Error { quantities, ..Error::new(code.unwrap_or(error.code), error.place, what, remedy) }
}

/// Those that are usual.
fn numberings(plate: &Plate) -> Vec<Numbering> {
    let Plate { columns, rows, .. } = *plate;
    if columns < 3 || rows < 3 {
        return Vec::new();
    }
    let counted = |(columns, rows): (u32, u32), with: &str, code: Option<Code>| Numbering {
        places: lattice(plate, (columns, rows)),
        with: with.to_owned(),
        remedy: format!("write columns = {columns} and rows = {rows} in plate.toml"),
        counts: Some((columns, rows)),
        code,
    };
    let by_rows = places(plate);
    let down_columns = |id: u32| by_rows[(id % rows * columns + id / rows) as usize];
    let down = Numbering {
        places: (0..columns * rows).map(down_columns).collect(),
        with: "ids that go down the columns instead of along the rows".to_owned(),
        remedy: format!(
            "number the markers along the rows: {columns} times the row plus the column, both from 0, in place of {rows} times the column plus the row"
        ),
        counts: None,
        code: Some(Code::PlateContradicted),
    };
    let squares = "columns and rows of plate.toml each less by one (inner corners, not squares)";
    let exchanged =
        (columns != rows).then(|| counted((rows, columns), "columns and rows of plate.toml exchanged", None));
    let all = [down, counted((columns - 1, rows - 1), squares, Some(Code::PlateContradicted))];
    exchanged.into_iter().chain(all).collect()
}

fn places(plate: &Plate) -> Vec<Vector3<f64>> {
    plate.markers.iter().map(|marker| marker.position_m).collect()
}

fn lattice(plate: &Plate, (columns, rows): (u32, u32)) -> Vec<Vector3<f64>> {
    places(&Plate::lattice(plate.kind, columns, rows, plate.pitch_m, plate.tolerance_m))
}

/// Markers of an image on a plane.
struct PlaneFit {
    /// RMS distance from where the plane has them, px.
    misfit_px: f64,
    /// The side that z points to is seen.
    is_front: bool,
}

impl PlaneFit {
    /// `None` where no plane is determined, or the plate has not all of them.
    fn of(image: &Image, places: &[Vector3<f64>]) -> Option<Self> {
        let seen = image.used().map(|o| Some((places.get(o.marker)?.xy(), o.uv)));
        let all: Vec<(Vector2<f64>, Vector2<f64>)> = seen.collect::<Option<_>>()?;
        let (plane_m, pixels): (Vec<Vector2<f64>>, Vec<Vector2<f64>>) = all.iter().copied().unzip();
        let Homography(map) = Homography::fit(&plane_m, &pixels)?;
        let onto = |at: &Vector2<f64>| map * at.push(1.0);
        let missed = all.iter().map(|(at, uv)| {
            let q = onto(at);
            (q.xy() / q.z - uv).norm_squared()
        });
        let misfit_px = (missed.sum::<f64>() / pixels.len() as f64).sqrt();
        // v points down: from the front the map of x and y to u and v turns the other way round.
        let is_front = map.determinant() * onto(plane_m.first()?).z < 0.0;
        Some(Self { misfit_px, is_front })
    }
}
