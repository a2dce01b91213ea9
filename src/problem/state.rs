//! Every unknown, with its value.

use nalgebra::{DVector, SMatrix, SVector, Vector2, Vector3, Vector6};

use super::linearise::{seen_centre, tilt_axes};
use super::{Image, Layout};
use crate::geom::Pose;
use crate::model::camera::Camera;
use crate::model::plate_modes::{MODES, basis};
use crate::model::robot::Robot;
use crate::series::Plate;

/// Number of tilts behind the joint noise of a stop.
const TILTS: usize = 2;

/// What an image may deviate by from the pose that the robot says.
#[derive(Debug, Clone, PartialEq)]
pub enum Slack {
    /// Free camera pose: the image has no tie to the robot (`camera_from_plate`).
    Pose(Pose),
    /// Joint noise of this stop, rad or m per reading; where two values follow, they are the apparent tilt of the plate about
    /// its x and y axes, rad: what smooth errors of an image (lens, focus, air) do to the pose that it shows.
    Joints(Vec<f64>),
    /// None: readings are exact.
    None,
}

impl Slack {
    /// Joint noise of a stop, with or without tilt, all zero.
    pub fn exact(readings: usize, tilts: bool) -> Self {
        Self::Joints(vec![0.0; readings + if tilts { TILTS } else { 0 }])
    }

    /// Number of unknowns.
    pub fn len(&self) -> usize {
        match self {
            Self::Pose(_) => 6,
            Self::Joints(dq) => dq.len(),
            Self::None => 0,
        }
    }

    /// True where there is no unknown.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Apparent tilt of the plate about its x and y axes, rad; `None` where there is none for a robot with this many readings.
    pub fn tilt(&self, readings: usize) -> Option<[f64; 2]> {
        match self {
            Self::Joints(values) => values.get(readings..).and_then(|t| t.try_into().ok()),
            _ => None,
        }
    }

    fn moved(&self, step: &[f64]) -> Self {
        match self {
            Self::Pose(pose) => Self::Pose(pose.perturbed(&Vector6::from_column_slice(step))),
            Self::Joints(dq) => Self::Joints(dq.iter().zip(step).map(|(q, s)| q + s).collect()),
            Self::None => Self::None,
        }
    }
}

/// Deviation of a plate from nominal.
#[derive(Debug, Clone, PartialEq)]
pub struct PlateShape {
    /// Amplitudes of the modes of [`crate::model::plate_modes`].
    pub modes: [f64; MODES],
    /// Correction of each marker on top of the modes, m.
    pub corrections: Vec<Vector3<f64>>,
    /// Nominal positions, m.
    pub nominal: Vec<Vector3<f64>>,
    /// Largest distance of a marker from the centre, m.
    pub half_diagonal_m: f64,
}

impl PlateShape {
    /// The nominal shape.
    pub fn nominal(plate: &Plate) -> Self {
        let nominal: Vec<_> = plate.markers.iter().map(|m| m.position_m).collect();
        Self {
            modes: [0.0; MODES],
            corrections: vec![Vector3::zeros(); nominal.len()],
            half_diagonal_m: nominal.iter().map(Vector3::norm).fold(0.0, f64::max),
            nominal,
        }
    }

    /// How a marker moves with the modes.
    #[inline(always)]
    pub fn modes_at(&self, marker: usize) -> SMatrix<f64, 3, MODES> {
        basis(&self.nominal[marker], self.half_diagonal_m)
    }

    /// Position of a marker in the plate frame, m.
    pub fn position(&self, marker: usize) -> Vector3<f64> {
        self.position_by(&self.modes_at(marker), marker)
    }

    /// The same, where what the modes do is at hand.
    #[inline(always)]
    pub fn position_by(&self, modes: &SMatrix<f64, 3, MODES>, marker: usize) -> Vector3<f64> {
        self.nominal[marker] + modes * SVector::from(self.modes) + self.corrections[marker]
    }
}

/// Every unknown of the problem.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Robot.
    pub robot: Robot,
    /// Camera poses: `flange_from_camera`, or `base_from_camera` for a fixed camera.
    pub mountings: Vec<Pose>,
    /// Plate poses: `base_from_plate`, or `flange_from_plate` for a fixed camera.
    pub placements: Vec<Pose>,
    /// Cameras.
    pub cameras: Vec<Camera>,
    /// Plates.
    pub plates: Vec<PlateShape>,
    /// Slack of every image.
    pub slack: Vec<Slack>,
}

