//! The planning study as Markdown.

use super::planning::{PlanStudy, PlanStudyRequest};
use crate::study::made_with::made_with;

/// A study as a table in Markdown.
pub fn study_table(robot: &str, request: &PlanStudyRequest, study: &PlanStudy) -> String {
    let [found, predicted, random, random_predicted] = study.overall_m().map(|m| 1e3 * m);
    let mut text = format!(
        "## {robot}: {} planned images against {} random ones, {} worlds\n\nMade with {}.\n\n\
         | | found, mm | predicted, mm | predicted / found |\n|---|---|---|---|\n\
         | {} planned | {found:.4} | {predicted:.4} | {:.3} |\n\
         | {} random | {random:.4} | {random_predicted:.4} | {:.3} |\n\n",
        request.planned,
        request.random,
        study.rows.len(),
        made_with(),
        request.planned,
        predicted / found,
        request.random,
        random_predicted / random,
    );
    if let Some(r) = &study.planned_to_random {
        text += &format!(
            "Planned over random: {:.3} (95 % of resampled worlds: {:.3} to {:.3}).\n",
            r.value, r.low, r.high
        );
    }
    let [planned, drawn] = study.views_m().map(|m| 1e3 * m);
    text += &format!("Over held-out views of the plate: {planned:.4} mm planned, {drawn:.4} mm random.\n");
    let least = |k: usize| study.rows.iter().map(|r| r.efficiency[k]).fold(1.0, f64::min);
    text += &format!("Least certified efficiency: relaxation {:.4}, whole images {:.4}.\n", least(0), least(1));
    text += "\n| world | planned, found mm | predicted | random, found mm | predicted |\n|---|---|---|---|---|\n";
    for r in &study.rows {
        let [a, b] = r.planned_m.map(|m| 1e3 * m);
        let [c, d] = r.random_m.map(|m| 1e3 * m);
        text += &format!("| {} | {a:.4} | {b:.4} | {c:.4} | {d:.4} |\n", r.seed);
    }
    for (seed, reason) in &study.failed {
        text += &format!("World {seed} was left out: {}\n", reason.replace('\n', " "));
    }
    text + "\n"
}
