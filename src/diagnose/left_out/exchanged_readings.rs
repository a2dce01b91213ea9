//! Do images that were left out fit the readings of each other?

use super::reading_circles::ReadingCircles;
use crate::diagnose::kind::{CheckContext, Kind, Quantity, Subject, Weight, some_of};
use crate::error::Code;
use crate::problem::{Adjustment, Image};

/// Most stops that are named.
const MOST_STOPS: usize = 5;

/// Stops whose rows were written in another order.
#[derive(Debug, Clone, PartialEq)]
pub struct ExchangedReadings {
    /// Images in a circle: each fits the readings that stand beside the next, the last those of the first.
    pub circle: Vec<String>,
    /// All images of these stops.
    pub images: Vec<String>,
    /// How well the worst of them does, m + rad.
    pub misfit: f64,
    /// True where something else that was measured at each of these stops fits its readings: then the images are exchanged.
    pub others_fit: bool,
    /// The file of the readings.
    pub table: &'static str,
}

/// Every circle once, and once for all cameras that saw its stops.
pub fn check(adjustment: &Adjustment, circles: &ReadingCircles, setting: &CheckContext) -> Vec<ExchangedReadings> {
    let problem = &adjustment.problem;
    let mut found: Vec<ExchangedReadings> = Vec::new();
    for (first, image) in problem.images.iter().enumerate().filter(|(k, _)| circles.contain(*k)) {
        if found.iter().any(|f| f.images.contains(&image.name)) {
            continue;
        }
        let circle = circles.beginning_with(first);
        let of_circle = |i: &&Image| circle.iter().any(|&(k, _)| problem.images[k].stop == i.stop);
        let is_measured = |&(k, _): &(usize, f64)| problem.is_measured_at(problem.images[k].stop);
        found.push(ExchangedReadings {
            others_fit: circle.iter().all(is_measured),
            circle: circle.iter().map(|&(i, _)| problem.images[i].name.clone()).collect(),
            images: problem.images.iter().filter(of_circle).map(|i| i.name.clone()).collect(),
            misfit: circle.iter().map(|&(_, misfit)| misfit).fold(0.0, f64::max),
            table: setting.series[image.series].readings_file(),
        });
    }
    found
}

impl Kind for ExchangedReadings {
    fn code(&self) -> Code {
        Code::ReadingsExchanged
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn subjects(&self) -> Vec<Subject> {
        self.images.iter().cloned().map(Subject::Image).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![Quantity::new("misfit_exchanged", self.misfit, "m + rad")]
    }

    fn place(&self) -> String {
        if self.others_fit { "images" } else { self.table }.into()
    }

    fn seen(&self) -> String {
        let named = some_of(&self.circle, MOST_STOPS);
        let to = 1e3 * self.misfit;
        match self.circle.len() {
            2 => format!(
                "the rows of {named} are exchanged: each image fits the readings of the other to {to:.1} (mm plus mrad)"
            ),
            _ => format!(
                "the rows of {named} are mixed up: each image fits the readings of the next, the last those of the first, to {to:.1} (mm plus mrad)"
            ),
        }
    }

    fn remedy(&self) -> String {
        match self.others_fit {
            true => format!(
                "exchange these images by their names (where there is images.csv, there), and leave {} as it is, which what else was measured at these stops fits",
                self.table
            ),
            false => "write these readings beside the images that they fit, and all of them are used".into(),
        }
    }
}
