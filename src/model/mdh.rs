//! Modified Denavit-Hartenberg parameters of a chain (J. Craig, *Introduction to Robotics*): `T_i = RotX(alpha) TransX(a) RotZ(q + theta) TransZ(d)`.
//!
//! The parameters blow up where two axes are nearly parallel: their common normal lies metres away. Such axes are taken as parallel here, and the
//! reader is told what that leaves.

use nalgebra::{Matrix3, Vector3};

use crate::geom::Pose;
use crate::urdf::{Chain, JointKind};

/// Axes nearer to parallel than this (rad), but not parallel, are taken as parallel: half a degree, beyond all errors of assembly.
const NEARLY_PARALLEL: f64 = 0.01;
/// Axes nearer than this (m) intersect.
const INTERSECT: f64 = 1e-9;

/// One link: from the frame of the axis before to that of its own axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// Joint.
    pub joint: String,
    /// How it moves.
    pub kind: JointKind,
    /// Angle between the axes, rad.
    pub alpha_rad: f64,
    /// Distance of the axes, m.
    pub a_m: f64,
    /// Angle at reading zero, rad.
    pub theta_rad: f64,
    /// Shift along the axis (at reading zero), m.
    pub d_m: f64,
}

/// The table, with full poses at both ends.
#[derive(Debug, Clone, PartialEq)]
pub struct Mdh {
    /// `base_from_frame` before the first link.
    pub base: Pose,
    /// Links.
    pub links: Vec<Link>,
    /// `frame_from_tip` behind the last link.
    pub tip: Pose,
    /// Pairs of joints whose axes were taken as parallel, and the angle that is lost, mrad.
    pub parallel: Vec<(String, String, f64)>,
}

/// Why a chain has no such table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unfit(pub String);

struct Axis {
    joint: String,
    kind: JointKind,
    direction: Vector3<f64>,
    point: Vector3<f64>,
}

impl Mdh {
    /// The table of a chain.
    ///
    /// # Errors
    /// A chain with mimic joints.
    pub fn of(chain: &Chain) -> Result<Self, Unfit> {
        let (mut axes, base_from_tip) = axes(chain)?;
        let mut parallel = Vec::new();
        for i in 1..axes.len() {
            let (before, own) = (axes[i - 1].direction, axes[i].direction);
            let angle = before.cross(&own).norm().atan2(before.dot(&own).abs());
            if angle < NEARLY_PARALLEL {
                axes[i].direction = before * before.dot(&own).signum();
                if angle > 1e-12 {
                    parallel.push((axes[i - 1].joint.clone(), axes[i].joint.clone(), 1e3 * angle));
                }
            }
        }
        let first = first_frame(&axes[0]);
        let mut frame = first;
        let mut links: Vec<Link> = Vec::new();
        for (i, axis) in axes.iter().enumerate() {
            // Frame of this axis at zero: x towards the next axis.
            let next = own_frame(axis, axes.get(i + 1), &frame);
            let between = frame.inverse() * next;
            let z = between.rotation.column(2).into_owned();
            let alpha = (-z.y).atan2(z.z);
            let turned = Matrix3::new(1.0, 0.0, 0.0, 0.0, alpha.cos(), -alpha.sin(), 0.0, alpha.sin(), alpha.cos());
            let inner = turned.transpose() * between.rotation;
            let shift = turned.transpose() * between.translation;
            links.push(Link {
                joint: axis.joint.clone(),
                kind: axis.kind,
                alpha_rad: alpha,
                a_m: shift.x,
                theta_rad: inner[(1, 0)].atan2(inner[(0, 0)]),
                d_m: shift.z,
            });
            frame = next;
        }
        Ok(Self { base: first, links, tip: frame.inverse() * base_from_tip, parallel })
    }

    /// Pose of the tip for readings (rad, m).
    pub fn base_from_tip(&self, readings: &[f64]) -> Pose {
        let mut pose = self.base;
        for (link, q) in self.links.iter().zip(readings) {
            let (turn, slide) = if link.kind == JointKind::Prismatic { (0.0, *q) } else { (*q, 0.0) };
            let x = Pose::from_xyz_rpy([link.a_m, 0.0, 0.0], [link.alpha_rad, 0.0, 0.0]);
            let z = Pose::from_xyz_rpy([0.0, 0.0, link.d_m + slide], [0.0, 0.0, link.theta_rad + turn]);
            pose = pose * x * z;
        }
        pose * self.tip
    }
}

