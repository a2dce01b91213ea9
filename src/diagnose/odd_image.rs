//! Is one image predicted far worse than the others?

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::assess::Accuracy;
use crate::error::Code;
use crate::fit::Fit;

/// An image that the others predict far worse than each other.
#[derive(Debug, Clone, PartialEq)]
pub struct OddImage {
    /// Its name.
    pub image: String,
    /// Its held-out error, mm.
    pub error_mm: f64,
    /// Of all images, mm RMS.
    pub rms_mm: f64,
}

pub(super) fn check(fit: &Fit, accuracy: &Accuracy, setting: &CheckContext) -> Option<OddImage> {
    let errors = accuracy.per_image_mm.iter().enumerate().filter_map(|(i, error)| Some((i, (*error)?[1])));
    let (worst, error_mm) = errors.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let rms_mm = accuracy.calibrated.rms_mm;
    let is_odd = error_mm > setting.limits.doubtful_odd_image * rms_mm;
    is_odd.then(|| OddImage { image: fit.problem.images[worst].name.clone(), error_mm, rms_mm })
}

impl Kind for OddImage {
    fn code(&self) -> Code {
        Code::OddImage
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn subjects(&self) -> Vec<Subject> {
        vec![Subject::Image(self.image.clone())]
    }

    fn quantities(&self) -> Vec<Quantity> {
        let errors = [("error", self.error_mm), ("rms", self.rms_mm)];
        errors.map(|(name, mm)| Quantity::new(name, 1e-3 * mm, "m")).into()
    }

    fn place(&self) -> String {
        self.image.clone()
    }

    fn seen(&self) -> String {
        format!("is off by {:.3} mm, far more than the others", self.error_mm)
    }

    fn remedy(&self) -> String {
        "look at it in the report; did the arm stand still?".into()
    }
}
