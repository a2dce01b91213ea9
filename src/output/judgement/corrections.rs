//! What a corrected program is worth, beside its text: corrections.csv and findings.json.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{Display, Write as _};

use serde::{Deserialize, Serialize};

use crate::assess::sigma_in_base;
use crate::diagnose::Weight;
use crate::error::{Code, Result};
use crate::frames::knowledge::scatter_m;
use crate::frames::{Knowledge, KnownRobot};
use crate::geom::Pose;
use crate::model::robot::{Posture, Robot};
use crate::output::restore::FoundModel;
use crate::output::solution_json::SolutionRecord;
use crate::programs::compensate::{Compensated, RESIDUAL};
use crate::programs::{KnownError, Left, Program, Target, TargetKind, TargetOutcome};
use crate::urdf::Chain;

/// Name of the table of corrections.
pub const TABLE: &str = "corrections.csv";
/// Name of the file of findings.
pub const FINDINGS: &str = "findings.json";
/// Taught joints and poses of one program that lie further apart, RMS, are not of the nominal model, m.
const SAME_MODEL: f64 = 5e-5;
/// Joints and a pose further apart were taught with another tool or work frame, m.
const SAME_FRAMES: f64 = 0.02;

/// What was found about a program or the models it was corrected with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FileFinding {
    /// Code that stays the same in every version.
    pub code: Code,
    /// Its weight.
    pub weight: Weight,
    /// File that it is about.
    pub subject: String,
    /// Numbers by name, the unit at the end of the name.
    pub quantities: BTreeMap<String, f64>,
    /// In words.
    pub text: String,
}

impl FileFinding {
    /// About a file, with numbers by name.
    pub fn new<const N: usize>(
        code: Code,
        weight: Weight,
        subject: impl Display,
        quantities: [(&str, f64); N],
        text: String,
    ) -> Self {
        Self { code, weight, subject: subject.to_string(), quantities: numbers(quantities), text }
    }
}

/// A solution that failed checks of its own, which what is made with it inherits; `None` of any other.
pub fn untrusted(record: &SolutionRecord, weight: Weight, subject: impl Display) -> Option<FileFinding> {
    let failed = record.findings.iter().filter(|f| f.weight == Weight::Gate);
    let codes: BTreeSet<&str> = failed.map(|f| f.code.name()).collect();
    let codes = codes.into_iter().collect::<Vec<_>>().join(", ");
    let codes = if codes.is_empty() { codes } else { format!(" ({codes})") };
    let text = format!(
        "the solution that it comes from is not to be trusted{codes}, and what is wrong there is wrong here: see `robotcal show`, mend the series and identify again"
    );
    let quantities = [("checks_failed", record.failed_gates.len() as f64)];
    (!record.failed_gates.is_empty())
        .then(|| FileFinding::new(Code::SolutionUntrusted, weight, subject, quantities, text))
}

