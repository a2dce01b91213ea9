//! The finding that a camera sits loosely on its mount; [`super::loose`] looks for it.

use crate::diagnose::kind::{Kind, Quantity, Subject, some_of};
use crate::error::Code;
use crate::series::CameraMount;

/// Most images that are named.
const MOST_IMAGES: usize = 5;

/// A camera tips over between two positions.
#[derive(Debug, Clone, PartialEq)]
pub struct LooseMounting {
    /// Name of the mounting.
    pub mounting: String,
    /// Where its camera is.
    pub mount: CameraMount,
    /// About which axis of the camera: pitch, yaw, roll.
    pub turn: &'static str,
    /// Angle between the positions, rad.
    pub angle_rad: f64,
    /// Spread of either, rad.
    pub spread_rad: f64,
    /// Images in the rarer position.
    pub images: Vec<String>,
    /// Images in all.
    pub of: usize,
}

impl Kind for LooseMounting {
    fn code(&self) -> Code {
        Code::LooseMounting
    }

    fn subjects(&self) -> Vec<Subject> {
        let body = Subject::Body(self.mounting.clone());
        std::iter::once(body).chain(self.images.iter().cloned().map(Subject::Image)).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![Quantity::new("angle", self.angle_rad, "rad").with_sigma(self.spread_rad)]
    }

    fn place(&self) -> String {
        let held_by = match self.mount {
            CameraMount::Hand => "mount",
            CameraMount::Fixed => "stand",
        };
        format!("camera {held_by} {}", self.mounting)
    }

    fn seen(&self) -> String {
        let loose = match self.mount {
            CameraMount::Hand => "it is loose on its mount or slips",
            CameraMount::Fixed => "its stand, or the plate on the tip, is loose or slips",
        };
        format!(
            "the {} of the camera has two values {:.2} mrad apart ({} of {} images: {}): {loose}, or a joint has backlash",
            self.turn,
            1e3 * self.angle_rad,
            self.images.len(),
            self.of,
            some_of(&self.images, MOST_IMAGES)
        )
    }

    fn remedy(&self) -> String {
        match self.mount {
            CameraMount::Hand => "fasten it and take the series again; if it was firm, look for a joint with play",
            CameraMount::Fixed => {
                "fasten the stand of the camera, and the plate on the tip, and take the series again; if both were firm, look for a joint with play"
            }
        }
        .into()
    }
}
