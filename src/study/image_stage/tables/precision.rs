//! The section on precision.

use std::fmt::Write;

use super::{Claim, Section, precision_plot};
use crate::plan::plate_design::LEAST_MINOR_AXIS_PX;
use crate::study::image_stage::{MAP_OFF_PX, Precision};

/// Largest rms in units of the bound.
const LARGEST_RATIO: f64 = 1.3;
/// Limits of the normalised error.
const HONEST: [f64; 2] = [0.9, 1.1];

/// What the study of precision says.
pub fn precision_section(study: &[Precision]) -> Section {
    let mut text = setup();
    text += "| radius px | blur px | contrast/noise | tilt deg | kind | designed for | pass | found | of | rms px | / formula | / bound | normalised |\n\
             |---|---|---|---|---|---|---|---|---|---|---|---|---|\n";
    for p in study {
        let kind = if p.annuli { "annuli" } else { "discs" };
        let c = &p.cell;
        let _ = write!(
            text,
            "| {} | {} | {} | {} | {kind} | {} | {} | {} | {} |",
            c.radius_px,
            c.psf_sigma_px,
            c.contrast_to_noise,
            c.tilt_deg,
            if c.is_designed_for() { "yes" } else { "no" },
            passes(p),
            p.markers,
            p.wanted
        );
        let _ = if p.markers == 0 {
            writeln!(text, " | | | |")
        } else {
            writeln!(text, " {:.5} | {:.2} | {:.2} | {:.2} |", p.rms_px, p.to_formula, p.to_bound, p.normalised)
        };
    }
    let plots = vec![("image-stage-precision.svg".to_owned(), precision_plot::plot(study, LARGEST_RATIO))];
    Section { title: "Precision".to_owned(), claims: claims(study), text, plots }
}

fn setup() -> String {
    format!(
        "Lattices of discs and annuli of one size, all in even light with even noise; errors of the outer centroids per axis. \
         `formula` is `(n/C) sqrt(2 s / (sqrt(pi) r))`, generalised to any contour: everything but the position known, the marker \
         large against the blur. `bound` is exact: the information in the derivatives of the blurred coverage, everything else known; \
         of an annulus whose inner circle is measured for itself, that centre unknown. \
         `normalised` is the rms error in units of the stated covariance.\n\n\
         `designed for`: `robotcal plate` designs plates for such a view, with a minor axis of {LEAST_MINOR_AXIS_PX} px and more; the others are measured all the \
         same. `pass`: 1 where the picture itself tells which marker is which. Where it does not (discs and annuli look alike when the blur is as large as their \
         radius, so that the code cannot be read), 2: the markers are measured where a map puts them that is known from elsewhere, as a pose from other \
         pictures or from the robot. That map is the true one, shifted by {MAP_OFF_PX} px in a random direction, with a random linear part on top that displaces \
         the outermost markers by up to as much; blur, noise and light are learned from the picture.\n\n"
    )
}

fn passes(p: &Precision) -> &'static str {
    match p.second_pass {
        0 => "1",
        n if n == p.markers => "2",
        _ => "1, 2",
    }
}

fn claims(study: &[Precision]) -> Vec<Claim> {
    let seen: Vec<&Precision> = study.iter().filter(|p| p.markers > 0).collect();
    let markers: usize = seen.iter().map(|p| p.markers).sum();
    let pooled = |of: fn(&Precision) -> f64| {
        (seen.iter().map(|p| of(p).powi(2) * p.markers as f64).sum::<f64>() / markers.max(1) as f64).sqrt()
    };
    // the rms of a cell of m markers is itself uncertain by 1 / sqrt(4 m)
    let is_over = |ratio: f64, p: &Precision| ratio > LARGEST_RATIO * (1.0 + 2.0 / (4.0 * p.markers as f64).sqrt());
    let over_bound = seen.iter().filter(|p| is_over(p.to_bound, p)).count();
    let over_formula: Vec<&&Precision> = seen.iter().filter(|p| is_over(p.to_formula, p)).collect();
    // where the contours are not large against the blur the formula promises what nobody can reach
    let unreachable = over_formula.iter().filter(|p| p.to_formula > LARGEST_RATIO * p.to_bound).count();
    let normalised = pooled(|p| p.normalised);
    let wanted: usize = study.iter().map(|p| p.wanted).sum();
    let missed = wanted - markers;
    let again = || study.iter().filter(|p| p.second_pass > 0);
    let (second, designed) = (again().count(), again().filter(|p| p.cell.is_designed_for()).count());
    vec![
        Claim {
            words: format!(
                "rms at most {LARGEST_RATIO} x the exact bound: {:.2} over all markers; above it by more than two standard errors in {over_bound} of {} cells",
                pooled(|p| p.to_bound),
                seen.len()
            ),
            holds: over_bound == 0,
        },
        Claim {
            words: format!(
                "rms at most {LARGEST_RATIO} x the formula where the exact bound is that low: {:.2} over all markers; above it by more than two standard errors \
                 in {} of {} cells, in {unreachable} of which the exact bound itself is above {LARGEST_RATIO} x the formula",
                pooled(|p| p.to_formula),
                over_formula.len(),
                seen.len()
            ),
            holds: over_formula.len() == unreachable,
        },
        Claim {
            words: format!(
                "normalised error between {} and {}: {normalised:.3} over all markers",
                HONEST[0], HONEST[1]
            ),
            holds: (HONEST[0]..=HONEST[1]).contains(&normalised),
        },
        Claim {
            words: format!(
                "markers are measured in every cell: {missed} of {wanted} are missed; {second} cells of {} need a second pass, {designed} of them of a size \
                 that plates are designed for",
                study.len()
            ),
            holds: study.iter().all(|p| p.markers > 0) && 100 * missed <= wanted,
        },
    ]
}
