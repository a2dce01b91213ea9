//! Whether a plate has the size that its file states. The lengths of the robot's links are the only others there are.

use super::kind::{CheckContext, Kind, Quantity, Subject};
use crate::assess::{Accuracy, refitted};
use crate::error::Code;
use crate::fit::Fit;
use crate::problem::{Adjustment, Problem, SCALE, State, UNKNOWN_SCALE, seen_markers, size_by_distance};

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
    for (k, plate) in problem.plates.iter().enumerate() {
        let far = |(off, sigma): &(f64, f64)| off.abs() > limits.plate_size_sigmas * sigma;
        let told = if plate.scale.is_some() { against_distance(fit, k) } else { against_file(fit, k) };
        let confirmed = told.filter(far).map(|(_, sigma)| (with_free_scale(fit, k), sigma));
        if let Some((off, sigma)) = confirmed.filter(far) {
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

    fn place(&self) -> String {
        "plate".into()
    }

    fn seen(&self) -> String {
        match self {
            Self::Contradicted { measured, off, sigma } => format!(
                "the links of the robot say that it is {:.2} % (+- {:.2} %) {} than {} says, and every length goes wrong with it",
                100.0 * off.abs(),
                100.0 * sigma,
                if *off > 0.0 { "larger" } else { "smaller" },
                if *measured { "[scale]" } else { "its file" },
            ),
            Self::Uneven { off, .. } => format!(
                "its rows and columns differ in scale by {:.2} %, so it was not made to size, and all lengths of the robot hang on its size",
                100.0 * off.abs()
            ),
        }
    }

    fn remedy(&self) -> String {
        let remedy = match self {
            Self::Contradicted { measured: true, .. } => {
                "check that distance, and that the lengths in the URDF are those of this robot"
            }
            Self::Contradicted { measured: false, .. } => {
                "measure two far markers and give [scale] in plate.toml, or correct pitch_m; if the plate is right, the URDF is of another robot or size"
            }
            Self::Uneven { .. } => "measure two far markers and give [scale] in plate.toml",
        };
        remedy.into()
    }
}

/// What the data say of the scale, less what the file of the plate says, with its standard deviation; `None` where they say nothing.
fn against_file(fit: &Fit, plate: usize) -> Option<(f64, f64)> {
    let at = fit.problem.layout.shapes[plate].start + SCALE;
    let column = &fit.problem.layout.columns[at];
    let (mean, prior) = (column.prior_mean, column.prior_sigma.powi(2));
    let left = fit.covariance.reduced[(at, at)];
    let told = 1.0 / left - 1.0 / prior;
    let scale = fit.state.plates[plate].modes[SCALE];
    (column.free && told > 0.0).then(|| ((scale - mean) / (left * told), (1.0 / told + prior).sqrt()))
}

/// What the data say of the measured distance of a plate, less the distance, with its standard deviation, over the distance; `None` where
/// they say nothing.
fn against_distance(fit: &Fit, plate: usize) -> Option<(f64, f64)> {
    let (k, distance) = fit.linearised.distances.iter().enumerate().find(|(_, d)| d.plate == plate)?;
    let predicted = 1.0 + fit.covariance.system.predicted_variance(&fit.covariance.reduced, k)?;
    let unit = distance.sigma_m / distance.length_m;
    Some((-distance.residual * predicted * unit, predicted.sqrt() * unit))
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

/// Size of a plate that nothing but images and links tells, less the stated one: where it is far off, the linear answer need not hold.
fn with_free_scale(fit: &Fit, plate: usize) -> f64 {
    let mut loose = fit.adjustment.clone();
    let at = loose.problem.layout.shapes[plate].start + SCALE;
    let mean = loose.problem.layout.columns[at].prior_mean;
    loose.problem.layout.columns[at].prior_sigma = UNKNOWN_SCALE;
    loose.problem.plates[plate].scale = None;
    let found = &refitted(loose).plates[plate];
    match size_by_distance(&fit.problem.plates[plate], found) {
        Some(size) => 1.0 / size - 1.0,
        None => found.modes[SCALE] - mean,
    }
}
