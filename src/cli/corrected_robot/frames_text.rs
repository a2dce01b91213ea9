//! What `frames` prints of a fit of touches.

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::DMatrix;

use crate::frames::{FrameFit, KnownRobot, Touches};
use crate::geom::Pose;
use crate::linalg::dense;
use crate::output::frame_findings::at_the_places;
use crate::output::frames_record::{FILE_NAME, FramesRecord, ToolKind, WorkKind};

/// Square roots of the diagonal, in thousandths.
fn sigmas(covariance: &DMatrix<f64>, first: usize) -> [f64; 3] {
    [0, 1, 2].map(|k| 1e3 * covariance[(first + k, first + k)].max(0.0).sqrt())
}

/// Rows of touches that are printed.
const MOST_ROWS: usize = 60;

/// The table on the terminal; `from` is the solution.
pub(super) fn text(from: &Path, made: &FramesRecord, fit: &FrameFit, touches: &Touches, robot: &KnownRobot) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = table(&mut out, from, made, fit, touches, robot);
    out
}

fn table(
    out: &mut String,
    from: &Path,
    made: &FramesRecord,
    fit: &FrameFit,
    touches: &Touches,
    robot: &KnownRobot,
) -> std::fmt::Result {
    writeln!(
        out,
        "robot     {}, {} to {}, corrected by {}",
        made.robot.name,
        made.robot.base,
        made.robot.tip,
        from.display()
    )?;
    if !touches.all.is_empty() {
        let used = fit.judged.iter().filter(|j| !j.left_out).count();
        let stated = touches.all.iter().map(|t| t.sigma_m).fold(0.0, f64::max);
        writeln!(
            out,
            "touches   {used} of {} in use, residual {:.3} mm RMS; sigma {:.3} mm as stated, {:.3} mm as found; joint noise {:.3} mm at the tool",
            touches.all.len(),
            1e3 * fit.rms_m,
            1e3 * stated,
            1e3 * stated * fit.factor,
            1e3 * fit.expected.joint_noise_m
        )?;
    }
    tool_rows(out, made, fit, touches)?;
    work_rows(out, made, fit, touches)?;
    let of = if made.work.is_some() { "in the work object" } else { "in the base" };
    writeln!(
        out,
        "expected  tool {of} {:.3} mm RMS over the {} stops of the solution and the touches (without these frames {:.3} mm), and joint noise {:.3} mm",
        1e3 * fit.expected.with_frames_m,
        robot.stops.len(),
        1e3 * fit.expected.without_m,
        1e3 * fit.expected.joint_noise_m
    )?;
    touch_rows(out, made)
}

/// Three lengths, mm.
fn millimetres(xyz: [f64; 3]) -> String {
    xyz.map(|v| format!("{:.3}", 1e3 * v + 0.0)).join(", ")
}

fn three(s: [f64; 3]) -> String {
    s.map(|v| format!("{v:.3}")).join(", ")
}

fn tool_rows(out: &mut String, made: &FramesRecord, fit: &FrameFit, touches: &Touches) -> std::fmt::Result {
    if let Some(tool) = &made.tool {
        let pose = Pose::from(&tool.pose);
        let how = match &fit.tool_covariances[0] {
            None => "as given".to_owned(),
            Some(c) if tool.measured == ToolKind::Pose => {
                format!("sigma {} mm; sigma of the turn {} mrad", three(sigmas(c, 0)), three(sigmas(c, 3)))
            }
            Some(c) => format!("sigma {} mm", three(sigmas(c, 0))),
        };
        writeln!(out, "tool      {} on {}: {} mm, {how}", tool.name, tool.parent, millimetres(pose.xyz()))?;
        if tool.measured != ToolKind::Pose {
            let rpy = pose.rpy().map(|v| format!("{:.4}", v.to_degrees() + 0.0)).join(", ");
            writeln!(
                out,
                "          roll, pitch, yaw {rpy} deg as given: touches of a point do not tell how the tool is turned"
            )?;
        }
        for (k, name) in touches.bodies.iter().enumerate().skip(1) {
            writeln!(out, "          also {name}: {} mm", millimetres(fit.tools[k].xyz()))?;
        }
    } else {
        writeln!(out, "tool      not told: nothing was touched")?;
    }
    Ok(())
}

fn work_rows(out: &mut String, made: &FramesRecord, fit: &FrameFit, touches: &Touches) -> std::fmt::Result {
    match (&made.work, &fit.work_covariance) {
        (Some(work), Some(c)) => {
            let pose = Pose::from(&work.pose);
            let rpy = pose.rpy().map(|v| format!("{:.4}", v.to_degrees() + 0.0)).join(", ");
            writeln!(
                out,
                "work      {} in {}: {} mm; roll, pitch, yaw {rpy} deg",
                work.name,
                work.parent,
                millimetres(pose.xyz())
            )?;
            if work.measured == WorkKind::Plate {
                writeln!(
                    out,
                    "          the plate of the solution: known relative to the robot as the images tell it"
                )?;
            } else {
                let (c, _) = at_the_places(c, touches);
                let c = dense(&c);
                writeln!(
                    out,
                    "          sigma {} mm in the middle of the places, {} mrad about its axes",
                    three(sigmas(&c, 0)),
                    three(sigmas(&c, 3))
                )?;
            }
        }
        _ => writeln!(
            out,
            "work      not told: no place is known (x_m, y_m, z_m of contacts.csv); the base stands where the description says"
        )?,
    }
    Ok(())
}

fn touch_rows(out: &mut String, made: &FramesRecord) -> std::fmt::Result {
    if !made.touches.is_empty() {
        writeln!(
            out,
            "{:>10}  {:<12} {:>9} {:>9} {:>9} {:>8}  {:>6}",
            "stop", "at", "dx mm", "dy mm", "dz mm", "mm", "sigmas"
        )?;
    }
    for t in made.touches.iter().take(MOST_ROWS) {
        let [x, y, z] = t.residual_m.map(|v| 1e3 * v);
        let length = 1e3 * t.residual_m.iter().map(|v| v * v).sum::<f64>().sqrt();
        let left = if t.left_out { "  left out" } else { "" };
        writeln!(
            out,
            "{:>10}  {:<12} {x:>9.3} {y:>9.3} {z:>9.3} {length:>8.3}  {:>6.1}{left}",
            t.stop, t.at, t.sigmas
        )?;
    }
    if made.touches.len() > MOST_ROWS {
        writeln!(out, "          {} more in {FILE_NAME}", made.touches.len() - MOST_ROWS)?;
    }
    Ok(())
}
