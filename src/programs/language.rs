//! The table of languages of robot programs.

use std::path::Path;

use super::program::Program;
use super::setting::ProgramSetting;
use super::text_file::TextFile;
use super::{foreign, frame_text, krl, rapid, table, urscript};
use crate::error::{Code, Error, Result};
use crate::geom::{Pose, exp_so3};

/// What a language has to say of itself.
struct Row {
    /// Its name on the command line.
    name: &'static str,
    /// What it is, in words.
    words: &'static str,
    /// Extensions of its files, in lower case.
    extensions: &'static [&'static str],
    /// Finds the targets in the texts.
    read: fn(Vec<TextFile>, &ProgramSetting<'_>) -> Result<Program>,
    /// A frame as this language writes it, from its numbers; `None` for another count of them.
    frame: fn(&[f64]) -> Option<Pose>,
    /// These numbers in words.
    frame_numbers: &'static str,
    /// The numbers of a frame in the brackets of this language.
    in_brackets: fn(&str) -> Option<Vec<f64>>,
}

/// From rows to the enum and all that asks which language it is.
macro_rules! languages {
    ($($(#[$doc:meta])* $language:ident $row:tt)+) => {
        /// Languages of programs.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Language {
            $($(#[$doc])* $language,)+
        }

        impl Language {
            /// All languages.
            pub const ALL: &[Self] = &[$(Self::$language),+];

            fn row(self) -> Row {
                match self { $(Self::$language => Row $row,)+ }
            }
        }
    };
}

languages! {
    /// A table of joint targets or flange poses.
    Csv {
        name: "csv",
        words: "Table of joints or flange poses",
        extensions: &["csv"],
        read: table::read,
        frame: |numbers| match *numbers {
            [x, y, z, qx, qy, qz, qw] => Some(Pose::from_xyz_quaternion([x, y, z], [qx, qy, qz, qw])),
            _ => None,
        },
        frame_numbers: "x_m,y_m,z_m,qx,qy,qz,qw",
        in_brackets: |_| None,
    }
    /// KUKA KRL: .src and .dat.
    Krl {
        name: "krl",
        words: "KUKA KRL",
        extensions: &["src", "dat"],
        read: krl::read,
        frame: |numbers| match *numbers {
            [x, y, z, a, b, c] => {
                Some(Pose::from_xyz_rpy([x, y, z].map(|v| 1e-3 * v), [c, b, a].map(f64::to_radians)))
            }
            _ => None,
        },
        frame_numbers: "X,Y,Z,A,B,C in mm and deg, or {X ..,Y ..,Z ..,A ..,B ..,C ..}",
        in_brackets: frame_text::krl,
    }
    /// ABB RAPID.
    Rapid {
        name: "rapid",
        words: "ABB RAPID",
        extensions: &["mod", "modx", "prg", "sys"],
        read: rapid::read,
        frame: |numbers| match *numbers {
            [x, y, z, q1, q2, q3, q4] => Some(Pose::from_xyz_quaternion([x, y, z].map(|v| 1e-3 * v), [q2, q3, q4, q1])),
            _ => None,
        },
        frame_numbers: "x,y,z,q1,q2,q3,q4 in mm, q1 the scalar part, or [[x,y,z],[q1,q2,q3,q4]]",
        in_brackets: frame_text::rapid,
    }
    /// Universal Robots URScript.
    UrScript {
        name: "urscript",
        words: "Universal Robots URScript",
        extensions: &["script", "urscript"],
        read: urscript::read,
        frame: |numbers| match *numbers {
            [x, y, z, rx, ry, rz] => Some(Pose::new(exp_so3(&[rx, ry, rz].into()), [x, y, z].into())),
            _ => None,
        },
        frame_numbers: "x,y,z,rx,ry,rz in m and rad, or p[x,y,z,rx,ry,rz]",
        in_brackets: frame_text::urscript,
    }
}

impl Language {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// What it is, in words.
    pub fn words(self) -> &'static str {
        self.row().words
    }

    /// The language that the name of a file tells.
    ///
    /// # Errors
    /// An extension that no language has.
    pub fn of_file(path: &Path) -> Result<Self> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let found = Self::ALL.iter().find(|l| l.row().extensions.contains(&extension.as_str()));
        found.copied().ok_or_else(|| {
            if let Some(words) = foreign::program(&extension) {
                let what = format!("is a program in {words}, by its extension, which compensate does not read");
                let remedy = "write its targets to a table (.csv); or give --language where it is in another one";
                return Error::new(Code::ProgramLanguage, path.display(), what, remedy);
            }
            let known: Vec<&str> = Self::ALL.iter().flat_map(|l| l.row().extensions).copied().collect();
            let what = "its extension tells no language of programs";
            Error::new(
                Code::ProgramLanguage,
                path.display(),
                what,
                format!(
                    "write its targets to a table (.csv); or, where it is in a language of these, rename it ({}) or give --language",
                    known.join(", ")
                ),
            )
        })
    }

    /// A frame as a user writes it: its numbers, separated by commas, or as it stands in the language.
    ///
    /// # Errors
    /// Anything else; the text says what is needed.
    pub fn frame(self, text: &str) -> std::result::Result<Pose, &'static str> {
        let row = self.row();
        let numbers = frame_text::list(text).or_else(|| (row.in_brackets)(text));
        numbers.and_then(|numbers| (row.frame)(&numbers)).ok_or(row.frame_numbers)
    }
}

/// Finds the targets of a program of one or more files (a module and its data).
///
/// # Errors
/// Text that the language does not allow, by file and line.
pub fn read(language: Language, files: Vec<TextFile>, setting: &ProgramSetting<'_>) -> Result<Program> {
    (language.row().read)(files, setting)
}
