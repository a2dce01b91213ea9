//! The same recording given twice, under two names.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

use crate::error::{Code, Error, Notice, Result};
use crate::problem::{BodySeen, Exposures, ImageRejection, MeasuredSeries, MeasuredStop, SeenBody, Shared};
use crate::series::{InputFile, Plate, Series};

/// Whose pictures a series has.
struct Shown<'a> {
    plate: &'a Plate,
    /// Hash of the image of every stop.
    pictures: Vec<Option<&'a str>>,
}

/// Index of a series, and of what it has.
type Place = (usize, usize);

/// What series before measured, by the readings to the last bit.
#[derive(Default)]
struct Before {
    stops: HashMap<Option<Vec<u64>>, Vec<Place>>,
    bodies: HashMap<Option<Vec<u64>>, Vec<Place>>,
}

/// What a series repeats of those before it.
struct Repeated {
    /// By its stop: the stop that shows the same, and whether both have a picture.
    images: BTreeMap<usize, (Place, bool)>,
    /// By its index among the bodies.
    bodies: BTreeMap<usize, Place>,
}

/// Leaves out images whose picture is that of an image of a series before, taken of the same plate with the same readings, in whatever format, and what trackers and
/// contacts measured before with the same readings, in the same series or another. `views` are the series as their files say, in the order of `all`; `images` are the
/// hashes of their images. Images without a picture are compared later, with those of their own series.
///
/// # Errors
/// A series all of whose images and measurements are in those before it: it is no second measurement.
pub(super) fn leave_out_repeated(
    views: &[&Series],
    images: &[InputFile],
    all: &mut [MeasuredSeries],
) -> Result<Vec<Notice>> {
    let hashes: BTreeMap<&Path, &str> = images.iter().map(|f| (f.path.as_path(), f.sha256.as_str())).collect();
    let shown = |view: &&'_ Series| -> Vec<Option<&str>> {
        view.stops.stops.iter().map(|stop| hashes.get(stop.path.as_deref()?).copied()).collect()
    };
    let shown: Vec<Shown> = views.iter().map(|v| Shown { plate: &v.plate, pictures: shown(v) }).collect();
    leave_out(&shown, all)
}

/// Leaves out what trackers and contacts measured before with the same readings, to the last digit; of series without images.
///
/// # Errors
/// A series all of whose measurements are in those before it.
pub fn leave_out_repeated_bodies(all: &mut [MeasuredSeries]) -> Result<Vec<Notice>> {
    leave_out(&[], all)
}

fn leave_out(shown: &[Shown], all: &mut [MeasuredSeries]) -> Result<Vec<Notice>> {
    let mut notices: Vec<Notice> = all.iter_mut().filter_map(leave_out_own).collect();
    for k in 1..all.len() {
        let (before, rest) = all.split_at_mut(k);
        let repeated = Repeated::of(&rest[0], k, before, shown);
        if repeated.is_all(&rest[0]) {
            return Err(refusal(&rest[0].name, &repeated.originals(before)));
        }
        notices.extend(repeated.leave_out(&mut rest[0], before));
    }
    Ok(notices)
}

/// Leaves out what a series itself has before, of the same instrument and body with the same readings: nothing was measured again.
fn leave_out_own(own: &mut MeasuredSeries) -> Option<Notice> {
    let mut known: HashMap<_, Vec<BodySeen>> = HashMap::new();
    let count = own.bodies.len();
    let stops = &own.stops;
    own.bodies.retain(|body| {
        let Some(readings) = key(&stops[body.stop]) else { return true };
        let of_same = known.entry((readings, body.instrument.clone(), body.body.clone())).or_default();
        let is_new = !of_same.contains(&body.seen);
        of_same.push(body.seen);
        is_new
    });
    let left_out = count - own.bodies.len();
    (left_out > 0).then(|| {
        Notice::new(
            Code::MeasurementDuplicate,
            format!("series {}", own.name),
            format!(
                "{left_out} measurements of trackers or contacts are, with their readings, earlier ones of the same series to the last digit: they are counted once"
            ),
            "give each once, and readings with all their digits",
        )
    })
}

fn key(stop: &MeasuredStop) -> Option<Vec<u64>> {
    stop.readings.as_ref().map(|q| q.iter().map(|v| v.to_bits()).collect())
}

