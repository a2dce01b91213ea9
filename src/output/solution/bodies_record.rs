//! What was measured of bodies on the tip, in solution.json: as it was read, and what the fit made of it.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::pose_record::{PlacedRecord, PoseRecord};
use crate::geom::Pose;
use crate::identify::Solution;
use crate::model::robot::Posture;
use crate::problem::{
    BodyMeasurement, BodyRejection, BodySeen, Instrument, InstrumentKind, MeasuredSeries, MeasuredStop, SeenBody,
    SeenLength, Shared,
};

/// Measurements of trackers and contacts, and where their frames and bodies are.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct BodiesRecord {
    /// Frames in which bodies were measured.
    pub instruments: Vec<InstrumentRecord>,
    /// Bodies on the tip: `tip_from_body`.
    pub bodies: Vec<PlacedRecord>,
    /// What was measured.
    pub measurements: Vec<MeasurementRecord>,
    /// Measured distances.
    pub lengths: Vec<LengthRecord>,
    /// Stops of series without images.
    pub stops: Vec<StopRecord>,
}

/// An instrument.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct InstrumentRecord {
    /// Name.
    pub name: String,
    /// What it is.
    pub kind: InstrumentKind,
    /// `base_from_instrument`.
    pub pose: PoseRecord,
    /// Covariance of its body twist, 36 numbers.
    pub covariance: Vec<f64>,
    /// Estimated factors on the stated sigmas of positions and rotations.
    pub sigma_factors: [f64; 2],
}

/// One measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MeasurementRecord {
    /// Name of its series.
    pub series: String,
    /// Index of its stop in the series.
    pub stop: usize,
    /// Name of the stop.
    pub name: String,
    /// Instrument.
    pub instrument: String,
    /// What the instrument is.
    pub kind: InstrumentKind,
    /// Body.
    pub body: String,
    /// Measured position in the frame of the instrument, m.
    pub xyz_m: [f64; 3],
    /// Measured rotation, qx qy qz qw; absent for a point.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quat_xyzw: Option<[f64; 4]>,
    /// Stated sigmas: position (m), rotation (rad).
    pub sigma: [f64; 2],
    /// Measured minus predicted with the latent joint errors: position (m), rotation (rad); absent where it is left out.
    pub residual: Option<[f64; 6]>,
    /// Held-out error of the position with nominal and calibrated robot, mm.
    pub held_out_mm: Option<[f64; 2]>,
    /// Why it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rejection: Option<BodyRejection>,
}

/// A measured distance between two instruments or bodies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LengthRecord {
    /// Name of its series.
    pub series: String,
    /// Names of its ends.
    pub between: [String; 2],
    /// Measured, m.
    pub distance_m: f64,
    /// Its sigma, m.
    pub sigma_m: f64,
    /// As fitted, m.
    pub fitted_m: Option<f64>,
    /// True where it took no part in the fit, which contradicts it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub left_out: bool,
}

/// A stop of a series without images.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StopRecord {
    /// Name of its series.
    pub series: String,
    /// Its name.
    pub name: String,
    /// Readings, rad or m; none off the robot.
    pub readings: Option<Vec<f64>>,
}

impl BodiesRecord {
    /// Of a solution.
    pub fn of(solution: &Solution) -> Self {
        let (problem, state) = (&solution.fit.problem, &solution.fit.state);
        let flat = |start: usize| solution.fit.covariance.block(start).transpose().as_slice().to_vec();
        let instrument = |(k, i): (usize, &Instrument)| InstrumentRecord {
            name: i.name.clone(),
            kind: i.kind,
            pose: (&state.instruments[k]).into(),
            covariance: flat(problem.layout.instruments[k].start),
            sigma_factors: problem.noise.body[i.component],
        };
        let body = |(k, name): (usize, &String)| PlacedRecord {
            name: name.clone(),
            pose: (&state.bodies[k]).into(),
            covariance: Some(flat(problem.layout.bodies[k].start)),
        };
        let stops = solution.series.iter().filter(|s| !s.has_images).flat_map(|s| {
            let of = |stop: &MeasuredStop| StopRecord {
                series: s.name.clone(),
                name: stop.image.clone(),
                readings: stop.readings.clone(),
            };
            s.stops.iter().map(of)
        });
        Self {
            instruments: problem.instruments.iter().enumerate().map(instrument).collect(),
            bodies: problem.bodies.iter().enumerate().map(body).collect(),
            measurements: problem
                .body_measurements
                .iter()
                .enumerate()
                .map(|(k, m)| measurement(solution, k, m))
                .collect(),
            lengths: (0..solution.series.len()).flat_map(|s| lengths(solution, s)).collect(),
            stops: stops.collect(),
        }
    }

    /// True where nothing of this kind was measured.
    pub fn is_empty(&self) -> bool {
        self.measurements.is_empty()
    }

