//! The usual mistakes in joint readings, each undone.

use crate::diagnose::{HALF_TURN_DEG, MistakeKind};
use crate::model::mirror::mirror_images;
use crate::model::robot::Robot;
use crate::series::{LENGTH_UNITS, LengthUnit};
use crate::urdf::{Chain, JointKind, SEARCHED_M};

/// The readings of all stops with one mistake undone, and its name.
pub(in crate::identify) type Undone = (Vec<Vec<f64>>, MistakeKind);

/// Every one of a single joint, of two or three, of all, and of rows.
pub(in crate::identify) fn mistakes_undone(robot: &Robot, given: &[Vec<f64>]) -> Vec<Undone> {
    let of_rows = shifted_rows(given).into_iter().flat_map(|shifted| whole_and_parted(robot, given, shifted));
    columns_undone(robot, given).into_iter().chain(of_rows).collect()
}

/// Those of columns.
pub(in crate::identify) fn columns_undone(robot: &Robot, given: &[Vec<f64>]) -> Vec<Undone> {
    let chain = &robot.chain;
    let limits = chain.limits_or(SEARCHED_M);
    let mut columns = Columns { chain, given, undone: Vec::new() };
    for (k, kind) in chain.reading_kinds.iter().enumerate() {
        columns.add_signs_and_order(k);
        columns.add_coupled(k);
        match kind {
            JointKind::Prismatic => columns.add_slide_units(k),
            JointKind::Revolute => columns.add_zeros_and_units(k, limits[k]),
            _ => {}
        }
    }
    columns.add_units_of_all();
    columns.add(MistakeKind::Reversed(chain.readings.clone()), |q| q.reverse());
    columns.undone
}

/// Factors from what was read to what it is, by whether it is degrees.
const ANGLE_UNITS: [(bool, f64); 2] = [(true, 1f64.to_radians()), (false, 1f64.to_degrees())];

/// The columns of readings, and what was undone in them.
struct Columns<'a> {
    chain: &'a Chain,
    given: &'a [Vec<f64>],
    undone: Vec<Undone>,
}

impl Columns<'_> {
    fn add(&mut self, mistake: MistakeKind, change: impl Fn(&mut Vec<f64>)) {
        let mut changed = self.given.to_vec();
        changed.iter_mut().for_each(change);
        self.undone.push((changed, mistake));
    }

    fn name(&self, joint: usize) -> String {
        self.chain.readings[joint].clone()
    }

    /// Of a joint alone, and with one or two behind it.
    fn add_signs_and_order(&mut self, k: usize) {
        let n = self.chain.readings.len();
        self.add(MistakeKind::Signs(vec![self.name(k)]), |q| q[k] = -q[k]);
        for other in k + 1..n {
            let names = vec![self.name(k), self.name(other)];
            self.add(MistakeKind::Columns(names.clone()), |q| q.swap(k, other));
            self.add(MistakeKind::Signs(names), |q| (q[k], q[other]) = (-q[k], -q[other]));
            for third in other + 1..n {
                for (a, b) in [(other, third), (third, other)] {
                    let names = [k, a, b].map(|joint| self.name(joint)).to_vec();
                    self.add(MistakeKind::Columns(names), |q| (q[k], q[a], q[b]) = (q[a], q[b], q[k]));
                }
            }
        }
    }

    /// Counted together with the joint before.
    fn add_coupled(&mut self, k: usize) {
        let kinds = &self.chain.reading_kinds;
        if k == 0 || [kinds[k - 1], kinds[k]] != [JointKind::Revolute; 2] {
            return;
        }
        for (is_sum, sign) in [(true, 1.0), (false, -1.0)] {
            let joints = [k, k - 1].map(|joint| self.name(joint));
            self.add(MistakeKind::Coupled { joints, is_sum }, |q| q[k] += sign * q[k - 1]);
        }
    }

    fn add_slide_units(&mut self, k: usize) {
        for LengthUnit { name, metres, .. } in LENGTH_UNITS {
            let joint = self.name(k);
            self.add(MistakeKind::SlideUnit { joint, unit: name, metres }, |q| q[k] *= metres);
        }
    }

    fn add_zeros_and_units(&mut self, k: usize, limits: (f64, f64)) {
        for lacking_deg in [90.0, -90.0, half_turn_deg(limits, self.given.iter().map(|q| q[k]))] {
            let joint = self.name(k);
            self.add(MistakeKind::Zero { joint, lacking_deg }, |q| q[k] += lacking_deg.to_radians());
        }
        for (are_degrees, factor) in ANGLE_UNITS {
            let joint = Some(self.name(k));
            self.add(MistakeKind::Unit { joint, are_degrees }, |q| q[k] *= factor);
        }
    }

    fn add_units_of_all(&mut self) {
        for (are_degrees, factor) in ANGLE_UNITS {
            self.add(MistakeKind::Unit { joint: None, are_degrees }, |q| {
                let revolute = q.iter_mut().zip(&self.chain.reading_kinds).filter(|(_, k)| **k == JointKind::Revolute);
                revolute.for_each(|(v, _)| *v *= factor);
            });
        }
    }
}

