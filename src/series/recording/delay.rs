//! How late the pictures are: what they show changes when the joints move.
//!
//! The difference of two pictures in a row is `a + b m / (m + s)`, where `m` is how far the joints moved between them, the delay
//! taken off. The delay and the scale `s` are those that explain most of the variance of the differences.

use std::collections::BTreeMap;
use std::path::Path;

use image::DynamicImage;

use super::frame::Frame;
use super::message::Message;
use super::messages;
use super::motion::{Posture, Standstill, moved};
use super::options::RecordingOptions;
use super::scan::time_ns;
use crate::error::{Code, Notice};

const MS: i64 = 1_000_000;
/// Longest delay that is looked for, ns: beside none, and beside what the times of arrival tell.
const REACH_NS: i64 = 2_000 * MS;
/// Delays by the times of arrival beyond which these are no guess any more, ns.
const LONGEST_GUESS_NS: i64 = 60_000 * MS;
/// Pictures that are compared are at least so far apart, ns: more would say the same.
const LEAST_STEP_NS: i64 = 40 * MS;
/// Pictures farther apart are not compared, ns: a whole motion would fit between them.
const LONGEST_STEP_NS: i64 = 250 * MS;
/// Most pictures that are compared, and least.
const PICTURES: std::ops::RangeInclusive<usize> = 40..=800;
/// Memory of all pictures that are decoded for this, one after the other, bytes.
const MOST_DECODED: u64 = 64 << 30;
/// Longest side of the reduced pictures that are compared, px.
const SIDE_PX: u32 = 64;
/// Motions that change a picture by half of the most that it can change, rad or m.
const SCALES: [f64; 6] = [1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3];
/// Least share of the variance that motion must explain.
const LEAST_EXPLAINED: f64 = 0.5;
/// Another delay that explains nearly as much: by this factor.
const NEARLY: f64 = 0.9;
/// Delays that are closer belong to one maximum, ns.
const APART_NS: i64 = 250 * MS;
/// Parts of the recording that are left out in turn for the uncertainty.
const PARTS: usize = 16;
/// A delay counts when it is so many times its standard deviation.
const CERTAIN: f64 = 4.0;

/// A delay that was measured.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Delay {
    /// From what a picture shows to its stamp, by the clock of the joints, s.
    pub delay_s: f64,
    /// Its standard deviation, s.
    pub sigma_s: f64,
}

/// The delay for which the times of arrival speak.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Guess {
    /// As [`Delay::delay_s`], ns.
    delay_ns: i64,
}

impl Guess {
    /// As times of arrival and stamps tell it together, s.
    pub fn of_arrival(delay_s: f64) -> Self {
        let delay_ns = (1e9 * delay_s).round() as i64;
        Self { delay_ns: if delay_ns.abs() > LONGEST_GUESS_NS { 0 } else { delay_ns } }
    }

    /// Delays that are looked for.
    fn reach(self) -> std::ops::RangeInclusive<i64> {
        self.delay_ns.min(0) - REACH_NS..=self.delay_ns.max(0) + REACH_NS
    }

    /// How far a delay is from none and from this guess, whichever is nearer, ns.
    fn distance(self, delay_ns: i64) -> i64 {
        delay_ns.abs().min((delay_ns - self.delay_ns).abs())
    }
}

impl Delay {
    pub(super) fn notice(self, recording: &Path) -> Notice {
        let side = if self.delay_s < 0.0 { "after" } else { "before" };
        let what = format!(
            "the images show where the joints were {:.1} +- {:.1} ms {side} their stamps, as motion in the images tells",
            1e3 * self.delay_s.abs(),
            1e3 * self.sigma_s
        );
        let remedy = "the delay is taken off; --image-delay 0 takes the stamps as they are";
        Notice::new(Code::ImageDelayFound, recording.display(), what, remedy)
    }
}

/// Said where the delay cannot be measured.
pub(super) fn unchecked(recording: &Path) -> Notice {
    let what = format!(
        "whether the images are late could not be checked: it takes {} images about motions of a robot that stops, not more than {} s apart, \
         that change with the motion",
        PICTURES.start(),
        1e-9 * LONGEST_STEP_NS as f64
    );
    let remedy =
        "take 5 images a second or more while the robot drives, too, or state the delay (--image-delay SECONDS)";
    Notice::new(Code::ImageDelayUnchecked, recording.display(), what, remedy)
}

/// Two pictures in a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair {
    pub from_ns: i64,
    pub to_ns: i64,
    /// Mean difference, in parts of the mean brightness.
    pub difference: f64,
}

