//! Is one image predicted far worse than the others, and than its place lets it be?
//!
//! A stop at the end of what the series covers is extrapolated to where it is held out: it misses by more than others, and tells most.

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::assess::{Accuracy, expected_mm};
use crate::error::Code;
use crate::fit::Fit;

/// An image that the others predict far worse than each other, and than what they leave open of the robot lets them.
#[derive(Debug, Clone, PartialEq)]
pub struct OddImage {
    /// Its name.
    pub image: String,
    /// Its held-out error, mm.
    pub error_mm: f64,
    /// Of all images, mm RMS.
    pub rms_mm: f64,
    /// What was to be expected of it by what the other images leave open and by the noise, mm RMS; none where that is not known.
    pub expected_mm: Option<f64>,
}

pub(super) fn check(fit: &Fit, accuracy: &Accuracy, setting: &CheckContext) -> Option<OddImage> {
    let (rms_mm, times) = (accuracy.calibrated.rms_mm, setting.limits.doubtful_odd_image);
    let errors = accuracy.per_image_mm.iter().enumerate().filter_map(|(i, error)| Some((i, (*error)?[1])));
    let far: Vec<(usize, f64)> = errors.filter(|(_, error_mm)| *error_mm > times * rms_mm).collect();
    if far.is_empty() {
        return None;
    }
    let images: Vec<usize> = far.iter().map(|(i, _)| *i).collect();
    let expected = expected_mm(fit.linear(), &images, setting.limits);
    let usual = |i: &usize| expected.get(i).map_or(rms_mm, |mm| mm.max(rms_mm));
    let odd = far.into_iter().filter(|(i, error_mm)| *error_mm > times * usual(i));
    let (worst, error_mm) = odd.max_by(|a, b| (a.1 / usual(&a.0)).total_cmp(&(b.1 / usual(&b.0))))?;
    let (image, expected_mm) = (fit.problem.images[worst].name.clone(), expected.get(&worst).copied());
    Some(OddImage { image, error_mm, rms_mm, expected_mm })
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
        let errors = [("error", Some(self.error_mm)), ("rms", Some(self.rms_mm)), ("expected", self.expected_mm)];
        errors.into_iter().filter_map(|(name, mm)| Some(Quantity::new(name, 1e-3 * mm?, "m"))).collect()
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
