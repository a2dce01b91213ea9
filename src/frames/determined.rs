//! What touches cannot tell, said before anything is fitted.

use nalgebra::{Matrix3, Vector3};

use super::equations::{Columns, Given};
use super::robot::KnownRobot;
use super::touch::{TouchPlace, Touches};
use crate::assess::Limits;
use crate::error::{Code, Error, Result};

/// Refuses touches that cannot determine tool or work object.
///
/// # Errors
/// Too few touches, places in another unit than m, places on a line, one orientation of the tool for all.
pub(super) fn check(
    robot: &KnownRobot,
    touches: &Touches,
    columns: &Columns,
    given: &Given,
    limits: &Limits,
) -> Result<()> {
    let places: Vec<Vector3<f64>> = touches.placed().map(|(_, place)| place).collect();
    let extents = extents_m(&places);
    require_metres(touches, extents[0], limits)?;
    let fewest = limits.fewest_touches;
    if columns.tool_is_free() && touches.all.len() < fewest {
        let what =
            format!("there are {}; three unknowns of the tool and the place take {fewest}", counted(touches.all.len()));
        return refused(Code::TouchesFew, what, "touch the same point again, with the tip turned another way");
    }
    if columns.work_is_free() {
        require_places_of_work(&places, extents, limits)?;
    }
    let relative = given.plate.is_none();
    if columns.tool_is_free() && relative {
        orientations(robot, touches, limits)?;
    }
    Ok(())
}

fn refused(code: Code, what: String, remedy: &str) -> Result<()> {
    Err(Error::new(code, "touches", what, remedy))
}

fn require_metres(touches: &Touches, extent: f64, limits: &Limits) -> Result<()> {
    if extent > limits.touches_apart_m {
        let what = format!("the places lie {extent:.0} m apart (RMS about their middle), further than any arm reaches");
        return refused(Code::TouchUnit, what, "write x_m, y_m, z_m in metres, not in mm");
    }
    if let Some(t) = touches.all.iter().find(|t| t.sigma_m >= limits.touch_sigma_m) {
        let what = format!("the sigma of stop {} is {} m", t.stop, t.sigma_m);
        return refused(Code::TouchUnit, what, "write sigma_m in metres: 0.00005 for 0.05 mm");
    }
    Ok(())
}

/// Refuses known places that are too few, or on a line: they leave a work object open.
fn require_places_of_work(places: &[Vector3<f64>], extents: [f64; 3], limits: &Limits) -> Result<()> {
    let apart = count_apart(places, limits.touches_on_a_line);
    if apart < limits.fewest_places {
        let what = format!(
            "known places are {apart}, and a work object has six unknowns: it takes three that are not on a line"
        );
        let remedy = "touch more points of the work object, or leave x_m, y_m, z_m empty to find the tool alone";
        return refused(Code::TouchesFew, what, remedy);
    }
    if extents[1] < limits.touches_on_a_line * extents[0] {
        let what = format!(
            "the {apart} known places lie on a line ({:.2} mm RMS beside it, {:.0} mm along it): the work object could turn about it",
            1e3 * extents[1],
            1e3 * extents[0]
        );
        return refused(Code::TouchesOnLine, what, "touch a point far beside the line");
    }
    Ok(())
}

fn counted(touches: usize) -> String {
    if touches == 1 { "1 touch".into() } else { format!("{touches} touches") }
}

/// The tool is told by turning it: by what the tip's orientations differ within each group of touches whose place is common.
fn orientations(robot: &KnownRobot, touches: &Touches, limits: &Limits) -> Result<()> {
    // The tool is seen whole.
    if touches.all.iter().any(|t| matches!(t.seen, TouchPlace::Pose(_))) {
        return Ok(());
    }
    let eigen = scatter_of_rotations(robot, touches).symmetric_eigen();
    let least = eigen.eigenvalues.imin();
    let [turned, most] = [least, eigen.eigenvalues.imax()].map(|k| eigen.eigenvalues[k].max(0.0).sqrt());
    if turned >= limits.touches_turned_rad {
        return Ok(());
    }
    let deg = |rad: f64| format!("{:.1} degrees RMS", rad.to_degrees());
    let axis = eigen.eigenvectors.column(least);
    let (what, remedy) = if most < limits.touches_turned_rad {
        (
            format!("all have one orientation of the tip ({}): the tool point is unobservable", deg(most)),
            "touch with the tip turned by 30 degrees and more about different axes, or give the tool with --tool",
        )
    } else {
        (
            format!(
                "the tip was turned about one axis only ({} across it): the tool point is unobservable along ({:.2}, {:.2}, {:.2}) of the tip",
                deg(turned),
                axis[0],
                axis[1],
                axis[2]
            ),
            "tilt the tip, too: by 30 degrees and more about an axis across that one",
        )
    };
    Err(Error::new(Code::TouchesNotTurned, "touches", what, remedy))
}

/// Mean square of what the tip's rotations differ by from the means of their groups.
fn scatter_of_rotations(robot: &KnownRobot, touches: &Touches) -> Matrix3<f64> {
    let known = touches.contacts.len();
    let mut groups: Vec<Vec<Matrix3<f64>>> = vec![Vec::new(); known + 1];
    for t in &touches.all {
        let group = if let TouchPlace::Unknown(contact) = t.seen { contact } else { known };
        groups[group].push(robot.at(&touches.postures[t.posture]).0.rotation);
    }
    let mut scatter = Matrix3::zeros();
    for rotations in groups.iter().filter(|g| !g.is_empty()) {
        let mean = rotations.iter().sum::<Matrix3<f64>>() / rotations.len() as f64;
        scatter += rotations.iter().map(|r| (r - mean).transpose() * (r - mean)).sum::<Matrix3<f64>>();
    }
    scatter / touches.all.len() as f64
}

/// RMS extents of points about their middle along their principal axes, largest first, m.
pub(super) fn extents_m(points: &[Vector3<f64>]) -> [f64; 3] {
    if points.is_empty() {
        return [0.0; 3];
    }
    let n = points.len() as f64;
    let mean = points.iter().sum::<Vector3<f64>>() / n;
    let scatter = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum::<Matrix3<f64>>() / n;
    let mut all: [f64; 3] = scatter.symmetric_eigenvalues().map(|v| v.max(0.0).sqrt()).into();
    all.sort_by(|a, b| b.total_cmp(a));
    all
}

/// How many of the points are apart by more than a share of their extent.
fn count_apart(points: &[Vector3<f64>], share: f64) -> usize {
    let near = share * extents_m(points)[0];
    let is_new = |k: usize| points[..k].iter().all(|p| (p - points[k]).norm() > near);
    (0..points.len()).filter(|&k| is_new(k)).count()
}
