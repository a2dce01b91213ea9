//! Sizes of the dots of a grid that the plate file does not state, from what the images show.

use std::collections::BTreeMap;

use super::Detection;
use crate::error::Code;
use crate::linalg::median;
use crate::series::{Marker, Plate, PlateKind};

/// Gives the markers the median of the radii that the images show, where they show any.
pub fn set_radii<'a>(plate: &mut Plate, images: impl Iterator<Item = &'a Detection>) {
    let usable = images.filter(|detection| detection.failure.is_none());
    let mut seen: BTreeMap<u32, [Vec<f64>; 2]> = BTreeMap::new();
    for (id, radii) in usable.filter_map(|detection| detection.circles.as_ref()).flat_map(|c| &c.sizes.radii_m) {
        let all = seen.entry(*id).or_default();
        (0..2).for_each(|k| all[k].push(radii[k]));
    }
    for marker in &mut plate.markers {
        if let Some([Some(outer), Some(inner)]) = seen.get(&marker.id).map(|radii| radii.each_ref().map(median)) {
            [marker.outer_radius_m, marker.inner_radius_m] = [outer, inner];
        }
    }
}

/// The plate with the sizes that other images show, and the images that may be told with them: the plate file says which dots are larger and
/// not how much, so that nothing tells how a grid is turned in which none looks larger.
pub(super) fn told_by_others(plate: &Plate, found: &[&Detection]) -> Option<(Plate, Vec<usize>)> {
    if plate.large.is_empty() {
        return None;
    }
    let mut measured = plate.clone();
    set_radii(&mut measured, found.iter().copied());
    let is_open = |k: &usize| found[*k].failure.as_ref().is_some_and(|f| f.code == Code::PlateIncomplete);
    (measured.markers != plate.markers).then(|| (measured, (0..found.len()).filter(is_open).collect()))
}

/// The grid with all dots as most of them are in the images that can be used, where that hides how it is turned, and the images that may show it so.
pub(super) fn with_dots_alike(
    plate: &Plate,
    found: &[(Option<(usize, usize)>, &Detection)],
) -> Option<(Plate, Vec<usize>)> {
    let usable = || found.iter().filter(|(_, detection)| detection.failure.is_none());
    let size = usable().find_map(|(size, _)| *size).filter(|_| plate.kind == PlateKind::CircleGrid)?;
    let mut alike = plate.clone();
    set_radii(&mut alike, usable().map(|(_, detection)| *detection));
    let [outer, inner] =
        [|m: &Marker| m.outer_radius_m, |m: &Marker| m.inner_radius_m].map(|of| median(alike.markers.iter().map(of)));
    let turns = alike.turns().len();
    for marker in &mut alike.markers {
        (marker.outer_radius_m, marker.inner_radius_m) = (outer?, inner?);
    }
    alike.large.clear();
    let codes = [Code::PlateIncomplete, Code::MarkersUnmeasured];
    let is_open = |(of, detection): &(Option<(usize, usize)>, &Detection)| {
        *of == Some(size) && detection.failure.as_ref().is_some_and(|f| codes.contains(&f.code))
    };
    let open: Vec<usize> = (0..found.len()).filter(|k| is_open(&found[*k])).collect();
    (alike.turns().len() > turns && !open.is_empty()).then_some((alike, open))
}
