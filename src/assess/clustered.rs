//! Covariance that trusts the scatter between stops more than the model of the noise.
//!
//! Markers count as known here: every one is told by many images, and a shift of all of them is none of the plate. With the
//! information `S = R R'` of the images and measured bodies of a stop about their poses and intrinsics, joint noise eliminated,
//! and their derivatives `T` by the columns, the covariance is `K = (sum T' S T + P)^-1` with the prior information `P`. With the scores `b` of the stops (the latents
//! included, whose own score is zero at the optimum) the sandwich is `K (sum T' b b' T + P) K`; priors count as the observations that
//! they stand for.
//!
//! The fit has taken a part of the scatter of every stop: `b` has the covariance `S - S Q S`, `Q = T K T'`, in the place of `S`.
//! `R (1 - R' Q R)^-1/2 R^-1 b` has `S` again (R. Bell, D. McCaffrey 2002). Where noise is as the model says the sandwich has the
//! expectation `K` (K.-Y. Liang, S. Zeger 1986).

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::limits::Limits;
use crate::linalg::{SymmetricFactor, product, symmetric_eigen};
use crate::problem::{E, Layout, SeenAtStop, by_columns, condensed};
use crate::solve::{LinearProblem, LinearStop};

/// Covariances of the dense columns with known markers.
#[derive(Debug, Clone)]
pub struct Clustered {
    /// By the model of the noise, `K`.
    pub model: DMatrix<f64>,
    /// By the scatter between stops.
    pub sandwich: DMatrix<f64>,
}

impl Clustered {
    /// Sigma of every column by the scatter between stops over that by the model; 1 where there is nothing to compare.
    pub fn ratios(&self) -> impl Iterator<Item = f64> {
        let variances = (0..self.model.nrows()).map(|k| (self.model[(k, k)], self.sandwich[(k, k)]));
        variances.map(|(model, sandwich)| if model > 0.0 { (sandwich / model).max(0.0).sqrt() } else { 1.0 })
    }
}

/// Both covariances; `None` for too few stops.
pub fn clustered_covariance(linear: LinearProblem, limits: &Limits) -> Option<Clustered> {
    if linear.stops().len() < limits.scatter_images {
        return None;
    }
    let n = linear.adjustment.problem.layout.len();
    let StopInformation { stops, free, prior, information } = StopInformation::of(linear);
    let model = SymmetricFactor::new(&information).ok()?.inverse();
    let by_prior = &model * DMatrix::from_diagonal(&prior);
    let mut sandwich = product(&by_prior, &by_prior.transpose());
    for told in &stops {
        let d = &told.by_free;
        let influence =
            &model * d.tr_mul(&told.restored(&product(d, &product(&model, &d.transpose())), limits.scatter_taken)?);
        sandwich.ger(1.0, &influence, &influence, 1.0);
    }
    let whole = |part: &DMatrix<f64>| {
        let mut whole = DMatrix::zeros(n, n);
        for (i, &row) in free.iter().enumerate() {
            free.iter().enumerate().for_each(|(k, &column)| whole[(row, column)] = part[(i, k)]);
        }
        whole
    };
    Some(Clustered { model: whole(&model), sandwich: whole(&sandwich) })
}

/// What all stops tell of the free columns together, markers known and joint noise eliminated.
#[derive(Debug, Clone)]
pub struct StopInformation {
    /// The stops.
    pub stops: Vec<RootInformation>,
    /// Free columns.
    free: Vec<usize>,
    /// Inverse prior sigma of each.
    prior: DVector<f64>,
    /// Information on them, priors included.
    pub information: DMatrix<f64>,
}

impl StopInformation {
    /// At a linearised fit.
    pub fn of(linear: LinearProblem) -> Self {
        let layout = &linear.adjustment.problem.layout;
        let columns = &layout.columns;
        let free: Vec<usize> = (0..columns.len()).filter(|&c| columns[c].free).collect();
        let prior = DVector::from_iterator(free.len(), free.iter().map(|&c| columns[c].prior_sigma.recip()));
        let mut information = DMatrix::from_diagonal(&prior.component_mul(&prior));
        let stops: Vec<RootInformation> =
            linear.stops().filter_map(|stop| RootInformation::of(&stop, layout, &free)).collect();
        for d in stops.iter().map(|told| &told.by_free) {
            information += product(&d.transpose(), d);
        }
        for distance in &linear.lin.distances {
            let modes = layout.shapes[distance.plate].clone();
            let own = |c: &usize| if modes.contains(c) { distance.by_modes[c - modes.start] } else { 0.0 };
            let row = DVector::from_iterator(free.len(), free.iter().map(own));
            information.ger(1.0, &row, &row, 1.0);
        }
        for length in &linear.lin.lengths {
            let own = |c: &usize| length.by_columns.iter().filter(|(own, _)| own == c).map(|(_, d)| d).sum();
            let row = DVector::from_iterator(free.len(), free.iter().map(own));
            information.ger(1.0, &row, &row, 1.0);
        }
        Self { stops, free, prior, information }
    }
}

