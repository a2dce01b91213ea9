//! Options as a person reads them.

use super::{Estimator, JointNoise, MarkerTolerance, Options};

impl Options {
    /// Names and values of what was chosen, in the order in which they are shown.
    pub fn in_words(&self) -> Vec<(String, String)> {
        let joint_noise = match self.joint_noise {
            JointNoise::Estimated => "estimated".to_owned(),
            JointNoise::Known(sigma) => format!("{sigma} rad"),
        };
        let mut model = self.model.name().to_owned();
        if self.harmonics != Options::default().harmonics {
            model += &format!(", {} harmonics", self.harmonics);
        }
        let mut words = vec![("joint noise".to_owned(), joint_noise), ("robot model".to_owned(), model)];
        if self.marker_tolerance == MarkerTolerance::Estimated {
            words.push(("marker tolerance".to_owned(), "estimated".to_owned()));
        }
        if self.estimator != Estimator::Joint {
            words.push(("estimator".to_owned(), self.estimator.title().to_owned()));
        }
        words.extend(self.selection.in_words());
        words.extend(
            self.payload
                .map(|p| ("payload".to_owned(), format!("{} kg at {:?} m of the tip link", p.mass_kg, p.centre_m))),
        );
        words
    }
}
