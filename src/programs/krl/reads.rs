//! Routines of a KUKA controller that only read what they are given.

use crate::programs::references::Which;

/// Functions and routines of the controller that can be given a position or a frame and only read it (KUKA, *Operating and programming
/// instructions for system integrators*; `bas.src`).
const READ: [&str; 26] = [
    "ABS",
    "ACOS",
    "ATAN2",
    "BAS",
    "COS",
    "CWRITE",
    "EK",
    "FORWARD",
    "INVERSE",
    "INV_POS",
    "SACC_CP",
    "SACC_JOINT",
    "SAPO",
    "SAPO_PTP",
    "SBASE",
    "SGEAR_JERK",
    "SIN",
    "SIPO_MODE",
    "SJERK",
    "SLOAD",
    "SORI_TYP",
    "SQRT",
    "STOOL2",
    "SVEL_CP",
    "SVEL_JOINT",
    "TAN",
];
/// Of the Ethernet interface, what sends.
const SEND: &str = "EKI_SET";

/// True for what the controller itself offers, as far as it reads that argument only.
pub(super) fn reads(routine: &str, which: &Which) -> bool {
    let is_text = routine == "SWRITE" && *which != Which::Nth(0);
    is_text || routine.starts_with(SEND) || READ.contains(&routine)
}
