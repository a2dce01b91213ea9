//! What the solution of a description states of it, to be held against another measurement.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use nalgebra::{DMatrix, Vector3, Vector6};

use super::compensate_frames::{NoSolution, Side, part, solution};
use crate::assess::{
    Limits, MeasuredPoint, NORMAL_95, PredictedFlange, by_readings, fit_points, freedom, most_of_sum, root_of_mean,
};
use crate::diagnose::Weight;
use crate::error::{Error, Result};
use crate::model::joint_terms::Term;
use crate::model::robot::{Posture, Robot};
use crate::output::corrections::{self, FileFinding};
use crate::output::restore::{FoundModel, exported_model, measured_series};
use crate::output::solution_json::{self, SolutionRecord};
use crate::problem::{Exposures, MeasuredSeries, SCALE, postures_of_stops};
use crate::series::{InputFile, SpatialFiles, is_image};

/// The solution from which a description came, with as much of its model as is judged.
pub(super) struct Stated {
    pub path: PathBuf,
    record: SolutionRecord,
    found: FoundModel,
    /// What is judged of it where that is not the whole: a URDF without compensation.toml.
    part: Option<Robot>,
}

/// What a right model misses in a measurement, RMS.
#[derive(Debug, Clone, Copy)]
pub(super) struct Expectation {
    pub rms_m: f64,
    /// Upper end of the 95 % interval.
    pub most_m: f64,
}

/// What a right model misses at points.
pub(super) struct ExpectedAtPoints {
    pub all: Expectation,
    /// At each of them, m.
    pub each_m: Vec<f64>,
}

/// Files of a series that hold what was measured, beside images and recordings.
const OBSERVATIONS: &str = "observations.csv";
/// End of the name of a recording.
const RECORDING: &str = "mcap";
/// Folders of images that several series may have in common.
const FLAT_FIELD: [&str; 2] = ["dark", "white"];

impl Stated {
    /// That of the solution.json beside a description; where that is of another one, a note that says so.
    ///
    /// # Errors
    /// One that stands there and cannot be used: without it the description would be judged by less.
    pub fn beside(urdf: &Path, robot: &Robot) -> Result<(Option<Self>, Option<FileFinding>)> {
        let path = urdf.with_file_name(solution_json::FILE_NAME);
        let side = Side { robot, urdf, solution: None };
        let record = match solution(&side, None)? {
            Ok(record) => record,
            Err(NoSolution::Absent(_)) => return Ok((None, None)),
            Err(NoSolution::OfOther(error)) => return Ok((None, Some(not_judged_by(urdf, &error)))),
            Err(NoSolution::Unusable(error)) => return Err(error),
        };
        let found = exported_model(&record)?;
        let part = part(&record, robot).cloned();
        Ok((Some(Self { path, record, found, part }), None))
    }

    /// Those with which the solution was judged.
    pub fn limits(&self) -> Limits {
        self.found.limits
    }

    /// At the stops of series: markers as far from the flange as what stands still is.
    pub fn at_stops(&self, series: &[MeasuredSeries]) -> Option<Expectation> {
        let flange = self.found.flange()?;
        let stops: Vec<Posture> = postures_of_stops(series).into_iter().flatten().flatten().collect();
        let at: Vec<PredictedFlange> = stops.iter().map(|stop| flange.at(&stop.readings)).collect();
        let lever_m = |at: &PredictedFlange| at.pose.translation.norm();
        let of_model = at.iter().map(|at| {
            let [sigma_m, sigma_rad] = at.sigmas();
            sigma_m.hypot(sigma_rad * lever_m(at))
        });
        let lacking = self.part.iter().flat_map(|part| {
            let twists = displacements(&self.found.robot, part, &stops);
            let length = |(t, at): (&Vector6<f64>, &PredictedFlange)| {
                t.fixed_rows::<3>(0).norm().hypot(t.fixed_rows::<3>(3).norm() * lever_m(at))
            };
            twists.iter().zip(&at).map(length).collect::<Vec<_>>()
        });
        let [model_m, lacking_m] = [rms(of_model), rms(lacking)];
        // The stated scatter stands for that at the stops.
        let [at_stops_m, most_m] = self.scatter_m(&by_readings(&self.found.robot, &stops), stops.len());
        let stated = self.record.flange?;
        let scatter_m = stated.scatter_m;
        let widening = stated.intervals.map_or(NORMAL_95, |intervals| match &self.part {
            None => intervals.model_m[1] / stated.model_m,
            // Errors of the model go along with what the part lacks, or against it.
            Some(_) => {
                let alone = stated.alone_m.zip(intervals.alone_m).map_or(0.0, |(m, [_, most_m])| most_m / m);
                f64::max(alone, intervals.urdf_m[1] / stated.urdf_m)
            }
        });
        let model_m = model_m.hypot(lacking_m);
        let expected =
            self.expectation([model_m, widening * model_m], [scatter_m, scatter_m + (most_m - at_stops_m)])?;
        // What was found for images that the fit had not seen is of this kind.
        let held_out_m = 1e-3 * self.record.accuracy.calibrated.rms_mm;
        let most_m = if held_out_m.is_finite() { expected.most_m.max(held_out_m) } else { expected.most_m };
        Some(Expectation { most_m, ..expected })
    }

