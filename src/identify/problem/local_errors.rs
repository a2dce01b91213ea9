//! Local errors of the joints: one column for every reading to which a joint came back, or at which it stood still.

use crate::model::joint_terms::{JointTerm, Term};
use crate::model::robot::Posture;
use crate::problem::{Stop, joined, related_readings};

/// Readings in common, over those that just fail to be, from which on they are no chance.
const BEYOND_CHANCE: usize = 3;

/// Terms of all readings: they are columns of a dense matrix, and where so many stops repeat readings no single place decides anything any more.
const MOST_TERMS: usize = 300;

/// Terms for the readings, those with the fewest first, that at least this share of the stops has in common with others, in the order of the readings.
pub(super) fn local_terms(
    stops: &[Stop],
    readings: usize,
    fewest_in_common: usize,
    least_share: f64,
) -> Vec<JointTerm> {
    let on_robot: Vec<&Posture> = stops.iter().filter_map(|s| s.posture.as_ref()).collect();
    let mut of_readings: Vec<Vec<JointTerm>> = Vec::new();
    for (reading, (pairs, missed)) in pairs_in_common(&on_robot, readings, fewest_in_common).into_iter().enumerate() {
        if pairs.len() < BEYOND_CHANCE * missed {
            continue;
        }
        let mut sets = joined(on_robot.len(), pairs.into_iter());
        sets.retain(|set| set.len() > 1);
        let tied: usize = sets.iter().map(Vec::len).sum();
        if (tied as f64) < least_share * on_robot.len() as f64 {
            continue;
        }
        let term = |set: &Vec<usize>| {
            let mean = set.iter().map(|&k| on_robot[k].readings[reading]).sum::<f64>() / set.len() as f64;
            JointTerm { reading, term: Term::local(mean), value: 0.0 }
        };
        of_readings.push(sets.iter().map(term).collect());
    }
    of_readings.sort_by_key(Vec::len);
    let mut count = 0;
    let is_paid = |terms: &Vec<JointTerm>| {
        count += terms.len();
        count <= MOST_TERMS
    };
    let mut terms: Vec<JointTerm> = of_readings.into_iter().take_while(is_paid).flatten().collect();
    terms.sort_by_key(|t| t.reading);
    terms
}

/// For every reading the pairs of stops that have it in common, and how many nearly do.
fn pairs_in_common(stops: &[&Posture], readings: usize, fewest_in_common: usize) -> Vec<(Vec<(usize, usize)>, usize)> {
    let mut all = vec![(Vec::new(), 0); readings];
    for (b, later) in stops.iter().enumerate() {
        for (a, earlier) in stops[..b].iter().enumerate() {
            let [common, nearly] = related_readings(earlier, later, fewest_in_common);
            common.into_iter().for_each(|r| all[r].0.push((a, b)));
            nearly.into_iter().for_each(|r| all[r].1 += 1);
        }
    }
    all
}

/// Sum of the squares of the local basis functions of every reading at a posture.
pub(super) fn local_share(terms: &[JointTerm], posture: &Posture) -> Vec<f64> {
    let mut share = vec![0.0; posture.readings.len()];
    for t in terms {
        share[t.reading] += t.local_basis(posture.readings[t.reading]).map_or(0.0, |basis| basis * basis);
    }
    share
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::*;
    use crate::model::robot::Posture;
    use crate::problem::JOINTS_IN_COMMON;

    fn stops(count: usize, step: Option<f64>) -> Vec<Stop> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut readings = || (0..3).map(|_| rng.random_range(0.0..0.5)).collect::<Vec<f64>>();
        let on_grid =
            |q: Vec<f64>| q.into_iter().map(|q| step.map_or(q, |s| (q / s).round() * s)).collect::<Vec<f64>>();
        (0..count)
            .map(|_| Stop { posture: Some(Posture::at(&on_grid(readings()))), series: 0, local_share: Vec::new() })
            .collect()
    }

    #[test]
    fn readings_that_agree_by_chance_are_no_places_of_their_own() {
        assert!(local_terms(&stops(1500, None), 3, JOINTS_IN_COMMON, 0.5).is_empty());
        assert_eq!(local_terms(&stops(1500, Some(0.1)), 3, JOINTS_IN_COMMON, 0.5).len(), 3 * 6);
    }
}
