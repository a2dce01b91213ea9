//! What readers, detector and the choice of the lens noticed.

use super::kind::{Kind, Subject, Weight};
use crate::error::{Code, Notice};

/// A notice of a room below.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Noticed(pub Notice);

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

    fn place(&self) -> String {
        self.0.place.clone()
    }

    fn seen(&self) -> String {
        self.0.what.clone()
    }

    fn remedy(&self) -> String {
        self.0.remedy.clone()
    }
}
