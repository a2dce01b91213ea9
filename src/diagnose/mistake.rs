//! A usual mistake that, undone, lets the joint readings fit the images: there is no result until it is mended.

use super::kind::{Kind, Quantity, Subject, Weight};
use crate::error::Code;
use crate::series::{CameraMount, LengthUnit};

/// What was done wrong.
#[derive(Debug, Clone, PartialEq)]
pub enum MistakeKind {
    /// Readings have the wrong sign.
    Signs(Vec<String>),
    /// The same, or those of others, with which the arm is its mirror image.
    SignsOrMirror {
        /// The joints.
        joints: Vec<String>,
        /// The others.
        others: Vec<String>,
    },
    /// The zero of a joint is far from that of the URDF.
    Zero {
        /// The joint.
        joint: String,
        /// Degrees that its readings lack.
        lacking_deg: f64,
    },
    /// Readings have the wrong sign, or the zero of another joint is half a turn off, as in a wrist, where both are the same.
    SignsOrZero {
        /// The joints of the signs.
        joints: Vec<String>,
        /// The joint of the zero.
        zero: String,
        /// Degrees that its readings lack.
        lacking_deg: f64,
    },
    /// The axes of an instrument are left-handed, or the readings of these joints have the wrong sign: the arm is its mirror image.
    MirrorImage {
        /// The joints.
        joints: Vec<String>,
        /// What to do where it is the axes.
        axes: String,
    },
    /// Columns stand in each other's place: the first takes the readings of the second, and so on, the last those of the first.
    Columns(Vec<String>),
    /// All columns stand in reverse order: these, from base to tip.
    Reversed(Vec<String>),
    /// Angles are in another unit than they are read in; of one joint alone, or of all.
    Unit {
        /// The joint; none where it is all of them.
        joint: Option<String>,
        /// True where degrees are read as radians, else the other way round.
        are_degrees: bool,
    },
    /// Readings of a prismatic joint are in another unit than metres.
    SlideUnit {
        /// The joint.
        joint: String,
        /// The unit, in the plural.
        unit: &'static str,
        /// Metres of one of them.
        metres: f64,
    },
    /// A joint is counted together with the one before it, as where it is counted from the ground.
    Coupled {
        /// The joint, and the one before it.
        joints: [String; 2],
        /// True where its own angle is the sum of both, false where it is the difference.
        is_sum: bool,
    },
    /// Every image stands beside the readings of the row below, or above.
    Rows {
        /// True for the row below.
        below: bool,
        /// The joints of which it does, as those of a positioner that was recorded apart; empty where it is all of them.
        columns: Vec<String>,
        /// The images of which it holds; none where it is all of them.
        part: Option<ShiftedPart>,
    },
    /// The camera is mounted in the way that is not stated.
    Mount {
        /// How it is mounted.
        mount: CameraMount,
        /// Its name, where it is one of several.
        camera: Option<String>,
    },
    /// The images of one camera are those of the other: one is in the hand, one is fixed.
    Cameras([String; 2]),
    /// Two arms stand in each other's place.
    Arms {
        /// Their joints: of the first arm, and of the second.
        arms: [Vec<String>; 2],
        /// True where the columns exchanged fit.
        columns: bool,
        /// True where camera and plate exchanged fit.
        carriers: bool,
    },
    /// The images show the scene mirrored, and may be turned as well, or the readings of these joints have the wrong sign, where the arm has a
    /// mirror image.
    Mirrored(Vec<String>),
    /// Directions fit and distances do not, medians over the images.
    Lengths {
        /// Of the directions, rad.
        angle_rad: f64,
        /// Of the distances, m.
        distance_m: f64,
        /// A prismatic joint that reads the same at all stops.
        constant: Option<String>,
    },
    /// The plate has another size.
    PlateSize {
        /// Its size over the stated one, by the links of the robot.
        scale: f64,
        /// Its pitch as stated, m.
        pitch_m: f64,
    },
    /// Measured positions are in this unit and not in metres.
    MeasuredUnit(LengthUnit),
    /// A table of poses or positions is to be read in another way.
    Poses {
        /// Which.
        code: Code,
        /// How it is to be read.
        what: String,
        /// What to do.
        remedy: String,
    },
}

/// Images one after the other that stand beside the readings of a neighbour, where others stand beside their own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShiftedPart {
    /// The first of them.
    pub first: String,
    /// The last of them.
    pub last: String,
    /// How many.
    pub images: usize,
    /// True where they go on to the last image.
    pub to_the_end: bool,
}

/// The table whose rows are wrong where rows are shifted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowsOf {
    /// That of the readings, as far as is known.
    Readings,
    /// That of the poses of a controller, from which readings were computed.
    Poses,
    /// This table of measurements: others fit the readings.
    Measured(&'static str),
    /// images.csv, the rows of one camera: others fit the readings.
    Camera,
    /// The images of a single camera, by their names: what else was measured fits the readings.
    Pictures,
}

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
}