/// A step of every unknown.
#[derive(Debug, Clone)]
pub struct Step {
    /// Dense columns.
    pub dense: DVector<f64>,
    /// Slack of every image (empty for one that takes no part).
    pub slack: Vec<Vec<f64>>,
    /// Marker corrections, per plate.
    pub markers: Vec<Vec<Vector3<f64>>>,
}

fn twist(step: &DVector<f64>, start: usize) -> Vector6<f64> {
    step.fixed_rows::<6>(start).into_owned()
}

impl State {
    /// The state after a step.
    pub fn moved(&self, layout: &Layout, step: &Step) -> Self {
        let mut next = self.clone();
        let x = &step.dense;
        for (k, xi) in next.robot.twists.iter_mut().enumerate() {
            *xi += twist(x, layout.twists.start + 6 * k);
        }
        for (k, term) in next.robot.terms.iter_mut().enumerate() {
            term.value += x[layout.terms.start + k];
        }
        for (pose, range) in next.mountings.iter_mut().zip(&layout.mountings) {
            *pose = pose.perturbed(&twist(x, range.start));
        }
        for (pose, range) in next.placements.iter_mut().zip(&layout.placements) {
            *pose = pose.perturbed(&twist(x, range.start));
        }
        for (camera, range) in next.cameras.iter_mut().zip(&layout.cameras) {
            camera.parameters.iter_mut().zip(range.clone()).for_each(|(p, c)| *p += x[c]);
        }
        for (k, plate) in next.plates.iter_mut().enumerate() {
            plate.modes.iter_mut().zip(layout.shapes[k].clone()).for_each(|(m, c)| *m += x[c]);
            plate.corrections.iter_mut().zip(&step.markers[k]).for_each(|(m, s)| *m += s);
        }
        for (slack, s) in next.slack.iter_mut().zip(&step.slack) {
            if !s.is_empty() {
                *slack = slack.moved(s);
            }
        }
        next
    }

    /// Values of the columns that have a prior (others are poses on a manifold and give zero).
    pub fn values(&self, layout: &Layout) -> DVector<f64> {
        let mut v = DVector::zeros(layout.len());
        for (k, xi) in self.robot.twists.iter().enumerate() {
            v.fixed_rows_mut::<6>(layout.twists.start + 6 * k).copy_from(xi);
        }
        for (k, term) in self.robot.terms.iter().enumerate() {
            v[layout.terms.start + k] = term.value;
        }
        for (camera, range) in self.cameras.iter().zip(&layout.cameras) {
            camera.parameters.iter().zip(range.clone()).for_each(|(p, c)| v[c] = *p);
        }
        for (plate, range) in self.plates.iter().zip(&layout.shapes) {
            plate.modes.iter().zip(range.clone()).for_each(|(m, c)| v[c] = *m);
        }
        v
    }

    /// Sets the value of one column; components of poses have none and stay.
    pub fn set_value(&mut self, layout: &Layout, column: usize, value: f64) {
        if layout.twists.contains(&column) {
            let k = column - layout.twists.start;
            self.robot.twists[k / 6][k % 6] = value;
        } else if layout.terms.contains(&column) {
            self.robot.terms[column - layout.terms.start].value = value;
        }
        for (camera, range) in self.cameras.iter_mut().zip(&layout.cameras).filter(|(_, r)| r.contains(&column)) {
            camera.parameters[column - range.start] = value;
        }
        for (plate, range) in self.plates.iter_mut().zip(&layout.shapes).filter(|(_, r)| r.contains(&column)) {
            plate.modes[column - range.start] = value;
        }
    }

    /// Pose of the camera of an image as these unknowns say.
    pub fn camera_from_plate(&self, image: &Image, slack: &Slack) -> Option<Pose> {
        let exact;
        let dq = match (slack, &image.stop) {
            (Slack::Pose(pose), _) => return Some(*pose),
            (Slack::Joints(dq), Some(_)) => dq,
            (_, Some(stop)) => {
                exact = vec![0.0; stop.readings.len()];
                &exact
            }
            (_, None) => return None,
        };
        let tip = self.robot.pose_at(image.stop.as_ref()?, dq);
        let pose =
            image.mount.camera_from_plate(&self.mountings[image.mounting], &tip, &self.placements[image.placement]);
        let Some([x, y]) = slack.tilt(image.stop.as_ref()?.readings.len()) else { return Some(pose) };
        Some(pose * Pose::exp(&(tilt_axes(&seen_centre(image, self)) * Vector2::new(x, y))))
    }
}
