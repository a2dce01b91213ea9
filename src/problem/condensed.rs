//! What an image tells of its pose and its intrinsics, whatever the noise of the joints does.

use nalgebra::DMatrix;

use super::equations::E;
use super::linearise::{Chained, ImageTerms};
use super::{Image, Layout};
use crate::linalg::SymmetricFactor;

/// Information of an image about its pose and intrinsics, 6 + [`E`], without its slack (Schur complement), of whose parts `slack`
/// is the information. The displacement field of a lens and single markers count as known. `None` where the slack is not determined.
pub fn condensed(terms: &ImageTerms, d_slack: &DMatrix<f64>, slack: &[f64]) -> Option<DMatrix<f64>> {
    let mut h = DMatrix::zeros(6 + E, 6 + E);
    h.view_mut((0, 0), (6, 6)).copy_from(&terms.pp);
    h.view_mut((0, 6), (6, E)).copy_from(&terms.pe.columns(0, E));
    h.view_mut((6, 0), (E, 6)).copy_from(&terms.pe.columns(0, E).transpose());
    h.view_mut((6, 6), (E, E)).copy_from(&terms.ee.view((0, 0), (E, E)));
    if slack.is_empty() {
        return Some(h);
    }
    let coupling = d_slack.transpose() * h.rows(0, 6);
    let mut of_slack = coupling.columns(0, 6) * d_slack;
    slack.iter().enumerate().for_each(|(k, information)| of_slack[(k, k)] += information);
    h -= coupling.transpose() * SymmetricFactor::new(&of_slack).ok()?.solve_many(&coupling);
    Some(h)
}

/// Derivatives of the pose and the intrinsics of an image by all columns of the layout, `[G 0; 0 1]`.
pub fn by_columns(layout: &Layout, image: &Image, chain: &Chained) -> DMatrix<f64> {
    let mut t = DMatrix::zeros(6 + E, layout.len());
    t.view_mut((0, 0), (6, layout.theta_len())).copy_from(&chain.d_theta);
    for (k, column) in layout.intrinsics(image).into_iter().enumerate().take(E) {
        if let Some(c) = column {
            t[(6 + k, c)] = 1.0;
        }
    }
    t
}
