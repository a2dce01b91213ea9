//! Robot programs as text with targets in it: read, corrected for the real robot, written back with every other byte as it was.
//!
//! | file | what |
//! |---|---|
//! | [`field`] | one number in the text, and its replacement |
//! | [`program`] | targets: joints or a pose, made of fields |
//! | [`codes`] | status and turn, confdata: which posture a pose means |
//! | [`posture`] | which joints a pose means |
//! | [`mod@compensate`] | targets of one robot to targets of another |
//! | `scan` | tokens that all languages share |
//! | `table`, `krl`, `rapid`, `urscript` | text -> targets |
//!
//! To add a language: a file that turns texts into a [`Program`], a variant of [`Language`] with its rows in this file.

pub mod codes;
pub mod compensate;
pub mod field;
mod itinerary;
mod krl;
pub mod posture;
pub mod program;
mod rapid;
mod scan;
mod setting;
mod table;
mod text_file;
mod urscript;

use std::path::Path;

pub use compensate::{Correction, Models, Outcome, Postures, compensate};
pub use posture::Known;
pub use program::{Kind, Left, Program, Target};
pub use setting::Setting;
pub use text_file::TextFile;

use crate::error::{Error, Result};

/// Languages of programs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Language {
    /// A table of joint targets or flange poses.
    Csv,
    /// KUKA KRL: .src and .dat.
    Krl,
    /// ABB RAPID.
    Rapid,
    /// Universal Robots URScript.
    UrScript,
}

/// Extensions of the files of each language.
const EXTENSIONS: [(&str, Language); 9] = [
    ("csv", Language::Csv),
    ("src", Language::Krl),
    ("dat", Language::Krl),
    ("mod", Language::Rapid),
    ("modx", Language::Rapid),
    ("prg", Language::Rapid),
    ("sys", Language::Rapid),
    ("script", Language::UrScript),
    ("urscript", Language::UrScript),
];

impl Language {
    /// The language that the name of a file tells.
    ///
    /// # Errors
    /// An extension that no language has.
    pub fn of_file(path: &Path) -> Result<Self> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        EXTENSIONS.iter().find(|(e, _)| *e == extension).map(|(_, language)| *language).ok_or_else(|| {
            let known: Vec<&str> = EXTENSIONS.iter().map(|(e, _)| *e).collect();
            let what = "its extension tells no language of programs";
            Error::input(path.display(), what, format!("rename it (known are {}) or give --language", known.join(", ")))
        })
    }
}

/// Finds the targets of a program of one or more files (a module and its data).
///
/// # Errors
/// Text that the language does not allow, by file and line.
pub fn read(language: Language, files: Vec<TextFile>, setting: &Setting<'_>) -> Result<Program> {
    match language {
        Language::Csv => table::read(files, setting),
        Language::Krl => krl::read(files, setting),
        Language::Rapid => rapid::read(files, setting),
        Language::UrScript => urscript::read(files, setting),
    }
}
