//! report.html: one self-contained page, made from the record in solution.json and nothing else.
//!
//! A new section is one function in `sections`, `parameters` or `images` and one row in [`report_html`].

mod figure;
mod images;
mod knowledge;
mod maps;
pub(crate) mod page;
mod parameters;
mod plan_page;
mod plan_pictures;
mod plots;
mod sections;
pub(crate) mod svg;
mod two_stage;
mod words;

pub use plan_page::{plan_html, sigma_text};

use maud::html;

use crate::output::solution_json::SolutionRecord;

const STYLE: &str = include_str!("style.css");

/// The page.
pub fn report_html(record: &SolutionRecord) -> String {
    let body = html! {
        (sections::head(record))
        (sections::accuracy(record))
        (knowledge::workspace(record))
        (two_stage::section(record))
        (sections::left_out(record))
        (sections::joint_noise(record))
        (sections::residuals(record))
        (parameters::robot(record))
        (parameters::undetermined(record))
        (knowledge::identifiable(record))
        (parameters::placed(record))
        (parameters::cameras(record))
        (sections::plates(record))
        (images::table(record))
        (sections::starts(record))
        (sections::record(record))
    };
    page::page(&format!("Calibration of {}", record.robot.name), STYLE, &body)
}
