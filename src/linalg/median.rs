//! The median.

use std::borrow::Borrow;
use std::cmp::Ordering;

/// The middle value, of an even number the larger of the two; `None` of nothing. NaN counts as largest.
pub fn median(values: impl IntoIterator<Item = impl Borrow<f64>>) -> Option<f64> {
    median_by(values.into_iter().map(|v| *v.borrow()), f64::total_cmp)
}

/// As [`median`], of values in this order.
pub fn median_by<T: Copy>(values: impl IntoIterator<Item = T>, order: impl FnMut(&T, &T) -> Ordering) -> Option<T> {
    let mut sorted: Vec<T> = values.into_iter().collect();
    sorted.sort_by(order);
    sorted.get(sorted.len() / 2).copied()
}

/// The middle value, of an even number the smaller of both: half of them are as small. Infinite of nothing.
pub fn lower_median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.into_iter().collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len().saturating_sub(1) / 2).copied().unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smaller_of_two_middle_values() {
        assert_eq!(lower_median([3.0, 1.0, 2.0]), 2.0);
        assert_eq!(lower_median([4.0, 3.0, 1.0, 2.0]), 2.0);
        assert_eq!(lower_median([]), f64::INFINITY);
    }

    #[test]
    fn the_larger_of_two_middle_values_and_nothing_of_nothing() {
        assert_eq!(median([3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median([4.0, 3.0, 1.0, 2.0]), Some(3.0));
        assert_eq!(median([f64::NAN, 2.0, 1.0]), Some(2.0));
        assert_eq!(median(Vec::<f64>::new()), None);
        assert_eq!(median_by([3, 1, 2, 4], i32::cmp), Some(3));
    }
}
