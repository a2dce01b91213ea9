//! Precision of the image stage against the Cramer-Rao bound, and the honesty of its covariance.

use robotcal::simulate::image_study::{Precision, precision, precision_cells};

fn root_mean_square(all: &[Precision], of: fn(&Precision) -> f64) -> f64 {
    (all.iter().map(|p| of(p).powi(2)).sum::<f64>() / all.len() as f64).sqrt()
}

#[test]
fn centres_are_near_the_bound_and_the_covariance_is_honest() {
    let all: Vec<Precision> = precision_cells(&[5.0, 12.0], &[0.6, 1.0], &[40.0, 200.0], &[0.0, 45.0])
        .into_iter()
        .filter(|c| c.radius_px > 6.0 || c.ratio == 0.0)
        .map(|c| precision(c, 3, 7))
        .collect();
    for p in &all {
        println!("{p:?}");
        // 60 markers, two axes: the rms of a cell is uncertain by 6.5 %
        assert!(p.markers + 3 >= p.wanted && p.to_bound < 1.3 * 1.2, "{p:?}");
    }
    assert!(root_mean_square(&all, |p| p.to_bound) < 1.3);
    assert!((0.9..1.1).contains(&root_mean_square(&all, |p| p.normalised)));
}

#[test]
fn without_noise_strongly_curved_contours_have_no_bias() {
    for cell in precision_cells(&[6.0, 10.0], &[0.6, 1.0], &[f64::INFINITY], &[0.0]) {
        let p = precision(cell, 2, 3);
        if cell.ratio == 0.0 {
            assert!(p.markers == p.wanted && p.rms_px < 1e-3 && p.bias_px < 5e-4, "{p:?}");
        }
    }
}