impl MistakeKind {
    /// True where `whole` is the same of all rows.
    pub fn is_part_of(&self, whole: &Self) -> bool {
        match (self, whole) {
            (
                Self::Rows { below, columns, part: Some(_) },
                Self::Rows { below: all_below, columns: all, part: None },
            ) => (below, columns) == (all_below, all),
            _ => false,
        }
    }

    /// By how much what was measured shrinks, and its misfit with it, where this is undone: what is left tells nothing of the unit where the misfit
    /// merely shrank. An arm that turns about its target fits positions in any unit.
    pub const fn shrinks(&self) -> f64 {
        match self {
            Self::MeasuredUnit(unit) => unit.metres,
            _ => 1.0,
        }
    }
}

/// A mistake that explains why readings and images do not fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Mistake {
    /// What was done wrong.
    pub kind: MistakeKind,
    /// Camera mounting and plate placement that do not fit.
    pub of: String,
    /// Median misfit of the camera poses as everything is stated, rad + m.
    pub misfit: f64,
    /// The same with the mistake undone; none of lengths, which were not corrected.
    pub misfit_undone: Option<f64>,
    /// True where images showed it, false where a tracker did.
    pub by_images: bool,
    /// The table that is wrong, where rows are shifted.
    pub rows_of: RowsOf,
}

impl Mistake {
    /// Images that it is about, where it is about some.
    const fn part(&self) -> Option<&ShiftedPart> {
        match &self.kind {
            MistakeKind::Rows { part, .. } => part.as_ref(),
            _ => None,
        }
    }

