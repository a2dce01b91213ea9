//! Stand-alone camera poses: what the free-pose adjustment found.

use std::collections::BTreeMap;

use nalgebra::{Matrix6, SVector};

use crate::geom::Pose;
use crate::init::SeenStop;
use crate::problem::{E, ImageTerms, Problem, State};
use crate::solve::PlateScale;

/// Stand-alone pose of one image.
#[derive(Debug, Clone, PartialEq)]
pub struct FreePose {
    /// `camera_from_plate`.
    pub camera_from_plate: Pose,
    /// Covariance of its body twist [rho, phi], m and rad, with the tolerances of the markers.
    pub covariance: Matrix6<f64>,
    /// The pose in the plate frame that the nominal markers define, with the scale of [`FreePoses::scales`]; the sigma of the scale is not
    /// in its covariance.
    pub in_frame: PlacedCamera,
    /// RMS of the lengths of its residuals, px.
    pub rms_px: f64,
    /// What the image by itself says of the focal length; `None` where it says nothing (seen from straight ahead).
    pub focal: Option<FocalLength>,
}

/// The focal length of one image, its pose being free and the other intrinsics those of all images.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FocalLength {
    /// Relative difference from that of all images.
    pub change: f64,
    /// Information on it, the inverse of its variance by the image noise.
    pub information: f64,
}

impl FocalLength {
    /// From the blocks of an image at a state with the focal lengths `[fx, fy]`, px.
    pub fn of(terms: &ImageTerms, [fx, fy]: [f64; 2]) -> Option<Self> {
        let mut direction = SVector::<f64, E>::zeros();
        (direction[0], direction[1]) = (fx, fy);
        let with_pose = terms.pe.fixed_columns::<E>(0) * direction;
        let solved = terms.pp.cholesky()?.solve(&with_pose);
        let information = direction.dot(&(terms.ee.fixed_view::<E, E>(0, 0) * direction)) - with_pose.dot(&solved);
        let pull = direction.dot(&terms.be.fixed_rows::<E>(0)) - solved.dot(&terms.bp);
        (information > 0.0).then(|| Self { change: pull / information, information })
    }
}

/// A camera in the frame of a plate.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedCamera {
    /// The pose.
    pub plate_from_camera: Pose,
    /// Covariance of its body twist [rho, phi], m and rad.
    pub covariance: Matrix6<f64>,
}

impl FreePoses {
    /// Of no image.
    pub fn none(state: State) -> Self {
        Self { poses: Vec::new(), rms_px: 0.0, observations: 0, state, scales: Vec::new(), pixel_factor: Vec::new() }
    }
}

/// The adjusted free poses.
#[derive(Debug, Clone)]
pub struct FreePoses {
    /// One for each image of the problem; `None` for an image that is left out.
    pub poses: Vec<Option<FreePose>>,
    /// RMS of the lengths of all residuals, px per point.
    pub rms_px: f64,
    /// Number of observations in use.
    pub observations: usize,
    /// Cameras and plates of this adjustment.
    pub state: State,
    /// Scale of every plate, in which the poses in its frame are given: as it was made, or as it was measured (`[scale]`). None for a
    /// plate that no image shows.
    pub scales: Vec<Option<PlateScale>>,
    /// Pixel factors found.
    pub pixel_factor: Vec<f64>,
}

impl FreePoses {
    /// Those of these images that were taken on the robot, with what they and their readings say, by index, for every camera mounting and plate
    /// placement.
    pub fn seen_stops(
        &self,
        problem: &Problem,
        images: impl Iterator<Item = usize>,
    ) -> BTreeMap<(usize, usize), Vec<(usize, SeenStop)>> {
        let mut groups: BTreeMap<(usize, usize), Vec<(usize, SeenStop)>> = BTreeMap::new();
        for i in images {
            let image = &problem.images[i];
            let (Some(stop), Some(pose)) = (problem.posture(i), &self.poses[i]) else { continue };
            let (readings, camera_from_plate) = (stop.readings.clone(), pose.camera_from_plate);
            let seen = SeenStop { readings, mount: image.mount, camera_from_plate };
            groups.entry((image.mounting, image.placement)).or_default().push((i, seen));
        }
        groups
    }

    /// Those of the mounting and placement with most of them.
    pub fn most_seen_stops(&self, problem: &Problem, images: impl Iterator<Item = usize>) -> Vec<SeenStop> {
        let largest = self.seen_stops(problem, images).into_values().max_by_key(Vec::len).unwrap_or_default();
        largest.into_iter().map(|(_, stop)| stop).collect()
    }
}
