//! Markers that lie far from where their plate says are let go: by their tolerance they would pull its size and shape their way.

use crate::assess::Limits;
use crate::diagnose::markers_off;
use crate::problem::{Adjustment, seen_markers};

/// Lets go of more of them; true where there are any. Where they are more than a few of a plate, it is the plate that is not as its file says.
pub(super) fn let_go(adjustment: &mut Adjustment, limits: &Limits) -> bool {
    let off = markers_off(adjustment, limits);
    let problem = &mut adjustment.problem;
    let before = problem.moved_markers.len();
    for plate in 0..problem.plates.len() {
        let own = off.iter().filter(|(p, _)| *p == plate);
        let most = limits.share_of_markers_moved * seen_markers(problem, plate).len() as f64;
        if own.clone().count() as f64 <= most {
            problem.moved_markers.extend(own);
        }
    }
    problem.moved_markers.len() > before
}
