//! Identified series to a problem: who shares what, by name.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix2, Vector2};

use super::bodies::Bodies;
use super::local_errors::{local_share, local_terms};
use super::seen_before::SeenBefore;
use crate::assess::Limits;
use crate::error::{Code, Error, Result};
use crate::geom::Pose;
use crate::model::camera::Camera;
use crate::model::plate_modes::DOT_GAIN;
use crate::model::robot::Robot;
use crate::problem::{
    Adjustment, DISPLACEMENT_SIZES, Family, HUBER, Image, ImageRejection, JOINTS_IN_COMMON, Layout, Mark,
    MarkerObservation, MeasuredSeries, MeasuredStop, Names, Noise, PlateShape, Problem, State, Stop, Tie, intern,
    postures_of_run, release_measured_scales, runs,
};
use crate::series::{Edge, Observation, Plate};

/// Standard deviation of an observation whose source states none, px per axis.
const DEFAULT_SIGMA_PX: f64 = 0.1;

/// First guess of the joint noise: from above, rad or m.
pub(in crate::identify) const FIRST_JOINT_NOISE: f64 = 3e-3;

/// First guess of the apparent displacement of the plate in an image: from above, rad or m.
const FIRST_DISPLACEMENT: f64 = 1e-3;

/// The problem at a state whose poses and focal lengths are still unknown (identities; pinhole of one image width).
///
/// With `local_errors` the errors of readings that stops have in common become columns.
pub fn build(robot: &Robot, series: &[MeasuredSeries], local_errors: bool, limits: &Limits) -> Result<Adjustment> {
    let (mut stops, places) = stops_of(series);
    let mut pictured = Pictured::of(series, &places, limits)?;
    let bodies = Bodies::of(series, &places);
    let runs = stops.last().map_or(0, |s| s.series + 1);
    let mut robot = robot.clone();
    let readings = robot.chain.readings.len();
    // A coordinate of a pose is read at many postures of the arm behind it.
    let fewest_in_common = if robot.chain.pose_coordinates().is_some() { readings } else { JOINTS_IN_COMMON };
    if local_errors {
        robot.terms.extend(local_terms(&stops, readings, fewest_in_common, limits.stops_in_common));
        for stop in &mut stops {
            stop.local_share = stop.posture.as_ref().map(|p| local_share(&robot.terms, p)).unwrap_or_default();
        }
    }
    let lenses = std::mem::take(&mut pictured.lenses);
    let state = unknown_state(robot, (&pictured, lenses), &bodies, stops.len());
    let layout = layout(&state, series, &pictured, &bodies);
    let noise = first_noise(&state, &layout, runs, bodies.components);
    let families = (0..pictured.cameras.len()).filter_map(|k| Family::of_field(&layout, &state, k)).collect();
    let mut problem = Problem {
        layout,
        plates: pictured.plates,
        placements: pictured.placements,
        mountings: pictured.mountings,
        cameras: pictured.cameras,
        stops,
        fewest_in_common,
        images: pictured.images,
        instruments: bodies.instruments,
        bodies: bodies.names,
        body_measurements: bodies.measurements,
        lengths: bodies.lengths,
        noise,
        families,
        moved_markers: BTreeSet::new(),
        restraint: None,
        huber: HUBER,
        bounds: limits.bounds(),
    };
    let sizes = if problem.tells_displacements().contains(&true) { DISPLACEMENT_SIZES } else { 1 };
    problem.noise.displacement = vec![FIRST_DISPLACEMENT; runs * sizes];
    Ok(Adjustment { problem, state })
}

/// The values before anything is known: poses are identities.
fn unknown_state(robot: Robot, (pictured, cameras): (&Pictured, Vec<Camera>), bodies: &Bodies, stops: usize) -> State {
    State {
        robot,
        mountings: vec![Pose::identity(); pictured.mountings.len()],
        placements: vec![Pose::identity(); pictured.placements.len()],
        instruments: vec![Pose::identity(); bodies.instruments.len()],
        bodies: vec![Pose::identity(); bodies.names.len()],
        plates: pictured.plates.iter().map(PlateShape::nominal).collect(),
        joint_errors: vec![Vec::new(); stops],
        ties: vec![Tie::Free(Pose::identity()); pictured.images.len()],
        cameras,
    }
}

