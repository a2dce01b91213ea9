//! `robotcal verify`: a corrected model judged by points that another device measured, or by another series.

use std::path::PathBuf;

use nalgebra::Vector3;

use super::joint_table::{self, Unit};
use super::robot::read_chain;
use super::say::say_line;
use super::verify_args::VerifyArgs;
use super::{Verdict, verify_series};
use crate::assess::{MeasuredPoint, fit_points};
use crate::error::{Code, Error, Result};
use crate::output::compensated;
use crate::urdf::Chain;

pub(super) fn run(args: &VerifyArgs) -> Result<Verdict> {
    match (&args.points, args.joint_unit) {
        (Some(file), Some(unit)) => points(args, file, unit),
        _ => verify_series::run(args, &args.recording),
    }
}

/// How far, RMS, points may be from where a robot puts them, m: robots miss by millimetres.
const FARTHEST_M: f64 = 0.05;

fn points(args: &VerifyArgs, points_file: &std::path::Path, unit: Unit) -> Result<Verdict> {
    let rms = |file: &PathBuf, compensation: Option<&PathBuf>| -> Result<(usize, f64, f64)> {
        let chain = read_chain(file, args.base.as_deref(), args.tip.as_deref())?;
        let points = read_points(points_file, &chain, unit)?;
        let robot = compensated(chain, compensation.map(PathBuf::as_path))?;
        let fit = fit_points(&robot, &points).ok_or_else(|| {
            Error::new(
                Code::PointsUndetermined,
                points_file.display(),
                "the points do not determine the frame of the device and the reflector",
                "measure at least 10 points that differ in position and in hand orientation",
            )
        })?;
        if fit.rms_m > FARTHEST_M {
            let what = format!(
                "the points are {:.0} mm RMS from where {} puts them: no error of a robot, but another robot or other readings",
                1e3 * fit.rms_m,
                file.display()
            );
            let remedy = "check --joint-unit, the order of the joint columns, and the unit of the points (m)";
            return Err(Error::new(Code::PointsContradict, points_file.display(), what, remedy));
        }
        let worst = fit.residuals_m.iter().map(Vector3::norm).fold(0.0, f64::max);
        Ok((points.len(), 1e3 * fit.rms_m, 1e3 * worst))
    };
    let (count, corrected, worst) = rms(&args.urdf, args.compensation.as_ref())?;
    say_line!("points    {count} of {}; frame of the device and reflector fitted", points_file.display());
    say_line!("model     {}: {corrected:.3} mm RMS, worst {worst:.3} mm", args.urdf.display());
    let Some(file) = &args.nominal else { return Ok(Verdict::Good) };
    let (_, nominal, worst) = rms(file, None)?;
    say_line!("nominal   {}: {nominal:.3} mm RMS, worst {worst:.3} mm", file.display());
    if corrected < nominal {
        say_line!("verdict   good: {:.0} % of the nominal error", 100.0 * corrected / nominal);
        return Ok(Verdict::Good);
    }
    say_line!("verdict   NOT TO BE TRUSTED: the corrected model is no better than the nominal one");
    Ok(Verdict::GateFailed)
}

fn read_points(path: &std::path::Path, chain: &Chain, unit: Unit) -> Result<Vec<MeasuredPoint>> {
    let rows = joint_table::read(path, &["x_m", "y_m", "z_m"], &chain.readings, &chain.reading_kinds, unit)?;
    let point = |(xyz, readings): (Vec<f64>, Vec<f64>)| MeasuredPoint {
        position_m: Vector3::from_column_slice(&xyz),
        readings,
    };
    Ok(rows.into_iter().map(point).collect())
}
