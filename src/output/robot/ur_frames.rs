//! Where ur_description has the frames of its links along the axes of the joints: meshes, masses and collision bodies hang on them.
//!
//! Axis `i` in the frame of its joint is `z`. A frame may slide along it by `s_i` without any change of the arm: the origin of joint `i` in the frame
//! before becomes `T(-s_(i-1)) O_i T(s_i)`. Frames of ur_description stand where axis 1 meets axis 2, axis 4 meets axis 5 and axis 5 meets axis 6, the
//! second where it meets axis 1, and the third, whose axis is parallel, beside the second.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Matrix3, Vector3};

use crate::geom::{Pose, exp_so3};

/// Frames that stand nearer (m) to their place in ur_description are left there: those of a calibrated arm are.
const NEAR_M: f64 = 0.01;
/// A frame that is turned by more (rad) about its axis than that of ur_description is another one.
const TURNED_RAD: f64 = 0.1;
/// Axes with a smaller sine of the angle between them are parallel.
const PARALLEL: f64 = 0.1;

/// Turns about x from every frame of ur_description to the next, rad.
const TURNS_RAD: [f64; 5] = [FRAC_PI_2, 0.0, 0.0, FRAC_PI_2, -FRAC_PI_2];

/// Pose at `s` along z.
pub(super) fn along_z(s: f64) -> Pose {
    Pose::new(Matrix3::identity(), Vector3::z() * s)
}

/// How far (m) the frames of an arm have to slide along their axes to stand as in ur_description, from its nominal origins, each in the frame of the
/// joint before; `None` where they are turned about their axes.
pub(super) fn slides(nominal: &[Pose; 6]) -> Option<[f64; 6]> {
    let [_, second, third, _, fifth, sixth] = nominal;
    let differs = |(origin, turn): (&Pose, f64)| {
        let wanted = Pose::new(exp_so3(&(Vector3::x() * turn)), origin.translation);
        origin.distance(&wanted).0 > TURNED_RAD
    };
    if nominal[1..].iter().zip(TURNS_RAD).any(differs) {
        return None;
    }
    let far = |s: f64| if s.abs() < NEAR_M { 0.0 } else { s };
    let to_first = far(meets_z(&second.inverse())?);
    let beside = far(to_first - third.translation.z);
    Some([far(meets_z(second)?), to_first, beside, far(meets_z(fifth)?), far(meets_z(sixth)?), 0.0])
}

/// Where on the axis z the axis z of another frame comes nearest.
fn meets_z(other: &Pose) -> Option<f64> {
    let (p, u) = (other.translation, other.rotation.column(2).into_owned());
    let square = 1.0 - u.z * u.z;
    (square > PARALLEL * PARALLEL).then(|| (p.z - u.z * u.dot(&p)) / square)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chained(origins: &[Pose], q: &[f64]) -> Vec<Pose> {
        let turned = |pose: &mut Pose, (origin, q): (&Pose, &f64)| {
            *pose = *pose * *origin * Pose::new(exp_so3(&(Vector3::z() * *q)), Vector3::zeros());
            Some(*pose)
        };
        origins.iter().zip(q).scan(Pose::identity(), turned).collect()
    }

    /// A UR10e in the frames of Denavit and Hartenberg, and in those of ur_description.
    #[test]
    fn frames_of_denavit_and_hartenberg_slide_to_those_of_ur_description() {
        let at = |x: f64, y: f64, z: f64, roll: f64| Pose::from_xyz_rpy([x, y, z], [roll, 0.0, 0.0]);
        let described = [
            at(0.0, 0.0, 0.1807, 0.0),
            at(0.0, 0.0, 0.0, FRAC_PI_2),
            at(-0.6127, 0.0, 0.0, 0.0),
            at(-0.57155, 0.0, 0.17415, 0.0),
            at(0.0, -0.11985, 0.0, FRAC_PI_2),
            at(0.0, 0.11655, 0.0, -FRAC_PI_2),
        ];
        let other = [
            at(0.0, 0.0, 0.0, 0.0),
            at(0.0, 0.0, 0.1807, FRAC_PI_2),
            at(-0.6127, 0.0, 0.0, 0.0),
            at(-0.57155, 0.0, 0.0, 0.0),
            at(0.0, 0.0, 0.17415, FRAC_PI_2),
            at(0.0, 0.0, 0.11985, -FRAC_PI_2) * along_z(0.11655),
        ];
        assert_eq!(slides(&described).unwrap(), [0.0; 6]);
        let slides = slides(&other).unwrap();
        let before = std::iter::once(0.0).chain(slides);
        let slid: Vec<Pose> =
            other.iter().zip(before).zip(slides).map(|((o, s), t)| along_z(-s) * *o * along_z(t)).collect();
        let q = [0.3, -1.2, 0.9, 2.0, -0.7, 1.4];
        for (one, link) in chained(&slid, &q).iter().zip(chained(&described, &q)) {
            assert!(one.distance(&link).0 < 1e-12 && one.distance(&link).1 < 1e-12, "{one:?} {link:?}");
        }
    }

    #[test]
    fn frames_that_are_turned_about_their_axes_are_others() {
        let mut turned = [Pose::identity(); 6];
        for (origin, turn) in turned[1..].iter_mut().zip(TURNS_RAD) {
            *origin = Pose::from_xyz_rpy([0.1, 0.0, 0.0], [turn, 0.0, 0.0]);
        }
        assert!(slides(&turned).is_some());
        turned[2] = turned[2] * Pose::from_xyz_rpy([0.0; 3], [0.0, 0.0, FRAC_PI_2]);
        assert!(slides(&turned).is_none());
    }
}
