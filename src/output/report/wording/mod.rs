//! What is said: `words` for names and numbers, `describe` for an image in a line, `many` where only some of very many are shown.

pub(super) mod describe;
pub(super) mod many;
pub(super) mod words;
