//! Inner constraints: covariances in the plate frame that the nominal markers define.
//!
//! Images do not change when all markers of a plate move rigidly and every pose of that plate follows. Only the priors of the
//! markers hold this motion `g` (body twist of the plate frame), with information `N' P N`, where the 3M x 6 matrix
//! `N = [I, -skew(x)]` moves the M nominal markers that were seen and `P` is their prior information. With `G` the rigid motion of
//! all unknowns and `C` their covariance, `C = C_inner + G (N' P N)^-1 G'`: the second part does not depend on the images and says
//! only how well the nominal markers define their frame. `C_inner` is the covariance under the constraint `N' P m = 0` on the
//! corrections `m`, which the estimates fulfil (S-transformation: Baarda 1973; inner constraints: Blaha 1971).

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3};

use crate::error::{Error, Result};
use crate::problem::{Image, Problem};

/// `[I, -skew(x)]`: motion of a marker by a rigid motion of all.
pub(super) fn rigid(x: &Vector3<f64>) -> SMatrix<f64, 3, 6> {
    let mut n = SMatrix::<f64, 3, 6>::zeros();
    n.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
    n.fixed_view_mut::<3, 3>(0, 3).copy_from(&-crate::geom::skew(x));
    n
}

/// `(N' P N)^-1` of the seen markers of plates that move together.
///
/// # Errors
/// When the markers seen lie on a line, so that they define no frame.
pub(super) fn rigid_covariance(problem: &Problem, seen: &BTreeSet<(usize, usize)>) -> Result<Matrix6<f64>> {
    let mut information = Matrix6::zeros();
    for &(plate, marker) in seen {
        let n = rigid(&problem.plates[plate].markers[marker].position_m);
        information += n.transpose() * n * problem.marker_information(plate, marker);
    }
    // The unit of length is chosen so that both halves of the diagonal have the same size.
    let diagonal = information.diagonal();
    let scale = diagonal.map(|d| if d > 0.0 { d.sqrt().recip() } else { 0.0 });
    let scaled = Matrix6::from_fn(|i, j| information[(i, j)] * scale[i] * scale[j]);
    let inverse = scaled.cholesky().filter(|c| c.l_dirty().diagonal().min() > 1e-6).map(|c| c.inverse());
    inverse.map(|c| Matrix6::from_fn(|i, j| c[(i, j)] * scale[i] * scale[j])).ok_or_else(|| {
        Error::unsolved(
            "plate",
            "the markers that were seen lie on a line and define no frame",
            "take images of more of the plate",
        )
    })
}

/// Markers that images in use show with observations in use, as (plate, marker), of the given plates.
pub(super) fn seen_markers(problem: &Problem, plates: &BTreeSet<usize>) -> BTreeSet<(usize, usize)> {
    markers_of(problem.used().map(|(_, i)| i).filter(|i| plates.contains(&i.plate)))
}

/// Markers with observations in use.
pub(super) fn markers_of<'a>(images: impl Iterator<Item = &'a Image>) -> BTreeSet<(usize, usize)> {
    images.flat_map(|i| i.used().map(|o| (i.plate, o.marker))).collect()
}

/// Plates that can only move together with `plates`, because they stood in a common placement.
pub(super) fn plates_tied_to(problem: &Problem, mut plates: BTreeSet<usize>) -> BTreeSet<usize> {
    let tied = || problem.used().map(|(_, i)| i).filter(|i| i.stop.is_some());
    loop {
        let placements: BTreeSet<usize> = tied().filter(|i| plates.contains(&i.plate)).map(|i| i.placement).collect();
        let before = plates.len();
        plates.extend(tied().filter(|i| placements.contains(&i.placement)).map(|i| i.plate));
        if plates.len() == before {
            return plates;
        }
    }
}

/// Plates that stood in a placement while the robot looked.
pub(super) fn plates_in(problem: &Problem, placement: usize) -> BTreeSet<usize> {
    problem.used().map(|(_, i)| i).filter(|i| i.stop.is_some() && i.placement == placement).map(|i| i.plate).collect()
}
