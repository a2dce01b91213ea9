//! Are the zeros of the joints, and the ways in which they count, those of the URDF?

use super::kind::{CheckContext, Kind, Quantity, Subject};
use crate::error::Code;
use crate::problem::Adjustment;
use crate::urdf::{FoundOrigin, Joint, JointKind};

/// A joint whose zero was found elsewhere before the fit, or that counts the other way.
#[derive(Debug, Clone, PartialEq)]
pub struct ZeroOff {
    /// Name of the joint.
    pub joint: String,
    /// What its readings lack, rad or m.
    pub offset: f64,
    /// How it moves.
    pub kind: JointKind,
    /// True where it counts the other way.
    pub is_reversed: bool,
}

pub(super) fn check(fit: &Adjustment, setting: &CheckContext) -> Vec<ZeroOff> {
    let of = |joint: &Joint| match joint.found {
        Some(FoundOrigin::Zero { offset, is_reversed })
            if is_reversed || offset.abs() > setting.limits.zeros_off_rad =>
        {
            Some(ZeroOff { joint: joint.name.clone(), offset, kind: joint.kind, is_reversed })
        }
        _ => None,
    };
    fit.state.robot.chain.joints.iter().filter_map(of).collect()
}

impl Kind for ZeroOff {
    fn code(&self) -> Code {
        Code::ZeroOff
    }

    fn subjects(&self) -> Vec<Subject> {
        vec![Subject::Joint(self.joint.clone())]
    }

    fn quantities(&self) -> Vec<Quantity> {
        let unit = if self.kind == JointKind::Prismatic { "m" } else { "rad" };
        let sign = if self.is_reversed { -1.0 } else { 1.0 };
        vec![Quantity::new("offset", self.offset, unit), Quantity::new("sign", sign, "1")]
    }

    fn place(&self) -> String {
        self.joint.clone()
    }

    fn seen(&self) -> String {
        let (size, unit) = match self.kind {
            JointKind::Prismatic => (1e3 * self.offset, "mm"),
            _ => (self.offset.to_degrees(), "deg"),
        };
        let counts = if self.is_reversed { "counts the other way, and " } else { "" };
        format!("{counts}its zero is {size:+.1} {unit} from that of the URDF, by the images; the corrected URDF has it")
    }

    fn remedy(&self) -> String {
        "where that cannot be, give URDF and joints.csv of the same robot".into()
    }
}
