//! How markers are coupled with the other unknowns of an image.

use nalgebra::SMatrix;
use robotcal::problem::{E, Equations};

/// Normal-equation blocks of one marker with the pose and the intrinsics before the field of one image.
pub struct MarkerCoupling {
    /// Index of the marker on its plate.
    pub marker: usize,
    pub with_pose: SMatrix<f64, 3, 6>,
    pub with_intrinsics: SMatrix<f64, 3, E>,
}

/// Those of every marker that was seen; observations of one marker stand together.
pub fn marker_couplings(equations: &Equations) -> Vec<MarkerCoupling> {
    let mut all: Vec<MarkerCoupling> = Vec::new();
    for (&marker, sight) in equations.markers.iter().zip(equations.sights()) {
        if all.last().is_none_or(|last| last.marker != marker) {
            all.push(MarkerCoupling { marker, with_pose: SMatrix::zeros(), with_intrinsics: SMatrix::zeros() });
        }
        let last = all.last_mut().unwrap();
        last.with_pose += sight.by_marker() * sight.by_pose().transpose();
        last.with_intrinsics += sight.by_marker() * sight.by_intrinsics().transpose();
    }
    all
}