    /// Of points, with the sigma per axis of the device, what the fit of frame and reflector takes up left out.
    pub fn at_points(&self, points: &[MeasuredPoint], device_m: f64) -> Option<ExpectedAtPoints> {
        let known = self.found.known_robot(None).ok()?;
        let robot = &self.found.robot;
        let unit = vec![1.0; self.found.joint_sigma.len()];
        let judged = (robot, self.part.as_ref());
        let left = fit_points(robot, points)?.expected(judged, points, known.covariance(), &unit)?;
        let backlash = self.backlash_m2(&left.by_reading, known.covariance());
        let scatter_m = self.scatter_m(&left.by_reading, points.len()).map(|m| (m * m + backlash).sqrt());
        let expected = self.expectation([left.model_m, left.most_model_m], scatter_m)?;
        let each = left.of_points.iter().map(|point| {
            let of_noise = self.scatter_m2(&point.by_reading) + self.backlash_m2(&point.by_reading, known.covariance());
            (point.model + of_noise + 3.0 * device_m.powi(2)).sqrt()
        });
        let each_m = each.collect();
        // Of so many coordinates, less what frame and reflector take up.
        let freedom = freedom(points.len()).max(1.0);
        let device_m = device_m * (freedom / points.len() as f64).sqrt();
        let most_m = device_m * (1.0 + NORMAL_95 / (2.0 * freedom).sqrt());
        let all = Expectation { rms_m: expected.rms_m.hypot(device_m), most_m: expected.most_m.hypot(most_m) };
        Some(ExpectedAtPoints { all, each_m })
    }

    /// Readings of the stops that the solution was found from, rad or m.
    pub fn own_stops(&self) -> Vec<Vec<f64>> {
        let own = measured_series(&self.record).unwrap_or_default();
        own.iter().flat_map(|s| &s.stops).filter_map(|stop| stop.readings.clone()).collect()
    }

    /// Square of what joint noise does, m^2, by the mean squares that unit noise of every reading makes.
    fn scatter_m2(&self, by_reading: &[f64]) -> f64 {
        by_reading.iter().zip(&self.found.joint_sigma).map(|(by, sigma)| by * sigma.powi(2)).sum()
    }

    /// What joint noise does, RMS over so many stops, and the upper end of its 95 % interval, m: by the mean squares that unit noise of every
    /// reading makes, m^2. How large the noise is, is known to its interval; how it falls at these stops, as of one degree of freedom a stop.
    fn scatter_m(&self, by_reading: &[f64], stops: usize) -> [f64; 2] {
        let FoundModel { joint_sigma, joint_most, .. } = &self.found;
        let parts = || by_reading.iter().zip(joint_sigma.iter().zip(joint_most));
        let square = self.scatter_m2(by_reading);
        let chance = NORMAL_95 * (2.0 / stops.max(1) as f64).sqrt() * square;
        let each = parts().map(|(by, (sigma, most))| [by * sigma.powi(2), by * most.powi(2)]);
        [square, most_of_sum(each.chain([[0.0, chance]]))].map(f64::sqrt)
    }

    /// What backlash does where nobody knows from which side a joint came, by the mean squares that unit noise of every reading makes, m^2:
    /// `b` to either side.
    fn backlash_m2(&self, by_reading: &[f64], covariance: &DMatrix<f64>) -> f64 {
        let FoundModel { robot, .. } = &self.found;
        let Some(first) = covariance.nrows().checked_sub(robot.terms.len()) else { return 0.0 };
        let terms = robot.terms.iter().enumerate().filter(|(_, t)| t.term == Term::Backlash);
        let squares = terms.map(|(k, t)| {
            by_reading.get(t.reading).map_or(0.0, |by| by * (t.value.powi(2) + covariance[(first + k, first + k)]))
        });
        squares.sum()
    }

    /// Of the errors of the model, with what a part of it lacks, and of the scatter of single stops, each with the upper end of its 95 % interval.
    fn expectation(&self, model_m: [f64; 2], scatter_m: [f64; 2]) -> Option<Expectation> {
        self.record.flange?;
        let [rms_m, most_m] = [0, 1].map(|k| model_m[k].hypot(scatter_m[k]));
        (rms_m > 0.0 && most_m.is_finite()).then_some(Expectation { rms_m, most_m })
    }

