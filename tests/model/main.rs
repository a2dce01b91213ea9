//! Tests of model; one binary, a file a subject.

#![allow(missing_docs, clippy::expect_used, clippy::panic, clippy::unwrap_used)]

#[path = "../support/robots.rs"]
mod robots;
#[path = "../support/mod.rs"]
mod support;

mod displacement_field;
mod extended_robot;
mod gravity;
mod independent;
mod jacobians;
mod lenses;
mod mirror;
