//! What readers, detector and the choice of the lens noticed.

use std::fmt;

use super::kind::{Kind, Subject, Weight};
use crate::error::{Code, Notice};

/// A notice of a room below.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Noticed(pub Notice);

impl fmt::Display for Noticed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl Kind for Noticed {
    fn code(&self) -> Code {
        self.0.code
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn subjects(&self) -> Vec<Subject> {
        vec![Subject::Place(self.0.place.clone())]
    }

    fn notice(&self) -> Notice {
        self.0.clone()
    }
}
