//! Tests of readers; one binary, a file a subject.

#![allow(missing_docs, clippy::expect_used, clippy::panic, clippy::unwrap_used)]

#[path = "../../fuzz/readers.rs"]
mod readers;
#[path = "../recording_support/mod.rs"]
mod recording_support;
#[path = "../support/robots.rs"]
mod robots;
#[path = "../said/mod.rs"]
mod said;

mod controller;
mod hostile;
mod images;
mod mcap;
mod parts;
mod plate;
mod real;
mod recorded;
mod recording_overlay;
mod series;
mod simulated;
mod spatial;
mod urdf;
mod urdf_patch;
