//! `robotcal verify`: a corrected model judged by points that another device measured, or by another series.

use std::collections::HashMap;
use std::path::Path;

use nalgebra::Vector3;

use super::verify_args::VerifyArgs;
use super::verify_model::Model;
use super::verify_points::{Laid, apart, of_another_size, open};
use super::verify_series;
use super::verify_verdict::{Gain, Measured, Reasons};
use crate::assess::{
    Limits, MeasuredPoint, PointFit, ReadingMistake, bootstrap_ratio, by_cluster, fit_points, reading_mistake,
};
use crate::cli::Verdict;
use crate::cli::flags::joint_table::{self, Unit};
use crate::cli::flags::robot::read_chain;
use crate::cli::terminal::say::say_line;
use crate::error::{Code, Error, Result};
use crate::model::robot::Robot;
use crate::output::compensated;
use crate::output::restore::add;
use crate::urdf::Chain;

/// Said where a solution says what to expect, and nothing is said of the device.
const EXACT: &str = "; they count as exact: --point-sigma-m tells what they scatter by";

pub fn run(args: &VerifyArgs) -> Result<Verdict> {
    match (&args.points, args.joint_unit) {
        (Some(file), Some(unit)) => points(args, file, unit),
        _ => verify_series::run(args, &args.recording),
    }
}

/// A robot model with the fit of the points to it.
struct Judged {
    robot: Robot,
    points: Vec<MeasuredPoint>,
    /// For every point the number of its readings.
    clusters: Vec<usize>,
    fit: PointFit,
}

impl Judged {
    fn of(robot: Robot, points: Vec<MeasuredPoint>, file: &Path) -> Result<Self> {
        let fit = fit_points(&robot, &points).ok_or_else(|| {
            Error::new(
                Code::PointsUndetermined,
                file.display(),
                "the points do not determine the frame of the device and the reflector",
                "measure at least 10 points that differ in position and in hand orientation",
            )
        })?;
        Ok(Self { robot, clusters: clusters(&points), points, fit })
    }

    /// With offsets added to all readings, rad or m.
    fn with_added(mut self, offsets: &[f64], file: &Path) -> Result<Self> {
        self.points.iter_mut().for_each(|point| add(&mut point.readings, offsets));
        Self::of(self.robot, self.points, file)
    }

    fn laid(&self) -> Laid<'_> {
        (&self.robot, &self.points, &self.fit)
    }

    /// Number of points at different readings.
    fn different(&self) -> usize {
        self.clusters.iter().max().map_or(0, |last| last + 1)
    }

    /// By the points but some; `None` where the others do not determine the frames.
    fn without(&self, left_out: &[usize]) -> Option<Self> {
        let kept = self.points.iter().enumerate().filter(|(k, _)| !left_out.contains(k));
        let points: Vec<MeasuredPoint> = kept.map(|(_, point)| point.clone()).collect();
        let fit = fit_points(&self.robot, &points)?;
        Some(Self { robot: self.robot.clone(), clusters: clusters(&points), points, fit })
    }
}

fn points(args: &VerifyArgs, file: &Path, unit: Unit) -> Result<Verdict> {
    let as_read = judged(args, (&args.urdf, args.compensation.as_deref()), (file, unit))?;
    let model = Model::of(as_read.robot.clone(), &args.urdf)?;
    let (stated, limits) = (model.stated.as_ref(), &model.limits);
    let device_m = point_sigma(args.point_sigma_m, limits)?;
    let zeros = args.readings.beside(stated, &args.urdf, &[])?;
    let of_model = match &zeros {
        Some(zeros) => as_read.with_added(&zeros.missing, file)?,
        None => as_read,
    };
    refuse_mistaken(&of_model, &args.urdf, file, limits)?;
    refuse_far(&of_model, &args.urdf, file, limits)?;
    let count = of_model.points.len();
    let exact = if stated.is_some() && args.point_sigma_m.is_none() { EXACT } else { "" };
    say_line!("points    {count} of {}; frame of the device and reflector fitted{exact}", file.display());
    zeros.iter().for_each(|zeros| say_line!("{}", zeros.line()));
    say_line!("{}", line("model", &args.urdf, &of_model));
    let nominal = args.nominal.as_ref().map(|urdf| {
        let nominal = judged(args, (urdf, None), (file, unit))?;
        refuse_far(&nominal, urdf, file, limits)?;
        say_line!("{}", line("nominal", urdf, &nominal));
        Ok(nominal)
    });
    let mut reasons = weigh((&args.urdf, &model), (&of_model, file, device_m), nominal.transpose()?.as_ref());
    reasons.findings.extend(model.doubts(&args.urdf, args.compensation.as_deref()));
    Ok(reasons.verdict())
}

