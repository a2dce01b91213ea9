//! The finding that the zero of a joint is another at some of the stops, or creeps; [`super::pose_step`] looks for it.

use super::displaced::Displacement;
use crate::diagnose::kind::{Kind, Quantity, Subject, Weight};
use crate::error::Code;
use crate::urdf::JointKind;

/// The zero of a joint is another from some stop on, or in one of several series, or creeps.
#[derive(Debug, Clone, PartialEq)]
pub struct ZeroMoved {
    /// Name of the joint.
    pub joint: String,
    /// How it moves.
    pub kind: JointKind,
    /// Series.
    pub series: String,
    /// At which of its stops.
    pub displacement: Displacement,
    /// Images or stops at which it is another, in this order.
    pub stops: Vec<String>,
    /// By how much, rad or m, and its sigma; of what creeps, from the first to the last stop.
    pub offset: (f64, f64),
    /// Share of the squares of the joint noise that this and what else changed explain.
    pub share: f64,
    /// Gate where it is beyond what a good robot repeats to, and explains most.
    pub weight: Weight,
}

impl ZeroMoved {
    /// True where hand or camera seem to have two positions because of it.
    pub(in crate::diagnose) fn explains_two_places(&self) -> bool {
        self.weight == Weight::Gate && self.displacement == Displacement::FromThenOn
    }

    fn first(&self) -> &str {
        self.stops.first().map_or("", String::as_str)
    }
}

impl Kind for ZeroMoved {
    fn code(&self) -> Code {
        Code::ZeroMoved
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn subjects(&self) -> Vec<Subject> {
        vec![Subject::Series(self.series.clone()), Subject::Joint(self.joint.clone())]
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![
            Quantity::new("offset", self.offset.0, self.kind.units()[0]).with_sigma(self.offset.1),
            Quantity::new("share_of_joint_noise", self.share, "1"),
        ]
    }

    fn place(&self) -> String {
        format!("series {}", self.series)
    }

    fn seen(&self) -> String {
        let size = format!("{:+.3} {} (sigma {:.3})", 1e3 * self.offset.0, self.kind.units()[1], 1e3 * self.offset.1);
        let anew = "the joint was mastered anew, or its encoder or belt slipped";
        let what = match self.displacement {
            Displacement::AllThrough => format!(
                "from the first to the last stop the zero of {} creeps by {size}: the arm is not yet warm, or a belt, brake or gear gives way",
                self.joint
            ),
            Displacement::InAll => {
                format!("the zero of {} is off by {size} from that of the other series: {anew}", self.joint)
            }
            _ => {
                format!("from {} on the zero of {} is off by {size} from that before: {anew}", self.first(), self.joint)
            }
        };
        format!("{what} (this explains {:.0} % of the squares of the joint noise)", 100.0 * self.share)
    }

    fn remedy(&self) -> String {
        match self.displacement {
            Displacement::AllThrough => {
                "let the arm warm up at the speed of its work, and take the series again".into()
            }
            Displacement::InAll => {
                "identify the robot from series of one mastering: give this one alone, or the others".into()
            }
            _ => format!("identify the robot from the stops of one mastering, before {} or from it on", self.first()),
        }
    }
}
