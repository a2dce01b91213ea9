//! Which postures were taken for poses of a controller?

use super::kind::{Kind, Quantity, Subject, Weight, some_of};
use crate::error::Code;

/// Stops that are named.
const NAMED: usize = 6;

/// What images and trackers say of postures that were computed.
#[derive(Debug, Clone, PartialEq)]
pub struct ComputedPostures {
    /// Series with such poses.
    pub series: Vec<String>,
    /// Their stops.
    pub stops: usize,
    /// Stops, by the names of their images, at which another posture is taken than that nearest to the stop before.
    pub others: Vec<String>,
    /// True where other postures at many stops together fit as well.
    pub is_open: bool,
    /// Stops at which another posture fits as well, the others as they are.
    pub undecided: usize,
}

impl Kind for ComputedPostures {
    fn code(&self) -> Code {
        Code::PosturesByImages
    }

    fn weight(&self) -> Weight {
        if self.is_open { Weight::Gate } else { Weight::Note }
    }

    fn subjects(&self) -> Vec<Subject> {
        let images = self.others.iter().cloned().map(Subject::Image);
        self.series.iter().cloned().map(Subject::Series).chain(images).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        let count = |name: &str, n: usize| Quantity::new(name, n as f64, "1");
        vec![
            count("stops", self.stops),
            count("in_another_posture", self.others.len()),
            count("others_fit_as_well", usize::from(self.is_open)),
            count("undecided", self.undecided),
        ]
    }

    fn place(&self) -> String {
        format!("series {}", some_of(&self.series, NAMED))
    }

    fn seen(&self) -> String {
        let others = match self.others.len() {
            0 => "what was seen fits the postures nearest to those of the stops before".to_owned(),
            count => format!(
                "at {count} of {} stops what was seen fits another posture than that nearest to the stop before, which is taken: {}",
                self.stops,
                some_of(&self.others, NAMED)
            ),
        };
        let open = match self.is_open {
            true => {
                "; other postures at many stops together (a wrist turned over) fit as well: the corrected robot is right for those that were taken, and where the poses are of the flange in the base"
            }
            false => "",
        };
        let undecided = match self.undecided {
            0 => String::new(),
            count => format!("; at {count} of {} stops another posture fits as well by itself", self.stops),
        };
        format!("{others}{undecided}{open}")
    }

    fn remedy(&self) -> String {
        match self.is_open {
            true => "state the joint angles of the first stop, roughly (series.toml: [controller] first_stop_deg), or record joint readings \
                     (joints.csv)",
            false => "record joint readings (joints.csv): they know the posture",
        }
        .into()
    }
}
