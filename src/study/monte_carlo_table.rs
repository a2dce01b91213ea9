//! Report of the Monte-Carlo test of the stated uncertainties.

use std::fmt::Write;

use crate::study::made_with::made_with;
use crate::study::{BLOCKS, MonteCarloCell};

/// Markdown with one table of normalised errors and one of the joint noise; `command` makes it.
pub fn monte_carlo_markdown(cells: &[MonteCarloCell], command: &str) -> String {
    let mut out = String::from("# Stated uncertainties against known truth\n\n");
    let worlds: usize = cells.iter().map(|c| c.worlds).sum();
    let failed: usize = cells.iter().map(|c| c.failed).sum();
    let _ = write!(
        out,
        "Made by `{command}` ({}): {worlds} simulated series identified from nothing with the full robot model, {failed} without a solution. \
         The true errors of robot, plate and markers are drawn from the priors of the estimator; images of 48 circles with a noise of 0.05 px.\n\n\
         ## Normalised error squared\n\n\
         Mean of `e' C^-1 e / n` over the worlds, for the error `e` of a block of `n` parameters with its stated covariance `C`. It is 1 \
         where the stated uncertainty is true, above 1 where it is too small. In brackets: the 99 % interval about 1 for this number of worlds; \
         **bold** where the mean lies outside. \"flange\" is the pose of the flange in the plate frame at a joint vector that was not measured.\n\n\
         The robot's parameters are known a thousand times better in some directions than in others, and the good directions turn along the bad \
         ones. \"robot\" takes `C` half-way between estimate and truth, where the tangent is parallel to the error. It contains what the \
         uncertainty of the estimated joint noise adds, which also widens the interval (it is common to all parameters of a world); the second column takes the noise that was put in, and judges the covariance \
         alone. The third takes `C` at the estimate, as solution.json states it. What it misses is the curvature, not the size of any parameter (\"single \
         parameters\": mean of `e^2 / sigma^2` of each by itself) and not the flange.\n\n",
        made_with()
    );
    let _ = writeln!(out, "| joint noise, mrad | worlds | {} |", BLOCKS.join(" | "));
    let _ = writeln!(out, "|---|---|{}", "---|".repeat(BLOCKS.len()));
    for c in cells {
        let block = |b: &crate::study::BlockResult| {
            let mean = if b.holds() { format!("{:.3}", b.mean) } else { format!("**{:.3}**", b.mean) };
            format!("{mean} (+-{:.3})", b.half_width)
        };
        let blocks: Vec<String> = c.blocks.iter().map(block).collect();
        let _ = writeln!(out, "| {:.3} | {} | {} |", 1e3 * c.joint_noise_rad, c.worlds, blocks.join(" | "));
    }
    out += "\n## Joint noise\n\nRMS over the joints: mean over the worlds, its spread over the worlds, and the spread that the program states (half \
            its one-sigma interval). Then how often the noise put in lies within the stated 95 % interval: of the RMS, and of single joints. The data \
            tell a variance, with an error that is normal down to zero. What is not told from none (one-sided 1 %) counts as none: a noise of 0.0025 mrad seldom is, and its \
            sigmas are too small by as much as the table above says.\n\n\
            | put in, mrad | found, mrad | spread, mrad | stated spread, mrad | within 95 %, RMS | within 95 %, joints |\n\
            |---|---|---|---|---|---|\n";
    for c in cells {
        let mrad = [c.joint_noise_rad, c.found_rad, c.found_spread_rad, c.stated_spread_rad].map(|v| 1e3 * v);
        let _ = writeln!(
            out,
            "| {:.4} | {:.4} | {:.4} | {:.4} | {:.1} % | {:.1} % |",
            mrad[0],
            mrad[1],
            mrad[2],
            mrad[3],
            100.0 * c.within as f64 / c.worlds.max(1) as f64,
            100.0 * c.joints_within
        );
    }
    out
}
