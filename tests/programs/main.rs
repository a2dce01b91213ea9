//! Tests of programs; one binary, a file a subject.

#![allow(missing_docs, clippy::expect_used, clippy::panic, clippy::unwrap_used)]

#[path = "../programs_support/mod.rs"]
mod programs_support;
#[path = "../support/robots.rs"]
mod robots;
#[path = "../said/mod.rs"]
mod said;

mod across_files;
mod changing;
mod external_axes;
mod frames;
mod frames_study;
mod given;
mod interrupts;
mod krl;
mod krl_statements;
mod loops;
mod not_told;
mod plan_choice;
mod plan_poses;
mod promise;
mod rapid;
mod rapid_handlers;
mod rapid_statements;
mod references;
mod retarget;
mod scopes;
mod script_calls;
mod several_frames;
mod stated_frames;
mod urscript;
mod used;
mod ways;