/// All axes at reading zero in the base frame, and the pose of the tip there.
fn axes(chain: &Chain) -> Result<(Vec<Axis>, Pose), Unfit> {
    let mut pose = Pose::identity();
    let mut axes = Vec::new();
    for joint in &chain.joints {
        pose = pose * joint.origin;
        let Some(drive) = joint.drive else { continue };
        if drive.multiplier != 1.0 || drive.offset != 0.0 || drive.reading != axes.len() {
            return Err(Unfit(format!("joint {} follows another one", joint.name)));
        }
        let direction = pose.rotation * joint.axis;
        axes.push(Axis { joint: joint.name.clone(), kind: joint.kind, direction, point: pose.translation });
    }
    Ok((axes, pose))
}

fn from_axes(z: Vector3<f64>, x: Vector3<f64>, origin: Vector3<f64>) -> Pose {
    let x = (x - z * z.dot(&x)).normalize();
    Pose::new(Matrix3::from_columns(&[x, z.cross(&x), z]), origin)
}

/// Frame on the first axis: origin next to that of the base, x as that of the base where it can.
fn first_frame(axis: &Axis) -> Pose {
    let helper = if axis.direction.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    from_axes(axis.direction, helper, axis.point - axis.direction * axis.direction.dot(&axis.point))
}

/// Frame of an axis: x along the common normal with the next one.
fn own_frame(axis: &Axis, next: Option<&Axis>, before: &Pose) -> Pose {
    let (z, p) = (axis.direction, axis.point);
    let foot = |of: &Vector3<f64>| p + z * z.dot(&(of - p));
    // Where the normal with the axis before meets this one: the origin without a shift along the axis.
    let level = nearest_on((z, p), (before.rotation.column(2).into_owned(), before.translation))
        .unwrap_or(foot(&before.translation));
    let x_before = before.rotation.column(0).into_owned();
    // The x axis before is never parallel to this axis but for a right angle of alpha about another x; then any normal serves.
    let fallback =
        if (x_before - z * z.dot(&x_before)).norm() > 1e-6 { x_before } else { before.rotation.column(1).into_owned() };
    let Some(next) = next else { return from_axes(z, fallback, level) };
    let cross = z.cross(&next.direction);
    if cross.norm() < 1e-12 {
        let across = (next.point - level) - z * z.dot(&(next.point - level));
        return from_axes(z, if across.norm() > INTERSECT { across } else { fallback }, level);
    }
    let own = nearest_on((z, p), (next.direction, next.point)).unwrap_or(level);
    let other = nearest_on((next.direction, next.point), (z, p)).unwrap_or(own);
    from_axes(z, if (other - own).norm() > INTERSECT { other - own } else { cross }, own)
}

/// Point of line `a` nearest to line `b` (direction and point each); `None` for parallel lines.
fn nearest_on(a: (Vector3<f64>, Vector3<f64>), b: (Vector3<f64>, Vector3<f64>)) -> Option<Vector3<f64>> {
    let ((da, pa), (db, pb)) = (a, b);
    let c = da.dot(&db);
    let sine = da.cross(&db).norm_squared();
    let between = pb - pa;
    (sine > 1e-20).then(|| pa + da * ((between.dot(&da) - between.dot(&db) * c) / sine))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::model::robot::Robot;

    /// Nominal robots, whose parallel axes are exactly parallel: the table says the same as the URDF, to rounding of its angles.
    #[test]
    fn tables_of_nominal_robots_are_exact() {
        for (file, tip) in [
            ("robots/kuka_kr6_r900/kuka_kr6_r900.urdf", "tool0"),
            ("robots/ur10e/ur10e.urdf", "tool0"),
            ("robots/lbr_iiwa_14/lbr_iiwa_14.urdf", "flange"),
        ] {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
            let chain = crate::urdf::read(&path).unwrap().chain(Some("base_link"), Some(tip)).unwrap();
            let mdh = Mdh::of(&chain).unwrap();
            let robot = Robot::nominal(chain);
            for k in 0..50 {
                let q: Vec<f64> = (0..mdh.links.len()).map(|i| 2.0 * ((7 * k + 3 * i) as f64).sin()).collect();
                let (rad, m) = mdh.base_from_tip(&q).distance(&robot.base_from_tip(&q));
                // Descriptions round right angles to some digits: lost where axes are taken as parallel.
                let lost: f64 = mdh.parallel.iter().map(|p| 1e-3 * p.2).sum();
                assert!(m < 1e-9 + 2.0 * lost && rad < 1e-9 + 2.0 * lost, "{file}: {m:e} m, {rad:e} rad, {mdh:?}");
                assert!(lost < 1e-5 && mdh.links.iter().all(|l| l.a_m.abs() < 1.0 && l.d_m.abs() < 1.0));
            }
        }
    }
}
