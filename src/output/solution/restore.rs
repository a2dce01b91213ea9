//! solution.json back into what a solve goes from, and into the model that it found.

use std::collections::BTreeSet;
use std::path::Path;

use nalgebra::{DMatrix, Vector3, Vector6};

use super::bodies_record::first_instrument;
use super::series_record::StopNoise;
use super::solution_json::{CameraRecord, ImageRecord, PlateRecord, SeriesRecord, SolutionRecord};
use crate::assess::{FlangeModel, Limits, Standing, usual_joint_sigma};
use crate::error::{Code, Error, Result};
use crate::frames::{KnownRobot, TouchedMarker};
use crate::geom::Pose;
use crate::identify::Options;
use crate::model::camera::Camera;
use crate::model::joint_terms::{JointTerm, Term};
use crate::model::plate_modes::MODES;
use crate::model::robot::{Posture, Robot};
use crate::problem::{Layout, Names, PlateShape, State};
use crate::problem::{MeasuredSeries, MeasuredStop, Shared};
use crate::series::{Marker, Observation, Plate};
use crate::urdf::{Chain, RobotDescription};

fn damaged(what: impl std::fmt::Display) -> Error {
    Error::new(
        Code::SolutionDamaged,
        super::solution_json::FILE_NAME,
        what,
        "give the solution.json as `robotcal identify` wrote it",
    )
}

/// The robot as it was read.
///
/// # Errors
/// A text that is no URDF.
pub fn robot_description(record: &SolutionRecord) -> Result<RobotDescription> {
    RobotDescription::from_text(Path::new(&record.urdf.file), record.urdf.text.clone())
}

/// The options that were used; of older files, which have them in words, those that change what is fitted.
pub fn options(record: &SolutionRecord) -> Options {
    let in_part = || Options { estimator: record.estimator, payload: record.robot.payload, ..Options::default() };
    record.options.clone().unwrap_or_else(in_part)
}

/// The chain that was solved for.
///
/// # Errors
/// Links that the URDF does not have.
pub fn chain(record: &SolutionRecord, description: &RobotDescription, base: &str, tip: &str) -> Result<Chain> {
    let mut chain = description.chain(Some(base), Some(tip))?.carrying(record.robot.payload.as_ref())?;
    // What was found before the fit does not stand in the URDF.
    for joint in &mut chain.joints {
        let found = record.robot.joints.iter().find(|j| j.found.is_some() && j.name == joint.name);
        if let Some(record) = found {
            (joint.origin, joint.found) = ((&record.nominal_origin).into(), record.found);
        }
    }
    Ok(chain)
}

fn plate(p: &PlateRecord) -> Result<Plate> {
    let n = p.id.len();
    if [p.nominal_m.len(), p.radii_m.len(), p.prior_sigma_m.len(), p.correction_m.len()].iter().any(|len| *len != n) {
        return Err(damaged(format!("plate '{}' has columns of different lengths", p.name)));
    }
    let marker = |k: usize| Marker {
        id: p.id[k],
        position_m: Vector3::from(p.nominal_m[k]),
        outer_radius_m: p.radii_m[k][0],
        inner_radius_m: p.radii_m[k][1],
        sigma_m: p.prior_sigma_m[k],
    };
    Ok(Plate {
        name: p.stated_name.clone(),
        kind: p.kind,
        columns: p.columns,
        rows: p.rows,
        pitch_m: p.pitch_m,
        tolerance_m: p.tolerance_m,
        aruco: None,
        tags: p.tags.clone(),
        puzzle: p.puzzle,
        large: Vec::new(),
        scale: p.scale,
        markers: (0..n).map(marker).collect(),
    })
}

fn stop(row: usize, image: &ImageRecord, series: &str, placements: &[String]) -> Result<MeasuredStop> {
    let o = &image.observations;
    if [o.edge.len(), o.uv.len(), o.covariance.len()].iter().any(|len| *len != o.marker.len()) {
        return Err(damaged(format!("image {} has columns of different lengths", image.name)));
    }
    let observation =
        |k: usize| Observation { marker: o.marker[k], edge: o.edge[k], uv: o.uv[k], covariance: Some(o.covariance[k]) };
    let observations: Shared<Vec<Observation>> = (0..o.marker.len()).map(observation).collect();
    let placement = placements.get(image.placement);
    let prefix = format!("{series}/");
    Ok(MeasuredStop {
        row: image.row.unwrap_or(row),
        image: image.name.strip_prefix(&prefix).unwrap_or(&image.name).to_owned(),
        readings: image.readings.clone(),
        placement: placement.ok_or_else(|| damaged(format!("image {} has no placement", image.name)))?.clone(),
        left_out: image.rejection().filter(|r| observations.is_empty() || r.is_of_detection()),
        observations,
    })
}

