//! What is roughly known before the measurement, as a problem without images.

use std::collections::BTreeSet;
use std::iter;

use nalgebra::{DMatrix, Matrix2, Vector2};

use super::visibility::seen_markers;
use crate::assess::Limits;
use crate::geom::Pose;
use crate::model::camera::Camera;
use crate::model::robot::{Posture, Robot};
use crate::problem::{
    Adjustment, HUBER, Image, JOINTS_IN_COMMON, Layout, Mark, MarkerObservation, Names, Noise, PlateShape, Problem,
    State, Stop, Tie, predict,
};
use crate::series::{CameraMount, Edge, Marker, Plate};

/// Robot, camera and plates as far as they are known.
#[derive(Debug, Clone)]
pub struct Setting {
    /// The robot with the joint terms that shall be found.
    pub robot: Robot,
    /// The camera.
    pub camera: Camera,
    /// Where the camera is.
    pub mount: CameraMount,
    /// `flange_from_camera`, or `base_from_camera` of a fixed camera.
    pub mounting: Pose,
    /// Names and poses of the places where the plate may stand: `base_from_plate`, or `flange_from_plate`.
    pub placements: Vec<(String, Pose)>,
    /// The plate.
    pub plate: Plate,
    /// Standard deviation of an observation, px per axis.
    pub pixel_sigma_px: f64,
    /// Joint noise of every reading, rad or m.
    pub joint_sigma: Vec<f64>,
    /// What images that were taken have beside.
    pub beside: Beside,
}

/// Cameras, mountings and placements of images that were taken, beside those that are planned for: they have columns of their own, behind them.
#[derive(Debug, Clone, Default)]
pub struct Beside {
    /// Cameras by name.
    pub cameras: Vec<(String, Camera)>,
    /// Mountings by name, as [`Setting::mounting`].
    pub mountings: Vec<(String, Pose)>,
    /// Placements by name, as [`Setting::placements`].
    pub placements: Vec<(String, Pose)>,
}

/// A stop with the images that are taken at it: one, or several of as many cameras, which have its joint noise in common.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedStop {
    /// Joint readings.
    pub posture: Posture,
    /// The images, one or more.
    pub images: Vec<Image>,
}

/// Images that were taken at stops.
pub fn images_of(stops: &[PlannedStop]) -> usize {
    stops.iter().map(|stop| stop.images.len()).sum()
}

/// The least joint noise that is planned with, rad or m.
const LEAST_JOINT_SIGMA: f64 = 1e-6;

impl Setting {
    /// A problem with the columns of this setting and no image, at the state about which it is linearised.
    pub fn adjustment(&self) -> Adjustment {
        let Beside { cameras, mountings, placements } = &self.beside;
        let own = [("hand_camera".to_owned(), self.mounting)];
        let (mounting_names, mountings): (Vec<_>, Vec<_>) = own.into_iter().chain(mountings.iter().cloned()).unzip();
        let placed = self.placements.iter().chain(placements).cloned();
        let (placement_names, placements): (Vec<_>, Vec<_>) = placed.unzip();
        let own = [("camera".to_owned(), self.camera.clone())];
        let (camera_names, cameras): (Vec<_>, Vec<_>) = own.into_iter().chain(cameras.iter().cloned()).unzip();
        let state = State {
            robot: self.robot.clone(),
            mountings,
            placements,
            instruments: Vec::new(),
            bodies: Vec::new(),
            cameras,
            plates: vec![PlateShape::nominal(&self.plate)],
            joint_errors: Vec::new(),
            ties: Vec::new(),
        };
        let mut layout = Layout::new(
            &state,
            &Names {
                mountings: &mounting_names,
                placements: &placement_names,
                cameras: &camera_names,
                plates: &["plate".to_owned()],
                ..Names::default()
            },
        );
        if let Some(sigma) = scale_sigma(&self.plate) {
            layout.columns[layout.shapes[0].start].prior_sigma = sigma;
        }
        let joint = self.joint_sigma.iter().map(|s| s.max(LEAST_JOINT_SIGMA)).collect();
        let problem = Problem {
            layout,
            plates: vec![self.plate.clone()],
            noise: Noise { pixel_factor: vec![1.0; camera_names.len()], joint: vec![joint], ..Noise::default() },
            placements: placement_names,
            mountings: mounting_names,
            cameras: camera_names,
            stops: Vec::new(),
            fewest_in_common: JOINTS_IN_COMMON,
            images: Vec::new(),
            instruments: Vec::new(),
            bodies: Vec::new(),
            body_measurements: Vec::new(),
            lengths: Vec::new(),
            families: Vec::new(),
            moved_markers: BTreeSet::new(),
            restraint: None,
            // Predictions have no residuals, so that it never acts.
            huber: HUBER,
            bounds: Limits::default().bounds(),
        };
        Adjustment { problem, state }
    }

    /// An adjustment of this setting with the images of some stops, nothing known yet of their joint errors.
    pub fn with_stops(&self, planned: &Adjustment, stops: Vec<PlannedStop>) -> Adjustment {
        let mut with = planned.clone();
        for (k, PlannedStop { posture, images }) in stops.into_iter().enumerate() {
            with.problem.images.extend(images.into_iter().map(|image| Image { stop: k, ..image }));
            with.problem.stops.push(Stop { series: 0, posture: Some(posture), local_share: Vec::new() });
        }
        with.state.joint_errors = vec![vec![0.0; self.joint_sigma.len()]; with.problem.stops.len()];
        with.state.ties = vec![Tie::Rigid; with.problem.images.len()];
        with
    }

