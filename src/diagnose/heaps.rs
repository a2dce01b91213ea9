//! Two heaps of images in which a camera, or a plate, seems to be elsewhere.

use nalgebra::Vector6;

use crate::assess::Limits;
use crate::fit::Fit;
use crate::geom::Pose;
use crate::linalg::median;
use crate::problem::Image;

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

/// By how much a body seems to be elsewhere in each of some images, by their index.
pub(super) struct Heaps(Vec<(usize, Vector6<f64>)>);

/// Two heaps of images.
pub(super) struct TwoPlaces {
    /// Which component of the twist tells them best.
    pub axis: usize,
    /// Distance of the heaps along it, and the spread of either, rad or m.
    pub distance: f64,
    pub spread: f64,
    /// Images in the rarer place.
    pub smaller: Vec<usize>,
    /// Share of the squares of its shift, or of its turn, that the two places explain.
    pub share: f64,
    /// Images in all.
    pub of: usize,
    /// How often one place follows on the other, in the order of the images.
    pub changes: usize,
}

impl Heaps {
    /// Of the camera of a mounting, by images of a fit beside what readings say.
    pub fn of_camera(fit: &Fit, by_readings: impl Fn(usize) -> Option<Pose>, mounting: usize) -> Self {
        let shown = |image: &Image| image.mounting == mounting;
        Self::of(fit, by_readings, shown, |seen, predicted| (seen * predicted.inverse()).log())
    }

    /// Of some images of a fit, by the twist between where each was taken and where readings say, by its index.
    pub(super) fn of(
        fit: &Fit,
        by_readings: impl Fn(usize) -> Option<Pose>,
        shown: impl Fn(&Image) -> bool,
        twist: impl Fn(Pose, Pose) -> Vector6<f64>,
    ) -> Self {
        let own = fit.problem.used().filter(|(i, image)| shown(image) && fit.taken_from(*i).joints() > 0);
        let told = |(i, _)| Some((i, twist(fit.camera_from_plate(i)?, by_readings(i)?)));
        Self(own.filter_map(told).collect())
    }

    /// Along the axis of some that tells two places best.
    fn split(&self, axes: impl Iterator<Item = usize>, limits: &Limits) -> Option<TwoPlaces> {
        let of = self.0.len();
        if of < limits.loose_images {
            return None;
        }
        let along = |axis: usize| self.0.iter().map(|(_, t)| t[axis]).collect::<Vec<f64>>();
        let (axis, found) = axes
            .filter_map(|axis| split(&along(axis), limits.loose_images_in_heap).map(|s| (axis, s)))
            .max_by(|a, b| (a.1.distance / a.1.spread).total_cmp(&(b.1.distance / b.1.spread)))?;
        let Split { distance, spread, smaller } = found;
        if distance < no_chance(of, limits) * spread {
            return None;
        }
        let is_member: Vec<bool> = (0..of).map(|k| smaller.contains(&k)).collect();
        let changes = is_member.windows(2).filter(|two| two[0] != two[1]).count();
        let parts = smaller.iter().map(|&k| self.0[k].0).collect();
        let (inside, outside): (Vec<usize>, Vec<usize>) = (0..of).partition(|&k| is_member[k]);
        let squares = |heap: &[usize]| {
            let mean = heap.iter().map(|&k| self.0[k].1).sum::<Vector6<f64>>() / heap.len().max(1) as f64;
            let off = heap.iter().map(|&k| self.0[k].1 - mean);
            off.fold([0.0; 2], |[shift, turn], off| {
                [shift + off.fixed_rows::<3>(0).norm_squared(), turn + off.fixed_rows::<3>(3).norm_squared()]
            })
        };
        let all = squares(&(0..of).collect::<Vec<usize>>());
        let (one, other) = (squares(&inside), squares(&outside));
        let left = [0, 1].map(|kind| one[kind] + other[kind]);
        let kind = axis / 3;
        let share = 1.0 - left[kind] / all[kind];
        Some(TwoPlaces { axis, distance, spread, smaller: parts, share, of, changes })
    }

    /// True of a camera that tips over.
    pub fn is_loose(&self, limits: &Limits) -> bool {
        self.loose(limits).is_some()
    }

    /// A camera that tips over.
    pub(super) fn loose(&self, limits: &Limits) -> Option<TwoPlaces> {
        self.split(3..6, limits).filter(|two| two.distance >= limits.loose_turn_rad)
    }

    /// A plate that has two places by turns: one that was moved once is found by its row.
    pub(super) fn moved(&self, limits: &Limits) -> Option<TwoPlaces> {
        let matters = |two: &TwoPlaces| match two.axis {
            0..3 => two.distance > limits.displaced_m,
            _ => two.distance > limits.displaced_rad,
        };
        self.split(0..6, limits)
            .filter(|two| matters(two) && two.share > limits.displaced_share && two.changes >= limits.place_changes)
    }
}

impl TwoPlaces {
    pub fn clearness(&self) -> f64 {
        self.distance / self.spread
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