/// Numbers by name.
pub fn numbers<const N: usize>(all: [(&str, f64); N]) -> BTreeMap<String, f64> {
    all.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

/// Whether the nominal model is the one in the controller: by joints and poses that were taught together.
pub fn nominal_findings(program: &Program, done: &Compensated) -> Vec<FileFinding> {
    let mut findings = Vec::new();
    for (k, file) in program.files.iter().enumerate() {
        let of_file = program.targets.iter().zip(&done.taught).filter(|(t, _)| t.file == k);
        let apart: Vec<f64> = of_file.filter_map(|(_, taught)| taught.map(|(_, m)| m)).collect();
        let (same, other): (Vec<f64>, Vec<f64>) = apart.iter().partition(|m| **m < SAME_FRAMES);
        let mut add = |code, weight, values: &[f64], words: &str| {
            let (rms_mm, max_mm) = (1e3 * rms(values), 1e3 * largest(values));
            let quantities = numbers([("pairs", values.len() as f64), ("rms_mm", rms_mm), ("max_mm", max_mm)]);
            let text = format!(
                "{} taught poses lie {rms_mm:.3} mm RMS ({max_mm:.3} mm at most) from where the nominal model puts the joints beside them: {words}",
                values.len()
            );
            findings.push(FileFinding { code, weight, subject: file.name.clone(), quantities, text });
        };
        if !same.is_empty() && rms(&same) <= SAME_MODEL {
            add(Code::NominalIsControllers, Weight::Note, &same, "it is the model in the controller");
        } else if !same.is_empty() {
            let words = "it is not the model in the controller, and the corrected poses keep an error of that size; give the controller's own model with --nominal (Universal Robots: the one that ur_calibration reads from the robot)";
            add(Code::NominalDiffers, Weight::Gate, &same, words);
        }
        if !same.is_empty() && !other.is_empty() {
            let words = "taught with another tool or base; they tell the posture only";
            add(Code::TaughtWithOtherFrames, Weight::Note, &other, words);
        } else if !other.is_empty() {
            let words = "the base frame or the tool is not that of the program: look at --base (the controllers of Universal Robots compute in `base`, half a turn about z from `base_link` of ur_description), --work and set_tcp";
            add(Code::FramesDiffer, Weight::Gate, &other, words);
        }
    }
    findings
}

/// Displaced targets whose orientation is that of the point that they start from.
pub fn displaced_finding(program: &Program, done: &Compensated) -> Option<FileFinding> {
    let left = |o: &TargetOutcome| match o {
        TargetOutcome::Done(c) if c.residual_rad > RESIDUAL => Some(1e3 * c.residual_rad),
        _ => None,
    };
    let mrad: Vec<f64> = done.outcomes.iter().filter_map(left).collect();
    let max_mrad = largest(&mrad);
    (!mrad.is_empty()).then(|| FileFinding {
        code: Code::DisplacedOrientation,
        weight: Weight::Note,
        subject: program.files.first().map_or_else(String::new, |f| f.name.clone()),
        quantities: numbers([("targets", mrad.len() as f64), ("max_mrad", max_mrad)]),
        text: format!("{} displaced targets are exact in place and turned as the points that they start from: {max_mrad:.4} mrad at most are left (RelTool can turn, Offs cannot)", mrad.len()),
    })
}

/// Poses of a table: the joints beside them are corrected, and they are not.
pub fn poses_kept_finding(program: &Program, done: &Compensated) -> Option<FileFinding> {
    let is_beside = |(target, outcome): &(&Target, &TargetOutcome)| {
        let is_done = matches!(outcome, TargetOutcome::Done(_));
        is_done && matches!(&target.kind, TargetKind::Pose(pose) if pose.has_joint_fields())
    };
    let count = program.targets.iter().zip(&done.outcomes).filter(is_beside).count();
    (count > 0).then(|| FileFinding {
        code: Code::PosesKept,
        weight: Weight::Note,
        subject: program.files.first().map_or_else(String::new, |f| f.name.clone()),
        quantities: numbers([("targets", count as f64)]),
        text: format!("the joints of {count} targets are corrected, and the poses beside them are as they were, which say where the tool is to be: send the joints"),
    })
}

/// Targets that stay as they are, by the names of their reasons: how many, and how many for each.
pub fn left_finding<'a>(reasons: impl Iterator<Item = &'a str>, subject: &str) -> Option<FileFinding> {
    let mut quantities = numbers([("targets", 0.0)]);
    for reason in reasons {
        for counted in ["targets", reason] {
            *quantities.entry(counted.to_owned()).or_default() += 1.0;
        }
    }
    let targets = quantities["targets"];
    let text = format!("{targets} targets stay as they are, each with its reason in {TABLE}");
    let (code, weight, subject) = (Code::TargetsLeft, Weight::Gate, subject.to_owned());
    (targets > 0.0).then_some(FileFinding { code, weight, subject, quantities, text })
}

/// No target at all: the text is not of that language, or it moves nothing.
pub fn missing_finding(program: &Program, left: &[Left], subject: &str) -> Option<FileFinding> {
    let is_empty = program.targets.is_empty() && left.is_empty();
    let text = "no target is found in the programs: look at --language, and whether the files are whole".to_owned();
    is_empty.then(|| FileFinding::new(Code::TargetsMissing, Weight::Gate, subject, [], text))
}

/// Expected error of every corrected target with base and tool unknown, m; with what a part of the model lacks, where it was corrected by that.
pub fn expected_errors(
    program: &Program,
    done: &Compensated,
    model: &FoundModel,
    part: Option<&Robot>,
) -> Vec<Option<f64>> {
    let expected = |(target, outcome): (&crate::programs::Target, &TargetOutcome)| {
        let TargetOutcome::Done(c) = outcome else { return None };
        let tool = match &target.kind {
            TargetKind::Pose(pose) => pose.flange_from_tool,
            TargetKind::Joints(joints) => joints.frames[0].pose().unwrap_or_else(Pose::identity),
        };
        let at_tool = |robot: &Robot| robot.base_from_tip(&c.corrected) * tool;
        let lacking_m = part.map_or(0.0, |part| at_tool(part).distance(&at_tool(&model.robot)).1);
        let sigma_m = sigma_in_base(&model.robot, &model.layout, &model.covariance, &c.corrected, &tool);
        Some(sigma_m.hypot(lacking_m))
    };
    program.targets.iter().zip(&done.outcomes).map(expected).collect()
}