    /// Adds placements that are planned for, and the stops that were taken with those beside behind them.
    #[must_use]
    pub fn with_further_placements(
        &mut self,
        new: Vec<(String, Pose)>,
        mut taken: Vec<PlannedStop>,
    ) -> Vec<PlannedStop> {
        let (own, added) = (self.placements.len(), new.len());
        self.placements.extend(new);
        let beside = taken.iter_mut().flat_map(|stop| &mut stop.images).filter(|image| image.placement >= own);
        beside.for_each(|image| image.placement += added);
        taken
    }

    /// `camera_from_plate` at joint readings.
    pub fn camera_from_plate(&self, readings: &[f64], placement: usize) -> Pose {
        let tip = self.robot.base_from_tip(readings);
        self.mount.camera_from_plate(&self.mounting, &tip, &self.placements[placement].1)
    }

    /// `base_from_plate` for a view `plate_from_camera`.
    pub fn base_from_plate(&self, plate_from_camera: &Pose, placement: usize) -> Pose {
        match self.mount {
            CameraMount::Hand => self.placements[placement].1,
            CameraMount::Fixed => self.mounting * plate_from_camera.inverse(),
        }
    }

    /// `base_from_tip` for a view `plate_from_camera`.
    pub fn base_from_tip(&self, plate_from_camera: &Pose, placement: usize) -> Pose {
        let plate = &self.placements[placement].1;
        match self.mount {
            CameraMount::Hand => *plate * *plate_from_camera * self.mounting.inverse(),
            CameraMount::Fixed => self.mounting * plate_from_camera.inverse() * plate.inverse(),
        }
    }

    /// The stop with the image that would be taken: every marker seen, observed where it is predicted. `None` where nothing is seen.
    pub fn stop(&self, state: &State, name: &str, readings: &[f64], placement: usize) -> Option<PlannedStop> {
        let seen = seen_markers(&self.plate, &self.camera, &self.camera_from_plate(readings, placement));
        self.stop_seeing(state, name, (readings, placement, &seen))
    }

    /// The same, where the markers that are seen are known by their indices.
    pub fn stop_seeing(&self, state: &State, name: &str, stop: (&[f64], usize, &[usize])) -> Option<PlannedStop> {
        self.stop_of(state, name, stop, |marker| {
            let inner = Some((Edge::Inner, marker.inner_radius_m, 1.0)).filter(|(_, radius_m, _)| *radius_m > 0.0);
            iter::once((Edge::Outer, marker.outer_radius_m, 1.0)).chain(inner)
        })
    }

    /// The same, from readings, placement and the indices of the markers seen, with one point for all contours of a marker, as exact as all
    /// together: where a circle is small, its image moves as that of its middle.
    pub fn stop_of_middles(&self, state: &State, stop: (&[f64], usize, &[usize])) -> Option<PlannedStop> {
        self.stop_of(state, "", stop, |marker| {
            let contours = if marker.inner_radius_m > 0.0 { 2.0 } else { 1.0 };
            iter::once((Edge::Outer, 0.0, contours))
        })
    }

    /// A stop, from readings and placement, at which these contours are seen of some markers: with radius, m (0: a point), and how often.
    fn stop_of<I: Iterator<Item = (Edge, f64, f64)>>(
        &self,
        state: &State,
        name: &str,
        (readings, placement, seen): (&[f64], usize, &[usize]),
        contours: impl Fn(&Marker) -> I,
    ) -> Option<PlannedStop> {
        let pose = self.camera_from_plate(readings, placement);
        let mut image = Image {
            name: name.to_owned(),
            series: 0,
            stop: 0,
            camera: 0,
            mounting: 0,
            placement,
            plate: 0,
            mount: self.mount,
            observations: Vec::new().into(),
            rejected: None,
        };
        let information = Matrix2::identity() * self.pixel_sigma_px.powi(-2);
        for &marker in seen {
            for (edge, radius_m, times) in contours(&self.plate.markers[marker]) {
                let mut o = MarkerObservation {
                    marker,
                    edge,
                    mark: Mark::of_radius(radius_m),
                    uv: Vector2::zeros(),
                    information: information * times,
                    rejected: None,
                };
                o.uv = predict(&image, state, &pose, &o)?.uv;
                image.observations.push(o);
            }
        }
        let posture = Posture::at(readings);
        (!image.observations.is_empty()).then_some(PlannedStop { posture, images: vec![image] })
    }
}

/// Standard deviation of the plate's scale from its measured distance, as a share; `None` where none was measured.
pub fn scale_sigma(plate: &Plate) -> Option<f64> {
    let bar = plate.scale?;
    let [a, b] = [bar.from, bar.to].map(|id| plate.index_of(id).map(|k| &plate.markers[k]));
    let (a, b) = (a?, b?);
    let variance = bar.sigma_m.powi(2) + a.sigma_m.powi(2) + b.sigma_m.powi(2);
    Some(variance.sqrt() / (a.position_m - b.position_m).norm())
}

/// Information that is assumed of columns without a prior, because something is roughly known: 1/sigma^2 on the diagonal.
pub fn rough_knowledge(problem: &Problem, camera: &Camera) -> DMatrix<f64> {
    let focal = camera.parameters[0];
    let sigma = |k: usize| {
        let c = &problem.layout.columns[k];
        let mounting = problem.layout.mountings.iter().any(|m| m.contains(&k));
        match (c.unit, mounting) {
            _ if c.prior_sigma.is_finite() => c.prior_sigma,
            ("m", true) => 0.1,
            ("rad", true) => 0.3,
            ("px", _) => 0.5 * focal,
            _ => 1.0,
        }
    };
    let n = problem.layout.len();
    DMatrix::from_fn(n, n, |i, j| if i == j { sigma(i).powi(-2) } else { 0.0 })
}
