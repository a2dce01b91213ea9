//! What images and measured bodies of a stop tell of their poses and intrinsics, whatever is latent there.

use nalgebra::DMatrix;

use super::body::BodyTerms;
use super::equations::E;
use super::linearise::{Chained, ImageTerms};
use super::{Image, Layout};
use crate::linalg::{SymmetricFactor, dense};

/// What something at a stop tells: information about its pose (6), and of an image about its intrinsics ([`E`] more).
#[derive(Debug, Clone)]
pub struct SeenAtStop {
    own: DMatrix<f64>,
    /// How its pose moves with what is latent at the stop, 6 x latent.
    by_latents: DMatrix<f64>,
}

impl SeenAtStop {
    /// An image, by its pixel blocks.
    pub fn of_image(terms: &ImageTerms, by_latents: DMatrix<f64>) -> Self {
        let mut own = DMatrix::zeros(6 + E, 6 + E);
        own.view_mut((0, 0), (6, 6)).copy_from(&terms.pp);
        own.view_mut((0, 6), (6, E)).copy_from(&terms.pe.columns(0, E));
        own.view_mut((6, 0), (E, 6)).copy_from(&terms.pe.columns(0, E).transpose());
        own.view_mut((6, 6), (E, E)).copy_from(&terms.ee.view((0, 0), (E, E)));
        Self { own, by_latents }
    }

    /// A measurement of a body, by its blocks.
    pub fn of_body(terms: &BodyTerms, by_latents: DMatrix<f64>) -> Self {
        Self { own: dense(&terms.pp), by_latents }
    }
}

/// Information of what was seen at a stop about poses and intrinsics, one behind the other, without what is latent (Schur complement),
/// which has the information `prior`. The displacement field of a lens and single markers count as known. `None` where what is latent is
/// not determined.
pub fn condensed(seen: &[SeenAtStop], prior: &[f64]) -> Option<DMatrix<f64>> {
    let size = seen.iter().map(|s| s.own.nrows()).sum();
    let mut h = DMatrix::zeros(size, size);
    let mut coupling = DMatrix::zeros(prior.len(), size);
    let mut latent = DMatrix::zeros(prior.len(), prior.len());
    let mut first = 0;
    for SeenAtStop { own, by_latents } in seen {
        let size = own.nrows();
        let with_latent = by_latents.transpose() * own.rows(0, 6);
        latent += with_latent.columns(0, 6) * by_latents;
        coupling.columns_mut(first, size).copy_from(&with_latent);
        h.view_mut((first, first), (size, size)).copy_from(own);
        first += size;
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
    for (k, column) in layout.intrinsics(image, &[]).into_iter().enumerate().take(E) {
        if let Some(c) = column {
            t[(6 + k, c)] = 1.0;
        }
    }
    t
}
