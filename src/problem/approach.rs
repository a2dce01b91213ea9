//! The stops of series with the steps that lead to them.

use std::collections::BTreeMap;

use super::measured_series::{MeasuredSeries, MeasuredStop};
use crate::model::robot::Posture;

/// The series of each run together: cameras that saw the same stops.
pub fn runs(series: &[MeasuredSeries]) -> impl Iterator<Item = &[MeasuredSeries]> {
    series.chunk_by(|a, b| a.run.is_some() && a.run == b.run)
}

/// The stops of a run by their places in it; `None` for those off the robot.
pub fn postures_of_run(views: &[MeasuredSeries]) -> BTreeMap<usize, Option<Posture>> {
    let mut rows: BTreeMap<usize, &MeasuredStop> = BTreeMap::new();
    for stop in views.iter().flat_map(|s| &s.stops) {
        rows.entry(stop.row).or_insert(stop);
    }
    let order_known = views.first().is_some_and(|s| s.order_known);
    let readings = rows.values().map(|stop| stop.readings.as_deref());
    rows.keys().copied().zip(Posture::in_order(readings, order_known)).collect()
}

/// The stops of every series in the order of its rows; `None` for those off the robot.
pub fn postures_of_stops(series: &[MeasuredSeries]) -> Vec<Vec<Option<Posture>>> {
    let of_views = |views: &[MeasuredSeries]| -> Vec<Vec<Option<Posture>>> {
        let of_run = postures_of_run(views);
        let of_view = |s: &MeasuredSeries| s.stops.iter().map(|stop| of_run[&stop.row].clone()).collect();
        views.iter().map(of_view).collect()
    };
    runs(series).flat_map(of_views).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stop(row: usize, reading: Option<f64>) -> MeasuredStop {
        MeasuredStop {
            row,
            image: row.to_string(),
            readings: reading.map(|q| vec![q]),
            placement: String::new(),
            observations: Vec::new().into(),
            left_out: None,
        }
    }

    fn steps(series: &[MeasuredSeries]) -> Vec<Vec<Option<f64>>> {
        let step = |posture: &Option<Posture>| posture.as_ref().and_then(|p| p.approach.as_ref().map(|step| step[0]));
        postures_of_stops(series).iter().map(|stops| stops.iter().map(step).collect()).collect()
    }

    #[test]
    fn a_joint_comes_from_the_last_stop_on_the_robot() {
        let rows = [Some(1.0), None, Some(4.0), None, None, Some(2.0)];
        let stops: Vec<MeasuredStop> = rows.iter().enumerate().map(|(row, q)| stop(row, *q)).collect();
        let series = |known| [MeasuredSeries::without_images("a", known, stops.clone())];
        assert_eq!(steps(&series(true)), [[None, None, Some(3.0), None, None, Some(-2.0)]]);
        assert_eq!(steps(&series(false)), [[None; 6]]);
    }

    /// The second camera saw the last stop alone.
    #[test]
    fn stops_of_a_run_lie_between_those_of_one_of_its_cameras() {
        let run = Some("run".to_owned());
        let of = |name: &str, stops| MeasuredSeries {
            run: run.clone(),
            ..MeasuredSeries::without_images(name, true, stops)
        };
        let (first, last) = (stop(0, Some(1.0)), stop(2, Some(5.0)));
        let all = [of("a", vec![first.clone(), stop(1, Some(2.0))]), of("b", vec![first, last])];
        assert_eq!(steps(&all), [[None, Some(1.0)], [None, Some(3.0)]]);
    }
}
