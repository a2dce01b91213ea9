//! From a solution to the record in solution.json.

use std::collections::BTreeSet;

use nalgebra::Matrix6;

use super::Context;
use super::bodies_record::BodiesRecord;
use super::estimates::{estimates, lower_triangle};
use super::gauge::Gauge;
use super::names::{ImageNames, plate_name, series_name};
use super::pose_files::determined;
use super::residuals::{poses, residuals};
use super::solution_json::{
    AccuracyRecord, ApparentShift, CameraRecord, FORMAT, FreePoseRecord, ImageRecord, JointRecord, ObservationColumns,
    PlacedRecord, PlateRecord, ProgramRecord, RobotRecord, ScatterRecord, SeriesRecord, SolutionRecord,
    StatisticsRecord, StopNoise, TermRecord, UrdfRecord,
};
use crate::assess::{ProjectionMap, median};
use crate::error::Result;
use crate::geom::Pose;
use crate::identify::{Solution, depths_m, stated_covariance};
use crate::model::joint_terms::{JointTerm, Term};
use crate::model::plate_modes;
use crate::problem::{Image, MeasuredStop, Problem, State};
use crate::series::{Observation, Plate};

/// The record of a solution.
///
/// # Errors
/// Estimates that are not finite, markers that define no frame.
pub(super) fn record(
    solution: &Solution,
    context: &Context,
    gauge: &Gauge,
    files: Vec<String>,
) -> Result<SolutionRecord> {
    let accuracy = &solution.accuracy;
    Ok(SolutionRecord {
        format: FORMAT,
        program: ProgramRecord {
            name: env!("CARGO_PKG_NAME").into(),
            version: env!("CARGO_PKG_VERSION").into(),
            command: context.command.clone(),
            options: context.options.clone(),
        },
        files,
        inputs: context.inputs.clone(),
        estimator: solution.estimator,
        options: Some(solution.options.clone()),
        status: format!("{:?}", solution.status).to_lowercase(),
        iterations: solution.iterations,
        failed_gates: solution.failed_gates(),
        accuracy: AccuracyRecord { nominal: accuracy.nominal, calibrated: accuracy.calibrated, folds: accuracy.folds },
        statistics: statistics(solution),
        notices: solution.notices(),
        findings: solution.findings.iter().map(Into::into).collect(),
        starts: solution.starts.clone(),
        robot: robot(&solution.fit.state, solution.fit.problem.twist_factor()),
        cameras: cameras(solution),
        mountings: mountings(solution),
        placements: placements(solution, gauge),
        plates: plates(solution, context, gauge),
        urdf: UrdfRecord {
            file: context.robot.path.file_name().map_or_else(String::new, |f| f.to_string_lossy().into_owned()),
            text: context.robot.text.clone(),
        },
        series: series(solution, context),
        identifiability: solution.uncertainty.identifiability.clone(),
        evidences: solution.evidences.clone(),
        flange: solution.uncertainty.flange,
        lenses: solution.lenses.clone(),
        two_stage: solution.two_stage.clone(),
        scatter: solution.uncertainty.clustered_sigma.as_ref().map(|_| ScatterRecord {
            flange_ratio: solution.uncertainty.clustered_ratio,
            larger_stated: solution.uncertainty.larger_stated,
        }),
        workspace: solution.uncertainty.workspace.clone(),
        estimates: estimates(solution, context)?,
        covariance_lower: lower_triangle(solution),
        images: images(solution, context),
        covariance_together: None,
        bodies: BodiesRecord::of(solution),
    })
}

/// Residuals in numbers.
pub(super) fn statistics(solution: &Solution) -> StatisticsRecord {
    let problem = &solution.fit.problem;
    let all = || solution.fit.linearised.terms.iter().flat_map(|t| &t.residuals);
    let used = all().count();
    let squares: f64 = all().map(|r| r.duv.norm_squared()).sum();
    let given: usize = problem.used().map(|(_, i)| i.observations.len()).sum();
    StatisticsRecord {
        images: problem.images.len(),
        images_used: problem.used().count(),
        observations_used: used,
        observations_left_out: given - problem.used().map(|(_, i)| i.used().count()).sum::<usize>(),
        rms_px: (squares / used.max(1) as f64).sqrt(),
        free_pose_rms_px: solution.free_poses.rms_px,
        free_pose_observations: solution.free_poses.observations,
        largest_normalised: all().map(|r| r.normalised).fold(0.0, f64::max),
        cost: solution.fit.linearised.cost,
        huber: problem.huber,
    }
}

