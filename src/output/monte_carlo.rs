//! Report of the Monte-Carlo test of the stated uncertainties.

use std::fmt::Write;

use crate::recipe::{BLOCKS, MonteCarloCell};

/// Markdown with one table of normalised errors and one of the joint noise; `command` makes it.
pub fn monte_carlo_markdown(cells: &[MonteCarloCell], command: &str) -> String {
    let mut out = String::from("# Stated uncertainties against known truth\n\n");
    let worlds: usize = cells.iter().map(|c| c.worlds).sum();
    let failed: usize = cells.iter().map(|c| c.failed).sum();
    let _ = write!(
        out,
        "Made by `{command}`: {worlds} simulated series identified from nothing with the default options, {failed} without a solution. \
         The true errors of robot, plate and markers are drawn from the priors of the estimator; images of 48 circles with a noise of 0.05 px.\n\n\
         ## Normalised error squared\n\n\
         Mean of `e' C^-1 e / n` over the worlds, for the error `e` of a block of `n` parameters with its stated covariance `C`. It is 1 \
         where the stated uncertainty is true, above 1 where it is too small. In brackets: the 99 % interval about 1 for this number of worlds; \
         **bold** where the mean lies outside. \"flange\" is the pose of the flange in the plate frame at a joint vector that was not measured.\n\n"
    );
    let _ = writeln!(out, "| joint noise, mrad | worlds | {} |", BLOCKS.join(" | "));
    let _ = writeln!(out, "|---|---|{}", "---|".repeat(BLOCKS.len()));
    for c in cells {
        let block = |b: &crate::recipe::BlockResult| {
            let mean = if b.holds() { format!("{:.3}", b.mean) } else { format!("**{:.3}**", b.mean) };
            format!("{mean} (+-{:.3})", b.half_width)
        };
        let blocks: Vec<String> = c.blocks.iter().map(block).collect();
        let _ = writeln!(out, "| {:.3} | {} | {} |", 1e3 * c.joint_noise_rad, c.worlds, blocks.join(" | "));
    }
    out += "\n## Joint noise\n\nRMS over the joints: mean over the worlds, its spread over the worlds, and the spread that the program states.\n\n\
            | put in, mrad | found, mrad | spread, mrad | stated spread, mrad |\n|---|---|---|---|\n";
    for c in cells {
        let mrad = [c.joint_noise_rad, c.found_rad, c.found_spread_rad, c.stated_spread_rad].map(|v| 1e3 * v);
        let _ = writeln!(out, "| {:.4} | {:.4} | {:.4} | {:.4} |", mrad[0], mrad[1], mrad[2], mrad[3]);
    }
    out
}
