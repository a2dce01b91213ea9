//! How much later images are stamped than joint readings: by times of arrival, by what the user says, and by what the images show.

use std::path::Path;

use super::delay::{self, Delay, Frames, Guess};
use super::file::for_each;
use super::motion::{Posture, standstills};
use super::options::{Clock, Motion, RecordingOptions};
use super::scan::Scan;
use crate::error::{Code, Notice, Result};

/// Delays of images and joints that differ by more deserve a look, s.
const NOTABLE_DELAY_S: f64 = 0.05;

/// How late the images of a recording are.
pub(super) struct Lateness {
    /// What is known of it.
    pub told: KnownDelay,
    /// How much longer images take from stamp to recording than joint readings (median), s.
    pub image_delay_s: f64,
    /// How much that grows from begin to end, s.
    growth_s: f64,
    /// True where stamps and times of arrival contradict each other, and the images do not tell which is right.
    pub is_open: bool,
}

impl Lateness {
    /// Of the images of a topic beside the joint readings of others.
    ///
    /// # Errors
    /// A file that cannot be read again.
    pub fn of(
        scan: &Scan,
        (image_topic, topics): (&str, &[String]),
        (postures, times): (&[Posture], &[i64]),
        options: &RecordingOptions,
    ) -> Result<Self> {
        let image_delay_s = scan.delay_s(&[image_topic.to_owned()]) - scan.delay_s(topics);
        let guess = match options.clock {
            Clock::Stamp => Guess::of_arrival(-image_delay_s),
            Clock::Log => Guess::of_arrival(image_delay_s),
        };
        let told = match options.image_delay_s {
            Some(delay_s) => KnownDelay::By(delay_s),
            None => told_by_motion(scan, image_topic, (postures, times), guess, options)?,
        };
        let is_open =
            told == KnownDelay::Open && options.clock == Clock::Stamp && image_delay_s.abs() > NOTABLE_DELAY_S;
        let growth_s = scan.delay_growth_s(image_topic) - scan.delay_growth_s(&topics[0]);
        Ok(Self { told, image_delay_s, growth_s, is_open })
    }

    /// In the time of the images, the joints were there so much later, ns.
    pub fn later_ns(&self) -> i64 {
        match self.told {
            KnownDelay::By(delay_s) | KnownDelay::Found(Delay { delay_s, .. }) => nanoseconds(delay_s),
            KnownDelay::NoDelay | KnownDelay::Open => 0,
        }
    }

    /// And so much later still, if times of arrival are right, ns.
    pub fn open_ns(&self) -> i64 {
        if self.is_open { nanoseconds(-self.image_delay_s) } else { 0 }
    }

    /// What the user should know of it.
    pub fn notices(&self, recording: &Path) -> Vec<Notice> {
        let mut notices = Vec::new();
        if self.growth_s.abs() > NOTABLE_DELAY_S {
            notices.push(run_apart(recording, self.growth_s));
        } else if self.is_open {
            let what = format!(
                "{}, and motion in the images does not tell which is right: images are taken where the robot stands still by either",
                delayed(self.image_delay_s)
            );
            notices.push(Notice::new(Code::ImagesDelayed, recording.display(), what, OTHER_CLOCK));
        }
        notices.extend((self.told == KnownDelay::Open && !self.is_open).then(|| delay::unchecked(recording)));
        notices
    }
}

/// What is known of the delay of the images.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum KnownDelay {
    /// It is given, s.
    By(f64),
    /// What the images show tells it.
    Found(Delay),
    /// What the images show tells that there is none that matters to a robot that stands.
    NoDelay,
    /// The images do not tell it.
    Open,
}

impl KnownDelay {
    pub fn late(self) -> Option<Delay> {
        match self {
            Self::Found(delay) => Some(delay),
            _ => None,
        }
    }

    /// Standard deviation of the delay that is taken off, s; none where nothing is known of it.
    pub fn sigma_s(self) -> Option<f64> {
        match self {
            Self::By(_) => Some(0.0),
            Self::Found(delay) => Some(delay.sigma_s),
            Self::NoDelay | Self::Open => None,
        }
    }
}

/// The delay of the images by what they show.
fn told_by_motion(
    scan: &Scan,
    topic: &str,
    (postures, times): (&[Posture], &[i64]),
    guess: Guess,
    options: &RecordingOptions,
) -> Result<KnownDelay> {
    let still = standstills(postures, options.still_speed, nanoseconds(options.least_still_s));
    let Some(mut frames) = Frames::about_motions(times, &still, guess) else { return Ok(KnownDelay::Open) };
    for file in &scan.files {
        for_each(file, |message| {
            if message.topic == topic {
                frames.take(&message, options);
            }
            Ok(())
        })?;
    }
    let pairs = frames.pairs();
    Ok(match delay::measured(&pairs, postures, guess) {
        Some(delay) if options.motion != Motion::Refuse || delay.is_notable(&pairs) => KnownDelay::Found(delay),
        Some(_) => KnownDelay::NoDelay,
        None => KnownDelay::Open,
    })
}

/// Clocks of images and joints that run apart by so much from begin to end, s.
fn run_apart(recording: &Path, growth_s: f64) -> Notice {
    let what = format!(
        "images take {} from stamp to arrival at the end than at the beginning, joint states do not: the clocks of camera and robot run apart",
        difference(growth_s)
    );
    let remedy = "use the times of recording (--clock log), or let one clock stamp both";
    Notice::new(Code::ClocksApart, recording.display(), what, remedy)
}

/// What to do where stamps and arrival contradict each other.
pub(super) const OTHER_CLOCK: &str =
    "state the delay (--image-delay 0 where the stamps are right), or take the times of recording (--clock log)";

pub(super) fn delayed(image_delay_s: f64) -> String {
    format!("images take {} from stamp to arrival than joint states", difference(image_delay_s))
}

fn difference(s: f64) -> String {
    format!("{:.3} s {}", s.abs(), if s < 0.0 { "less" } else { "more" })
}

pub(super) fn nanoseconds(s: f64) -> i64 {
    (s * 1e9).round() as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delay_has_no_sign_in_words() {
        assert_eq!([difference(-0.18), difference(0.18)], ["0.180 s less", "0.180 s more"]);
    }
}
