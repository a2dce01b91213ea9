//! Markers that lie far from where their plate says are let go: by their tolerance they would pull its size and shape, and their neighbours, their way.

use crate::assess::{Limits, MARKERS_DRAWN_ALONG, farthest};
use crate::diagnose::{FarMarker, markers_off};
use crate::problem::{Adjustment, seen_markers};

/// Lets go of those that lie farthest off, and takes back those that do not; true where there are any. Where they are more than a few of a plate, it is
/// the plate that is not as its file says.
pub(super) fn let_go(adjustment: &mut Adjustment, limits: &Limits) -> bool {
    let off = markers_off(adjustment, limits);
    let problem = &mut adjustment.problem;
    let before = problem.moved_markers.clone();
    problem.moved_markers.retain(|marker| off.iter().any(|far| far.of == *marker));
    for plate in 0..problem.plates.len() {
        let is_held = |far: &&FarMarker| far.of.0 == plate && !problem.moved_markers.contains(&far.of);
        let held = off.iter().filter(is_held).map(|far| (far.of, far.sigmas));
        let farthest: Vec<_> = farthest(held, MARKERS_DRAWN_ALONG).collect();
        let gone = problem.moved_markers.iter().filter(|(p, _)| *p == plate).count();
        let most = limits.share_of_markers_moved * seen_markers(problem, plate).len() as f64;
        if (gone + farthest.len()) as f64 <= most {
            problem.moved_markers.extend(farthest);
        }
    }
    problem.moved_markers != before
}
