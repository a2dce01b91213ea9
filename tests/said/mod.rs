//! What the program says is known by its code, and by the names and numbers in it: files with lines, images, joints, keys, flags.

#![allow(dead_code)]

use robotcal::{Code, Error, Notice};

/// Something with a code that names places.
pub trait Said {
    fn code(&self) -> Option<Code>;
    fn text(&self) -> String;
}

impl Said for Error {
    fn code(&self) -> Option<Code> {
        Some(self.code)
    }

    fn text(&self) -> String {
        self.to_string()
    }
}

impl Said for Notice {
    fn code(&self) -> Option<Code> {
        Some(self.code)
    }

    fn text(&self) -> String {
        self.to_string()
    }
}

/// What the program printed: the code is that of its error.
impl Said for String {
    fn code(&self) -> Option<Code> {
        let name = self.lines().find_map(|l| l.strip_prefix("error[")?.split(']').next())?;
        Some(*Code::ALL.iter().find(|c| c.name() == name).unwrap())
    }

    fn text(&self) -> String {
        self.clone()
    }
}

/// Holds that `said` has the code and names all of these: no sentences here.
#[track_caller]
pub fn assert_says(said: &impl Said, code: Code, names: &[&str]) {
    let text = said.text();
    assert_eq!(said.code(), Some(code), "{text}");
    for name in names {
        assert!(text.contains(name), "{name:?} not in:\n{text}");
    }
}
