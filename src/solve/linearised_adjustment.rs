//! An adjustment near its optimum that is linearised where it stands, and what is left of it without some of its images.

use std::borrow::Cow;

use nalgebra::DMatrix;

use super::elimination::parts::Parts;
use super::elimination::system::System;
use super::linear::{LinearProblem, Linearised};
use super::optimum::covariance::fixed_are_known;
use crate::problem::Adjustment;

/// An adjustment, linearised where it stands.
#[derive(Debug, Clone)]
pub struct LinearisedAdjustment {
    /// The adjustment.
    pub adjustment: Adjustment,
    /// Its linearisation.
    pub linearised: Linearised,
    /// Its system there, where that is known.
    pub(super) system: Option<System>,
}

impl LinearisedAdjustment {
    /// `None` where a marker lies behind its camera.
    pub fn of(adjustment: Adjustment) -> Option<Self> {
        let linearised = adjustment.linearise()?;
        Some(Self { adjustment, linearised, system: None })
    }

    /// The linear problem.
    pub fn linear(&self) -> LinearProblem<'_> {
        self.adjustment.linear(&self.linearised)
    }

    /// Covariance of the first dense columns alone; `None` where the unknowns are not determined.
    pub fn covariance_of_first(&self, columns: usize) -> Option<DMatrix<f64>> {
        let linear = self.linear();
        let system = self.system.as_ref().map_or_else(|| Cow::Owned(System::new(linear, 0.0)), Cow::Borrowed);
        let of_first = DMatrix::identity(system.rhs.len(), columns);
        let mut covariance = system.factor(linear).ok()?.solve_many(&of_first).rows(0, columns).into_owned();
        fixed_are_known(&self.adjustment.problem, &mut covariance);
        Some(covariance)
    }
}

impl LinearProblem<'_> {
    /// Without some of its images, and what was measured of bodies at their stops.
    pub fn without_images(self, held: &[usize]) -> LinearisedAdjustment {
        self.left_in(self.adjustment.without_images(held))
    }

    /// Without one of some sets of images, whose system is known from the parts that they make.
    pub fn without_set(self, sets: &[Vec<usize>], set: usize, parts: Option<&Parts>) -> LinearisedAdjustment {
        let left = self.without_images(&sets[set]);
        let system = parts.and_then(|parts| parts.without(set, left.linear()));
        LinearisedAdjustment { system, ..left }
    }

    /// Without what was measured of bodies at some stops.
    pub fn without_bodies_at(self, stops: &[usize]) -> LinearisedAdjustment {
        self.left_in(self.adjustment.without_bodies_at(stops))
    }

    /// With some of the stops in use; see [`Adjustment::some_stops`].
    pub fn some_stops(self, many: usize, some: usize) -> Option<LinearisedAdjustment> {
        self.adjustment.some_stops(many, some).map(|left| self.left_in(left))
    }

    fn left_in(self, adjustment: Adjustment) -> LinearisedAdjustment {
        let linearised = adjustment.left_of(self.lin);
        LinearisedAdjustment { adjustment, linearised, system: None }
    }
}
