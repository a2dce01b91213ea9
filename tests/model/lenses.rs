//! Lenses: simulated ones are recovered, the evidence tells them apart, and what ROS cannot say is said with its loss.

use crate::robots::ur10e;
use robotcal::assess::Limits;
use robotcal::identify::{Options, RobotModel, Solution, choose_lens, depths_m, identify};
use robotcal::model::camera::{Camera, Lens, fit_lens};
use robotcal::plan::plate_design::{PlateRequest, design};
use robotcal::plan::viewpoint::ViewRange;
use robotcal::problem::{Adjustment, LensChoice};
use robotcal::simulate::{SimulatedSeries, WorldRequest, lens_camera, series};
use robotcal::study::measured;

fn world(lens: Lens, field_deg: f64) -> SimulatedSeries {
    seen_from(lens, field_deg, 10, ViewRange::default())
}

fn seen_from(lens: Lens, field_deg: f64, images: usize, views: ViewRange) -> SimulatedSeries {
    let plate = design(&PlateRequest { markers: Some(120), ..PlateRequest::default() }).unwrap().plate;
    let request = WorldRequest {
        camera: lens_camera(lens, 1280, 1024, field_deg.to_radians()),
        images,
        held_out: 2,
        views,
        seed: 7,
        ..WorldRequest::typical(ur10e(), plate)
    };
    series(&request).unwrap()
}

/// The lens that made the images is chosen, or one that predicts them as well.
#[test]
fn hold_out_tells_lenses_apart() {
    for (lens, field_deg, not) in [
        (Lens::Brown, 60.0, &[][..]),
        (Lens::Fisheye, 100.0, &[Lens::Brown, Lens::Parallax, Lens::ThinPrism][..]),
        (Lens::Rational, 100.0, &[Lens::Brown, Lens::Parallax, Lens::ThinPrism][..]),
        (Lens::ThinPrism, 60.0, &[Lens::Brown, Lens::Fisheye, Lens::Rational, Lens::Parallax][..]),
        (Lens::Parallax, 60.0, &[Lens::Brown, Lens::Fisheye, Lens::Rational, Lens::ThinPrism][..]),
    ] {
        let made = world(lens, field_deg);
        let mut seen = vec![measured(&made, &ur10e())];
        seen[0].lens = Lens::Brown;
        let notices = choose_lens(&ur10e(), &mut seen, &["camera".into()], &Limits::default()).unwrap();
        println!("{lens:?}: {}", notices[0]);
        let chosen = seen[0].lens;
        assert!(!not.contains(&chosen), "{lens:?} taken for {chosen:?}: {}", notices[0]);
        assert!(lens != Lens::Brown || chosen == Lens::Brown, "{}", notices[0]);
        assert_eq!(notices.len(), 1);
    }
}

#[test]
fn a_lens_is_expressed_by_another_with_its_loss() {
    let camera = lens_camera(Lens::ThinPrism, 1280, 1024, 1.0);
    let fit = fit_lens(&camera, Lens::Rational, &[0.4, 0.8]).unwrap();
    assert!(fit.worst_px >= fit.rms_px && fit.worst_px > 0.01, "a prism is no radial lens: {fit:?}");
    // The loss is what the two cameras differ by.
    let (mut worst, mut beyond) = (0.0f64, 0);
    for i in 0..50 {
        for k in 0..40 {
            let ray = camera.ray(&nalgebra::Vector2::new(26.1 * f64::from(i), 26.2 * f64::from(k))).unwrap();
            let off = (camera.project(&ray).unwrap() - fit.camera.project(&ray).unwrap()).norm();
            worst = worst.max(off);
            beyond += usize::from(off > fit.worst_px * 1.01);
        }
    }
    assert!(beyond == 0 && worst > 0.8 * fit.worst_px, "{worst} {fit:?}");
    // A lens that contains the other loses nothing.
    let brown = lens_camera(Lens::Brown, 1280, 1024, 1.0);
    for lens in [Lens::Rational, Lens::ThinPrism] {
        let fit = fit_lens(&brown, lens, &[0.4, 0.8]).unwrap();
        assert!(fit.worst_px < 1e-3, "{lens:?}: {}", fit.worst_px);
    }
}

#[test]
fn rays_and_projections_undo_each_other_through_every_lens() {
    for lens in Lens::ALL {
        let camera: Camera = lens_camera(lens, 1280, 1024, 80f64.to_radians());
        for (u, v) in [(0.0, 0.0), (640.0, 500.0), (1279.0, 12.5), (33.0, 1023.0)] {
            let uv = nalgebra::Vector2::new(u, v);
            // Far away, where a lens that sees the distance is as its ray says.
            let x = camera.ray(&uv).unwrap() * 1e9;
            assert!((camera.project(&x).unwrap() - uv).norm() < 1e-6, "{lens:?} at {u}, {v}");
        }
    }
}

/// The camera of a world as the joint fit finds it.
fn found(made: &SimulatedSeries, lens: Lens, choice: LensChoice) -> Solution {
    let mut seen = vec![measured(made, &ur10e())];
    seen[0].lens = lens;
    seen[0].lens_choice = choice;
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    identify(ur10e(), &seen, &options).unwrap()
}