/// Other postures of every stop, where readings were computed.
fn other_postures(series: &SeriesRecord, stops: &[MeasuredStop]) -> Vec<Vec<Vec<f64>>> {
    if series.other_postures.is_empty() {
        return Vec::new();
    }
    stops.iter().map(|stop| series.other_postures.get(&stop.image).cloned().unwrap_or_default()).collect()
}

/// Everything that was measured, ready to be solved again: what the solve had left out takes part again.
///
/// # Errors
/// A file that does not hang together.
pub fn measured_series(record: &SolutionRecord) -> Result<Vec<MeasuredSeries>> {
    let placements: Vec<String> = record.placements.iter().map(|p| p.name.clone()).collect();
    let plates: Vec<Plate> = record.plates.iter().map(plate).collect::<Result<_>>()?;
    let series = record.series.iter().map(|s| {
        let (bodies, lengths) = (record.bodies.seen(&s.name), record.bodies.seen_lengths(&s.name));
        if !s.has_images {
            let own = MeasuredSeries::without_images(&s.name, s.order_known, record.bodies.stops_of(&s.name));
            let postures = other_postures(s, &own.stops);
            return Ok(MeasuredSeries { run: s.run.clone(), bodies, lengths, postures, ..own });
        }
        let of_plate = || damaged(format!("series {} has no plate", s.name));
        let stops = record.images.iter().filter(|i| i.series == s.name).enumerate();
        let stops: Vec<MeasuredStop> =
            stops.map(|(row, i)| stop(row, i, &s.name, &placements)).collect::<Result<_>>()?;
        Ok(MeasuredSeries {
            name: s.name.clone(),
            run: s.run.clone(),
            camera: s.camera.clone(),
            mounting: s.mounting.clone(),
            mount: s.camera_mount,
            width_px: s.width_px,
            height_px: s.height_px,
            focal_px: s.focal_px,
            known_camera: s.known_camera.clone(),
            lens: s.lens,
            lens_choice: s.lens_choice,
            centroid: s.centroid,
            plate: plates.get(s.plate).ok_or_else(of_plate)?.clone(),
            plate_name: format!("{} {}", record.plates[s.plate].name, s.plate),
            has_images: true,
            bodies,
            lengths,
            order_known: s.order_known,
            otherwise: Vec::new(),
            postures: other_postures(s, &stops),
            stops,
        })
    });
    series.collect()
}

/// A camera as it was found.
pub fn camera(c: &CameraRecord) -> Camera {
    let parameters = c.parameters.iter().map(|(_, v)| *v).collect();
    Camera { lens: c.lens, width_px: c.width_px, height_px: c.height_px, parameters }
}

/// Nearest and farthest plate centre that each camera saw, m.
pub fn depths_of_record(record: &SolutionRecord) -> Vec<[f64; 2]> {
    let seen = |camera: usize| {
        let poses = record.images.iter().filter(move |i| i.camera == camera && i.is_used());
        poses.filter_map(|i| i.free_pose.as_ref()).map(|f| Pose::from(&f.plate_from_camera).inverse().translation.z)
    };
    let range = |k: usize| match (seen(k).reduce(f64::min), seen(k).reduce(f64::max)) {
        (Some(near), Some(far)) if near > 0.0 => [near, far],
        _ => [1.0, 1.0],
    };
    (0..record.cameras.len()).map(range).collect()
}

/// The model that a solution found, with its covariance.
#[derive(Debug, Clone)]
pub struct FoundModel {
    /// The robot that is stated: twists and joint terms, no local errors.
    pub robot: Robot,
    /// All columns, those of local errors among them.
    pub layout: Layout,
    /// What stands still in the base frame for most images on the robot, and its first column.
    pub still: Option<(Pose, usize)>,
    /// Covariance of the columns of `layout`, m and rad, with the plates in the frames of their nominal markers, as `still` is.
    pub covariance: DMatrix<f64>,
    /// Stops of the images in use.
    pub stops: Vec<Posture>,
    /// Joint noise of a stop, root mean square over the series, rad or m.
    pub joint_sigma: Vec<f64>,
    /// Upper ends of its 95 % intervals, rad or m: no more than no robot in order has, and the noise itself where it counts as known.
    pub joint_most: Vec<f64>,
    /// Numbers that decide.
    pub limits: Limits,
}

