//! How far off something may be before it is left out.

/// Bounds on what belongs to the others; the limits say where each comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Normalised length of the residual of an observation.
    pub observation: f64,
    /// The same below which one that was left out comes back.
    pub observation_back: f64,
    /// Joint error of an image or measurement, in robust sigmas per joint.
    pub joint_error: f64,
    /// Smallest robust sigma of a joint that is believed there, rad or m.
    pub joint_sigma: f64,
    /// Length of the residual of a point, and of a pose, in sigmas.
    pub body: [f64; 2],
}

impl Bounds {
    /// That of an observation that takes part, or was left out.
    pub const fn of_observation(&self, is_out: bool) -> f64 {
        if is_out { self.observation_back } else { self.observation }
    }

    /// That of a point or a pose that takes part, or was left out: it comes back as far below as an observation does.
    pub fn of_body(&self, is_pose: bool, is_out: bool) -> f64 {
        let bound = self.body[usize::from(is_pose)];
        if is_out { bound * self.observation_back / self.observation } else { bound }
    }
}