#[test]
fn the_joint_fit_tells_lenses_apart_and_states_what_ros_cannot_express() {
    for (lens, field_deg) in [(Lens::Brown, 60.0), (Lens::Fisheye, 100.0), (Lens::Parallax, 60.0)] {
        let s = found(&world(lens, field_deg), Lens::Brown, LensChoice::All);
        let taken: Vec<Lens> = s.lenses.iter().filter(|l| l.taken).map(|l| l.lens).collect();
        println!("{lens:?}: {:?}", s.lenses);
        assert_eq!((taken, s.fit.state.cameras[0].lens), (vec![lens], lens));
        let loss = s.fit.state.cameras[0].in_ros(&depths_m(&s.fit.problem, &s.free_poses)[0]);
        assert_eq!(loss.is_some(), lens == Lens::Parallax);
        let said = s.findings.iter().filter(|f| f.code() == robotcal::Code::LensNotInRos).count();
        assert_eq!(said, usize::from(loss.is_some()));
    }
}

#[test]
fn other_lenses_are_asked_where_the_residuals_show_a_pattern() {
    let asked = |lens: Lens| found(&world(lens, 60.0), Lens::Brown, LensChoice::All).lenses.len();
    assert_eq!(asked(Lens::Brown), 1);
    assert!(asked(Lens::Parallax) > 4);
}

/// The simplest lens does not explain the images of a wide angle: the fit does not begin with it.
#[test]
fn a_wide_angle_begins_with_the_lens_that_explains_it() {
    // The plate fills the image.
    let near = ViewRange { near_m: 0.08, far_m: 0.15, aside_rad: 0.4, ..ViewRange::default() };
    let s = found(&seen_from(Lens::Fisheye, 150.0, 24, near), Lens::Brown, LensChoice::All);
    println!("{:?}", s.lenses);
    assert_eq!(s.fit.state.cameras[0].lens, Lens::Fisheye);
    assert!(s.lenses.iter().all(|l| l.lens.formula() == Lens::Fisheye), "no pattern asks for another");
    let first = found(&world(Lens::Rational, 75.0), Lens::Brown, LensChoice::All);
    assert!(first.lenses.iter().any(|l| l.lens == Lens::Brown));
}

#[test]
fn a_camera_without_a_field_has_no_family_of_one() {
    let s = found(&world(Lens::Brown, 60.0), Lens::BrownField, LensChoice::Settled);
    let fields = |a: &Adjustment| a.problem.families.iter().filter(|f| f.held.ncols() > 0).count();
    let camera = &s.fit.state.cameras[0];
    let formula =
        Camera { lens: Lens::Brown, parameters: camera.parameters[..camera.parametric()].to_vec(), ..*camera };
    let other = s.fit.adjustment.with_camera(0, formula);
    assert_eq!((fields(&s.fit.adjustment), fields(&other)), (1, 0));
    assert!(other.linearise().is_some());
}

#[test]
fn the_lenses_that_ros_can_express_are_a_choice_of_their_own() {
    for (lens, field_deg) in [(Lens::Brown, 60.0), (Lens::Fisheye, 100.0), (Lens::Parallax, 60.0)] {
        let s = found(&world(lens, field_deg), Lens::Brown, LensChoice::Exported);
        println!("{lens:?}: {:?}", s.lenses);
        let taken = s.fit.state.cameras[0].lens;
        assert!(s.lenses.iter().all(|l| l.lens.is_in_ros()) && taken.is_in_ros(), "{taken:?}");
        assert!(taken == lens || lens == Lens::Parallax, "{lens:?} taken for {taken:?}");
    }
}

/// A prism says nearly what a shift of the principal point with a turn does; it must not take the principal point along.
#[test]
fn prism_and_principal_point_are_kept_apart() {
    let made = world(Lens::Brown, 60.0);
    let sigma = |lens: Lens| {
        let s = found(&made, lens, LensChoice::Settled);
        let first = s.fit.problem.layout.cameras[0].start;
        [2, 3].map(|k| s.fit.covariance.sigma(first + k))
    };
    let (brown, prism) = (sigma(Lens::Brown), sigma(Lens::ThinPrism));
    println!("principal point known to {brown:?} px, with a prism to {prism:?} px");
    assert!(prism.iter().zip(&brown).all(|(p, b)| *p < 5.0 * b + 0.5), "{prism:?} {brown:?}");
}

/// A wide lens with a prism, for which numerator and denominator nearly say the same: the fit stays in the image, and comes as near as one
/// without denominator.
#[test]
fn the_nearest_lens_of_a_wide_prism_is_found() {
    for parameters in [
        [834.06, 834.4, 647.18, 507.404, -0.11, 0.09, 4e-4, -3e-4, -0.02, 3e-3, -2e-3, -2.5e-3, 1.5e-3],
        [833.9, 834.2, 640.3, 513.8, -0.1102, 0.0911, 1.5e-3, -1.1e-3, -0.0207, 5e-4, 1.2e-3, -4e-4, -9e-4],
        [480.0, 480.0, 639.5, 511.5, -0.2, 0.06, 4e-4, -3e-4, -0.006, 3e-3, -2e-3, -2.5e-3, 1.5e-3],
    ] {
        let camera = Camera { lens: Lens::ThinPrism, width_px: 1280, height_px: 1024, parameters: parameters.to_vec() };
        let depths = [0.3, 0.6];
        let found = camera.in_ros(&depths).unwrap();
        let brown = fit_lens(&camera, Lens::Brown, &depths).unwrap();
        assert!(found.rms_px <= 1.01 * brown.rms_px, "{} against {}", found.rms_px, brown.rms_px);
    }
}
