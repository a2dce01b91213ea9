//! Where the cameras of a solution are: of one robot some may be in the hand and others in the cell.

use super::solution_json::SolutionRecord;
use crate::series::CameraMount;

impl SolutionRecord {
    /// Where the camera is of the images on the robot that show the plate at this placement; none without such an image.
    pub fn mount_of_placement(&self, placement: usize) -> Option<CameraMount> {
        self.images.iter().find(|i| i.is_on_robot() && i.placement == placement).map(|i| i.camera_mount)
    }

    /// Where the camera of this mounting is; none without an image on the robot.
    pub fn mount_of_mounting(&self, mounting: usize) -> Option<CameraMount> {
        self.images.iter().find(|i| i.is_on_robot() && i.mounting == mounting).map(|i| i.camera_mount)
    }
}

#[cfg(test)]
impl SolutionRecord {
    /// The solution that comes with the program, as if its second half of images were of a camera in the cell that sees another plate on the tip.
    pub(crate) fn with_both_mounts() -> Self {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("reports/kr6_small")
            .join(super::solution_json::FILE_NAME);
        let mut record = super::solution_json::read(&std::fs::read(path).unwrap()).unwrap();
        let carried = super::pose_record::PlacedRecord { name: "carried".into(), ..record.placements[0].clone() };
        record.placements.push(carried);
        record.mountings.push(record.mountings[0].clone());
        for image in record.images.iter_mut().skip(12) {
            (image.camera_mount, image.placement, image.mounting) = (CameraMount::Fixed, 1, 1);
        }
        record
    }
}
