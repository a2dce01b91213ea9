//! Some of very many stops, chosen so that they still tell of everything that is unknown.

use std::collections::{BTreeMap, BTreeSet};

use super::{Adjustment, ImageRejection};
use crate::series::spread;

/// Fewest stops of one kind that are chosen: of a camera or a pose that few stops tell of, all of them tell.
const FEWEST: usize = 40;

impl Adjustment {
    /// About `some` of the stops in use, with all that was measured there, where there are more than `many`: evenly chosen among those of one series
    /// that show the same cameras, mountings, placements and bodies, and of these forty at least.
    pub fn some_stops(&self, many: usize, some: usize) -> Option<Self> {
        let problem = &self.problem;
        let mut shown: BTreeMap<usize, BTreeSet<[usize; 4]>> = BTreeMap::new();
        for (_, image) in problem.used() {
            shown.entry(image.stop).or_default().insert([0, image.camera, image.mounting, image.placement]);
        }
        for (_, measured) in problem.used_bodies() {
            shown.entry(measured.stop).or_default().insert([1, measured.instrument, measured.body, 0]);
        }
        if shown.len() <= many {
            return None;
        }
        let chosen = chosen(shown.iter().map(|(stop, what)| (*stop, (problem.stops[*stop].series, what))), some);
        let rest: Vec<usize> = shown.keys().copied().filter(|stop| !chosen.contains(stop)).collect();
        let held: Vec<usize> =
            problem.used().filter(|(_, image)| !chosen.contains(&image.stop)).map(|(i, _)| i).collect();
        let mut left = self.without_bodies_at(&rest);
        held.iter().for_each(|&i| left.problem.images[i].rejected = Some(ImageRejection::Excluded));
        Some(left)
    }
}

/// About `some` of all stops, which stand with their kinds.
fn chosen<K: Ord>(stops: impl Iterator<Item = (usize, K)>, some: usize) -> BTreeSet<usize> {
    let mut alike: BTreeMap<K, Vec<usize>> = BTreeMap::new();
    stops.for_each(|(stop, kind)| alike.entry(kind).or_default().push(stop));
    let all: usize = alike.values().map(Vec::len).sum();
    let of_kind = |own: &Vec<usize>| {
        let some = (some * own.len()).div_ceil(all.max(1)).max(FEWEST);
        spread(own.len(), some).map(|k| own[k]).collect::<Vec<_>>()
    };
    alike.values().flat_map(of_kind).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_few_stops_show_is_still_told_of() {
        // A second camera at twelve of a thousand stops, and a placement of its own for sixty.
        let kind = |stop: usize| if (500..512).contains(&stop) { 1 } else { 2 * usize::from(stop >= 940) };
        let some = chosen((0..1000).map(|stop| (stop, kind(stop))), 250);
        let of = |wanted: usize| some.iter().filter(|stop| kind(**stop) == wanted).count();
        assert_eq!(of(1), 12);
        assert!((35..=45).contains(&of(2)), "{}", of(2));
        assert!((225..=240).contains(&of(0)), "{}", of(0));
    }

    #[test]
    fn stops_of_one_kind_are_spread_over_all() {
        let some = chosen((0..1000).map(|stop| (stop, ())), 250);
        assert_eq!(some, spread(1000, 250).collect());
    }
}
