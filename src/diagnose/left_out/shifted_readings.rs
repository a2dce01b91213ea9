//! Do images that were left out one after the other fit the readings of their neighbours?

use super::reading_circles::ReadingCircles;
use crate::diagnose::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::error::Code;
use crate::problem::Adjustment;

/// Images beside readings that were shifted by a row, and left out.
#[derive(Debug, Clone, PartialEq)]
pub struct ShiftedReadings {
    /// Series.
    pub series: String,
    /// The file of the readings.
    pub table: &'static str,
    /// The images, in the order of their stops.
    pub images: Vec<String>,
    /// True where they fit the readings of the row below, else of the one above.
    pub below: bool,
    /// How well the worst of them does, m + rad.
    pub misfit: f64,
}

/// Every run once; of several cameras at the same stops that of the first.
pub fn check(adjustment: &Adjustment, circles: &ReadingCircles, setting: &CheckContext) -> Vec<ShiftedReadings> {
    let problem = &adjustment.problem;
    let mut found: Vec<(Vec<usize>, ShiftedReadings)> = Vec::new();
    for camera in 0..problem.cameras.len() {
        let of_camera: Vec<usize> = (0..problem.images.len()).filter(|&i| problem.images[i].camera == camera).collect();
        for below in [true, false] {
            let all: Vec<Option<f64>> =
                (0..of_camera.len()).map(|k| fits_neighbour(circles, &of_camera, k, below)).collect();
            let places: Vec<usize> = (0..all.len()).collect();
            let runs = places.chunk_by(|a, b| all[*a].is_some() && all[*b].is_some());
            for run in runs.filter(|run| run.len() >= setting.limits.moved_images) {
                let of = |k: &usize| &problem.images[of_camera[*k]];
                let stops: Vec<usize> = run.iter().map(|k| of(k).stop).collect();
                if found.iter().any(|(known, _)| known.iter().any(|stop| stops.contains(stop))) {
                    continue;
                }
                let series = &setting.series[of(&run[0]).series];
                let shifted = ShiftedReadings {
                    series: series.name.clone(),
                    table: series.readings_file(),
                    images: run.iter().map(|k| of(k).name.clone()).collect(),
                    below,
                    misfit: run.iter().filter_map(|k| all[*k]).fold(0.0, f64::max),
                };
                found.push((stops, shifted));
            }
        }
    }
    found.into_iter().map(|(_, shifted)| shifted).collect()
}

/// How well an image that was left out fits the readings of its neighbour among those of its camera; `None` where it does not, or where readings were
/// exchanged in a circle.
fn fits_neighbour(circles: &ReadingCircles, of_camera: &[usize], place: usize, below: bool) -> Option<f64> {
    let (other, misfit) = circles.fit_outside(of_camera[place])?;
    let neighbour = if below { of_camera.get(place + 1) } else { of_camera.get(place.checked_sub(1)?) };
    (neighbour == Some(&other)).then_some(misfit)
}

impl ShiftedReadings {
    fn ends(&self) -> [&str; 2] {
        [self.images.first(), self.images.last()].map(|name| name.map_or("", String::as_str))
    }
}

impl Kind for ShiftedReadings {
    fn code(&self) -> Code {
        Code::RowsShifted
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn subjects(&self) -> Vec<Subject> {
        self.images.iter().cloned().map(Subject::Image).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![
            Quantity::new("images_shifted", self.images.len() as f64, "1"),
            Quantity::new("misfit_shifted", self.misfit, "m + rad"),
        ]
    }

    fn place(&self) -> String {
        format!("series {}", self.series)
    }

    fn seen(&self) -> String {
        let [first, last] = self.ends();
        format!(
            "the rows of {} are shifted by one from {first} to {last}: {} images that were left out fit the readings of the row {}, to {:.1} (mm plus mrad)",
            self.table,
            self.images.len(),
            if self.below { "below" } else { "above" },
            1e3 * self.misfit
        )
    }

    fn remedy(&self) -> String {
        let [first, last] = self.ends();
        format!(
            "look for a row that was lost or written twice before {first}, and shift the names of the images by one row from there to {last}"
        )
    }
}
