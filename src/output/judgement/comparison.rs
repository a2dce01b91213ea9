//! The comparison of estimators as Markdown.

use crate::assess::Ratio;
use crate::identify::{Comparison, ComparisonRow, HeldOut};

/// A ratio with its interval, a dash where there is none.
pub fn ratio_text(ratio: Option<Ratio>) -> String {
    ratio.map_or_else(|| "-".into(), |r| r.to_string())
}

fn markdown_row(row: &ComparisonRow, with_truth: bool) -> String {
    let held = |h: Option<HeldOut>| match h {
        None => " - | - | - |".to_owned(),
        Some(h) => format!(" {:.3} | {:.4} | {} |", h.rms_px, h.rms_mm, ratio_text(h.to_joint)),
    };
    let truth = match row.truth {
        _ if !with_truth => String::new(),
        None => " no solution | - |".to_owned(),
        Some(t) => format!(" {:.4} | {:.4} |", t.flange_mm, t.camera_mm),
    };
    let estimator = format!("| {} {} |", row.estimator.letter(), row.estimator.title());
    estimator + &held(row.by_image) + &held(row.by_region) + &truth + "\n"
}

/// A comparison as a Markdown table.
pub fn comparison_markdown(comparison: &Comparison) -> String {
    let regions = match comparison.folds[1] {
        0 => "; too few postures to hold regions of the workspace out".to_owned(),
        count => format!(" and in {count} regions of the workspace"),
    };
    let mut out = format!(
        "{} images of the robot; each held out once, in {} folds{regions} (images that share joint readings stay together).\n\
         The same observations, outliers, priors and frames for all estimators.\n\
         mm: RMS distance at the plate between where an unseen image shows the markers and where the joint readings put them.\n\
         to F: its ratio to the joint fit, with the 95 % bootstrap interval over images (those that share joint readings count once). The joint fit keeps the noise \
         that the whole series showed, as in the accuracy that `identify` prints; the others find theirs anew.\n\n",
        comparison.images, comparison.folds[0]
    );
    let with_truth = comparison.rows.iter().any(|r| r.truth.is_some());
    out.push_str("| estimator | by image px | mm | to F | by region px | mm | to F |");
    out.push_str(if with_truth { " flange mm | camera mm |\n" } else { "\n" });
    out.push_str("|---|---|---|---|---|---|---|");
    out.push_str(if with_truth { "---|---|\n" } else { "\n" });
    comparison.rows.iter().for_each(|row| out += &markdown_row(row, with_truth));
    if with_truth {
        out.push_str(
            "\nflange: RMS error of the flange relative to the plate at readings that took no part, plate and tool frames aligned; \
             camera: that of the camera in the plate frame, nothing aligned; both fitted to all images.\n",
        );
    }
    out
}