impl Before {
    /// Cameras of one run saw the same stops.
    fn of(own: &MeasuredSeries, before: &[MeasuredSeries]) -> Self {
        let is_of_its_run = |other: &MeasuredSeries| own.run.is_some() && own.run == other.run;
        let mut all = Self::default();
        for (k, other) in before.iter().enumerate().filter(|(_, other)| !is_of_its_run(other)) {
            for (row, stop) in other.stops.iter().enumerate().filter(|(_, stop)| !stop.observations.is_empty()) {
                all.stops.entry(key(stop)).or_default().push((k, row));
            }
            for (b, body) in other.bodies.iter().enumerate() {
                all.bodies.entry(key(&other.stops[body.stop])).or_default().push((k, b));
            }
        }
        all
    }
}

impl Repeated {
    fn of(own: &MeasuredSeries, index: usize, before: &[MeasuredSeries], shown: &[Shown]) -> Self {
        let measured = Before::of(own, before);
        let picture = |series: usize, row: usize| shown.get(series).and_then(|s| *s.pictures.get(row)?);
        let image = |(row, stop): (usize, &MeasuredStop)| {
            let repeats = |of: &Place| {
                let pictures = picture(index, row).zip(picture(of.0, of.1));
                let original = &before[of.0].stops[of.1];
                // Of one picture a second pass may have found more of the plate in one series than in the other.
                let is_of_one_plate =
                    pictures.is_some_and(|(own, other)| own == other) && shown[index].plate == shown[of.0].plate;
                // In another format its bytes are others.
                let is_one_exposure = || pictures.is_some() && Exposures::of([original]).shows(stop);
                let is_same = is_of_one_plate || original.observations == stop.observations || is_one_exposure();
                is_same.then_some((*of, pictures.is_some()))
            };
            Some((row, measured.stops.get(&key(stop))?.iter().find_map(repeats)?))
        };
        let body = |(b, body): (usize, &SeenBody)| {
            let is_original = |of: &&Place| {
                let other = &before[of.0].bodies[of.1];
                (other.kind, other.seen) == (body.kind, body.seen)
            };
            Some((b, *measured.bodies.get(&key(&own.stops[body.stop]))?.iter().find(is_original)?))
        };
        let stops = own.stops.iter().enumerate().filter(|(_, stop)| !stop.observations.is_empty());
        Self {
            images: stops.filter_map(image).collect(),
            bodies: own.bodies.iter().enumerate().filter_map(body).collect(),
        }
    }

    /// True where nothing is left of a series that measured something.
    fn is_all(&self, own: &MeasuredSeries) -> bool {
        let images = own.stops.iter().filter(|stop| !stop.observations.is_empty()).count();
        let measured = images + own.bodies.len();
        measured > 0 && self.images.len() + self.bodies.len() == measured
    }

    /// Names of the series that are repeated.
    fn originals(&self, before: &[MeasuredSeries]) -> String {
        let of = self.images.values().map(|(of, _)| of).chain(self.bodies.values());
        let series: BTreeSet<usize> = of.map(|of| of.0).collect();
        series.into_iter().map(|k| before[k].name.as_str()).collect::<Vec<_>>().join(", ")
    }

    /// Takes out of the series what it repeats. What is left was seen by the same instrument, of the same body.
    fn leave_out(&self, own: &mut MeasuredSeries, before: &[MeasuredSeries]) -> Option<Notice> {
        for (row, (of, _)) in self.images.iter().filter(|(_, (_, has_pictures))| *has_pictures) {
            let stop = &mut own.stops[*row];
            if stop.left_out.is_none() {
                let of = format!("{}/{}", before[of.0].name, before[of.0].stops[of.1].image);
                stop.left_out = Some(ImageRejection::Duplicate { of });
                stop.observations = Shared::default();
            }
        }
        if self.bodies.is_empty() {
            return None;
        }
        let names = self.first_names(own, before);
        let named = |name: &String| names.get(name).unwrap_or(name).clone();
        let bodies = std::mem::take(&mut own.bodies).into_iter().enumerate();
        let left = bodies.filter(|(b, _)| !self.bodies.contains_key(b)).map(|(_, body)| body);
        own.bodies = left
            .map(|body| SeenBody { instrument: named(&body.instrument), body: named(&body.body), ..body })
            .collect();
        own.lengths.iter_mut().for_each(|length| length.between = length.between.each_ref().map(named));
        let originals: BTreeSet<usize> = self.bodies.values().map(|of| of.0).collect();
        own.lengths.retain(|length| !originals.iter().any(|k| before[*k].lengths.contains(length)));
        let known = before.iter().flat_map(|s| &s.bodies).chain(&own.bodies);
        let known: BTreeSet<&String> = known.flat_map(|b| [&b.instrument, &b.body]).collect();
        own.lengths.retain(|length| length.between.iter().all(|end| known.contains(end)));
        Some(self.notice(&own.name, before))
    }

