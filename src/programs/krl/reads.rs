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

/// Functions of the controller, beside those above, that do not move the robot: texts, files, messages.
const STILL: [&str; 38] = [
    "CAST_FROM",
    "CAST_TO",
    "CCLOSE",
    "CHECKPIDONRDC",
    "CIOCTL",
    "CLEAR_KRLMSG",
    "COPEN",
    "CREAD",
    "DELETE_BACKWARD_BUFFER",
    "EB",
    "EO",
    "EXISTS_KRLDLG",
    "EXISTS_KRLMSG",
    "GET_SIG_INF",
    "GET_SYSTEM_DATA",
    "IOCTL",
    "IS_KEY_PRESSED",
    "KRLMSG",
    "MBX_REC",
    "MSGDIALOG",
    "MSGLOOP",
    "MSGNOTIFY",
    "MSGQUIT",
    "ROB_TIMER",
    "SET_KRLDLG",
    "SET_KRLMSG",
    "SREAD",
    "STRADD",
    "STRCLEAR",
    "STRCOMP",
    "STRCOPY",
    "STRDECLLEN",
    "STRFIND",
    "STRLEN",
    "SWRITE",
    "TIMER_LIMIT",
    "VARSTATE",
    "VARTYPE",
];
/// Of the interfaces to sensors and networks, what begins so; what moves the robot is known apart.
const INTERFACES: [&str; 3] = ["EKI_", "RSI_", "ST_"];

/// True for what the controller itself offers and that does not move the robot.
pub(super) fn is_still(routine: &str) -> bool {
    READ.contains(&routine) || STILL.contains(&routine) || INTERFACES.iter().any(|begin| routine.starts_with(begin))
}