fn robot(state: &State, twist_factor: f64) -> RobotRecord {
    let robot = &state.robot;
    let chain = &robot.chain;
    let corrected = robot.corrected_origins();
    let joints = chain.joints.iter().enumerate().map(|(k, j)| JointRecord {
        name: j.name.clone(),
        kind: j.kind,
        axis: j.axis.into(),
        nominal_origin: (&j.origin).into(),
        twist: robot.twists[k].into(),
        corrected_origin: (&corrected[k]).into(),
        limits: j.limits,
        drive: j.drive.map(|d| (chain.readings[d.reading].clone(), d.multiplier, d.offset)),
        upwards: j.upwards,
        found: j.found,
    });
    let record = |t: &JointTerm| TermRecord {
        reading: chain.readings[t.reading].clone(),
        term: t.term.name(),
        value: t.value,
        unit: t.term.unit(chain.reading_kinds[t.reading]).into(),
    };
    let (local, stated): (Vec<&JointTerm>, Vec<&JointTerm>) =
        robot.terms.iter().partition(|t| matches!(t.term, Term::Local(_)));
    RobotRecord {
        name: chain.robot.clone(),
        base: chain.base.clone(),
        tip: chain.tip.clone(),
        readings: chain.readings.clone(),
        reading_kinds: chain.reading_kinds.clone(),
        joints: joints.collect(),
        terms: stated.into_iter().map(record).collect(),
        local_errors: local.into_iter().map(record).collect(),
        payload: chain.payload(),
        twist_factor,
    }
}

fn series(solution: &Solution, context: &Context) -> Vec<SeriesRecord> {
    let plate = |k: usize| solution.fit.problem.images.iter().find(|i| i.series == k).map_or(0, |i| i.plate);
    let record = |(k, s): (usize, &crate::problem::MeasuredSeries)| SeriesRecord {
        name: series_name(&context.series, k),
        camera: s.camera.clone(),
        mounting: s.mounting.clone(),
        camera_mount: s.mount,
        width_px: s.width_px,
        height_px: s.height_px,
        focal_px: s.focal_px,
        known_camera: s.known_camera.clone(),
        lens: s.lens,
        lens_choice: s.lens_choice,
        centroid: s.centroid,
        plate: plate(k),
        has_images: s.has_images,
        order_known: s.order_known,
        noise: Some(stop_noise(solution, &[solution.fit.problem.noise_of(k)])),
        run: s.run.clone(),
        other_postures: s.stops.iter().zip(&s.postures).filter_map(other_postures).collect(),
    };
    solution.series.iter().enumerate().map(record).collect()
}

fn other_postures((stop, others): (&MeasuredStop, &Vec<Vec<f64>>)) -> Option<(String, Vec<Vec<f64>>)> {
    (!others.is_empty()).then(|| (stop.image.clone(), others.clone()))
}

fn cameras(solution: &Solution) -> Vec<CameraRecord> {
    let problem = &solution.fit.problem;
    let depths = depths_m(&solution.fit.problem, &solution.free_poses);
    let camera = |(k, name): (usize, &String)| {
        let c = &solution.fit.state.cameras[k];
        let noise = stop_noise(solution, &series_with(problem, k));
        CameraRecord {
            name: name.clone(),
            lens: c.lens,
            width_px: c.width_px,
            height_px: c.height_px,
            parameters: c.parameter_names().map(Into::into).zip(c.parameters.iter().copied()).collect(),
            pixel_factor: problem.noise.pixel_factor[k],
            joint_noise: noise.joint,
            joint_noise_interval: noise.joint_interval,
            apparent_tilt_rad: noise.apparent_tilt_rad,
            ros_loss_px: c.in_ros(&depths[k]).map(|fit| [fit.rms_px, fit.worst_px]),
            projection: Some(projection(solution, k)),
            field_sigma_px: problem.layout.fields[k].clone().next().map(|c| problem.layout.columns[c].prior_sigma),
        }
    };
    problem.cameras.iter().enumerate().map(camera).collect()
}

/// Series that a camera took, by the index of their noise.
fn series_with(problem: &Problem, camera: usize) -> Vec<usize> {
    let taken: BTreeSet<usize> =
        problem.images.iter().filter(|i| i.camera == camera).map(|i| problem.stops[i.stop].series).collect();
    taken.into_iter().collect()
}