    /// Names of instruments and bodies in the series before, where all that is repeated says the same one.
    fn first_names(&self, own: &MeasuredSeries, before: &[MeasuredSeries]) -> BTreeMap<String, String> {
        let mut names: BTreeMap<&String, BTreeSet<&String>> = BTreeMap::new();
        for (b, of) in &self.bodies {
            let (own, first) = (&own.bodies[*b], &before[of.0].bodies[of.1]);
            names.entry(&own.instrument).or_default().insert(&first.instrument);
            names.entry(&own.body).or_default().insert(&first.body);
        }
        let only = |(own, firsts): (&String, BTreeSet<&String>)| {
            let first = firsts.first().filter(|_| firsts.len() == 1)?;
            Some((own.clone(), (*first).clone()))
        };
        names.into_iter().filter_map(only).collect()
    }

    fn notice(&self, series: &str, before: &[MeasuredSeries]) -> Notice {
        let count = self.bodies.len();
        Notice::new(
            Code::MeasurementDuplicate,
            format!("series {series}"),
            format!(
                "{count} measurements of trackers or contacts are, with their readings, those of series {} to the last digit: they are counted once, and the others are taken to be of the same instrument and body",
                self.originals(before)
            ),
            "give each recording once",
        )
    }
}

fn refusal(series: &str, first: &str) -> Error {
    Error::new(
        Code::SeriesRepeated,
        format!("series {series}"),
        format!("repeats series {first}: all of its stops have the readings and the measurements of stops there"),
        "give each recording once",
    )
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::problem::{InstrumentKind, SeenLength};
    use crate::series::{Edge, Observation, PlateKind};

    fn stop(row: usize) -> MeasuredStop {
        MeasuredStop {
            row,
            image: format!("img_{row}.png"),
            readings: Some(vec![0.1 * row as f64, -0.3]),
            placement: "placement".into(),
            observations: Shared::default(),
            left_out: None,
        }
    }

    /// Of a tracker without a name: it and its target are called after the series.
    fn tracked(name: &str, rows: &[usize]) -> MeasuredSeries {
        let stops = rows.iter().map(|row| stop(*row)).collect();
        let body = |(k, row): (usize, &usize)| SeenBody {
            stop: k,
            instrument: name.to_owned(),
            kind: InstrumentKind::Tracker,
            body: format!("{name} ball"),
            seen: BodySeen::Point(Vector3::new(*row as f64, 0.5, 1.0)),
            sigma_m: 1e-4,
            sigma_rad: 1e-4,
        };
        let bodies = rows.iter().enumerate().map(body).collect();
        let between = [name.to_owned(), format!("{name} ball")];
        let lengths = vec![SeenLength { between, distance_m: 0.4, sigma_m: 1e-4 }];
        MeasuredSeries { bodies, lengths, ..MeasuredSeries::without_images(name, true, stops) }
    }

    /// Images of rows that show one marker, at `column`.
    fn imaged(name: &str, rows: &[usize], column: f64) -> MeasuredSeries {
        let seen =
            |row: usize| Observation { marker: 1, edge: Edge::Outer, uv: [column, row as f64], covariance: None };
        let image = |row: &usize| MeasuredStop { observations: Shared::from(vec![seen(*row)]), ..stop(*row) };
        MeasuredSeries {
            has_images: true,
            ..MeasuredSeries::without_images(name, true, rows.iter().map(image).collect())
        }
    }

    fn codes(notices: &[Notice]) -> Vec<Code> {
        notices.iter().map(|n| n.code).collect()
    }

    #[test]
    fn a_board_beside_another_in_the_same_pictures_is_no_repetition() {
        let [first, second] = [0.03, 0.02].map(|pitch| Plate::lattice(PlateKind::Points, 4, 3, pitch, 1e-4));
        let names: Vec<String> = (0..6).map(|k| format!("hash {k}")).collect();
        let pictures = |rows: &[usize]| rows.iter().map(|row| Some(names[*row].as_str())).collect::<Vec<_>>();
        let (whole, part) = ([0, 1, 2, 3], [2, 3, 4, 5]);
        for rows in [whole, part] {
            let given = || [imaged("a", &whole, 100.0), imaged("b", &rows, 700.0)];
            let shown = |plate| {
                [Shown { plate: &first, pictures: pictures(&whole) }, Shown { plate, pictures: pictures(&rows) }]
            };
            let mut of_two = given();
            assert_eq!(leave_out(&shown(&second), &mut of_two), Ok(vec![]));
            assert!(of_two[1].stops.iter().all(|stop| stop.left_out.is_none() && !stop.observations.is_empty()));

            // Of one board, of which a second look found something else.
            let mut of_one = given();
            let left_out = leave_out(&shown(&first), &mut of_one);
            if rows == whole {
                assert_eq!(left_out.unwrap_err().code, Code::SeriesRepeated);
            } else {
                let is_out: Vec<bool> = of_one[1].stops.iter().map(|stop| stop.left_out.is_some()).collect();
                assert_eq!(is_out, [true, true, false, false]);
            }
        }
    }

    #[test]
    fn what_a_tracker_saw_counts_once_however_it_is_given_again() {
        let refused = |mut all: Vec<MeasuredSeries>| leave_out_repeated_bodies(&mut all).unwrap_err().code;
        let a = || tracked("a", &[0, 1, 2, 3]);
        assert_eq!(refused(vec![a(), tracked("b", &[0, 1, 2, 3])]), Code::SeriesRepeated);
        // Two series joined.
        assert_eq!(refused(vec![a(), tracked("b", &[4, 5]), tracked("c", &[0, 1, 2, 3, 4, 5])]), Code::SeriesRepeated);

        // A series that went on: the same tracker, ball and distance.
        let mut all = [a(), tracked("b", &[0, 1, 2, 3, 4, 5])];
        let notices = leave_out_repeated_bodies(&mut all).unwrap();
        assert_eq!(codes(&notices), [Code::MeasurementDuplicate]);
        let left: Vec<(usize, &str, &str)> =
            all[1].bodies.iter().map(|b| (b.stop, b.instrument.as_str(), b.body.as_str())).collect();
        assert_eq!(left, [(4, "a", "a ball"), (5, "a", "a ball")]);
        assert!(all[1].lengths.is_empty() && all[0].bodies.len() == 4 && all[0].lengths.len() == 1);

        // A row that was copied within its table.
        let mut copied = [tracked("a", &[0, 1, 0, 2, 0])];
        assert_eq!(codes(&leave_out_repeated_bodies(&mut copied).unwrap()), [Code::MeasurementDuplicate]);
        assert_eq!(copied[0].bodies.iter().map(|b| b.stop).collect::<Vec<_>>(), [0, 1, 3]);

        // Other readings, or another place: another measurement.
        let mut others = [a(), tracked("b", &[0, 1, 2, 3])];
        others[1].stops.iter_mut().for_each(|stop| stop.readings = Some(vec![1.0, stop.row as f64]));
        assert_eq!(leave_out_repeated_bodies(&mut others), Ok(vec![]));
        let mut others = [a(), tracked("b", &[0, 1, 2, 3])];
        others[1].bodies.iter_mut().for_each(|b| b.seen = BodySeen::Point(Vector3::zeros()));
        assert_eq!(leave_out_repeated_bodies(&mut others), Ok(vec![]));
        assert_eq!((others[1].bodies.len(), others[1].lengths.len()), (4, 1));
    }

    #[test]
    fn other_images_with_the_same_tables_are_kept_and_the_tables_are_not() {
        let mut all = [("a", 100.0), ("b", 700.0)].map(|(name, column)| MeasuredSeries {
            bodies: tracked(name, &[0, 1, 2]).bodies,
            ..imaged(name, &[0, 1, 2], column)
        });
        assert_eq!(codes(&leave_out_repeated_bodies(&mut all).unwrap()), [Code::MeasurementDuplicate]);
        assert!(all[1].bodies.is_empty() && all[1].stops.iter().all(|stop| !stop.observations.is_empty()));
    }
}
