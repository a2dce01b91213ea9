//! What several integration tests share.
#![allow(dead_code, missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

pub mod dense;
pub mod small;
pub mod witness;
