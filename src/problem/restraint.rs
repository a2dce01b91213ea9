//! A prior on columns of the robot together, beside the prior of each: so far from nominal, and no farther, where the data do not say.

use nalgebra::{DMatrix, DVector};

/// The prior.
#[derive(Debug, Clone, PartialEq)]
pub struct Restraint {
    /// Columns.
    pub columns: Vec<usize>,
    /// Information of their values: zero is nominal.
    pub information: DMatrix<f64>,
    /// Displacement of the tip against the nominal robot that it expects over the workspace, RMS of the length, m.
    pub displacement_m: f64,
    /// Normal deviate of how the latent joint errors repeat over neighbouring readings, which is why it is there.
    pub repeats: f64,
}

/// A quadratic prior on several columns, with mean zero.
#[derive(Debug, Clone)]
pub struct JointPrior<'a> {
    /// The columns.
    pub columns: &'a [usize],
    /// Information of their values.
    pub information: DMatrix<f64>,
}

impl JointPrior<'_> {
    fn own(&self, values: &DVector<f64>) -> DVector<f64> {
        DVector::from_iterator(self.columns.len(), self.columns.iter().map(|&c| values[c]))
    }

    /// Information times value, in the order of the columns, at values of all columns.
    pub fn pull(&self, values: &DVector<f64>) -> DVector<f64> {
        &self.information * self.own(values)
    }

    /// Square of the values in units of the prior.
    pub fn squares(&self, values: &DVector<f64>) -> f64 {
        self.own(values).dot(&self.pull(values))
    }
}

impl Restraint {
    /// As a prior.
    pub fn prior(&self) -> JointPrior<'_> {
        JointPrior { columns: &self.columns, information: self.information.clone() }
    }
}