/// The model beside what its solution states at the points, which scatter by the device, m per axis.
fn weigh(
    (urdf, model): (&Path, &Model),
    (judged, file, device_m): (&Judged, &Path, f64),
    nominal: Option<&Judged>,
) -> Reasons {
    let (stated, limits) = (model.stated.as_ref(), &model.limits);
    let expected_of = |points: &[MeasuredPoint]| stated.and_then(|s| s.at_points(points, device_m));
    let expected = expected_of(&judged.points);
    let mut reasons = Reasons::default();
    let (is_moved, wrong) = apart(judged.laid(), expected.as_ref(), limits, &mut reasons);
    let different = judged.different();
    if is_moved {
        reasons.against.push("the points do not belong together".into());
        return reasons;
    }
    if different < limits.scatter_images {
        reasons.against.push(format!(
            "{different} different points, of which frame and reflector take up nine of {} values: measure {} or more",
            3 * different,
            limits.scatter_images
        ));
        return reasons;
    }
    let gain = nominal.and_then(|nominal| gain(judged, nominal, &wrong));
    if nominal.is_some() && gain.is_none() {
        reasons.against.push("the nominal model leaves nothing".into());
    }
    // Wrong points are none of the robot's errors.
    let without = (!wrong.is_empty()).then(|| judged.without(&wrong)).flatten();
    let expected = without.as_ref().map_or(expected, |others| expected_of(&others.points));
    let judged = without.as_ref().unwrap_or(judged);
    let rms_m = judged.fit.rms_m;
    let stated_here = stated.zip(expected.map(|expected| expected.all));
    let is_stated = stated_here.is_some();
    reasons.add(&Measured { urdf, rms_m, stated: stated_here, gain }, limits);
    let is_bad = reasons.is_bad();
    if reasons.misses() || !is_stated && rms_m > limits.displaced_m {
        reasons.findings.extend(of_another_size(judged.laid(), file, limits));
    }
    if !is_bad {
        reasons.findings.extend(open(judged.laid(), stated, file, limits));
    }
    reasons
}

/// As stated; nothing where it is not.
fn point_sigma(stated: Option<f64>, limits: &Limits) -> Result<f64> {
    match stated.unwrap_or(0.0) {
        sigma if (0.0..limits.far_points_m).contains(&sigma) => Ok(sigma),
        sigma => Err(Error::new(
            Code::OptionRange,
            "--point-sigma-m",
            format!("{sigma} is no sigma of points in metres"),
            "give metres: 0.00005 are 0.05 mm",
        )),
    }
}

/// The error of a model over that of the nominal one, by the points but some.
fn gain<'a>(model: &Judged, nominal: &'a Judged, left_out: &[usize]) -> Option<Gain<'a>> {
    let robot = &nominal.robot;
    let [model, nominal] = [model, nominal].map(|judged| judged.without(left_out));
    let (model, nominal) = (model?, nominal?);
    let ratio = bootstrap_ratio(&units(&model, &model), &units(&model, &nominal))?;
    let readings = model.points.into_iter().map(|point| point.readings).collect();
    Some(Gain { ratio, nominal: robot, of: "points", at: (readings, model.fit.tip_point_m) })
}

fn judged(
    args: &VerifyArgs,
    (urdf, compensation): (&Path, Option<&Path>),
    (file, unit): (&Path, Unit),
) -> Result<Judged> {
    let chain = read_chain(urdf, args.base.as_deref(), args.tip.as_deref())?;
    let points = read_points(file, &chain, unit)?;
    let robot = compensated(chain, compensation)?;
    Judged::of(robot, points, file)
}

fn contradict(code: Code, (model, urdf): (&Judged, &Path), file: &Path, [why, remedy]: [&str; 2]) -> Error {
    let what =
        format!("the points are {:.1} mm RMS from where {} puts them{why}", 1e3 * model.fit.rms_m, urdf.display());
    Error::new(code, file.display(), what, remedy)
}

