//! What may be chosen when a recording is read.

use crate::series::AngleUnit;
use crate::urdf::{Chain, JointKind};

/// Which time of a message counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Clock {
    /// The stamp in its header: when the data were taken.
    #[default]
    Stamp,
    /// When it was recorded: for drivers whose stamps come from different clocks.
    Log,
}

/// What to do with a recording whose robot never stands still.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Motion {
    /// Refuse it.
    #[default]
    Refuse,
    /// Take images all the same, at least this many seconds apart, with joints interpolated at their stamps.
    Accept {
        /// Least time between two images, s.
        interval_s: f64,
    },
}

/// Which picture stands for a standstill.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Picking {
    /// The sharpest image.
    #[default]
    Sharpest,
    /// The mean of the images: less noise, and the noise becomes known.
    Average,
}

/// How a recording is read.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingOptions {
    /// Joints whose readings are needed; empty: all of the topic.
    pub joints: Vec<String>,
    /// Those of them that slide, where the robot is known: their readings are in m whatever the unit of angles.
    pub prismatic: Vec<String>,
    /// Unit of the angles where it is stated; else rad, in which ROS has them.
    pub joint_unit: Option<AngleUnit>,
    /// Topic of the joint states; needed when there are several.
    pub joint_topic: Option<String>,
    /// Topic of the images; needed when there are several.
    pub image_topic: Option<String>,
    /// Frame of the images (`frame_id` of their headers); needed where the images of several cameras are in one topic.
    pub image_frame: Option<String>,
    /// Which time counts.
    pub clock: Clock,
    /// How long before its time an image was taken, s; measured from the motion in the images where it is not given.
    pub image_delay_s: Option<f64>,
    /// Whether images in motion are taken.
    pub motion: Motion,
    /// Sharpest image or average.
    pub picking: Picking,
    /// Fastest joint of a robot that stands still, rad/s or m/s.
    pub still_speed: f64,
    /// Shortest standstill, s.
    pub least_still_s: f64,
}

impl Default for RecordingOptions {
    fn default() -> Self {
        Self {
            joints: Vec::new(),
            prismatic: Vec::new(),
            joint_unit: None,
            joint_topic: None,
            image_topic: None,
            image_frame: None,
            clock: Clock::Stamp,
            image_delay_s: None,
            motion: Motion::Refuse,
            picking: Picking::Sharpest,
            // Encoder noise of 0.1 mrad over the window of 0.1 s is 1 mrad/s; slow moves are above 10 mrad/s.
            still_speed: 5e-3,
            least_still_s: 0.3,
        }
    }
}

impl RecordingOptions {
    /// The same for the joints of a chain.
    #[must_use]
    pub fn of_chain(self, chain: &Chain) -> Self {
        let kinds = chain.readings.iter().zip(&chain.reading_kinds);
        let slides = kinds.filter(|(_, kind)| **kind == JointKind::Prismatic);
        Self { joints: chain.readings.clone(), prismatic: slides.map(|(joint, _)| joint.clone()).collect(), ..self }
    }
}
