//! Known places of contacts of which two stand in each other's rows.

use nalgebra::Vector3;

use super::points_start::{PointAt, agreeing, distances, each_place, point_at};
use super::touch_mistakes::in_metres;
use crate::assess::Limits;
use crate::diagnose::{Finding, Mistake, MistakeKind, RowsOf};
use crate::error::{Code, Result};
use crate::linalg::median;
use crate::problem::{Adjustment, InstrumentKind};

/// Places of which two are exchanged without taking long.
const MOST_PLACES: usize = 12;

/// Touches of known places, each with the index of its place.
struct Touched {
    points: Vec<PointAt>,
    place_of: Vec<usize>,
    places: Vec<Vector3<f64>>,
}

impl Touched {
    fn of(points: Vec<PointAt>) -> Self {
        let places = each_place(points.iter().map(|(place, _)| *place));
        let index = |(place, _): &PointAt| places.iter().position(|p| p == place).unwrap_or_default();
        let place_of = points.iter().map(index).collect();
        Self { points, place_of, places }
    }

    /// The median misfit of the touches of a place, of the place with the largest, with two places exchanged, m.
    fn worst(&self, exchanged: Option<(usize, usize)>) -> f64 {
        let of = |place: usize| match exchanged {
            Some((a, b)) if place == a => b,
            Some((a, b)) if place == b => a,
            _ => place,
        };
        let points: Vec<PointAt> =
            self.points.iter().zip(&self.place_of).map(|((_, tip), place)| (self.places[of(*place)], *tip)).collect();
        let Some(placed) = agreeing(&points) else { return f64::INFINITY };
        let missed = distances(&points, &placed);
        let of_place = |place: usize| {
            let own = missed.iter().zip(&self.place_of).filter(|(_, of)| **of == place);
            median(own.map(|(distance, _)| *distance).collect::<Vec<f64>>()).unwrap_or_default()
        };
        (0..self.places.len()).map(of_place).fold(0.0, f64::max)
    }
}

/// Refuses known places that the touches contradict as they are, and do not with two of them exchanged.
///
/// # Errors
/// The two.
pub(super) fn name_exchange(adjustment: &Adjustment, measured: &[usize], limits: &Limits) -> Result<()> {
    let problem = &adjustment.problem;
    let of = |&k: &usize| point_at(adjustment, &problem.body_measurements[k]);
    let Some(&first) = measured.first() else { return Ok(()) };
    let instrument = &problem.instruments[problem.body_measurements[first].instrument];
    if instrument.kind != InstrumentKind::Places {
        return Ok(());
    }
    let touched = Touched::of(measured.iter().filter_map(of).collect());
    let n = touched.places.len();
    let misfit = touched.worst(None);
    if !(limits.fewest_places..=MOST_PLACES).contains(&n) || misfit < limits.suspicious_misfit {
        return Ok(());
    }
    let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
    let best = pairs
        .map(|pair| (touched.worst(Some(pair)), pair))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .filter(|(left, _)| *left < limits.suspicious_misfit && *left < limits.mistake_explains * misfit);
    let Some((left, (a, b))) = best else { return Ok(()) };
    let [a, b] = [a, b].map(|place| in_metres(&touched.places[place]));
    let kind = MistakeKind::Poses {
        code: Code::PlaceContradicted,
        what: format!("the places {a} and {b} are exchanged: each in the place of the other the touches fit"),
        remedy: "exchange them in contacts.csv".into(),
    };
    let of = instrument.place();
    let rows_of = RowsOf::Readings;
    let mistake = Mistake { kind, of, misfit, misfit_undone: Some(left), by_images: false, rows_of };
    Err(Finding::from(mistake).refusal())
}
