//! Second pass: the pictures of the stops as they pass by, in bounded memory, and the joints at their stamps.

use std::collections::BTreeMap;
use std::path::Path;

use image::{DynamicImage, ImageFormat};
use rayon::prelude::*;

use super::cdr::Decoded;
use super::frame::Frame;
use super::message::Message;
use super::messages;
use super::motion::{Interpolated, Posture, interpolate};
use super::options::{Picking, RecordingOptions};
use super::pixels::{self, Mean};
use super::scan::time_ns;
use crate::error::{Code, Error, Notice, Result};
use crate::files::batches;
use crate::series::{DEFAULT_PLACEMENT, SeriesStop};

/// Memory of messages that wait for others of their stop, bytes.
const MOST_HELD: usize = 256 << 20;
/// Memory of pictures that are decoded at one time, bytes.
const MOST_IN_FLIGHT: u64 = 256 << 20;

/// How one stop was taken from a recording.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct StopReport {
    /// Name of its picture.
    pub image: String,
    /// Largest joint speed at its stamp, rad/s or m/s.
    pub speed: f64,
    /// From its stamp to the nearest sample of the joint whose samples are furthest, s.
    pub nearest_sample_s: f64,
    /// Pictures that were looked at.
    pub pictures: usize,
    /// Mean squared gradient of the best picture, 16-bit counts.
    pub sharpness: f64,
    /// Noise of one picture, counts; known where pictures were averaged.
    pub noise_counts: Option<f64>,
}

/// Images of a stop that differ so many times more than those of the quietest quarter of the stops show several things.
const UNLIKE: f64 = 5.0;
/// Noise below this, counts, is that of pictures without any.
const LEAST_NOISE_COUNTS: f64 = 1.0;

/// Averages of images that do not show the same.
pub(super) fn unlike(recording: &Path, reports: &[StopReport]) -> Option<Notice> {
    let mut noises: Vec<(f64, &str)> =
        reports.iter().filter_map(|r| Some((r.noise_counts?, r.image.as_str()))).collect();
    noises.sort_by(|a, b| a.0.total_cmp(&b.0));
    let usual = noises.get(noises.len() / 4)?.0.max(LEAST_NOISE_COUNTS);
    let (most, image) = *noises.last()?;
    let count = noises.iter().filter(|(noise, _)| *noise > UNLIKE * usual).count();
    let what = format!(
        "the images of {count} of {} stops differ by more than their noise, those of {image} by {most:.1} counts where {usual:.1} are usual: \
         their average mixes images that do not show the same (motion, light)",
        noises.len()
    );
    let remedy = "take the sharpest image instead of the average, and find out whether the images are late (--image-delay SECONDS)";
    (count > 0).then(|| Notice::new(Code::ImagesUnlike, recording.display(), what, remedy))
}

/// Image times that belong to one stop.
pub(super) type Group = Vec<i64>;

/// Pictures of one stop that have come so far.
#[derive(Default)]
struct Open {
    waiting: usize,
    done: bool,
    frames: Vec<(i64, Frame)>,
}

/// Gathers the wanted pictures as they pass by, and finishes a stop when its last one has come.
pub(super) struct Collector<'a> {
    stop_of: BTreeMap<i64, usize>,
    open: Vec<Open>,
    images: &'a Path,
    options: &'a RecordingOptions,
    postures: &'a [Posture],
    /// What the positions of the postures were multiplied by.
    factors: &'a [f64],
    /// Memory of the pictures that wait, bytes.
    held: usize,
    taken: Taken,
}

/// Finished stops by the time of their picture.
pub(super) type Rows = BTreeMap<i64, (SeriesStop, StopReport)>;

/// What was taken of a recording.
#[derive(Default)]
pub(super) struct Taken {
    pub rows: Rows,
    /// How many pictures could not be read, and why the first could not.
    pub malformed: Option<(usize, String)>,
}

impl Taken {
    fn reject(&mut self, reason: String) {
        self.malformed.get_or_insert((0, reason)).0 += 1;
    }
}

