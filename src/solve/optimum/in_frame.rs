//! Covariances in the plate frame that the nominal markers define ([`super::frame`]).
//!
//! Nothing is subtracted from a covariance with priors, of which so little would remain that rounding decides. Instead the frame is held in
//! the normal equations. (1) `N' P c = 0` for the corrections: of markers with the information `V = F F'`, eliminated as `Y = B F^-T`,
//! the part `Y O` is put back, `O` the orthonormal basis of `F^-1 P N`; the information grows by `Y O O' Y'`. Where markers stay, the
//! combinations are projected out. Images do not see this motion, so to hold it is to transform to it. They hardly see the scale, and a robot does: what the
//! tolerances leave open of it becomes a part of the mode that is scale. (2) Poses `T = T' + A s` follow what the modes `s` move
//! of the frame, a congruence of the information. What is left is known from images, as positive definite as they make it.

use std::ops::Range;

use nalgebra::{DMatrix, Matrix3, Matrix6};

use super::covariance::{Covariance, put_first};
use super::fit::Fit;
use super::frame::{Frame, frames};
use crate::error::{Code, Error, Result};
use crate::model::plate_modes::MODES;
use crate::problem::{Adjustment, Problem, SCALE};
use crate::solve::elimination::seen_markers::SeenMarkers;
use crate::solve::elimination::system::{Eliminated, Elimination, Singular, System};
use crate::solve::linear::{LinearImage, LinearProblem};

/// Covariance with the plates held in their frames.
#[derive(Debug, Clone)]
pub struct InFrame {
    /// The frames, of all plates that were seen.
    pub frames: Vec<Frame>,
    covariance: Covariance,
    /// Covariance of the first columns by a second stage, whose poses of plates are stated as they are.
    of_second_stage: Option<DMatrix<f64>>,
}

/// Six unknowns of a pose that follow the modes of plates.
struct Following {
    /// Its first unknown.
    pose: Place,
    /// First column of the modes.
    modes: usize,
    /// `A`, six x modes.
    by: DMatrix<f64>,
}

#[derive(Clone, Copy)]
enum Place {
    Reduced(usize),
    /// Eliminated: a stop by its place among those in use, and the first among what is latent there.
    Latent(usize, usize),
}

/// Covariance with the plates in their frames, with what was added to the covariance `stated` and what a second stage replaced of it.
///
/// # Errors
/// Markers that define no frame; normal equations that are singular.
pub fn in_frame(linear: LinearProblem, stated: &Covariance) -> Result<InFrame> {
    in_frame_by(Elimination::cheaper(linear), linear, stated)
}

/// As [`in_frame`] by a given elimination.
///
/// # Errors
/// As [`in_frame`].
pub fn in_frame_by(which: Elimination, linear: LinearProblem, stated: &Covariance) -> Result<InFrame> {
    Stated { linear, covariance: stated }.in_frame_from(System::without_distances(which, linear, 0.0))
}

impl Fit {
    /// Its covariance with the plates in their frames, as [`in_frame`].
    ///
    /// # Errors
    /// As [`in_frame`].
    pub fn in_frame(&self) -> Result<InFrame> {
        let is_whole = self.linearised.distances.is_empty() && self.problem.restraint.is_none();
        match self.covariance.own_system().filter(|_| is_whole) {
            Some(system) => {
                Stated { linear: self.linear(), covariance: &self.covariance }.in_frame_from(system.clone())
            }
            None => in_frame(self.linear(), &self.covariance),
        }
    }
}

/// A linear problem with the covariance that is stated of it.
struct Stated<'a> {
    linear: LinearProblem<'a>,
    covariance: &'a Covariance,
}

impl Stated<'_> {
    /// From the system without measured distances.
    fn in_frame_from(&self, mut system: System) -> Result<InFrame> {
        let Self { linear, covariance: stated } = *self;
        let problem = &linear.adjustment.problem;
        let frames = frames(linear.adjustment)?;
        let following = following(linear, &system, &frames);
        widen_scales(problem, &frames, &mut system);
        let combinations = combinations(linear, &frames);
        let held = hold(&mut system, combinations, &following);
        system.add_distances(linear, held.as_ref());
        let singular =
            |e: Singular| Error::new(Code::FitUndetermined, "plate", e.to_string(), "take images of more of the plate");
        let factor = system.factor(linear).map_err(singular)?;
        let mut covariance = Covariance::of(problem, system, factor);
        if let (Eliminated::Stops(e), Some(held)) = (&covariance.system.eliminated, &held) {
            e.project(held, &mut covariance.reduced);
        }
        if let Some(added) = &stated.added {
            covariance.add(&followed(added.clone(), &following));
        }
        stated.enlarged.iter().for_each(|&(column, factor)| covariance.enlarge(column, factor));
        Ok(InFrame { frames, covariance, of_second_stage: stated.replaced_first() })
    }
}

