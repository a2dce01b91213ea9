//! A mistake in words: what was done wrong, and what is to be done.

use super::mistake::{Mistake, MistakeKind, RowsOf, ShiftedPart};
use crate::series::CameraMount;

impl RowsOf {
    /// What is to be shifted.
    fn names(self) -> String {
        match self {
            Self::Readings => "the names in the first column of joints.csv".into(),
            Self::Poses => "the names in the first column of controller.csv".into(),
            Self::Measured(table) => format!("the names in the first column of {table}"),
            Self::Camera => "the stops of this camera in images.csv".into(),
            Self::Pictures => "the names of the images (of observations.csv, its first column)".into(),
        }
    }

    /// Why not the readings.
    const fn reason(self) -> &'static str {
        match self {
            Self::Readings | Self::Poses => "",
            _ => " and leave the readings as they are, which others fit;",
        }
    }

    /// How shifted rows are put right: of some images, of some columns, or all of them.
    fn put_right(self, below: bool, columns: &[String], part: Option<&ShiftedPart>) -> String {
        let (names, reason) = (self.names(), self.reason());
        match (part, columns) {
            (Some(ShiftedPart { first, last, to_the_end, .. }), _) => format!(
                "look for a row that was lost or written twice before {first}, and shift {names} by one row from there on{};{reason} of a recording, see --image-delay and --clock log",
                if *to_the_end { String::new() } else { format!(" to {last}") }
            ),
            (None, []) => {
                format!("shift {names} by one row;{reason} of a recording, see --image-delay and --clock log")
            }
            (None, columns) => format!(
                "shift the columns {} of joints.csv one row {}, and see how they were recorded",
                columns.join(", "),
                if below { "up" } else { "down" }
            ),
        }
    }
}

/// Names in a sentence.
fn listed(names: &[String]) -> String {
    match names {
        [before @ .., last] if !before.is_empty() => format!("{} and {last}", before.join(", ")),
        _ => names.concat(),
    }
}

fn signs_wrong(joints: &[String], noun: &str) -> String {
    let negated = match joints {
        [one] => one.as_str(),
        [_, _] => "both",
        _ => "all of them",
    };
    format!("the readings of {} have the wrong sign: with {negated} negated the {noun}s fit", listed(joints))
}

fn signs_changed(joints: &[String]) -> String {
    let (columns, axes) = if joints.len() == 1 { ("column", "axis") } else { ("columns", "axes") };
    let names = listed(joints);
    format!(
        "negate the {columns} {names} of joints.csv, or the {axes} of {names} in the URDF if the controller counts that way"
    )
}

fn zero_changed(joint: &str, lacking_deg: f64) -> String {
    format!(
        "add {lacking_deg} deg to the column {joint} of joints.csv, or turn the origin of {joint} in the URDF by as much about its axis"
    )
}

/// How the arm itself tells which way a joint counts.
fn turned_by_hand(joints: &[String]) -> String {
    let joint = joints.first().map_or("", String::as_str);
    format!(
        "move {joint} alone to a larger reading, and see whether it turns about its axis in the URDF as a right-hand screw (a slide: goes along it)"
    )
}

const fn unit(are_degrees: bool) -> [&'static str; 3] {
    if are_degrees { ["degrees", "radians", "deg"] } else { ["radians", "degrees", "rad"] }
}

fn mount_written(mount: CameraMount, camera: Option<&str>) -> String {
    let word = if mount == CameraMount::Hand { "hand" } else { "fixed" };
    match camera {
        Some(camera) => format!("write mount = \"{word}\" under the [[camera]] of name = \"{camera}\" in series.toml"),
        None => format!("write camera_mount = \"{word}\" in series.toml (of a recording: in the .toml of its name)"),
    }
}

fn arms_exchanged_back([first, second]: &[Vec<String>; 2], columns: bool, carriers: bool) -> String {
    let columns = columns.then(|| {
        let (first, second) = (first.join(", "), second.iter().rev().cloned().collect::<Vec<_>>().join(", "));
        format!("exchange the column names {first} and {second} in joints.csv")
    });
    let carriers = carriers.then(|| {
        "give the URDF of the arm that carries the camera with --urdf, and that of the other under [robot_2]".to_owned()
    });
    columns.into_iter().chain(carriers).collect::<Vec<_>>().join("; if they are right, ")
}

fn rows_shifted(noun: &str, below: bool, columns: &[String], part: Option<&ShiftedPart>) -> String {
    let row = if below { "below" } else { "above" };
    if let Some(ShiftedPart { first, last, images, to_the_end }) = part {
        let which = if *to_the_end { format!("from {first} on") } else { format!("from {first} to {last}") };
        return format!(
            "{which} {noun}s and joint readings are shifted by one row: {images} {noun}s fit the readings of the row {row}, others their own"
        );
    }
    let readings = match columns {
        [] => "joint readings".to_owned(),
        some => format!("the readings of {} alone", some.join(", ")),
    };
    format!("{noun}s and {readings} are shifted by one row: every {noun} fits the readings of the row {row}")
}

