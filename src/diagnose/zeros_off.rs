//! Are the zeros of the joints, and the ways in which they count, those of the URDF?

use super::kind::{CheckContext, Kind, Quantity, Subject};
use crate::assess::Limits;
use crate::error::Code;
use crate::problem::Adjustment;
use crate::urdf::{Chain, FoundOrigin, Joint, JointKind};

/// A joint whose zero was found elsewhere before the fit, or that counts the other way.
#[derive(Debug, Clone, PartialEq)]
pub struct ZeroOff {
    /// Name of the joint.
    pub joint: String,
    /// What its readings lack, rad or m.
    pub offset: f64,
    /// False of a joint at an end of the arm, where another zero turns the base, or the hand, alone.
    pub offset_is_told: bool,
    /// How it moves.
    pub kind: JointKind,
    /// True where it counts the other way.
    pub is_reversed: bool,
}

pub(super) fn check(fit: &Adjustment, setting: &CheckContext) -> Vec<ZeroOff> {
    zeros_off(&fit.state.robot.chain, setting.limits)
}

/// Joints whose zeros were found far from those of the robot description, or that count the other way.
pub fn zeros_off(chain: &Chain, limits: &Limits) -> Vec<ZeroOff> {
    let is_at_an_end = |reading: usize| reading == 0 || reading + 1 == chain.readings.len();
    let of = |joint: &Joint| match (joint.found, joint.drive) {
        (Some(FoundOrigin::Zero { offset, is_reversed }), Some(drive))
            if is_reversed || offset.abs() > limits.zeros_off_rad =>
        {
            let offset_is_told = !is_at_an_end(drive.reading);
            Some(ZeroOff { joint: joint.name.clone(), offset, offset_is_told, kind: joint.kind, is_reversed })
        }
        _ => None,
    };
    chain.joints.iter().filter_map(of).collect()
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
        let offset = self.offset_is_told.then(|| Quantity::new("offset", self.offset, unit));
        offset.into_iter().chain([Quantity::new("sign", sign, "1")]).collect()
    }

    fn place(&self) -> String {
        self.joint.clone()
    }

    fn seen(&self) -> String {
        let (size, unit) = match self.kind {
            JointKind::Prismatic => (1e3 * self.offset, "mm"),
            _ => (self.offset.to_degrees(), "deg"),
        };
        match (self.is_reversed, self.offset_is_told) {
            (true, true) => format!(
                "counts the other way, and its zero is {size:+.1} {unit} from that of the URDF, by the images; the corrected URDF has it, or mastering.csv where it has in_urdf = no"
            ),
            (false, true) => {
                format!("its zero is {size:+.1} {unit} from that of the URDF, by the images; the corrected URDF has it, or mastering.csv where it has in_urdf = no")
            }
            (true, false) => "counts the other way, by the images, and does so in the corrected URDF; where its zero is they do not tell, as another one turns base or hand alone".into(),
            (false, false) => "its zero is not that of the URDF; where it is the images do not tell, as another one turns base or hand alone".into(),
        }
    }

    fn remedy(&self) -> String {
        "where that cannot be, give URDF and joints.csv of the same robot".into()
    }
}
