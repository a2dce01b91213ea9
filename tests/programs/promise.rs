//! What a corrected program promises in the base frame, against what simulated robots do.

use crate::programs_support::identified::identified_kr6;
use crate::robots::kr6_to_link_6;
use rayon::prelude::*;
use robotcal::assess::sigma_in_base;
use robotcal::geom::Pose;
use robotcal::model::inverse::{reading_limits, solve_from};
use robotcal::model::robot::Robot;
use robotcal::simulate::RobotErrors;

/// Targets of every program.
const TARGETS: usize = 20;

/// The sum of squares of error and of stated error over the targets of a world, m^2, and the mean square of their ratios.
fn world(errors: RobotErrors, seed: u64) -> [f64; 3] {
    let (made, s) = identified_kr6(errors, TARGETS, seed);
    let found = s.exported_robot();
    let (nominal, truth) = (Robot::nominal(kr6_to_link_6()), made.truth.robot(&kr6_to_link_6()).unwrap());
    let limits = reading_limits(&nominal.chain);
    let mut sums = [0.0; 3];
    let mut count = 0.0;
    for programmed in made.truth.held_out.iter().map(|h| &h.readings) {
        let meant = nominal.base_from_tip(programmed);
        let Some(corrected) = solve_from(&found, &limits, &meant, programmed) else { continue };
        let error = (truth.base_from_tip(&corrected).translation - meant.translation).norm_squared();
        let stated =
            sigma_in_base(&found, &s.fit.problem.layout, &s.fit.covariance.reduced, &corrected, &Pose::identity());
        let squares = [error, stated * stated, error / (stated * stated)];
        sums.iter_mut().zip(squares).for_each(|(sum, square)| *sum += square);
        count += 1.0;
    }
    assert!(count >= 0.8 * TARGETS as f64, "seed {seed}: {count} targets corrected");
    sums.map(|sum| sum / count)
}

#[test]
#[ignore = "minutes; its figures stand in the guide, programs; WORLDS robots"]
fn study_of_the_expected_error_of_programs() {
    let worlds: u64 = std::env::var("WORLDS").map_or(40, |n| n.parse().unwrap());
    let smaller = RobotErrors::default();
    for (what, errors) in
        [("errors of the priors", RobotErrors::of_priors()), ("0.3 mm, 1 mrad, offsets 3 mrad", smaller)]
    {
        let all: Vec<[f64; 3]> = (1..=worlds).into_par_iter().map(|seed| world(errors, seed)).collect();
        let n = all.len() as f64;
        let mean = |k: usize| all.iter().map(|w| w[k]).sum::<f64>() / n;
        let spread = (all.iter().map(|w| (w[2] - mean(2)).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
        // The targets of a robot are off together: a robot is one observation.
        let half_width = 2.576 * spread / n.sqrt();
        println!(
            "{what}: {n} robots, off by {:.2} mm RMS, stated {:.2} mm; mean (error / stated)^2 {:.2} (+-{half_width:.2})",
            1e3 * mean(0).sqrt(),
            1e3 * mean(1).sqrt(),
            mean(2)
        );
        assert!(
            errors != RobotErrors::of_priors() || (mean(2) - 1.0).abs() <= half_width,
            "{} +-{half_width}",
            mean(2)
        );
    }
}
