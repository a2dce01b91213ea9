//! Stops whose images show much the same part of a plate, and markers that stand beside each other: the ones touch much the same markers, the others
//! are seen by much the same images, so that their products are small when taken together.

use nalgebra::Vector3;

use crate::solve::linear::LinearStop;

/// Most stops or markers of a group, and as many in all groups but the last. Fewer make products too short, more have less in common.
pub(super) const MOST: usize = 24;
/// As if plates lay so far apart, m: stops of different plates are parted first.
const APART_M: f64 = 1e3;

/// Bounds of what the images of a stop show: least x and y, largest x and y, m.
type Bounds = [f64; 4];

/// Places of some stops, in groups.
pub(super) fn alike(stops: &[LinearStop]) -> Vec<Vec<usize>> {
    let mut stops: Vec<(usize, Bounds)> = stops.iter().map(bounds).enumerate().collect();
    let mut groups = Vec::new();
    part(&mut stops, &mut groups);
    groups
}

/// Places of markers, each of a plate, with those beside each other in groups.
pub(super) fn neighbours<'a>(markers: impl Iterator<Item = (usize, &'a Vector3<f64>)>) -> Vec<Vec<usize>> {
    let bounds = |(plate, position): (usize, &Vector3<f64>)| {
        let [x, y] = place(plate, position);
        [x, y, x, y]
    };
    let mut markers: Vec<(usize, Bounds)> = markers.map(bounds).enumerate().collect();
    let mut groups = Vec::new();
    part(&mut markers, &mut groups);
    groups
}

/// Of a marker among those of all plates, m.
fn place(plate: usize, position: &Vector3<f64>) -> [f64; 2] {
    [plate as f64 * APART_M + position.x, position.y]
}

/// Of the markers as they should be; zero where no image shows any.
fn bounds(stop: &LinearStop) -> Bounds {
    let mut bounds: Option<Bounds> = None;
    for own in stop.images() {
        let plate = &stop.problem().plates[own.image.plate];
        for seen in &own.terms.markers {
            let [x, y] = place(own.image.plate, &plate.markers[seen.marker].position_m);
            let [x0, y0, x1, y1] = bounds.unwrap_or([x, y, x, y]);
            bounds = Some([x0.min(x), y0.min(y), x1.max(x), y1.max(y)]);
        }
    }
    bounds.unwrap_or_default()
}

/// Halves by the bound in which stops differ most until groups are small enough.
fn part(stops: &mut [(usize, Bounds)], groups: &mut Vec<Vec<usize>>) {
    if stops.len() <= MOST {
        groups.push(stops.iter().map(|(at, _)| *at).collect());
        return;
    }
    let spread = |k: usize| {
        let of = || stops.iter().map(|(_, bounds)| bounds[k]);
        of().fold(f64::NEG_INFINITY, f64::max) - of().fold(f64::INFINITY, f64::min)
    };
    let widest = (1..4).fold(0, |best, k| if spread(k) > spread(best) { k } else { best });
    let half = (stops.len() / 2).next_multiple_of(MOST);
    stops.select_nth_unstable_by(half, |a, b| a.1[widest].total_cmp(&b.1[widest]));
    let (first, second) = stops.split_at_mut(half);
    part(first, groups);
    part(second, groups);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stop_is_in_one_group_with_those_beside_it() {
        let places = 100;
        // Those with even places show one corner, the others another.
        let of = |at: usize| (at, if at.is_multiple_of(2) { [0.0, 0.0, 0.1, 0.1] } else { [0.3, 0.2, 0.4, 0.3] });
        let mut stops: Vec<_> = (0..places).map(of).collect();
        let mut groups = Vec::new();
        part(&mut stops, &mut groups);
        assert!(groups.iter().all(|g| g.len() <= MOST));
        let mixed = groups.iter().filter(|g| g.iter().any(|at| at % 2 != g[0] % 2)).count();
        assert!(mixed <= 1, "{groups:?}");
        let mut all: Vec<usize> = groups.into_iter().flatten().collect();
        all.sort_unstable();
        assert_eq!(all, (0..places).collect::<Vec<_>>());
    }
}
