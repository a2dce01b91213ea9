//! The words of KRL for motions.

use crate::programs::scan::Reader;

/// Motions and how many targets they have.
pub(super) const MOVES: [(&str, usize); 7] =
    [("PTP", 1), ("LIN", 1), ("CIRC", 2), ("SPTP", 1), ("SLIN", 1), ("SCIRC", 2), ("SPL", 1)];
pub(super) const RELATIVE: [&str; 7] =
    ["PTP_REL", "LIN_REL", "CIRC_REL", "SPTP_REL", "SLIN_REL", "SCIRC_REL", "SPL_REL"];

/// The frame without any displacement.
pub(super) const NULL_FRAME: &str = "$NULLFRAME";
/// The system's own frame of the world, in which bases are stated.
pub(super) const WORLD: &str = "$WORLD";

/// True before `$NULLFRAME:`, behind which stands a position as it is.
pub(super) fn is_seen_from_null(reader: &Reader<'_>) -> bool {
    reader.ahead_is_word(0, NULL_FRAME) && reader.ahead_is_mark(1, b':')
}

/// True for the header of a spline block: `SPLINE`, `PTP_SPLINE`, `PTP SPLINE`.
pub(super) fn begins_spline(reader: &Reader<'_>) -> bool {
    let is = |word| reader.ahead_is_word(0, word);
    is("SPLINE") || is("PTP_SPLINE") || (is("PTP") && reader.ahead_is_word(1, "SPLINE"))
}
