//! Do most observations agree with the others?

use crate::assess::Limits;
use crate::diagnose::given_camera::GivenCamera;
use crate::diagnose::kind::{CheckContext, Kind, Quantity, Subject};
use crate::error::Code;
use crate::problem::{Adjustment, MeasuredSeries};

/// Many single observations were left out of images in use.
#[derive(Debug, Clone, PartialEq)]
pub struct ObservationsLeftOut {
    /// Share of all.
    pub share: f64,
    /// Image that lost the largest share, and this share.
    pub worst: (String, f64),
    /// Whether a camera was given.
    pub given: GivenCamera,
}

pub fn check(adjustment: &Adjustment, setting: &CheckContext) -> Option<ObservationsLeftOut> {
    observations_left_out(adjustment, setting.limits).map(|found| found.given_by(setting.series))
}

/// More observations left out than clean images lose.
pub fn observations_left_out(adjustment: &Adjustment, limits: &Limits) -> Option<ObservationsLeftOut> {
    let (mut out, mut all, mut worst) = (0, 0, (0.0, ""));
    for (_, image) in adjustment.problem.used() {
        let (n, rejected) = (image.observations.len(), image.observations.len() - image.used().count());
        (out, all) = (out + rejected, all + n);
        let share = rejected as f64 / n.max(1) as f64;
        if share > worst.0 {
            worst = (share, image.name.as_str());
        }
    }
    let share = f64::from(out as u32) / f64::from(all.max(1) as u32);
    let found = ObservationsLeftOut { share, worst: (worst.1.to_owned(), worst.0), given: GivenCamera::Not };
    (share > limits.share_of_observations_left_out).then_some(found)
}

impl ObservationsLeftOut {
    /// The same, where these series say whether a camera was given.
    #[must_use]
    pub fn given_by(self, series: &[MeasuredSeries]) -> Self {
        Self { given: GivenCamera::of(series, None), ..self }
    }
}

impl Kind for ObservationsLeftOut {
    fn code(&self) -> Code {
        Code::ObservationsLeftOut
    }

    fn subjects(&self) -> Vec<Subject> {
        vec![Subject::Image(self.worst.0.clone())]
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![Quantity::new("share", self.share, "1"), Quantity::new("share_in_image", self.worst.1, "1")]
    }

    fn place(&self) -> String {
        "observations".into()
    }

    fn seen(&self) -> String {
        let (image, share) = &self.worst;
        format!("{:.0} % were left out, {:.0} % in {image}", 100.0 * self.share, 100.0 * share)
    }

    fn remedy(&self) -> String {
        let usual = "look for markers taken for others, a bent plate, changed focus";
        self.given.remedy().map_or_else(|| usual.into(), |camera| format!("{camera}; else {usual}"))
    }
}