/// Poses that follow, of placements and of images without a tie to the robot.
fn following(linear: LinearProblem, system: &System, frames: &[Frame]) -> Vec<Following> {
    let problem = &linear.adjustment.problem;
    let layout = &problem.layout;
    let mut all = Vec::new();
    let mut placements_done = vec![false; problem.placements.len()];
    for own in linear.images() {
        let LinearImage { image, tie, stop: at, .. } = own;
        let Some(frame) = frames.iter().find(|f| f.plates.contains(&image.plate)) else { continue };
        let (pose, by) = if let Some(pose) = tie.free_pose() {
            let [_, Range { start, .. }] = own.latents();
            let place = system.latent_start.get(at).map_or(Place::Latent(at, start), |s| Place::Reduced(s + start));
            (place, frame.pose_by_modes(image.plate, pose))
        } else {
            let start = layout.placements[image.placement].start;
            let moves = (start..start + 6).all(|c| layout.columns[c].free && system.touched(c));
            if std::mem::replace(&mut placements_done[image.placement], true) || !moves {
                continue;
            }
            (Place::Reduced(start), frame.placement_by_modes())
        };
        for (p, &plate) in frame.plates.iter().enumerate() {
            let modes = layout.shapes[plate].start;
            let mut by = by.columns(MODES * p, MODES).into_owned();
            let fixed = (0..MODES).filter(|m| !layout.columns[modes + m].free);
            fixed.for_each(|m| by.column_mut(m).fill(0.0));
            all.push(Following { pose, modes, by });
        }
    }
    all
}

/// What the tolerances of markers leave open of the scale of a plate goes to its mode.
fn widen_scales(problem: &Problem, frames: &[Frame], system: &mut System) {
    for (frame, &plate) in frames.iter().flat_map(|f| f.plates.iter().map(move |p| (f, p))) {
        let at = problem.layout.shapes[plate].start + SCALE;
        let column = &problem.layout.columns[at];
        if column.free {
            let prior = column.prior_sigma.powi(2);
            system.information[(at, at)] += 1.0 / (prior + frame.scale_variance(plate)) - 1.0 / prior;
        }
    }
}

/// The combinations of corrections that the frames hold, 3 markers x motions.
fn combinations(linear: LinearProblem, frames: &[Frame]) -> DMatrix<f64> {
    let seen = SeenMarkers::of(linear);
    let motions = frames.iter().map(|f| f.by_modes.nrows()).sum();
    let mut combinations = DMatrix::zeros(3 * seen.order.len(), motions);
    let mut first = 0;
    for frame in frames {
        for (at, &(plate, marker)) in seen.order.iter().enumerate().filter(|(_, m)| frame.seen.contains(m)) {
            let own = frame.held(&linear.adjustment.problem, plate, marker);
            combinations.view_mut((3 * at, first), own.shape()).copy_from(&own);
        }
        first += frame.by_modes.nrows();
    }
    combinations
}

/// Holds the combinations and lets poses follow; returns the orthonormal combinations where markers stay in the system.
fn hold(system: &mut System, combinations: DMatrix<f64>, following: &[Following]) -> Option<DMatrix<f64>> {
    let held = match &mut system.eliminated {
        Eliminated::Markers(e) => {
            let taken = e.hold(&combinations);
            system.information += &taken * taken.transpose();
            None
        }
        Eliminated::Stops(e) => Some(e.hold(combinations, &mut system.information)),
    };
    for Following { pose, modes, by } in following {
        match (pose, &mut system.eliminated) {
            (Place::Reduced(pose), eliminated) => {
                let a = &mut system.information;
                let columns = a.columns(*pose, by.nrows()) * by;
                let mut into = a.columns_mut(*modes, by.ncols());
                into += columns;
                let rows = by.tr_mul(&a.rows(*pose, by.nrows()));
                let mut into = a.rows_mut(*modes, by.ncols());
                into += rows;
                if let Eliminated::Markers(e) = eliminated {
                    e.carry(*pose, *modes, by);
                }
            }
            (Place::Latent(stop, first), Eliminated::Stops(e)) => e.carry((*stop, *first), *modes, by),
            (Place::Latent(..), Eliminated::Markers(_)) => {}
        }
    }
    held
}

