//! How far the joints of a chain go.

use std::f64::consts::{PI, TAU};

use super::chain::{Chain, JointKind};
use super::elements::{UNLIMITED_M, UNLIMITED_RAD};

impl Chain {
    /// Lower and upper limit of every reading that the URDF limits, rad or m.
    ///
    /// The limits of a mimic joint are limits of the joint that it follows.
    pub fn stated_limits(&self) -> Vec<Option<(f64, f64)>> {
        let mut limits: Vec<Option<(f64, f64)>> = vec![None; self.readings.len()];
        for joint in &self.joints {
            let (Some(drive), Some((low, high))) = (joint.drive, joint.limits) else { continue };
            if drive.multiplier == 0.0 {
                continue;
            }
            let [a, b] = [low, high].map(|l| (l - drive.offset) / drive.multiplier);
            let own = (a.min(b), a.max(b));
            let merged = limits[drive.reading].map_or(own, |(l, h)| (l.max(own.0), h.min(own.1)));
            // Limits that leave nothing of each other are of no use.
            if merged.0 < merged.1 {
                limits[drive.reading] = Some(merged);
            }
        }
        limits
    }

    /// The same; joints without limits get half a turn to both sides, slides `slide_m`.
    pub fn limits_or(&self, slide_m: f64) -> Vec<(f64, f64)> {
        let widest = |kind: &JointKind| if *kind == JointKind::Prismatic { slide_m } else { UNLIMITED_RAD };
        let limits = self.stated_limits().into_iter().zip(&self.reading_kinds);
        limits.map(|(limits, kind)| limits.unwrap_or((-widest(kind), widest(kind)))).collect()
    }

    /// Ranges of all readings in which the arm takes every posture that it has, rad or m: of a joint that turns farther a turn, that about zero where it can.
    pub fn ranges(&self) -> Vec<(f64, f64)> {
        let limits = self.limits_or(UNLIMITED_M).into_iter().zip(&self.reading_kinds);
        limits.map(|(limits, kind)| kind.inner_turn(limits)).collect()
    }
}

impl JointKind {
    /// What of a range is within a turn: from half a turn before zero on, or, where all of it lies before zero, up to its end; the whole of a slide.
    pub fn inner_turn(self, (low, high): (f64, f64)) -> (f64, f64) {
        if self == Self::Prismatic {
            return (low, high);
        }
        let from = if high <= 0.0 { low.max(high - TAU) } else { low.max(-PI) };
        (from, high.min(from + TAU))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::urdf::{RobotDescription, SEARCHED_M};

    /// A slide from 1 to 5 m, a joint beside zero, one of two turns, and one without limits that another follows.
    const URDF: &str = "<robot name='r'><link name='a'/><link name='b'/><link name='c'/><link name='d'/><link name='e'/><link name='f'/>\
        <joint name='rail' type='prismatic'><parent link='a'/><child link='b'/><axis xyz='1 0 0'/><limit lower='1' upper='5' effort='0' velocity='0'/></joint>\
        <joint name='beside' type='revolute'><parent link='b'/><child link='c'/><axis xyz='0 0 1'/><limit lower='4' upper='6' effort='0' velocity='0'/></joint>\
        <joint name='turns' type='revolute'><parent link='c'/><child link='d'/><axis xyz='0 1 0'/><limit lower='-6.28' upper='6.28' effort='0' velocity='0'/></joint>\
        <joint name='followed' type='continuous'><parent link='d'/><child link='e'/><axis xyz='0 0 1'/></joint>\
        <joint name='follower' type='revolute'><parent link='e'/><child link='f'/><axis xyz='0 0 1'/><limit lower='-1' upper='2' effort='0' velocity='0'/>\
        <mimic joint='followed' multiplier='-2' offset='1'/></joint></robot>";

    #[test]
    fn ranges_are_the_stated_ones_within_a_turn() {
        let description = RobotDescription::from_text(std::path::Path::new("r.urdf"), URDF.to_owned()).unwrap();
        let chain = description.chain(None, None).unwrap();
        assert_eq!(chain.stated_limits()[3], Some((-0.5, 1.0)));
        assert_eq!(chain.ranges(), [(1.0, 5.0), (4.0, 6.0), (-PI, PI), (-0.5, 1.0)]);
        assert_eq!(JointKind::Revolute.inner_turn((-20.0, -1.0)), (-1.0 - TAU, -1.0));
        // A turntable from zero on, and a wrist (Panda) that is not centred.
        for whole in [(0.0, TAU), (-0.0175, 3.7525)] {
            assert_eq!(JointKind::Revolute.inner_turn(whole), whole);
        }
    }

    #[test]
    fn what_states_no_limits_has_those_that_are_asked_for() {
        let text = URDF.replace("<limit lower='1' upper='5' effort='0' velocity='0'/>", "");
        let chain =
            RobotDescription::from_text(std::path::Path::new("r.urdf"), text).unwrap().chain(None, None).unwrap();
        assert_eq!(chain.ranges()[0], (-UNLIMITED_M, UNLIMITED_M));
        assert_eq!(chain.limits_or(SEARCHED_M)[0], (-SEARCHED_M, SEARCHED_M));
        // Limits that contradict those of what follows.
        let text = URDF.replace("lower='-1' upper='2'", "lower='7' upper='9'").replace("'continuous'", "'revolute'");
        let text =
            text.replace("<axis xyz='0 0 1'/></joint>", "<axis xyz='0 0 1'/><limit lower='-1' upper='1'/></joint>");
        let chain =
            RobotDescription::from_text(std::path::Path::new("r.urdf"), text).unwrap().chain(None, None).unwrap();
        assert_eq!(chain.stated_limits()[3], Some((-1.0, 1.0)));
    }
}
