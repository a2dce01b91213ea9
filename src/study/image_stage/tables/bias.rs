//! The section on bias.

use std::fmt::Write;

use super::{Claim, Section};
use crate::detect::circles::LOPSIDED_PX;
use crate::study::image_stage::{Bias, BiasCause, COMA_CONTRAST_TO_NOISE};

/// Largest distance to the true centroid that is allowed, px.
const LARGEST_BIAS_PX: f64 = 0.003;
/// Displacement that coma must have before it has to be told, px.
const COMA_TOLD_PX: f64 = 0.003;

/// What the study of bias says.
pub fn bias_section(study: &[Bias]) -> Section {
    let mut text = "Noise-free pictures of the standard plate, 16 bit; distances of the measured centroids of outer and inner \
                    circles from the true area centroid of the contour's image, for markers with a minor axis of 7 px and more. \
                    The column `projected centre` is the error of who takes that for the centroid.\n\n\
                    | case | blur px | radius px | markers | of | rms px | largest px | projected centre px |\n\
                    |---|---|---|---|---|---|---|---|\n"
        .to_owned();
    let (coma, plain): (Vec<&Bias>, Vec<&Bias>) =
        study.iter().partition(|b| matches!(b.case.cause, BiasCause::Coma { .. }));
    for b in &plain {
        let _ = writeln!(
            text,
            "| {} | {:.1} | {:.0} | {} | {} | {:.5} | {:.5} | {:.3} |",
            name(&b.case.cause),
            b.case.psf_sigma_px,
            b.case.radius_px,
            b.markers,
            b.wanted,
            b.rms_px,
            b.largest_px,
            b.projected_centre_px
        );
    }
    let _ = write!(
        text,
        "\nComa displaces centres, and no test on a single edge can undo it. Inner and outer circles are displaced by \
         nearly the same, so that their difference shows only strong coma; the lopsidedness of the edges shows it long before: \
         the fit takes a part of it for a displacement and leaves the rest in the residuals, which tells how much that was. It is told from \
         {LOPSIDED_PX} px in the corner on, where it is more than four standard errors. The last column is what a picture of these 504 markers with a contrast of \
         {COMA_CONTRAST_TO_NOISE} times the noise says, with its standard error: with probability 1/2 such a picture tells what is four times that error, with 98 % what is \
         six times; less is for the pictures of a series together to tell.\n\n\
         | tail in the corner px | blur px | largest bias px | inner - outer in the corner px | told by lopsided edges px | the same in noise px |\n\
         |---|---|---|---|---|---|\n"
    );
    for b in &coma {
        let BiasCause::Coma { corner_px } = b.case.cause else { continue };
        let noisy =
            b.lopsided_in_noise.map_or_else(String::new, |l| format!("{:.4} +- {:.4}", l.corner_px, l.corner_sigma_px));
        let _ = writeln!(
            text,
            "| {corner_px:.1} | {:.1} | {:.4} | {:.4} | {:.4} | {noisy} |",
            b.case.psf_sigma_px,
            b.largest_px,
            b.inner_outer.map_or(f64::NAN, |io| io.drift.corner_px),
            b.lopsided.map_or(f64::NAN, |l| l.corner_px)
        );
    }
    Section { title: "Bias".to_owned(), claims: claims(&plain, &coma), text, plots: Vec::new() }
}

fn claims(plain: &[&Bias], coma: &[&Bias]) -> Vec<Claim> {
    let largest = plain.iter().map(|b| b.largest_px).fold(0.0, f64::max);
    let missed: usize = plain.iter().map(|b| b.wanted - b.markers.min(b.wanted)).sum();
    let wanted: usize = plain.iter().map(|b| b.wanted).sum();
    let displaced: Vec<&&Bias> = coma.iter().filter(|b| b.largest_px > COMA_TOLD_PX).collect();
    let is_told = |b: &&&&Bias| {
        b.lopsided.is_some_and(|l| l.exceeds(LOPSIDED_PX)) || b.inner_outer.is_some_and(|io| io.asymmetric())
    };
    let told = displaced.iter().filter(is_told).count();
    vec![
        Claim {
            words: format!(
                "at most {LARGEST_BIAS_PX} px to the true centroid under a gradient of 0.5 %/px, in the corner of a wide-angle lens and \
                 close by: {largest:.4} px"
            ),
            holds: largest <= LARGEST_BIAS_PX,
        },
        Claim {
            words: format!("markers missed in these pictures: {missed} of {wanted}"),
            holds: 50 * missed <= wanted,
        },
        Claim {
            words: format!(
                "coma that displaces a centre by more than {COMA_TOLD_PX} px is told: {told} of {} pictures",
                displaced.len()
            ),
            holds: told == displaced.len(),
        },
    ]
}

fn name(cause: &BiasCause) -> String {
    match cause {
        BiasCause::Gradient { per_px, direction_deg } => {
            format!("{:.1} %/px at {direction_deg:.0} deg", 100.0 * per_px)
        }
        BiasCause::WideAngle { k1, field_deg } => format!("corner, k1 = {k1} at {field_deg:.0} deg"),
        BiasCause::Close { distance_m, tilt_deg } => format!("{distance_m} m, tilt {tilt_deg:.0} deg"),
        BiasCause::Coma { corner_px } => format!("coma of {corner_px} px"),
    }
}
