//! Sides of tags that something disturbs: the edge of a shadow or of a reflection along a side looks like the side itself, a little
//! wider, and a fit takes the one for the other by pixels. Its residuals on the paper tell, beside those of the other sides of the
//! picture; on the ink the code leaves some, too, which moves no side. The edge of a thing that lies on the border of a tag looks like a
//! side, too, as sharp as the others: there the step tells, beside those of the tag's other sides.

use super::edge_line::{EdgeLine, Measured};
use crate::detect::corners::quantile;

/// Residuals this many times those that are usual are those of something else ...
const DISTURBED: f64 = 2.0;
/// ... if they exceed this share of the contrast: what moved a side by more than its sigmas left 0.017 and more.
const LEAST_DISTURBED: f64 = 0.015;
/// Noise that does not fade with the light is that of the sides of which this part is quieter ...
const QUIET: f64 = 0.1;
/// ... and no side has more than this many times as much: of a hundred pixels it is known to 7 %.
const NOISY: f64 = 1.5;

/// A step below this part of another one leads to no paper of the same plate in the same light: a dark hand leaves 0.4, wood 0.6.
const UNLIKE: f64 = 0.75;
/// Ink that is darker than this part of the step tells nothing about the light.
const BLACK: f64 = 0.005;

/// What most sides of a picture have in common.
pub struct Usual {
    /// Residual of the fit over the contrast.
    share: f64,
    /// Residual of the quietest sides, counts: of weak light nothing but noise.
    quiet: f64,
}

impl Usual {
    pub fn of<'a>(sides: impl Iterator<Item = &'a EdgeLine> + Clone) -> Self {
        let share = quantile(sides.clone().map(|s| s.paper_residual() / s.contrast()), 0.5);
        let quiet = quantile(sides.map(EdgeLine::paper_residual), QUIET);
        Self { share: share.unwrap_or(0.0), quiet: quiet.unwrap_or(0.0) }
    }

    /// The sides of a tag, without those whose residuals are worse than usual or that have something else than paper beside them.
    pub fn undisturbed(&self, tag: [Measured; 4]) -> [Measured; 4] {
        let mut sides: Vec<EdgeLine> = tag.iter().filter_map(|side| side.ok()).collect();
        sides.sort_by(|a, b| a.contrast().total_cmp(&b.contrast()));
        let middle = sides.get(sides.len() / 2).copied();
        let good = |side: &EdgeLine| self.fits(side) && middle.is_some_and(|m| has_paper_as(side, &m));
        tag.map(|side| side.and_then(|s| if good(&s) { Ok(s) } else { Err("disturbed surroundings") }))
    }

    fn fits(&self, side: &EdgeLine) -> bool {
        let share = f64::max(DISTURBED * self.share, LEAST_DISTURBED);
        side.paper_residual() <= f64::max(share * side.contrast(), NOISY * self.quiet)
    }
}

/// Weaker light falls on ink and paper alike, and glare leaves the step between them: a step unlike that of the tag's other sides, from
/// ink like theirs, leads to something else.
fn has_paper_as(side: &EdgeLine, other: &EdgeLine) -> bool {
    let ink = |s: &EdgeLine| s.dark().max(0.0) + BLACK * other.contrast();
    let step = side.contrast() / other.contrast();
    let in_its_light = step / (ink(side) / ink(other));
    step.max(in_its_light) >= UNLIKE && step.min(in_its_light) <= 1.0 / UNLIKE
}