    /// Joints that it is about; none where it is about all.
    fn joints(&self) -> &[String] {
        match &self.kind {
            MistakeKind::Signs(joints)
            | MistakeKind::SignsOrMirror { joints, .. }
            | MistakeKind::SignsOrZero { joints, .. }
            | MistakeKind::Columns(joints)
            | MistakeKind::Rows { columns: joints, .. } => joints,
            MistakeKind::Unit { joint, .. } => joint.as_slice(),
            MistakeKind::SlideUnit { joint, .. } | MistakeKind::Zero { joint, .. } => std::slice::from_ref(joint),
            MistakeKind::Coupled { joints, .. } => &joints[..1],
            _ => &[],
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

/// Degrees between zeros that are opposite.
pub const HALF_TURN_DEG: f64 = 180.0;

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

impl Kind for Mistake {
    fn code(&self) -> Code {
        match &self.kind {
            MistakeKind::Signs(_) | MistakeKind::SignsOrMirror { .. } | MistakeKind::SignsOrZero { .. } => {
                Code::JointSignWrong
            }
            MistakeKind::Zero { .. } => Code::ZeroOff,
            MistakeKind::MirrorImage { .. } => Code::AxesMirrored,
            MistakeKind::Columns(_) | MistakeKind::Reversed(_) => Code::JointOrderWrong,
            MistakeKind::Unit { .. } | MistakeKind::SlideUnit { .. } => Code::JointUnitWrong,
            MistakeKind::Coupled { .. } => Code::JointCoupled,
            MistakeKind::Rows { .. } => Code::RowsShifted,
            MistakeKind::Arms { columns: true, .. } => Code::JointOrderWrong,
            MistakeKind::Mount { .. } | MistakeKind::Cameras(_) | MistakeKind::Arms { .. } => Code::CameraMountWrong,
            MistakeKind::Mirrored(_) => Code::ImagesMirrored,
            MistakeKind::Lengths { .. } => Code::LinkLengthsWrong,
            MistakeKind::PlateSize { .. } => Code::PlatePitchWrong,
            MistakeKind::MeasuredUnit(_) => Code::MeasuredUnit,
            MistakeKind::Poses { code, .. } => *code,
        }
    }

    fn weight(&self) -> Weight {
        Weight::Refusal
    }

    fn subjects(&self) -> Vec<Subject> {
        if let Some(ShiftedPart { first, last, .. }) = self.part() {
            let subject = if self.by_images { Subject::Image } else { Subject::Stop };
            return [first, last].into_iter().cloned().map(subject).collect();
        }
        let joints = |joints: &[String]| joints.iter().cloned().map(Subject::Joint).collect::<Vec<_>>();
        let of = || vec![Subject::Body(self.of.clone())];
        match &self.kind {
            MistakeKind::MirrorImage { joints: mirrored, .. } | MistakeKind::Mirrored(mirrored) => {
                [of(), joints(mirrored)].concat()
            }
            _ if self.joints().is_empty() => of(),
            _ => joints(self.joints()),
        }
    }

    fn quantities(&self) -> Vec<Quantity> {
        let mut all = vec![Quantity::new("misfit", self.misfit, "rad + m")];
        all.extend(self.misfit_undone.map(|left| Quantity::new("misfit_undone", left, "rad + m")));
        all.extend(self.part().map(|part| Quantity::new("images_shifted", part.images as f64, "1")));
        match self.kind {
            MistakeKind::Lengths { angle_rad, distance_m, .. } => {
                all.extend([Quantity::new("angle", angle_rad, "rad"), Quantity::new("distance", distance_m, "m")]);
            }
            MistakeKind::Zero { lacking_deg, .. } => all.push(Quantity::new("offset", lacking_deg.to_radians(), "rad")),
            MistakeKind::PlateSize { scale, pitch_m } => {
                all.extend([Quantity::new("plate_size", scale, "1"), Quantity::new("pitch", scale * pitch_m, "m")]);
            }
            _ => {}
        }
        all
    }

    fn place(&self) -> String {
        if let Some(ShiftedPart { first, .. }) = self.part() {
            return first.clone();
        }
        match self.joints() {
            [] => self.of.clone(),
            joints => joints.join(", "),
        }
    }

    fn seen(&self) -> String {
        self.in_words(if self.by_images { "image" } else { "measurement" })
    }

    fn remedy(&self) -> String {
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
            MistakeKind::Rows { part: Some(ShiftedPart { first, last, to_the_end, .. }), .. } => format!(
                "look for a row that was lost or written twice before {first}, and shift {} by one row from there on{};{} of a recording, see --image-delay and --clock log",
                self.rows_of.names(),
                if *to_the_end { String::new() } else { format!(" to {last}") },
                self.rows_of.reason()
            ),
            MistakeKind::Rows { columns, .. } if columns.is_empty() => format!(
                "shift {} by one row;{} of a recording, see --image-delay and --clock log",
                self.rows_of.names(),
                self.rows_of.reason()
            ),
            MistakeKind::Rows { columns, below, .. } => format!(
                "shift the columns {} of joints.csv one row {}, and see how they were recorded",
                columns.join(", "),
                if *below { "up" } else { "down" }
            ),
            MistakeKind::Mount { mount, camera } => {
                let word = if *mount == CameraMount::Hand { "hand" } else { "fixed" };
                match camera {
                    Some(camera) => format!("write mount = \"{word}\" under the [[camera]] of name = \"{camera}\" in series.toml"),
                    None => format!("write camera_mount = \"{word}\" in series.toml (of a recording: in the .toml of its name)"),
                }
            }
            MistakeKind::Cameras([a, b]) => format!(
                "exchange the names {a} and {b} in the column camera of images.csv; if they are right, exchange what stands under their [[camera]] in series.toml"
            ),
            MistakeKind::Arms { arms: [first, second], columns, carriers } => {
                let columns = columns.then(|| {
                    let (first, second) = (first.join(", "), second.iter().rev().cloned().collect::<Vec<_>>().join(", "));
                    format!("exchange the column names {first} and {second} in joints.csv")
                });
                let carriers = carriers.then(|| {
                    "give the URDF of the arm that carries the camera with --urdf, and that of the other under [robot_2]".to_owned()
                });
                columns.into_iter().chain(carriers).collect::<Vec<_>>().join("; if they are right, ")
            }
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
                "check that the URDF is of this robot and size, with lengths in metres, and that the tip link carries the camera; zeros of parallel joints that are off against each other, as one by +90 and the next by -90 degrees, look the same: compare the robot at its zeros with the URDF".into()
            }
            MistakeKind::PlateSize { .. } => {
                "measure the plate with a ruler and correct pitch_m (of tags tag_m or marker_m) in plate.toml; if it is right, the URDF is of another size of this robot".into()
            }
            MistakeKind::MeasuredUnit(unit) => format!("multiply x_m, y_m and z_m by {}", unit.metres),
            MistakeKind::Poses { remedy, .. } => remedy.clone(),
        }
    }
}

impl Mistake {
    /// What was done wrong, by what shows it: `noun` names one of it.
    fn in_words(&self, noun: &str) -> String {
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
            MistakeKind::Rows { below, part: Some(ShiftedPart { first, last, images, to_the_end }), .. } => {
                let which = if *to_the_end { format!("from {first} on") } else { format!("from {first} to {last}") };
                format!(
                    "{which} {noun}s and joint readings are shifted by one row: {images} {noun}s fit the readings of the row {}, others their own",
                    if *below { "below" } else { "above" }
                )
            }
            MistakeKind::Rows { below, columns, part: None } => format!(
                "{noun}s and {} are shifted by one row: every {noun} fits the readings of the row {}",
                match columns.as_slice() {
                    [] => "joint readings".to_owned(),
                    some => format!("the readings of {} alone", some.join(", ")),
                },
                if *below { "below" } else { "above" }
            ),
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_measurements_show_keeps_the_names_of_the_user() {
        let [first, last] = ["image_3", "image_9"].map(str::to_owned);
        let part = Some(ShiftedPart { first, last, images: 7, to_the_end: false });
        let kinds = [
            MistakeKind::Rows { below: true, columns: Vec::new(), part },
            MistakeKind::Signs(vec!["image_3".into(), "image_9".into()]),
        ];
        for kind in kinds {
            let (of, rows_of) = ("tracker".to_owned(), RowsOf::Readings);
            let of_measurements = Mistake { kind, of, misfit: 1.0, misfit_undone: None, by_images: false, rows_of };
            let said = of_measurements.seen();
            assert!(said.contains("image_3") && said.contains("image_9"), "{said}");
            let of_images = Mistake { by_images: true, ..of_measurements };
            assert_ne!(said, of_images.seen());
        }
    }
}
