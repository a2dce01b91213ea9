//! What a result is worth, in words and numbers for people.
//!
//! `verdict` judges one solution and `parameter_words` names its parameters; `difference` holds two solutions against each other, `comparison` estimators;
//! `corrections` says what a corrected program is worth.

pub mod comparison;
pub mod corrections;
pub mod difference;
pub mod parameter_words;
pub mod verdict;
pub mod written_programs;
