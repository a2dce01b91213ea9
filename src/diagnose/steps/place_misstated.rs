//! The finding that a given place is not where the other touches have it; [`super::pose_step`] looks for it.

use super::rows::Step;
use crate::diagnose::kind::{Kind, Quantity, Subject, Weight, some_of};
use crate::error::Code;
use crate::problem::Problem;

/// Most stops that are named.
const MOST_STOPS: usize = 3;

/// A given place is misstated, or another point was touched each time.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaceMisstated {
    /// Series.
    pub series: String,
    /// Name of the frame of the places.
    pub frame: String,
    /// As stated, m, in that frame.
    pub place_m: [f64; 3],
    /// As all else has it less that, m, along the axes of the frame, each with its sigma.
    pub off_m: [(f64, f64); 3],
    /// Stops at which it was touched.
    pub stops: Vec<String>,
    /// Share of the squares of the joint noise that this and what else changed explain.
    pub share: f64,
    /// True where it, or what was found after it, explains most of what was left.
    pub explains_most: bool,
    /// Gate where it is beyond what a good robot repeats to, and explains most.
    pub weight: Weight,
}

impl PlaceMisstated {
    pub(super) fn of(
        step: &Step,
        problem: &Problem,
        first: usize,
        (series, stops): (String, Vec<String>),
        weight: Weight,
    ) -> Self {
        let measured = &problem.body_measurements[first];
        let off_m = [0, 1, 2].map(|k| (step.change[k], step.covariance[(k, k)].sqrt()));
        Self {
            series,
            frame: problem.instruments[measured.instrument].name.clone(),
            place_m: measured.seen.position().into(),
            off_m,
            stops,
            share: step.share,
            explains_most: step.explains_most,
            weight,
        }
    }

    /// True where measurements in this frame scatter because of it.
    pub(in crate::diagnose) fn explains_scatter_of(&self, instrument: &str) -> bool {
        self.explains_most && self.frame == instrument
    }

    fn distance_m(&self) -> f64 {
        self.off_m.iter().map(|(off, _)| off * off).sum::<f64>().sqrt()
    }
}

impl Kind for PlaceMisstated {
    fn code(&self) -> Code {
        Code::PlaceContradicted
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn subjects(&self) -> Vec<Subject> {
        let stops = self.stops.iter().cloned().map(Subject::Stop);
        [Subject::Series(self.series.clone()), Subject::Body(self.frame.clone())].into_iter().chain(stops).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        let along = ["off_x", "off_y", "off_z"].into_iter().zip(self.off_m);
        let off = along.map(|(name, (off, sigma))| Quantity::new(name, off, "m").with_sigma(sigma));
        let distance = Quantity::new("distance", self.distance_m(), "m");
        let share = Quantity::new("share_of_joint_noise", self.share, "1");
        [distance].into_iter().chain(off).chain([share]).collect()
    }

    fn place(&self) -> String {
        format!("series {}, contacts.csv", self.series)
    }

    fn seen(&self) -> String {
        let [x, y, z] = self.place_m;
        let [to_x, to_y, to_z] = self.off_m.map(|(off, _)| 1e3 * off);
        let sigma = self.off_m.iter().map(|(_, sigma)| 1e3 * sigma).fold(0.0, f64::max);
        format!(
            "the place ({x:.4}, {y:.4}, {z:.4}) m of {}, touched at {}, is {:.2} mm from where all else has it: that is ({to_x:+.2}, {to_y:+.2}, {to_z:+.2}) mm further (sigma at most {sigma:.2} mm per axis; this explains {:.0} % of the squares of the joint noise)",
            self.frame,
            some_of(&self.stops, MOST_STOPS),
            1e3 * self.distance_m(),
            100.0 * self.share
        )
    }

    fn remedy(&self) -> String {
        "measure it again and correct it in contacts.csv, or touch the point that was meant".into()
    }
}
