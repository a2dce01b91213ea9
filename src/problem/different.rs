//! How many stops are different ones.

/// Number of readings that differ from all before them by more than `within` in some joint, rad or m; no more than `enough` are counted.
pub fn different_readings<'a>(readings: impl Iterator<Item = &'a [f64]>, within: f64, enough: usize) -> usize {
    let mut different: Vec<&[f64]> = Vec::new();
    for own in readings {
        let is_same = |other: &&[f64]| own.iter().zip(other.iter()).all(|(a, b)| (a - b).abs() <= within);
        if !different.iter().any(is_same) {
            different.push(own);
        }
        if different.len() == enough {
            break;
        }
    }
    different.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_that_is_taken_again_is_no_other() {
        let all = [[0.0, 1.0], [0.5, 1.0], [1e-3, 1.0 - 1e-3], [0.5, 1.0], [0.5, 1.1]];
        let count = |enough| different_readings(all.iter().map(<[f64; 2]>::as_slice), 2e-3, enough);
        assert_eq!((count(5), count(2)), (3, 2));
    }
}
