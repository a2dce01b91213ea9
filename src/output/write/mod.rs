//! The only place of this room that touches the disk.
//!
//! A result is written to a folder of its own and then changes places with the earlier one in a single step of the file
//! system; where that cannot be (a mount point, the current folder, a file system without that step), file by file after a
//! list of what is to be done, by which a run that was cut short is completed ([`recover`]). See *Decisions*, 6.

mod held;
mod journal;
mod kept;
mod new_result;
mod own;
mod place;
mod staging;
mod strays;
mod swap;
mod tree;

pub use new_result::{NewFolder, NewResult};
pub use own::is_changed;
pub use place::ResultFolder;
pub use strays::recover;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::error::Result;

/// Writes all files into `dir`, replacing an earlier result as a whole: a failure leaves `dir` as it was.
///
/// Files in `dir` that do not belong to the earlier result (notes, say) are kept; where one of that was changed since, nothing is written. Missing
/// parents are made.
///
/// # Errors
/// As [`ResultFolder::claim`] and [`NewResult::finish`]; anything that cannot be written.
pub fn write_all(dir: &Path, files: &BTreeMap<String, Vec<u8>>) -> Result<()> {
    let record = tree::RECORDS.into_iter().find(|record| files.contains_key(*record));
    ResultFolder::claim(dir, record.unwrap_or(tree::RECORDS[0]))?.write_all(files)
}

/// Writes files into a folder among whatever is there, all of them or none; none of them may be one of `inputs`, or take the place of a file that is
/// not this program's own as it wrote it. What it wrote before it kept a record is kept under another name.
///
/// # Errors
/// A file that is one of the inputs, or is there and somebody else's; anything that cannot be written or renamed.
pub fn write_beside(dir: &Path, files: &[(String, &[u8])], inputs: &[PathBuf]) -> Result<()> {
    ResultFolder::among(dir)?.write_beside(files, inputs)
}