/// A covariance of the first unknowns after poses have followed.
fn followed(mut added: DMatrix<f64>, following: &[Following]) -> DMatrix<f64> {
    for Following { pose, modes, by } in following {
        let Place::Reduced(pose) = *pose else { continue };
        if pose + by.nrows() > added.nrows() {
            continue;
        }
        let rows = by * added.rows(*modes, by.ncols());
        let mut from = added.rows_mut(pose, by.nrows());
        from -= rows;
        let columns = added.columns(*modes, by.ncols()) * by.transpose();
        let mut from = added.columns_mut(pose, by.nrows());
        from -= columns;
    }
    added
}

impl InFrame {
    /// The frame of a plate; none where no image shows it.
    pub fn frame(&self, plate: usize) -> Option<&Frame> {
        self.frames.iter().find(|f| f.plates.contains(&plate))
    }

    /// Covariance of so many dense columns, the first.
    pub fn dense(&self, columns: usize) -> DMatrix<f64> {
        let mut all = self.covariance.reduced.view((0, 0), (columns, columns)).into_owned();
        if let Some(first) = &self.of_second_stage {
            put_first(&mut all, first);
        }
        all
    }

    /// Covariance of a placement.
    pub fn placement(&self, start: usize) -> Matrix6<f64> {
        let own = self.of_second_stage.as_ref().unwrap_or(&self.covariance.reduced);
        own.fixed_view::<6, 6>(start, start).into_owned()
    }

    /// Covariance of the camera pose of every image in use, tied to the robot or not, as its body twist, m and rad.
    pub fn camera_poses(&self, linear: LinearProblem) -> Vec<Matrix6<f64>> {
        self.covariance.camera_poses(linear)
    }

    /// Covariances of the free camera poses of all images in use.
    pub fn poses(&self, linear: LinearProblem) -> Vec<Matrix6<f64>> {
        let of = |c: DMatrix<f64>| {
            let c = Matrix6::from_column_slice(c.as_slice());
            0.5 * (c + c.transpose())
        };
        self.covariance.of_images(linear).into_iter().map(of).collect()
    }

    /// Covariance of the free camera poses of all images in use together, six rows each, in their order; none where what is latent at the
    /// stops was eliminated.
    pub fn poses_together(&self, linear: LinearProblem) -> Option<DMatrix<f64>> {
        let first = |own: LinearImage| {
            let [_, Range { start, .. }] = own.latents();
            own.tie.free_pose()?;
            Some(self.covariance.system.latent_start.get(own.stop)? + start)
        };
        let starts: Vec<usize> = linear.images().map(first).collect::<Option<_>>()?;
        let rows: Vec<usize> = starts.into_iter().flat_map(|s| s..s + 6).collect();
        Some(self.covariance.reduced.select_rows(&rows).select_columns(&rows))
    }

    /// Sigma of the scale of a plate.
    pub fn scale_sigma(&self, problem: &Problem, plate: usize) -> Option<f64> {
        self.frame(plate).map(|f| f.scale_sigma(problem, &self.covariance.reduced, plate))
    }

    /// Covariance of the position (modes and correction, without the scale of the plate) of every marker, per plate. A marker that no
    /// image shows keeps its tolerance; a plate that no image shows its modes, too.
    pub fn positions(&self, adjustment: &Adjustment) -> Vec<Vec<Matrix3<f64>>> {
        let Adjustment { problem, state } = adjustment;
        let carried = |plate: usize, marker: usize| match self.frame(plate) {
            Some(frame) => frame.moved_by_modes(adjustment, (plate, marker)),
            None => vec![(problem.layout.shapes[plate].start, state.plates[plate].modes_at(marker))],
        };
        let reduced = &self.covariance.reduced;
        let unseen = |plate: usize, marker: usize| -> Matrix3<f64> {
            let all = carried(plate, marker);
            let of = |(i, a): &(usize, _)| -> Matrix3<f64> {
                all.iter().map(|(k, b)| a * reduced.fixed_view::<MODES, MODES>(*i, *k) * b.transpose()).sum()
            };
            all.iter().map(of).sum::<Matrix3<f64>>() + Matrix3::identity() / problem.marker_information(plate, marker)
        };
        let seen = self.covariance.system.marker_covariances_with(reduced, Some(&carried));
        let plate = |(p, markers): (usize, Vec<Option<Matrix3<f64>>>)| {
            markers.into_iter().enumerate().map(|(m, c)| c.unwrap_or_else(|| unseen(p, m))).collect()
        };
        seen.into_iter().enumerate().map(plate).collect()
    }
}