/// Reduced pictures of the wanted times, as they pass by.
pub(super) struct Frames {
    wanted: Vec<i64>,
    reduced: BTreeMap<i64, Vec<f32>>,
    decoded: u64,
}

impl Frames {
    /// The pictures about motions, evenly spread over the recording; `None` where there are too few.
    pub fn about_motions(times: &[i64], still: &[Standstill], guess: Guess) -> Option<Self> {
        let mut thinned: Vec<i64> = Vec::new();
        for time in times {
            if thinned.last().is_none_or(|last| time - last >= LEAST_STEP_NS) {
                thinned.push(*time);
            }
        }
        let mut motions: Vec<(i64, i64)> = still.windows(2).map(|w| (w[0].to_ns, w[1].from_ns)).collect();
        if motions.is_empty() {
            motions.push((*times.first()?, *times.last()?));
        }
        let (least, most) = guess.reach().into_inner();
        let about = |every: usize| -> Vec<i64> {
            let near =
                |t: &&i64| motions.iter().step_by(every).any(|(from, to)| (from + least..=to + most).contains(*t));
            thinned.iter().filter(near).copied().collect()
        };
        let all = about(1);
        let mut wanted = about(all.len().div_ceil(*PICTURES.end()).max(1));
        wanted.truncate(*PICTURES.end());
        let close = wanted.windows(2).filter(|w| w[1] - w[0] <= LONGEST_STEP_NS).count();
        (close >= *PICTURES.start()).then(|| Self { wanted, reduced: BTreeMap::new(), decoded: 0 })
    }

    /// Looks at a message of the images; one that cannot be read is left out.
    pub fn take(&mut self, message: &Message<'_>, options: &RecordingOptions) {
        let Some(stamp_ns) = messages::stamp_in(message.data, options.image_frame.as_deref()) else { return };
        let time = time_ns(stamp_ns, message, options.clock);
        if self.wanted.binary_search(&time).is_err() || self.reduced.contains_key(&time) {
            return;
        }
        let Ok(frame) = Frame::read(message) else { return };
        self.decoded += frame.decoded_bytes();
        if self.decoded <= MOST_DECODED
            && let Ok(picture) = frame.decode()
        {
            self.reduced.insert(time, reduced(&picture));
        }
    }

    pub fn pairs(&self) -> Vec<Pair> {
        let pair = |w: &[i64]| {
            let (one, other) = (self.reduced.get(&w[0])?, self.reduced.get(&w[1])?);
            if w[1] - w[0] > LONGEST_STEP_NS || one.len() != other.len() {
                return None;
            }
            let sum: f64 = one.iter().zip(other).map(|(a, b)| f64::from((a - b).abs())).sum();
            Some(Pair { from_ns: w[0], to_ns: w[1], difference: sum / one.len() as f64 })
        };
        self.wanted.windows(2).filter_map(pair).collect()
    }
}

/// A small picture of mean brightness 1.
fn reduced(picture: &DynamicImage) -> Vec<f32> {
    let side = SIDE_PX.min(picture.width().max(picture.height()));
    let small = picture.thumbnail(side, side).into_luma16().into_raw();
    let mean = small.iter().map(|v| f32::from(*v)).sum::<f32>() / small.len().max(1) as f32;
    small.iter().map(|v| f32::from(*v) / mean.max(1.0)).collect()
}

/// The delay of the pictures, where the motion tells it.
pub(super) fn measured(pairs: &[Pair], postures: &[Posture], guess: Guess) -> Option<Delay> {
    if pairs.len() < *PICTURES.start() {
        return None;
    }
    let coarse = Search::new(pairs, postures, guess.reach().step_by(10 * MS as usize));
    let (best, explained) = coarse.nearest_maximum(guess)?;
    if explained < LEAST_EXPLAINED {
        return None;
    }
    let fine = Search::new(pairs, postures, (best - 60 * MS..=best + 60 * MS).step_by(MS as usize));
    let delay_s = fine.best(None)?;
    let left_out = (0..PARTS).map(|part| fine.best(Some(part))).collect::<Option<Vec<f64>>>()?;
    let mean = left_out.iter().sum::<f64>() / PARTS as f64;
    let scatter: f64 = left_out.iter().map(|d| (d - mean).powi(2)).sum();
    // The jackknife, and the step of the search.
    let variance = scatter * (PARTS - 1) as f64 / PARTS as f64 + (1e-9 * MS as f64).powi(2) / 12.0;
    Some(Delay { delay_s, sigma_s: variance.sqrt() })
}

