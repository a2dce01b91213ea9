//! A problem and where its solution stands.

use std::collections::BTreeSet;

use super::{BodyRejection, Family, Image, ImageRejection, Problem, State, TakenFrom, Tie};
use crate::geom::Pose;
use crate::model::camera::Camera;

/// A problem with a value of every unknown: what a solve starts from and what it leaves.
#[derive(Debug, Clone)]
pub struct Adjustment {
    /// What was measured and what is known beforehand.
    pub problem: Problem,
    /// The unknowns.
    pub state: State,
}

impl Adjustment {
    /// The images that take part, with their indices and ties.
    pub fn used(&self) -> impl Iterator<Item = (usize, &Image, &Tie)> {
        self.problem.used().map(|(i, image)| (i, image, &self.state.ties[i]))
    }

    /// Where an image was taken from, as the unknowns stand.
    pub fn taken_from(&self, image: usize) -> TakenFrom<'_> {
        let joint_errors = &self.state.joint_errors[self.problem.images[image].stop];
        TakenFrom { posture: self.problem.posture(image), joint_errors, tie: &self.state.ties[image] }
    }

    /// Where a body was measured from, as the unknowns stand: it has no tie of its own.
    pub fn body_taken_from(&self, measured: usize) -> TakenFrom<'_> {
        let stop = self.problem.body_measurements[measured].stop;
        let joint_errors = &self.state.joint_errors[stop];
        TakenFrom { posture: self.problem.stops[stop].posture.as_ref(), joint_errors, tie: &Tie::Rigid }
    }

    /// Camera pose of an image as the unknowns say; `None` off the robot without a free pose.
    pub fn camera_from_plate(&self, image: usize) -> Option<Pose> {
        self.state.camera_from_plate(&self.problem.images[image], self.taken_from(image))
    }

    /// Camera pose of an image as its joint readings say; `None` off the robot.
    pub fn camera_by_readings(&self, image: usize) -> Option<Pose> {
        self.camera_by_readings_of(image, image)
    }

    /// Camera pose of an image as the joint readings of another say; `None` where that one was taken off the robot.
    pub fn camera_by_readings_of(&self, image: usize, other: usize) -> Option<Pose> {
        self.state.camera_from_plate(&self.problem.images[image], TakenFrom::exact(self.problem.posture(other)?))
    }

    /// The adjustment without some of its images: they are held out, and with them what was measured of bodies at their stops.
    pub fn without_images(&self, held: &[usize]) -> Self {
        let stops: Vec<usize> = held.iter().map(|&i| self.problem.images[i].stop).collect();
        let mut rest = self.without_bodies_at(&stops);
        held.iter().for_each(|&i| rest.problem.images[i].rejected = Some(ImageRejection::Excluded));
        rest
    }

    /// The adjustment without what was measured of bodies at some stops.
    pub fn without_bodies_at(&self, stops: &[usize]) -> Self {
        let mut rest = self.clone();
        let stops: BTreeSet<usize> = stops.iter().copied().collect();
        let held = rest.problem.body_measurements.iter_mut().filter(|m| stops.contains(&m.stop));
        held.for_each(|m| m.rejected = Some(BodyRejection::Excluded));
        rest
    }

    /// Stops at which something in use was seen, ascending.
    pub fn used_stops(&self) -> BTreeSet<usize> {
        let images = self.problem.used().map(|(_, image)| image.stop);
        images.chain(self.problem.used_bodies().map(|(_, m)| m.stop)).collect()
    }

    /// Starts where an adjustment of some of its stops ended; sizes of latent joint errors and apparent displacements at `least`, rad or m, or
    /// more.
    pub fn start_near_some(&mut self, solved: &Self, least: f64) {
        self.state.clone_from(&solved.state);
        self.problem.noise.start_near(&solved.problem.noise, least);
        let factors = self.problem.families.iter_mut().zip(&solved.problem.families);
        factors.for_each(|(own, known)| own.factor = known.factor);
        self.hold_component_priors();
    }

    /// Leaves the local errors out: their columns stay at zero.
    pub fn without_local_errors(&mut self) {
        let Self { problem, state } = self;
        let first = problem.layout.terms.start;
        for c in problem.layout.locals.clone() {
            problem.layout.columns[c].free = false;
            state.robot.terms[c - first].value = 0.0;
        }
        problem.noise.local.fill(0.0);
    }

    /// The priors of local errors and of families follow their components; local errors that are left out keep theirs.
    pub fn hold_component_priors(&mut self) {
        let Self { problem, state } = self;
        problem.families.iter().for_each(|f| f.hold(&mut problem.layout));
        let first = problem.layout.terms.start;
        for c in problem.layout.locals.clone() {
            let column = &mut problem.layout.columns[c];
            if column.free {
                column.prior_sigma = problem.noise.local[state.robot.terms[c - first].reading];
            }
        }
    }

    /// Ties all images of the robot to their readings, without an error; no latent errors at all for readings that count as exact.
    pub fn tie_to_readings(&mut self, readings_are_exact: bool) {
        let Self { problem, state } = self;
        for (stop, errors) in problem.stops.iter().zip(&mut state.joint_errors) {
            *errors = vec![0.0; if readings_are_exact { 0 } else { stop.readings() }];
        }
        for (i, tie) in problem.upright_ties().into_iter().enumerate().filter(|(i, _)| problem.on_robot(*i)) {
            state.ties[i] = if readings_are_exact { Tie::Rigid } else { tie };
        }
    }

    /// Starts where an adjustment of the same series with another robot model ended: what both have is taken over, the observations that are left out, and the noise, joint
    /// noise at `least`, rad or m, or more.
    pub fn start_near(&mut self, solved: &Self, least: f64) {
        let Self { problem, state } = self;
        let mut robot = state.robot.clone();
        robot.twists.clone_from(&solved.state.robot.twists);
        for own in &mut robot.terms {
            let known = solved.state.robot.terms.iter().find(|t| (t.reading, t.term) == (own.reading, own.term));
            own.value = known.map_or(own.value, |t| t.value);
        }
        *state = State { robot, ..solved.state.clone() };
        for (own, known) in problem.images.iter_mut().zip(&solved.problem.images) {
            own.leave_out_as(known.observations.iter().map(|o| o.rejected));
        }
        problem.noise.start_near(&solved.problem.noise, least);
        problem.families.iter_mut().for_each(|f| f.take_factor(&solved.problem.families));
        self.hold_component_priors();
    }

    /// The adjustment with another camera in the place of one.
    #[must_use]
    pub fn with_camera(&self, index: usize, camera: Camera) -> Self {
        let mut other = self.clone();
        let Self { problem, state } = &mut other;
        let field = problem.layout.fields[index].clone();
        problem.families.retain(|f| !f.columns.iter().any(|c| field.contains(c)));
        let (layout, from, moved) = problem.layout.with_camera(index, &problem.cameras[index], &camera);
        problem.layout = layout;
        let columns = problem.families.iter_mut().flat_map(|f| &mut f.columns);
        columns.filter(|c| **c >= from).for_each(|c| *c = c.saturating_add_signed(moved));
        state.cameras[index] = camera;
        problem.families.extend(Family::of_field(&problem.layout, state, index));
        other
    }

    /// What acts through the camera poses (robot, mountings, placements) stays as it is.
    pub fn hold_poses(&mut self) {
        let theta = self.problem.layout.theta_len();
        self.problem.layout.columns[..theta].iter_mut().for_each(|c| c.free = false);
    }

    /// Error of rotation (rad) and of position (m) of the pose that the readings of an image say, against another; `None` off the robot.
    pub fn misfit(&self, pose: &Pose, image: usize) -> Option<(f64, f64)> {
        Some(self.camera_by_readings(image)?.distance(pose))
    }
}
