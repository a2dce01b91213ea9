//! The same recording given twice, under two names.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use crate::error::{Code, Error, Result};
use crate::problem::{BodySeen, ImageRejection, InstrumentKind, MeasuredSeries, MeasuredStop, Shared};
use crate::series::{InputFile, Observation, Series};

/// What was measured at a stop.
struct Measured<'a> {
    name: &'a str,
    readings: Option<&'a Vec<f64>>,
    observations: &'a [Observation],
    /// Hash of its image.
    picture: Option<&'a str>,
    bodies: Vec<(InstrumentKind, BodySeen, [f64; 2])>,
}

impl Measured<'_> {
    /// Readings to the last bit.
    fn key(&self) -> Option<Vec<u64>> {
        self.readings.map(|q| q.iter().map(|v| v.to_bits()).collect())
    }

    /// Readings and measurements are the same; of one picture a second pass may have found more in one series than in the other.
    fn repeats(&self, other: &Self) -> bool {
        let is_picture = self.shows_picture_of(other);
        (self.readings, &self.bodies) == (other.readings, &other.bodies)
            && (is_picture || self.observations == other.observations)
    }

    fn shows_picture_of(&self, other: &Self) -> bool {
        self.picture.is_some() && self.picture == other.picture
    }
}

/// Stops of a series, `None` where nothing was measured.
fn stops<'a>(
    series: &'a MeasuredSeries,
    view: &Series,
    pictures: &BTreeMap<&Path, &'a str>,
) -> Vec<Option<Measured<'a>>> {
    let mut bodies = vec![Vec::new(); series.stops.len()];
    for b in &series.bodies {
        bodies[b.stop].push((b.kind, b.seen, [b.sigma_m, b.sigma_rad]));
    }
    let files = view.stops.stops.iter().map(|stop| stop.path.as_deref());
    let measured = |((stop, bodies), file): ((&'a MeasuredStop, Vec<_>), Option<&Path>)| {
        let is_empty = stop.observations.is_empty() && bodies.is_empty();
        (!is_empty).then(|| Measured {
            name: &stop.image,
            readings: stop.readings.as_ref(),
            observations: &stop.observations,
            picture: file.and_then(|file| pictures.get(file).copied()),
            bodies,
        })
    };
    series.stops.iter().zip(bodies).zip(files).map(measured).collect()
}

/// Leaves out images whose picture is that of an image of a series before, taken with the same readings. `views` are the series as their files
/// say, in the order of `all`; `images` are the hashes of their images.
///
/// # Errors
/// A series all of whose stops are stops of one before it: it is no second measurement.
pub(super) fn leave_out_repeated(views: &[&Series], images: &[InputFile], all: &mut [MeasuredSeries]) -> Result<()> {
    let pictures: BTreeMap<&Path, &str> = images.iter().map(|f| (f.path.as_path(), f.sha256.as_str())).collect();
    let stops: Vec<Vec<Option<Measured>>> = all.iter().zip(views).map(|(s, view)| stops(s, view, &pictures)).collect();
    let mut left_out: Vec<(usize, usize, String)> = Vec::new();
    for (k, own) in stops.iter().enumerate() {
        let is_of_its_run = |other: &MeasuredSeries| all[k].run.is_some() && all[k].run == other.run;
        for (other, before) in all.iter().zip(&stops).take(k).filter(|(other, _)| !is_of_its_run(other)) {
            let repeated = repeated(own, before);
            if !repeated.is_empty() && repeated.len() == own.iter().flatten().count() {
                return Err(refusal(&all[k].name, &other.name));
            }
            let pictures = repeated.into_iter().filter(|(_, is_picture, _)| *is_picture);
            left_out.extend(pictures.map(|(row, _, of)| (k, row, format!("{}/{of}", other.name))));
        }
    }
    for (series, row, of) in left_out {
        let stop = &mut all[series].stops[row];
        if stop.left_out.is_none() {
            stop.left_out = Some(ImageRejection::Duplicate { of });
            stop.observations = Shared::default();
        }
    }
    Ok(())
}

/// Stops that repeat one of another series, each with whether it shows the same picture, and the name of that one.
fn repeated<'a>(own: &[Option<Measured>], before: &[Option<Measured<'a>>]) -> Vec<(usize, bool, &'a str)> {
    let mut by_key: HashMap<_, Vec<&Measured<'a>>> = HashMap::new();
    before.iter().flatten().for_each(|m| by_key.entry(m.key()).or_default().push(m));
    let original = |(row, stop): (usize, &Option<Measured>)| {
        let stop = stop.as_ref()?;
        let of = by_key.get(&stop.key())?.iter().find(|other| stop.repeats(other))?;
        Some((row, stop.shows_picture_of(of), of.name))
    };
    own.iter().enumerate().filter_map(original).collect()
}

fn refusal(series: &str, first: &str) -> Error {
    Error::new(
        Code::SeriesRepeated,
        format!("series {series}"),
        format!("repeats series {first}: all of its stops have the readings and the measurements of stops there"),
        "give each recording once",
    )
}
