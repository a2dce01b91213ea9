//! Readings in chain order and SI, and whether the stated unit can be true.

use std::path::Path;

use super::joint_names::{StatedUnit, remedy_of_names};
use super::joints::Stops;
use super::manifest::AngleUnit;
use crate::error::{Code, Error, Notice, Result};
use crate::urdf::{Chain, JointKind};

/// No joint of an arm turns further than two full turns from zero on most of its stops.
const TWO_TURNS_RAD: f64 = 4.0 * std::f64::consts::PI;
/// No arm turns most of its joints ten turns from zero; even readings of degrees that are said to be radians are smaller, deg.
const TEN_TURNS_DEG: f64 = 3600.0;
/// A description may limit a joint to half a turn where the real one makes a whole turn to either side (UR arms).
const FOREIGN_LIMITS_RAD: f64 = std::f64::consts::PI;
/// Soft limits of controllers differ from those of the description by less than this.
const SOFT_LIMITS_RAD: f64 = 0.5;
/// Readings that all stay below this number of degrees are a whole turn if they are radians.
pub(super) const SMALL_DEG: f64 = 6.3;
/// The same of a rail, m.
const SOFT_LIMITS_M: f64 = 0.01;
/// Units that lengths are recorded in, beside metres.
pub const LENGTH_UNITS: [LengthUnit; 4] = [
    LengthUnit { name: "millimetres", sign: "mm", metres: 1e-3 },
    LengthUnit { name: "centimetres", sign: "cm", metres: 1e-2 },
    LengthUnit { name: "inches", sign: "inch", metres: 0.0254 },
    LengthUnit { name: "feet", sign: "ft", metres: 0.3048 },
];
/// Fewer stops than this say nothing about their unit.
const MANY_STOPS: usize = 3;

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LengthUnit {
    /// What many of it are called.
    pub name: &'static str,
    /// Its sign behind a number.
    pub sign: &'static str,
    /// Its length, m.
    pub metres: f64,
}

/// Readings of every stop in the order of `Chain::readings`, rad and m; `None` for images taken off the robot. `stating` says how another unit
/// is stated.
///
/// # Errors
/// A joint of the chain that has no column, and a unit that cannot be true.
pub(super) fn readings_for(
    file: &Path,
    stops: &Stops,
    unit: AngleUnit,
    chain: &Chain,
    stating: impl Fn(&str) -> String,
) -> Result<Vec<Option<Vec<f64>>>> {
    let columns = columns_of(file, stops, chain, StatedUnit { unit, stating: &stating })?;
    let raw: Vec<Option<Vec<f64>>> = stops
        .stops
        .iter()
        .map(|stop| stop.raw_readings.as_ref().map(|r| columns.iter().map(|&c| r[c]).collect()))
        .collect();
    let known: Vec<&[f64]> = raw.iter().flatten().map(Vec::as_slice).collect();
    check_unit(file, unit, chain, &known, stating)?;
    Ok(raw.into_iter().map(|row| row.map(|q| to_si(chain, unit, &q))).collect())
}

/// The columns of the readings of a chain; none where some are missing.
fn columns(stops: &Stops, chain: &Chain) -> Option<Vec<usize>> {
    chain.readings.iter().map(|name| stops.joints.iter().position(|joint| joint == name)).collect()
}

fn columns_of(file: &Path, stops: &Stops, chain: &Chain, stated: StatedUnit<'_>) -> Result<Vec<usize>> {
    if let Some(columns) = columns(stops, chain) {
        return Ok(columns);
    }
    let is_missing = |name: &&String| !stops.joints.contains(name);
    let missing: Vec<&str> = chain.readings.iter().filter(is_missing).map(String::as_str).collect();
    let what = format!(
        "has no readings of {} (needed from {} to {}); its joint columns are: {}",
        missing.join(", "),
        chain.base,
        chain.tip,
        stops.joints.join(", ")
    );
    let remedy = remedy_of_names(&missing, &stops.joints, Some(stated))
        .unwrap_or_else(|| "name the columns as the joints in the URDF, or choose another base or tip".to_owned());
    Err(Error::new(Code::JointMissing, file.display(), what, remedy))
}

