//! Motions of KRL.

use crate::programs::program::MeantPosture;

/// Motions and how many targets they have.
pub(super) const MOVES: [(&str, usize); 7] =
    [("PTP", 1), ("LIN", 1), ("CIRC", 2), ("SPTP", 1), ("SLIN", 1), ("SCIRC", 2), ("SPL", 1)];
pub(super) const RELATIVE: [&str; 6] = ["PTP_REL", "LIN_REL", "CIRC_REL", "SPTP_REL", "SLIN_REL", "SCIRC_REL"];

/// The posture that a motion means: on paths of the tool, status and turn are not heeded.
pub(super) fn posture_of(motion: &str, stated: MeantPosture) -> MeantPosture {
    match stated {
        MeantPosture::Nearest if ["LIN", "SLIN"].contains(&motion) => MeantPosture::Along,
        MeantPosture::Coded(codes, axes) if !["PTP", "SPTP"].contains(&motion) => MeantPosture::Unheeded(codes, axes),
        stated => stated,
    }
}
