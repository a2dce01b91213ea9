//! Closed forms that the adjustment starts from.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::equations::{Columns, Given, Unknowns};
use super::robot::KnownRobot;
use super::touch::{TouchPlace, Touches};
use crate::assess::{MeasuredPoint, fit_points};
use crate::geom::{Pose, project_to_so3, rigid_fit};
use crate::linalg::SymmetricFactor;

/// Tool points of all bodies in the tip and unknown places, by linear least squares: `R_j t + p_j = w`, where every place is unknown or
/// known in the base. `None` where the touches do not determine them.
fn linear(tips: &[Pose], touches: &Touches, work: Option<&Pose>) -> Option<[Vec<Vector3<f64>>; 2]> {
    let (bodies, contacts) = (touches.bodies.len(), touches.contacts.len());
    let n = 3 * (bodies + contacts);
    let (mut information, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
    for t in &touches.all {
        let tip = &tips[t.posture];
        let mut a = DMatrix::zeros(3, n);
        a.view_mut((0, 3 * t.body), (3, 3)).copy_from(&tip.rotation);
        let known = match (t.seen, work) {
            (TouchPlace::Unknown(contact), _) => {
                a.view_mut((0, 3 * (bodies + contact)), (3, 3)).copy_from(&-Matrix3::identity());
                Vector3::zeros()
            }
            (TouchPlace::Point(place), Some(work)) => work.transform(&place),
            (TouchPlace::Pose(pose), Some(work)) => work.transform(&pose.translation),
            (_, None) => continue,
        };
        information += a.tr_mul(&a);
        right += a.tr_mul(&DVector::from_column_slice((known - tip.translation).as_slice()));
    }
    let x = SymmetricFactor::new(&information).ok()?.solve(&right);
    let points: Vec<Vector3<f64>> =
        (0..bodies + contacts).map(|k| Vector3::new(x[3 * k], x[3 * k + 1], x[3 * k + 2])).collect();
    points
        .iter()
        .all(|p| p.iter().all(|v| v.is_finite()))
        .then(|| [points[..bodies].to_vec(), points[bodies..].to_vec()])
}

/// The work object where the tool points are known.
fn work_of(tips: &[Pose], touches: &Touches, points: &[Vector3<f64>]) -> Option<Pose> {
    let pair = |(t, place): (&super::touch::Touch, Vector3<f64>)| (place, tips[t.posture].transform(&points[t.body]));
    rigid_fit(&touches.placed().map(pair).collect::<Vec<_>>())
}

/// Tool and work object together, from the places of the body that has most.
fn both(robot: &KnownRobot, touches: &Touches) -> Option<Pose> {
    let count = |body: usize| touches.placed().filter(|(t, _)| t.body == body).count();
    let body = (0..touches.bodies.len()).max_by_key(|&b| (count(b), std::cmp::Reverse(b)))?;
    let of_body = touches.placed().filter(|(t, _)| t.body == body);
    let point = |(t, position_m): (&super::touch::Touch, Vector3<f64>)| MeasuredPoint {
        position_m,
        readings: touches.postures[t.posture].readings.clone(),
    };
    let fitted = fit_points(robot.exported(), &of_body.map(point).collect::<Vec<_>>())?;
    Some(fitted.device_from_base.inverse())
}

/// A value of every unknown near which the adjustment converges; `None` where the touches determine none.
pub(super) fn start(robot: &KnownRobot, touches: &Touches, columns: &Columns, given: &Given) -> Option<Unknowns> {
    let tips: Vec<Pose> = touches.postures.iter().map(|p| robot.at(p).0).collect();
    let (points, work, places) = located(robot, &tips, touches, columns, given)?;
    let of_given = given.tool.map_or_else(Matrix3::identity, |t| t.rotation);
    let rotation = |body: usize| rotation_seen(&tips, touches, &work, body).unwrap_or(of_given);
    let tools = points.iter().enumerate().map(|(b, p)| Pose::new(rotation(b), *p)).collect();
    // Places are in the work object.
    let mut places: Vec<Vector3<f64>> = places.iter().map(|p| work.inverse().transform(p)).collect();
    if given.tool.is_some() {
        for (contact, place) in places.iter_mut().enumerate() {
            let touching = touches.all.iter().find(|t| t.seen == TouchPlace::Unknown(contact))?;
            *place = work.inverse().transform(&tips[touching.posture].transform(&points[touching.body]));
        }
    }
    Some(Unknowns { tools, work, places })
}

/// Points of the bodies in the tip, the work object, and the places that are not known, in the base.
type Located = (Vec<Vector3<f64>>, Pose, Vec<Vector3<f64>>);

/// By what is given of them, as far as it is.
fn located(robot: &KnownRobot, tips: &[Pose], touches: &Touches, columns: &Columns, given: &Given) -> Option<Located> {
    let zero = vec![Vector3::zeros(); touches.contacts.len()];
    Some(match (given.tool, given.plate) {
        (Some(tool), plate) => {
            let points = vec![tool.translation; touches.bodies.len()];
            let work = match plate {
                Some(plate) => plate,
                None if columns.work_is_free() => work_of(tips, touches, &points)?,
                None => Pose::identity(),
            };
            (points, work, zero)
        }
        (None, Some(plate)) => {
            let [points, places] = linear(tips, touches, Some(&plate))?;
            (points, plate, places)
        }
        (None, None) if !columns.work_is_free() => {
            let [points, places] = linear(tips, touches, None)?;
            (points, Pose::identity(), places)
        }
        (None, None) => {
            // Places that are not known tell the tool; known ones tell both.
            let work = match linear(tips, touches, None) {
                Some([points, _]) => work_of(tips, touches, &points)?,
                None => both(robot, touches)?,
            };
            let [points, places] = linear(tips, touches, Some(&work))?;
            (points, work, places)
        }
    })
}

/// How a body is turned in the tip, by the touches that see it as a pose; none where none does.
fn rotation_seen(tips: &[Pose], touches: &Touches, work: &Pose, body: usize) -> Option<Matrix3<f64>> {
    let turned = touches.all.iter().filter_map(|t| match t.seen {
        TouchPlace::Pose(pose) if t.body == body => {
            Some(tips[t.posture].rotation.transpose() * work.rotation * pose.rotation)
        }
        _ => None,
    });
    let sum = turned.fold(Matrix3::zeros(), |sum, r| sum + r);
    project_to_so3(&sum).filter(|_| touches.is_pose(body))
}
