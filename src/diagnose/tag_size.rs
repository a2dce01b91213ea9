//! Have the tags of a plate the size that is stated, beside their distance?
//!
//! With `x` the middle of a tag, `e` a corner from there, and `d` how far the corner is found from where the plate file says, `a` and `b` in
//! `d = a x + b e` are by how much the distances of the tags and their sizes are larger than stated, along x and along y each. Their difference hangs
//! neither on the scale nor on a stretch of the whole plate.

use nalgebra::{Vector2, Vector3};

use super::kind::{CheckContext, Kind, Quantity, Weight};
use super::slopes::slopes;
use crate::assess::{Accuracy, Limits};
use crate::error::Code;
use crate::fit::Fit;
use crate::problem::{Adjustment, telling_markers};

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
    let seen = telling_markers(problem, plate);
    let middle = |k: usize| -> Vector3<f64> {
        let of_tag = nominal.markers.iter().filter(|m| m.id / 4 == nominal.markers[k].id / 4);
        of_tag.map(|m| m.position_m).sum::<Vector3<f64>>() / 4.0
    };
    let count = seen.len().max(1) as f64;
    let tolerance_m = (seen.iter().map(|&k| nominal.markers[k].sigma_m.powi(2)).sum::<f64>() / count).sqrt();
    let moved: Vec<[Vector3<f64>; 3]> = seen
        .iter()
        .map(|&k| {
            let (at, x) = (nominal.markers[k].position_m, middle(k));
            [x, at - x, shape.position(k) - at]
        })
        .collect();
    let (larger, information) = beside_distance(&moved)?;
    let sigma = tolerance_m / information.sqrt();
    (larger.abs() > limits.sigmas_beyond_tolerance * sigma).then(|| TagsOff {
        plate: problem.plate_name(plate),
        larger,
        stated: tags.side_m / (tags.side_m + tags.gap_m),
    })
}

/// By how much tags are larger beside their distance, and how well displacements of unit variance tell it: along x and along y by themselves,
/// as a print may be stretched; `None` where none does, as of one tag. Of each corner the middle of its tag, where it is from there and by how
/// much it is displaced.
fn beside_distance(moved: &[[Vector3<f64>; 3]]) -> Option<(f64, f64)> {
    let along = |axis: usize| {
        let of_corner = |[x, e, d]: &[Vector3<f64>; 3]| (Vector2::new(x[axis], e[axis]), d[axis]);
        let found = slopes(&moved.iter().map(of_corner).collect::<Vec<_>>())?;
        let difference = Vector2::new(-1.0, 1.0);
        Some((difference.dot(&found.of), difference.dot(&(found.covariance * difference)).recip()))
    };
    let told: Vec<(f64, f64)> = (0..2).filter_map(along).collect();
    let information: f64 = told.iter().map(|(_, information)| information).sum();
    let larger = told.iter().map(|(larger, information)| larger * information).sum::<f64>() / information;
    (information > 0.0).then_some((larger, information))
}

impl Kind for TagsOff {
    fn code(&self) -> Code {
        Code::TagsOff
    }

    fn weight(&self) -> Weight {
        Weight::Note
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners of 7 x 5 tags of 28 mm, 35 mm apart, printed with these factors along x and y, the tags by another factor beside.
    fn printed(x: f64, y: f64, tags: f64) -> Vec<[Vector3<f64>; 3]> {
        let all = (0..7).flat_map(|i| (0..5).flat_map(move |j| (0..4).map(move |c| (i, j, c))));
        let corner = |(i, j, c): (i32, i32, i32)| {
            let middle = Vector3::new(f64::from(i), f64::from(j), 0.0) * 0.035;
            let from_there = Vector3::new(f64::from(2 * (c % 2) - 1), f64::from(2 * (c / 2) - 1), 0.0) * 0.014;
            let at = middle + tags * from_there;
            [middle, from_there, Vector3::new(x * at.x, y * at.y, 0.0) - middle - from_there]
        };
        all.map(corner).collect()
    }

    #[test]
    fn tags_of_a_stretched_print_have_the_size_that_belongs_to_their_distance() {
        let larger = |x, y, tags| beside_distance(&printed(x, y, tags)).unwrap().0;
        assert!(larger(0.97, 0.95, 1.0).abs() < 1e-12, "{}", larger(0.97, 0.95, 1.0));
        let found = larger(0.97, 0.95, 1.01);
        assert!((0.0095..0.0097).contains(&found), "{found}");
    }

    #[test]
    fn a_row_of_tags_is_compared_along_it_and_one_tag_with_nothing() {
        let row: Vec<_> = printed(0.97, 0.95, 1.01).into_iter().filter(|[x, _, _]| x.y == 0.0).collect();
        let (larger, information) = beside_distance(&row).unwrap();
        assert!((larger - 0.0097).abs() < 1e-12 && information > 0.0, "{larger} {information}");
        assert_eq!(beside_distance(&row[..4]), None);
    }
}
