//! A measured distance between two places (of sockets), or between two bodies that the tip carries.

use nalgebra::{Matrix3, Vector3};

use super::{Layout, State};
use crate::geom::Pose;

/// What a distance was measured between, by index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LengthEnds {
    /// The origins of two instruments: places of two sockets.
    Instruments([usize; 2]),
    /// The origins of two bodies.
    Bodies([usize; 2]),
}

/// One measured distance.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredLength {
    /// Its ends.
    pub ends: LengthEnds,
    /// Measured, m.
    pub distance_m: f64,
    /// Its sigma, m.
    pub sigma_m: f64,
    /// Its series, and its place among the distances of that.
    pub read: (usize, usize),
    /// True where it takes no part: all else contradicts it.
    pub left_out: bool,
}

/// A measured distance over its sigma, linearised.
#[derive(Debug, Clone, PartialEq)]
pub struct Length {
    /// Derivatives by the columns that it depends on, 1/m.
    pub by_columns: Vec<(usize, f64)>,
    /// Measured less predicted.
    pub residual: f64,
}

impl MeasuredLength {
    /// At a state; `None` where the ends coincide.
    pub fn linearise(&self, layout: &Layout, state: &State) -> Option<Length> {
        let (poses, ranges, ends) = match self.ends {
            LengthEnds::Instruments(ends) => (&state.instruments, &layout.instruments, ends),
            LengthEnds::Bodies(ends) => (&state.bodies, &layout.bodies, ends),
        };
        let [a, b] = ends.map(|k| &poses[k]);
        let between = b.translation - a.translation;
        let distance = between.norm();
        let direction = between.try_normalize(f64::MIN_POSITIVE)? / self.sigma_m;
        let of = |end: usize, sign: f64, pose: &Pose| {
            let by: Vector3<f64> = Matrix3::transpose(&pose.rotation) * direction * sign;
            let start = ranges[end].start;
            (0..3).filter(move |k| layout.columns[start + k].free).map(move |k| (start + k, by[k]))
        };
        let by_columns = of(ends[0], -1.0, a).chain(of(ends[1], 1.0, b)).collect();
        Some(Length { by_columns, residual: (self.distance_m - distance) / self.sigma_m })
    }
}

impl Length {
    /// All pairs of its columns with their derivatives.
    pub fn pairs(&self) -> impl Iterator<Item = ((usize, f64), (usize, f64))> + '_ {
        self.by_columns.iter().flat_map(|a| self.by_columns.iter().map(move |b| (*a, *b)))
    }
}
