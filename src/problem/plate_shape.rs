//! The shape of a plate.

use nalgebra::{SMatrix, SVector, Vector3};

use crate::model::plate_modes::{MODES, basis};
use crate::series::Plate;

/// Deviation of a plate from nominal.
#[derive(Debug, Clone, PartialEq)]
pub struct PlateShape {
    /// Amplitudes of the modes of [`crate::model::plate_modes`].
    pub modes: [f64; MODES],
    /// Correction of each marker on top of the modes, m.
    pub corrections: Vec<Vector3<f64>>,
    /// Nominal positions, m.
    pub nominal: Vec<Vector3<f64>>,
    /// Largest distance of a marker from the centre, m.
    pub half_diagonal_m: f64,
}

impl PlateShape {
    /// The nominal shape.
    pub fn nominal(plate: &Plate) -> Self {
        let nominal: Vec<_> = plate.markers.iter().map(|m| m.position_m).collect();
        Self {
            modes: [0.0; MODES],
            corrections: vec![Vector3::zeros(); nominal.len()],
            half_diagonal_m: nominal.iter().map(Vector3::norm).fold(0.0, f64::max),
            nominal,
        }
    }

    /// How a marker moves with the modes.
    #[inline(always)]
    pub fn modes_at(&self, marker: usize) -> SMatrix<f64, 3, MODES> {
        basis(&self.nominal[marker], self.half_diagonal_m)
    }

    /// Position of a marker in the plate frame, m.
    pub fn position(&self, marker: usize) -> Vector3<f64> {
        self.position_by(&self.modes_at(marker), marker)
    }

    /// The same, where what the modes do is at hand.
    #[inline(always)]
    pub fn position_by(&self, modes: &SMatrix<f64, 3, MODES>, marker: usize) -> Vector3<f64> {
        self.nominal[marker] + modes * SVector::from(self.modes) + self.corrections[marker]
    }
}
