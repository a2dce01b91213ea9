//! Images that were taken while the robot moved: what is not known of their times is not known of their readings.

use super::motion::{Posture, Standstill, interpolate};
use crate::error::{Code, Error, Notice, Result};

/// Farthest by which a reading may be off for the uncertainty of the time of its image (one standard deviation), rad or m: what the worst
/// joints of an uncalibrated robot have as errors.
const MOST_OFF: f64 = 5e-3;

/// Images between the standstills.
#[derive(Debug, Default)]
pub(super) struct Moving {
    /// Times of those that are taken, ns.
    pub taken: Vec<i64>,
    left_out: usize,
    /// Largest uncertainty of a reading among those that are taken, rad or m.
    worst: f64,
}

impl Moving {
    /// Images at least `interval_s` apart whose readings are known well enough; `sigma_s`: standard deviation of their delay, s, where
    /// this is known.
    ///
    /// # Errors
    /// A delay of which nothing is known: the joints were anywhere near.
    pub fn of(
        place: &str,
        (postures, still): (&[Posture], &[Standstill]),
        times: &[i64],
        interval_s: f64,
        sigma_s: Option<f64>,
    ) -> Result<Self> {
        let mut moving = Self::default();
        let outside = |t: &i64| still.iter().all(|s| !(s.from_ns..=s.to_ns).contains(t));
        for time in times.iter().copied().filter(outside) {
            let Some(joints) = interpolate(postures, time) else { continue };
            let last = moving.taken.last().copied().unwrap_or(i64::MIN);
            if time.saturating_sub(last) < (interval_s * 1e9) as i64 {
                continue;
            }
            // No number where a given delay meets a speed that is not known: it counts as given.
            let off = sigma_s.ok_or_else(|| unknown(place, still, times))? * joints.speed;
            if off > MOST_OFF {
                moving.left_out += 1;
                continue;
            }
            moving.worst = moving.worst.max(off);
            moving.taken.push(time);
        }
        Ok(moving)
    }

    /// What the uncertainty of the delay makes of the readings; none where the delay is given.
    pub fn notice(&self, place: &str, sigma_s: Option<f64>) -> Option<Notice> {
        let sigma_s = sigma_s.filter(|sigma_s| *sigma_s > 0.0)?;
        let mut what = format!(
            "the delay of the images is known to {:.1} ms: the readings of {} images in motion are uncertain by up to {:.1} mrad (mm)",
            1e3 * sigma_s,
            self.taken.len(),
            1e3 * self.worst
        );
        if self.left_out > 0 {
            let more = 1e3 * MOST_OFF;
            what += &format!(
                "; {} images of faster motions, uncertain by more than {more} mrad (mm), are left out",
                self.left_out
            );
        }
        Some(Notice::new(Code::ImagesInMotion, place, what, REMEDY))
    }
}

const REMEDY: &str = "state the delay where it is known (--image-delay SECONDS), or move slowly while images are taken";

/// Motions between standstills tell the delay, and not those of a robot that drives on at one speed: the pictures change alike all the time.
fn unknown(place: &str, still: &[Standstill], times: &[i64]) -> Error {
    let span_s = times.first().zip(times.last()).map_or(0.0, |(from, to)| 1e-9 * (to - from) as f64);
    let what = format!(
        "images are to be taken in motion, and what they show does not tell their delay: where the robot was at an image is not known ({} images in {span_s:.0} s, {} \
         standstills of the robot)",
        times.len(),
        still.len()
    );
    let remedy = "state the delay (--image-delay SECONDS, 0 where the stamps are right), or let the robot stand for a second or more between motions, \
                  with 5 images a second or more all the time: begin and end of motions tell it";
    Error::new(Code::ImageDelayUnchecked, place, what, remedy)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Joints every 10 ms that move at 0.2, 1.0 and 5.0 rad/s for a second each.
    fn postures() -> Vec<Posture> {
        let mut position = 0.0;
        let of = |k: i64| {
            let posture = Posture { time_ns: k * 10_000_000, positions: vec![position], oldest_ns: 0 };
            position += 0.01 * [0.2, 1.0, 5.0][(k / 100).min(2) as usize];
            posture
        };
        (0..301).map(of).collect()
    }

    #[test]
    fn what_is_not_known_of_the_delay_is_not_known_of_the_readings() {
        let (postures, times) = (postures(), (0..=30).map(|k| k * 100_000_000).collect::<Vec<i64>>());
        let of = |sigma_s| Moving::of("run", (&postures, &[]), &times, 0.1, sigma_s);
        let counted = |sigma_s: f64| of(Some(sigma_s)).map(|m| (m.taken.len(), m.left_out)).unwrap();
        // 2 ms are 10 mrad at 5 rad/s, 2 mrad at 1 rad/s, and 6 mrad at 2 s, where the joint comes to move faster.
        let moving = of(Some(2e-3)).unwrap();
        assert_eq!((moving.taken.len(), moving.left_out), (20, 11));
        assert!((moving.worst - 2e-3).abs() < 1e-9, "{}", moving.worst);
        assert_eq!(moving.notice("run", Some(2e-3)).map(|n| n.code), Some(Code::ImagesInMotion));
        assert_eq!(counted(0.0), (31, 0));
        assert!(of(Some(0.0)).unwrap().notice("run", Some(0.0)).is_none());
        let unknown = of(None).unwrap_err();
        assert_eq!(unknown.code, Code::ImageDelayUnchecked);
        // words: what was there.
        assert!(
            ["31 images in 3 s", "0 standstills"].iter().all(|there| unknown.what.contains(there)),
            "{}",
            unknown.what
        );
        let standing = Standstill { from_ns: 0, to_ns: 3_000_000_000 };
        assert!(Moving::of("run", (&postures, &[standing]), &times, 0.1, None).unwrap().taken.is_empty());
    }
}
