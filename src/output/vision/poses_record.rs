//! What `robotcal poses` found, for its report.

use crate::assess::Limits;
use crate::diagnose::Weight;
use crate::error::Notice;
use crate::identify::{PoseComparison, PoseSigma, StartVerdict};
use crate::linalg::median;
use crate::output::photogrammetry::Photogrammetry;
use crate::output::solution::finding_record::FindingRecord;
use crate::output::solution_json::{
    CameraRecord, EstimateRecord, ImageRecord, PlateRecord, ProgramRecord, SeriesRecord, StatisticsRecord,
};
use crate::series::InputFile;

/// Name of the record that a program reads.
pub const FILE_NAME: &str = "poses.json";

/// Cameras, plates and poses from images alone.
#[derive(Debug, Clone)]
pub struct PosesRecord {
    /// What wrote it.
    pub program: ProgramRecord,
    /// Files of this result.
    pub files: Vec<String>,
    /// What was read.
    pub inputs: Vec<InputFile>,
    /// Numbers that decided its verdicts.
    pub limits: Limits,
    /// All that was found out about the data.
    pub findings: Vec<FindingRecord>,
    /// What the user should know, though the result stands.
    pub notices: Vec<Notice>,
    /// Series.
    pub series: Vec<SeriesRecord>,
    /// Residuals.
    pub statistics: StatisticsRecord,
    /// Starting values.
    pub starts: Vec<StartVerdict>,
    /// Cameras.
    pub cameras: Vec<CameraRecord>,
    /// Plates.
    pub plates: Vec<PlateRecord>,
    /// Images with their observations.
    pub images: Vec<ImageRecord>,
    /// All scalar estimates.
    pub estimates: Vec<EstimateRecord>,
    /// How well the pose of every image in use is known.
    pub known: Vec<PoseSigma>,
    /// The poses of another source, by the name of their file.
    pub against: Option<(String, PoseComparison)>,
}

impl PosesRecord {
    /// What it says of images, cameras and plates: all but the poses.
    pub fn photogrammetry(&self) -> Photogrammetry<'_> {
        Photogrammetry {
            record: FILE_NAME,
            program: &self.program,
            files: &self.files,
            inputs: &self.inputs,
            robot: None,
            series: &self.series,
            statistics: &self.statistics,
            starts: &self.starts,
            cameras: &self.cameras,
            plates: &self.plates,
            images: &self.images,
            estimates: &self.estimates,
        }
    }

    /// Findings that say that the result is not to be trusted.
    pub fn failed(&self) -> impl Iterator<Item = &FindingRecord> {
        self.findings.iter().filter(|f| f.weight != Weight::Note)
    }
}

/// How well a pose is usually known: medians of the standard deviations of position, m, and direction, rad.
pub fn usual(known: &[PoseSigma]) -> Option<[f64; 2]> {
    let middle = |of: fn(&PoseSigma) -> f64| median(known.iter().map(of).collect::<Vec<_>>());
    Some([middle(|s| s.position_m)?, middle(|s| s.rotation_rad)?])
}

/// The pose whose position is known worst.
pub fn worst(known: &[PoseSigma]) -> Option<&PoseSigma> {
    known.iter().max_by(|a, b| a.position_m.total_cmp(&b.position_m))
}
