//! What the views of several cameras at the same stops have in common.

/// The stops that several cameras saw together.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Run {
    /// Name of the series folder.
    pub name: String,
    /// Where some cameras are in the hand and others are fixed: they see different plates.
    pub has_mixed_mounts: bool,
    /// For every stop of the view, its place among the stops of the folder.
    pub rows: Vec<usize>,
}
