//! The measured distance of two markers, the only absolute length beside the links of the robot.

use std::collections::BTreeSet;

use super::{Adjustment, PlateShape, Problem};
use crate::series::Plate;

/// Index of the scale among the modes of a plate.
pub const SCALE: usize = 0;

/// Gives the scale of every plate with a measured distance the prior that the distance makes, on a plate of its present shape.
pub fn hold_scale_bars(Adjustment { problem, state }: &mut Adjustment) {
    for (k, (columns, shape)) in problem.layout.shapes.clone().iter().zip(&state.plates).enumerate() {
        if let Some((mean, sigma)) = bar_scale(&problem.plates[k], shape, &seen_markers(problem, k)) {
            let column = &mut problem.layout.columns[columns.start + SCALE];
            (column.prior_mean, column.prior_sigma) = (mean, sigma);
        }
    }
}

/// Scale by the measured distance of two markers, with its standard deviation: `distance = nominal (scale + shape)`, where everything
/// but the scale makes the shape. A marker that was not seen may be off by its tolerance.
fn bar_scale(plate: &Plate, shape: &PlateShape, seen: &BTreeSet<usize>) -> Option<(f64, f64)> {
    let bar = plate.scale?;
    let [a, b] = [plate.index_of(bar.from)?, plate.index_of(bar.to)?];
    let nominal = plate.markers[a].position_m - plate.markers[b].position_m;
    let shaped = (shape.position(a) - shape.position(b) - shape.modes[SCALE] * nominal).norm();
    let unseen = [a, b].into_iter().filter(|m| !seen.contains(m));
    let variance = bar.sigma_m.powi(2) + unseen.map(|m| plate.markers[m].sigma_m.powi(2)).sum::<f64>();
    let nominal = nominal.norm();
    (nominal > 0.0).then(|| ((bar.distance_m - shaped) / nominal, variance.sqrt() / nominal))
}

/// Size of a plate by its measured distance, over that of a shape, with its standard deviation.
pub fn size_by_bar(
    plate: &Plate,
    shape: &PlateShape,
    seen: &BTreeSet<(usize, usize)>,
    index: usize,
) -> Option<(f64, f64)> {
    let bar = plate.scale?;
    let [a, b] = [plate.index_of(bar.from)?, plate.index_of(bar.to)?];
    let length = (shape.position(a) - shape.position(b)).norm();
    let unseen = [a, b].into_iter().filter(|m| !seen.contains(&(index, *m)));
    let variance = bar.sigma_m.powi(2) + unseen.map(|m| plate.markers[m].sigma_m.powi(2)).sum::<f64>();
    (length > 0.0).then(|| (bar.distance_m / length, variance.sqrt() / length))
}

/// Markers of a plate that images in use show.
pub fn seen_markers(problem: &Problem, plate: usize) -> BTreeSet<usize> {
    let images = problem.used().map(|(_, image)| image).filter(|image| image.plate == plate);
    images.flat_map(|image| image.used().map(|o| o.marker)).collect()
}
