//! Does the camera model explain the images, with a pose of its own for every one of them?

use super::given_camera::GivenCamera;
use super::kind::{CheckContext, Kind, Quantity};
use crate::error::Code;
use crate::problem::Problem;

/// The stand-alone camera poses leave too much.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraModelMisfit {
    /// RMS of the lengths of their residuals, px per point.
    pub rms_px: f64,
    /// Whether a camera was given.
    pub given: GivenCamera,
}

/// Looks at what is left beside the noise that is stated of the observations.
pub(super) fn check(problem: &Problem, setting: &CheckContext) -> Option<CameraModelMisfit> {
    let rms_px = setting.free.rms_px;
    let variances = problem.used().flat_map(|(_, image)| image.used()).map(|o| o.stated_variance_px2());
    let (sum, count) = variances.fold((0.0, 0.0f64), |(sum, count), v| (sum + v, count + 1.0));
    let unexplained = rms_px.powi(2) - sum / count.max(1.0);
    (unexplained > setting.limits.free_rms_px.powi(2))
        .then(|| CameraModelMisfit { rms_px, given: GivenCamera::of(setting.series, None) })
}

impl Kind for CameraModelMisfit {
    fn code(&self) -> Code {
        Code::CameraModelMisfit
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![Quantity::new("free_pose_rms", self.rms_px, "px")]
    }

    fn place(&self) -> String {
        "camera".into()
    }

    fn seen(&self) -> String {
        format!(
            "stand-alone camera poses leave {:.2} px per point: the camera model or the plate does not describe these images",
            self.rms_px
        )
    }

    fn remedy(&self) -> String {
        let camera = self.given.remedy().unwrap_or("try --camera auto");
        format!("{camera}, and check that plate.toml describes the plate in the images")
    }
}
