//! solution.json: its records, made from a solution, written, checked and read back.
//!
//! In the order of the data: `estimates` and `residuals` take the numbers from a fit; `image_records` and `solution_record` make the records, whose
//! types stand in `solution_json`, `photogrammetry` (what results of `identify` and of `poses` have in common) and the files `.._record`; `bytes` writes
//! and reads them, `check` judges what was read, and `restore` makes models and series of it again.

pub mod bodies_record;
pub mod bytes;
mod check;
pub mod estimates;
pub mod finding_record;
pub mod image_records;
mod mounts;
pub mod photogrammetry;
pub mod pose_record;
pub mod residuals;
pub mod restore;
mod series_record;
pub mod solution_json;
pub mod solution_record;
