//! Is every marker where the plate file says, within its tolerance?

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::assess::{Accuracy, Limits};
use crate::error::Code;
use crate::fit::Fit;
use crate::problem::{Adjustment, PlateShape};
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
    named_markers_off(fit, setting.limits)
}

/// Markers far beyond their tolerance, as findings.
pub fn named_markers_off(adjustment: &Adjustment, limits: &Limits) -> Vec<MarkerOff> {
    let Adjustment { problem, state } = adjustment;
    let several = problem.plates.len() > 1;
    let off = |FarMarker { of: (p, m), .. }| MarkerOff {
        marker: problem.plates[p].markers[m].id,
        plate: several.then(|| problem.plate_name(p)),
        distance_m: state.plates[p].corrections[m].norm(),
    };
    markers_off(adjustment, limits).into_iter().map(off).collect()
}

/// A marker far beyond its tolerance.
#[derive(Debug, Clone, Copy)]
pub struct FarMarker {
    /// Its plate and its index.
    pub of: (usize, usize),
    /// How far, in sigmas of its tolerance.
    pub sigmas: f64,
}

/// All of them. A tolerance that is found larger than stated is that of all markers.
pub fn markers_off(Adjustment { problem, state }: &Adjustment, limits: &Limits) -> Vec<FarMarker> {
    let of_plate = |(p, (plate, shape)): (usize, (&Plate, &PlateShape))| {
        let factor = problem.noise.marker.get(p).map_or(1.0, |found| found.max(1.0));
        let all = plate.markers.iter().zip(&shape.corrections).enumerate();
        let far = all.map(|(m, (marker, correction))| FarMarker {
            of: (p, m),
            sigmas: correction.norm() / (factor * marker.sigma_m),
        });
        far.filter(|marker| marker.sigmas > limits.sigmas_beyond_tolerance).collect::<Vec<_>>()
    };
    problem.plates.iter().zip(&state.plates).enumerate().flat_map(of_plate).collect()
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