/// Expected error of every corrected target by measured frames, m: that of the tool in the work object, joint noise of one arrival included.
pub fn expected_with_frames(program: &Program, done: &Compensated, sides: &[FramedRobot]) -> Vec<Option<f64>> {
    let expected = |(target, outcome): (&crate::programs::Target, &TargetOutcome)| {
        let TargetOutcome::Done(c) = outcome else { return None };
        let own = match &target.kind {
            TargetKind::Pose(pose) => pose.flange_from_tool,
            TargetKind::Joints(joints) => joints.frames[0].pose().unwrap_or_else(Pose::identity),
        };
        let square = |side: &FramedRobot| {
            let tool = side.tool.unwrap_or(own);
            let posture = Posture::at(if side.is_taught { &c.programmed } else { &c.corrected });
            let sigma_m = side.knowledge.sigma_m(&side.robot, &posture, &tool, &side.work);
            let scatter = if side.is_taught { 0.0 } else { scatter_m(&side.robot, &posture, &tool) };
            sigma_m.powi(2) + scatter.powi(2)
        };
        Some(sides.iter().map(square).sum::<f64>().sqrt())
    };
    program.targets.iter().zip(&done.outcomes).map(expected).collect()
}

/// A robot with its measured frames.
#[derive(Debug, Clone)]
pub struct FramedRobot {
    /// The robot.
    pub robot: KnownRobot,
    /// What is known of tool and work object.
    pub knowledge: Knowledge,
    /// `tip_from_tool`, where it was measured.
    pub tool: Option<Pose>,
    /// `base_from_work`.
    pub work: Pose,
    /// True for the robot on which the program was taught.
    pub is_taught: bool,
}

impl KnownError for FramedRobot {
    fn error_m(&self, readings: &[f64]) -> nalgebra::Vector3<f64> {
        let tool = self.tool.unwrap_or_else(Pose::identity);
        self.knowledge.error_m(&self.robot, &Posture::at(readings), &tool, &self.work)
    }
}

/// Which tool and base a program was corrected with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Meant {
    /// Nothing was said: they stand where the description has them, which nobody measured.
    Untold,
    /// They are taken as nominal, as the user asks.
    Nominal,
    /// They were measured: what of them, in words.
    Measured(String),
}

impl Meant {
    /// Behind "corrected".
    pub fn in_words(&self) -> String {
        match self {
            Self::Untold => String::new(),
            Self::Nominal => " for a robot whose base and tool are exactly where the program has them".into(),
            Self::Measured(what) => format!(", with {what}"),
        }
    }
}

/// What the numbers promise, by what is known of base and tool; `Err` says why it is not known. Where nobody said what to take them for, and they
/// are known worse than the correction is large, the program is not corrected.
pub fn expected_findings(
    expected: std::result::Result<&[Option<f64>], &str>,
    done: &Compensated,
    meant: &Meant,
    subject: &str,
) -> Vec<FileFinding> {
    let shifts: Vec<f64> = (done.outcomes.iter())
        .filter_map(|o| if let TargetOutcome::Done(c) = o { Some(1e3 * c.shift_m) } else { None })
        .collect();
    if shifts.is_empty() {
        return Vec::new();
    }
    let errors_mm: std::result::Result<Vec<f64>, &str> =
        expected.map(|each| each.iter().flatten().map(|m| 1e3 * m).collect());
    let (unknown_mm, correction_mm) = (errors_mm.as_ref().ok().map(|mm| rms(mm)), rms(&shifts));
    let error = match &errors_mm {
        Ok(mm) => error_known(mm, meant, subject),
        Err(why) => error_unknown(why, subject),
    };
    let frames = match meant {
        Meant::Untold if unknown_mm.is_none_or(|mm| mm > correction_mm) => {
            Some(frames_unknown(unknown_mm, correction_mm, subject))
        }
        Meant::Nominal => Some(frames_nominal(subject)),
        _ => None,
    };
    std::iter::once(error).chain(frames).collect()
}

fn error_known(mm: &[f64], meant: &Meant, subject: &str) -> FileFinding {
    let (rms_mm, max_mm) = (rms(mm), largest(mm));
    let text = match meant {
        Meant::Measured(what) => format!(
            "the tool is expected {rms_mm:.3} mm RMS ({max_mm:.3} mm at most) from where the program meant it, joint noise included, with {what}"
        ),
        _ => format!(
            "in the base frame the tool is expected {rms_mm:.2} mm RMS ({max_mm:.2} mm at most) from where the program meant it: images do not tell where base and tool stand"
        ),
    };
    let quantities = numbers([("targets", mm.len() as f64), ("rms_mm", rms_mm), ("max_mm", max_mm)]);
    FileFinding { code: Code::ExpectedError, weight: Weight::Note, subject: subject.to_owned(), quantities, text }
}

