//! The verdict: may this result be used?

use super::words::{count, significant};
use crate::output::solution_json::SolutionRecord;

/// What stands at the top of the report.
pub(super) struct Verdict {
    /// CSS class: good, care, failed.
    pub class: &'static str,
    /// One line.
    pub headline: &'static str,
    /// Why, in sentences.
    pub reasons: Vec<String>,
}

/// Images of the robot below which the nominal model decides much of the result.
const FEW_IMAGES: usize = 20;

/// Share of images left out that asks for a look.
const MUCH_LEFT_OUT: f64 = 0.1;

/// Gain on held-out images below which a new model is hardly worth installing.
const SMALL_GAIN: f64 = 1.3;

/// A single image this many times worse than the RMS of all asks for a look.
const ODD_IMAGE: f64 = 3.0;

/// The verdict on a result: failed gates first, then what asks for care.
pub(super) fn verdict(record: &SolutionRecord) -> Verdict {
    if !record.failed_gates.is_empty() {
        return Verdict {
            class: "failed",
            headline: "Failed: do not use this model before the cause is found",
            reasons: record.failed_gates.clone(),
        };
    }
    let reasons = cares(record);
    match reasons.is_empty() {
        true => Verdict { class: "good", headline: "Good: the corrected model can be used", reasons },
        false => Verdict { class: "care", headline: "Use with care: look at the points below first", reasons },
    }
}

fn cares(record: &SolutionRecord) -> Vec<String> {
    let mut reasons = Vec::new();
    let on_robot = || record.images.iter().filter(|i| i.readings.is_some());
    let (all, used) = (on_robot().count(), on_robot().filter(|i| i.reason.is_none()).count());
    if used < FEW_IMAGES {
        reasons.push(format!(
            "Only {} of the robot took part; with fewer than {FEW_IMAGES} the nominal model decides much of the result. Take 30 to 50.",
            count(used, "image")
        ));
    }
    if (all - used) as f64 > MUCH_LEFT_OUT * all as f64 {
        reasons.push(format!("{} of {all} images of the robot were left out; the reasons are below.", all - used));
    }
    let (before, after) = (&record.accuracy.nominal, &record.accuracy.calibrated);
    if after.rms_mm * SMALL_GAIN > before.rms_mm {
        reasons.push(format!(
            "The gain is small: {} mm before, {} mm after. The robot repeats no better than this, or the stops are too much alike.",
            significant(before.rms_mm),
            significant(after.rms_mm)
        ));
    }
    if after.worst_mm > ODD_IMAGE * after.rms_mm {
        reasons.push(format!(
            "One image is off by {} mm, far more than the others; see the table of images.",
            significant(after.worst_mm)
        ));
    }
    reasons
}
