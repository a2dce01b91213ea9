//! Which joint errors a model of the robot has.

/// Which joint terms are fitted beside twists.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RobotModel {
    /// Joint offsets.
    Rigid,
    /// Offsets, gear scale, two harmonics.
    Gear,
    /// Offsets, gravity of the joints that carry the arm; of all joints where masses are known.
    Sag,
    /// All of these.
    GearSag,
    /// All of these, gravity of all joints, and backlash.
    Full,
    /// The largest of these that no other beats by evidence.
    Auto,
}

impl RobotModel {
    /// Those among which the data choose.
    pub const CHOICES: [Self; 5] = [Self::Rigid, Self::Gear, Self::Sag, Self::GearSag, Self::Full];

    /// Which errors it has beside offsets, or may have: gears, sag of the arm, and what only the largest has.
    const fn errors(self) -> [bool; 3] {
        match self {
            Self::Rigid => [false, false, false],
            Self::Gear => [true, false, false],
            Self::Sag => [false, true, false],
            Self::GearSag => [true, true, false],
            Self::Full | Self::Auto => [true, true, true],
        }
    }

    /// True where it has all terms of another.
    pub(in crate::model) fn contains(self, other: Self) -> bool {
        self.errors().into_iter().zip(other.errors()).all(|(own, other)| own || !other)
    }

    /// True where it has gears, or may have them.
    pub const fn has_gears(self) -> bool {
        self.errors()[0]
    }

    /// Its name in options and files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rigid => "rigid",
            Self::Gear => "gear",
            Self::Sag => "sag",
            Self::GearSag => "gear-sag",
            Self::Full => "full",
            Self::Auto => "auto",
        }
    }

    /// What it is, for people.
    pub fn title(self) -> &'static str {
        match self {
            Self::Rigid => "rigid robot model",
            Self::Gear => "robot model with gears",
            Self::Sag => "robot model with sag",
            Self::GearSag => "robot model with gears and sag",
            Self::Full => "full robot model",
            Self::Auto => "robot model by evidence",
        }
    }
}
