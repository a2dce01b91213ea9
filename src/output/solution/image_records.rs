//! What an adjustment says of cameras, plates and images, with or without a robot: their records.

use std::collections::BTreeSet;

use nalgebra::{DMatrix, Matrix6};

use super::estimates::estimates;
use super::residuals::{poses, residuals};
use super::solution_json::{
    ApparentShift, CameraRecord, EstimateRecord, FreePoseRecord, ImageRecord, ObservationColumns, PlateRecord,
    SeriesRecord, StatisticsRecord, StopNoise,
};
use crate::assess::{ProjectionMap, Uncertainty};
use crate::error::Result;
use crate::fit::{Fit, FreePoses};
use crate::geom::Pose;
use crate::identify::{depths_m, stated_covariance};
use crate::linalg::median;
use crate::model::plate_modes;
use crate::output::gauge::Gauge;
use crate::output::names::{ImageNames, plate_name, series_name};
use crate::problem::{Image, MeasuredSeries, MeasuredStop, Problem};
use crate::series::{Observation, Plate};

/// What the records are made from.
#[derive(Clone, Copy)]
pub struct ImageRecords<'a> {
    /// The fit.
    pub fit: &'a Fit,
    /// The stand-alone camera poses.
    pub free_poses: &'a FreePoses,
    /// What the fit went from.
    pub measured: &'a [MeasuredSeries],
    /// Names of the series.
    pub names: &'a [String],
    /// The plates in their frames.
    pub gauge: &'a Gauge,
    /// What is known of joint noise and of sigmas by clusters; none without a robot.
    pub uncertainty: Option<&'a Uncertainty>,
    /// Error of each held-out image, nominal and calibrated, mm; empty without a robot.
    pub held_out_mm: &'a [Option<[f64; 2]>],
}

