//! What is said on a terminal, and how: lines on stdout (`say`, `paragraph`), progress and stages of the work on stderr.

pub mod paragraph;
pub mod progress;
pub mod say;
pub mod stages;
