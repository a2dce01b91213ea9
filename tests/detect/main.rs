//! Tests of detect; one binary, a file a subject.

#![allow(missing_docs, clippy::expect_used, clippy::panic, clippy::unwrap_used)]

#[path = "../boards_scene/mod.rs"]
mod boards_scene;
#[path = "../circles_support/mod.rs"]
mod circles_support;
#[path = "../support/command.rs"]
mod program;
#[path = "../support/robots.rs"]
mod robots;
#[path = "../said/mod.rs"]
mod said;

mod board_views;
mod boards_charuco;
mod boards_chessboard;
mod boards_files;
mod boards_real;
mod circles;
mod command;
mod corners_rendered;
mod drawn_dots;
mod fisheye;
mod grids;
mod image_stage;
mod puzzleboards;
mod tags;
mod tags_disturbed;
