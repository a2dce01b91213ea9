//! Tests of world; one binary, a file a subject.

mod bad;
mod commands;
mod golden;
mod render;
mod series;
