//! By how much what measures lengths states them too large, by all else that the fit knows: Rao's score test as in [`super::response`], of one
//! column that stretches every position that an instrument measured, or every measured distance.

use nalgebra::Vector6;

use crate::problem::{MeasuredLength, Step};
use crate::solve::elimination::right_hand_sides::RightHandSides;
use crate::solve::elimination::seen_markers::SeenMarkers;
use crate::solve::elimination::system::System;
use crate::solve::linear::{BodyPart, LinearProblem};

/// What measures lengths, beside plates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LengthStandard {
    /// A tracker, or given places: index of the instrument.
    Instrument(usize),
    /// The measured distances between places or bodies.
    Distances,
}

/// A relative stretch and its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stretch {
    /// Lengths as stated over those as they are, less one.
    pub off: f64,
    /// Standard deviation.
    pub sigma: f64,
}

impl LinearProblem<'_> {
    /// The stretch by one step from the optimum; `None` where nothing tells it.
    pub fn stretch(self, standard: LengthStandard) -> Option<Stretch> {
        let system = System::new(self, 0.0);
        let factor = system.factor(self).ok()?;
        let lengths = self.stretched_lengths(standard);
        let mut column = RightHandSides::none(self, &SeenMarkers::of(self), 1);
        for (part, twist) in self.lin.bodies.iter().zip(self.stretched(standard)) {
            column.add_body(self, part, &(part.terms.pp * twist));
        }
        for (length, by) in self.lin.lengths.iter().zip(&lengths) {
            length.by_columns.iter().for_each(|(c, d)| column.dense[*c] += d * by);
        }
        let response = system.steps(self, &factor, &column).into_iter().next()?;
        let (mut information, mut score) = (0.0, 0.0);
        for (part, twist) in self.lin.bodies.iter().zip(self.stretched(standard)) {
            information += twist.dot(&(part.terms.pp * (twist - self.body_step(part, &response))));
            score += twist.dot(&part.terms.bp);
        }
        for (length, by) in self.lin.lengths.iter().zip(&lengths) {
            let taken: f64 = length.by_columns.iter().map(|(c, d)| d * response.dense[*c]).sum();
            information += by * (by - taken);
            score += by * length.residual;
        }
        (information > 0.0).then(|| Stretch { off: score / information, sigma: information.sqrt().recip() })
    }

    /// How a stretch moves what is predicted of every measured body, as a body twist.
    fn stretched(self, standard: LengthStandard) -> impl Iterator<Item = Vector6<f64>> {
        self.lin.bodies.iter().map(move |part| {
            let own = self.adjustment.problem.body_measurements[part.index].instrument;
            let mut twist = Vector6::zeros();
            if standard == LengthStandard::Instrument(own) {
                let pose = &part.chain.pose;
                twist.fixed_rows_mut::<3>(0).copy_from(&pose.rotation.tr_mul(&pose.translation));
            }
            twist
        })
    }

    /// The same of every measured distance, over its sigma.
    fn stretched_lengths(self, standard: LengthStandard) -> Vec<f64> {
        let (measured, lengths) = (self.adjustment.problem.used_lengths(), &self.lin.lengths);
        let measured: Vec<&MeasuredLength> = measured.map(|(_, l)| l).collect();
        if standard != LengthStandard::Distances || measured.len() != lengths.len() {
            return vec![0.0; lengths.len()];
        }
        measured.into_iter().zip(lengths).map(|(m, l)| m.distance_m / m.sigma_m - l.residual).collect()
    }

    /// How a step moves what is predicted of a measured body, as a body twist.
    fn body_step(self, part: &BodyPart, step: &Step) -> Vector6<f64> {
        let stop = self.adjustment.problem.body_measurements[part.index].stop;
        part.chain.moved(&step.dense, step.joint_errors[stop].iter().copied())
    }
}
