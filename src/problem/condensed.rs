//! What an image tells of its pose and its intrinsics, whatever is latent at its stop.

use nalgebra::DMatrix;

use super::equations::E;
use super::linearise::{Chained, ImageTerms};
use super::{Image, Layout};
use crate::linalg::SymmetricFactor;

/// Information of an image about its pose and intrinsics, 6 + [`E`], without what is latent (Schur complement): it moves the pose by
/// `d_latent` (6 x latent) and has the information `prior`. The displacement field of a lens and single markers count as known. `None`
/// where what is latent is not determined.
pub fn condensed(terms: &ImageTerms, d_latent: &DMatrix<f64>, prior: &[f64]) -> Option<DMatrix<f64>> {
    let mut h = DMatrix::zeros(6 + E, 6 + E);
    h.view_mut((0, 0), (6, 6)).copy_from(&terms.pp);
    h.view_mut((0, 6), (6, E)).copy_from(&terms.pe.columns(0, E));
    h.view_mut((6, 0), (E, 6)).copy_from(&terms.pe.columns(0, E).transpose());
    h.view_mut((6, 6), (E, E)).copy_from(&terms.ee.view((0, 0), (E, E)));
    if prior.is_empty() {
        return Some(h);
    }
    let coupling = d_latent.transpose() * h.rows(0, 6);
    let mut latent = coupling.columns(0, 6) * d_latent;
    prior.iter().enumerate().for_each(|(k, information)| latent[(k, k)] += information);
    h -= coupling.transpose() * SymmetricFactor::new(&latent).ok()?.solve_many(&coupling);
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