fn to_si(chain: &Chain, unit: AngleUnit, raw: &[f64]) -> Vec<f64> {
    let si = |(q, kind): (&f64, &JointKind)| match kind {
        JointKind::Revolute => q * unit.in_rad(),
        _ => *q,
    };
    raw.iter().zip(&chain.reading_kinds).map(si).collect()
}

/// Limits of a reading, where they are stated.
fn limits(chain: &Chain, reading: usize) -> Option<(f64, f64)> {
    chain.stated_limits()[reading]
}

fn revolute(chain: &Chain) -> impl Iterator<Item = usize> + Clone + '_ {
    (0..chain.readings.len()).filter(|&i| chain.reading_kinds[i] == JointKind::Revolute)
}

/// Whether the limits of these readings hold to within `slack` (rad or m) when the raw values are multiplied by `factor`.
fn fits(chain: &Chain, mut readings: impl Iterator<Item = usize>, q: &[f64], factor: f64, slack: f64) -> bool {
    readings.all(|i| limits(chain, i).is_none_or(|(low, high)| (low - slack..=high + slack).contains(&(q[i] * factor))))
}

/// Whether readings of a file, as they stand there, can be in this unit; `stating` says how the other one is stated, `"deg"` or `"rad"`.
///
/// # Errors
/// A unit that cannot be true.
pub fn check_unit(
    file: &Path,
    unit: AngleUnit,
    chain: &Chain,
    rows: &[&[f64]],
    stating: impl Fn(&str) -> String,
) -> Result<()> {
    if rows.is_empty() {
        return Ok(());
    }
    refuse_counts(file, unit, chain, rows)?;
    match unit {
        AngleUnit::Rad => refuse_degrees_as_radians(file, chain, rows, stating("deg"))?,
        AngleUnit::Deg => refuse_radians_as_degrees(file, chain, rows, &stating("rad"))?,
    }
    refuse_other_lengths(file, unit, chain, rows)
}

/// Most joints of most stops so far from zero are neither radians nor degrees.
fn refuse_counts(file: &Path, unit: AngleUnit, chain: &Chain, rows: &[&[f64]]) -> Result<()> {
    let joints = revolute(chain).count();
    let are_counts = |q: &&&[f64]| 2 * revolute(chain).filter(|&i| q[i].abs() > TEN_TURNS_DEG).count() > joints;
    // A turntable by itself may have gone round so often.
    if joints < 2 || 2 * rows.iter().filter(are_counts).count() <= rows.len() {
        return Ok(());
    }
    let (joint, (low, high)) = widest(chain, rows);
    let what = format!(
        "joint_unit is {}, but {joint} reads {low} to {high}: most joints are more than ten turns from zero, as counts of encoders are",
        unit.name()
    );
    let remedy = "convert the counts to degrees: by the counts of each axis for a turn, from those of its zero, as the controller has them";
    Err(Error::new(Code::CountsAsAngles, file.display(), what, remedy))
}

fn refuse_degrees_as_radians(file: &Path, chain: &Chain, rows: &[&[f64]], remedy: String) -> Result<()> {
    let possible = |q: &[f64], factor, slack| fits(chain, revolute(chain), q, factor, slack);
    let mostly = |test: &dyn Fn(&[f64]) -> bool| 2 * rows.iter().filter(|q| test(q)).count() > rows.len();
    let beyond_limits =
        mostly(&|q| !possible(q, 1.0, FOREIGN_LIMITS_RAD) && possible(q, AngleUnit::Deg.in_rad(), SOFT_LIMITS_RAD));
    let turning = revolute(chain).filter(|&i| mostly(&|q| q[i].abs() > TWO_TURNS_RAD)).count();
    // One axis of many may be wound up; a third of them is not.
    let wound_up = turning > 0 && 3 * turning >= revolute(chain).count();
    if !beyond_limits && !wound_up {
        return Ok(());
    }
    let (joint, (low, high)) = widest(chain, rows);
    let why = match beyond_limits {
        true => "beyond the limits in the URDF, which they keep if they are degrees",
        false => "more than two turns as radians",
    };
    let what = format!("joint_unit is rad, but {joint} reads {low} to {high}: most rows are {why}");
    Err(Error::new(Code::DegreesAsRadians, file.display(), what, remedy))
}