    /// Number of measurements that are left out.
    pub fn left_out(&self) -> usize {
        self.measurements.iter().filter(|m| m.rejection.is_some()).count()
    }

    /// Measurements of a series, ready to be solved again.
    pub fn seen(&self, series: &str) -> Vec<SeenBody> {
        let of = |m: &MeasurementRecord| SeenBody {
            stop: m.stop,
            instrument: m.instrument.clone(),
            kind: m.kind,
            body: m.body.clone(),
            seen: match m.quat_xyzw {
                Some(quaternion) => BodySeen::Pose(Pose::from_xyz_quaternion(m.xyz_m, quaternion)),
                None => BodySeen::Point(Vector3::from(m.xyz_m)),
            },
            sigma_m: m.sigma[0],
            sigma_rad: m.sigma[1],
        };
        self.measurements.iter().filter(|m| m.series == series).map(of).collect()
    }

    /// Measured distances of a series.
    pub fn seen_lengths(&self, series: &str) -> Vec<SeenLength> {
        let of =
            |l: &LengthRecord| SeenLength { between: l.between.clone(), distance_m: l.distance_m, sigma_m: l.sigma_m };
        self.lengths.iter().filter(|l| l.series == series).map(of).collect()
    }

    /// Stops of a series without images.
    pub fn stops_of(&self, series: &str) -> Vec<MeasuredStop> {
        let of = |(row, s): (usize, &StopRecord)| MeasuredStop {
            row,
            image: s.name.clone(),
            readings: s.readings.clone(),
            placement: String::new(),
            observations: Shared::default(),
            left_out: None,
        };
        self.stops.iter().filter(|s| s.series == series).enumerate().map(of).collect()
    }

    /// Postures of the stops of series without images.
    pub fn postures(&self) -> impl Iterator<Item = Posture> + '_ {
        let readings = self.stops.iter().filter_map(|s| s.readings.clone());
        readings.map(|readings| Posture { readings, approach: None })
    }

    /// The instruments as the columns are named after them.
    pub fn named_instruments(&self) -> Vec<Instrument> {
        let of = |i: &InstrumentRecord| Instrument { name: i.name.clone(), kind: i.kind, component: 0 };
        self.instruments.iter().map(of).collect()
    }
}

fn measurement(solution: &Solution, k: usize, m: &BodyMeasurement) -> MeasurementRecord {
    let problem = &solution.fit.problem;
    let (series, stop) = (&solution.series[m.read.0], m.read.1);
    let part = solution.fit.linearised.body(k);
    let (xyz_m, quat_xyzw) = match &m.seen {
        BodySeen::Point(position) => ((*position).into(), None),
        BodySeen::Pose(pose) => (pose.xyz(), Some(pose.quaternion_xyzw())),
    };
    MeasurementRecord {
        series: series.name.clone(),
        stop,
        name: series.stops[stop].image.clone(),
        instrument: problem.instruments[m.instrument].name.clone(),
        kind: problem.instruments[m.instrument].kind,
        body: problem.bodies[m.body].clone(),
        xyz_m,
        quat_xyzw,
        sigma: [m.sigma_m, m.sigma_rad],
        residual: part.map(|part| part.terms.residual.into()),
        held_out_mm: solution.accuracy.per_body_mm.get(k).copied().flatten(),
        rejection: m.rejected,
    }
}

fn lengths(solution: &Solution, index: usize) -> Vec<LengthRecord> {
    let series = &solution.series[index];
    let is_out = |k: usize| solution.fit.problem.lengths.iter().any(|l| l.left_out && l.read == (index, k));
    series.lengths.iter().enumerate().map(|(k, l)| length(solution, series, l, is_out(k))).collect()
}

fn length(solution: &Solution, series: &MeasuredSeries, l: &SeenLength, left_out: bool) -> LengthRecord {
    let (problem, state) = (&solution.fit.problem, &solution.fit.state);
    let place = |name: &String| {
        let instrument =
            problem.instruments.iter().position(|i| &i.name == name).map(|k| state.instruments[k].translation);
        instrument.or_else(|| Some(state.bodies[problem.bodies.iter().position(|b| b == name)?].translation))
    };
    let [a, b] = l.between.each_ref().map(place);
    LengthRecord {
        series: series.name.clone(),
        between: l.between.clone(),
        distance_m: l.distance_m,
        sigma_m: l.sigma_m,
        fitted_m: a.zip(b).map(|(a, b)| (b - a).norm()),
        left_out,
    }
}

/// What stands still for the first measurement: pose and index of its instrument.
pub(super) fn first_instrument(record: &BodiesRecord) -> Option<(Pose, usize)> {
    let first = record.measurements.first()?;
    let at = record.instruments.iter().position(|i| i.name == first.instrument && i.kind == first.kind)?;
    Some(((&record.instruments[at].pose).into(), at))
}
