//! report.html: one self-contained page, made from the record in solution.json and nothing else.
//!
//! A new section is one function in `sections`, `parameters` or `images` and one row in [`report_html`].

mod images;
mod knowledge;
mod maps;
mod parameters;
mod plan_page;
mod plan_pictures;
mod plots;
mod sections;
pub(super) mod svg;
mod verdict;
mod words;

pub use plan_page::{plan_html, sigma_text};

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::output::solution_json::SolutionRecord;

const STYLE: &str = include_str!("style.css");

/// The page.
pub fn report_html(record: &SolutionRecord) -> String {
    let page: Markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "Calibration of " (record.robot.name) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                (sections::head(record))
                (sections::accuracy(record))
                (knowledge::workspace(record))
                (sections::left_out(record))
                (sections::joint_noise(record))
                (sections::residuals(record))
                (parameters::robot(record))
                (parameters::undetermined(record))
                (knowledge::told(record))
                (parameters::placed(record))
                (parameters::cameras(record))
                (sections::plates(record))
                (images::table(record))
                (sections::starts(record))
                (sections::record(record))
            }
        }
    };
    page.into_string()
}

/// A figure with its caption.
fn figure(svg: &str, caption: &str) -> Markup {
    html! { figure { (PreEscaped(svg)) figcaption { (caption) } } }
}
