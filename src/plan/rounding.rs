//! From weights to whole images: the heaviest candidates, then single exchanges while they gain.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::relax::{Design, Relaxed};
use crate::linalg::LinearRow;

/// A choice of candidates.
#[derive(Debug, Clone, PartialEq)]
pub struct Rounded {
    /// Chosen candidates, ascending.
    pub chosen: Vec<usize>,
    /// Criterion.
    pub value: f64,
    /// Certified share of what any weights could reach.
    pub efficiency: f64,
    /// Exchanges made.
    pub exchanges: usize,
}

/// Candidates with the best slope that are tried exactly for each place.
const TRIED: usize = 6;
/// Candidates on the shortlist for each image.
const SHORTLIST: usize = 8;
/// Sweeps over all places.
const SWEEPS: usize = 12;
/// Relative gain below which an exchange is not worth making.
const LEAST_GAIN: f64 = 1e-6;
/// Slack on rows for whole images.
const ROW_SLACK: f64 = 1e-9;

fn sums(rows: &[LinearRow], chosen: &[usize]) -> Vec<f64> {
    rows.iter().map(|r| chosen.iter().map(|&k| r.coefficients[k]).sum()).collect()
}

/// By how much rows are violated, in units of their own coefficients.
fn violation(rows: &[LinearRow], sums: &[f64]) -> f64 {
    let one = |(r, s): (&LinearRow, &f64)| {
        let size = r.coefficients.iter().fold(1e-300_f64, |m, c| m.max(c.abs()));
        ((s - r.high).max(r.low - s).max(0.0) / size - ROW_SLACK).max(0.0)
    };
    rows.iter().zip(sums).map(one).sum()
}

/// Whole images near the weights; `None` where the rows allow none that the exchanges find.
pub fn round(design: &Design, relaxed: &Relaxed) -> Option<Rounded> {
    let mut order: Vec<usize> = (0..relaxed.weights.len()).collect();
    order.sort_by(|&a, &b| relaxed.weights[b].total_cmp(&relaxed.weights[a]).then(a.cmp(&b)));
    let mut chosen: Vec<usize> = order.iter().take(design.count).copied().collect();
    repair(design, &mut chosen, &order)?;
    let mut information = design.information(&indicator(&chosen, order.len()));
    let mut value = design.criterion.value(&information).ok()?;
    let newcomers = shortlist(design, relaxed)?;
    let mut exchanges = 0;
    for _ in 0..SWEEPS {
        let before = exchanges;
        for place in 0..chosen.len() {
            if let Some((better, m, f)) = exchange(design, &chosen, place, &newcomers, &information, value) {
                (chosen[place], information, value) = (better, m, f);
                exchanges += 1;
            }
        }
        if exchanges == before {
            break;
        }
    }
    chosen.sort_unstable();
    let efficiency = design.criterion.share(relaxed.bound, value).min(1.0);
    Some(Rounded { chosen, value, efficiency, exchanges })
}

/// Candidates that may come in: all of them where rows weigh them differently, else those with the best slopes at the weights.
fn shortlist(design: &Design, relaxed: &Relaxed) -> Option<Vec<usize>> {
    let mut all: Vec<usize> = (0..relaxed.weights.len()).collect();
    if design.rows.is_empty() {
        let at = design.criterion.evaluate(&design.information(&relaxed.weights)).ok()?;
        let slopes = design.gradient(&at);
        all.sort_by(|&a, &b| slopes[a].total_cmp(&slopes[b]).then(a.cmp(&b)));
        all.truncate(SHORTLIST * design.count);
    }
    Some(all)
}

fn indicator(chosen: &[usize], n: usize) -> Vec<f64> {
    let mut w = vec![0.0; n];
    chosen.iter().for_each(|&k| w[k] = 1.0);
    w
}

/// Exchanges, heaviest newcomers first, until the rows hold.
fn repair(design: &Design, chosen: &mut [usize], order: &[usize]) -> Option<()> {
    let mut now = violation(design.rows, &sums(design.rows, chosen));
    while now > 0.0 {
        let mut best: Option<(f64, usize, usize)> = None;
        for place in (0..chosen.len()).rev() {
            for &k in order.iter().filter(|k| !chosen.contains(k)) {
                let mut other = chosen.to_vec();
                other[place] = k;
                let v = violation(design.rows, &sums(design.rows, &other));
                if v < best.map_or(now - 1e-12, |b| b.0 - 1e-12) {
                    best = Some((v, place, k));
                }
            }
        }
        let (v, place, k) = best?;
        chosen[place] = k;
        now = v;
    }
    Some(())
}

/// A better candidate for one place, with the information and value that it brings.
fn exchange(
    design: &Design,
    chosen: &[usize],
    place: usize,
    newcomers: &[usize],
    information: &DMatrix<f64>,
    value: f64,
) -> Option<(usize, DMatrix<f64>, f64)> {
    let without = information - &design.candidates[chosen[place]];
    let at = design.criterion.evaluate(&without).ok()?;
    let others: Vec<usize> = chosen.iter().copied().filter(|k| *k != chosen[place]).collect();
    let partial = sums(design.rows, &others);
    let fits = |k: usize| {
        let with: Vec<f64> = partial.iter().zip(design.rows).map(|(s, r)| s + r.coefficients[k]).collect();
        violation(design.rows, &with) == 0.0
    };
    let fitting: Vec<usize> = newcomers.iter().copied().filter(|k| !chosen.contains(k) && fits(*k)).collect();
    let mut ranked: Vec<(f64, usize)> =
        fitting.into_par_iter().map(|k| (at.gradient(&design.candidates[k]), k)).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut best: Option<(usize, DMatrix<f64>, f64)> = None;
    for &(_, k) in ranked.iter().take(TRIED) {
        let m = &without + &design.candidates[k];
        let Ok(f) = design.criterion.value(&m) else { continue };
        if f < best.as_ref().map_or(value - LEAST_GAIN * value.abs(), |b| b.2) {
            best = Some((k, m, f));
        }
    }
    best
}
