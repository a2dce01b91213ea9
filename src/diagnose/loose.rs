//! A camera that sits loosely on its mount: it tips over between two positions, and the joint noise shows two heaps.

use super::shift::Shift;
use crate::problem::{Problem, Slack, State};

/// Fewest images, in all and in the smaller heap, that tell two heaps from chance.
const FEWEST_IMAGES: usize = 12;
const FEWEST_IN_HEAP: usize = 3;

/// Smallest distance of the heaps that matters, rad.
const LEAST_TURN: f64 = 0.2e-3;

/// What the axes of the camera do, in the order x, y, z.
const TURNS: [&str; 3] = ["pitch", "yaw", "roll"];

/// Distance of two heaps in units of their own spread from which they are no chance: normal samples of 16 to 72 values reach
/// less with a probability of 0.999 (best of all splits).
fn no_chance(images: usize) -> f64 {
    4.5 + 30.0 / images as f64
}

/// The best split of values into two heaps.
#[derive(Debug, Clone, PartialEq)]
struct Split {
    /// Distance of the means.
    distance: f64,
    /// Common standard deviation inside the heaps.
    spread: f64,
    /// Indices of the smaller heap.
    smaller: Vec<usize>,
}

fn split(values: &[f64]) -> Option<Split> {
    let n = values.len();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let moments = |heap: &[usize]| {
        let mean = heap.iter().map(|&i| values[i]).sum::<f64>() / heap.len() as f64;
        (mean, heap.iter().map(|&i| (values[i] - mean).powi(2)).sum::<f64>())
    };
    let cuts = FEWEST_IN_HEAP..=n.checked_sub(FEWEST_IN_HEAP)?;
    let best = cuts
        .map(|k| {
            let ((low, a), (high, b)) = (moments(&order[..k]), moments(&order[k..]));
            (a + b, high - low, k)
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))?;
    let (squares, distance, k) = best;
    let mut smaller = if 2 * k <= n { order[..k].to_vec() } else { order[k..].to_vec() };
    smaller.sort_unstable();
    Some(Split { distance, spread: (squares / (n - 2) as f64).sqrt(), smaller })
}

/// Names every mounting whose camera turned between two positions; with what to do.
///
/// Mountings whose images a displacement explains already are left out.
pub fn loose_mountings(problem: &Problem, state: &State, shifts: &[Shift]) -> Vec<String> {
    let open = |m: &usize| !shifts.iter().any(|s| s.explains(problem, *m));
    (0..problem.mountings.len()).filter(open).filter_map(|m| loose(problem, state, m)).collect()
}

fn loose(problem: &Problem, state: &State, mounting: usize) -> Option<String> {
    let turns: Vec<(usize, [f64; 3])> = problem
        .used()
        .filter(|(i, image)| image.mounting == mounting && matches!(state.slack[*i], Slack::Joints(_)))
        .filter_map(|(i, image)| {
            let seen = state.camera_from_plate(image, &state.slack[i])?;
            let predicted = state.camera_from_plate(image, &Slack::None)?;
            let turn = (seen * predicted.inverse()).log();
            Some((i, [turn[3], turn[4], turn[5]]))
        })
        .collect();
    if turns.len() < FEWEST_IMAGES {
        return None;
    }
    let (axis, found) = (0..3)
        .filter_map(|axis| split(&turns.iter().map(|(_, t)| t[axis]).collect::<Vec<_>>()).map(|s| (axis, s)))
        .max_by(|a, b| (a.1.distance / a.1.spread).total_cmp(&(b.1.distance / b.1.spread)))?;
    if found.distance < LEAST_TURN || found.distance < no_chance(turns.len()) * found.spread {
        return None;
    }
    let names: Vec<&str> = found.smaller.iter().map(|&k| problem.images[turns[k].0].name.as_str()).collect();
    let more = names.len().saturating_sub(5);
    Some(format!(
        "camera mount {}: the {} of the camera has two values {:.2} mrad apart ({} of {} images: {}{}); the camera is loose on its mount, or slips: fasten it and take the series again",
        problem.mountings[mounting],
        TURNS[axis],
        1e3 * found.distance,
        names.len(),
        turns.len(),
        names[..names.len() - more].join(", "),
        if more > 0 { format!(" and {more} more") } else { String::new() }
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    fn normal(rng: &mut rand_chacha::ChaCha8Rng) -> f64 {
        StandardNormal.sample(rng)
    }

    #[test]
    fn two_heaps_are_told_from_noise() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        let mut false_alarms = 0;
        for _ in 0..500 {
            let values: Vec<f64> = (0..24).map(|_| normal(&mut rng)).collect();
            let s = split(&values).unwrap();
            false_alarms += usize::from(s.distance > no_chance(24) * s.spread);
        }
        assert!(false_alarms <= 2, "{false_alarms} of 500");
        let values: Vec<f64> = (0..24).map(|k| normal(&mut rng) + if k % 5 == 0 { 10.0 } else { 0.0 }).collect();
        let s = split(&values).unwrap();
        assert!(s.distance > no_chance(24) * s.spread);
        assert_eq!(s.smaller, [0, 5, 10, 15, 20]);
    }
}