/// The robot of a record as its own readings drive it: offsets, twists and all joint terms.
fn found_robot(record: &SolutionRecord) -> Result<Robot> {
    let chain = chain(record, &robot_description(record)?, &record.robot.base, &record.robot.tip)?;
    if chain.joints.len() != record.robot.joints.len() || chain.readings != record.robot.readings {
        return Err(damaged("robot and URDF text do not belong together"));
    }
    let twists = record.robot.joints.iter().map(|j| Vector6::from(j.twist)).collect();
    let terms = record.robot.terms.iter().chain(&record.robot.local_errors).map(|t| {
        let reading = chain.readings.iter().position(|r| *r == t.reading);
        let known = reading.zip(Term::from_name(&t.term));
        known
            .map(|(reading, term)| JointTerm { reading, term, value: t.value })
            .ok_or_else(|| damaged(format!("joint term {}.{} is not known", t.reading, t.term)))
    });
    let terms = terms.collect::<Result<Vec<_>>>()?;
    Ok(Robot { chain, twists, terms })
}

/// What the controller of the exported robot adds to the readings that the robot was identified from, rad or m; none where the corrected
/// URDF holds all offsets.
///
/// # Errors
/// A file that does not hang together.
pub fn entered_offsets(record: &SolutionRecord) -> Result<Vec<f64>> {
    match (record.offsets_in_mastering, record.offsets_to_enter.is_empty()) {
        (false, _) => Ok(vec![0.0; record.robot.readings.len()]),
        (true, false) => Ok(record.offsets_to_enter.clone()),
        (true, true) => {
            // Zeros that were found before the fit stood in the URDF then.
            let mut robot = found_robot(record)?;
            robot.chain.joints.iter_mut().for_each(|j| j.found = None);
            Ok(robot.zero_corrections())
        }
    }
}

/// The robot that the files of a record describe, corrected URDF with compensation.toml, for the readings of the controller to which they
/// belong: with the offsets entered that are not in them.
///
/// # Errors
/// A file that does not hang together.
pub fn exported_robot(record: &SolutionRecord) -> Result<Robot> {
    Ok(found_robot(record)?.without_local_errors().mastered_by(&entered_offsets(record)?))
}

/// The model of a record for the readings of the controller to which its exported files belong, as of [`exported_robot`].
///
/// # Errors
/// A file that does not hang together.
pub fn exported_model(record: &SolutionRecord) -> Result<FoundModel> {
    let (mut model, entered) = (found_model(record)?, entered_offsets(record)?);
    if entered.iter().any(|offset| *offset != 0.0) {
        // The parameters of the robot come first, and those of local errors and poses stay.
        let own = model.robot.mastered_by_own(&entered);
        let mut of_all = DMatrix::identity(model.layout.len(), model.layout.len());
        of_all.view_mut((0, 0), own.shape()).copy_from(&own);
        model.covariance = &of_all * &model.covariance * of_all.transpose();
    }
    model.robot = exported_robot(record)?;
    model.stops.iter_mut().for_each(|stop| add(&mut stop.readings, &entered));
    Ok(model)
}

/// The markers of the plates that stood at a placement.
pub fn markers_at(record: &SolutionRecord, placement: usize) -> Vec<TouchedMarker> {
    let plates: BTreeSet<usize> = record.images.iter().filter(|i| i.placement == placement).map(|i| i.plate).collect();
    let plates = plates.into_iter().filter_map(|p| record.plates.get(p));
    let markers = plates.flat_map(|p| p.nominal_m.iter().zip(&p.position_m));
    markers.map(|(nominal, found)| TouchedMarker { nominal: (*nominal).into(), found: (*found).into() }).collect()
}

/// Adds offsets to readings.
pub fn add(readings: &mut [f64], offsets: &[f64]) {
    readings.iter_mut().zip(offsets).for_each(|(reading, offset)| *reading += offset);
}