fn lengths_misfit(angle_rad: f64, distance_m: f64, constant: Option<&str>) -> String {
    let fit = format!(
        "directions fit the joint readings (median {:.1} mrad), distances do not (median {:.0} mm)",
        1e3 * angle_rad,
        1e3 * distance_m
    );
    match constant {
        Some(joint) => format!("{fit}, and {joint} reads the same at all stops"),
        None => format!("{fit}: these are the axes of such an arm with other link lengths"),
    }
}

impl Mistake {
    /// What was done wrong, by what shows it: `noun` names one of it.
    pub(super) fn in_words(&self, noun: &str) -> String {
        match &self.kind {
            MistakeKind::Signs(joints) => signs_wrong(joints, noun),
            MistakeKind::SignsOrMirror { joints, others } => format!(
                "{}; with {} negated, as the mirror image of the arm, they fit alike, and do not tell which",
                signs_wrong(joints, noun),
                listed(others)
            ),
            MistakeKind::Zero { joint, lacking_deg } => format!(
                "the zero of {joint} is not that of the URDF: with {lacking_deg} deg added to its readings the {noun}s fit"
            ),
            MistakeKind::SignsOrZero { joints, zero, lacking_deg } => format!(
                "{}; with {lacking_deg} deg added to those of {zero} they fit alike, and do not tell which",
                signs_wrong(joints, noun)
            ),
            MistakeKind::MirrorImage { joints, .. } => format!(
                "its axes are left-handed, or the readings of {} have the wrong sign: either makes the arm its mirror image, with either undone the {noun}s fit, and they do not tell which",
                listed(joints)
            ),
            MistakeKind::Columns(joints) if joints.len() == 2 => {
                format!("the joints stand in another order: with {} exchanged the {noun}s fit", joints.join(" and "))
            }
            MistakeKind::Columns(joints) => {
                let mut right = joints.clone();
                right.rotate_left(1);
                format!(
                    "the joints stand in another order: with the columns {} taken for {} the {noun}s fit",
                    right.join(", "),
                    joints.join(", ")
                )
            }
            MistakeKind::Reversed(joints) => {
                let ends = joints
                    .first()
                    .zip(joints.last())
                    .map_or(String::new(), |(a, b)| format!(", {a} in the place of {b} and so on"));
                format!("the joints stand in reverse order{ends}: reversed, the {noun}s fit")
            }
            MistakeKind::Unit { joint, are_degrees } => {
                let [is, read_as, _] = unit(*are_degrees);
                let values = joint.as_ref().map_or("the joint values".into(), |j| format!("the readings of {j} alone"));
                format!("{values} are {is}, read as {read_as}: converted, the {noun}s fit")
            }
            MistakeKind::SlideUnit { joint, unit, .. } => {
                format!("the readings of {joint} are {unit}, read as metres: converted, the {noun}s fit")
            }
            MistakeKind::Coupled { joints: [joint, before], is_sum } => format!(
                "the controller counts {joint} together with {before}, as where J3 is counted from the ground: with {joint} {} {before} the {noun}s fit",
                if *is_sum { "plus" } else { "minus" }
            ),
            MistakeKind::Rows { below, columns, part } => rows_shifted(noun, *below, columns, part.as_ref()),
            MistakeKind::Mount { mount: CameraMount::Hand, .. } => {
                format!("the camera is in the hand and the plate stands still: read so, the {noun}s fit")
            }
            MistakeKind::Mount { mount: CameraMount::Fixed, .. } => {
                format!("the camera stands still and the plate is in the hand: read so, the {noun}s fit")
            }
            MistakeKind::Cameras([a, b]) => {
                format!("the {noun}s of {a} and {b} are exchanged: each taken for those of the other, they fit")
            }
            MistakeKind::Arms { columns: true, .. } => {
                format!("the arms are exchanged: with the columns of each taken for those of the other the {noun}s fit")
            }
            MistakeKind::Arms { .. } => {
                format!(
                    "the arms are exchanged: with the camera on the second and the plate on the first the {noun}s fit"
                )
            }
            MistakeKind::Mirrored(joints) => {
                let joints = match joints.as_slice() {
                    [] => "all joints that turn the arm to its sides".to_owned(),
                    joints => listed(joints),
                };
                format!(
                    "the {noun}s are mirrored (or their rows and columns are exchanged), or {joints} count the other way: with either undone the {noun}s fit, and they do not tell which"
                )
            }
            MistakeKind::Lengths { angle_rad, distance_m, constant } => {
                lengths_misfit(*angle_rad, *distance_m, constant.as_deref())
            }
            MistakeKind::PlateSize { scale, pitch_m } => format!(
                "the plate is {scale:.3} times as large as plate.toml says, judged by the link lengths in the URDF (a pitch of {:.3} mm instead of {:.3} mm fits), \
                 or else the robot is {:.3} times as large as the URDF",
                1e3 * scale * pitch_m,
                1e3 * pitch_m,
                1.0 / scale
            ),
            MistakeKind::MeasuredUnit(unit) => format!("positions are in {}: in metres the {noun}s fit", unit.name),
            MistakeKind::Poses { what, .. } => what.clone(),
        }
    }

