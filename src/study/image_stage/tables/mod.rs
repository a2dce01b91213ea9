//! The report on the image stage: what it reaches on rendered pictures, one section for each part of the study.
//!
//! A new part is a file here that returns a [`Section`], and a variant of `Part` in `cli/images/image_study.rs`.

mod bias;
mod identity;
mod precision;
mod precision_plot;

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::study::made_with::made_with;

pub use bias::bias_section;
pub use identity::identity_section;
pub use precision::precision_section;

/// One part of the report.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// Heading.
    pub title: String,
    /// What was to be shown, and whether it was.
    pub claims: Vec<Claim>,
    /// Setup and tables, as Markdown.
    pub text: String,
    /// File name and SVG of every plot, shown at the end of the section.
    pub plots: Vec<(String, String)>,
}

/// Something that was to be shown.
#[derive(Debug, Clone, PartialEq)]
pub struct Claim {
    /// In words, with the limit and the figure reached.
    pub words: String,
    /// Whether it holds.
    pub holds: bool,
}

impl Claim {
    /// One line for terminal and report.
    pub fn line(&self) -> String {
        format!("{}: {}", if self.holds { "holds" } else { "FAILS" }, self.words)
    }
}

/// Name of the report.
pub const REPORT: &str = "image-stage.md";

/// The report and its plots: file name -> bytes. `command` makes it.
pub fn image_study_files(sections: &[Section], command: &str) -> BTreeMap<String, Vec<u8>> {
    let mut text = format!("# The image stage on rendered pictures\n\nMade by `{command}` ({}).\n", made_with());
    let mut files = BTreeMap::new();
    for section in sections {
        let _ = write!(text, "\n## {}\n\n", section.title);
        section.claims.iter().for_each(|c| text += &format!("- **{}**\n", c.line()));
        let _ = write!(text, "\n{}\n", section.text.trim_end());
        for (name, svg) in &section.plots {
            let _ = write!(text, "\n![{}]({name})\n", section.title);
            files.insert(name.clone(), svg.clone().into_bytes());
        }
    }
    files.insert(REPORT.to_owned(), text.into_bytes());
    files
}