/// The model of a record, for the readings that it was identified from.
///
/// # Errors
/// A file that does not hang together.
pub fn found_model(record: &SolutionRecord) -> Result<FoundModel> {
    let state = found_state(record)?;
    let names = |all: &[super::solution_json::PlacedRecord]| all.iter().map(|p| p.name.clone()).collect::<Vec<_>>();
    let cameras: Vec<String> = record.cameras.iter().map(|c| c.name.clone()).collect();
    let plates: Vec<String> = record.plates.iter().map(|p| p.name.clone()).collect();
    let [mountings, placements, bodies] =
        [&record.mountings, &record.placements, &record.bodies.bodies].map(|all| names(all));
    let names = Names {
        mountings: &mountings,
        placements: &placements,
        cameras: &cameras,
        plates: &plates,
        instruments: &record.bodies.named_instruments(),
        bodies: &bodies,
    };
    let layout = found_layout(record, &state, &names)?;
    let n = layout.len();
    let at = |i: usize, j: usize| record.covariance_lower[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)];
    let used = || record.images.iter().filter(|i| i.is_used());
    let stop = |i: &ImageRecord| i.readings.clone().map(|readings| Posture { readings, approach: i.approach.clone() });
    let standing = used().filter(|i| i.is_on_robot()).map(|i| Standing::of(i.camera_mount, i.mounting, i.placement));
    let still = Standing::of_most(standing, &names).map(|standing| standing.placed(&state, &layout));
    let of_instrument = || first_instrument(&record.bodies).map(|(pose, k)| (pose, layout.instruments[k].start));
    let still = still.or_else(of_instrument);
    Ok(FoundModel {
        limits: record.limits(),
        joint_sigma: of_readings(record, |noise| noise.joint.clone()),
        joint_most: of_readings(record, |noise| most_noise(noise, &record.limits())),
        covariance: DMatrix::from_fn(n, n, at),
        stops: used().filter_map(stop).chain(record.bodies.postures()).collect(),
        robot: state.robot.without_local_errors(),
        layout,
        still,
    })
}

fn found_state(record: &SolutionRecord) -> Result<State> {
    Ok(State {
        robot: found_robot(record)?,
        mountings: record.mountings.iter().map(|m| (&m.pose).into()).collect(),
        placements: record.placements.iter().map(|p| (&p.pose).into()).collect(),
        instruments: record.bodies.instruments.iter().map(|i| (&i.pose).into()).collect(),
        bodies: record.bodies.bodies.iter().map(|b| (&b.pose).into()).collect(),
        cameras: record.cameras.iter().map(camera).collect(),
        plates: record.plates.iter().map(|p| plate(p).map(|p| PlateShape::nominal(&p))).collect::<Result<_>>()?,
        joint_errors: Vec::new(),
        ties: Vec::new(),
    })
}

/// The columns, with what was held of them and their priors.
fn found_layout(record: &SolutionRecord, state: &State, names: &Names) -> Result<Layout> {
    let mut layout = Layout::new(state, names);
    let n = layout.len();
    if record.estimates.len() != n || record.covariance_lower.len() != n * (n + 1) / 2 {
        return Err(damaged(format!("there are {} estimates for {n} parameters", record.estimates.len())));
    }
    debug_assert_eq!(MODES, layout.shapes.first().map_or(MODES, |r| r.len()));
    for (column, e) in layout.columns.iter_mut().zip(&record.estimates) {
        column.free = e.free;
        column.prior_sigma = e.prior_sigma.unwrap_or(f64::INFINITY);
        column.prior_mean = e.prior_mean.unwrap_or(0.0);
    }
    Ok(layout)
}

/// A number of each reading from every series, root mean square; of the cameras in files that know the noise of them only.
fn of_readings(record: &SolutionRecord, of: impl Fn(&StopNoise) -> Vec<f64>) -> Vec<f64> {
    let all: Vec<Vec<f64>> = record.stop_noise().iter().map(|(_, noise)| of(noise)).collect();
    let readings = record.robot.readings.len();
    let found = usual_joint_sigma(&all);
    if found.len() == readings { found } else { vec![0.0; readings] }
}

/// Upper ends of the intervals of joint noise.
fn most_noise(noise: &StopNoise, limits: &Limits) -> Vec<f64> {
    let most = |(r, sigma): (usize, &f64)| match noise.joint_interval.get(r) {
        Some([_, most]) => most.unwrap_or(f64::INFINITY).min(limits.unusual_joint_noise).max(*sigma),
        None => *sigma,
    };
    noise.joint.iter().enumerate().map(most).collect()
}

impl FoundModel {
    /// The robot as measured frames go with it; with the plate of a placement, whose pose is known as the robot is.
    ///
    /// # Errors
    /// A covariance that is not finite.
    pub fn known_robot(&self, placement: Option<usize>) -> Result<KnownRobot> {
        let plate = placement.map(|p| self.layout.placements[p].start);
        let (stops, joint) = (self.stops.clone(), self.joint_sigma.clone());
        KnownRobot::new(&self.robot, &self.layout, &self.covariance, plate, joint, stops)
            .ok_or_else(|| damaged("the covariance is not finite"))
    }

    /// The flange anywhere; `None` where robot and plate (or fixed camera) are not tied.
    pub fn flange(&self) -> Option<FlangeModel<'_>> {
        FlangeModel::new(&self.robot, &self.layout, self.still?, &self.covariance, &self.stops, &self.limits)
    }
}
