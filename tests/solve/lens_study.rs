//! How often the evidence takes another lens than the one that made the images, and what that does to the flange.

use std::collections::BTreeMap;

use crate::robots::kr6_to_link_6;
use rayon::prelude::*;
use robotcal::identify::{Options, RobotModel, Solution, identify};
use robotcal::linalg::SymmetricFactor;
use robotcal::model::camera::Lens;
use robotcal::plan::plate_design::{PlateRequest, design};
use robotcal::problem::{LensChoice, MeasuredSeries};
use robotcal::simulate::{RobotErrors, SimulatedSeries, WorldRequest, lens_camera, series};
use robotcal::study::{flange_error, measured};

fn world(lens: Lens, images: usize, joint_noise_rad: f64, seed: u64) -> SimulatedSeries {
    let plate = design(&PlateRequest { markers: Some(60), ..PlateRequest::default() }).unwrap().plate;
    let field_deg: f64 = if lens == Lens::Fisheye { 100.0 } else { 60.0 };
    let request = WorldRequest {
        camera: lens_camera(lens, 1280, 1024, field_deg.to_radians()),
        images,
        errors: RobotErrors::of_priors(),
        joint_noise_rad,
        plate_modes: true,
        held_out: 1,
        seed,
        ..WorldRequest::typical(kr6_to_link_6(), plate)
    };
    series(&request).unwrap()
}

/// The lens taken of one that is open, and the normalised squared error of a flange pose with it and with `brown`, per degree of freedom.
fn taken(made: &SimulatedSeries) -> Option<(Lens, f64, f64)> {
    let seen = measured(made, &kr6_to_link_6());
    let options = Options { model: RobotModel::Full, ..Options::default() };
    let by = |lens_choice: LensChoice| {
        identify(kr6_to_link_6(), &[MeasuredSeries { lens: Lens::Brown, lens_choice, ..seen.clone() }], &options).ok()
    };
    let normalised = |s: &Solution| {
        let (error, covariance) = flange_error(s, made, &made.truth.robot(&kr6_to_link_6()).unwrap())?;
        let factor = SymmetricFactor::new(&covariance).ok()?;
        Some(error.dot(&factor.solve(&error)) / 6.0)
    };
    let open = by(LensChoice::All)?;
    let lens = open.fit.state.cameras[0].lens;
    let with_brown =
        if lens == Lens::Brown { normalised(&open)? } else { by(LensChoice::Settled).as_ref().and_then(normalised)? };
    Some((lens, normalised(&open)?, with_brown))
}

#[test]
#[ignore = "many minutes; its figures stand in the guide, formulation; WORLDS worlds a line, twice as many of the first"]
fn study_of_the_choice() {
    let worlds: u64 = std::env::var("WORLDS").map_or(4, |n| n.parse().unwrap());
    println!(
        "| lens | stops | joint noise mrad | worlds | taken | flange | with brown |\n|---|---|---|---|---|---|---|"
    );
    for (lens, images, noise) in [
        (Lens::Brown, 24, 0.02e-3),
        (Lens::ThinPrism, 24, 0.02e-3),
        (Lens::Parallax, 24, 0.02e-3),
        (Lens::Brown, 24, 0.1e-3),
        (Lens::Brown, 50, 0.02e-3),
    ] {
        let worlds = if (lens, images, noise) == (Lens::Brown, 24, 0.02e-3) { 2 * worlds } else { worlds };
        let all: Vec<_> =
            (1..=worlds).into_par_iter().filter_map(|seed| taken(&world(lens, images, noise, seed))).collect();
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        all.iter().for_each(|t| *counts.entry(t.0.name()).or_default() += 1);
        let mean = |of: fn(&(Lens, f64, f64)) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
        let half_width = 2.576 * (2.0 / (6.0 * all.len() as f64)).sqrt();
        println!(
            "| {} | {images} | {} | {} | {counts:?} | {:.2} (+-{half_width:.2}) | {:.2} |",
            lens.name(),
            1e3 * noise,
            all.len(),
            mean(|t| t.1),
            mean(|t| t.2)
        );
        let right = counts.get(lens.name()).copied().unwrap_or(0);
        assert!(right as f64 >= 0.9 * all.len() as f64 && all.len() as u64 == worlds, "{}: {counts:?}", lens.name());
    }
}