    /// What is to be done.
    pub(super) fn what_to_do(&self) -> String {
        match &self.kind {
            MistakeKind::Signs(joints) => signs_changed(joints),
            MistakeKind::SignsOrMirror { joints, others } => {
                format!("{}: if it does not, {}; else {}", turned_by_hand(others), signs_changed(others), signs_changed(joints))
            }
            MistakeKind::Zero { joint, lacking_deg } => zero_changed(joint, *lacking_deg),
            MistakeKind::SignsOrZero { joints, zero, lacking_deg } => {
                format!("{}: if it does, {}; else {}", turned_by_hand(joints), zero_changed(zero, *lacking_deg), signs_changed(joints))
            }
            MistakeKind::MirrorImage { joints, axes } => {
                format!("{}: if it does, {axes}; else {}", turned_by_hand(joints), signs_changed(joints))
            }
            MistakeKind::Columns(joints) if joints.len() == 2 => {
                format!("exchange the column names {} in joints.csv", joints.join(" and "))
            }
            MistakeKind::Columns(joints) => format!("correct the column names {} in joints.csv", joints.join(", ")),
            MistakeKind::Reversed(joints) => {
                let reversed: Vec<&str> = joints.iter().rev().map(String::as_str).collect();
                format!("name the columns {} of joints.csv {}", joints.join(", "), reversed.join(", "))
            }
            MistakeKind::Unit { joint: Some(joint), .. } => {
                format!("bring the column {joint} of joints.csv to the unit of the others")
            }
            MistakeKind::Unit { joint: None, are_degrees } => {
                format!("write joint_unit = \"{}\" in series.toml (of a recording: in the .toml of its name)", unit(*are_degrees)[2])
            }
            MistakeKind::SlideUnit { joint, metres, .. } => {
                format!("multiply the column {joint} of joints.csv by {metres}: prismatic joints are metres")
            }
            MistakeKind::Coupled { joints: [joint, before], is_sum } => {
                let word = if *is_sum { "plus" } else { "minus" };
                format!("write {joint} {word} {before} into the column {joint} of joints.csv")
            }
            MistakeKind::Rows { below, columns, part } => self.rows_of.put_right(*below, columns, part.as_ref()),
            MistakeKind::Mount { mount, camera } => mount_written(*mount, camera.as_deref()),
            MistakeKind::Cameras([a, b]) => format!(
                "exchange the names {a} and {b} in the column camera of images.csv; if they are right, exchange what stands under their [[camera]] in series.toml"
            ),
            MistakeKind::Arms { arms, columns, carriers } => arms_exchanged_back(arms, *columns, *carriers),
            MistakeKind::Mirrored(joints) => {
                let mirrored = "mirror the images back, or have camera and converter write them as the sensor sees (no mirroring, no exchange of rows and columns)";
                match joints.as_slice() {
                    [] => format!("{mirrored}; if they are right, negate the joints that turn the arm to its sides"),
                    joints => format!("{mirrored}; if they are right, {}", signs_changed(joints)),
                }
            }
            MistakeKind::Lengths { constant: Some(joint), .. } => format!(
                "look whether {joint} moved between the stops: write its readings into joints.csv; if it stood still, check that the URDF is of this robot and size, with lengths in metres"
            ),
            MistakeKind::Lengths { constant: None, .. } => {
                "check that the URDF is of this robot and size, with lengths in metres, and that the tip link carries the camera; an axis that the URDF lacks, as a rail, must have stood still between the stops: else put it into the URDF and its readings into joints.csv; zeros of parallel joints that are off against each other, as one by +90 and the next by -90 degrees, look the same: compare the robot at its zeros with the URDF".into()
            }
            MistakeKind::PlateSize { .. } => {
                "measure the plate with a ruler and correct pitch_m (of tags tag_m or marker_m) in plate.toml; if it is right, the URDF is of another size of this robot".into()
            }
            MistakeKind::MeasuredUnit(unit) => format!("multiply x_m, y_m and z_m by {}", unit.metres),
            MistakeKind::Poses { remedy, .. } => remedy.clone(),
        }
    }
}
