//! Tests of world; one binary, a file a subject.

mod again;
mod bad;
mod commands;
mod golden;
mod render;
#[path = "../said/mod.rs"]
mod said;
mod series;
