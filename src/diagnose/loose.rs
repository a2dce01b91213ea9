//! A camera that sits loosely on its mount: it tips over between two positions, and the joint noise shows two heaps.

use super::kind::{CheckContext, Kind, Quantity, Subject, some_of};
use crate::assess::{Accuracy, Limits};
use crate::error::Code;
use crate::fit::Fit;
use crate::linalg::median;

/// Most images that are named.
const MOST_IMAGES: usize = 5;

/// A camera tips over between two positions.
#[derive(Debug, Clone, PartialEq)]
pub struct LooseMounting {
    /// Name of the mounting.
    pub mounting: String,
    /// About which axis of the camera: pitch, yaw, roll.
    pub turn: &'static str,
    /// Angle between the positions, rad.
    pub angle_rad: f64,
    /// Spread of either, rad.
    pub spread_rad: f64,
    /// Images in the rarer position.
    pub images: Vec<String>,
    /// Images in all.
    pub of: usize,
}

/// What the axes of the camera do, in the order x, y, z.
const TURNS: [&str; 3] = ["pitch", "yaw", "roll"];

/// Distance of two heaps in units of their own spread from which they are no chance.
fn no_chance(images: usize, limits: &Limits) -> f64 {
    limits.loose_spreads + limits.loose_spreads_of_few / images as f64
}

/// The best split of values into two heaps.
#[derive(Debug, Clone, PartialEq)]
struct Split {
    /// Distance of the medians: one value far off makes no heap.
    distance: f64,
    /// Common standard deviation inside the heaps.
    spread: f64,
    /// Indices of the smaller heap.
    smaller: Vec<usize>,
}

fn split(values: &[f64], fewest: usize) -> Option<Split> {
    let n = values.len();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let squares = |heap: &[usize]| {
        let mean = heap.iter().map(|&i| values[i]).sum::<f64>() / heap.len() as f64;
        heap.iter().map(|&i| (values[i] - mean).powi(2)).sum::<f64>()
    };
    let cuts = fewest..=n.checked_sub(fewest)?;
    let best = cuts.map(|k| (squares(&order[..k]) + squares(&order[k..]), k)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let (squares, k) = best;
    let median_of = |heap: &[usize]| median(heap.iter().map(|&i| values[i]).collect::<Vec<_>>());
    let distance = median_of(&order[k..])? - median_of(&order[..k])?;
    let mut smaller = if 2 * k <= n { order[..k].to_vec() } else { order[k..].to_vec() };
    smaller.sort_unstable();
    Some(Split { distance, spread: (squares / (n - 2) as f64).sqrt(), smaller })
}

/// Every mounting whose camera turned between two positions.
pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Vec<LooseMounting> {
    let fit = setting.with_noise_found(fit);
    (0..fit.problem.mountings.len()).filter_map(|m| loose(fit, m, setting.limits)).collect()
}

fn loose(fit: &Fit, mounting: usize, limits: &Limits) -> Option<LooseMounting> {
    let problem = &fit.problem;
    let turns: Vec<(usize, [f64; 3])> = problem
        .used()
        .filter(|(i, image)| image.mounting == mounting && fit.taken_from(*i).joints() > 0)
        .filter_map(|(i, _)| {
            let (seen, predicted) = (fit.camera_from_plate(i)?, fit.camera_by_readings(i)?);
            let turn = (seen * predicted.inverse()).log();
            Some((i, [turn[3], turn[4], turn[5]]))
        })
        .collect();
    if turns.len() < limits.loose_images {
        return None;
    }
    let (axis, found) = (0..3)
        .filter_map(|axis| {
            let about_axis: Vec<f64> = turns.iter().map(|(_, t)| t[axis]).collect();
            split(&about_axis, limits.loose_images_in_heap).map(|s| (axis, s))
        })
        .max_by(|a, b| (a.1.distance / a.1.spread).total_cmp(&(b.1.distance / b.1.spread)))?;
    if found.distance < limits.loose_turn_rad || found.distance < no_chance(turns.len(), limits) * found.spread {
        return None;
    }
    Some(LooseMounting {
        mounting: problem.mountings[mounting].clone(),
        turn: TURNS[axis],
        angle_rad: found.distance,
        spread_rad: found.spread,
        images: found.smaller.iter().map(|&k| problem.images[turns[k].0].name.clone()).collect(),
        of: turns.len(),
    })
}

impl Kind for LooseMounting {
    fn code(&self) -> Code {
        Code::LooseMounting
    }

    fn subjects(&self) -> Vec<Subject> {
        let body = Subject::Body(self.mounting.clone());
        std::iter::once(body).chain(self.images.iter().cloned().map(Subject::Image)).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![Quantity::new("angle", self.angle_rad, "rad").with_sigma(self.spread_rad)]
    }

    fn place(&self) -> String {
        format!("camera mount {}", self.mounting)
    }

    fn seen(&self) -> String {
        format!(
            "the {} of the camera has two values {:.2} mrad apart ({} of {} images: {}): it is loose on its mount or slips, or a joint has backlash",
            self.turn,
            1e3 * self.angle_rad,
            self.images.len(),
            self.of,
            some_of(&self.images, MOST_IMAGES)
        )
    }

    fn remedy(&self) -> String {
        "fasten it and take the series again; if it is fast, look for a joint with play".into()
    }
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
            let s = split(&values, 3).unwrap();
            false_alarms += usize::from(s.distance > no_chance(24, &Limits::default()) * s.spread);
        }
        assert!(false_alarms <= 2, "{false_alarms} of 500");
        let values: Vec<f64> = (0..24).map(|k| normal(&mut rng) + if k % 5 == 0 { 10.0 } else { 0.0 }).collect();
        let s = split(&values, 3).unwrap();
        assert!(s.distance > no_chance(24, &Limits::default()) * s.spread);
        assert_eq!(s.smaller, [0, 5, 10, 15, 20]);
        // One image among many that belongs elsewhere is no second position.
        let values: Vec<f64> = (0..400).map(|k| normal(&mut rng) + if k == 7 { 25.0 } else { 0.0 }).collect();
        let s = split(&values, 3).unwrap();
        assert!(s.smaller.contains(&7) && s.distance < no_chance(400, &Limits::default()) * s.spread);
    }
}
