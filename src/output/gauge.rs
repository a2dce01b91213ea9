//! The plates of a solution in the frames that their nominal markers define: shapes, poses, covariances and scales, made once for all files.
//!
//! The priors of modes and corrections hold a fitted plate in a frame of their own: the mean of a bow, or the turn of a skew, is left in it.
//! All that is written of plates goes through here, so that what one file states fits what another one does.

use nalgebra::{Matrix3, Matrix6};

use crate::error::Result;
use crate::fit::Fit;
use crate::geom::{Pose, adjoint};
use crate::problem::{Adjustment, PlateShape};
use crate::solve::{InFrame, PlateScale, Similarity};

/// Plates, their poses and covariances in the frames of their nominal markers.
pub(super) struct Gauge {
    /// Shapes of the plates at their sizes; that of a plate that no image shows as it was.
    pub plates: Vec<PlateShape>,
    /// Poses of the plates: `base_from_plate`, or `flange_from_plate` for a fixed camera.
    pub placements: Vec<Pose>,
    /// Covariances of these poses.
    pub placed: Vec<Matrix6<f64>>,
    /// `fitted plate frame <- frame` of every plate and of every placement.
    of_plates: Vec<Pose>,
    of_placements: Vec<Pose>,
    /// Size of every plate here over that in the fit.
    resized: Vec<f64>,
    /// Covariance of the position of every marker, its plate's scale apart, m^2.
    pub positions: Vec<Vec<Matrix3<f64>>>,
    /// Scale of every plate as in its files; none for a plate that no image shows.
    pub scales: Vec<Option<PlateScale>>,
}

impl Gauge {
    /// Of a fit with a robot and its plates in their frames: as large as they were found.
    ///
    /// # Errors
    /// Markers that lie on a line.
    pub fn of(fit: &Fit, in_frame: &InFrame) -> Result<Self> {
        Self::with_sizes(fit, in_frame, |_, found| found)
    }

    /// Of images alone, which see no size: plates as large as the stand-alone poses are given for.
    ///
    /// # Errors
    /// Markers that lie on a line.
    pub fn of_images(fit: &Fit, scales: &[Option<PlateScale>]) -> Result<Self> {
        let size = |plate: usize, found| scales[plate].map_or(found, |scale| 1.0 + scale.relative);
        let in_frame = fit.in_frame()?;
        Ok(Self { scales: scales.to_vec(), ..Self::with_sizes(fit, &in_frame, size)? })
    }

    /// `size` is that of a plate, of which the fit found one.
    fn with_sizes(fit: &Fit, in_frame: &InFrame, size: impl Fn(usize, f64) -> f64) -> Result<Self> {
        let Adjustment { problem, state } = &fit.adjustment;
        let mut plates = state.plates.clone();
        let mut of_plates = vec![Pose::identity(); plates.len()];
        let (mut scales, mut resized) = (vec![None; plates.len()], vec![1.0; plates.len()]);
        for frame in &in_frame.frames {
            let similarity = Similarity::of(frame, &fit.adjustment)?;
            for &plate in &frame.plates {
                let size = size(plate, similarity.size(plate));
                resized[plate] = size / similarity.size(plate);
                plates[plate] = similarity.shape(plate, &state.plates[plate], size);
                of_plates[plate] = similarity.motion;
                let sigma = in_frame.scale_sigma(problem, plate);
                scales[plate] = sigma.map(|sigma| PlateScale { relative: size - 1.0, sigma });
            }
        }
        let of_placements: Vec<Pose> =
            plates_of_placements(fit).into_iter().map(|p| p.map_or_else(Pose::identity, |p| of_plates[p])).collect();
        let placements = state.placements.iter().zip(&of_placements).map(|(pose, motion)| *pose * *motion).collect();
        let placed = problem.layout.placements.iter().zip(&of_placements).map(|(columns, motion)| {
            let followed = followed(motion);
            followed * in_frame.placement(columns.start) * followed.transpose()
        });
        let placed = placed.collect();
        let mut positions = in_frame.positions(fit);
        for (own, motion) in positions.iter_mut().zip(&of_plates) {
            let turn = motion.rotation.transpose();
            own.iter_mut().for_each(|c| *c = turn * *c * turn.transpose());
        }
        Ok(Self { plates, placements, placed, of_plates, of_placements, resized, positions, scales })
    }

    /// Body twist of the pose of a plate as it is written by that of the fit.
    pub fn followed(&self, placement: usize) -> Matrix6<f64> {
        followed(&self.of_placements[placement])
    }

    /// `camera_from_plate` of an image, of which the fit has this pose.
    pub fn camera_from_plate(&self, Adjustment { problem, state }: &Adjustment, image: usize, fitted: &Pose) -> Pose {
        let own = &problem.images[image];
        let is_free = own.rejected.is_none() && state.ties[image].is_free();
        if !is_free {
            return *fitted * self.of_placements[own.placement];
        }
        let followed = *fitted * self.of_plates[own.plate];
        Pose::new(followed.rotation, followed.translation * self.resized[own.plate])
    }
}

/// The body twist of `T M` is `Ad(M^-1)` times that of `T`.
fn followed(motion: &Pose) -> Matrix6<f64> {
    adjoint(&motion.inverse())
}

/// The plate of every placement: that of the images that tie it to the robot, else that of the first image.
fn plates_of_placements(Adjustment { problem, state }: &Adjustment) -> Vec<Option<usize>> {
    let mut plates = vec![None; problem.placements.len()];
    let tied = problem.used().filter(|(k, _)| !state.ties[*k].is_free()).map(|(_, image)| image);
    for image in tied.chain(&problem.images) {
        plates[image.placement].get_or_insert(image.plate);
    }
    plates
}
