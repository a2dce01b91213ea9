//! Tests of world; one binary, a file a subject.

#![allow(missing_docs, clippy::expect_used, clippy::panic, clippy::unwrap_used)]

mod again;
mod bad;
mod commands;
mod crossover;
mod golden;
mod odd_image;
mod poses_report;
#[path = "../support/command.rs"]
mod program;
mod render;
#[path = "../support/robots.rs"]
mod robots;
#[path = "../said/mod.rs"]
mod said;
mod series;
mod several_series;
