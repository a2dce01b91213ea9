//! Some of many stops.

const GOLDEN_RATIO: f64 = 0.618_033_988_749_895;

/// About `some` of `count` stops, ascending and spread over all of them; all where there are no more. By the golden ratio, and not every n-th:
/// stops often come in turns of equal length.
pub fn spread(count: usize, some: usize) -> impl Iterator<Item = usize> {
    let share = some as f64 / count as f64;
    (0..count).filter(move |k| count <= some || (*k as f64 * GOLDEN_RATIO).fract() < share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn some_of_many_are_spread_over_all_and_over_turns() {
        assert_eq!(spread(7, 7).collect::<Vec<_>>(), (0..7).collect::<Vec<_>>());
        let some: Vec<usize> = spread(12_000, 500).collect();
        assert!((495..=505).contains(&some.len()), "{}", some.len());
        // Every n-th would take some places of such turns always, and the others never.
        for turn in 2..40 {
            let expected = 500.0 / turn as f64;
            for place in 0..turn {
                let taken = some.iter().filter(|k| *k % turn == place).count();
                assert!(taken > 0 && (taken as f64) < 2.0 * expected, "{taken} of {expected} at {place} of {turn}");
            }
        }
        assert!(some.windows(2).all(|w| w[1] - w[0] < 40));
    }
}
