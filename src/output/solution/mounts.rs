//! Where the cameras of a solution are: of one robot some may be in the hand and others in the cell.

use super::solution_json::SolutionRecord;
use crate::assess::Standing;
use crate::problem::Names;
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

    /// Which base and tool the expected errors of the flange are stated with, in words: in files of earlier versions they are relative to the plate.
    pub fn flange_fits(&self) -> &'static str {
        let is_earlier = !self.images.is_empty() && self.flange.is_some_and(|e| e.placed_m.is_none());
        if is_earlier { "relative to the plate" } else { "with the base and the tool that fit best" }
    }

    /// What stands still for most images on the robot, in a word.
    pub fn stands_still(&self) -> &'static str {
        let mountings: Vec<String> = self.mountings.iter().map(|m| m.name.clone()).collect();
        let placements: Vec<String> = self.placements.iter().map(|p| p.name.clone()).collect();
        let names = Names { mountings: &mountings, placements: &placements, ..Names::default() };
        let used = self.images.iter().filter(|i| i.is_used_on_robot());
        match Standing::of_most(used.map(|i| Standing::of(i.camera_mount, i.mounting, i.placement)), &names) {
            Some(Standing::Mounting(_)) => "camera",
            _ => "plate",
        }
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
