//! Whether a plate has the size that its file states. The lengths of the robot's links are the only others there are.

use crate::assess::refitted;
use crate::fit::Fit;
use crate::problem::{Adjustment, Problem, SCALE, State, seen_markers};
use crate::solve::Covariance;

/// Standard deviations from which on plate and links contradict each other.
const CONTRADICTION: f64 = 3.0;

/// Prior sigma of a scale of which nothing is known.
const UNKNOWN_SCALE: f64 = 0.1;

/// Prior sigmas of the x/y scale beyond which a plate was not made to size.
const NOT_TO_SIZE: f64 = 5.0;

const ASPECT: usize = 1;

/// Reasons not to believe the size of a plate, in words with what to do.
pub fn doubted_sizes(fit: &Fit) -> Vec<String> {
    let Fit { adjustment: Adjustment { problem, state }, covariance, .. } = fit;
    let mut doubts = Vec::new();
    for (k, (columns, shape)) in problem.layout.shapes.iter().zip(&state.plates).enumerate() {
        let plate = &problem.plates[k];
        let of = |mode: usize| &problem.layout.columns[columns.start + mode];
        let free_scale = || with_free_scale(fit, columns.start).plates[k].modes[SCALE] - of(SCALE).prior_mean;
        let contradicted = contradicted(problem, columns.start, shape.modes[SCALE], covariance);
        let far =
            contradicted.map(|sigma| (free_scale(), sigma)).filter(|(off, sigma)| off.abs() > CONTRADICTION * sigma);
        if let Some((off, sigma)) = far {
            let (word, remedy) = match plate.scale {
                Some(_) => ("[scale]", "check that distance, and that the lengths in the URDF are those of this robot"),
                None => (
                    "its file",
                    "measure two far markers and give [scale] in plate.toml, or correct pitch_m; if the plate is right, the URDF is of another robot or size",
                ),
            };
            doubts.push(format!(
                "plate: the links of the robot say that it is {:.2} % (+- {:.2} %) {} than {word} says; every length goes wrong with it; {remedy}",
                100.0 * off.abs(),
                100.0 * sigma,
                if off > 0.0 { "larger" } else { "smaller" },
            ));
        }
        if plate.scale.is_none()
            && let Some((uneven, tolerance)) = x_y_scale(problem, state, k)
            && uneven.abs() > NOT_TO_SIZE * tolerance
        {
            doubts.push(format!(
                "plate: its rows and columns differ in scale by {:.2} %, so it was not made to size, and all lengths of the robot hang on its size; \
                 measure two far markers and give [scale] in plate.toml",
                100.0 * uneven.abs()
            ));
        }
    }
    doubts
}

/// Standard deviation of the scale without its prior, where what the data say of it is too far from the prior; `None` where it is not, or where
/// they say nothing.
fn contradicted(problem: &Problem, column: usize, scale: f64, covariance: &Covariance) -> Option<f64> {
    let (mean, prior) = (problem.layout.columns[column].prior_mean, problem.layout.columns[column].prior_sigma.powi(2));
    let left = covariance.reduced[(column, column)];
    let told = 1.0 / left - 1.0 / prior;
    if !problem.layout.columns[column].free || told <= 0.0 {
        return None;
    }
    let (off, sigma) = ((scale - mean) / (left * told), (1.0 / told + prior).sqrt());
    (off.abs() > CONTRADICTION * sigma).then_some(sigma)
}

/// The x/y scale of the markers that were seen, corrections included, and its prior sigma.
fn x_y_scale(problem: &Problem, state: &State, plate: usize) -> Option<(f64, f64)> {
    let shape = &state.plates[plate];
    let (mut along, mut size, mut loose) = (0.0, 0.0, 0.0);
    for m in seen_markers(problem, plate) {
        let modes = shape.modes_at(m);
        let stretch = modes.column(ASPECT);
        along += stretch.dot(&(shape.position(m) - shape.nominal[m]));
        size += stretch.norm_squared();
        loose += stretch.norm_squared() / problem.marker_information(plate, m);
    }
    let prior = problem.layout.columns[problem.layout.shapes[plate].start + ASPECT].prior_sigma;
    (size > 0.0).then(|| (along / size, prior.hypot(loose.sqrt() / size)))
}

/// The fit with a scale that nothing but images and links tells: where it is far off, the linear answer need not hold.
fn with_free_scale(fit: &Adjustment, column: usize) -> State {
    let mut loose = fit.clone();
    loose.problem.layout.columns[column].prior_sigma = UNKNOWN_SCALE;
    refitted(loose)
}
