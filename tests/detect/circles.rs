//! The circle detector on rendered pictures with known truth.

use crate::circles_support::{Errors, View, behind_mosaic, errors, report, scene, standard_plate};
use crate::grids::{blurred, jpeg, sharpen};
use robotcal::Code;
use robotcal::detect::circles::{CircleDetection, DroppedCandidate, Found, Options, Outcome, Reason, detect};
use robotcal::detect::{Detection, Picture};
use robotcal::series::Edge;
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

fn tilted() -> View {
    View { distance_m: 0.55, tilt_deg: 25.0, azimuth_deg: 30.0, roll_deg: 20.0, ..View::default() }
}

/// Paper at and above full scale, up to nearly half as much again: the edges of the markers are clipped on their light side.
#[test]
fn overexposed_paper_costs_no_marker() {
    for times in [1.0, 1.05, 1.2, 1.45] {
        let mut view = tilted();
        view.conditions.exposure = times / view.conditions.light_reflectance;
        let scene = scene(&view);
        let found = detect(&scene.render(3), &scene.plate, &Options::default()).unwrap();
        let e = errors(&scene, &found);
        report(&scene, &found, &e);
        assert_eq!(e.wrong, 0, "{times}");
        assert!(e.found as f64 >= 0.95 * e.visible as f64, "{times}: {} of {}", e.found, e.visible);
        assert!(e.nees() < 1.5 && e.rms() < 0.03, "{times}: nees {}, rms {} px", e.nees(), e.rms());
    }
}

/// More than a tenth of the markers are clipped, and one is covered at its edge: the clipped ones come back, and what covers one is no
/// clipping, so that none comes back off its place.
#[test]
fn clipped_markers_come_back_and_a_covered_one_does_not() {
    let scene = scene(&tilted());
    let mut picture = scene.render(6);
    let mut centres: Vec<_> = (0..scene.plate.markers.len())
        .filter(|m| scene.visible(*m, 3.0))
        .map(|m| scene.centroid(m, Edge::Outer).unwrap())
        .collect();
    centres.sort_by(|a, b| a.x.total_cmp(&b.x));
    let begin = centres[centres.len() * 17 / 20].x;
    let covered = centres[centres.len() / 3];
    let size = centres.len();
    for (k, v) in picture.pixels.iter_mut().enumerate() {
        let (x, y) = ((k % picture.width) as f64, (k / picture.width) as f64);
        let light = 1.0 + ((x - begin) / 40.0).clamp(0.0, 1.0);
        // Something dark with a soft edge hangs over a side of the marker.
        let cover = ((y - covered.y - 3.0) / 4.0).clamp(0.0, 1.0);
        let is_beside = (x - covered.x).abs() < 9.0 && y - covered.y < 16.0;
        let cover = if is_beside { 1.0 - 0.8 * cover } else { 1.0 };
        *v = (f64::from(*v) * light * cover).round().min(255.0) as f32;
    }
    let found = detect(&picture, &scene.plate, &Options::default()).unwrap();
    let e = errors(&scene, &found);
    report(&scene, &found, &e);
    let told = Detection::from(found.clone()).notices.iter().any(|n| n.code == Code::MarkersSmoothed);
    assert_eq!((e.wrong, told), (0, found.smoothed > 0));
    assert!(found.smoothed > size / 20 && e.found as f64 >= 0.9 * size as f64, "{} of {}", e.found, size);
    let farthest = e.residuals.iter().map(|(off, ..)| off[0].hypot(off[1])).fold(0.0, f64::max);
    assert!(farthest < 0.3, "{farthest} px");
}

/// Strong compression rings beside every edge and flattens the paper: the markers are found, within 0.05 px.
#[test]
fn strong_compression_costs_no_marker() {
    for quality in [35, 30] {
        let scene = scene(&tilted());
        let picture = jpeg(&scene.render(4), quality);
        let found = detect(&picture, &scene.plate, &Options::default()).unwrap();
        let e = errors(&scene, &found);
        report(&scene, &found, &e);
        assert_eq!(e.wrong, 0, "{quality}");
        assert!(e.found as f64 >= 0.9 * e.visible as f64, "{quality}: {} of {}", e.found, e.visible);
        assert!(e.rms() < 0.05, "{quality}: rms {} px", e.rms());
    }
}

