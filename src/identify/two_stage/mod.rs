//! The estimators in two stages: camera poses first, then the robot from them.
//!
//! `fit` has all of them; `staged` makes a whole result of one; `compare` puts them beside the joint fit, into a `Comparison`.

mod block_diagonal;
pub(super) mod compare;
pub(super) mod fit;
pub(super) mod staged;