/// Root mean square over some series.
fn stop_noise(solution: &Solution, series: &[usize]) -> StopNoise {
    let problem = &solution.fit.problem;
    let rms = |of: &dyn Fn(usize) -> f64| match series {
        [one] => of(*one),
        _ => (series.iter().map(|s| of(*s).powi(2)).sum::<f64>() / series.len().max(1) as f64).sqrt(),
    };
    let readings = problem.noise.joint.first().map_or(0, Vec::len);
    let sigmas: Vec<Vec<f64>> = (0..problem.noise.joint.len()).map(|s| problem.joint_sigma(s)).collect();
    let interval = |r: usize| {
        let ends = solution.uncertainty.joint_noise_of(&problem.noise, series, r)?;
        Some(ends.map(|v| Some(v).filter(|v| v.is_finite())))
    };
    let sizes = problem.noise.displacement_sizes();
    let displacement = |kind: usize| rms(&|s| problem.noise.displacement.get(s * sizes + kind).copied().unwrap_or(0.0));
    StopNoise {
        joint: (0..readings).map(|r| rms(&|s| sigmas[s][r])).collect(),
        joint_interval: (0..readings).filter_map(interval).collect(),
        apparent_tilt_rad: displacement(0),
        apparent_shift: (sizes > 1).then(|| ApparentShift {
            spin_rad: displacement(1),
            across_m: displacement(2),
            along_m: displacement(3),
        }),
    }
}

/// The map of a camera, for points as far away as the plates were.
fn projection(solution: &Solution, camera: usize) -> ProjectionMap {
    let depths: Vec<f64> = (solution.fit.problem.used().filter(|(_, i)| i.camera == camera))
        .filter_map(|(i, _)| solution.free_poses.poses[i].as_ref().map(|p| p.camera_from_plate.translation.z))
        .collect();
    let range = solution.fit.problem.layout.cameras[camera].clone();
    let covariance = solution.fit.covariance.reduced.view((range.start, range.start), (range.len(), range.len()));
    ProjectionMap::new(&solution.fit.state.cameras[camera], &covariance.into_owned(), median(&depths).unwrap_or(1.0))
}

fn flat(c: &Matrix6<f64>) -> Vec<f64> {
    (0..36).map(|k| c[(k / 6, k % 6)]).collect()
}

fn mountings(solution: &Solution) -> Vec<PlacedRecord> {
    let problem = &solution.fit.problem;
    let placed = |(k, name): (usize, &String)| {
        let start = problem.layout.mountings[k].start;
        let covariance = determined(solution, start).then(|| flat(&solution.fit.covariance.block(start)));
        PlacedRecord { name: name.clone(), pose: (&solution.fit.state.mountings[k]).into(), covariance }
    };
    problem.mountings.iter().enumerate().map(placed).collect()
}

fn placements(solution: &Solution, gauge: &Gauge) -> Vec<PlacedRecord> {
    let problem = &solution.fit.problem;
    let placed = |(k, name): (usize, &String)| {
        let determined = determined(solution, problem.layout.placements[k].start);
        let covariance = determined.then(|| flat(&gauge.placement(problem, k)));
        PlacedRecord { name: name.clone(), pose: (&solution.fit.state.placements[k]).into(), covariance }
    };
    problem.placements.iter().enumerate().map(placed).collect()
}

fn plates(solution: &Solution, context: &Context, gauge: &Gauge) -> Vec<PlateRecord> {
    let problem = &solution.fit.problem;
    let plate = |(k, p): (usize, &Plate)| {
        let shape = &solution.fit.state.plates[k];
        let sigmas = &gauge.positions[k];
        PlateRecord {
            name: plate_name(problem, &context.series, k),
            kind: p.kind,
            columns: p.columns,
            rows: p.rows,
            pitch_m: p.pitch_m,
            tolerance_m: p.tolerance_m,
            tags: p.tags.clone(),
            puzzle: p.puzzle,
            scale: p.scale,
            modes: plate_modes::NAMES.iter().map(|n| n.to_string()).zip(shape.modes).collect(),
            id: p.markers.iter().map(|m| m.id).collect(),
            nominal_m: p.markers.iter().map(|m| m.position_m.into()).collect(),
            radii_m: p.markers.iter().map(|m| [m.outer_radius_m, m.inner_radius_m]).collect(),
            prior_sigma_m: p.markers.iter().map(|m| m.sigma_m).collect(),
            tolerance_factor: problem.noise.marker.get(k).copied().unwrap_or(1.0),
            correction_m: shape.corrections.iter().map(|c| (*c).into()).collect(),
            position_m: (0..p.markers.len()).map(|m| shape.position(m).into()).collect(),
            sigma_m: sigmas.iter().map(|c| [0, 1, 2].map(|d| c[(d, d)].max(0.0).sqrt())).collect(),
            relative_scale: gauge.scales[k].map(Into::into),
            relative_scale_of_poses: solution.free_poses.scales[k].map(Into::into),
        }
    };
    problem.plates.iter().enumerate().map(plate).collect()
}