fn refuse_radians_as_degrees(file: &Path, chain: &Chain, rows: &[&[f64]], stating: &str) -> Result<()> {
    let all = || revolute(chain).flat_map(|i| rows.iter().map(move |q| q[i]));
    let (low, high) = all().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), q| (l.min(q), h.max(q)));
    let small = low > -SMALL_DEG && high < SMALL_DEG && all().next().is_some();
    if !small
        || rows.len() < MANY_STOPS
        || !rows.iter().all(|q| fits(chain, revolute(chain), q, 1.0, FOREIGN_LIMITS_RAD))
    {
        return Ok(());
    }
    let (joint, (joint_low, joint_high)) = widest(chain, rows);
    let what = format!(
        "joint_unit is deg, but all readings lie between {low} and {high} ({joint}: {joint_low} to {joint_high}): \
         as degrees the robot hardly moves, as radians they are usual"
    );
    let table = file.file_name().unwrap_or_default().display();
    let remedy = format!("{stating} (if they are degrees, convert them to radians in {table})");
    Err(Error::new(Code::RadiansAsDegrees, file.display(), what, remedy))
}

fn refuse_other_lengths(file: &Path, unit: AngleUnit, chain: &Chain, rows: &[&[f64]]) -> Result<()> {
    let sliding = || (0..chain.readings.len()).filter(|&i| chain.reading_kinds[i] == JointKind::Prismatic);
    let of_most = |test: &dyn Fn(&[f64]) -> bool| 2 * rows.iter().filter(|q| test(q)).count() > rows.len();
    let keeps = |i: usize, q: &[f64], factor: f64, slack: f64| fits(chain, std::iter::once(i), q, factor, slack);
    let units_of = |i: usize| -> Vec<&LengthUnit> {
        let fit = |unit: &&LengthUnit| of_most(&|q| !keeps(i, q, 1.0, 1.0) && keeps(i, q, unit.metres, SOFT_LIMITS_M));
        // Counted the other way it keeps its limits as well: the measurements tell.
        let is_negated = of_most(&|q| keeps(i, q, -1.0, SOFT_LIMITS_M));
        if is_negated { Vec::new() } else { LENGTH_UNITS.iter().filter(fit).collect() }
    };
    let Some((reading, units)) = sliding().map(|i| (i, units_of(i))).find(|(_, units)| !units.is_empty()) else {
        return Ok(());
    };
    let (low, high) = range(rows, reading);
    let joined = |one: fn(&LengthUnit) -> String| units.iter().map(|unit| one(unit)).collect::<Vec<_>>().join(" or ");
    let what = format!(
        "{} reads {low} to {high}, beyond the limits in the URDF, which it keeps if it is in {}",
        chain.readings[reading],
        joined(|unit| unit.name.to_owned())
    );
    let is_within = limits(chain, reading).is_some_and(|(least, most)| high - low <= most - least + SOFT_LIMITS_M);
    let remedy = format!(
        "prismatic joints are metres: multiply the column by {}{}",
        joined(|unit| format!("{} ({})", unit.metres, unit.sign)),
        if is_within {
            "; if it is in metres, its zero is not that of the URDF: add what lies between them"
        } else {
            ""
        }
    );
    let exchanged = |other: &usize| of_most(&|q| keeps_exchanged([reading, *other], q, unit, chain));
    let Some(other) = revolute(chain).find(exchanged) else {
        return Err(Error::new(Code::MillimetresAsMetres, file.display(), what, remedy));
    };
    let [slide, turn] = [reading, other].map(|i| &chain.readings[i]);
    let (low, high) = range(rows, other);
    let what = format!("{what}; {turn} reads {low} to {high}: with both columns exchanged both keep their limits");
    let remedy = format!("exchange the column names {slide} and {turn}; if they are right, {remedy}");
    Err(Error::new(Code::JointOrderWrong, file.display(), what, remedy))
}

