//! Rows in which a tracker wrote the same again, to the last digit, while the arm carried its target on: it was stuck.

use std::collections::BTreeMap;

use super::placed::{SeenFrom, missed, placed};
use super::points_start::{DISAGREES, Placed, tip_at};
use crate::assess::Limits;
use crate::geom::Pose;
use crate::linalg::lower_median;
use crate::problem::{Adjustment, BodyRejection, BodySeen, Problem};

/// Leaves out what was written again at successive stops of a series, where the others say that the target was carried further than they miss by, and
/// is elsewhere.
pub(super) fn leave_out_stuck(adjustment: &mut Adjustment, limits: &Limits) {
    let mut groups: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for (k, measured) in adjustment.problem.used_bodies() {
        if adjustment.problem.is_by_tracker(measured) {
            groups.entry((measured.instrument, measured.body)).or_default().push(k);
        }
    }
    let stuck: Vec<usize> = groups.values().flat_map(|group| stuck(adjustment, group, limits)).collect();
    for k in stuck {
        adjustment.problem.body_measurements[k].rejected = Some(BodyRejection::Repeated);
    }
}

/// A row of the table: the index of its measurement, and what was seen at which tip.
type Row = (usize, SeenFrom);

/// Those of one body by one tracker.
fn stuck(adjustment: &Adjustment, group: &[usize], limits: &Limits) -> Vec<usize> {
    let problem = &adjustment.problem;
    let of = |&k: &usize| {
        let measured = &problem.body_measurements[k];
        Some((k, (measured.seen, tip_at(adjustment, measured)?)))
    };
    let rows: Vec<Row> = group.iter().filter_map(of).collect();
    let runs: Vec<&[Row]> = rows.chunk_by(|a, b| is_again(problem, a, b)).collect();
    let others: Vec<SeenFrom> = runs.iter().filter(|run| run.len() == 1).map(|run| run[0].1).collect();
    if others.len() == runs.len() {
        return Vec::new();
    }
    let Some(placed) = placed(&others, limits.suspicious_misfit) else { return Vec::new() };
    let usual = lower_median(others.iter().map(|seen| missed(seen, &placed)));
    let bound = f64::max(limits.suspicious_misfit, DISAGREES * usual);
    let fits = |row: &Row| missed(&row.1, &placed) <= bound;
    let is_stuck = |at: &usize| {
        let run = runs[*at];
        let was_carried = run.iter().any(|(_, (_, tip))| carried(&run[0].1, tip, &placed) > bound);
        // Where rows were shifted, the last row before, or the first, says what its neighbour does.
        let is_of_later = !fits(&run[0]) && run.iter().any(fits);
        let is_first_of_shifted = run.len() == 2 && runs.get(at + 1).is_some_and(|next| !fits(&next[0]));
        run.len() > 1 && was_carried && !is_of_later && !is_first_of_shifted
    };
    let of_stuck = (0..runs.len()).filter(is_stuck).flat_map(|at| runs[at]);
    of_stuck.filter(|row| !fits(row)).map(|(k, _)| *k).collect()
}

/// True where the second row says what the first one does, at the next stop of the same series.
fn is_again(problem: &Problem, a: &Row, b: &Row) -> bool {
    let [first, next] = [a, b].map(|(k, _)| &problem.body_measurements[*k]);
    first.read.0 == next.read.0 && first.seen == next.seen
}

/// How far the body is at another tip from where it is at its own.
fn carried((seen, tip): &SeenFrom, other: &Pose, (_, body): &Placed) -> f64 {
    let [here, there] = [tip, other].map(|tip| *tip * *body);
    match seen {
        BodySeen::Point(_) => (here.translation - there.translation).norm(),
        BodySeen::Pose(_) => here.misfit(&there),
    }
}