impl Delay {
    /// True where it is longer than half the time from picture to picture, and certain.
    pub(super) fn is_notable(self, pairs: &[Pair]) -> bool {
        let mut steps: Vec<i64> = pairs.iter().map(|p| p.to_ns - p.from_ns).collect();
        steps.sort_unstable();
        let half_step_s = steps.get(steps.len() / 2).map_or(0.0, |ns| 0.5e-9 * *ns as f64);
        self.delay_s.abs() > half_step_s.max(CERTAIN * self.sigma_s)
    }
}

/// Motions between the pictures for every delay that is tried.
struct Search<'a> {
    pairs: &'a [Pair],
    /// Delays, ns, and how far the joints moved between the pictures of every pair.
    tried: Vec<(i64, Vec<Option<f64>>)>,
}

impl<'a> Search<'a> {
    fn new(pairs: &'a [Pair], postures: &[Posture], delays: impl Iterator<Item = i64>) -> Self {
        let motions = |d: i64| pairs.iter().map(|p| moved(postures, p.from_ns - d, p.to_ns - d)).collect();
        Self { pairs, tried: delays.map(|d| (d, motions(d))).collect() }
    }

    /// Share of the variance that a delay explains with its best scale, without one part of the recording.
    fn explained(&self, k: usize, without: Option<usize>) -> f64 {
        let part = |i: usize| i * PARTS / self.pairs.len();
        let seen: Vec<(f64, f64)> = (self.tried[k].1.iter().zip(self.pairs).enumerate())
            .filter(|(i, _)| without != Some(part(*i)))
            .filter_map(|(_, (m, pair))| Some(((*m)?, pair.difference)))
            .collect();
        if 2 * seen.len() < self.pairs.len() {
            return 0.0;
        }
        SCALES.iter().map(|s| determination(&seen, *s)).fold(0.0, f64::max)
    }

    /// The delay that explains most, ns, and how much; of several that explain nearly as much, as cycles of equal length do, the
    /// one nearest to none or to the guess, if no other is nearly as near.
    fn nearest_maximum(&self, guess: Guess) -> Option<(i64, f64)> {
        let all: Vec<(i64, f64)> = (0..self.tried.len()).map(|k| (self.tried[k].0, self.explained(k, None))).collect();
        let most = all.iter().map(|(_, e)| *e).fold(0.0, f64::max);
        let is_maximum = |k: &usize| {
            let about = all.iter().filter(|(d, _)| (d - all[*k].0).abs() < APART_NS);
            all[*k].1 > 0.0 && all[*k].1 >= NEARLY * most && about.clone().all(|(_, e)| *e <= all[*k].1)
        };
        let mut maxima: Vec<(i64, f64)> = (0..all.len()).filter(is_maximum).map(|k| all[k]).collect();
        maxima.sort_by_key(|(delay, _)| guess.distance(*delay));
        match maxima[..] {
            [] => None,
            [first, second, ..] if guess.distance(second.0) < 2 * guess.distance(first.0) => None,
            [first, ..] => Some(first),
        }
    }

    /// The delay that explains most, between the steps, s; `None` at the end of what was tried.
    fn best(&self, without: Option<usize>) -> Option<f64> {
        let all: Vec<f64> = (0..self.tried.len()).map(|k| self.explained(k, without)).collect();
        let k = (0..all.len()).reduce(|a, b| if all[b] > all[a] { b } else { a })?;
        let (before, after) = (*all.get(k.checked_sub(1)?)?, *all.get(k + 1)?);
        let curvature = before - 2.0 * all[k] + after;
        let share = if curvature < 0.0 { 0.5 * (before - after) / curvature } else { 0.0 };
        Some(1e-9 * (self.tried[k].0 as f64 + share * MS as f64))
    }
}

/// Squared correlation of differences with `m / (m + scale)`; 0 where more motion goes with less difference.
fn determination(seen: &[(f64, f64)], scale: f64) -> f64 {
    let n = seen.len() as f64;
    let x = |m: f64| m / (m + scale);
    let (mean_x, mean_y) = (seen.iter().map(|s| x(s.0)).sum::<f64>() / n, seen.iter().map(|s| s.1).sum::<f64>() / n);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (m, difference) in seen {
        let (dx, dy) = (x(*m) - mean_x, difference - mean_y);
        xx += dx * dx;
        xy += dx * dy;
        yy += dy * dy;
    }
    let defined = xx > 0.0 && yy > 0.0 && xy > 0.0;
    if defined { xy * xy / (xx * yy) } else { 0.0 }
}
