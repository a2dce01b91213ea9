//! Tests of outputs; one binary, a file a subject.

#![allow(missing_docs, clippy::expect_used, clippy::panic, clippy::unwrap_used)]

#[path = "../outputs_support/mod.rs"]
mod outputs_support;
#[path = "../support/command.rs"]
mod program;
#[path = "../support/robots.rs"]
mod robots;
#[path = "../support/mod.rs"]
mod support;

mod controller;
mod gauge;
mod plate_frame;
mod poses;
mod report;
mod verify_points;
mod verify_series;
mod whole;
mod write;
