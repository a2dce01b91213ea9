//! Estimators beside each other: what is recorded of them.

use serde::{Deserialize, Serialize};

use crate::assess::Ratio;
use crate::identify::estimator::Estimator;

/// Errors on images that the estimator did not see.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    /// RMS distance between measured and predicted markers, px.
    pub rms_px: f64,
    /// RMS distance in space at the plate, mm.
    pub rms_mm: f64,
    /// RMS in mm over that of the joint estimator, with bootstrap interval over images; those that share joint readings count once.
    pub to_joint: Option<Ratio>,
    /// Number of images predicted.
    pub images: usize,
}

/// Errors against what was put in.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TruthError {
    /// RMS error of the flange relative to the plate over held-out readings, gauge aligned, mm.
    pub flange_mm: f64,
    /// RMS error of the camera's position in the plate frame over held-out readings, nothing aligned, mm.
    pub camera_mm: f64,
}

/// One estimator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ComparisonRow {
    /// Which.
    pub estimator: Estimator,
    /// Held out fold by fold; images that share joint readings stay together.
    pub by_image: Option<HeldOut>,
    /// Held out one region of the workspace after the other; `None` for too few postures.
    pub by_region: Option<HeldOut>,
    /// Against truth.
    pub truth: Option<TruthError>,
}

/// The comparison.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Rows in the order A to F, of the estimators that took part.
    pub rows: Vec<ComparisonRow>,
    /// Images on the robot that took part.
    pub images: usize,
    /// Number of folds by image, and of regions of the workspace; 0 where too few postures make none.
    pub folds: [usize; 2],
}

impl Comparison {
    /// The two-stage fits that predicted held-out images, with their error over that of the joint fit.
    pub fn two_stage(&self) -> impl Iterator<Item = (&ComparisonRow, Ratio)> {
        let staged = |row: &&ComparisonRow| !matches!(row.estimator, Estimator::HardJoint | Estimator::Joint);
        self.rows.iter().filter(staged).filter_map(|row| Some((row, row.by_image?.to_joint?)))
    }

    /// The one of them with the smallest error.
    pub fn best_two_stage(&self) -> Option<(&ComparisonRow, Ratio)> {
        self.two_stage().min_by(|a, b| a.1.value.total_cmp(&b.1.value))
    }
}