/// First guesses of the variance components, the joint noise of every run by itself; how many sizes displacements have is not yet known.
fn first_noise(state: &State, layout: &Layout, runs: usize, body_components: usize) -> Noise {
    let readings = state.robot.chain.readings.len();
    Noise {
        pixel_factor: vec![1.0; state.cameras.len()],
        joint: vec![vec![FIRST_JOINT_NOISE; readings]; runs],
        local: first_local(state, layout),
        displacement: Vec::new(),
        marker: Vec::new(),
        body: vec![[1.0; 2]; body_components],
    }
}

/// The columns of the problem: free are those of which the observations tell something and that nobody holds.
fn layout(state: &State, series: &[MeasuredSeries], pictured: &Pictured, bodies: &Bodies) -> Layout {
    let names = Names {
        mountings: &pictured.mountings,
        placements: &pictured.placements,
        cameras: &pictured.cameras,
        plates: &pictured.plate_names,
        instruments: &bodies.instruments,
        bodies: &bodies.names,
    };
    let mut layout = Layout::new(state, &names);
    release_measured_scales(&mut layout, &pictured.plates);
    for s in series.iter().filter(|s| s.known_camera.as_ref().is_some_and(|k| k.held)) {
        let own = pictured.cameras.iter().position(|c| *c == s.camera).map(|k| layout.cameras[k].clone());
        own.into_iter().flatten().for_each(|c| layout.columns[c].free = false);
    }
    bodies.hold_unseen_turns(&mut layout);
    for (plate, shape) in layout.shapes.clone().into_iter().enumerate() {
        let is_circle = |o: &MarkerObservation| o.mark != Mark::Corner;
        let own = pictured.images.iter().filter(|image| image.plate == plate);
        layout.columns[shape.start + DOT_GAIN].free = own.flat_map(|i| i.observations.iter()).any(is_circle);
    }
    layout
}

/// The images of all series, and what they are of, each named once.
#[derive(Default)]
struct Pictured {
    cameras: Vec<String>,
    /// As they start, one a camera.
    lenses: Vec<Camera>,
    mountings: Vec<String>,
    placements: Vec<String>,
    plate_names: Vec<String>,
    /// One a name.
    plates: Vec<Plate>,
    /// Those of one stop follow each other.
    images: Vec<Image>,
}

impl Pictured {
    fn of(series: &[MeasuredSeries], places: &[Vec<usize>], limits: &Limits) -> Result<Self> {
        let (mut all, mut seen_before) = (Self::default(), SeenBefore::default());
        for (index, s) in series.iter().enumerate().filter(|(_, s)| s.has_images) {
            let camera = all.camera(s)?;
            let plate = intern(&mut all.plate_names, &s.plate_name);
            if plate == all.plates.len() {
                all.plates.push(s.plate.clone());
            }
            let mounting = intern(&mut all.mountings, &s.mounting);
            let originals = seen_before.originals(s);
            for (row, stop) in s.stops.iter().enumerate() {
                let observations = measured(stop, s)?;
                let duplicate = originals[row].clone().map(|of| ImageRejection::Duplicate { of });
                let rejected = stop.left_out.clone().or(duplicate).or_else(|| {
                    let found = observations.len();
                    let needed = limits.image_observations;
                    (found < needed).then_some(ImageRejection::TooFewMarkers { found, needed })
                });
                let placement = intern(&mut all.placements, &stop.placement);
                all.images.push(Image {
                    name: stop.image.clone(),
                    series: index,
                    stop: places[index][row],
                    camera,
                    mounting,
                    placement,
                    plate,
                    mount: s.mount,
                    observations: observations.into(),
                    rejected,
                });
            }
        }
        all.images.sort_by_key(|image| image.stop);
        Ok(all)
    }

