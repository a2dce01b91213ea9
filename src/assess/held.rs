//! Do the data contradict parameters that are held? Score test at the fit (C. Rao 1948).
//!
//! With the held columns `H` free, too, the normal equations of the fit are `N dx = b`, where `b` vanishes but for `H`. With `C = N^-1` and where the
//! held values are true, `b_H' C_HH b_H` is a sum of squares of normal deviates, each times the share that the data tell of it, and so no larger than
//! chi-squared with the sum of these shares as degrees of freedom; `dx = C b` is the step to the fit with the columns free. Which of them it is: the one
//! with the largest score of its own, `b_c^2 / S_cc` with `S = C_HH^-1`, is let go, `S` and `b` are swept by it, and again while one is beyond chance.

use nalgebra::{DMatrix, DVector};

use super::flange::FlangeModel;
use super::limits::Limits;
use super::patterns::deviate;
use crate::fit::Fit;
use crate::linalg::SymmetricFactor;

/// Parameters that are held at values which the data contradict.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldTest {
    /// Their columns, each with the normal deviate of its score once those before it are free.
    pub columns: Vec<(usize, f64)>,
    /// Normal deviate of all that is held together.
    pub deviate: f64,
    /// How far the step to the fit with all of it free moves the flange over the region of the stops, RMS, and the stated sigma, m; none where nothing
    /// ties the robot to the plate.
    pub moved_m: Option<[f64; 2]>,
    /// That step, of the columns of robot and poses.
    pub step: DVector<f64>,
}

/// What the data say against some held columns; `None` where it may be chance.
pub fn contradicted(fit: &Fit, held: &[usize], limits: &Limits) -> Option<HeldTest> {
    let mut freed = fit.adjustment.clone();
    held.iter().for_each(|&c| freed.problem.layout.columns[c].free = true);
    let covariance = freed.linear(&fit.linearised).covariance().ok()?;
    let (layout, b) = (&freed.problem.layout, &covariance.system.rhs);
    let told: Vec<usize> = held.iter().copied().filter(|&c| covariance.system.touched(c)).collect();
    let own = DMatrix::from_fn(told.len(), told.len(), |i, k| covariance.reduced[(told[i], told[k])]);
    let score = DVector::from_iterator(told.len(), told.iter().map(|&c| b[c]));
    let shares = told.iter().enumerate().map(|(i, &c)| 1.0 - own[(i, i)] * layout.columns[c].prior_sigma.powi(-2));
    let deviate = deviate(score.dot(&(&own * &score)), shares.sum());
    if told.is_empty() || deviate <= limits.pattern_sigmas {
        return None;
    }
    let information = SymmetricFactor::new(&own).ok()?.inverse();
    let columns = let_go(information, score.clone(), limits.pattern_sigmas);
    let step = told.iter().zip(score.iter()).fold(DVector::zeros(layout.theta_len()), |step, (&c, b)| {
        step + covariance.reduced.view((0, c), (layout.theta_len(), 1)).column(0) * *b
    });
    let framed = fit.in_frame().ok().map(|framed| framed.dense(layout.len()));
    let model = FlangeModel::of(fit, framed.as_ref().unwrap_or(&fit.covariance.reduced), limits);
    let columns = columns.into_iter().map(|(i, deviate)| (told[i], deviate)).collect();
    Some(HeldTest { columns, deviate, moved_m: model.map(|m| m.moved_m(&step)), step })
}

/// The unknowns that are let go one after the other, by their places, and the normal deviate of each.
fn let_go(mut information: DMatrix<f64>, mut score: DVector<f64>, sigmas: f64) -> Vec<(usize, f64)> {
    let mut free: Vec<(usize, f64)> = Vec::new();
    while free.len() < score.len() {
        let deviate = |i: usize| score[i].abs() / information[(i, i)].max(f64::MIN_POSITIVE).sqrt();
        let held = (0..score.len()).filter(|i| free.iter().all(|(other, _)| other != i));
        let Some((next, size)) = held.map(|i| (i, deviate(i))).max_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        if !free.is_empty() && size <= sigmas {
            break;
        }
        free.push((next, size));
        let (column, row) = (information.column(next) / information[(next, next)], information.row(next).into_owned());
        score -= &column * score[next];
        information -= column * row;
    }
    free
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_that_looks_wrong_beside_another_alone_is_not_let_go() {
        // Two that act alike, and one apart: the first is off by ten sigmas.
        let information = DMatrix::from_row_slice(3, 3, &[1.0, 0.9, 0.0, 0.9, 1.0, 0.0, 0.0, 0.0, 1.0]);
        let score = &information * DVector::from_vec(vec![10.0, 0.0, 0.5]);
        let free = let_go(information, score, 4.0);
        assert_eq!(free.len(), 1);
        assert!(free[0].0 == 0 && (free[0].1 - 10.0).abs() < 1e-12, "{free:?}");
    }
}