fn images(solution: &Solution, context: &Context) -> Vec<ImageRecord> {
    let problem = &solution.fit.problem;
    let names = ImageNames::new(problem, &context.series);
    let (poses, stops) = (poses(solution), measured_stops(solution));
    let image = |(k, i): (usize, &Image)| {
        let from = solution.fit.taken_from(k);
        let joint_noise = Some(from.joint_errors.to_vec()).filter(|_| i.rejected.is_none() && from.joints() > 0);
        let observations = observations(solution, k, stops[k], poses[k].as_ref());
        ImageRecord {
            name: names.of(k).to_owned(),
            series: series_name(&context.series, i.series),
            camera: i.camera,
            mounting: i.mounting,
            placement: i.placement,
            plate: i.plate,
            camera_mount: i.mount,
            readings: from.posture.map(|p| p.readings.clone()),
            approach: from.posture.and_then(|p| p.approach.clone()),
            joint_noise,
            camera_from_plate: poses[k].as_ref().map(Into::into),
            free_pose: solution.free_poses.poses[k].as_ref().map(|free| FreePoseRecord {
                plate_from_camera: (&free.in_frame.plate_from_camera).into(),
                covariance: flat(&free.in_frame.covariance),
                rms_px: free.rms_px,
            }),
            rms_px: rms_px(solution, k),
            held_out_mm: solution.accuracy.per_image_mm.get(k).copied().flatten(),
            reason: i.rejected.as_ref().map(ToString::to_string),
            rejection: i.rejected.clone(),
            row: solution.series[i.series].run.as_ref().map(|_| stops[k].row),
            observations,
        }
    };
    problem.images.iter().enumerate().map(image).collect()
}

/// RMS of the lengths of the residuals of an image in use, px.
pub(super) fn rms_px(solution: &Solution, image: usize) -> Option<f64> {
    let at = solution.fit.linearised.images.iter().position(|&i| i == image)?;
    let residuals = &solution.fit.linearised.terms[at].residuals;
    let squares: f64 = residuals.iter().map(|r| r.duv.norm_squared()).sum();
    Some((squares / residuals.len().max(1) as f64).sqrt())
}

/// The stop of every image in its series.
fn measured_stops(solution: &Solution) -> Vec<&MeasuredStop> {
    let mut stops: Vec<_> = solution.series.iter().map(|series| series.stops.iter()).collect();
    solution.fit.problem.images.iter().filter_map(|image| stops[image.series].next()).collect()
}

/// Covariances as they were stated, in the order of the observations of the image: inverted twice they would be others in the last bit.
fn stated(plate: &Plate, stop: &MeasuredStop) -> Vec<[f64; 3]> {
    let mut all: Vec<&Observation> = stop.observations.iter().collect();
    all.sort_by_key(|o| (plate.index_of(o.marker), o.edge));
    all.into_iter().map(stated_covariance).collect()
}

fn observations(solution: &Solution, image: usize, stop: &MeasuredStop, pose: Option<&Pose>) -> ObservationColumns {
    let Image { series, plate, ref observations, .. } = solution.fit.problem.images[image];
    let markers = &solution.fit.problem.plates[plate].markers;
    ObservationColumns {
        marker: observations.iter().map(|o| markers[o.marker].id).collect(),
        edge: observations.iter().map(|o| o.edge).collect(),
        radius_m: observations.iter().map(|o| o.mark.radius_m()).collect(),
        uv: observations.iter().map(|o| o.uv.into()).collect(),
        covariance: stated(&solution.series[series].plate, stop),
        duv: residuals(solution, image, pose).into_iter().map(|r| r.map(Into::into)).collect(),
        reason: observations.iter().map(|o| o.rejected).collect(),
    }
}
