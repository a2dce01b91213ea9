//! What was measured of the tip: touches of places, known or not, and what a tracker saw.

use nalgebra::Vector3;

use crate::error::{Code, Error, Result};
use crate::geom::Pose;
use crate::model::robot::Posture;
use crate::problem::{BodySeen, InstrumentKind, MeasuredSeries, SeenBody, intern, postures_of_stops, stop_name};
use crate::series::JointsBeside;

/// A place is that of a marker from which it is no farther, m: what a file rounds.
const AT_MARKER_M: f64 = 1e-5;

/// A marker of a plate in the frame of the plate, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TouchedMarker {
    /// Where its plate says that it is.
    pub nominal: Vector3<f64>,
    /// Where the images found it.
    pub found: Vector3<f64>,
}

/// Where a touch says that the body was.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TouchPlace {
    /// Its origin in the work object, m.
    Point(Vector3<f64>),
    /// Its pose in the work object.
    Pose(Pose),
    /// At a place that is not known: index of the contact.
    Unknown(usize),
}

/// One measurement.
#[derive(Debug, Clone, PartialEq)]
pub struct Touch {
    /// Name of its stop.
    pub stop: String,
    /// Index of its posture: measurements of one stop share their joint noise.
    pub posture: usize,
    /// Index of the body.
    pub body: usize,
    /// Where it was.
    pub seen: TouchPlace,
    /// Stated sigma of a coordinate, m.
    pub sigma_m: f64,
    /// Stated sigma of the rotation about an axis, rad; of poses.
    pub sigma_rad: f64,
}

/// Everything that was measured with one tool.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Touches {
    /// Postures of the stops.
    pub postures: Vec<Posture>,
    /// Names of the bodies that the tip carries: the tool, or the targets of a tracker.
    pub bodies: Vec<String>,
    /// Names of contacts at unknown places.
    pub contacts: Vec<String>,
    /// Name of the frame of the known places; `None` where none is known.
    pub frame: Option<String>,
    /// Joints beside the chain, which may have moved what was touched.
    pub beside: JointsBeside,
    /// Measurements.
    pub all: Vec<Touch>,
}

impl Touches {
    /// What series hold of it. Series are of one tool: bodies and contacts of one name are one thing in all of them.
    ///
    /// # Errors
    /// Places in more than one frame; measurements at stops without readings; no measurements at all.
    pub fn of(series: &[MeasuredSeries]) -> Result<Self> {
        let mut touches = Self::default();
        for (index, (s, at_stops)) in series.iter().zip(postures_of_stops(series)).enumerate() {
            let mut postures = vec![None; s.stops.len()];
            for b in &s.bodies {
                let stop = &s.stops[b.stop];
                let place = || format!("series {}, stop {}", s.name, stop.image);
                let Some(at_stop) = &at_stops[b.stop] else {
                    let what = "was measured, but its joint readings are not given";
                    let remedy = "fill the row of joints.csv, or remove the measurement";
                    return Err(Error::new(Code::ReadingsMissing, place(), what, remedy));
                };
                let seen = touches.place(b, place)?;
                let posture = *postures[b.stop].get_or_insert_with(|| {
                    touches.postures.push(at_stop.clone());
                    touches.postures.len() - 1
                });
                let body = intern(&mut touches.bodies, &b.body);
                let (sigma_m, sigma_rad) = (b.sigma_m, b.sigma_rad);
                let stop = stop_name(series, (index, b.stop));
                touches.all.push(Touch { stop, posture, body, seen, sigma_m, sigma_rad });
            }
        }
        if touches.all.is_empty() {
            let names: Vec<&str> = series.iter().map(|s| s.name.as_str()).collect();
            let what = "holds no touches: there is no contacts.csv, points.csv or poses.csv with rows";
            let remedy = "write contacts.csv with the columns stop,contact,x_m,y_m,z_m (without x_m,y_m,z_m where the place is not known)";
            return Err(Error::new(Code::FileEmpty, format!("series {}", names.join(", ")), what, remedy));
        }
        Ok(touches)
    }

    /// The place that was measured, in the one frame of all that are known.
    fn place(&mut self, body: &SeenBody, place: impl Fn() -> String) -> Result<TouchPlace> {
        if body.kind == InstrumentKind::Socket {
            return Ok(TouchPlace::Unknown(intern(&mut self.contacts, &body.instrument)));
        }
        let frame = self.frame.get_or_insert_with(|| body.instrument.clone());
        if *frame != body.instrument {
            let what = format!("is in the frame '{}', others are in '{frame}'", body.instrument);
            let remedy = "give the places of one work object at a time: run `frames` once for each";
            return Err(Error::new(Code::SeriesDisagree, place(), what, remedy));
        }
        Ok(match body.seen {
            BodySeen::Point(point) => TouchPlace::Point(point),
            BodySeen::Pose(pose) => TouchPlace::Pose(pose),
        })
    }

    /// Adds offsets to the readings of all postures, rad or m.
    pub fn add(&mut self, offsets: &[f64]) {
        for posture in &mut self.postures {
            posture.readings.iter_mut().zip(offsets).for_each(|(reading, offset)| *reading += offset);
        }
    }

    /// Brings touches at the nominal places of markers to where the markers were found; how far each, m.
    pub fn move_to_found(&mut self, markers: &[TouchedMarker]) -> Vec<f64> {
        let mut moved = Vec::new();
        for touch in &mut self.all {
            let TouchPlace::Point(place) = &mut touch.seen else { continue };
            let away = |m: &&TouchedMarker| (m.nominal - *place).norm();
            let nearest = markers.iter().min_by(|a, b| away(a).total_cmp(&away(b)));
            if let Some(marker) = nearest.filter(|m| away(m) <= AT_MARKER_M) {
                moved.push((marker.found - marker.nominal).norm());
                *place = marker.found;
            }
        }
        moved
    }

    /// True where the orientation of a body was seen, too.
    pub fn is_pose(&self, body: usize) -> bool {
        self.all.iter().any(|t| t.body == body && matches!(t.seen, TouchPlace::Pose(_)))
    }

    /// Measurements at known places.
    pub fn placed(&self) -> impl Iterator<Item = (&Touch, Vector3<f64>)> {
        self.all.iter().filter_map(|t| match t.seen {
            TouchPlace::Point(place) => Some((t, place)),
            TouchPlace::Pose(pose) => Some((t, pose.translation)),
            TouchPlace::Unknown(_) => None,
        })
    }
}
