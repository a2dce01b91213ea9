//! Can camera.yaml express the lens that was found?

use super::kind::{Kind, Quantity, Subject, Weight};
use crate::error::Code;

/// camera.yaml cannot express the lens of a camera.
#[derive(Debug, Clone, PartialEq)]
pub struct LensNotInRos {
    /// Camera.
    pub camera: String,
    /// Its lens.
    pub lens: &'static str,
    /// What is lost, RMS over the image, px.
    pub rms_px: f64,
    /// The most, px.
    pub worst_px: f64,
}

impl Kind for LensNotInRos {
    fn code(&self) -> Code {
        Code::LensNotInRos
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn subjects(&self) -> Vec<Subject> {
        vec![Subject::Camera(self.camera.clone())]
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![Quantity::new("rms", self.rms_px, "px"), Quantity::new("worst", self.worst_px, "px")]
    }

    fn place(&self) -> String {
        format!("camera {}", self.camera)
    }

    fn seen(&self) -> String {
        format!(
            "camera.yaml cannot express its {} lens: it is off by {:.3} px RMS over the image, at most {:.3} px",
            self.lens, self.rms_px, self.worst_px
        )
    }

    fn remedy(&self) -> String {
        "solution.json has the lens itself; --camera ros identifies one that camera.yaml can express".into()
    }
}