impl<'a> Collector<'a> {
    pub fn new(
        groups: Vec<Group>,
        images: &'a Path,
        options: &'a RecordingOptions,
        (postures, factors): (&'a [Posture], &'a [f64]),
    ) -> Self {
        let stop_of = groups.iter().enumerate().flat_map(|(i, g)| g.iter().map(move |t| (*t, i))).collect();
        let open = groups.iter().map(|g| Open { waiting: g.len(), ..Open::default() }).collect();
        Self { stop_of, open, images, options, postures, factors, held: 0, taken: Taken::default() }
    }

    pub fn take(&mut self, message: &Message<'_>) -> Result<()> {
        let frame = self.options.image_frame.as_deref();
        let Some(stamp_ns) = messages::stamp_in(message.data, frame) else { return Ok(()) };
        let time = time_ns(stamp_ns, message, self.options.clock);
        let Some(stop) = self.stop_of.remove(&time) else { return Ok(()) };
        if self.open[stop].done {
            return Ok(());
        }
        match Frame::read(message) {
            Ok(frame) => {
                self.held += frame.bytes();
                self.open[stop].frames.push((time, frame));
            }
            Err(reason) => self.taken.reject(reason),
        }
        self.open[stop].waiting -= 1;
        if self.open[stop].waiting == 0 {
            self.close(stop)?;
        }
        if self.held > MOST_HELD {
            // Pictures come in the order of time, but for a few: the stops that wait have what they need.
            self.close_all()?;
        }
        Ok(())
    }

    pub fn finish(mut self) -> Result<Taken> {
        self.close_all()?;
        Ok(self.taken)
    }

    fn close_all(&mut self) -> Result<()> {
        for stop in 0..self.open.len() {
            if !self.open[stop].frames.is_empty() {
                self.close(stop)?;
            }
        }
        Ok(())
    }

    /// Chooses or averages the pictures of a stop and writes the result.
    fn close(&mut self, stop: usize) -> Result<()> {
        self.open[stop].done = true;
        let mut frames = std::mem::take(&mut self.open[stop].frames);
        frames.sort_by_key(|(time, _)| *time);
        self.held -= frames.iter().map(|(_, frame)| frame.bytes()).sum::<usize>();
        let (seen, mean) = self.look_at(&frames);
        // The first of equally sharp ones, so that the choice does not depend on anything else.
        let Some((best, sharpness)) = seen.iter().copied().reduce(|a, b| if b.1 > a.1 { b } else { a }) else {
            return Ok(());
        };
        let averaged = mean.finish();
        let noise_counts = averaged.as_ref().map(|(_, noise)| *noise);
        let times = match averaged {
            Some(_) => seen.iter().map(|(k, _)| frames[*k].0).collect(),
            None => vec![frames[best].0],
        };
        let Some(joints) = mean_joints(self.postures, &times) else { return Ok(()) };
        let time = times[times.len() / 2];
        let image = match (averaged, frames[best].1.file()) {
            (Some((mean, _)), _) => self.write_png(time, &mean)?,
            (None, Some((bytes, extension))) => self.write(time, extension, bytes)?,
            (None, None) => match frames[best].1.decode() {
                Ok(picture) => self.write_png(time, &picture)?,
                Err(reason) => {
                    self.taken.reject(reason);
                    return Ok(());
                }
            },
        };
        let stop = self.stop(&image, &joints.positions, time);
        let report = StopReport {
            image,
            speed: joints.speed,
            nearest_sample_s: joints.nearest_ns as f64 * 1e-9,
            pictures: seen.len(),
            sharpness,
            noise_counts,
        };
        self.taken.rows.insert(time, (stop, report));
        Ok(())
    }

    /// A picture with the positions of the joints in SI units at a time, ns.
    fn stop(&self, image: &str, positions: &[f64], time: i64) -> SeriesStop {
        SeriesStop {
            path: Some(self.images.join(image)),
            image: image.to_owned(),
            raw_readings: Some(positions.iter().zip(self.factors).map(|(q, factor)| q / factor).collect()),
            placement: DEFAULT_PLACEMENT.to_string(),
            time_s: Some(time as f64 * 1e-9),
            ..SeriesStop::default()
        }
    }

