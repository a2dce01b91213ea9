//! Whether a plate has the size that its file states. The lengths of the robot's links are the only others there are.

use std::fmt;

use super::kind::{CheckContext, Kind, Quantity, Subject};
use crate::assess::{Accuracy, refitted};
use crate::error::Code;
use crate::fit::Fit;
use crate::problem::{Adjustment, Problem, SCALE, State, seen_markers};

/// Prior sigma of a scale of which nothing is known.
const UNKNOWN_SCALE: f64 = 0.1;

const ASPECT: usize = 1;

/// A reason not to believe the size of a plate.
#[derive(Debug, Clone, PartialEq)]
pub enum DoubtedSize {
    /// The links of the robot say another size.
    Contradicted {
        /// True where the size was measured (`[scale]`).
        measured: bool,
        /// Relative difference: larger is positive.
        off: f64,
        /// Its standard deviation.
        sigma: f64,
    },
    /// Rows and columns differ in scale.
    Uneven {
        /// Relative difference.
        off: f64,
        /// Prior sigma of it.
        tolerance: f64,
    },
}

pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Vec<DoubtedSize> {
    let Adjustment { problem, state } = &fit.adjustment;
    let limits = setting.limits;
    let mut doubts = Vec::new();
    for (k, columns) in problem.layout.shapes.iter().enumerate() {
        let plate = &problem.plates[k];
        let mean = problem.layout.columns[columns.start + SCALE].prior_mean;
        let free_scale = || with_free_scale(fit, columns.start).plates[k].modes[SCALE] - mean;
        let contradicted = contradicted(fit, k, limits.plate_size_sigmas);
        let far = contradicted.map(|sigma| (free_scale(), sigma));
        if let Some((off, sigma)) = far.filter(|(off, sigma)| off.abs() > limits.plate_size_sigmas * sigma) {
            doubts.push(DoubtedSize::Contradicted { measured: plate.scale.is_some(), off, sigma });
        }
        if plate.scale.is_none()
            && let Some((off, tolerance)) = x_y_scale(problem, state, k)
            && off.abs() > limits.plate_aspect_sigmas * tolerance
        {
            doubts.push(DoubtedSize::Uneven { off, tolerance });
        }
    }
    doubts
}

impl fmt::Display for DoubtedSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Contradicted { measured, off, sigma } => {
                let (word, remedy) = match measured {
                    true => {
                        ("[scale]", "check that distance, and that the lengths in the URDF are those of this robot")
                    }
                    false => (
                        "its file",
                        "measure two far markers and give [scale] in plate.toml, or correct pitch_m; if the plate is right, the URDF is of another robot or size",
                    ),
                };
                write!(
                    f,
                    "plate: the links of the robot say that it is {:.2} % (+- {:.2} %) {} than {word} says; every length goes wrong with it; {remedy}",
                    100.0 * off.abs(),
                    100.0 * sigma,
                    if *off > 0.0 { "larger" } else { "smaller" },
                )
            }
            Self::Uneven { off, .. } => write!(
                f,
                "plate: its rows and columns differ in scale by {:.2} %, so it was not made to size, and all lengths of the robot hang on its size; \
                 measure two far markers and give [scale] in plate.toml",
                100.0 * off.abs()
            ),
        }
    }
}

impl Kind for DoubtedSize {
    fn code(&self) -> Code {
        match self {
            Self::Contradicted { .. } => Code::PlateSizeContradicted,
            Self::Uneven { .. } => Code::PlateUneven,
        }
    }

    fn subjects(&self) -> Vec<Subject> {
        vec![Subject::Body("plate".to_owned())]
    }

    fn quantities(&self) -> Vec<Quantity> {
        match *self {
            Self::Contradicted { off, sigma, .. } => vec![Quantity::new("relative_size", off, "1").with_sigma(sigma)],
            Self::Uneven { off, tolerance } => {
                vec![Quantity::new("relative_x_y_scale", off, "1"), Quantity::new("tolerance", tolerance, "1")]
            }
        }
    }
}

/// Standard deviation of the scale without its prior, where what the data say of it is too far from the prior; `None` where it is not, or where
/// they say nothing.
fn contradicted(fit: &Fit, plate: usize, sigmas: f64) -> Option<f64> {
    let at = fit.problem.layout.shapes[plate].start;
    let column = &fit.problem.layout.columns[at];
    let (mean, prior) = (column.prior_mean, column.prior_sigma.powi(2));
    let left = fit.covariance.reduced[(at, at)];
    let told = 1.0 / left - 1.0 / prior;
    if !column.free || told <= 0.0 {
        return None;
    }
    let scale = fit.state.plates[plate].modes[SCALE];
    let (off, sigma) = ((scale - mean) / (left * told), (1.0 / told + prior).sqrt());
    (off.abs() > sigmas * sigma).then_some(sigma)
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
