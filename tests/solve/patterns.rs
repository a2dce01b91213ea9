//! Patterns in the residuals: named where they are, not where they are not, and by what removes them.

use std::collections::BTreeMap;

use nalgebra::{DVector, Vector3};
use rayon::prelude::*;
use robotcal::assess::{FlangeModel, Limits, Pattern, cause, patterns};
use robotcal::diagnose::{Finding, GivenCamera, ResidualPattern, residual_pattern};
use robotcal::fit::Fit;
use robotcal::identify::{Options, RobotModel, Solution, identify, stand_alone};
use robotcal::model::camera::{Camera, Lens};
use robotcal::plan::plate_design::{PlateRequest, design};
use robotcal::problem::{LensChoice, MeasuredSeries};
use robotcal::simulate::{SimulatedSeries, WorldRequest, lens_camera, series};
use robotcal::study::measured;

use crate::robots::kr6_to_link_6;
use crate::support::flange::{flange_of, true_from_fitted};
use crate::support::small::Dice;

/// What is put in, and how much of it.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    Clean,
    /// k1z, m.
    Parallax(f64),
    /// s1 and s3.
    ThinPrism(f64),
    /// Amplitude of waves, px.
    Field(f64),
    /// Height of a bent plate at its corners, m: third and fourth powers, which no mode has.
    Bow(f64),
}

impl Fault {
    fn pattern(self) -> Option<Pattern> {
        match self {
            Self::Clean => None,
            Self::Parallax(_) => Some(Pattern::Parallax),
            Self::ThinPrism(_) => Some(Pattern::ThinPrism),
            Self::Field(_) => Some(Pattern::Field),
            Self::Bow(_) => Some(Pattern::PlateBow),
        }
    }

    fn lens(self) -> Lens {
        match self {
            Self::Parallax(_) => Lens::Parallax,
            Self::ThinPrism(_) => Lens::ThinPrism,
            Self::Field(_) => Lens::BrownField,
            Self::Clean | Self::Bow(_) => Lens::Brown,
        }
    }

    fn camera(self) -> Camera {
        let brown = lens_camera(Lens::Brown, 1280, 1024, 60_f64.to_radians());
        let mut camera = lens_camera(self.lens(), 1280, 1024, 60_f64.to_radians());
        camera.parameters[..9].copy_from_slice(&brown.parameters);
        match self {
            Self::Parallax(k) => camera.parameters[9..].copy_from_slice(&[k, 0.0]),
            Self::ThinPrism(s) => camera.parameters[9..].copy_from_slice(&[s, 0.0, -s, 0.0]),
            Self::Field(px) => camera.parameters[9..].iter_mut().for_each(|c| *c *= px / 0.5),
            Self::Clean | Self::Bow(_) => {}
        }
        camera
    }
}

/// A world whose fault the fit does not know of: 30 stops, 60 markers stated to 0.03 mm.
fn world(fault: Fault, seed: u64) -> SimulatedSeries {
    let mut plate = design(&PlateRequest { markers: Some(60), ..PlateRequest::default() }).unwrap().plate;
    plate.markers.iter_mut().for_each(|m| m.sigma_m = 0.03e-3);
    plate.tolerance_m = 0.03e-3;
    let stated = plate.clone();
    if let Fault::Bow(height) = fault {
        let size = plate.markers.iter().map(|m| m.position_m.norm()).fold(0.0, f64::max);
        for marker in &mut plate.markers {
            let at: Vector3<f64> = marker.position_m / size;
            marker.position_m.z += height * (2.0 * at.x.powi(3) + at.y.powi(3) - at.x.powi(4));
        }
    }
    let request = WorldRequest {
        camera: fault.camera(),
        images: 30,
        pixel_sigma_px: 0.02,
        held_out: 1,
        seed,
        ..WorldRequest::typical(kr6_to_link_6(), plate)
    };
    SimulatedSeries { plate: stated, ..series(&request).unwrap() }
}

fn seen(made: &SimulatedSeries) -> MeasuredSeries {
    MeasuredSeries { lens: Lens::Brown, lens_choice: LensChoice::Settled, ..measured(made, &kr6_to_link_6()) }
}

