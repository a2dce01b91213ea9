//! Which of the patterns in the residuals names the cause.

use super::hold_out::of_fold;
use super::limits::Limits;
use super::patterns::{Bearer, Pattern, PatternTest};
use crate::fit::Fit;
use crate::solve::{ComponentOptions, LinearProblem, estimate_components};

/// Rounds in which image noise and fit follow a lens.
const ROUNDS: usize = 4;

/// The pattern that names the cause: of those beyond chance that which gains most, or the simplest that removes nearly as much of the squares
/// of the residuals. What is of second order in a large fault belongs to no first-order column, and many columns take more of it: where a
/// displacement field gains most, a formula is judged by what the fit with it leaves.
pub fn cause<'a>(fit: &Fit, tests: &'a [PatternTest], limits: &Limits) -> Option<&'a PatternTest> {
    let found = || tests.iter().filter(|t| t.is_found(limits));
    let best = found().max_by(|a, b| a.gain.total_cmp(&b.gain))?;
    if best.pattern == Pattern::Tolerance {
        return Some(best);
    }
    let enough = limits.pattern_share * best.share;
    let mut simpler: Vec<&PatternTest> =
        found().filter(|t| t.pattern != Pattern::Tolerance && t.degrees < best.degrees).collect();
    simpler.sort_by_key(|t| t.degrees);
    let by_formula = |t: &PatternTest| best.pattern == Pattern::Field && best.bearer == t.bearer;
    let removes_enough =
        |t: &&&PatternTest| t.share >= enough || by_formula(t) && removed(fit, t).is_some_and(|share| share >= enough);
    simpler.iter().find(removes_enough).copied().or(Some(best))
}

/// Share of the squares of the residuals that a fit with the lens of this pattern removes, whose image noise follows: the misfit that is counted as
/// noise now would leave more to the priors of its coefficients than to the images.
fn removed(fit: &Fit, test: &PatternTest) -> Option<f64> {
    let Bearer::Camera(k) = test.bearer else { return None };
    let extended = fit.with_camera(k, fit.state.cameras[k].extended(test.pattern.lens()?)?);
    let settings = of_fold(&extended);
    let options = ComponentOptions { joint: false, displacement: false, rounds: ROUNDS, settings };
    let left = squares_px(estimate_components(extended, &options).linear()?);
    let share = 1.0 - left / squares_px(fit.linear());
    tracing::debug!(?test.pattern, by_step = test.share, by_fit = share, "share of the squares that a lens removes");
    Some(share)
}

/// Squares of the residuals of all images, as they are weighted, px^2.
fn squares_px(linear: LinearProblem) -> f64 {
    linear.images().flat_map(|image| &image.terms.residuals).map(|r| r.weight * r.duv.norm_squared()).sum()
}