/// True where a slide and a turn keep their limits with their readings exchanged.
fn keeps_exchanged([slide, turn]: [usize; 2], q: &[f64], unit: AngleUnit, chain: &Chain) -> bool {
    let mut exchanged = q.to_vec();
    exchanged.swap(slide, turn);
    let (low, high) = limits(chain, turn).unwrap_or((-FOREIGN_LIMITS_RAD, FOREIGN_LIMITS_RAD));
    let angles = low - SOFT_LIMITS_RAD..=high + SOFT_LIMITS_RAD;
    fits(chain, std::iter::once(slide), &exchanged, 1.0, SOFT_LIMITS_M)
        && angles.contains(&(exchanged[turn] * unit.in_rad()))
}

/// Name and range of the revolute reading that reaches furthest from zero.
fn widest<'a>(chain: &'a Chain, rows: &[&[f64]]) -> (&'a str, (f64, f64)) {
    let reach = |i: usize| rows.iter().map(|q| q[i].abs()).fold(0.0, f64::max);
    let widest = revolute(chain).max_by(|&a, &b| reach(a).total_cmp(&reach(b)));
    widest.map_or(("", (0.0, 0.0)), |i| (&chain.readings[i], range(rows, i)))
}

fn range(rows: &[&[f64]], reading: usize) -> (f64, f64) {
    rows.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), q| (l.min(q[reading]), h.max(q[reading])))
}

/// Columns that the chain does not need, and readings beyond the limits of the URDF. Of the `view` of one among several cameras, what is said is
/// that of the others.
pub(super) fn notices(file: &Path, (stops, view): (&Stops, bool), unit: AngleUnit, chain: &Chain) -> Vec<Notice> {
    let mut notices = Vec::new();
    let extra = stops.joints.iter().filter(|j| !chain.readings.contains(j));
    let (beside, unknown): (Vec<&String>, Vec<&String>) = extra.partition(|j| chain.beside.contains(j));
    let ends = format!("between {} and {}", chain.base, chain.tip);
    let of_other_branches = (
        format!("columns of joints of the URDF that do not lie {ends}"),
        "they are not used; where they move the plate or the camera, name the link that carries it: [plate_mount] with link = \
         \"...\", or link = \"...\" under [camera] of series.toml",
    );
    let of_none = (
        format!("columns that are no joints {ends}, nor any of the URDF"),
        "they are not used; check the spelling if they should be",
    );
    let that_vary = (
        format!("columns that are no joints {ends}, nor any of the URDF, and differ from stop to stop"),
        "where they move the robot, the camera or the plate (a rail, a lift), the URDF must have them as joints; else they are not used",
    );
    let (moving, unknown): (Vec<&String>, Vec<&String>) = unknown.into_iter().partition(|j| varies(stops, j));
    for (joints, code, (what, remedy)) in [
        (beside, Code::JointUnused, of_other_branches),
        (unknown, Code::JointUnused, of_none),
        (moving, Code::JointUnusedMoves, that_vary),
    ] {
        if !joints.is_empty() {
            let names = joints.iter().map(|j| j.as_str()).collect::<Vec<_>>().join(", ");
            notices.push(Notice::new(code, file.display(), format!("{what}: {names}"), remedy));
        }
    }
    notices.extend(unused_covariates(file, stops));
    notices.extend(equal_columns(file, stops, chain));
    let Some(columns) = columns(stops, chain) else { return notices };
    for (reading, column) in columns.into_iter().enumerate() {
        notices.extend(beyond_limits(file, (stops, view), unit, chain, (reading, column)));
    }
    notices
}

fn column(stops: &Stops, joint: &str) -> Vec<f64> {
    let Some(column) = stops.joints.iter().position(|j| j == joint) else { return Vec::new() };
    stops.stops.iter().filter_map(|s| s.raw_readings.as_ref()?.get(column).copied()).collect()
}

/// Whether a column differs from stop to stop, by more than noise.
fn differs(stops: &Stops, joint: &str) -> bool {
    let readings = column(stops, joint);
    let (low, high) = readings.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), q| (l.min(*q), h.max(*q)));
    high - low > UNMOVED
}

/// Whether a column differs, and otherwise than a clock or a counter.
fn varies(stops: &Stops, joint: &str) -> bool {
    differs(stops, joint) && !column(stops, joint).windows(2).all(|pair| pair[0] < pair[1])
}

