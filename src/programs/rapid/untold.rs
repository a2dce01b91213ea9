//! Frames that the text does not tell, and whether those that the user states stand for them.

use crate::geom::Pose;
use crate::programs::program::{StatedFrame, Understood};
use crate::programs::reason::Why;

/// Why a frame is not known.
pub(super) enum Untold {
    /// The text does not tell it: the one that the user states stands for it.
    Nowhere(Why),
    /// One of several, or perhaps none: no other stands for it.
    Several(Why),
    /// It is none of the robot, or none that stands still: no other stands for it.
    Elsewhere(Why),
}

impl Untold {
    /// The frame that the user states, where it stands for this one.
    pub fn or_stated(self, stated: Option<Pose>) -> Understood<Pose> {
        match self {
            Self::Nowhere(why) => stated.ok_or(why),
            Self::Several(why) | Self::Elsewhere(why) => Err(why),
        }
    }
}

/// A frame of the text, or the stated one, beside that which stands where none was chosen.
pub(super) fn beside(none: &Pose, known: Result<Pose, Untold>, stated: Option<Pose>) -> StatedFrame {
    match known {
        Err(Untold::Elsewhere(_)) => StatedFrame::Elsewhere,
        Err(Untold::Several(_)) => StatedFrame::Several,
        known => StatedFrame::beside(none, known.ok().or(stated)),
    }
}
