//! Several solves at a time, or one after the other where each needs much memory.

use rayon::prelude::*;

use crate::problem::Problem;

/// Stops beyond which adjustments are worked on one by one.
const MANY: usize = 2000;

/// What `work` makes of `all` and their numbers, each by an adjustment of about the size of `problem`: as many at a time as there are threads.
pub fn side_by_side<A: Sync, T: Send>(problem: &Problem, all: &[A], work: impl Fn(usize, &A) -> T + Sync) -> Vec<T> {
    let at_a_time = if problem.stops.len() > MANY { 1 } else { rayon::current_num_threads().max(1) };
    let numbered: Vec<(usize, &A)> = all.iter().enumerate().collect();
    let of_some = |some: &[(usize, &A)]| some.par_iter().map(|(k, one)| work(*k, one)).collect::<Vec<T>>();
    numbered.chunks(at_a_time).flat_map(of_some).collect()
}
