//! What the images of a stop tell of their poses and intrinsics, whatever is latent there.

use nalgebra::DMatrix;

use super::equations::E;
use super::linearise::{Chained, ImageTerms};
use super::{Image, Layout};
use crate::linalg::SymmetricFactor;

/// One image of a stop: its pixel blocks, and how its pose moves with what is latent at the stop, 6 x latent.
pub type SeenAtStop<'a> = (&'a ImageTerms, DMatrix<f64>);

/// Information of the images of a stop about their poses and intrinsics, 6 + [`E`] an image, without what is latent (Schur complement),
/// which has the information `prior`. The displacement field of a lens and single markers count as known. `None` where what is latent is
/// not determined.
pub fn condensed(images: &[SeenAtStop], prior: &[f64]) -> Option<DMatrix<f64>> {
    let size = 6 + E;
    let mut h = DMatrix::zeros(size * images.len(), size * images.len());
    let mut coupling = DMatrix::zeros(prior.len(), size * images.len());
    let mut latent = DMatrix::zeros(prior.len(), prior.len());
    for (k, (terms, d_latent)) in images.iter().enumerate() {
        let mut own = DMatrix::zeros(size, size);
        own.view_mut((0, 0), (6, 6)).copy_from(&terms.pp);
        own.view_mut((0, 6), (6, E)).copy_from(&terms.pe.columns(0, E));
        own.view_mut((6, 0), (E, 6)).copy_from(&terms.pe.columns(0, E).transpose());
        own.view_mut((6, 6), (E, E)).copy_from(&terms.ee.view((0, 0), (E, E)));
        let with_latent = d_latent.transpose() * own.rows(0, 6);
        latent += with_latent.columns(0, 6) * d_latent;
        coupling.columns_mut(size * k, size).copy_from(&with_latent);
        h.view_mut((size * k, size * k), (size, size)).copy_from(&own);
    }
    if prior.is_empty() {
        return Some(h);
    }
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
