//! One file of a robot program.

/// One file of a program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TextFile {
    /// Name for messages.
    pub name: String,
    /// Its bytes, in whatever encoding its comments are.
    pub bytes: Vec<u8>,
}
