//! In which order to visit the stops: short, free of collision, every joint approached from both sides.

use rayon::prelude::*;

use super::scene::Scene;

/// The way to one stop.
#[derive(Debug, Clone, PartialEq)]
pub struct Leg {
    /// Index of the stop.
    pub stop: usize,
    /// Postures to pass before it.
    pub via: Vec<Vec<f64>>,
    /// False where no free way was found from the stop before: one has to be taught.
    pub is_free: bool,
}

/// Greatest step between two collision checks, rad or m of any joint.
const CHECK_STEP: f64 = 0.03;
/// What a blocked way counts in addition, rad.
const BLOCKED: f64 = 4.0;
/// What the whole imbalance of one joint counts, as a share of the length of the tour.
const BALANCE: f64 = 0.2;
/// Sweeps of improvements.
const SWEEPS: usize = 40;
/// Postures tried as an intermediate one.
const DETOURS: usize = 150;

/// Greatest motion of a joint, rad or m.
pub fn motion(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (b - a).abs()).fold(0.0, f64::max)
}

/// For each joint: approaches from below less those from above, over their number (0 is balanced, 1 is one-sided). One that stands still is not
/// approached.
pub fn imbalance(stops: &[&[f64]]) -> Vec<f64> {
    let joints = stops.first().map_or(0, |s| s.len());
    let of = |j: usize| {
        let steps = stops.windows(2).map(|w| w[1][j] - w[0][j]).filter(|step| *step != 0.0);
        let (sum, count) = steps.fold((0.0, 0), |(sum, count), step| (sum + step.signum(), count + 1));
        sum.abs() / f64::from(count.max(1))
    };
    (0..joints).map(of).collect()
}

/// A tour through all stops (readings) of one placement; `spare` are free postures that may be passed on the way.
pub fn tour(stops: &[Vec<f64>], scene: &Scene, placement: usize, spare: &[Vec<f64>]) -> Vec<Leg> {
    let n = stops.len();
    let pairs: Vec<(usize, usize)> = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b))).collect();
    let free: Vec<bool> =
        pairs.par_iter().map(|&(a, b)| scene.way_is_free(&stops[a], &stops[b], placement, CHECK_STEP)).collect();
    let mut cost = vec![vec![0.0; n]; n];
    let mut is_free = vec![vec![true; n]; n];
    for (&(a, b), &open) in pairs.iter().zip(&free) {
        let c = motion(&stops[a], &stops[b]) + if open { 0.0 } else { BLOCKED };
        (cost[a][b], cost[b][a]) = (c, c);
        (is_free[a][b], is_free[b][a]) = (open, open);
    }
    let order = improved(nearest_neighbours(&cost), stops, &cost);
    let legs = order.iter().enumerate().map(|(k, &stop)| {
        let Some(&before) = k.checked_sub(1).and_then(|k| order.get(k)) else {
            return Leg { stop, via: Vec::new(), is_free: true };
        };
        if is_free[before][stop] {
            return Leg { stop, via: Vec::new(), is_free: true };
        }
        past(stop, detour([&stops[before], &stops[stop]], scene, &[placement], spare))
    });
    legs.collect()
}

/// The leg between stops (readings) of two placements, free with the plate at either: it is moved on the way.
pub fn leg_across(stop: usize, ends: [&[f64]; 2], scene: &Scene, placements: [usize; 2], spare: &[Vec<f64>]) -> Leg {
    // The plate is put down in front of an arm that stands at the stop before.
    let is_placed = scene.collision(ends[0], placements[1]).is_none();
    if is_placed && is_free_at(ends, scene, &placements) {
        return Leg { stop, via: Vec::new(), is_free: true };
    }
    past(stop, detour(ends, scene, &placements, spare))
}

/// The leg past an intermediate posture; one to be taught where there is none.
fn past(stop: usize, detour: Option<Vec<f64>>) -> Leg {
    Leg { stop, is_free: detour.is_some(), via: detour.into_iter().collect() }
}

/// Whether the straight way is free with the plate at each of these placements.
fn is_free_at([from, to]: [&[f64]; 2], scene: &Scene, placements: &[usize]) -> bool {
    placements.iter().all(|&placement| scene.way_is_free(from, to, placement, CHECK_STEP))
}

fn nearest_neighbours(cost: &[Vec<f64>]) -> Vec<usize> {
    let mut left: Vec<usize> = (0..cost.len()).collect();
    let mut order = Vec::with_capacity(left.len());
    while !left.is_empty() {
        let from = |k: usize| order.last().map_or(k as f64, |&last: &usize| cost[last][k]);
        let next = (0..left.len()).min_by(|&a, &b| from(left[a]).total_cmp(&from(left[b]))).unwrap_or(0);
        order.push(left.remove(next));
    }
    order
}

/// Length of the tour with what its imbalance adds.
fn total(order: &[usize], stops: &[Vec<f64>], cost: &[Vec<f64>], scale: f64) -> f64 {
    let length: f64 = order.windows(2).map(|w| cost[w[0]][w[1]]).sum();
    let visited: Vec<&[f64]> = order.iter().map(|&k| stops[k].as_slice()).collect();
    let uneven: f64 = imbalance(&visited).iter().map(|x| x * x).sum();
    length + BALANCE * scale * uneven
}

/// Reversals of stretches and moves of single stops while they gain.
fn improved(mut order: Vec<usize>, stops: &[Vec<f64>], cost: &[Vec<f64>]) -> Vec<usize> {
    let n = order.len();
    let scale: f64 = order.windows(2).map(|w| cost[w[0]][w[1]]).sum();
    let mut best = total(&order, stops, cost, scale);
    for _ in 0..SWEEPS {
        let before = best;
        for a in 0..n {
            for b in a + 1..n {
                let mut reversed = order.clone();
                reversed[a..=b].reverse();
                let mut moved = order.clone();
                let stop = moved.remove(a);
                moved.insert(b, stop);
                for other in [reversed, moved] {
                    let t = total(&other, stops, cost, scale);
                    if t < best - 1e-9 {
                        (order, best) = (other, t);
                    }
                }
            }
        }
        if best >= before - 1e-9 {
            break;
        }
    }
    order
}

fn detour([from, to]: [&[f64]; 2], scene: &Scene, placements: &[usize], spare: &[Vec<f64>]) -> Option<Vec<f64>> {
    let mut ranked: Vec<(f64, &Vec<f64>)> = spare.iter().map(|s| (motion(from, s) + motion(s, to), s)).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let open = |s: &[f64]| {
        placements.iter().all(|&placement| scene.collision(s, placement).is_none())
            && is_free_at([from, s], scene, placements)
            && is_free_at([s, to], scene, placements)
    };
    ranked.into_iter().take(DETOURS).map(|(_, s)| s).find(|s| open(s)).cloned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_that_stands_still_is_approached_from_no_side() {
        let stops: [&[f64]; 5] = [
            &[0.0, 0.3, 0.0, 0.0],
            &[1.0, 0.3, 0.0, 1.0],
            &[0.5, 0.3, 0.2, 2.0],
            &[0.7, 0.3, 0.0, 3.0],
            &[0.9, 0.3, 0.0, 4.0],
        ];
        assert_eq!(imbalance(&stops), [0.5, 0.0, 0.0, 1.0]);
    }
}
