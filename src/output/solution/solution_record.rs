//! From a solution to the record in solution.json.

use super::bodies_record::BodiesRecord;
use super::estimates::{covariance_of_columns, determined, lower_triangle};
use super::image_records::{ImageRecords, flat};
use super::solution_json::{
    AccuracyRecord, FORMAT, JointRecord, PlacedRecord, ProgramRecord, RobotRecord, ScatterRecord, SolutionRecord,
    TermRecord, UrdfRecord,
};
use crate::error::Result;
use crate::identify::Solution;
use crate::model::joint_terms::{JointTerm, Term};
use crate::output::gauge::Gauge;
use crate::output::robot::mastering::to_enter;
use crate::output::{Context, Offsets};
use crate::problem::State;

/// The record of a solution.
///
/// # Errors
/// Estimates that are not finite, markers that define no frame.
pub fn record(solution: &Solution, context: &Context, gauge: &Gauge, files: Vec<String>) -> Result<SolutionRecord> {
    let accuracy = &solution.accuracy;
    let seen = ImageRecords {
        fit: &solution.fit,
        free_poses: &solution.free_poses,
        measured: &solution.series,
        names: &context.series,
        gauge,
        uncertainty: Some(&solution.uncertainty),
        held_out_mm: &accuracy.per_image_mm,
    };
    let stated = covariance_of_columns(&solution.fit, gauge, seen.uncertainty);
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
        status: solution.status.name().to_owned(),
        iterations: solution.iterations,
        failed_gates: solution.failed_gates(),
        accuracy: AccuracyRecord { nominal: accuracy.nominal, calibrated: accuracy.calibrated, folds: accuracy.folds },
        statistics: seen.statistics(),
        notices: solution.notices(),
        findings: solution.findings.iter().map(Into::into).collect(),
        offsets_in_mastering: context.offsets == Offsets::Mastering,
        offsets_to_enter: match context.offsets {
            Offsets::Folded => Vec::new(),
            Offsets::Mastering => to_enter(solution, context),
        },
        starts: solution.starts.clone(),
        robot: robot(&solution.fit.state, solution.fit.problem.twist_factor()),
        cameras: seen.cameras(),
        mountings: mountings(solution),
        placements: placements(solution, gauge),
        plates: seen.plates(),
        urdf: UrdfRecord {
            file: context.robot.path.file_name().map_or_else(String::new, |f| f.to_string_lossy().into_owned()),
            text: context.robot.text.clone(),
        },
        series: seen.series(),
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
        estimates: seen.estimates(&stated)?,
        covariance_lower: lower_triangle(&solution.fit, &stated),
        images: seen.images(),
        covariance_together: None,
        bodies: BodiesRecord::of(solution),
    })
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
        let covariance = determined.then(|| flat(&gauge.placed[k]));
        PlacedRecord { name: name.clone(), pose: (&gauge.placements[k]).into(), covariance }
    };
    problem.placements.iter().enumerate().map(placed).collect()
}
