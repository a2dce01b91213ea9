//! Variables that routines in none of the files are given.

/// A variable that a routine in none of the files is given.
#[derive(Debug)]
pub(super) struct Given {
    pub name: String,
    pub routine: String,
    /// File and line of what it held, where a statement of the text above had set it.
    pub place: Option<(usize, usize)>,
}
