//! The circle detector on rendered pictures with known truth.

use crate::circles_support::{View, errors, report, scene};
use robotcal::detect::circles::{Options, Outcome, detect};
use robotcal::study::image_stage::{MirrorAnswer, Plates, identity_view};

#[test]
fn a_whole_plate_is_found_and_measured() {
    let view = View { distance_m: 0.55, tilt_deg: 25.0, azimuth_deg: 30.0, roll_deg: 20.0, ..View::default() };
    let scene = scene(&view);
    let picture = scene.render(1);
    let start = std::time::Instant::now();
    let found = detect(&picture, &scene.plate, &Options::default()).unwrap();
    println!("{:?} in {:?}", found.outcome, start.elapsed());
    assert!(matches!(found.outcome, Outcome::Identified { .. }));
    let e = errors(&scene, &found);
    report(&scene, &found, &e);
    assert_eq!(e.wrong, 0);
    assert!(e.found as f64 >= 0.99 * e.visible as f64);
}

/// View 14330 shows 25 markers from 6 to 80 px, steeply: the lattice of its mirror image grows in another order, and slips.
#[test]
fn a_mirror_image_is_named_where_its_lattice_slips() {
    let (view, ..) = identity_view(&Plates::standard().unwrap(), 14330);
    assert!(view.identified && view.wrong == 0);
    assert_eq!(view.mirror, Some(MirrorAnswer::Named));
}
