//! Files of a series to measurements of bodies: names, sigmas and frames as the manifest says.

use crate::error::{Code, Error, Result};
use crate::problem::{BodySeen, InstrumentKind, SeenBody, SeenLength};
use crate::series::Series;

/// Sigma of a coordinate and of a rotation about an axis where nothing states them, m and rad.
const DEFAULT_SIGMA: (f64, f64) = (1e-4, 2e-4);

/// The body that touches, where contacts do not name it.
const TOUCHING: &str = "contact";

/// Names that several series do not share by their defaults.
struct Qualified<'a> {
    series: &'a Series,
    several: bool,
}

impl Qualified<'_> {
    fn name(&self, name: &str) -> String {
        if self.several { format!("{} {name}", self.series.name) } else { name.to_owned() }
    }
}

/// What was measured of bodies in a series; `several` series qualify the names that they do not share.
pub(super) fn seen_bodies(series: &Series, several: bool) -> Vec<SeenBody> {
    let qualified = Qualified { series, several };
    let files = &series.spatial;
    let tracker = series.manifest.tracker.clone().unwrap_or_default();
    let instrument = tracker.name.clone().unwrap_or_else(|| series.name.clone());
    // A tracker that is named sees the same bodies in every series.
    let body = |target: &str| if tracker.name.is_some() { target.to_owned() } else { qualified.name(target) };
    let sigma_m = |row: Option<f64>| row.or(tracker.sigma_m).unwrap_or(DEFAULT_SIGMA.0);
    let point = |row: &crate::series::PointRow| SeenBody {
        stop: row.stop,
        instrument: instrument.clone(),
        kind: InstrumentKind::Tracker,
        body: body(&row.target),
        seen: BodySeen::Point(row.tracker_from_point_m),
        sigma_m: sigma_m(row.sigma_m),
        sigma_rad: DEFAULT_SIGMA.1,
    };
    let pose = |row: &crate::series::PoseRow| SeenBody {
        stop: row.stop,
        instrument: instrument.clone(),
        kind: InstrumentKind::Tracker,
        body: body(&row.target),
        seen: BodySeen::Pose(row.tracker_from_target),
        sigma_m: sigma_m(row.sigma_m),
        sigma_rad: row.sigma_rad.or(tracker.sigma_rad).unwrap_or(DEFAULT_SIGMA.1),
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
            instrument: qualified.name(&name),
            kind,
            body: qualified.name(TOUCHING),
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
pub(super) fn seen_lengths(series: &Series, several: bool, bodies: &[SeenBody]) -> Result<Vec<SeenLength>> {
    let qualified = Qualified { series, several };
    let is_known = |name: &String| bodies.iter().any(|b| &b.instrument == name || &b.body == name);
    let is_marker = |name: &String| name.parse::<u32>().is_ok_and(|id| series.plate.index_of(id).is_some());
    let mut lengths = Vec::new();
    // A target that the tracker lost everywhere is known by name, and has no place.
    let is_lost = |name: &String| series.spatial.lost.contains(name);
    for given in series.manifest.distance.iter().filter(|d| !d.between.iter().all(is_marker)) {
        let named = |name: &String| if is_known(name) { name.clone() } else { qualified.name(name) };
        let between = given.between.each_ref().map(named);
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
