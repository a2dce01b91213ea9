//! Which of the frames of a program is the one that was measured: at most one of them is.

use nalgebra::{Matrix3, Vector3};

use crate::geom::Pose;

/// Frames that differ by no more than this (m, rad) are one, written with few digits.
const ONE_FRAME: (f64, f64) = (1e-4, 1e-3);

/// A tool as it was measured on a robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MeasuredTool {
    /// Its point in the frame of the flange, m; it is turned as the program says.
    Point(Vector3<f64>),
    /// `flange_from_tool`.
    Pose(Pose),
}

impl MeasuredTool {
    pub(super) fn point(&self) -> Vector3<f64> {
        match self {
            Self::Point(point) => *point,
            Self::Pose(pose) => pose.translation,
        }
    }

    /// `flange_from_tool` where this is taken for `other`: points tell no turn, so that none is made between them.
    pub(super) fn onto(&self, other: &Self) -> Pose {
        match (self, other) {
            (Self::Pose(a), Self::Pose(b)) => *a * b.inverse(),
            _ => Pose::new(Matrix3::identity(), self.point() - other.point()),
        }
    }
}

/// Distance (m) and angle (rad) from the program's frames to the measured ones beyond which they are not the same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SameFrames {
    /// Of work objects.
    pub work: (f64, f64),
    /// Of tools.
    pub tool: (f64, f64),
    /// Of several frames of a program within them, how many times nearer than the next one the nearest must be to count as the measured one.
    pub clearly_nearer: f64,
}

/// The measured frame, and what is near it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reference {
    pose: Pose,
    /// Distance (m) and angle (rad) of what may be the same.
    limits: (f64, f64),
    /// False where only the origin was measured.
    is_turned: bool,
}

impl Reference {
    /// A measured tool.
    pub fn tool(measured: MeasuredTool, same: &SameFrames) -> Self {
        let (pose, is_turned) = match measured {
            MeasuredTool::Point(point) => (Pose::new(Matrix3::identity(), point), false),
            MeasuredTool::Pose(pose) => (pose, true),
        };
        Self { pose, limits: same.tool, is_turned }
    }

    /// A measured work object.
    pub fn work(measured: Pose, same: &SameFrames) -> Self {
        Self { pose: measured, limits: same.work, is_turned: true }
    }

    /// Angle (rad) and distance (m) between two frames, by what was measured of them.
    fn apart(&self, a: &Pose, b: &Pose) -> (f64, f64) {
        let (rad, m) = a.distance(b);
        (if self.is_turned { rad } else { 0.0 }, m)
    }

    /// How near a frame is, 1 at the limits.
    fn nearness(&self, own: &Pose) -> f64 {
        let (rad, m) = self.apart(own, &self.pose);
        (m / self.limits.0).max(rad / self.limits.1)
    }

    fn are_one(&self, a: &Pose, b: &Pose) -> bool {
        let (rad, m) = self.apart(a, b);
        m < ONE_FRAME.0 && rad < ONE_FRAME.1
    }
}

/// Frames of a program beside a measured one.
#[derive(Debug, Clone)]
pub(super) enum Candidates {
    /// Nothing was measured.
    Unmeasured,
    /// One of them may be the measured one, or none.
    Alone(Reference),
    /// Of several, this one is the measured one: stated as that, or clearly the nearest.
    One(Reference, Pose, Chosen),
    /// Any of several may be: how far off the nearest two are, m.
    Several(Reference, [f64; 2]),
}

/// Why one of several frames is the measured one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Chosen {
    Stated,
    Nearest,
}

/// Why a frame is not the measured one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum NotMeasured {
    /// Angle (rad) and distance (m) are beyond the limits.
    Apart(f64, f64),
    /// Another one is stated as that, at this distance, m.
    OtherStated(f64),
    /// Another one is nearer: their distances, m.
    OtherNearer(f64, f64),
    /// Others are about as near: the nearest two distances, m.
    Unclear([f64; 2]),
}

impl Candidates {
    /// Of all frames of a program; `stated` is the one that the user says was measured.
    pub fn of(frames: &[Pose], reference: Option<Reference>, stated: Option<Pose>, clearly_nearer: f64) -> Self {
        let Some(reference) = reference else { return Self::Unmeasured };
        let mut near: Vec<Pose> = Vec::new();
        for frame in frames.iter().chain(&stated).filter(|frame| reference.nearness(frame) <= 1.0) {
            if !near.iter().any(|known| reference.are_one(known, frame)) {
                near.push(*frame);
            }
        }
        near.sort_by(|a, b| reference.nearness(a).total_cmp(&reference.nearness(b)));
        let is_stated = |frame: &&Pose| stated.is_some_and(|stated| reference.are_one(frame, &stated));
        match (near.iter().find(is_stated), near.as_slice()) {
            (_, [] | [_]) => Self::Alone(reference),
            (Some(stated), _) => Self::One(reference, *stated, Chosen::Stated),
            (None, [first, second, ..]) if reference.nearness(first) * clearly_nearer < reference.nearness(second) => {
                Self::One(reference, *first, Chosen::Nearest)
            }
            (None, [first, second, ..]) => {
                Self::Several(reference, [first, second].map(|frame| reference.apart(frame, &reference.pose).1))
            }
        }
    }

    /// Whether a frame is the measured one.
    pub fn check(&self, own: &Pose) -> Result<(), NotMeasured> {
        let (Self::Alone(reference) | Self::One(reference, ..) | Self::Several(reference, _)) = self else {
            return Ok(());
        };
        let (rad, m) = reference.apart(own, &reference.pose);
        if reference.nearness(own) > 1.0 {
            return Err(NotMeasured::Apart(rad, m));
        }
        match self {
            Self::One(_, one, chosen) if !reference.are_one(own, one) => Err(match chosen {
                Chosen::Stated => NotMeasured::OtherStated(reference.apart(own, one).1),
                Chosen::Nearest => NotMeasured::OtherNearer(m, reference.apart(one, &reference.pose).1),
            }),
            Self::Several(_, nearest) => Err(NotMeasured::Unclear(*nearest)),
            _ => Ok(()),
        }
    }
}

impl NotMeasured {
    /// The sentence, of a tool or a work object that an option states.
    pub fn in_words(self, what: &str, option: &str) -> String {
        match self {
            Self::Apart(rad, m) => format!(
                "its {what} lies {:.1} mm and {:.1} degrees from the measured one: another {what}",
                1e3 * m,
                rad.to_degrees()
            ),
            Self::OtherStated(m) => {
                format!("its {what} lies {:.1} mm from that of {option}, which is the measured one", 1e3 * m)
            }
            Self::OtherNearer(own, nearest) => format!(
                "its {what} lies {:.1} mm from the measured one, and another {what} of the program {:.1} mm: that one was measured (if not, state the one that was with {option})",
                1e3 * own,
                1e3 * nearest
            ),
            Self::Unclear([first, second]) => format!(
                "two {what}s of the program lie {:.1} and {:.1} mm from the measured one: state the one that was measured with {option}",
                1e3 * first,
                1e3 * second
            ),
        }
    }
}
