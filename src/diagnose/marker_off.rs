//! Is every marker where the plate file says, within its tolerance?

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::assess::Accuracy;
use crate::error::Code;
use crate::fit::Fit;
use crate::problem::PlateShape;
use crate::series::Plate;

/// A marker lies elsewhere than its plate file says.
#[derive(Debug, Clone, PartialEq)]
pub struct MarkerOff {
    /// Its id.
    pub marker: u32,
    /// Its plate, where there are several.
    pub plate: Option<String>,
    /// How far, m.
    pub distance_m: f64,
}

pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Vec<MarkerOff> {
    let problem = &fit.problem;
    let several = problem.plates.len() > 1;
    let off = |(k, (plate, shape)): (usize, (&Plate, &PlateShape))| {
        let markers = plate.markers.iter().zip(&shape.corrections);
        let all = markers.map(|(marker, correction)| (marker, correction.norm()));
        let beyond = all.filter(|(marker, off_m)| *off_m > setting.limits.sigmas_beyond_tolerance * marker.sigma_m);
        let plate = several.then(|| problem.plate_name(k));
        beyond
            .map(|(marker, distance_m)| MarkerOff { marker: marker.id, plate: plate.clone(), distance_m })
            .collect::<Vec<_>>()
    };
    problem.plates.iter().zip(&fit.state.plates).enumerate().flat_map(off).collect()
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
        match &self.plate {
            Some(plate) => format!("marker {} of {plate}", self.marker),
            None => format!("marker {}", self.marker),
        }
    }

    fn seen(&self) -> String {
        format!("lies {:.2} mm from where the plate file says, far beyond its tolerance", 1e3 * self.distance_m)
    }

    fn remedy(&self) -> String {
        "printed wrongly, moved, or taken for another? its corrected position stands in plate.csv".into()
    }
}
