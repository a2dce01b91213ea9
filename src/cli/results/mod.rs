//! Subcommands that identify a robot and tell of the result: `identify`, `compare` (other estimators beside it) and `show` (a result again).
//!
//! What they print is made in `summary` (the short answer), `long_table` and `at` (the flange at given joint vectors).

mod at;
pub mod compare;
pub mod identify;
pub mod long_table;
pub mod show;
pub mod summary;
