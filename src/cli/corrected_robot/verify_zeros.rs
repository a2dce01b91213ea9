//! Zeros of the joints that tell why a model misses in a series: other ones than its own, or readings of the other side of its mastering.

use std::path::Path;

use super::verify_stated::Stated;
use super::verify_verdict::{exceeded, numbers_of};
use super::zeros::Zeros;
use crate::assess::Limits;
use crate::diagnose::{Finding, Weight, ZeroOff};
use crate::error::Code;
use crate::output::corrections::FileFinding;
use crate::problem::MeasuredSeries;
use crate::urdf::JointKind;

/// How the readings of a joint are to be taken so that the images fit.
pub(super) fn words(zero: &ZeroOff) -> String {
    let ZeroOff { joint, offset, .. } = zero;
    let by = match zero.kind {
        JointKind::Prismatic => format!("{:+.1} mm", 1e3 * offset),
        _ => format!("{:+.1} deg", offset.to_degrees()),
    };
    match (zero.is_reversed, zero.offset_is_told) {
        (true, true) => format!("{joint} counts the other way and its readings lack {by}"),
        (true, false) => format!("{joint} counts the other way"),
        (false, _) => format!("the readings of {joint} lack {by}"),
    }
}

/// A zero of the model that is not that of the readings, by the images.
pub(super) fn zero_off(zero: &ZeroOff, subject: &str) -> FileFinding {
    let text = format!(
        "{subject}: readings and images fit the model where {}: mastered anew, encoder or belt slipped, or a description of other zeros than the controller's; master it as it was, or identify again",
        words(zero)
    );
    let quantities = numbers_of(&Finding::from(zero.clone()));
    FileFinding { code: Code::ZeroOff, weight: Weight::Gate, subject: subject.to_owned(), quantities, text }
}

/// What the model misses with the readings taken the other way, m, where that is no more than it may.
pub(super) fn read_otherwise(
    (urdf, stated): (&Path, &Stated),
    (zeros, rms_m): (&Zeros, f64),
    series: &[MeasuredSeries],
    limits: &Limits,
) -> Option<FileFinding> {
    let expected = stated.at_stops(series)?;
    let (word, mm) = (zeros.other(), 1e3 * rms_m);
    let or_enter = if word == "before" { ", or enter them" } else { "" };
    let text = format!(
        "{}: with the readings as they are taken the model misses more than its solution states, and {mm:.3} mm RMS with them as those of the controller {word} the offsets of mastering.csv were entered: say --readings {word}{or_enter}",
        urdf.display()
    );
    let is_other = exceeded((urdf, rms_m), &stated.path, expected, limits).is_none();
    is_other.then(|| {
        FileFinding::new(Code::ReadingsOfOtherZeros, Weight::Gate, urdf.display(), [("other_rms_mm", mm)], text)
    })
}
