//! The plates of a solution in the frames that their nominal markers define: covariances and scales, made once for all files.

use nalgebra::{Matrix3, Matrix6};

use crate::error::Result;
use crate::fit::Fit;
use crate::problem::{Adjustment, Problem};
use crate::solve::{InFrame, PlateScale, Similarity, in_frame};

/// Covariances of placements and markers in the frames of the plates.
pub(super) struct Gauge {
    in_frame: InFrame,
    /// Covariance of the position of every marker, its plate's scale apart, m^2.
    pub positions: Vec<Vec<Matrix3<f64>>>,
    /// Scale of every plate as in its files; none for a plate that no image shows.
    pub scales: Vec<Option<PlateScale>>,
}

impl Gauge {
    /// Of a fit.
    ///
    /// # Errors
    /// Markers that lie on a line.
    pub fn of(fit: &Fit) -> Result<Self> {
        let Adjustment { problem, state } = &fit.adjustment;
        let in_frame = in_frame(fit.linear(), &fit.covariance)?;
        let scale = |plate: usize| -> Result<Option<PlateScale>> {
            let Some((frame, sigma)) = in_frame.frame(plate).zip(in_frame.scale_sigma(problem, plate)) else {
                return Ok(None);
            };
            let similarity = Similarity::of(problem, &frame.seen, plate, &state.plates[plate])?;
            Ok(Some(PlateScale { relative: similarity.size - 1.0, sigma }))
        };
        let scales = (0..problem.plates.len()).map(scale).collect::<Result<_>>()?;
        Ok(Self { positions: in_frame.positions(fit), scales, in_frame })
    }

    /// Covariance of the pose of a plate.
    pub fn placement(&self, problem: &Problem, placement: usize) -> Matrix6<f64> {
        self.in_frame.placement(problem.layout.placements[placement].start)
    }
}
