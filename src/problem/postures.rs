//! Stops that share joint readings: what a joint is off by there, it is off by at all of them.

use std::ops::Range;

use super::Problem;
use crate::model::robot::Posture;

/// Readings closer than this, rad or m, are the same posture of a joint.
const SAME_READING: f64 = 2e-3;

/// Fewest readings in common that make two stops of an arm related: a single one agrees by chance now and then.
pub const JOINTS_IN_COMMON: usize = 2;

/// Readings that two stops have in common, and those that they just fail to have beside others: among stops that are dense enough to agree by
/// chance there are as many of the one kind as of the other. Empty where fewer than `fewest` are the same: it may be chance.
pub fn related_readings(a: &Posture, b: &Posture, fewest: usize) -> [Vec<usize>; 2] {
    let apart = || a.readings.iter().zip(&b.readings).map(|(a, b)| (a - b).abs());
    let within = |range: Range<f64>| apart().enumerate().filter(|(_, d)| range.contains(d)).map(|(r, _)| r).collect();
    match apart().filter(|d| *d < SAME_READING).count() {
        count if count + 1 < fewest => [Vec::new(), Vec::new()],
        count if count < fewest => [Vec::new(), within(SAME_READING..2.0 * SAME_READING)],
        _ => [within(0.0..SAME_READING), within(SAME_READING..2.0 * SAME_READING)],
    }
}

/// Readings that two stops have in common; empty where it may be chance.
fn common_readings(a: &Posture, b: &Posture, fewest: usize) -> Vec<usize> {
    let [common, _] = related_readings(a, b, fewest);
    common
}

/// Sets of indices below `count`, joined by the pairs; each set ascending, in the order of their first members.
pub fn joined(count: usize, pairs: impl Iterator<Item = (usize, usize)>) -> Vec<Vec<usize>> {
    let mut parent: Vec<usize> = (0..count).collect();
    fn root(parent: &mut [usize], mut i: usize) -> usize {
        while parent[i] != i {
            parent[i] = parent[parent[i]];
            i = parent[i];
        }
        i
    }
    for (a, b) in pairs {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        parent[a.max(b)] = a.min(b);
    }
    let mut sets: Vec<Vec<usize>> = vec![Vec::new(); count];
    for i in 0..count {
        sets[root(&mut parent, i)].push(i);
    }
    sets.retain(|s| !s.is_empty());
    sets
}

/// Images of `among` in groups that share readings, directly or through others; an image off the robot is alone.
pub fn posture_groups(problem: &Problem, among: &[usize]) -> Vec<Vec<usize>> {
    let posture = |k: usize| problem.posture(among[k]);
    let are_related = |a: &Posture, b: &Posture| !common_readings(a, b, problem.fewest_in_common).is_empty();
    let related = (0..among.len())
        .flat_map(|a| (0..a).map(move |b| (b, a)))
        .filter(|&(a, b)| posture(a).zip(posture(b)).is_some_and(|(a, b)| are_related(a, b)));
    joined(among.len(), related).into_iter().map(|set| set.into_iter().map(|k| among[k]).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_reading_in_common_is_chance_two_are_a_posture() {
        let (a, b, c) =
            (Posture::at(&[0.1, 0.2, 0.3]), Posture::at(&[0.1005, 0.9, 0.8]), Posture::at(&[0.1, 0.2, -0.3]));
        assert!(common_readings(&a, &b, JOINTS_IN_COMMON).is_empty());
        assert_eq!(common_readings(&a, &c, JOINTS_IN_COMMON), [0, 1]);
        assert!(common_readings(&a, &c, 3).is_empty());
    }

    #[test]
    fn pairs_join_into_sets() {
        let pairs = [(3, 1), (4, 5), (1, 5)];
        assert_eq!(joined(6, pairs.into_iter()), [vec![0], vec![1, 3, 4, 5], vec![2]]);
    }
}
