//! Readings that stand beside images by another order of their names: 1, 2, .. 10 as people count, or 1, 10, .. 2 as programs sort.

use std::collections::BTreeMap;

use crate::diagnose::MistakeKind;
use crate::error::Code;
use crate::problem::MeasuredSeries;

/// The readings of stops by their place in a series, in either of the other orders, with the name of the mistake; none where both orders are one.
pub(super) fn in_other_orders(series: &MeasuredSeries) -> Vec<(BTreeMap<usize, Vec<f64>>, MistakeKind)> {
    let read = || series.stops.iter().enumerate().filter_map(|(k, stop)| Some((k, stop, stop.readings.as_ref()?)));
    let mut counted: Vec<usize> = read().map(|(k, ..)| k).collect();
    let mut sorted = counted.clone();
    counted.sort_by_cached_key(|k| by_numbers(&series.stops[*k].image));
    sorted.sort_by_key(|k| series.stops[*k].image.as_str());
    if counted == sorted {
        return Vec::new();
    }
    let given: BTreeMap<usize, &Vec<f64>> = read().map(|(k, _, readings)| (k, readings)).collect();
    let moved = |(own, beside): (&usize, &usize)| Some((*own, (*given.get(beside)?).clone()));
    let orders = [
        (&counted, &sorted, ["sorted as text (1, 10, .. 2)", "counted (1, 2, .. 10)"]),
        (&sorted, &counted, ["counted (1, 2, .. 10)", "sorted as text (1, 10, .. 2)"]),
    ];
    let of_order = |(own, beside, [names, readings]): (&Vec<usize>, &Vec<usize>, [&str; 2])| {
        let mistake = MistakeKind::Poses {
            code: Code::RowsMisordered,
            what: format!("the names of the images are {names}, and the readings beside them are of images that are {readings}"),
            remedy: "sort the names in the first column of joints.csv in the other order, and leave the readings where they stand".into(),
        };
        (own.iter().zip(beside).filter_map(moved).collect(), mistake)
    };
    orders.into_iter().map(of_order).collect()
}

/// Text and number by turns.
fn by_numbers(name: &str) -> Vec<(String, u64)> {
    let mut parts: Vec<(String, String)> = vec![Default::default()];
    for c in name.chars() {
        let (_, number) = &parts[parts.len() - 1];
        if !c.is_ascii_digit() && !number.is_empty() {
            parts.push(Default::default());
        }
        let last = parts.len() - 1;
        if c.is_ascii_digit() { parts[last].1.push(c) } else { parts[last].0.push(c) }
    }
    parts.into_iter().map(|(text, number)| (text, number.parse().unwrap_or(u64::MAX))).collect()
}

#[cfg(test)]
mod tests {
    use super::by_numbers;

    #[test]
    fn names_are_counted() {
        let mut names = ["img_10.png", "img_2.png", "b1_3", "img_1.png", "b1_12", "none"];
        names.sort_by_cached_key(|name| by_numbers(name));
        assert_eq!(names, ["b1_3", "b1_12", "img_1.png", "img_2.png", "img_10.png", "none"]);
    }
}
