//! report.html: one self-contained page, made from the record in solution.json, with small pictures of images whose files are there.
//!
//! A new chapter is one function and one row in [`chapters`].

mod bodies;
mod coverage;
mod describe;
mod figure;
mod figure_files;
mod findings;
mod first_page;
mod gallery;
mod images;
mod knowledge;
mod many;
mod maps;
pub(crate) mod page;
mod parameters;
mod plan_page;
mod plan_pictures;
mod plots;
mod pose_residuals;
mod scene;
mod sections;
pub(crate) mod svg;
mod thumbnails;
mod two_stage;
mod words;

pub use figure_files::FigureFile;
pub use plan_page::{plan_html, sigma_text};
pub use thumbnails::{Shown, Thumbnail, Thumbnails};

use maud::Markup;

use crate::output::solution_json::SolutionRecord;
use page::{Chapter, page_of_chapters};

const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("report.js");

/// The page.
pub fn report_html(record: &SolutionRecord, pictures: &Thumbnails) -> String {
    let title = format!("Calibration of {}", record.robot.name);
    page_of_chapters(&title, STYLE, SCRIPT, &first_page::first_page(record), &chapters(record, pictures))
}

/// Every figure of the report but the pictures.
pub fn figure_files(record: &SolutionRecord) -> Vec<FigureFile> {
    figure_files::drawn(&chapters(record, &Thumbnails::default()), STYLE)
}

/// All chapters; those without content are left out.
fn chapters(r: &SolutionRecord, pictures: &Thumbnails) -> Vec<Chapter> {
    let chapter = |id: &'static str, title: &str, body: Markup| Chapter { id, title: title.to_owned(), body };
    vec![
        chapter("accuracy", "Accuracy before and after", sections::accuracy(r)),
        chapter("findings", "Findings, and what to do", findings::section(r)),
        chapter("left-out", "What was read, and what was left out", sections::left_out(r)),
        chapter("pictures", "Pictures: best, worst and left out", gallery::gallery(r, pictures)),
        chapter("scene", "Arm, camera poses and plate", scene::section(r)),
        chapter("coverage", "What the stops covered", coverage::section(r)),
        chapter("bodies", "Trackers and contacts", bodies::section(r)),
        chapter("images", "Residuals by image", images::table(r)),
        chapter("pose-residuals", "Pose residuals by image", pose_residuals::section(r)),
        chapter("residuals", "Residuals", sections::residuals(r)),
        chapter("workspace", "How well the flange is known where", knowledge::workspace(r)),
        chapter("corrections", "What was corrected on the robot", parameters::robot(r)),
        chapter("undetermined", "What the data could not determine", parameters::undetermined(r)),
        chapter("known", "What the data tell, and what to measure next", knowledge::identifiable(r)),
        chapter("two-step", "Two-step calibration", two_stage::section(r)),
        chapter("joint-noise", "Joint noise", sections::joint_noise(r)),
        chapter("poses", "Hand-eye transform and target pose", parameters::placed(r)),
        chapter("cameras", "Camera", parameters::cameras(r)),
        chapter("plate", "Plate", sections::plates(r)),
        chapter("starts", "Starting values", sections::starts(r)),
        chapter("record", "For the record", sections::record(r)),
    ]
}
