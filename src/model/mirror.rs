//! Which joints count the other way in the mirror image of an arm.
//!
//! With the mirror `M = I - 2 n n'` a rotation about `a` becomes one about `-M a` by the same angle, a shift along `a` one along `M a`. An arm whose
//! axes lie, at zero, all in one plane or stand upright on it is its own mirror image but for the signs of some readings: rotations about axes in the
//! plane and shifts across it. Distances, and whatever is given to a mirror image, are the same for both.

use nalgebra::Vector3;

use super::robot::Robot;
use crate::urdf::{Chain, JointKind};

/// An axis of a chain at zero.
struct Axis {
    reading: usize,
    kind: JointKind,
    direction: Vector3<f64>,
    point: Vector3<f64>,
}

/// Readings, by their indices, with whose signs changed a chain is its own mirror image: one set for every plane, each at least one reading. Axes may
/// be off by `tolerance`, rad, and the images of their places in the plane by as much, m.
pub fn mirror_images(chain: &Chain, tolerance: f64) -> Vec<Vec<usize>> {
    if chain.pose_coordinates().is_some() || chain.joints.iter().any(|j| j.is_between_bases()) {
        return Vec::new();
    }
    let axes = axes(chain);
    let mut all: Vec<Vec<usize>> =
        normals(&axes, tolerance).iter().filter_map(|normal| reversed(&axes, normal, tolerance)).collect();
    all.retain(|readings| !readings.is_empty());
    all.sort_by(|a, b| (a.len(), a).cmp(&(b.len(), b)));
    all.dedup();
    all
}

fn axes(chain: &Chain) -> Vec<Axis> {
    let poses = Robot::nominal(chain.clone()).link_poses(&vec![0.0; chain.readings.len()]);
    let moving = chain.joints.iter().zip(poses).filter_map(|(joint, pose)| Some((joint, pose, joint.drive?)));
    let axis = moving.map(|(joint, pose, drive)| Axis {
        reading: drive.reading,
        kind: joint.kind,
        direction: pose.rotation * joint.axis,
        point: pose.translation,
    });
    axis.collect()
}

/// Normals of planes that come into question: along an axis, across two, or across one and the way to another.
fn normals(axes: &[Axis], tolerance: f64) -> Vec<Vector3<f64>> {
    let along = axes.iter().map(|axis| axis.direction);
    let pairs = axes.iter().flat_map(|a| axes.iter().map(move |b| (a, b)));
    let across = pairs.flat_map(|(a, b)| [a.direction.cross(&b.direction), a.direction.cross(&(b.point - a.point))]);
    along.chain(across).filter_map(|normal| normal.try_normalize(tolerance)).collect()
}

/// The readings that the mirror image has with the other sign; `None` where it is another arm.
fn reversed(axes: &[Axis], normal: &Vector3<f64>, tolerance: f64) -> Option<Vec<usize>> {
    let (mut changed, mut kept, mut heights) = (Vec::new(), Vec::new(), Vec::new());
    for axis in axes {
        let is_upright = axis.direction.cross(normal).norm() < tolerance;
        if !is_upright && axis.direction.dot(normal).abs() > tolerance {
            return None;
        }
        let is_changed = (axis.kind == JointKind::Prismatic) == is_upright;
        let readings = if is_changed { &mut changed } else { &mut kept };
        readings.push(axis.reading);
        if axis.kind == JointKind::Revolute && !is_upright {
            heights.push(axis.point.dot(normal));
        }
    }
    let most = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let is_plane = heights.iter().all(|height| 2.0 * (most - height) < tolerance);
    changed.sort_unstable();
    changed.dedup();
    (is_plane && changed.iter().all(|reading| !kept.contains(reading))).then_some(changed)
}