#[test]
fn a_pattern_is_named_by_its_cause_and_none_where_there_is_none() {
    let limits = Limits::default();
    for (fault, seed) in [
        (Fault::Clean, 1),
        (Fault::Clean, 2),
        (Fault::Parallax(2e-3), 3),
        (Fault::ThinPrism(8e-3), 4),
        (Fault::Field(0.2), 5),
        (Fault::Bow(0.3e-3), 6),
        (Fault::ThinPrism(2e-2), 7),
        (Fault::Field(0.5), 8),
        (Fault::Parallax(5e-3), 9),
    ] {
        let found = stand_alone(&[seen(&world(fault, seed))], &limits).unwrap();
        let tests = patterns(&found.fit, &limits).unwrap();
        println!("seed {seed} {fault:?}");
        for t in &tests {
            println!(
                "    {:?} {:.1} of {} deviate {:.2} gain {:.1} rms {:.4} least {:.4} {:?}",
                t.pattern, t.statistic, t.degrees, t.deviate, t.gain, t.rms_px, t.least_px, t.moved
            );
        }
        assert_eq!(cause(&tests, &limits).map(|t| t.pattern), fault.pattern(), "seed {seed} {fault:?}");
    }
}

/// The same with noise that is 3.5 times larger in the corners of the image, and stated as the same everywhere.
fn noisier_at_the_border(made: &SimulatedSeries, seed: u64) -> MeasuredSeries {
    let (mut series, mut dice) = (seen(made), Dice::new(seed));
    let half = [f64::from(series.width_px), f64::from(series.height_px)].map(|px| 0.5 * px);
    for stop in &mut series.stops {
        let mut own = stop.observations.to_vec();
        for seen in &mut own {
            let squares: f64 = (0..2).map(|k| (seen.uv[k] / half[k] - 1.0).powi(2)).sum();
            let times = 1.0 + 2.5 * (0.5 * squares).powi(2);
            let beside = 0.02 * (times * times - 1.0).sqrt();
            seen.uv = seen.uv.map(|uv| uv + dice.normal(beside));
        }
        stop.observations = own.into();
    }
    series
}

/// Noise that grows towards the border is no pattern: the statistics of the columns that are largest there stay chi-squared. A pattern is found in it.
#[test]
fn noise_that_is_larger_at_the_border_is_no_pattern() {
    let limits = Limits::default();
    let tests = |fault: Fault, seed: u64| {
        let found = stand_alone(&[noisier_at_the_border(&world(fault, seed), seed)], &limits).unwrap();
        patterns(&found.fit, &limits).unwrap()
    };
    let clean: Vec<Vec<_>> = (31..41).into_par_iter().map(|seed| tests(Fault::Clean, seed)).collect();
    let of = |pattern: Pattern| clean.iter().flatten().filter(move |t| t.pattern == pattern);
    for pattern in [Pattern::Radial, Pattern::ThinPrism, Pattern::Field] {
        let [sum, degrees] = of(pattern).fold([0.0; 2], |[s, d], t| [s + t.statistic, d + t.degrees as f64]);
        println!("{pattern:?}: {:.2} a degree of {degrees}", sum / degrees);
        // Four standard deviations of chi-squared.
        assert!(sum < degrees + 4.0 * (2.0 * degrees).sqrt(), "{pattern:?} {sum} of {degrees}");
    }
    assert!(clean.iter().all(|tests| cause(tests, &limits).is_none()));
    for (fault, seed) in [(Fault::ThinPrism(2e-2), 7), (Fault::Field(0.5), 8), (Fault::Parallax(5e-3), 9)] {
        let tests = tests(fault, seed);
        assert_eq!(cause(&tests, &limits).map(|t| t.pattern), fault.pattern(), "seed {seed} {fault:?}");
    }
}

