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

/// Degrees between zeros that are opposite.
pub const HALF_TURN_DEG: f64 = 180.0;

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
        self.what_to_do()
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
