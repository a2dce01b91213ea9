//! The mirror image of an arm.

use nalgebra::Vector3;
use robotcal::model::mirror::mirror_images;
use robotcal::model::robot::Robot;

use crate::robots::{kr6, ur10e};

/// A millimetre and a milliradian.
const TOLERANCE: f64 = 1e-3;

#[test]
fn an_arm_in_a_plane_is_its_own_mirror_image_with_signs_changed() {
    let chain = kr6();
    let mirrored = mirror_images(&chain, TOLERANCE);
    assert_eq!(mirrored, [[0, 3, 5]]);
    let robot = Robot::nominal(chain);
    let mirror = |p: Vector3<f64>| Vector3::new(p.x, -p.y, p.z);
    let body = Vector3::new(0.05, -0.03, 0.12);
    let at_zero = robot.base_from_tip(&[0.0; 6]);
    let mirrored_body = at_zero.inverse().transform(&mirror(at_zero.transform(&body)));
    for k in 0..20 {
        let q: Vec<f64> = (0..6).map(|r| (1.7 * f64::from(k) + 0.9 * f64::from(r)).sin()).collect();
        let negated: Vec<f64> =
            q.iter().enumerate().map(|(r, q)| if mirrored[0].contains(&r) { -q } else { *q }).collect();
        let seen = mirror(robot.base_from_tip(&q).transform(&body));
        let miss = (robot.base_from_tip(&negated).transform(&mirrored_body) - seen).norm();
        assert!(miss < 1e-9, "{miss}");
    }
}

#[test]
fn an_arm_with_axes_beside_its_plane_has_no_mirror_image() {
    assert_eq!(mirror_images(&ur10e(), TOLERANCE), Vec::<Vec<usize>>::new());
}