/// Joints that move and read the same to the last digit at every stop.
fn equal_columns(file: &Path, stops: &Stops, chain: &Chain) -> Option<Notice> {
    let moving = |joint: &&String| differs(stops, joint) && column(stops, joint).len() >= MANY_STOPS;
    let joints: Vec<&String> = chain.readings.iter().filter(moving).collect();
    let mut pairs =
        joints.iter().enumerate().flat_map(|(k, one)| joints[k + 1..].iter().map(move |other| (one, other)));
    let (one, other) = pairs.find(|(one, other)| column(stops, one) == column(stops, other))?;
    let what = format!("the columns {one} and {other} are equal at every stop");
    let remedy = "one of them is a copy of the other: write what the joint reads (of joints that are coupled, the URDF has one with mimic)";
    Some(Notice::new(Code::JointColumnsEqual, file.display(), what, remedy))
}

/// Joints of the URDF that a chain does not need.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct JointsBeside {
    /// Those whose columns differ from stop to stop.
    pub moved: Vec<String>,
    /// Those without a column.
    pub untold: Vec<String>,
}

impl JointsBeside {
    /// Of readings beside a chain.
    pub(super) fn of(stops: &Stops, chain: &Chain) -> Self {
        let (told, untold): (Vec<String>, Vec<String>) =
            chain.beside_arm().cloned().partition(|joint| stops.joints.contains(joint));
        Self { moved: told.into_iter().filter(|joint| differs(stops, joint)).collect(), untold }
    }

    /// Adds those of other stops.
    pub fn add(&mut self, other: Self) {
        for (own, other) in [(&mut self.moved, other.moved), (&mut self.untold, other.untold)] {
            own.extend(other);
            own.sort();
            own.dedup();
        }
    }
}

/// Columns that are read, and of which no joint term makes use.
fn unused_covariates(file: &Path, stops: &Stops) -> Option<Notice> {
    let is_warm = stops.stops.iter().any(|s| s.covariates.temperature_c.is_some());
    let columns: Vec<&str> = [(is_warm, "temperature_c"), (!stops.torque_joints.is_empty(), "tau_nm:<joint>")]
        .into_iter()
        .filter_map(|(is_there, name)| is_there.then_some(name))
        .collect();
    let what = format!("columns that no joint term makes use of: {}", columns.join(", "));
    let remedy = "they may stay; the result is the same without them";
    (!columns.is_empty()).then(|| Notice::new(Code::CovariatesUnused, file.display(), what, remedy))
}

/// Readings of an axis that stands still differ by less, in any unit.
const UNMOVED: f64 = 1e-3;

/// One over the last digit that is shown of a reading; what it does not show is rounding.
const SHOWN: f64 = 1e4;

/// The worst offender of one joint, and how many there are.
fn beyond_limits(
    file: &Path,
    (stops, view): (&Stops, bool),
    unit: AngleUnit,
    chain: &Chain,
    (reading, column): (usize, usize),
) -> Option<Notice> {
    let (low, high) = limits(chain, reading)?;
    let revolute = chain.reading_kinds[reading] == JointKind::Revolute;
    let factor = if revolute { unit.in_rad() } else { 1.0 };
    let beyond = |q: f64| (low - q).max(q - high);
    let outside: Vec<_> = stops
        .stops
        .iter()
        .filter_map(|s| Some((s, s.raw_readings.as_ref()?[column] * factor)))
        .filter(|(_, q)| beyond(*q) > factor / SHOWN)
        .collect();
    let (stop, worst) = outside.iter().max_by(|a, b| beyond(a.1).total_cmp(&beyond(b.1)))?;
    let shown = if revolute { unit.name() } else { "m" };
    let [worst, low, high] = [*worst, low, high].map(|q| (SHOWN * q / factor).round() / SHOWN);
    let (line, image) = (format!("{}:{}", file.display(), stop.line), &stop.image);
    let counted = format!(" ({} of {} images)", outside.len(), stops.stops.len());
    let (place, counted) = if view { (line, String::new()) } else { (format!("{line}, image {image}"), counted) };
    let joint = &chain.readings[reading];
    let what = format!("{joint} reads {worst} {shown}, beyond its limits {low} to {high} in the URDF{counted}");
    Some(Notice::new(Code::JointBeyondLimits, place, what, "check the joint's unit and sign, or correct the limits"))
}