impl ImageRecords<'_> {
    /// Every scalar estimate, by the covariance that is `stated`.
    ///
    /// # Errors
    /// Estimates that are not finite.
    pub fn estimates(&self, stated: &DMatrix<f64>) -> Result<Vec<EstimateRecord>> {
        estimates(self.fit, self.names, stated, self.uncertainty)
    }

    /// Residuals in numbers.
    pub fn statistics(&self) -> StatisticsRecord {
        let problem = &self.fit.problem;
        let all = || self.fit.linearised.terms.iter().flat_map(|t| &t.residuals);
        let used = all().count();
        let squares: f64 = all().map(|r| r.duv.norm_squared()).sum();
        let given: usize = problem.used().map(|(_, i)| i.observations.len()).sum();
        StatisticsRecord {
            images: problem.images.len(),
            images_used: problem.used().count(),
            observations_used: used,
            observations_left_out: given - problem.used().map(|(_, i)| i.used().count()).sum::<usize>(),
            rms_px: (squares / used.max(1) as f64).sqrt(),
            free_pose_rms_px: self.free_poses.rms_px,
            free_pose_observations: self.free_poses.observations,
            largest_normalised: all().map(|r| r.normalised).fold(0.0, f64::max),
            cost: self.fit.linearised.cost,
            huber: problem.huber,
        }
    }

    /// Series, apart from their images.
    pub fn series(&self) -> Vec<SeriesRecord> {
        let plate = |k: usize| self.fit.problem.images.iter().find(|i| i.series == k).map_or(0, |i| i.plate);
        let record = |(k, s): (usize, &MeasuredSeries)| SeriesRecord {
            name: series_name(self.names, k),
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
            noise: Some(self.stop_noise(&[self.fit.problem.noise_of(k)])),
            run: s.run.clone(),
            other_postures: s.stops.iter().zip(&s.postures).filter_map(other_postures).collect(),
        };
        self.measured.iter().enumerate().map(record).collect()
    }

    /// Cameras with their variance components.
    pub fn cameras(&self) -> Vec<CameraRecord> {
        let problem = &self.fit.problem;
        let depths = depths_m(problem, self.free_poses);
        let camera = |(k, name): (usize, &String)| {
            let c = &self.fit.state.cameras[k];
            let noise = self.stop_noise(&series_with(problem, k));
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
                projection: Some(self.projection(k)),
                field_sigma_px: problem.layout.fields[k].clone().next().map(|c| problem.layout.columns[c].prior_sigma),
            }
        };
        problem.cameras.iter().enumerate().map(camera).collect()
    }

    /// Root mean square over some series.
    fn stop_noise(&self, series: &[usize]) -> StopNoise {
        let problem = &self.fit.problem;
        let rms = |of: &dyn Fn(usize) -> f64| match series {
            [one] => of(*one),
            _ => (series.iter().map(|s| of(*s).powi(2)).sum::<f64>() / series.len().max(1) as f64).sqrt(),
        };
        let readings = problem.noise.joint.first().map_or(0, Vec::len);
        let sigmas: Vec<Vec<f64>> = (0..problem.noise.joint.len()).map(|s| problem.joint_sigma(s)).collect();
        let interval = |r: usize| {
            let ends = self.uncertainty?.joint_noise_of(&problem.noise, series, r)?;
            Some(ends.map(|v| Some(v).filter(|v| v.is_finite())))
        };
        let sizes = problem.noise.displacement_sizes();
        let displacement =
            |kind: usize| rms(&|s| problem.noise.displacement.get(s * sizes + kind).copied().unwrap_or(0.0));
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
    fn projection(&self, camera: usize) -> ProjectionMap {
        let depths: Vec<f64> = (self.fit.problem.used().filter(|(_, i)| i.camera == camera))
            .filter_map(|(i, _)| self.free_poses.poses[i].as_ref().map(|p| p.camera_from_plate.translation.z))
            .collect();
        let range = self.fit.problem.layout.cameras[camera].clone();
        let covariance = self.fit.covariance.reduced.view((range.start, range.start), (range.len(), range.len()));
        ProjectionMap::new(&self.fit.state.cameras[camera], &covariance.into_owned(), median(&depths).unwrap_or(1.0))
    }

    /// Plates as given, and corrected.
    pub fn plates(&self) -> Vec<PlateRecord> {
        let problem = &self.fit.problem;
        let plate = |(k, p): (usize, &Plate)| {
            let shape = &self.gauge.plates[k];
            let sigmas = &self.gauge.positions[k];
            PlateRecord {
                name: plate_name(problem, self.names, k),
                stated_name: p.name.clone(),
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
                moved: problem.moved_markers.iter().filter(|(of, _)| *of == k).map(|(_, m)| p.markers[*m].id).collect(),
                tolerance_factor: problem.noise.marker.get(k).copied().unwrap_or(1.0),
                correction_m: shape.corrections.iter().map(|c| (*c).into()).collect(),
                position_m: (0..p.markers.len()).map(|m| shape.position(m).into()).collect(),
                sigma_m: sigmas.iter().map(|c| [0, 1, 2].map(|d| c[(d, d)].max(0.0).sqrt())).collect(),
                relative_scale: self.gauge.scales[k].map(Into::into),
                relative_scale_of_poses: self.free_poses.scales[k].map(Into::into),
            }
        };
        problem.plates.iter().enumerate().map(plate).collect()
    }

    /// Images with their observations.
    pub fn images(&self) -> Vec<ImageRecord> {
        let problem = &self.fit.problem;
        let names = ImageNames::new(problem, self.names);
        let (poses, stops) = (poses(self.fit), self.measured_stops());
        let image = |(k, i): (usize, &Image)| {
            let from = self.fit.taken_from(k);
            let joint_noise = Some(from.joint_errors.to_vec()).filter(|_| i.rejected.is_none() && from.joints() > 0);
            let observations = self.observations(k, stops[k], poses[k].as_ref());
            ImageRecord {
                name: names.of(k).to_owned(),
                series: series_name(self.names, i.series),
                camera: i.camera,
                mounting: i.mounting,
                placement: i.placement,
                plate: i.plate,
                camera_mount: i.mount,
                readings: from.posture.map(|p| p.readings.clone()),
                approach: from.posture.and_then(|p| p.approach.clone()),
                joint_noise,
                camera_from_plate: poses[k]
                    .as_ref()
                    .map(|pose| (&self.gauge.camera_from_plate(self.fit, k, pose)).into()),
                free_pose: self.free_poses.poses[k].as_ref().map(|free| FreePoseRecord {
                    plate_from_camera: (&free.in_frame.plate_from_camera).into(),
                    covariance: flat(&free.in_frame.covariance),
                    rms_px: free.rms_px,
                }),
                rms_px: self.rms_px(k),
                held_out_mm: self.held_out_mm.get(k).copied().flatten(),
                reason: i.rejected.as_ref().map(ToString::to_string),
                rejection: i.rejected.clone(),
                row: self.measured[i.series].run.as_ref().map(|_| stops[k].row),
                observations,
            }
        };
        problem.images.iter().enumerate().map(image).collect()
    }

    /// RMS of the lengths of the residuals of an image in use, px.
    fn rms_px(&self, image: usize) -> Option<f64> {
        let at = self.fit.linearised.images.iter().position(|&i| i == image)?;
        let residuals = &self.fit.linearised.terms[at].residuals;
        let squares: f64 = residuals.iter().map(|r| r.duv.norm_squared()).sum();
        Some((squares / residuals.len().max(1) as f64).sqrt())
    }

    /// The stop of every image in its series.
    fn measured_stops(&self) -> Vec<&MeasuredStop> {
        let mut stops: Vec<_> = self.measured.iter().map(|series| series.stops.iter()).collect();
        self.fit.problem.images.iter().filter_map(|image| stops[image.series].next()).collect()
    }

    fn observations(&self, image: usize, stop: &MeasuredStop, pose: Option<&Pose>) -> ObservationColumns {
        let Image { series, plate, ref observations, .. } = self.fit.problem.images[image];
        let markers = &self.fit.problem.plates[plate].markers;
        ObservationColumns {
            marker: observations.iter().map(|o| markers[o.marker].id).collect(),
            edge: observations.iter().map(|o| o.edge).collect(),
            radius_m: observations.iter().map(|o| o.mark.radius_m()).collect(),
            uv: observations.iter().map(|o| o.uv.into()).collect(),
            covariance: stated(&self.measured[series].plate, stop),
            duv: residuals(self.fit, image, pose).into_iter().map(|r| r.map(Into::into)).collect(),
            reason: observations.iter().map(|o| o.rejected).collect(),
        }
    }
}

fn other_postures((stop, others): (&MeasuredStop, &Vec<Vec<f64>>)) -> Option<(String, Vec<Vec<f64>>)> {
    (!others.is_empty()).then(|| (stop.image.clone(), others.clone()))
}

/// Series that a camera took, by the index of their noise.
fn series_with(problem: &Problem, camera: usize) -> Vec<usize> {
    let taken: BTreeSet<usize> =
        problem.images.iter().filter(|i| i.camera == camera).map(|i| problem.stops[i.stop].series).collect();
    taken.into_iter().collect()
}

/// Row by row.
pub(super) fn flat(c: &Matrix6<f64>) -> Vec<f64> {
    (0..36).map(|k| c[(k / 6, k % 6)]).collect()
}

/// Covariances as they were stated, in the order of the observations of the image: inverted twice they would be others in the last bit.
fn stated(plate: &Plate, stop: &MeasuredStop) -> Vec<[f64; 3]> {
    let mut all: Vec<&Observation> = stop.observations.iter().collect();
    all.sort_by_key(|o| (plate.index_of(o.marker), o.edge));
    all.into_iter().map(stated_covariance).collect()
}
