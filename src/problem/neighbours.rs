//! The stops whose rows stand beside that of a stop.

use super::Problem;

impl Problem {
    /// The orders in which rows of these stops (ascending, some maybe repeated) may stand: among all stops, and by themselves where they are fewer.
    pub fn orders_of_rows(&self, of: &[usize]) -> Vec<Vec<usize>> {
        let all: Vec<usize> = (0..self.stops.len()).collect();
        let mut own = of.to_vec();
        own.dedup();
        if own.len() < all.len() { vec![all, own] } else { vec![all] }
    }

    /// The stop of the same series whose row stands directly below that of a stop, else directly above it, in such an order.
    pub fn neighbour(&self, order: &[usize], stop: usize, below: bool) -> Option<usize> {
        let at = order.binary_search(&stop).ok()?;
        let other = *order.get(if below { at + 1 } else { at.checked_sub(1)? })?;
        (self.stops[other].series == self.stops[stop].series).then_some(other)
    }
}
