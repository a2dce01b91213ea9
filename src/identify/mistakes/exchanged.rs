//! Two coordinates of positions that stand in each other's column.

use crate::geom::Pose;

/// The columns of a position.
const COLUMNS: [&str; 3] = ["x_m", "y_m", "z_m"];

/// Two of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::identify) struct Exchanged(usize, usize);

impl Exchanged {
    /// Every two.
    pub const ALL: [Self; 3] = [Self(0, 1), Self(0, 2), Self(1, 2)];

    /// The pose with each of the two coordinates in its own column.
    pub fn undone(self, mut pose: Pose) -> Pose {
        pose.translation.swap_rows(self.0, self.1);
        pose
    }

    /// What is wrong.
    pub fn what(self) -> String {
        format!("{} stand in each other's column", self.columns())
    }

    /// What to do.
    pub fn remedy(self) -> String {
        format!("exchange the columns {}", self.columns())
    }

    fn columns(self) -> String {
        format!("{} and {}", COLUMNS[self.0], COLUMNS[self.1])
    }
}
