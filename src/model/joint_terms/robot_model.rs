//! Which joint errors a model of the robot has.

/// Which joint terms are fitted beside twists; each model has the terms of those before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RobotModel {
    /// Joint offsets.
    Rigid,
    /// Offsets, gear scale, two harmonics.
    Gear,
    /// All of these, gravity and backlash.
    Full,
    /// The largest of these that no smaller one beats by evidence.
    Auto,
}

impl RobotModel {
    /// Its name in options and files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rigid => "rigid",
            Self::Gear => "gear",
            Self::Full => "full",
            Self::Auto => "auto",
        }
    }

    /// What it is, for people.
    pub fn title(self) -> &'static str {
        match self {
            Self::Rigid => "rigid robot model",
            Self::Gear => "robot model with gears",
            Self::Full => "full robot model",
            Self::Auto => "robot model by evidence",
        }
    }
}
