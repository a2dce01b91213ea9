//! Is there a pattern in the residuals that noise does not explain, what would remove it, and does it matter?

use super::given_camera::GivenCamera;
use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::assess::{Accuracy, Bearer, Limits, Pattern, PatternEffect, PatternTest, cause, patterns};
use crate::error::Code;
use crate::fit::Fit;
use crate::model::camera::Lens;
use crate::problem::MeasuredSeries;

/// The residuals show a pattern.
#[derive(Debug, Clone, PartialEq)]
pub struct ResidualPattern {
    /// What it is, and what it does.
    pub found: PatternTest,
    /// Whose pattern it is.
    pub bearer: String,
    /// True where it moves flange or poses by more than is stated of them.
    pub matters: bool,
    /// True where the lens has terms of this kind, which do not suffice: priors hold them back, or their form is another.
    pub is_fitted: bool,
    /// True where the lens has a displacement field already.
    pub has_field: bool,
    /// Lenses that were tried for the camera and have less evidence than the one that was taken.
    pub tried: Vec<Lens>,
    /// Whether the camera was given.
    pub given: GivenCamera,
}

pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Option<ResidualPattern> {
    residual_pattern(fit, setting.limits).map(|pattern| pattern.given_by(setting.series))
}

/// The pattern that names the cause, where there is one.
pub fn residual_pattern(fit: &Fit, limits: &Limits) -> Option<ResidualPattern> {
    let tests = patterns(fit, limits).ok()?;
    let found = cause(&tests, limits)?.clone();
    let bearer = match found.bearer {
        Bearer::Camera(k) => fit.problem.cameras.get(k)?.clone(),
        Bearer::Plate(k) => fit.problem.plate_name(k),
    };
    let matters = found.moved.is_some_and(|m| m.sigmas() > limits.pattern_moves);
    let is_fitted = matches!(found.bearer, Bearer::Camera(k) if found.pattern.is_fitted(fit, k));
    let has_field = matches!(found.bearer, Bearer::Camera(k) if fit.state.cameras[k].lens.has_field());
    Some(ResidualPattern { found, bearer, matters, is_fitted, has_field, tried: Vec::new(), given: GivenCamera::Not })
}

/// What it looks like, and what removes it.
fn words(pattern: Pattern) -> [&'static str; 2] {
    match pattern {
        Pattern::ThinPrism => [
            "grow with the square of the distance from the axis, to one side",
            "try --camera thin_prism: an element of the lens is tilted",
        ],
        Pattern::Radial => {
            ["are radial, of a higher order than the lens has", "try --camera rational, or fisheye for a wide lens"]
        }
        Pattern::Parallax => {
            ["are radial and go with the distance", "try --camera parallax: the entrance pupil of the lens moves"]
        }
        Pattern::Field => ["are smooth over the image, and no formula has them", "try --camera brown+field"],
        Pattern::PlateBow => {
            ["are those of heights of the plate", "flatten the plate, or state a larger tolerance_m of its markers"]
        }
        Pattern::PlatePrint => {
            ["are those of markers shifted smoothly in the plate", "measure the markers, or state a larger tolerance_m"]
        }
        Pattern::Tolerance => ["", "state a larger tolerance_m, or give --marker-tolerance estimated"],
    }
}

impl ResidualPattern {
    /// The same, where these series say whether its camera was given.
    #[must_use]
    pub fn given_by(self, series: &[MeasuredSeries]) -> Self {
        let given = match self.found.bearer {
            Bearer::Camera(_) => GivenCamera::of(series, Some(&self.bearer)),
            Bearer::Plate(_) => GivenCamera::Not,
        };
        Self { given, ..self }
    }

    /// The lens that the remedy would name.
    fn remedy_lens(&self) -> Option<Lens> {
        match self.found.bearer {
            Bearer::Plate(_) => None,
            Bearer::Camera(_) if self.is_fitted || self.found.pattern == Pattern::Field => Some(Lens::BrownField),
            Bearer::Camera(_) => self.found.pattern.lens(),
        }
    }

    fn moves(&self) -> String {
        let Some(PatternEffect { flange_m, pose_m, pose_rad }) = self.found.moved else { return String::new() };
        match flange_m {
            Some([by, sigma]) => {
                format!("; without it the flange moves by {:.3} mm (stated sigma {:.3} mm)", 1e3 * by, 1e3 * sigma)
            }
            None => format!(
                "; without it the camera poses move by {:.4} mm and {:.3} arcmin (stated sigmas {:.4} mm, {:.3} arcmin)",
                1e3 * pose_m[0],
                60.0 * pose_rad[0].to_degrees(),
                1e3 * pose_m[1],
                60.0 * pose_rad[1].to_degrees()
            ),
        }
    }
}

impl Kind for ResidualPattern {
    fn code(&self) -> Code {
        Code::ResidualPattern
    }

    fn weight(&self) -> Weight {
        if self.matters { Weight::Gate } else { Weight::Note }
    }

    fn subjects(&self) -> Vec<Subject> {
        match self.found.bearer {
            Bearer::Camera(_) => vec![Subject::Camera(self.bearer.clone())],
            Bearer::Plate(_) => vec![Subject::Body(self.bearer.clone())],
        }
    }

    fn quantities(&self) -> Vec<Quantity> {
        let test = &self.found;
        let mut all = vec![
            Quantity::new("chi_squared", test.statistic, "1"),
            Quantity::new("degrees_of_freedom", test.degrees as f64, "1"),
            Quantity::new("found_from", test.least_px, "px"),
        ];
        if test.rms_px.is_finite() {
            all.push(Quantity::new("pattern_rms", test.rms_px, "px"));
        }
        if let Some(PatternEffect { flange_m, pose_m, pose_rad }) = test.moved {
            let moved = |name: &str, [by, sigma]: [f64; 2], unit: &str| Quantity::new(name, by, unit).with_sigma(sigma);
            all.extend(flange_m.map(|m| moved("flange_moved", m, "m")));
            all.extend([moved("pose_moved", pose_m, "m"), moved("pose_turned", pose_rad, "rad")]);
        }
        all
    }

    fn place(&self) -> String {
        match self.found.bearer {
            Bearer::Camera(_) => format!("camera {}", self.bearer),
            Bearer::Plate(_) => self.bearer.clone(),
        }
    }

    fn seen(&self) -> String {
        let test = &self.found;
        match test.pattern {
            Pattern::Tolerance => format!(
                "the markers are off by {:.1} times the stated tolerance",
                (test.statistic / test.degrees.max(1) as f64).sqrt()
            ),
            pattern => format!(
                "the residuals show a pattern of {:.4} px RMS that noise does not leave: they {}{} (of patterns of {:.4} px 19 in 20 are found)",
                test.rms_px,
                words(pattern)[0],
                self.moves(),
                test.least_px
            ),
        }
    }

    fn remedy(&self) -> String {
        if let Some(remedy) = self.given.remedy() {
            return remedy.into();
        }
        match self.is_fitted {
            _ if self.has_field => {
                "no lens of this program has it beside a displacement field: nothing to do while the flange moves by less than its sigma".into()
            }
            _ if self.remedy_lens().is_some_and(|lens| self.tried.contains(&lens)) => {
                "the lenses that could have it were tried and have less evidence than this one: nothing to do while the flange moves by less than its sigma; else see whether focus or mount of the lens changed during the series".into()
            }
            true => "this lens has terms of this kind, and they do not suffice: try --camera brown+field".into(),
            false => words(self.found.pattern)[1].into(),
        }
    }
}
