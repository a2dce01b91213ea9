//! Can camera.yaml express the lens that was found?

use super::given_camera::GivenCamera;
use super::kind::{Kind, Quantity, Subject, Weight};
use crate::error::Code;

/// camera.yaml cannot express the lens of a camera.
#[derive(Debug, Clone, PartialEq)]
pub struct LensNotInRos {
    /// Camera.
    pub camera: String,
    /// Its lens.
    pub lens: &'static str,
    /// What is lost over the image, RMS and at most, px; none where no lens of ROS comes near, and there is no camera.yaml.
    pub loss_px: Option<[f64; 2]>,
    /// Whether the camera was given: then the lens is that of its file.
    pub given: GivenCamera,
}

impl Kind for LensNotInRos {
    fn code(&self) -> Code {
        if self.loss_px.is_some() { Code::LensNotInRos } else { Code::CameraFileImpossible }
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn subjects(&self) -> Vec<Subject> {
        vec![Subject::Camera(self.camera.clone())]
    }

    fn quantities(&self) -> Vec<Quantity> {
        let named =
            self.loss_px.map(|[rms, worst]| [Quantity::new("rms", rms, "px"), Quantity::new("worst", worst, "px")]);
        named.into_iter().flatten().collect()
    }

    fn place(&self) -> String {
        format!("camera {}", self.camera)
    }

    fn seen(&self) -> String {
        match self.loss_px {
            Some([rms, worst]) => format!(
                "camera.yaml is off by {rms:.3} px RMS, at most {worst:.3} px: over the image it cannot express the {} lens",
                self.lens
            ),
            None => format!("no lens of ROS comes near to its {} lens: there is no camera.yaml", self.lens),
        }
    }

    fn remedy(&self) -> String {
        match self.loss_px {
            _ if self.given != GivenCamera::Not => "the lens is that of --camera-file (with --from, --camera ros sets it aside); solution.json has it itself, and robotcal convert writes it in a format that holds it".into(),
            Some(_) => "solution.json has the lens itself; --camera ros identifies one that camera.yaml can express".into(),
            None => "solution.json has the lens itself, and robotcal convert writes it in a format that holds it; --camera ros identifies one that camera.yaml can express".into(),
        }
    }
}
