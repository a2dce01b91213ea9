//! The stops of the images in use, and what stands still while the robot moves.

use std::collections::BTreeMap;

use crate::geom::Pose;
use crate::model::robot::Posture;
use crate::problem::{Adjustment, Layout, Names, Problem, State};
use crate::series::CameraMount;

/// Stops of the images in use.
pub fn stops(problem: &Problem) -> Vec<Posture> {
    problem.used_stops().into_iter().filter_map(|s| problem.stops[s].posture.clone()).collect()
}

/// Joint noise of every stop on the robot that is in use, rad or m.
pub(super) fn on_robot_sigmas(problem: &Problem) -> Vec<Vec<f64>> {
    let on_robot = problem.used_stops().into_iter().map(|s| &problem.stops[s]).filter(|s| s.posture.is_some());
    on_robot.map(|s| problem.joint_sigma(s.series)).collect()
}

/// Share of these stops that every noise of stops has.
pub(super) fn shares_of_series(problem: &Problem) -> Vec<f64> {
    let mut shares = vec![0.0; problem.noise.joint.len()];
    let on_robot: Vec<usize> =
        problem.used_stops().into_iter().filter(|s| problem.stops[*s].posture.is_some()).collect();
    on_robot.iter().for_each(|s| shares[problem.stops[*s].series] += 1.0 / on_robot.len() as f64);
    shares
}

/// What stands still in the base frame while the robot moves, by its index.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Standing {
    /// The plate at a placement.
    Placement(usize),
    /// The fixed camera of a mounting.
    Mounting(usize),
}

impl Standing {
    /// For an image of a mounting and a placement.
    pub const fn of(mount: CameraMount, mounting: usize, placement: usize) -> Self {
        match mount {
            CameraMount::Hand => Self::Placement(placement),
            CameraMount::Fixed => Self::Mounting(mounting),
        }
    }

    /// What stands still for most images; of several the first by name, so that the order of the series says nothing.
    pub fn of_most(images: impl Iterator<Item = Self>, names: &Names) -> Option<Self> {
        let mut images_of: BTreeMap<Self, usize> = BTreeMap::new();
        images.for_each(|standing| *images_of.entry(standing).or_default() += 1);
        let name = |standing: Self| match standing {
            Self::Placement(k) => &names.placements[k],
            Self::Mounting(k) => &names.mountings[k],
        };
        let order = |(a, of_a): &(Self, usize), (b, of_b): &(Self, usize)| of_b.cmp(of_a).then(name(*a).cmp(name(*b)));
        images_of.into_iter().min_by(order).map(|(standing, _)| standing)
    }

    /// Its pose in the base frame, with its first column.
    pub fn placed(self, state: &State, layout: &Layout) -> (Pose, usize) {
        match self {
            Self::Placement(k) => (state.placements[k], layout.placements[k].start),
            Self::Mounting(k) => (state.mountings[k], layout.mountings[k].start),
        }
    }
}

/// What stands still in the base frame for most images on the robot, with its first column: the plate, or a fixed camera; without images
/// an instrument.
pub fn still(Adjustment { problem, state }: &Adjustment) -> Option<(Pose, usize)> {
    let layout = &problem.layout;
    let images = problem.used_on_robot().map(|i| &problem.images[i]);
    let names = Names { mountings: &problem.mountings, placements: &problem.placements, ..Names::default() };
    let standing = Standing::of_most(images.map(|i| Standing::of(i.mount, i.mounting, i.placement)), &names);
    let Some(standing) = standing else {
        let (_, measured) = problem.used_bodies().next()?;
        return Some((state.instruments[measured.instrument], layout.instruments[measured.instrument].start));
    };
    Some(standing.placed(state, layout))
}

#[cfg(test)]
mod tests {
    use super::Standing::{Mounting, Placement};
    use super::*;

    #[test]
    fn what_stands_still_for_most_images_does_not_hang_on_their_order() {
        let [placements, mountings] =
            [&["b", "a", "c"][..], &["camera"]].map(|all| all.iter().map(|n| (*n).to_owned()));
        let (placements, mountings): (Vec<String>, Vec<String>) = (placements.collect(), mountings.collect());
        let names = Names { placements: &placements, mountings: &mountings, ..Names::default() };
        let of = |images: &[Standing]| {
            let turned: Vec<Standing> = images.iter().rev().copied().collect();
            let found = Standing::of_most(images.iter().copied(), &names);
            assert_eq!(found, Standing::of_most(turned.into_iter(), &names));
            found
        };
        assert_eq!(of(&[Placement(0), Placement(2), Placement(2), Mounting(0)]), Some(Placement(2)));
        assert_eq!(of(&[Placement(0), Placement(1), Mounting(0)]), Some(Placement(1)));
        assert_eq!(of(&[]), None);
    }
}
