//! Is every marker where the plate file says, within its tolerance?

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::assess::Accuracy;
use crate::error::Code;
use crate::fit::Fit;

/// A marker lies elsewhere than its plate file says.
#[derive(Debug, Clone, PartialEq)]
pub struct MarkerOff {
    /// Its id.
    pub marker: u32,
    /// How far, m.
    pub distance_m: f64,
}

pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Vec<MarkerOff> {
    let plates = fit.problem.plates.iter().zip(&fit.state.plates);
    let markers = plates.flat_map(|(plate, shape)| plate.markers.iter().zip(&shape.corrections));
    markers
        .map(|(marker, correction)| (marker, correction.norm()))
        .filter(|(marker, distance_m)| *distance_m > setting.limits.sigmas_beyond_tolerance * marker.sigma_m)
        .map(|(marker, distance_m)| MarkerOff { marker: marker.id, distance_m })
        .collect()
}

impl Kind for MarkerOff {
    fn code(&self) -> Code {
        Code::MarkerOff
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn subjects(&self) -> Vec<Subject> {
        vec![Subject::Marker(self.marker)]
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![Quantity::new("distance", self.distance_m, "m")]
    }

    fn place(&self) -> String {
        format!("marker {}", self.marker)
    }

    fn seen(&self) -> String {
        format!("lies {:.2} mm from where the plate file says, far beyond its tolerance", 1e3 * self.distance_m)
    }

    fn remedy(&self) -> String {
        "printed wrongly, moved, or taken for another? its corrected position stands in plate.csv".into()
    }
}