fn refuse_mistaken(model: &Judged, urdf: &Path, file: &Path, limits: &Limits) -> Result<()> {
    let Judged { robot, points, fit, .. } = model;
    // Of few points everything explains everything.
    if model.different() < limits.scatter_images || fit.rms_m < limits.displaced_m {
        return Ok(());
    }
    let Some((mistake, left_m)) = reading_mistake(robot, points, fit.rms_m, limits) else { return Ok(()) };
    let name = |reading: usize| &robot.chain.readings[reading];
    let columns = "correct the columns of the joints";
    let (code, undone, remedy) = match mistake {
        ReadingMistake::Reversed(joint) => {
            (Code::PointsContradict, format!("with the other sign of {}", name(joint)), columns)
        }
        ReadingMistake::Exchanged(a, b) => {
            (Code::PointsContradict, format!("with {} and {} exchanged", name(a), name(b)), columns)
        }
        ReadingMistake::Mirrored => (
            Code::AxesMirrored,
            "with one axis of theirs reversed: the axes of the device are left-handed, or the joints that turn the arm to its sides count the other way"
                .into(),
            "move one of these joints alone and look which way it turns: correct the signs of their columns, or export in right-handed axes",
        ),
        ReadingMistake::Shifted(by_one_above) => {
            let row = if by_one_above { "below" } else { "above" };
            let undone = format!("with the joint readings of the row {row}: the rows are shifted by one");
            (Code::RowsShifted, undone, "bring points and joint readings of the same stops into the same rows")
        }
    };
    let why = format!(", and {:.3} mm {undone}", 1e3 * left_m);
    Err(contradict(code, (model, urdf), file, [&why, remedy]))
}

fn refuse_far(model: &Judged, urdf: &Path, file: &Path, limits: &Limits) -> Result<()> {
    if model.fit.rms_m <= limits.far_points_m {
        return Ok(());
    }
    let why = ": no error of a robot, but another robot or other readings";
    let mut remedy = "check --joint-unit, the order of the joint columns, and the unit of the points (m)".to_owned();
    let chain = &model.robot.chain;
    let carrying = chain.carrying_base().map(|joint| &joint.name);
    let others: Vec<&str> = carrying.chain(chain.beside_arm()).map(String::as_str).collect();
    // Of links that stand still to each other the frame of the device takes up which is the base.
    if !others.is_empty() {
        remedy += &format!(
            "; and --base: the device has to stand still beside \"{}\", against which {} may move it",
            chain.base,
            others.join(", ")
        );
    }
    Err(contradict(Code::PointsContradict, (model, urdf), file, [why, &remedy]))
}

fn line(what: &str, urdf: &Path, Judged { fit, .. }: &Judged) -> String {
    let worst = fit.residuals_m.iter().map(Vector3::norm).fold(0.0, f64::max);
    format!("{what:<9} {}: {:.3} mm RMS, worst {:.3} mm", urdf.display(), 1e3 * fit.rms_m, 1e3 * worst)
}

/// For every point the number of its readings.
fn clusters(points: &[MeasuredPoint]) -> Vec<usize> {
    let mut known: HashMap<Vec<u64>, usize> = HashMap::new();
    let bits = |p: &MeasuredPoint| p.readings.iter().map(|q| q.to_bits()).collect();
    points
        .iter()
        .map(|p| {
            let next = known.len();
            *known.entry(bits(p)).or_insert(next)
        })
        .collect()
}

/// Squares of the residuals, those at the same readings together.
fn units(model: &Judged, judged: &Judged) -> Vec<(f64, f64)> {
    let squares: Vec<(f64, f64)> = judged.fit.residuals_m.iter().map(|r| (r.norm_squared(), 1.0)).collect();
    by_cluster(&model.clusters, &squares)
}

fn read_points(path: &Path, chain: &Chain, unit: Unit) -> Result<Vec<MeasuredPoint>> {
    let rows = joint_table::read(path, &["x_m", "y_m", "z_m"], chain, (unit, "--joint-unit"))?;
    let point = |(xyz, readings): (Vec<f64>, Vec<f64>)| MeasuredPoint {
        position_m: Vector3::from_column_slice(&xyz),
        readings,
    };
    Ok(rows.into_iter().map(point).collect())
}
