//! Tests of structure; one binary, a file a subject.

#![allow(missing_docs, clippy::expect_used, clippy::panic, clippy::unwrap_used)]

mod apart;
mod architecture;
mod circles;
mod codes;
mod features;
mod imports;
mod limits;
mod pages;
mod random;
mod sentences;
