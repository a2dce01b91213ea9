//! What images tell of cameras, plates and poses: the part that the results of `identify` and of `poses` have in common.

use super::solution_json::{
    CameraRecord, EstimateRecord, FILE_NAME, ImageRecord, PlateRecord, ProgramRecord, RobotRecord, SeriesRecord,
    SolutionRecord, StatisticsRecord,
};
use crate::identify::StartVerdict;
use crate::series::InputFile;

/// The records of a result that speak of images.
#[derive(Debug, Clone, Copy)]
pub struct Photogrammetry<'a> {
    /// The file that holds all of them.
    pub record: &'static str,
    /// What wrote it.
    pub program: &'a ProgramRecord,
    /// Files of the result.
    pub files: &'a [String],
    /// What was read.
    pub inputs: &'a [InputFile],
    /// The robot; none where no robot takes part.
    pub robot: Option<&'a RobotRecord>,
    /// Series.
    pub series: &'a [SeriesRecord],
    /// Residuals.
    pub statistics: &'a StatisticsRecord,
    /// Starting values.
    pub starts: &'a [StartVerdict],
    /// Cameras.
    pub cameras: &'a [CameraRecord],
    /// Plates.
    pub plates: &'a [PlateRecord],
    /// Images with their observations.
    pub images: &'a [ImageRecord],
    /// All scalar estimates.
    pub estimates: &'a [EstimateRecord],
}

impl SolutionRecord {
    /// What it says of images, cameras and plates.
    pub fn photogrammetry(&self) -> Photogrammetry<'_> {
        Photogrammetry {
            record: FILE_NAME,
            program: &self.program,
            files: &self.files,
            inputs: &self.inputs,
            robot: Some(&self.robot),
            series: &self.series,
            statistics: &self.statistics,
            starts: &self.starts,
            cameras: &self.cameras,
            plates: &self.plates,
            images: &self.images,
            estimates: &self.estimates,
        }
    }
}

impl<'a> Photogrammetry<'a> {
    /// Observations in use of a camera: measured place (px) and stated covariance uu, uv, vv (px^2).
    pub fn seen_by(self, camera: usize) -> impl Iterator<Item = ([f64; 2], [f64; 3])> + 'a {
        let images = self.images.iter().filter(move |i| i.camera == camera && i.is_used());
        images.flat_map(|i| {
            let o = &i.observations;
            let used = o.reason.iter().map(Option::is_none);
            o.uv.iter()
                .copied()
                .zip(o.covariance.iter().copied())
                .zip(used)
                .filter_map(|(seen, used)| used.then_some(seen))
        })
    }
}