    /// The camera of a series.
    fn camera(&mut self, s: &MeasuredSeries) -> Result<usize> {
        let camera = intern(&mut self.cameras, &s.camera);
        if camera == self.lenses.len() {
            let known = s.known_camera.as_ref().map(|k| k.camera.clone());
            let unknown = || Camera::pinhole(s.lens, s.width_px, s.height_px, f64::from(s.width_px));
            self.lenses.push(known.unwrap_or_else(unknown));
        }
        let (width, height) = (self.lenses[camera].width_px, self.lenses[camera].height_px);
        if (width, height) != (s.width_px, s.height_px) {
            return Err(Error::new(
                Code::SeriesDisagree,
                format!("series {}", s.name),
                format!(
                    "camera '{}' has images of {}x{} px here and of {width}x{height} px in an earlier series",
                    s.camera, s.width_px, s.height_px
                ),
                "give different cameras different names in [camera] of series.toml",
            ));
        }
        Ok(camera)
    }
}

/// Stops of all series, and those of the rows of each: rows of one place in a run are one stop.
fn stops_of(series: &[MeasuredSeries]) -> (Vec<Stop>, Vec<Vec<usize>>) {
    let (mut stops, mut places) = (Vec::new(), Vec::with_capacity(series.len()));
    for (run, views) in runs(series).enumerate() {
        let first = stops.len();
        let postures = postures_of_run(views);
        let place: BTreeMap<usize, usize> = postures.keys().enumerate().map(|(k, row)| (*row, first + k)).collect();
        stops.extend(postures.into_values().map(|posture| Stop { series: run, posture, local_share: Vec::new() }));
        places.extend(views.iter().map(|s| s.stops.iter().map(|stop| place[&stop.row]).collect::<Vec<_>>()));
    }
    (stops, places)
}

/// First guess of the local error of every reading that has columns for it; 0 for the others.
fn first_local(state: &State, layout: &Layout) -> Vec<f64> {
    let mut first = vec![0.0; state.robot.chain.readings.len()];
    let terms = layout.locals.start - layout.terms.start;
    state.robot.terms[terms..].iter().for_each(|t| first[t.reading] = FIRST_JOINT_NOISE);
    first
}

/// Covariance uu, uv, vv of an observation as the detector states it, px^2; the usual one where it states none.
pub fn stated_covariance(observation: &Observation) -> [f64; 3] {
    observation.covariance.unwrap_or([DEFAULT_SIGMA_PX.powi(2), 0.0, DEFAULT_SIGMA_PX.powi(2)])
}

fn measured(stop: &MeasuredStop, s: &MeasuredSeries) -> Result<Vec<MarkerObservation>> {
    let mut observations = Vec::with_capacity(stop.observations.len());
    for o in &stop.observations {
        let place = || format!("image {}, marker {}", stop.image, o.marker);
        let marker = s.plate.index_of(o.marker).ok_or_else(|| {
            Error::new(
                Code::MarkerUnknown,
                place(),
                "the plate has no such marker",
                "check that plate.toml belongs to this series",
            )
        })?;
        let [uu, uv, vv] = stated_covariance(o);
        let information =
            Matrix2::new(uu, uv, uv, vv).try_inverse().filter(|m| m[(0, 0)] > 0.0 && m.determinant() > 0.0);
        let radius_m = match o.edge {
            Edge::Outer => s.plate.markers[marker].outer_radius_m,
            Edge::Inner => s.plate.markers[marker].inner_radius_m,
        };
        observations.push(MarkerObservation {
            marker,
            edge: o.edge,
            mark: if s.centroid { Mark::of_radius(radius_m) } else { Mark::Corner },
            uv: Vector2::from(o.uv),
            information: information.ok_or_else(|| {
                Error::new(
                    Code::CsvRange,
                    place(),
                    "the covariance is not positive definite",
                    "check cov_uu, cov_uv, cov_vv",
                )
            })?,
            rejected: None,
        });
    }
    observations.sort_by_key(|o| (o.marker, o.edge));
    Ok(observations)
}