#[test]
fn of_steps_that_take_more_than_there_is_the_simplest_names_the_cause() {
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    for seed in [2, 13] {
        let solution = identify(kr6_to_link_6(), &[seen(&world(Fault::ThinPrism(2e-2), seed))], &options).unwrap();
        let found = residual_pattern(&solution.fit, &Limits::default()).unwrap().found;
        assert!(found.statistic.is_finite() && found.rms_px.is_finite() && found.share > 0.9, "seed {seed}: {found:?}");
        assert_eq!(found.pattern, Pattern::ThinPrism, "seed {seed}");
    }
}

/// Markers as good as 0.03 mm that are said to be as good as 0.03 and 0.3 mm: what is stated of the poses is in the frame of their nominal
/// places, and hardly depends on it; of the flange it is what the files say.
#[test]
fn a_pattern_is_judged_by_what_is_stated_in_the_frame_of_the_plate() {
    let made = world(Fault::Field(0.2), 5);
    let limits = Limits::default();
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    let stated = |tolerance_m: f64| {
        let mut plate = made.plate.clone();
        plate.tolerance_m = tolerance_m;
        plate.markers.iter_mut().for_each(|m| m.sigma_m = tolerance_m);
        let seen = seen(&SimulatedSeries { plate, ..made.clone() });
        let alone = stand_alone(std::slice::from_ref(&seen), &limits).unwrap();
        let solution = identify(kr6_to_link_6(), &[seen], &options).unwrap();
        let moved = |fit: &Fit| residual_pattern(fit, &limits).unwrap().found.moved.unwrap();
        let Solution { fit, uncertainty, .. } = &solution;
        let model = FlangeModel::of(fit, &uncertainty.covariance, &limits).unwrap();
        let by_file = model.moved_m(&DVector::zeros(fit.problem.layout.theta_len()))[1];
        let by_pattern = moved(fit).flange_m.unwrap()[1];
        println!("{tolerance_m} m: {by_pattern} m, {by_file} m in the file");
        assert!((by_pattern / by_file - 1.0).abs() < 1e-6, "{by_pattern} m, {by_file} m in the file");
        moved(&alone.fit).pose_m[1]
    };
    let [good, loose] = [0.03e-3, 0.3e-3].map(stated);
    assert!((0.8..1.3).contains(&(loose / good)), "{good} m, {loose} m");
}

/// The coefficients of a thin prism have priors, which this lens is far beyond: a part of its pattern is left.
#[test]
fn a_lens_with_terms_of_the_fault_is_fitted() {
    let limits = Limits::default();
    for (fault, is_fitted) in [(Fault::ThinPrism(8e-3), Some(true)), (Fault::Parallax(2e-3), None)] {
        let seen = MeasuredSeries { lens: fault.lens(), ..seen(&world(fault, 4)) };
        let found = residual_pattern(&stand_alone(&[seen], &limits).unwrap().fit, &limits);
        println!("seed 4 {fault:?}: {found:?}");
        assert_eq!(found.map(|f| f.is_fitted), is_fitted, "{fault:?}");
    }
}

/// A remedy names no lens that is there, nor one that was tried and has less evidence, nor any beside the file of a camera.
#[test]
fn a_lens_that_was_taken_or_tried_is_not_the_remedy() {
    let limits = Limits::default();
    let found =
        residual_pattern(&stand_alone(&[seen(&world(Fault::ThinPrism(8e-3), 4))], &limits).unwrap().fit, &limits);
    let found = found.unwrap();
    let [name, field] = ["thin_prism", "brown+field"];
    let not = GivenCamera::Not;
    for (is_fitted, tried, given, named) in [
        (false, vec![], not, Some(name)),
        (true, vec![], not, Some(field)),
        (false, vec![Lens::ThinPrism], not, None),
        (true, vec![Lens::BrownField], not, None),
        (false, vec![], GivenCamera::Start, None),
        (true, vec![], GivenCamera::Held, None),
    ] {
        let remedy = Finding::from(ResidualPattern { is_fitted, tried, given, ..found.clone() }).remedy();
        for lens in [name, field] {
            // words: the remedy is what the user follows, and names lenses
            assert_eq!(remedy.contains(lens), named == Some(lens), "{remedy}");
        }
    }
}

