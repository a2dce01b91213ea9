//! Flags for recordings.

use clap::{Args, ValueEnum};

use crate::error::{Code, Error, Result};
use crate::files::word;
use crate::series::{Clock, Motion, Picking, RecordingOptions};

/// Flags that say how a recording is read.
#[derive(Debug, Args)]
#[command(next_help_heading = "Recordings")]
pub struct RecordingArgs {
    /// Recordings: topic of the joint states, when there are several
    #[arg(long, value_name = "TOPIC")]
    joint_topic: Option<String>,
    /// Recordings: topic of the images, when there are several
    #[arg(long, value_name = "TOPIC")]
    image_topic: Option<String>,
    /// Recordings: frame_id of the images, when those of several cameras are in one topic
    #[arg(long, value_name = "FRAME")]
    image_frame: Option<String>,
    /// Recordings: whose time counts, that of the message's stamp or that of its recording
    #[arg(long, value_enum, default_value_t = ClockName::Stamp)]
    clock: ClockName,
    /// Recordings: how long before its time an image was taken [default: as motion in the images tells, where it does]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    image_delay: Option<f64>,
    /// Recordings: what stands for a standstill, its sharpest image or the average of its images
    #[arg(long, value_enum, default_value_t = PickingName::Sharpest)]
    picture: PickingName,
    /// Recordings: also take images while the robot moves, this many seconds apart
    #[arg(long, value_name = "SECONDS")]
    in_motion: Option<f64>,
}

/// Longest delay that is accepted, s.
const LONGEST_DELAY_S: f64 = 60.0;

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ClockName {
    Stamp,
    Log,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum PickingName {
    Sharpest,
    Average,
}

impl RecordingArgs {
    /// Options for these joints (empty: all that are recorded).
    pub fn options(&self, joints: &[String]) -> Result<RecordingOptions> {
        let motion = match self.in_motion {
            None => Motion::Refuse,
            Some(interval_s) if interval_s > 0.0 && interval_s.is_finite() => Motion::Accept { interval_s },
            Some(s) => {
                return Err(Error::new(
                    Code::OptionRange,
                    "--in-motion",
                    format!("{s} is no time"),
                    "give seconds, for example 0.5",
                ));
            }
        };
        if let Some(delay_s) = self.image_delay.filter(|s| s.abs() > LONGEST_DELAY_S || s.is_nan()) {
            let what = format!("{delay_s} is no delay of images");
            return Err(Error::new(Code::OptionRange, "--image-delay", what, "give seconds, for example 0.25"));
        }
        Ok(RecordingOptions {
            joints: joints.to_vec(),
            joint_topic: self.joint_topic.clone(),
            image_topic: self.image_topic.clone(),
            image_frame: self.image_frame.clone(),
            clock: if self.clock == ClockName::Log { Clock::Log } else { Clock::Stamp },
            image_delay_s: self.image_delay,
            motion,
            picking: if self.picture == PickingName::Average { Picking::Average } else { Picking::Sharpest },
            ..RecordingOptions::default()
        })
    }

    /// The flags as they are given, to be given to another command.
    pub fn given(&self) -> String {
        let topic = |flag: &str, topic: &Option<String>| topic.as_ref().map(|t| format!(" --{flag} {}", word(t)));
        let seconds = |flag: &str, seconds: Option<f64>| seconds.map(|s| format!(" --{flag} {s}"));
        let parts = [
            topic("joint-topic", &self.joint_topic),
            topic("image-topic", &self.image_topic),
            topic("image-frame", &self.image_frame),
            (self.clock == ClockName::Log).then(|| " --clock log".to_owned()),
            seconds("image-delay", self.image_delay),
            (self.picture == PickingName::Average).then(|| " --picture average".to_owned()),
            seconds("in-motion", self.in_motion),
        ];
        parts.into_iter().flatten().collect()
    }
}
