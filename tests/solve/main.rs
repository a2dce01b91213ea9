//! Tests of solve; one binary, a file a subject.

#![allow(missing_docs, clippy::expect_used, clippy::panic, clippy::unwrap_used)]

#[path = "../outputs_support/mod.rs"]
mod outputs_support;
#[path = "../support/robots.rs"]
mod robots;
#[path = "../said/mod.rs"]
mod said;
#[path = "../support/mod.rs"]
mod support;

mod between_series;
mod bodies;
mod cameras;
mod carried;
mod causes;
mod controller_poses;
mod coverage;
mod diagnosis;
mod few_points;
mod knowledge;
mod lens_study;
mod marker_tolerance;
mod measured_worlds;
mod mirror_image;
mod mixtures;
mod moved_in_time;
mod normal_equations;
mod open_turns;
mod patterns;
mod plate_size;
mod random_worlds;
mod real_tracker;
mod refits;
mod second_pass;
mod solver_laws;
mod stated_lengths;
mod tracker_rows;
mod two_stage;
mod zeros;