fn error_unknown(why: &str, subject: &str) -> FileFinding {
    let text = format!(
        "how far the tool will be from where the program meant it is not known ({why}); base and tool are usually wrong by millimetres"
    );
    let (code, quantities) = (Code::ExpectedErrorUnknown, BTreeMap::new());
    FileFinding { code, weight: Weight::Note, subject: subject.to_owned(), quantities, text }
}

/// Nobody stated base and tool, and they are known worse than the correction is large.
fn frames_unknown(unknown_mm: Option<f64>, correction_mm: f64, subject: &str) -> FileFinding {
    let remedy =
        "measure them with a few touches (robotcal frames) and give --frames frames.json, or say --frames nominal";
    let size =
        unknown_mm.map_or_else(|| "by an unknown amount".to_owned(), |mm| format!("by {mm:.2} mm RMS at the targets"));
    let text = format!(
        "base and tool of the real robot are unknown {size}, and the correction itself is {correction_mm:.2} mm RMS: the program repeats the shape of what was meant, and is not corrected; {remedy}"
    );
    let known = unknown_mm.map(|mm| ("unknown_mm", mm)).into_iter();
    let quantities = known.chain([("correction_mm", correction_mm)]).map(|(n, v)| (n.to_owned(), v)).collect();
    FileFinding { code: Code::FramesUnknown, weight: Weight::Gate, subject: subject.to_owned(), quantities, text }
}

fn frames_nominal(subject: &str) -> FileFinding {
    let text = "base and tool are taken as nominal, as asked for: right where the real ones are".to_owned();
    let (code, quantities) = (Code::FramesNominal, BTreeMap::new());
    FileFinding { code, weight: Weight::Note, subject: subject.to_owned(), quantities, text }
}

/// All findings as JSON, one a line.
///
/// # Errors
/// None in practice: every field can be written as JSON.
pub fn findings_json(findings: &[impl Serialize], written: &[impl Serialize]) -> Result<String> {
    let lines: Vec<String> = findings.iter().map(line).chain(written.iter().map(line)).collect::<Result<_>>()?;
    Ok(format!("[\n{}\n]\n", lines.join(",\n")))
}

fn line(finding: &impl Serialize) -> Result<String> {
    let error = |e| crate::error::Error::new(Code::RecordNotWritten, FINDINGS, e, "report this");
    serde_json::to_string(finding).map_err(error)
}

/// One row for every target: what the correction is, or why there is none.
pub fn table(program: &Program, done: &Compensated, expected: Option<&[Option<f64>]>, chain: &Chain) -> String {
    let mut out = String::from(
        "file,line,target,correction_mm,correction_mrad,largest_joint_change,joint,joint_unit,rounding_m,rounding_rad,left_because,posture,expected_mm,taught_mm,reason\n",
    );
    let cell = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
    let millimetres = |m: Option<f64>| m.map_or_else(String::new, |m| format!("{:.4}", 1e3 * m));
    let told = program.targets.iter().zip(&done.outcomes).enumerate().filter(|(k, _)| !done.is_said(program, *k));
    for (k, (t, outcome)) in told {
        let head = format!("{},{},{}", cell(&program.files[t.file].name), t.line, cell(&t.name));
        let expected = millimetres(expected.and_then(|e| e[k]));
        let taught = millimetres(done.taught[k].map(|(_, m)| m));
        let _ = match outcome {
            TargetOutcome::Done(c) => {
                let (joint, change) = c.largest_change();
                let (mm, mrad) = (1e3 * c.shift_m, 1e3 * c.turn_rad);
                let (name, unit) = (cell(&chain.readings[joint]), chain.reading_kinds[joint].units()[0]);
                let (rest_m, rest_rad) = (c.residual_m, c.residual_rad);
                let posture = c.posture.word();
                writeln!(
                    out,
                    "{head},{mm:.4},{mrad:.4},{change:.9},{name},{unit},{rest_m:.2e},{rest_rad:.2e},,{posture},{expected},{taught},"
                )
            }
            TargetOutcome::Left(why) => {
                writeln!(out, "{head},,,,,,,,{},,,{taught},{}", cell(&why.words), why.reason.name())
            }
        };
    }
    for l in &program.left {
        let (file, name) = (cell(&program.files[l.file].name), cell(&l.name));
        let _ = writeln!(out, "{file},{},{name},,,,,,,,{},,,,{}", l.line, cell(&l.why.words), l.why.reason.name());
    }
    out
}