    /// Which pictures can be read and how sharp they are, and their mean where that is wanted.
    fn look_at(&mut self, frames: &[(i64, Frame)]) -> (Vec<(usize, f64)>, Mean) {
        let (mut seen, mut mean) = (Vec::new(), Mean::default());
        let sizes: Vec<u64> = frames.iter().map(|(_, frame)| frame.decoded_bytes()).collect();
        for batch in batches(&sizes, MOST_IN_FLIGHT) {
            let decoded: Vec<Decoded<(DynamicImage, f64)>> = (frames[batch.clone()].par_iter())
                .map(|(_, frame)| frame.decode().map(|p| (pixels::sharpness(&p), p)).map(|(s, p)| (p, s)))
                .collect();
            for (k, picture) in batch.zip(decoded) {
                match picture {
                    Ok((picture, sharpness)) => {
                        seen.push((k, sharpness));
                        if self.options.picking == Picking::Average {
                            mean.add(&picture);
                        }
                    }
                    Err(reason) => self.taken.reject(reason),
                }
            }
        }
        (seen, mean)
    }

    fn write_png(&self, time: i64, picture: &DynamicImage) -> Result<String> {
        let mut bytes = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut bytes, ImageFormat::Png).map_err(|e| {
            Error::new(
                Code::OutputFailed,
                self.images.display(),
                format!("a picture cannot be written: {e}"),
                "report this",
            )
        })?;
        self.write(time, "png", bytes.get_ref())
    }

    /// Writes a picture named by its stamp.
    fn write(&self, time: i64, extension: &str, bytes: &[u8]) -> Result<String> {
        const SECOND: i64 = 1_000_000_000;
        let name = format!("{}.{:09}.{extension}", time.div_euclid(SECOND), time.rem_euclid(SECOND));
        let path = self.images.join(&name);
        std::fs::write(&path, bytes).map_err(|e| Error::io(&path, &e))?;
        Ok(name)
    }
}

/// Joints at the mean of some times; the largest speed and distance among them.
fn mean_joints(postures: &[Posture], times: &[i64]) -> Option<Interpolated> {
    let all = times.iter().map(|t| interpolate(postures, *t)).collect::<Option<Vec<_>>>()?;
    let mut mean = all.first()?.clone();
    for other in &all[1..] {
        for (sum, q) in mean.positions.iter_mut().zip(&other.positions) {
            *sum += q;
        }
        mean.speed = mean.speed.max(other.speed);
        mean.nearest_ns = mean.nearest_ns.max(other.nearest_ns);
    }
    mean.positions.iter_mut().for_each(|q| *q /= all.len() as f64);
    Some(mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_average_of_images_that_differ_is_told() {
        let report = |noise: Option<f64>| StopReport {
            image: "a.png".to_owned(),
            speed: 0.0,
            nearest_sample_s: 0.0,
            pictures: 9,
            sharpness: 1.0,
            noise_counts: noise,
        };
        let told = |noises: &[f64]| {
            let reports: Vec<StopReport> = noises.iter().map(|noise| report(Some(*noise))).collect();
            unlike(Path::new("run"), &reports).map(|n| n.code)
        };
        assert_eq!(told(&[2.0, 2.1, 1.9, 2.0, 33.0]), Some(Code::ImagesUnlike));
        assert_eq!(told(&[2.0, 2.1, 33.0, 34.0, 35.0]), Some(Code::ImagesUnlike));
        assert_eq!(told(&[2.0, 2.1, 1.9, 2.0, 6.0]), None);
        // Rounding alone: a picture without noise.
        assert_eq!(told(&[0.0, 0.0, 0.0, 1.0]), None);
        assert_eq!(unlike(Path::new("run"), &[report(None)]), None);
    }
}