    /// That it failed checks of its own: what is measured here says more of the robot than they do.
    pub fn untrusted(&self, urdf: &Path) -> Option<FileFinding> {
        corrections::untrusted(&self.record, Weight::Note, urdf.display())
    }

    /// Relative standard deviation of the size of the plate that is known best, and so of all lengths; `None` without plates.
    pub fn size_sigma(&self) -> Option<f64> {
        let FoundModel { layout, covariance, .. } = &self.found;
        let sigma = |shape: &Range<usize>| covariance[(shape.start + SCALE, shape.start + SCALE)].sqrt();
        layout.shapes.iter().map(sigma).min_by(f64::total_cmp)
    }

    /// Whether one of these files of measurements is an input of the solution, or one of these series shows an exposure of it: files of other
    /// formats have other bytes.
    pub fn was_fitted_to(&self, files: &[InputFile], series: &[MeasuredSeries]) -> bool {
        let is_file = files.iter().filter(|file| is_measurement(&file.path)).any(|file| is_input(&self.record, file));
        is_file || measured_series(&self.record).is_ok_and(|own| has_exposure_of(&own, series))
    }

    /// How far what is judged and a nominal robot put a point of the tip apart at some readings, and at the stops of the series that the solution was
    /// found from, once frame and point are fitted: RMS, m.
    pub fn apart_from(&self, nominal: &Robot, on_tip: &Vector3<f64>, readings: &[Vec<f64>]) -> Option<[f64; 2]> {
        let judged = self.part.as_ref().unwrap_or(&self.found.robot);
        let apart = |at: &[Vec<f64>]| {
            let by_judged = at.iter().map(|q| MeasuredPoint::on_tip(judged, on_tip, &Posture::at(q)));
            Some(fit_points(nominal, &by_judged.collect::<Vec<_>>())?.rms_m)
        };
        Some([apart(readings)?, apart(&self.own_stops())?])
    }

    /// The solution.
    pub fn record(&self) -> &SolutionRecord {
        &self.record
    }
}

/// What a solution of another description states is not held against this one.
fn not_judged_by(urdf: &Path, error: &Error) -> FileFinding {
    let Error { code, place, what, remedy, .. } = error;
    let text = format!("{place} {what}: this robot is not held against what a solution states; {remedy}");
    FileFinding::new(*code, Weight::Note, urdf.display(), [], text)
}

fn has_exposure_of(fitted: &[MeasuredSeries], series: &[MeasuredSeries]) -> bool {
    let known = Exposures::of(fitted.iter().flat_map(|s| &s.stops));
    series.iter().flat_map(|s| &s.stops).any(|stop| known.shows(stop))
}

/// Whether files of measurements are inputs of a solution, one of each folder; `None` where those of some folders are and those of others not.
pub(super) fn were_fitted_to(record: &SolutionRecord, files: &[InputFile]) -> Option<bool> {
    let mut folders: BTreeMap<Option<&Path>, bool> = BTreeMap::new();
    for file in files.iter().filter(|file| is_measurement(&file.path)) {
        *folders.entry(file.path.parent()).or_default() |= is_input(record, file);
    }
    let is_one = folders.values().any(|is_input| *is_input);
    folders.values().all(|is_input| *is_input == is_one).then_some(is_one)
}

fn is_input(record: &SolutionRecord, file: &InputFile) -> bool {
    record.inputs.iter().any(|input| input.sha256 == file.sha256)
}

fn rms(lengths: impl Iterator<Item = f64>) -> f64 {
    let squares: Vec<f64> = lengths.map(|m| m * m).collect();
    if squares.is_empty() { 0.0 } else { root_of_mean(squares) }
}

/// How the tip of a second robot stands to that of a first one, without what a tool takes up: body twists.
fn displacements(a: &Robot, b: &Robot, stops: &[Posture]) -> Vec<Vector6<f64>> {
    let twist = |stop| (a.base_from_tip_at(stop).inverse() * b.base_from_tip_at(stop)).log();
    let all: Vec<Vector6<f64>> = stops.iter().map(twist).collect();
    let mean = all.iter().sum::<Vector6<f64>>() / all.len().max(1) as f64;
    all.into_iter().map(|twist| twist - mean).collect()
}

fn is_measurement(path: &Path) -> bool {
    let text = |part: Option<&std::ffi::OsStr>| part.and_then(|p| p.to_str()).unwrap_or_default().to_lowercase();
    let (name, end) = (text(path.file_name()), text(path.extension()));
    let folder = text(path.parent().and_then(Path::file_name));
    let is_table = name == OBSERVATIONS || SpatialFiles::NAMES.contains(&name.as_str());
    is_table || ((is_image(path) || end == RECORDING) && !FLAT_FIELD.contains(&folder.as_str()))
}