/// Half a turn to the side that leads readings towards the middle of their limits.
fn half_turn_deg((low, high): (f64, f64), readings: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = readings.len().max(1) as f64;
    let mean = readings.sum::<f64>() / n;
    if mean > 0.5 * (low + high) { -HALF_TURN_DEG } else { HALF_TURN_DEG }
}

/// Signs of three joints and more: those that make a mirror image of the arm, and those that do beside another wrong sign. Axes may be off by
/// `tolerance`, rad and m.
pub(in crate::identify) fn mirrored_signs_undone(robot: &Robot, given: &[Vec<f64>], tolerance: f64) -> Vec<Undone> {
    let names = &robot.chain.readings;
    let of_mirror = |mirror: Vec<usize>| {
        let one = names.iter().map(|name| signs_of_others(robot, std::slice::from_ref(name), &mirror));
        std::iter::once(signs_of_others(robot, &[], &mirror)).chain(one).collect::<Vec<_>>()
    };
    let signs = mirror_images(&robot.chain, tolerance).into_iter().flat_map(of_mirror);
    let undone = signs.filter(|joints| joints.len() > 2).map(|joints| {
        let sign: Vec<f64> = names.iter().map(|name| if joints.contains(name) { -1.0 } else { 1.0 }).collect();
        let negated = |q: &Vec<f64>| -> Vec<f64> { q.iter().zip(&sign).map(|(q, sign)| q * sign).collect() };
        (given.iter().map(negated).collect(), MistakeKind::Signs(joints))
    });
    undone.collect()
}

/// The joints whose signs, beside those of a mirror image (readings by their indices), are those that these joints have wrong.
pub(in crate::identify) fn signs_of_others(robot: &Robot, joints: &[String], mirror: &[usize]) -> Vec<String> {
    let names = robot.chain.readings.iter().enumerate();
    names.filter(|(k, name)| mirror.contains(k) != joints.contains(name)).map(|(_, name)| name.clone()).collect()
}

/// Shifted rows of all columns, and of some: positioner, rail or second arm stand before the first arm, or behind it, and may have been recorded
/// apart.
pub(in crate::identify) fn whole_and_parted(
    robot: &Robot,
    given: &[Vec<f64>],
    (shifted, mistake): Undone,
) -> Vec<Undone> {
    let names = &robot.chain.readings;
    let n = names.len();
    let below = matches!(mistake, MistakeKind::Rows { below: true, .. });
    let of_columns = (1..n).flat_map(|k| [0..k, k..n]).map(|columns| {
        let mut changed = given.to_vec();
        let rows = changed.iter_mut().zip(&shifted);
        rows.for_each(|(q, of)| q[columns.clone()].copy_from_slice(&of[columns.clone()]));
        (changed, MistakeKind::Rows { below, columns: names[columns].to_vec(), part: None })
    });
    let of_columns: Vec<Undone> = of_columns.collect();
    std::iter::once((shifted, mistake)).chain(of_columns).collect()
}

/// Readings of the row below, or above.
pub(super) fn shifted_rows(given: &[Vec<f64>]) -> [Undone; 2] {
    [true, false].map(|below| {
        let mut shifted = given.to_vec();
        shifted.rotate_left(if below { 1 } else { given.len().saturating_sub(1) });
        (shifted, MistakeKind::Rows { below, columns: Vec::new(), part: None })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_a_turn_leads_towards_the_middle_of_the_limits() {
        assert_eq!(half_turn_deg((-2.0, 2.0), [1.5, 1.9].into_iter()), -HALF_TURN_DEG);
        assert_eq!(half_turn_deg((-2.0, 2.0), [-1.5, 0.1].into_iter()), HALF_TURN_DEG);
        assert_eq!(half_turn_deg((0.0, 6.2), [0.5].into_iter()), HALF_TURN_DEG);
    }
}