/// Flange of two solutions, each in the frame of its true markers, RMS difference over what the tool does not take up, and the stated sigma of the
/// first, m.
fn apart((faulty, bent): (&Solution, &SimulatedSeries), (clean, flat): (&Solution, &SimulatedSeries)) -> [f64; 2] {
    let (fit, layout) = (&faulty.fit, &faulty.fit.problem.layout);
    let values = fit.state.values(layout) - clean.fit.state.values(layout);
    let mut step = values.rows(0, layout.theta_len()).into_owned();
    let placed = |fit: &Fit, made: &SimulatedSeries| fit.state.placements[0] * true_from_fitted(fit, made).inverse();
    let placement = (placed(&clean.fit, flat).inverse() * placed(fit, bent)).log();
    step.rows_mut(layout.placements[0].start, 6).copy_from(&placement);
    flange_of(fit).moved_m(&step)
}

struct Outcome {
    /// Displacement of the flange by the fault, in stated sigmas.
    sigmas: f64,
    found: Option<ResidualPattern>,
}

fn outcome(fault: Fault, seed: u64) -> Option<Outcome> {
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    let solved = |fault: Fault| {
        let made = world(fault, seed);
        Some((identify(kr6_to_link_6(), &[seen(&made)], &options).ok()?, made))
    };
    let (faulty, bent) = solved(fault)?;
    let found = residual_pattern(&faulty.fit, &Limits::default());
    let sigmas = if fault == Fault::Clean {
        0.0
    } else {
        let (clean, flat) = solved(Fault::Clean)?;
        let [moved, sigma] = apart((&faulty, &bent), (&clean, &flat));
        if let Some(f) = &found {
            println!(
                "seed {seed} {fault:?}: moved {:.4} of {:.4} mm; step {:?} of {:?}",
                1e3 * moved,
                1e3 * sigma,
                f.found.moved.and_then(|m| m.flange_m),
                f.found.pattern
            );
        }
        moved / sigma
    };
    Some(Outcome { sigmas, found })
}

#[test]
#[ignore = "an hour; its figures stand in the guide, camera_misfit; WORLDS worlds a line, four times as many clean ones; FROM: lines left out"]
fn study_of_patterns() {
    let worlds: u64 = std::env::var("WORLDS").map_or(20, |n| n.parse().unwrap());
    println!(
        "| fault | worlds | flange, stated sigmas | above one | named there | right | gate | named as |\n|---|---|---|---|---|---|---|---|"
    );
    let lines = [
        Fault::Clean,
        Fault::Parallax(2e-4),
        Fault::Parallax(1e-3),
        Fault::Parallax(5e-3),
        Fault::ThinPrism(1e-3),
        Fault::ThinPrism(5e-3),
        Fault::ThinPrism(2e-2),
        Fault::Field(0.02),
        Fault::Field(0.1),
        Fault::Field(0.5),
        Fault::Bow(0.03e-3),
        Fault::Bow(0.15e-3),
        Fault::Bow(0.75e-3),
    ];
    let first = std::env::var("FROM").map_or(0, |n| n.parse().unwrap());
    for fault in lines.into_iter().skip(first) {
        let count = if fault == Fault::Clean { 4 * worlds } else { worlds };
        let all: Vec<Outcome> = (1..=count).into_par_iter().filter_map(|seed| outcome(fault, seed)).collect();
        let mut names: BTreeMap<String, usize> = BTreeMap::new();
        all.iter().for_each(|o| {
            let name = o.found.as_ref().map_or("none".to_owned(), |f| format!("{:?}", f.found.pattern));
            *names.entry(name).or_default() += 1;
        });
        let above = || all.iter().filter(|o| o.sigmas > 1.0);
        let is_right = |o: &&Outcome| o.found.as_ref().map(|f| f.found.pattern) == fault.pattern();
        println!(
            "| {fault:?} | {} | {:.2} | {} | {} | {} | {} | {names:?} |",
            all.len(),
            all.iter().map(|o| o.sigmas).sum::<f64>() / all.len().max(1) as f64,
            above().count(),
            above().filter(|o| o.found.is_some()).count(),
            above().filter(is_right).count(),
            all.iter().filter(|o| o.found.as_ref().is_some_and(|f| f.matters)).count(),
        );
    }
}
