//! The image stage on rendered pictures of the standard plate: bias, the bound of Cramer and Rao, and the stated covariance.

use robotcal::detect::circles::LOPSIDED_PX;
use robotcal::plan::plate_design::{PlateRequest, design};
use robotcal::study::image_stage::{BiasCause, Precision, bias, bias_cases, precision, precision_cells};

/// DESIGN: at most 0.003 px to the true centroid; coma that displaces by more is told, and nothing else is taken for it.
#[test]
fn gradient_distortion_and_perspective_leave_no_bias_and_coma_is_told() {
    let plate = design(&PlateRequest::default()).unwrap().plate;
    for case in &bias_cases(&[0.8, 1.5]) {
        let b = bias(case, &plate).unwrap();
        println!("{b:?}");
        let told = b.lopsided.unwrap().exceeds(LOPSIDED_PX);
        if matches!(case.cause, BiasCause::Coma { .. }) {
            assert!(told || b.largest_px < 0.003, "{b:?}");
        } else {
            assert!(b.largest_px < 0.003 && b.markers > 0 && 100 * b.markers >= 95 * b.wanted, "{b:?}");
            assert!(!told, "{b:?}");
        }
    }
}

fn root_mean_square(all: &[Precision], of: fn(&Precision) -> f64) -> f64 {
    (all.iter().map(|p| of(p).powi(2)).sum::<f64>() / all.len() as f64).sqrt()
}

#[test]
fn centres_are_near_the_bound_and_the_covariance_is_honest() {
    let all: Vec<Precision> = precision_cells(&[5.0, 12.0], &[0.6, 1.0], &[40.0, 200.0], &[0.0, 45.0])
        .into_iter()
        .flat_map(|c| precision(c, 2, 7))
        .collect();
    for p in &all {
        println!("{p:?}");
        // some 40 markers, two axes: the rms of a cell is uncertain by 8 %
        assert!(p.markers + 3 >= p.wanted && p.to_bound < 1.3 * 1.24, "{p:?}");
    }
    assert!(root_mean_square(&all, |p| p.to_bound) < 1.3);
    assert!((0.9..1.1).contains(&root_mean_square(&all, |p| p.normalised)));
}

/// Where the blur is as large as the markers nobody can read their code: a map tells where they are.
#[test]
fn unreadable_markers_are_measured_where_a_map_puts_them() {
    for cell in precision_cells(&[4.0], &[1.5], &[60.0], &[0.0, 60.0]) {
        assert_eq!(cell.is_designed_for(), cell.tilt_deg == 0.0);
        for p in precision(cell, 2, 7) {
            println!("{p:?}");
            assert!(p.second_pass == p.markers && p.markers == p.wanted, "{p:?}");
            assert!(p.to_bound < 1.3 * 1.24 && (0.7..1.3).contains(&p.normalised), "{p:?}");
        }
    }
}

#[test]
fn without_noise_strongly_curved_contours_have_no_bias() {
    for cell in precision_cells(&[6.0, 10.0], &[0.6, 1.0], &[f64::INFINITY], &[0.0]) {
        let [discs, _] = precision(cell, 2, 3);
        assert!(discs.markers == discs.wanted && discs.rms_px < 1e-3 && discs.bias_px < 5e-4, "{discs:?}");
    }
}
