//! report.html: one self-contained page, made from the record in solution.json, with small pictures of images whose files are there.
//!
//! In the order of the data: `wording` (names and numbers in words) and `page` (the frame of a page, figures and their files) -> `figures` (what is drawn) ->
//! `chapters` -> the pages, this one, `poses_page` and `plan_page`.
//!
//! A new chapter is one function in `chapters/` and one row in [`chapters()`].

mod chapters;
mod figures;
mod first_page;
pub(crate) mod page;
mod plan_page;
mod poses_page;
mod wording;

pub use figures::thumbnails::{Shown, Thumbnail, Thumbnails};
pub use page::figure_files::FigureFile;
pub use plan_page::{plan_html, sigma_text};
pub use poses_page::poses_html;

use crate::output::solution_json::SolutionRecord;
use crate::output::verdict::Verdict;
use chapters::{
    bodies, coverage, findings, gallery, images, knowledge, parameters, pose_residuals, sections, two_stage,
};
use figures::scene;
use page::figure_files;
use page::frame::{Chapter, SCRIPT, STYLE, page_of_chapters};
use wording::words::count;

/// Name of the report.
pub const FILE_NAME: &str = "report.html";

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
    let seen = r.photogrammetry();
    let [scene, noise] = match r.has_no_robot() {
        true => ["Camera poses and plate", "Noise of the poses of the controller"],
        false => ["Arm, camera poses and plate", "Joint noise"],
    };
    let ended = format!("; the last solve {} after {} in all", r.status, count(r.iterations, "step"));
    vec![
        Chapter::new("accuracy", "Accuracy before and after", sections::accuracy(r)),
        Chapter::new("findings", "Findings, and what to do", findings::section(&Verdict::of(r), &r.notices)),
        Chapter::new("left-out", "What was read, and what was left out", sections::left_out(r)),
        Chapter::new("pictures", "Pictures: best, worst and left out", gallery::gallery(seen, pictures)),
        Chapter::new("scene", scene, scene::section(r)),
        Chapter::new("coverage", "What the stops covered", coverage::section(r)),
        Chapter::new("bodies", "Trackers and contacts", bodies::section(r)),
        Chapter::new("images", "Residuals by image", images::table(r)),
        Chapter::new("pose-residuals", "Pose residuals by image", pose_residuals::section(r)),
        Chapter::new("residuals", "Residuals", sections::residuals(seen)),
        Chapter::new("workspace", "How well the flange is known where", knowledge::workspace(r)),
        Chapter::new("corrections", "What was corrected on the robot", parameters::robot(r)),
        Chapter::new("undetermined", "What the data could not determine", parameters::undetermined(r)),
        Chapter::new("known", "What the data tell, and what to measure next", knowledge::identifiable(r)),
        Chapter::new("two-step", "Two-step calibration", two_stage::section(r)),
        Chapter::new("joint-noise", noise, sections::joint_noise(r)),
        Chapter::new("poses", "Hand-eye transform and target pose", parameters::placed(r)),
        Chapter::new("cameras", "Camera", parameters::cameras(seen)),
        Chapter::new("plate", "Plate", sections::plates(seen)),
        Chapter::new("starts", "Starting values", sections::starts(seen)),
        Chapter::new("record", "For the record", sections::record(seen, &ended)),
    ]
}
