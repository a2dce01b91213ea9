//! Files of a series to measurements of bodies: names, sigmas and frames as the manifest says.

use super::stated::on_the_tip_beside_others;
use crate::error::{Code, Error, Result};
use crate::problem::{BodySeen, InstrumentKind, SeenBody, SeenLength};
use crate::series::{DEFAULT_PLACEMENT, Series};

/// Sigma of a coordinate and of a rotation about an axis where nothing states them, m and rad.
const DEFAULT_SIGMA: (f64, f64) = (1e-4, 2e-4);

/// The body that touches, where contacts do not name it.
const TOUCHING: &str = "contact";

/// A series, and whether its names are told from those of others.
#[derive(Clone, Copy)]
pub struct NamedSeries<'a> {
    /// What was read.
    pub series: &'a Series,
    /// True where it is one of several, which do not share by default what they do not name.
    pub is_one_of_several: bool,
}

impl NamedSeries<'_> {
    fn qualified(&self, name: &str) -> String {
        if self.is_one_of_several { format!("{} {name}", self.series.name) } else { name.to_owned() }
    }

    /// Name of a placement: the default one is that of its series alone, and a plate on the tip is not one in the cell.
    pub(super) fn placement(&self, placement: &str) -> String {
        let own = match self.is_one_of_several && placement == DEFAULT_PLACEMENT {
            true => format!("{placement} of {}", self.series.run_name()),
            false => placement.to_owned(),
        };
        if on_the_tip_beside_others(self.series) { format!("{own} on the tip") } else { own }
    }
}

/// What was measured of bodies in a series.
pub(super) fn seen_bodies(named: NamedSeries) -> Vec<SeenBody> {
    let series = named.series;
    let files = &series.spatial;
    let tracker = series.manifest.tracker.clone().unwrap_or_default();
    let instrument = tracker.name.clone().unwrap_or_else(|| series.name.clone());
    // A tracker that is named sees the same bodies in every series.
    let body = |target: &str| if tracker.name.is_some() { target.to_owned() } else { named.qualified(target) };
    let tracked = |stop: usize, target: &str, seen: BodySeen, sigma_m: Option<f64>| SeenBody {
        stop,
        instrument: instrument.clone(),
        kind: InstrumentKind::Tracker,
        body: body(target),
        seen,
        sigma_m: sigma_m.or(tracker.sigma_m).unwrap_or(DEFAULT_SIGMA.0),
        sigma_rad: DEFAULT_SIGMA.1,
    };
    let point = |row: &crate::series::PointRow| {
        tracked(row.stop, &row.target, BodySeen::Point(row.tracker_from_point_m), row.sigma_m)
    };
    let pose = |row: &crate::series::PoseRow| SeenBody {
        sigma_rad: row.sigma_rad.or(tracker.sigma_rad).unwrap_or(DEFAULT_SIGMA.1),
        ..tracked(row.stop, &row.target, BodySeen::Pose(row.tracker_from_target), row.sigma_m)
    };
    let contact = series.manifest.contact.clone().unwrap_or_default();
    let touched = |row: &crate::series::ContactRow| {
        let (kind, name, place) = match row.position_m {
            Some(place) => {
                (InstrumentKind::Places, contact.frame.clone().unwrap_or_else(|| TOUCHING.to_owned()), place)
            }
            None => (InstrumentKind::Socket, row.contact.clone(), nalgebra::Vector3::zeros()),
        };
        SeenBody {
            stop: row.stop,
            instrument: named.qualified(&name),
            kind,
            body: named.qualified(TOUCHING),
            seen: BodySeen::Point(place),
            sigma_m: contact.sigma_m.unwrap_or(DEFAULT_SIGMA.0),
            sigma_rad: DEFAULT_SIGMA.1,
        }
    };
    let trackers = files.points.iter().map(point).chain(files.poses.iter().map(pose));
    trackers.chain(files.contacts.iter().map(touched)).collect()
}

/// Measured distances between what `bodies` name, those between markers of the plate left out.
///
/// # Errors
/// An end that nothing names.
pub(super) fn seen_lengths(named: NamedSeries, bodies: &[SeenBody]) -> Result<Vec<SeenLength>> {
    let series = named.series;
    let is_known = |name: &String| bodies.iter().any(|b| &b.instrument == name || &b.body == name);
    let is_marker = |name: &String| name.parse::<u32>().is_ok_and(|id| series.plate.index_of(id).is_some());
    let mut lengths = Vec::new();
    // A target that the tracker lost everywhere is known by name, and has no place.
    let is_lost = |name: &String| series.spatial.lost.contains(name);
    for given in series.manifest.distance.iter().filter(|d| !d.between.iter().all(is_marker)) {
        let full = |name: &String| if is_known(name) { name.clone() } else { named.qualified(name) };
        let between = given.between.each_ref().map(full);
        let unknown = |end: &usize| !is_known(&between[*end]);
        if let Some(unknown) = (0..2).find(|end| unknown(end) && !is_lost(&given.between[*end])) {
            let what =
                format!("[[distance]] names '{}', and nothing of this name was measured", given.between[unknown]);
            let remedy = "name two contacts of contacts.csv, two targets of points.csv or poses.csv, or two markers of the plate";
            return Err(Error::new(Code::CsvName, series.manifest_file().display(), what, remedy));
        }
        if (0..2).any(|end| unknown(&end)) {
            continue;
        }
        lengths.push(SeenLength { between, distance_m: given.distance_m, sigma_m: given.sigma_m });
    }
    Ok(lengths)
}
