//! An adjustment at its optimum.

use std::ops::{Deref, DerefMut};

use super::covariance::Covariance;
use crate::problem::Adjustment;
use crate::solve::linear::{LinearProblem, Linearised};

/// An adjustment at its optimum, with everything that is known there.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Data, with the reasons of all rejections and the final variance components, and all estimates.
    pub adjustment: Adjustment,
    /// Linearisation at the estimates: residuals and weights of the images in use.
    pub linearised: Linearised,
    /// Covariance of the estimates.
    pub covariance: Covariance,
}

impl Fit {
    /// The linear problem at the estimates.
    pub fn linear(&self) -> LinearProblem<'_> {
        self.adjustment.linear(&self.linearised)
    }
}

/// A fit is an adjustment of which more is known.
impl Deref for Fit {
    type Target = Adjustment;

    fn deref(&self) -> &Adjustment {
        &self.adjustment
    }
}

impl DerefMut for Fit {
    fn deref_mut(&mut self) -> &mut Adjustment {
        &mut self.adjustment
    }
}
