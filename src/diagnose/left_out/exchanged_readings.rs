//! Do images that were left out fit the readings of each other?

use crate::diagnose::kind::{CheckContext, Kind, Quantity, Subject, Weight, some_of};
use crate::error::Code;
use crate::problem::{Adjustment, Image, ImageRejection, Mismatch, Problem};

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
pub fn check(adjustment: &Adjustment, setting: &CheckContext) -> Vec<ExchangedReadings> {
    let problem = &adjustment.problem;
    let circles = ReadingCircles::of(problem);
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

/// Wrongly paired images that fit the readings of others, and the circles of those that fit each other's.
pub(super) struct ReadingCircles {
    /// For every image the one whose readings it fits, and how well; none for others.
    fits: Vec<Option<(usize, f64)>>,
    is_in_circle: Vec<bool>,
}

impl ReadingCircles {
    pub fn of(problem: &Problem) -> Self {
        let fits: Vec<Option<(usize, f64)>> =
            (0..problem.images.len()).map(|image| whose_readings_fit(problem, image)).collect();
        let mut is_in_circle = vec![false; fits.len()];
        let mut is_met = vec![false; fits.len()];
        for first in 0..fits.len() {
            let (mut way, mut at) = (Vec::new(), first);
            while !is_met[at]
                && let Some((other, _)) = fits[at]
            {
                is_met[at] = true;
                way.push(at);
                at = other;
            }
            // A way that comes back to one of its own images ends in a circle.
            let back_at = way.iter().position(|image| *image == at);
            way.iter().skip(back_at.unwrap_or(way.len())).for_each(|image| is_in_circle[*image] = true);
        }
        Self { fits, is_in_circle }
    }

    pub fn contain(&self, image: usize) -> bool {
        self.is_in_circle[image]
    }

    /// Of an image outside the circles the one whose readings it fits, and how well.
    pub fn fit_outside(&self, image: usize) -> Option<(usize, f64)> {
        self.fits[image].filter(|_| !self.contain(image))
    }

    /// The images of a circle from one of them on, each with how well it fits the readings of the next, the last those of the first.
    fn beginning_with(&self, first: usize) -> Vec<(usize, f64)> {
        let mut circle = Vec::new();
        let mut at = first;
        while let Some((next, misfit)) = self.fits[at] {
            circle.push((at, misfit));
            at = next;
            if at == first {
                break;
            }
        }
        circle
    }
}

/// The image of whose readings a wrongly paired one is, and how well it fits them.
fn whose_readings_fit(problem: &Problem, image: usize) -> Option<(usize, f64)> {
    let image = &problem.images[image];
    let Some(ImageRejection::WronglyPaired(Mismatch::Fit { fits: Some(fits), .. })) = &image.rejected else {
        return None;
    };
    let other = problem.images.iter().position(|i| i.series == image.series && i.name == fits.of)?;
    Some((other, fits.misfit))
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
