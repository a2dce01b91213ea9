//! Have the tags of a plate the size that is stated, beside their distance?
//!
//! With `x` the middle of a tag, `e` a corner from there, and `d` how far the corner is found from where the plate file says, `a` and `b` in
//! `d = a x + b e` are by how much the distances of the tags and their sizes are larger than stated. Their difference does not hang on the scale.

use nalgebra::Vector3;

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::assess::{Accuracy, Limits};
use crate::error::Code;
use crate::fit::Fit;
use crate::problem::{Adjustment, seen_markers};

/// The tags of a plate are larger or smaller beside their distance than the plate file says.
#[derive(Debug, Clone, PartialEq)]
pub struct TagsOff {
    /// Plate, by one of its series.
    pub plate: String,
    /// By how much larger, as a share.
    pub larger: f64,
    /// Side over pitch, as stated.
    pub stated: f64,
}

pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Vec<TagsOff> {
    tags_off(fit, setting.limits)
}

/// Plates whose tags have another size beside their distance, by more than the tolerance of the markers allows.
pub fn tags_off(adjustment: &Adjustment, limits: &Limits) -> Vec<TagsOff> {
    (0..adjustment.problem.plates.len()).filter_map(|plate| of_plate(adjustment, plate, limits)).collect()
}

fn of_plate(Adjustment { problem, state }: &Adjustment, plate: usize, limits: &Limits) -> Option<TagsOff> {
    let (nominal, shape) = (&problem.plates[plate], &state.plates[plate]);
    let tags = nominal.tags.as_ref()?;
    let seen = seen_markers(problem, plate);
    let middle = |k: usize| -> Vector3<f64> {
        let of_tag = nominal.markers.iter().filter(|m| m.id / 4 == nominal.markers[k].id / 4);
        of_tag.map(|m| m.position_m).sum::<Vector3<f64>>() / 4.0
    };
    let moved: Vec<[Vector3<f64>; 3]> = seen
        .iter()
        .map(|&k| {
            let (at, x) = (nominal.markers[k].position_m, middle(k));
            [x, at - x, shape.position(k) - at]
        })
        .collect();
    let mean = |part: usize| moved.iter().map(|m| m[part]).sum::<Vector3<f64>>() / moved.len().max(1) as f64;
    let means = [0, 1, 2].map(mean);
    let slope = |by: usize| {
        let apart = |m: &[Vector3<f64>; 3]| [m[by] - means[by], m[2] - means[2]];
        let pairs = moved.iter().map(apart).collect::<Vec<_>>();
        let square: f64 = pairs.iter().map(|[x, _]| x.norm_squared()).sum();
        (pairs.iter().map(|[x, d]| x.dot(d)).sum::<f64>() / square, square)
    };
    let ([(a, across), (b, within)], count) = ([slope(0), slope(1)], seen.len().max(1) as f64);
    let tolerance_m = (seen.iter().map(|&k| nominal.markers[k].sigma_m.powi(2)).sum::<f64>() / count).sqrt();
    let sigma = tolerance_m * (across.recip() + within.recip()).sqrt();
    let larger = b - a;
    // One tag has no distance: nothing is to be compared, and the numbers are not finite.
    (larger.abs() > limits.sigmas_beyond_tolerance * sigma).then(|| TagsOff {
        plate: problem.plate_name(plate),
        larger,
        stated: tags.side_m / (tags.side_m + tags.gap_m),
    })
}

impl Kind for TagsOff {
    fn code(&self) -> Code {
        Code::TagsOff
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn subjects(&self) -> Vec<Subject> {
        Vec::new()
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![Quantity::new("larger", self.larger, "1")]
    }

    fn place(&self) -> String {
        self.plate.clone()
    }

    fn seen(&self) -> String {
        let Self { larger, stated, .. } = self;
        format!(
            "its tags are {:.2} % {} beside their distance than the plate file says (side over pitch {:.4}, stated {stated:.4}): one of them \
             is wrong, and the scale with it",
            100.0 * larger.abs(),
            if *larger > 0.0 { "larger" } else { "smaller" },
            stated * (1.0 + larger)
        )
    }

    fn remedy(&self) -> String {
        "measure the side of a tag and the distance of two far tags, and correct tag_m, spacing, marker_m or gap_m of the plate file".into()
    }
}
