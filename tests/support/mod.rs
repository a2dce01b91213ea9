//! What several integration tests share.
#![allow(dead_code)]

pub mod by_poses;
pub mod couplings;
pub mod dense;
pub mod displaced;
pub mod flange;
pub mod small;
pub mod witness;