/// An image of which every marker was identified and none measured is no image that can be used.
#[test]
fn markers_that_are_all_saturated_are_a_failure() {
    let scene = scene(&tilted());
    let mut seen = detect(&scene.render(5), &scene.plate, &Options::default()).unwrap();
    let usable = Detection::from(seen.clone());
    let is_told = |of: &Detection| of.notices.iter().any(|n| n.code == Code::MarkersUnmeasured);
    assert!(usable.failure.is_none() && !is_told(&usable), "{:?}", usable.notices);
    let lost = |reason| {
        move |f: &Found| {
            let ellipse = Some(f.measured.outer.ellipse);
            DroppedCandidate { uv: f.measured.outer.ellipse.centre, reason, ellipse, marker: Some(f.marker) }
        }
    };
    let all = std::mem::take(&mut seen.found);
    seen.observations.clear();
    for reason in [Reason::Saturated, Reason::EdgeModel, Reason::CutByBorder] {
        let dropped = all.iter().map(lost(reason)).collect();
        let detection = Detection::from(CircleDetection { dropped, ..seen.clone() });
        assert_eq!(detection.failure.map(|f| f.code), Some(Code::MarkersUnmeasured), "{reason}");
    }
    // A third of them are left.
    let third = all.len() / 3;
    let dropped = all[third..].iter().map(lost(Reason::Saturated)).collect();
    let part = Detection::from(CircleDetection { dropped, found: all[..third].to_vec(), ..seen.clone() });
    assert!(part.failure.is_none() && is_told(&part), "{:?}", part.notices);
}

/// Raw values of a colour sensor taken for grey.
#[test]
fn markers_behind_a_mosaic_of_colours_are_found_in_a_smoothed_copy() {
    let scene = scene(&tilted());
    let picture = behind_mosaic(scene.render(6));
    let found = detect(&picture, &scene.plate, &Options::default()).unwrap();
    let e = errors(&scene, &found);
    report(&scene, &found, &e);
    assert_eq!((e.wrong, found.smoothed), (0, found.found.len()));
    assert!(e.found as f64 >= 0.9 * e.visible as f64 && e.rms() < 0.05, "{} of {}: {}", e.found, e.visible, e.rms());
}

/// A camera that stores the root of the light (gamma 2.2) moves the edges of small blurred rings towards each other by a third of their width:
/// whole steps from the printed ratio of their radii overshoot. By whole steps alone none of the 118 small rings of these pictures converges, and from a
/// blur of 1.2 px on most still do not.
#[test]
fn small_rings_in_a_blurred_picture_with_gamma_are_measured() {
    for (psf_sigma_px, full_well_e) in [(1.0, f64::INFINITY), (1.0, 20_000.0)] {
        let mut view = View::default();
        let smallest = standard_plate().markers.iter().map(|m| m.outer_radius_m).fold(f64::MAX, f64::min);
        view.distance_m = view.focal_px * smallest / 8.0;
        (view.conditions.psf_sigma_px, view.conditions.full_well_e, view.conditions.bits) =
            (psf_sigma_px, full_well_e, 8);
        let scene = scene(&view);
        let mut picture = scene.render(7);
        let full_scale = picture.full_scale;
        picture.pixels.iter_mut().for_each(|v| *v = (full_scale * (*v / full_scale).powf(1.0 / 2.2)).round());
        let found = detect(&picture, &scene.plate, &Options::default()).unwrap();
        let e = errors(&scene, &found);
        report(&scene, &found, &e);
        assert_eq!(e.wrong, 0, "{psf_sigma_px}");
        assert!(e.found as f64 >= 0.98 * e.visible as f64, "{psf_sigma_px}: {} of {}", e.found, e.visible);
        assert!(e.rms() < 0.03, "{psf_sigma_px}: rms {} px", e.rms());
    }
}

fn in_counts(mut picture: Picture) -> Picture {
    picture.pixels.iter_mut().for_each(|v| *v = v.round().clamp(0.0, picture.full_scale));
    picture
}

/// Sharpening, smoothing and compression give neighbouring pixels noise in common: stated covariances know of it. 1200 to 1500 centres a kind, of
/// 1007 markers whose two centres have much of their noise in common: the mean of the squares is uncertain by 3 %.
#[test]
fn covariances_are_honest_where_neighbouring_pixels_have_noise_in_common() {
    type Kind = (&'static str, fn(Picture) -> Picture);
    let kinds: [Kind; 4] = [
        ("white", |picture| picture),
        ("sharpened", |picture| sharpen(picture, 1.0, 1.0)),
        ("blurred", |picture| in_counts(blurred(&picture, 0.7))),
        ("JPEG", |picture| jpeg(&picture, 70)),
    ];
    for (kind, spoil) in kinds {
        let mut all = Errors::default();
        for seed in 1..3 {
            let scene = scene(&View { azimuth_deg: 30.0 + 70.0 * seed as f64, ..noisy() });
            let found = detect(&spoil(scene.render(seed)), &scene.plate, &Options::default()).unwrap();
            let e = errors(&scene, &found);
            report(&scene, &found, &e);
            assert_eq!((e.wrong, found.smoothed), (0, 0), "{kind}");
            all.residuals.extend(e.residuals);
        }
        println!("{kind}: {} centres, normalised error {:.3}", all.residuals.len(), all.nees());
        assert!(all.residuals.len() > 1000, "{kind}: {}", all.residuals.len());
        assert!((0.8..1.25).contains(&all.nees()), "{kind}: {}", all.nees());
    }
}

/// Noise of some 2 % of the contrast, well above the rounding to counts.
fn noisy() -> View {
    let mut view = tilted();
    (view.conditions.full_well_e, view.conditions.bits) = (3000.0, 8);
    view
}
