//! Sides of tags that something disturbs: the edge of a shadow or of a reflection along a side looks like the side itself, a little
//! wider, and a fit takes the one for the other by pixels. Its residuals on the paper tell, beside those of the other sides of the
//! picture; on the ink the code leaves some, too, which moves no side.

use super::corners::quantile;
use super::edge_line::EdgeLine;

/// Residuals this many times those that are usual are those of something else ...
const DISTURBED: f64 = 2.0;
/// ... if they exceed this share of the contrast: what moved a side by more than its sigmas left 0.017 and more.
const LEAST_DISTURBED: f64 = 0.015;
/// Noise that does not fade with the light is that of the sides of which this part is quieter ...
const QUIET: f64 = 0.1;
/// ... and no side has more than this many times as much: of a hundred pixels it is known to 7 %.
const NOISY: f64 = 1.5;

/// What most sides of a picture have in common.
pub(super) struct Usual {
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

    /// The side, if its residuals are no worse than usual.
    pub fn undisturbed(&self, side: EdgeLine) -> Result<EdgeLine, &'static str> {
        let share = f64::max(DISTURBED * self.share, LEAST_DISTURBED);
        let most = f64::max(share * side.contrast(), NOISY * self.quiet);
        if side.paper_residual() <= most { Ok(side) } else { Err("disturbed surroundings") }
    }
}
