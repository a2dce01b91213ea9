//! The section on precision.

use std::fmt::Write;

use super::{Claim, Section};
use crate::simulate::image_study::Precision;

/// Largest rms in units of the bound.
const LARGEST_RATIO: f64 = 1.3;
/// Limits of the normalised error.
const HONEST: [f64; 2] = [0.9, 1.1];

/// What the study of precision says.
pub fn precision_section(study: &[Precision]) -> Section {
    let mut text = "Lattices of discs and annuli of one size, all in even light with even noise; errors of the outer centroids per axis. \
                    `formula` is `(n/C) sqrt(2 s / (sqrt(pi) r))`, generalised to any contour: everything but the position known, the marker \
                    large against the blur. `bound` is exact: the information in the derivatives of the blurred coverage, everything else known; \
                    of an annulus whose inner circle is measured for itself, that centre unknown. \
                    `normalised` is the rms error in units of the stated covariance.\n\n\
                    | radius px | blur px | contrast/noise | tilt deg | kind | found | of | rms px | / formula | / bound | normalised |\n\
                    |---|---|---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for p in study {
        let kind = if p.annuli { "annuli" } else { "discs" };
        let c = &p.cell;
        let _ = write!(
            text,
            "| {} | {} | {} | {} | {kind} | {} | {} |",
            c.radius_px, c.psf_sigma_px, c.contrast_to_noise, c.tilt_deg, p.markers, p.wanted
        );
        let _ = if p.markers == 0 {
            writeln!(text, " | | | |")
        } else {
            writeln!(text, " {:.5} | {:.2} | {:.2} | {:.2} |", p.rms_px, p.to_formula, p.to_bound, p.normalised)
        };
    }
    Section { title: "Precision".to_owned(), claims: claims(study), text, plots: Vec::new() }
}

fn claims(study: &[Precision]) -> Vec<Claim> {
    let seen: Vec<&Precision> = study.iter().filter(|p| p.markers > 0).collect();
    let markers: usize = seen.iter().map(|p| p.markers).sum();
    let pooled = |of: fn(&Precision) -> f64| {
        (seen.iter().map(|p| of(p).powi(2) * p.markers as f64).sum::<f64>() / markers.max(1) as f64).sqrt()
    };
    // the rms of a cell of m markers is itself uncertain by 1 / sqrt(4 m)
    let over = |of: fn(&Precision) -> f64| {
        seen.iter().filter(|p| of(p) > LARGEST_RATIO * (1.0 + 2.0 / (4.0 * p.markers as f64).sqrt())).count()
    };
    let ratio = |name: &str, of: fn(&Precision) -> f64| Claim {
        words: format!(
            "rms at most {LARGEST_RATIO} x the {name}: {:.2} over all markers; above it by more than two standard errors in {} of {} cells",
            pooled(of),
            over(of),
            seen.len()
        ),
        holds: over(of) == 0,
    };
    let normalised = pooled(|p| p.normalised);
    let empty = study.len() - seen.len();
    vec![
        ratio("exact bound", |p| p.to_bound),
        ratio("formula", |p| p.to_formula),
        Claim {
            words: format!(
                "normalised error between {} and {}: {normalised:.3} over all markers",
                HONEST[0], HONEST[1]
            ),
            holds: (HONEST[0]..=HONEST[1]).contains(&normalised),
        },
        Claim {
            words: format!("markers are identified and measured in every cell: none in {empty} of {}", study.len()),
            holds: empty == 0,
        },
    ]
}