/// What images and measured bodies of one stop tell.
#[derive(Debug, Clone)]
pub struct RootInformation {
    /// Index of the stop.
    pub stop: usize,
    /// Places of its images among those in use.
    pub places: Range<usize>,
    /// Indices of its measurements of bodies.
    pub bodies: Vec<usize>,
    /// `R^-1 b`.
    pub score: DVector<f64>,
    /// `R' T`, rows x all columns.
    pub by_root: DMatrix<f64>,
    /// Its free columns.
    pub by_free: DMatrix<f64>,
}

impl RootInformation {
    fn of(stop: &LinearStop, layout: &Layout, free: &[usize]) -> Option<Self> {
        let n = stop.unknowns();
        let images = stop.images().map(|own| SeenAtStop::of_image(own.terms, own.by_latents(n)));
        let bodies = stop.bodies().iter().map(|own| SeenAtStop::of_body(&own.terms, own.by_latents(n)));
        let (root, inverse) = roots(&condensed(&images.chain(bodies).collect::<Vec<_>>(), &stop.prior())?)?;
        let mut score = DVector::zeros(root.nrows());
        let mut t = DMatrix::zeros(root.nrows(), layout.len());
        let mut first = 0;
        for own in stop.images() {
            score.rows_mut(first, 6).copy_from(&own.terms.bp);
            score.rows_mut(first + 6, E).copy_from(&own.terms.be.rows(0, E));
            t.rows_mut(first, 6 + E).copy_from(&by_columns(layout, own.image, own.chain));
            first += 6 + E;
        }
        for own in stop.bodies() {
            score.rows_mut(first, 6).copy_from(&own.terms.bp);
            t.view_mut((first, 0), (6, layout.theta_len())).copy_from(&own.chain.d_theta);
            first += 6;
        }
        let by_root = product(&root.transpose(), &t);
        let by_free = by_root.select_columns(free);
        let bodies = stop.bodies().iter().map(|own| own.index).collect();
        Some(Self { stop: stop.index, places: stop.places(), bodies, score: inverse * score, by_root, by_free })
    }

    /// The score with what the fit took of its scatter, of which `taken` is `R' Q R`; at most `most` of any direction counts.
    fn restored(&self, taken: &DMatrix<f64>, most: f64) -> Option<DVector<f64>> {
        let (taken, directions) = symmetric_eigen(taken)?;
        let back = taken.map(|h| (1.0 - h.clamp(0.0, most)).sqrt().recip());
        Some(&directions * back.component_mul(&directions.tr_mul(&self.score)))
    }
}

/// Smallest eigenvalue of an information in units of its diagonal that counts.
const SINGULAR: f64 = 1e-10;

/// A root `R` of `S = R R'` and its inverse, which is zero where nothing is told.
fn roots(s: &DMatrix<f64>) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let n = s.nrows();
    let unit = s.diagonal().map(|v| v.max(0.0).sqrt());
    let inverse = unit.map(|u| if u > 0.0 { 1.0 / u } else { 0.0 });
    let (values, vectors) = symmetric_eigen(&DMatrix::from_fn(n, n, |i, j| s[(i, j)] * inverse[i] * inverse[j]))?;
    let told = |v: f64, f: fn(f64) -> f64| if v > SINGULAR { f(v) } else { 0.0 };
    let of = |scale: &DVector<f64>, f: fn(f64) -> f64| {
        DMatrix::from_fn(n, n, |i, k| scale[i] * vectors[(i, k)] * told(values[k], f))
    };
    Some((of(&unit, f64::sqrt), of(&inverse, |v| v.sqrt().recip()).transpose()))
}
