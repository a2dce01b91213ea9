//! The words of KRL for motions.

use crate::programs::scan::Reader;

/// Motions and how many targets they have.
pub(super) const MOVES: [(&str, usize); 7] =
    [("PTP", 1), ("LIN", 1), ("CIRC", 2), ("SPTP", 1), ("SLIN", 1), ("SCIRC", 2), ("SPL", 1)];
pub(super) const RELATIVE: [&str; 7] =
    ["PTP_REL", "LIN_REL", "CIRC_REL", "SPTP_REL", "SLIN_REL", "SCIRC_REL", "SPL_REL"];

/// True for the header of a spline block: `SPLINE`, `PTP_SPLINE`, `PTP SPLINE`.
pub(super) fn begins_spline(reader: &Reader<'_>) -> bool {
    let is = |word| reader.ahead_is_word(0, word);
    is("SPLINE") || is("PTP_SPLINE") || (is("PTP") && reader.ahead_is_word(1, "SPLINE"))
}
