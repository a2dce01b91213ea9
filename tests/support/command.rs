//! `robotcal` as a user calls it.

#![allow(dead_code)]

use std::process::{Command, Output};

pub fn robotcal(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_robotcal")).args(args).output().unwrap()
}

/// What it said, stdout first.
pub fn text(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}
